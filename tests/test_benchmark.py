"""The loops that observers are measured against give the same estimates as the compiled laws."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.benchmark.horizon import time_horizon
from workbench.benchmark.observers import plain_filters, resample
from workbench.benchmark.other_loops import open_loop
from workbench.machines.wheelset.benchmark import LOOPS, by_fmpy
from workbench.machines.wheelset.benchmark.c_loop import CLoop
from workbench.observers import choose
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.system.registry import open_model


@pytest.mark.parametrize("name", LOOPS)
def test_compiled_laws_agree_with_loops_written_in_numpy(system, dry_case, name):
    """Coasting, braking and standstill. 1e-9 of a column's largest value: rounding, grown 1e4."""
    samples = (dry_case.time, dry_case.u, dry_case.y)
    system = plain_filters(system)
    kind = choose(system, [name])[name]
    with open_model(system, kind.role) as fmu:
        gains = kind.default_gains(fmu, system)
        ours = kind(fmu, system, gains).run(*samples)
        with by_fmpy(name, fmu, system, gains) as loop:
            theirs = loop(*samples)
    scale = np.abs(theirs.values).max(axis=0)
    assert_allclose(ours.values / scale, theirs.values / scale, rtol=0, atol=1e-9)
    if name in ("ekf", "ukf"):
        # Fx near standstill: a small difference of large covariances, hence of the largest sigma.
        largest = theirs.sigma.max(axis=0)
        assert_allclose(ours.sigma / largest, theirs.sigma / largest, rtol=0, atol=1e-6)
        assert_allclose(ours.nis, theirs.nis, rtol=1e-6, atol=1e-8)


def test_the_model_alone_goes_the_same_way_by_fmpy(system, minimal, dry_case):
    """Coasting, braking and standstill, as above."""
    samples = (dry_case.time, dry_case.u, dry_case.y)
    ours = OpenLoop(minimal, system, OpenLoop.default_gains(minimal, system)).run(*samples).values
    with open_loop(minimal, system) as loop:
        theirs = loop(*samples)
    columns = list(system.columns)
    read = [output.name for output in system.outputs] + list(system.reported)
    ours = ours[:, [columns.index(name) for name in read]]
    scale = np.abs(theirs).max(axis=0)
    assert_allclose(ours / scale, theirs / scale, rtol=0, atol=1e-9)


def test_plain_c_gives_the_same_bits_as_the_compiled_law(system, minimal, dry_case):
    """Same arithmetic in the same order, and neither compiler may contract or reorder it."""
    gains = DisturbanceObserver.default_gains(minimal, system)
    observer = DisturbanceObserver(minimal, system, gains)
    ours = observer.run(dry_case.time, dry_case.u, dry_case.y)
    theirs = CLoop(minimal, system, gains).run(dry_case.time, dry_case.u, dry_case.y)
    assert_array_equal(ours.values, theirs)


def test_resampling_keeps_the_recorded_samples(dry_case):
    """Of five samples at 1 kHz, the first is one recorded at 200 Hz, up to rounding of times."""
    _, u, y = resample(dry_case, 1000.0)
    assert_allclose(u[::5], dry_case.u[: len(u[::5])], rtol=1e-9, atol=1e-6)
    assert_allclose(y[::5], dry_case.y[: len(y[::5])], rtol=1e-9, atol=1e-9)


def test_a_sample_of_the_moving_horizon_takes_a_twentieth_of_the_same_problem_in_ipopt(
    system, dry_case
):
    """That both find the same cost is part of the measurement; it takes about a thousandth."""
    times = time_horizon(dry_case, system)
    assert (times.unknowns, times.samples) == (4, 20)
    assert times.ratios()["ipopt"] > 20.0
