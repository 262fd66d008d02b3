"""Scenarios of the virtual rig that take less time than the standard ones, and its data sheet."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench.machines.wheelset.rig import SCENARIOS, Scenario, StopTruth

REFERENCE = Path(__file__).parents[1] / "fmus" / "fmi2" / "Reference.fmu"
SEED = 1  # of the recordings of the repository
ROLLER_RADIUS, WHEEL_RADIUS, BRAKE_RADIUS = 0.70, 0.46, 0.30  # m


def short(name: str, speed: float, **conditions: object) -> Scenario:
    """A standard stop from another speed [km/h]: the lower, the shorter."""
    usual = SCENARIOS[name]
    changed = replace(usual.conditions, initial_speed=speed / 3.6, **conditions)
    return replace(usual, conditions=changed)


def normal_force(stop: StopTruth) -> np.ndarray:
    """Of one brake unit [N]."""
    return 0.1086 * np.maximum(0.0, stop.truth["pads"] - 25e3)
