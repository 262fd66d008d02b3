"""Modelica sources to a flat system of scalar equations, stage 1 of the compiler.

rumoca parses, checks and flattens; this module turns its flat DAE (JSON, schema 43) into CasADi
expressions. What the later stages cannot treat (events, clocks, external functions) is refused
here, with file and line.
"""

import contextlib
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import rumoca

from workbench.errors import InputError

SCHEMA = 43

# Values are numpy arrays of scalar SX, so that Modelica's rules of rank (a vector is no matrix) hold.
Value = np.ndarray[Any, np.dtype[np.object_]]


@dataclass(frozen=True)
class Variable:
    """One scalar variable of the flat model.

    `symbol` stands for it in the equations; `unit`, `description`, `minimum`, `maximum` and
    `nominal` are the Modelica attributes, None where not given.
    """

    name: str
    symbol: ca.SX
    start: float
    unit: str | None
    description: str | None
    minimum: float | None
    maximum: float | None
    nominal: float | None


@dataclass(frozen=True)
class FlatModel:
    """A flat model: residual(time, states, derivatives, unknowns, inputs, parameters) = 0.

    Attributes
    ----------
    states : differentiated variables with `fixed = true`: they carry the initial state.
    dependent : differentiated variables without it: algebraic, their derivatives follow.
    derivatives : symbols of der(state) and der(dependent), in this order.
    algebraic : unknowns that are not differentiated.
    inputs, parameters : what the environment sets; parameters bound to others are substituted.
    outputs : names of top-level outputs, in order of declaration.
    equations : (residual, "file:line") pairs, all scalar.
    assertions : (condition, text) pairs; a condition is 1 where it holds.
    """

    name: str
    description: str
    time: ca.SX
    states: list[Variable]
    dependent: list[Variable]
    derivatives: list[ca.SX]
    algebraic: list[Variable]
    inputs: list[Variable]
    parameters: list[Variable]
    tunable: list[bool]
    outputs: list[str]
    equations: list[tuple[ca.SX, str]]
    assertions: list[tuple[ca.SX, str]]


def flatten(package: Path, model: str) -> FlatModel:
    """Flatten `model` (dotted name) of the library whose `package.mo` is given.

    Raises
    ------
    InputError
        With the compiler's own diagnostics (file, line, what is wrong), or naming a construct
        that the later stages do not treat.
    """
    if not package.is_file():
        raise InputError(
            where=str(package),
            found="no such file",
            expected="the package.mo of a Modelica library",
            remedy="give the path of the library's package.mo",
        )
    try:
        dae = rumoca.Session().load(str(package), model=model).to_dict("dae")
    except rumoca.RumocaError as error:
        raise InputError(
            where=f"{package.parent}, model {model}",
            found=_diagnostics(package, model, str(error)),
            expected="a balanced Modelica model without errors",
            remedy="correct the source and build again",
        ) from None
    if dae["schema_version"] != SCHEMA:
        raise InputError(
            where=f"rumoca {rumoca.version()}",
            found=f"DAE schema {dae['schema_version']}",
            expected=f"schema {SCHEMA}",
            remedy="install the rumoca release that constraints.txt pins",
        )
    return _Reader(dae, model).flat_model()


def _diagnostics(package: Path, model: str, fallback: str) -> str:
    """The compiler's diagnostics with file and line; its summary where it gives none."""
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            found = rumoca.validate(str(package), model=model)
        except rumoca.RumocaError:
            return fallback
    lines = [
        f"{d.file or package}:{d.line}:{d.column}: {d.message}" for d in found if d.line is not None
    ]
    return "; ".join(dict.fromkeys(lines)) or fallback


def _lift(value: object) -> Value:
    """A rank-0 value."""
    box: Value = np.empty((), object)
    box[()] = ca.SX(value)
    return box


def _each(operation: Callable[..., ca.SX], *operands: Value) -> Value:
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
        return _each(lambda x, y: x * y, a, b)
    left = a if a.ndim == 2 else a.reshape(1, -1)
    right = b if b.ndim == 2 else b.reshape(-1, 1)
    out: Value = np.empty((left.shape[0], right.shape[1]), object)
    for i, j in np.ndindex(out.shape):
        out[i, j] = _total([left[i, k] * right[k, j] for k in range(left.shape[1])])
    if a.ndim == 1:
        out = out[0, :]
    if b.ndim == 1:
        out = out[..., 0]
    return np.asarray(out, object) if isinstance(out, np.ndarray) else _lift(out)


