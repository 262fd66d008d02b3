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

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from workbench.recording import Matrix, Vector

SHARE = 0.1  # of the samples of a level that lead on: the levels are decades
_ACCEPTED = 0.44  # share of accepted steps at which chains forget best (Papaioannou et al., 3.3)
_STEP = 0.6  # of a chain at first, over the spread of the samples


@dataclass(frozen=True)
class Level:
    """One decade of one run.

    Attributes
    ----------
    value : quantile.
    variation : coefficient of variation of this decade's own estimate of a tenth.
    accepted : share of the steps of its chains; 1 of the first, which has none.
    """

    value: float
    variation: float
    accepted: float


@dataclass(frozen=True, eq=False)
class Tail:
    """The lower tail of a distribution, from runs that know nothing of each other.

    Attributes
    ----------
    runs : two or more, each with the same decades.
    samples : of each decade of a run.
    """

    runs: tuple[tuple[Level, ...], ...]
    samples: int

    @property
    def decades(self) -> int:
        """How far down it goes."""
        return len(self.runs[0])

    def probability(self, decade: int) -> float:
        """Of what is beyond the quantile of a decade, counted from 1."""
        return SHARE**decade

    def value(self, decade: int) -> float:
        """Quantile of a decade, counted from 1: the mean of the runs."""
        return float(np.mean(self._values(decade)))

    def interval(self, decade: int, confidence: float = 0.95) -> tuple[float, float]:
        """Between which the quantile is, by the scatter of the runs (Student's t)."""
        values = self._values(decade)
        half = float(t.isf(0.5 - 0.5 * confidence, values.size - 1))
        half *= float(values.std(ddof=1)) / math.sqrt(values.size)
        return self.value(decade) - half, self.value(decade) + half

    def variation(self, decade: int) -> float:
        """Coefficient of variation of the probability, as the chains of the runs say themselves.

        It takes decades as independent: the lower bound of Au and Beck, equation 29, of which runs
        scatter up to a third more. `interval` does not rest on it.
        """
        squares = [sum(one.variation**2 for one in run[:decade]) for run in self.runs]
        return math.sqrt(float(np.mean(squares)) / len(self.runs))

    @property
    def evaluations(self) -> int:
        """Of the function, in all."""
        kept = round(SHARE * self.samples)
        each = self.samples + (self.decades - 1) * (self.samples - kept)
        return len(self.runs) * each

    def _values(self, decade: int) -> Vector:
        return np.array([run[decade - 1].value for run in self.runs])


def plain_runs(probability: float, variation: float) -> float:
    """Evaluations by which plain sampling tells a probability as surely.

    >>> round(plain_runs(1e-9, 0.1))
    100000000000
    """
    return (1.0 - probability) / (probability * variation**2)


def descend(
    evaluate: Callable[[Matrix], Vector], dimension: int, decades: int, samples: int, seed: int
) -> tuple[Level, ...]:
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
    >>> tail = Tail(tuple(descend(first, 5, 9, 1000, seed) for seed in range(8)), 1000)
    >>> low, high = tail.interval(9)
    >>> low < -5.998 < high
    True
    """
    rng = np.random.default_rng(seed)
    kept = round(SHARE * samples)
    points = rng.standard_normal((samples, dimension))
    values = evaluate(points)
    step, chains, accepted = _STEP, samples, 1.0
    found: list[Level] = []
    while True:
        order = np.argsort(values, kind="stable")
        bound = float(np.mean(values[order[kept - 1 : kept + 1]]))
        variation = _variation((values <= bound).reshape(-1, chains))
        found.append(Level(bound, variation, accepted))
        if len(found) == decades:
            return tuple(found)
        begin, chains = order[:kept], kept
        points, values, step, accepted = _chains(
            evaluate, points[begin], values[begin], bound, step, rng
        )


def _chains(
    evaluate: Callable[[Matrix], Vector],
    points: Matrix,
    values: Vector,
    bound: float,
    step: float,
    rng: np.random.Generator,
) -> tuple[Matrix, Vector, float, float]:
    """Samples beyond a bound from some of them, (n * length,), one step of all chains at a time.

    A step keeps the normal distribution whatever its size, so that only the bound refuses it; the
    size follows the share that is accepted.
    """
    found, known, accepted = [points], [values], []
    for k in range(1, round(1.0 / SHARE)):
        turned = math.sqrt(1.0 - step**2) * points + step * rng.standard_normal(points.shape)
        there = evaluate(turned)
        taken = there <= bound
        points = np.where(taken[:, None], turned, points)
        values = np.where(taken, there, values)
        found.append(points)
        known.append(values)
        accepted.append(float(taken.mean()))
        step = min(0.999, step * math.exp((accepted[-1] - _ACCEPTED) / math.sqrt(k)))
    return np.concatenate(found), np.concatenate(known), step, float(np.mean(accepted))


def _variation(beyond: NDArray[np.bool_]) -> float:
    """Coefficient of variation of a share of samples that chains (length, n) made.

    Au and Beck (2001), equations 25 to 28: samples of a chain are alike, which counts like fewer.
    """
    told = beyond.astype(np.float64)
    length, share = len(told), told.mean()
    alike = 0.0
    for lag in range(1, length):
        together = (told[lag:] * told[:-lag]).mean() - share**2
        alike += 2.0 * (1.0 - lag / length) * together / (share * (1.0 - share))
    return math.sqrt((1.0 - share) / (share * told.size) * max(1.0 + alike, 1.0))
