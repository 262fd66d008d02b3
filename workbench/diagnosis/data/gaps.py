"""Where a recording lacks samples while an input moves: what follows begins with an error.

What the machine did then is in no sample; so a part after it is a recording of its own, of which
the start is fitted.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from workbench.diagnosis.data.cleaning import uneven_steps
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.recordings.case import Case
from workbench.system.system import System

_MOVED = 0.01  # of an input's size, beyond its noise: the least change worth reporting


def gaps(case: Case, system: System) -> Iterator[tuple[int, list[str]]]:
    """First samples after gaps that are longer than a block, and labels of inputs that moved there.

    An input moved if it does so within the length of the gap before and after it.
    """
    time, steps = case.time, np.diff(case.time)
    h = float(np.median(steps))
    long = (steps > h + system.comparison.block) & ~uneven_steps(time, h)
    for k in np.flatnonzero(long):
        near = (time >= time[k] - steps[k]) & (time <= time[k + 1] + steps[k])
        moved = [
            signal.label
            for signal in system.inputs
            if signal.name in case
            and np.ptp(case[signal.name][near])
            > 2.0 * SOUND.spike * signal.noise_at_scale + _MOVED * signal.scale
        ]
        if moved:
            yield int(k) + 1, moved


def parted(
    cases: Sequence[Case], system: System, names: Collection[str], start_time: float
) -> Iterator[Case]:
    """Recordings in parts that begin after such gaps; those with too little to compare are none.

    Parameters
    ----------
    names : of all recordings, which no later part has.
    start_time : of the model [s], where a recording does not say it.
    """
    for case in cases:
        begins = [0, *(first for first, _ in gaps(case, system)), case.time.size]
        if len(begins) == 2:
            yield case
            continue
        begun = start_time if case.model_time is None else case.model_time
        for number, (first, end) in enumerate(pairwise(begins), start=1):
            part, name = case.part(slice(first, end)), f"{case.name}_part{number}"
            while name in names:
                name += "_"
            if np.ptp(part.time) >= system.comparison.least:
                yield replace(
                    part,
                    name=name if first else case.name,
                    model_time=begun + float(part.time[0] - case.time[0]),
                )


def doubt(cases: Sequence[Case], system: System, remedy: Callable[[], str]) -> str:
    """Gaps after which recordings go on, in words, and what to do; empty if there are none."""
    told = [
        f"{case.name} lacks {case.time[first] - case.time[first - 1]:.3g} s from "
        f"{case.time[first - 1]:.6g} s on, where {' and '.join(moved)} moved"
        for case in cases
        for first, moved in gaps(case, system)
    ]
    return f"{'; '.join(told)}: what follows begins with an error. {remedy()}" if told else ""
