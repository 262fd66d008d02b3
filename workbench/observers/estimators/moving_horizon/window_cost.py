"""What a window costs: squares, less of what is far off, and noise as wide as it has to be."""

import numpy as np

from workbench.models.native import compiled
from workbench.observers.estimators.moving_horizon.window import DETERMINED


@compiled
def reweigh(window, limit, fading):  # type: ignore[no-untyped-def]
    """Give less weight to samples that are far off, more noise to steps that took it.

    Samples have Huber's loss, by weights. The noise of a quantity's step has the variance that is
    most likely, which is the declared one or the square of what it was; in the steps after that it
    is as wide, fading, since a change seldom comes alone. Sources: P. Huber (1964), Ann. Math.
    Statist. 35, 73-101; D. MacKay (1992), Neural Comput. 4, 415-447, with a scale for each step.

    Parameters
    ----------
    limit : standard deviations beyond which the loss grows linearly.
    fading : share of a wider noise that the next step has.

    Returns
    -------
    Whether any of it changed by more than a tenth.
    """
    data, solution = window.data, window.solution
    changed, calm = False, True
    for k in range(data.filled[0]):
        for j in range(data.weight.shape[1]):
            if solution.total[k, j] == 0.0:
                continue
            old = data.weight[k, j]
            size = np.sqrt(data.levels[k, j]) * abs(solution.force[k, j]) / old
            new = limit / size if size > limit else 1.0
            data.weight[k, j] = new
            changed = changed or abs(new - old) > 0.1 * old
        if data.alert[0] == 0:
            continue
        for i in range(data.F.shape[1], data.mean.size):
            old = data.wider[k, i]
            square = data.noise[k, i] * (solution.costates[k, i] * old) ** 2
            before = data.wider[k - 1, i] if k > 0 else data.older[i]
            new = max(1.0, square, fading * before)
            data.wider[k, i] = new
            changed = changed or abs(new - old) > 0.1 * old
            calm = calm and new == 1.0
    if calm:
        data.alert[0] = 0
    return changed


@compiled
def cost(window):  # type: ignore[no-untyped-def]
    """Sum of squares at the nodes, where steps have been taken; with what active bounds ask for.

    A bound that is missed costs what it pushes with, so that the solution with bounds is a minimum.
    """
    data, solution, scratch = window.data, window.solution, window.scratch
    s, outputs, P, work = data.mean.size, data.weight.shape[1], solution.P, scratch.work
    total = 0.0
    # Cholesky's factor of the first covariance; directions without variance do not move.
    for i in range(s):
        work[i] = data.nodes[0, i] - data.mean[i]
        for j in range(i + 1):
            P[i, j] = data.covariance[i, j]
            if i == j:
                P[i, i] += data.noise[0, i] * data.wider[0, i]
            least = DETERMINED * P[i, i]
            for k in range(j):
                P[i, j] -= P[i, k] * P[j, k]
            if i == j:
                P[i, i] = np.sqrt(P[i, i]) if P[i, i] > least else 0.0
            else:
                P[i, j] = P[i, j] / P[j, j] if P[j, j] > 0.0 else 0.0
        for j in range(i):
            work[i] -= P[i, j] * work[j]
        work[i] = work[i] / P[i, i] if P[i, i] > 0.0 else 0.0
        total += work[i] ** 2
    for k in range(data.filled[0]):
        for i in range(s):
            variance = data.noise[k, i] * data.wider[k, i]
            if k > 0 and variance > 0.0:
                total += (data.nodes[k, i] - data.arrived[k - 1, i]) ** 2 / variance
            if solution.active[k, i] != 0:
                above = data.arrived[k, i] - data.high[i]
                below = data.low[i] - data.arrived[k, i]
                total += 2.0 * solution.multiplier[k, i] * max(above, below, 0.0)
        for j in range(outputs):
            if not np.isnan(data.errors[k, j]):
                total += data.errors[k, j] ** 2 * data.weight[k, j] / data.levels[k, j]
    return total
