"""The gains that observers have unless told otherwise: tuned on the project's cases."""

import json
import shutil
import tomllib
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.models.fmu import FMU
from workbench.observers import Estimator, Gains, estimators_of
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.estimators.parameter import ParameterEstimator
from workbench.observers.gains import read_gains, usual_gains
from workbench.recordings.case import read_cases
from workbench.system.registry import open_model
from workbench.system.system import System
from workbench.tuning import evaluate_gains, pose
from workbench.tuning.cost import Settling

from .built import build_here

NAMES = ("disturbance_observer", "parameter_estimator")


@pytest.fixture(scope="module")
def models(system) -> Iterator[dict[str, FMU]]:
    """The models of both estimators, by the estimators' names."""
    with open_model(system) as minimal, open_model(system, "full") as full:
        yield dict(zip(NAMES, (minimal, full), strict=True))


@pytest.mark.parametrize("name", NAMES)
def test_default_gains_reach_the_z_they_claim_and_beat_reasoned_ones(root, system, inline, name):
    path = root / "workbench" / "machines" / "wheelset" / "gains" / f"{name}.toml"
    claimed = tomllib.loads(path.read_text())["provenance"]
    job = pose(system, name, read_cases([root / "cases"], system), claimed["scale_errors"]).job
    assert dict(system.objective.weights) == claimed["weights"]
    tuned = read_gains(path, {name: job.gains})
    after, before = evaluate_gains(inline(job), job, [tuned.values, job.gains.values])
    # The last digits depend on the processor.
    assert_allclose(
        after, [claimed["z_k"][recording.name] for recording in job.recordings], rtol=1e-6
    )
    assert after.max() == pytest.approx(claimed["z"], rel=1e-6)
    assert after.max() < before.max()


def test_models_that_gains_were_not_tuned_on_get_reasoned_ones(system, models):
    known = estimators_of(system)
    minimal, full = models.values()
    gains = {
        name: (usual_gains(cls, minimal, system), usual_gains(cls, full, system))
        for name, cls in known.items()
    }
    tuned = {n: [chosen.source.startswith("tuned") for chosen in both] for n, both in gains.items()}
    assert tuned.pop("disturbance_observer") == tuned.pop("disturbance_observer_disc")
    assert tuned.pop("parameter_estimator") == [False, True]
    assert not any(any(both) for both in tuned.values())
    own, other = gains["disturbance_observer"]
    assert_allclose(other.values, known["disturbance_observer"].default_gains(full, system).values)
    assert np.abs(own.values - other.values).max() > 1.0


def test_gains_act_on_the_states_they_were_tuned_for_in_whatever_order_a_compiler_has_them(
    root, system, tmp_path
):
    """OpenModelica sorts states by name; here the order is that of the declarations."""
    library = tmp_path / "WheelsetRig"
    shutil.copytree(root / "modelica" / "WheelsetRig", library)
    source = library / "MinimalObserver.mo"
    lines = source.read_text().splitlines(keepends=True)
    at, behind = (
        next(k for k, line in enumerate(lines) if f"AngularVelocity {name}(start" in line)
        for name in ("omegaW", "omegaR")
    )
    lines[at], lines[behind] = lines[behind], lines[at]
    source.write_text("".join(lines))
    build_here(library / "package.mo", "WheelsetRig.MinimalObserver", tmp_path / "turned.fmu")

    (case,) = read_cases([root / "cases" / "01_dry_80_1.5"], system)
    with open_model(system) as own, FMU(tmp_path / "turned.fmu") as turned:
        assert turned.states == own.states[::-1]
        gains = usual_gains(DisturbanceObserver, own, system)
        forces = [
            np.asarray(
                DisturbanceObserver(fmu, system, gains).run(case.time, case.u, case.y).values
            )
            for fmu in (own, turned)
        ]
    # The same equations in another order: rounding, which feedback does not let grow.
    assert_allclose(forces[1], forces[0], rtol=1e-6, atol=1e-6)


def test_simulate_says_whose_gains_it_used(root, tmp_path):
    case = str(root / "cases" / "03_dry_120_3.6")
    sources = {}
    for extra in ([], ["--untuned"]):
        out = tmp_path / f"run{len(extra)}"
        chosen = ["--estimator", "disturbance_observer", "--workers", "1", "--out", str(out)]
        assert main(["simulate", case, *chosen, *extra]) == 0
        provenance = json.loads((out / "summary.json").read_text())["provenance"]
        sources[len(extra)] = provenance["disturbance_observer"]["source"]
    assert sources[0] == "tuned, disturbance_observer.toml"
    assert sources[1].startswith("stationary Kalman gain")


def slow_disturbance_observer(fmu: FMU, system: System) -> tuple[Estimator, Gains]:
    gains = DisturbanceObserver.default_gains(fmu, system)
    values = gains.values.copy()
    values[12:16] *= 0.02  # those that act on muDC
    slow = gains.with_values(values)
    return DisturbanceObserver(fmu, system, slow), slow


def slow_parameter_estimator(fmu: FMU, system: System) -> tuple[Estimator, Gains]:
    gains = estimators_of(system)["parameter_estimator"].default_gains(fmu, system)
    slow = gains.with_values(0.2 * gains.values)
    return ParameterEstimator(fmu, system, slow), slow


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (slow_disturbance_observer, "disturbance_observer"),
        (slow_parameter_estimator, "parameter_estimator"),
    ],
)
def test_settling_predicts_how_much_of_a_friction_step_is_left(system, models, make, name):
    """Reference: the observer itself along a model whose friction steps at the operating point."""
    fmu, asked = models[name], system.following
    assert asked.within == 0.5
    step, rate = 0.01, 1000
    settling = Settling(fmu, system, estimators_of(system)[name])  # leaves the model in equilibrium
    speeds = fmu.variables(["omegaW", "omegaR"])
    fmu.start(dict(zip(("omegaW", "omegaR"), fmu.get(speeds).tolist(), strict=True)))
    inputs = fmu.variables(["pB", "tauR", "dmuDC"])
    coasting, signals = 2 * rate, []
    for k in range(coasting + round(asked.within * rate) + 1):
        signals.append(fmu.get(speeds).copy())
        fmu.set(inputs, np.array([1.5e5, 0.0, step * (k >= coasting)]))
        fmu.step(1.0 / rate)
    y = np.array(signals)
    u = np.tile([1.5e5, 0.0], (len(y), 1))
    observer, gains = make(fmu, system)
    friction = observer.run(np.arange(len(y)) / rate, u, y).values[:, 3]
    left = abs(1.0 - (friction[-1] - friction[coasting]) / step)
    # The speed, and with it the slope of the creep law, falls by 6 % in these seconds.
    assert left > 0.1
    assert left == pytest.approx(settling.left(gains), rel=0.1)


def test_methods_of_an_estimator_under_their_former_names_are_taken():
    former = {"name": "former", "reasoned": classmethod(lambda cls, fmu, system: "its own")}
    with pytest.warns(DeprecationWarning, match="reasoned is now called default_gains"):
        cls = type("Former", (DisturbanceObserver,), former)
    assert cls.default_gains(None, None) == "its own"
