"""What an FMU says of itself, stage 2: identity, interfaces, platforms, variables."""

import hashlib
import itertools
import math
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

import fmpy

from workbench.errors import InputError, one_line, unknown_name
from workbench.models.archive import DESCRIPTION, damaged, opened
from workbench.runtime.resources import CHECKOUT

OWN_TOOL = "Observer workbench"  # that FMUs say they were made by, with its version
MODEL_EXCHANGE = "Model Exchange"
CO_SIMULATION = "Co-Simulation"
_NO_NUMBERS = ("String", "Binary", "Clock")
REAL_TYPES = ("Real", "Float64")  # of FMI 2.0 and 3.0
_FLOATS = (*REAL_TYPES, "Float32")  # of states


@dataclass(frozen=True)
class Interface:
    """Model Exchange or Co-Simulation, as one FMU offers it; flags as in FMI's description."""

    identifier: str
    saves_state: bool
    serialises_state: bool
    directional_derivatives: bool
    one_instance_per_process: bool
    completed_steps: bool
    variable_steps: bool
    interpolates: bool  # takes derivatives of inputs (FMI 2.0)


@dataclass(frozen=True)
class Variable:
    """One variable; `start` as written, None where the description has none."""

    name: str
    reference: int
    type: str
    real: bool  # a scalar of type Real (FMI 2.0) or Float64 (FMI 3.0)
    causality: str
    variability: str
    unit: str | None
    start: str | None
    # nominal, minimum, maximum: in `unit`, None where the description has none
    nominal: float | None
    minimum: float | None
    maximum: float | None
    text: str
    array: bool = False
    # "exact" and "approx" may be set before the start, "calculated" may not
    initial: str | None = None
    # of, element, size: of an element of an array: its name, the place in it, how many it has
    of: str = ""
    element: int = 0
    size: int = 1
    items: tuple[int, ...] = ()  # values of an enumeration, which may have holes
    relative: bool = False  # whether it is a difference, whose unit has no zero of its own

    @property
    def limits(self) -> tuple[float, float]:
        """Minimum and maximum, in `unit`; infinite where the description has none."""
        low = -math.inf if self.minimum is None else self.minimum
        return low, math.inf if self.maximum is None else self.maximum

    @property
    def holds_number(self) -> bool:
        """Whether its type is of numbers, of which a Boolean has two."""
        return self.type not in _NO_NUMBERS

    @property
    def floats(self) -> bool:
        """Whether its type is of numbers that need not be whole."""
        return self.type in _FLOATS

    @property
    def scalar(self) -> bool:
        """Whether it is one such number by itself, no array and no element of one."""
        return self.floats and not self.array and not self.of


