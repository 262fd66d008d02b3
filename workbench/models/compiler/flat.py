"""Modelica sources to a flat system of scalar equations, stage 1 of the compiler.

rumoca parses, checks and flattens; this module turns its flat DAE (JSON, schema 43) into CasADi
expressions. What the later stages cannot treat (events, clocks, external functions) is refused
here, with file and line.
"""

import ast
import contextlib
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import rumoca

from workbench.errors import InputError
from workbench.models.compiler.expressions import BINARY, NO_EVENT, REWRITE, Arena, Value, each
from workbench.models.modelica import STANDARD, Library, check, files, packages, read_library
from workbench.models.modelica.classes import Class, Component, Modifier
from workbench.models.modelica.source import EXPERIMENT, KINDS
from workbench.runtime.supervision import blaming, limited_memory, quiet_panics

# The value of an expression of parameters, for an entry of the DAE, of its start or limit.
Number = Callable[[ca.SX, Mapping[str, Any], str], float]

SCHEMA = 43
# Bytes beyond which the front end overflows; 65 MB do for the reference model.
_MEMORY = 2 << 30

_EXPORT = "export the model as an FMU from another Modelica tool, and use that FMU"
# What the front end says, and what to do about it; the first that fits.
_REMEDIES = (
    (r"cannot be evaluated", "correct the expression, or the parameters in it"),
    (r"numeric expression, found Real", "write numbers of less than 1.8e308"),
    (r"value of another type|type mismatch: expected `", "give it a value of its declared type"),
    (r"der\(\.\.\.\) must have exactly one", "name what is differentiated: e = ...; and der(e)"),
    (
        r"der\(\.\.\.\) must name a coordinate",
        "make the derivative an input of its own, or its argument a state",
    ),
    (r"missing source scope", "name each output of the call: (a, b) = f(u)"),
    (r"expected Real, found Integer", "write real numbers, such as 1.0"),
    (
        r"shape mismatch",
        "make the sizes of both sides equal; without 'each', {1, 2} gives each of two components "
        "its value; '.+' adds a scalar to an array",
    ),
    (r"'each' modification", "remove that 'each', or give the component a size"),
    (r"type attribute", "give all elements one value, or declare the elements one by one"),
    (
        r"lexically nested class",
        f"hand the value to that class as a parameter or an argument, or {_EXPORT}",
    ),
    (r"initial algorithm", "write it as an initial equation"),
    (
        r"function loop reduction",
        "use a for loop of constant length without 'break', and if-expressions in it",
    ),
    (r"function loop domain", "loop over a range of whole numbers, such as 1:3"),
    (
        r"function (statement|return)",
        f"use for loops of constant length and if-expressions, or {_EXPORT}",
    ),
    (
        r"^the size of an array|range bound is not|array extent must be",
        "write the size as a number or an Integer parameter; linspace needs two points at least",
    ),
    (r"for-equation range", "loop over a range of numbers, such as 1:3"),
    (r"unresolved [\w ]+: 'Modelica\.", f"correct the name, or {STANDARD}"),
    (r"instantiates partial", "redeclare it as a class that is complete"),
    (r"cardinality\(", "write a Boolean parameter in its place, which says what is connected"),
    (
        r"declarative algorithm|model algorithm",
        "write equations, or a function with this algorithm",
    ),
    (r"violates constrainedby", "extend a common class, and name it after 'constrainedby'"),
    (
        r"^events, ",
        f"write that part without modes, or {_EXPORT}; if the model has no part of that class, add "
        "the missing equation or remove the one too many",
    ),
    (r"^an equation of arrays in", "write it for each: for i in 1:n loop b[i].v = v[i]; end for"),
    (
        r"unbalanced model",
        "add the missing equation or remove the one too many; inputs of components need a value",
    ),
    (r"not a discrete-time expression", "use a Real, or an if-expression inside noEvent(...)"),
    (r"^unexpected `:?=`", "write '=' in equations, and ':=' in algorithms and functions"),
    (r"^unexpected", "correct it; a ';', a bracket or an 'end' may be missing there or above it"),
    (r"exponentiation", "put brackets: (a^b)^c, or a^(b^c)"),
    (r"state-machine", f"write it as equations without modes, or {_EXPORT}"),
    (r"`spatialDistribution`", f"write it as volumes in a row, or {_EXPORT}"),
    (
        r"unresolved Flat reference",
        "correct the name, or the index, for which write a number or a parameter; a component "
        "whose condition is false has no variables. A record that is a constant of a package: "
        "declare it as a parameter of the model",
    ),
    (r"without elements", "give the array one element at least, or remove it"),
    (r"unresolved|not found|undefined", "correct the name"),
    (r"unsupported|no checked canonical|rejected", REWRITE),
)

# What may stand behind a model that the front end calls unbalanced.
_UNBALANCED = {
    r"\b(pre|edge|change|reinit)\s*\(|\bwhen\b": "events",
    r"\b\w+(\[\w*:\w*\])?\.\w+\s*=\s*\{\s*\{": "an equation of arrays in an array of components",
}

_DECLARED = re.compile(r"\b(package|end|extends|constrainedby)\s+[\w.]+")
_BUILT_IN = frozenset(
    "abs sign sqrt div mod rem ceil floor integer sin cos tan asin acos atan atan2 sinh cosh tanh "  # noqa: SIM905
    "exp log log10 min max sum product size fill zeros ones identity diagonal linspace transpose "
    "cross skew symmetric scalar vector matrix cat delay smooth homotopy semiLinear noEvent".split()
)  # functions that need no declaration (spec 3.7 and 10.3)
_CALLED = re.compile(r"([A-Za-z_][\w.]*)\s*\(")
# The front end takes 15 s for so many turns of a function, and time grows by their square.
_MOST_TURNS = 10_000
_LOOP = re.compile(r"\bfor\s+\w+\s+in\s+((?:\d+\s*:\s*){1,2})(\w+)\s+loop\b|\b(?:end\s+)?for\b")
_COUNT = re.compile(r"\bInteger\s+(\w+)[^;=]*=\s*(\d+)\s*[;\"]")
# An index of a connection that is no number, parameter or sum of such: its value is lost.
_CONNECTED = r"\bconnect\s*\([^;]*?\[[^\];]*?(?P<index>\bend\b|\bif\b|\w+\s*[(\[])"
_MAYBE_MISREAD = re.compile(
    rf"\bterminate\s*\(|\bhomotopy\s*\(\s*simplified\b|,\s*\w+\s+in\b|{_CONNECTED}"
)
_MISREAD = re.compile(
    r"\bterminate\s*\(|\bhomotopy\s*\(\s*simplified\b|[([{}\])]|\bfor\b|,(?=\s*\w+\s+in\b)"
    rf"|{_CONNECTED}"
)


