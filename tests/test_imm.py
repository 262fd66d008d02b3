"""A bank of filters that weigh the conditions of a system: what it is on a linear model, and what
it finds on rails."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import inv

from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.observers.estimators.imm import InteractingMultipleModel, changes, hypotheses
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.replay import replay
from workbench.observers.run import Run
from workbench.recordings.case import Case, read_case, read_cases
from workbench.system.registry import load_system, open_model
from workbench.system.system import System

from .built import declare, machine
from .linear import exact_step, with_steps
from .systems import WHEELSET

ROOT = Path(__file__).parent.parent

# --- on a linear model: a vessel that cools, insulated or bare, heated by a source and the sun ---

LIBRARY, SYSTEM = machine("heated_vessel")
RATES, STEP, NOISE, WALK = (0.02, 0.05), 1.0, 0.2, np.array([0.01, 0.002])


@pytest.fixture(scope="module")
def vessel(tmp_path_factory) -> System:
    folder = tmp_path_factory.mktemp("vessel")
    rng, warm, rows = np.random.default_rng(3), 10.0, []
    for k in range(300):
        heater = 0.4 if k % 60 < 30 else 0.1
        rows.append((k * STEP, heater, warm + NOISE * rng.standard_normal()))
        warm += STEP * (heater + 0.12 - RATES[k > 150] * warm)
    case = folder / "cases" / "01_cover_lost"
    case.mkdir(parents=True)
    title = 'title = "Cover lost"\nconditions.cover = "on"\nmeasurement.file = "measured.csv"\n'
    (case / "case.toml").write_text(title)
    table = pd.DataFrame(rows, columns=["time [s]", "heater [K/s]", "warm [K]"])
    table.to_csv(case / "measured.csv", index=False)
    return declare(folder, LIBRARY, SYSTEM, Vessel="Heat.Vessel")


@pytest.fixture(scope="module")
def fmu(vessel) -> Iterator[FMU]:
    with open_model(vessel) as opened:
        yield opened


@pytest.fixture(scope="module")
def case(vessel) -> Case:
    return read_case(vessel.source.parent / "cases" / "01_cover_lost", vessel)


def bank(fmu: FMU, system: System, lasts: float) -> InteractingMultipleModel:
    conditions = tuple(replace(condition, lasts=lasts) for condition in system.conditions)
    given = replace(system, conditions=conditions)
    return InteractingMultipleModel.untuned(fmu, given)


def textbook(case: Case, transition: np.ndarray, accurate: bool) -> tuple[np.ndarray, ...]:
    """Blom and Bar-Shalom (1988) in matrices: means, deviations and probabilities, by sample.

    By Euler's implicit step, or by exact ones.
    """
    first = np.array([case["warm"][0], 0.0])
    z, P = [first, first], [np.diag([NOISE, 0.05]) ** 2] * 2
    weight = np.array([0.5, 0.5])
    estimates, last = [(first, np.sqrt(np.diag(P[0])), weight)], case["heater"][0]
    for heater, measured in zip(case["heater"][1:], case["warm"][1:], strict=True):
        before = transition.T @ weight
        mixed, spread, evidence = [], [], []
        for j, rate in enumerate(RATES):
            share = transition[:, j] * weight / before[j]
            mean = share[0] * z[0] + share[1] * z[1]
            cov = sum(
                s * (p + np.outer(a - mean, a - mean)) for s, a, p in zip(share, z, P, strict=True)
            )
            Phi = inv(np.array([[1.0 + STEP * rate, -STEP], [0.0, 1.0]]))
            G = H = STEP * Phi[:, :1]
            if accurate:
                Phi, G, H = exact_step([[-rate, 1.0], [0.0, 0.0]], [[1.0], [0.0]], STEP)
            mean = Phi @ mean + G @ [last + 0.1] + H @ [heater - last]
            cov = Phi @ (cov + STEP * np.diag(WALK**2)) @ Phi.T
            S = cov[0, 0] + NOISE**2
            gain, innovation = cov[:, 0] / S, measured - mean[0]
            mixed.append(mean + gain * innovation)
            spread.append(cov - S * np.outer(gain, gain))
            evidence.append(np.exp(-0.5 * innovation**2 / S) / np.sqrt(S))
        z, P, last = mixed, spread, heater
        weight = before * evidence
        weight /= weight.sum()
        mean = weight @ z
        cov = sum(
            w * (p + np.outer(a - mean, a - mean)) for w, a, p in zip(weight, z, P, strict=True)
        )
        estimates.append((mean, np.sqrt(np.diag(cov)), weight))
    return tuple(np.array(column) for column in zip(*estimates, strict=True))


@pytest.mark.parametrize("accurate", [False, True])
@pytest.mark.parametrize("lasts", [20.0, 100.0, np.inf])
def test_it_is_the_textbook_where_the_model_is_linear(fmu, vessel, case, lasts, accurate):
    """Without changes the mixture is exact: two filters side by side, weighed by Bayes' rule."""
    case = case.part(slice(0, 140))  # in which no probability vanishes in double precision
    estimate = with_steps(bank(fmu, vessel, lasts), (case.time, case.u, case.y), accurate)
    rate = STEP / lasts
    transition = inv(np.array([[1.0 + rate, -rate], [-rate, 1.0 + rate]]))
    mean, sigma, weight = textbook(case, transition, accurate)
    warm, sun = (list(vessel.columns).index(name) for name in ("warm", "dsun"))
    # Rounding alone, of numbers of 10 and probabilities down to 1e-30. A step of order 3 leaves
    # z^4/38 of a motion, with z = 0.05 2e-7, for twenty steps; that of 10 K in deviations of 0.2 K.
    share = 20.0 * 0.05**4 / 38.0 if accurate else 0.0
    left = share * 10.0 / NOISE
    close = 1e-10 + left * sigma[:, 1].max()
    assert_allclose(estimate.values[:, warm], mean[1:, 0], rtol=1e-9 + share)
    assert_allclose(estimate.values[:, sun], mean[1:, 1], rtol=1e-9, atol=close)
    # The distance of the means, off by that, is a part of the deviation.
    assert_allclose(estimate.sigma[:, warm], sigma[1:, 0], rtol=1e-8 + left)
    assert_allclose(estimate.sigma[:, sun], sigma[1:, 1], rtol=1e-8 + left)
    # Of a probability the logarithm is off by that times an innovation, 3 deviations at most.
    assert_allclose(estimate.probability[:, 1], weight[1:, 1], rtol=1e-7 + 60.0 * left, atol=1e-12)


