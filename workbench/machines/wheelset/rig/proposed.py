"""The stop that `workbench next` proposes, as the rig makes it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from workbench.errors import InputError
from workbench.machines.wheelset.rig.drive import TRAIN_INERTIA
from workbench.machines.wheelset.rig.scenarios import (
    DISC_TEMPERATURE,
    FRICTION,
    WHEEL_LOAD,
    Conditions,
    Scenario,
    Surface,
)
from workbench.machines.wheelset.rig.sensors import FURTHER
from workbench.runtime.files import parse_table, read_text
from workbench.studies.design.candidates import Profile
from workbench.system.system import System

_NAME = "30_next"
_SURFACES: Mapping[str, Surface] = {"dry": "dry", "wet": "wet"}
_DEMAND = np.arange(0.0, 90.0, 0.05)  # [s] from the first, when a controller asks anew


def proposed_stop(result: Path, system: System) -> Scenario:
    """The best experiment of a result of `workbench next`.

    Parameters
    ----------
    result : folder with next.json.
    """
    file = result / "next.json"
    remedy = "give the folder that 'workbench next' wrote for this rig"
    text = read_text(file, remedy)
    try:
        return stop_of(parse_table(text)["tried"][0], system)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise InputError(
            where=str(file),
            found="no experiment that says speed, direction, surfaces and pressure of a stop",
            expected="what 'workbench next' writes",
            remedy=remedy,
        ) from None


def stop_of(experiment: Mapping[str, Any], system: System) -> Scenario:
    """A stop whose pressure follows the profile of an experiment, as `workbench next` writes it.

    All sensors of the system that the rig may have besides are fitted.

    Raises
    ------
    ValueError, KeyError, TypeError
        If it asks for what the rig cannot do.
    """
    settings, pressures = experiment["conditions"], experiment["inputs"]["pB"]
    if system.experiments is None:
        raise ValueError
    (varied,) = (profile for profile in system.experiments.varied if profile.name == "pB")
    levels = tuple(map(float, pressures["levels"]))
    profile = Profile(varied, str(pressures["profile"]), levels, float(pressures["every"]))
    demand = profile.demand(_DEMAND + varied.begins)
    changes = np.flatnonzero(np.diff(demand)) + 1
    steps = tuple((float(_DEMAND[k]), float(demand[k])) for k in changes)
    direction: Literal[1, -1] = 1 if settings["direction"] > 0 else -1
    rail, *discs = (_SURFACES[surface] for surface in (settings["wheel_rail"], *settings["discs"]))
    if len(discs) != system.condition("discs").count:
        raise ValueError
    conditions = Conditions(
        initial_speed=float(settings["initial_speed"]),
        brake_pressure=float(demand[0]),
        wheel_rail=rail,
        discs=tuple(discs),
        direction=direction,
        wheel_load=float(settings.get("wheel_load", WHEEL_LOAD)),
        disc_temperature=float(settings.get("disc_temperature", DISC_TEMPERATURE)),
    )
    imitated = float(experiment["settings"].get("imitated", TRAIN_INERTIA))
    sensors = tuple(signal.name for signal in system.reference_signals if signal.name in FURTHER)
    # A roller that stops as fast as no train does is a slide to the protection, which would vent.
    protected = imitated >= TRAIN_INERTIA
    return Scenario(
        name=_NAME,
        conditions=conditions,
        muWR=FRICTION[rail],
        patch=None,
        protected=protected,
        steps=steps,
        imitated=imitated,
        lasts=system.experiments.lasts,
        sensors=sensors,
    )
