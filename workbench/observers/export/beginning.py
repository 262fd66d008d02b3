"""What an estimator remembers from the start, and which of it the first sample says.

That is found by starting the estimator itself. What it begins with must be linear in the first
sample, as a speed that is measured and one that rolls along with it are.
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.native import Instance
from workbench.observers import Estimator
from workbench.observers.export.translation.values import literal, name_in_c

_ROUNDING = 1e-9  # share of what is told apart: rounding is a millionth of it
_LARGEST = float(np.finfo(float).max) / 1e9  # sums of it are finite
_TRIALS = (1.0, -1.0, 10.0)  # samples at which what was found is tried, in sizes of signals


class ModelView(NamedTuple):
    """What a law sees of its model, see `Instance`, and where the model stands."""

    x: Vector
    dx: Vector
    u: Vector
    y: Vector
    jacobian: Matrix
    number: int  # of the model, where there are several
    # at_x, at_u: states and inputs of the model, all of them
    at_x: Vector
    at_u: Vector


class Remembered(NamedTuple):
    """All that a law remembers; `memory` is of the estimator's own kind."""

    model: tuple[ModelView, ...]
    memory: Any


@dataclass(frozen=True)
class FirstValue:
    """A number that the first sample says: constant + slopes @ [u, y]."""

    place: str  # in C
    constant: float
    slopes: Vector

    @property
    def text(self) -> str:
        """Statement in C that gives it its value."""
        terms = [literal(self.constant)] if self.constant else []
        for k in np.flatnonzero(self.slopes):
            slope = float(self.slopes[k])
            terms.append(f"sample[{k}]" if slope == 1.0 else f"{literal(slope)} * sample[{k}]")
        return f"{self.place} = {' + '.join(terms)};"


def memory_after(estimator: Estimator, sample: Vector) -> Remembered:
    """All that is remembered after a first sample, (m + l,)."""
    m = len(estimator.system.inputs)
    estimator.start(sample[:m], sample[m:])
    parts = estimator.parts
    _refuse_shared(estimator)
    both = zip(parts.models, estimator.models, strict=True)
    models = tuple(_model(model, fmu, number) for number, (model, fmu) in enumerate(both))
    return copy.deepcopy(Remembered(models, parts.state))


def usual_sample(estimator: Estimator) -> Vector:
    """A sample at which the model is valid, (m + l,): its own start."""
    system, defaults = estimator.system, estimator.fmu.defaults
    return np.array(
        [defaults.get(signal.name, 0.0) for signal in (*system.inputs, *system.outputs)]
    )


def values_of_first_sample(estimator: Estimator) -> list[FirstValue]:
    """What the first sample says, of all that is remembered.

    Raises
    ------
    InputError
        If that is not linear in the sample.
    """
    usual = usual_sample(estimator)
    signals = (*estimator.system.inputs, *estimator.system.outputs)
    sizes = np.array([abs(signal.scale) or 1.0 for signal in signals])
    places, begin = _flat(memory_after(estimator, usual))
    # By powers of two, so that what is measured is found without rounding where zero is usual.
    steps = 2.0 ** np.round(np.log2(sizes))
    moved = [_flat(memory_after(estimator, usual + step))[1] for step in np.diag(steps)]
    slopes = np.array([_change(begin, step) for step in moved]).T / steps
    whole = np.round(slopes)
    slopes = np.where(np.abs(slopes - whole) < _ROUNDING, whole, slopes)
    share = np.random.default_rng(0).uniform(0.5, 1.0, sizes.size)  # of each signal another one
    for trial in _TRIALS:
        change = trial * share * sizes
        changed = _change(begin, _flat(memory_after(estimator, usual + change))[1])
        large = np.abs(slopes) @ np.abs(change) + np.abs(np.where(np.isfinite(begin), begin, 0.0))
        if (bad := np.flatnonzero(np.abs(changed - slopes @ change) > _ROUNDING * large)).size:
            raise InputError(
                where=f"estimator {estimator.name}",
                found=f"{places[bad[0]]}, which is not linear in the first sample",
                expected="a start that follows the first sample linearly",
                remedy="let the law make it of the first sample, where h is 0",
            )
    return [
        FirstValue(places[k], _constant(begin[k], slopes[k], usual, sizes), slopes[k])
        for k in np.flatnonzero(slopes.any(axis=1))
    ]


