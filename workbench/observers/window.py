"""The least-squares problem over the last samples, linearised, and its solution with bounds.

Unknown are the nodes s_k of N steps, states and quantities after the noise of the model:

    |s_0 - mean|^2 / (covariance + Q_0) + sum |s_k - step(s_k-1)|^2 / Q_k + sum |y_k - output|^2 / R_k

with what each step arrives at within bounds. `solve_free` is a Kalman filter over the nodes and back:
the Riccati recursion of the problem. The way back is that of the costates, which inverts nothing, so
that quantities without noise are allowed. Source: A. Bryson, M. Frazier (1963), Smoothing for linear
and nonlinear dynamic systems; G. Bierman (1973), Automatica 9, 503-508.

A bound that is active is one more sample, without noise, so that its problem has the same
structure. Which ones are active is found by the dual method of D. Goldfarb, A. Idnani (1983),
Mathematical Programming 27, 1-33, in which each step is one such recursion: finite, exact to
rounding, and two recursions where the bounds are those of the sample before. An interior-point
method (PIQP, HPIPM) takes about ten recursions for each sample, and the last digits are its
tolerance; the multipliers here are forces of samples and tell whether the answer is right.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.fmu import Matrix, Vector
from workbench.kernel import compiled, inlined
from workbench.observers.kalman import carry

Tensor = NDArray[np.float64]

# Share of a standard deviation by which a bound may be missed: far less than an estimate knows, far
# more than rounding.
_TOLERANCE = 1e-9
# Share of its variance that rounding leaves to what other bounds already determine.
_DETERMINED = 1e-12
_RULED_OUT = 2  # mark of a bound that cannot be met
_MOST = 20  # changes of a bound for each node: more would be a circle of rounding


class Window(NamedTuple):
    """Nodes of the last N steps, oldest first, what was measured, and work space.

    s unknowns at a node (n states), m inputs, l outputs; rows of samples: l of outputs, then s of
    bounds.

    Attributes
    ----------
    count : (1,) nodes that are there.
    mean, covariance : of the first node before the noise of the model; all older samples.
    low, high : (s,) bounds.
    nodes : (N, s) where the steps are linearised; inputs, samples, steps : of each node's step.
    noise : (N, s) variances of the model's noise; levels : (N, l) variances of samples.
    arrived : (N, s) where a step from the node leads; F : (N, n, s) its derivatives.
    slopes : (N, l, s) derivatives of outputs there; errors : (N, l) samples less outputs.
    weight : (N, l) share of a sample's information that counts.
    active : (N, s) 1 at the upper bound, -1 at the lower one; multiplier : (N, s) of it.
    scale : (N, s) variances without bounds.
    offset : (N, s) filtered less node; spread : (N, s, s) covariance of it.
    gain : (N, l + s, s), total, surprise, force : (N, l + s) of samples and bounds, see `_absorb`.
    change : (N, s) best node less node.
    next_mean, next_covariance : as mean and covariance, of the second node.
    costate, error, work : (s,); P : (s, s).
    """

    count: NDArray[np.intp]
    mean: Vector
    covariance: Matrix
    low: Vector
    high: Vector
    nodes: Matrix
    inputs: Matrix
    samples: Matrix
    steps: Vector
    noise: Matrix
    levels: Matrix
    arrived: Matrix
    F: Tensor
    slopes: Tensor
    errors: Matrix
    weight: Matrix
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
    costate: Vector
    error: Vector
    work: Vector
    P: Matrix


def window(N: int, n: int, m: int, outputs: int, low: Vector, high: Vector) -> Window:
    """An empty window of N nodes of a model with so many states, inputs and outputs."""
    s = low.size
    rows = outputs + s
    return Window(
        count=np.zeros(1, np.intp),
        mean=np.zeros(s),
        covariance=np.zeros((s, s)),
        low=low,
        high=high,
        nodes=np.zeros((N, s)),
        inputs=np.zeros((N, m)),
        samples=np.zeros((N, outputs)),
        steps=np.zeros(N),
        noise=np.zeros((N, s)),
        levels=np.zeros((N, outputs)),
        arrived=np.zeros((N, s)),
        F=np.zeros((N, n, s)),
        slopes=np.zeros((N, outputs, s)),
        errors=np.zeros((N, outputs)),
        weight=np.ones((N, outputs)),
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
        costate=np.zeros(s),
        error=np.zeros(s),
        work=np.zeros(s),
        P=np.zeros((s, s)),
    )


@inlined
def assign(target, source):  # type: ignore[no-untyped-def]
    """Copy a vector, in rising order."""
    for i in range(target.size):
        target[i] = source[i]


@inlined
def assign_rows(target, source):  # type: ignore[no-untyped-def]
    """Copy a matrix, in rising order."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]


