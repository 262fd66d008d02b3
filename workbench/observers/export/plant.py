"""The model of an estimator in C, and how its law sees it."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from workbench.errors import InputError
from workbench.models.compiler.ccode import generate
from workbench.models.compiler.explicit import StateSpace, make_explicit
from workbench.models.compiler.flat import flatten
from workbench.models.modelica import read_library
from workbench.observers import Estimator
from workbench.observers.export.translation.data import contents


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
