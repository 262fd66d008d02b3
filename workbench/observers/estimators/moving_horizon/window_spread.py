"""Covariances of the smoothed nodes of a window, by what later samples tell.

The information is the covariance of the costates, of which the way back of `window` takes the mean;
it inverts nothing. Sources: A. Bryson, M. Frazier (1963), Smoothing for linear and nonlinear
dynamic systems; G. Bierman (1973), Automatica 9, 503-508.
"""

from typing import Annotated, NamedTuple

from workbench.arrays import Matrix, Tensor, zeros
from workbench.models.native import compiled
from workbench.observers.estimators.kalman import carry


class Spread(NamedTuple):
    """Covariances of what a window estimates."""

    information: Annotated[Matrix, "s, s"]  # what later samples tell
    product: Annotated[Matrix, "s, s"]  # work space
    covariances: Annotated[Tensor, "N, s, s"]  # of where the step from each node leads
    first: Annotated[Matrix, "s, s"]  # before them all


def spread(N: int, s: int) -> Spread:
    """Room for N nodes of s unknowns."""
    return zeros(Spread, {"N": N, "s": s})


@compiled
def _gather(information, v, c, at, total, work):  # type: ignore[no-untyped-def]
    """Add a sample of unknown `at`, or with slopes c, `at` < 0, to the information.

    (I - c v'/total) information (I - v c'/total) + c c'/total, v = P c.
    """
    s, square = v.size, 0.0
    for i in range(s):
        work[i] = 0.0
        for j in range(s):
            work[i] += information[i, j] * v[j]
        square += v[i] * work[i]
    both = (1.0 + square / total) / total
    for i in range(s):
        own = c[i] if at < 0 else (1.0 if i == at else 0.0)
        for j in range(i + 1):
            other = c[j] if at < 0 else (1.0 if j == at else 0.0)
            information[i, j] += both * own * other - (own * work[j] + work[i] * other) / total
            information[j, i] = information[i, j]


@compiled
def _back(F, information, product):  # type: ignore[no-untyped-def]
    """Information <- F' information F of a step, see `carry`."""
    n, s = F.shape
    for i in range(s):
        for j in range(s):
            product[i, j] = information[i, j] if j >= n else 0.0
            for k in range(n):
                product[i, j] += information[i, k] * F[k, j]
    # Only half of it is computed: what rounding makes of the difference would grow.
    for i in range(s):
        for j in range(i + 1):
            information[i, j] = product[i, j] if i >= n else 0.0
            for k in range(n):
                information[i, j] += F[k, i] * product[k, j]
            information[j, i] = information[i, j]


@compiled
def _reduce(P, information, product, smoothed):  # type: ignore[no-untyped-def]
    """Covariance with what later samples tell: P - P information P."""
    s = P.shape[0]
    for i in range(s):
        for j in range(s):
            product[i, j] = 0.0
            for k in range(s):
                product[i, j] += P[i, k] * information[k, j]
    for i in range(s):
        for j in range(i + 1):
            smoothed[i, j] = P[i, j]
            for k in range(s):
                smoothed[i, j] -= product[i, k] * P[k, j]
            smoothed[j, i] = smoothed[i, j]
        smoothed[i, i] = max(smoothed[i, i], 0.0)  # rounding, of what is known exactly


@compiled
def gather_spread(window, seen, spread):  # type: ignore[no-untyped-def]
    """Covariances without bounds, from the last node back, after `solve_free`."""
    data, solution, scratch = window.data, window.solution, window.scratch
    information, product = spread.information, spread.product
    for i in range(information.shape[0]):
        for j in range(information.shape[0]):
            information[i, j] = 0.0
    for k in range(data.filled[0] - 1, -1, -1):
        for j in range(seen.size - 1, -1, -1):
            if solution.total[k, j] > 0.0:
                _gather(
                    *(information, solution.gain[k, j], data.slopes[k, j], seen[j]),
                    *(solution.total[k, j], scratch.work),
                )
        _back(data.F[k], information, product)
        _reduce(solution.spread[k], information, product, spread.covariances[k])
        carry(data.F[k], spread.covariances[k], scratch.product)
    _reduce(data.covariance, information, product, spread.first)