@compiled
def shift(window):  # type: ignore[no-untyped-def]
    """Forget the oldest node: what it tells becomes the mean and covariance of the next one."""
    last = window.count[0] - 1
    assign(window.mean, window.next_mean)
    assign_rows(window.covariance, window.next_covariance)
    assign(window.steps[:last], window.steps[1:])
    assign_rows(window.inputs[:last], window.inputs[1:])
    assign_rows(window.nodes[:last], window.nodes[1:])
    assign_rows(window.noise[:last], window.noise[1:])
    assign_rows(window.active[:last], window.active[1:])
    assign_rows(window.samples[:last], window.samples[1:])
    assign_rows(window.levels[:last], window.levels[1:])
    assign_rows(window.weight[:last], window.weight[1:])
    window.count[0] = last


@compiled
def _absorb(window, k, row, at, residual, variance):  # type: ignore[no-untyped-def]
    """Correct error and P by a sample of unknown `at`, or of output -1 - at with its slopes.

    Kept are what the way back needs: gain P c, total c'P c + variance, surprise.
    """
    P, error, v = window.P, window.error, window.gain[k, row]
    s = error.size
    if at >= 0:
        for i in range(s):
            v[i] = P[i, at]
        total, surprise = v[at] + variance, residual - error[at]
    else:
        c = window.slopes[k, row]
        total, surprise = variance, residual
        for i in range(s):
            v[i] = 0.0
            for j in range(s):
                v[i] += P[i, j] * c[j]
            total += c[i] * v[i]
            surprise -= c[i] * error[i]
    window.total[k, row], window.surprise[k, row] = total, surprise
    inverse = 1.0 / total
    for i in range(s):
        factor = v[i] * inverse
        error[i] += factor * surprise
        for j in range(i + 1):
            P[i, j] -= factor * v[j]
            P[j, i] = P[i, j]


@compiled
def _filter(window, seen, bounded):  # type: ignore[no-untyped-def]
    """Filter along the nodes; error and P are then those of the last arrival."""
    P, error, outputs = window.P, window.error, seen.size
    s, n = error.size, window.F.shape[1]
    for k in range(window.count[0]):
        d, F = window.offset[k], window.F[k]
        for i in range(s):
            before = window.mean[i] if k == 0 else window.arrived[k - 1, i] + error[i]
            d[i] = before - window.nodes[k, i]
            for j in range(s):
                if k == 0:
                    P[i, j] = window.covariance[i, j]
                if i == j:
                    P[i, i] += window.noise[k, i]
                window.spread[k, i, j] = P[i, j]
        carry(F, P, window.work)
        for i in range(n):
            error[i] = 0.0
            for j in range(s):
                error[i] += F[i, j] * d[j]
        for i in range(n, s):
            error[i] = d[i]
        for j in range(outputs):
            window.total[k, j] = 0.0
            if not np.isnan(window.errors[k, j]):
                variance = window.levels[k, j] / window.weight[k, j]
                _absorb(window, k, j, seen[j], window.errors[k, j], variance)
        if k == 0:
            assign_rows(window.next_covariance, P)
            for i in range(s):
                window.next_mean[i] = window.arrived[0, i] + error[i]
        for i in range(s):
            window.total[k, outputs + i] = 0.0
            if not bounded:
                window.scale[k, i] = P[i, i]
            elif (
                abs(window.active[k, i]) == 1 and P[i, i] > _DETERMINED * window.scale[k, i]
            ):
                limit = window.high[i] if window.active[k, i] > 0 else window.low[i]
                _absorb(window, k, outputs + i, i, limit - window.arrived[k, i], 0.0)


@inlined
def _react(window, k, row, at):  # type: ignore[no-untyped-def]
    """Force of a sample, and the costate before it."""
    costate, total = window.costate, window.total[k, row]
    if total == 0.0:
        window.force[k, row] = 0.0
        return
    force = window.surprise[k, row]
    for i in range(costate.size):
        force += window.gain[k, row, i] * costate[i]
    force /= total
    window.force[k, row] = force
    if at >= 0:
        costate[at] -= force
    else:
        for i in range(costate.size):
            costate[i] -= window.slopes[k, row, i] * force


