"""Simulation from sample to sample by the standard: what an open loop runs on.

A model with events: steps of integration end at samples and at time events. After each, event
indicators are read; a change of sign is located within the step, and the model goes through Event
Mode there. A Co-Simulation makes a step of its own from sample to sample.
Source: FMI 2.0.4, section 3.2; FMI 3.0, sections 2.5 and 3.
"""

import copy
import ctypes
from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.integrate import RK45, Radau
from scipy.optimize import brentq

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError
from workbench.models.explicit_steps import Samples, State, go_on
from workbench.models.fmu import FMU, SAME_RATE, CoSimulation, TypedVariables, central_differences
from workbench.models.instance import TOLERANCE
from workbench.models.native import MOVED, OK, Instance, instance, raise_on_failure

# Points within a step at which indicators are read, so that one that changes twice is found.
_LOOKS = 4
# Between two samples; a model that needs more comes to rest by ever more events (Zeno).
_MOST_EVENTS = 10_000
_PILED = 500  # events from which on the pace of the last so many tells whether that comes


class _Kept(NamedTuple):
    """A point between two steps: the FMU's saved state, and what is known of it."""

    saved: ctypes.c_void_p
    t: float
    before: Vector
    signs: Vector
    nominal: Vector
    next_event: float


class HybridSimulation:
    """A model that was started, driven by inputs from sample to sample.

    Parameters
    ----------
    fmu : after its start, whose inputs have the values of the first sample.
    inputs : what drives it, (m,), of any types that hold numbers.
    holds : (m,) 1 of an input that stays until the next sample, -1 of one whose sample is the mean
        since the one before; others go on in a straight line. Discrete ones stay, and jump in
        Event Mode.
    """

    def __init__(self, fmu: FMU, inputs: TypedVariables, holds: Vector) -> None:
        self._fmu, self._inputs = fmu, inputs
        moving = [i for i, name in enumerate(inputs.names) if fmu.moves(name)]
        self._continuous_at = np.array(moving, np.intp)
        self._continuous = fmu.typed([inputs.names[i] for i in moving])
        self._holds = np.where(holds == 0.0, 1.0, holds)
        self._holds[self._continuous_at] = holds[self._continuous_at]
        self._t = float(fmu.time[0])
        self._x = fmu.get_states()
        self._nominal = fmu.nominals()
        self._before = self._after = fmu.get_typed(inputs)  # at the ends of the interval
        self._begin, self._end = self._t, np.inf
        self._signs = np.sign(fmu.event_indicators())
        self._step: float | None = None
        self._unknown = ""  # of a rate on the way of the step, see `FMU.unknown_rate`
        self._events, self._piled = 0, self._t  # in this interval, and when so many were over
        self._event_at = self._t  # of the last one [s]
        self.passed = 0  # events but for jumps of inputs, since `start_from`, one it was beyond too
        self._kept: _Kept | None = None

    def begin(self, u: Vector) -> None:
        """Take the inputs of the first sample, (m,)."""
        self._jump(u)

    def advance(self, t: float, u: Vector) -> Vector:
        """Go on to the sample at t [s] with inputs u, (m,); returns the states there, (n,).

        Raises
        ------
        FMUError
            If the FMU refuses a call, asks to end, cannot be integrated, or its events pile up.
        """
        self._events, self._piled = 0, self._t
        self._jump(np.where(self._holds < 0.0, u, self._before))
        self._begin, self._end = self._t, t
        self._after = np.where(self._holds > 0.0, self._before, u)
        return self._go_through(t, u)

    def _go_through(self, t: float, u: Vector) -> Vector:
        """Go on within an interval to the sample at its end; see `advance`."""
        while self._t < t:
            self._go_on(t)
            while self._fmu.next_event[0] <= self._t:
                self._handle_event()
        self._before = self._after
        self._jump(u)
        return self._x.copy()

    def run(self, time: Vector, u: Matrix, outputs: TypedVariables) -> Matrix:
        """Take the first sample and go on to the last; returns the outputs at all, (n, l).

        Parameters
        ----------
        time : (n,) of the FMU at the samples [s].
        u : (n, m) inputs at the samples.
        """
        self.begin(u[0])
        rows = np.empty((time.size, len(outputs.names)))
        rows[0] = self._fmu.get_typed(outputs)
        model = self._compiled(outputs)
        last = np.vstack([u[:1], u[:-1]])
        begin, end = np.where(self._holds < 0.0, u, last), np.where(self._holds > 0.0, last, u)
        samples = Samples(time, *(part[:, self._continuous_at].copy() for part in (u, begin, end)))
        jumps = np.flatnonzero(self._jump_matters & ((begin != last) | (end != u)).any(axis=1))
        stops = np.append(jumps, time.size)
        k, tried, patience = 1, 1, 1
        while k < time.size:
            stop = int(stops[np.searchsorted(stops, k)])
            if model is not None and stop > k >= tried:
                state = State(np.zeros(1), self._x, self._nominal, self._signs)
                reached, status = go_on(model, samples, state, slice(k, stop), rows, TOLERANCE)
                # Where a motion is stiff, it soon is again: the next trial is ever further away.
                patience = 1 if reached > k else 2 * patience
                k, tried = reached, reached + patience
                self._t, self._before = float(time[k - 1]), u[k - 1].copy()
                if status != OK and state.t[0] > self._t:
                    self._begin, self._end = self._t, float(time[k])
                    self._before, self._after = begin[k].copy(), end[k].copy()
                    self._end_step(float(state.t[0]), status, model)
                    self._go_through(float(time[k]), u[k])
                    rows[k] = self._fmu.get_typed(outputs)
                    k += 1
                    continue
            if k < time.size:
                self.advance(float(time[k]), u[k])
                rows[k] = self._fmu.get_typed(outputs)
                k += 1
        return rows

    def _end_step(self, t: float, status: int, model: Instance) -> None:
        """Take over at t [s], where compiled code told the FMU that a step is over."""
        self._events, self._piled = 0, self._begin
        self._t, self._step = t, None
        self._place(t, self._x)
        if status == MOVED:
            raise_on_failure(status, self._fmu)
        event, end = model.ended
        if end:
            raise self._fmu.end_error()
        if event:
            self._handle_event()

    def _compiled(self, outputs: TypedVariables) -> Instance | None:
        """The FMU for compiled steps; None if they cannot set and read all that there is."""
        fmu = self._fmu
        others = outputs.others or self._continuous.others
        compilable = self._x.size and all(map(fmu.is_real, fmu.states)) and not others
        if not compilable or fmu.remembers_steps:
            return None
        return instance(fmu, self._continuous.names, [], outputs.names)

    @cached_property
    def _jump_matters(self) -> bool:
        """Whether a jump of an input may be an event, or compiled steps cannot set it."""
        jumping = len(self._continuous.names) < len(self._inputs.names)
        if self._signs.size or self._inputs.others or jumping:
            return True
        return any(v.variability == "discrete" for v in self._fmu.description.variables)

    def keep(self) -> None:
        """Keep the present point, to which `start_from` goes back; the FMU must save its state."""
        fmu, over = self._fmu, self._kept
        self._kept = _Kept(
            saved=fmu.save(over.saved if over else None),
            t=self._t,
            before=self._before.copy(),
            signs=self._signs.copy(),
            nominal=self._nominal,
            next_event=float(fmu.next_event[0]),
        )

    def fork(self) -> "HybridSimulation":
        """Another simulation of the same FMU, whose present point it keeps for itself."""
        other = copy.copy(self)
        other._kept = None
        other.keep()
        return other

    def start_from(self, x: Vector, held: Vector) -> None:
        """Go back to the point that was kept, with other states, (n,), and other last inputs, (q,).

        A point beyond an event passes it there.
        """
        kept = self._kept
        assert kept is not None
        self._fmu.restore(kept.saved)
        self._fmu.next_event[0] = kept.next_event
        self._t, self._nominal, self._signs = kept.t, kept.nominal, kept.signs
        self._x, self._step, self._events = x.copy(), None, 0
        self._before = np.concatenate([kept.before[: kept.before.size - held.size], held])
        self._after = self._before
        self._place(self._t, self._x)
        self.passed = int((np.sign(self._fmu.event_indicators()) != self._signs).any())
        self._handle_event(self._before)

    def release(self) -> None:
        """Free what was kept."""
        if self._kept is not None:
            self._fmu.release(self._kept.saved)
            self._kept = None

    def _jump(self, u: Vector) -> None:
        """Let inputs jump to u, which is an event."""
        if not np.array_equal(u, self._before):
            self._before = self._after = u.copy()
            self._place(self._t, self._x)
            self._handle_event(u)

    def _inputs_at(self, t: float) -> Vector:
        share = (t - self._begin) / (self._end - self._begin) if self._end < np.inf else 0.0
        return self._before + share * (self._after - self._before)

    def _place(self, t: float, x: Vector) -> None:
        """Put the FMU at a point."""
        self._fmu.set_time(t)
        if self._continuous.names:
            self._fmu.set_typed(self._continuous, self._inputs_at(t)[self._continuous_at])
        self._fmu.set_states(x)

    @np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused, by name
    def _go_on(self, end: float) -> None:
        """Integrate to the sample, the next time event, or a state or step event before."""
        end = min(end, float(self._fmu.next_event[0]))
        path = self._path(end)
        t_before = self._t
        while self._t < end:
            t, x_at = next(path)
            at = self._first_event(t_before, t, x_at)
            self._t, self._x = at or t, x_at(at or t)
            self._place(self._t, self._x)
            rates = self._fmu.derivatives() if self._fmu.remembers_steps else None
            if self._fmu.complete_step() or at is not None:
                self._handle_event()
                return
            if rates is not None:
                self._require_rates(rates)
            t_before = t

    def _require_rates(self, rates: Vector) -> None:
        """Refuse rates that the end of a step changed without an event, (n,) before it."""
        off = np.abs(self._fmu.derivatives() - rates)
        if (off > SAME_RATE * np.abs(rates)).any():
            name = self._fmu.states[int(off.argmax())]
            raise self._error(f"changes the derivative of '{name}' without an event")

    def _path(self, end: float):  # type: ignore[no-untyped-def]
        """Steps to the end: the time of each, and the states within it."""
        if not self._x.size:
            yield end, lambda t: self._x
            return
        if (whole := self._one_step(end)) is not None:
            yield end, whole
            return
        self._unknown = ""
        first = self._step if self._step is None else min(self._step, end - self._t)
        try:
            solver = Radau(
                self._rates,
                self._t,
                self._x,
                end,
                rtol=TOLERANCE,
                atol=TOLERANCE * self._nominal,  # type: ignore[arg-type]  # SciPy takes vectors
                jac=self._jacobian,
                first_step=first,
            )
            while solver.status == "running":
                if message := solver.step():
                    raise self._error(f"cannot be integrated ({message})", self._unknown)
                if solver.t < end:  # the last one is cut
                    self._step = solver.h_abs
                yield solver.t, solver.dense_output()
        except (ValueError, np.linalg.LinAlgError) as error:  # of derivatives that are not finite
            raise self._error(f"cannot be integrated ({error})", self._unknown) from None

    def _one_step(self, end: float) -> Callable[[float], Vector] | None:
        """States within one explicit step to the end, None where its error is too large.

        Samples mostly resolve a motion; an implicit solver costs several times as much for them.
        Source: Dormand and Prince (1980), A family of embedded Runge-Kutta formulae; SciPy's RK45.
        """
        begin, x = self._t, self._x
        h, K = end - begin, np.empty((7, x.size))
        try:
            for stage, (a, c) in enumerate(zip(RK45.A, RK45.C, strict=True)):
                K[stage] = self._rates(begin + c * h, x + h * (a[:stage] @ K[:stage]))
            after = x + h * (RK45.B @ K[:6])
            K[6] = self._rates(end, after)
        except FMUError:  # of a stage that is far off, as where a motion is stiff
            return None
        scale = TOLERANCE * (self._nominal + np.maximum(np.abs(x), np.abs(after)))
        if not np.all(np.abs(h * (RK45.E @ K)) <= scale):  # nor of what is not finite
            return None
        Q, powers = K.T @ RK45.P, np.arange(4)
        return lambda t: x + (t - begin) * (Q @ ((t - begin) / h) ** powers)

    def _rates(self, t: float, x: Vector) -> Vector:
        self._place(t, x)
        rates = self._fmu.derivatives()
        if not np.isfinite(rates).all():
            self._unknown = f". It came to {self._fmu.unknown_rate()}"
        return rates

    def _jacobian(self, t: float, x: Vector) -> Matrix:
        self._place(t, x)
        if self._fmu.has_directional_derivatives and all(map(self._fmu.is_real, self._fmu.states)):
            return self._fmu.state_jacobian()
        # Not SciPy's: its steps grow without bound for states that no derivative depends on.
        steps = 1e-6 * np.maximum(np.abs(x), self._nominal)
        return central_differences(lambda x: self._rates(t, x), x, steps)

    def _first_event(self, begin: float, end: float, x_at):  # type: ignore[no-untyped-def]
        """Time just after the first state event of a step [s], None where there is none.

        An indicator changes strictly where it has the opposite sign, or leaves zero: models may
        compare with `>` what FMI counts by `>= 0`, so that nothing switches at zero itself. One
        that is zero at the end of the step, and was not, has changed as well.
        """
        signs = self._signs
        if not signs.size:
            return None

        def left(t: float) -> float:
            """How far indicators are from a change, the nearest; below zero where one has."""
            self._place(t, x_at(t))
            now = self._fmu.event_indicators()
            away = np.where(signs != 0.0, signs * now, np.where(now != 0.0, -np.abs(now), 1.0))
            return float(np.nan_to_num(away, nan=-1.0).min())

        low, looks = begin, [float(t) for t in np.linspace(begin, end, _LOOKS + 1)[1:]]
        if begin == self._event_at and left(looks[0]) >= 0.0:
            looks = [*self._early_looks(begin, looks[0], x_at), *looks]
        for high in looks:
            beyond = left(high)
            if beyond < 0.0 or (high == end and beyond == 0.0):
                break
            low = high
        else:
            return None
        strictly, spacing = beyond < 0.0, float(np.spacing(max(abs(low), abs(high))))
        if strictly and left(low) >= 0.0:
            near, step = float(brentq(left, low, high, xtol=spacing)), 4.0 * spacing
            while low < near < high:  # the root may be on either side of the change
                low, high, near = (
                    (low, near, near - step) if left(near) < 0.0 else (near, high, near + step)
                )
                step *= 2.0
        while high - low > 4.0 * spacing:
            middle = 0.5 * (low + high)
            further = left(middle)
            low, high = (
                (low, middle)
                if further < 0.0 or (further == 0.0 and not strictly)
                else (middle, high)
            )
        return high

    def _early_looks(self, begin: float, look: float, x_at) -> list[float]:  # type: ignore[no-untyped-def]
        """Times between an event and the first look after it [s], from the event on.

        An indicator that the event left at zero may be back there before the first look, as that
        of a ball is which just jumps. It is beyond zero from the event on, so that looks at halves
        of halves find it. The shortest is where states bend by the tolerance over the whole jump.
        """
        x, middle, after = x_at(begin), x_at(0.5 * (begin + look)), x_at(look)
        bend = np.abs(after - 2.0 * middle + x) / (TOLERANCE * (self._nominal + np.abs(x)))
        halves = int(np.ceil(0.5 * np.log2(max(float(bend.max(initial=0.0)) / 2.0, 1.0))))
        return [begin + (look - begin) * 0.5**k for k in range(halves, 0, -1)]

    def _handle_event(self, u: Vector | None = None) -> None:
        """Go through Event Mode at the present point, where inputs may jump to u."""
        self._events, self._event_at = self._events + 1, self._t
        self.passed += u is None
        if self._events % _PILED == 0:
            left, took = self._end - self._t, self._t - self._piled
            if not took > 0.0:  # the next one is due by now, each time
                raise self._error(f"has more than {_PILED} events at one time", self._cause())
            if left * _PILED > took * (_MOST_EVENTS - self._events) and self._events > _PILED:
                fault = f"has more than {_MOST_EVENTS} events between two samples"
                raise self._error(fault, self._cause())
            self._piled = self._t
        update = self._fmu.handle_event(self._inputs, u)
        self._x = self._fmu.get_states()  # some tools change them, and do not say so
        if update.nominals_changed:
            self._nominal = self._fmu.nominals()
        self._signs = np.sign(self._fmu.event_indicators())
        self._step = None

    def _cause(self) -> str:
        """What brings the present event about, and how a model is made that goes on."""
        changed = np.flatnonzero(np.sign(self._fmu.event_indicators()) != self._signs)
        if self._fmu.next_event[0] <= self._t:
            return ": time events, each as soon as the one before. Correct nextEventTime"
        if not changed.size:
            return ": step events. Let the model ask for Event Mode only where something changes"
        return (
            f": its event indicator {changed[0] + 1} of {self._signs.size} changes sign again and "
            "again (chattering, or ever shorter jumps). Give the switch a hysteresis, or make it "
            "smooth, or let the model come to rest"
        )

    def _error(self, fault: str, more: str = "") -> FMUError:
        return FMUError(f"{self._fmu.called}: it {fault} at {self._t:.9g} s of its time{more}")


