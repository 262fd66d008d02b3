"""What every estimator does."""

from typing import Protocol

from workbench.fmu import Vector

# Columns of an estimate, with units; NaN where a method does not estimate the quantity.
ESTIMATE = {
    "omegaW": "rad/s",
    "omegaR": "rad/s",
    "muWR": "1",
    "muDC": "1",
    "Fx": "N",
    "slip": "m/s",
}


class Estimator(Protocol):
    """Feeds on u = [pB, tauR] (Pa, N.m) and y = [omegaW, omegaR] (rad/s), sample by sample."""

    @property
    def name(self) -> str:
        """Key in tables and results."""
        ...

    def init(self, t: float, u: Vector, y: Vector) -> Vector:
        """Start at time t [s] with the first sample; returns the estimate, (6,) as in ESTIMATE."""
        ...

    def step(self, t: float, u: Vector, y: Vector) -> Vector:
        """Advance to time t [s] with the sample taken there; returns the estimate, (6,)."""
        ...
