"""Derivatives of a simulation by parameters, made beside it.

What a small change of a parameter does to the motion obeys the model's equations, linearised along
the motion: dS/dt = df/dx S + df/dp. They are stepped as the motion is, by the FMU's directional
derivatives, for all parameters at once.
Source: E. Hairer, S. P. Norsett, G. Wanner (1993), Solving Ordinary Differential Equations I,
section I.14.
"""

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Tensor, Vector, zeros
from workbench.models.fmu import FMU, References
from workbench.models.native import Instance, differentiate, direction, inlined, recover, solve

_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


class Tangent(NamedTuple):
    """Derivatives by p columns, and work space."""

    knowns: References  # (r,) parameters of all columns
    edges: NDArray[np.intp]  # (p + 1,) where each column's begin
    seeds: Vector  # (r,) ones
    # (k, p) factors by which parameters act at each sample, one row or none: they are 1
    courses: Matrix
    shares: Vector  # (p,) those of the present point
    # (p,) whether a column is of the same parameters as the one before it
    alike: NDArray[np.bool_]
    used: NDArray[np.intp]  # states that others depend on
    stiff: NDArray[np.intp]  # those of them that are stepped implicitly
    told: NDArray[np.intp]  # numbers of the outputs, behind those of the states
    states: Matrix  # (n, p) derivatives of the states that are used, zero of the others
    # derivatives of the prediction errors of each sample
    errors: Annotated[Tensor, "k, c, p"]
    # which of two points is the present one; the other is where a step begins
    turn: Annotated[NDArray[np.intp], "1"]
    # derivatives of the rates and the predicted outputs by the columns
    by_columns: Annotated[Tensor, "2, p, n + c"]
    # entries, rows, by, slopes: those by the states that are not zero: how many, of what, by which
    entries: Annotated[NDArray[np.intp], "2"]
    rows: Annotated[NDArray[np.intp], "2, n*n + n*c"]
    by: Annotated[NDArray[np.intp], "2, n*n + n*c"]
    slopes: Annotated[Matrix, "2, n*n + n*c"]
    # first, second, moved, rates: slopes of the two stages, states and rates between them
    first: Annotated[Matrix, "n, p"]
    second: Annotated[Matrix, "n, p"]
    moved: Annotated[Matrix, "n, p"]
    rates: Annotated[Matrix, "n, p"]
    system: Annotated[Matrix, "s, s + p"]  # of the s stiff states and their right sides
    along: Annotated[Vector, "n + c"]  # rates and outputs along one direction


def tangent(
    fmu: FMU,
    model: Instance,
    columns: Sequence[Sequence[str]],
    samples: int,
    stiff: NDArray[np.intp],
    absent: Sequence[str] = (),
) -> Tangent:
    """Prepare derivatives for a run, by parameters that act alike all along; see `following`.

    Parameters
    ----------
    columns : variables of the FMU that each column varies together, of a state its start.
    samples : of the run.
    stiff : states that are stepped implicitly.
    absent : components of the FMU whose states nothing depends on.
    """
    within = tuple(f"{component}." for component in absent)
    used = [i for i, name in enumerate(fmu.states) if not name.startswith(within)]
    own = np.array([i for i in stiff if i in used], np.intp)
    n, p, c = len(fmu.states), len(columns), model.y.size
    acting = [[name for name in column if name not in fmu.states] for column in columns]
    names = [name for column in acting for name in column]
    begin = [[float(state in column) for column in columns] for state in fmu.states]
    return zeros(
        Tangent,
        {"n": n, "p": p, "c": c, "k": samples if p else 1, "s": own.size},
        knowns=fmu.variables(names).references,
        edges=np.cumsum([0, *(len(column) for column in acting)]),
        seeds=np.ones(len(names)),
        courses=np.zeros((0, p)),
        shares=np.ones(p),
        alike=np.array([q > 0 and acting[q] == acting[q - 1] for q in range(p)], np.bool_),
        used=np.array(used, np.intp),
        stiff=own,
        told=np.arange(n, n + c),
        states=np.reshape(begin, (n, p)),
    )


def following(tangent: Tangent, courses: Matrix) -> Tangent:
    """The same by parameters that act by factors which change in time, (samples, p)."""
    return tangent._replace(courses=np.ascontiguousarray(courses), shares=courses[0].copy())


