"""What is known of channels and conditions beside the files: told now, or confirmed before."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workbench.recordings.channels.names import NamedChannel, read_named
from workbench.recordings.formats import RecordedFile
from workbench.system.system import System
from workbench.system.tables import read_table

COLUMNS = "columns.toml"  # which channels are which signals, in all files of a folder


@dataclass(frozen=True)
class Told:
    """What a user says of a recording that its file does not say.

    Attributes
    ----------
    conditions : as `case.toml` has them.
    columns : channels by signal.
    step : between two samples [s].
    apart : whether sheets or groups with the same channels are recordings of their own, whatever
        their times; None: if their times tell; False: they are one recording.
    """

    conditions: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, NamedChannel] = field(default_factory=dict)
    step: float | None = None
    apart: bool | None = None


def stored_columns(folder: Path, system: System) -> dict[str, NamedChannel]:
    """Channels by signal that were confirmed for a folder; empty where none were.

    Raises
    ------
    InputError
        If the file is no TOML, or names no signal of the system.
    """
    path = folder / COLUMNS
    if not path.is_file():
        return {}
    table = read_table(path, "correct the file", "[columns]")
    table.refuse_unknown("columns")
    return read_named(table.table("columns"), system)


def usable(
    stored: Mapping[str, NamedChannel], files: Sequence[RecordedFile]
) -> dict[str, NamedChannel]:
    """Of stored channels those that some files have, in no other unit than what was confirmed."""
    units: dict[str, str] = {}
    for group in (group for file in files for group in file.groups):
        for channel in group.channels:
            units[channel.name] = units[f"{group.name}/{channel.name}"] = channel.unit
    return {
        signal: one
        for signal, one in stored.items()
        if one.channel in units
        and (not one.unit or not units[one.channel] or one.unit == units[one.channel])
    }
