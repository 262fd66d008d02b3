"""Modelica sources to a flat system of scalar equations, stage 1 of the compiler.

rumoca parses, checks and flattens; this module turns its flat DAE (JSON, schema 43) into CasADi
expressions. What the later stages cannot treat (events, clocks, external functions) is refused
here, with file and line.
"""

import contextlib
import io
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import rumoca

from workbench.errors import InputError
from workbench.models.compiler.dropped import refuse_dropped
from workbench.models.compiler.expressions import BINARY, Arena, Value, each, lift
from workbench.models.modelica import check, files, packages, read_library
from workbench.models.modelica.classes import Class

SCHEMA = 43


@dataclass(frozen=True)
class FlatVariable:
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
    experiment : numbers of the experiment annotation, such as StopTime [s].
    """

    name: str
    description: str
    experiment: dict[str, float]
    time: ca.SX
    states: list[FlatVariable]
    dependent: list[FlatVariable]
    derivatives: list[ca.SX]
    algebraic: list[FlatVariable]
    inputs: list[FlatVariable]
    parameters: list[FlatVariable]
    tunable: list[bool]
    outputs: list[str]
    equations: list[tuple[ca.SX, str]]
    assertions: list[tuple[ca.SX, str]]


def flatten(package: Path, model: str) -> FlatModel:
    """Flatten `model` (dotted name) of the library whose `package.mo` is given.

    Libraries that it uses are found as `workbench.models.modelica.packages` says.

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
    library = read_library(package)
    refuse_dropped(library, check(library, model))
    used = [str(file.parent) for file in packages(package)[1:]]
    try:
        with _quiet_panic():
            dae = rumoca.Session(roots=used).load(str(package), model=model).to_dict("dae")
    except rumoca.RumocaError as error:
        raise InputError(
            where=f"{package.parent}, model {model}",
            found=_diagnostics(package, model, str(error)),
            expected="a balanced Modelica model without errors",
            remedy="correct the source and build again",
        ) from None
    except BaseException as panic:  # a panic of the front end is no Exception
        if type(panic).__name__ != "PanicException":
            raise
        raise InputError(
            where=f"{package.parent}, model {model}",
            found=_panic(package, str(panic)),
            expected="Modelica that the front end treats",
            remedy="write what stands there in another way, and build again",
        ) from None
    if dae["schema_version"] != SCHEMA:
        raise InputError(
            where=f"rumoca {rumoca.version()}",
            found=f"DAE schema {dae['schema_version']}",
            expected=f"schema {SCHEMA}",
            remedy="install the rumoca release that the extra [compiler] pins",
        )
    return _Reader(dae, library.find(model), model).flat_model()


