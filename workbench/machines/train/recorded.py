"""Sets of recorded stops with known faults, diagnosed as those of the virtual train."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from workbench.errors import InputError
from workbench.machines.train.planting import PLANTABLE
from workbench.recordings.datasets import write_cases
from workbench.runtime.files import parse_table, read_text
from workbench.studies.power.planting import Group, Kind, Planting, SheetError

_TRUTH = "truth.json"
_KNOWN = {  # what a truth calls a fault: as it is here, and the size of one of its units
    "pads_axle": ("pads", -1.0),
    "isolated_unit": ("units", 1.0),
    "dragging": ("drag", 1.0),
    "radius_axle": ("radius", 1e-3),
    "speed_delay": ("late", 1.0),
    "cylinder_lag_bogie": ("lag", 1.0),
    "pressure_sensor": ("reading", 1.0),
    "pressure_offset": ("zero", 1e5),
    "glazing": ("glazing", 1.0),
}


@dataclass(frozen=True)
class RecordedTrain:
    """Sets of recorded stops, a `VirtualRig` that makes none: a set's seed is its number."""

    folders: tuple[Path, ...]  # of the sets

    plantables = PLANTABLE
    sheet_errors: ClassVar[tuple[SheetError, ...]] = ()  # none: what was recorded is as it is

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the sets."""
        return tuple(folder.name for folder in self.folders)

    @property
    def groups(self) -> list[Group]:
        """What each set hides, by its truth."""
        return [(_planting(k, folder),) for k, folder in enumerate(self.folders)]

    @property
    def identity(self) -> Mapping[str, Any]:
        """What was recorded."""
        files = (file for folder in self.folders for file in sorted(folder.glob("*/*")))
        whole = hashlib.sha256()
        for file in files:
            whole.update(file.read_bytes())
        return {"sets": list(self.recordings), "recorded": whole.hexdigest()}

    def simulate(self, seed: int, gains: Mapping[str, float]) -> Path:
        """Folder of a set, which was recorded."""
        return self.folders[seed]

    def write(self, simulated: Path, gains: Mapping[str, float], folder: Path) -> None:
        """Make cases of its stops."""
        write_cases("train", simulated, folder)


def recorded_sets(folders: Sequence[Path]) -> RecordedTrain:
    """Sets of stops: folders with a `truth.json`, or folders of such."""
    all_sets: list[Path] = []
    for folder in folders:
        inner = [folder, *sorted(path for path in folder.glob("*") if path.is_dir())]
        sets = [path for path in inner if (path / _TRUTH).is_file()]
        if not sets:
            raise InputError(
                where=str(folder),
                found=f"no set with a {_TRUTH}",
                expected="folders of stops, each with what is wrong in them",
                remedy="name the folder that holds them",
            )
        all_sets += sets
    rig = RecordedTrain(tuple(all_sets))
    _ = rig.groups  # a truth that is not understood is refused here
    return rig


def _planting(number: int, folder: Path) -> Planting:
    path, known = folder / _TRUTH, {plantable.name: plantable for plantable in PLANTABLE}
    try:
        effects = parse_table(read_text(path, "name another folder"))["effects"]
        gains = {}
        for name, fault in effects.items():
            own, unit = _KNOWN[name]
            place = f"[{int(fault['at'])}]" if "at" in fault else ""
            gains[own + place] = unit * float(fault["size"])
        planted = [known[name] for name in gains]
    except (
        ValueError,
        ArithmeticError,
        KeyError,
        TypeError,
        AttributeError,
        RecursionError,
    ) as error:
        raise InputError(
            where=str(path),
            found=f"a truth that is not understood ({type(error).__name__}: {error})",
            expected=f'"effects" of some of {", ".join(_KNOWN)}, each with "size" and "at"',
            remedy="correct it, or leave the set out",
        ) from None
    kinds: tuple[Kind, ...] = ("clean", "single", "pair")
    multiple = min(
        (abs(gains[plantable.name]) / plantable.unit_size for plantable in planted), default=0.0
    )
    kind, names = kinds[min(len(gains), 2)], tuple(plantable.effect for plantable in planted)
    return Planting(kind, number, multiple, gains, names)
