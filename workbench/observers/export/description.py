"""The model description of an FMU that takes samples: Co-Simulation alone, with their time."""

import xml.etree.ElementTree as ET

_OF_DERIVATIVES = (
    "providesDirectionalDerivative",
    "providesDirectionalDerivatives",
    "providesAdjointDerivatives",
)
_WITH_DERIVATIVES = (
    *("Derivatives", "InitialUnknowns"),  # of FMI 2.0
    *("ContinuousStateDerivative", "InitialUnknown"),  # of FMI 3.0
)


def co_simulated(description: str, sample_time: float) -> str:
    """A model description without Model Exchange, and with the time from sample to sample [s]."""
    root = ET.fromstring(description)
    for exchange in root.findall("ModelExchange"):
        root.remove(exchange)
    (experiment,) = root.findall("DefaultExperiment")
    experiment.set("stepSize", repr(sample_time))
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def sampled(description: str, sample_time: float) -> str:
    """The same of a law's FMU, whose states are what it shows, and have no derivatives."""
    root = ET.fromstring(description)
    (variables,) = root.findall("ModelVariables")
    (structure,) = root.findall("ModelStructure")
    for variable in list(variables):
        if variable.get("name", "").startswith("der("):
            variables.remove(variable)
    for part in list(structure):
        if part.tag in _WITH_DERIVATIVES:
            structure.remove(part)
    for part in root.iter():
        for name in ("dependencies", *_OF_DERIVATIVES):
            part.attrib.pop(name, None)
    used = {part.get("unit") for part in variables.iter()}
    (units,) = root.findall("UnitDefinitions")
    for unit in list(units):
        if unit.get("name") not in used:
            units.remove(unit)
    return co_simulated(ET.tostring(root, encoding="unicode"), sample_time)
