"""Signals of different rates and recorders, at common times: nothing is invented in a gap."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.recordings.channels.matching import Assignment
from workbench.recordings.channels.proposal import ProposedMapping
from workbench.recordings.formats import RecordedFile
from workbench.recordings.formats.stamps import iso
from workbench.system.parts import Signal
from workbench.system.system import System

_LATE = 1.5  # steps of a channel, from which on it has a gap


@dataclass(frozen=True, eq=False)
class MergedRecording:
    """A recording in SI units."""

    time: Vector  # (n,) s, as the recorder counts them
    signals: Mapping[str, Vector]  # (n,) each, by name
    start: float  # of time zero [s since 1970], NaN where that is not known
    notes: tuple[str, ...]  # what was interpolated and left out, in words
    doubts: tuple[str, ...]  # why its files may be damaged, or units wrong, in words
    zoned: bool = False  # whether that is in UTC; else in some local time

    def date(self, sample: int) -> str:
        """When a sample was taken, ISO 8601; empty where that is not known."""
        known = iso(self.start + float(self.time[sample]))
        return f"{known}Z" if known and self.zoned else known


@dataclass(frozen=True, eq=False)
class _Track:
    """Samples of one signal at its own times."""

    signal: Signal
    times: Vector
    values: Vector
    step: float
    missing: int
    censored: Vector  # times at which the file says only a bound; nothing goes across them
    jumps: bool  # whether it moves between rows of one time


def merge(
    files: Sequence[RecordedFile], proposal: ProposedMapping, system: System
) -> MergedRecording:
    """Bring the channels of a proposal to common times.

    The times are those of the slowest output, where all have samples. Other signals are
    interpolated between two samples of their own, in a straight line, or held where the system says
    that they are; where these are further apart than a recording may have gaps, there is no sample.
    An aid is NaN there, and holds up no other.

    Raises
    ------
    InputError
        If a signal has fewer than two samples, channels have no time in common, or the clocks of
        two files cannot be compared.
    """
    starts = _starts(files, proposal)
    tracks = [
        _track(
            system.signals[name], assignment, proposal, starts[assignment.file, assignment.group]
        )
        for name, assignment in proposal.assigned.items()
    ]
    outputs = {output.name for output in system.outputs}
    slowest = max((track for track in tracks if track.signal.name in outputs), key=lambda t: t.step)
    asked = [track for track in tracks if track.signal not in system.intermittent]
    begin = max(float(track.times[0]) for track in asked)
    end = min(float(track.times[-1]) for track in asked)
    inside = (slowest.times >= begin) & (slowest.times <= end)
    time = slowest.times[inside]
    limit = system.sampling.gap if math.isfinite(system.sampling.gap) else system.comparison.block
    known = np.ones(time.size, dtype=bool)
    notes = [
        f"{track.signal.name}: {track.missing} samples without a value"
        for track in tracks
        if track.missing
    ]
    if cut := int((~inside).sum()):
        notes.append(f"{cut} samples at the ends, where not all channels have any, were left out")
    signals: dict[str, Vector] = {}
    for track in tracks:
        values, near = _at(track, time, max(limit, _LATE * track.step))
        if track in asked:
            known &= near
        else:
            values = np.where(near, values, np.nan)
        signals[track.signal.name] = values
        if not np.isin(time, track.times).all():
            way = {1.0: "held", -1.0: "averaged"}.get(track.signal.hold, "interpolated")
            notes.append(f"{track.signal.name}: {way} from samples every {track.step:.6g} s")
    if gone := int((~known).sum()):
        notes.append(f"{gone} samples in gaps of more than {limit:g} s were left out")
    if known.sum() < 2:
        raise InputError(
            where=", ".join(str(file.path) for file in files),
            found=f"channels with {int(known.sum())} samples at common times",
            expected="channels that were recorded at the same time",
            remedy="give the files of one recording together, and others apart",
        )
    signals = {name: values[known] for name, values in signals.items()}
    begun = [c.start for c in proposal.clocks.values() if math.isfinite(c.start)]
    stated = [
        clock.dated - float(clock.times[np.isfinite(clock.times)][0])
        for clock in proposal.clocks.values()
        if math.isfinite(clock.dated)
    ]
    zero = min(begun or stated, default=math.nan)
    damaged = [f"{file.path}: {doubt}" for file in files for doubt in file.doubts]
    mended = [
        f"{files[file].path}, '{clock.channel}': {text}"
        for (file, _), clock in proposal.clocks.items()
        for text in clock.corrections
    ]
    mended += [
        f"{files[assigned.file].path}, '{assigned.label}': {text}"
        for assigned in proposal.assigned.values()
        for text in assigned.channel.corrections
    ]
    mended += [
        f"{track.signal.name}: it jumps between rows of one time, and is taken to move in a "
        "straight line from the sample before; if it is set and stays, add held = true to it"
        for track in tracks
        if track.jumps and track.signal.hold == 0.0 and track.signal in system.inputs
    ]
    doubts = *damaged, *proposal.contradictions, *mended, *_mixed_groups(files, proposal)
    zoned = bool(begun) and all(c.zoned for c in proposal.clocks.values() if math.isfinite(c.start))
    return MergedRecording(time[known], signals, zero, tuple(notes), doubts, zoned)


def _mixed_groups(files: Sequence[RecordedFile], proposal: ProposedMapping) -> Iterator[str]:
    """Signals of groups of a file that may be two recordings: one holds the other's channel, too.

    Where both have dates, they are brought together by these.
    """
    for (name, assigned), (_, other) in permutations(proposal.assigned.items(), 2):
        keys = (assigned.file, assigned.group), (other.file, other.group)
        dated = all(math.isfinite(proposal.clocks[key].start) for key in keys)
        if assigned.file != other.file or assigned.group == other.group or dated:
            continue
        file = files[assigned.file]
        own, theirs = (file.groups[group] for _, group in keys)
        if any(channel.name == other.channel.name for channel in own.channels):
            yield (
                f"{file.path}: {name} is taken from '{own.name}', which holds "
                f"'{other.channel.name}' as '{theirs.name}' does, from which that is taken: they "
                "may be two recordings"
            )
            return


def _starts(
    files: Sequence[RecordedFile], proposal: ProposedMapping
) -> dict[tuple[int, int], float]:
    """What is added to the times of each group, so that they count from one zero [s]."""
    clocks = proposal.clocks
    known = [clock.start for clock in clocks.values() if math.isfinite(clock.start)]
    if not known or len(clocks) == 1:
        return dict.fromkeys(clocks, 0.0)
    if len(known) < len(clocks):
        missing = next(key for key, clock in clocks.items() if not math.isfinite(clock.start))
        raise InputError(
            where=str(files[missing[0]].path),
            found="times without a date beside others that have one",
            expected="clocks that can be compared",
            remedy="import the files apart, or export them with the same times",
        )
    first = min(known)
    return {key: clock.start - first for key, clock in clocks.items()}


def _track(signal: Signal, assigned: Assignment, proposal: ProposedMapping, start: float) -> _Track:
    times = proposal.clocks[assigned.file, assigned.group].times + start
    values = assigned.values
    held = np.isfinite(times) & np.isfinite(values)
    if held.sum() < 2:
        raise InputError(
            where=f"channel '{assigned.channel.name}'",
            found=f"{int(held.sum())} samples",
            expected=f"samples of {signal.label}",
            remedy="name another channel",
        )
    steps = np.diff(times[held])
    step = float(np.median(steps[steps != 0.0]))
    bounds = times[list(assigned.channel.censored)]
    last = np.append(np.diff(times[held]) != 0.0, True)  # of rows of one time
    jumps = bool((np.diff(values[held])[~last[:-1]] != 0.0).any())
    missing = int((~held).sum())
    return _Track(signal, times[held][last], values[held][last], step, missing, bounds, jumps)


def _at(track: _Track, time: Vector, limit: float) -> tuple[Vector, np.ndarray]:
    """Values at some times, (n,), and whether samples stand near enough around them, (n,)."""
    after = np.clip(np.searchsorted(track.times, time), 0, track.times.size - 1)
    exact = track.times[after] == time
    before = np.where(exact, after, np.maximum(after - 1, 0))
    near = track.times[after] - track.times[before] <= limit * (1.0 + 1e-9)
    near &= (time >= track.times[0]) & (time <= track.times[-1])
    lowest, highest = (np.searchsorted(track.censored, track.times[k]) for k in (before, after))
    near &= lowest == highest
    if track.signal.hold > 0.0:
        return track.values[before], near
    if track.signal.hold < 0.0:
        # A sample is the mean since the one before: what it integrates to is kept.
        summed = np.cumsum(track.values * np.diff(track.times, prepend=track.times[0]))
        within = np.diff(np.interp(time, track.times, summed))
        means = np.append(track.values[after[0]], within / np.diff(time))
        return means, near
    return np.interp(time, track.times, track.values), near
