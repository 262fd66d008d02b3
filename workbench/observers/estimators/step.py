"""The step of a model that estimators take from sample to sample, its derivatives, its error.

With A = df/dx at the beginning x, z = h A, f at the inputs u of the end, Euler's linearly implicit
step is x(h) = x + d, (I - z) d = h f. It leaves out, to first order,

    g = (h f(x, u(0)) - d)/2,  of which W g is left at its end, W = (I - z)^-1

Of any model that costs one evaluation. `follow_error` adds it up over the steps, as the model and
the corrections by samples carry it on; see `judge` for what is borne. Where it is more, as where
something swings, states get back what has added up, and from there on each step is, with inputs
that go straight and W = (I - g z)^-1,

    d   = h phi(z) f(x, u(0))
    r   = f(x + 2/3 d, u(2/3)) - f(x, u(0)) - 2/3 A d
    x(h) = x + d + 3/2 h psi(z) r
    phi = g W (I + c W + d W^2) = (R - I)/z,  psi = g^2 W (1/g + (1/g - 1) W + d W^2) = (phi - I)/z

Of a linear model x(h) = R(z) x, the function of order 3 that is L-stable, and inputs that go
straight are met without lag. Of any other one the step is of order 3, too, as in exponential
Rosenbrock methods, of which phi and psi are here rational: two evaluations and one Jacobian. The
error is estimated by what a step of order 2 would leave out, and by the rates at its end, which a
switch after the last evaluation changes. Where it is more than sensors allow, the step is taken in
parts. Sources: M. Hochbruck, A. Ostermann (2010), Exponential integrators,
Acta Numerica 19, 209-286, section 2.4; E. Hairer, G. Wanner (1996), Solving Ordinary Differential
Equations II, sections IV.6 (R, g), IV.7 and IV.8 (choice of parts).
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector, zeros
from workbench.models.fmu import FMU
from workbench.models.native import (
    OK,
    REFUSED,
    SINGULAR,
    compiled,
    evaluate,
    implicit,
    inlined,
    invert,
    linearise,
    set_point,
    set_states,
    solve,
)
from workbench.observers.layout import lag, measure, near_rest, put, stick

_G = 0.43586652150845899941601945119356  # root of g^3 - 3 g^2 + 3 g/2 - 1/6
# R = W + (W - I) (c I + d W) W: of order 2 if 1 + c + d = 1/g and 1 + 2 c + 3 d = 1/(2 g^2), and of
# order 3 as g is that root.
_D = 0.5 / _G**2 - 2.0 / _G + 1.0
_C = 1.0 / _G - 1.0 - _D
# Of order 2 with W and W^2 alone: g (a W + b W^2) for phi.
_B = 0.5 / _G**2 - 1.0 / _G
_A = 1.0 / _G - _B
_AT = 2.0 / 3.0  # of the step, where it is evaluated again

# Error of a step of order 2, as a share of the largest size of a state. The step itself is of order
# 3: z = h w of a swing is then 0.01, its error z^4/38, and 1e5 alike add up to 1e-4 of the size.
_RELATIVE = 1e-7
# Where a filter lets states walk by w sqrt(h) in a step, the same as a share of that. Its gain is
# w sqrt(h) over the noise of a sensor, so that errors which add up within its memory stay below
# this share of the noise.
_SHARE = 0.1
# Share of what noise and walks allow that is borne of Euler's steps, as a root of mean squares.
_BORNE = 0.1
_OFF = 0.335  # deviations; a 95 % band of an estimate that is off by so many covers 93 %
# Sum of squares of errors, in variances, that is borne once: that of the innovations of 200 samples
# scatters by as much.
_FIRST = 20.0
_MOST = 2000  # parts of a step that are tried, of which the last is what is left
_FINEST = 1e-9  # part of a step: where a rate jumps, an error falls no faster than the part
_SMALLEST = 1e-6  # size of a state, as a share of its nominal one, that is not told from 0
_SMALL = 1e-3  # square of an error over what is allowed, of which a step need not know more


class Step(NamedTuple):
    """What steps of a model remember, and work space: n states, m inputs and time, s unknowns."""

    # (n,) random walks of the states that a filter allows for [unit/sqrt(s)]; 0: it has none
    walk: Vector
    reach: Annotated[Vector, "n"]  # largest size that a state has had
    least: Vector  # (n,) size of a state below which it counts as nothing
    columns: int  # of the Jacobian that is left in the model: n of rates, or those of outputs, too
    accurate: Annotated[Vector, "1"]  # 1 where steps are of order 3, 0 where they are Euler's
    # of Euler's step, with its right-hand side; of a model alone one more
    system: Annotated[Matrix, "n, n + 1"]
    spread: Annotated[Matrix, "n, n + s + 1"]  # of its derivatives, and its right-hand side
    left: Annotated[Vector, "n"]  # what it leaves out, g above
    # predicted, error: what that has added up to, before and after the last sample
    predicted: Annotated[Vector, "s"]
    error: Annotated[Vector, "s"]
    # squares of it in the last sample over the innovations' variances; their number
    seen: Annotated[Vector, "2"]
    weight: Vector  # (1,) of the next sample in them
    # shown, allowed: sums over samples, of innovations and of each unknown, see `judge`
    shown: Annotated[Vector, "1 + s"]
    allowed: Annotated[Vector, "1 + s"]
    size: Annotated[Vector, "1"]  # of the next part of a step [s], 0: not yet known
    # ends, taken: shares of the step at which its parts end; number of them
    ends: Annotated[Vector, "k"]
    taken: Annotated[NDArray[np.intp], "1"]
    given: Annotated[Vector, "1"]  # 1 where parts end where those of the step before did
    coarse: Annotated[Vector, "1"]  # steps that the most parts leave too large an error of
    inputs: Annotated[Vector, "m"]  # the last sample of the inputs, and its time
    # begin, end, between: inputs and time at the beginning of a step, its end, within it
    begin: Annotated[Vector, "m"]
    end: Annotated[Vector, "m"]
    between: Annotated[Vector, "m"]
    # (m + 1,) inputs and time at the end of a model's step before, which took `lasted`
    ended: Annotated[Vector, "m"]
    lasted: Vector  # (1,) [s]
    x: Annotated[Vector, "n"]  # states that advance, of a law that keeps no others
    rates: Annotated[Vector, "n"]  # f at the beginning
    # W, pivots: see `invert`
    W: Annotated[Matrix, "n, n"]
    pivots: Annotated[NDArray[np.intp], "n"]
    # d, r: change of the states without what bends it, and by that: 3/2 h psi r; d of Euler's
    # step, too
    d: Annotated[Vector, "n"]
    r: Annotated[Vector, "n"]
    # w1, w2, w3: powers of W times a vector
    w1: Annotated[Vector, "n"]
    w2: Annotated[Vector, "n"]
    w3: Annotated[Vector, "n"]
    bend: Annotated[Vector, "n"]  # what the rates have beyond their Jacobian
    beyond: Annotated[Vector, "n"]  # that at the second evaluation, with what inputs make of it
    # bent, curved: error of d by the step of order 2; that of r, of curvature alone
    bent: Annotated[Vector, "n"]
    curved: Annotated[Vector, "n"]
    F: Annotated[Matrix, "n, s"]  # derivatives of the step by states and quantities
    # second, third, part: work space of it
    second: Annotated[Matrix, "n, n"]
    third: Annotated[Matrix, "n, n"]
    part: Annotated[Matrix, "n, s"]


def model_step(fmu: FMU, walk: Vector, inputs: int, size: int, columns: int = 0) -> Step:
    """Work space for steps of an FMU.

    Parameters
    ----------
    walk : (n,) random walks of the states [unit/sqrt(s)].
    inputs : number of measured inputs.
    size : number of states and quantities by which steps are differentiated.
    columns : see `Step`; 0: of rates alone.
    """
    n = len(fmu.states)
    return zeros(
        Step,
        {"n": n, "m": inputs + 1, "s": size, "k": _MOST + 2},
        walk=np.ascontiguousarray(walk),
        least=_SMALLEST * fmu.sizes(fmu.states),
        columns=columns or n,
        weight=np.ones(1),
        lasted=np.ones(1),
    )


@compiled
def restart(step, u):  # type: ignore[no-untyped-def]
    """Forget sizes of states and parts; u, (m + 1,), is the first sample."""
    step.size[0] = step.coarse[0] = 0.0
    for i in range(step.shown.size):
        step.shown[i], step.allowed[i] = 0.0, _FIRST
    for i in range(step.error.size):
        step.error[i] = step.predicted[i] = 0.0
    for i in range(step.reach.size):
        step.reach[i] = step.left[i] = 0.0
    for j in range(u.size):
        step.inputs[j] = u[j]
        step.ended[j] = u[j] + 1.0  # not those of a step before, of which there is none


@inlined
def interval(layout, step, before, u):  # type: ignore[no-untyped-def]
    """Set inputs at the beginning and the end of a step between two samples, (m + 1,)."""
    for j in range(u.size):
        step.begin[j] = u[j] if layout.holds[j] < 0.0 else before[j]
        step.end[j] = before[j] if layout.holds[j] > 0.0 else u[j]


@inlined
def begin_interval(model, layout, step, z, u, h):  # type: ignore[no-untyped-def]
    """Begin a step from z to the sample u, for which Euler's error needs h f(z, u(0)); a status.

    The model is at z, at inputs and time of the sample before. Before the first accurate step, z
    gets what Euler's have left out.
    """
    interval(layout, step, step.inputs, u)
    if step.accurate[0] > 0.0:
        for i in range(step.error.size):
            z[i] += step.error[i]
            step.error[i] = step.predicted[i] = 0.0
        return OK
    return _rates_at_begin(model, layout, step, u, h)


@inlined
def begin_alone(model, layout, step, z, u, h):  # type: ignore[no-untyped-def]
    """Begin a step of a model whose states nothing has corrected, see `begin_interval`; a status.

    Euler's step ends with the rate (x(h) - x)/h = f + A d, which is f(x(h)) but for what bends f
    within the step: to first order, as all that is said of the error. Where the step begins at the
    inputs that the one before has ended at, that saves an evaluation.
    """
    interval(layout, step, step.inputs, u)
    follows = step.accurate[0] == 0.0
    for j in range(u.size):
        follows = follows and step.begin[j] == step.ended[j]
    if not follows:
        return begin_interval(model, layout, step, z, u, h)
    for i in range(step.rates.size):
        step.rates[i] = h / step.lasted[0] * step.d[i]
    return OK


@inlined
def _rates_at_begin(model, layout, step, u, h):  # type: ignore[no-untyped-def]
    """Write h f(z, u(0)) to the rates; returns a status."""
    status = 0
    for j in range(u.size):
        if layout.holds[j] < 0.0 and step.begin[j] != step.inputs[j] and not status:
            status = set_point(model, step.begin)
    status = status or evaluate(model)
    for i in range(step.rates.size):
        step.rates[i] = h * model.dx[i]
    return status


@inlined
def judge(step, i, shown, allowed):  # type: ignore[no-untyped-def]
    """Add a sample to the sums; steps are accurate from the next one on if they exceed the allowed.

    Parameters
    ----------
    i : 0 of outputs, 1 + k of unknown k.
    shown, allowed : squares of the error that steps have made, and of what is borne of it.
    """
    step.shown[i] += shown
    step.allowed[i] += allowed
    if step.shown[i] > step.allowed[i]:
        step.accurate[0] = 1.0


@inlined
def judge_sample(step, P, fade, shown, count, nis):  # type: ignore[no-untyped-def]
    """Judge steps of a filter after a sample, as far as it has feedback.

    Of the error that they have made of unknowns, e, as much is borne beside their covariance P as
    makes a 95 % band cover 93 %; of outputs a tenth, beside the innovations before the sample.

    Parameters
    ----------
    shown : C e squared over the innovations' variances, of `count` outputs.
    nis : the same of the innovations: where they are larger than noise and walks allow, they say
        what matters. An outlier counts as three standard deviations.
    """
    if step.accurate[0] > 0.0:
        return
    weight = fade * step.weight[0]
    judge(step, 0, weight * shown, weight * _BORNE * _BORNE * max(count, min(nis, 9.0 * count)))
    for i in range(step.error.size):
        if P[i, i] > 0.0:
            square = step.error[i] * step.error[i]
            judge(step, 1 + i, weight * square / P[i, i], weight * _OFF * _OFF)


def unbearable(step: Step) -> bool:
    """Whether Euler's steps made more than a tenth of an open loop's errors over a recording."""
    return bool(step.accurate[0] or (step.shown > _BORNE**2 * step.allowed).any())


@inlined
def _interpolate(step, share):  # type: ignore[no-untyped-def]
    """Inputs and time at a share of the step, which is exact at 0 and 1."""
    for j in range(step.end.size):
        step.between[j] = (1.0 - share) * step.begin[j] + share * step.end[j]


@inlined
def _multiply(A, v, w):  # type: ignore[no-untyped-def]
    """Write A v to w."""
    for i in range(v.size):
        total = 0.0
        for k in range(v.size):
            total += A[i, k] * v[k]
        w[i] = total


@inlined
def _powers(step, v):  # type: ignore[no-untyped-def]
    """Make step.w1, w2 and w3 W v, W^2 v and W^3 v."""
    _multiply(step.W, v, step.w1)
    _multiply(step.W, step.w1, step.w2)
    _multiply(step.W, step.w2, step.w3)


@compiled
def _stages(model, step, z, h, first, last):  # type: ignore[no-untyped-def]
    """Change of the states in a part of h [s], from share `first` to `last` of the step; a status.

    The model is at z, its Jacobian there in model.jacobian.
    """
    n, f, d, r, error = model.x.size, step.rates, step.d, step.r, step.bent
    w1, w2, w3, bend, part = step.w1, step.w2, step.w3, step.bend, _G * h
    for i in range(n):
        for j in range(n):
            step.W[i, j] = -part * model.jacobian[j, i]
        step.W[i, i] += 1.0
    if invert(step.W, step.pivots):
        return SINGULAR
    _powers(step, f)
    for i in range(n):
        d[i] = part * (w1[i] + _C * w2[i] + _D * w3[i])
        error[i] = d[i] - part * (_A * w1[i] + _B * w2[i])
        model.x[i] = z[i] + _AT * d[i]
    _interpolate(step, first + _AT * (last - first))
    if set_point(model, step.between) or set_states(model) or evaluate(model):
        return REFUSED
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += model.jacobian[j, i] * d[j]
        bend[i] = step.beyond[i] = model.dx[i] - f[i] - _AT * total
    _bent(step, part, r)
    return OK


@inlined
def _bent(step, part, r):  # type: ignore[no-untyped-def]
    """Write 3/2 h psi bend to r; part = g h."""
    w1, w2, w3 = step.w1, step.w2, step.w3
    _powers(step, step.bend)
    for i in range(r.size):
        r[i] = 1.5 * part * (w1[i] + (1.0 - _G) * w2[i] + _G * _D * w3[i])


@compiled
def _tell_apart(model, step, z, h):  # type: ignore[no-untyped-def]
    """Add what curvature alone makes of a part of h [s] to the error, without inputs; a status.

    Inputs that go straight are no error. The model has the inputs of the second evaluation.
    """
    n = model.x.size
    for i in range(n):
        model.x[i] = z[i]
    if set_states(model) or evaluate(model):
        return REFUSED
    for i in range(n):
        step.bend[i] -= model.dx[i] - step.rates[i]
    _bent(step, _G * h, step.curved)
    return OK


@compiled
def _look_at_end(model, step, z, h, last):  # type: ignore[no-untyped-def]
    """Add what a switch within a part of h [s] makes of it to the error; a status.

    What the rates have beyond their Jacobian grows from the second evaluation to the end as inputs
    that go straight, by 1/s, or as curvature, by 1/s^2, or between. A jump that adds m to it after
    that evaluation, at the share s, errs by (1 - s) h W m at most.
    """
    n = model.x.size
    for i in range(n):
        model.x[i] = z[i] + step.d[i] + step.r[i]
    _interpolate(step, last)
    if set_point(model, step.between) or set_states(model) or evaluate(model):
        return REFUSED
    for i in range(n):
        jump = model.dx[i] - step.rates[i]
        for j in range(n):
            jump -= model.jacobian[j, i] * (step.d[j] + step.r[j])
        straight, curved = step.beyond[i] / _AT, step.beyond[i] / (_AT * _AT)
        most, least = max(straight, curved), min(straight, curved)
        step.bend[i] = (1.0 - _AT) * h * (jump - max(min(jump, most), least))
    _multiply(step.W, step.bend, step.curved)
    return OK


@inlined
def _error(step, z, h, bent):  # type: ignore[no-untyped-def]
    """Square of the largest error of a part of a step over what is allowed of it.

    NaN where it is none; at least `_SMALL`, which says nothing. `bent` is the error of a step of
    order 2 beside that of d.
    """
    worst, walks = _SMALL, _SHARE * _SHARE * h
    for i in range(step.d.size):
        moved = z[i] + step.d[i] + step.r[i]
        reach = _RELATIVE * max(max(step.reach[i], step.least[i]), max(abs(z[i]), abs(moved)))
        allowed = max(walks * step.walk[i] * step.walk[i], reach * reach)
        error = abs(step.bent[i]) + abs(bent[i])
        square = error * error
        if not square <= worst * allowed:
            worst = square / allowed
    return worst


@compiled
def _derivatives(model, step, h, F):  # type: ignore[no-untyped-def]
    """Write the derivatives of a part of h [s] to F, (n, s), rows of states: [R, h phi B].

    R = (1 - c) W + (c - d) W^2 + d W^3.
    """
    g, c, d = _G, _C, _D
    n, s = F.shape
    W, second, third = step.W, step.second, step.third
    for i in range(n):
        for j in range(n):
            second[i, j] = third[i, j] = 0.0
    for i in range(n):
        for k in range(n):
            factor = W[i, k]
            for j in range(n):
                second[i, j] += factor * W[k, j]
    for i in range(n):
        for k in range(n):
            factor = W[i, k]
            for j in range(n):
                third[i, j] += factor * second[k, j]
    for i in range(n):
        for j in range(n):
            F[i, j] = (1.0 - c) * W[i, j] + (c - d) * second[i, j] + d * third[i, j]
            third[i, j] = g * h * (W[i, j] + c * second[i, j] + d * third[i, j])
        for j in range(n, s):
            total = 0.0
            for k in range(n):
                total += third[i, k] * model.jacobian[j, k]
            F[i, j] = total


@compiled
def _follow(step):  # type: ignore[no-untyped-def]
    """F <- [part; 0, I] F."""
    F, part, w = step.F, step.part, step.w1
    n, s = F.shape
    for j in range(s):
        for i in range(n):
            w[i] = part[i, j] if j >= n else 0.0
            for k in range(n):
                w[i] += part[i, k] * F[k, j]
        for i in range(n):
            F[i, j] = w[i]


@inlined
def euler(model, layout, step, z, h, differentiated):  # type: ignore[no-untyped-def]
    """Take one linearly implicit Euler step, see `advance`; the model is at z, inputs of its end.

    Its derivatives are (I - hA)^-1 [I, hB]; the rows of quantities are those of a unit matrix.
    """
    n, system, spread = model.x.size, step.system, step.spread
    size = step.F.shape[1]
    status = linearise(model, step.columns) or evaluate(model)
    if differentiated:
        implicit(model, h, spread)
        for i in range(n):
            for j in range(n):
                spread[i, n + j] = 1.0 if j == i else 0.0
            for j in range(n, size):
                spread[i, n + j] = h * model.jacobian[j, i]
            spread[i, n + size] = h * model.dx[i]
        status = status or solve(spread)
        for i in range(n):
            for j in range(size):
                step.F[i, j] = spread[i, n + j]
            step.d[i] = spread[i, n + size]
    else:
        implicit(model, h, system)
        for i in range(n):
            system[i, n] = h * model.dx[i]
        status = status or solve(system)
        for i in range(n):
            step.d[i] = system[i, n]
    before = lag(layout, z)
    for i in range(n):
        z[i] += step.d[i]
        step.left[i] = 0.5 * (step.rates[i] - step.d[i])
    stick(layout, z, before)
    return status


@compiled
def follow_error(step):  # type: ignore[no-untyped-def]
    """Carry what Euler's steps have left out on by the last one: error -> F error + W g."""
    n, size = step.F.shape
    if step.accurate[0] > 0.0:
        return
    for i in range(size):
        step.predicted[i] = step.error[i] if i >= n else 0.0
    for i in range(n):
        for k in range(size):
            step.predicted[i] += step.F[i, k] * step.error[k]
        for k in range(n):
            step.predicted[i] += step.F[i, k] * step.left[k]
    for i in range(size):
        step.error[i] = step.predicted[i]