@dataclass(frozen=True)
class Description:
    """The model description of an FMU and what its archive holds."""

    path: Path
    sha256: str  # hash of the file, its identity in results
    version: str  # of FMI, "2.0" or "3.0"
    name: str
    text: str
    tool: str
    token: str  # GUID or instantiation token
    interfaces: Mapping[str, Interface]  # by name, MODEL_EXCHANGE and CO_SIMULATION
    platforms: tuple[str, ...]  # those with a binary, in FMI's names
    # sizes of the files of all platforms [bytes], by name in the archive
    binaries: Mapping[str, int]
    variables: tuple[Variable, ...]
    # by name of a unit that it defines: SI units, "kg.m-1.s-2", how many of them it is, its zero
    units: Mapping[str, tuple[str, float, float]]
    # states, rates: names of the continuous states and their derivatives, in FMI's order
    states: tuple[str, ...]
    rates: tuple[str, ...]
    # names of what a derivative or an output depends on, by its name; without those of which the
    # model structure does not say it
    dependencies: Mapping[str, tuple[str, ...]]
    event_indicators: int  # their number; 0 for a smooth model
    # start, step, stop: of the default experiment [s], None where there is none
    start: float | None
    step: float | None
    stop: float | None

    @cached_property
    def by_name(self) -> Mapping[str, Variable]:
        """Its variables."""
        return {variable.name: variable for variable in self.variables}

    def names(self, causality: str) -> tuple[str, ...]:
        """Names of the variables of a causality, in the order of the model description."""
        return tuple(v.name for v in self.variables if v.causality == causality)

    def renamed(self, names: Mapping[str, str]) -> "Description":
        """The same description with other names.

        A variable whose own name is given to another one is called `fmu.NAME` from then on.

        Parameters
        ----------
        names : new names and the FMU's own, such as {"p": "pressure"}.
        """
        if not names:
            return self
        own = {variable.name for variable in self.variables}
        for ours, theirs in names.items():
            if theirs not in own:
                raise unknown_name(
                    theirs,
                    own,
                    where=str(self.path),
                    found=f"no variable '{theirs}'",
                    expected=f"the variable that is to be '{ours}'",
                    remedy=f"correct '{ours}' in the mapping of names; 'workbench fmu info' lists "
                    "the FMU's variables",
                )
        mapped = {theirs: ours for ours, theirs in names.items()}

        def new(name: str) -> str:
            return mapped.get(name, f"fmu.{name}" if name in names else name)

        return replace(
            self,
            variables=tuple(replace(v, name=new(v.name)) for v in self.variables),
            states=tuple(map(new, self.states)),
            rates=tuple(map(new, self.rates)),
            dependencies={
                new(unknown): tuple(map(new, knowns))
                for unknown, knowns in self.dependencies.items()
            },
        )

    def require(self, interface: str) -> Interface:
        """Interface of a name, with a binary for this machine.

        Raises
        ------
        InputError
            If the FMU has no such interface, waits for clocks, or has no binary for this machine.
        """
        clocks = [v.name for v in self.variables if v.type == "Clock" and v.causality == "input"]
        if clocks:
            raise InputError(
                where=str(self.path),
                found=f"input clocks, {', '.join(clocks)}",
                expected="a model that keeps its own time: nobody ticks clocks here, and what "
                "waits for them would stand still",
                remedy="export the model without clocks, with time events in their place",
            )
        if interface not in self.interfaces:
            raise InputError(
                where=str(self.path),
                found=f"FMI {self.version}, "
                + (
                    f"{', '.join(self.interfaces)} only"
                    if self.interfaces
                    else "neither Model Exchange nor Co-Simulation"
                ),
                expected=f"{interface} of FMI 2.0 or 3.0"
                + (", whose states an observer can set" if interface == MODEL_EXCHANGE else ""),
                remedy=f"export the model for {interface}"
                + (
                    "; with Co-Simulation alone these run: workbench simulate --estimator "
                    "open_loop, workbench fit, workbench diagnose"
                    if CO_SIMULATION in self.interfaces
                    else ""
                ),
            )
        if not {fmpy.platform, fmpy.platform_tuple} & set(self.platforms):
            raise InputError(
                where=str(self.path),
                found=f"binaries for {', '.join(self.platforms) or 'no platform'}",
                expected=f"a binary for this machine ({fmpy.platform_tuple})",
                remedy="export the model for this machine, or compile the FMU's sources if it has "
                "any, for instance with 'fmpy compile'",
            )
        self.library(interface)
        return self.interfaces[interface]

    def library(self, interface: str) -> str:
        """Name in the archive of this machine's binary for an interface."""
        file = f"{self.interfaces[interface].identifier}{fmpy.sharedLibraryExtension}"
        names = [f"binaries/{platform}/{file}" for platform in (fmpy.platform, fmpy.platform_tuple)]
        if library := next((name for name in names if self.binaries.get(name)), None):
            return library
        empty = next((name for name in names if name in self.binaries), None)
        raise InputError(
            where=str(self.path),
            found=f"an empty file {empty}" if empty else f"no file {' or '.join(names)}",
            expected="the binary that the model description names",
            remedy="export the model again",
        )


