"""How sure sizes are where what is left of errors is no noise.

Errors e that go on in time move a least-squares estimate by dz = -N^-1 S'e, with S the derivatives
beside what differs between recordings. Its covariance is N^-1 S'C S N^-1, with the autocovariance C
of what is left in place of that of white noise (P. J. Huber 1967, Proc. 5th Berkeley Symp. 1,
221-233; W. K. Newey, K. D. West 1987, Econometrica 55, 703-708).

A law that is wrong in form moves its size by more, since the fit takes what of that looks like the
size, whatever the number of samples (M. C. Kennedy, A. O'Hagan 2001, J. R. Stat. Soc. B 63,
425-464). What is left tells how large it is: of a smooth law, about its slope and its bend remain,
so that its scale is known by two degrees of freedom, and Student's t of two makes the interval.
Where noise hides the form, recordings say at least how wrong it may be: a size that goes with a
quantity which the law should not depend on leaves errors of its own, and moves all that is fitted.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import matmul_toeplitz
from scipy.special import stdtrit

from workbench.arrays import Vector
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Joint, Key, covariance
from workbench.diagnosis.inference.search import FittedModel
from workbench.system.units import BAND

WRONG = 0.2  # share of its effect by which a law may be wrong in form, at most
_SHARES = (np.arange(20) + 0.5) / 20.0 * WRONG
_SHAPES = 2  # of a smooth law that a fitted size does not take: slope and bend


def share_by_form(left: float, explained: float) -> float:
    """Standard deviation of a size by its form, as a share of it.

    Parameters
    ----------
    left : mean square error that remains, beyond noise.
    explained : that without the effect.

    >>> round(share_by_form(1.0, 100.0), 3)
    0.22
    """
    scale = float(-stdtrit(_SHAPES, 0.025)) / BAND
    return float(scale * np.sqrt(max(left, 0.0) / max(explained, left, 1e-9)))


def hidden_by_noise(fit: Fit, best: FittedModel, effect: Effect) -> dict[Key, float]:
    """Standard deviation of each common unknown by the form of a law that seems right.

    The size z may go with any one of `standardised`, z (1 + s q). Beforehand each q is as likely,
    and s is normal with a standard deviation up to a fifth, each as likely; recordings say more.
    A fit without it is moved by N_zz^-1 N_zs s. Of what is no class of a library, nothing is known.
    """
    if fit.free or not effect.of_library or effect.order_locked:
        return {}
    lin, forms = fit.modulated(fit.linearise(best.linearised, best.active), effect)
    joint = fit.quadratics(lin, forms)
    total, known = joint.total(), len(joint.known)
    size = best.point.sizes[effect.name, effect.label]
    coupling = size * total.N[:known, known:]  # (p, q)
    moved = covariance(total.N[:known, :known]) @ coupling
    place = joint.shared.index((effect.name, effect.label))
    shown = np.maximum(size**2 * np.diag(total.N)[known:] - (coupling * moved).sum(axis=0), 0.0)
    gradient = size * total.g[known:] - moved.T @ total.g[:known]
    # Of s by each q and each standard deviation beforehand, (q, 20).
    precision = shown[:, None] + 1.0 / _SHARES**2
    mean = gradient[:, None] / precision
    evidence = 0.5 * (mean * gradient[:, None] - np.log(precision * _SHARES**2))
    weights = np.exp(evidence - evidence.max())
    squares = (weights / weights.sum() * (mean**2 + 1.0 / precision)).sum(axis=1)
    # A size is the mean where its effect acts, by how far it moves errors there.
    moved[place] -= size * _means(joint, place)
    deviations = np.sqrt(moved**2 @ squares)
    return dict(zip(joint.known, map(float, deviations), strict=True))


def _means(joint: Joint, place: int) -> Vector:
    """(q,) Mean of what a size goes with, by the squares of the derivatives by that size."""
    known = len(joint.known)
    products = sum(system.J[:, place] @ system.J[:, known:] for system in joint.systems)
    squares = sum(system.J[:, place] @ system.J[:, place] for system in joint.systems)
    means: Vector = np.asarray(products / squares, np.float64)
    return means


def correlated_deviations(fit: Fit, best: FittedModel) -> dict[Key, float]:
    """Standard deviation of each common unknown by what a fit leaves, as it goes on in time."""
    joint = fit.quadratics(fit.linearise(best.linearised, best.active))
    errors, slopes = [], []
    for system in joint.systems:
        slopes.append(system.slopes.reshape(-1, system.channels, len(joint.shared)))
        errors.append(system.r[: system.blocks].reshape(-1, system.channels))
    scores = np.zeros((len(joint.shared),) * 2)
    for c in range(joint.systems[0].channels):
        covariances = autocovariance([own[:, c] for own in errors])
        for own in slopes:
            lags = covariances[: len(own)]
            scores += own[:, c].T @ matmul_toeplitz((lags, lags), own[:, c])
    inverse = covariance(joint.total().N)
    variances = np.maximum(np.diag(inverse @ scores @ inverse), 0.0)
    return dict(zip(joint.shared, map(float, np.sqrt(variances)), strict=True))


def autocovariance(recordings: Sequence[Vector]) -> Vector:
    """Autocovariance by lag, (n,) of the longest; over all samples, so that it is definite.

    >>> autocovariance([np.array([1.0, -1.0, 1.0])]).round(3).tolist()
    [1.0, -0.667, 0.333]
    """
    sums = np.zeros(max(map(len, recordings)))
    for errors in recordings:
        sums[: len(errors)] += np.correlate(errors, errors, "full")[len(errors) - 1 :]
    covariances: Vector = sums / sum(map(len, recordings))
    return covariances
