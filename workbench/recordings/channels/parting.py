"""Which recordings files hold: one by several recorders, or one in each sheet, group or structure.

Where parts of a file hold the same channels, each with times of its own, each is a recording, and
what is said of channels holds for all of them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from workbench.errors import InputError
from workbench.recordings.channels.names import TIME, NamedChannel, listed
from workbench.recordings.channels.proposal import propose
from workbench.recordings.channels.recordings import ProposedRecording, ProposedRecordings, where
from workbench.recordings.channels.simultaneous import at_one_time
from workbench.recordings.channels.told import Told, usable
from workbench.recordings.formats import Group, RecordedFile
from workbench.system.system import System

_Signature = tuple[tuple[tuple[str, NamedChannel], ...], tuple[str, ...], frozenset[str]]


def propose_recordings(
    files: Sequence[RecordedFile],
    system: System,
    stored: Mapping[str, NamedChannel],
    told: Told,
) -> ProposedRecordings:
    """Propose recordings, and channels for each.

    Files are one recording where their channels tell it, as they do if one sheet alone holds them.
    Where it cannot be told whether parts of a file are recordings of their own, that is a problem
    of the one.

    Parameters
    ----------
    files : one by itself, or those that several recorders wrote of one recording.
    stored : channels that were confirmed before; those that are told win.

    Raises
    ------
    InputError
        As `propose`; or if it cannot be told whether parts of a file are recordings of their own.
    """
    whole = _tried("", files, system, stored, told)
    settled = isinstance(whole, ProposedRecording) and not whole.proposal.problems
    one = told.apart is False or len(files) > 1 or settled or _names_a_group(told, files)
    found = None if one else _apart(files[0], system, stored, told)
    if found is not None:
        doubt = "" if told.apart else at_one_time(found.held, system)
        if not doubt:
            return found
        if not found.problems:
            whole = _doubted(whole, doubt, files)
    if isinstance(whole, InputError):
        raise whole
    return ProposedRecordings((whole,))


def _tried(
    name: str,
    files: Sequence[RecordedFile],
    system: System,
    stored: Mapping[str, NamedChannel],
    told: Told,
) -> ProposedRecording | InputError:
    """Some files or parts of them as one recording, or why they cannot be proposed as one."""
    try:
        known = {**usable(stored, files), **told.columns}
        return ProposedRecording(name, tuple(files), propose(files, system, known, told.step))
    except InputError as error:
        return error


def _names_a_group(told: Told, files: Sequence[RecordedFile]) -> bool:
    """Whether the user chooses among groups: GROUP/NAME."""
    groups = [group for file in files for group in file.groups]
    names = {channel.name for group in groups for channel in group.channels}
    full = {f"{group.name}/{channel.name}" for group in groups for channel in group.channels}
    return any(column.channel in full - names for column in told.columns.values())


def _doubted(
    whole: ProposedRecording | InputError, doubt: str, files: Sequence[RecordedFile]
) -> ProposedRecording | InputError:
    """Files as one recording, where parts of them may be recordings of their own."""
    if isinstance(whole, ProposedRecording):
        return replace(whole, proposal=replace(whole.proposal, problems=(doubt,)))
    return InputError(
        where=where(files, ""),
        found=doubt,
        expected="recordings one after the other, or channels that were measured once",
        remedy="say --apart if each is a recording of its own; else name the channels of one, "
        "--column 'SIGNAL=GROUP/CHANNEL'",
    )


def _apart(
    file: RecordedFile, system: System, stored: Mapping[str, NamedChannel], told: Told
) -> ProposedRecordings | None:
    """The recordings of a file whose parts hold the same channels; None: it has no such parts."""
    for depth in range(1, 1 + max(len(group.within) for group in file.groups)):
        parts: dict[tuple[str, ...], list[Group]] = {}
        for group in file.groups:
            parts.setdefault(group.within[:depth], []).append(group)
        tried: dict[str, ProposedRecording | InputError] = {}
        held: dict[str, RecordedFile] = {}
        for path, groups in parts.items():
            name = "/".join(path) or file.path.name  # what stands outside of all others
            held[name] = replace(file, groups=tuple(groups))
            tried[name] = _tried(name, [held[name]], system, stored, told)
        alike = _alike(
            [one for one in tried.values() if isinstance(one, ProposedRecording)], system
        )
        if alike:
            return _sorted_out(alike, tried, held, system)
    return None


def _needed(system: System) -> list[str]:
    return [signal.name for signal in (*system.inputs, *system.outputs)]


def _alike(tried: Sequence[ProposedRecording], system: System) -> list[ProposedRecording]:
    """Most of those that hold the same channels, at least two; those without problems first."""
    classes: dict[_Signature, list[ProposedRecording]] = {}
    for one in tried:
        # A part with fewer channels than a recording has signals is that of one logger.
        if not one.proposal.problems or len(_names(one.files[0])) >= len(_needed(system)):
            classes.setdefault(_signature(one, system), []).append(one)
    several = [held for held in classes.values() if len(held) > 1]
    complete = [held for held in several if not held[0].proposal.problems]
    return max(complete or several, key=len, default=[])


def _signature(recording: ProposedRecording, system: System) -> _Signature:
    """Channels of all signals that are needed; where some have none, the names of all channels.

    A unit that was named for all sheets is not taken for one that states another.
    """
    named, proposal = recording.proposal.named, recording.proposal
    needed = tuple((name, named[name]) for name in (TIME, *_needed(system)) if name in named)
    names = _names(recording.files[0]) if proposal.problems else frozenset()
    return needed, proposal.contradictions, names


def _names(file: RecordedFile) -> frozenset[str]:
    return frozenset(channel.name for group in file.groups for channel in group.channels)


def _sorted_out(
    alike: Sequence[ProposedRecording],
    tried: Mapping[str, ProposedRecording | InputError],
    held: Mapping[str, RecordedFile],
    system: System,
) -> ProposedRecordings:
    """Recordings, and of what else the file holds which parts look like further ones."""
    first = alike[0].proposal
    taken = {first.assigned[name].channel.name for name in _needed(system) if name in first.named}
    refused: list[InputError] = []
    beside: list[str] = []
    for name, outcome in tried.items():
        if outcome in alike:
            continue
        names = _names(held[name])
        # One that lacks little of a recording is told as one; others are something else.
        if 2 * len(taken & names) >= max(1, len(taken)):
            refused.append(_refusal(name, outcome, held[name], alike[0], system))
            beside.append(f"'{name}' is no such recording: {refused[-1].found}")
        else:
            beside.append(f"'{name}' holds other channels: {listed(sorted(names))}")
    notes = tuple(beside)
    recordings = [
        replace(one, files=tuple(replace(f, notes=(*f.notes, *notes)) for f in one.files))
        for one in alike
    ]
    return ProposedRecordings(tuple(recordings), tuple(refused), notes)


def _refusal(
    name: str,
    outcome: ProposedRecording | InputError,
    file: RecordedFile,
    first: ProposedRecording,
    system: System,
) -> InputError:
    """Why a part of a file is no recording, where others are."""
    if isinstance(outcome, InputError):
        found, remedy = outcome.found, outcome.remedy
    else:
        differences = _differences(outcome, first, system)
        proposal = outcome.proposal
        found = "; ".join([*proposal.problems, *differences, *proposal.contradictions])
        remedy = "give it the names and units of the others, or --column 'SIGNAL=CHANNEL [unit]'"
    return InputError(
        where=where([file], name),
        found=found,
        expected=f"the channels of '{first.name}'",
        remedy=f"{remedy}; or name its channels alone, --column 'SIGNAL={name}/CHANNEL'",
    )


def _differences(
    recording: ProposedRecording, other: ProposedRecording, system: System
) -> Iterator[str]:
    """Channels that are not those of another recording, in words."""
    named, others = recording.proposal.named, other.proposal.named
    for signal in (TIME, *_needed(system)):
        if signal in named and named[signal] != others.get(signal):
            own, theirs = (
                f"'{held.channel}'{f' [{held.unit}]' * bool(held.unit)}" if held else "-"
                for held in (named[signal], others.get(signal))
            )
            yield f"{signal}: {own}, in '{other.name}' {theirs}"