def read_description(path: Path) -> Description:
    """Read the model description of an FMU."""
    try:
        found_one = path.is_file()
    except OSError:  # of names that no file can have
        found_one = False
    if not found_one:
        raise InputError(
            where=str(path),
            found="no such file",
            expected="an FMU",
            remedy="give the path of one with --fmu"
            + ("" if CHECKOUT is None else ", or build the project's with 'make fmus'"),
        )
    # A name may get another content; times of change are good to some milliseconds.
    status = path.stat()
    return _read(path, (status.st_mtime_ns, status.st_ctime_ns, status.st_size, status.st_ino))


@lru_cache(maxsize=4)
def _read(path: Path, state: tuple[int, ...]) -> Description:
    """Read a file in the state that it has: of 100 000 variables that takes seconds."""
    with opened(path) as archive:
        files = {entry.filename: entry.file_size for entry in archive.infolist()}
        if DESCRIPTION not in files:
            raise damaged(path, f"it holds no {DESCRIPTION}")
        xml = archive.read(DESCRIPTION)
    try:
        _refuse_entities(xml)
        root = ElementTree.fromstring(xml)
    except Exception as error:  # anything that is no FMU
        raise damaged(path, error) from None
    try:
        with path.open("rb") as stream:  # FMPy leaves a file open that it opened and refused
            description = fmpy.read_model_description(stream, validate=False)
    except Exception as error:  # FMPy raises bare Exception
        raise _wrong(path, f"what FMI does not allow ({error})") from None
    if not re.fullmatch(r"2\.0|3\.0(\.\d+)?", description.fmiVersion):  # with its bug fixes
        raise InputError(
            where=str(path),
            found=f"FMI {description.fmiVersion}",
            expected="FMI 2.0 or 3.0",
            remedy="export the model for one of these versions",
        )
    try:
        return _description(path, description, root, files)
    except _WrongError as error:
        raise _wrong(path, str(error)) from None


def _wrong(path: Path, found: str) -> InputError:
    return InputError(
        where=f"{path}, {DESCRIPTION}",
        found=found,
        expected="a description as FMI asks for",
        remedy="export the model again, or report it to the exporter's makers",
    )


_VARIABILITIES = ("constant", "fixed", "tunable", "discrete", "continuous")
_LONGEST_NAME = 4096  # characters; those of nested models have hundreds
# Of terminals, and those that turn the direction in which text is shown.
_CONTROLS = re.compile("[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")
_MOST_ELEMENTS = 1_000_000  # of arrays; the variables of the largest models are 100 000


class _WrongError(ValueError):
    """What a model description has and must not, as a noun phrase."""


def _refuse_entities(xml: bytes) -> None:
    """Refuse a document type: FMI has none, and its entities can grow without bound."""

    def refuse(*_: object) -> None:
        raise ValueError("its model description declares a document type")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.Parse(xml, True)


