"""What an FMU says of itself, stage 2: identity, interfaces, platforms, variables."""

import hashlib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import fmpy

from workbench.errors import InputError, closest
from workbench.resources import CHECKOUT

MODEL_EXCHANGE = "Model Exchange"
CO_SIMULATION = "Co-Simulation"


@dataclass(frozen=True)
class Interface:
    """Model Exchange or Co-Simulation, as one FMU offers it; flags as in FMI's description."""

    identifier: str
    saves_state: bool
    serialises_state: bool
    directional_derivatives: bool
    needs_execution_tool: bool
    one_instance_per_process: bool


@dataclass(frozen=True)
class Variable:
    """One variable; `start` as written, None where the description has none.

    Attributes
    ----------
    real : a scalar of type Real (FMI 2.0) or Float64 (FMI 3.0).
    nominal, minimum, maximum : in `unit`, None where the description has none.
    """

    name: str
    reference: int
    type: str
    real: bool
    causality: str
    variability: str
    unit: str | None
    start: str | None
    nominal: float | None
    minimum: float | None
    maximum: float | None
    text: str


@dataclass(frozen=True)
class Description:
    """The model description of an FMU and what its archive holds.

    Attributes
    ----------
    sha256 : hash of the file, its identity in results.
    version : of FMI, "2.0" or "3.0".
    token : GUID or instantiation token.
    interfaces : by name, MODEL_EXCHANGE and CO_SIMULATION.
    platforms : those with a binary, in FMI's names.
    states, rates : names of the continuous states and their derivatives, in FMI's order.
    event_indicators : their number; 0 for a smooth model.
    step, stop : of the default experiment [s], None where there is none.
    """

    path: Path
    sha256: str
    version: str
    name: str
    text: str
    tool: str
    token: str
    interfaces: Mapping[str, Interface]
    platforms: tuple[str, ...]
    variables: tuple[Variable, ...]
    states: tuple[str, ...]
    rates: tuple[str, ...]
    event_indicators: int
    step: float | None
    stop: float | None

    def names(self, causality: str) -> tuple[str, ...]:
        """Names of the variables of a causality, in the order of the model description."""
        return tuple(v.name for v in self.variables if v.causality == causality)

    def renamed(self, names: Mapping[str, str]) -> "Description":
        """The same description with other names.

        A variable whose own name is given to another one is called `fmu.NAME` from then on.

        Parameters
        ----------
        names : new names and the FMU's own, such as {"p": "pressure"}.

        Raises
        ------
        InputError
            If the FMU has no variable of a name.
        """
        own = {variable.name for variable in self.variables}
        for ours, theirs in names.items():
            if theirs not in own:
                raise InputError(
                    where=str(self.path),
                    found=f"no variable '{theirs}'{closest(theirs, own)}",
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
        )

    def require(self, interface: str) -> Interface:
        """Interface of a name, with a binary for this machine.

        Raises
        ------
        InputError
            If the FMU has no such interface, or no binary for this machine.
        """
        if interface not in self.interfaces:
            raise InputError(
                where=str(self.path),
                found=f"FMI {self.version}, {', '.join(self.interfaces) or 'no interface'} only",
                expected=f"{interface} of FMI 2.0 or 3.0"
                + (", whose states an observer can set" if interface == MODEL_EXCHANGE else ""),
                remedy=f"export the model for {interface}",
            )
        if not {fmpy.platform, fmpy.platform_tuple} & set(self.platforms):
            raise InputError(
                where=str(self.path),
                found=f"binaries for {', '.join(self.platforms) or 'no platform'}",
                expected=f"a binary for this machine ({fmpy.platform_tuple})",
                remedy="compile the FMU's sources, for instance with 'fmpy compile'",
            )
        return self.interfaces[interface]


def read_description(path: Path) -> Description:
    """Read the model description of an FMU.

    Raises
    ------
    InputError
        If the file is no FMU of FMI 2.0 or 3.0.
    """
    if not path.is_file():
        raise InputError(
            where=str(path),
            found="no such file",
            expected="an FMU",
            remedy="give the path of one with --fmu"
            + ("" if CHECKOUT is None else ", or build the project's with 'make fmus'"),
        )
    try:
        found = fmpy.read_model_description(str(path), validate=False)
        with zipfile.ZipFile(path) as archive:
            files = [Path(name).parts for name in archive.namelist()]
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    except Exception as error:  # FMPy raises bare Exception for anything that is no FMU
        raise InputError(
            where=str(path),
            found=f"a file that is no FMU ({error})",
            expected="an FMU of FMI 2.0 or 3.0",
            remedy="export the model again",
        ) from None
    if found.fmiVersion not in ("2.0", "3.0"):
        raise InputError(
            where=str(path),
            found=f"FMI {found.fmiVersion}",
            expected="FMI 2.0 or 3.0",
            remedy="export the model for one of these versions",
        )
    offered = {MODEL_EXCHANGE: root.find("ModelExchange"), CO_SIMULATION: root.find("CoSimulation")}
    experiment = found.defaultExperiment
    return Description(
        path=path,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        version=found.fmiVersion,
        name=found.modelName,
        text=found.description or "",
        tool=found.generationTool or "",
        token=found.guid,
        interfaces={name: _interface(tag) for name, tag in offered.items() if tag is not None},
        platforms=tuple(sorted({f[1] for f in files if f[0] == "binaries" and len(f) > 2})),
        variables=tuple(_variable(v) for v in found.modelVariables),
        states=tuple(unknown.variable.derivative.name for unknown in found.derivatives),
        rates=tuple(unknown.variable.name for unknown in found.derivatives),
        event_indicators=max(found.numberOfEventIndicators, len(found.eventIndicators)),
        step=_number(experiment.stepSize) if experiment else None,
        stop=_number(experiment.stopTime) if experiment else None,
    )


def _interface(element: ElementTree.Element) -> Interface:
    """Read capabilities from the XML, as FMPy 0.3.32 misses some of FMI 3.0."""

    def has(*names: str) -> bool:
        return any(element.get(name) in ("true", "1") for name in names)

    return Interface(
        identifier=element.attrib["modelIdentifier"],
        saves_state=has("canGetAndSetFMUstate", "canGetAndSetFMUState"),
        serialises_state=has("canSerializeFMUstate", "canSerializeFMUState"),
        directional_derivatives=has(
            "providesDirectionalDerivative", "providesDirectionalDerivatives"
        ),
        needs_execution_tool=has("needsExecutionTool"),
        one_instance_per_process=has("canBeInstantiatedOnlyOncePerProcess"),
    )


def _variable(variable: "fmpy.model_description.ModelVariable") -> Variable:
    declared = variable.declaredType
    return Variable(
        name=variable.name,
        reference=variable.valueReference,
        type=variable.type,
        real=variable.type in ("Real", "Float64") and not variable.dimensions,
        causality=variable.causality,
        variability=variable.variability or "continuous",
        unit=variable.unit or (declared.unit if declared else None),
        start=None if variable.start is None else str(variable.start),
        nominal=_number(variable.nominal or (declared.nominal if declared else None)),
        minimum=_number(variable.min or (declared.min if declared else None)),
        maximum=_number(variable.max or (declared.max if declared else None)),
        text=variable.description or "",
    )


def _number(text: str | None) -> float | None:
    return None if text is None else float(text)
