"""Channels are proposed for signals, as the user names them, then as names and units tell."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from workbench.errors import InputError, closest
from workbench.recordings.channels.clock import Clock, read_clock
from workbench.recordings.channels.matching import (
    Assignment,
    conversion_to,
    doubts_of,
    fitting_units,
    match,
    missing_of,
    samples_of,
    unit_doubt,
    unit_reason,
)
from workbench.recordings.channels.names import (
    TIME,
    NamedChannel,
    PlacedChannel,
    likeness_to,
    listed,
    placed_channels,
)
from workbench.recordings.formats import FileChannel, RecordedFile
from workbench.recordings.formats.spelling import conversion, is_unit
from workbench.recordings.formats.stamps import is_said
from workbench.system.parts import Signal
from workbench.system.system import System

_LEFT_OUT = re.compile(r"'(?P<name>[^']+)' (has|is|holds|states) ")


@dataclass(frozen=True, eq=False)
class ProposedMapping:
    """Which channels of some files are which signals of a system."""

    assigned: Mapping[str, Assignment]  # channels by signal
    # of each group with an assigned channel, by file and group
    clocks: Mapping[tuple[int, int], Clock]
    left: tuple[str, ...]  # channels that nobody takes
    problems: tuple[str, ...]  # why a signal that is needed has no channel, in words
    # why a channel is not taken for a signal that a recording may be without, in words
    unmatched: tuple[str, ...] = ()
    # units that were named and that files contradict, in words
    contradictions: tuple[str, ...] = ()

    @property
    def certain(self) -> bool:
        """Whether it follows from names and units alone."""
        own = all(assignment.certain for assignment in self.assigned.values())
        return not self.problems and own and all(clock.certain for clock in self.clocks.values())

    @property
    def doubts(self) -> list[str]:
        """What somebody must confirm, in words: nobody has said it, nor does a file."""
        texts = [
            f"{name}: {assignment.doubt}"
            for name, assignment in self.assigned.items()
            if assignment.doubt
        ]
        times = {clock.channel: clock.unit for clock in self.clocks.values() if not clock.certain}
        return texts + [
            f"{TIME}: {unit_doubt(TIME, name, unit)}" for name, unit in times.items() if name
        ]

    @property
    def named(self) -> dict[str, NamedChannel]:
        """As it is stored."""
        channels = {name: assignment.named for name, assignment in self.assigned.items()}
        for clock in self.clocks.values():
            if clock.channel:
                unit = clock.stated or ("" if clock.certain else clock.unit)
                channels.setdefault(TIME, NamedChannel(clock.channel, unit))
        return channels


def propose(
    files: Sequence[RecordedFile],
    system: System,
    given: Mapping[str, NamedChannel],
    step: float | None = None,
) -> ProposedMapping:
    """Propose a channel for each signal.

    Parameters
    ----------
    files : that hold one recording, of one or several recorders.
    given : channels that the user names, by signal, and by "time".
    step : between two samples, where the files do not say it [s].

    Raises
    ------
    InputError
        If a named channel is missing or is named twice, or its unit does not fit; or a group that
        holds a signal has no time.
    """
    places = list(placed_channels(files))
    where = ", ".join(str(file.path) for file in files)
    texts = [channel for file in files for group in file.groups for channel in group.left]
    _refuse_texts(given, texts, places, where)
    assigned = {
        name: _as_named(channel, system.signals[name], places, system, where)
        for name, channel in given.items()
        if name != TIME
    }
    _refuse_shared(assigned, where)
    notes = [note for file in files for note in file.notes]
    if TIME in given and given[TIME].channel not in {channel.name for channel in texts}:
        _find(given[TIME], TIME, places, where)
    times = {given[TIME].channel} if TIME in given else set()
    free = [
        place
        for place in places
        if place.channel.name not in times
        and not place.channel.stamp
        and all(place.channel is not other.channel for other in assigned.values())
    ]
    assigned, doubts = match(assigned, free, system)
    problems = tuple(
        f"{signal.name}: {doubts.get(signal.name) or _text_of(signal, texts, notes)}"
        for signal in (*system.inputs, *system.outputs)
        if signal.name not in assigned
    )
    unmatched = tuple(
        f"{signal.name}: {doubts[signal.name]}"
        for signal in system.reference_signals
        if signal.name in doubts and signal.name not in assigned
    )
    clocks = _clocks(assigned, files, given.get(TIME), step, system)
    taken = {id(assignment.channel) for assignment in assigned.values()}
    timed = {clock.channel for clock in clocks.values()}
    left = [p for p in places if id(p.channel) not in taken and p.channel.name not in timed]
    shown = tuple(f"{p.label} [{p.channel.unit}]" if p.channel.unit else p.label for p in left)
    contradictions = tuple(_contradictions(given, assigned, files, clocks, system))
    return ProposedMapping(assigned, clocks, shown, problems, unmatched, contradictions)


def _text_of(signal: Signal, texts: Sequence[FileChannel], notes: Sequence[str]) -> str:
    """Why a signal has no channel: one of its name may hold texts, or was left out."""
    for channel in texts:
        if likeness_to(channel.name, channel.about, signal.names):
            return _held_by(channel)
    for note in notes:  # '...' has a formula that is not understood
        if (match := _LEFT_OUT.match(note)) and likeness_to(match["name"], "", signal.names):
            return note
    return "no channel whose name or unit tells"


def _held_by(channel: FileChannel) -> str:
    """What a channel without numbers holds, in words."""
    if example := next(filter(None, channel.texts), ""):
        return f"'{channel.name}' holds texts such as '{example}', no numbers"
    return (
        f"'{channel.name}' holds nothing; of formulas that were never computed there is no number: "
        "open and save the file in a program of spreadsheets"
    )


def _refuse_texts(
    given: Mapping[str, NamedChannel],
    texts: Sequence[FileChannel],
    places: Sequence[PlacedChannel],
    where: str,
) -> None:
    """Refuse a channel that a user names for a signal, and that holds no numbers."""
    numbers = {place.channel.name for place in places}
    held = {channel.name: channel for channel in texts if channel.name not in numbers}
    for name in (name for name, own in given.items() if name != TIME and own.channel in held):
        raise InputError(
            where=f"{where}, channel '{given[name].channel}'",
            found=_held_by(held[given[name].channel]),
            expected=f"numbers for {name}, in one unit",
            remedy="export it as numbers, in one unit, or name another channel",
        )


def _find(
    channel: NamedChannel, signal: str, places: Sequence[PlacedChannel], where: str
) -> PlacedChannel:
    """The place that a user names."""
    name = channel.channel
    candidates = [place for place in places if place.channel.name == name]
    candidates = candidates or [place for place in places if name in (place.label, place.full)]
    candidates = candidates or [p for p in places if p.channel.name.casefold() == name.casefold()]
    candidates = candidates or [p for p in places if p.channel.about == name]  # its number
    if signal == TIME and candidates:
        return candidates[0]
    if len(candidates) != 1:
        names = [place.channel.name for place in places]
        raise InputError(
            where=f"{where}, channel '{name}'",
            found=f"{len(candidates)} channels of this name" if candidates else "no such channel",
            expected=f"one for {signal} among {listed(names)}{closest(name, names)}",
            remedy=f"correct the name, --column '{signal}=NAME'"
            + (", GROUP/NAME of several groups, or rename a column" if candidates else ""),
        )
    return candidates[0]


def _as_named(
    channel: NamedChannel,
    signal: Signal,
    places: Sequence[PlacedChannel],
    system: System,
    where: str,
) -> Assignment:
    """The channel that a user names for a signal."""
    place = _find(channel, signal.name, places, where)
    column = f"{signal.name}={place.label}"
    missing, gaps, marked = missing_of(place.channel, channel.missing, column)
    samples = samples_of(place.channel, missing)
    unit = stated = channel.unit or place.channel.unit
    if not stated:
        fitting = fitting_units(samples, signal, system)
        unit = fitting[0] if len(fitting) == 1 else ""
    concluded = not stated and unit != "1"
    way = conversion_to(unit, signal, system) if unit else None
    if way is None:
        raise _no_unit_of(signal, place, unit, stated_by_user=bool(channel.unit), where=where)
    turn = -1.0 if channel.reversed else 1.0
    scale, formula = way
    doubts = [marked]
    if not channel.unit:
        doubts += doubts_of(place.channel, unit, scale.applied(samples), signal, column)
    doubt = unit_doubt(signal.name, place.label, unit) if concluded else ""
    return Assignment(
        file=place.file,
        group=place.group,
        channel=place.channel,
        label=place.label,
        unit=unit,
        factor=turn * scale.factor,
        zero=turn * scale.zero,
        formula=formula,
        reason=unit_reason("named", unit, concluded) + gaps,
        certain=not (concluded or any(doubts)),
        concluded=concluded or bool(channel.unit),
        doubt="; ".join(filter(None, (doubt, *doubts))),
        missing=missing,
        declared=channel.missing,
    )


def _no_unit_of(
    signal: Signal, place: PlacedChannel, unit: str, *, stated_by_user: bool, where: str
) -> InputError:
    """A unit that cannot become that of a signal; where one is stated, no other is proposed."""
    name = f"--column '{signal.name}={place.label}"
    if not unit:
        unit_found, remedy = "no unit in the file", f"give it, {name} [UNIT]'"
    elif not is_unit(unit):
        unit_found = f"[{unit}], a unit that is not known"
        remedy = f"convert the values, or name one that is the same, {name} [UNIT]'"
    else:
        unit_found = f"[{unit}], no unit of {signal.label}"
        remedy = "correct the unit" if stated_by_user else "name another channel"
    return InputError(
        where=f"{where}, channel '{place.channel.name}'",
        found=unit_found,
        expected=f"one that can become {signal.unit}"
        + (f" or {signal.recorded_as.unit}" if signal.recorded_as else ""),
        remedy=remedy,
    )


def _refuse_shared(assigned: Mapping[str, Assignment], where: str) -> None:
    """Refuse one channel that is named for two signals."""
    taken: dict[int, str] = {}
    for signal, assignment in assigned.items():
        if id(assignment.channel) in taken:
            raise InputError(
                where=f"{where}, channel '{assignment.label}'",
                found=f"it stands for {taken[id(assignment.channel)]} and for {signal}",
                expected="a channel of its own for each signal",
                remedy=f"correct one of the two, --column '{signal}=NAME'",
            )
        taken[id(assignment.channel)] = signal


def _clocks(
    assigned: Mapping[str, Assignment],
    files: Sequence[RecordedFile],
    named: NamedChannel | None,
    step: float | None,
    system: System,
) -> dict[tuple[int, int], Clock]:
    """Times of each group with an assigned channel, by file and group."""
    clocks: dict[tuple[int, int], Clock] = {}
    for i, j in dict.fromkeys(
        (assignment.file, assignment.group) for assignment in assigned.values()
    ):
        group = files[i].groups[j]
        at = str(files[i].path) + (f", '{group.name}'" if group.name else "")
        clocks[i, j] = read_clock(group, named, step, system, at)
    for index, file in enumerate(files):
        own = [clock for (i, _), clock in clocks.items() if i == index and clock.counted]
        sizes = dict.fromkeys(str(clock.times.size) for clock in own)
        if len(sizes) > 1:
            raise InputError(
                where=str(file.path),
                found=f"one rate for channels of {' and '.join(sizes)} samples",
                expected="channels that were sampled together, or times of their own",
                remedy="export each with its times, or name channels of one length by --column",
            )
    return clocks


def _contradictions(
    given: Mapping[str, NamedChannel],
    assigned: Mapping[str, Assignment],
    files: Sequence[RecordedFile],
    clocks: Mapping[tuple[int, int], Clock],
    system: System,
) -> Iterator[str]:
    """Units that a user names, and that the files contradict: one of the two is wrong."""
    for name in (name for name in given if name in assigned):
        channel, signal = assigned[name], system.signals[name]
        ways = [
            conversion_to(unit, signal, system) for unit in (channel.unit, channel.channel.unit)
        ]
        # Values of a unit with a zero of its own, as degC, are taken as they are: [1].
        plain = channel.unit == "1" and _has_zero(channel.channel.unit)
        if channel.channel.unit and ways[0] != ways[1] and not plain:
            yield _contradiction(
                files[channel.file], channel.label, channel.unit, channel.channel.unit
            )
    for (i, j), clock in clocks.items():
        stated = {channel.name: channel.unit for channel in files[i].groups[j].channels}.get(
            clock.channel
        )
        if (
            stated
            and not is_said(clock.unit)
            and conversion(clock.unit, "s") != conversion(stated, "s")
        ):
            yield _contradiction(files[i], clock.channel, clock.unit, stated)


def _has_zero(unit: str) -> bool:
    """Whether a unit is one of temperatures whose zero is not that of kelvin."""
    scale = conversion(unit, "K")
    return scale is not None and scale.zero != 0.0


def _contradiction(file: RecordedFile, channel: str, unit: str, stated: str) -> str:
    return (
        f"{file.path}, channel '{channel}': taken in [{unit}], as named, and the file states "
        f"[{stated}]"
    )
