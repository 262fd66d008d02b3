"""Prediction errors of a model along a recording: what the data say that the model does not.

The model is simulated from the measured inputs. Only a slow motion that integrates the noise of
inputs is led along its measured output, by the stationary Kalman gain for that noise: errors of the
past are forgotten and the prediction errors are white when the model is right. All else stays the
model's own. Source: L. Ljung, System Identification, 2nd ed. 1999, section 7.2 (prediction-error
methods).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.samples import Samples
from workbench.diagnosis.simulation.steps import Steps, step, steps
from workbench.diagnosis.simulation.tangent import (
    Tangent,
    advance,
    following,
    renew,
    share,
    tangent,
    tell,
)
from workbench.errors import FMUError
from workbench.models.fmu import FMU
from workbench.models.native import (
    check_state_events,
    compiled,
    inlined,
    instance,
    place,
    raise_on_failure,
    read,
    set_inputs,
    set_states,
)
from workbench.system.system import System

_LONGEST = 1.2  # sample times, of a step: what is stepped explicitly has to be stable
_SWIFT = 1.0  # rate times step from which on a state is stepped implicitly


class _Led(NamedTuple):
    """The motion that is led."""

    # that a correction scales alike, the leader first; empty: all outputs lead
    states: NDArray[np.intp]
    column: int  # of the output that leads alone
    corrected: NDArray[np.intp]  # (p,) states that all outputs lead
    gain: Matrix  # (p, l) of these corrections
    # restarted, seen: (r,) states that restarts set, and the columns of their outputs
    restarted: NDArray[np.intp]
    seen: NDArray[np.intp]


@inlined
def _lead(model, led, share, error, states, errors):  # type: ignore[no-untyped-def]
    """Correct the states by prediction errors (c,), and derivatives (n, p) by theirs (c, p).

    A correction scales all states that move together: what depends on their ratio stays as it is,
    so that the noise of one sample does not come back as something else in the next.
    """
    x, p = model.x, states.shape[1]
    if led.states.size:
        first, column = led.states[0], led.column
        correction, leader = share * error[column], x[first]
        if led.states.size == 1:
            x[first] += correction
            for q in range(p):
                states[first, q] += share * errors[column, q]
        elif abs(leader) > 2.0 * abs(correction):
            for q in range(p):
                moved = share * errors[column, q] - correction / leader * states[first, q]
                for i in led.states:
                    states[i, q] *= 1.0 + correction / leader
                    states[i, q] += moved / leader * x[i]
            for i in led.states:
                x[i] *= 1.0 + correction / leader
    for i in range(led.corrected.size):
        for j in range(led.gain.shape[1]):
            x[led.corrected[i]] += led.gain[i, j] * error[j]
            for q in range(p):
                states[led.corrected[i], q] += led.gain[i, j] * errors[j, q]


@inlined
def _restart(model, led, error, states, errors):  # type: ignore[no-untyped-def]
    """Set states as measured, by errors (c,), and derivatives (n, p) by theirs (c, p)."""
    for i in range(led.restarted.size):
        at, column = led.restarted[i], led.seen[i]
        model.x[at] += error[column]
        for q in range(states.shape[1]):
            states[at, q] += errors[column, q]


class _Run(NamedTuple):
    """What a prediction runs along."""

    time: Vector  # (n,) [s] of the samples
    u: Matrix  # (n, m) inputs
    holds: Vector  # (m,), see `Signal.hold`
    y: Matrix  # (n, c) measured
    gain: Vector  # (n,) of the correction by what leads alone
    led: _Led
    anew: NDArray[np.bool_]  # (n,) whether states are set as measured before a sample
    x0: Vector  # (s,) states at the start
    longest: float  # of a step [s]


class _State(NamedTuple):
    """What a prediction leaves: errors (n, c), steps, and derivatives of errors and states."""

    errors: Matrix
    work: Steps
    tangent: Tangent


@compiled
def _predict(model, state, args):  # type: ignore[no-untyped-def]
    """Fill state.errors (n, c) and their derivatives along `args`, a `_Run`; returns a status.

    e_k = y_k - g(x_k, u_k), and x_k+1 = F(x_k + K_k e_k, u_k, u_k+1): F steps the model from one
    sample to the next, K_k is the gain of what leads; where states restart, they are set to y_k.
    """
    time, u, holds, y, led = args.time, args.u, args.holds, args.y, args.led
    errors, work, tangent = state.errors, state.work, state.tangent
    varied = tangent.states.shape[1] > 0
    for i in range(args.x0.size):
        model.x[i] = args.x0[i]
    for j in range(u.shape[1]):
        model.u[j] = u[0, j]
    if place(model):
        return 1
    stays = ends = False  # whether inputs jump at samples, and at the begin of steps
    for j in range(holds.size):
        stays, ends = stays or holds[j] > 0.0, ends or holds[j] < 0.0
    for k in range(time.size):
        if k > 0:
            before = k - 1 if varied else 0
            if args.anew[k]:
                _restart(model, led, errors[k - 1], tangent.states, tangent.errors[before])
            _lead(
                model, led, args.gain[k - 1], errors[k - 1], tangent.states, tangent.errors[before]
            )
            if set_states(model):
                return 1
            for j in range(u.shape[1]):
                if holds[j] < 0.0:
                    model.u[j] = u[k, j]
            if ends and (set_inputs(model, 0, u.shape[1]) or (varied and renew(model, tangent))):
                return 1
            interval = time[k] - time[k - 1]
            count = max(1, math.ceil(interval / args.longest - 1e-6))
            for i in range(1, count + 1):
                for j in range(u.shape[1]):
                    begin = u[k, j] if holds[j] < 0.0 else u[k - 1, j]
                    moved = 0.0 if holds[j] > 0.0 else (u[k, j] - begin) * i / count
                    work.to[j] = begin + moved
                status = step(model, work, interval / count)
                if varied and not status:
                    share(tangent, k, i / count)
                    status = advance(model, tangent, interval / count)
                if status:
                    return status
            for j in range(u.shape[1]):
                model.u[j] = u[k, j]
            if stays and set_inputs(model, 0, u.shape[1]):
                return 1
        status = check_state_events(model) or read(model)
        if status:
            return status
        for i in range(y.shape[1]):
            errors[k, i] = y[k, i] - model.y[i]
        if varied:
            if (k == 0 or stays) and renew(model, tangent):
                return 1
            tell(tangent, k)
    return 0


@dataclass(frozen=True)
class Variation:
    """A parameter that is varied."""

    variables: tuple[str, ...]  # of the FMU that take its value; of a state it is the start
    # other variables that are set while it is varied, such as the shape of an effect that is absent
    # otherwise
    setting: Mapping[str, float] = field(default_factory=dict)
    size: float = 0.0  # a typical change; 0 where its value tells


class Predictor:
    """One model, ready for many runs.

    Parameters
    ----------
    fmu : model with the states, inputs and readings of the system; it must outlive the predictor.
    signals : that are predicted.
    parts : of a sample time, one step each.
    watched : variables that `along` tells.
    """

    def __init__(
        self,
        fmu: FMU,
        system: System,
        signals: Sequence[str],
        parts: int = 1,
        watched: Sequence[str] = (),
    ) -> None:
        self._fmu, self._system = fmu, system
        inputs = [signal.name for signal in system.inputs]
        readings = [*(system.signals[name].reading for name in signals), *watched]
        self._model = instance(fmu, inputs, system.corrections, readings)
        self._longest = _LONGEST * system.sample_time / parts
        leading = system.comparison.leading
        states: list[int] = []
        if leading is not None:
            others = [name for name in leading.together if name != leading.output]
            states = [fmu.states.index(name) for name in (leading.output, *others)]
        column = list(signals).index(leading.output) if leading is not None else 0
        self._leading = np.array(states, np.intp), column
        # States that sensors of the model read; what leads a run lets it forget its start.
        self._read = [
            signal
            for signal in (system.outputs if leading is None else ())
            if signal.name in fmu.states and signal.reading != signal.name
        ]
        self._readings = fmu.variables([signal.reading for signal in self._read])

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
        return self.derivatives(samples, values, ())[0]

    def along(self, samples: Samples, values: Mapping[str, float]) -> Matrix:
        """What is watched, at each sample of a recording, (n, w); see `errors`."""
        count = len(self._model.y) - samples.y.shape[1]
        y = np.hstack([samples.y, np.zeros((samples.time.size, count))])
        watched: Matrix = -self.errors(replace(samples, y=y), values)[:, samples.y.shape[1] :]
        return watched

    def derivatives(
        self,
        samples: Samples,
        values: Mapping[str, float],
        columns: Sequence[Variation],
        courses: Matrix | None = None,
        absent: Sequence[str] = (),
    ) -> tuple[Matrix, Tangent]:
        """Prediction errors along one recording, and their derivatives by p columns.

        The FMU is left at the last sample. See `errors`.

        Parameters
        ----------
        courses : (n, p) factors by which the columns act at each sample, if they change in time.
        absent : components of the FMU whose states nothing depends on.
        """
        fmu, values = self._fmu, {**self.begin(samples), **values}
        for column in columns:
            values |= column.setting
        seen = self._start(samples, values)
        errors = np.zeros_like(samples.y)
        self._model.u[:] = 0.0
        x0 = fmu.get_states()
        # One more, for rates at the last one.
        end = int(np.flatnonzero(samples.reported)[-1]) + 2
        work = self._steps()
        varied = [column.variables for column in columns]
        along = tangent(fmu, self._model, varied, samples.time.size, work.stiff, absent)
        for q, names in enumerate(varied) if seen else ():
            acting = fmu.variables([name for name in names if name not in fmu.states])
            by = fmu.jacobian(self._readings.references, acting).sum(axis=1)
            for at, (j, slope) in seen.items():
                along.states[at, q] = (along.states[at, q] - by[j]) / slope
        if courses is not None:
            along = following(along, courses)
        restarts = samples.restarts
        run = _Run(
            time=samples.time[:end],
            u=samples.u,
            holds=samples.holds,
            y=samples.y,
            gain=samples.gain,
            led=self._led(samples),
            anew=np.zeros(end, np.bool_) if restarts is None else restarts.at[:end],
            x0=x0,
            longest=self._longest,
        )
        status = _predict(self._model, _State(errors, work, along), run)
        raise_on_failure(status, fmu)
        if not np.isfinite(along.states).all():  # once lost, they stay so
            raise FMUError(f"{fmu.called}: derivatives of {samples.name} grow beyond all bounds")
        return errors, along

    def started(self, samples: Samples, values: Mapping[str, float]) -> dict[str, float]:
        """States at the start that sensors read as `values` and the recording say."""
        seen = self._start(samples, {**self.begin(samples), **values})
        x0 = self._fmu.get_states()
        return {self._fmu.states[at]: float(x0[at]) for at in seen}

    def _start(self, samples: Samples, values: Mapping[str, float]) -> dict[int, tuple[int, float]]:
        """Start the FMU, with states where sensors read what is given; number and slope, by state.

        Not where a sensor bends, or has states: what it reads then follows from what was before.
        """
        fmu, seen = self._fmu, dict[int, tuple[int, float]]()
        fmu.begin_at(samples.model_time)
        # What a model calculates at its start may depend on inputs.
        fmu.start({**dict(zip(samples.inputs, samples.u[0], strict=True)), **values})
        known = {j: signal for j, signal in enumerate(self._read) if signal.name in values}
        if not known:
            return {}
        slopes = fmu.jacobian(self._readings.references, fmu.variables(fmu.states))
        read_ = fmu.get(self._readings).copy()
        for j, signal in known.items():
            at, value = fmu.states.index(signal.name), values[signal.name]
            if np.flatnonzero(slopes[j]).tolist() != [at]:
                continue
            begin = fmu.get_states()
            x0 = begin.copy()
            x0[at] += (value - read_[j]) / slopes[j, at]
            fmu.set_states(x0)
            if abs(fmu.get(self._readings)[j] - value) <= signal.noise_at_scale:
                seen[at] = j, float(slopes[j, at])
            else:
                fmu.set_states(begin)
        return seen

    def _led(self, samples: Samples) -> _Led:
        lead, restarts = samples.lead, samples.restarts
        corrected = () if lead is None else lead.states
        gain = np.zeros((0, 0)) if lead is None else np.ascontiguousarray(lead.gain)
        restarted = () if restarts is None else tuple(restarts.noise)
        seen = np.array([samples.signals.index(name) for name in restarted], np.intp)
        return _Led(*self._leading, self._at(corrected), gain, self._at(restarted), seen)

    def _at(self, states: Sequence[str]) -> NDArray[np.intp]:
        return np.array([self._fmu.states.index(name) for name in states], np.intp)

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