@compiled
def _smooth(window, seen):  # type: ignore[no-untyped-def]
    """Forces of samples and bounds, and the best change of each node, from the last one back."""
    costate, work, outputs = window.costate, window.work, seen.size
    s, n = costate.size, window.F.shape[1]
    for i in range(s):
        costate[i] = 0.0
    for k in range(window.count[0] - 1, -1, -1):
        F = window.F[k]
        for i in range(s - 1, -1, -1):
            _react(window, k, outputs + i, i)
        for j in range(outputs - 1, -1, -1):
            _react(window, k, j, seen[j])
        for j in range(s):
            work[j] = costate[j] if j >= n else 0.0
            for i in range(n):
                work[j] += F[i, j] * costate[i]
        for i in range(s):
            costate[i] = work[i]
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
    _filter(window, seen, False)
    _smooth(window, seen)


@inlined
def _solve_bounded(window, seen):  # type: ignore[no-untyped-def]
    _filter(window, seen, True)
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


@inlined
def _push(window, outputs, k, i):  # type: ignore[no-untyped-def]
    """What an active bound pushes with, inwards; negative if it pulls."""
    return -window.active[k, i] * window.force[k, outputs + i]


@compiled
def _most_missed(window):  # type: ignore[no-untyped-def]
    """The worst miss of a bound that is not active: node, unknown and side, 0 if there is none."""
    worst, node, which, side = _TOLERANCE, 0, 0, 0
    for i in range(window.mean.size):
        if window.low[i] == -np.inf and window.high[i] == np.inf:
            continue
        for k in range(window.count[0]):
            if window.active[k, i] != 0:
                continue
            value, deviation = end(window, k, i), np.sqrt(window.scale[k, i])
            above, below = value - window.high[i], window.low[i] - value
            if max(above, below) > worst * deviation:
                worst, node, which = max(above, below) / deviation, k, i
                side = 1 if above > below else -1
    return node, which, side


@compiled
def _resume(window, seen):  # type: ignore[no-untyped-def]
    """Start from the bounds of the sample before, without those that would pull; see `bound`."""
    outputs, recursions = seen.size, 0
    while True:
        any_active, dropped = False, False
        for k in range(window.count[0]):
            for i in range(window.mean.size):
                any_active = any_active or window.active[k, i] != 0
        if not any_active:
            if recursions > 0:
                solve_free(window, seen)
            return recursions
        _solve_bounded(window, seen)
        recursions += 1
        for k in range(window.count[0]):
            for i in range(window.mean.size):
                if window.active[k, i] == 0:
                    continue
                window.multiplier[k, i] = _push(window, outputs, k, i)
                if window.multiplier[k, i] < 0.0 or window.total[k, outputs + i] == 0.0:
                    window.active[k, i], dropped = 0, True
        if not dropped:
            return recursions


@compiled
def _advance(window, outputs, node, which):  # type: ignore[no-untyped-def]
    """Move the multipliers towards those of the last recursion, until one would pull.

    That bound is let go. Returns whether none was.
    """
    share, at, of = 1.0, -1, -1
    for k in range(window.count[0]):
        for i in range(window.mean.size):
            if abs(window.active[k, i]) != 1 or (k == node and i == which):
                continue
            new, old = _push(window, outputs, k, i), window.multiplier[k, i]
            if new < 0.0 and old < share * (old - new):
                share, at, of = old / (old - new), k, i
    for k in range(window.count[0]):
        for i in range(window.mean.size):
            if abs(window.active[k, i]) == 1:
                new, old = _push(window, outputs, k, i), window.multiplier[k, i]
                window.multiplier[k, i] = old + share * (new - old)
    if at >= 0:
        window.active[at, of] = 0
    return at < 0


@compiled
def bound(window, seen):  # type: ignore[no-untyped-def]
    """Bring what was solved without bounds within them; returns the number of recursions.

    A bound that no noise of the model can reach, such as that of a quantity which others
    determine, is left missed.
    """
    outputs, recursions = seen.size, _resume(window, seen)
    ruled_out = False
    while recursions < _MOST * window.count[0]:
        node, which, side = _most_missed(window)
        if side == 0:
            break
        window.active[node, which], window.multiplier[node, which] = side, 0.0
        done = False
        while not done:
            _solve_bounded(window, seen)
            recursions += 1
            if window.total[node, outputs + which] == 0.0:
                window.active[node, which], done, ruled_out = _RULED_OUT, True, True
            else:
                done = _advance(window, outputs, node, which)
    for i in range(window.mean.size):
        # What the first bounds push with stays, so that the next window meets the same balance.
        if abs(window.active[0, i]) == 1:
            for j in range(window.mean.size):
                push = window.next_covariance[j, i] * window.force[0, outputs + i]
                window.next_mean[j] += push
    if ruled_out:
        for k in range(window.count[0]):
            for i in range(window.mean.size):
                if window.active[k, i] == _RULED_OUT:
                    window.active[k, i] = 0
    return recursions
