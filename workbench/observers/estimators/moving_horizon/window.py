"""The least-squares problem over the last samples, linearised, and its solution.

Unknown are the nodes s_k of N steps, states and quantities after the noise of the model, in

    |s_0 - mean|^2 / (covariance + Q_0)
    + sum |s_k - step(s_k-1)|^2 / Q_k + sum |y_k - output|^2 / R_k

`solve_free` is a Kalman filter over the nodes and back: the Riccati recursion of the problem. The
way back is that of the costates, which inverts nothing, so that quantities without noise are
allowed. Sources: A. Bryson, M. Frazier (1963), Smoothing for linear and nonlinear dynamic systems;
G. Bierman (1973), Automatica 9, 503-508.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Tensor, Vector, zeros
from workbench.models.native import assign, compiled, inlined
from workbench.observers.estimators.kalman import carry
from workbench.observers.layout import assign_rows

# Share of its variance that rounding leaves to what other bounds already determine.
DETERMINED = 1e-12


class Data(NamedTuple):
    """What was measured along the last N steps, oldest first, and how the model moves there.

    s unknowns at a node (n states), m inputs, l outputs.
    """

    filled: Annotated[NDArray[np.intp], "1"]  # nodes that are there
    # mean, covariance: of the first node before the noise of the model; all older samples
    mean: Annotated[Vector, "s"]
    covariance: Annotated[Matrix, "s, s"]
    # low, high: (s,) bounds
    low: Vector
    high: Vector
    nodes: Annotated[Matrix, "N, s"]  # where the steps are linearised
    # inputs, reached, samples, steps: of the step of each node, at its beginning and at its end
    inputs: Annotated[Matrix, "N, m"]
    reached: Annotated[Matrix, "N, m"]
    samples: Annotated[Matrix, "N, l"]
    steps: Annotated[Vector, "N"]
    noise: Annotated[Matrix, "N, s"]  # variances of the model's noise
    levels: Annotated[Matrix, "N, l"]  # variances of samples
    arrived: Annotated[Matrix, "N, s"]  # where a step from the node leads
    F: Annotated[Tensor, "N, n, s"]  # its derivatives
    slopes: Annotated[Tensor, "N, l, s"]  # derivatives of outputs there
    errors: Annotated[Matrix, "N, l"]  # samples less outputs
    weight: Matrix  # (N, l) share of a sample's information that counts
    # (N, s) variance of the model's noise over what is declared, less where levels are learnt
    wider: Matrix
    older: Vector  # (s,) of the node before
    alert: Annotated[NDArray[np.intp], "1"]  # whether it may be wider


class Solution(NamedTuple):
    """The best change of the nodes, and how it was found; rows are l outputs, then s bounds."""

    active: Annotated[NDArray[np.intp], "N, s"]  # 1 at the upper bound, -1 at the lower one
    multiplier: Annotated[Matrix, "N, s"]  # of it
    scale: Annotated[Matrix, "N, s"]  # variances without bounds
    offset: Annotated[Matrix, "N, s"]  # filtered less node
    spread: Annotated[Tensor, "N, s, s"]  # covariance of it
    # gain, total, surprise, force: of samples and bounds, see `measurement_update`
    gain: Annotated[Tensor, "N, l + s, s"]
    total: Annotated[Matrix, "N, l + s"]
    surprise: Annotated[Matrix, "N, l + s"]
    force: Annotated[Matrix, "N, l + s"]
    change: Annotated[Matrix, "N, s"]  # best node less node
    # next_mean, next_covariance: as mean and covariance of the data, of the second node
    next_mean: Annotated[Vector, "s"]
    next_covariance: Annotated[Matrix, "s, s"]
    before: Annotated[Matrix, "s, s"]  # covariance of the last arrival before its sample
    moved: Annotated[Vector, "s"]  # by the sample
    costates: Annotated[Matrix, "N, s"]  # of the nodes: what noise does to the cost
    # error, P: of the arrival that the filter is at
    error: Annotated[Vector, "s"]
    P: Annotated[Matrix, "s, s"]


class Scratch(NamedTuple):
    """Work space."""

    costate: Annotated[Vector, "s"]
    work: Annotated[Vector, "s"]
    product: Annotated[Matrix, "n, s"]


class Window(NamedTuple):
    """A least-squares problem, its solution, and room to work in."""

    data: Data
    solution: Solution
    scratch: Scratch


def window(N: int, n: int, m: int, outputs: int, low: Vector, high: Vector) -> Window:
    """An empty window of N nodes of a model with so many states, inputs and outputs."""
    s = low.size
    sizes = {"N": N, "n": n, "m": m, "l": outputs, "s": s}
    wide = {"weight": np.ones((N, outputs)), "wider": np.ones((N, s)), "older": np.ones(s)}
    data = zeros(Data, sizes, low=low, high=high, **wide)
    return Window(data, zeros(Solution, sizes), zeros(Scratch, sizes))


@compiled
def shift(window):  # type: ignore[no-untyped-def]
    """Forget the oldest node: what it tells becomes the mean and covariance of the next one."""
    data, solution = window.data, window.solution
    last = data.filled[0] - 1
    assign(data.mean, solution.next_mean)
    assign(data.older, data.wider[0])
    assign_rows(data.covariance, solution.next_covariance)
    assign(data.steps[:last], data.steps[1:])
    assign_rows(data.inputs[:last], data.inputs[1:])
    assign_rows(data.reached[:last], data.reached[1:])
    assign_rows(data.nodes[:last], data.nodes[1:])
    assign_rows(data.noise[:last], data.noise[1:])
    assign_rows(data.arrived[:last], data.arrived[1:])
    assign_rows(data.errors[:last], data.errors[1:])
    for k in range(last):
        assign_rows(data.F[k], data.F[k + 1])
        assign_rows(data.slopes[k], data.slopes[k + 1])
    assign_rows(solution.active[:last], solution.active[1:])
    assign_rows(data.samples[:last], data.samples[1:])
    assign_rows(data.levels[:last], data.levels[1:])
    assign_rows(data.weight[:last], data.weight[1:])
    assign_rows(data.wider[:last], data.wider[1:])
    data.filled[0] = last


@compiled
def measurement_update(solution, v, c, at, residual, variance):  # type: ignore[no-untyped-def]
    """Correct error and P by a sample of unknown `at`, or of an output with slopes c, `at` < 0.

    Returns what the way back needs beside v = P c: c'P c + variance, and residual - c'error.
    """
    P, error = solution.P, solution.error
    s = error.size
    if at >= 0:
        for i in range(s):
            v[i] = P[i, at]
        total, surprise = v[at] + variance, residual - error[at]
    else:
        total, surprise = variance, residual
        for i in range(s):
            v[i] = 0.0
            for j in range(s):
                v[i] += P[i, j] * c[j]
            total += c[i] * v[i]
            surprise -= c[i] * error[i]
    inverse = 1.0 / total
    for i in range(s):
        factor = v[i] * inverse
        error[i] += factor * surprise
        for j in range(i + 1):
            P[i, j] -= factor * v[j]
            P[j, i] = P[i, j]
    return total, surprise


@compiled
def _filter(window, seen, bounded, damping):  # type: ignore[no-untyped-def]
    """Filter along the nodes; error and P are then those of the last arrival."""
    data, solution, scratch = window.data, window.solution, window.scratch
    P, error, outputs = solution.P, solution.error, seen.size
    s, n = error.size, data.F.shape[1]
    for k in range(data.filled[0]):
        d, F = solution.offset[k], data.F[k]
        for i in range(s):
            before = data.mean[i] if k == 0 else data.arrived[k - 1, i] + error[i]
            d[i] = before - data.nodes[k, i]
            for j in range(s):
                if k == 0:
                    P[i, j] = data.covariance[i, j]
                if i == j:
                    P[i, i] += data.noise[k, i] * data.wider[k, i]
                solution.spread[k, i, j] = P[i, j]
        carry(F, P, scratch.product)
        for i in range(n):
            error[i] = 0.0
            for j in range(s):
                error[i] += F[i, j] * d[j]
        for i in range(n, s):
            error[i] = d[i]
        if k == data.filled[0] - 1:
            assign_rows(solution.before, P)
            assign(solution.moved, error)
        for j in range(outputs):
            solution.total[k, j] = 0.0
            if not np.isnan(data.errors[k, j]):
                variance = data.levels[k, j] / data.weight[k, j]
                solution.total[k, j], solution.surprise[k, j] = measurement_update(
                    solution,
                    solution.gain[k, j],
                    data.slopes[k, j],
                    seen[j],
                    data.errors[k, j],
                    variance,
                )
        if k == data.filled[0] - 1:
            for i in range(s):
                solution.moved[i] = error[i] - solution.moved[i]
        if k == 0:
            assign_rows(solution.next_covariance, P)
            for i in range(s):
                solution.next_mean[i] = data.arrived[0, i] + error[i]
        for i in range(s):
            solution.total[k, outputs + i] = 0.0
            if not bounded:
                solution.scale[k, i] = P[i, i]
            elif abs(solution.active[k, i]) == 1 and P[i, i] > DETERMINED * solution.scale[k, i]:
                limit = data.high[i] if solution.active[k, i] > 0 else data.low[i]
                row, missing = outputs + i, limit - data.arrived[k, i]
                solution.total[k, row], solution.surprise[k, row] = measurement_update(
                    solution, solution.gain[k, row], scratch.work, i, missing, 0.0
                )
            elif damping > 0.0 and solution.scale[k, i] > 0.0:
                row = outputs + i
                solution.total[k, row], solution.surprise[k, row] = measurement_update(
                    solution,
                    solution.gain[k, row],
                    scratch.work,
                    i,
                    0.0,
                    solution.scale[k, i] / damping,
                )


@compiled
def _react(costate, v, c, at, total, surprise):  # type: ignore[no-untyped-def]
    """Force of a sample, which changes the costate; see `measurement_update`."""
    if total == 0.0:
        return 0.0
    force = surprise
    for i in range(costate.size):
        force += v[i] * costate[i]
    force /= total
    if at >= 0:
        costate[at] -= force
    else:
        for i in range(costate.size):
            costate[i] -= c[i] * force
    return force


@compiled
def _smooth(window, seen):  # type: ignore[no-untyped-def]
    """Forces of samples and bounds, and the best change of each node, from the last one back."""
    data, solution, scratch = window.data, window.solution, window.scratch
    costate, work, outputs = scratch.costate, scratch.work, seen.size
    s, n = costate.size, data.F.shape[1]
    for i in range(s):
        costate[i] = 0.0
    for k in range(data.filled[0] - 1, -1, -1):
        F = data.F[k]
        for i in range(s - 1, -1, -1):
            row = outputs + i
            solution.force[k, row] = _react(
                *(costate, solution.gain[k, row], work, i),
                *(solution.total[k, row], solution.surprise[k, row]),
            )
        for j in range(outputs - 1, -1, -1):
            solution.force[k, j] = _react(
                *(costate, solution.gain[k, j], data.slopes[k, j], seen[j]),
                *(solution.total[k, j], solution.surprise[k, j]),
            )
        for j in range(s):
            work[j] = costate[j] if j >= n else 0.0
            for i in range(n):
                work[j] += F[i, j] * costate[i]
        for i in range(s):
            costate[i] = solution.costates[k, i] = work[i]
        for i in range(s):
            solution.change[k, i] = solution.offset[k, i]
            for j in range(s):
                solution.change[k, i] -= solution.spread[k, i, j] * costate[j]


@inlined
def solve_free(window, seen):  # type: ignore[no-untyped-def]
    """Solve without bounds; P is then the covariance of the last arrival, error its filtered mean.

    Parameters
    ----------
    seen : (l,) see Layout.
    """
    _filter(window, seen, False, 0.0)
    _smooth(window, seen)


@inlined
def solve_damped(window, seen, damping):  # type: ignore[no-untyped-def]
    """Solve with bounds, and with each unknown drawn to where it is."""
    _filter(window, seen, True, damping)
    _smooth(window, seen)


@inlined
def solve_bounded(window, seen):  # type: ignore[no-untyped-def]
    """Solve with the bounds that are active as samples without noise."""
    _filter(window, seen, True, 0.0)
    _smooth(window, seen)


@inlined
def end(window, k, i):  # type: ignore[no-untyped-def]
    """Unknown i where the best step from node k leads."""
    data, solution = window.data, window.solution
    n = data.F.shape[1]
    if i >= n:
        return data.arrived[k, i] + solution.change[k, i]
    total = data.arrived[k, i]
    for j in range(data.mean.size):
        total += data.F[k, i, j] * solution.change[k, j]
    return total
