"""The drive that lets the roller behave as a train."""

import math
from dataclasses import dataclass

TRAIN_INERTIA = 7840.0  # [kg.m2] 16 t at the roller's circumference, which it imitates usually

_OBSERVER_LAG = 0.005  # [s]
_TORQUE_LAG = 0.003  # [s] of the inverter
_HOLDING = 15e3  # [N.m.s/rad] stops the roller in 0.1 s
_RIPPLE = 0.005  # of the torque, six times per turn: an inverter's sixth harmonic


@dataclass(frozen=True)
class Losses:
    """Loss torque c0 + c1*|omega| + c2*omega**2, with the sign of omega; SI units."""

    c0: float
    c1: float
    c2: float

    def torque(self, omega: float) -> float:
        """Loss torque [N.m] at `omega` [rad/s]; the sign is smoothed below 0.05 rad/s."""
        size = self.c0 + self.c1 * abs(omega) + self.c2 * omega * omega
        return size * math.tanh(omega / 0.05)


class Drive:
    """Electrical inertia simulation with compensation of the roller's losses.

    What brakes the roller, the creep force and the losses, is told from speed and torque by a
    disturbance observer of reduced order. The losses, as the drive knows them, are given back:
    the imitated train has no resistance of its own, so that all that slows it passes the contact.
    Of the rest the drive carries what the roller's inertia lacks. Switched off, it does neither.

    Parameters
    ----------
    inertia : [kg.m2] of the roller, as the drive knows it.
    imitated : [kg.m2] that it lets the roller have; 0 where it is off.
    losses : of the roller, as the drive knows them.
    omega : [rad/s] at the start.
    dt : [s] period of the control.
    """

    def __init__(
        self, inertia: float, imitated: float, losses: Losses, omega: float, dt: float
    ) -> None:
        self._inertia = inertia
        self._share = 1.0 - inertia / imitated if imitated else 0.0
        self._losses = losses if imitated else Losses(0.0, 0.0, 0.0)
        self._dt = dt
        self._follow = 1.0 - math.exp(-dt / _TORQUE_LAG)
        self._torque = self._losses.torque(omega)
        # The observer starts settled, on losses alone.
        self._momentum = inertia * omega + _OBSERVER_LAG * self._torque
        self._angle = 0.0

    def step(self, omega: float, *, stopped: bool) -> float:
        """Torque [N.m] until the next call; once stopped, the drive holds the roller still."""
        load = (self._momentum - self._inertia * omega) / _OBSERVER_LAG
        losses = self._losses.torque(omega)
        wanted = -_HOLDING * omega if stopped else self._share * (load - losses) + losses
        self._torque += self._follow * (wanted - self._torque)
        self._angle += omega * self._dt
        torque = self._torque * (1.0 + _RIPPLE * math.cos(6.0 * self._angle))
        # d(load)/dt = (actual load - load)/lag, without differentiating the speed.
        self._momentum += self._dt * (torque - load)
        return torque