def _description(
    path: Path,
    description: "fmpy.model_description.ModelDescription",
    root: ElementTree.Element,
    files: Mapping[str, int],
) -> Description:
    offered = {MODEL_EXCHANGE: root.find("ModelExchange"), CO_SIMULATION: root.find("CoSimulation")}
    experiment = description.defaultExperiment
    if not description.guid:
        raise _WrongError("an empty guid or instantiationToken, or none")
    places = [name.split("/") for name in files]
    _refuse_wrong_references(description.fmiVersion, root)
    _refuse_impossible(description, root)
    elements = {v.name: _elements(v) for v in description.modelVariables if v.dimensions}
    relative = _relative(root)
    variables = tuple(
        replace(variable, relative=v.name in relative)
        for v in description.modelVariables
        for variable in (_variable(v), *elements.get(v.name, ()))
    )

    def scalars(name: str) -> tuple[str, ...]:
        return tuple(v.name for v in elements[name]) if name in elements else (name,)

    if twice := [n for n, count in Counter(v.name for v in variables).items() if count > 1]:
        raise _WrongError(f"two variables '{twice[0]}'")
    _refuse_wrong_states(description)
    return Description(
        path=path,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        version=description.fmiVersion[:3],
        name=_one_line(description.modelName),
        text=_one_line(description.description),
        tool=_one_line(description.generationTool),
        token=description.guid,
        interfaces={
            name: _interface(tag, description.fmiVersion[:3])
            for name, tag in offered.items()
            if tag is not None
        },
        platforms=tuple(sorted({p[1] for p in places if p[0] == "binaries" and len(p) > 2})),
        binaries={name: size for name, size in files.items() if name.startswith("binaries/")},
        variables=variables,
        units={
            unit.name: _in_si(unit.baseUnit)
            for unit in description.unitDefinitions
            if unit.name and unit.baseUnit
        },
        states=tuple(
            name for u in description.derivatives for name in scalars(u.variable.derivative.name)
        ),
        rates=tuple(name for u in description.derivatives for name in scalars(u.variable.name)),
        dependencies={
            unknown.variable.name: tuple(known.name for known in unknown.dependencies)
            for unknown in (*description.derivatives, *description.outputs)
            if unknown.dependencies is not None
        },
        event_indicators=max(description.numberOfEventIndicators, len(description.eventIndicators)),
        start=_number(experiment.startTime, "the start time") if experiment else None,
        step=_number(experiment.stepSize, "the step size") if experiment else None,
        stop=_number(experiment.stopTime, "the stop time") if experiment else None,
    )


def _refuse_wrong_references(version: str, root: ElementTree.Element) -> None:
    """Refuse references that are no whole numbers as XML has them.

    Python reads more than these, such as 1_0, and takes places from 0 down as from the end.
    """
    for element in root.iter():
        for key in ("valueReference", "index", "derivative", "dependencies"):
            place = version == "2.0" and key != "valueReference"  # these count from 1
            for word in (element.get(key) or "").split():
                if not (word.isascii() and word.isdigit()) or (place and not word.strip("0")):
                    raise _WrongError(f"{key} = '{word[:40]}' of an element <{element.tag}>")


def _refuse_wrong_states(description: "fmpy.model_description.ModelDescription") -> None:
    """Refuse derivatives of nothing, of what is no state, and two of the same."""
    states = [unknown.variable.derivative for unknown in description.derivatives]
    for unknown, state in zip(description.derivatives, states, strict=True):
        name = unknown.variable.name
        if state is None:
            raise _WrongError(
                f"a derivative '{name}' in the model structure, which is the derivative of nothing"
            )
        if (state.variability or "continuous") != "continuous" or state.type not in _FLOATS:
            raise _WrongError(f"a derivative '{name}' of '{state.name}', which is no state")
        same = [other for other in states if other.valueReference == state.valueReference]
        if any(other is not state for other in same):
            names = " and ".join(f"'{other.name}'" for other in same)
            raise _WrongError(f"the states {names} with one value reference")
        if len(same) > 1:
            raise _WrongError(f"two derivatives of '{state.name}' in the model structure")


