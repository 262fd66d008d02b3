"""Where a recording lacks samples while an input moves: what follows begins with an error.

What the machine did then is in no sample; so a part after it is a recording of its own, of which
the start is fitted.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis.data.cleaning import Mask, bridge, outliers, uneven_steps
from workbench.diagnosis.data.counting import count
from workbench.diagnosis.data.samples import compared
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.errors import FMUError, InputError
from workbench.models.description import MODEL_EXCHANGE
from workbench.models.fmu import FMU
from workbench.models.simulation import Drive, Simulation
from workbench.recordings.case import Case
from workbench.system.registry import open_model
from workbench.system.system import System


def gaps(case: Case, system: System) -> dict[int, list[str]]:
    """Labels of inputs that may have moved outputs by more than noise, by first sample after a gap.

    Where an input leaves a straight line by more than its noise, within the length of a gap before
    and after it, it may have done so in the gap: the model is simulated with that and without it.
    """
    time, steps = case.time, np.diff(case.time)
    h = float(np.median(steps))
    ends = 1 + np.flatnonzero((steps > h + system.comparison.block) & ~uneven_steps(time, h))
    left = _left_lines(case, system, ends)
    if not left.any():
        return {}
    with open_model(system) as fmu:
        beyond = _beyond_noise(fmu, case, system, ends, left)
    return {
        int(end): [
            signal.label for signal, matters in zip(system.inputs, row, strict=True) if matters
        ]
        for end, row in zip(ends, beyond, strict=True)
        if row.any()
    }


def _left_lines(case: Case, system: System, ends: Collection[int]) -> Matrix:
    """By how much inputs leave a straight line about gaps, (g, m); 0 where that is noise."""
    time, left = case.time, np.zeros((len(ends), len(system.inputs)))
    for j, signal in enumerate(system.inputs if len(ends) else ()):
        values = case[signal.name]
        values = bridge(time, values, outliers(values, signal, SOUND))
        for i, end in enumerate(ends):
            length = time[end] - time[end - 1]
            near = (time >= time[end - 1] - length) & (time <= time[end] + length)
            line = np.polynomial.Polynomial.fit(time[near], values[near], 1)
            away = float(np.ptp(values[near] - line(time[near])))
            if away > 2.0 * SOUND.spike * signal.noise_at_scale:
                left[i, j] = away
    return left


def _beyond_noise(
    fmu: FMU, case: Case, system: System, ends: Collection[int], left: Matrix
) -> Mask:
    """Whether inputs that are off by `left` (g, m) in gaps move outputs after them by more, (g, m).

    They do if the model cannot be simulated so far by itself.
    """
    time, ends = case.time, np.array(ends)
    steps = np.diff(time)
    ramp = np.minimum(np.median(steps), steps[ends - 1] / 3.0)
    within = np.column_stack([time[ends - 1] + ramp, time[ends] - ramp])
    at = np.insert(time, np.repeat(ends, 2), within.ravel())
    rows = np.searchsorted(at, time)
    u = np.column_stack([np.interp(at, time, column) for column in case.u.T])
    gap = np.setdiff1d(np.arange(at.size), rows).reshape(-1, 2)
    outputs = [system.signals[name] for name in (*case.outputs, *case.aids)]
    inputs = [signal.name for signal in system.inputs]
    shown = [n for n in case.outputs if n in fmu.states and fmu.interface == MODEL_EXCHANGE]
    values = {**system.set_by(case.conditions), **{name: case[name][0] for name in shown}}
    simulation = Simulation(fmu, inputs, [signal.reading for signal in outputs], system.holds)
    noise = np.array([signal.noise_at_scale for signal in outputs])
    beyond: Mask = left > 0.0
    try:
        usual = simulation.run(Drive(at, u, case.model_time), values)[rows]
        for j in np.flatnonzero(beyond.any(axis=0)):
            off = u.copy()
            off[gap, j] += left[:, [j]]
            moved = np.abs(simulation.run(Drive(at, off, case.model_time), values)[rows] - usual)
            most = np.maximum.reduceat(np.nan_to_num(moved / noise, nan=np.inf).max(axis=1), ends)
            beyond[:, j] &= most > 1.0
    except (FMUError, InputError):
        pass
    return beyond


def begins(case: Case, system: System, ends: Iterable[int]) -> list[int]:
    """Those samples after gaps at which a recording can begin anew: all parts have enough."""
    able = [0]
    for end in ends:
        parts = case.part(slice(able[-1], end)), case.part(slice(end, None))
        if all(_counts(part, system) for part in parts):
            able.append(end)
    return able[1:]


def _counts(part: Case, system: System) -> bool:
    """Whether a part of a recording has enough to compare."""
    own = [name for name in compared(system, [part]) if name in part]
    try:
        count(part, system, (*part.inputs, *own), SOUND, restarting=False)
    except InputError:
        return False
    return True


def parted(
    case: Case, begins: Sequence[int], names: Collection[str], start_time: float
) -> Iterator[Case]:
    """Parts of a recording that begin at samples.

    Parameters
    ----------
    names : of all recordings, which no later part has.
    start_time : of the model [s], where a recording does not say it.
    """
    yield case.part(slice(0, begins[0])) if begins else case
    begun = start_time if case.model_time is None else case.model_time
    for number, (first, end) in enumerate(pairwise([*begins, case.time.size]), start=2):
        name = f"{case.name}_part{number}"
        while name in names:
            name += "_"
        since = float(case.time[first] - case.time[0])
        yield replace(case.part(slice(first, end)), name=name, model_time=begun + since)


def described(case: Case, end: int, moved: Sequence[str]) -> str:
    """A gap in words."""
    before, after = case.time[[end - 1, end]]
    line = (
        "" if case.first_line is None else f" (line {case.first_line + end} of {case.source.name})"
    )
    return (
        f"{case.name} lacks {after - before:.3g} s from {before:.6g} s on{line}, "
        f"where {' and '.join(moved)} moved"
    )