@dataclass(frozen=True)
class FlatVariable:
    """One scalar variable of the flat model.

    Attributes
    ----------
    symbol : stands for it in the equations.
    start : its value before the simulation, at the defaults of all parameters.
    unit, description, minimum, maximum, nominal : Modelica's attributes, None where not given.
    start_expression : start as an expression of parameters; None where it is a number.
    has_start : whether the source gives a start.
    fixed : whether it begins at its start, whatever else holds.
    select : Modelica's stateSelect, such as "Default" or "Prefer".
    place : "file:line" of its declaration.
    """

    name: str
    symbol: ca.SX
    start: float
    unit: str | None
    description: str | None
    minimum: float | None
    maximum: float | None
    nominal: float | None
    start_expression: ca.SX | None = None
    has_start: bool = True
    fixed: bool = False
    select: str = "Default"
    place: str = ""


@dataclass(frozen=True)
class FlatModel:
    """A flat model: residual(time, states, derivatives, unknowns, inputs, parameters) = 0.

    Attributes
    ----------
    place : "file:line" of the model.
    differentiated : variables whose derivative is in the equations, in order of declaration.
    rates : symbols of their derivatives.
    algebraic : unknowns that are not differentiated.
    inputs, parameters : what the environment sets; parameters bound to others are substituted.
    outputs : names of top-level outputs, in order of declaration.
    equations, initial_equations : (residual, "file:line") pairs, all scalar.
    assertions : (condition, text) pairs; a condition is 1 where it holds.
    experiment : numbers of the experiment annotation, such as StopTime [s].
    notes : what the user should know, a sentence each.
    """

    name: str
    description: str
    place: str
    experiment: dict[str, float]
    time: ca.SX
    differentiated: list[FlatVariable]
    rates: list[ca.SX]
    algebraic: list[FlatVariable]
    inputs: list[FlatVariable]
    parameters: list[FlatVariable]
    tunable: list[bool]
    outputs: list[str]
    equations: list[tuple[ca.SX, str]]
    initial_equations: list[tuple[ca.SX, str]]
    assertions: list[tuple[ca.SX, str]]
    notes: tuple[str, ...]


def flatten(package: Path, model: str) -> FlatModel:
    """Flatten `model` (dotted name) of the library whose `package.mo` is given.

    Libraries that it uses are found as `workbench.models.modelica.packages` says.

    Raises
    ------
    InputError
        With file and line of what is wrong, or of a construct that the later stages do not treat.
    """
    if not package.is_file():
        raise InputError(
            where=str(package),
            found="no such file",
            expected="the package.mo of a Modelica library",
            remedy="give the path of the library's package.mo",
        )
    library = read_library(package)
    reached = check(library, model)
    source = library.find(model)
    _refuse_dropped(library, reached)
    _refuse_misread(library, reached)
    _refuse_shared_constants(library, reached)
    _refuse_stale_constants(library, (source.name, *library.ancestors(source.name)))
    if source.partial or source.kind in ("package", "function", "type", "connector", "record"):
        raise InputError(
            where=source.where,
            found=f"{'a partial' if source.partial else 'a'} {source.kind} {model}",
            expected="a model or block that is complete",
            remedy="choose a model that extends or uses it",
        )
    refusal = InputError(
        where=source.where,
        found=f"{model}, at which the front end overflows",
        expected="expressions of some thousand terms at most, arrays of as many elements, and "
        "functions and constants that do not need themselves",
        remedy="make it smaller, or leave out what needs itself",
    )
    try:
        with quiet_panics(), blaming(refusal), limited_memory(_MEMORY):
            roots = [str(used.parent) for used in packages(package)[1:]]
            dae = rumoca.Session(roots=roots).load(str(package), model=model).to_dict("dae")
    except rumoca.RumocaError as error:
        drawn = _diagnostics(package, model)
        if drawn and re.search("exponentiation|state-machine", drawn[1]):  # of file or model
            drawn = _placed(library, reached, source, drawn[1])
        place, message = drawn or _placed(library, reached, source, str(error))
        raise _front_end_refusal(place, message) from None
    except BaseException as panic:  # a panic of the front end is no Exception
        if type(panic).__name__ != "PanicException":
            raise
        raise _front_end_refusal(*_panic(library, reached, source, str(panic))) from None
    if dae["schema_version"] != SCHEMA:
        raise InputError(
            where=f"rumoca {rumoca.version()}",
            found=f"DAE schema {dae['schema_version']}",
            expected=f"schema {SCHEMA}",
            remedy="install the rumoca release that the extra [compiler] pins",
        )
    return _Reader(dae, library, source, model).flat_model()


def _front_end_refusal(place: str, message: str) -> InputError:
    remedies = (remedy for pattern, remedy in _REMEDIES if re.search(pattern, message))
    return InputError(
        where=place,
        found=message,
        expected="a balanced Modelica model without errors, of what the front end treats",
        remedy=next(remedies, "correct the source and build again"),
    )