def _refuse_impossible(
    description: "fmpy.model_description.ModelDescription", root: ElementTree.Element
) -> None:
    """Refuse counts, factors and roles that no model has."""
    if not 0 <= description.numberOfEventIndicators <= _MOST_ELEMENTS:
        raise _WrongError(f"{description.numberOfEventIndicators} event indicators")
    for tag in ("BaseUnit", "DisplayUnit"):
        for unit in root.iter(tag):
            factor = _number(unit.get("factor"), f"the factor of a <{tag}>")
            _number(unit.get("offset"), f"the offset of a <{tag}>")
            if factor == 0.0:
                raise _WrongError(f"the factor 0 of a <{tag}>, a unit without size")
    count = sum(
        math.prod(max(length, 0) for length in v.shape)
        for v in description.modelVariables
        if v.dimensions
    )
    if count > _MOST_ELEMENTS:
        elements = str(count) if count < 10**18 else "more than 10^18"
        raise _WrongError(f"arrays with {elements} elements, where {_MOST_ELEMENTS} can be read,")
    for variable in description.modelVariables:
        if (variable.variability or "continuous") not in _VARIABILITIES:
            raise _WrongError(f"the variability '{variable.variability}' of '{variable.name}'")
        if any(length < 1 for length in variable.shape or ()):
            raise _WrongError(f"an array '{variable.name}' of the shape {variable.shape}")
        timed = variable.intervalVariability not in (None, "triggered")
        if variable.type == "Clock" and timed and variable.causality != "input":
            # FMI 3.0.2, section 2.2.8.3: clocks that follow time are inputs, which importers tick.
            raise _WrongError(f"a clock '{variable.name}' that follows time and is no input")
    for unknown in description.outputs:
        if unknown.variable.causality != "output":
            raise _WrongError(
                f"a {unknown.variable.causality} '{unknown.variable.name}' among the outputs of "
                "the model structure"
            )
    experiment = description.defaultExperiment
    if experiment is not None:
        step = _number(experiment.stepSize, "the step size")
        start = _number(experiment.startTime, "the start time") or 0.0
        stop = _number(experiment.stopTime, "the stop time")
        if step is not None and step <= 0.0:
            raise _WrongError(f"the step size {step:g} s")
        if stop is not None and stop < start:
            raise _WrongError(f"the stop time {stop:g} s before the start time {start:g} s")
        if stop is not None and math.isinf(stop - start):
            raise _WrongError(f"an experiment from {start:g} s to {stop:g} s, which has no length")


def _relative(root: ElementTree.Element) -> set[str]:
    """Names of variables that are differences, which FMPy 0.3.32 does not read."""
    types: set[str] = set()
    names: set[str] = set()
    for place in ("TypeDefinitions", "ModelVariables"):  # FMI 2.0 has attributes in an element more
        for tag in root.findall(f"{place}/*"):
            stated = [
                e.get("relativeQuantity") for e in (tag, *tag) if "relativeQuantity" in e.attrib
            ]
            declared = next(
                (e.get("declaredType") for e in (tag, *tag) if e.get("declaredType")), ""
            )
            if stated[0] in ("true", "1") if stated else declared in types:
                names.add(tag.get("name", ""))
        types, names = names, set()
    return types


def _in_si(base: "fmpy.model_description.BaseUnit") -> tuple[str, float, float]:
    """SI units as a product, 1 for none, how many of them a unit is, and its zero in them."""
    powers = {
        name: int(getattr(base, name)) for name in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    }
    factors = [name + f"{power}" * (power != 1) for name, power in powers.items() if power]
    return ".".join(factors) or "1", float(base.factor), float(base.offset or 0.0)


def _interface(element: ElementTree.Element, version: str) -> Interface:
    """Read capabilities from the XML, as FMPy 0.3.32 misses some of FMI 3.0."""

    def has(*names: str) -> bool:
        return any(element.get(name) in ("true", "1") for name in names)

    identifier = element.get("modelIdentifier", "")
    # It is the name of a file: none outside the folder of binaries.
    if not re.fullmatch(r"\w[\w.-]*", identifier):
        raise _WrongError(f"the modelIdentifier '{identifier[:80]}' of <{element.tag}>")
    return Interface(
        identifier=identifier,
        saves_state=has("canGetAndSetFMUstate", "canGetAndSetFMUState"),
        serialises_state=has("canSerializeFMUstate", "canSerializeFMUState"),
        directional_derivatives=has(
            "providesDirectionalDerivative", "providesDirectionalDerivatives"
        ),
        one_instance_per_process=has("canBeInstantiatedOnlyOncePerProcess"),
        completed_steps=has("needsCompletedIntegratorStep")
        if version == "3.0"
        else not has("completedIntegratorStepNotNeeded"),
        variable_steps=has("canHandleVariableCommunicationStepSize"),
        interpolates=version == "2.0" and has("canInterpolateInputs"),
    )


