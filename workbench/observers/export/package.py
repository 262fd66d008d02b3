"""An observer FMU beside the reference model in one package of SSP 1.0.

The readings of the sensors go to the observer; measured inputs go to both.
Source: Modelica Association, System Structure and Parameterization 1.0 (2019).
"""

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from workbench.errors import InputError
from workbench.models.compiler.assembly import pack
from workbench.models.compiler.description import base_units
from workbench.models.description import CO_SIMULATION, read_description
from workbench.system.system import System

_COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"
_STRUCTURE = "http://ssp-standard.org/SSP1/SystemStructureDescription"
_VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"

_START_FILE = "resources/start.ssv"
_MACHINE, _OBSERVER = "machine", "observer"  # names of the two components

Connectors: TypeAlias = Mapping[str, tuple[str, str]]  # (kind, unit) by name
# From (component, connector) to (component, connector); the whole has no name.
Connection: TypeAlias = tuple[str, str, str, str]


@dataclass(frozen=True)
class Wiring:
    """What is connected to what."""

    # machine, observer, whole: connectors of the two components, and of both together
    machine: Connectors
    observer: Connectors
    whole: Connectors
    connections: tuple[Connection, ...]  # of these


def wiring(system: System) -> Wiring:
    """Connectors and connections by the signals of a system.

    An observer gives its estimate of an output `y` as `yEstimate`, and other estimates under their
    own names; the package gives estimates as `nameEstimate`, beside the truth of the machine.
    """
    inputs = {signal.name: ("input", signal.unit) for signal in system.inputs}
    outputs = {output.name: ("input", output.unit) for output in system.outputs}
    estimates = {
        **system.reported,
        **{quantity.name: quantity.unit for quantity in system.estimated},
    }
    seen = {f"{output.name}Estimate": output.unit for output in system.outputs}
    readings = {
        signal.reading: signal.unit for signal in (*system.outputs, *system.reference_signals)
    }
    shown = {signal.name: (signal.reading, signal.unit) for signal in system.reference_signals}
    shown |= {name: (name, unit) for name, unit in system.reported.items() if name not in shown}
    truth = {reading: unit for reading, unit in shown.values()}
    return Wiring(
        machine=inputs | _output_connectors({**readings, **truth}),
        observer=inputs | outputs | _output_connectors({**estimates, **seen}),
        whole=inputs
        | _output_connectors({name: unit for name, (_, unit) in shown.items()})
        | _output_connectors({f"{name}Estimate": unit for name, unit in estimates.items()}),
        connections=(
            *(("", name, to, name) for name in inputs for to in (_MACHINE, _OBSERVER)),
            *((_MACHINE, output.reading, _OBSERVER, output.name) for output in system.outputs),
            *((_MACHINE, reading, "", name) for name, (reading, _) in shown.items()),
            *((_OBSERVER, name, "", f"{name}Estimate") for name in estimates),
        ),
    )


def _output_connectors(units: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    return {name: ("output", unit) for name, unit in units.items()}


for _prefix, _namespace in (("ssc", _COMMON), ("ssd", _STRUCTURE), ("ssv", _VALUES)):
    ET.register_namespace(_prefix, _namespace)


def write_package(system: System, observer: Path, reference: Path, ssp: Path) -> None:
    """Write an SSP package of an observer and the reference model, whole or not at all.

    Parameters
    ----------
    observer, reference : FMUs (FMI 2.0), copied into the package.

    Raises
    ------
    InputError
        If an FMU is not of FMI 2.0 for Co-Simulation, or lacks a connector.
    """
    wired = wiring(system)
    _check(reference, wired.machine)
    _check(observer, wired.observer)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "resources").mkdir()
        for fmu in (observer, reference):
            (folder / "resources" / fmu.name).write_bytes(fmu.read_bytes())
        (folder / _START_FILE).write_text(_start_values(system))
        structure = _structure(wired, observer.name, reference.name)
        (folder / "SystemStructure.ssd").write_text(structure)
        pack(folder, ssp)