def _panic(library: Library, reached: Sequence[str], source: Class, text: str) -> tuple[str, str]:
    """File and line, and message, of a panic of the front end."""
    detail = re.search(r'detail: "((?:[^"\\]|\\.)*)"', text)
    message = detail.group(1) if detail else text.splitlines()[0]
    span = re.search(r"start: BytePos\((\d+)\), end: BytePos\((\d+)\)", text)
    if span is not None and message.startswith("der("):
        # The span names no file: of those of the library it is in the one that has a der() there.
        start, end = int(span.group(1)), int(span.group(2))
        for path in files(library.file):
            content = path.read_bytes()
            if content[start:end].startswith(b"der("):
                line = content[:start].count(b"\n") + 1
                return f"{path}:{line}", f"{content[start:end].decode()}: {message}"
    return _placed(library, reached, source, message)


def _diagnostics(package: Path, model: str) -> tuple[str, str] | None:
    """Place of the front end's first diagnostic with a line, and what all of them say."""
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            diagnostics = rumoca.validate(str(package), model=model)
        except rumoca.RumocaError:
            return None
    messages: dict[str, str] = {}
    for diagnostic in diagnostics:
        # Syntax errors carry their place in a drawing, all others as attributes.
        drawn = re.findall(
            r"\u00d7 (.+?(?:\n\s*\u2502.*?)*)\n\s*\u256d\u2500\[(.+?)\]", diagnostic.message
        )
        for message, place in drawn:
            words = " ".join(re.sub(r"\n\s*\u2502", " ", message).split())
            messages.setdefault(place.rpartition(":")[0], words)
        if not drawn and diagnostic.line is not None:
            place = f"{diagnostic.file or package}:{diagnostic.line}"
            messages.setdefault(place, diagnostic.message.strip())
    if not messages:
        return None
    first, *others = messages.items()
    if first[1].startswith("unexpected"):  # what follows is its consequence
        return first
    return first[0], "; ".join([first[1], *(f"{place}: {text}" for place, text in others)])


def _placed(library: Library, reached: Sequence[str], source: Class, text: str) -> tuple[str, str]:
    """Where what the front end's message is about stands in the source, and the message.

    The front end gives no place for what it does not treat, but quotes a name: it is looked for in
    the model, then in the classes that it uses. Without one, the place is that of the model.
    """
    message = re.sub(r"^\w+ failed: \S+ failed in \w+: ", "", text.split("\n")[0])
    message = message.split(";")[0]
    if untyped := re.search(r'MissingEffectiveType \{ owner: VarName\("([^"]+)"\)', message):
        message = f"`{untyped[1]}`, of no known type, as is an array without elements"
    if "binding type compatibility" in message:
        message = "a component with a value of another type"
    if place := re.search(r" \[([^\[\]]+:\d+):\d+\]$", message):
        return place[1], message[: place.start()]
    quoted = re.findall(r"`([^`]+)`", message)
    names = [word.split(".") for word in quoted if re.fullmatch(r"[\w.]+", word)]
    causes: dict[str, str] = {}  # by pattern of what the message does not say
    if "der(...)" in message:
        patterns = [r"\bder\s*\((?!\s*[\w.]+(\[[\w,:]*\])?\s*\))"]
    elif "for-equation range" in message:
        patterns = [r"\bfor\s+\w+\s+in\s+(?!\d+\s*:)"]
    elif "exponentiation" in message:
        patterns = [r"\^\s*[\w.]+\s*\^"]
    elif "state-machine" in message:
        patterns = [r"\binitialState\s*\("]
    elif "missing source scope" in message:
        patterns = [r"\(\s*,"]
    elif "unbalanced model" in message:
        causes = _UNBALANCED
        patterns = list(causes)
    elif "cannot be evaluated" in message:
        patterns = [rf"\b{name[-1]}\s*(\([^;]*\))?\s*=" for name in names]
    else:
        # Of `Lib.Data.motor.R` the source may say Data.motor.R or motor.R.
        words = [".".join(n[k:]) for n in names for k in range(max(1, len(n) - 1))]
        sized = [rf"\bsize\s*\(\s*{word}\s*,|\b{word}\s*\[[^\]]*\bend\b" for word in words]
        sized = sized if "unresolved Flat" in message else []
        causes = dict.fromkeys(sized, "the size of an array of components")
        patterns = sized + [
            pattern
            for word in words
            for pattern in (rf"\b{word}\s*\(", rf"\b{word}\b")
            if word not in (source.name, source.name.rpartition(".")[2])
        ]
    for pattern in patterns:
        for name in dict.fromkeys([source.name, *reached]):
            file, _, line = library.classes[name].where.rpartition(":")
            for number, words_of_line in enumerate(_own_lines(library.classes[name]), int(line)):
                if match := re.search(pattern, words_of_line):
                    cause = f"{causes[pattern]}, '{match[0]}': " if pattern in causes else ""
                    return f"{file}:{number}", cause + message
    return source.where, message


def _own_lines(source: Class) -> list[str]:
    """Lines of a class, from its name to its end, without strings and comments."""
    file, _, line = source.where.rpartition(":")
    text = "\n".join(Path(file).read_text(encoding="utf-8-sig").split("\n")[int(line) - 1 :])
    short = re.escape(source.name.rpartition(".")[2])
    text = re.split(rf"\bend\s+{short}\s*;", text, maxsplit=1)[0]
    hidden = r'"(?:[^"\\]|\\.)*"|//[^\n]*|/\*.*?\*/'
    return re.sub(hidden, lambda match: "\n" * match[0].count("\n"), text, flags=re.DOTALL).split(
        "\n"
    )


