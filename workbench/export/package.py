"""An observer FMU beside the reference model in one package of SSP 1.0.

The readings of the rig's sensors go to the observer; pressure and drive torque go to both.
Source: Modelica Association, System Structure and Parameterization 1.0 (2019).
"""

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

from workbench.compiler.archive import pack
from workbench.description import CO_SIMULATION, read_description
from workbench.errors import InputError
from workbench.resources import fmus

_COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"
_STRUCTURE = "http://ssp-standard.org/SSP1/SystemStructureDescription"
_VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"

# Rolling at 120 km/h without slip, on rails that carry a stop; the pads differ from nominal, so
# that there is something to estimate.
_START = {
    "rig.omegaW": (120 / 3.6 / 0.46, "rad/s"),
    "rig.omegaR": (120 / 3.6 / 0.70, "rad/s"),
    "rig.muWR": (0.40, "1"),
    "rig.muDC": (0.33, "1"),
}
_START_FILE = "resources/start.ssv"

# Connectors of the two components: name -> (kind, unit).
_RIG = {
    "pB": ("input", "Pa"),
    "tauR": ("input", "N.m"),
    "omegaWReading": ("output", "rad/s"),
    "omegaRReading": ("output", "rad/s"),
    "FxReading": ("output", "N"),
    "slip": ("output", "m/s"),
}
_OBSERVER = {
    "pB": ("input", "Pa"),
    "tauR": ("input", "N.m"),
    "omegaW": ("input", "rad/s"),
    "omegaR": ("input", "rad/s"),
    "Fx": ("output", "N"),
    "slip": ("output", "m/s"),
    "muWR": ("output", "1"),
    "muDC": ("output", "1"),
    "omegaWEstimate": ("output", "rad/s"),
    "omegaREstimate": ("output", "rad/s"),
}
_SYSTEM = {
    "pB": ("input", "Pa"),
    "tauR": ("input", "N.m"),
    "Fx": ("output", "N"),
    "slip": ("output", "m/s"),
    **{f"{name}Estimate": _OBSERVER[name] for name in ("Fx", "slip", "muWR", "muDC")},
}
# From (component, connector) to (component, connector); the system itself has no name.
_CONNECTIONS = (
    *(("", name, to, name) for name in ("pB", "tauR") for to in ("rig", "observer")),
    ("rig", "omegaWReading", "observer", "omegaW"),
    ("rig", "omegaRReading", "observer", "omegaR"),
    ("rig", "FxReading", "", "Fx"),
    ("rig", "slip", "", "slip"),
    *(("observer", name, "", f"{name}Estimate") for name in ("Fx", "slip", "muWR", "muDC")),
)
# Exponents of the base units and factor.
_UNITS: Mapping[str, Mapping[str, str]] = {
    "1": {},
    "N": {"kg": "1", "m": "1", "s": "-2"},
    "N.m": {"kg": "1", "m": "2", "s": "-2"},
    "Pa": {"kg": "1", "m": "-1", "s": "-2"},
    "m/s": {"m": "1", "s": "-1"},
    "rad/s": {"rad": "1", "s": "-1"},
}


for _prefix, _namespace in (("ssc", _COMMON), ("ssd", _STRUCTURE), ("ssv", _VALUES)):
    ET.register_namespace(_prefix, _namespace)


def write_package(observer: Path, reference: Path, ssp: Path) -> None:
    """Write an SSP package of an observer and the reference model, whole or not at all.

    Parameters
    ----------
    observer, reference : FMUs (FMI 2.0), copied into the package.

    Raises
    ------
    InputError
        If an FMU is not of FMI 2.0 for Co-Simulation, or lacks a connector.
    """
    _check(reference, _RIG)
    _check(observer, _OBSERVER)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "resources").mkdir()
        for fmu in (observer, reference):
            (folder / "resources" / fmu.name).write_bytes(fmu.read_bytes())
        (folder / _START_FILE).write_text(_start_values())
        (folder / "SystemStructure.ssd").write_text(_structure(observer.name, reference.name))
        pack(folder, ssp)


def _check(fmu: Path, connectors: Mapping[str, tuple[str, str]]) -> None:
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
        remedy=f"take {fmus() / 'fmi2' / 'Reference.fmu'}, or a model with the same variables",
    )


def _structure(observer: str, reference: str) -> str:
    """Text of SystemStructure.ssd."""
    root = ET.Element(
        f"{{{_STRUCTURE}}}SystemStructureDescription", version="1.0", name="ObserverBesideReference"
    )
    text = "Rig and observer: pressure and drive torque in, forces and frictions out"
    system = _add(root, "System", name="stop", description=text)
    _add_connectors(system, _SYSTEM)
    bindings = _add(system, "ParameterBindings")
    _add(bindings, "ParameterBinding", source=_START_FILE)
    elements = _add(system, "Elements")
    for name, fmu, connectors in (("rig", reference, _RIG), ("observer", observer, _OBSERVER)):
        source = f"resources/{fmu}"
        component = _add(
            elements, "Component", name=name, source=source, implementation="CoSimulation"
        )
        _add_connectors(component, connectors)
    connections = _add(system, "Connections")
    for start_element, start, end_element, end in _CONNECTIONS:
        ends = {
            "startElement": start_element,
            "startConnector": start,
            "endElement": end_element,
            "endConnector": end,
        }
        _add(connections, "Connection", **{key: value for key, value in ends.items() if value})
    _add_units(_add(root, "Units"))
    _add(root, "DefaultExperiment", startTime="0.0", stopTime="20.0")
    return _text(root)


def _start_values() -> str:
    """Text of the file of start values."""
    root = ET.Element(f"{{{_VALUES}}}ParameterSet", version="1.0", name="start")
    parameters = ET.SubElement(root, f"{{{_VALUES}}}Parameters")
    for name, (value, unit) in _START.items():
        parameter = ET.SubElement(parameters, f"{{{_VALUES}}}Parameter", name=name)
        ET.SubElement(parameter, f"{{{_VALUES}}}Real", value=repr(value), unit=unit)
    _add_units(ET.SubElement(root, f"{{{_VALUES}}}Units"))
    return _text(root)


def _add(parent: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, f"{{{_STRUCTURE}}}{tag}", attributes)


def _add_connectors(parent: ET.Element, connectors: Mapping[str, tuple[str, str]]) -> None:
    group = _add(parent, "Connectors")
    for name, (kind, unit) in connectors.items():
        connector = _add(group, "Connector", name=name, kind=kind)
        ET.SubElement(connector, f"{{{_COMMON}}}Real", unit=unit)


def _add_units(parent: ET.Element) -> None:
    for name, exponents in _UNITS.items():
        unit = ET.SubElement(parent, f"{{{_COMMON}}}Unit", name=name)
        ET.SubElement(unit, f"{{{_COMMON}}}BaseUnit", dict(exponents))


def _text(root: ET.Element) -> str:
    ET.indent(root, "  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
