"""Expressions of rumoca's flat DAE (JSON, schema 43), evaluated to CasADi.

Values are numpy arrays of scalar SX, so that Modelica's rules of rank hold: a vector is no matrix.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError

Value = NDArray[Any]


def lift(value: object) -> Value:
    """A rank-0 value."""
    box: Value = np.empty((), object)
    box[()] = ca.SX(value)
    return box


def each(operation: Callable[..., ca.SX], *operands: Value) -> Value:
    """Apply a scalar operation element by element, with scalars expanded."""
    spread = np.broadcast_arrays(*operands)
    out: Value = np.empty(spread[0].shape, object)
    for index in np.ndindex(out.shape):
        out[index] = ca.SX(operation(*(operand[index] for operand in spread)))
    return out


def _total(terms: Sequence[ca.SX]) -> ca.SX:
    total = ca.SX(0)
    for term in terms:
        total = total + term
    return total


def _product(a: Value, b: Value) -> Value:
    """Modelica's `*`: scalar, dot, matrix-vector and matrix-matrix product (spec 10.6.5)."""
    if a.ndim == 0 or b.ndim == 0:
        return each(lambda x, y: x * y, a, b)
    left = a if a.ndim == 2 else a.reshape(1, -1)
    right = b if b.ndim == 2 else b.reshape(-1, 1)
    out: Value = np.empty((left.shape[0], right.shape[1]), object)
    for i, j in np.ndindex(out.shape):
        out[i, j] = _total([left[i, k] * right[k, j] for k in range(left.shape[1])])
    if a.ndim == 1:
        out = out[0, :]
    if b.ndim == 1:
        out = out[..., 0]
    return np.asarray(out, object) if isinstance(out, np.ndarray) else lift(out)


def _power(a: ca.SX, b: ca.SX) -> ca.SX:
    """a^b with small integer exponents as products, which keeps derivatives polynomial."""
    if b.is_constant() and float(b) in (2.0, 3.0):
        return a * a if float(b) == 2.0 else a * a * a
    return a**b


BINARY: Mapping[str, Callable[[ca.SX, ca.SX], ca.SX]] = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "divide": lambda x, y: x / y,
    "power": _power,
    "elementwise_multiply": lambda x, y: x * y,
    "elementwise_divide": lambda x, y: x / y,
    "elementwise_power": _power,
    "less": lambda x, y: x < y,
    "less_equal": lambda x, y: x <= y,
    "greater": lambda x, y: x > y,
    "greater_equal": lambda x, y: x >= y,
    "equal": lambda x, y: x == y,
    "not_equal": lambda x, y: x != y,
    "and": ca.logic_and,
    "or": ca.logic_or,
}
_UNARY: Mapping[str, Callable[[ca.SX], ca.SX]] = {
    "negate": lambda x: -x,
    "plus": lambda x: x,
    "not": ca.logic_not,
}
_ELEMENTWISE: Mapping[str, Callable[..., ca.SX]] = {
    "sin": ca.sin,
    "cos": ca.cos,
    "tan": ca.tan,
    "asin": ca.asin,
    "acos": ca.acos,
    "atan": ca.atan,
    "atan2": ca.atan2,
    "sinh": ca.sinh,
    "cosh": ca.cosh,
    "tanh": ca.tanh,
    "exp": ca.exp,
    "log": ca.log,
    "log10": ca.log10,
    "sqrt": ca.sqrt,
    "abs": ca.fabs,
    "sign": ca.sign,
    "no_event": lambda x: x,
    "smooth": lambda order, x: x,
}


def _matrix(value: Value) -> Value:
    """Promote to rank 2 as `cat` inside `[...]` does: a vector becomes a column."""
    return value if value.ndim == 2 else value.reshape(-1, 1)


@dataclass
class _Call:
    """Values of one function call: inputs by ordinal, outputs and locals by index."""

    arguments: list[Value]
    values: dict[int, Value] = field(default_factory=dict)


