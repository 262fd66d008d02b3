"""Observers on models with an effect plugged in: other states, another radius."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.diagnosis import Outcome
from workbench.diagnosis.effects.extension import build
from workbench.diagnosis.inference.best_estimate import bands, best_estimate
from workbench.machines.wheelset.rig import Effects, select
from workbench.models.fmu import FMU
from workbench.models.modelica import read_library
from workbench.observers import Estimator, Gains
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.estimators.unscented import UnscentedKalmanFilter
from workbench.observers.replay import replay
from workbench.observers.run import Ending
from workbench.observers.score import score
from workbench.observers.simulation import CaseResult
from workbench.recordings.case import Case, read_case

from .built import diagnosed
from .recordings import record
from .systems import WHEELSET as SYSTEM

RR, JR, TRAIN_INERTIA = 0.70, 1500.0, 7840.0
WORN = 0.45  # m, wheel radius of Worn

EFFECTS = {
    "Fading": "Effects.BrakeFade padFriction(fade=1e-3)",
    "Warming": "Effects.BrakeFade padFriction(fade=0.0)",
    "Lagging": "Effects.CylinderLag cylinder(lag=0.1)",
    "Worn": "Effects.WheelRadius wheelRadius(delta=-0.01)",
}
FADING_STATES = ("omegaW", "omegaR", "padFriction.rise")


@pytest.fixture(scope="module")
def extended(root, tmp_path_factory) -> Iterator[dict[str, FMU]]:
    """The minimal model with one effect each."""
    folder = tmp_path_factory.mktemp("extended")
    library = read_library(root / "modelica" / "WheelsetRig" / "package.mo")
    models = {}
    for name, effect in EFFECTS.items():
        text = (
            f"model {name}\n"
            f"  extends WheelsetRig.MinimalObserver(redeclare WheelsetRig.{effect});\n"
            f"end {name};\n"
        )
        path = folder / f"{name}.fmu"
        build(library, name, text, path, every_platform=False)
        models[name] = FMU(path)
    yield models
    for fmu in models.values():
        fmu.close()


@pytest.fixture(scope="module")
def fading_stop(extended) -> tuple[Case, float]:
    """A stop from 120 km/h whose pads fade, without noise, and what discs are warmer then [K]."""
    fmu = extended["Fading"]
    assert fmu.states == FADING_STATES
    fmu.start({"omegaR": 120 / 3.6 / RR, "omegaW": 120 / 3.6 / 0.46})
    inputs = fmu.variables(["pB", "tauR"])
    outputs = fmu.variables(["omegaW", "omegaR", "Fx"])
    rows = []
    for k in range(24_000):
        t = 0.001 * k
        pB = 2.7e5 * (1 - np.exp(-max(0.0, t - 1.0) / 0.5))
        # The drive imitates a train: it supplies what the roller lacks in inertia.
        tauR = (TRAIN_INERTIA - JR) / TRAIN_INERTIA * RR * fmu.get(outputs)[2]
        fmu.set(inputs, np.array([pB, tauR]))
        fmu.step(0.001)
        if k % 5 == 0:
            rows.append([t, pB, tauR, *fmu.get(outputs)])
    t, pB, tauR, omegaW, omegaR, Fx = np.array(rows).T
    case = Case(
        name="fading",
        title="fading",
        conditions={"wheel_rail": "dry", "direction": 1},
        time=t,
        signals={"pB": pB, "tauR": tauR, "omegaW": omegaW, "omegaR": omegaR, "Fx": Fx},
        inputs=("pB", "tauR"),
        outputs=("omegaW", "omegaR"),
        source=Path("fading"),
    )
    return case, float(fmu.get_states()[2])


def observer(fmu: FMU) -> DisturbanceObserver:
    return DisturbanceObserver(fmu, SYSTEM, gains_of(fmu))


def gains_of(fmu: FMU) -> Gains:
    """Reasoned gains; the FMU is left at its operating point."""
    return DisturbanceObserver.default_gains(fmu, SYSTEM)


def force_error(case: Case, estimator: Estimator) -> float:
    """Error of Fx, rms over mean while braking."""
    run = replay(case, estimator)
    assert run.ending is Ending.OK
    return score(case, run, SYSTEM).nrmse


def test_a_model_that_knows_the_fade_of_its_pads_lowers_the_error_of_the_force(
    minimal, extended, fading_stop
):
    case, _ = fading_stop
    without, knowing = (force_error(case, observer(fmu)) for fmu in (minimal, extended["Fading"]))
    # Measured: 0.05 % and 0.007 %; what is left is of the step.
    assert knowing < 0.5 * without


def test_a_state_without_effect_changes_no_estimate(minimal, extended, dry_case):
    gains = gains_of(minimal)
    recording = dry_case.time, dry_case.u, dry_case.y
    expected, estimate = (
        DisturbanceObserver(fmu, SYSTEM, gains).run(*recording).values
        for fmu in (minimal, extended["Warming"])
    )
    # Rounding only, amplified by the stiff slip.
    assert_allclose(estimate, expected, rtol=1e-6, atol=1e-6)


def test_the_disturbance_observer_follows_a_disc_that_it_does_not_measure(extended, fading_stop):
    case, rise = fading_stop
    fmu = extended["Fading"]
    observer(fmu).run(case.time, case.u, case.y)
    assert rise > 50.0
    # Steps of 5 ms, in the order of 1e-3 of the stop.
    assert fmu.get_states()[2] == pytest.approx(rise, rel=1e-3)


def test_the_effect_costs_nothing_on_a_recorded_stop(minimal, extended, root):
    """The recorded pads fade by 7e-4 /K instead of 1e-3."""
    folder = root.parent / "shared" / "recordings" / "labelled" / "fade" / "04_dry_160_4.2"
    if not folder.is_dir():
        pytest.skip("no such recordings")
    case = read_case(folder, SYSTEM)
    without, knowing = (force_error(case, observer(fmu)) for fmu in (minimal, extended["Fading"]))
    # The observer learns the fade anyway; noise of the sensors is all of the 0.15 %.
    assert knowing < 1.1 * without


def test_the_operating_point_is_an_equilibrium_of_every_model(extended):
    for fmu in extended.values():
        gains = gains_of(fmu)
        # Of some 100 rad/s2 that pads and creep force have; the search ends at 1e-9 m/s of slip.
        assert abs(fmu.derivatives()[fmu.states.index("omegaW")]) < 1e-4
        assert fmu.get(fmu.variables(["Fx"]))[0] > 5e3
        assert np.isfinite(gains.values).all()
        assert np.abs(gains.design["effect"]).min() > 10.0


def test_a_cylinder_that_lags_is_full_at_the_operating_point(minimal, extended):
    expected, lagging = (gains_of(fmu) for fmu in (minimal, extended["Lagging"]))
    assert_allclose(lagging.values, expected.values, rtol=1e-9)
    assert_allclose(lagging.design["effect"], expected.design["effect"], rtol=1e-9)


def test_discs_are_at_their_start_at_the_operating_point(extended):
    fmu = extended["Fading"]
    gains_of(fmu)
    assert fmu.get_states()[2] == fmu.defaults["padFriction.rise"]


@pytest.mark.parametrize("method", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_a_worn_wheel_at_standstill_has_no_creep_force(extended, dry_case, method):
    """The radius of rolling is the model's, not the parameter rW: that would leave 7 kN."""
    fmu = extended["Worn"]
    case = dry_case.with_signals({"omegaW": dry_case["omegaW"] * fmu.defaults["rW"] / WORN})
    run = replay(case, method.untuned(fmu, SYSTEM))
    resting = case.time > case.time[-1] - 0.5
    # 100 N is the noise of the load cell itself (80 N) with a margin for the drive's torque.
    assert np.abs(run.signal("Fx")[resting]).max() < 100.0