def _check(fmu: Path, connectors: Connectors) -> None:
    """Refuse an FMU that the package cannot connect."""
    description = read_description(fmu)
    causality = {variable.name: variable.causality for variable in description.variables}
    if not description.version.startswith("2.") or CO_SIMULATION not in description.interfaces:
        found = f"FMI {description.version}, {' and '.join(description.interfaces)}"
    else:
        wrong = [name for name, (kind, _) in connectors.items() if causality.get(name) != kind]
        if not wrong:
            return
        found = f"no {connectors[wrong[0]][0]} '{wrong[0]}'"
    raise InputError(
        where=str(fmu),
        found=found,
        expected=f"FMI 2.0, Co-Simulation, with {', '.join(connectors)}",
        remedy="take the reference model of the system, or one with the same variables",
    )


def _structure(wired: Wiring, observer: str, reference: str) -> str:
    """Text of SystemStructure.ssd."""
    root = ET.Element(
        f"{{{_STRUCTURE}}}SystemStructureDescription", version="1.0", name="ObserverBesideReference"
    )
    text = "Machine and observer: measured inputs in, truth and estimates out"
    whole = _add(root, "System", name="whole", description=text)
    _add_connectors(whole, wired.whole)
    bindings = _add(whole, "ParameterBindings")
    _add(bindings, "ParameterBinding", source=_START_FILE)
    elements = _add(whole, "Elements")
    for name, fmu, connectors in (
        (_MACHINE, reference, wired.machine),
        (_OBSERVER, observer, wired.observer),
    ):
        source = f"resources/{fmu}"
        component = _add(
            elements, "Component", name=name, source=source, implementation="CoSimulation"
        )
        _add_connectors(component, connectors)
    connections = _add(whole, "Connections")
    for start_element, start, end_element, end in wired.connections:
        ends = {
            "startElement": start_element,
            "startConnector": start,
            "endElement": end_element,
            "endConnector": end,
        }
        _add(connections, "Connection", **{key: value for key, value in ends.items() if value})
    all_connectors = {**wired.machine, **wired.observer, **wired.whole}.values()
    _add_units(_add(root, "Units"), {unit for _, unit in all_connectors})
    _add(root, "DefaultExperiment", startTime="0.0", stopTime="20.0")
    return _text(root)


def _start_values(system: System) -> str:
    """Text of the file of start values."""
    start = system.export.start
    held = {name: float(formula(system.values)) for name, formula in start.held.items()}
    measured = [output.name for output in system.outputs if output.name in held]
    values = {(_MACHINE, name): value for name, value in (held | dict(start.quantities)).items()}
    values |= {(_OBSERVER, name): held[name] for name in measured}  # its first sample
    units = {name: system.unit(name) for _, name in values}
    root = ET.Element(f"{{{_VALUES}}}ParameterSet", version="1.0", name="start")
    parameters = ET.SubElement(root, f"{{{_VALUES}}}Parameters")
    for (component, name), value in values.items():
        parameter = ET.SubElement(parameters, f"{{{_VALUES}}}Parameter", name=f"{component}.{name}")
        ET.SubElement(parameter, f"{{{_VALUES}}}Real", value=repr(value), unit=units[name])
    _add_units(ET.SubElement(root, f"{{{_VALUES}}}Units"), set(units.values()))
    return _text(root)


def _add(parent: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, f"{{{_STRUCTURE}}}{tag}", attributes)


def _add_connectors(parent: ET.Element, connectors: Connectors) -> None:
    group = _add(parent, "Connectors")
    for name, (kind, unit) in connectors.items():
        connector = _add(group, "Connector", name=name, kind=kind)
        ET.SubElement(connector, f"{{{_COMMON}}}Real", unit=unit)


def _add_units(parent: ET.Element, units: Set[str]) -> None:
    for name in sorted(units):
        exponents, factor = base_units(name)
        assert factor == 1.0, name  # units of a system's signals are SI
        unit = ET.SubElement(parent, f"{{{_COMMON}}}Unit", name=name)
        powers = {base: str(power) for base, power in exponents.items()}
        ET.SubElement(unit, f"{{{_COMMON}}}BaseUnit", powers)


def _text(root: ET.Element) -> str:
    ET.indent(root, "  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
