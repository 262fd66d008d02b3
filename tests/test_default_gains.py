"""The gains that observers have unless told otherwise: tuned on the project's cases."""

import json
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.case import read_cases
from workbench.fmu import FMU
from workbench.objective import Weights
from workbench.observers import (
    DisturbanceGains,
    DisturbanceObserver,
    ParameterEstimator,
    ParameterGains,
    reasoned_settings,
)
from workbench.pool import Pool
from workbench.tuning import (
    DEFAULTS,
    Evaluator,
    Job,
    default_settings,
    evaluate_gains,
    read_gains,
    reasoned_gains,
    recordings,
    to_vector,
)
from workbench.tuning.settling import HALF_SECOND, Settling

MODELS = {"disturbance_observer": "MinimalObserver", "parameter_estimator": "FullObserver"}


@pytest.fixture(scope="module")
def models(root: Path) -> Iterator[tuple[FMU, FMU]]:
    fmus = root / "fmus" / "fmi2"
    with FMU(fmus / "MinimalObserver.fmu") as minimal, FMU(fmus / "FullObserver.fmu") as full:
        yield minimal, full


@pytest.mark.parametrize("name", MODELS)
def test_default_gains_reach_the_z_they_claim_and_beat_reasoned_ones(
    root: Path, inline: Callable[[Job], Pool[Evaluator]], name: str
) -> None:
    path = root / "fmus" / "fmi2" / f"{MODELS[name]}.fmu"
    claimed = tomllib.loads((DEFAULTS / f"{name}.toml").read_text())["provenance"]
    cases = read_cases([root / "cases"])
    with FMU(path) as fmu:
        reasoned = reasoned_gains(name, fmu)
    judged = recordings(cases, claimed["radius_error"])
    job = Job(name, path.read_bytes(), {}, reasoned, judged, Weights())
    tuned = read_gains(DEFAULTS / f"{name}.toml")[1]
    after, before = evaluate_gains(inline(job), job, [to_vector(tuned), to_vector(reasoned)])
    # The last digits depend on the processor.
    assert_allclose(after, [claimed["z_k"][one.name] for one in judged], rtol=1e-6)
    assert after.max() == pytest.approx(claimed["z"], rel=1e-6)
    assert after.max() < before.max()


def test_models_that_gains_were_not_tuned_on_get_reasoned_ones(models: tuple[FMU, FMU]) -> None:
    minimal, full = models
    settings, tuned = default_settings(minimal, full)
    assert set(tuned) == set(MODELS)
    other, none = default_settings(full, minimal)
    assert not none
    assert_allclose(other.disturbance.L, reasoned_settings(full, minimal).disturbance.L)
    assert np.abs(settings.disturbance.L - other.disturbance.L).max() > 1.0


def test_simulate_says_whose_gains_it_used(root: Path, tmp_path: Path) -> None:
    case = str(root / "cases" / "03_dry_120_3.6")
    told = {}
    for extra in ([], ["--untuned"]):
        out = tmp_path / f"run{len(extra)}"
        chosen = ["--estimator", "disturbance_observer", "--workers", "1", "--out", str(out)]
        assert main(["simulate", case, *chosen, *extra]) == 0
        provenance = json.loads((out / "summary.json").read_text())["provenance"]
        told[len(extra)] = provenance["disturbance_observer"]["source"]
    assert told[0] == "tuned, disturbance_observer.toml"
    assert told[1].startswith("stationary Kalman gain")


def slow_disturbance_observer(fmu: FMU) -> tuple[DisturbanceObserver, DisturbanceGains]:
    gains = reasoned_gains("disturbance_observer", fmu)
    assert isinstance(gains, DisturbanceGains)
    L = gains.L.copy()
    L[3] *= 0.02
    slow = replace(gains, L=L)
    return DisturbanceObserver(fmu, slow), slow


def slow_parameter_estimator(fmu: FMU) -> tuple[ParameterEstimator, ParameterGains]:
    gains = reasoned_gains("parameter_estimator", fmu)
    assert isinstance(gains, ParameterGains)
    slow = replace(gains, L=0.2 * gains.L)
    return ParameterEstimator(fmu, slow), slow


@pytest.mark.parametrize(
    ("make", "which"), [(slow_disturbance_observer, 0), (slow_parameter_estimator, 1)]
)
def test_settling_predicts_how_much_of_a_friction_step_is_left(
    models: tuple[FMU, FMU], make: Callable[[FMU], tuple], which: int
) -> None:
    """Reference: the observer itself along a model whose friction steps at the operating point."""
    fmu = models[which]
    step, rate = 0.01, 1000
    settling = Settling(fmu)  # leaves the model in equilibrium
    speeds = fmu.variables(["omegaW", "omegaR"])
    fmu.start(dict(zip(("omegaW", "omegaR"), fmu.get(speeds).tolist(), strict=True)))
    inputs = fmu.variables(["pB", "tauR", "dmuDC"])
    coasting, signals = 2 * rate, []
    for k in range(coasting + round(HALF_SECOND * rate) + 1):
        signals.append(fmu.get(speeds).copy())
        fmu.set(inputs, np.array([1.5e5, 0.0, step * (k >= coasting)]))
        fmu.step(1.0 / rate)
    y = np.array(signals)
    u = np.tile([1.5e5, 0.0], (len(y), 1))
    observer, gains = make(fmu)
    friction = observer.run(np.arange(len(y)) / rate, u, y).values[:, 3]
    left = abs(1.0 - (friction[-1] - friction[coasting]) / step)
    # The speed, and with it the slope of the creep law, falls by 6 % in these seconds.
    assert left > 0.1
    assert left == pytest.approx(settling.left(gains), rel=0.1)