# --- the best estimate of a recording, with both models ---


STOPS = ("dry_120_3.6", "dry_120_2.7_rev")
GAIN = 0.04  # of the measured torque, which is most of the balance that the force follows from


@pytest.fixture(scope="module")
def outcome(system, once) -> Outcome:
    """Of two stops whose torque was measured too large."""

    def run(folder: Path) -> Outcome:
        for scenario in select(STOPS):
            record(scenario, 3, Effects(torque_gain=GAIN), folder / "stops" / scenario.name)
        return diagnosed(system, folder / "stops", folder / "out", "DriveTorqueGain", "WheelRadius")

    return once("diagnosis of a wrong torque", run)


@pytest.fixture(scope="module")
def estimates(outcome) -> dict[str, CaseResult]:
    by_recording = {case.name: best_estimate(outcome, case.name) for case in outcome.cases}
    return {name: estimate for name, estimate in by_recording.items() if estimate is not None}


def test_the_band_holds_what_the_load_cells_say_once_the_model_is_extended(outcome, estimates):
    """The nominal model takes 4 % of torque for force, some forty standard deviations."""
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "DriveTorqueGain"
    inside: dict[str, list[float]] = {"nominal_model": [], "extended_model": []}
    assert len(estimates) == len(STOPS)
    for estimate in estimates.values():
        for model, numbers in bands(estimate).items():
            inside[model].append(numbers["Fx"]["inside"])
            assert numbers["Fx"]["low"] < numbers["Fx"]["value"] < numbers["Fx"]["high"]
    # Of 95 %; the cells ring, and stand 21.6 Hz behind the contact.
    assert np.mean(inside["extended_model"]) >= 0.93
    assert max(inside["nominal_model"]) < 0.1


def test_load_cells_feed_no_estimate(outcome, estimates):
    """Without them the numbers are the same, but for the share of them that is inside."""
    case = outcome.cases[0]
    signals = {name: values for name, values in case.signals.items() if name != "Fx"}
    best = best_estimate(replace(outcome, cases=(replace(case, signals=signals),)), case.name)
    for model, run in estimates[case.name].runs.items():
        assert_array_equal(run.estimate, best.runs[model].estimate)
        assert_array_equal(run.sigma, best.runs[model].sigma)
        assert bands(best)[model]["Fx"]["inside"] is None


def test_where_errors_have_no_explanation_there_is_no_best_estimate(outcome):
    unexplained = replace(outcome.diagnosis, verdict="unexplained")
    name = outcome.cases[0].name
    assert best_estimate(replace(outcome, diagnosis=unexplained), name) is None
    # Of a model that lacks nothing there is one, without an extended model.
    nothing = replace(outcome, diagnosis=replace(outcome.diagnosis, verdict="nothing"))
    assert list(best_estimate(replace(nothing, extension=None), name).runs) == ["nominal_model"]
