"""Recursive filters; `scipy.signal` has them, too, but takes half a second to load."""

import math

import numpy as np

from workbench.arrays import Vector
from workbench.models.native import compiled, read_only


def recursive(numerator: Vector, denominator: Vector, values: Vector, begin: Vector) -> Vector:
    """Values (n, ...) behind a filter, as of `scipy.signal.lfilter` along the first axis.

    Parameters
    ----------
    numerator, denominator : (k + 1,), of which the last begins with 1.
    begin : (k, ...) memory at the first sample.

    Examples
    --------
    >>> recursive(np.array([0.5, 0.0]), np.array([1.0, -0.5]), np.ones(3), np.zeros(1))
    array([0.5  , 0.75 , 0.875])
    """
    columns = math.prod(values.shape[1:])
    filtered = np.empty(values.shape)
    memory = np.array(begin, np.float64).reshape(denominator.size - 1, columns)
    rows = read_only(values.reshape(values.shape[0], columns))
    _filter(numerator, denominator, rows, memory, filtered.reshape(rows.shape))
    return filtered


@compiled
def _filter(numerator, denominator, values, memory, filtered):  # type: ignore[no-untyped-def]
    """Filter each column of values, (n, p), by direct form II, transposed."""
    last = memory.shape[0]
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            x = values[i, j]
            y = memory[0, j] + numerator[0] * x
            for m in range(1, last):
                memory[m - 1, j] = memory[m, j] + x * numerator[m] - y * denominator[m]
            memory[last - 1, j] = x * numerator[last] - y * denominator[last]
            filtered[i, j] = y
    return 0
