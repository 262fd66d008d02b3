"""An estimator to a Co-Simulation FMU: its law in C, sample by sample.

The law is translated from Python (`observers.export.translation`); the compiler makes C of the
model, and `law.c` takes the place of the integrator. Settings become constants, but gains that
stand in them as they are stay parameters; memory is a part of the FMU's state, so that nothing is
allocated after the start and a saved state has all of it.

What is remembered from the start, and which of it the first sample says, is found by starting the
estimator itself. What it begins with must be linear in the first sample, as a speed that is
measured and one that rolls along with it are.
"""

import copy
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models import native
from workbench.models.compiler import PLATFORMS, BuiltFMU, SteppingLaw, assemble
from workbench.models.compiler.ccode import generate
from workbench.models.compiler.explicit import StateSpace, make_explicit
from workbench.models.compiler.flat import FlatVariable, flatten
from workbench.models.fmu import FMU
from workbench.models.modelica import read_library
from workbench.models.native import Instance
from workbench.observers import Estimator
from workbench.observers.export.translation import (
    Array,
    Data,
    Number,
    Primitive,
    Program,
    Record,
    Several,
)
from workbench.observers.export.translation.values import DOUBLE, contents, literal, name_in_c


def plant_of(estimator: Estimator) -> StateSpace:
    """The model of an estimator from the library, with the outputs that its law reads."""
    system, fmu = estimator.system, estimator.fmu
    library = read_library(system.library).name
    name = f"{library}.{system.model(estimator.role).name}"
    space = make_explicit(flatten(system.library, name))
    states = [state.name for state in space.states]
    ours = [fmu.names.get(state, state) for state in fmu.states]
    known = {fmu.names.get(default, default) for default in fmu.defaults}
    missing = [
        variable.name
        for variable in (*space.parameters, *space.inputs)
        if variable.name not in known
    ]
    if states != ours or missing:
        raise InputError(
            where=fmu.place,
            found=f"no {missing[0]}" if missing else f"states {', '.join(ours)}",
            expected=f"what {name} has, {', '.join(missing or states)}",
            remedy="build the FMU from the library of the system",
        )
    if ca.depends_on(ca.vertcat(space.f, space.w), space.t):
        raise InputError(
            where=name,
            found="explicit time in the model",
            expected="a model of states, inputs and parameters: an exported law has no time",
            remedy="make what depends on time an input of the model",
        )
    listed = [output.name for output in space.outputs]
    read = [listed.index(name) for name in _read(estimator) if name not in states]
    return replace(
        space,
        w=ca.vertcat(ca.SX(0, 1), *(space.w[k] for k in read)),
        outputs=[space.outputs[k] for k in read],
        assertions=ca.SX(0, 1),
        assertion_texts=[],
    )


def plant_code(plant: StateSpace, estimator: Estimator) -> dict[str, str]:
    """Text of plant_code.h, the model, and of plant.h, how the law sees it."""
    code = generate(plant, "", "plant")
    fmu, system = estimator.fmu, estimator.system
    states, inputs = (
        [variable.name for variable in group] for group in (plant.states, plant.inputs)
    )
    known = [*(signal.name for signal in system.inputs), *system.corrections]
    outputs, unknown = [], [*range(len(states))]
    for column, name in enumerate(_read(estimator)):
        if name in states:
            outputs.append(-1 - states.index(name))
        else:
            outputs.append(len(unknown) - len(states))
            unknown.append(len(states) + column)
    ours = {theirs: name for name, theirs in fmu.names.items()}
    names = [ours.get(parameter.name, parameter.name) for parameter in plant.parameters]
    parameters = tuple(
        np.array([model.defaults[name] for name in names] or [0.0]) for model in estimator.models
    )
    sizes = {
        "NX": len(states),
        "NW": len(plant.outputs),
        "NNZ_XU": code.jacobian_xu.nnz(),
    }
    tables = [
        f"/* How a law sees the model {plant.name}. */",
        *(f"#define PLANT_{name} {size}" for name, size in sizes.items()),
        _whole("plant_input", [inputs.index(fmu.names.get(name, name)) for name in known]),
        _whole("plant_output", outputs),
        _whole("plant_unknown", unknown),
        f"static const double plant_parameter[][{parameters[0].size}] = {contents(parameters)};",
        "",
    ]
    return {"plant.h": "\n".join(tables), "plant_code.h": code.source}


