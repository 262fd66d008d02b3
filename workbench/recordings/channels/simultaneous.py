"""Whether parts of a file may be of the same time: two recorders of one recording, or copies."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.channels.recordings import ProposedRecording
from workbench.recordings.formats import FileChannel
from workbench.recordings.formats.stamps import iso
from workbench.system.system import System

_SAME = 1e-3  # of how far an output goes: repeated experiments differ by more, filters by less
_COPIED = 0.9  # of all rows: cut out of a longer recording
_FEW = 10  # rows that differ, of which by chance most may be in another recording
_NEAR = 0.1  # of a recording's length: how long after its own zero it may begin
_DATE, _CLOCK = "date", "clock"
_CHOICE = ": they are two recordings, --apart, or one, of which channels are named GROUP/CHANNEL"


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
        one, other = spans[i], spans[j]
        if one and other and one.meets(other):
            return f"{names} hold the same channels at one time, {one} and {other}{_CHOICE}"
        if same := _same_output(parts[i], parts[j], system) or _same_rows(rows[i], rows[j]):
            return f"{names} hold the same samples of {same}{_CHOICE}"
    return ""


def _span(recording: ProposedRecording) -> _Span | None:
    """When a part was recorded; None: its times count from a zero of their own."""
    for key, clock in recording.proposal.clocks.items():
        group = recording.files[key[0]].groups[key[1]]
        shown = [c for c in (group.time, *group.channels) if c is not None and _is_dated(c)]
        times, zero, kind = clock.times, 0.0, _CLOCK
        if shown:
            dated = np.isfinite(shown[0].start)
            times, kind = shown[0].values, _DATE if dated else _CLOCK
            zero = shown[0].start if dated else shown[0].shown
        held = np.sort(times[np.isfinite(times)]) + zero
        if held.size > 1:
            begin, end = float(held[0]), float(held[-1])
            own_zero = begin <= _NEAR * (end - begin) and end >= 0.0
            if kind == _DATE or not own_zero:
                return _Span(kind, begin, end)
    return None


def _is_dated(channel: FileChannel) -> bool:
    return bool(np.isfinite(channel.start) or np.isfinite(channel.shown))


def _same_output(recording: ProposedRecording, other: ProposedRecording, system: System) -> str:
    """An output that goes the same way in both, counted from their first samples; or none."""
    for signal in system.outputs:
        if not all(signal.name in part.proposal.assigned for part in (recording, other)):
            continue
        (t, x), (u, y) = (_samples(part, signal.name) for part in (recording, other))
        near = u <= t[-1]
        with np.errstate(over="ignore", invalid="ignore"):  # what no machine reads
            spread = float(np.std(y[near]))
            apart = float(np.sqrt(np.mean((np.interp(u[near], t, x) - y[near]) ** 2)))
        if near.sum() > _FEW and spread > 0.0 and apart <= _SAME * spread:
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
    if not held or len({(one.file, one.group) for one in held}) > 1:
        return np.empty(0)
    weights = np.sqrt(np.arange(2.0, 2.0 + len(held)))
    with np.errstate(over="ignore", invalid="ignore"):
        sums = (np.column_stack([one.values for one in held]) * weights).sum(axis=1)
    return np.unique(sums[np.isfinite(sums)])


def _same_rows(one: Vector, other: Vector) -> str:
    """What to call rows that are nearly all in both; or nothing."""
    short, long = sorted((one, other), key=np.size)
    copied = short.size > _FEW and np.isin(short, long).mean() >= _COPIED
    return "all signals" if copied else ""
