"""The stop in a recording: when it was commanded, what was asked, how far it went."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Vector
from workbench.diagnosis.data.counting import excluded_by
from workbench.errors import InputError
from workbench.recordings.case import Case, Value, read_conditions
from workbench.studies.distance.simulation import GRID
from workbench.system.comparison import Exclusion
from workbench.system.stopping import COMMAND, DrivenInput, Stopping
from workbench.system.system import System
from workbench.system.tables import Table

_RISEN = 6.0  # lags after which what rises is there: a quarter of a percent is left
_HALF = math.log(2.0)  # lags in which the half is reached


@dataclass(frozen=True, eq=False)
class Stop:
    """A stop, recorded or asked for."""

    name: str
    asked: Mapping[str, float]  # by name, SI
    conditions: Mapping[str, Value]  # as of a case
    # by input, (g,) what it is by the place, every GRID from the command on
    along: Mapping[str, Vector]


@dataclass(frozen=True, eq=False)
class RecordedStop:
    """A stop that was made."""

    stop: Stop
    command: float  # in the recording [s]
    distance: float  # from the command to standstill, by its own sensors [m]
    resistance: float  # of gradients and curves over weight, after the response, mean [1]
    outside: tuple[str, ...]  # reasons why it is outside the validity range of the model


def read_stop(case: Case, system: System, stopping: Stopping) -> RecordedStop:
    """Read the stop out of a recording.

    Raises
    ------
    InputError
        If nothing rises in it, or it does not end at rest.
    """
    time, speed = case.time, system.evaluate(stopping.speed, case.signals)
    rising = next(signal for signal in stopping.driven if signal.name == stopping.timed_by)
    command = _command(case, rising)
    end = _at_rest(case, speed, command, stopping)
    moving = (time > command) & (np.arange(time.size) < end)
    at = np.concatenate([[command], time[moving]])
    going = np.interp(at, time, speed)
    way = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(at) * (going[1:] + going[:-1]))])
    rate = (speed[end - 1] - speed[end]) / (time[end] - time[end - 1])
    distance = float(way[-1] + going[-1] ** 2 / (2.0 * rate))
    risen = (at > command + rising.delay + _RISEN * rising.lag) & (way <= way[-1])
    asked = {}
    for quantity in stopping.asked:
        values = np.interp(at, time, system.evaluate(quantity.formula, case.signals))
        asked[quantity.name] = float(
            values[0] if quantity.place == COMMAND else np.median(values[risen])
        )
    h = float(np.median(np.diff(time)))
    resistance = 0.0
    if stopping.nominal is not None:  # mean over the way after the response
        values = system.evaluate(stopping.nominal.resistance, case.signals)
        after = way >= np.interp(at[0] + stopping.response, at, way)
        lengths = np.gradient(way[after])
        resistance = float(np.interp(at[after], time, values) @ lengths / lengths.sum())
    grid = np.arange(0.0, way[-1] + GRID, GRID)
    along = {
        signal.name: np.interp(grid, way, np.interp(at, time, case[signal.name]))
        for signal in stopping.driven
        if signal.along
    }
    return RecordedStop(
        stop=Stop(case.name, asked, case.conditions, along),
        command=command,
        distance=distance,
        resistance=resistance,
        outside=tuple(
            exclusion.reason
            for exclusion in stopping.outside
            if _mask(exclusion, case.signals, system, time, h)[moving].any()
        ),
    )


def asked_stop(asked: Mapping[str, Any], system: System, stopping: Stopping) -> Stop:
    """Read a stop as people ask for it; what they do not say is usual.

    Parameters
    ----------
    asked : quantities with units, words of conditions, by name.

    Raises
    ------
    InputError
        If something is no quantity that is asked for and no condition, or is not as expected.
    """
    where = "what is asked for"
    quantities = {quantity.name: quantity for quantity in stopping.asked}
    table = Table(asked, where)
    table.refuse_unknown([*quantities, *(condition.name for condition in system.conditions)])
    values = {name: table.number(name, q.unit, q.usual) for name, q in quantities.items()}
    conditions = {}
    for condition in system.conditions:
        if condition.name in asked:
            conditions[condition.name] = asked[condition.name]
        elif condition.choices:
            usual = condition.choices[0]
            conditions[condition.name] = [usual] * condition.count if condition.count else usual
    return Stop("asked for", values, read_conditions(Table(conditions, where), system), {})


def beyond(outputs: Mapping[str, Vector], system: System, stopping: Stopping) -> bool:
    """Whether readings of a model's outputs, (n,) each, are outside its validity range."""
    h = system.sample_time
    time: Vector = h * np.arange(float(next(iter(outputs.values())).size))
    return any(_mask(exclusion, outputs, system, time, h).any() for exclusion in stopping.outside)


def _mask(
    exclusion: Exclusion, signals: Mapping[str, Vector], system: System, time: Vector, h: float
) -> NDArray[np.bool_]:
    """Where a reason holds; at rest a ratio is undefined, and no reason holds."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return excluded_by(exclusion, signals, system, time, h, 1)


def _command(case: Case, rising: DrivenInput) -> float:
    """When the command was given, by the half of what it made rise [s]."""
    signal, time = case[rising.name], case.time
    low, high = float(np.median(signal[: time.size // 10])), float(np.median(signal[-10:]))
    half = 0.5 * (low + high)
    above = signal > half
    first = int(np.argmax(above))
    if first == 0 or not high > low:
        raise InputError(
            where=f"{case.source}, column '{rising.name}'",
            found="nothing that rises after the beginning",
            expected="a stop, from before its command until it is at rest",
            remedy="leave this recording out",
        )
    share = (half - signal[first - 1]) / (signal[first] - signal[first - 1])
    crossed = time[first - 1] + share * (time[first] - time[first - 1])
    return float(crossed - rising.delay - _HALF * rising.lag)


def _at_rest(case: Case, speed: Vector, command: float, stopping: Stopping) -> int:
    slow = (case.time > command) & (speed <= stopping.rest)
    if not slow.any():
        raise InputError(
            where=str(case.source),
            found=f"{speed[-1]:.3g} m/s at its end",
            expected="a recording until standstill",
            remedy="leave this recording out",
        )
    return int(np.argmax(slow))
