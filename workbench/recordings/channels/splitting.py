"""Which recordings files hold: one by several recorders, or one in each sheet, group or structure.

Where parts of a file hold the same channels, each with times of its own, each is a recording, and
what is said of channels holds for all of them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.recordings.channels.names import TIME, NamedChannel, RecordingOptions, listed, usable
from workbench.recordings.channels.proposal import ProposedMapping, propose
from workbench.recordings.formats import Group, RecordedFile
from workbench.recordings.formats.stamps import iso
from workbench.system.system import System

_Signature = tuple[tuple[tuple[str, NamedChannel], ...], tuple[str, ...], frozenset[str]]
_SAME = 1e-3  # of how far an output goes: repeated experiments differ by more, filters by less
_COPIED = 0.9  # of all rows: cut out of a longer recording
_FEW = 10  # rows that differ, of which by chance most may be in another recording
_NEAR = 0.1  # of a recording's length: how long after its own zero it may begin
_DATE, _CLOCK = "date", "clock"
_CHOICE = ": they are two recordings, --apart, or one, of which channels are named GROUP/CHANNEL"


@dataclass(frozen=True, eq=False)
class ProposedRecording:
    """One recording, with the channels that are proposed for it."""

    name: str  # of the sheet, group or structure that holds it; empty: the files hold it alone
    files: tuple[RecordedFile, ...]  # that hold it, without what other recordings hold
    proposal: ProposedMapping

    @property
    def where(self) -> str:
        """Files and sheet, for messages."""
        return where(self.files, self.name)


@dataclass(frozen=True, eq=False)
class ProposedRecordings:
    """All recordings of some files."""

    held: tuple[ProposedRecording, ...]  # those that can be imported, in the order of the file
    refused: tuple[InputError, ...] = ()  # why others cannot
    beside: tuple[str, ...] = ()  # what else the file holds, in words

    @property
    def certain(self) -> bool:
        """Whether nobody need be asked."""
        return all(recording.proposal.certain for recording in self.held)

    @property
    def problems(self) -> list[str]:
        """Why signals that are needed have no channel, in words."""
        return _once(recording.proposal.problems for recording in self.held)

    @property
    def doubts(self) -> list[str]:
        """What somebody must confirm, in words."""
        return _once(recording.proposal.doubts for recording in self.held)

    @property
    def unmatched(self) -> list[str]:
        """Why channels are not taken for signals that recordings may be without, in words."""
        return _once(recording.proposal.unmatched for recording in self.held)

    @property
    def left(self) -> list[str]:
        """Channels that nobody takes."""
        return _once(recording.proposal.left for recording in self.held)

    @property
    def named(self) -> dict[str, NamedChannel]:
        """Channels by signal, as they are stored; the first recording that has one tells."""
        channels: dict[str, NamedChannel] = {}
        for recording in self.held:
            channels = {**recording.proposal.named, **channels}
        return channels


def _once(lists: Iterable[Iterable[str]]) -> list[str]:
    return list(dict.fromkeys(text for texts in lists for text in texts))


def where(files: Sequence[RecordedFile], name: str) -> str:
    """Files and the part of them that is meant, for messages."""
    paths = ", ".join(str(file.path) for file in files)
    return f"{paths}, '{name}'" if name else paths


def propose_recordings(
    files: Sequence[RecordedFile],
    system: System,
    stored: Mapping[str, NamedChannel],
    options: RecordingOptions,
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
    whole = _propose_part("", files, system, stored, options)
    settled = isinstance(whole, ProposedRecording) and not whole.proposal.problems
    single = options.apart is False or len(files) > 1 or settled or _names_a_group(options, files)
    parts = None if single else _recordings_within(files[0], system, stored, options)
    if parts is not None:
        doubt = "" if options.apart else at_one_time(parts.held, system)
        if not doubt:
            return parts
        if not parts.problems:
            whole = _with_doubt(whole, doubt, files)
    if isinstance(whole, InputError):
        raise whole
    return ProposedRecordings((whole,))


def _propose_part(
    name: str,
    files: Sequence[RecordedFile],
    system: System,
    stored: Mapping[str, NamedChannel],
    options: RecordingOptions,
) -> ProposedRecording | InputError:
    """Some files or parts of them as one recording, or why they cannot be proposed as one."""
    try:
        known = {**usable(stored, files), **options.columns}
        return ProposedRecording(name, tuple(files), propose(files, system, known, options.step))
    except InputError as error:
        return error


def _names_a_group(options: RecordingOptions, files: Sequence[RecordedFile]) -> bool:
    """Whether the user chooses among groups: GROUP/NAME."""
    groups = [group for file in files for group in file.groups]
    names = {channel.name for group in groups for channel in group.channels}
    full = {f"{group.name}/{channel.name}" for group in groups for channel in group.channels}
    return any(column.channel in full - names for column in options.columns.values())


def _with_doubt(
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


def _recordings_within(
    file: RecordedFile,
    system: System,
    stored: Mapping[str, NamedChannel],
    options: RecordingOptions,
) -> ProposedRecordings | None:
    """The recordings of a file whose parts hold the same channels; None: it has no such parts."""
    for depth in range(1, 1 + max(len(group.within) for group in file.groups)):
        parts: dict[tuple[str, ...], list[Group]] = {}
        for group in file.groups:
            parts.setdefault(group.within[:depth], []).append(group)
        outcomes: dict[str, ProposedRecording | InputError] = {}
        held: dict[str, RecordedFile] = {}
        for path, groups in parts.items():
            name = "/".join(path) or file.path.name  # what stands outside of all others
            held[name] = replace(file, groups=tuple(groups))
            outcomes[name] = _propose_part(name, [held[name]], system, stored, options)
        alike = _same_channels(
            [
                recording
                for recording in outcomes.values()
                if isinstance(recording, ProposedRecording)
            ],
            system,
        )
        if alike:
            return _sorted_out(alike, outcomes, held, system)
    return None


def _needed_signals(system: System) -> list[str]:
    return [signal.name for signal in (*system.inputs, *system.outputs)]


def _same_channels(
    outcomes: Sequence[ProposedRecording], system: System
) -> list[ProposedRecording]:
    """Most of those that hold the same channels, at least two; those without problems first."""
    classes: dict[_Signature, list[ProposedRecording]] = {}
    for recording in outcomes:
        # A part with fewer channels than a recording has signals is that of one logger.
        if not recording.proposal.problems or len(_names(recording.files[0])) >= len(
            _needed_signals(system)
        ):
            classes.setdefault(_signature(recording, system), []).append(recording)
    several = [held for held in classes.values() if len(held) > 1]
    complete = [held for held in several if not held[0].proposal.problems]
    return max(complete or several, key=len, default=[])


def _signature(recording: ProposedRecording, system: System) -> _Signature:
    """Channels of all signals that are needed; where some have none, the names of all channels.

    A unit that was named for all sheets is not taken for one that states another.
    """
    named, proposal = recording.proposal.named, recording.proposal
    needed = tuple(
        (name, named[name]) for name in (TIME, *_needed_signals(system)) if name in named
    )
    names = _names(recording.files[0]) if proposal.problems else frozenset()
    return needed, proposal.contradictions, names


def _names(file: RecordedFile) -> frozenset[str]:
    return frozenset(channel.name for group in file.groups for channel in group.channels)


def _sorted_out(
    alike: Sequence[ProposedRecording],
    outcomes: Mapping[str, ProposedRecording | InputError],
    held: Mapping[str, RecordedFile],
    system: System,
) -> ProposedRecordings:
    """Recordings, and of what else the file holds which parts look like further ones."""
    first = alike[0].proposal
    taken = {
        first.assigned[name].channel.name for name in _needed_signals(system) if name in first.named
    }
    refused: list[InputError] = []
    beside: list[str] = []
    for name, outcome in outcomes.items():
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
        replace(
            recording, files=tuple(replace(f, notes=(*f.notes, *notes)) for f in recording.files)
        )
        for recording in alike
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
        problem, remedy = outcome.found, outcome.remedy
    else:
        differences = _differences(outcome, first, system)
        proposal = outcome.proposal
        problem = "; ".join([*proposal.problems, *differences, *proposal.contradictions])
        remedy = "give it the names and units of the others, or --column 'SIGNAL=CHANNEL [unit]'"
    return InputError(
        where=where([file], name),
        found=problem,
        expected=f"the channels of '{first.name}'",
        remedy=f"{remedy}; or name its channels alone, --column 'SIGNAL={name}/CHANNEL'",
    )


def _differences(
    recording: ProposedRecording, other: ProposedRecording, system: System
) -> Iterator[str]:
    """Channels that are not those of another recording, in words."""
    named, others = recording.proposal.named, other.proposal.named
    for signal in (TIME, *_needed_signals(system)):
        if signal in named and named[signal] != others.get(signal):
            own, theirs = (
                f"'{held.channel}'{f' [{held.unit}]' * bool(held.unit)}" if held else "-"
                for held in (named[signal], others.get(signal))
            )
            yield f"{signal}: {own}, in '{other.name}' {theirs}"


@dataclass(frozen=True)
class _Span:
    """First and last time of a part [s], on a clock that others may share."""

    clock: str
    begin: float
    end: float

    def meets(self, other: "_Span") -> bool:
        """Whether both were recorded at one time."""
        alike = self.clock == other.clock
        return alike and self.begin < other.end and other.begin < self.end

    def __str__(self) -> str:
        if self.clock == _DATE:
            return f"{iso(self.begin)} to {iso(self.end)}"
        return f"{self.begin:.9g} s to {self.end:.9g} s"


def at_one_time(parts: Sequence[ProposedRecording], system: System) -> str:
    """Why it cannot be told whether parts are recordings of their own, in words; empty: they are.

    Times that count from a zero within them are of a recording of their own.
    """
    spans = [_span(part) for part in parts]
    rows = [_rows(part, system) for part in parts]
    for i, j in combinations(range(len(parts)), 2):
        names = f"'{parts[i].name}' and '{parts[j].name}'"
        span, other = spans[i], spans[j]
        if span and other and span.meets(other):
            return f"{names} hold the same channels at one time, {span} and {other}{_CHOICE}"
        short, long = sorted((rows[i], rows[j]), key=np.size)
        same = _same_output(parts[i], parts[j], system)
        if not same and short.size > _FEW and np.isin(short, long).mean() >= _COPIED:
            same = "all signals"
        if same:
            return f"{names} hold the same samples of {same}{_CHOICE}"
    return ""


def _span(recording: ProposedRecording) -> _Span | None:
    """When a part was recorded; None: its times count from a zero of their own."""
    for key, clock in recording.proposal.clocks.items():
        group = recording.files[key[0]].groups[key[1]]
        channels = [channel for channel in (group.time, *group.channels) if channel is not None]
        shown = [c for c in channels if np.isfinite([c.start, c.shown]).any()]
        times, zero, scale = clock.times, 0.0, _CLOCK
        if shown:
            dated = np.isfinite(shown[0].start)
            times, scale = shown[0].values, _DATE if dated else _CLOCK
            zero = shown[0].start if dated else shown[0].shown
        held = np.sort(times[np.isfinite(times)]) + zero
        if held.size > 1:
            begin, end = float(held[0]), float(held[-1])
            own_zero = begin <= _NEAR * (end - begin) and end >= 0.0
            if scale == _DATE or not own_zero:
                return _Span(scale, begin, end)
    return None


def _same_output(recording: ProposedRecording, other: ProposedRecording, system: System) -> str:
    """An output that goes the same way in both, counted from their first samples; or none."""
    for signal in system.outputs:
        if not all(signal.name in part.proposal.assigned for part in (recording, other)):
            continue
        (t, x), (u, y) = (_samples(part, signal.name) for part in (recording, other))
        near = u <= t[-1]
        with np.errstate(over="ignore", invalid="ignore"):  # what no machine reads
            spread = float(np.std(y[near]))
            distance = float(np.sqrt(np.mean((np.interp(u[near], t, x) - y[near]) ** 2)))
        if near.sum() > _FEW and spread > 0.0 and distance <= _SAME * spread:
            return signal.name
    return ""


def _samples(part: ProposedRecording, signal: str) -> tuple[Vector, Vector]:
    """Times from the first sample [s], and values, SI, where there are any."""
    assignment = part.proposal.assigned[signal]
    times, values = part.proposal.clocks[assignment.file, assignment.group].times, assignment.values
    held = np.isfinite(times) & np.isfinite(values)
    if not held.any():
        return np.zeros(1), np.zeros(1)
    return times[held] - times[held][0], values[held]


def _rows(part: ProposedRecording, system: System) -> Vector:
    """A number for each row of signals that differs from all others; empty if rates differ."""
    needed = [signal.name for signal in (*system.inputs, *system.outputs)]
    held = [part.proposal.assigned[name] for name in needed if name in part.proposal.assigned]
    if not held or len({(channel.file, channel.group) for channel in held}) > 1:
        return np.empty(0)
    weights = np.sqrt(np.arange(2.0, 2.0 + len(held)))
    with np.errstate(over="ignore", invalid="ignore"):
        sums = (np.column_stack([channel.values for channel in held]) * weights).sum(axis=1)
    return np.unique(sums[np.isfinite(sums)])
