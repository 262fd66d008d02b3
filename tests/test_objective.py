"""Scores against closed forms."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.case import Case
from workbench.cosim import Outcome, Run
from workbench.objective import Weights, braking_window, low_pass, score
from workbench.observers import ESTIMATE

RR = 0.70


def stop(Fx: np.ndarray | None, step: float = 0.005) -> Case:
    """A recording of 20 s: brake on at 5 s, below 1 m/s from 15 s on."""
    t = np.arange(0.0, 20.0, step)
    omegaR = np.where(t < 15.0, 2.0, 1.0)
    return Case(
        name="stop",
        title="stop",
        conditions=None,  # type: ignore[arg-type]
        time=t,
        pB=np.where(t >= 5.0, 2e5, 0.0),
        tauR=np.zeros_like(t),
        omegaW=np.zeros_like(t),
        omegaR=omegaR,
        Fx=Fx,
        source=Path("stop"),
    )


def run_of(case: Case, **signals: np.ndarray) -> Run:
    estimate = np.full((case.time.size, len(ESTIMATE)), np.nan)
    for name, values in signals.items():
        estimate[:, list(ESTIMATE).index(name)] = values
    nothing = np.full_like(estimate, np.nan)
    nis, claimed = nothing[:, 0], np.zeros(case.time.size, bool)
    return Run("stop", "test", case.time, estimate, nothing, nis, Outcome.OK, "", 0.0, claimed)


@pytest.fixture
def constant() -> Case:
    n = stop(None).time.size
    return stop(np.full(n, -12e3))


def test_a_gain_error_is_its_own_nrmse(constant: Case) -> None:
    judged = score(constant, run_of(constant, Fx=1.03 * constant.Fx), RR, Weights())
    assert_allclose(judged.Fx_nrmse, 0.03, rtol=1e-12)
    assert_allclose(judged.Fx_rms, 360.0, rtol=1e-12)


def test_only_braking_counts(constant: Case) -> None:
    """The window runs from first pressure (5 s) to the last sample above 1 m/s (15 s)."""
    window = braking_window(constant, RR)
    assert_allclose([constant.time[window.start], constant.time[window.stop - 1]], [5.0, 14.995])
    outside = (constant.time < 4.0) | (constant.time > 16.0)
    judged = score(constant, run_of(constant, Fx=constant.Fx + 5e3 * outside), RR, Weights())
    # What the zero-phase filter carries over one second at 5 Hz is far below 1e-6.
    assert judged.Fx_nrmse is not None
    assert judged.Fx_nrmse < 1e-6


def test_ringing_of_the_load_cell_does_not_count(constant: Case) -> None:
    ringing = 1000.0 * np.sin(2 * np.pi * 21.6 * constant.time)
    judged = score(constant, run_of(constant, Fx=constant.Fx + ringing), RR, Weights())
    # Butterworth of order 2, forward and backward: (5/21.6)^4 = 0.3 % of 1 kN over 12 kN.
    assert judged.Fx_nrmse is not None
    assert judged.Fx_nrmse < 0.003 / np.sqrt(2) * 1000 / 12e3 * 1.1


def test_the_filter_shifts_no_phase() -> None:
    t = np.arange(0.0, 10.0, 0.005)
    wave = np.sin(2 * np.pi * 0.5 * t)
    inner = slice(400, -400)
    # Gain at a tenth of the bandwidth: 1/(1 + 1e-4).
    assert_allclose(low_pass(t, wave)[inner], wave[inner] / (1 + 1e-4), atol=1e-4)


def test_z_is_the_weighted_mean_of_absolute_errors(constant: Case) -> None:
    """Reference: equation (12) for constant errors."""
    run = run_of(
        constant,
        Fx=constant.Fx + 500.0,
        omegaW=constant.omegaW + 0.2,
        omegaR=constant.omegaR - 0.1,
    )
    weights = Weights(cW=2.0, cR=3.0, cF=1e-3)
    assert_allclose(score(constant, run, RR, weights).z, 2 * 0.2 + 3 * 0.1 + 0.5, rtol=1e-12)


def test_without_measured_force_there_is_no_score_but_a_reason() -> None:
    case = stop(None)
    judged = score(case, run_of(case, Fx=np.zeros(case.time.size)), RR, Weights())
    assert (judged.Fx_rms, judged.Fx_nrmse, judged.z) == (None, None, None)
    assert "no Fx" in judged.reason


def test_uneven_samples_give_the_same_score() -> None:
    """A signal below 1 Hz is known as well from samples with 20 % jitter."""
    rng = np.random.default_rng(3)
    even = stop(None)
    t = even.time + rng.uniform(-0.001, 0.001, even.time.size)
    scores = []
    for time in (even.time, t):
        force = 1e4 * (1 + 0.3 * np.sin(2 * np.pi * 0.3 * time))
        case = Case(**{**stop(force).__dict__, "time": time})
        error = 200.0 * np.sin(2 * np.pi * 0.8 * time)
        scores.append(score(case, run_of(case, Fx=force + error), RR, Weights()).Fx_nrmse)
    # Interpolation to the even grid: curvature * h^2 / 8 = 1e-4 of the error.
    assert_allclose(scores[1], scores[0], rtol=1e-3)