class _Reader:
    """Reads variables and equations around the arena of expressions."""

    def __init__(self, dae: Mapping[str, Any], library: Library, source: Class, model: str) -> None:
        self.library, self.source = library, source
        self.model = model
        own = library.components(source.name)
        # The front end calls parts of a record local, whose declaration is an input or output.
        self.interface = {name for name, c in own.items() if c.prefixes & {"input", "output"}}
        self.storage = dae["storage"]
        self.variables: list[dict[str, Any]] = self.storage["variables"]
        self.arena = Arena(dae, source.where)
        self.notes: list[str] = []

    def flat_model(self) -> FlatModel:
        """Read variables, then equations."""
        self._refuse_events()
        self.arena.refuse_moved_subscripts()
        for number, entry in enumerate(self.variables):
            if number not in self.arena.defined or self._interface_causality(entry):
                self._refuse_type(entry)
            shape = tuple(self.arena.types[entry["value_type"]]["dimensions"])
            symbol: Value = np.empty(shape, object)
            for index in np.ndindex(shape):
                place = f"[{','.join(str(i + 1) for i in index)}]" if index else ""
                symbol[index] = ca.SX.sym(f"{entry['name']}{place}")
            self.arena.symbols.append(symbol)
            if entry["role"] == "state":
                self.arena.rates[number] = each(lambda s: ca.SX.sym(f"der({s.name()})"), symbol)
        free, bound = self._bind_parameters()
        substitute = _substitution([pair[1:] for pair in bound])
        numeric = self._numbers(free, substitute)
        for number, _, binding in bound:
            for element in binding.flat:
                numeric(element, self.variables[number], "value")  # refuses what is no parameter
        groups: dict[str, list[FlatVariable]] = {"state": [], "algebraic": [], "input": []}
        outputs, input_equations = [], []
        for number, entry in enumerate(self.variables):
            role = "algebraic" if entry["role"] == "output" else entry["role"]
            if role not in groups:
                continue
            if role == "input" and (equations := self._bound_input(number)):
                role = "algebraic"
                input_equations += equations
            scalars = self._scalars(number, substitute, numeric)
            groups[role] += scalars
            if self._interface_causality(entry) == "output":
                outputs += [v.name for v in scalars]
        parameters = [v for n in free for v in self._scalars(n, substitute, numeric)]
        _refuse_outside("parameter", parameters)
        _refuse_outside("the start of", [v for v in groups["state"] if v.fixed and v.has_start])
        tunable = [
            self.variables[n]["attributes"]["is_tunable"]
            for n in free
            for _ in self.arena.symbols[n].flat
        ]
        self.arena.reads_equations = True
        operations = self.storage["continuous_equation_operations"]
        initial = self.storage["initialization_equation_operations"]
        return FlatModel(
            name=self.model,
            description=self.source.description or self.model,
            place=self.source.where,
            experiment=self._experiment(),
            time=self.arena.time,
            differentiated=groups["state"],
            rates=[rate for rates in self.arena.rates.values() for rate in rates.flat],
            algebraic=groups["algebraic"],
            inputs=groups["input"],
            parameters=parameters,
            tunable=tunable,
            outputs=outputs,
            equations=[
                (substitute(residual), place)
                for residual, place in (*self._equations(operations), *input_equations)
            ],
            initial_equations=[(substitute(e), place) for e, place in self._equations(initial)],
            assertions=[(substitute(c), text) for c, text in self._assertions()],
            notes=tuple(self.notes),
        )

    def _interface_causality(self, entry: Mapping[str, Any]) -> str:
        """What a variable is of the model itself, input or output; empty: neither."""
        attributes = entry["attributes"]
        top, *parts = attributes["component_ref"]["parts"]
        if parts and top["ident"] not in self.interface:
            return ""
        causality = str(attributes["declared_causality" if parts else "causality"])
        return causality if causality in ("input", "output") else ""

    def _bound_input(self, number: int) -> list[tuple[ca.SX, str]]:
        """Equations of an input whose value varies: `extends Lag(u=pressure)` leaves none free."""
        node = self.variables[number]["attributes"]["binding"]
        if node is None:
            return []
        binding = np.broadcast_to(self.arena.evaluate(node), self.arena.symbols[number].shape)
        if all(element.is_constant() for element in binding.flat):
            return []
        place = self.arena.place(self.variables[number])
        pairs = zip(self.arena.symbols[number].flat, binding.flat, strict=True)
        return [(symbol - value, place) for symbol, value in pairs]

    def _refuse_type(self, entry: Mapping[str, Any]) -> None:
        """Refuse variables and inputs that are not Real, and what only events change."""
        scalar = self.arena.types[entry["value_type"]]["scalar"]
        role = entry["role"]
        if role in ("parameter", "constant") or (
            role in ("state", "algebraic", "output", "input") and scalar == "real"
        ):
            return
        causality = entry["attributes"]["declared_causality"]
        prefix = f"{causality} " if causality in ("input", "output") else ""
        kind = "discrete Real" if scalar == "real" else str(scalar).capitalize()
        remedy = "declare it a parameter where it is constant, or as Real"
        if prefix == "input ":
            remedy = "declare it as Real, and compare inside noEvent(...): noEvent(u > 0.5)"
        raise self.arena.refuse(
            f"{prefix}{kind} '{entry['name']}'", entry, "Real variables and inputs", remedy
        )

    def _refuse_events(self) -> None:
        storage, refuse = self.storage, self.arena.refuse
        asserted = {r for a in storage["event_actions"] for r in self._relations(a["guard"])}
        expected = "continuous equations without events"
        export = "export the model as an FMU from a tool that treats events, and use that FMU"
        checked = ("assert", "warning")
        whens = [a for a in storage["event_actions"] if not any(k in a["kind"] for k in checked)]
        for clock in storage["clocks"]:
            raise refuse("sampling", clock, expected, export)
        for when in [*whens, *storage["discrete_real_equations"]]:
            raise refuse("a when-clause", when, expected, export)
        for delay in storage["delays"]:
            remedy = "replace it by a first-order lag, or a Padé approximation"
            raise refuse("a delay", delay, "ordinary differential equations", remedy)
        for event in storage["time_events"]:
            raise refuse("an expression that causes an event", event, expected, NO_EVENT)
        for root in [*storage["roots"], *storage["structured_roots"]]:
            body = root.get("root", root)
            if "relation" not in body or body["relation"] not in asserted:
                place, remedy = body, NO_EVENT
                if "quotient_owner" in body:  # div, mod and rem, whatever of
                    place = storage["conditions"][body["quotient_owner"]["owner"]]
                    remedy = (
                        "of parameters, write floor(a/b) for div(a, b) and a - b*floor(a/b) for "
                        "mod(a, b); else use a smooth expression"
                    )
                raise refuse("an expression that causes events", place, expected, remedy)
        for kind, name in (
            ("previous_values", "pre(...)"),
            ("initial_discrete_values", "an initial value of a discrete variable"),
            ("initial_parameter_values", "a parameter with fixed = false"),
        ):
            for entry in storage[kind]:
                raise refuse(name, entry if isinstance(entry, dict) else None, expected, export)

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

    def _bind_parameters(self) -> tuple[list[int], list[tuple[int, Value, Value]]]:
        """Split into free parameters and (number, symbols, expressions) of bound ones."""
        free: list[int] = []
        bound: list[tuple[int, Value, Value]] = []
        for number, entry in enumerate(self.variables):
            text = self.arena.types[entry["value_type"]]["scalar"] == "string"
            if entry["role"] not in ("parameter", "constant") or text:
                continue
            unset = entry["attributes"]["binding"] is None and not self.arena.has_start(number)
            if entry["role"] == "constant" and unset:
                raise self.arena.refuse(
                    f"constant '{entry['name']}' without a value",
                    entry,
                    "constants with values",
                    "give its value, or make it a parameter",
                )
            if entry["attributes"]["fixed"] == [False]:
                raise self.arena.refuse(
                    f"parameter '{entry['name']}' with fixed = false",
                    entry,
                    "parameters that are known before the initialisation",
                    "compute its value by hand, or from other parameters",
                )
            binding = self.arena.default(number)
            constant = all(element.is_constant() for element in binding.flat)
            if entry["role"] == "parameter" and constant and not self.arena.is_structural(number):
                free.append(number)
                if unset:
                    self.notes.append(
                        f"{self.arena.place(entry)}: parameter '{entry['name']}' has neither a "
                        "value nor a start, and is 0."
                    )
            else:
                bound.append((number, self.arena.symbols[number], binding))
        return free, bound

    def _numbers(self, free: list[int], substitute: Callable[[ca.SX], ca.SX]) -> Number:
        """A function that evaluates expressions of parameters at their default values.

        It refuses an expression of what is no parameter, and a value that is no finite number, at
        the entry that has it.
        """
        symbols, values = [], []
        for number in free:
            symbols += list(self.arena.symbols[number].flat)
            values += list(self.arena.default(number).flat)
        free_symbols, defaults = ca.vertcat(*symbols), ca.vertcat(*values)

        def number_of(expression: ca.SX, entry: Mapping[str, Any], what: str) -> float:
            value = expression
            if not expression.is_constant():  # most are, and models have thousands
                expression = substitute(expression)
                value = ca.substitute(expression, free_symbols, defaults)
            if varying := ca.symvar(value):
                name = varying[0].name()
                remedy = (
                    f"declare '{name}' a parameter, or write an equation or an initial equation"
                )
                if ca.is_equal(varying[0], self.arena.time):
                    remedy = (
                        "declare it as a variable; in place of a start, write an initial equation"
                    )
                raise self.arena.refuse(
                    f"'{entry['name']}' with a value, a start or a limit that depends on '{name}'",
                    entry,
                    "one that parameters alone give",
                    f"{remedy} for '{entry['name']}'",
                )
            if not math.isfinite(result := float(ca.evalf(value))):
                parameters = ca.symvar(expression)
                given = [f"{s.name()} = {numeric_default(s):g}" for s in parameters]
                raise self.arena.refuse(
                    f"'{entry['name']}' with a {what} of {result:g} at the defaults of parameters"
                    + "".join(f", {text}" for text in given),
                    entry,
                    "a finite number",
                    "correct the expression, or the parameters in it",
                )
            return result

        def numeric_default(symbol: ca.SX) -> float:
            return float(ca.substitute(symbol, free_symbols, defaults))

        return number_of

    def _scalars(
        self,
        number: int,
        substitute: Callable[[ca.SX], ca.SX],
        numeric: Number,
    ) -> list[FlatVariable]:
        entry = self.variables[number]
        attributes = entry["attributes"]
        symbol = self.arena.symbols[number]

        def elements(node: int | None) -> list[ca.SX | None]:
            if node is None:
                return [None] * symbol.size
            return list(np.broadcast_to(self.arena.evaluate(node), symbol.shape).flat)

        def numbers(name: str) -> list[float | None]:
            values = elements(attributes[name])
            return [None if value is None else numeric(value, entry, name) for value in values]

        starts = elements(attributes["start"])
        if entry["role"] == "parameter":
            starts = list(self.arena.default(number).flat)
        elif entry["role"] == "input" and not self._bound_input(number):
            bound = attributes["binding"] is not None
            starts = elements(attributes["binding" if bound else "start"])
        starts = [None if start is None else substitute(start) for start in starts]
        what = "value" if entry["role"] == "parameter" else "start"
        defaults = [0.0 if start is None else numeric(start, entry, what) for start in starts]
        fixed = attributes["fixed"] or [False]
        columns = zip(
            symbol.flat,
            starts,
            defaults,
            numbers("min"),
            numbers("max"),
            numbers("nominal"),
            np.broadcast_to(np.array(fixed, bool), symbol.size) if len(fixed) == 1 else fixed,
            self._units(entry, symbol),
            strict=True,
        )
        return [
            FlatVariable(
                name=s.name(),
                symbol=s,
                start=default,
                unit=unit,
                description=attributes["description"],
                minimum=minimum,
                maximum=maximum,
                nominal=nominal,
                start_expression=None if start is None or start.is_constant() else start,
                has_start=self.arena.has_start(number),
                fixed=bool(is_fixed),
                select=attributes["state_select"],
                place=self.arena.place(entry),
            )
            for s, start, default, minimum, maximum, nominal, is_fixed, unit in columns
        ]

    def _units(self, entry: Mapping[str, Any], symbol: Value) -> list[str | None]:
        """Units of the elements; where each has its own, they stand in the source alone."""
        unit, parts = entry["attributes"]["unit"], entry["attributes"]["component_ref"]["parts"]
        component = None
        if symbol.shape and unit is None:
            component = self.library.part(self.source.name, [part["ident"] for part in parts])
        text = self.library.unit(component) if component else ""
        if not text.startswith("{"):
            return [unit] * symbol.size
        units = np.array(ast.literal_eval(text.replace("{", "[").replace("}", "]")), object)
        # Of components that are arrays the first dimensions are theirs.
        indices = [sub["Index"]["value"] - 1 for part in parts for sub in part["subs"]]
        outer = max(0, units.ndim - symbol.ndim)
        with contextlib.suppress(IndexError):
            units = units[tuple(indices[len(indices) - outer :])]
        if units.shape != symbol.shape:
            raise self.arena.refuse(
                f"'{entry['name']}' with units {text}",
                entry,
                f"a unit for each element of an array of {' x '.join(map(str, symbol.shape))}",
                'give each its unit, or all one: (each unit = "m")',
            )
        return list(units.flat)

    def _equations(self, operations: Sequence[Mapping[str, Any]]) -> Iterator[tuple[ca.SX, str]]:
        for operation in operations:
            ((kind, body),) = operation.items()
            place = self.arena.place(body)
            if kind == "residual":
                residuals = list(self.arena.evaluate(body["residual"]).flat)
            elif kind == "structured" and body["scalar_view"] == "BinderSubstitution":
                residuals = [
                    element
                    for _ in self.arena.points(body["domain"])
                    for node in body["bodies"]
                    for element in self.arena.evaluate(node).flat
                ]
            elif kind == "structured":
                residuals = [e for node in body["bodies"] for e in self.arena.evaluate(node).flat]
            else:
                raise self.arena.refuse(f"an equation of kind '{kind}'", body)
            for residual in residuals:
                yield residual, place

    def _assertions(self) -> Iterator[tuple[ca.SX, str]]:
        for action in self.storage["event_actions"]:
            kind = action["kind"]
            if "warning" in kind:
                self.notes.append(
                    f"{self.arena.place(action)}: an assertion of level warning is not checked."
                )
                continue
            yield (
                ca.logic_not(self._condition(action["guard"])),
                self._text(kind["assert"]["message"]),
            )

    def _condition(self, number: int) -> ca.SX:
        """The expression of a condition node; an assertion's guard is its negation."""
        condition = self.storage["conditions"][number]
        if isinstance(condition["node"], dict):
            ((kind, body),) = condition["node"].items()
            match kind:
                case "relation":
                    relation = self.storage["relations"][body]
                    return self.arena.evaluate(relation.get("relation", relation)["expression"])[()]
                case "not":
                    return ca.logic_not(self._condition(body))
                case "and" | "or":
                    lhs, rhs = self._condition(body["lhs"]), self._condition(body["rhs"])
                    return BINARY[kind](lhs, rhs)
                case "expression" | "discrete":
                    return self.arena.evaluate(body)[()]
        raise self.arena.refuse("a condition of an assertion", condition)

    def _text(self, number: int) -> str:
        """An assertion's text; one that is put together, as the source has it."""
        literal = self.arena.nodes[number].get("literal", {})
        quoted = self.arena.quote(self.storage["expressions"]["provenance"][number])
        return str(literal.get("string", quoted))

    def _experiment(self) -> dict[str, float]:
        """Numbers of the model's experiment annotation, which the flat DAE drops."""
        numbers = {}
        for name, text in self.source.experiment.items():
            if name not in EXPERIMENT:
                continue
            with contextlib.suppress(ValueError):
                numbers[name] = float(text)
            if not math.isfinite(numbers.get(name, math.nan)):
                raise InputError(
                    where=self.source.where,
                    found=f"experiment({name}={text})",
                    expected="a finite number",
                    remedy="write the number",
                )
        return numbers


