"""One long recording becomes several: where it was interrupted, and where the system says."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from workbench.recording import Vector
from workbench.system import System
from workbench.system_parts import Cutting


@dataclass(frozen=True)
class Cut:
    """Samples that are kept as one recording, or left out.

    Attributes
    ----------
    first, end : sample, and the one after the last.
    reason : why they are left out; empty: they are kept.
    """

    first: int
    end: int
    reason: str = ""


def cut(time: Vector, signals: Mapping[str, Vector], system: System) -> list[Cut]:
    """Cut a recording into those that it holds, in their order; all samples are in one part.

    It is cut where no recording may have a gap, and, if the system says how (`cutting`) and there
    is more than one part, from the rise of one signal to the fall of another. A recording without
    anything to cut is one part.

    Parameters
    ----------
    time : (n,) s.
    signals : (n,) each, SI.
    """
    gaps = np.flatnonzero(np.diff(time) > system.sampling.largest_gap) + 1
    bounds = [0, *gaps.tolist(), time.size]
    pieces = list(pairwise(bounds))
    parts = _parts(time, signals, system.cutting, pieces, system) if system.cutting else []
    if sum(not one.reason for one in parts) < 2:
        parts = [Cut(first, end) for first, end in pieces]
    judged = [_long_enough(one, time, system) for one in parts]
    return list(_with_rest(judged, time.size))


def _parts(
    time: Vector,
    signals: Mapping[str, Vector],
    rule: Cutting,
    pieces: list[tuple[int, int]],
    system: System,
) -> list[Cut]:
    """Parts between a rise and a fall, with what is kept around them."""
    applied = np.abs(system.signal(rule.begins.signal, signals)) > rule.begins.level
    moving = np.abs(system.signal(rule.ends.signal, signals)) > rule.ends.level
    found: list[Cut] = []
    for low, high in pieces:
        last = low
        for begin, end, reason in _runs(time, applied, moving, rule.released, low, high):
            first = max(last, int(np.searchsorted(time, time[begin] - rule.before)))
            stop = min(high, int(np.searchsorted(time, time[end - 1] + rule.after, "right")))
            found.append(Cut(first, stop, reason))
            last = stop
    return found


def _runs(
    time: Vector,
    applied: np.ndarray,
    moving: np.ndarray,
    released: float,
    low: int,
    high: int,
) -> Iterator[tuple[int, int, str]]:
    """First sample, the one after the last, and why a run is no recording."""
    k = low
    while k < high:
        if not (applied[k] and moving[k]) or (k > low and applied[k - 1]):
            k += 1
            continue
        end, on = k, k
        while end < high and moving[end] and time[end] - time[on] <= released:
            on = end if applied[end] else on
            end += 1
        if end == high:
            yield k, end, "it does not end in this recording"
        elif moving[end]:
            yield k, end, "it was released before its end"
        elif k == low:
            yield k, end, "it had begun before this recording"
        else:
            yield k, end, ""
        k = end


def _long_enough(one: Cut, time: Vector, system: System) -> Cut:
    lasts = time[one.end - 1] - time[one.first]
    if one.reason or (one.end - one.first >= system.fewest and lasts >= system.shortest):
        return one
    return Cut(one.first, one.end, "it is shorter than a recording must be")


def _with_rest(parts: list[Cut], size: int) -> Iterator[Cut]:
    """The parts and what is between them."""
    last = 0
    for one in parts:
        if one.first > last:
            yield Cut(last, one.first, "between recordings")
        yield one
        last = one.end
    if last < size:
        yield Cut(last, size, "between recordings")
