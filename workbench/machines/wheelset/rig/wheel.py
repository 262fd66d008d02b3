"""What turns with the wheelset and is not round, and what slip makes of friction."""

import math

_FALLING_SLIP = 5.0  # [m/s] that makes 1 - 1/e of a change of friction with slip
_CLEANING_ENERGY = 250e3  # [J] of slip at one wheel leaves 1/e of what soils its contact


class OutOfRoundWheel:
    """A wheel whose radius varies over a turn, beside a model whose wheel is round.

    The model's wheel keeps the velocity of the rim, which is all that the contact knows. The true
    one turns slower where its radius is larger; the torque that makes it do so, and the longer
    lever of the creep force, act on the model from outside. Setting the radius of the model every
    millisecond would be a staircase instead, on which the stiff contact kicks: at 10 m/s the
    ripple of the force would be twice too large.

    Parameters
    ----------
    amplitude : [m] of the radius, once per turn.
    phase : [rad] the radius is largest at -phase.
    radius : [m] mean.
    inertia : [kg.m2] of the wheelset.
    """

    def __init__(self, amplitude: float, phase: float, radius: float, inertia: float) -> None:
        self._amplitude = amplitude
        self._phase = phase
        self._radius = radius
        self._inertia = inertia

    def speed(self, omega: float, phi: float) -> float:
        """Angular velocity [rad/s] of the true wheel, where that of the round one is `omega`."""
        bump = self._amplitude * math.cos(phi + self._phase)
        return omega * (self._radius / (self._radius + bump))

    def torque(self, omega: float, phi: float, Fx: float) -> float:
        """Torque [N.m] on the round wheel, of first order in the amplitude."""
        angle = phi + self._phase
        inertial = self._inertia * omega * omega / self._radius
        return self._amplitude * (Fx * math.cos(angle) - inertial * math.sin(angle))


def falls(gain: float, slip: float) -> float:
    """Contact friction at a slip velocity [m/s], over that which falls as Polach's."""
    return 1.0 - gain * math.expm1(-abs(slip) / _FALLING_SLIP)


class CleanedContact:
    """Contact friction that recovers with the energy of slip.

    Source: Voltr and Lata (2015), Transient wheel-rail adhesion characteristics under the cleaning
    effect of sliding, Vehicle System Dynamics 53, 605-618; in its simplest form.

    Parameters
    ----------
    recovery : share of friction that a clean contact has more.
    dt : [s] time between two steps.
    """

    def __init__(self, recovery: float, dt: float) -> None:
        self.friction = 1.0  # over that of the soiled contact
        self._recovery = recovery
        self._dt = dt
        self._soiled = 1.0

    def rub(self, power: float) -> None:
        """Advance by one time step with `power` [W] of slip at each wheel."""
        self._soiled *= math.exp(-self._dt * power / _CLEANING_ENERGY)
        self.friction = 1.0 + self._recovery * (1.0 - self._soiled)
