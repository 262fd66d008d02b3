"""Sensors with another gain or zero: a sensor reads (1 + gain) times its signal, plus offset.

A sensor is no matter of the model. Inputs drive it by what they were, and what it says of an output
is compared as its sensor reads it.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from workbench.arrays import Matrix
from workbench.diagnosis.data.samples import Samples
from workbench.diagnosis.effects.candidates import GAIN, OFFSET, sensor_error
from workbench.recordings.case import Case
from workbench.system.system import System


class Reading(NamedTuple):
    """What a sensor reads: `factor` times its signal, plus `offset` [SI]."""

    factor: float = 1.0
    offset: float = 0.0


def sensor_errors(system: System) -> dict[str, tuple[str, str, float]]:
    """By the name of a sensor's error: its signal, GAIN or OFFSET, and a typical size [SI]."""
    return {
        f"{sensor_error(signal, size)}.{size}": (signal.name, size, typical)
        for signal in system.signals.values()
        for size, typical in ((GAIN, 1.0), (OFFSET, signal.scale))
    }


def readings(
    errors: Mapping[str, tuple[str, str, float]], values: Mapping[str, float]
) -> dict[str, Reading]:
    """What sensors read, of those with an error.

    Parameters
    ----------
    errors : see `sensor_errors`.
    values : by the same names; others are zero.
    """
    wrong: dict[str, Reading] = {}
    for name, (signal, size, _) in errors.items():
        if value := values.get(name, 0.0):
            known = wrong.get(signal, Reading())
            wrong[signal] = (
                known._replace(factor=1.0 + value) if size == GAIN else known._replace(offset=value)
            )
    return wrong


def corrected(samples: Samples, wrong: Mapping[str, Reading]) -> Samples:
    """A recording with signals as they were: (reading - offset) / factor."""
    if not wrong:
        return samples
    u, y = samples.u.copy(), samples.y.copy()
    for names, values in ((samples.inputs, u), (samples.signals, y)):
        for j, name in enumerate(names):
            if name in wrong:
                values[:, j] = (values[:, j] - wrong[name].offset) / wrong[name].factor
    return replace(samples, u=u, y=y, begin=starts(samples.begin, wrong))


def starts(values: Mapping[str, float], wrong: Mapping[str, Reading]) -> dict[str, float]:
    """Start values, those that were read by a wrong sensor as they were."""
    return {
        name: (value - wrong[name].offset) / wrong[name].factor if name in wrong else value
        for name, value in values.items()
    }


def scaled(samples: Samples, signals: Matrix, wrong: Mapping[str, Reading]) -> Matrix:
    """Signals, or their derivatives, (n, c, ...) times the factors of their sensors."""
    if not any(name in wrong for name in samples.signals):
        return signals
    signals = signals.copy()
    for j, name in enumerate(samples.signals):
        if name in wrong:
            signals[:, j] *= wrong[name].factor
    return signals


def shifted(samples: Samples, signals: Matrix, wrong: Mapping[str, Reading]) -> Matrix:
    """Signals (n, c) plus the offsets of their sensors."""
    offsets = [wrong.get(name, Reading()).offset for name in samples.signals]
    return signals + offsets if any(offsets) else signals


def case_by_sensors(case: Case, system: System, sizes: Mapping[tuple[str, str], float]) -> Case:
    """A recording with all signals as they were, where a diagnosis found their sensors wrong.

    Parameters
    ----------
    sizes : by effect and parameter, those of sensors among them.
    """
    named = {f"{name}.{of}": size for (name, of), size in sizes.items()}
    wrong = readings(sensor_errors(system), named)
    return case.with_signals(
        {n: (case[n] - r.offset) / r.factor for n, r in wrong.items() if n in case}
    )
