"""What samples of a linearised model tell about its states: Gramians and Cramer-Rao bounds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.recording import Matrix, Vector


@dataclass(frozen=True)
class SampledModel:
    """A linearised model: x[i+1] = Phi[i] x[i] + Gamma[i] v[i], y[i] = C[i] x[i].

    Attributes
    ----------
    names : (k,) states, then corrections of the estimated quantities, which are constant.
    Phi : (n, k, k) from one sample to the next.
    Gamma : (n, k, m) effect of one standard deviation of the noise of each input.
    C : (n, l, k) of the measured outputs.
    R : (n, l) variance of the outputs [their unit squared].
    """

    names: tuple[str, ...]
    Phi: Matrix
    Gamma: Matrix
    C: Matrix
    R: Matrix


def exponentials(matrices: Matrix) -> Matrix:
    """Return matrix exponentials, (n, k, k), of a stack: Taylor series, scaling and squaring.

    Scipy's function hands small matrices one by one to the threads of its linear algebra, which
    takes a hundred times as long where processes share the processors.
    Source: Moler and Van Loan (2003), SIAM Review 45, 3, method 3.
    """
    norm = float(np.abs(matrices).sum(axis=2).max())
    halvings = max(0, int(np.ceil(np.log2(max(norm, 0.5) / 0.5))))
    scaled = matrices / 2.0**halvings
    identity = np.eye(matrices.shape[-1])
    result: Matrix = np.broadcast_to(identity, matrices.shape)
    # Thirteen terms at a norm of 0.5 leave 0.5^14/14!, below double precision.
    for order in range(13, 0, -1):
        result = identity + scaled @ result / order
    for _ in range(halvings):
        result = result @ result
    return result


def gramians(model: SampledModel, starts: NDArray[np.int_], length: int) -> Matrix:
    """Local observability Gramian of windows, weighted with the noise of the outputs.

    It is the Fisher information on the state at the window's begin; noise of inputs is left out.

    Parameters
    ----------
    starts : (m,) first sample of each window.
    length : samples of a window.

    Returns
    -------
    (m, k, k), in the inverse units of the states, squared.
    """
    sensitivity = np.tile(np.eye(len(model.names)), (starts.size, 1, 1))
    gramian = np.zeros_like(sensitivity)
    for j in range(length):
        seen = model.C[starts + j] @ sensitivity
        gramian += seen.transpose(0, 2, 1) @ (seen / model.R[starts + j][:, :, None])
        sensitivity = model.Phi[starts + j] @ sensitivity
    return gramian


def bounds(model: SampledModel, starts: NDArray[np.int_], length: int, prior: Vector) -> Matrix:
    """Cramer-Rao bound of the states at the end of windows, noise of inputs included.

    The covariance of the Kalman filter along the trajectory is the inverse of the window's Fisher
    information and that of the prior; so no bound is above the prior.

    Parameters
    ----------
    starts : (m,) first sample of each window.
    length : samples of a window.
    prior : (k,) standard deviations before the window.

    Returns
    -------
    (m, k) standard deviations, in the units of the states.
    """
    P = np.tile(np.diag(prior**2), (starts.size, 1, 1))
    for j in range(length):
        C = model.C[starts + j]
        PC = P @ C.transpose(0, 2, 1)
        innovation = C @ PC + model.R[starts + j][:, :, None] * np.eye(C.shape[1])
        P = P - PC @ np.linalg.solve(innovation, PC.transpose(0, 2, 1))
        P = 0.5 * (P + P.transpose(0, 2, 1))
        if j + 1 < length:
            Phi, Gamma = model.Phi[starts + j], model.Gamma[starts + j]
            P = Phi @ P @ Phi.transpose(0, 2, 1) + Gamma @ Gamma.transpose(0, 2, 1)
    deviation: Matrix = np.sqrt(np.einsum("mii->mi", P))
    return deviation


def remaining(scaled: Matrix) -> Matrix:
    """Return standard deviations left over the prior's, (..., k); Gramian in units of the prior."""
    posterior = np.linalg.inv(np.eye(scaled.shape[-1]) + scaled)
    left: Matrix = np.sqrt(np.einsum("...ii->...i", posterior))
    return left
