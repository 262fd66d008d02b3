"""Clocks of loggers: signals that one logger records are late together, against all others.

A clock is no matter of the model. Inputs drive it as of the time when they acted, what it says of
an output is read as late as its logger reads it, and a motion that is led follows what was measured
at that time.
"""

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.cleaning import first_value
from workbench.diagnosis.data.samples import Samples, starting
from workbench.diagnosis.effects.candidates import INPUT_LAG, LEAST_SKEWS
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.effects.extension import variables
from workbench.recordings.case import Case
from workbench.system.system import System

KIND, OWN, SKEW = "LoggerTimeSkew", "TimeSkew", "skew"
DELAY = "delay"
INPUT_DELAY = "InputDelay"


def clocks(system: System) -> tuple[Effect, ...]:
    """Clocks of loggers that may be late against that of the other signals."""
    return tuple(_clock(system, KIND, *clock) for clock in system.clocks.items())


def reference(system: System) -> str:
    """The signal by whose clock a model runs: that which leads its motion, if one does."""
    leading = system.comparison.leading
    return system.outputs[0].name if leading is None else leading.output


def own_clocks(system: System) -> tuple[Effect, ...]:
    """A clock of each signal, against that of the reference, whatever the loggers."""
    first = reference(system)
    return tuple(
        _clock(system, OWN, signal, (signal,)) for signal in system.signals if signal != first
    )


def delays(system: System) -> tuple[Effect, ...]:
    """A delay of each signal by itself, but for one that has a logger of its own.

    An input that acts late is recorded early, against which all others are late.
    """
    known, effects = {frozenset(names) for names in system.clocks.values()}, []
    for name, signal in system.signals.items():
        others = tuple(other for other in system.signals if other != name)
        acts = signal in system.inputs
        if not others or known & {frozenset([name]), frozenset(others)}:
            continue
        clock = _clock(system, INPUT_DELAY, name, others)
        text = f"{signal.label} that acts at another time than it is recorded"
        if not acts:
            clock = _clock(system, "SensorDelay", name, (name,))
            text = f"a sensor of {signal.label} that reads late"
        separation = f"a second sensor of {signal.label}, with a clock that is known"
        effects.append(replace(clock, size=DELAY, text=text, separation=separation))
    return tuple(effects)


def held_otherwise(
    system: System, effects: Set[str], size: float, low: float, high: float
) -> dict[str, str]:
    """Inputs that would act so much later if they were held otherwise, and the key that says so.

    A sample that acts until the next one acts half a sample time later, on average, than one on a
    straight line to it; one that acts since the sample before, half a sample time earlier.

    Parameters
    ----------
    effects : names of those that explain the same; if inputs are among them, no others are meant.
    size, low, high : of a delay or a lag of inputs behind outputs, and ends of its interval [s].
    """
    half = 0.5 * system.sample_time
    late = [
        s for s in system.inputs if {f"{INPUT_DELAY}[{s.name}]", f"{INPUT_LAG}[{s.name}]"} & effects
    ]
    keys = {}
    for signal in late or system.inputs:
        later = {
            key: (other.hold - signal.hold) * half for key, other in signal.otherwise_held.items()
        }
        key = min(later, key=lambda key: abs(later[key] - size))
        if low <= later[key] <= high:
            keys[signal.name] = f"held = {key}"
    return keys


def _clock(system: System, model: str, name: str, signals: tuple[str, ...]) -> Effect:
    return Effect(
        name=f"{model}[{name}]",
        model=model,
        slots=(),
        size=SKEW,
        matters=LEAST_SKEWS * system.comparison.least_skew,
        text=f"a logger of {' and '.join(signals)} with a time offset",
        separation="one signal that both loggers record",
        late=signals,
    )


def late_signals(system: System) -> dict[str, dict[str, float]]:
    """By the name of what says how late a clock is [s]: signals it moves, 1 later or -1 earlier.

    A motion follows what leads it with the noise of each sample, which would be another if that
    were moved: where the clock of the reference is late, all others are early. Where none leads,
    outputs alone are late: inputs that are moved bend between other samples, and what they do from
    the first one on would begin later.
    """
    first, directions = reference(system), {}
    outputs = {signal.name for signal in system.outputs}
    for clock in (*clocks(system), *own_clocks(system), *delays(system)):
        others = [name for name in system.signals if name not in clock.late]
        alone = system.comparison.leading is None
        early = first in clock.late and not (alone and outputs.issuperset(clock.late))
        moving = dict.fromkeys(others, -1.0) if early else dict.fromkeys(clock.late, 1.0)
        directions[variables(clock, clock.size)[0]] = moving
    return directions


def lateness(
    signals_of: Mapping[str, Mapping[str, float]], values: Mapping[str, float]
) -> dict[str, float]:
    """By how much signals are late [s], of those that are.

    Parameters
    ----------
    signals_of : see `late_signals`.
    values : by the same names; others are zero.
    """
    late: dict[str, float] = {}
    for name, signals in signals_of.items():
        for signal, way in signals.items() if values.get(name, 0.0) != 0.0 else ():
            late[signal] = late.get(signal, 0.0) + way * values[name]
    return late


