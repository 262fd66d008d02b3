"""What is tuned, as a vector, and where it is searched."""

from dataclasses import astuple, dataclass, fields, replace
from typing import TypeAlias

import numpy as np

from workbench.fmu import FMU, Matrix, Vector
from workbench.observers import (
    DisturbanceGains,
    DisturbanceObserver,
    Estimator,
    ExtendedKalmanFilter,
    FilterNoise,
    OperatingPoint,
    ParameterEstimator,
    ParameterGains,
    UnscentedKalmanFilter,
    pole_placed_gains,
    stationary_gains,
)
from workbench.observers.disturbance import hold_in_equilibrium

Gains: TypeAlias = DisturbanceGains | ParameterGains | FilterNoise

TUNABLE = (DisturbanceObserver.name, ParameterEstimator.name, "ekf", "ukf")
NOISE_REACH = (
    100.0  # a level this far from the sensors' noise means: trust it wholly, or not at all
)


def reasoned_gains(name: str, fmu: FMU) -> Gains:
    """Gains of an estimator before tuning; the FMU is left at an operating point."""
    if name == DisturbanceObserver.name:
        return stationary_gains(fmu)
    if name == ParameterEstimator.name:
        return pole_placed_gains(fmu)
    return FilterNoise()


def build(name: str, fmu: FMU, gains: Gains) -> Estimator:
    """The estimator `name` with the given gains."""
    match gains:
        case DisturbanceGains():
            return DisturbanceObserver(fmu, gains)
        case ParameterGains():
            return ParameterEstimator(fmu, gains)
        case FilterNoise():
            kind = (
                UnscentedKalmanFilter
                if name == UnscentedKalmanFilter.name
                else ExtendedKalmanFilter
            )
            return kind(fmu, gains)


def gain_names(gains: Gains) -> tuple[str, ...]:
    """Names of the tuned gains, in the order of their vector."""
    match gains:
        case FilterNoise():
            return tuple(field.name for field in fields(gains))
        case DisturbanceGains():
            return (*_entries(gains.L), "T_WR", "T_DC")
        case ParameterGains():
            return _entries(gains.L)


def to_vector(gains: Gains) -> Vector:
    """The tuned gains, (n,)."""
    match gains:
        case FilterNoise():
            return np.array(astuple(gains))
        case DisturbanceGains():
            return np.array([*gains.L.ravel(), gains.T_WR, gains.T_DC])
        case ParameterGains():
            return gains.L.flatten()


def from_vector(gains: Gains, values: Vector) -> Gains:
    """The same gains with tuned values, (n,)."""
    match gains:
        case FilterNoise():
            return FilterNoise(*map(float, values))
        case DisturbanceGains():
            L = np.array(values[:16]).reshape(4, 4)
            return replace(gains, L=L, T_WR=float(values[16]), T_DC=float(values[17]))
        case ParameterGains():
            return replace(gains, L=np.array(values).reshape(2, 4))


def _entries(L: Matrix) -> tuple[str, ...]:
    rows, columns = L.shape
    return tuple(f"L{i + 1}{j + 1}" for i in range(rows) for j in range(columns))


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """Coordinates in 0..1 for gains of any size and sign.

    A gain is smallest * sinh(s * asinh(largest / smallest)): proportional to s where it is too
    small to matter, logarithmic beyond, of either sign.

    Attributes
    ----------
    smallest, largest : (n,) magnitudes between which a gain matters.
    lower, upper : (n,) range of s: -1..1 for both signs.
    start : (n,) coordinates of the reasoned gains.
    """

    smallest: Vector
    largest: Vector
    lower: Vector
    upper: Vector
    start: Vector

    def gains(self, coordinates: Vector) -> Vector:
        """Gains (..., n) at coordinates (..., n)."""
        s = self.lower + coordinates * (self.upper - self.lower)
        return np.asarray(self.smallest * np.sinh(s * np.arcsinh(self.largest / self.smallest)))

    def coordinates(self, gains: Vector) -> Vector:
        """Coordinates (..., n) of gains (..., n)."""
        s = np.arcsinh(gains / self.smallest) / np.arcsinh(self.largest / self.smallest)
        return np.asarray((s - self.lower) / (self.upper - self.lower))

    def at_bound(self, coordinates: Vector) -> Vector:
        """Which gains, (n,) of bool, ended within 1 % of a bound."""
        return np.asarray((coordinates < 0.01) | (coordinates > 0.99))


def search_space(fmu: FMU, gains: Gains, slowest: float, fastest: float) -> SearchSpace:
    """Bounds that follow from the linearised model and the recordings.

    By itself a gain closes a loop of angular frequency w through an effect e on a speed: a gain of
    a speed on its rate (1/s) has w = L, one on the rate of a friction (1/rad) has w^2 = e L, and an
    integral one order more. It matters from the slowest w that a recording shows to the fastest
    that its samples carry.

    Parameters
    ----------
    fmu : the estimator's model; its state is left at the operating point.
    slowest, fastest : angular frequencies [rad/s].
    """
    values = to_vector(gains)
    if isinstance(gains, FilterNoise):
        smallest, largest = values / NOISE_REACH, values * NOISE_REACH
        # From the smallest level on: a filter without noise has no gain.
        lower, upper = np.arcsinh(1.0) / np.arcsinh(largest / smallest), np.ones(values.size)
    else:
        orders, effects = _loops(fmu, gains)
        smallest, largest = slowest**orders / effects, fastest**orders / effects
        lower, upper = -np.ones(values.size), np.ones(values.size)
        if isinstance(gains, DisturbanceGains):
            upper[16:] = 0.0  # a friction deviation that grows by itself is no disturbance model
    span = SearchSpace(smallest, largest, lower, upper, np.zeros(values.size))
    return replace(span, start=np.clip(span.coordinates(values), 0.0, 1.0))


def _loops(fmu: FMU, gains: DisturbanceGains | ParameterGains) -> tuple[Vector, Vector]:
    """Order of the loop that each gain closes, (n,), and effect in it, (n,)."""
    effect = _effect_of_frictions(fmu)
    frictions = np.tile(effect, 2).ravel()
    if isinstance(gains, ParameterGains):
        return np.tile([1.0, 1.0, 2.0, 2.0], 2), frictions
    orders = np.array([[1, 1, 2, 2], [1, 1, 2, 2], [2, 2, 3, 3], [2, 2, 3, 3]], float)
    return np.append(orders, [1.0, 1.0]), np.concatenate([np.ones(8), frictions, np.ones(2)])


def _effect_of_frictions(fmu: FMU) -> Matrix:
    """Effect of muWR, muDC (rows) on omegaW, omegaR (columns), (2, 2) [rad/s2].

    Directly, or through the common speed of wheelset and roller, whichever is larger.
    """
    hold_in_equilibrium(fmu, OperatingPoint())
    order = [fmu.states.index(name) for name in ("omegaW", "omegaR")]
    A = fmu.state_jacobian()[np.ix_(order, order)]
    B = fmu.input_jacobian(fmu.variables(["dmuWR", "dmuDC"]))[order]
    rates, left = np.linalg.eig(A.T)
    slow = left[:, np.argmax(rates.real)].real
    rolling = np.array([fmu.defaults["rR"] / fmu.defaults["rW"], 1.0])
    common = np.outer(rolling, slow @ B / (slow @ rolling))
    return np.asarray(np.maximum(np.abs(B), np.abs(common)).T)