@contextlib.contextmanager
def _quiet_panic() -> Iterator[None]:
    """Keep the report that a panic writes to the process's standard error from the user's."""
    sys.stderr.flush()
    shown = os.dup(2)
    with tempfile.TemporaryFile() as report:
        os.dup2(report.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(shown, 2)
            os.close(shown)


def _panic(package: Path, text: str) -> str:
    """What a panic of the front end says, with file and line where its span tells them.

    >>> _panic(Path("package.mo"), 'Unsupported { detail: "der(...) of an input" }')
    'der(...) of an input'
    """
    detail = re.search(r'detail: "((?:[^"\\]|\\.)*)"', text)
    message = detail.group(1) if detail else text.splitlines()[0]
    span = re.search(r"start: BytePos\((\d+)\), end: BytePos\((\d+)\)", text)
    if span is None or not message.startswith("der("):
        return message
    # The span names no file: of those of the library it is in the one that has a der() there.
    start, end = int(span.group(1)), int(span.group(2))
    texts = {path: path.read_bytes() for path in files(package) if path.suffix == ".mo"}
    places = [
        (path, content[:start].count(b"\n") + 1, content[start:end].decode())
        for path, content in texts.items()
        if content[start:end].startswith(b"der(")
    ]
    if len(places) != 1:
        return message
    path, line, derivative = places[0]
    return f"{path}:{line}: {derivative}: {message}"


def _diagnostics(package: Path, model: str, fallback: str) -> str:
    """The compiler's diagnostics as 'file:line:column: message'; its summary where it has none."""
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            diagnostics = rumoca.validate(str(package), model=model)
        except rumoca.RumocaError:
            return fallback
    lines = []
    for diagnostic in diagnostics:
        # Syntax errors carry their place in a drawing, all others as attributes.
        drawn = re.findall(r"\u00d7 (.+?)\n\s*\u256d\u2500\[(.+?)\]", diagnostic.message)
        lines += [f"{place}: {message}" for message, place in drawn]
        if not drawn and diagnostic.line is not None:
            place = f"{diagnostic.file or package}:{diagnostic.line}:{diagnostic.column}"
            lines.append(f"{place}: {diagnostic.message.strip()}")
    return "; ".join(dict.fromkeys(lines)) or fallback


class _Reader:
    """Reads variables and equations around the arena of expressions."""

    def __init__(self, dae: Mapping[str, Any], source: Class, model: str) -> None:
        self.source = source
        self.model = model
        self.storage = dae["storage"]
        self.arena = Arena(dae, model)

    def flat_model(self) -> FlatModel:
        """Read variables, then equations."""
        self._refuse_events()
        entries = self.storage["variables"]
        for number, entry in enumerate(entries):
            shape = tuple(self.arena.types[entry["value_type"]]["dimensions"])
            symbol: Value = np.empty(shape, object)
            for index in np.ndindex(shape):
                symbol[index] = ca.SX.sym(_scalar_name(entry["name"], index))
            self.arena.symbols.append(symbol)
            if entry["role"] == "state":
                self.arena.rates[number] = each(lambda s: ca.SX.sym(f"der({s.name()})"), symbol)
        free, bound = self._bind_parameters(entries)
        numeric = self._numbers(free, bound)
        groups: dict[str, list[FlatVariable]] = {"state": [], "dependent": [], "algebraic": []}
        rates: dict[str, list[ca.SX]] = {"state": [], "dependent": []}
        inputs, outputs = [], []
        for number, entry in enumerate(entries):
            role = "algebraic" if entry["role"] == "output" else entry["role"]
            scalars = self._scalars(number, entry, numeric)
            if role == "state":
                fixed = entry["attributes"]["fixed"]
                role = "state" if fixed and all(fixed) else "dependent"
                rates[role] += list(self.arena.rates[number].flat)
            if role in groups:
                groups[role] += scalars
            elif role == "input":
                inputs += scalars
            elif role not in ("parameter", "constant"):
                raise self.arena.refuse(
                    f"variable {entry['name']} of kind '{role}'", self.arena.place(entry)
                )
            attributes = entry["attributes"]
            top_level = len(attributes["component_ref"]["parts"]) == 1
            if top_level and attributes["causality"] == "output":
                outputs += [v.name for v in scalars]
        tunable = [
            entries[n]["attributes"]["is_tunable"] for n in free for _ in self.arena.symbols[n].flat
        ]
        substitute = _substitution(bound)
        return FlatModel(
            name=self.model,
            description=self.source.description or self.model,
            experiment=self._experiment(),
            time=self.arena.time,
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
                raise self.arena.refuse("an expression that causes events", self.arena.place(body))
        for kind in (
            "time_events",
            "clocks",
            "delays",
            "previous_values",
            "discrete_real_equations",
            "initialization_equation_operations",
        ):
            if self.storage[kind]:
                raise self.arena.refuse(f"{kind.replace('_', ' ')} in the model")

    def _relations(self, condition: int) -> Iterator[int]:
        """Yield the relations that a condition is made of."""
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
            binding = lift(0.0) if node is None else self.arena.value(node)
            binding = np.broadcast_to(binding, self.arena.symbols[number].shape)
            constant = all(element.is_constant() for element in binding.flat)
            if entry["role"] == "parameter" and constant and not self.arena.is_structural(number):
                free.append(number)
            else:
                bound.append((self.arena.symbols[number], binding))
        return free, bound

    def _numbers(self, free: list[int], bound: list[Any]) -> Callable[[ca.SX], float]:
        """A function that evaluates expressions of parameters at their default values."""
        symbols, values = [], []
        for number in free:
            binding = self.storage["variables"][number]["attributes"]["binding"]
            default = lift(0.0) if binding is None else self.arena.value(binding)
            symbols += list(self.arena.symbols[number].flat)
            values += list(np.broadcast_to(default, self.arena.symbols[number].shape).flat)
        substitute = _substitution(bound)
        every, defaults = ca.vertcat(*symbols), ca.vertcat(*values)

        def number_of(expression: ca.SX) -> float:
            if expression.is_constant():  # most are, and models have thousands
                return float(expression)
            return float(ca.evalf(ca.substitute(substitute(expression), every, defaults)))

        return number_of

    def _scalars(
        self, number: int, entry: Mapping[str, Any], numeric: Callable[[ca.SX], float]
    ) -> list[FlatVariable]:
        attributes = entry["attributes"]
        symbol = self.arena.symbols[number]
        key = "binding" if entry["role"] == "parameter" else "start"

        def attribute(name: str) -> list[float | None]:
            node = attributes[name]
            if node is None:
                return [None] * symbol.size
            values = np.broadcast_to(self.arena.value(node), symbol.shape)
            return [numeric(element) for element in values.flat]

        starts = attribute(key)
        columns = zip(
            symbol.flat,
            starts,
            attribute("min"),
            attribute("max"),
            attribute("nominal"),
            strict=True,
        )
        return [
            FlatVariable(
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
            place = self.arena.place(body)
            if kind == "residual":
                residuals = list(self.arena.value(body["residual"]).flat)
            elif kind == "structured" and body["scalar_view"] == "BinderSubstitution":
                residuals = [
                    element
                    for _ in self.arena.points(body["domain"])
                    for node in body["bodies"]
                    for element in self.arena.value(node).flat
                ]
            elif kind == "structured":
                residuals = [e for node in body["bodies"] for e in self.arena.value(node).flat]
            else:
                raise self.arena.refuse(f"an equation of kind '{kind}'", place)
            for residual in residuals:
                yield residual, place

    def _assertions(self) -> Iterator[tuple[ca.SX, str]]:
        for action in self.storage["event_actions"]:
            kind = action["kind"]
            if "assert" not in kind:
                raise self.arena.refuse("a when-clause", self.arena.place(action))
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
                return self.arena.value(relation.get("relation", relation)["expression"])[()]
            case "not":
                return ca.logic_not(self._condition(body))
            case "and" | "or":
                lhs, rhs = self._condition(body["lhs"]), self._condition(body["rhs"])
                return BINARY[kind](lhs, rhs)
            case "expression" | "discrete":
                return self.arena.value(body)[()]
        raise self.arena.refuse(f"a condition of kind '{kind}'")

    def _text(self, number: int) -> str:
        literal = self.arena.nodes[number].get("literal", {})
        return str(literal.get("string", "assertion failed"))

    def _experiment(self) -> dict[str, float]:
        """Read the experiment annotation of the model's own class, which the flat DAE drops.

        It ends with its class: a class of the same short name elsewhere in the file is another.
        """
        file, _, line = self.source.where.rpartition(":")
        short = self.source.name.rpartition(".")[2]
        lines = Path(file).read_text(encoding="utf-8").splitlines()[int(line) - 1 :]
        own = re.split(rf"\bend\s+{short}\s*;", "\n".join(lines), maxsplit=1)[0]
        experiment = re.search(r"\bexperiment\s*\(([^)]*)\)", own)
        pairs = re.findall(r"(\w+)\s*=\s*([-+.\deE]+)", experiment[1]) if experiment else []
        return {name: float(value) for name, value in pairs}


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
