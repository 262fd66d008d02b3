"""How well a run fits its recording, stage 5: errors of what is judged, and z of the paper."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError
from workbench.models.fmu import FMU
from workbench.models.native import compiled
from workbench.observers.run import Ending, Run
from workbench.recordings.case import Case
from workbench.system.parts import Objective
from workbench.system.system import System

# Two equal poles at a corner are down by 3 dB at this share of it.
_CORNER = 2 * np.pi / np.sqrt(np.sqrt(2) - 1)

# Samples whose line scores the estimate before them: its noise has 1.5 times a sample's variance;
# to repeat the noise costs 29 %, and a line through more would cut curves of the motion.
_AFTER = 4

_POINTS, _ROUNDED = 8, 1e-9  # states by chance, and share of a value that arithmetic leaves


@dataclass(frozen=True)
class Score:
    """Errors of one run; None where they cannot be judged, and why."""

    # rms error of the judged signal in the window, below the bandwidth [its unit]
    rms: float | None
    nrmse: float | None  # the same over the mean of its size [1]
    # objective z_k of equation (12), over the whole recording, of deviations below the bandwidth
    # [1]
    z: float | None
    reason: str  # why a value is missing; empty if none is


def with_readings(system: System, models: Sequence[FMU]) -> System:
    """Report what sensors read of the scored signals, where that is another value in the model.

    A sensor that rectifies or lags is scored by its reading; see `scored_column`. A reading that
    equals its output at states by chance is that output. The models are started anew.
    """
    names = dict.fromkeys((system.objective.signal, *system.objective.weights))
    readings = {
        name: signal.reading
        for name, signal in system.signals.items()
        if name in names and name in system.columns and signal.reading not in system.columns
    }
    outputs = set.intersection(*({*fmu.outputs} for fmu in models)) if models else set()
    readings = {name: reading for name, reading in readings.items() if reading in outputs}
    differing = {name for fmu in models for name in _differing(fmu, readings)}
    units = {readings[n]: system.signals[n].unit for n in readings if n in differing}
    return replace(system, reported={**system.reported, **units}) if units else system


def _differing(fmu: FMU, readings: Mapping[str, str]) -> list[str]:
    """Signals whose reading is another value than their output."""
    if not readings:
        return []
    fmu.start({})
    rng, x = np.random.default_rng(0), fmu.get_states().copy()
    outputs, read = fmu.variables(list(readings)), fmu.variables(list(readings.values()))
    away = np.zeros(len(readings), bool)
    for _ in range(_POINTS):
        fmu.set_states(x + np.maximum(np.abs(x), 1.0) * rng.uniform(-1.0, 1.0, x.size))
        try:
            shown, reading = fmu.get(outputs).copy(), fmu.get(read).copy()
        except FMUError:  # no state of this machine
            continue
        away |= np.abs(reading - shown) > _ROUNDED * np.abs(shown)
    fmu.start({})
    return [name for name, other in zip(readings, away, strict=True) if other]


def scored_column(system: System, columns: Collection[str], name: str) -> str:
    """Column of an estimate that is scored by a measured signal: its reading, where it is there."""
    signal = system.signals.get(name)
    return signal.reading if signal is not None and signal.reading in columns else name


def judged_window(case: Case, system: System) -> slice:
    """Samples in which the judged signal counts; empty where the recording has none."""
    first, last = 0, case.time.size - 1
    if (begins := system.objective.begins) is not None:
        above = np.flatnonzero(system.signal(begins.signal, case.signals) > begins.level)
        if not above.size:
            return slice(0, 0)
        first = int(above[0])
    if (ends := system.objective.ends) is not None:
        above = np.flatnonzero(np.abs(system.signal(ends.signal, case.signals)) > ends.level)
        if not above.size:
            return slice(0, 0)
        last = int(above[-1])
    return slice(first, max(last + 1, first))


def low_pass(time: Vector, signal: Vector, bandwidth: float) -> Vector:
    """Low-pass a sampled signal without phase shift (Butterworth, order 2, forward and backward).

    Uneven samples are brought to an even grid of their mean step and back. A signal sampled too
    slowly to hold more than the bandwidth [Hz] is returned as it is.

    >>> t = np.arange(0, 2, 0.005)
    >>> ringing = low_pass(t, np.sin(2 * np.pi * 21.6 * t), 5.0)
    >>> float(np.abs(ringing[100:-100]).max().round(3))
    0.002
    """
    from scipy.signal import butter, sosfiltfilt  # takes its time to load

    step = (time[-1] - time[0]) / (time.size - 1)
    if 2 * bandwidth * step >= 1.0:
        return signal
    even = time[0] + step * np.arange(time.size)
    sections = butter(2, 2 * bandwidth * step, output="sos")
    smooth: Vector = sosfiltfilt(sections, np.interp(even, time, signal))
    return np.interp(time, even, smooth)


def samples(time: Vector) -> tuple[Vector, Vector]:
    """Step [s] from the sample before, and share [1] in the time average, of each sample, (n,)."""
    steps = np.diff(time, prepend=time[0])
    return steps, 0.5 * (steps + np.append(steps[1:], 0.0)) / (time[-1] - time[0])


def corner(objective: Objective) -> float:
    """Poles of the low-pass through which deviations count [rad/s]."""
    return float(_CORNER * objective.bandwidth)


@compiled
def integrate(z, memory, deviations, weights, steps, shares, corner):  # type: ignore[no-untyped-def]
    """Add a piece of recording to z_k, equation (12) of Schwarz et al. (2018).

    Deviations count below the bandwidth, where an estimate can follow; above, a recording holds the
    noise of its sensors and the modes of its machine, which would reward slow gains. The low-pass
    has two equal real poles. z only grows, sample by sample, so that pieces do not change the sum.

    Parameters
    ----------
    memory : (2, w) of the low-pass, written; zeros at the beginning.
    deviations : (n, w) of estimated from measured signals.
    weights : (w,) of these signals.
    steps, shares : (n,) as of `samples`.
    corner : as of `corner` [rad/s].
    """
    for i in range(steps.size):
        # The first sample has no step before it and stands for all the past.
        gain = 1.0 - np.exp(-corner * steps[i]) if steps[i] > 0.0 else 1.0
        for j in range(weights.size):
            memory[0, j] += gain * (deviations[i, j] - memory[0, j])
            memory[1, j] += gain * (memory[0, j] - memory[1, j])
            z += shares[i] * weights[j] * abs(memory[1, j])
    return z


def references(case: Case, system: System) -> Matrix:
    """What estimates of the weighed signals are scored by, (n, w).

    Where all of them correct the estimators, each estimate is scored by the straight line through
    the samples after it, which it has not seen: by its own sample the best would be to repeat the
    noise. The last few, after which too few follow, are scored by their own.
    """
    measured = np.column_stack([case[name] for name in system.objective.weights])
    if system.validated or len(measured) <= _AFTER:
        return measured
    time = sliding_window_view(case.time[1:], _AFTER)  # (n - _AFTER, _AFTER)
    after = sliding_window_view(measured[1:], _AFTER, axis=0)  # (n - _AFTER, w, _AFTER)
    middle, mean = time.mean(axis=1, keepdims=True), after.mean(axis=2)
    slope = np.einsum("nwk,nk->nw", after, time - middle) / np.square(time - middle).sum(
        axis=1, keepdims=True
    )
    line = mean + slope * (case.time[:-_AFTER, None] - middle)
    return np.vstack([line, measured[-_AFTER:]])


def weights(objective: Objective) -> Vector:
    """Weights of the weighed signals, (w,)."""
    return np.array(list(objective.weights.values()))


def score(case: Case, run: Run, system: System) -> Score:
    """Judge a run against its recording."""
    objective = system.objective
    if run.ending is not Ending.OK:
        return Score(None, None, None, f"{run.ending.value} {run.message}".strip())
    if missing := [name for name in (objective.signal, *objective.weights) if name not in case]:
        return Score(None, None, None, f"the recording has no {missing[0]} to score by")
    # A method that takes a signal as measured makes no error in it.
    columns = [scored_column(system, run.columns, name) for name in objective.weights]
    estimates = np.column_stack([run.signal(column) for column in columns])
    deviations = np.nan_to_num(estimates - references(case, system))
    steps, shares = samples(case.time)
    memory = np.zeros((2, len(objective.weights)))
    z = float(
        integrate(0.0, memory, deviations, weights(objective), steps, shares, corner(objective))
    )
    window = judged_window(case, system)
    if window.stop - window.start < 2:
        return Score(None, None, z, "the recording has no scored time")
    column = scored_column(system, run.columns, objective.signal)
    error = run.signal(column) - case[objective.signal]
    measured = low_pass(case.time, case[objective.signal], objective.bandwidth)
    rms = float(np.sqrt(np.mean(low_pass(case.time, error, objective.bandwidth)[window] ** 2)))
    return Score(rms, rms / float(np.mean(np.abs(measured[window]))), z, "")
