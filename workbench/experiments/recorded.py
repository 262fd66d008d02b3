"""Recordings that a model predicts of an experiment, as sensors would make them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workbench.case import Case, read_only
from workbench.conditions import Value
from workbench.errors import InputError
from workbench.experiments.candidates import Experiment
from workbench.fmu import CoSimulation, Matrix, Vector
from workbench.system import Condition, System
from workbench.system_conditions import LARGEST
from workbench.system_experiments import Experiments


def recorded(
    model: CoSimulation,
    system: System,
    experiments: Experiments,
    candidate: Experiment,
    values: Mapping[str, float],
    name: str,
    judged: tuple[str, ...],
    seed: int,
) -> Case:
    """What the sensors would record of an experiment if the model with these values were true.

    Inputs that a controller makes follow from the model's variables, anew in each of the blocks
    whose means are compared; those that a profile makes go from sample to sample in a line, of
    which a step of the model has the middle, unless they are held.

    Parameters
    ----------
    values : of the model's parameters, SI.
    judged : names of signals that are only there to judge by, and are recorded.
    seed : of the noise of the sensors.
    """
    h = system.sample_time
    time: Vector = h * np.arange(round(experiments.lasts / h) + 1.0)
    u, y = _driven(model, system, experiments, candidate, values, judged, time)
    time, rng = time[: len(y)], np.random.default_rng(seed)
    outputs = tuple(one.name for one in system.outputs)
    clean = dict(
        zip((*(one.name for one in system.inputs), *outputs, *judged), [*u.T, *y.T], strict=True)
    )
    signals = {
        key: read_only(
            column + system.signals[key].deviation(column) * rng.standard_normal(time.size)
        )
        for key, column in clean.items()
    }
    return Case(
        name=name,
        title=candidate.text(system),
        conditions=_conditions(system, candidate, clean),
        time=read_only(time),
        signals=signals,
        inputs=tuple(one.name for one in system.inputs),
        outputs=outputs,
        source=Path(name),
    )


def start_of(system: System, experiments: Experiments, candidate: Experiment) -> dict[str, float]:
    """States at the start of an experiment, SI."""
    known = {**system.values, **candidate.numbers}
    return {state: float(formula(known)) for state, formula in experiments.start.items()}


def _driven(
    model: CoSimulation,
    system: System,
    experiments: Experiments,
    candidate: Experiment,
    values: Mapping[str, float],
    judged: tuple[str, ...],
    time: Vector,
) -> tuple[Matrix, Matrix]:
    """Inputs (n, m) and readings (n, c) without noise, until the recording ends."""
    known: dict[str, Any] = {**system.values, **candidate.numbers}
    model.start(
        start_of(system, experiments, candidate),
        {key: value for key, value in values.items() if key in model.defaults},
    )
    names = [one.name for one in system.inputs]
    inputs = model.variables(names)
    read = model.variables(
        [system.signals[key].reading for key in (*(one.name for one in system.outputs), *judged)]
    )
    formulas = [*experiments.driven.values()]
    formulas += [experiments.ends.formula] if experiments.ends else []
    variables = {v.name for v in model.description.variables}
    felt = model.variables(sorted({key for one in formulas for key in one.names} & variables))
    u, y = np.zeros((time.size, len(names))), np.zeros((time.size, read.references.size))
    for one in candidate.profiles:
        u[:, names.index(one.input.name)] = one.signal(time)
    driven = [(names.index(key), formula) for key, formula in experiments.driven.items()]
    held = [j for j, one in enumerate(system.inputs) if one.held]
    h = float(time[1] - time[0])
    every = max(1, round(system.comparison.block / h))
    for k in range(time.size):
        if k > 0:
            for j, _ in driven:
                u[k, j] = u[k - 1, j]
            inputs.values[:] = 0.5 * (u[k - 1] + u[k])
            inputs.values[held] = u[k - 1, held]
            model.set(inputs, inputs.values)
            model.step(h)
        model.set(inputs, u[k])
        if k % every == 0:
            feels = {**known, **dict(zip(felt.names, model.get(felt).tolist(), strict=True))}
            for j, formula in driven:
                u[k, j] = formula(feels)
            model.set(inputs, u[k])
            ends = experiments.ends
            if ends is not None and abs(float(ends.formula(feels))) < ends.below:
                return u[:k], y[:k]
        y[k] = model.get(read)
    return u, y


def _conditions(
    system: System, candidate: Experiment, clean: Mapping[str, Vector]
) -> dict[str, Value]:
    """Conditions as they are set; others as the recording says, or the usual ones."""
    found: dict[str, Value] = {}
    for one in system.conditions:
        if one.name in candidate.settings:
            found[one.name] = candidate.settings[one.name].value
        elif one.choices:
            found[one.name] = (one.choices[0],) * one.count if one.count else one.choices[0]
        elif not one.sets:
            found[one.name] = _told(system, one, clean)
    return found


def _told(system: System, one: Condition, clean: Mapping[str, Vector]) -> float:
    """A quantity as a recording says it."""
    if one.agrees is None:
        raise InputError(
            where=f"{system.source}, [next.conditions]",
            found=f"no '{one.name}', of which no recording tells",
            expected="its values",
            remedy=f"add {one.name} = [...], or agrees = {{ is = ... }} to the condition",
        )
    values = system.evaluate(one.agrees.formula, clean)
    return float(values.max() if one.agrees.place == LARGEST else values[0])