class Arena:
    """The expressions of a flat DAE, evaluated to CasADi.

    Attributes
    ----------
    time : symbol of time.
    symbols : value of each variable, by its number; filled by the reader of variables.
    rates : value of the time derivative of each differentiated variable.
    """

    def __init__(self, dae: Mapping[str, Any], model: str) -> None:
        self.model = model
        self.sources = {key: (path, text) for key, path, text in dae["source_map"]["files"]}
        storage = dae["storage"]
        self.storage = storage
        self.nodes: list[dict[str, Any]] = storage["expressions"]["nodes"]
        self.types: list[dict[str, Any]] = storage["value_types"]
        self.functions: list[dict[str, Any]] = storage["functions"]
        self.domains = [d["domain"]["binders"] for d in storage["domains"]]
        self.operands: dict[int, list[int]] = {}
        self.subscripts: dict[int, list[Any]] = {}
        self._deal_arenas(storage["expressions"])
        self.time = ca.SX.sym("time")
        self.symbols: list[Value] = []
        self.rates: dict[int, Value] = {}
        self.binders: dict[tuple[int, int], int] = {}

    def _deal_arenas(self, expressions: Mapping[str, Any]) -> None:
        """Operands and subscripts lie in two flat lists, in the order of their owners."""
        operands = iter(o if isinstance(o, int) else o["node"] for o in expressions["operands"])
        subscripts = iter(expressions["subscripts"])
        for number, node in enumerate(self.nodes):
            ((_, body),) = node.items()
            if not isinstance(body, dict):
                continue
            self.operands[number] = [next(operands) for _ in range(body.get("operand_count", 0))]
            self.subscripts[number] = [
                next(subscripts)["kind"] for _ in range(body.get("subscript_count", 0))
            ]

    def place(self, entry: Mapping[str, Any]) -> str:
        """'file:line' of an entry of the DAE."""
        span = (entry.get("provenance") or entry.get("declaration") or {}).get("span")
        if not span or span["source"] not in self.sources:
            return self.model
        path, text = self.sources[span["source"]]
        line = text.encode()[: span["start"]].count(b"\n") + 1
        return f"{path}:{line}"

    def refuse(self, what: str, place: str | None = None) -> InputError:
        """The error for what this compiler does not treat."""
        return InputError(
            where=place or f"model {self.model}",
            found=what,
            expected="continuous equations without events, solvable for derivatives",
            remedy="rewrite it with smooth expressions or noEvent(...)",
        )

    def value(self, number: int, call: _Call | None = None) -> Value:
        """Value of expression node `number`; inside a function call, in its environment."""
        ((kind, body),) = self.nodes[number].items()
        operands = [self.value(o, call) for o in self.operands.get(number, [])]
        match kind:
            case "literal":
                ((form, content),) = body.items()
                if form == "string":
                    raise self.refuse("a string in an equation")
                return lift(float(content))
            case "coordinate":
                return self._coordinate(body, call)
            case "unary":
                return each(_UNARY[body["operator"]], self.value(body["operand"], call))
            case "binary":
                lhs, rhs = self.value(body["lhs"], call), self.value(body["rhs"], call)
                if body["operator"] == "multiply":
                    return _product(lhs, rhs)
                return each(BINARY[body["operator"]], lhs, rhs)
            case "array":
                return np.stack(operands)
            case "index":
                return self._index(self.value(body["base"], call), self.subscripts[number], call)
            case "range":
                return self._range(body, call)
            case "builtin":
                return self._builtin(body["builtin"], operands)
            case "conditional":
                return self._conditional(operands)
            case "comprehension":
                return self._comprehension(body["domain"], body["body"], call)
            case "function_value":
                assert call is not None
                return call.values[body["value"]]
            case "call":
                return self._call(body, call)
        raise self.refuse(f"the construct '{kind}'")

    def _coordinate(self, body: Any, call: _Call | None) -> Value:
        if body == "time":
            return lift(self.time)
        ((kind, content),) = body.items()
        if kind == "parameter" and self.is_structural(content):
            return self.value(self.storage["variables"][content]["attributes"]["binding"])
        match kind:
            case "parameter" | "state" | "algebraic" | "input":
                return self.symbols[int(content)]
            case "derivative":
                return self.rates[content]
            case "binder":
                return lift(self.binders[content["domain"], content["ordinal"]])
            case "function_parameter":
                assert call is not None
                return call.arguments[int(content["ordinal"])]
        raise self.refuse(f"a reference of kind '{kind}'")

    def is_structural(self, number: int) -> bool:
        """Integer and Boolean parameters choose sizes and branches: they are compiled in."""
        kind: str = self.types[self.storage["variables"][number]["value_type"]]["scalar"]
        return kind != "real"

    def _index(self, base: Value, subscripts: Sequence[Any], call: _Call | None) -> Value:
        picks: list[Any] = []
        for subscript in subscripts:
            if subscript == "whole":
                picks.append(slice(None))
                continue
            ((_, node),) = subscript.items()
            chosen = self.value(node, call)
            if not all(element.is_constant() for element in chosen.flat):
                raise self.refuse("an array index that is not constant")
            numbers = np.array([int(float(element)) - 1 for element in chosen.flat])
            picks.append(int(numbers[0]) if chosen.ndim == 0 else numbers)
        out = base
        axis = 0
        for pick in picks:
            out = np.take(out, pick, axis=axis) if not isinstance(pick, slice) else out
            axis += 0 if isinstance(pick, int) else 1
        return out if isinstance(out, np.ndarray) else lift(out)

    def _range(self, body: Mapping[str, Any], call: _Call | None) -> Value:
        start, stop = (
            float(self.value(body[f"{end}_expression"], call)[()]) for end in ("start", "stop")
        )
        step_node = body["explicit_step_expression"]
        step = 1.0 if step_node is None else float(self.value(step_node, call)[()])
        return np.stack([lift(v) for v in np.arange(start, stop + 0.5 * step, step)])

    def _builtin(self, name: str, operands: list[Value]) -> Value:
        if name in _ELEMENTWISE:
            return each(_ELEMENTWISE[name], *operands)
        match name:
            case "min" | "max":
                choose = ca.fmin if name == "min" else ca.fmax
                if len(operands) == 2:
                    return each(choose, *operands)
                least = operands[0].flat[0]
                for element in operands[0].flat[1:]:
                    least = choose(least, element)
                return lift(least)
            case "sum":
                return lift(_total(list(operands[0].flat)))
            case "identity":
                size = int(float(operands[0][()]))
                return each(ca.SX, np.array(np.eye(size), object))
            case "fill":
                shape = [int(float(o[()])) for o in operands[1:]]
                return np.broadcast_to(operands[0], (*shape, *operands[0].shape))
            case "zeros" | "ones":
                shape = [int(float(o[()])) for o in operands]
                return each(ca.SX, np.full(shape, float(name == "ones"), object))
            case "cross":
                a, b = operands
                rows = [(1, 2), (2, 0), (0, 1)]
                return np.stack([lift(a[i] * b[j] - a[j] * b[i]) for i, j in rows])
            case "transpose":
                return operands[0].T
            case "promoted_cat1" | "promoted_cat2":
                matrices = [_matrix(o) for o in operands]
                return np.concatenate(matrices, axis=int(name[-1]) - 1)
        raise self.refuse(f"the function '{name}'")

    def _conditional(self, operands: list[Value]) -> Value:
        """Operands: condition, value, condition, value, ..., value otherwise."""
        out = operands[-1]
        for position in range(len(operands) - 3, -1, -2):
            out = each(ca.if_else, operands[position], operands[position + 1], out)
        return out

    def points(self, domain: int) -> Iterator[tuple[int, ...]]:
        """Walk a domain of loop indices, binding each; yields the positions from 0."""
        binders = self.domains[domain]
        ranges = [range(b["lower"], b["upper"] + 1, b["step"]) for b in binders]
        for position in np.ndindex(*(len(r) for r in ranges)):
            for ordinal, (binder, at) in enumerate(zip(ranges, position, strict=True)):
                self.binders[domain, ordinal] = binder[at]
            yield position

    def _comprehension(self, domain: int, body: int, call: _Call | None) -> Value:
        values = {position: self.value(body, call) for position in self.points(domain)}
        shape = tuple(last + 1 for last in max(values))
        return np.stack(list(values.values())).reshape(shape + next(iter(values.values())).shape)

    def _call(self, body: Mapping[str, Any], call: _Call | None) -> Value:
        function = self.functions[body["function"]]
        if function["external"] is not None:
            raise self.refuse(f"the external function {function['name']}", self.place(function))
        inner = _Call([self.value(o, call) for o in self.operands[body["owner"]]])
        for statement in function["statements"]:
            ((kind, content),) = statement.items()
            if kind == "assignment":
                inner.values[content["target"]] = self.value(content["rhs"], inner)
            elif kind == "assignment_group":
                self._assign_group(content, inner)
            else:
                raise self.refuse(f"a statement '{kind}'", self.place(function))
        return inner.values[body["output"]]

    def _assign_group(self, group: Mapping[str, Any], inner: _Call) -> None:
        """An if statement: its assignments hold conditional expressions, valid side by side."""
        new = {a["target"]: self.value(a["rhs"], inner) for a in group["assignments"]}
        inner.values.update(new)