def gains_in_settings(estimator: Estimator) -> dict[str, list[str]]:
    """Places in C among the settings, by gain; none if a gain does more than stand there as it is.

    That is found by making the estimator anew with other gains: a law whose settings and memory
    change by nothing else follows its gains when they change later.
    """
    system, gains, parts = estimator.system, estimator.gains, estimator.parts
    if parts.several or not gains.names:
        return {}
    # Of each gain another share and another zero, so that no two have one value.
    shares = np.random.default_rng(0).uniform(0.5, 1.0, (2, gains.values.size))
    others = gains.with_values(gains.values * shares[0] + 1e-9 * shares[1])
    moved = type(estimator)(estimator.fmu, system, others)
    sample = usual_sample(estimator)
    before, after = (_flat(memory_after(e, sample))[1] for e in (estimator, moved))
    numbers = list(_numbers(parts.settings, "settings"))
    changed = [number for _, number in _numbers(moved.parts.settings, "settings")]
    places: dict[str, list[str]] = {name: [] for name in gains.names}
    index = {value: k for k, value in enumerate(others.values.tolist())}
    for (place, number), other in zip(numbers, changed, strict=True):
        k = index.get(other)
        if k is not None and number == gains.values[k]:
            places[gains.names[k]].append(place)
        elif _change(np.array(number), np.array(other)) != 0.0:
            return {}
    return places if not np.any(_change(before, after)) and all(places.values()) else {}


def _change(before: Vector, after: Vector) -> Vector:
    """Difference; where one of them alone is no number, as large as a number can be."""
    same = (before == after) | (np.isnan(before) & np.isnan(after))
    with np.errstate(invalid="ignore"):
        return np.where(same, 0.0, np.nan_to_num(after - before, nan=_LARGEST))


def _constant(value: float, slopes: Vector, usual: Vector, sizes: Vector) -> float:
    constant = value - float(slopes @ usual)
    rounding = _ROUNDING * float(np.abs(slopes) @ (np.abs(usual) + sizes))
    return 0.0 if abs(constant) < rounding else constant


def _model(instance: Instance, fmu: FMU, number: int) -> ModelView:
    at_u = np.array([fmu.defaults.get(name, 0.0) for name in fmu.inputs])
    buffers = instance.x, instance.dx, instance.u, instance.y, instance.jacobian
    return ModelView(*buffers, number=number, at_x=fmu.get_states(), at_u=at_u)


def _refuse_shared(estimator: Estimator) -> None:
    """Refuse memory that is in two places, which would be two in C."""
    parts = estimator.parts
    arrays = [*_arrays(tuple(parts.settings)), *_arrays(tuple(map(tuple, parts.models)))]
    for array in _arrays(parts.state):
        if any(np.shares_memory(array, other) for other in arrays):
            raise InputError(
                where=f"estimator {estimator.name}",
                found="an array that stands in two places of its memory, or in its settings",
                expected="memory in which each array is another one",
                remedy="make two arrays",
            )
        arrays.append(array)


def _arrays(value: Any) -> Iterator[NDArray[Any]]:
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for entry in value:
            yield from _arrays(entry)


def _flat(value: Remembered) -> tuple[list[str], Vector]:
    """Places in C of all numbers, and the numbers, (n,)."""
    listed = list(_numbers(value, "law"))
    return [place for place, _ in listed], np.array([number for _, number in listed])


def _numbers(value: Any, place: str) -> Iterator[tuple[str, float]]:
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        mark = "->" if isinstance(value, Remembered) else "."
        for name, entry in zip(value._fields, value, strict=True):
            yield from _numbers(entry, f"{place}{mark}{name_in_c(name)}")
    elif isinstance(value, tuple | np.ndarray):
        listed = value.ravel().tolist() if isinstance(value, np.ndarray) else value
        for k, entry in enumerate(listed):
            yield from _numbers(entry, f"{place}[{k}]")
    elif isinstance(value, int | float | np.generic):  # all else is refused where it becomes C
        yield place, float(value)
