"""The least-squares problem over the last samples, linearised, and its solution.

Unknown are the nodes s_k of N steps, states and quantities after the noise of the model, in

    |s_0 - mean|^2 / (covariance + Q_0)
    + sum |s_k - step(s_k-1)|^2 / Q_k + sum |y_k - output|^2 / R_k

`solve_free` is a Kalman filter over the nodes and back: the Riccati recursion of the problem. The
way back is that of the costates, which inverts nothing, so that quantities without noise are
allowed. Sources: A. Bryson, M. Frazier (1963), Smoothing for linear and nonlinear dynamic systems;
G. Bierman (1973), Automatica 9, 503-508.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.models.native import compiled, inlined
from workbench.observers.estimators.kalman import carry
from workbench.observers.layout import assign, assign_rows

Tensor = NDArray[np.float64]

# Share of its variance that rounding leaves to what other bounds already determine.
DETERMINED = 1e-12


class Window(NamedTuple):
    """Nodes of the last N steps, oldest first, what was measured, and work space.

    s unknowns at a node (n states), m inputs, l outputs; rows of samples: l of outputs, then s of
    bounds.

    Attributes
    ----------
    filled : (1,) nodes that are there.
    mean, covariance : of the first node before the noise of the model; all older samples.
    low, high : (s,) bounds.
    nodes : (N, s) where the steps are linearised; inputs, samples, steps : of each node's step;
        reached : (N, m) inputs at its end.
    noise : (N, s) variances of the model's noise; levels : (N, l) variances of samples.
    arrived : (N, s) where a step from the node leads; F : (N, n, s) its derivatives.
    slopes : (N, l, s) derivatives of outputs there; errors : (N, l) samples less outputs.
    weight : (N, l) share of a sample's information that counts; wider : (N, s) variance of the
        model's noise over what is declared, less where levels are learnt; older : (s,) of the node
        before; alert : (1,) whether it may be wider.
    active : (N, s) 1 at the upper bound, -1 at the lower one; multiplier : (N, s) of it.
    scale : (N, s) variances without bounds.
    offset : (N, s) filtered less node; spread : (N, s, s) covariance of it.
    gain : (N, l + s, s), total, surprise, force : (N, l + s) of samples and bounds, see
        `measurement_update`.
    change : (N, s) best node less node.
    next_mean, next_covariance : as mean and covariance, of the second node.
    before : (s, s) covariance of the last arrival before its sample; moved : (s,) by the sample.
    costates : (N, s) of the nodes: what noise does to the cost.
    costate, error, work : (s,); product : (n, s); P : (s, s).
    """

    filled: NDArray[np.intp]
    mean: Vector
    covariance: Matrix
    low: Vector
    high: Vector
    nodes: Matrix
    inputs: Matrix
    reached: Matrix
    samples: Matrix
    steps: Vector
    noise: Matrix
    levels: Matrix
    arrived: Matrix
    F: Tensor
    slopes: Tensor
    errors: Matrix
    weight: Matrix
    wider: Matrix
    older: Vector
    alert: NDArray[np.intp]
    active: NDArray[np.intp]
    multiplier: Matrix
    scale: Matrix
    offset: Matrix
    spread: Tensor
    gain: Tensor
    total: Matrix
    surprise: Matrix
    force: Matrix
    change: Matrix
    next_mean: Vector
    next_covariance: Matrix
    before: Matrix
    moved: Vector
    costates: Matrix
    costate: Vector
    error: Vector
    work: Vector
    product: Matrix
    P: Matrix


def window(N: int, n: int, m: int, outputs: int, low: Vector, high: Vector) -> Window:
    """An empty window of N nodes of a model with so many states, inputs and outputs."""
    s = low.size
    rows = outputs + s
    return Window(
        filled=np.zeros(1, np.intp),
        mean=np.zeros(s),
        covariance=np.zeros((s, s)),
        low=low,
        high=high,
        nodes=np.zeros((N, s)),
        inputs=np.zeros((N, m)),
        reached=np.zeros((N, m)),
        samples=np.zeros((N, outputs)),
        steps=np.zeros(N),
        noise=np.zeros((N, s)),
        levels=np.zeros((N, outputs)),
        arrived=np.zeros((N, s)),
        F=np.zeros((N, n, s)),
        slopes=np.zeros((N, outputs, s)),
        errors=np.zeros((N, outputs)),
        weight=np.ones((N, outputs)),
        wider=np.ones((N, s)),
        older=np.ones(s),
        alert=np.zeros(1, np.intp),
        active=np.zeros((N, s), np.intp),
        multiplier=np.zeros((N, s)),
        scale=np.zeros((N, s)),
        offset=np.zeros((N, s)),
        spread=np.zeros((N, s, s)),
        gain=np.zeros((N, rows, s)),
        total=np.zeros((N, rows)),
        surprise=np.zeros((N, rows)),
        force=np.zeros((N, rows)),
        change=np.zeros((N, s)),
        next_mean=np.zeros(s),
        next_covariance=np.zeros((s, s)),
        before=np.zeros((s, s)),
        moved=np.zeros(s),
        costates=np.zeros((N, s)),
        costate=np.zeros(s),
        error=np.zeros(s),
        work=np.zeros(s),
        product=np.zeros((n, s)),
        P=np.zeros((s, s)),
    )


@compiled
def shift(window):  # type: ignore[no-untyped-def]
    """Forget the oldest node: what it tells becomes the mean and covariance of the next one."""
    last = window.filled[0] - 1
    assign(window.mean, window.next_mean)
    assign(window.older, window.wider[0])
    assign_rows(window.covariance, window.next_covariance)
    assign(window.steps[:last], window.steps[1:])
    assign_rows(window.inputs[:last], window.inputs[1:])
    assign_rows(window.reached[:last], window.reached[1:])
    assign_rows(window.nodes[:last], window.nodes[1:])
    assign_rows(window.noise[:last], window.noise[1:])
    assign_rows(window.arrived[:last], window.arrived[1:])
    assign_rows(window.errors[:last], window.errors[1:])
    for k in range(last):
        assign_rows(window.F[k], window.F[k + 1])
        assign_rows(window.slopes[k], window.slopes[k + 1])
    assign_rows(window.active[:last], window.active[1:])
    assign_rows(window.samples[:last], window.samples[1:])
    assign_rows(window.levels[:last], window.levels[1:])
    assign_rows(window.weight[:last], window.weight[1:])
    assign_rows(window.wider[:last], window.wider[1:])
    window.filled[0] = last


@compiled
def measurement_update(P, error, v, c, at, residual, variance):  # type: ignore[no-untyped-def]
    """Correct error and P by a sample of unknown `at`, or of an output with slopes c, `at` < 0.

    Returns what the way back needs beside v = P c: c'P c + variance, and residual - c'error.
    """
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
    P, error, outputs = window.P, window.error, seen.size
    s, n = error.size, window.F.shape[1]
    for k in range(window.filled[0]):
        d, F = window.offset[k], window.F[k]
        for i in range(s):
            before = window.mean[i] if k == 0 else window.arrived[k - 1, i] + error[i]
            d[i] = before - window.nodes[k, i]
            for j in range(s):
                if k == 0:
                    P[i, j] = window.covariance[i, j]
                if i == j:
                    P[i, i] += window.noise[k, i] * window.wider[k, i]
                window.spread[k, i, j] = P[i, j]
        carry(F, P, window.product)
        for i in range(n):
            error[i] = 0.0
            for j in range(s):
                error[i] += F[i, j] * d[j]
        for i in range(n, s):
            error[i] = d[i]
        if k == window.filled[0] - 1:
            assign_rows(window.before, P)
            assign(window.moved, error)
        for j in range(outputs):
            window.total[k, j] = 0.0
            if not np.isnan(window.errors[k, j]):
                variance = window.levels[k, j] / window.weight[k, j]
                window.total[k, j], window.surprise[k, j] = measurement_update(
                    *(P, error, window.gain[k, j], window.slopes[k, j]),
                    *(seen[j], window.errors[k, j], variance),
                )
        if k == window.filled[0] - 1:
            for i in range(s):
                window.moved[i] = error[i] - window.moved[i]
        if k == 0:
            assign_rows(window.next_covariance, P)
            for i in range(s):
                window.next_mean[i] = window.arrived[0, i] + error[i]
        for i in range(s):
            window.total[k, outputs + i] = 0.0
            if not bounded:
                window.scale[k, i] = P[i, i]
            elif abs(window.active[k, i]) == 1 and P[i, i] > DETERMINED * window.scale[k, i]:
                limit = window.high[i] if window.active[k, i] > 0 else window.low[i]
                row, missing = outputs + i, limit - window.arrived[k, i]
                window.total[k, row], window.surprise[k, row] = measurement_update(
                    P, error, window.gain[k, row], window.work, i, missing, 0.0
                )
            elif damping > 0.0 and window.scale[k, i] > 0.0:
                row = outputs + i
                window.total[k, row], window.surprise[k, row] = measurement_update(
                    *(P, error, window.gain[k, row], window.work, i, 0.0),
                    window.scale[k, i] / damping,
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
    costate, work, outputs = window.costate, window.work, seen.size
    s, n = costate.size, window.F.shape[1]
    for i in range(s):
        costate[i] = 0.0
    for k in range(window.filled[0] - 1, -1, -1):
        F = window.F[k]
        for i in range(s - 1, -1, -1):
            row = outputs + i
            window.force[k, row] = _react(
                *(costate, window.gain[k, row], work, i),
                *(window.total[k, row], window.surprise[k, row]),
            )
        for j in range(outputs - 1, -1, -1):
            window.force[k, j] = _react(
                *(costate, window.gain[k, j], window.slopes[k, j], seen[j]),
                *(window.total[k, j], window.surprise[k, j]),
            )
        for j in range(s):
            work[j] = costate[j] if j >= n else 0.0
            for i in range(n):
                work[j] += F[i, j] * costate[i]
        for i in range(s):
            costate[i] = window.costates[k, i] = work[i]
        for i in range(s):
            window.change[k, i] = window.offset[k, i]
            for j in range(s):
                window.change[k, i] -= window.spread[k, i, j] * costate[j]


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
    n = window.F.shape[1]
    if i >= n:
        return window.arrived[k, i] + window.change[k, i]
    total = window.arrived[k, i]
    for j in range(window.mean.size):
        total += window.F[k, i, j] * window.change[k, j]
    return total