def _refuse_outside(what: str, variables: Sequence[FlatVariable]) -> None:
    """Refuse a value of a parameter, or a start of a state, that its own limits exclude."""
    for variable in variables:
        low, high = variable.minimum, variable.maximum
        if (low is not None and variable.start < low) or (
            high is not None and variable.start > high
        ):
            limits = {"min": low, "max": high}
            raise InputError(
                where=variable.place,
                found=f"{what} '{variable.name}' = {variable.start:g}",
                expected=" and ".join(f"{k} = {v:g}" for k, v in limits.items() if v is not None),
                remedy="correct the value, or its limits",
            )


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


def _refuse_dropped(library: Library, reached: Iterable[str]) -> None:
    """Refuse what is right in Modelica and the front end drops: a redeclaration, or a value.

    The redeclaration by a class that extends of what its base has from its own base; the value
    that is given together with attributes to what is inherited, or to a part of a part, as in
    `extends Part(k(max=2.0)=1.0)`; modifiers of classes that are redeclared.
    """
    held = [c for c in library.classes.values() if c.name.rpartition(".")[0] in reached]
    aliases = {
        c.name.rpartition(".")[2]: c
        for c in held
        if "replaceable" in c.prefixes
        and not c.constraint
        and any(base.modifier.inner for base in c.extends)
    }
    for element in [c for c in held if "redeclare" in c.prefixes]:
        name = element.name.rpartition(".")[2]
        if name in aliases:
            raise _lost_modifiers(name, element.where, aliases[name].name)
    for name in reached:
        _refuse_redeclarations(library, name)
        for extends in library.classes[name].extends:
            _refuse_values(extends.modifier)
            _refuse_lost_modifiers(extends.modifier, aliases)
        for component in library.classes[name].components:
            _refuse_lost_modifiers(component.modifier, aliases)
            for modification in component.modifier.inner.values():
                _refuse_values(_inside(modification))
            if "outer" in component.prefixes:
                _refuse_outer(component)


