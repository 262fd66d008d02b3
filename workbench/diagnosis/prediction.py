"""Prediction errors of a model along a recording: what the data say that the model does not.

The model is simulated from the measured inputs. Only a slow motion that integrates the noise of
inputs is led along its measured output, by the stationary Kalman gain for that noise: errors of the
past are forgotten and the prediction errors are white when the model is right. All else stays the
model's own. Source: L. Ljung, System Identification, 2nd ed. 1999, section 7.2 (prediction-error
methods).
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.diagnosis.samples import Samples
from workbench.diagnosis.steps import Steps, step, steps
from workbench.fmu import FMU, Matrix
from workbench.kernel import checked, compiled, instance, place, read, set_inputs, set_states
from workbench.system import System

_LONGEST = 1.2  # sample times, of a step: what is stepped explicitly has to be stable
_SWIFT = 1.0  # rate times step from which on a state is stepped implicitly


class _Led(NamedTuple):
    """The motion that is led.

    Attributes
    ----------
    states : that a correction scales alike, the leader first; empty: all outputs lead.
    column : of the output that leads alone.
    corrected : (p,) states that all outputs lead.
    gain : (p, l) of these corrections.
    """

    states: NDArray[np.intp]
    column: int
    corrected: NDArray[np.intp]
    gain: Matrix


@compiled
def _predict(model, time, u, held, y, gain, led, x0, longest, errors, work):  # type: ignore[no-untyped-def]
    """Fill `errors` (n, c), measured minus predicted; returns a status.

    A correction scales all states that move together: what depends on their ratio stays as it is,
    so that the noise of one sample does not come back as something else in the next.
    """
    for i in range(x0.size):
        model.x[i] = x0[i]
    for j in range(u.shape[1]):
        model.u[j] = u[0, j]
    if place(model):
        return 1
    holds = False
    for j in range(held.size):
        holds = holds or held[j]
    for k in range(time.size):
        if k > 0:
            if led.states.size:
                correction = gain[k - 1] * errors[k - 1, led.column]
                leader = model.x[led.states[0]]
                if led.states.size == 1:
                    model.x[led.states[0]] += correction
                elif abs(leader) > 2.0 * abs(correction):
                    for i in led.states:
                        model.x[i] *= 1.0 + correction / leader
            for i in range(led.corrected.size):
                for j in range(led.gain.shape[1]):
                    model.x[led.corrected[i]] += led.gain[i, j] * errors[k - 1, j]
            if set_states(model):
                return 1
            interval = time[k] - time[k - 1]
            count = max(1, math.ceil(interval / longest - 1e-6))
            for i in range(1, count + 1):
                for j in range(u.shape[1]):
                    moved = 0.0 if held[j] else (u[k, j] - u[k - 1, j]) * i / count
                    work.to[j] = u[k - 1, j] + moved
                status = step(model, work, interval / count)
                if status:
                    return status
            for j in range(u.shape[1]):
                model.u[j] = u[k, j]
            if holds and set_inputs(model, 0, u.shape[1]):
                return 1
        if read(model):
            return 1
        for i in range(y.shape[1]):
            errors[k, i] = y[k, i] - model.y[i]
    return 0


class Predictor:
    """One model, ready for many runs.

    Parameters
    ----------
    fmu : model with the states, inputs and readings of the system; it must outlive the predictor.
    signals : that are predicted.
    parts : of a sample time, one step each.
    """

    def __init__(self, fmu: FMU, system: System, signals: Sequence[str], parts: int = 1) -> None:
        self._fmu, self._system = fmu, system
        inputs = [one.name for one in system.inputs]
        readings = [system.signals[name].reading for name in signals]
        self._model = instance(fmu, inputs, system.corrections, readings)
        self._longest = _LONGEST * system.sample_time / parts
        leading = system.comparison.leading
        states: list[int] = []
        if leading is not None:
            others = [name for name in leading.together if name != leading.output]
            states = [fmu.states.index(name) for name in (leading.output, *others)]
        column = list(signals).index(leading.output) if leading is not None else 0
        self._leading = np.array(states, np.intp), column

    def begin(self, samples: Samples) -> dict[str, float]:
        """Start values of states, as known at the start of a recording."""
        return {name: value for name, value in samples.begin.items() if name in self._fmu.states}

    def errors(self, samples: Samples, values: Mapping[str, float]) -> Matrix:
        """Prediction errors along one recording.

        Parameters
        ----------
        values : by name of the FMU's variables, SI; others keep their defaults.

        Returns
        -------
        errors : (n, c) measured minus predicted; zero from the second sample on after all that
            counts.

        Raises
        ------
        FMUError
            If the model cannot be evaluated along the recording.
        """
        fmu = self._fmu
        fmu.start({**self.begin(samples), **values})
        errors = np.zeros_like(samples.y)
        self._model.u[:] = 0.0
        x0 = fmu.get_states()
        end = int(np.flatnonzero(samples.told)[-1]) + 2  # one more, for rates at the last one told
        status = _predict(
            self._model,
            samples.time[:end],
            samples.u,
            samples.held,
            samples.y,
            samples.gain,
            self._led(samples),
            x0,
            self._longest,
            errors,
            self._steps(),
        )
        checked(status, fmu)
        return errors

    def _led(self, samples: Samples) -> _Led:
        lead = samples.lead
        if lead is None:
            return _Led(*self._leading, np.zeros(0, np.intp), np.zeros((0, 0)))
        places = [self._fmu.states.index(name) for name in lead.states]
        return _Led(*self._leading, np.array(places, np.intp), np.ascontiguousarray(lead.gain))

    def _steps(self) -> Steps:
        """Work space; which states are stiff is judged where the recording begins."""
        fmu = self._fmu
        rates = np.abs(fmu.state_jacobian().diagonal()) * self._longest
        stiff = [
            i
            for i, name in enumerate(fmu.states)
            if name in (self._system.states or ()) or rates[i] > _SWIFT
        ]
        return steps(fmu, np.array(stiff, np.intp), len(self._system.inputs))
