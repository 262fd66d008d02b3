"""Steps of a linear model dx/dt = A x + B u in which inputs go straight, and filters with them."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from workbench.arrays import Matrix, Vector
from workbench.observers import Estimate, Estimator


def exact_step(A: ArrayLike, B: ArrayLike, h: float) -> tuple[Matrix, Matrix, Matrix]:
    """Phi, G and H of x(h) = Phi x(0) + G u(0) + H (u(h) - u(0)), exactly.

    Source: C. Van Loan (1978), IEEE Trans. Autom. Control 23, 395-404.
    """
    A, B = np.asarray(A), np.asarray(B)
    n, m = B.shape
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[:n, :n], whole[:n, n : n + m] = h * A, h * B
    whole[n : n + m, n + m :] = np.eye(m)
    whole = expm(whole)
    return whole[:n, :n], whole[:n, n : n + m], whole[:n, n + m :]


def with_steps(
    estimator: Estimator, samples: tuple[Vector, Matrix, Matrix], accurate: bool
) -> Estimate:
    """Estimates after the first sample, all by accurate steps, or all by Euler's."""
    time, u, y = samples
    estimator.init(time[0], u[0], y[0])
    for step in estimator.steps:
        step.accurate[0], step.allowed[:] = float(accurate), np.inf
    return estimator.advance(np.diff(time), u[1:], y[1:])