def _power(a: ca.SX, b: ca.SX) -> ca.SX:
    """a^b with small integer exponents as products, which keeps derivatives polynomial."""
    if b.is_constant() and float(b) in (2.0, 3.0):
        return a * a if float(b) == 2.0 else a * a * a
    return a**b


_BINARY: Mapping[str, Callable[[ca.SX, ca.SX], ca.SX]] = {
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


@dataclass
class _Call:
    """Values of one function call: inputs by ordinal, outputs and locals by index."""

    arguments: list[Value]
    values: dict[int, Value] = field(default_factory=dict)


class _Reader:
    """Evaluates the expression arena of rumoca's flat DAE."""

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
        """Operands and subscripts lie in two flat lists, in the order of the nodes that own them."""
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

    def _place(self, entry: Mapping[str, Any]) -> str:
        """'file:line' of an entry of the DAE."""
        span = (entry.get("provenance") or entry.get("declaration") or {}).get("span")
        if not span or span["source"] not in self.sources:
            return self.model
        path, text = self.sources[span["source"]]
        line = text.encode()[: span["start"]].count(b"\n") + 1
        return f"{path}:{line}"

    def _refuse(self, what: str, place: str | None = None) -> InputError:
        return InputError(
            where=place or f"model {self.model}",
            found=what,
            expected="continuous equations without events, solvable for derivatives",
            remedy="rewrite it with smooth expressions or noEvent(...)",
        )

    # --- expressions ---

    def value(self, number: int, call: _Call | None = None) -> Value:
        """Value of expression node `number`; inside a function call, in its environment."""
        ((kind, body),) = self.nodes[number].items()
        operands = [self.value(o, call) for o in self.operands.get(number, [])]
        match kind:
            case "literal":
                ((form, content),) = body.items()
                if form == "string":
                    raise self._refuse("a string in an equation")
                return _lift(float(content))
            case "coordinate":
                return self._coordinate(body, call)
            case "unary":
                return _each(_UNARY[body["operator"]], self.value(body["operand"], call))
            case "binary":
                lhs, rhs = self.value(body["lhs"], call), self.value(body["rhs"], call)
                if body["operator"] == "multiply":
                    return _product(lhs, rhs)
                return _each(_BINARY[body["operator"]], lhs, rhs)
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
        raise self._refuse(f"the construct '{kind}'")

    def _coordinate(self, body: Any, call: _Call | None) -> Value:
        if body == "time":
            return _lift(self.time)
        ((kind, content),) = body.items()
        if kind == "parameter" and self._is_structural(content):
            return self.value(self.storage["variables"][content]["attributes"]["binding"])
        match kind:
            case "parameter" | "state" | "algebraic" | "input":
                return self.symbols[content]
            case "derivative":
                return self.rates[content]
            case "binder":
                return _lift(self.binders[content["domain"], content["ordinal"]])
            case "function_parameter":
                assert call is not None
                return call.arguments[content["ordinal"]]
        raise self._refuse(f"a reference of kind '{kind}'")

    def _is_structural(self, number: int) -> bool:
        """Integer and Boolean parameters choose sizes and branches: their values are compiled in."""
        return self.types[self.storage["variables"][number]["value_type"]]["scalar"] != "real"

    def _index(self, base: Value, subscripts: Sequence[Any], call: _Call | None) -> Value:
        picks: list[Any] = []
        for subscript in subscripts:
            if subscript == "whole":
                picks.append(slice(None))
                continue
            ((_, node),) = subscript.items()
            chosen = self.value(node, call)
            if not all(element.is_constant() for element in chosen.flat):
                raise self._refuse("an array index that is not constant")
            numbers = np.array([int(float(element)) - 1 for element in chosen.flat])
            picks.append(int(numbers[0]) if chosen.ndim == 0 else numbers)
        out = base
        axis = 0
        for pick in picks:
            out = np.take(out, pick, axis=axis) if not isinstance(pick, slice) else out
            axis += 0 if isinstance(pick, int) else 1
        return out if isinstance(out, np.ndarray) else _lift(out)

    def _range(self, body: Mapping[str, Any], call: _Call | None) -> Value:
        start, stop = (
            float(self.value(body[f"{end}_expression"], call)[()]) for end in ("start", "stop")
        )
        step_node = body["explicit_step_expression"]
        step = 1.0 if step_node is None else float(self.value(step_node, call)[()])
        return np.stack([_lift(v) for v in np.arange(start, stop + 0.5 * step, step)])

    def _builtin(self, name: str, operands: list[Value]) -> Value:
        if name in _ELEMENTWISE:
            return _each(_ELEMENTWISE[name], *operands)
        match name:
            case "min" | "max":
                choose = ca.fmin if name == "min" else ca.fmax
                if len(operands) == 2:
                    return _each(choose, *operands)
                least = operands[0].flat[0]
                for element in operands[0].flat[1:]:
                    least = choose(least, element)
                return _lift(least)
            case "sum":
                return _lift(_total(list(operands[0].flat)))
            case "identity":
                size = int(float(operands[0][()]))
                return _each(ca.SX, np.array(np.eye(size), object))
            case "zeros" | "ones":
                shape = [int(float(o[()])) for o in operands]
                return _each(ca.SX, np.full(shape, float(name == "ones"), object))
            case "cross":
                a, b = operands
                rows = [(1, 2), (2, 0), (0, 1)]
                return np.stack([_lift(a[i] * b[j] - a[j] * b[i]) for i, j in rows])
            case "transpose":
                return operands[0].T
            case "promoted_cat1" | "promoted_cat2":
                matrices = [_matrix(o) for o in operands]
                return np.concatenate(matrices, axis=int(name[-1]) - 1)
        raise self._refuse(f"the function '{name}'")

    def _conditional(self, operands: list[Value]) -> Value:
        """Operands: condition, value, condition, value, ..., value otherwise."""
        out = operands[-1]
        for position in range(len(operands) - 3, -1, -2):
            out = _each(ca.if_else, operands[position], operands[position + 1], out)
        return out

    def _points(self, domain: int) -> Iterator[tuple[int, ...]]:
        """Walk a domain of loop indices, binding each; yields the positions from 0."""
        binders = self.domains[domain]
        ranges = [range(b["lower"], b["upper"] + 1, b["step"]) for b in binders]
        for position in np.ndindex(*(len(r) for r in ranges)):
            for ordinal, (binder, at) in enumerate(zip(ranges, position, strict=True)):
                self.binders[domain, ordinal] = binder[at]
            yield position

    def _comprehension(self, domain: int, body: int, call: _Call | None) -> Value:
        values = {position: self.value(body, call) for position in self._points(domain)}
        shape = tuple(last + 1 for last in max(values))
        return np.stack(list(values.values())).reshape(shape + next(iter(values.values())).shape)

    def _call(self, body: Mapping[str, Any], call: _Call | None) -> Value:
        function = self.functions[body["function"]]
        if function["external"] is not None:
            raise self._refuse(f"the external function {function['name']}", self._place(function))
        inner = _Call([self.value(o, call) for o in self.operands[body["owner"]]])
        for statement in function["statements"]:
            ((kind, content),) = statement.items()
            if kind == "assignment":
                inner.values[content["target"]] = self.value(content["rhs"], inner)
            elif kind == "assignment_group":
                self._assign_group(content, inner)
            else:
                raise self._refuse(f"a statement '{kind}'", self._place(function))
        return inner.values[body["output"]]

    def _assign_group(self, group: Mapping[str, Any], inner: _Call) -> None:
        """An if statement: its assignments hold conditional expressions, valid side by side."""
        new = {a["target"]: self.value(a["rhs"], inner) for a in group["assignments"]}
        inner.values.update(new)

    # --- the model ---

    def flat_model(self) -> FlatModel:
        """Read variables, then equations."""
        self._refuse_events()
        entries = self.storage["variables"]
        for number, entry in enumerate(entries):
            shape = tuple(self.types[entry["value_type"]]["dimensions"])
            symbol: Value = np.empty(shape, object)
            for index in np.ndindex(shape):
                symbol[index] = ca.SX.sym(_scalar_name(entry["name"], index))
            self.symbols.append(symbol)
            if entry["role"] == "state":
                self.rates[number] = _each(lambda s: ca.SX.sym(f"der({s.name()})"), symbol)
        free, bound = self._bind_parameters(entries)
        numeric = self._numbers(free, bound)
        groups: dict[str, list[Variable]] = {"state": [], "dependent": [], "algebraic": []}
        rates: dict[str, list[ca.SX]] = {"state": [], "dependent": []}
        inputs, outputs = [], []
        for number, entry in enumerate(entries):
            role = "algebraic" if entry["role"] == "output" else entry["role"]
            scalars = self._scalars(number, entry, numeric)
            if role == "state":
                fixed = entry["attributes"]["fixed"]
                role = "state" if fixed and all(fixed) else "dependent"
                rates[role] += list(self.rates[number].flat)
            if role in groups:
                groups[role] += scalars
            elif role == "input":
                inputs += scalars
            elif role not in ("parameter", "constant"):
                raise self._refuse(f"variable {entry['name']} of kind '{role}'", self._place(entry))
            attributes = entry["attributes"]
            top_level = len(attributes["component_ref"]["parts"]) == 1
            if top_level and attributes["causality"] == "output":
                outputs += [v.name for v in scalars]
        tunable = [entries[n]["attributes"]["is_tunable"] for n in free for _ in self.symbols[n].flat]
        substitute = _substitution(bound)
        return FlatModel(
            name=self.model,
            description=self._model_description(),
            time=self.time,
            states=groups["state"],
            dependent=groups["dependent"],
            derivatives=rates["state"] + rates["dependent"],
            algebraic=groups["algebraic"],
            inputs=inputs,
            parameters=[v for n in free for v in self._scalars(n, entries[n], numeric)],
            tunable=tunable,
            outputs=outputs,
            equations=[(substitute(e), place) for e, place in self._equations()],
            assertions=[(substitute(c), text) for c, text in self._assertions()],
        )

    def _refuse_events(self) -> None:
        asserted = {r for a in self.storage["event_actions"] for r in self._relations(a["guard"])}
        for root in [*self.storage["roots"], *self.storage["structured_roots"]]:
            body = root.get("root", root)
            if "relation" not in body or body["relation"] not in asserted:
                raise self._refuse("an expression that causes events", self._place(body))
        for kind in (
            "time_events",
            "clocks",
            "delays",
            "previous_values",
            "discrete_real_equations",
            "initialization_equation_operations",
        ):
            if self.storage[kind]:
                raise self._refuse(f"{kind.replace('_', ' ')} in the model")

    def _relations(self, condition: int) -> Iterator[int]:
        """The relations that a condition is made of."""
        node = self.storage["conditions"][condition]["node"]
        if not isinstance(node, dict):
            return
        ((kind, body),) = node.items()
        if kind == "relation":
            yield body
        for part in [body] if kind == "not" else body.values() if kind in ("and", "or") else []:
            yield from self._relations(part)

    def _bind_parameters(self, entries: Sequence[Mapping[str, Any]]) -> tuple[list[int], list[Any]]:
        """Split into free parameters and (symbols, expression) pairs of bound ones."""
        free: list[int] = []
        bound: list[tuple[Value, Value]] = []
        for number, entry in enumerate(entries):
            if entry["role"] not in ("parameter", "constant"):
                continue
            node = entry["attributes"]["binding"]
            binding = _lift(0.0) if node is None else self.value(node)
            binding = np.broadcast_to(binding, self.symbols[number].shape)
            constant = all(element.is_constant() for element in binding.flat)
            if entry["role"] == "parameter" and constant and not self._is_structural(number):
                free.append(number)
            else:
                bound.append((self.symbols[number], binding))
        return free, bound

    def _numbers(self, free: list[int], bound: list[Any]) -> Callable[[ca.SX], float]:
        """A function that evaluates expressions of parameters at their default values."""
        symbols, values = [], []
        for number in free:
            binding = self.storage["variables"][number]["attributes"]["binding"]
            default = _lift(0.0) if binding is None else self.value(binding)
            symbols += list(self.symbols[number].flat)
            values += list(np.broadcast_to(default, self.symbols[number].shape).flat)
        substitute = _substitution(bound)

        def number_of(expression: ca.SX) -> float:
            constant = ca.substitute(
                substitute(expression), ca.vertcat(*symbols), ca.vertcat(*values)
            )
            return float(ca.evalf(constant))

        return number_of

    def _scalars(
        self, number: int, entry: Mapping[str, Any], numeric: Callable[[ca.SX], float]
    ) -> list[Variable]:
        attributes = entry["attributes"]
        symbol = self.symbols[number]
        key = "binding" if entry["role"] == "parameter" else "start"

        def attribute(name: str) -> list[float | None]:
            node = attributes[name]
            if node is None:
                return [None] * symbol.size
            values = np.broadcast_to(self.value(node), symbol.shape)
            return [numeric(element) for element in values.flat]

        starts = attribute(key)
        columns = zip(
            symbol.flat, starts, attribute("min"), attribute("max"), attribute("nominal"), strict=True
        )
        return [
            Variable(
                name=s.name(),
                symbol=s,
                start=0.0 if start is None else start,
                unit=attributes["unit"],
                description=attributes["description"],
                minimum=minimum,
                maximum=maximum,
                nominal=nominal,
            )
            for s, start, minimum, maximum, nominal in columns
        ]

    def _equations(self) -> Iterator[tuple[ca.SX, str]]:
        for operation in self.storage["continuous_equation_operations"]:
            ((kind, body),) = operation.items()
            place = self._place(body)
            if kind == "residual":
                residuals = list(self.value(body["residual"]).flat)
            elif kind == "structured" and body["scalar_view"] == "BinderSubstitution":
                residuals = [
                    element
                    for _ in self._points(body["domain"])
                    for node in body["bodies"]
                    for element in self.value(node).flat
                ]
            elif kind == "structured":
                residuals = [e for node in body["bodies"] for e in self.value(node).flat]
            else:
                raise self._refuse(f"an equation of kind '{kind}'", place)
            for residual in residuals:
                yield residual, place

    def _assertions(self) -> Iterator[tuple[ca.SX, str]]:
        for action in self.storage["event_actions"]:
            kind = action["kind"]
            if "assert" not in kind:
                raise self._refuse("a when-clause", self._place(action))
            yield (
                ca.logic_not(self._condition(action["guard"])),
                self._text(kind["assert"]["message"]),
            )

    def _condition(self, number: int) -> ca.SX:
        """The expression of a condition node; an assertion's guard is its negation."""
        node = self.storage["conditions"][number]["node"]
        ((kind, body),) = node.items()
        match kind:
            case "relation":
                relation = self.storage["relations"][body]
                return self.value(relation.get("relation", relation)["expression"])[()]
            case "not":
                return ca.logic_not(self._condition(body))
            case "and" | "or":
                lhs, rhs = self._condition(body["lhs"]), self._condition(body["rhs"])
                return _BINARY[kind](lhs, rhs)
            case "expression":
                return self.value(body)[()]
        raise self._refuse(f"a condition of kind '{kind}'")

    def _text(self, number: int) -> str:
        literal = self.nodes[number].get("literal", {})
        return str(literal.get("string", "assertion failed"))

    def _model_description(self) -> str:
        """The description string after `model NAME` in the sources (the flat DAE drops it)."""
        short = self.model.rsplit(".", 1)[-1]
        for path, text in self.sources.values():
            if Path(path).stem == short or Path(path).name == "package.mo":
                _, found, rest = text.partition(f'model {short} "')
                if found:
                    return rest.partition('"')[0]
        return self.model


def _matrix(value: Value) -> Value:
    """Promote to rank 2 as `cat` inside `[...]` does: a vector becomes a column."""
    return value if value.ndim == 2 else value.reshape(-1, 1)


def _scalar_name(name: str, index: tuple[int, ...]) -> str:
    return f"{name}[{','.join(str(i + 1) for i in index)}]" if index else str(name)


def _substitution(bound: list[tuple[Value, Value]]) -> Callable[[ca.SX], ca.SX]:
    """Replace bound parameters by what they are bound to, through any depth."""
    symbols = ca.vertcat(*(s for names, _ in bound for s in names.flat))
    values = ca.vertcat(*(e for _, binding in bound for e in binding.flat))
    if not bound:
        return lambda expression: expression
    for _ in bound:
        resolved = ca.substitute(values, symbols, values)
        if ca.is_equal(resolved, values, 0):
            break
        values = resolved
    return lambda expression: ca.substitute(expression, symbols, values)
