"""Channels of a recorder become signals of a system: proposed, named by the user, merged."""

import re
from collections.abc import Mapping
from pathlib import Path

from workbench.errors import InputError
from workbench.recordings.channels.merge import MergedRecording, merge
from workbench.recordings.channels.names import (
    COLUMNS,
    TIME,
    NamedChannel,
    RecordingOptions,
    listed,
    parse_named,
    read_named,
    stored_columns,
)
from workbench.recordings.channels.proposal import ProposedMapping, propose
from workbench.recordings.channels.splitting import (
    ProposedRecording,
    ProposedRecordings,
    propose_recordings,
)
from workbench.recordings.csv import header
from workbench.recordings.formats import read_recorded_file
from workbench.system.system import System

__all__ = [
    "COLUMNS",
    "TIME",
    "MergedRecording",
    "NamedChannel",
    "ProposedMapping",
    "ProposedRecording",
    "ProposedRecordings",
    "RecordingOptions",
    "has_own_names",
    "listed",
    "merge",
    "parse_named",
    "propose",
    "propose_recordings",
    "read_measured",
    "read_named",
    "stored_columns",
]


def has_own_names(path: Path, system: System) -> bool:
    """Whether the first line of a CSV has the system's own names."""
    try:
        with path.open("rb") as stream:
            line = stream.readline(1 << 16).decode("utf-8-sig", "replace")
    except OSError:
        return True  # the strict reader says what is wrong
    names = {header(cell)[0] for cell in re.split("[,;\t]", line)}
    return {TIME, *(signal.name for signal in (*system.inputs, *system.outputs))} <= names


def read_measured(
    path: Path, system: System, options: RecordingOptions, stored: Mapping[str, NamedChannel]
) -> MergedRecording:
    """Read a file whose channels were confirmed, or are named as the signals are.

    Parameters
    ----------
    stored : channels that were confirmed for the folder; those of `options` win.

    Raises
    ------
    InputError
        If the file cannot be read, holds several recordings, or somebody must say what its
        channels are.
    """
    recorded = read_recorded_file(path)
    proposed = propose_recordings([recorded], system, stored, options)
    if len(proposed.held) > 1:
        names = [f"'{recording.name}'" for recording in proposed.held]
        raise InputError(
            where=str(path),
            found=f"{len(names)} recordings, {listed(names)}",
            expected="one",
            remedy=f"run 'workbench import {path} --out CASES', which makes a case of each, or "
            "name the channels of one, --column 'SIGNAL=GROUP/CHANNEL'",
        )
    (proposal,) = (recording.proposal for recording in proposed.held)
    if not proposal.certain:
        raise _unsure(path, proposal)
    return merge([recorded], proposal, system)


def _unsure(path: Path, proposal: ProposedMapping) -> InputError:
    proposed = [
        f"{name} = {assignment.channel.name} [{assignment.unit}]"
        for name, assignment in proposal.assigned.items()
        if not assignment.certain
    ]
    unconfirmed = [*proposal.problems, *(f"perhaps {proposal}" for proposal in proposed)]
    unconfirmed += [
        f"perhaps time = {clock.channel} [{clock.unit}]"
        if clock.channel
        else f"perhaps time {clock.reason}"
        for clock in proposal.clocks.values()
        if not clock.certain
    ]
    return InputError(
        where=str(path),
        found=f"channels that nobody confirmed: {'; '.join(unconfirmed)}",
        expected="the system's own names with units, or channels that are named",
        remedy=f"run 'workbench import {path} --out CASES', which asks, or name them with --column",
    )
