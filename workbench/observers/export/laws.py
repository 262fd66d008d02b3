"""An estimator to a Co-Simulation FMU: its law in C, sample by sample.

The law is translated from Python (`observers.export.translation`); the compiler makes C of the
model, and `law.c` takes the place of the integrator. Settings become constants, but gains that
stand in them as they are stay parameters; memory is a part of the FMU's state, so that nothing is
allocated after the start and a saved state has all of it.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import casadi as ca

from workbench.models import native
from workbench.models.compiler import PLATFORMS, BuiltFMU, SteppingLaw, assemble
from workbench.models.compiler.explicit import StateSpace
from workbench.models.compiler.flat import FlatVariable
from workbench.models.modelica import read_library
from workbench.observers import Estimator
from workbench.observers.export.beginning import (
    gains_in_settings,
    memory_after,
    usual_sample,
    values_of_first_sample,
)
from workbench.observers.export.plant import plant_code, plant_of
from workbench.observers.export.translation import (
    Array,
    Data,
    Number,
    Primitive,
    Program,
    Record,
    Several,
)
from workbench.observers.export.translation.data import contents
from workbench.observers.export.translation.values import DOUBLE

_HERE = Path(__file__).parent
_SOURCES = {"integrator.c": _HERE / "law.c", "memory.h": _HERE / "law.h"}

# Functions of the kernel that call the FMU, by the number of their arguments; law.c has them.
_CALLS = {
    "set_sample": 2,
    "set_point": 2,
    "set_inputs": 3,
    "set_states": 1,
    "place": 1,
    "evaluate": 1,
    "read": 1,
}
_CALLS |= {"differentiate": 3, "linearise": 2}


_OF_DERIVATIVES = (
    "providesDirectionalDerivative",
    "providesDirectionalDerivatives",
    "providesAdjointDerivatives",
)
_WITH_DERIVATIVES = (
    *("Derivatives", "InitialUnknowns"),  # of FMI 2.0
    *("ContinuousStateDerivative", "InitialUnknown"),  # of FMI 3.0
)


def model_name(estimator: Estimator) -> str:
    """Dotted name of an estimator's FMU."""
    system, own = estimator.system, type(estimator)
    name = system.export.classes.get(own.name, own.__name__)
    return f"{read_library(system.library).name}.{name}"


def build_observer(
    estimator: Estimator,
    fmu: Path,
    fmi: int,
    gains_file: str = "",
    report: Callable[[str], None] = lambda platform: None,
    platforms: Sequence[str] = tuple(PLATFORMS),
) -> BuiltFMU:
    """Compile an estimator with its gains to a Co-Simulation FMU.

    Parameters
    ----------
    estimator : on its FMU, which is started anew.
    fmu : file to write; written whole or not at all.
    fmi : 2 or 3.
    gains_file : text of gains.toml, kept in the FMU.
    report : called with the name of each platform when it is about to be compiled.
    platforms : names from `assembly.PLATFORMS`.

    Raises
    ------
    InputError
        If the law has what is not translated, with file and line; its memory has no fixed size, or
        does not follow the first sample linearly; its FMU is not of the system's library.
    """
    plant = plant_of(estimator)
    gains = gains_in_settings(estimator)
    stepped = SteppingLaw(
        sources=_SOURCES,
        tables={**plant_code(plant, estimator), **_law_code(estimator, gains)},
        described=lambda text: _description(text, estimator.system.sample_time),
        resources={"gains.toml": gains_file},
    )
    shell = replace(_shell(estimator, list(gains)), experiment=plant.experiment)
    return assemble(shell, fmu, fmi, platforms, stepped, report)


