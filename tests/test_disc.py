"""The physical trend of disc-pad friction: null, closed forms, and what it is good for."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.machines.wheelset.estimators.disc import DiscModel, DiscObserver
from workbench.models.fmu import FMU
from workbench.observers import Estimator, Gains
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.replay import replay
from workbench.observers.run import Ending, Run
from workbench.observers.score import score
from workbench.recordings.case import Case, read_case
from workbench.system.system import System

RR, RB, NOMINAL = 0.70, 0.30, 0.30


@pytest.fixture(scope="module")
def fmu(minimal_path) -> Iterator[FMU]:
    with FMU(minimal_path) as opened:
        yield opened


@pytest.fixture(scope="module")
def gains(fmu, system) -> Gains:
    return DisturbanceObserver.default_gains(fmu, system)


def slowed(gains: Gains, share: float) -> Gains:
    """A share of the feedback on muDC; the wheelset still follows its measured speed."""
    values = gains.values.copy()
    values[12:16] *= share
    return gains.with_values(values)


def without_feedback(fmu: FMU, system: System, gains: Gains, case: Case, disc: DiscModel) -> Run:
    run = replay(case, DiscObserver(fmu, system, slowed(gains, 0.0), disc))
    assert run.ending is Ending.OK
    return run


def column(system: System, name: str) -> int:
    return list(system.columns).index(name)


def test_a_trend_of_zero_size_is_the_constant_bit_for_bit(fmu, system, gains, dry_case):
    """The disc warms, but neither speed nor temperature matters to friction."""
    zero = DiscModel(slope=0.0, fade=0.0)
    observers: list[Estimator] = [
        DisturbanceObserver(fmu, system, gains),
        DiscObserver(fmu, system, gains, zero),
    ]
    runs = [replay(dry_case, observer) for observer in observers]
    assert runs[0].ending is Ending.OK
    assert_array_equal(runs[0].estimate, runs[1].estimate)


def test_the_two_observers_can_be_told_apart_by_name(fmu, system, gains):
    names = [kind(fmu, system, gains).name for kind in (DisturbanceObserver, DiscObserver)]
    assert names == ["disturbance_observer", "disturbance_observer_disc"]


@pytest.mark.parametrize("name", ["03_dry_120_3.6", "05_dry_120_2.7_rev"])
def test_without_feedback_friction_follows_the_law_of_speed(root, fmu, system, gains, name):
    """Reference: muDC = 0.30 (1 + slope (1 - v/speed)), in both directions."""
    case = read_case(root / "cases" / name, system)
    run = without_feedback(fmu, system, gains, case, DiscModel(slope=0.2, fade=0.0, speed=22.0))
    law = NOMINAL * (1.0 + 0.2 * (1.0 - RR * np.abs(run.signal("omegaR")) / 22.0))
    # The law takes the speed of the sample before; the rest is rounding of 8000 additions.
    assert_allclose(run.signal("muDC")[1:], law[:-1], atol=1e-11, rtol=0.0)
    assert np.ptp(law) > 0.05


def test_without_feedback_friction_fades_with_the_energy_of_the_brake(fmu, system, gains, dry_case):
    """Reference: warming is share * energy / capacity without cooling; brake as in the nominal
    plant, three discs, 10.86 kN/bar above 0.25 bar."""
    fade, capacity, share = 1e-3, 1.2e5, 0.9
    disc = DiscModel(
        slope=0.0,
        fade=fade,
        temperature=20.0,
        ambient=20.0,
        capacity=capacity,
        share=share,
        cooling=0.0,
    )
    run = without_feedback(fmu, system, gains, dry_case, disc)
    press = 10.86e3 * np.maximum(0.0, dry_case["pB"] / 1e5 - 0.25)
    omegaW = run.signal("omegaW")
    power = 3 * RB * run.signal("muDC") * press * np.abs(omegaW * np.tanh(omegaW / 0.05))
    energy = np.append(0.0, np.cumsum(power[:-1] * np.diff(dry_case.time)))
    law = NOMINAL * (1.0 - fade * share * energy / capacity)
    # The pressure sensor's noise and one sample of 300 kW: 1.5 kJ of 9 MJ.
    assert_allclose(run.signal("muDC"), law, atol=2e-3 * (NOMINAL - law.min()))
    assert NOMINAL - law.min() > 0.01


def test_a_disc_cools_to_the_air_with_its_time_constant(fmu, system, gains, dry_case):
    """Reference: T - ambient falls by exp(-cooling t/capacity) at rest without pressure."""
    disc = DiscModel(slope=0.0, fade=1e-3, temperature=20.0, capacity=2e5, cooling=1e4)
    observer = DiscObserver(fmu, system, slowed(gains, 0.0), disc)
    y, pressed = np.array([80.0, 80.0 * 0.46 / RR]), np.array([4e5, 0.0])
    observer.init(0.0, pressed, y)
    # The heat of a step is that of the pressure at the sample before it.
    for t in (1.0, 2.0):
        observer.step(t, pressed, y)
    muDC = column(system, "muDC")
    warmth = [
        NOMINAL - observer.step(2.0 + 0.01 * k, np.zeros(2), y).values[muDC] for k in range(1, 2002)
    ]
    assert warmth[0] > 1e-4
    # Explicit Euler with h/tau = 0.01/20 over one time constant: relative error 1e-3/4.
    assert_allclose(warmth[2000] / warmth[0], np.exp(-1.0), rtol=1e-3)


def test_what_was_learned_decays_towards_the_law_not_towards_the_constant(
    fmu, system, gains, dry_case
):
    """At rest the law of speed says 0.30 (1 + slope); a decay of 2/s forgets all else in 10 s."""
    values = gains.values.copy()
    values[gains.names.index("T_muDC")] = -2.0
    disc = DiscModel(slope=0.25, fade=0.0)
    observer = DiscObserver(fmu, system, gains.with_values(values), disc)
    observer.run(dry_case.time, dry_case.u, dry_case.y)
    nothing, end = np.zeros(2), dry_case.time[-1]
    observer.step(end, dry_case.u[-1], nothing)
    for k in range(1, 1001):
        muDC = observer.step(end + 0.01 * k, nothing, nothing).values[column(system, "muDC")]
    # exp(-20) of what was learned, and a wheelset that creeps at some mm/s.
    assert muDC == pytest.approx(0.375, abs=1e-4)


@pytest.mark.parametrize("name", ["03_dry_120_3.6", "05_dry_120_2.7_rev"])
def test_slow_feedback_errs_half_as_much_with_the_trend(root, fmu, system, gains, name):
    """A thirtieth of the gain on muDC cannot follow the rise of friction; the textbook trend can.

    Measured: 0.60 to 0.23 % in case 03, 0.59 to 0.28 % in case 05; half is asked.
    """
    case = read_case(root / "cases" / name, system)
    slow = slowed(gains, 0.03)
    constant, physical = (
        score(case, replay(case, kind(fmu, system, slow)), system).nrmse
        for kind in (DisturbanceObserver, DiscObserver)
    )
    assert physical < 0.5 * constant