def _refuse_shared_constants(library: Library, reached: Iterable[str]) -> None:
    """Refuse a package beside another one that extends it with other values of its constants.

    The front end gives both the values of one.
    """
    own = set(map(str, files(library.file)))
    texts = {
        library.classes[name].where: _DECLARED.sub("", "\n".join(_own_lines(library.classes[name])))
        for name in reached
        if library.classes[name].where.rpartition(":")[0] in own
    }

    def named(package: str) -> str:
        short = re.compile(rf"\b{package.rpartition('.')[2]}\b(?!\s*\()")
        return next((where for where, text in texts.items() if short.search(text)), "")

    for package in [c for c in library.classes.values() if c.kind == "package"]:
        if named(package.name):
            _refuse_two_values(library, package.name)
        for base, dotted in zip(package.extends, library.bases(package.name), strict=True):
            given = library.components(dotted) if dotted in library.classes else {}
            valued = [n for n in base.modifier.inner if n in given and given[n].modifier.value]
            if valued and named(package.name) and (where := named(dotted)):
                raise InputError(
                    where=where,
                    found=f"package {dotted} beside {package.name}, which changes its constant "
                    f"'{valued[0]}'",
                    expected="packages of which none changes what another one has",
                    remedy=f"declare '{valued[0]}' without a value in a partial package, and "
                    "extend that with each value",
                )


