"""What can be planted in stops of the virtual train, and what the library calls it."""

import dataclasses
import hashlib
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.errors import InputError, require_known
from workbench.machines.train.rig import AXLES, BOGIES, VEHICLES, AskedStop
from workbench.machines.train.stops import (
    DRIES,
    USUAL,
    Faults,
    SimulatedStop,
    draw_train,
    simulate_stop,
    write_stop,
)
from workbench.recordings.datasets import write_cases
from workbench.studies.power.planting import Plantable, SheetError

# A quarter of what is worth a stop in the workshop, so that size 4 is pads with 15 % less friction,
# one unit, a brake with 1500 N.m, a wheel turned by 2.5 mm, a lag of 0.4 s, a sensor a tenth off,
# or with an offset of 0.08 bar, one pole of a hundred, a vehicle of 56 t that is weighed as 49 t, a
# track file that is 4 permille off, a film of water, 12 % less friction of all pads, a wet rail
# that is called dry, an accelerometer that is tilted by 1.2 degrees or reads 8 % more.
_SINGLE = (
    ("pads", "WeakPads", AXLES, "1", 0.15, False),
    ("units", "IsolatedUnit", AXLES, "1", 1.0, False),
    ("drag", "DraggingBrake", AXLES, "N.m", 1500.0, False),
    ("radius", "WheelRadius", AXLES, "m", 2.5e-3, True),
    ("late", "LateSpeed", AXLES, "s", 0.1, False),
    ("lag", "CylinderLag", BOGIES, "s", 0.4, False),
    ("reading", "PressureSensorGain", BOGIES, "1", 0.10, True),
    ("zero", "PressureSensorOffset", BOGIES, "Pa", 8e3, True),
    ("mass", "WrongMass", VEHICLES, "1", 0.15, True),
    ("poles", "PoleCount", AXLES, "1", 0.01, True),
)
_WHOLE = (
    ("gradient", "WrongGradient", "1", 4e-3, True),
    ("water", "WaterFilm", "1", 1.0, False),
    ("glazing", "Glazing", "1", 0.15, False),
    ("all_pads", "AllPads", "1", 0.12, False),
    ("adhesion", "LowAdhesion", "1", 0.3, False),
    ("accelerometer_bias", "AccelerometerBias", "m/s2", 0.2, True),
    ("accelerometer_gain", "AccelerometerGain", "1", 0.08, True),
)
_SHAPES = {"water": {"E0": DRIES}}
PLANTABLE = (
    *(
        Plantable(f"{name}[{i}]", unit, f"{effect}[{i}]", signed=signed, unit_size=size / 4)
        for name, effect, count, unit, size, signed in _SINGLE
        for i in range(1, count + 1)
    ),
    *(
        Plantable(
            name, unit, effect, signed=signed, shapes=_SHAPES.get(name, {}), unit_size=size / 4
        )
        for name, effect, unit, size, signed in _WHOLE
    ),
)
SHEET_ERRORS = (SheetError("noise", 2.0), SheetError("tolerances", 1.0))


@dataclass(frozen=True)
class PlantedTrain:
    """Sets of stops of one train each, a `VirtualRig`."""

    stops: tuple[AskedStop, ...]  # of a set

    plantables = PLANTABLE
    sheet_errors = SHEET_ERRORS

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the stops."""
        return tuple(stop.name for stop in self.stops)

    @property
    def identity(self) -> Mapping[str, Any]:
        """Stops and code."""
        code = sorted(Path(__file__).parent.glob("*.py"))
        return {
            "stops": [repr(stop) for stop in self.stops],
            "rig": hashlib.sha256(b"".join(file.read_bytes() for file in code)).hexdigest(),
        }

    def simulate(self, seed: int, gains: Mapping[str, float]) -> list[tuple[SimulatedStop, int]]:
        """What happens in the stops of one train; each with the seed of its noise."""
        faults = _faults(gains)
        tolerances = draw_train(seed, faults.tolerances)
        return [(simulate_stop(stop, seed, tolerances, faults), seed) for stop in self.stops]

    def write(
        self,
        simulated: Sequence[tuple[SimulatedStop, int]],
        gains: Mapping[str, float],
        folder: Path,
    ) -> None:
        """Write what the train's computer records, read as that of any train."""
        with tempfile.TemporaryDirectory() as recorded:
            for stop, seed in simulated:
                write_stop(stop, seed, _faults(gains), Path(recorded) / stop.stop.name)
            write_cases("train", Path(recorded), folder)


def virtual_rig(names: Sequence[str], model: Path | None) -> PlantedTrain:
    """Stops by name, three dry ones and a wet one if none is named.

    Raises
    ------
    InputError
        If there is no stop of a name, or a model is given: the rig has its own equations.
    """
    known = {stop.name: stop for stop in USUAL}
    require_known(names, known, where="--case {}".format, found="no stop of this name")
    if model is not None:
        raise InputError(
            where=f"--reference {model}",
            found="a model",
            expected="none: this simulated rig has equations of its own",
            remedy="leave it out",
        )
    return PlantedTrain(tuple(stop for stop in USUAL if stop.name in names or not names))


def _faults(gains: Mapping[str, float]) -> Faults:
    faults: dict[str, Any] = {}
    for name, gain in gains.items():
        fault, _, place = name.partition("[")
        if place:
            nothing = getattr(Faults(), fault)
            faults[fault] = faults.get(fault, np.zeros_like(nothing))
            faults[fault][int(place.removesuffix("]")) - 1] = gain
        else:
            faults[fault] = gain
    return dataclasses.replace(Faults(), **faults)
