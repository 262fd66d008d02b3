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
    changed, calm = False, True
    for k in range(window.filled[0]):
        for j in range(window.weight.shape[1]):
            if window.total[k, j] == 0.0:
                continue
            old = window.weight[k, j]
            size = np.sqrt(window.levels[k, j]) * abs(window.force[k, j]) / old
            new = limit / size if size > limit else 1.0
            window.weight[k, j] = new
            changed = changed or abs(new - old) > 0.1 * old
        if window.alert[0] == 0:
            continue
        for i in range(window.F.shape[1], window.mean.size):
            old = window.wider[k, i]
            square = window.noise[k, i] * (window.costates[k, i] * old) ** 2
            before = window.wider[k - 1, i] if k > 0 else window.older[i]
            new = max(1.0, square, fading * before)
            window.wider[k, i] = new
            changed = changed or abs(new - old) > 0.1 * old
            calm = calm and new == 1.0
    if calm:
        window.alert[0] = 0
    return changed


@compiled
def cost(window):  # type: ignore[no-untyped-def]
    """Sum of squares at the nodes, where steps have been taken; with what active bounds ask for.

    A bound that is missed costs what it pushes with, so that the solution with bounds is a minimum.
    """
    s, outputs, P, work = window.mean.size, window.weight.shape[1], window.P, window.work
    total = 0.0
    # Cholesky's factor of the first covariance; directions without variance do not move.
    for i in range(s):
        work[i] = window.nodes[0, i] - window.mean[i]
        for j in range(i + 1):
            P[i, j] = window.covariance[i, j]
            if i == j:
                P[i, i] += window.noise[0, i] * window.wider[0, i]
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
    for k in range(window.filled[0]):
        for i in range(s):
            variance = window.noise[k, i] * window.wider[k, i]
            if k > 0 and variance > 0.0:
                total += (window.nodes[k, i] - window.arrived[k - 1, i]) ** 2 / variance
            if window.active[k, i] != 0:
                above = window.arrived[k, i] - window.high[i]
                below = window.low[i] - window.arrived[k, i]
                total += 2.0 * window.multiplier[k, i] * max(above, below, 0.0)
        for j in range(outputs):
            if not np.isnan(window.errors[k, j]):
                total += window.errors[k, j] ** 2 * window.weight[k, j] / window.levels[k, j]
    return total
