"""Sensors that read wrong: of a true signal s, gain, zero, lag, or a reading that is bent.

A sensor is no matter of the model. Inputs drive it by what they were, and what it says of an output
is compared as its sensor reads it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.clocks import greatest_skew
from workbench.diagnosis.data.samples import Samples
from workbench.diagnosis.effects.candidates import (
    GAIN,
    LAG,
    LIMIT,
    LOSS,
    OFFSET,
    RECTIFIED,
    SHARES,
    STEP,
    WIDTH,
    wrong_sensors,
    zero,
)
from workbench.diagnosis.effects.catalogue import Effect
from workbench.recordings.case import Case
from workbench.system.system import System

_LIMITS = (0.995, 0.75, 0.5)  # quantiles of readings that a sensor may lose something beyond
_WHOLE = 1e-3  # of a step, by which what is read in steps may be off for the digits of a file


class SensorReading(NamedTuple):
    """What a sensor reads of a signal s [SI]: (1 + gain) b(f(s)) + offset.

    f lags: `lag` df/dt = s - f. b is bent, one after the other: below zero it lacks the share
    `rectified`, within `width` of zero all; beyond `limit` the share `loss`; it goes in `step`s.
    """

    gain: float = 0.0
    offset: float = 0.0
    lag: float = 0.0
    rectified: float = 0.0
    width: float = 0.0
    loss: float = 0.0
    limit: float = np.inf
    step: float = 0.0

    @property
    def factor(self) -> float:
        """By which a signal is read."""
        return 1.0 + self.gain

    @property
    def bends(self) -> bool:
        """Whether it is more than a gain and a zero."""
        return any((self.lag, self.rectified, self.width, self.loss, self.step))

    def bent(self, time: Vector, signal: Vector) -> Vector:
        """What is read of a signal (n,), but for gain and zero."""
        s = lagged(time, signal, self.lag)
        s = s + self.rectified * np.maximum(-s, 0.0)
        s = np.sign(s) * np.maximum(np.abs(s) - self.width, 0.0)
        s = s - self.loss * np.sign(s) * np.maximum(np.abs(s) - self.limit, 0.0)
        return self.step * np.round(s / self.step) if self.step else s

    def straight(self, read: float) -> float:
        """The signal that was read, where one value tells it: above zero, and below the limit."""
        s = (read - self.offset) / self.factor
        beyond = max(abs(s) - self.limit, 0.0) * self.loss
        return s + float(np.sign(s)) * (self.width + beyond)

    def slopes(self, time: Vector, signal: Vector) -> Vector:
        """Derivative of what is bent by what lags, (n,); steps have that of their mean."""
        s = lagged(time, signal, self.lag)
        slopes = np.where(s < 0.0, 1.0 - self.rectified, 1.0)
        s = s + self.rectified * np.maximum(-s, 0.0)
        slopes *= np.abs(s) >= self.width
        slopes *= np.where(np.abs(s) - self.width > self.limit, 1.0 - self.loss, 1.0)
        return slopes


def lagged(time: Vector, values: Matrix, lag: float) -> Matrix:
    """Values (n, ...) behind a lag of first order [s], which rests before the first.

    From sample to sample, values go along a line: with q = exp(-h/lag) and w = lag/h (1 - q),
    f_k = q f_k-1 + (w - q) s_k-1 + (1 - w) s_k.
    """
    if lag == 0.0:
        return values
    from scipy.signal import lfilter  # takes its time, and little else needs it

    h = float(np.median(np.diff(time)))
    q = np.exp(-h / lag)
    w = lag / h * (1.0 - q)
    steady = w * values[:1]
    behind: Matrix = lfilter([1.0 - w, w - q], [1.0, -q], values, axis=0, zi=steady)[0]
    return behind


class SensorError(NamedTuple):
    """One parameter of a wrong sensor: of which signal, a typical size, bounds, unit, and zero."""

    signal: str
    parameter: str
    typical: float
    bounds: tuple[float, float]
    unit: str
    zero: float  # about which a gain is wrong


def sensor_errors(system: System) -> dict[str, SensorError]:
    """What sensors may have wrong, by the names of variables."""
    errors = {}
    for effect in wrong_sensors(system):
        signal = system.signals[effect.sensor]
        for parameter in (effect.size, *(name for name, _ in effect.shapes)):
            if parameter in SHARES:
                typical, unit = 1.0, "1"
            elif parameter == LAG:
                typical, unit = system.sample_time, "s"
            else:
                typical, unit = signal.scale, signal.unit
            # A gain keeps the sign of its signal; a zero is off by the signal's size at most.
            bounds = {
                GAIN: (-0.9, 9.0),
                OFFSET: (-typical, typical),
                LAG: (0.0, greatest_skew(system)),
                LIMIT: (0.0, np.inf),
                LOSS: (0.0, 2.0),
                RECTIFIED: (0.0, 3.0),
            }.get(parameter, (0.0, typical))
            name = f"{effect.name}.{parameter}"
            about = zero(signal.unit, signal.scale) if parameter == GAIN else 0.0
            errors[name] = SensorError(signal.name, parameter, typical, bounds, unit, about)
    return errors


def readings(
    errors: Mapping[str, SensorError], values: Mapping[str, float]
) -> dict[str, SensorReading]:
    """What sensors read, of those with an error.

    Parameters
    ----------
    errors : see `sensor_errors`.
    values : by the same names; others are zero.
    """
    wrong: dict[str, SensorReading] = {}
    for name, error in errors.items():
        if value := values.get(name, 0.0):
            known = wrong.get(error.signal, SensorReading())
            wrong[error.signal] = known._replace(**{error.parameter: value})
    zeros = {error.signal: error.zero for error in errors.values() if error.parameter == GAIN}
    return {
        signal: reading._replace(offset=reading.offset - reading.gain * zeros[signal])
        for signal, reading in wrong.items()
    }


def corrected(samples: Samples, wrong: Mapping[str, SensorReading]) -> Samples:
    """A recording with signals as they were: (reading - offset) / factor, inputs behind their lag.

    An output that is bent is not made straight: see `straightened`.
    """
    if not wrong:
        return samples
    u, y = samples.u.copy(), samples.y.copy()
    for names, values in ((samples.inputs, u), (samples.signals, y)):
        for j, name in enumerate(names):
            if name in wrong:
                values[:, j] = (values[:, j] - wrong[name].offset) / wrong[name].factor
    for j, name in enumerate(samples.inputs):
        if name in wrong:
            u[:, j] = lagged(samples.time, u[:, j], wrong[name].lag)
    return replace(samples, u=u, y=y, begin=starts(samples.begin, wrong))


def straightened(samples: Samples, seen: Matrix, wrong: Mapping[str, SensorReading]) -> Samples:
    """A recording whose outputs have, beside what was read, what sensors lack of signals seen."""
    y = samples.y.copy()
    for j, name in enumerate(samples.signals):
        if name in wrong:
            y[:, j] += seen[:, j] - wrong[name].bent(samples.time, seen[:, j])
    return replace(samples, y=y)


def starts(values: Mapping[str, float], wrong: Mapping[str, SensorReading]) -> dict[str, float]:
    """Start values, those that were read by a wrong sensor as they were."""
    return {
        name: wrong[name].straight(value) if name in wrong else value
        for name, value in values.items()
    }


def sensed(samples: Samples, signals: Matrix, wrong: Mapping[str, SensorReading]) -> Matrix:
    """What sensors read of signals (n, c)."""
    signals = signals.copy()
    for j, name in enumerate(samples.signals):
        if name in wrong:
            bent = wrong[name].bent(samples.time, signals[:, j])
            signals[:, j] = wrong[name].factor * bent + wrong[name].offset
    return signals


def sensed_changes(
    samples: Samples, changes: Matrix, seen: Matrix, wrong: Mapping[str, SensorReading]
) -> Matrix:
    """What sensors read of small changes (n, c, p) of the signals that are seen, (n, c)."""
    changes = changes.copy()
    for j, name in enumerate(samples.signals):
        if (reading := wrong.get(name)) is not None:
            slopes = reading.factor * reading.slopes(samples.time, seen[:, j])
            behind = lagged(samples.time, changes[:, j], reading.lag)
            changes[:, j] = slopes[:, None] * behind
    return changes


def step_of(values: Vector) -> float:
    """The step of readings that are all multiples of one; 0 if they are not."""
    levels = np.unique(values)
    steps = np.diff(levels)
    if not steps.size:
        return 0.0
    step = float(np.median(steps[steps > _WHOLE * steps.max()]))
    off = values / step
    return step if np.abs(off - np.round(off)).max() < _WHOLE * max(1.0, np.abs(off).max()) else 0.0


def fitting_recordings(
    effects: Sequence[Effect], system: System, cases: Sequence[Case]
) -> Iterator[Effect]:
    """Effects, those of sensors as recordings can show them.

    The limit of a sensor is sought among its readings. A dead zone around zero is an offset where
    no reading comes near, and readings that are no multiples of a step above noise have none. A
    step is that of the readings: by another one a run goes in other steps, as wrong as without.
    """
    for effect in effects:
        signals = [effect.sensor] if effect.sensor else effect.late
        parts = [case[name] for case in cases for name in signals if name in case]
        read = np.concatenate([part[~np.isnan(part)] for part in parts] or [np.zeros(0)])
        if signals and not read.size:
            continue  # nothing shows what no recording has
        if not effect.sensor:
            yield effect
            continue
        noise = system.signals[effect.sensor].noise_at_scale
        if effect.size == LOSS:
            limits = np.quantile(np.abs(read), _LIMITS)
            yield replace(effect, shapes=((LIMIT, tuple(dict.fromkeys(map(float, limits)))),))
        elif effect.size == STEP:
            if (step := step_of(read)) >= noise:
                yield replace(effect, told=step)
        elif effect.size != WIDTH or np.abs(read).min() <= noise:
            yield effect


def case_by_sensors(case: Case, system: System, sizes: Mapping[tuple[str, str], float]) -> Case:
    """A recording with all signals as they were, where a diagnosis found their sensors wrong.

    Parameters
    ----------
    sizes : by effect and parameter, those of sensors among them.
    """
    named = {f"{name}.{of}": size for (name, of), size in sizes.items()}
    wrong = readings(sensor_errors(system), named)
    inputs = {signal.name for signal in system.inputs}
    return case.with_signals(
        {
            n: lagged(case.time, (case[n] - r.offset) / r.factor, r.lag * (n in inputs))
            for n, r in wrong.items()
            if n in case
        }
    )
