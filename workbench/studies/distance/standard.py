"""Distances as standards calculate and correct them.

Sources: EN 14531-1:2015, clause 4, and ISO 20138-1 (equivalent rate and response); EN 16834
(corrections to nominal conditions, and the percentage).
"""

import math
from dataclasses import dataclass

G = 9.81  # [m/s2]


def stopping_distance(speed: float, response: float, rate: float) -> float:
    """Distance s = v0 te + v0^2/(2 ae) [m].

    Parameters
    ----------
    speed : at the command [m/s].
    response : equivalent, a delay and half of a rise in a line [s].
    rate : equivalent deceleration [m/s2].

    >>> round(stopping_distance(200.0 / 3.6, 1.598264, 0.899829), 2)
    1803.8
    """
    return speed * response + speed**2 / (2.0 * rate)


def equivalent_rate(speed: float, response: float, distance: float) -> float:
    """Equivalent deceleration ae [m/s2], the inverse of `stopping_distance`."""
    return speed**2 / (2.0 * (distance - speed * response))


@dataclass(frozen=True)
class NominalRate:
    """Deceleration of a stop as its sheet says it, which others are compared with."""

    speed: float  # at the command [m/s]
    response: float  # equivalent [s]
    distance: float  # nominal [m]

    @property
    def rate(self) -> float:
        """Equivalent deceleration [m/s2]."""
        return equivalent_rate(self.speed, self.response, self.distance)

    def ratio(self, shortness: float) -> float:
        """Deceleration over the nominal one, of minus the logarithm of a distance [m]."""
        return equivalent_rate(self.speed, self.response, math.exp(-shortness)) / self.rate


@dataclass(frozen=True)
class StopConditions:
    """Under which a stop was made."""

    mass: float  # weighed
    rotating: float  # what turns adds [kg]
    resistance: float  # of gradients and curves over weight, uphill positive [1]


def nominal_rate(rate: float, conditions: StopConditions, mass: float) -> float:
    """Equivalent deceleration on a level, straight way with a nominal mass [m/s2].

    The force follows the weighed load: it is taken as that of the mass that was stopped.

    Parameters
    ----------
    rate : as it was [m/s2].
    mass : nominal [kg].
    """
    turning = conditions.mass + conditions.rotating
    level = rate - G * conditions.resistance * conditions.mass / turning
    return level * turning / conditions.mass * mass / (mass + conditions.rotating)


def percentage(distance: float, constants: tuple[float, float]) -> float:
    """C/s - D [%].

    >>> round(percentage(1000.0, (61300.0, 8.9)), 1)
    52.4
    """
    return constants[0] / distance - constants[1]
