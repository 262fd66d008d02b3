"""Recordings that a model predicts of an experiment, as sensors would make them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.fmu import CoSimulation
from workbench.models.native import (
    OK,
    REFUSED,
    co_simulation_instance,
    compiled,
    do_step,
    raise_on_failure,
    read,
    set_inputs,
)
from workbench.recordings.case import Case, Value, make_case
from workbench.studies.design.candidates import Experiment
from workbench.system.parts import LARGEST, Condition
from workbench.system.system import System


def predict_recording(
    model: CoSimulation,
    system: System,
    candidate: Experiment,
    values: Mapping[str, float],
    references: tuple[str, ...],
    number: int,
) -> Case:
    """Simulate what the sensors would record of an experiment if the model were true.

    Inputs that a controller makes follow from the model's variables, anew in each of the blocks
    whose means are compared; those that a profile makes go from sample to sample in a line, of
    which a step of the model has the middle, unless they are `held`.

    Parameters
    ----------
    values : of the model's parameters, SI.
    references : names of the validation sensors that are recorded.
    number : of the recording; seeds the noise of the sensors.
    """
    u, y = _simulate(model, system, candidate, values, references)
    time, rng = system.sample_time * np.arange(float(len(y))), np.random.default_rng(number)
    names = [*(signal.name for signal in (*system.inputs, *system.outputs)), *references]
    clean = dict(zip(names, (*u.T, *y.T), strict=True))
    signals = {
        key: column + system.signals[key].deviation(column) * rng.standard_normal(time.size)
        for key, column in clean.items()
    }
    conditions = _conditions(system, candidate, clean)
    case = make_case(f"{number:03}", (time, signals), conditions, system)
    return replace(case, title=candidate.text(system), aids=())


def start_of(system: System, candidate: Experiment) -> dict[str, float]:
    """States at the start of an experiment, SI."""
    assert system.experiments is not None
    known = {**system.values, **candidate.numbers}
    return {state: float(formula(known)) for state, formula in system.experiments.start.items()}


def _simulate(
    model: CoSimulation,
    system: System,
    candidate: Experiment,
    values: Mapping[str, float],
    references: tuple[str, ...],
) -> tuple[Matrix, Matrix]:
    """Inputs (n, m) and readings (n, c) without noise, until the recording ends."""
    assert system.experiments is not None
    experiments, h = system.experiments, system.sample_time
    time: Vector = h * np.arange(round(experiments.lasts / h) + 1.0)
    known: dict[str, Any] = {**system.values, **candidate.numbers}
    model.start(
        start_of(system, candidate),
        {key: value for key, value in values.items() if key in model.defaults},
    )
    names = [signal.name for signal in system.inputs]
    outputs = [output.name for output in system.outputs]
    readings = [system.signals[key].reading for key in (*outputs, *references)]
    formulas = [*experiments.driven.values()]
    formulas += [experiments.ends.formula] if experiments.ends else []
    variables = {v.name for v in model.description.variables}
    felt = model.variables(
        sorted({key for formula in formulas for key in formula.names} & variables)
    )
    u, y = np.zeros((time.size, len(names))), np.zeros((time.size, len(readings)))
    for profile in candidate.profiles:
        u[:, names.index(profile.input.name)] = profile.signal(time)
    size = max(1, round(system.comparison.block / h))
    model.set(model.variables(names), u[0])
    running = co_simulation_instance(model, names, readings)
    for k in range(0, time.size, size):
        block = slice(k, k + size + 1)
        feels = {**known, **dict(zip(felt.names, model.get(felt).tolist(), strict=True))}
        for key, formula in experiments.driven.items():
            u[block, names.index(key)] = formula(feels)
        ends = experiments.ends
        if ends is not None and abs(float(ends.formula(feels))) < ends.below:
            return u[:k], y[:k]
        raise_on_failure(step_block(running, h, system.holds, u[block], y[block]), model)
    return u, y


@compiled
def step_block(model, h, holds, u, y):  # type: ignore[no-untyped-def]
    """Write readings y (n, c) for inputs u (n, m), samples h [s] apart; returns a status.

    A step from sample k - 1 to k is driven by (u_{k-1} + u_k) / 2 where holds, (m,), is 0, by
    u_{k-1} where it is 1, by u_k where it is -1.
    """
    m = u.shape[1]
    for k in range(len(u)):
        if k > 0:
            for j in range(m):
                model.u[j] = 0.5 * ((1.0 + holds[j]) * u[k - 1, j] + (1.0 - holds[j]) * u[k, j])
            if set_inputs(model, 0, m) or do_step(model, h):
                return REFUSED
        for j in range(m):
            model.u[j] = u[k, j]
        if set_inputs(model, 0, m) or read(model):
            return REFUSED
        for i in range(y.shape[1]):
            y[k, i] = model.y[i]
    return OK


def _conditions(
    system: System, candidate: Experiment, clean: Mapping[str, Vector]
) -> dict[str, Value]:
    """Conditions as they are set; others as the recording says, or the usual ones."""
    conditions: dict[str, Value] = {}
    for condition in system.conditions:
        if condition.name in candidate.settings:
            conditions[condition.name] = candidate.settings[condition.name].value
        elif condition.choices:
            conditions[condition.name] = (
                (condition.choices[0],) * condition.count
                if condition.count
                else condition.choices[0]
            )
        elif not condition.sets:
            conditions[condition.name] = _condition_value(system, condition, clean)
    return conditions


def _condition_value(system: System, condition: Condition, clean: Mapping[str, Vector]) -> float:
    """A quantity, by the formula that recordings must agree with."""
    if condition.agrees is None:
        raise InputError(
            where=f"{system.source}, [next.conditions]",
            found=f"no '{condition.name}', of which no recording tells",
            expected="its values",
            remedy=f"add {condition.name} = [...], or agrees = {{ is = ... }} to the condition",
        )
    values = system.evaluate(condition.agrees.formula, clean)
    return float(values.max() if condition.agrees.place == LARGEST else values[0])
