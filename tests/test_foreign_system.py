"""A machine that nobody here knows runs on its own description: two tanks, of which one leaks.

Its only measured output is no state of the model: a level sensor's voltage, with gain and offset.
Recordings are made from other equations, by SciPy.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import lxml.html
import numpy as np
import pandas as pd
import pytest
from numpy.linalg import inv
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.observers import Estimator, choose, estimators_of
from workbench.observers.replay import replay
from workbench.observers.run import Ending, Run
from workbench.observers.score import score
from workbench.recordings.case import Case, read_case
from workbench.system.registry import open_model
from workbench.system.system import System

from .built import declare, machine
from .linear import exact_step, with_steps

CASE = 'title = "Pump on and off"\nmeasurement.file = "measured.csv"\n'

AREA, PIPE, DRAIN = 0.5, 2e-3, 1e-3  # as in the model
STEP, END, OPENS, SETTLED = 2.0, 6000.0, 2400.0, 4800.0  # [s]
BEFORE, AFTER = 1e-4, 2.5e-4  # [m3/s] of the leak, which opens
ESTIMATORS = ("disturbance_observer", "parameter_estimator", "ekf", "arrow", "ukf", "mhe", "imm")
ESTIMATORS += ("smoother",)


def pump(t: float) -> float:
    """Inflow [m3/s], which comes in turns of 20 min."""
    return 1.2e-3 if t % 1200.0 < 600.0 else 0.9e-3


def simulated(seed: int) -> pd.DataFrame:
    """Recording of tanks that are not as full as the model starts, by other equations."""

    # Of the volumes, from the inflow and the leak.
    A = np.array([[-PIPE, PIPE], [PIPE, -PIPE - DRAIN]]) / AREA
    Phi, G, _ = exact_step(A, [[1.0, 0.0], [0.0, -1.0]], STEP)
    time = np.arange(0.0, END + STEP, STEP)
    v, rows = np.array([0.9, 0.7]) * AREA, []
    for t in time:
        rows.append(v)
        # An observer takes an input for that of the step to its sample.
        v = Phi @ v + G @ [pump(t), AFTER if t >= OPENS else BEFORE]
    level = np.array(rows)[:, 1] / AREA
    rng = np.random.default_rng(seed)
    before = np.append(0.0, time[:-1])
    return pd.DataFrame(
        {
            "time [s]": time,
            "pump [m3/s]": [pump(t) for t in before],
            "reading [V]": 2.0 * level + 0.4 + 0.005 * rng.standard_normal(time.size),
            "outflow [m3/s]": DRAIN * level + 1e-5 * rng.standard_normal(time.size),
        }
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """All that a user writes: library, system file and recordings; and the compiled model."""
    folder = tmp_path_factory.mktemp("tanks")
    for seed, name in enumerate(("01_first", "02_second")):
        (folder / "cases" / name).mkdir(parents=True)
        (folder / "cases" / name / "case.toml").write_text(CASE)
        simulated(seed).to_csv(folder / "cases" / name / "measured.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def tanks(folder) -> System:
    return declare(folder, *machine("two_tanks"), Tanks="Water.Tanks")


@pytest.fixture(scope="module")
def fmu(tanks) -> Iterator[FMU]:
    with open_model(tanks) as opened:
        yield opened


@pytest.fixture(scope="module")
def case(folder, tanks) -> Case:
    return read_case(folder / "cases" / "01_first", tanks)


def made(fmu: FMU, tanks: System, name: str) -> Estimator:
    return estimators_of(tanks)[name].untuned(fmu, tanks)


@pytest.fixture(scope="module")
def runs(fmu, tanks, case, once) -> dict[str, Run]:
    names = estimators_of(tanks)
    return once("tanks", lambda _: {name: replay(case, made(fmu, tanks, name)) for name in names})


def test_a_system_has_the_estimators_of_all_systems_and_no_others(tanks):
    assert list(estimators_of(tanks)) == ["open_loop", *ESTIMATORS]
    with pytest.raises(InputError, match="direct_inversion"):
        choose(tanks, ["direct_inversion"])


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_leak_that_opens_is_found_from_the_voltage_of_a_level_sensor(case, tanks, runs, name):
    run = runs[name]
    assert run.ending is Ending.OK
    settled = case.time >= SETTLED
    leak = run.signal("leak")[settled]
    assert leak.mean() == pytest.approx(AFTER, rel=0.02)
    # It opened by 1.5e-4 m3/s, of which noise makes no more than a fifth.
    assert np.abs(leak - AFTER).max() < 0.2 * (AFTER - BEFORE)
    level = (case["reading"] - 0.4) / 2.0
    outflow = run.signal("outflow")[settled].mean()
    # Less than half the noise of a flow meter, 1.2 %.
    assert outflow == pytest.approx(DRAIN * level[settled].mean(), rel=5e-3)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_every_observer_is_nearer_to_what_judges_than_the_model_alone(case, tanks, runs, name):
    alone, own = (score(case, runs[estimator], tanks) for estimator in ("open_loop", name))
    assert own.nrmse < 0.5 * alone.nrmse


def test_the_open_loop_model_goes_where_its_own_equations_lead(case, runs):
    """Reference: the exact solution of the linear model with the nominal leak."""
    A = np.array([[-PIPE, PIPE], [PIPE, -PIPE - DRAIN]]) / AREA
    levels = [np.array([1.0, 0.8])]
    values, vectors = np.linalg.eigh(A)
    for inflow in case["pump"][1:]:
        steady = -np.linalg.solve(A, np.array([inflow, -BEFORE]) / AREA)
        kept = vectors @ np.diag(np.exp(values * STEP)) @ vectors.T
        levels.append(steady + kept @ (levels[-1] - steady))
    # Implicit Euler: relative error h*rate/2 of a motion that decays at up to 0.01 1/s.
    expected = 2.0 * np.array(levels)[:, 1] + 0.4
    assert_allclose(runs["open_loop"].signal("reading"), expected, rtol=0.01)


@pytest.mark.parametrize("accurate", [False, True])
@pytest.mark.parametrize("name", ["ekf", "ukf", "mhe"])
def test_filters_are_the_kalman_filter_where_the_model_is_linear(fmu, tanks, case, name, accurate):
    """Reference: textbook equations in matrices, with Euler's implicit step or with exact ones."""
    gains = estimators_of(tanks)[name].default_gains(fmu, tanks)
    walk = np.array([1e-5, 1e-5, gains["leak"]])
    A = np.array([[-PIPE, PIPE, 0.0], [PIPE, -PIPE - DRAIN, -1.0], [0.0, 0.0, 0.0]])
    A[:2] /= AREA
    B = np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 0.0]]) / AREA
    C, R = np.array([[0.0, 2.0, 0.0]]), gains["reading"] ** 2
    Phi = inv(np.eye(3) - STEP * A)
    G, H = STEP * Phi @ B, STEP * Phi @ B
    if accurate:
        Phi, G, H = exact_step(A, B, STEP)
    z, P = np.array([1.0, 0.8, 0.0]), np.diag([0.1, 0.1, 5e-5]) ** 2
    expected, before = [[z[2], np.sqrt(P[2, 2]), 0.0]], case["pump"][0]
    for inflow, measured in zip(case["pump"][1:], case["reading"][1:], strict=True):
        z = Phi @ z + G @ [before, BEFORE] + H @ [inflow - before, 0.0]
        P, before = Phi @ (P + STEP * np.diag(walk**2)) @ Phi.T, inflow
        S = (C @ P @ C.T).item() + R
        K = (P @ C.T).ravel() / S
        innovation = measured - (C @ z).item() - 0.4
        z = z + K * innovation
        keep = np.eye(3) - np.outer(K, C)
        P = keep @ P @ keep.T + R * np.outer(K, K)
        expected.append([z[2], np.sqrt(P[2, 2]), innovation**2 / S])
    correction, sigma, nis = np.array(expected).T
    estimate = with_steps(made(fmu, tanks, name), (case.time, case.u, case.y), accurate)
    column = list(tanks.columns).index("dleak")
    # Rounding alone: the covariance of volumes and flow has a condition number of 1e6. An accurate
    # step may leave 1e-7 of a level of 1 m, which is this share of the sensor's deviation.
    left = 1e-7 * 2.0 / 0.005 if accurate else 0.0
    close = 1e-6 * AFTER + left * sigma.max()
    assert_allclose(estimate.values[:, column], correction[1:], rtol=1e-6, atol=close)
    assert_allclose(estimate.sigma[:, column], sigma[1:], rtol=1e-6)
    assert_allclose(np.sqrt(estimate.nis), np.sqrt(nis[1:]), rtol=1e-6, atol=1e-6 + left)


@pytest.mark.usefixtures("tanks")
@pytest.mark.parametrize("name", ["disturbance_observer", "parameter_estimator", "ekf"])
def test_tuning_improves_z_and_its_page_speaks_of_the_system(folder, tmp_path, name):
    chosen = ["--system", str(folder), "--cases", str(folder / "cases"), "--out", str(tmp_path)]
    search = ["--budget", "3", "--population", "3", "--workers", "1", "--folds", "2"]
    assert main(["tune", name, *chosen, *search]) == 0
    # JSON has no infinity, and this objective no bandwidth.
    summary = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)
    assert summary["z"] < summary["z_reasoned"]
    whole = lxml.html.fromstring((tmp_path / "index.html").read_bytes())
    page = " ".join(part.text_content() for part in whole.xpath("//header|//main"))
    assert "error of reading" in page
    assert "error of outflow" in page
    assert not re.search(r"\b(inf|None|Fx|omega\w|friction|wheel\w*|stops?|speeds?)\b", page)