def _refuse_two_values(library: Library, package: str) -> None:
    """Refuse a constant to which two extends-clauses on the way of a package give values.

    The front end takes the value of the one further away.
    """
    given: dict[str, tuple[str, Modifier]] = {}
    for name in (package, *library.ancestors(package)):
        for base in library.classes[name].extends:
            for constant, modifier in base.modifier.inner.items():
                if modifier.value and constant in given:
                    nearer, value = given[constant]
                    raise InputError(
                        where=value.where,
                        found=f"{constant}={value.value} where {nearer} extends, and "
                        f"{constant}={modifier.value} where {name} does, for {package}",
                        expected="one value in extends-clauses, as the Modelica front end takes "
                        "that further away",
                        remedy=f"extend {base.name} in {nearer}, or declare '{constant}' with its "
                        f"value in the body of {name}",
                    )
                if modifier.value:
                    given[constant] = (name, modifier)


def _refuse_stale_constants(library: Library, lineage: Sequence[str]) -> None:
    """Refuse functions of a package that a model, or what it extends, redeclares with constants.

    The front end computes them with the values of the package before it. That of a component is
    taken as it is meant.
    """
    for name in lineage:
        if name not in library.classes:
            continue
        inner = [m for base in library.classes[name].extends for m in base.modifier.inner.values()]
        redeclared = [(m.redeclared.type, name, m.where) for m in inner if m.redeclared]
        redeclared += [
            (base.name, name, cls.where)
            for cls in library.classes.values()
            if cls.name.rpartition(".")[0] == name and "redeclare" in cls.prefixes
            for base in cls.extends
        ]
        for type_name, scope, where in redeclared:
            package = library.resolve(type_name, scope)
            around = (package, *library.ancestors(package)) if package in library.classes else ()
            known = [library.classes[cls] for cls in around if cls in library.classes]
            changed = any(base.modifier.inner for cls in known for base in cls.extends)
            functions = [
                cls.name
                for cls in library.classes.values()
                if cls.kind == "function" and cls.name.rpartition(".")[0] in around
            ]
            if changed and functions:
                raise InputError(
                    where=where,
                    found=f"package {package}, which {name} redeclares, with function "
                    f"{functions[0]} and constants that it changes",
                    expected="the package at a component, as the Modelica front end takes it then",
                    remedy=f"declare a component of the class that has it, such as "
                    f"'Part part(redeclare package Medium = {type_name})'",
                )


def _refuse_misread(library: Library, reached: Iterable[str]) -> None:
    """Refuse what the front end drops or turns round.

    These are terminate(...) in an if-equation, homotopy(simplified = ..., actual = ...),
    {a for i in u, j in v}, connect(a[end], b), der(f, x) of a function f, and functions of one's
    own that have the name of one of the language.

    The first iterator of an array constructor is the innermost (spec 10.4.1.1); the front end
    takes it for the outermost.
    """
    own = set(map(str, files(library.file)))
    waiting = [name for name in reached if library.classes[name].where.rpartition(":")[0] in own]
    for name in waiting:
        file, _, line = library.classes[name].where.rpartition(":")
        text = "\n".join(_own_lines(library.classes[name]))
        for called in dict.fromkeys(_CALLED.findall(text)):
            function = None
            with contextlib.suppress(InputError):  # a part of a component, whose name a class has
                function = library.classes.get(library.resolve(called, name))
            if function is not None and "der" in function.prefixes:
                raise InputError(
                    where=function.where,
                    found=f"the partial derivative of a function, '{called} = der(...)'",
                    expected="functions that are written in Modelica, as the Modelica front end "
                    "takes the function itself",
                    remedy="write the derivative as a function of its own",
                )
            if (
                function is not None
                and called in _BUILT_IN
                and function.where.startswith(tuple(f"{path}:" for path in own))
            ):
                raise InputError(
                    where=f"{file}:{line}",
                    found=f"'{called}(...)' in {name}, and a function {function.name}",
                    expected="functions with other names than those of the language, as the "
                    "Modelica front end takes those",
                    remedy=f"give {function.name} another name, or call it with its package",
                )
            if function is not None and function.kind == "function":
                waiting += [function.name] * (function.name not in waiting)
        _refuse_long_loops(text, file, int(line))
        if not _MAYBE_MISREAD.search(text):
            continue
        brackets: list[str] = []
        for match in _MISREAD.finditer(text):
            word = match[0]
            where = f"{file}:{int(line) + text[: match.start()].count(chr(10))}"
            if word.startswith("homotopy"):
                raise InputError(
                    where=where,
                    found="homotopy(simplified = ..., actual = ...)",
                    expected="'actual' first, as the Modelica front end takes the first argument",
                    remedy="write homotopy(actual = ..., simplified = ...)",
                )
            if word.startswith("connect"):
                raise InputError(
                    where=where,
                    found=f"'{match['index']}' in an index of '{' '.join(word.split())}'",
                    expected="numbers, parameters and their sums, as the Modelica front end takes "
                    "another element then",
                    remedy="write the number, or a parameter with its value",
                )
            if word.startswith("terminate"):
                raise InputError(
                    where=where,
                    found="terminate(...)",
                    expected="continuous equations without events",
                    remedy=f"remove it, assert its contrary, or {_EXPORT}",
                )
            if word in "([{":
                brackets.append(word)
            elif word in ")]}":
                del brackets[-1:]
            elif word == "for" and brackets:
                brackets[-1] += word
            elif word == "," and brackets[-1:] == ["{for"]:
                raise InputError(
                    where=where,
                    found="an array constructor with several iterators",
                    expected="one iterator, as the Modelica front end takes them in another order",
                    remedy="nest them: {a for i in u, j in v} is {{a for i in u} for j in v}",
                )


