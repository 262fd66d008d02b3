"""Functions of numbers, of Python and numpy, in C."""

import builtins
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench.observers.export.translation.values import (
    BOOL,
    DOUBLE,
    INT,
    Array,
    Number,
    Value,
    common,
    expression,
)

# By name of the function of numbers in C; of all numpy and Python have under a name.
_REAL = {
    "sqrt": (np.sqrt, math.sqrt),
    "exp": (np.exp, math.exp),
    "log": (np.log, math.log),
    "sin": (np.sin, math.sin),
    "cos": (np.cos, math.cos),
    "tan": (np.tan, math.tan),
    "asin": (np.arcsin, math.asin),
    "acos": (np.arccos, math.acos),
    "atan": (np.arctan, math.atan),
    "atan2": (np.arctan2, math.atan2),
    "sinh": (np.sinh, math.sinh),
    "cosh": (np.cosh, math.cosh),
    "tanh": (np.tanh, math.tanh),
    "hypot": (np.hypot, math.hypot),
    "floor": (np.floor,),
    "ceil": (np.ceil,),
    "fabs": (np.abs, np.fabs, math.fabs),
}
_TRUTH = {
    "isnan": (np.isnan, math.isnan),
    "isinf": (np.isinf, math.isinf),
    "isfinite": (np.isfinite, math.isfinite),
}
_ONE, _TWO = 1, 2


def of_numbers(function: Any, given: Sequence[Value]) -> Value | None:
    """A function of numbers; None if it is another one."""
    if function is builtins.len and len(given) == _ONE and isinstance(given[0].type, Array):
        return given[0].sizes[0]
    if not given or not all(isinstance(argument.type, Number) for argument in given):
        return None
    listed = ", ".join(argument.text for argument in given)
    for table, kind in ((_REAL, DOUBLE), (_TRUTH, BOOL)):
        for name, functions in table.items():
            if any(function is known for known in functions):
                count = _TWO if name in ("atan2", "hypot") else _ONE
                return (
                    expression(kind, f"{name}({listed})", *given) if len(given) == count else None
                )
    return _builtin(function, given)


def _builtin(function: Any, given: Sequence[Value]) -> Value | None:
    first = given[0]
    if function is builtins.min or function is builtins.max:
        return _extreme("python_least" if function is builtins.min else "python_most", given)
    if len(given) > _ONE:
        return None
    if function is builtins.abs:
        name = "fabs" if first.kind == DOUBLE else "abs"
        return expression(
            common(first.kind, INT), f"{name}({first.text})", first, natural=first.kind != DOUBLE
        )
    if function is builtins.float:
        return expression(DOUBLE, f"(double){first.operand}", first)
    if function is builtins.int:
        return expression(INT, f"(int){first.operand}", first, natural=first.natural)
    if function is builtins.bool:
        return expression(BOOL, f"{first.operand} != 0", first)
    return None


def _extreme(name: str, given: Sequence[Value]) -> Value | None:
    """The least or largest, the first of equal ones, by comparisons in Python's order."""
    if len(given) < _TWO:
        return None
    result = given[0]
    for argument in given[1:]:
        kind = common(common(result.kind, argument.kind), INT)
        of = name if kind == DOUBLE else f"{name}_int"
        natural = kind == INT and result.natural and argument.natural
        result = expression(
            kind, f"{of}({result.text}, {argument.text})", result, argument, natural=natural
        )
    return result
