"""A point of the fit, and what the stops say about it: errors, derivatives, likelihood."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.inference.quadratic import Key
from workbench.diagnosis.inference.thresholds import Thresholds
from workbench.diagnosis.simulation.simulator import WhitenedResiduals


@dataclass(frozen=True)
class Point:
    """Values of all unknowns."""

    # by effect and parameter, SI; an order-locked effect has its "amplitude" here
    sizes: Mapping[Key, float]
    levels: Mapping[Key, float]  # common level by parameter and choice of a condition, or by delay
    deviations: Matrix  # of each recording from the common values, in standard deviations, (K, d)
    phases: Mapping[str, Vector]  # [rad] of order-locked effects, (K,) by effect


@dataclass(frozen=True, eq=False)
class LinearizedPoint:
    """Evidence of all stops about a point."""

    point: Point
    # of the columns of each jacobian: delays, what differs between recordings, (effect, parameter)
    keys: tuple[Key, ...]
    residuals: tuple[WhitenedResiduals, ...]
    lasting: int  # blocks from which on an error is no noise
    # (m,) variance of slow errors over that of white noise, by channel, at least 1
    variance_factors: Vector
    away: float  # chi-squared of levels and deviations against what tolerances say of them
    excess: float = Thresholds.excess  # see `Thresholds`
    settled: bool = False  # whether a fit that ended here found no step that is worth one

    def extended(self, keys: Iterable[Key], jacobians: Sequence[Matrix]) -> "LinearizedPoint":
        """The same with more columns, (b*m + q, p) of each stop."""
        residuals = tuple(
            replace(recording, jacobian=np.column_stack([recording.jacobian, more]))
            for recording, more in zip(self.residuals, jacobians, strict=True)
        )
        return replace(self, keys=(*self.keys, *keys), residuals=residuals)

    def derived_as(self, other: "LinearizedPoint") -> "LinearizedPoint":
        """The same with derivatives at another point, where errors alone are asked for."""
        residuals = tuple(
            replace(recording, jacobian=there.jacobian)
            for recording, there in zip(self.residuals, other.residuals, strict=True)
        )
        return replace(self, keys=other.keys, residuals=residuals)

    @property
    def misfit(self) -> float:
        """Chi-squared of all stops at the point, in units of the noise."""
        return float(sum(recording.residual @ recording.residual for recording in self.residuals))

    @property
    def squares(self) -> Vector:
        """Mean square of the errors of blocks that are told, by channel (m,)."""
        errors = np.concatenate([recording.errors for recording in self.residuals])
        squares: Vector = _share(self.residuals) * np.square(errors).mean(axis=0)
        return squares

    @property
    def deviance(self) -> float:
        """What a fit makes least: minus twice the log likelihood, up to a constant.

        Of a channel that is wrong, the variance is unknown, and errors that last count once:
        its logarithm counts. To spoil one channel for another is no gain then.
        Source: Y. Bard, Nonlinear Parameter Estimation, 1974, section 4-8.
        """
        count, mean = _counts(self.residuals), self.squares
        noise = count * np.minimum(mean, 1.0 + self.excess)
        wrong = count / self.lasting * np.log(self.spread)
        at_rest = sum(float(recording.rest @ recording.rest) for recording in self.residuals)
        return float((noise + wrong).sum()) + at_rest + self.away

    @property
    def spread(self) -> Vector:
        """(m,) By what chi-squared of each channel is divided, for a step to lower the deviance."""
        wrong: Vector = np.maximum(0.0, self.squares - (1.0 + self.excess))
        return 1.0 + self.lasting * wrong

    def weighed(self, variance_factors: Vector) -> float:
        """Chi-squared, each channel in units of what is wrong with it, (m,)."""
        return float(
            sum(
                (recording.errors**2 / variance_factors).sum() + recording.rest @ recording.rest
                for recording in self.residuals
            )
        )


def lasting(errors: Matrix, blocks: int) -> Matrix:
    """Squares of means of so many whitened errors (b, c), times their number: noise leaves 1."""
    count = len(errors) // blocks * blocks
    means = errors[:count].reshape(-1, blocks, errors.shape[1]).mean(axis=1)
    squares: Matrix = blocks * means**2
    return squares


def slowness(residuals: Sequence[WhitenedResiduals], blocks: int) -> Vector:
    """Variance of errors that last over that of white noise, by channel, at least 1.

    What a model lacks leaves more than noise does, and then priors and tolerances must be weighed
    against that, not against the noise.
    """
    squares = np.concatenate([lasting(recording.errors, blocks) for recording in residuals])
    slow: Vector = np.maximum(1.0, _share(residuals) * squares.mean(axis=0))
    return slow


def _counts(residuals: Sequence[WhitenedResiduals]) -> Vector:
    """Number of blocks that are told, by channel (m,)."""
    counts: Vector = np.sum([recording.blocks for recording in residuals], axis=0)
    return counts


def _share(residuals: Sequence[WhitenedResiduals]) -> Vector:
    """Blocks over those that are told, by channel (m,): silent ones have no errors."""
    share: Vector = sum(len(recording.errors) for recording in residuals) / _counts(residuals)
    return share


def between(point: Point, other: Point) -> Point:
    """Half way; nothing that one of them lacks."""

    def half(a: Mapping[Any, Any], b: Mapping[Any, Any]) -> dict[Any, Any]:
        return {key: 0.5 * (value + b[key]) for key, value in a.items()}

    return Point(
        half(point.sizes, other.sizes),
        half(point.levels, other.levels),
        0.5 * (point.deviations + other.deviations),
        half(point.phases, other.phases),
    )
