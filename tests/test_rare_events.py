"""Subset simulation: quantiles of closed forms, down to one in 1e9; it scatters as it says."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import stdtr
from scipy.stats import chi2, norm, t

from workbench.arrays import Matrix, Vector
from workbench.studies.distance.rare_events import Tail, descend, plain_runs

DECADES = range(1, 10)
PROBABILITIES = 10.0 ** -np.arange(1.0, 10.0)


def tail(
    evaluate: Callable[[Matrix], Vector],
    dimension: int,
    first: int,
    addend: Callable[[Vector], Vector] | None = None,
) -> Tail:
    seeds = range(first, first + 8)
    return Tail(tuple(descend(evaluate, dimension, 9, 500, seed) for seed in seeds), addend)


def summed(points: Matrix) -> Vector:
    return points.sum(axis=1) / np.sqrt(points.shape[1])


def negative_square(points: Matrix) -> Vector:
    return -np.square(points).sum(axis=1)


def largest(points: Matrix) -> Vector:
    return -points.max(axis=1)


@pytest.mark.parametrize(
    ("evaluate", "dimension", "exact"),
    [
        (summed, 30, norm.ppf(PROBABILITIES)),
        (negative_square, 10, -chi2.isf(PROBABILITIES, 10)),
        # The largest of 20: 1 - (1 - sf)^20 = p, in 20 directions of failure.
        (largest, 20, -norm.isf(-np.expm1(np.log1p(-PROBABILITIES) / 20.0))),
    ],
)
def test_quantiles_are_those_of_closed_forms_down_to_one_in_1e9(evaluate, dimension, exact):
    """Of 95 % intervals nine in ten hold: what runs miss together, they do not show."""
    tails = [tail(evaluate, dimension, 100 * k) for k in range(10)]
    found = [[tail.quantile(decade) for decade in DECADES] for tail in tails]
    held = [
        row.low <= value <= row.high for one in found for row, value in zip(one, exact, strict=True)
    ]
    # 90 intervals, those of one tail alike; of ten tails, two and a half deviations are 0.24.
    assert np.mean(held) > 0.66
    mean = np.mean([[row.value for row in one] for one in found], axis=0)
    # Ten tails leave half a percent at 1e-9; 500 samples of a decade bias it by as much.
    assert_allclose(mean, exact, rtol=0.01)


def test_a_probability_scatters_as_it_says():
    """Coefficient of variation at 1e-6, over 25 tails whose quantiles have known probability."""
    found = [tail(summed, 10, 100 * k).quantile(6) for k in range(25)]
    scatter = np.std(np.log(norm.cdf([one.value for one in found])), ddof=1)
    said = np.sqrt(np.mean(np.square([one.variation for one in found])))
    # 25 give a deviation to 14 %, eight runs theirs to 27 %, 25 times: two and a half of both.
    assert 0.6 < scatter / said < 1.4


def test_what_is_added_with_a_heavy_tail_is_not_missed():
    """Reference: the sum of a normal variable and one of Student's t, by numerical integration."""
    spread, left, freedom = 0.021, 0.003, 5

    def beyond(value: float) -> float:
        def density(z: float) -> float:
            return float(norm.cdf((value - left * z) / spread) * t.pdf(z, freedom))

        edges = [-np.inf, 2.0 * value / left - 50.0, value / left, 0.0, np.inf]
        return sum(quad(density, low, high, limit=400)[0] for low, high in pairwise(edges))

    def addend(x: Vector) -> Vector:
        found: Vector = stdtr(freedom, x / left)
        return found

    one = tail(lambda points: spread * summed(points), 30, 1, addend)
    for decade in (4, 9):
        exact = brentq(lambda x, p=10.0**-decade: np.log(beyond(x) / p), -2.0, 0.0)
        found = one.quantile(decade)
        # Three times the half of its interval, which is 1 % at 1e-6 where the tail turns.
        assert abs(found.value - exact) < 1.5 * (found.high - found.low)
        assert_allclose(found.value, exact, rtol=0.03)


def test_it_agrees_with_plain_sampling_of_a_function_that_bends():
    def bent(points: Matrix) -> Vector:
        return points[:, 0] + 0.3 * points[:, 1] ** 2 - 0.2 * np.exp(points[:, 2])

    plain = bent(np.random.default_rng(1).standard_normal((1_000_000, 3)))
    found = tail(bent, 3, 1).quantile(4)
    # The hundredth of a million: its probability is known to 10 %, as is the other's.
    low, high = np.sort(plain)[[70, 130]]
    assert low < found.high
    assert found.low < high


def test_the_same_seed_gives_the_same_samples():
    one, other = (descend(summed, 5, 4, 100, seed=3) for _ in range(2))
    assert_allclose(one.values, other.values, rtol=0.0)
    assert_allclose(one.weights.sum(), 1.0, rtol=1e-12)  # of all that there is
    assert one.evaluations == 100 + 3 * 90


def test_plain_sampling_takes_a_hundred_times_the_inverse_for_a_tenth():
    """Variance of a share: p (1 - p)/n."""
    assert_allclose(plain_runs(1e-5, 0.1), 99.999e5, rtol=1e-12)
