"""Stops repeated without cooling, and coast-downs: on the rig, and as conditions of the model."""

import json
from dataclasses import replace

import numpy as np
import pytest

from workbench.diagnosis import read_effects
from workbench.diagnosis.data.counting import count
from workbench.diagnosis.effects.extension import ExtendedModel, build
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.machines.wheelset.rig import CONSTANT_PADS, SCENARIOS, plant, simulate, stop_of
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.modelica import read_library
from workbench.recordings.case import read_case
from workbench.studies.design.candidates import Experiment, all_settings, other_profiles
from workbench.studies.design.simulation import predict_recording
from workbench.system.experiments import RELEASE
from workbench.system.registry import load_system, model_path

from .recordings import REFERENCE, record

SYSTEM = load_system("wheelset")
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
    one = next(
        experiment
        for experiment in all_settings(SYSTEM.experiments)
        if all(experiment.settings[name].value == value for name, value in fixed.items())
    )
    profiles = other_profiles(SYSTEM.experiments, one)
    return next(profile for profile in profiles if profile.profiles[0].shape == RELEASE)


def losses(omega: np.ndarray, c0: float, c1: float, c2: float) -> np.ndarray:
    """Of a shaft [N.m], as the data sheet has them."""
    return c0 + c1 * omega + c2 * omega**2


def test_the_rig_coasts_down_by_its_losses_alone(coasting):
    """By those of the data sheet; what rolls slips a little, too."""
    said = {
        "conditions": {**{n: s.value for n, s in coasting.settings.items()}, "discs": ["dry"] * 3},
        "settings": {"imitated": 0.0},
        "inputs": {"pB": {"profile": RELEASE, "levels": [2.7e5], "every": 5.0}},
    }
    stop = stop_of(json.loads(json.dumps(said)), SYSTEM)
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