class CoSimulationRun:
    """A Co-Simulation that was started, driven by inputs from sample to sample.

    Parameters
    ----------
    fmu : after its start, whose inputs have the values of the first sample.
    inputs : what drives it, (m,).
    holds : (m,) 1 of an input that stays until the next sample, -1 of one whose sample is the mean
        since the one before; others go on in a straight line, of which the mean of each step of
        the FMU acts where it takes no derivatives of inputs.
    """

    def __init__(self, fmu: CoSimulation, inputs: TypedVariables, holds: Vector) -> None:
        self._fmu, self._inputs = fmu, inputs
        moves = [fmu.moves(name) or fmu.is_real(name) for name in inputs.names]
        still = ~np.array(moves, np.bool_)
        self._holds = np.where(still & (holds == 0.0), 1.0, holds)
        self._states = fmu.typed(fmu.states)
        lines = zip(inputs.names, self._holds == 0.0, strict=True)
        sloping = [fmu.takes_slopes and straight and fmu.is_real(name) for name, straight in lines]
        self._lines_at = np.flatnonzero(sloping)
        self._lines = fmu.variables([inputs.names[i] for i in self._lines_at])
        self._t = fmu.start_time
        self._before = fmu.get_typed(inputs)

    def run(self, time: Vector, u: Matrix, outputs: TypedVariables) -> Matrix:
        """See `HybridSimulation.run`."""
        self.begin(u[0])
        rows = np.empty((time.size, len(outputs.names)))
        rows[0] = self._fmu.get_typed(outputs)
        for k in range(1, time.size):
            self.advance(float(time[k]), u[k])
            rows[k] = self._fmu.get_typed(outputs)
        return rows

    def begin(self, u: Vector) -> None:
        """Take the inputs of the first sample, (m,)."""
        self._fmu.set_typed(self._inputs, u)
        self._before = u.copy()

    def advance(self, t: float, u: Vector) -> Vector:
        """Go on to the sample at t [s] with inputs u, (m,); returns the states there, (n,).

        Raises
        ------
        FMUError
            If the FMU refuses the step, or asks to end.
        """
        if t > self._t:
            first = np.where(self._holds < 0.0, u, self._before)
            move, h = np.where(self._holds > 0.0, self._before, u) - first, t - self._t

            def drive(begin: float, end: float) -> None:
                acting = first + 0.5 * (begin + end) * move
                acting[self._lines_at] = (first + begin * move)[self._lines_at]
                self._fmu.set_typed(self._inputs, acting)
                if self._lines_at.size:
                    self._fmu.set_slopes(self._lines, move[self._lines_at] / h)

            self._fmu.step(h, drive)
            self._t = t
        self._fmu.set_typed(self._inputs, u)
        self._before = u.copy()
        return self._fmu.get_typed(self._states)