def _description(plain: str, sample_time: float) -> str:
    """The model description of an FMU that takes samples, from that of a model with states.

    Co-Simulation alone, with the time from sample to sample [s]; states are what it shows, and have
    no derivatives.
    """
    root = ET.fromstring(plain)
    (variables,) = root.findall("ModelVariables")
    (structure,) = root.findall("ModelStructure")
    (units,) = root.findall("UnitDefinitions")
    (experiment,) = root.findall("DefaultExperiment")
    derivatives = [v for v in variables if v.get("name", "").startswith("der(")]
    for part in derivatives:
        variables.remove(part)
    used = {part.get("unit") for part in variables.iter()}
    for whole, parts in (
        (root, root.findall("ModelExchange")),
        (structure, [part for part in structure if part.tag in _WITH_DERIVATIVES]),
        (units, [unit for unit in units if unit.get("name") not in used]),
    ):
        for part in parts:
            whole.remove(part)
    for part in root.iter():
        for name in ("dependencies", *_OF_DERIVATIVES):
            part.attrib.pop(name, None)
    experiment.set("stepSize", repr(sample_time))
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _law_code(estimator: Estimator, gains: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Text of law_data.h, sizes and structs, and of law_code.h, contents and functions.

    Parameters
    ----------
    gains : places in C among the settings, by gain that is a parameter.
    """
    begin, parts = memory_after(estimator, usual_sample(estimator)), estimator.parts
    data = Data(f"estimator {estimator.name}")
    of_settings = data.type_of(parts.settings, "settings")
    of_memory = data.type_of(begin.memory, "memory")
    models = data.type_of(begin.model, "model")
    assert isinstance(of_settings, Record)
    assert isinstance(of_memory, Record)
    assert isinstance(models, Several)
    sizes = _sizes(estimator)
    measured = [  # inputs and time, outputs
        Array(DOUBLE, (size,), (1,), constant=True)
        for size in (sizes["INPUTS"] + 1, sizes["OUTPUTS"])
    ]
    row = Array(DOUBLE, (sizes["ROW"],), (1,), constant=False)
    program = Program(
        {
            getattr(native, name).py_func: Primitive(f"plant_{name}", count)
            for name, count in _CALLS.items()
        }
    )
    step = program.add(
        parts.step,
        [
            models if parts.several else models.of,
            replace(of_settings, constant=True),
            of_memory,
            Number(DOUBLE),
            *measured,
            row,
        ],
    )
    settings = "settings" if gains else "law_settings"
    named = f"typedef {of_settings.name} LawSettings_;\ntypedef {of_memory.name} LawMemory_;\n"
    header = [
        f"/* Sizes and structs of the law of {estimator.name}. */",
        *(f"#define LAW_{name} {size}" for name, size in sizes.items()),
        *("", data.definitions(), named),
    ]
    code = [
        f"/* The law of {estimator.name}, translated from Python. */",
        f"static const LawSettings_ law_settings = {contents(parts.settings)};",
        "",
        f"static const Law law_start = {contents(begin)};",
        "",
        f"static const double law_bands[] = {contents(estimator.bands)};",
        "",
        program.text(step),
        "static void estimator_begin(Law *law, const double *sample) {",
        "    *law = law_start;",
        *(f"    {assignment.text}" for assignment in values_of_first_sample(estimator)),
        "}",
        "",
        "static int estimator_step(Law *law, double h, const double *sample, const double *gain,",
        "                          double *row) {",
        *(["    LawSettings_ settings = law_settings;"] if gains else ["    (void)gain;"]),
        *(
            f"    {place} = gain[{k}];"
            for k, places in enumerate(gains.values())
            for place in places
        ),
        "    const double *const y = sample + LAW_INPUTS;",
        "    double u[LAW_INPUTS + 1] = {0.0};  /* the plant has no explicit time */",
        "    memcpy(u, sample, LAW_INPUTS * sizeof *u);",
        f"    int status = {step}(law->model, &{settings}, &law->memory, h, u, y, row);",
        f"    for (int k = 0; k < {estimator.bands.size}; k++) {{",
        f"        row[{estimator.bands.size} + k] *= law_bands[k];",
        "    }",
        "    return status;",
        "}",
        "",
    ]
    return {"law_data.h": "\n".join(header), "law_code.h": "\n".join(code)}


def _sizes(estimator: Estimator) -> dict[str, int]:
    """Sizes that law.c asks for."""
    system, parts = estimator.system, estimator.parts
    instance = parts.models[0]
    knowns, unknowns = instance.jacobian.shape
    return {
        "MODELS": len(parts.models),
        "INPUTS": len(system.inputs),
        "OUTPUTS": len(system.outputs),
        "ROW": parts.width,
        "SET": instance.u.size,
        "READ": instance.y.size,
        "KNOWNS": knowns,
        "UNKNOWNS": unknowns,
    }


def _shell(estimator: Estimator, gains: Sequence[str]) -> StateSpace:
    """The FMU as other tools see it: samples are inputs, entries of an estimate are its states."""
    meanings = estimator.meanings(estimator.fmu, estimator.system, estimator.gains)
    parameters = []
    for name in gains:
        meaning, unit = meanings.get(name, (name, "1"))
        parameters.append(_variable(name, unit, f"Gain: {meaning}", estimator.gains[name]))
    system, defaults = estimator.system, estimator.fmu.defaults
    inputs = [
        _variable(
            signal.name, signal.unit, f"Measured: {signal.label}", defaults.get(signal.name, 0.0)
        )
        for signal in (*system.inputs, *system.outputs)
    ]
    states = _entries(estimator)
    x, u, p = (
        ca.vertcat(ca.SX(0, 1), *(variable.symbol for variable in group))
        for group in (states, inputs, parameters)
    )
    nothing = ca.SX(0, 1)
    return StateSpace(
        name=model_name(estimator),
        description=f"{estimator.label[0].upper()}{estimator.label[1:]}: {system.title}",
        experiment={},
        t=ca.SX.sym("time"),
        x=x,
        u=u,
        p=p,
        f=ca.SX.zeros(len(states), 1),
        w=nothing,
        assertions=nothing,
        assertion_texts=[],
        states=states,
        inputs=inputs,
        parameters=parameters,
        tunable=[False] * len(parameters),
        outputs=[],
        state_outputs=[state.name for state in states],
    )


def _entries(estimator: Estimator) -> list[FlatVariable]:
    """Entries of an estimate: values, standard deviations, probabilities, and the innovation."""
    system, defaults = estimator.system, estimator.fmu.defaults
    seen = {output.name: f"{output.name}Estimate" for output in system.outputs}
    ranges = {
        quantity.name: (_finite(quantity.low), _finite(quantity.high))
        for quantity in system.estimated
    }
    values = [
        _variable(
            seen.get(name, name),
            unit,
            f"Estimate of {name}",
            defaults.get(name, 0.0),
            ranges.get(name, (None, None)),
        )
        for name, unit in system.columns.items()
    ]
    deviations = [
        _variable(f"sigma_{name}", unit, f"Standard deviation of {name}")
        for name, unit in system.columns.items()
    ]
    modes = [
        _variable(f"probability_{mode}", "1", f"Probability of {mode}") for mode in estimator.modes
    ]
    return [*values, *deviations, *modes, _variable("nis", "1", "Normalised innovation squared")]


def _finite(limit: float) -> float | None:
    return limit if math.isfinite(limit) else None


def _variable(
    name: str,
    unit: str,
    description: str,
    start: float = 0.0,
    limits: tuple[float | None, float | None] = (None, None),
) -> FlatVariable:
    return FlatVariable(name, ca.SX.sym(name), start, unit, description, *limits, nominal=None)
