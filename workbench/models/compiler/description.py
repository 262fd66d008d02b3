"""modelDescription.xml of FMI 2.0 and FMI 3.0, stage 4 of the compiler."""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import pint

from workbench.errors import InputError
from workbench.models.compiler.ccode import GeneratedCode, identifier
from workbench.models.compiler.explicit import StateSpace
from workbench.models.compiler.flat import FlatVariable

_REGISTRY: "pint.UnitRegistry[float]" = pint.UnitRegistry()
_REGISTRY.define("@alias ohm = Ohm")  # as Modelica writes them
_REGISTRY.define("@alias turn = rev")
_BASE_UNITS = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "radian": "rad",
}
# What people read instead of the SI unit: (name, display = factor * SI).
_DISPLAY_UNITS = {"Pa": ("bar", 1e-5)}


@dataclass(frozen=True)
class _Entry:
    """A variable of the FMU; `row` and `column` are its places in the Jacobian, None if none."""

    name: str
    variable: FlatVariable
    unit: str | None
    causality: str
    variability: str
    initial: str | None
    start: bool
    reference: int
    row: int | None = None
    column: int | None = None
    derivative_of: int | None = None


def describe(
    model: StateSpace, code: GeneratedCode, token: str, fmi: int, tool: str, sources: Sequence[str]
) -> str:
    """Text of modelDescription.xml.

    Parameters
    ----------
    fmi : 2 or 3.
    tool : generation tool, with its version.
    sources : names of the C sources (FMI 2 lists them here).
    """
    entries = _entries(model)
    units = {e.unit: e.variable.place for e in reversed(entries) if e.unit}
    root = _root(model, token, fmi, tool, sources)
    if units:  # an empty list is not valid
        definitions = ET.SubElement(root, "UnitDefinitions")
        for unit, place in sorted(units.items()):
            _define_unit(definitions, unit, place)
    categories = ET.SubElement(root, "LogCategories")
    for name, text in (
        ("logAll", "All messages"),
        ("logStatusError", "Errors and discarded steps"),
    ):
        ET.SubElement(categories, "Category", name=name, description=text)
    begin = model.experiment.get("StartTime", 0.0)
    experiment = {
        "startTime": f"{begin:.17g}",
        "stopTime": repr(model.experiment.get("StopTime", begin + 1.0)),
        "tolerance": repr(model.experiment.get("Tolerance", 1e-6)),
    }
    if "Interval" in model.experiment:
        experiment["stepSize"] = repr(model.experiment["Interval"])
    ET.SubElement(root, "DefaultExperiment", experiment)
    variables = ET.SubElement(root, "ModelVariables")
    structure = ET.SubElement(root, "ModelStructure")
    for entry in entries:
        own, real = _attributes(entry), _real_attributes(entry)
        if fmi == 2:
            element = ET.SubElement(ET.SubElement(variables, "ScalarVariable", own), "Real", real)
        else:
            element = ET.SubElement(variables, "Float64", {**own, **real})
        if entry.derivative_of is not None:
            element.set("derivative", str(entry.derivative_of + (fmi == 2)))
    if fmi == 3:
        time = {"name": "time", "valueReference": str(len(entries)), "causality": "independent"}
        ET.SubElement(variables, "Float64", {**time, "variability": "continuous"})
    _structure(structure, entries, code, fmi)
    ET.indent(root, "  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _entries(model: StateSpace) -> list[_Entry]:
    """Variables in the order of their value references: x, der(x), u, p, w."""
    entries: list[_Entry] = []
    n, m = len(model.states), len(model.inputs)

    def add(
        variable: FlatVariable,
        causality: str,
        variability: str,
        initial: str | None,
        row: int | None = None,
        column: int | None = None,
    ) -> None:
        entries.append(
            _Entry(
                name=variable.name,
                variable=variable,
                unit=variable.unit,
                causality=causality,
                variability=variability,
                initial=initial,
                start=initial == "exact" or causality == "input",
                reference=len(entries),
                row=row,
                column=column,
            )
        )

    starts = zip(model.states, model.initial_states(), strict=True)
    for i, (state, start) in enumerate(starts):
        role = "output" if state.name in model.state_outputs else "local"
        add(replace(state, start=start), role, "continuous", "exact", column=i)
    for i, state in enumerate(model.states):
        entries.append(
            _Entry(
                name=f"der({state.name})",
                variable=state,
                unit=_rate_unit(state.unit),
                causality="local",
                variability="continuous",
                initial="calculated",
                start=False,
                reference=len(entries),
                row=i,
                derivative_of=i,
            )
        )
    for i, variable in enumerate(model.inputs):
        add(variable, "input", "continuous", None, column=n + i)
    for i, (variable, tunable) in enumerate(zip(model.parameters, model.tunable, strict=True)):
        variability = "tunable" if tunable else "fixed"
        add(variable, "parameter", variability, "exact", column=n + m + i)
    for i, variable in enumerate(model.outputs):
        add(variable, "output", "continuous", "calculated", row=n + i)
    return entries


def _root(model: StateSpace, token: str, fmi: int, tool: str, sources: Sequence[str]) -> ET.Element:
    """The description with both interfaces, which FMI 2 and 3 spell otherwise."""
    state, plural = ("state", "") if fmi == 2 else ("State", "s")
    attributes = {
        "fmiVersion": f"{fmi}.0",
        "modelName": model.name,
        "guid" if fmi == 2 else "instantiationToken": token,
        "description": model.description,
        "generationTool": tool,
        "variableNamingConvention": "structured",
        **({"numberOfEventIndicators": "0"} if fmi == 2 else {}),
    }
    common = {
        "modelIdentifier": identifier(model.name),
        f"canGetAndSetFMU{state}": "true",
        f"canSerializeFMU{state}": "true",
        f"providesDirectionalDerivative{plural}": "true",
        **({"providesAdjointDerivatives": "true"} if fmi == 3 else {}),
    }
    root = ET.Element("fmiModelDescription", attributes)
    stepping = {"canHandleVariableCommunicationStepSize": "true"}
    for name, own in (("ModelExchange", {}), ("CoSimulation", stepping)):
        interface = ET.SubElement(root, name, {**common, **own})
        if fmi == 2:
            files = ET.SubElement(interface, "SourceFiles")
            for source in sources:
                ET.SubElement(files, "File", name=source)
    return root


def base_units(unit: str, where: str = "") -> tuple[dict[str, int], float]:
    """Exponents of the SI base units (and rad) of a Modelica unit, and its factor to them.

    >>> base_units("N.m")
    ({'kg': 1, 'm': 2, 's': -2}, 1.0)
    >>> base_units("Ohm")
    ({'A': -2, 'kg': 1, 'm': 2, 's': -3}, 1.0)
    """
    exponents, zero, one = _in_base_units(unit, where)
    return exponents, one - zero


def _in_base_units(unit: str, where: str) -> tuple[dict[str, int], float, float]:
    """Exponents of the base units, and what 0 and 1 of a unit are in them."""
    spelled = re.sub(r"([A-Za-z])(-?\d+)", r"\1**\2", unit).replace(".", "*")
    try:
        parsed: Any = _REGISTRY.parse_units(spelled)
        zero, one, two = (_REGISTRY.Quantity(v, parsed).to_base_units() for v in (0.0, 1.0, 2.0))
        if not math.isclose(two.magnitude - one.magnitude, one.magnitude - zero.magnitude):
            raise ValueError("a logarithm")  # as dB
        powers: Any = one.unit_items()
        exponents = {_BASE_UNITS[str(name)]: int(power) for name, power in powers}
    except (pint.errors.PintError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            where=where or f"unit '{unit}'",
            found=f"unit '{unit}', which is not known ({error})",
            expected="an SI unit in Modelica's notation, such as N.m or kg.m2",
            remedy="correct the unit attribute",
        ) from None
    return dict(sorted(exponents.items())), float(zero.magnitude), float(one.magnitude)


def _define_unit(parent: ET.Element, unit: str, where: str) -> None:
    exponents, zero, one = _in_base_units(unit, where)
    element = ET.SubElement(parent, "Unit", name=unit)
    base = ET.SubElement(element, "BaseUnit", {k: str(v) for k, v in exponents.items()})
    if one - zero != 1.0:
        base.set("factor", repr(one - zero))
    if zero != 0.0:
        base.set("offset", repr(zero))
    if unit in _DISPLAY_UNITS:
        name, scale = _DISPLAY_UNITS[unit]
        ET.SubElement(element, "DisplayUnit", name=name, factor=repr(scale))


def _rate_unit(unit: str | None) -> str | None:
    """Unit of a time derivative: rad/s becomes rad/s2."""
    if unit is None:
        return None
    head, slash, tail = unit.partition("/")
    if not slash:
        return f"{head}/s"
    if match := re.fullmatch(r"s(\d*)", tail):
        return f"{head}/s{int(match[1] or 1) + 1}"
    return f"{head}/({tail.strip('()')}.s)"


def _attributes(entry: _Entry) -> dict[str, str]:
    attributes = {
        "name": entry.name,
        "valueReference": str(entry.reference),
        "causality": entry.causality,
        "variability": entry.variability,
    }
    derived = entry.derivative_of is not None
    if entry.initial:
        attributes["initial"] = entry.initial
    if derived:
        attributes["description"] = f"Time derivative of {entry.variable.name}"
    elif entry.variable.description:
        attributes["description"] = entry.variable.description
    return attributes


def _real_attributes(entry: _Entry) -> dict[str, str]:
    attributes: dict[str, str] = {}
    if entry.unit:
        attributes["unit"] = entry.unit
        if entry.unit in _DISPLAY_UNITS:
            attributes["displayUnit"] = _DISPLAY_UNITS[entry.unit][0]
    if entry.derivative_of is None:
        for name, value in (
            ("min", entry.variable.minimum),
            ("max", entry.variable.maximum),
            ("nominal", entry.variable.nominal),
        ):
            if value is not None:
                attributes[name] = repr(value)
    if entry.start:
        attributes["start"] = repr(entry.variable.start)
    return attributes


def _structure(
    parent: ET.Element, entries: Sequence[_Entry], code: GeneratedCode, fmi: int
) -> None:
    """Unknowns with the knowns that they depend on: FMI 2 has groups, and counts from 1."""
    outputs = [e for e in entries if e.causality == "output"]
    derivatives = [e for e in entries if e.derivative_of is not None]
    initial = [e for e in [*derivatives, *outputs] if e.initial == "calculated"]
    first, key = (1, "index") if fmi == 2 else (0, "valueReference")
    by_column = {e.column: e for e in entries if e.column is not None}
    by_row = ca.horzcat(code.jacobian_xu, code.jacobian_p).T
    starts, columns = by_row.colind(), by_row.row()
    for unknowns, whole, tag in (
        (outputs, "Outputs", "Output"),
        (derivatives, "Derivatives", "ContinuousStateDerivative"),
        (initial, "InitialUnknowns", "InitialUnknown"),
    ):
        group = parent
        if fmi == 2 and unknowns:
            group, tag = ET.SubElement(parent, whole), "Unknown"
            unknowns = sorted(unknowns, key=lambda entry: entry.reference)
        for entry in unknowns:
            knowns = [entry]  # an output that is a state
            if (row := entry.row) is not None:
                knowns = [by_column[c] for c in columns[starts[row] : starts[row + 1]]]
            if whole != "InitialUnknowns":
                knowns = [known for known in knowns if known.causality != "parameter"]
            numbers = " ".join(str(known.reference + first) for known in knowns)
            own = {key: str(entry.reference + first), "dependencies": numbers}
            ET.SubElement(group, tag, own)