def _read(estimator: Estimator) -> list[str]:
    """The model's names of outputs that the law reads."""
    system, fmu = estimator.system, estimator.fmu
    unseen = [output.name for output in system.outputs if output.name not in fmu.states]
    return [fmu.names.get(name, name) for name in (*system.reported, *unseen)]


def _whole(name: str, values: Sequence[int]) -> str:
    return f"static const int {name}[] = {contents(np.array(values or [0]))};"


_ROUNDING = 1e-9  # share of what is told apart: rounding is a millionth of it
_LARGEST = float(np.finfo(float).max) / 1e9  # sums of it are finite
_TRIALS = (1.0, -1.0, 10.0)  # samples at which what was found is tried, in sizes of signals


class ModelView(NamedTuple):
    """What a law sees of its model, see `Instance`, and where the model stands."""

    x: Vector
    dx: Vector
    u: Vector
    y: Vector
    jacobian: Matrix
    number: int  # of the model, where there are several
    # at_x, at_u: states and inputs of the model, all of them
    at_x: Vector
    at_u: Vector


class Remembered(NamedTuple):
    """All that a law remembers; `memory` is of the estimator's own kind."""

    model: tuple[ModelView, ...]
    memory: Any


@dataclass(frozen=True)
class FirstValue:
    """A number that the first sample says: constant + slopes @ [u, y]."""

    place: str  # in C
    constant: float
    slopes: Vector

    @property
    def text(self) -> str:
        """Statement in C that gives it its value."""
        terms = [literal(self.constant)] if self.constant else []
        for k in np.flatnonzero(self.slopes):
            slope = float(self.slopes[k])
            terms.append(f"sample[{k}]" if slope == 1.0 else f"{literal(slope)} * sample[{k}]")
        return f"{self.place} = {' + '.join(terms)};"


def memory_after(estimator: Estimator, sample: Vector) -> Remembered:
    """All that is remembered after a first sample, (m + l,)."""
    m = len(estimator.system.inputs)
    estimator.start(sample[:m], sample[m:])
    parts = estimator.parts
    _refuse_shared(estimator)
    both = zip(parts.models, estimator.models, strict=True)
    models = tuple(_model(model, fmu, number) for number, (model, fmu) in enumerate(both))
    return copy.deepcopy(Remembered(models, parts.state))


def usual_sample(estimator: Estimator) -> Vector:
    """A sample at which the model is valid, (m + l,): its own start."""
    system, defaults = estimator.system, estimator.fmu.defaults
    return np.array(
        [defaults.get(signal.name, 0.0) for signal in (*system.inputs, *system.outputs)]
    )


def values_of_first_sample(estimator: Estimator) -> list[FirstValue]:
    """What the first sample says, of all that is remembered.

    Raises
    ------
    InputError
        If that is not linear in the sample.
    """
    usual = usual_sample(estimator)
    signals = (*estimator.system.inputs, *estimator.system.outputs)
    sizes = np.array([abs(signal.scale) or 1.0 for signal in signals])
    places, begin = _flat(memory_after(estimator, usual))
    # By powers of two, so that what is measured is found without rounding where zero is usual.
    steps = 2.0 ** np.round(np.log2(sizes))
    moved = [_flat(memory_after(estimator, usual + step))[1] for step in np.diag(steps)]
    slopes = np.array([_change(begin, step) for step in moved]).T / steps
    whole = np.round(slopes)
    slopes = np.where(np.abs(slopes - whole) < _ROUNDING, whole, slopes)
    share = np.random.default_rng(0).uniform(0.5, 1.0, sizes.size)  # of each signal another one
    for trial in _TRIALS:
        change = trial * share * sizes
        changed = _change(begin, _flat(memory_after(estimator, usual + change))[1])
        large = np.abs(slopes) @ np.abs(change) + np.abs(np.where(np.isfinite(begin), begin, 0.0))
        if (bad := np.flatnonzero(np.abs(changed - slopes @ change) > _ROUNDING * large)).size:
            raise InputError(
                where=f"estimator {estimator.name}",
                found=f"{places[bad[0]]}, which is not linear in the first sample",
                expected="a start that follows the first sample linearly",
                remedy="let the law make it of the first sample, where h is 0",
            )
    return [
        FirstValue(places[k], _constant(begin[k], slopes[k], usual, sizes), slopes[k])
        for k in np.flatnonzero(slopes.any(axis=1))
    ]


