"""A recorder's file as signals, by what was confirmed before or what is certain."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workbench.errors import InputError
from workbench.foreign import RecordedFile, read_foreign
from workbench.mapping.merge import Measured, merge
from workbench.mapping.names import TIME, NamedChannel, read_named
from workbench.mapping.proposal import ProposedMapping, propose
from workbench.recording import header
from workbench.system import System
from workbench.tables import read_table

COLUMNS = "columns.toml"  # which channels are which signals, in all files of a folder


@dataclass(frozen=True)
class Told:
    """What a user says of a recording that its file does not say.

    Attributes
    ----------
    conditions : as `case.toml` has them.
    columns : channels by signal.
    step : between two samples [s].
    """

    conditions: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, NamedChannel] = field(default_factory=dict)
    step: float | None = None


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
    for group in (group for one in files for group in one.groups):
        for channel in group.channels:
            units[channel.name] = units[f"{group.name}/{channel.name}"] = channel.unit
    return {
        signal: one
        for signal, one in stored.items()
        if one.channel in units
        and (not one.unit or not units[one.channel] or one.unit == units[one.channel])
    }


def has_own_names(path: Path, system: System) -> bool:
    """Whether the first line of a CSV has the system's own names."""
    try:
        with path.open("rb") as stream:
            line = stream.readline(1 << 16).decode("utf-8-sig", "replace")
    except OSError:
        return True  # the strict reader says what is wrong
    names = {header(cell)[0] for cell in re.split("[,;\t]", line)}
    return {TIME, *(one.name for one in (*system.inputs, *system.outputs))} <= names


def read_measured(
    path: Path, system: System, told: Told, stored: Mapping[str, NamedChannel]
) -> Measured:
    """Read a file whose channels were confirmed, or are named as the signals are.

    Parameters
    ----------
    stored : channels that were confirmed for the folder; those of `told` win.

    Raises
    ------
    InputError
        If the file cannot be read, or somebody must say what its channels are.
    """
    recorded = read_foreign(path)
    known = {**usable(stored, [recorded]), **told.columns}
    proposal = propose([recorded], system, known, told.step)
    if not proposal.certain:
        raise _unsure(path, proposal)
    return merge([recorded], proposal, system)


def _unsure(path: Path, proposal: ProposedMapping) -> InputError:
    proposed = [
        f"{name} = {one.channel.name} [{one.unit}]"
        for name, one in proposal.assigned.items()
        if not one.certain
    ]
    found = [*proposal.problems, *(f"perhaps {one}" for one in proposed)]
    found += [
        f"perhaps time = {clock.channel} [{clock.unit}]"
        if clock.channel
        else f"perhaps time {clock.reason}"
        for clock in proposal.clocks.values()
        if not clock.certain
    ]
    return InputError(
        where=str(path),
        found=f"channels that nobody confirmed: {'; '.join(found)}",
        expected="the system's own names with units, or channels that are named",
        remedy=f"run 'workbench import {path} --out CASES', which asks, or name them with --column",
    )
