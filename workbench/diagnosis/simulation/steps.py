"""Steps of a stiff model, which may have kinks, such as Coulomb friction.

Where the model is smooth, a step is linearly implicit and its Jacobian serves several. A step that
meets the model otherwise than its Jacobian says is taken again with a new one; if that does not
serve either, as where a body comes to rest under Coulomb friction, it is solved for, by Newton's
method in two halves. A body that sticks then stays where it is, without chatter.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector, zeros
from workbench.models.added import TERM
from workbench.models.fmu import FMU
from workbench.models.native import (
    OK,
    compiled,
    differentiate,
    evaluate,
    implicit,
    inlined,
    linearise,
    place,
    set_inputs,
    set_states,
    set_time,
    solve,
)

_KEPT = 8  # steps with one Jacobian: in as many samples a machine changes little
_BENT = 0.1  # share of rates by which the Jacobian may be wrong about them
_FLAT = 1e-6  # change of a state in a step, relative to its nominal value, that is nothing
_CLOSE = 1e-4  # of a step, that the last correction by Newton's method may be
_ROUNDS, _HALVED = 40, 12  # of Newton's method; times that one of its corrections is halved
# Parts of a step that is solved for. Where a term beside a rate jumps at rest, in ever more until
# the end moves by little of the step: for how far a body goes before it stops within a step; a stop
# within one of the last is met to 1e-4. Laws of a library are smooth by themselves.
_FEWEST, _MOST_PARTS, _SETTLED = 2, 32, 1e-3
_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


class Steps(NamedTuple):
    """What steps remember, and work space."""

    stiff: NDArray[np.intp]  # (p,) states that are stepped implicitly
    nominal: Vector  # (n,) sizes of the states
    a: Annotated[Matrix, "n, p"]  # columns of the Jacobian by the stiff states
    system: Annotated[Matrix, "p, 2*p"]  # I - gamma h A for them, and its inverse
    step: Annotated[Vector, "1"]  # that it is for [s]
    age: NDArray[np.intp]  # (1,) steps that the Jacobian has served
    full: Annotated[Matrix, "n, n + 1"]  # the same of all states, and Newton's correction
    # from_, to: inputs at the beginning and at the end of a step
    from_: Annotated[Vector, "m"]
    to: Annotated[Vector, "m"]
    time: Annotated[Vector, "1"]  # of the model at the beginning of a step [s]
    # x, f: states where a step begins, and their rates
    x: Annotated[Vector, "n"]
    f: Annotated[Vector, "n"]
    # rates where the first stage would lead explicitly; Newton's correction
    moved: Annotated[Vector, "n"]
    # k1, k2: slopes of the two stages
    k1: Annotated[Vector, "n"]
    k2: Annotated[Vector, "n"]
    # begin, known, scale: of a step that is solved for: where it begins, the last guess, sizes
    begin: Annotated[Vector, "n"]
    known: Annotated[Vector, "n"]
    scale: Annotated[Vector, "n"]
    coarse: Annotated[Vector, "n"]  # end of it in half as many parts
    most: NDArray[np.intp]  # (1,) parts that it is taken in at most
    picked: Annotated[Vector, "p"]  # solution of a system of the stiff states


def steps(fmu: FMU, stiff: NDArray[np.intp], inputs: int) -> Steps:
    """Work space for an FMU.

    Parameters
    ----------
    stiff : states that are stepped implicitly.
    inputs : number of measured inputs.
    """
    n, p = len(fmu.states), stiff.size
    nominal = {v.name: v.nominal for v in fmu.description.variables}
    sharp = any(name.startswith(TERM) for name in nominal)
    return zeros(
        Steps,
        {"n": n, "p": p, "m": inputs},
        stiff=stiff,
        nominal=fmu.sizes(fmu.states),
        age=np.full(1, _KEPT),
        most=np.array([_MOST_PARTS if sharp else _FEWEST]),
    )


@inlined
def restart(work):  # type: ignore[no-untyped-def]
    """Forget the Jacobian, as where a motion begins anew."""
    work.age[0] = _KEPT


@inlined
def _renew(model, work, h, anew):  # type: ignore[no-untyped-def]
    """Make work.system (p, 2 p), [I - gamma h A, its inverse] of the p stiff states; a status.

    A = df/dx of the stiff states, (n, p), is that here or the one that is kept; h [s].
    """
    n, p = model.x.size, work.stiff.size
    if anew:
        work.age[0] = 0
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


@inlined
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
def _begun(model, work, h, anew):  # type: ignore[no-untyped-def]
    """First stage of a step from work.x, whose rates are work.f; returns a status.

    Afterwards model.x is where this stage leads, model.dx its rates, work.k1 its slope and
    work.k2 what of it is the change of the inputs.
    """
    n, k1, k2 = model.x.size, work.k1, work.k2
    status = _renew(model, work, h, anew)
    if status:
        return status
    work.age[0] += 1
    for j in range(work.to.size):
        model.u[j] = work.to[j]
    for i in range(n):
        k1[i] = work.f[i]
        model.x[i] = work.x[i] + h * k1[i]
    for i in work.stiff:
        model.x[i] = work.x[i]
    status = set_time(model, work.time[0] + h) or place(model) or evaluate(model)
    if status:
        return status
    for i in range(n):
        work.moved[i] = model.dx[i]
        k2[i] = _GAMMA * (model.dx[i] - k1[i])
        k1[i] += k2[i]
    _solve(work, h, k1)
    for i in range(n):
        model.x[i] = work.x[i] + h * k1[i]
    return set_states(model) or evaluate(model)


@inlined
def _bent(model, work, h):  # type: ignore[no-untyped-def]
    """Whether rates at the first stage differ from what the Jacobian says of them.

    Each is compared with the sizes of its own parts, so that this needs no tolerance in its unit.
    """
    for i in work.stiff:
        away = model.dx[i] - work.moved[i]
        size = abs(model.dx[i]) + abs(work.moved[i])
        for c in range(work.stiff.size):
            part = work.a[i, c] * h * work.k1[work.stiff[c]]
            away -= part
            size += abs(part)
        if abs(away) > _BENT * size and h * abs(away) > _FLAT * work.nominal[i]:
            return True
    return False


@compiled
def step(model, work, h):  # type: ignore[no-untyped-def]
    """Advance model.x by h [s] while the inputs go to work.to; returns a status.

    Rosenbrock method of two stages, L-stable, with inputs linear in time: a sampled ramp is met
    without lag, which linearly implicit Euler would show as half a sample of delay. It is of order
    2 whatever matrix stands for the Jacobian, so that one serves several steps, and only the states
    that may be stiff are treated so. What drives them, inputs and all other states, enters by its
    change over the step.
    Source: J. G. Verwer et al. (1999), SIAM J. Sci. Comput. 20, 1456-1480.
    """
    n, k1, k2 = model.x.size, work.k1, work.k2
    work.time[0] = model.time[0]
    for j in range(work.from_.size):
        work.from_[j] = model.u[j]
    if evaluate(model):
        return 1
    for i in range(n):
        work.x[i] = model.x[i]
        work.f[i] = model.dx[i]
    status = _begun(model, work, h, work.age[0] >= _KEPT)
    if status:
        return status
    bent = _bent(model, work, h)
    if bent and work.age[0] > 1:
        for j in range(work.from_.size):
            model.u[j] = work.from_[j]
        for i in range(n):
            model.x[i] = work.x[i]
        status = set_time(model, work.time[0]) or place(model)
        status = status or _begun(model, work, h, True)
        if status:
            return status
        bent = _bent(model, work, h)
    for i in range(n):
        work.scale[i] = h * max(abs(work.f[i]), abs(model.dx[i])) + _FLAT * work.nominal[i]
        k2[i] = model.dx[i] - 2.0 * k1[i] - k2[i]
    _solve(work, h, k2)
    for i in range(n):
        k2[i] = work.x[i] + h * (1.5 * k1[i] + 0.5 * k2[i])
    if not bent or _solved(model, work, h):
        for i in range(n):
            model.x[i] = k2[i]
    status = set_time(model, work.time[0] + h)
    if bent:  # parts end with the inputs of theirs
        for j in range(work.to.size):
            model.u[j] = work.to[j]
        status = status or set_inputs(model, 0, work.to.size)
    return status or set_states(model)


@compiled
def _solved(model, work, h):  # type: ignore[no-untyped-def]
    """Advance model.x from work.x by h [s], in parts that are solved for; returns a status.

    Their number is doubled until the end hardly moves. Where the last number cannot be solved for,
    the one before stands.
    """
    parts, n = _FEWEST, model.x.size
    if _in_parts(model, work, h, parts):
        return 1
    while parts < work.most[0]:
        parts *= 2
        for i in range(n):
            work.coarse[i] = model.x[i]
        if _in_parts(model, work, h, parts):
            for i in range(n):
                model.x[i] = work.coarse[i]
            break
        moved = 0.0
        for i in range(n):
            moved = max(moved, abs(model.x[i] - work.coarse[i]) / work.scale[i])
        if moved < _SETTLED:
            break
    return OK


@compiled
def _in_parts(model, work, h, parts):  # type: ignore[no-untyped-def]
    """Advance model.x from work.x by h [s], in equal parts that are solved for; returns a status.

    Each is a diagonally implicit Runge-Kutta step of two stages, L-stable and of order 2.
    Source: R. Alexander (1977), SIAM J. Numer. Anal. 14, 1006-1021.
    """
    n, length = model.x.size, h / parts
    work.age[0] = _KEPT
    for i in range(n):
        model.x[i] = work.x[i]
    for part in range(parts):
        for i in range(n):
            work.begin[i] = model.x[i]
        for stage in range(2):
            share = (part + (_GAMMA if stage == 0 else 1.0)) / parts
            for j in range(work.to.size):
                model.u[j] = work.from_[j] + share * (work.to[j] - work.from_[j])
            status = set_time(model, work.time[0] + share * h)
            if (
                status
                or set_inputs(model, 0, work.to.size)
                or _implicit(model, work, _GAMMA * length)
            ):
                return 1
            if stage == 0:
                for i in range(n):
                    slope = (model.x[i] - work.begin[i]) / _GAMMA
                    work.begin[i] += (1.0 - _GAMMA) * slope
    return OK


@compiled
def _implicit(model, work, h):  # type: ignore[no-untyped-def]
    """Solve x = work.begin + h f(x) for model.x, begun where it is; returns a status.

    Newton's method; a correction is halved until the next one is smaller, so that it finds its way
    to the narrow range of speeds in which a body sticks.
    Source: P. Deuflhard (2004), Newton Methods for Nonlinear Problems, ch. 3, natural monotonicity.
    """
    n, known = model.x.size, work.known
    if set_states(model) or evaluate(model) or linearise(model, n):
        return 1
    if evaluate(model):
        return 1
    size = _correction(model, work, h)
    for _ in range(_ROUNDS):
        share = 1.0
        for i in range(n):
            known[i] = model.x[i]
            work.moved[i] = work.full[i, n]
        for _ in range(_HALVED):
            for i in range(n):
                model.x[i] = known[i] + share * work.moved[i]
            if set_states(model) or evaluate(model):
                return 1
            left = _correction(model, work, h)
            if left <= max((1.0 - 0.25 * share) * size, _CLOSE**2):
                break
            share *= 0.5
        if not left <= max((1.0 - 0.25 * share) * size, _CLOSE**2):
            return 1
        if left < _CLOSE:
            for i in range(n):
                model.x[i] += work.full[i, n]
            return set_states(model)
        if linearise(model, n) or evaluate(model):
            return 1
        size = _correction(model, work, h)
    return 1


@compiled
def _correction(model, work, h):  # type: ignore[no-untyped-def]
    """Newton's correction becomes the last column of work.full; returns its relative size."""
    n = model.x.size
    implicit(model, h, work.full)
    for i in range(n):
        work.full[i, n] = work.begin[i] + h * model.dx[i] - model.x[i]
    if solve(work.full):
        return np.inf
    size = 0.0
    for i in range(n):
        size = max(size, abs(work.full[i, n]) / work.scale[i])
    return size
