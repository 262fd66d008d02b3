"""Quantiles that are reached once in a million times or less, by subset simulation.

A rare event is a chain of frequent ones: of each decade the tenth of the samples that is furthest
out leads on, by Markov chains that stay beyond the tenth. Nine decades take as many samples as
plain sampling has for the third or fourth.
Sources: S.-K. Au, J. L. Beck (2001), Probabilistic Engineering Mechanics 16, 263-277; the steps of
the chains are those of I. Papaioannou, W. Betz, K. Zwirglmaier, D. Straub (2015), Probabilistic
Engineering Mechanics 41, 89-103, section 3.3.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtrit

from workbench.arrays import Matrix, Vector
from workbench.studies.distance.standard import NominalRate

_SHARE = 0.1  # of the samples of a decade that lead on
_ACCEPTED = 0.44  # share of accepted steps at which chains forget best (Papaioannou et al., 3.3)
_STEP = 0.6  # of a chain at first, over the spread of the samples


@dataclass(frozen=True, eq=False)
class Descent:
    """One run: samples of a distribution, of which the lower tail has as many as the middle."""

    values: Vector  # (n,) least first
    weights: Vector  # (n,) probability that each stands for
    evaluations: int  # of the function


@dataclass(frozen=True)
class Quantile:
    """A value that is not reached with a probability."""

    probability: float
    value: float
    # low, high: between which it is, 95 %
    low: float
    high: float
    variation: float  # coefficient of variation of the probability of `value`


@dataclass(frozen=True, eq=False)
class Tail:
    """The lower tail of a distribution, from runs that know nothing of each other."""

    runs: tuple[Descent, ...]  # two or more
    # cumulative distribution of what is added to each sample, which nothing that was sampled tells,
    # (n,) of (n,); or None. It is not sampled, because chains that follow the bulk miss a single
    # variable with a heavy tail.
    addend: Callable[[Vector], Vector] | None = None

    def quantile(self, decade: int) -> Quantile:
        """Quantile of a probability 10^-decade, the mean of the runs.

        Runs scatter by Student's t. Over closed forms, intervals of 95 % hold nine times in ten:
        what runs miss together, they do not show.
        """
        values = np.array([self._quantile(run, 10.0**-decade) for run in self.runs])
        middle, root = float(values.mean()), math.sqrt(values.size)
        half = float(-stdtrit(values.size - 1, 0.025) * values.std(ddof=1)) / root
        beyond = np.array([self._beyond(run, middle) for run in self.runs])
        variation = float(beyond.std(ddof=1) / beyond.mean()) / root
        return Quantile(10.0**-decade, middle, middle - half, middle + half, variation)

    @property
    def evaluations(self) -> int:
        """Of the function, in all."""
        return sum(run.evaluations for run in self.runs)

    def _quantile(self, run: Descent, probability: float) -> float:
        if self.addend is None:
            middle = np.cumsum(run.weights) - 0.5 * run.weights
            return float(np.interp(probability, middle, run.values))
        low, high = float(run.values[0]), float(run.values[-1])
        while self._beyond(run, low) > probability:
            low -= high - low

        def away(value: float) -> float:
            return math.log(max(self._beyond(run, value), 1e-300) / probability)

        return float(brentq(away, low, high, xtol=1e-7 * (high - low)))

    def _beyond(self, run: Descent, value: float) -> float:
        """Probability of less than a value."""
        if self.addend is None:
            middle = np.cumsum(run.weights) - 0.5 * run.weights
            return float(np.interp(value, run.values, middle))
        return float(run.weights @ self.addend(value - run.values))


def plain_runs(probability: float, variation: float) -> float:
    """Evaluations by which plain sampling tells a probability as surely.

    >>> round(plain_runs(1e-9, 0.1))
    99999999900
    """
    return (1.0 - probability) / (probability * variation**2)


def descend(
    evaluate: Callable[[Matrix], Vector], dimension: int, decades: int, samples: int, seed: int
) -> Descent:
    """Go down the lower tail of a function of standard normal variables once.

    Parameters
    ----------
    evaluate : takes points (n, d), returns the function (n,).
    samples : of each decade, a multiple of ten.

    Examples
    --------
    A normal variable is below -5.998 once in 1e9 times.

    >>> def first(u):
    ...     return u[:, 0]
    >>> tail = Tail(tuple(descend(first, 5, 9, 1000, seed) for seed in range(8)))
    >>> quantile = tail.quantile(9)
    >>> quantile.low < -5.998 < quantile.high
    True
    """
    rng = np.random.default_rng(seed)
    kept = round(_SHARE * samples)
    points = rng.standard_normal((samples, dimension))
    values = evaluate(points)
    weight, step, evaluations = 1.0 / samples, _STEP, samples
    decade_values, weights = [], []
    for _ in range(decades - 1):
        order = np.argsort(values, kind="stable")
        decade_values.append(values[order[kept:]])
        weights.append(np.full(samples - kept, weight))
        begin, bound = order[:kept], float(np.mean(values[order[kept - 1 : kept + 1]]))
        points, values, step = _chains(evaluate, points[begin], values[begin], bound, step, rng)
        weight, evaluations = _SHARE * weight, evaluations + samples - kept
    decade_values.append(values)
    weights.append(np.full(samples, weight))
    drawn, probability = np.concatenate(decade_values), np.concatenate(weights)
    order = np.argsort(drawn, kind="stable")
    return Descent(drawn[order], probability[order], evaluations)


def _chains(
    evaluate: Callable[[Matrix], Vector],
    points: Matrix,
    values: Vector,
    bound: float,
    step: float,
    rng: np.random.Generator,
) -> tuple[Matrix, Vector, float]:
    """Samples beyond a bound from those that lead on, ten from each; all chains step together.

    A step keeps the normal distribution whatever its size, so that only the bound refuses it; the
    size follows the share that is accepted.
    """
    chain_points, chain_values = [points], [values]
    for k in range(1, round(1.0 / _SHARE)):
        # u' = sqrt(1 - step^2) u + step w with w normal is normal as u is.
        proposed = math.sqrt(1.0 - step**2) * points + step * rng.standard_normal(points.shape)
        proposed_values = evaluate(proposed)
        accepted = proposed_values <= bound
        points = np.where(accepted[:, None], proposed, points)
        values = np.where(accepted, proposed_values, values)
        chain_points.append(points)
        chain_values.append(values)
        step = min(0.999, step * math.exp((float(accepted.mean()) - _ACCEPTED) / math.sqrt(k)))
    return np.concatenate(chain_points), np.concatenate(chain_values), step


# --- plain sampling, which subset simulation is held against ---


@dataclass(frozen=True)
class PlainLevel:
    """A deceleration that all but one stop in so many reach, as that many stops show it."""

    decade: int  # of that number
    ratio: float  # of it to the nominal one
    # low, high: between which it is, 95 %
    low: float
    high: float


@dataclass(frozen=True)
class PlainSampling:
    """What plain samples show of a safety level."""

    samples: int  # that were drawn
    levels: tuple[PlainLevel, ...]  # by decade, as far as they reach

    @classmethod
    def of(cls, shortness: Vector, decades: int, nominal: NominalRate) -> Self:
        """From minus the logarithm of distances [m], (n,)."""
        ordered, levels = np.sort(shortness), []
        for decade in range(1, decades + 1):
            if (ends := quantile(ordered, 10.0**-decade)) is None:
                break
            levels.append(PlainLevel(decade, *map(nominal.ratio, ends)))
        return cls(shortness.size, tuple(levels))

    def lines(self) -> list[str]:
        """Lines for people."""
        return [f"the same by {self.samples} plain samples, 95 %:"] + [
            f"  1e{level.decade:<6} {level.ratio:7.4f}    {level.low:.4f} to {level.high:.4f}"
            for level in self.levels
        ]


def quantile(shortness: Vector, probability: float) -> tuple[float, float, float] | None:
    """Quantile of a sample and its 95 % interval, whatever the distribution; None: too few.

    The number of samples below a quantile is binomial, so that two of their ranks hold it.
    Source: H. A. David, H. N. Nagaraja (2003), Order Statistics, 3rd ed., section 7.1.

    Parameters
    ----------
    shortness : (n,) least first.

    Examples
    --------
    >>> quantile(np.arange(1.0, 10_001.0), 1e-2)
    (100.0, 81.0, 121.0)
    """
    from scipy.stats import binom  # takes its time, and little else needs it

    n = shortness.size
    low, high = (int(binom.ppf(share, n, probability)) for share in (0.025, 0.975))
    if low < 1 or high + 1 > n:
        return None
    middle = max(1, round(n * probability))
    value, least, most = (float(shortness[rank - 1]) for rank in (middle, low, high + 1))
    return value, least, most
