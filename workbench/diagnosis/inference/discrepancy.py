"""How sure sizes are where what is left of errors is no noise.

Errors e that go on in time move a least-squares estimate by dz = -N^-1 S'e, with S the derivatives
beside what differs between recordings. Its covariance is N^-1 S'C S N^-1, with the autocovariance C
of what is left in place of that of white noise (P. J. Huber 1967, Proc. 5th Berkeley Symp. 1,
221-233; W. K. Newey, K. D. West 1987, Econometrica 55, 703-708).

A law that is wrong in form moves its size by more, since the fit takes what of that looks like the
size, whatever the number of samples (M. C. Kennedy, A. O'Hagan 2001, J. R. Stat. Soc. B 63,
425-464). What is left tells how large it is: of a smooth law, about its slope and its bend remain,
so that its scale is known by two degrees of freedom, and Student's t of two makes the interval.

Where noise is left, a law may be wrong as far as noise hides that. So each is fitted again with a
size that goes with a quantity that was measured, by a share that is known beforehand to about what
laws of a handbook are right to: data that show the law well narrow it, others do not.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import matmul_toeplitz
from scipy.stats import t

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.samples import Samples
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Key, Quadratic, covariance, minimum
from workbench.diagnosis.inference.search import FittedModel
from workbench.system.units import BAND

_SHAPES = 2  # of a smooth law that a fitted size does not take: slope and bend
# Share of its effect by which a law is wrong in form: correlations of friction and heat transfer in
# handbooks scatter by a tenth or so about what is measured.
_WRONG = 0.1
_REACH = 3.0  # standard deviations of a quantity, beyond which a law goes no further with it


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


def quantities(recordings: Sequence[Samples]) -> list[Matrix]:
    """What a law may depend on and does not, in each recording, (n, q).

    Time, inputs and outputs as they were measured, each with the mean zero and the root mean square
    one over all recordings, so that a size is that in the middle.
    """
    columns = [
        np.column_stack([r.time - r.time[0], r.u, np.where(r.silent, np.nan, r.y)])
        for r in recordings
    ]
    every = np.vstack([c[r.told] for c, r in zip(columns, recordings, strict=True)])
    able = np.nanmax(every, axis=0) > np.nanmin(every, axis=0)
    mean, scale = np.nanmean(every, axis=0)[able], np.nanstd(every, axis=0)[able]
    courses = [np.clip((c[:, able] - mean) / scale, -_REACH, _REACH) for c in columns]
    return [np.nan_to_num(course) for course in courses]


def hidden_by_noise(fit: Fit, best: FittedModel, effect: Effect) -> dict[Key, float]:
    """Standard deviation of each parameter of a cause by an error of form that noise may hide.

    Of all quantities with which its size may go, by the one that moves it furthest. Empty where a
    size cannot change within a recording.
    """
    lin, extra = fit.varied(best.linearised, effect, quantities)
    if not extra:
        return {}
    joint = fit.quadratics(lin, extra)
    total, known = joint.total(), len(joint.known)
    least = np.diag(covariance(total.N[:known, :known]))
    about = minimum(Quadratic(total.N[:known, :known], total.g[:known], 0.0, 0))
    prior = 1.0 / (_WRONG * best.point.sizes[effect.name, effect.label]) ** 2
    squares = np.zeros(known)
    for j in range(known, len(total.g)):
        at = [*range(known), j]
        N = total.N[np.ix_(at, at)]
        N[-1, -1] += prior
        moved = minimum(Quadratic(N, total.g[at], 0.0, 0))[:-1] - about
        spread = np.diag(covariance(N))[:-1] - least
        squares = np.maximum(squares, moved**2 + np.maximum(spread, 0.0))
    pairs = zip(joint.known, map(float, np.sqrt(squares)), strict=True)
    return {key: deviation for key, deviation in pairs if key[0] == effect.name}
