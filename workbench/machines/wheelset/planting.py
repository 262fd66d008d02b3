"""Effects that the virtual rig injects, with their names in the library."""

import dataclasses
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.errors import InputError
from workbench.machines.wheelset import rig
from workbench.machines.wheelset.rig import (
    CONSTANT_PADS,
    STANDARD,
    Effects,
    Scenario,
    StopTruth,
    plant,
    select,
    simulate,
    stop_of,
    write_recording,
)
from workbench.models.fmu import CoSimulation
from workbench.studies.power.planting import Plantable, SheetError
from workbench.system.system import System

_RATE = 200  # [Hz] of the recordings
_USUAL = STANDARD[:6]  # dry
_FIELDS = {field.name: field.metadata for field in dataclasses.fields(Effects)}
_FILM = {"E0": 0.45e6}


def _plantable(name: str, effect: str = "", **known: Any) -> Plantable:
    unit, least = _FIELDS[name]["unit"], _FIELDS[name]["least"]
    return Plantable(name, unit, effect, least, **known)


PLANTABLE = (
    _plantable("speed_friction", "SpeedDependentPadFriction"),
    _plantable("pressure_exponent", "PressureDependentPadFriction"),
    _plantable("fade", "BrakeFade"),
    _plantable("water_film", "WaterFilm", signed=False, shapes=_FILM),
    _plantable("single_disc_film", "SingleDiscWaterFilm", signed=False, shapes=_FILM),
    _plantable("bedding_in", "BeddingIn", shapes={"tau": 2.0}),
    _plantable("disc_thickness", "DiscThicknessVariation", signed=False),
    _plantable("cylinder_lag", "CylinderLag", signed=False),
    _plantable("caliper_hysteresis", "CaliperHysteresis", signed=False),
    _plantable("return_spring", "ReturnSpringPressure"),
    _plantable("pressure_offset", "PressureSensorOffset", sensed=True),
    _plantable("wheel_radius", "WheelRadius"),
    _plantable("roller_radius", "RollerRadius"),
    _plantable("out_of_round", "OutOfRoundWheel", signed=False),
    _plantable("wheel_load", "WheelLoad"),
    _plantable("creep_stiffness", "CreepStiffness"),
    _plantable("wheel_inertia", "WheelInertia"),
    _plantable("roller_inertia", "RollerInertia"),
    _plantable("torque_gain", "DriveTorqueGain", sensed=True),
    _plantable("adhesion_recovery", "AdhesionRecovery", signed=False, shapes={"Er": 250e3}),
    _plantable("falling_friction", "FallingFriction"),
    _plantable("wheelset_losses", "WheelsetLosses"),
    _plantable("roller_losses", "RollerLosses"),
    _plantable("fx_gain", "FxGain", sensed=True),
    _plantable("fx_offset", "FxOffset", sensed=True),
    _plantable("apex_offset", "ApexOffset", sensed=True),
    _plantable("speed_delay", "SpeedSignalDelay", sensed=True),
    _plantable("pole_ring", "PoleRingEccentricity", signed=False, sensed=True),
    _plantable("time_skew", "LoggerTimeSkew[speeds]", sensed=True),
    # Sizes that disturb the balances about as much as those above.
    _plantable("friction_step", unit_size=0.01, slot="padFriction"),
    _plantable("friction_ripple", unit_size=0.01, slot="padFriction"),
    _plantable("friction_deceleration", unit_size=0.01, slot="padFriction"),
    _plantable("drive_beat", sensed=True, unit_size=0.005, slot="driveTorque"),
    _plantable("force_drift", sensed=True, unit_size=2.0, slot="forceSensor"),
)

# More than a careful sheet has wrong: a mode is measured to 10 %, an inertia computed to 1 %.
SHEET_ERRORS = (
    *(SheetError("structure", gain) for gain in (0.25, -0.25)),
    *(SheetError("creep_stiffness", gain, "CreepStiffness") for gain in (0.1, -0.1)),
    *(SheetError("roller_inertia", gain, "RollerInertia") for gain in (0.015, -0.015)),
    SheetError("noise", 2.0),
    SheetError("tolerances", 1.0),
)


@dataclass(frozen=True)
class PlantedStops:
    """Sets of stops on constant pads, a `VirtualRig`."""

    scenarios: tuple[Scenario, ...]  # the stops of a set
    reference: Path  # multibody model, a Co-Simulation FMU

    plantables = PLANTABLE
    sheet_errors = SHEET_ERRORS

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the stops."""
        return tuple(scenario.name for scenario in self.scenarios)

    @property
    def identity(self) -> Mapping[str, Any]:
        """Stops, model and code."""
        code = sorted(file for folder in rig.__path__ for file in Path(folder).glob("*.py"))
        return {
            "scenarios": [repr(scenario) for scenario in self.scenarios],
            "reference": hashlib.sha256(self.reference.read_bytes()).hexdigest(),
            "rig": hashlib.sha256(b"".join(file.read_bytes() for file in code)).hexdigest(),
        }

    def following(self, experiment: Mapping[str, Any], system: System) -> "PlantedStops":
        """The rig that makes an experiment of `workbench next`."""
        return dataclasses.replace(self, scenarios=(stop_of(experiment, system),))

    def simulate(self, seed: int, gains: Mapping[str, float]) -> list[StopTruth]:
        """What happens in the stops."""
        effects = _effects(gains)
        return [simulate(scenario, seed, effects, self.reference) for scenario in self.scenarios]

    def write(
        self, simulated: Sequence[StopTruth], gains: Mapping[str, float], folder: Path
    ) -> None:
        """Write what the sensors make of them."""
        for stop in simulated:
            write_recording(stop, _effects(gains), _RATE, folder / stop.scenario.name)


def virtual_rig(names: Sequence[str], model: Path | None) -> PlantedStops:
    """Stops by name, the six dry standard ones if none is named.

    Raises
    ------
    InputError
        If there is no stop of a name, or the model is no FMU for Co-Simulation.
    """
    if model is None:
        raise InputError(
            where="system file, [models]",
            found="no reference model",
            expected="the multibody model, which makes the stops",
            remedy="name it, or give --reference",
        )
    scenarios = tuple(select(names or _USUAL))
    with CoSimulation(model):
        pass  # a file that is no FMU is refused here, once
    return PlantedStops(scenarios, model)


def _effects(gains: Mapping[str, float]) -> Effects:
    return plant(CONSTANT_PADS, [f"{name}={gain!r}" for name, gain in gains.items()])
