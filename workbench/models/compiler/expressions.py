"""Expressions of rumoca's flat DAE (JSON, schema 43), evaluated to CasADi.

Values are numpy arrays of scalar SX, so that Modelica's rules of rank hold: a vector is no matrix.
"""

import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError

Value = NDArray[Any]

_DEEPEST = 30  # calls within each other; each is inlined


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


def _power(a: Value, b: Value) -> Value:
    """Modelica's `^`: of a square matrix repeated products (spec 10.6.7), else of scalars."""
    if a.ndim != 2:
        return each(_scalar_power, a, b)
    if float(b[()]) < 0:
        raise ValueError("a negative power of a matrix")
    result = each(ca.SX, np.array(np.eye(len(a)), object))
    for _ in range(int(float(b[()]))):
        result = _product(result, a)
    return result


def _scalar_power(a: ca.SX, b: ca.SX) -> ca.SX:
    """a^b with small integer exponents as products, which keeps derivatives polynomial."""
    if b.is_constant() and float(b) in (2.0, 3.0):
        return a * a if float(b) == 2.0 else a * a * a
    return a**b


_ARITHMETIC: Mapping[str, Callable[[ca.SX, ca.SX], ca.SX]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "power": _scalar_power,
}
BINARY: Mapping[str, Callable[[ca.SX, ca.SX], ca.SX]] = {
    **{
        f"{prefix}{name}": operation
        for prefix in ("", "elementwise_")
        for name, operation in _ARITHMETIC.items()
    },
    "less": operator.lt,
    "less_equal": operator.le,
    "greater": operator.gt,
    "greater_equal": operator.ge,
    "equal": operator.eq,
    "not_equal": operator.ne,
    "and": ca.logic_and,
    "or": ca.logic_or,
}


def _truncate(x: ca.SX) -> ca.SX:
    return ca.if_else(x < 0, ca.ceil(x), ca.floor(x))


