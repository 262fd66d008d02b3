"""Arithmetic in a system file: signals made of measured ones and of a model's parameters."""

import ast
import json
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from workbench.errors import InputError

Formula = Callable[[Callable[[str], Any]], Any]

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS: dict[str, np.ufunc] = {
    "abs": np.abs,
    "max": np.maximum,
    "min": np.minimum,
    "sqrt": np.sqrt,
    "sign": np.sign,
}


@dataclass(frozen=True)
class Expression:
    """A formula over names, also `a.b` and `a[1]`; its values are floats or arrays of one shape.

    A name that is no identifier stands in double quotes; Modelica's `'a b'` as it is.

    Parameters
    ----------
    text : numbers, names, + - * / **, brackets, abs, max, min, sqrt, sign.
    where : place for the message of an error.

    Raises
    ------
    InputError
        If the text is anything else.

    Examples
    --------
    >>> stored = Expression("inflow - c*sqrt(2*level)", "system.toml")
    >>> float(stored({"inflow": 0.5, "c": 0.125, "level": 2.0}))
    0.25
    >>> sorted(stored.names)
    ['c', 'inflow', 'level']
    """

    text: str
    where: str = field(compare=False)

    @classmethod
    def of(cls, name: str, where: str) -> "Expression":
        """The formula that is a name alone, however it is spelt."""
        try:
            return cls(name, where)
        except InputError:
            return cls(json.dumps(name, ensure_ascii=False), where)

    def __post_init__(self) -> None:
        self.names  # noqa: B018  read once, so that a mistake shows where it stands

    def __reduce__(self) -> tuple[type["Expression"], tuple[str, str]]:
        return Expression, (self.text, self.where)  # no process takes functions of another one

    @cached_property
    def _formula(self) -> Formula:
        try:
            return self._built(ast.parse(self.text, mode="eval").body)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise self._wrong(self.text) from None

    @cached_property
    def names(self) -> frozenset[str]:
        """Names of what the formula is made of."""
        names: list[str] = []

        def note(name: str) -> float:
            names.append(name)
            return 1.0

        try:
            with np.errstate(all="ignore"):
                self._formula(note)
        except (RecursionError, OverflowError):
            raise self._wrong(self.text) from None
        return frozenset(names)

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Value where names have `values`, a float or an array."""
        return self._formula(values.__getitem__)

    def slopes(self, names: tuple[str, ...], values: Mapping[str, float]) -> tuple[float, ...]:
        """Coefficients of some of the names, in which the formula must be linear and homogeneous.

        Parameters
        ----------
        values : of the other names.
        """
        count = len(names)
        points = np.vstack([np.eye(count), -np.arange(2.0, 2.0 + count), np.zeros(count)])
        others = {name: values[name] for name in self.names if name not in names}
        with np.errstate(all="ignore"):
            sums = np.array(
                [float(self({**others, **dict(zip(names, p, strict=True))})) for p in points]
            )
        slopes = sums[:count]
        if not (np.isfinite(sums).all() and np.allclose(sums, points @ slopes)):
            raise InputError(
                where=self.where,
                found=f"'{self.text}'",
                expected=f"a sum of {', '.join(names)}, each times a constant",
                remedy="correct the formula",
            )
        return tuple(float(value) for value in slopes)

    def _built(self, node: ast.AST) -> Formula:
        """A function of what tells the value of a name."""
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                constant = np.float64(number)  # divided by zero it is infinite, as an array is
                return lambda value_of: constant
            case ast.Name() | ast.Attribute() | ast.Subscript() | ast.Constant(value=str()):
                name = self._name(node)
                return lambda value_of: value_of(name)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                return _apply(_OPERATORS[type(op)], self._built(operand))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _apply(_OPERATORS[type(op)], self._built(left), self._built(right))
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if (
                name in _FUNCTIONS and len(args) == _FUNCTIONS[name].nin
            ):
                return _apply(_FUNCTIONS[name], *map(self._built, args))
        raise self._wrong(ast.unparse(node))

    def _name(self, node: ast.AST) -> str:
        match node:
            case ast.Name(id=name):
                return name
            case ast.Constant(value=str() as name) if not name.isidentifier():
                written = ast.get_source_segment(self.text, node) or ""
                return written if written.startswith("'") else name
            case ast.Attribute(value=value, attr=name):
                return f"{self._name(value)}.{name}"
            case ast.Subscript(value=value, slice=ast.Constant(value=int() as place)) if place > 0:
                return f"{self._name(value)}[{place}]"
        raise self._wrong(ast.unparse(node))

    def _wrong(self, part: str) -> InputError:
        return InputError(
            where=self.where,
            found=f"'{part}'",
            expected=f"numbers, names, + - * / **, brackets, {', '.join(_FUNCTIONS)}",
            remedy="correct the formula",
        )


def _apply(function: Callable[..., Any], *parts: Formula) -> Formula:
    """A function of one or two parts."""
    if len(parts) == 1:
        (only,) = parts
        return lambda value_of: function(only(value_of))
    left, right = parts
    return lambda value_of: function(left(value_of), right(value_of))