def _refuse_long_loops(text: str, file: str, line: int) -> None:
    """Refuse loops of more turns than the front end unrolls in seconds.

    Parameters
    ----------
    text : of a class, without strings and comments; from `line` of the file on.
    """
    counts = dict(_COUNT.findall(text))
    open_loops: list[int] = []
    for match in _LOOP.finditer(text):
        if match[0].startswith("end"):
            del open_loops[-1:]
            continue
        if match[2] is None and not re.match(r"[^;]*?\bloop\b", text[match.end() :]):
            continue  # of an array constructor
        last = str(counts.get(match[2], match[2]))
        count = 1  # where it is not known here
        if match[1] and last.isdigit():
            first, *step = map(int, re.findall(r"\d+", match[1]))
            count = max(1, (int(last) - first) // max(1, *step, 1) + 1)
        open_loops.append(count)
        if (turns := math.prod(open_loops)) > _MOST_TURNS:
            raise InputError(
                where=f"{file}:{line + text[: match.start()].count(chr(10))}",
                found=f"a loop of {turns} turns, nested ones multiplied",
                expected=f"at most {_MOST_TURNS}, as the Modelica front end unrolls each",
                remedy=f"write a sum in closed form, take fewer turns, or {_EXPORT}",
            )


def _refuse_outer(component: Component) -> None:
    """Refuse an outer variable: the front end misses the equation that ties it to the inner one.

    It takes what is outer and inner at once for a new one.
    """
    if "inner" in component.prefixes:
        raise InputError(
            where=component.where,
            found=f"'inner outer {component.name}'",
            expected="an outer or an inner component, as the Modelica front end needs",
            remedy=f"declare '{component.name}' outer; what is within finds the same inner one",
        )
    if component.type in ("Real", "Integer", "Boolean") and not component.prefixes & {
        "parameter",
        "constant",
    }:
        raise InputError(
            where=component.where,
            found=f"'outer {component.type} {component.name}'",
            expected="an outer component of a model, as the Modelica front end needs",
            remedy=f"put '{component.name}' into a model, and declare that inner and outer",
        )


def _refuse_redeclarations(library: Library, name: str) -> None:
    for extends, base in zip(library.classes[name].extends, library.bases(name), strict=True):
        if base not in library.classes:
            continue
        inherited = set(library.components(base))
        inherited -= {component.name for component in library.classes[base].components}
        for slot, modifier in extends.modifier.inner.items():
            if modifier.redeclared is not None and slot in inherited:
                raise InputError(
                    where=modifier.where,
                    found=f"a redeclaration of '{slot}', which {base} inherits",
                    expected="one of a component that the extended class itself declares, as "
                    "the Modelica front end needs",
                    remedy=f"declare '{slot}' in {base}, or extend the class that declares it",
                )


def _refuse_values(modifier: Modifier) -> None:
    """Refuse values beside attributes at any depth below that of a declaration itself."""
    for name, given in modifier.inner.items():
        if given.value and given.inner:
            raise InputError(
                where=given.where,
                found=f"a value of '{name}' together with {', '.join(given.inner)}",
                expected="one of the two, as the Modelica front end loses the value",
                remedy=f"give '{name}' its value alone, or its attributes in a class of its own",
            )
        _refuse_values(_inside(given))


def _refuse_lost_modifiers(
    modifier: Modifier, aliases: Mapping[str, Class], part: str = ""
) -> None:
    """Refuse modifiers of a class that is redeclared, and of the one that stood in its place.

    Redeclarations within a part of what is modified are lost, too.

    Parameters
    ----------
    part : whose elements the modifiers are of; empty where they are of the whole.
    aliases : replaceable classes with modifiers, which hold for what comes in their place, too
        (spec 7.3.2), by their own names.
    """
    for name, given in modifier.inner.items():
        new = given.redeclared
        if new is not None and part:
            raise InputError(
                where=new.where,
                found=f"a redeclaration of '{name}' within '{part}'",
                expected="redeclarations in what is declared or extended itself, as the Modelica "
                "front end drops others",
                remedy=f"declare '{part}' replaceable, and redeclare it as a class that extends "
                "its own with this redeclaration",
            )
        if new is not None and new.prefixes & KINDS:
            own = new.modifier.inner if "function" not in new.prefixes else {}
            if own or name in aliases:
                raise _lost_modifiers(name, new.where, new.type if own else aliases[name].name)
        _refuse_lost_modifiers(_inside(given), aliases, name)


def _lost_modifiers(name: str, where: str, of: str) -> InputError:
    return InputError(
        where=where,
        found=f"a redeclaration of class '{name}', with modifiers of {of}",
        expected="classes without modifiers, as the Modelica front end drops them here",
        remedy=f"declare {of} with its modifiers as a class of another name, and put that there",
    )


def _inside(modifier: Modifier) -> Modifier:
    return modifier if modifier.redeclared is None else modifier.redeclared.modifier
