"""Scores against closed forms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from workbench.observers import choose
from workbench.observers.run import Ending, Run
from workbench.observers.score import judged_window, low_pass, score
from workbench.observers.simulation import prepare
from workbench.recordings.case import Case, read_cases
from workbench.system.system import System
from workbench.tuning.cost import evaluators
from workbench.tuning.recipe import evaluate_gains, pose

from . import heater
from .built import declare, machine


def stop(Fx: np.ndarray | None, step: float = 0.005) -> Case:
    """A recording of 20 s: brake on at 5 s, below 1 m/s from 15 s on."""
    t = np.arange(0.0, 20.0, step)
    signals = {
        "pB": np.where(t >= 5.0, 2e5, 0.0),
        "tauR": np.zeros_like(t),
        "omegaW": np.zeros_like(t),
        "omegaR": np.where(t < 15.0, 2.0, 1.0),
    }
    return Case(
        name="stop",
        title="stop",
        conditions={},
        time=t,
        signals=signals if Fx is None else {**signals, "Fx": Fx},
        inputs=("pB", "tauR"),
        outputs=("omegaW", "omegaR"),
        source=Path("stop"),
    )


def run_of(system: System, case: Case, **signals: np.ndarray) -> Run:
    nothing = np.full(case.time.size, np.nan)
    return Run(
        case="stop",
        estimator="test",
        columns=system.columns,
        time=case.time,
        estimate=np.column_stack([signals.get(name, nothing) for name in system.columns]),
        sigma=np.column_stack([nothing] * len(system.columns)),
        nis=nothing,
        ending=Ending.OK,
        message="",
        seconds=0.0,
        claimed={},
    )


@pytest.fixture
def constant() -> Case:
    n = stop(None).time.size
    return stop(np.full(n, -12e3))


def test_a_gain_error_is_its_own_nrmse(system, constant):
    result = score(constant, run_of(system, constant, Fx=1.03 * constant["Fx"]), system)
    assert_allclose(result.nrmse, 0.03, rtol=1e-12)
    assert_allclose(result.rms, 360.0, rtol=1e-12)


def test_only_braking_counts(system, constant):
    """The window runs from first pressure (5 s) to the last sample above 1 m/s (15 s)."""
    window = judged_window(constant, system)
    assert_allclose([constant.time[window.start], constant.time[window.stop - 1]], [5.0, 14.995])
    outside = (constant.time < 4.0) | (constant.time > 16.0)
    result = score(constant, run_of(system, constant, Fx=constant["Fx"] + 5e3 * outside), system)
    # What the zero-phase filter carries over one second at 5 Hz is far below 1e-6.
    assert result.nrmse < 1e-6


def test_ringing_of_the_load_cell_does_not_count(system, constant):
    ringing = 1000.0 * np.sin(2 * np.pi * 21.6 * constant.time)
    result = score(constant, run_of(system, constant, Fx=constant["Fx"] + ringing), system)
    # Butterworth of order 2, forward and backward: (5/21.6)^4 = 0.3 % of 1 kN over 12 kN.
    assert result.nrmse < 0.003 / np.sqrt(2) * 1000 / 12e3 * 1.1


def test_the_filter_shifts_no_phase():
    t = np.arange(0.0, 10.0, 0.005)
    wave = np.sin(2 * np.pi * 0.5 * t)
    inner = slice(400, -400)
    # Gain at a tenth of the bandwidth: 1/(1 + 1e-4).
    assert_allclose(low_pass(t, wave, 5.0)[inner], wave[inner] / (1 + 1e-4), atol=1e-4)


def test_z_is_the_weighted_mean_of_absolute_errors(system, constant):
    """Reference: equation (12) for constant errors."""
    run = run_of(
        system,
        constant,
        Fx=constant["Fx"] + 500.0,
        omegaW=constant["omegaW"] + 0.2,
        omegaR=constant["omegaR"] - 0.1,
    )
    weights = {"omegaW": 2.0, "omegaR": 3.0, "Fx": 1e-3}
    weighed = replace(system, objective=replace(system.objective, weights=weights))
    assert_allclose(score(constant, run, weighed).z, 2 * 0.2 + 3 * 0.1 + 0.5, rtol=1e-12)


def test_without_measured_force_there_is_no_score_but_a_reason(system):
    case = stop(None)
    result = score(case, run_of(system, case, Fx=np.zeros(case.time.size)), system)
    assert (result.rms, result.nrmse, result.z) == (None, None, None)
    assert "no Fx" in result.reason


def test_uneven_samples_give_the_same_score(system):
    """A signal below 1 Hz is known as well from samples with 20 % jitter."""
    rng = np.random.default_rng(3)
    even = stop(None)
    t = even.time + rng.uniform(-0.001, 0.001, even.time.size)
    scores = []
    for time in (even.time, t):
        force = 1e4 * (1 + 0.3 * np.sin(2 * np.pi * 0.3 * time))
        case = replace(stop(force), time=time)
        error = 200.0 * np.sin(2 * np.pi * 0.8 * time)
        scores.append(score(case, run_of(system, case, Fx=force + error), system).nrmse)
    # Interpolation to the even grid: curvature * h^2 / 8 = 1e-4 of the error.
    assert_allclose(scores[1], scores[0], rtol=1e-3)


def test_a_sensor_that_rectifies_is_scored_by_its_reading(tmp_path):
    """A block that is heated and cooled in turn; the sensor reads how far it is off.

    The recording is the model's own, so that its free run errs by the noise alone. By the state,
    it would err by twice the temperature wherever the block is cold.
    """
    folder = tmp_path / "block"
    output = '  output Real reading(unit="K") = abs(T) "As read";\n'
    library, file = machine("heater", sensor='reading = "reading"')
    library = library.replace("    Real Tc(", f"  {output}    Real Tc(")
    block = declare(folder, library, f'{file}\n[objective]\njudged = "T"\n')
    time = np.arange(600.0)
    power = 60.0 * np.sign(np.sin(2.0 * np.pi * time / 200.0 + 0.1))

    def rates(t: float, x: np.ndarray) -> list[float]:
        T, casing = x
        P = power[min(int(t), 599)]
        return [(P - 2.0 * (T - casing)) / 100.0, (2.0 * (T - casing) - 0.5 * casing) / 200.0]

    run = solve_ivp(rates, (0.0, 599.0), [0.0, 0.0], t_eval=time, max_step=1.0, rtol=1e-8)
    noise = heater.NOISE * np.random.default_rng(1).standard_normal(time.size)
    assert run.y[0].min() < -5.0
    frame = pd.DataFrame({"time [s]": time, "P [W]": power, "T [K]": np.abs(run.y[0]) + noise})
    (case,) = heater.cases(block, [frame])
    result = prepare(block, choose(block, ["open_loop"])).run(case)
    score = result.scores["open_loop"]
    assert score.rms < 2.0 * heater.NOISE  # inputs change between samples of a second
    error = result.error("open_loop")
    assert np.sqrt(np.mean(error**2)) == pytest.approx(score.rms, rel=0.01)


def test_tuning_and_simulation_have_one_z(system, root):
    """Of the same gains on the same recording, to all digits."""
    cases = read_cases([root / "cases" / "08_wet_120_3.6"], system)
    problem = pose(system, "ekf", cases, scale_errors={})
    with evaluators(problem.job, 1) as pool:
        ((tuned,),) = evaluate_gains(pool, problem.job, [problem.job.gains.values])
    simulated = prepare(system, choose(system, ["ekf"]), tuned=False).run(cases[0])
    assert simulated.scores["ekf"].z == tuned
