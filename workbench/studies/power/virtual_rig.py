"""What a system's plugin provides for recordings in which effects are injected."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, Self, runtime_checkable

from workbench.errors import InputError
from workbench.studies.power.planting import Group, Plantable, SheetError
from workbench.system.plugins import find_plugin, load
from workbench.system.system import System


class VirtualRig(Protocol):
    """Makes sets of recordings; it is sent to worker processes.

    A plugin opens one by its `virtual_rig(names, model) -> VirtualRig`: the recordings that a set
    is made of, the usual ones if none is named, and the FMU that makes them, None where there is
    none. Wrong names or files it refuses there.
    """

    @property
    def plantables(self) -> tuple[Plantable, ...]:
        """What can be planted."""

    @property
    def sheet_errors(self) -> tuple[SheetError, ...]:
        """Ways in which the machine may differ from its data sheet."""

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings of a set."""

    @property
    def identity(self) -> Mapping[str, Any]:
        """All that recordings depend on besides a seed and what is planted, for JSON."""

    def simulate(self, seed: int, gains: Mapping[str, float]) -> Any:
        """What happens in the recordings of a set; effects that are sensed may change after it."""

    def write(self, simulated: Any, gains: Mapping[str, float], folder: Path) -> None:
        """Write what sensors make of it, as case folders."""


@runtime_checkable
class FollowingRig(VirtualRig, Protocol):
    """A virtual rig that also makes what `workbench next` proposes."""

    def following(self, experiment: Mapping[str, Any], system: System) -> Self:
        """The rig whose only recording is an experiment, as it stands in next.json.

        Raises
        ------
        ValueError, KeyError, TypeError
            If it asks for what the rig cannot do.
        """


def open_virtual_rig(
    system: System,
    names: Sequence[str],
    model: Path | None,
    own: Callable[[], VirtualRig] | None = None,
) -> VirtualRig:
    """The virtual rig of a system.

    Parameters
    ----------
    names : of the recordings of a set; the usual ones if none is named.
    model : FMU that makes them; None where the rig has equations of its own.
    own : makes one of the system's own model, where no plugin has any.
    """
    make = load(find_plugin(system.plugin).virtual_rig)
    if make is None and own is not None:
        return own()
    if make is None:
        raise InputError(
            where=str(system.source),
            found="no plugin that can inject effects",
            expected="a plugin with a 'virtual_rig', which makes recordings",
            remedy='name it as plugin = "...", or choose a system that has one',
        )
    rig: VirtualRig = make(names, model)
    return rig


class RecordedSets(VirtualRig, Protocol):
    """Sets that were recorded, of which somebody says what is wrong in them.

    A plugin reads them by its `recorded_sets(folders) -> RecordedSets`.
    """

    @property
    def groups(self) -> list[Group]:
        """What each set hides."""


def read_recorded_sets(system: System, folders: Sequence[Path]) -> RecordedSets:
    """Recorded sets of a system, with what is wrong in them."""
    read = load(find_plugin(system.plugin).recorded_sets)
    if read is None:
        raise InputError(
            where=f"{system.source}, --recorded",
            found="no plugin that reads what is wrong in recorded sets",
            expected="a plugin with 'recorded_sets'",
            remedy="leave --recorded out: sets are made on the simulated rig",
        )
    sets: RecordedSets = read(folders)
    return sets