def test_a_cover_that_is_lost_under_way_is_noticed(fmu, vessel, case):
    off = replay(case, bank(fmu, vessel, 100.0)).probability["cover_off"]
    assert off[140:150].max() < 0.05
    assert np.median(off[-100:]) > 0.95


def test_rates_of_change_leave_one_choice_for_each_other(vessel):
    assert_allclose(changes(vessel), [[-0.01, 0.01], [0.01, -0.01]])
    (cover,) = vessel.conditions
    second = replace(cover, name="lid", lasts=50.0)
    both = changes(replace(vessel, conditions=(cover, second)))
    assert len(hypotheses(replace(vessel, conditions=(cover, second)))) == 4
    # Rows are on on, on off, off on, off off; a lid changes twice as often as a cover.
    assert_allclose(both[0], [-0.03, 0.02, 0.01, 0.0])
    assert_allclose(both.sum(axis=1), 0.0, atol=1e-15)


def test_a_time_that_is_none_is_refused(vessel, tmp_path):
    shutil.copy(vessel.source.parent / "Vessel.fmu", tmp_path)
    (tmp_path / "system.toml").write_text(SYSTEM.replace('"100 s"', '"0 s"'))
    with pytest.raises(InputError, match=r"lasts.*a time above 0"):
        load_system(tmp_path)


# --- on the rig ---


@pytest.fixture(scope="module")
def rails(once) -> dict[str, Run]:
    """Wet and dry stops of the rig."""

    def run(_: Path) -> dict[str, Run]:
        with open_model(WHEELSET) as opened:
            own = InteractingMultipleModel.untuned(opened, WHEELSET)
            return {case.name: replay(case, own) for case in read_cases([ROOT / "cases"], WHEELSET)}

    return once("rails", run)


def test_with_one_hypothesis_it_is_the_extended_filter():
    conditions = tuple(replace(condition, parameters={}) for condition in WHEELSET.conditions)
    plain = replace(WHEELSET, conditions=conditions, bands={})
    case = read_case(ROOT / "cases" / "09_wet_160_4.2_wsp", plain)
    with open_model(plain) as opened:
        gains = ExtendedKalmanFilter.default_gains(opened, plain)
        kinds = (ExtendedKalmanFilter, InteractingMultipleModel)
        alone, mixed = (cls(opened, plain, gains).run(case.time, case.u, case.y) for cls in kinds)
    assert_allclose(mixed.values, alone.values, rtol=1e-12, atol=0)
    assert_allclose(mixed.sigma, alone.sigma, rtol=1e-12, atol=0)
    assert_allclose(mixed.nis, alone.nis, rtol=1e-12, atol=0)


def test_the_condition_of_the_rail_is_found_within_a_second(rails):
    """Where the wheel rolls: sliding, the laws of wet and dry rails are alike."""
    for case in read_cases([ROOT / "cases"], WHEELSET):
        right = rails[case.name].probability[f"wheel_rail_{case.conditions['wheel_rail']}"]
        pressed = case.time[np.argmax(case["pB"] > 25e3)]  # pads touch, data sheet
        rolling = 0.70 * np.abs(case["omegaR"]) > 1.0
        slip = np.abs(0.70 * case["omegaR"] - 0.46 * case["omegaW"])
        rolling &= slip < 0.02 * 0.70 * np.abs(case["omegaR"])
        later = (case.time > pressed + 1.0) & rolling
        # A slide ends with a wheel that rolls, and may leave the wrong idea for some samples.
        assert np.mean(right[later] > 0.95) > 0.99, case.name
