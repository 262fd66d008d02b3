"""Stops repeated without cooling, and coast-downs: on the rig, and as conditions of the model."""

import json
from dataclasses import replace

import numpy as np
import pytest

from workbench.cli.schemas import case_schema
from workbench.diagnosis import read_effects
from workbench.diagnosis.data.counting import count
from workbench.diagnosis.effects.extension import ExtendedModel, build
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.errors import InputError
from workbench.machines.wheelset.rig import CONSTANT_PADS, SCENARIOS, plant, simulate, stop_of
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.modelica import read_library
from workbench.observers import estimators_of
from workbench.observers.replay import replay
from workbench.observers.run import Run
from workbench.recordings.case import Case, read_case
from workbench.studies.design.candidates import Experiment, all_settings, other_profiles
from workbench.studies.design.prediction import predict_recording
from workbench.system.experiments import RELEASE
from workbench.system.expression import Expression
from workbench.system.registry import model_path

from .edits import edit
from .recordings import REFERENCE, record
from .systems import WHEELSET as SYSTEM

STOP = SCENARIOS["01_dry_80_1.5"]
WARM = replace(STOP, conditions=replace(STOP.conditions, disc_temperature=450.0))
FADE = plant(CONSTANT_PADS, ["fade=4e-4"])


def test_fade_begins_where_the_stop_before_left_it():
    cold, warm = (simulate(scenario, 3, FADE, REFERENCE) for scenario in (STOP, WARM))
    for stop, temperature in ((cold, 333.15), (warm, 450.0)):
        expected = 0.30 * stop.drawn.muDC * (1.0 - 4e-4 * (temperature - 373.15))
        assert stop.truth["muDC1"][0] == pytest.approx(expected, rel=1e-9)
    # Both are heated nearly alike, and the air takes more from the warmer one.
    end = [scenario.truth["temperature1"][-1] for scenario in (cold, warm)]
    assert end[0] < end[1] < end[0] + (450.0 - 333.15)


def test_what_is_said_of_the_discs_reaches_the_model(tmp_path):
    record(WARM, 3, FADE, tmp_path / "warm")
    record(STOP, 3, FADE, tmp_path / "cold")
    warm, cold = (read_case(tmp_path / name, SYSTEM) for name in ("warm", "cold"))
    assert SYSTEM.set_by(warm.conditions)["TDisc"] == 450.0
    assert "TDisc" not in SYSTEM.set_by(cold.conditions)


def test_fade_of_the_model_begins_there_too(tmp_path):
    library = read_library(SYSTEM.library)
    (fade,) = (
        effect for effect in read_effects(library, "MinimalObserver") if effect.name == "BrakeFade"
    )
    text = ExtendedModel(library, "MinimalObserver", "Fading", [fade], "Pads that fade").source()
    build(library, "Fading", text, tmp_path / "Fading.fmu", every_platform=False)
    forces = []
    with FMU(tmp_path / "Fading.fmu") as model:
        for temperature in (373.15, 450.0):
            sizes = {"padFriction.brakeFade.fade": 4e-4, "TDisc": temperature}
            model.start({"omegaW": 50.0, "omegaR": 50.0 * 0.46 / 0.70}, sizes)
            model.set(model.variables(["pB"]), np.array([2.7e5]))
            forces.append(model.get(model.variables(["FDisc"]))[0])
    assert forces[1] / forces[0] == pytest.approx(1.0 - 4e-4 * (450.0 - 373.15), rel=1e-12)


# --- coast-down ---


@pytest.fixture(scope="module")
def coasting() -> Experiment:
    """From 120 km/h with the drive off: braked for five seconds, and released."""
    fixed = {"initial_speed": 120.0 / 3.6, "direction": 1, "wheel_rail": "dry", "imitated": 0.0}
    chosen = next(
        experiment
        for experiment in all_settings(SYSTEM.experiments)
        if all(experiment.settings[name].value == value for name, value in fixed.items())
    )
    profiles = other_profiles(SYSTEM.experiments, chosen)
    return next(profile for profile in profiles if profile.profiles[0].shape == RELEASE)


def losses(omega: np.ndarray, c0: float, c1: float, c2: float) -> np.ndarray:
    """Of a shaft [N.m], as the data sheet has them."""
    return c0 + c1 * omega + c2 * omega**2


def test_the_rig_coasts_down_by_its_losses_alone(coasting):
    """By those of the data sheet; what rolls slips a little, too."""
    content = {
        "conditions": {**{n: s.value for n, s in coasting.settings.items()}, "discs": ["dry"] * 3},
        "settings": {"imitated": 0.0},
        "inputs": {"pB": {"profile": RELEASE, "levels": [2.7e5], "every": 5.0}},
    }
    stop = stop_of(json.loads(json.dumps(content)), SYSTEM)
    assert not stop.protected
    made = simulate(stop, 3, CONSTANT_PADS, REFERENCE)
    assert made.standstill == made.time[-1] + 1e-3 == pytest.approx(90.0)
    assert np.abs(made.truth["tauR"]).max() == 0.0
    after = made.time > made.drawn.coasting + 10.0
    omega = made.truth["omegaR"][after]
    assert omega[-1] > 5.0
    momentum = (1500.0 * made.drawn.JR + 110.0 * made.drawn.JW * (0.70 / 0.46) ** 2) * omega
    own = losses(omega, 40.0, 1.0, 0.02)
    carried = losses(omega * 0.70 / 0.46, 25.0, 0.6, 0.004) * 0.70 / 0.46
    lost = float(np.sum(own + carried)) * 1e-3
    assert momentum[0] - momentum[-1] == pytest.approx(lost, rel=0.02)


