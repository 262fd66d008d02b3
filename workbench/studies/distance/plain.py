"""Quantiles by plain sampling, which subset simulation is held against."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.stats import binom

from workbench.arrays import Vector
from workbench.studies.distance.standard import NominalRate


@dataclass(frozen=True)
class PlainLevel:
    """A deceleration that all but one stop in so many reach, as that many stops show it.

    Attributes
    ----------
    decade : of that number.
    ratio : of it to the nominal one; low, high : between which it is, 95 %.
    """

    decade: int
    ratio: float
    low: float
    high: float


@dataclass(frozen=True)
class PlainSampling:
    """What plain samples show of a safety level.

    Attributes
    ----------
    samples : that were drawn.
    levels : by decade, as far as they reach.
    """

    samples: int
    levels: tuple[PlainLevel, ...]

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
    n = shortness.size
    low, high = (int(binom.ppf(share, n, probability)) for share in (0.025, 0.975))
    if low < 1 or high + 1 > n:
        return None
    middle = max(1, round(n * probability))
    value, least, most = (float(shortness[rank - 1]) for rank in (middle, low, high + 1))
    return value, least, most
