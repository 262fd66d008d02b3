"""Explicit steps of integration in compiled code, from sample to sample where no event is.

Samples mostly resolve a motion, so that one step of order 5 reaches from one to the next; where its
error is too large it is made in parts. An event, and a motion that is too stiff, are left to the
caller, at the sample before.
Source: J. R. Dormand, P. J. Prince (1980), A family of embedded Runge-Kutta formulae, J. Comp.
Appl. Math. 6, 19-26; interpolation by L. F. Shampine, as in SciPy's RK45.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import RK45

from workbench.arrays import Matrix, Vector
from workbench.models.native import (
    EVENT,
    OK,
    Instance,
    assign,
    compiled,
    end_step,
    evaluate,
    read,
    read_indicators,
    set_inputs,
    set_states,
    set_time,
)

# In an interval: as many take as long as one implicit step in Python.
_MOST = 100
# Shares of a step at which indicators are read, so that one that changes twice is found.
_LOOKS = np.array([0.25, 0.5, 0.75])
_SAFETY, _LEAST, _GROWTH = 0.9, 0.2, 5.0  # of steps, as SciPy has them


class _Method(NamedTuple):
    """Coefficients."""

    # a, c: (6, 5), (6,) of the stages
    a: Matrix
    c: Vector
    # b, e: (6,), (7,) weights of the end and of its error, per h
    b: Vector
    e: Vector
    looks: Matrix  # (3, 7) weights of the points at `_LOOKS`, per h


_METHOD = _Method(
    np.ascontiguousarray(RK45.A),
    np.ascontiguousarray(RK45.C),
    np.ascontiguousarray(RK45.B),
    np.ascontiguousarray(RK45.E),
    np.power.outer(_LOOKS, np.arange(1.0, 5.0)) @ RK45.P.T,
)


class _Space(NamedTuple):
    """Space to work in."""

    stages: Matrix  # (7, n) derivatives K of the states
    # begin, before, after: (n,) states at the sample, and at both ends of a step
    begin: Vector
    before: Vector
    after: Vector
    t: Vector  # (1,) end of the last step that is over [s]


class Samples(NamedTuple):
    """What acts at and between samples."""

    time: Vector  # (n,) of the FMU at the samples [s]
    u: Matrix  # (n, m) inputs at the samples
    # begin, end: (n, m) inputs at both ends of the interval before each sample; straight between
    begin: Matrix
    end: Matrix


class State(NamedTuple):
    """Where the FMU is."""

    t: Vector  # (1,) time [s]
    x: Vector  # (n,) states
    nominal: Vector  # (n,) their typical sizes
    signs: Vector  # (z,) of event indicators: -1, 0, 1


def go_on(
    model: Instance, samples: Samples, state: State, part: slice, outputs: Matrix, tolerance: float
) -> tuple[int, int]:
    """Go on through a part of the samples; returns the first that is not reached, and a status.

    The state becomes that at the last sample that was reached, or at the end of a step after it
    that the FMU was told to be over: it is not told so twice. If that is not the last of the part,
    the FMU is at any point.

    Parameters
    ----------
    model : with the inputs that `Samples` has, and the outputs that are read, l.
    part : of the samples, without the one where the FMU is.
    outputs : (n, l), of which those of samples that are reached are written.
    tolerance : of a step, relative to states and their nominal values.
    """
    n = model.x.size
    space = _Space(np.zeros((7, n)), np.zeros(n), np.zeros(n), np.zeros(n), state.t)
    model.x[:], model.ended[:] = state.x, 0
    bounds = tolerance * state.nominal, tolerance
    ended: tuple[int, int] = _go_on(
        model, _METHOD, space, samples, state.signs, (part.start, part.stop), bounds, outputs
    )
    state.x[:] = model.x
    return ended


@compiled
def _go_on(model, method, space, samples, signs, part, bounds, outputs):  # type: ignore[no-untyped-def]
    """Samples of a part; returns the first that is not reached, with x as at the one before.

    Or, where the FMU is told of steps, as at the end of the last one; and a status.
    """
    for k in range(part[0], part[1]):
        assign(space.begin, model.x)
        space.t[0] = samples.time[k - 1]
        status = _interval(model, method, space, samples, signs, k, bounds)
        for j in range(model.measured):
            model.u[j] = samples.u[k, j]
        status = status or set_inputs(model, 0, model.measured) or read(model)
        if status != OK:
            if model.complete_step == 0:
                space.t[0] = samples.time[k - 1]
                assign(model.x, space.begin)
            return k, status
        assign(outputs[k], model.y)
    return part[1], OK


@compiled
def _interval(model, method, space, samples, signs, k, bounds):  # type: ignore[no-untyped-def]
    """To the sample k from the one before, at model.x; a status.

    EVENT : one is due within the interval or at its end, or steps become too many.

    Otherwise than OK, model.x and space.t are at the end of the last step that is over.
    """
    begin, end = samples.time[k - 1], samples.time[k]
    if end >= model.next_event[0]:
        return EVENT
    t, h = begin, end - begin
    for _ in range(_MOST):
        last = t + h >= end
        h = end - t if last else h
        error = _step(model, method, space, samples, k, t, h, bounds)
        if not error <= 1.0:
            h *= max(_LEAST, _SAFETY * error**-0.2) if error > 1.0 else _LEAST
            continue
        status = _look(model, method, space, samples, signs, k, t, h) if signs.size else OK
        assign(model.x, space.after)
        after = end if last else t + h
        status = status or _place(model, samples, k, after) or _cross(model, signs)
        if status:
            assign(model.x, space.before)
            return status
        t = space.t[0] = after
        status = end_step(model)
        if status or last:
            return status
        h *= min(_GROWTH, _SAFETY * error**-0.2) if error > 0.0 else _GROWTH
    return EVENT


@compiled
def _step(model, method, space, samples, k, t, h, bounds):  # type: ignore[no-untyped-def]
    """From model.x at t over h: space.after = x + h sum b K; returns the error over its bound.

    K_s = f(t + c_s h, x + h sum_r<s a_sr K_r), the last one at the end. The error, h sum e K, is
    the largest of all states. What the FMU refuses, as far off a stiff motion, is infinite.
    """
    n, stages = model.x.size, space.stages
    assign(space.before, model.x)
    for s in range(7):
        for i in range(n):
            slope = 0.0
            for r in range(s):
                slope += (method.b[r] if s == 6 else method.a[s, r]) * stages[r, i]
            model.x[i] = space.before[i] + h * slope
        at = t + h * (1.0 if s == 6 else method.c[s])
        if _place(model, samples, k, at) or evaluate(model):
            assign(model.x, space.before)
            return np.inf
        assign(stages[s], model.dx)
    worst = 0.0
    for i in range(n):
        off = 0.0
        for s in range(7):
            off += method.e[s] * stages[s, i]
        size = max(abs(space.before[i]), abs(model.x[i]))
        share = abs(h * off) / (bounds[0][i] + bounds[1] * size)
        worst = share if not share <= worst else worst  # also what is no number
    assign(space.after, model.x)
    assign(model.x, space.before)
    return worst


@compiled
def _look(model, method, space, samples, signs, k, t, h):  # type: ignore[no-untyped-def]
    """EVENT if an indicator has another sign within a step; a status."""
    for look in range(_LOOKS.size):
        for i in range(model.x.size):
            slope = 0.0
            for s in range(7):
                slope += method.looks[look, s] * space.stages[s, i]
            model.x[i] = space.before[i] + h * slope
        status = _place(model, samples, k, t + _LOOKS[look] * h) or _cross(model, signs)
        if status:
            return status
    return OK


@compiled
def _cross(model, signs):  # type: ignore[no-untyped-def]
    """EVENT if an indicator has another sign than before, at zero too; a status."""
    status = read_indicators(model)
    for i in range(signs.size):
        if np.sign(model.indicators[i]) != signs[i]:
            return status or EVENT
    return status


@compiled
def _place(model, samples, k, t):  # type: ignore[no-untyped-def]
    """Put the FMU at model.x and a time within the interval before sample k; a status."""
    begin, end = samples.time[k - 1], samples.time[k]
    share = (t - begin) / (end - begin)
    for j in range(model.measured):
        model.u[j] = samples.begin[k, j] + share * (samples.end[k, j] - samples.begin[k, j])
    return set_time(model, t) or set_inputs(model, 0, model.measured) or set_states(model)
