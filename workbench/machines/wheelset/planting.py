"""What can be planted in stops of the virtual rig, and what the library calls it."""

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
_USUAL = (
    *("01_dry_80_1.5", "02_dry_100_2.7", "03_dry_120_3.6", "04_dry_160_4.2"),
    *("05_dry_120_2.7_rev", "06_dry_160_3.6_rev"),
)
_FIELDS = {field.name: field.metadata for field in dataclasses.fields(Effects)}
_FILM = {"E0": 0.45e6}


def _one(name: str, effect: str = "", **known: Any) -> Plantable:
    unit, least = _FIELDS[name]["unit"], _FIELDS[name]["least"]
    return Plantable(name, unit, effect, least, **known)


PLANTABLE = (
    _one("speed_friction", "SpeedDependentPadFriction"),
    _one("pressure_exponent", "PressureDependentPadFriction"),
    _one("fade", "BrakeFade"),
    _one("water_film", "WaterFilm", signed=False, shapes=_FILM),
    _one("single_disc_film", "SingleDiscWaterFilm", signed=False, shapes=_FILM),
    _one("bedding_in", "BeddingIn", shapes={"tau": 2.0}),
    _one("disc_thickness", "DiscThicknessVariation", signed=False),
    _one("cylinder_lag", "CylinderLag", signed=False),
    _one("caliper_hysteresis", "CaliperHysteresis", signed=False),
    _one("return_spring", "ReturnSpringPressure"),
    _one("pressure_offset", "PressureSensorOffset", sensed=True),
    _one("wheel_radius", "WheelRadius"),
    _one("roller_radius", "RollerRadius"),
    _one("out_of_round", "OutOfRoundWheel", signed=False),
    _one("wheel_load", "WheelLoad"),
    _one("creep_stiffness", "CreepStiffness"),
    _one("wheel_inertia", "WheelInertia"),
    _one("roller_inertia", "RollerInertia"),
    _one("torque_gain", "DriveTorqueGain", sensed=True),
    _one("adhesion_recovery", "AdhesionRecovery", signed=False, shapes={"Er": 250e3}),
    _one("falling_friction", "FallingFriction"),
    _one("wheelset_losses", "WheelsetLosses"),
    _one("roller_losses", "RollerLosses"),
    _one("fx_gain", "FxGain", sensed=True),
    _one("fx_offset", "FxOffset", sensed=True),
    _one("apex_offset", "ApexOffset", sensed=True),
    _one("speed_delay", "SpeedSignalDelay", sensed=True),
    _one("pole_ring", "PoleRingEccentricity", signed=False, sensed=True),
    _one("time_skew", "LoggerTimeSkew[speeds]", sensed=True),
    # Sizes that disturb the balances about as much as those above.
    _one("friction_step", unit_size=0.01, slot="padFriction"),
    _one("friction_ripple", unit_size=0.01, slot="padFriction"),
    _one("friction_deceleration", unit_size=0.01, slot="padFriction"),
    _one("drive_beat", sensed=True, unit_size=0.005, slot="driveTorque"),
    _one("force_drift", sensed=True, unit_size=2.0, slot="forceSensor"),
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
    """Sets of stops on constant pads, a `VirtualRig`.

    Attributes
    ----------
    scenarios : the stops of a set.
    reference : multibody model, a Co-Simulation FMU.
    """

    scenarios: tuple[Scenario, ...]
    reference: Path

    @property
    def plantables(self) -> tuple[Plantable, ...]:
        """What can be planted."""
        return PLANTABLE

    @property
    def sheet_errors(self) -> tuple[SheetError, ...]:
        """What the data sheet may have wrong."""
        return SHEET_ERRORS

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
