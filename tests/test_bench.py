"""Times that `bench` tells: that they are measured, and of the same numbers."""

import dataclasses
import functools
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.arrays import Matrix
from workbench.benchmark.calls import points
from workbench.benchmark.horizon import HorizonTimes, time_horizon
from workbench.benchmark.memory import peak_memory, watch_command
from workbench.benchmark.observers import (
    ObserverTimes,
    ProcessTimes,
    open_loop,
    plain_filters,
    resample,
)
from workbench.benchmark.tuning import (
    EvaluationTimes,
    TuningMemory,
    WorkerRates,
    evaluate_by_loop,
    format_tuning,
    observe_memory,
    time_evaluation,
    time_evaluations,
    time_workers,
    tuning_job,
)
from workbench.cli.schemas import summaries
from workbench.errors import InputError
from workbench.machines.wheelset.benchmark import LOOPS, by_fmpy
from workbench.machines.wheelset.benchmark.c_loop import CLoop
from workbench.models.compiler.benchmark import CallTimes, time_sources
from workbench.models.description import read_description
from workbench.observers import choose
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.recordings.case import Case
from workbench.system.registry import open_model

from .edits import edits
from .hostile_fmus import rewritten
from .processes import python

STEP = 0.005  # [s]


@pytest.fixture
def at(minimal, system) -> Matrix:
    return points(minimal, system, np.random.default_rng(1))


def timed(path: Path, at: Matrix) -> CallTimes:
    return time_sources(read_description(path), at, STEP)


def change_source(fmu: Path, changed: Path, name: str, right: str, wrong: str) -> Path:
    """Copy an FMU with other text in one of its sources."""
    return rewritten(fmu, changed, edits(f"sources/{name}", (right, wrong)))


def test_calls_of_the_minimal_model_take_nanoseconds(minimal_path, at):
    times = timed(minimal_path, at)
    assert (times.states, times.inputs) == (2, 6)
    # 50 operations and five elementary functions: no computer needs less than 5 ns. A step is
    # several evaluations, and a call of 1 ms would be one in another unit.
    assert 5e-9 < times.derivatives < times.step < 1e-3
    assert times.ratios() == {
        "derivatives": times.derivatives_fmi / times.derivatives,
        "jacobian": times.jacobian_fmi / times.jacobian,
    }


def test_what_importers_ask_at_each_step_takes_the_short_ways(minimal_path, tmp_path, at):
    """All inputs at once, and whole columns of the Jacobian: the long ways fail while it runs."""

    def block(text: str, function: str) -> str:
        head, body = text.split(f"{function}(", 1)
        parameters, body = body.split(") {", 1)
        fail = "if (i->state.phase == CONTINUOUS) return STATUS_ERROR;"
        return f"{head}{function}({parameters}) {{ {fail} {body}"

    def change(folder: Path) -> None:
        file = folder / "sources" / "instance.c"
        file.write_text(block(block(file.read_text(), "Status set_any"), "Status directional_any"))

    timed(rewritten(minimal_path, tmp_path / "short.fmu", change), at)


def test_the_schema_of_times_has_what_is_written_of_them():
    """A run of the command takes minutes; its file is made of these."""
    sections = summaries()["bench"]["properties"]
    observers, tuning = (sections[name]["properties"] for name in ("observers", "tuning"))
    beside = {"ratios", "unit", "steps_per_second"}
    for cls, schema in (
        (CallTimes, sections["calls"]["additionalProperties"]),
        (ObserverTimes, observers["steps"]["items"]),
        (ProcessTimes, observers["processes"]),
        (HorizonTimes, observers["horizon"]),
        (EvaluationTimes, tuning["evaluations"]["items"]),
        (WorkerRates, tuning["workers"]),
        (TuningMemory, tuning["memory"]),
    ):
        assert set(schema["properties"]) - beside == {
            field.name for field in dataclasses.fields(cls)
        }
        assert schema["required"] == list(schema["properties"])
        assert not schema["additionalProperties"]


def test_a_delay_in_the_interface_shows_in_the_ratio(minimal_path, tmp_path, at):
    slow = change_source(
        minimal_path,
        tmp_path / "slow.fmu",
        "fmi2.c",
        "    return (fmi2Status)instance_get_derivatives",
        "    for (volatile int n = 0; n < 1000; n++) {\n    }\n"
        "    return (fmi2Status)instance_get_derivatives",
    )
    # 1000 volatile increments take 200 ns or more, the plain call 30 to 100.
    assert timed(slow, at).ratios()["derivatives"] > 3.0


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("xdot[k] = source[k]", "xdot[k] = 1.0", "derivatives differ"),
        ("sensitivity[k] = zero", "sensitivity[k] = 1.0", "Jacobians differ"),
    ],
)
def test_an_interface_that_gives_other_numbers_is_refused(
    minimal_path, tmp_path, at, right, wrong, message
):
    changed = change_source(minimal_path, tmp_path / "wrong.fmu", "instance.c", right, wrong)
    with pytest.raises(InputError, match=rf"wrong\.fmu: found {message}"):
        timed(changed, at)


