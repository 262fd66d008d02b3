"""Bounds of the least-squares problem over the last samples.

A bound that is active is one more sample, without noise, so that its problem has the same
structure. Which ones are active is found by the dual method of D. Goldfarb, A. Idnani (1983),
Mathematical Programming 27, 1-33, in which each step is one recursion over the nodes: finite, exact
to rounding, and two recursions where the bounds are those of the sample before. An interior-point
method (PIQP, HPIPM) takes about ten recursions for each sample and leaves its tolerance in the
answer. Forces of the bounds are multipliers: with none that pulls and no bound missed, the
conditions of Karush, Kuhn and Tucker hold, and the answer is right.
"""

import numpy as np

from workbench.models.native import compiled, inlined
from workbench.observers.estimators.moving_horizon.window import end, solve_bounded, solve_free

# Share of a standard deviation by which a bound may be missed: far less than an estimate knows, far
# more than rounding.
_TOLERANCE = 1e-9
_RULED_OUT = 2  # mark of a bound that cannot be met
_MOST = 20  # recursions for each node: more would be a circle of rounding


@inlined
def push(window, outputs, k, i):  # type: ignore[no-untyped-def]
    """What an active bound pushes with, inwards; negative if it pulls."""
    solution = window.solution
    return -solution.active[k, i] * solution.force[k, outputs + i]


@compiled
def _most_missed(window):  # type: ignore[no-untyped-def]
    """The worst miss of a bound that is not active: node, unknown and side, 0 if there is none."""
    data, solution = window.data, window.solution
    worst, node, which, side = _TOLERANCE, 0, 0, 0
    for i in range(data.mean.size):
        if data.low[i] == -np.inf and data.high[i] == np.inf:
            continue
        for k in range(data.filled[0]):
            if solution.active[k, i] != 0:
                continue
            value, deviation = end(window, k, i), np.sqrt(solution.scale[k, i])
            above, below = value - data.high[i], data.low[i] - value
            if max(above, below) > worst * deviation:
                worst, node, which = max(above, below) / deviation, k, i
                side = 1 if above > below else -1
    return node, which, side


@compiled
def _resume(window, seen):  # type: ignore[no-untyped-def]
    """Start from the bounds of the sample before, without those that would pull; see `bound`."""
    data, solution = window.data, window.solution
    outputs, recursions = seen.size, 0
    while True:
        any_active, dropped = False, False
        for k in range(data.filled[0]):
            for i in range(data.mean.size):
                any_active = any_active or solution.active[k, i] != 0
        if not any_active:
            if recursions > 0:
                solve_free(window, seen)
            return recursions
        solve_bounded(window, seen)
        recursions += 1
        for k in range(data.filled[0]):
            for i in range(data.mean.size):
                if solution.active[k, i] == 0:
                    continue
                solution.multiplier[k, i] = push(window, outputs, k, i)
                if solution.multiplier[k, i] < 0.0 or solution.total[k, outputs + i] == 0.0:
                    solution.active[k, i], dropped = 0, True
        if not dropped:
            return recursions


@compiled
def _advance(window, outputs, node, which):  # type: ignore[no-untyped-def]
    """Move the multipliers towards those of the last recursion, until one would pull.

    That bound is let go. Returns whether none was.
    """
    data, solution = window.data, window.solution
    share, at, of = 1.0, -1, -1
    for k in range(data.filled[0]):
        for i in range(data.mean.size):
            if abs(solution.active[k, i]) != 1 or (k == node and i == which):
                continue
            new, old = push(window, outputs, k, i), solution.multiplier[k, i]
            if new < 0.0 and old < share * (old - new):
                share, at, of = old / (old - new), k, i
    for k in range(data.filled[0]):
        for i in range(data.mean.size):
            if abs(solution.active[k, i]) == 1:
                new, old = push(window, outputs, k, i), solution.multiplier[k, i]
                solution.multiplier[k, i] = old + share * (new - old)
    if at >= 0:
        solution.active[at, of] = 0
    return at < 0


@compiled
def bound(window, seen):  # type: ignore[no-untyped-def]
    """Bring what was solved without bounds within them; returns the number of recursions.

    A bound that no noise of the model can reach, such as that of a quantity which others
    determine, is left missed.
    """
    data, solution = window.data, window.solution
    outputs, recursions = seen.size, _resume(window, seen)
    ruled_out = False
    while recursions < _MOST * data.filled[0]:
        node, which, side = _most_missed(window)
        if side == 0:
            break
        solution.active[node, which], solution.multiplier[node, which] = side, 0.0
        done = False
        while not done:
            solve_bounded(window, seen)
            recursions += 1
            if solution.total[node, outputs + which] == 0.0:
                solution.active[node, which], done, ruled_out = _RULED_OUT, True, True
            else:
                done = _advance(window, outputs, node, which)
    for i in range(data.mean.size):
        # What the first bounds push with stays, so that the next window meets the same balance.
        if abs(solution.active[0, i]) == 1:
            for j in range(data.mean.size):
                push = solution.next_covariance[j, i] * solution.force[0, outputs + i]
                solution.next_mean[j] += push
    if ruled_out:
        for k in range(data.filled[0]):
            for i in range(data.mean.size):
                if solution.active[k, i] == _RULED_OUT:
                    solution.active[k, i] = 0
    return recursions