def greatest_skew(system: System) -> float:
    """By how much a clock is late at most [s]: an error that lasts no longer is timing's."""
    return max(system.comparison.lasting, system.comparison.block)


def apparent_lags(
    measured: Sequence[Matrix], predicted: Sequence[Matrix], most: int
) -> NDArray[np.intp]:
    """Samples by which measured signals lag behind what is predicted of them, (c,).

    For each signal the lag L that leaves least of y(t) = a + b yhat(t - L), fitted in each
    recording: whatever the scale and the zero of a sensor. 0 where the best is not inside.

    Parameters
    ----------
    measured, predicted : (n, c) of each recording.
    most : samples, of a lag.
    """
    reach = min(most, *(len(values) // 4 for values in measured))
    lags = np.arange(-reach, reach + 1)
    left = np.zeros((lags.size, measured[0].shape[1]))
    for y, by_model in zip(measured, predicted, strict=True):
        inner = slice(reach, len(y) - reach)
        aim = y[inner] - y[inner].mean(axis=0)
        for j, lag in enumerate(lags):
            course = by_model[inner.start - lag : inner.stop - lag]
            course = course - course.mean(axis=0)
            power = np.maximum((course**2).sum(axis=0), np.finfo(float).tiny)
            left[j] += (aim**2).sum(axis=0) - (aim * course).sum(axis=0) ** 2 / power
    best = np.argmin(left, axis=0)
    inside = (best > 0) & (best < lags.size - 1)
    return np.where(inside, best - reach, 0)


def moved(time: Vector, values: Matrix, late: float) -> Matrix:
    """Values (n, ...) of a time `late` [s] before each sample; before the first they rest."""
    at = np.clip(time - late, time[0], time[-1])
    right = np.clip(np.searchsorted(time, at), 1, time.size - 1)
    share = (at - time[right - 1]) / (time[right] - time[right - 1])
    share = share.reshape(-1, *(1,) * (values.ndim - 1))
    between: Matrix = values[right - 1] + share * (values[right] - values[right - 1])
    return between


def in_time(samples: Samples, late: Mapping[str, float]) -> Samples:
    """A recording whose late signals are moved to when they were measured.

    Each sample of an output keeps its noise: that of what a restart reads is known, and a line
    between two samples would have half of its variance, so that half a sample were favoured. Means
    over a block move instead, in which nothing else happens. Inputs have no noise left.

    Parameters
    ----------
    late : by signal [s].
    """
    if not late:
        return samples
    time, u, y = samples.time, samples.u.copy(), samples.y.copy()
    for j, name in enumerate(samples.inputs):
        if name in late:
            u[:, j] = moved(time, u[:, j], -late[name])
    window = int(np.median(np.diff(samples.blocks)))
    for j, name in enumerate(samples.signals):
        if name in late:
            slow = uniform_filter1d(y[:, j], window, mode="nearest")
            y[:, j] += moved(time, slow, -late[name]) - slow
    return replace(samples, u=u, y=y)


def late_start(samples: Samples, signal: str, system: System, late: float) -> float:
    """By how much a signal that is read late [s] began elsewhere than its first samples say.

    One that is read early began before them, along their line.
    """
    h = float(np.median(np.diff(samples.time)))
    count, noise = starting(system, h), system.signals[signal].noise_at_scale
    column = samples.y[:, samples.signals.index(signal)]

    def value(first: int, before: float = 0.0) -> float:
        part = slice(first, first + count)
        return first_value(samples.time[part], column[part], noise, before)

    share, first = np.modf(min(late / h, samples.time.size - 2.0))
    if late < 0.0:
        return value(0, -late) - value(0)
    after = (1.0 - share) * value(int(first)) + share * value(int(first) + 1)
    return float(after - value(0))


def mirrored(samples: Samples, errors: Matrix, late: Mapping[str, float]) -> Matrix:
    """Errors (n, c), those beside them in place of what no input or prediction reaches.

    By another clock, a recording is read before it begins or after it ends. As many errors stand
    there as before, as large as noise is, so that chi-squared favours no clock.

    Parameters
    ----------
    late : by signal [s].
    """
    time, errors = samples.time, errors.copy()
    ends = time[-1] - max([0.0, *(late.get(name, 0.0) for name in samples.inputs)])
    for j, name in enumerate(samples.signals):
        by = late.get(name, 0.0)
        first, end = np.searchsorted(time, [time[0] + by, ends + by + 1e-9])
        first, end = min(int(first), time.size // 2), max(int(end), time.size // 2)
        errors[:first, j] = errors[first : 2 * first, j][::-1]
        errors[end:, j] = errors[2 * end - time.size : end, j][::-1]
    return errors


def case_in_time(case: Case, system: System, sizes: Mapping[tuple[str, str], float]) -> Case:
    """As `in_time`, of all that was recorded.

    Parameters
    ----------
    sizes : by effect and parameter, those of clocks among them.
    """
    named = {f"{name}.{of}": size for (name, of), size in sizes.items()}
    late = lateness(late_signals(system), named)
    return case.with_signals(
        {n: moved(case.time, case[n], -by) for n, by in late.items() if n in case}
    )