def test_sources_of_fmi_3_are_refused(root, tmp_path, at):
    path = tmp_path / "three.fmu"
    shutil.copyfile(root / "fmus" / "fmi3" / "MinimalObserver.fmu", path)
    with pytest.raises(InputError, match=r"C sources of FMI 2\.0 that compile"):
        timed(path, at)


@pytest.mark.parametrize("name", LOOPS)
def test_compiled_laws_agree_with_loops_written_in_numpy(system, dry_case, name):
    """Coasting, braking and standstill. 1e-9 of a column's largest value: rounding, grown 1e4."""
    samples = (dry_case.time, dry_case.u, dry_case.y)
    system = plain_filters(system)
    cls = choose(system, [name])[name]
    with open_model(system, cls.role) as fmu:
        gains = cls.default_gains(fmu, system)
        ours = cls(fmu, system, gains).run(*samples)
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
    ours = OpenLoop.untuned(minimal, system).run(*samples).values
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
    ours = DisturbanceObserver(minimal, system, gains).run(dry_case.time, dry_case.u, dry_case.y)
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


SAMPLES = slice(700, 1300)  # 3 s: first pressure and the beginning of the stop
MB = 1e6


@pytest.fixture(scope="module")
def case(dry_case) -> Case:
    return dry_case.part(SAMPLES)


def test_evaluations_by_the_tuning_and_by_fmpy_agree_and_are_timed(system, case):
    rows = time_evaluations(case, system)
    assert [row.estimator for row in rows] == ["disturbance_observer", "parameter_estimator"]
    for row in rows:
        assert row.steps == 600
        assert row.z > 0.0
        # 600 calls of four or more methods from Python, beside one of a compiled loop.
        assert row.fmpy > row.ours > 0.0
        assert row.ratios() == {"fmpy": row.fmpy / row.ours}


def test_times_of_evaluations_that_disagree_are_refused(system, case):
    """The other counts the force a millionth more."""
    job = tuning_job(DisturbanceObserver, system, [case])
    weights = {**system.objective.weights, "Fx": 1.000001e-3}
    heavier = replace(system, objective=replace(system.objective, weights=weights))
    with (
        open_model(system) as fmu,
        by_fmpy(job.estimator, fmu, system, job.gains) as loop,
        pytest.raises(ArithmeticError, match="not those of the same evaluation"),
    ):
        time_evaluation(job, functools.partial(evaluate_by_loop, loop, case, heavier))


def test_rates_of_workers_are_measured(system, case):
    rates = time_workers([case], system, candidates=4)
    assert (rates.cases, rates.candidates) == (1, 4)
    assert min(rates.one, rates.two) > 0.0
    assert rates.ratios()["two"] == rates.two / rates.one
    if find_spec("distributed"):
        assert rates.ratios()["dask"] == rates.dask / rates.two
    else:
        assert rates.dask is None


@pytest.mark.long
def test_memory_of_master_and_workers_is_measured(root, system, monkeypatch):
    monkeypatch.chdir(root)
    memory = observe_memory([root / "cases" / "03_dry_120_3.6"], system)
    # numba and its compiler alone take 80 MB in each.
    assert min(memory.master, memory.worker) > 80 * MB
    # A worker as large as the other within a fifth, and Python's process that clears up.
    assert memory.total > memory.master + 1.8 * memory.worker


def test_a_process_does_not_have_the_peak_of_the_one_that_started_it():
    """It does by `getrusage`."""
    ballast = np.ones(50_000_000)  # 400 MB
    run = python("-c", "from workbench.benchmark.memory import peak_memory; print(peak_memory())")
    assert peak_memory() > ballast.nbytes
    assert int(run.stdout) < 100 * MB


def test_a_watched_command_counts_with_what_it_starts():
    """100 MB in a process that lives for half a second, 25 looks, beside 200 MB in the first."""
    program = (
        "import subprocess, sys, time\n"
        "kept = b'x' * int(sys.argv[1])\n"
        "if len(sys.argv) > 2:\n"
        "    subprocess.run([sys.executable, '-c', sys.argv[2], '100000000'], check=True)\n"
        "time.sleep(0.5)\n"
    )
    peaks = watch_command([sys.executable, "-c", program, "200000000", program])
    assert len(peaks) == 2
    # Python itself takes 10 MB.
    assert 200 * MB < peaks[0] < 230 * MB
    assert 100 * MB < peaks[1] < 130 * MB
    with pytest.raises(subprocess.CalledProcessError, match="status 3"):
        watch_command([sys.executable, "-c", "raise SystemExit(3)"])


def test_the_table_has_the_ratios_and_says_what_was_not_measured():
    evaluations = [EvaluationTimes("disturbance_observer", 6233, 0.003, 0.45, 0.1)]
    memory = TuningMemory(master=290_000_000, worker=270_000_000, total=840_000_000)
    rates = WorkerRates(cases=14, candidates=60, one=15.0, two=28.5, dask=27.0)
    table = format_tuning(evaluations, rates, memory)
    for text in ("150x", "1.90 times as many", "0.95 times as many", "840 MB in all processes"):
        assert text in table
    assert "no package 'distributed'" in format_tuning(
        evaluations, replace(rates, dask=None), memory
    )