def test_a_coast_down_counts_from_its_brake_on(coasting):
    with CoSimulation(model_path(SYSTEM, "observer")) as model:
        case = predict_recording(model, SYSTEM, coasting, {}, ("Fx",), 1)
    assert case.time[-1] == pytest.approx(SYSTEM.experiments.lasts)
    counted = count(case, SYSTEM, tuple(case.signals), SOUND, restarting=False)
    assert len(counted.blocks) * SYSTEM.comparison.block > 80.0


# --- a wheel load that is set ---


LIGHT = replace(STOP, conditions=replace(STOP.conditions, wheel_load=60e3))
# The contact is as stiff as its area is large, with the power 2/3 of the load (Hertz).
SOFTER = (80.0 / 60.0) ** (2.0 / 3.0)


@pytest.fixture(scope="module")
def light(tmp_path_factory) -> Case:
    folder = tmp_path_factory.mktemp("light") / "01_light"
    record(LIGHT, 3, CONSTANT_PADS, folder)
    return read_case(folder, SYSTEM)


@pytest.fixture(scope="module")
def unsaid(light) -> Case:
    """As if nobody had said how heavy the axle was."""
    kept = {name: value for name, value in light.conditions.items() if name != "wheel_load"}
    return replace(light, conditions=kept)


def open_loop(case: Case, role: str) -> Run:
    """A model of the rig by itself."""
    with FMU(model_path(SYSTEM, role)) as fmu:
        return replay(case, estimators_of(SYSTEM)["open_loop"].untuned(fmu, SYSTEM))


def test_what_sets_a_parameter_is_said_or_is_as_in_the_model(light, unsaid):
    assert SYSTEM.set_by(light.conditions)["Fz"] == 60e3
    assert "Fz" not in SYSTEM.set_by(unsaid.conditions)
    assert "Fz" not in SYSTEM.set_by({**light.conditions, "wheel_load": "unknown"})
    required = case_schema(SYSTEM)["properties"]["conditions"]["required"]
    assert "wheel_rail" in required
    assert "wheel_load" not in required


@pytest.mark.parametrize(
    ("written", "message"),
    [("-1 kN", "found '-1 kN'; expected above 0 N"), ("60 kg", r"found \[kg\]")],
)
def test_a_load_that_is_none_is_refused(written, message, tmp_path):
    record(LIGHT, 3, CONSTANT_PADS, tmp_path / "stop")
    toml = tmp_path / "stop" / "case.toml"
    edit(toml, ("60 kN", written))
    with pytest.raises(InputError, match=message):
        read_case(tmp_path / "stop", SYSTEM)


def test_slip_of_a_light_axle_goes_with_its_contact():
    usual, less = (simulate(scenario, 3, CONSTANT_PADS, REFERENCE) for scenario in (STOP, LIGHT))
    held = slice(*np.searchsorted(usual.time, usual.drawn.coasting + np.array([5.0, 10.0])))
    more = less.truth["slip"][held] / usual.truth["slip"][held]
    # Polach's force bends by 1 % more where less of it is left.
    assert more == pytest.approx(SOFTER, rel=0.015)


def test_estimators_run_with_the_load_that_was_said(light, unsaid):
    runs = [open_loop(case, "observer") for case in (light, unsaid)]
    # Where the contact carries little: the model's friction is that of a slippery rail.
    begins = np.argmax(runs[0].signal("Fx") > 500.0)
    stated, usual = (run.signal("slip")[begins] for run in runs)
    assert stated / usual == pytest.approx(SOFTER, rel=0.02)
    # Of both wheels, 60 kN each.
    assert runs[0].signal("adhesion") == pytest.approx(np.abs(runs[0].signal("Fx")) / 120e3)


def test_samples_are_excluded_by_the_load_that_was_said(light, unsaid):
    (slide, *_) = SYSTEM.comparison.exclusions
    usage = Expression("Fx/(2*Fz)", "a test")
    much = replace(slide, reason="much adhesion", formula=usage, above=0.04, from_rest=False)
    much = replace(much, smoothed=0.0, within=0.0, only_while=None, restarted=())
    system = replace(SYSTEM, comparison=replace(SYSTEM.comparison, exclusions=(much,)))
    for case, load in ((light, 60e3), (unsaid, 80e3)):
        counted = count(case, system, tuple(case.signals), SOUND, restarting=False)
        beyond = np.abs(counted.clean["Fx"]) > 0.04 * 2.0 * load
        assert 0.01 < beyond.mean() < 0.99
        # But for the first samples and the last one, of which no mean is formed.
        assert np.array_equal(counted.excluded["much adhesion"][5:-5], beyond[5:-5])


def test_a_model_without_that_parameter_runs_as_it_is(light, unsaid):
    """The full model has the wheel load as an output."""
    runs = [open_loop(case, "full") for case in (light, unsaid)]
    assert np.array_equal(runs[0].signal("slip"), runs[1].signal("slip"))