def gains_in_settings(estimator: Estimator) -> dict[str, list[str]]:
    """Places in C among the settings, by gain; none if a gain does more than stand there as it is.

    That is found by making the estimator anew with other gains: a law whose settings and memory
    change by nothing else follows its gains when they change later.
    """
    system, gains, parts = estimator.system, estimator.gains, estimator.parts
    if parts.several or not gains.names:
        return {}
    # Of each gain another share and another zero, so that no two have one value.
    shares = np.random.default_rng(0).uniform(0.5, 1.0, (2, gains.values.size))
    others = gains.with_values(gains.values * shares[0] + 1e-9 * shares[1])
    moved = type(estimator)(estimator.fmu, system, others)
    sample = usual_sample(estimator)
    before, after = (_flat(memory_after(e, sample))[1] for e in (estimator, moved))
    numbers = list(_numbers(parts.settings, "settings"))
    changed = [number for _, number in _numbers(moved.parts.settings, "settings")]
    places: dict[str, list[str]] = {name: [] for name in gains.names}
    index = {value: k for k, value in enumerate(others.values.tolist())}
    for (place, number), other in zip(numbers, changed, strict=True):
        k = index.get(other)
        if k is not None and number == gains.values[k]:
            places[gains.names[k]].append(place)
        elif _change(np.array(number), np.array(other)) != 0.0:
            return {}
    return places if not np.any(_change(before, after)) and all(places.values()) else {}


def _change(before: Vector, after: Vector) -> Vector:
    """Difference; where one of them alone is no number, as large as a number can be."""
    same = (before == after) | (np.isnan(before) & np.isnan(after))
    with np.errstate(invalid="ignore"):
        return np.where(same, 0.0, np.nan_to_num(after - before, nan=_LARGEST))


def _constant(value: float, slopes: Vector, usual: Vector, sizes: Vector) -> float:
    constant = value - float(slopes @ usual)
    rounding = _ROUNDING * float(np.abs(slopes) @ (np.abs(usual) + sizes))
    return 0.0 if abs(constant) < rounding else constant


def _model(instance: Instance, fmu: FMU, number: int) -> ModelView:
    at_u = np.array([fmu.defaults.get(name, 0.0) for name in fmu.inputs])
    buffers = instance.x, instance.dx, instance.u, instance.y, instance.jacobian
    return ModelView(*buffers, number=number, at_x=fmu.get_states(), at_u=at_u)


def _refuse_shared(estimator: Estimator) -> None:
    """Refuse memory that is in two places, which would be two in C."""
    parts = estimator.parts
    arrays = [*_arrays(tuple(parts.settings)), *_arrays(tuple(map(tuple, parts.models)))]
    for array in _arrays(parts.state):
        if any(np.shares_memory(array, other) for other in arrays):
            raise InputError(
                where=f"estimator {estimator.name}",
                found="an array that stands in two places of its memory, or in its settings",
                expected="memory in which each array is another one",
                remedy="make two arrays",
            )
        arrays.append(array)


def _arrays(value: Any) -> Iterator[NDArray[Any]]:
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for entry in value:
            yield from _arrays(entry)


def _flat(value: Remembered) -> tuple[list[str], Vector]:
    """Places in C of all numbers, and the numbers, (n,)."""
    listed = list(_numbers(value, "law"))
    return [place for place, _ in listed], np.array([number for _, number in listed])


def _numbers(value: Any, place: str) -> Iterator[tuple[str, float]]:
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        mark = "->" if isinstance(value, Remembered) else "."
        for name, entry in zip(value._fields, value, strict=True):
            yield from _numbers(entry, f"{place}{mark}{name_in_c(name)}")
    elif isinstance(value, tuple | np.ndarray):
        listed = value.ravel().tolist() if isinstance(value, np.ndarray) else value
        for k, entry in enumerate(listed):
            yield from _numbers(entry, f"{place}[{k}]")
    elif isinstance(value, int | float | np.generic):  # all else is refused where it becomes C
        yield place, float(value)


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
