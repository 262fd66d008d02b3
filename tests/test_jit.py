"""Laws are compiled with the loop that takes them up, and hand on named tuples by address."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core.errors import TypingError

from workbench.models.native import compiled


@compiled
def root(x: float) -> float:
    if x < 0.0:
        raise ValueError("no root")
    return float(np.sqrt(x))


@compiled
def total(x: np.ndarray) -> float:
    total = 0.0
    for number in x:
        total += root(number)
    return total


def test_a_loop_does_what_its_law_does_and_refuses_what_it_refuses():
    assert total(np.array([1.0, 4.0])) == 3.0
    with pytest.raises(ValueError, match="no root"):
        total(np.array([1.0, -4.0]))


def test_what_a_loop_took_up_may_be_called_alone_too():
    assert total(np.array([9.0])) == root(9.0) == 3.0


class Part(NamedTuple):
    values: np.ndarray
    factor: float


class Whole(NamedTuple):
    part: Part
    matrix: np.ndarray
    count: int
    negative: bool
    parts: tuple[Part, ...]


@compiled
def weighted(part: Part) -> float:
    total = 0.0
    for i in range(part.values.size):
        total += part.factor * part.values[i]
    return total


@compiled
def everything(whole: Whole, k: int) -> float:
    sign = -1.0 if whole.negative else 1.0
    total = weighted(whole.part) + whole.matrix[1, 0] * whole.count + weighted(whole.parts[k])
    return sign * total


@compiled
def fill(part: Part, steps: int) -> float:
    before = part.values[0]
    for _ in range(steps):
        for i in range(part.values.size):
            part.values[i] += part.factor
    return part.values[0] - before


def whole(negative: bool) -> Whole:
    parts = tuple(Part(np.full(3, 10.0 * k), 2.0) for k in range(3))
    return Whole(Part(np.arange(4.0), 0.5), np.arange(6.0).reshape(3, 2), 7, negative, parts)


@pytest.mark.parametrize("negative", [False, True])
def test_a_law_reads_what_python_reads(negative):
    """Arrays, numbers, truth values, tuples within tuples, and one of several by its number."""
    given = whole(negative)
    for k in range(3):
        assert everything(given, k) == everything.py_func(given, k)


def test_what_a_law_writes_into_arrays_is_seen_by_itself_and_by_its_caller():
    """Addresses are read once, what lies there each time."""
    part = Part(np.zeros(5), 0.25)
    assert fill(part, 8) == 2.0
    assert (part.values == 2.0).all()


def test_arrays_of_one_call_are_not_those_of_the_next():
    assert [weighted(Part(np.full(2, value), 1.0)) for value in (1.0, 2.0, 3.0)] == [2.0, 4.0, 6.0]


def _named(fields: list[tuple[str, Any]]) -> Callable[..., Any]:
    pair: Any = NamedTuple("Pair", fields)
    return pair


@compiled
def difference(pair: Any) -> float:
    return pair.first - pair.second


def test_classes_of_one_name_may_have_their_fields_in_another_order():
    fields, other = [("first", float), ("second", float)], [("second", float), ("first", float)]
    assert difference(_named(fields)(5.0, 3.0)) == 2.0
    assert difference(_named(other)(5.0, 3.0)) == -2.0


def test_a_field_that_there_is_not_is_named():
    with pytest.raises(TypingError, match="first"):
        difference(Part(np.zeros(1), 1.0))
