"""How sure sizes are where what is left of errors is no noise.

Errors e that go on in time move a least-squares estimate by dz = -N^-1 S'e, with S the derivatives
beside what differs between recordings. Its covariance is N^-1 S'C S N^-1, with the autocovariance C
of what is left in place of that of white noise (P. J. Huber 1967, Proc. 5th Berkeley Symp. 1,
221-233; W. K. Newey, K. D. West 1987, Econometrica 55, 703-708).

A law that is wrong in form moves its size by more, since the fit takes what of that looks like the
size, whatever the number of samples (M. C. Kennedy, A. O'Hagan 2001, J. R. Stat. Soc. B 63,
425-464). What is left tells how large it is: of a smooth law, about its slope and its bend remain,
so that its scale is known by two degrees of freedom, and Student's t of two makes the interval.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import matmul_toeplitz
from scipy.stats import t

from workbench.arrays import Vector
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Key, covariance
from workbench.diagnosis.inference.search import FittedModel
from workbench.system.units import BAND

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
    scale = float(t.isf(0.025, _SHAPES)) / BAND
    return float(scale * np.sqrt(max(left, 0.0) / max(explained, left, 1e-9)))


def correlated_deviations(fit: Fit, best: FittedModel) -> dict[Key, float]:
    """Standard deviation of each common unknown by what a fit leaves, as it goes on in time."""
    joint = fit.quadratics(fit.linearise(best.linearised, best.active))
    errors, slopes = [], []
    for system in joint.systems:
        follows, _ = system.follows()
        beside = (system.J + system.P @ follows)[: system.blocks]  # (b*c, p)
        slopes.append(beside.reshape(-1, system.channels, len(joint.shared)))
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