_UNARY: Mapping[str, Callable[[ca.SX], ca.SX]] = {
    "negate": operator.neg,
    "plus": operator.pos,
    "not": ca.logic_not,
}
_ELEMENTWISE: Mapping[str, Callable[..., ca.SX]] = {
    **{
        name: getattr(ca, name)
        for name in (
            *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh"),
            *("exp", "log", "log10", "sqrt", "sign", "floor", "ceil"),
        )
    },
    "abs": ca.fabs,
    "integer": ca.floor,
    "no_event": lambda x: x,
    "smooth": lambda order, x: x,
    "homotopy": lambda actual, simplified: actual,
    "div": lambda x, y: _truncate(x / y),
    "rem": lambda x, y: x - y * _truncate(x / y),
    "mod": lambda x, y: x - y * ca.floor(x / y),
}
NO_EVENT = (
    "write noEvent(...) around it where it may switch without an event, use a smooth expression, "
    "or export the model as an FMU from a tool that treats events, and use that FMU"
)
REWRITE = (
    "write it in another way, or export the model as an FMU from another Modelica tool, "
    "and use that FMU"
)


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
    defined : expression of each Boolean or Integer variable that no event changes, by its number.
    reads_equations : whether expressions are those of equations, after all values have been read.
    """

    def __init__(self, dae: Mapping[str, Any], model_place: str) -> None:
        self.model_place = model_place
        self.sources = {key: (path, text) for key, path, text in dae["source_map"]["files"]}
        storage = dae["storage"]
        self.storage = storage
        self.nodes: list[dict[str, Any]] = storage["expressions"]["nodes"]
        self._provenance: list[dict[str, Any]] = storage["expressions"]["provenance"]
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
        self.defined: dict[int, int] = {  # where one branch holds always
            target: value["value"]
            for owner in storage["discrete_value_owners"]
            if [branch["activation"] for branch in owner["branches"]] == ["always"]
            for target, value in zip(owner["targets"], owner["branches"][0]["values"], strict=True)
        }
        self._depth = 0  # of the function call that is being evaluated
        self._branches = 0  # around what is being evaluated, which only the simulation chooses
        self.reads_equations = False

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
        """'file:line' of an entry of the DAE; of the model where it has none."""
        return self._locate(entry)[0]

    def quote(self, entry: Mapping[str, Any]) -> str:
        """What the source says at an entry of the DAE, in quotes; empty where it has no place."""
        return self._locate(entry)[1]

    def _locate(self, entry: Mapping[str, Any]) -> tuple[str, str]:
        source, start, end = self._span(entry)
        if source not in self.sources:
            return self.model_place, ""
        path, text = self.sources[source]
        content = text.encode()
        line = content[:start].count(b"\n") + 1
        words = " ".join(content[start:end].decode().split())
        return f"{path}:{line}", f"'{words}'" if len(words) < 80 else f"'{words[:76]} ...'"

    @staticmethod
    def _span(entry: Mapping[str, Any]) -> tuple[Any, int, int]:
        """Source, begin and end (in bytes) of an entry of the DAE."""
        span = (entry.get("provenance") or entry.get("declaration") or entry).get("span") or {}
        return span.get("source"), span.get("start", 0), span.get("end", 0)

    def refuse(
        self,
        what: str,
        entry: Mapping[str, Any] | int | None = None,
        expected: str = "an expression that the workbench's compiler treats",
        remedy: str = REWRITE,
    ) -> InputError:
        """The error for what this compiler does not treat, at an entry or expression of the DAE."""
        where = self._provenance[entry] if isinstance(entry, int) else entry or {}
        place, quote = self._locate(where)
        said = f"{what}: {quote}" if quote and quote.strip("'") not in what else what
        return InputError(where=place, found=said, expected=expected, remedy=remedy)

    def refuse_moved_subscripts(self) -> None:
        """Refuse b.v[2] and b[:].v[2] of an array of components b.

        The front end takes the subscript for one of b.
        """
        texts = {source: text.encode() for source, (_, text) in self.sources.items()}
        for number, node in enumerate(self.nodes):
            ((kind, body),) = node.items()
            source, start, end = self._span(self._provenance[number])
            if source not in texts or kind not in ("coordinate", "index"):
                continue
            named = re.fullmatch(rb"[^\s()]+\.\w+", texts[source][start:end])
            if named is None or re.match(rb"\s*\[", texts[source][end : end + 80]) is None:
                continue
            base = body["base"] if kind == "index" else number
            if "index" in self.nodes[base]:  # b[:].v[2], and not b[i].v[2]
                picks = self.subscripts[base]
                moved = any(pick == "whole" or "slice" in pick for pick in picks)
            else:
                parts = self.operands[base] if "array" in self.nodes[base] else [base]
                moved = any(self._has_subscripts_beyond(p, named[0].decode()) for p in parts)
            if moved:
                raise self.refuse(
                    "a subscript of what an array of components has",
                    number,
                    "one component or what all have, as the Modelica front end takes the subscript "
                    "for one of the components",
                    "for b.v[2], where b has 3 components, write {b[i].v[2] for i in 1:3}",
                )

    def _has_subscripts_beyond(self, number: int, written: str) -> bool:
        """Whether a variable has a subscript at a part to which the source gives none."""
        coordinate = self.nodes[number].get("coordinate")
        ((kind, content),) = coordinate.items() if isinstance(coordinate, dict) else (("", 0),)
        if kind not in ("parameter", "state", "algebraic", "input", "derivative"):
            return False
        variable = self.storage["variables"][content]
        if not self.types[variable["value_type"]]["dimensions"]:
            return False  # of an equation that has the place of the whole reference
        parts = str(variable["name"]).split(".")[::-1]
        own = re.sub(r"\[[^\]]*\]", "[]", written).split(".")[::-1]
        pairs = [
            (part.partition("["), mine.partition("["))
            for part, mine in zip(parts, own, strict=False)
        ]
        return all(part[0] == mine[0] for part, mine in pairs) and any(
            part[1] and not mine[1] for part, mine in pairs
        )

    def evaluate(self, number: int) -> Value:
        """Value of an expression node, or the refusal of what it holds.

        Raises
        ------
        InputError
            With file and line.
        """
        try:
            return self.value(number)
        except InputError:
            raise
        except (ArithmeticError, LookupError, NotImplementedError, TypeError, ValueError):
            raise self.refuse("an expression that cannot be evaluated", number) from None

    def value(self, number: int, call: _Call | None = None) -> Value:
        """Value of expression node `number`; inside a function call, in its environment."""
        ((kind, body),) = self.nodes[number].items()
        match kind:
            case "literal":
                ((form, content),) = body.items()
                if form == "string":
                    raise self.refuse(
                        "a string in an equation",
                        number,
                        "numbers",
                        "use an enumeration or a Boolean parameter in its place",
                    )
                return lift(float(content))
            case "coordinate":
                return self._coordinate(number, body, call)
            case "unary":
                return each(_UNARY[body["operator"]], self.value(body["operand"], call))
            case "binary":
                return self._finite(number, self._binary(body, call))
            case "conditional":
                return self._conditional(self.operands[number], call)
            case "comprehension":
                return self._comprehension(body["domain"], body["body"], call)
            case "function_value":
                assert call is not None
                return call.values[body["value"]]
            case "call":
                return self._call(number, body, call)
            case "field":
                record = self.value(body["base"], call)[()]
                if not isinstance(record, list):
                    raise self.refuse("a field of what is no record", number)
                return np.asarray(record[body["field"]], object)
        operands = [self.value(o, call) for o in self.operands.get(number, [])]
        match kind:
            case "array":
                return np.stack(operands)
            case "record":
                box: Value = np.empty((), object)
                box[()] = operands
                return box
            case "index":
                return self._element(number, body["base"], call)
            case "array_update":
                return self._update(number, body, call)
            case "range":
                return self._range(body, call)
            case "builtin":
                return self._finite(number, self._builtin(number, body["builtin"], operands))
        raise self.refuse(f"the construct '{kind}'", number)

    def _finite(self, number: int, value: Value) -> Value:
        """Refuse a constant of an equation that is no finite number, unless within a branch."""
        for element in value.flat if self.reads_equations and not self._branches else ():
            if element.is_constant() and not math.isfinite(float(element)):
                raise self.refuse(
                    f"a value of {float(element):g}",
                    number,
                    "finite numbers",
                    "correct the expression, or the constants in it",
                )
        return value

    def _binary(self, body: Mapping[str, Any], call: _Call | None) -> Value:
        lhs, rhs = self.value(body["lhs"], call), self.value(body["rhs"], call)
        match body["operator"]:
            case "multiply":
                return _product(lhs, rhs)
            case "power":
                return _power(lhs, rhs)
        return each(BINARY[body["operator"]], lhs, rhs)

    def _coordinate(self, number: int, body: Any, call: _Call | None) -> Value:
        if body == "time":
            return lift(self.time)
        ((kind, content),) = body.items()
        match kind:
            case "parameter" if self.is_structural(content):
                return self.default(content)
            case "parameter" | "state" | "algebraic" | "input":
                return self.symbols[int(content)]
            case "derivative":
                return self.rates[content]
            case "discrete_value" if content in self.defined:
                return self.value(self.defined[content])
            case "binder":
                return lift(self.binders[content["domain"], content["ordinal"]])
            case "function_parameter":
                assert call is not None
                return call.arguments[int(content["ordinal"])]
            case "condition":
                node = self.storage["conditions"][content]
                raise self.refuse(
                    "a condition of events", node, "equations without events", NO_EVENT
                )
        raise self.refuse(f"a reference of kind '{kind}'", number)

    def has_start(self, number: int) -> bool:
        """Whether the source gives a start; one of the front end stands at the declaration."""
        entry = self.storage["variables"][number]
        node = entry["attributes"]["start"]
        return node is not None and self._span(self._provenance[node]) != self._span(entry)

    def default(self, number: int) -> Value:
        """Value of a parameter: what it is bound to, else its start (spec 8.6), else zero."""
        entry = self.storage["variables"][number]
        attributes = entry["attributes"]
        given = attributes["binding"] is not None or self.has_start(number)
        if not given and self.is_structural(number):
            raise self.refuse(
                f"parameter '{entry['name']}' without a value", entry, "a value", "give it one"
            )
        node = attributes["start"] if attributes["binding"] is None else attributes["binding"]
        value = lift(0.0) if node is None else self.evaluate(node)
        return np.broadcast_to(value, self.symbols[number].shape)

    def is_structural(self, number: int) -> bool:
        """Integer and Boolean parameters choose sizes and branches: they are compiled in."""
        kind: str = self.types[self.storage["variables"][number]["value_type"]]["scalar"]
        return kind != "real"

    def _picks(self, owner: int, shape: Sequence[int], call: _Call | None) -> list[Any]:
        """Places, from 0, of each subscript of a node in an array of this shape."""
        picks: list[Any] = []
        for subscript, length in zip(self.subscripts[owner], shape, strict=False):
            if subscript == "whole":
                picks.append(slice(None))
                continue
            ((_, node),) = subscript.items()
            chosen = self.value(node, call)
            if not all(element.is_constant() for element in chosen.flat):
                raise self.refuse(
                    "an array index that is not constant",
                    owner,
                    "indices that are known before the simulation",
                    "choose by if-expressions inside noEvent(...)",
                )
            numbers = np.array([int(float(element)) for element in chosen.flat], int)
            if outside := [n for n in numbers if not 1 <= n <= length]:
                raise self.refuse(
                    f"index {outside[0]}",
                    owner,
                    f"an index from 1 to {length}",
                    "correct the index",
                )
            picks.append(int(numbers[0]) - 1 if chosen.ndim == 0 else numbers - 1)
        return picks

    def _element(self, number: int, base: int, call: _Call | None) -> Value:
        """Elements of an array; of one that is listed, only the one that is chosen is evaluated."""
        listed = self.operands[base] if "array" in self.nodes[base] else []
        first = self._picks(number, [len(listed)], call)[0] if listed else None
        if isinstance(first, int):
            value = self.value(listed[first], call)
            return self._index(value, self._picks(number, (len(listed), *value.shape), call)[1:])
        value = self.value(base, call)
        return self._index(value, self._picks(number, value.shape, call))

    def _index(self, base: Value, picks: Sequence[Any]) -> Value:
        out = base
        axis = 0
        for pick in picks:
            out = np.take(out, pick, axis=axis) if not isinstance(pick, slice) else out
            axis += 0 if isinstance(pick, int) else 1
        return out if isinstance(out, np.ndarray) else lift(out)

    def _update(self, number: int, body: Mapping[str, Any], call: _Call | None) -> Value:
        """An array with some elements assigned: what `y[i] := v` makes of y."""
        out = np.array(self.value(body["base"], call), object)
        value = self.value(body["value"], call)
        picks = tuple(self._picks(number, out.shape, call))
        out[picks] = value[()] if value.ndim == 0 else value
        return out

    def _range(self, body: Mapping[str, Any], call: _Call | None) -> Value:
        start, stop = (
            float(self.value(body[f"{end}_expression"], call)[()]) for end in ("start", "stop")
        )
        step_node = body["explicit_step_expression"]
        step = 1.0 if step_node is None else float(self.value(step_node, call)[()])
        # Of 0:0.1:0.3 the quotient is 4e-16 below 3, by rounding; a step that is meant is not.
        count = max(0, int(np.floor((stop - start) / step + 1e-9)) + 1)
        return np.array([ca.SX(start + k * step) for k in range(count)], object)

    def _builtin(self, number: int, name: str, operands: list[Value]) -> Value:
        if name in _ELEMENTWISE:
            return each(_ELEMENTWISE[name], *operands)
        first = operands[0] if operands else lift(0.0)
        match name:
            case "min" | "max":
                choose = ca.fmin if name == "min" else ca.fmax
                if len(operands) == 2:
                    return each(choose, *operands)
                least = first.flat[0]
                for element in first.flat[1:]:
                    least = choose(least, element)
                return lift(least)
            case "sum":
                return lift(_total(list(first.flat)))
            case "product":
                return lift(reduce(lambda x, y: x * y, first.flat, ca.SX(1)))
            case "size" if len(operands) == 1:
                return np.stack([lift(length) for length in first.shape])
            case "size":
                return lift(first.shape[int(float(operands[1][()])) - 1])
            case "linspace":
                count = int(float(operands[2][()]))
                step = (operands[1][()] - first[()]) / (count - 1)
                return np.stack([lift(first[()] + k * step) for k in range(count)])
            case "diagonal":
                out = each(ca.SX, np.array(np.zeros((first.size, first.size)), object))
                out[np.diag_indices(first.size)] = first
                return out
            case "identity":
                return each(ca.SX, np.array(np.eye(int(float(first[()]))), object))
            case "fill":
                shape = [int(float(o[()])) for o in operands[1:]]
                return np.broadcast_to(first, (*shape, *first.shape))
            case "zeros" | "ones":
                shape = [int(float(o[()])) for o in operands]
                return each(ca.SX, np.full(shape, float(name == "ones"), object))
            case "cross":
                a, b = operands
                rows = [(1, 2), (2, 0), (0, 1)]
                return np.stack([lift(a[i] * b[j] - a[j] * b[i]) for i, j in rows])
            case "transpose":
                return first.T
            case "vector":
                return first.reshape(-1)
            case "matrix":
                return _matrix(first)
            case "scalar":
                return first.reshape(())
            case "promoted_cat1" | "promoted_cat2":
                matrices = [_matrix(o) for o in operands]
                return np.concatenate(matrices, axis=int(name[-1]) - 1)
        raise self.refuse(f"the function '{name}'", number)

    def _conditional(self, operands: Sequence[int], call: _Call | None) -> Value:
        """Operands: condition, value, condition, value, ..., value otherwise.

        Branches that a constant condition rules out are not evaluated: they need not exist.
        """
        if len(operands) == 1:
            return self.value(operands[0], call)
        condition: ca.SX = self.value(operands[0], call)[()]
        if condition.is_constant():
            taken = operands[1:2] if float(condition) else operands[2:]
            return self._conditional(taken, call)
        self._branches += 1
        value = self.value(operands[1], call)
        otherwise = self._conditional(operands[2:], call)
        self._branches -= 1
        return each(lambda x, y: ca.if_else(condition, x, y), value, otherwise)

    def points(self, domain: int) -> Iterator[tuple[int, ...]]:
        """Walk a domain of loop indices, binding each; yields the positions from 0."""
        binders = self.domains[domain]
        ranges = [
            range(b["lower"], b["upper"] + (1 if b["step"] > 0 else -1), b["step"]) for b in binders
        ]
        for position in np.ndindex(*(len(r) for r in ranges)):
            for ordinal, (binder, at) in enumerate(zip(ranges, position, strict=True)):
                self.binders[domain, ordinal] = binder[at]
            yield position

    def _comprehension(self, domain: int, body: int, call: _Call | None) -> Value:
        values = {position: self.value(body, call) for position in self.points(domain)}
        if not values:
            return np.empty(0, object)
        shape = tuple(last + 1 for last in max(values))
        return np.stack(list(values.values())).reshape(shape + next(iter(values.values())).shape)

    def _call(self, number: int, body: Mapping[str, Any], call: _Call | None) -> Value:
        function = self.functions[body["function"]]
        external = function["external"]
        if external is not None and external["language"] == "builtin":
            # As Modelica.Math declares its functions.
            arguments = [self.value(o, call) for o in self.operands[body["owner"]]]
            if external["symbol"] in _ELEMENTWISE and self._in_order(function):
                value = each(_ELEMENTWISE[external["symbol"]], *arguments)
                return self._finite(number, value)
        if external is not None:
            raise self.refuse(
                f"the external function '{function['name']}'",
                number,
                "functions that are written in Modelica",
                "write its algorithm in Modelica, or export the model as an FMU from another "
                "Modelica tool, and use that FMU",
            )
        if self._depth > _DEEPEST:
            raise self.refuse(
                f"function '{function['name']}', which calls itself without end",
                number,
                "recursion that ends by constants",
                "write it with a for loop",
            )
        self._depth += 1
        inner = _Call([self.value(o, call) for o in self.operands[body["owner"]]])
        self._execute(function["statements"], function, inner)
        self._depth -= 1
        return inner.values[body["output"]]

    def _in_order(self, function: Mapping[str, Any]) -> bool:
        """Whether an external call passes the inputs in their order, which the flat DAE drops."""
        path, start, end = self._span(function)
        text = self.sources[path][1].encode()[start:end].decode()
        call = re.search(r'external\s*"builtin"[^;(]*\(([^)]*)\)', text)
        passed = [name.strip() for name in call[1].split(",")] if call else []
        return passed == [parameter["name"] for parameter in function["parameters"]]

    def _execute(
        self, statements: Sequence[Mapping[str, Any]], function: Mapping[str, Any], inner: _Call
    ) -> None:
        for statement in statements:
            ((kind, content),) = statement.items()
            match kind:
                case "assignment":
                    inner.values[content["target"]] = self.value(content["rhs"], inner)
                case "assignment_group":
                    # An if statement: its right-hand sides are conditional, valid side by side.
                    new = {a["target"]: self.value(a["rhs"], inner) for a in content["assignments"]}
                    inner.values.update(new)
                case "for" if not content["iteration_locals"]:
                    for _ in self.points(content["domain"]):
                        self._execute(content["statements"], function, inner)
                case _:
                    raise self.refuse(
                        f"a statement '{kind}' in function '{function['name']}'", function
                    )
