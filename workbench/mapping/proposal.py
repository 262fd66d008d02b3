"""Channels are proposed for signals: by name, by unit, and by what values are plausible."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.errors import InputError, closest
from workbench.foreign import FileChannel, Group, RecordedFile
from workbench.mapping.clock import Clock, read_clock
from workbench.mapping.names import (
    EXACT,
    TIME,
    WITHIN,
    WORDS,
    NamedChannel,
    alike,
    is_asked,
    listed,
)
from workbench.mapping.units import conversion_to, fitting_units, unit_in_name
from workbench.recording import Vector
from workbench.system import System
from workbench.system_parts import Signal


@dataclass(frozen=True, eq=False)
class Assigned:
    """A channel that is taken for a signal.

    Attributes
    ----------
    file : it stands in, counted from 0.
    group : in that file, counted from 0.
    label : the channel's name, with its group where several have it.
    unit : that its values are in.
    factor, zero : SI value is `factor*value + zero`.
    formula : what the recorder has in place of the signal; empty: the signal itself.
    reason : why this one, for people.
    certain : whether name and unit are the system's own, so that nobody need be asked.
    concluded : whether the file does not say the unit.
    alone : whether nothing but its unit speaks for it.
    """

    file: int
    group: int
    channel: FileChannel
    label: str
    unit: str
    factor: float
    zero: float
    formula: str
    reason: str
    certain: bool
    concluded: bool = False
    alone: bool = False

    @property
    def values(self) -> Vector:
        """(n,) SI, not finite in gaps."""
        with np.errstate(over="ignore", invalid="ignore"):  # what no machine reads
            return self.factor * self.channel.values + self.zero

    @property
    def named(self) -> NamedChannel:
        """As it is stored; what the file says of the unit is left to it."""
        unit = self.unit if self.concluded or self.unit != self.channel.unit else ""
        return NamedChannel(self.label, unit, self.factor < 0.0)


@dataclass(frozen=True, eq=False)
class ProposedMapping:
    """Which channels of some files are which signals of a system.

    Attributes
    ----------
    assigned : channels by signal.
    clocks : of each group with an assigned channel, by file and group.
    left : channels that nobody takes.
    problems : why a signal that is needed has no channel, in words.
    """

    assigned: Mapping[str, Assigned]
    clocks: Mapping[tuple[int, int], Clock]
    left: tuple[str, ...]
    problems: tuple[str, ...]

    @property
    def certain(self) -> bool:
        """Whether it follows from names and units alone."""
        own = all(one.certain for one in self.assigned.values())
        return not self.problems and own and all(one.certain for one in self.clocks.values())

    @property
    def named(self) -> dict[str, NamedChannel]:
        """As it is stored."""
        found = {name: one.named for name, one in self.assigned.items()}
        for clock in self.clocks.values():
            if clock.channel:
                found.setdefault(
                    TIME, NamedChannel(clock.channel, "" if clock.certain else clock.unit)
                )
        return found


@dataclass(frozen=True, eq=False)
class _Place:
    file: int
    group: int
    holder: Group
    channel: FileChannel
    label: str


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
    places = _places(files)
    where = ", ".join(str(one.path) for one in files)
    assigned = {
        name: _as_named(one, system.signals[name], places, system, where)
        for name, one in given.items()
        if name != TIME
    }
    _refuse_shared(assigned, where)
    if TIME in given:
        _find(given[TIME], TIME, places, where)
    times = {given[TIME].channel} if TIME in given else set()
    free = [
        one
        for one in places
        if one.channel.name not in times
        and not one.channel.stamp
        and all(one.channel is not other.channel for other in assigned.values())
    ]
    doubts: dict[str, str] = {}
    _by_name(assigned, doubts, free, system)
    _by_unit(assigned, doubts, free, system)
    problems = tuple(
        f"{one.name}: {doubts.get(one.name, 'no channel whose name or unit tells')}"
        for one in (*system.inputs, *system.outputs)
        if one.name not in assigned
    )
    clocks: dict[tuple[int, int], Clock] = {}
    for one in assigned.values():
        if (one.file, one.group) not in clocks:
            group = files[one.file].groups[one.group]
            at = str(files[one.file].path) + (f", '{group.name}'" if group.name else "")
            clocks[one.file, one.group] = read_clock(group, given.get(TIME), step, system, at)
    _refuse_one_rate(clocks, files)
    taken = {id(one.channel) for one in assigned.values()}
    timed = {clock.channel for clock in clocks.values()}
    left = [p.channel for p in places if id(p.channel) not in taken and p.channel.name not in timed]
    shown = tuple(f"{one.name} [{one.unit}]" if one.unit else one.name for one in left)
    return ProposedMapping(assigned, clocks, shown, problems)


def _places(files: Sequence[RecordedFile]) -> list[_Place]:
    """All channels, each with a name that no other has, if groups have names."""
    found = [
        (i, j, group, channel)
        for i, one in enumerate(files)
        for j, group in enumerate(one.groups)
        for channel in group.channels
    ]
    counts = Counter(channel.name for *_, channel in found)
    return [
        _Place(i, j, group, one, one.name if counts[one.name] == 1 else f"{group.name}/{one.name}")
        for i, j, group, one in found
    ]


def _find(one: NamedChannel, signal: str, places: Sequence[_Place], where: str) -> _Place:
    """The place that a user names."""
    name = one.channel
    found = [place for place in places if place.channel.name == name]
    found = found or [place for place in places if place.label == name]
    found = found or [p for p in places if p.channel.name.casefold() == name.casefold()]
    if signal == TIME and found:
        return found[0]
    if len(found) != 1:
        names = [place.channel.name for place in places]
        raise InputError(
            where=f"{where}, channel '{name}'",
            found=f"{len(found)} channels of this name" if found else "no such channel",
            expected=f"one for {signal} among {listed(names)}{closest(name, names)}",
            remedy=f"correct the name, --column '{signal}=NAME'"
            + (", or GROUP/NAME where several groups have it" if found else ""),
        )
    return found[0]


def _as_named(
    one: NamedChannel, signal: Signal, places: Sequence[_Place], system: System, where: str
) -> Assigned:
    """The channel that a user names for a signal."""
    place = _find(one, signal.name, places, where)
    unit = one.unit or place.channel.unit
    concluded = not unit
    if not unit:
        fitting = fitting_units(place.channel, signal, system)
        unit = fitting[0] if len(fitting) == 1 else ""
    way = conversion_to(unit, signal, system) if unit else None
    if way is None:
        raise InputError(
            where=f"{where}, channel '{place.channel.name}'",
            found=f"[{unit}], no unit of {signal.label}" if unit else "no unit in the file",
            expected=f"one that can become {signal.unit}"
            + (f" or {signal.recorded_as.unit}" if signal.recorded_as else ""),
            remedy=f"give it, --column '{signal.name}={place.channel.name} [{signal.shown}]'",
        )
    turn = -1.0 if one.reversed else 1.0
    scale, formula = way
    return Assigned(
        place.file,
        place.group,
        place.channel,
        place.label,
        unit,
        turn * scale.factor,
        turn * scale.zero,
        formula,
        _unit_reason("named", unit, concluded),
        certain=True,
        concluded=concluded or bool(one.unit),
    )


def _refuse_shared(assigned: Mapping[str, Assigned], where: str) -> None:
    """Refuse one channel that is named for two signals."""
    taken: dict[int, str] = {}
    for signal, one in assigned.items():
        if id(one.channel) in taken:
            raise InputError(
                where=f"{where}, channel '{one.label}'",
                found=f"it stands for {taken[id(one.channel)]} and for {signal}",
                expected="a channel of its own for each signal",
                remedy=f"correct one of the two, --column '{signal}=NAME'",
            )
        taken[id(one.channel)] = signal


def _refuse_one_rate(
    clocks: Mapping[tuple[int, int], Clock], files: Sequence[RecordedFile]
) -> None:
    """Refuse one rate for channels of one file that have unlike numbers of samples."""
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


def _unit_reason(reason: str, unit: str, concluded: bool) -> str:
    return f"{reason}; no unit in the file, only {unit} fits" if concluded else reason


def _candidate(
    place: _Place, signal: Signal, system: System, likeness: int
) -> tuple[Assigned | None, str]:
    """A channel as a signal, or None and why it cannot be."""
    channel = place.channel
    unit = channel.unit or unit_in_name(channel.name, signal, system)
    concluded = not unit
    if concluded:
        fitting = fitting_units(channel, signal, system)
        if len(fitting) != 1:
            fits = f"as {' or '.join(fitting)}" if fitting else "in no usual unit"
            return None, f"'{channel.name}' has no unit and is plausible {fits}"
        unit = fitting[0]
    way = conversion_to(unit, signal, system)
    if way is None:
        return None, f"'{channel.name}' is in [{unit}]"
    scale, formula = way
    values = scale.factor * channel.values + scale.zero
    low, high = signal.possible
    if not np.isfinite(values).any():
        return None, f"'{channel.name}' holds no numbers"
    if np.nanmin(values) < low or np.nanmax(values) > high:
        return None, f"'{channel.name}' in [{unit}] goes beyond what is possible"
    reason = "name and unit" if likeness else "the only one of its unit"
    return Assigned(
        place.file,
        place.group,
        channel,
        place.label,
        unit,
        scale.factor,
        scale.zero,
        formula,
        _unit_reason(reason, unit, concluded),
        certain=likeness == EXACT and channel.name == signal.name and bool(channel.unit),
        concluded=concluded,
        alone=not likeness,
    ), ""


def _by_name(
    assigned: dict[str, Assigned],
    doubts: dict[str, str],
    places: Sequence[_Place],
    system: System,
) -> None:
    """Assign channels whose names tell, the most alike first; doubts say why a signal has none."""
    found: dict[int, list[tuple[Signal, Assigned]]] = {EXACT: [], WORDS: [], WITHIN: []}
    for signal in system.signals.values():
        for place in places:
            likeness = alike(place.channel.name, place.channel.about, signal)
            if likeness and is_asked(place.channel.name) and not signal.exact:
                doubts[signal.name] = f"'{place.channel.name}' is asked for, not measured"
            elif likeness:
                one, doubt = _candidate(place, signal, system, likeness)
                if one is not None:
                    found[likeness].append((signal, one))
                else:
                    doubts[signal.name] = doubt
    settled = set(assigned)
    for level in found.values():
        taken = {id(one.channel) for one in assigned.values()}
        left = [(s, o) for s, o in level if s.name not in settled and id(o.channel) not in taken]
        for signal, one in left:
            rivals = [o.label for s, o in left if s is signal]
            claims = [s.name for s, o in left if o.channel is one.channel]
            settled.add(signal.name)
            if len(rivals) == len(claims) == 1:
                assigned[signal.name] = one
            elif len(rivals) > 1:
                doubts[signal.name] = f"it may be {' or '.join(map(repr, rivals))}"
            else:
                doubts[signal.name] = f"'{one.channel.name}' may be {' or '.join(claims)}"


def _by_unit(
    assigned: dict[str, Assigned],
    doubts: Mapping[str, str],
    places: Sequence[_Place],
    system: System,
) -> None:
    """Assign the only channel that has the unit of the only signal that lacks one."""
    taken = {id(one.channel) for one in assigned.values()}
    lacking = [
        one
        for one in (*system.inputs, *system.outputs)
        if one.name not in assigned and one.name not in doubts
    ]
    fitting = [
        (signal, one)
        for signal in lacking
        for place in places
        if id(place.channel) not in taken
        and place.channel.unit
        and not is_asked(place.channel.name)
        and (one := _candidate(place, signal, system, 0)[0]) is not None
    ]
    for signal, one in fitting:
        if sum(s is signal or o.channel is one.channel for s, o in fitting) == 1:
            assigned[signal.name] = one
