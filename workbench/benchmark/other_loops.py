"""Estimators as loops written another way, which the compiled ones are measured against.

The model alone is there for any system, with FMPy's own methods and numpy; a system's plugin may
have more.
"""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import POINTER, c_double
from types import ModuleType
from typing import Any

import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description

from workbench.arrays import Matrix, Vector
from workbench.models.fmu import FMU
from workbench.observers import Gains
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.system.plugins import find_plugin, load
from workbench.system.system import System

Loop = Callable[..., object]  # of time, u and y, as Estimator.run


@contextmanager
def by_fmpy(
    estimator: str, fmu: FMU, system: System, gains: Gains
) -> Iterator[Callable[..., Any] | None]:
    """The loop of an estimator with FMPy's methods and numpy; None where there is none.

    That of the model alone is there for any system.
    """
    if estimator == OpenLoop.name:
        with open_loop(fmu, system) as alone:
            yield alone
        return
    module = _loops(system)
    if module is None or estimator not in module.LOOPS:
        yield None
        return
    with module.by_fmpy(estimator, fmu, system, gains) as loop:
        yield loop


def by_c(estimator: str, fmu: FMU, system: System, gains: Gains) -> Loop | None:
    """The loop of an estimator in C without FMI; None where there is none."""
    module = _loops(system)
    return module.by_c(estimator, fmu, system, gains) if module else None


def _loops(system: System) -> ModuleType | None:
    module: ModuleType | None = load(find_plugin(system.plugin).loops)
    return module


@contextmanager
def open_loop(fmu: FMU, system: System) -> Iterator[Callable[[Vector, Matrix, Matrix], Matrix]]:
    """A loop like that of `OpenLoop`, over time, u and y; it returns outputs and reported, (n, k).

    Parameters
    ----------
    fmu : of FMI 2.0, whose file is loaded a second time.
    """
    description = read_model_description(str(fmu.path))
    known = {v.name: v.valueReference for v in description.modelVariables}
    rates = [unknown.variable for unknown in description.derivatives]
    states = [known[rate.derivative.name] for rate in rates]
    rows, n = [rate.valueReference for rate in rates], len(rates)

    def references(*names: str) -> list[int]:
        return [known[fmu.names.get(name, name)] for name in names]

    inputs = references(*(signal.name for signal in system.inputs))
    read = references(*(output.name for output in system.outputs), *system.reported)
    given = references(*system.given)
    places = [j for j, output in enumerate(system.outputs) if output.name in fmu.states]
    seen = references(*(system.outputs[j].name for j in places))
    x, dx = np.zeros(n), np.zeros(n)
    at_x, at_dx = (buffer.ctypes.data_as(POINTER(c_double)) for buffer in (x, dx))
    folder = extract(str(fmu.path))
    model = instantiate_fmu(folder, description, "ModelExchange")

    def begin(y: Vector) -> None:
        model.reset()
        model.setupExperiment()
        model.setReal([*given, *seen], [*system.given.values(), *y[places]])
        model.enterInitializationMode()
        model.exitInitializationMode()
        model.newDiscreteStates()
        model.enterContinuousTimeMode()
        model.getContinuousStates(at_x, n)

    def run(time: Vector, u: Matrix, y: Matrix) -> Matrix:
        begin(y[0])
        values = np.empty((time.size, len(read)))
        for k, h in enumerate(np.diff(time, prepend=time[0])):
            model.setReal(inputs, u[k])
            if h > 0.0:
                model.getDerivatives(at_dx, n)
                columns = [model.getDirectionalDerivative(rows, [j], [1.0]) for j in states]
                x[:] += np.linalg.solve(np.eye(n) - h * np.array(columns).T, h * dx)
                model.setContinuousStates(at_x, n)
            values[k] = model.getReal(read)
        return values

    try:
        yield run
    finally:
        model.terminate()
        model.freeInstance()
        shutil.rmtree(folder, ignore_errors=True)