@compiled
def advance(model, layout, step, z, h, differentiated):  # type: ignore[no-untyped-def]
    """Advance states by h [s], in which quantities stay and inputs go from begin to end; a status.

    Parameters
    ----------
    z : (n + q,) states, which advance, and corrections; not model.x.
    differentiated : whether derivatives of the step become step.F.
    """
    if step.accurate[0] == 0.0:
        return put(model, z) or euler(model, layout, step, z, h, differentiated)
    return _go_in_parts(model, layout, step, z, h, differentiated)


@compiled
def _go_in_parts(model, layout, step, z, h, differentiated):  # type: ignore[no-untyped-def]
    """Take steps of order 3, as many as their error asks for; see `advance`."""
    n, done, part, share, given = model.x.size, 0.0, h, 1.0, step.given[0] > 0.0
    if not given:
        step.taken[0], step.ends[0] = 1, 1.0
    if near_rest(layout, z):
        # Friction has a kink there that parts of a step would chase and no sensor shows.
        status = measure(model, step.end) or put(model, z)
        return status or euler(model, layout, step, z, h, differentiated)
    if 0.0 < step.size[0] < h:
        share = 1.0 / np.ceil(h / step.size[0])
        part = share * h
    renewed, tried, taken = False, 0, 0
    while done < 1.0:
        if renewed:
            status = put(model, z)
        else:
            _interpolate(step, done)
            status = measure(model, step.between) or put(model, z)
            status = status or linearise(model, step.columns) or evaluate(model)
            for i in range(n):
                step.rates[i] = model.dx[i]
        if status:
            return status
        tried += 1
        if given:
            share = step.ends[taken] - done
        elif tried > _MOST:
            share = 1.0 - done
        part = share * h
        last = 1.0 if done + 1.5 * share > 1.0 else done + share
        if given:
            last = step.ends[taken]
        status = _stages(model, step, z, part, done, last)
        if status == REFUSED:
            return status
        square = np.inf if status else _error(step, z, h, step.r)
        if given and not status:
            square = 1.0
        if not square <= 1.0 and square < np.inf:
            if _tell_apart(model, step, z, part):
                return REFUSED
            square = _error(step, z, h, step.curved)
        if not given and square <= 1.0:
            if _look_at_end(model, step, z, part, last):
                return REFUSED
            ended = _error(step, z, h, step.curved)
            square = square if ended <= square else ended  # also what is no number
        if not given and not square <= 1.0 and share > _FINEST and tried <= _MOST:
            factor = max(0.9 / square ** (1.0 / 6.0), 0.2) if square < np.inf else 0.2
            share = (1.0 - done) / np.ceil((1.0 - done) / (factor * share) - 1e-9)
            part, renewed = share * h, True
            continue
        if status:
            return status
        if not square <= 1.0 and tried > _MOST:
            step.coarse[0] += 1.0
        before = lag(layout, z)
        for i in range(n):
            step.reach[i] = max(step.reach[i], abs(z[i]))
            z[i] += step.d[i] + step.r[i]
        stick(layout, z, before)
        if differentiated and done == 0.0:
            _derivatives(model, step, part, step.F)
        elif differentiated:
            _derivatives(model, step, part, step.part)
            _follow(step)
        done, renewed = last, False
        taken += 1
        if not given:
            step.ends[taken - 1], step.taken[0] = last, taken
        if share < 1.0 and not given:
            grown = share * 0.9 / square ** (1.0 / 6.0)
            step.size[0] = h * grown
            if done < 1.0:
                share = (1.0 - done) / np.ceil((1.0 - done) / grown - 1e-9)
                part = share * h
    return OK
