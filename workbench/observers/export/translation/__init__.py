"""Laws of estimators, which are compiled Python, to C99.

The laws keep to what numba compiles without allocating: numbers, arrays of a given shape, named
tuples of these, loops and calls of other compiled functions. With the concrete settings and memory
of an estimator all shapes are known, so that each function becomes plain C over pointers, once for
each set of types that it is called with.
"""

from workbench.observers.export.translation.functions import Primitive, Program
from workbench.observers.export.translation.values import (
    Array,
    Data,
    Number,
    Record,
    Several,
    Value,
)

__all__ = ["Array", "Data", "Number", "Primitive", "Program", "Record", "Several", "Value"]
