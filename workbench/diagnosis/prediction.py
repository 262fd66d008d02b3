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
from workbench.fmu import FMU, Matrix, Vector
from workbench.kernel import (
    checked,
    compiled,
    differentiate,
    evaluate,
    instance,
    place,
    read,
    set_inputs,
    set_states,
    solve,
)
from workbench.system import System

_LONGEST = 1.2  # sample times, of a step: what is stepped explicitly has to be stable
_SWIFT = 1.0  # rate times step from which on a state is stepped implicitly
_KEPT = 8  # steps with one Jacobian: in as many samples a machine changes little
_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


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


class _Work(NamedTuple):
    """What a simulation remembers, and work space.

    Attributes
    ----------
    stiff : (p,) states that are stepped implicitly.
    a : (n, p) columns of the Jacobian by them.
    system : (p, 2 p) I - gamma h A for them, and its inverse; step : (1,) that it is for [s].
    """

    stiff: NDArray[np.intp]
    a: Matrix
    system: Matrix
    step: Vector
    between: Vector
    x: Vector
    k1: Vector
    k2: Vector
    picked: Vector


@compiled
def _renew(model, work, h, anew):  # type: ignore[no-untyped-def]
    """Make the matrix of a step of h [s], with the Jacobian here or the one that is kept."""
    n, p = model.x.size, work.stiff.size
    if anew:
        for c in range(p):
            if differentiate(model, work.stiff[c], n):
                return 1
            for i in range(n):
                work.a[i, c] = model.jacobian[work.stiff[c], i]
    elif work.step[0] == h:
        return 0
    for r in range(p):
        for c in range(p):
            work.system[r, c] = -_GAMMA * h * work.a[work.stiff[r], c]
            work.system[r, p + c] = 1.0 if r == c else 0.0
        work.system[r, r] += 1.0
    work.step[0] = h
    return solve(work.system)


@compiled
def _solve(work, h, k):  # type: ignore[no-untyped-def]
    """Solve (I - gamma h A) x = k in place; A has columns by the stiff states, else zeros."""
    stiff, picked, p = work.stiff, work.picked, work.stiff.size
    for r in range(p):
        picked[r] = 0.0
        for c in range(p):
            picked[r] += work.system[r, p + c] * k[stiff[c]]
    for i in range(k.size):
        for c in range(stiff.size):
            k[i] += _GAMMA * h * work.a[i, c] * picked[c]
    for r in range(stiff.size):
        k[stiff[r]] = picked[r]


@compiled
def _step(model, work, h, renew):  # type: ignore[no-untyped-def]
    """Advance model.x by h [s] while the inputs go to work.between; returns a status.

    Rosenbrock method of two stages, L-stable, with inputs linear in time: a sampled ramp is met
    without lag, which linearly implicit Euler would show as half a sample of delay. It is of order
    2 whatever matrix stands for the Jacobian, so that one serves several steps, and only the states
    that may be stiff are treated so. What drives them, inputs and all other states, enters by its
    change over the step.
    Source: J. G. Verwer et al. (1999), SIAM J. Sci. Comput. 20, 1456-1480.
    """
    n, x, k1, k2 = model.x.size, work.x, work.k1, work.k2
    if evaluate(model):
        return 1
    for i in range(n):
        x[i] = model.x[i]
        k1[i] = model.dx[i]
    status = _renew(model, work, h, renew)
    if status:
        return status
    for j in range(work.between.size):
        model.u[j] = work.between[j]
    for i in range(n):
        model.x[i] += h * k1[i]
    for i in work.stiff:
        model.x[i] = x[i]
    if place(model) or evaluate(model):
        return 1
    for i in range(n):
        k2[i] = _GAMMA * (model.dx[i] - k1[i])
        k1[i] += k2[i]
    _solve(work, h, k1)
    for i in range(n):
        model.x[i] = x[i] + h * k1[i]
    if set_states(model) or evaluate(model):
        return 1
    for i in range(n):
        k2[i] = model.dx[i] - 2.0 * k1[i] - k2[i]
    _solve(work, h, k2)
    for i in range(n):
        model.x[i] = x[i] + h * (1.5 * k1[i] + 0.5 * k2[i])
    return set_states(model)


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
    taken, holds = 0, False
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
            steps = max(1, math.ceil(interval / longest - 1e-6))
            for i in range(1, steps + 1):
                for j in range(u.shape[1]):
                    moved = 0.0 if held[j] else (u[k, j] - u[k - 1, j]) * i / steps
                    work.between[j] = u[k - 1, j] + moved
                status = _step(model, work, interval / steps, taken % _KEPT == 0)
                taken += 1
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
    """

    def __init__(self, fmu: FMU, system: System, signals: Sequence[str]) -> None:
        self._fmu, self._system = fmu, system
        inputs = [one.name for one in system.inputs]
        readings = [system.signals[name].reading for name in signals]
        self._model = instance(fmu, inputs, system.corrections, readings)
        self._longest = _LONGEST * system.sample_time
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
        errors : (n, c) measured minus predicted.

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
        status = _predict(
            self._model,
            samples.time,
            samples.u,
            samples.held,
            samples.y,
            samples.gain,
            self._led(samples),
            x0,
            self._longest,
            errors,
            self._work(),
        )
        checked(status, fmu)
        return errors

    def _led(self, samples: Samples) -> _Led:
        lead = samples.lead
        if lead is None:
            return _Led(*self._leading, np.zeros(0, np.intp), np.zeros((0, 0)))
        places = [self._fmu.states.index(name) for name in lead.states]
        return _Led(*self._leading, np.array(places, np.intp), np.ascontiguousarray(lead.gain))

    def _work(self) -> _Work:
        """Work space; which states are stiff is judged where the recording begins."""
        fmu, n = self._fmu, len(self._fmu.states)
        rates = np.abs(fmu.state_jacobian().diagonal()) * self._longest
        stiff = [
            i
            for i, name in enumerate(fmu.states)
            if name in (self._system.states or ()) or rates[i] > _SWIFT
        ]
        p = len(stiff)
        return _Work(
            np.array(stiff, np.intp),
            *(np.zeros((n, p)), np.zeros((p, 2 * p)), np.zeros(1)),
            np.zeros(len(self._system.inputs)),
            *(np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(p)),
        )