@inlined
def renew(model, tangent):  # type: ignore[no-untyped-def]
    """Take the derivatives of the model at the present point; returns a status.

    The point before is where a step begins.
    """
    n, p = tangent.states.shape
    unknowns = n + tangent.errors.shape[1]
    now, count = 1 - tangent.turn[0], 0
    tangent.turn[0] = now
    for j in tangent.used:
        if differentiate(model, j, unknowns):
            return 1
        for rows in (tangent.used, tangent.told):
            for i in rows:
                slope = model.jacobian[j, i]
                if slope != 0.0:
                    tangent.rows[now, count] = i
                    tangent.by[now, count] = j
                    tangent.slopes[now, count] = slope
                    count += 1
    tangent.entries[now] = count
    for q in range(p):
        first, end = tangent.edges[q], tangent.edges[q + 1]
        if first == end:
            continue
        knowns, seeds, along = tangent.knowns[first:], tangent.seeds[first:end], tangent.along
        if not tangent.alike[q] and direction(
            model, model.unknowns, knowns, seeds, along[:unknowns]
        ):
            return 1
        for i in range(unknowns):
            tangent.by_columns[now, q, i] = tangent.shares[q] * tangent.along[i]
    return recover(model)


@inlined
def share(tangent, k, part):  # type: ignore[no-untyped-def]
    """Take the factors of parameters at a part of the way from sample k - 1 to sample k."""
    if tangent.courses.shape[0] > 0:
        for q in range(tangent.shares.size):
            before = tangent.courses[k - 1, q]
            tangent.shares[q] = before + part * (tangent.courses[k, q] - before)


@inlined
def _product(tangent, at, states, rows, first, result):  # type: ignore[no-untyped-def]
    """Derivatives of some rates or outputs, by way of the states and directly.

    Parameters
    ----------
    rows : their numbers, of which `first` is the first row of the result.
    """
    p, size = states.shape[1], result.shape[0]
    by_columns = tangent.by_columns[at]
    for i in rows:
        for q in range(p):
            result[i - first, q] = by_columns[q, i]
    for k in range(tangent.entries[at]):
        i, j, slope = tangent.rows[at, k] - first, tangent.by[at, k], tangent.slopes[at, k]
        if 0 <= i < size:
            for q in range(p):
                result[i, q] += slope * states[j, q]


@inlined
def _solved(model, tangent, h, k):  # type: ignore[no-untyped-def]
    """Solve (I - gamma h A) x = k in place; A has columns by the stiff states, else zeros."""
    stiff = tangent.stiff
    a, system, s = model.jacobian, tangent.system, stiff.size
    if s == 0:
        return 0
    for r in range(s):
        for c in range(s):
            system[r, c] = -_GAMMA * h * a[stiff[c], stiff[r]]
        system[r, r] += 1.0
        for q in range(k.shape[1]):
            system[r, s + q] = k[stiff[r], q]
    status = solve(system)
    for c in range(s):
        for i in tangent.used:
            slope = _GAMMA * h * a[stiff[c], i]
            if slope != 0.0:
                for q in range(k.shape[1]):
                    k[i, q] += slope * system[c, s + q]
    for r in range(s):
        for q in range(k.shape[1]):
            k[stiff[r], q] = system[r, s + q]
    return status


@inlined
def advance(model, tangent, h):  # type: ignore[no-untyped-def]
    """Advance the derivatives of the states over a step of h [s] that ended here; a status.

    The method of `steps.step`, for equations that are linear.
    """
    if renew(model, tangent):
        return 1
    p, used = tangent.states.shape[1], tangent.used
    now, before = tangent.turn[0], 1 - tangent.turn[0]
    s, k1, k2 = tangent.states, tangent.first, tangent.second
    moved, rates = tangent.moved, tangent.rates
    _product(tangent, before, s, used, 0, k1)
    for i in used:
        for q in range(p):
            moved[i, q] = s[i, q] + h * k1[i, q]
    for i in tangent.stiff:
        for q in range(p):
            moved[i, q] = s[i, q]
    _product(tangent, now, moved, used, 0, rates)
    for i in used:
        for q in range(p):
            k2[i, q] = _GAMMA * (rates[i, q] - k1[i, q])
            k1[i, q] += k2[i, q]
    status = _solved(model, tangent, h, k1)
    for i in used:
        for q in range(p):
            moved[i, q] = s[i, q] + h * k1[i, q]
    _product(tangent, now, moved, used, 0, rates)
    for i in used:
        for q in range(p):
            k2[i, q] = rates[i, q] - 2.0 * k1[i, q] - k2[i, q]
    status = status or _solved(model, tangent, h, k2)
    for i in used:
        for q in range(p):
            s[i, q] += h * (1.5 * k1[i, q] + 0.5 * k2[i, q])
    return status


@inlined
def tell(tangent, k):  # type: ignore[no-untyped-def]
    """Derivatives of the prediction errors of sample k, where the model was differentiated."""
    errors = tangent.errors[k]
    n = tangent.states.shape[0]
    _product(tangent, tangent.turn[0], tangent.states, tangent.told, n, errors)
    for i in range(errors.shape[0]):
        for q in range(errors.shape[1]):
            errors[i, q] = -errors[i, q]