def _variable(variable: "fmpy.model_description.ModelVariable") -> Variable:
    declared = variable.declaredType
    real = variable.type in REAL_TYPES and not variable.dimensions
    name = variable.name
    if not name:
        raise _WrongError("a variable without a name")
    if len(name) > _LONGEST_NAME or _CONTROLS.search(name + (variable.unit or "")):
        raise _WrongError(
            f"the name '{name[:40]}' of {len(name)} characters, or with control characters"
        )
    if not 0 <= variable.valueReference < 2**32:
        raise _WrongError(f"the value reference {variable.valueReference} of '{name}'")
    if not variable.dimensions:
        _refuse_wrong_start(variable, variable.start)

    def limit(key: str) -> float | None:
        if variable.dimensions or variable.type in (*_NO_NUMBERS, "Boolean"):
            return None
        text = getattr(variable, key) or (getattr(declared, key) if declared else None)
        return _number(text, f"{key} of '{name}'", endless=key != "nominal")

    minimum, maximum = limit("min"), limit("max")
    if minimum is not None and maximum is not None and minimum > maximum:
        raise _WrongError(f"the range of '{name}', from {minimum:g} to {maximum:g}")
    # Another name in FMI 3.0, <Alias>: it is read under that, and set under the first alone.
    alias = getattr(variable, "alias", None) is not None and variable.causality != "independent"
    return Variable(
        name=name,
        reference=variable.valueReference,
        type=variable.type,
        real=real,
        causality="local" if alias else variable.causality,
        variability=variable.variability or "continuous",
        unit=variable.unit or (declared.unit if declared else None),
        start=None if variable.start is None else str(variable.start),
        nominal=limit("nominal"),
        minimum=minimum,
        maximum=maximum,
        text=_one_line(variable.description),
        array=bool(variable.dimensions),
        initial=variable.initial,
        items=_items(variable),
    )


def _refuse_wrong_start(
    variable: "fmpy.model_description.ModelVariable", start: str | None
) -> None:
    if variable.type not in (*_NO_NUMBERS, "Boolean"):
        _number(start, f"the start value of '{variable.name}'")


def _items(variable: "fmpy.model_description.ModelVariable") -> tuple[int, ...]:
    """Values of an enumeration, in its order; none of other types."""
    declared = variable.declaredType
    items = declared.items or [] if variable.type == "Enumeration" and declared else []
    try:
        return tuple(int(item.value) for item in items)
    except (TypeError, ValueError):
        raise _WrongError(f"an item of '{declared.name}' without a whole number") from None


def _elements(variable: "fmpy.model_description.ModelVariable") -> tuple[Variable, ...]:
    """Elements of an array, `x[1]` or `A[1,2]`, in the order in which FMI has their values."""
    array = _variable(variable)
    if not array.holds_number:
        return ()
    places = list(itertools.product(*(range(1, count + 1) for count in variable.shape)))
    starts: list[str | None] = list((array.start or "").split())
    if len(starts) != len(places):  # none, or one for all
        starts = [array.start] * len(places)
    for start in dict.fromkeys(starts):
        _refuse_wrong_start(variable, start)
    return tuple(
        replace(
            array,
            name=f"{array.name}[{','.join(map(str, place))}]",
            array=False,
            start=start,
            of=array.name,
            element=k,
            size=len(places),
        )
        for k, (place, start) in enumerate(zip(places, starts, strict=True))
    )


def _one_line(text: str | None) -> str:
    """A text for people, as one line that they can read."""
    return one_line(" ".join((text or "").split()))


def _number(text: str | float | None, name: str, *, endless: bool = False) -> float | None:
    """A number of the description, if there is one; endless ones only where they have a meaning."""
    if text is None:
        return None
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if isinstance(text, str) and ("_" in text or not text.isascii()):  # which Python reads
        number = math.nan
    if math.isnan(number) or (math.isinf(number) and not endless):
        raise _WrongError(f"{name} = '{str(text)[:40]}'")
    return number
