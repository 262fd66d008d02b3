"""One stop on the model: from the command to standstill, in a compiled loop.

What drives the model is known in time or along the way, so that a stop needs nothing but the FMU.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.simulation.steps import restart, steps
from workbench.diagnosis.simulation.steps import step as advance
from workbench.errors import FMUError
from workbench.models.fmu import FMU
from workbench.models.native import (
    MOVED,
    OK,
    check_state_events,
    compiled,
    instance,
    place,
    raise_on_failure,
    read,
)
from workbench.system.stopping import Stopping
from workbench.system.system import System

GRID = 5.0  # [m] between two values of what drives the model along the way; shorter than a vehicle
_MOVING = MOVED + 1  # status: not at rest when the time was over


@dataclass(frozen=True, eq=False)
class DrivingInputs:
    """What drives a model in a stop: each input rises in time to a value, or goes along the way."""

    to: Vector  # (m,) values that inputs rise to [unit]
    # delay, lag: (m,) [s] after the command, of first order; both 0 of what is constant
    delay: Vector
    lag: Vector
    along: Matrix  # (m, g) what is added at the places of the way, every GRID [unit]


@dataclass(frozen=True, eq=False)
class StopResult:
    """One stop."""

    distance: float  # from the command to standstill [m]
    time: float  # until then [s]
    outputs: Matrix  # (n, l) readings of the outputs, by samples; none where steps are longer
    warned: str  # what the FMU warned of; empty: nothing


@compiled
def _set_inputs(drive, t, way, u):  # type: ignore[no-untyped-def]
    """Write the inputs at a time after the command and a place to u."""
    to, delay, lag, along = drive
    at = max(way, 0.0) / GRID
    last = along.shape[1] - 1
    first = min(int(at), last)
    share = min(at - first, 1.0)
    for j in range(to.size):
        risen = 1.0
        if t < delay[j]:
            risen = 0.0
        elif lag[j] > 0.0:
            risen = 1.0 - math.exp((delay[j] - t) / lag[j])
        here, there = along[j, first], along[j, min(first + 1, last)]
        u[j] = to[j] * risen + here + share * (there - here)


@compiled
def _stop(model, drive, limits, y, result, work):  # type: ignore[no-untyped-def]
    """Fill `y` (n, l), as far as it goes, and `result` (distance, time, steps); returns a status.

    `limits` are the index of the speed, that at rest [m/s], a step [s] and the most steps. The way
    is the integral of the speed by trapezia, s += h (v_k + v_{k+1}) / 2.
    """
    state, rest, h, most = limits
    restart(work)
    _set_inputs(drive, 0.0, 0.0, model.u)
    if place(model):
        return 1
    way, speed = 0.0, model.x[state]
    for k in range(most):
        status = check_state_events(model)
        if status:
            return status
        if k < y.shape[0]:
            if read(model):
                return 1
            for i in range(y.shape[1]):
                y[k, i] = model.y[i]
        _set_inputs(drive, (k + 1) * h, way + h * speed, work.to)
        status = advance(model, work, h)
        if status:
            return status
        for j in range(work.to.size):
            model.u[j] = work.to[j]
        before, speed = speed, model.x[state]
        # A constant rate from step to step; the last part, from a small speed, too.
        if speed <= rest:
            rate = (before - speed) / h
            result[0] = way + before * before / (2.0 * rate)
            result[1] = k * h + before / rate
            result[2] = k + 1
            return 0
        way += 0.5 * h * (before + speed)
    return _MOVING


class StopSimulation:
    """Simulate stops of a model.

    Parameters
    ----------
    fmu : with the states, inputs and outputs of the system; it must outlive this.
    """

    def __init__(self, fmu: FMU, system: System, stopping: Stopping) -> None:
        self._fmu, self._stopping = fmu, stopping
        inputs = [signal.name for signal in system.inputs]
        outputs = [output.name for output in system.outputs]
        readings = [system.signals[name].reading for name in outputs]
        self._model = instance(fmu, inputs, system.corrections, readings)
        self._h = system.sample_time
        self._y = np.zeros((round(stopping.longest / self._h), len(outputs)))
        self._state = fmu.states.index(stopping.state)
        self._result = np.zeros(3)
        # All states: how stiff one is changes on the way to standstill.
        self._work = steps(fmu, np.arange(len(fmu.states)), len(inputs))

    def run(self, drive: DrivingInputs, values: Mapping[str, float], stride: int = 1) -> StopResult:
        """Stop once.

        Parameters
        ----------
        values : of parameters and states at the command, by name, SI; others keep their defaults.
        stride : samples to a step; outputs are read where it is one.

        Raises
        ------
        FMUError
            If the model cannot be evaluated, or does not come to rest in time.
        """
        self._fmu.take_warning()  # of a stop that failed
        self._fmu.start(values)
        self._model.x[:], self._model.u[:] = self._fmu.get_states(), 0.0
        y = self._y if stride == 1 else self._y[:0]
        inputs = drive.to, drive.delay, drive.lag, drive.along
        limits = self._state, self._stopping.rest, stride * self._h, len(self._y) // stride
        status = _stop(self._model, inputs, limits, y, self._result, self._work)
        if status == _MOVING:
            raise FMUError(
                f"{self._fmu.called}: not at rest after {self._stopping.longest:g} s; "
                "the stop asks for too little, or the way falls too steeply"
            )
        raise_on_failure(status, self._fmu)
        assert status == OK
        distance, time, count = self._result
        outputs = y[: int(count)].copy()
        return StopResult(float(distance), float(time), outputs, self._fmu.take_warning())
