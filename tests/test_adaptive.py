"""Noise levels that follow innovations: what filters learn, leave out, and follow."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from workbench.arrays import Vector
from workbench.models.fmu import FMU
from workbench.observers import Estimate, estimators_of
from workbench.observers.estimators import kalman
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.estimators.moving_horizon.estimator import MovingHorizonEstimator
from workbench.observers.estimators.unscented import UnscentedKalmanFilter
from workbench.observers.replay import replay
from workbench.observers.run import Run
from workbench.observers.score import judged_window
from workbench.recordings.case import read_cases
from workbench.system.system import System

from .systems import WHEELSET

ROOT = Path(__file__).parent.parent
FILTERS = ("ekf", "ukf", "imm", "mhe")
KINDS = (ExtendedKalmanFilter, UnscentedKalmanFilter, MovingHorizonEstimator)
STEP, BRAKING = 0.005, 2.7e5  # [s], [Pa]


def stop(fmu: FMU, muDC: Vector, noise: float = 1.0, seed: int = 5) -> tuple[np.ndarray, ...]:
    """Time, inputs and outputs of a wheelset that brakes at 2.7 bar, with friction by sample.

    Parameters
    ----------
    noise : of both speeds, over what the system file says.
    """
    rng = np.random.default_rng(seed)
    speed = 40.0
    fmu.start({"omegaR": speed / 0.70, "omegaW": speed / 0.46}, {"muWR": 0.40})
    inputs = fmu.variables(["pB", "tauR", "dmuDC"])
    rows = []
    for friction in muDC:
        fmu.set(inputs, np.array([BRAKING, 8e3, friction - fmu.defaults["muDC"]]))
        rows.append(fmu.get_states())
        fmu.step(STEP)
    y = np.array(rows)[:, [fmu.states.index(name) for name in ("omegaW", "omegaR")]]
    deviation = np.array([0.002, 0.003]) + np.abs(y) * [1e-3, 0.0]
    y = y + noise * deviation * rng.standard_normal(y.shape)
    u = np.tile([BRAKING, 8e3], (len(y), 1))
    return np.arange(len(y)) * STEP, u, y


def estimate(fmu: FMU, cls: type[ExtendedKalmanFilter], system: System, *stop: Vector) -> Estimate:
    return cls.untuned(fmu, system).run(*stop)


MUDC = list(WHEELSET.columns).index("muDC")


@pytest.mark.parametrize("cls", KINDS)
@pytest.mark.parametrize("noise", [0.3, 1.0, 3.0])
def test_noise_of_sensors_is_learnt(fmu, cls, noise):
    """After ten times the time for it, innovations are as large as the filter says."""
    estimates = estimate(fmu, cls, WHEELSET, *stop(fmu, np.full(5000, 0.30), noise))
    nis = np.asarray(estimates.nis)[4000:]
    # Mean of 1000 samples of two outputs: chance makes 2 +- 0.06, levels know 4 % of a deviation.
    assert nis.mean() == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("cls", KINDS)
def test_a_friction_that_stays_is_known_the_better_the_longer(fmu, cls):
    held = replace(WHEELSET, learns=np.inf)
    samples = stop(fmu, np.full(6000, 0.30))
    learnt, assumed = (estimate(fmu, cls, system, *samples) for system in (WHEELSET, held))
    assert learnt.sigma[-1, MUDC] < 0.4 * assumed.sigma[-1, MUDC]
    late = np.abs(learnt.values[3000:, MUDC] - 0.30)
    assert np.mean(late < 2.0 * learnt.sigma[3000:, MUDC]) > 0.9


@pytest.mark.parametrize("cls", KINDS)
def test_a_friction_that_moves_again_is_followed(fmu, cls):
    """Still for 15 s, then 0.1 in 5 s, as on a drying disc: the band opens, and holds it."""
    moving = np.concatenate([np.full(3000, 0.20), np.linspace(0.20, 0.30, 1000)])
    estimates = estimate(fmu, cls, WHEELSET, *stop(fmu, moving))
    error = np.abs(estimates.values[:, MUDC] - moving)[3200:]
    assert error.max() < 0.01
    assert np.mean(error < 2.0 * estimates.sigma[3200:, MUDC]) > 0.8


@pytest.mark.parametrize("cls", KINDS[:2])  # the window gives it less weight instead
def test_a_single_wrong_sample_is_left_out(fmu, cls):
    time, u, y = stop(fmu, np.full(3000, 0.30))
    spoilt = y.copy()
    spoilt[2000] *= 1.5
    clean, estimates = (estimate(fmu, cls, WHEELSET, time, u, readings) for readings in (y, spoilt))
    # One sample less is known: a small part of a deviation.
    moved = np.abs(estimates.values - clean.values)[1999:]
    assert (moved < 0.5 * np.maximum(clean.sigma, 1e-9)[1999:]).all()


@pytest.mark.parametrize(
    ("cls", "within", "limit"),
    [(KINDS[0], 0.3, 0.02), (KINDS[1], 0.3, 0.02), (KINDS[2], 0.7, 0.03)],
)
def test_a_jump_of_a_friction_is_followed_at_once(fmu, cls, within, limit):
    """Pads lose half their friction between two samples; held levels take a second to follow.

    The window first takes some of its samples for outliers, and is ready for more jumps after one.
    """
    jumping = np.concatenate([np.full(3000, 0.40), np.full(400, 0.20)])
    estimates = estimate(fmu, cls, WHEELSET, *stop(fmu, jumping, 0.3))
    error = np.abs(estimates.values[:, MUDC] - jumping)
    assert error[3000 + round(within / STEP) :].max() < limit


@pytest.fixture(scope="module")
def runs(fmu, once) -> dict[str, list[tuple[slice, Run]]]:
    cases, known = read_cases([ROOT / "cases"], WHEELSET), estimators_of(WHEELSET)

    def run(name: str) -> list[tuple[slice, Run]]:
        ready = known[name].untuned(fmu, WHEELSET)
        return [(judged_window(case, WHEELSET), replay(case, ready)) for case in cases]

    return once("filters on the rig", lambda _: {name: run(name) for name in FILTERS})


@pytest.mark.parametrize("name", FILTERS)
def test_innovations_on_the_rig_are_as_large_as_filters_say(runs, name):
    """Chi-squared with two degrees of freedom: its mean, and its 95 % bound."""
    nis = np.concatenate([run.nis[window] for window, run in runs[name]])
    # Levels lag by two seconds behind speeds that fall, whose noise falls with them.
    assert nis.mean() == pytest.approx(2.0, abs=0.1)
    assert np.mean(nis < chi2.ppf(0.95, 2)) == pytest.approx(0.95, abs=0.01)


def test_one_sample_speaks_for_three_standard_deviations_at_most():
    """Else a wrong sample that is still possible would widen all bands after it."""
    levels = kalman.levels(2, 1)
    kalman.reset(levels)
    noise, explained = 4.0, 5.0  # variances; an innovation scatters by 3
    scatters = []
    for innovation in (3.0, 9.0, 90.0):
        kalman.note(levels, 0, innovation, explained, noise)
        scatters.append(levels.scatter[0])
    assert scatters == pytest.approx([1.0, (81.0 - 5.0) / 4.0, (81.0 - 5.0) / 4.0])
