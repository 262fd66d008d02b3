"""Friction of the pads, heat and water of the discs."""

import math
from collections.abc import Sequence

from workbench.machines.wheelset.rig.effects import Effects
from workbench.machines.wheelset.rig.scenarios import Conditions

FRICTION = 0.30  # at 22 m/s, 100 degC and 35 kN

_SPEED, _TEMPERATURE, _FORCE = 22.0, 100.0, 35e3  # [m/s], [degC], [N] of that friction
_LEAST_FORCE = 1e3  # [N] below, the power law of the force is not followed
_BEDDING_TIME = 2.0  # [s]
_WET_FRICTION = 0.12
_DRYING_ENERGY = 0.45e6  # [J] of friction on one disc leaves 1/e of its film
_STEP_AT, _STEP_WIDTH = 90.0, 5.0  # [degC], [K] of friction_step
_SLOWING_LAG = 0.2  # [s] of friction_deceleration, longer than wheels swing
_RIPPLE = 2.0 * math.pi * 0.3  # [rad/s] of friction_ripple

_AMBIENT, _ICE = 20.0, 273.15  # [degC], [K]
_HEAT_CAPACITY = 75.0 * 500.0  # [J/K] friction ring of 75 kg
_INTO_DISC = 0.93  # share of the heat; the pads take the rest


class Pads:
    """Pad friction that depends on speed, temperature, force, first contact and water.

    Each disc is one lump of steel, heated by its own friction and cooled by the air. Its film of
    water leaves with friction energy, not with time.

    Parameters
    ----------
    effects : gains of the dependences.
    conditions : of the discs at the start.
    level : friction over FRICTION, from rig to rig.
    phase : [rad] of the discs' thickness.
    dt : [s] time between two steps.
    """

    def __init__(
        self, effects: Effects, conditions: Conditions, level: float, phase: float, dt: float
    ) -> None:
        discs = conditions.discs
        self.temperature = [conditions.disc_temperature - _ICE] * len(discs)  # [degC] of each disc
        films = [effects.water_film] * len(discs)
        films[1] = max(films[1], effects.single_disc_film)
        # water on each disc, 1 at the start if wet, what is planted if dry
        self.film = [
            1.0 if disc == "wet" else film for disc, film in zip(discs, films, strict=True)
        ]
        self._effects = effects
        self._level = level
        self._phase = phase
        self._dt = dt
        self._contact = 0.0  # [s] since first contact
        self._speed = math.nan  # [m/s] before
        self._slowing = 0.0  # [m/s2] deceleration

    def friction(self, speed: float, force: float, turn: float) -> list[float]:
        """Friction coefficient of each disc.

        Parameters
        ----------
        speed : [m/s] of the wheel's circumference; pads slide at a fixed share of it.
        force : [N] normal force of one unit.
        turn : [rad] angle of the discs.
        """
        e = self._effects
        common = FRICTION * (1.0 + e.speed_friction * (1.0 - speed / _SPEED))
        common *= (max(force, _LEAST_FORCE) / _FORCE) ** -e.pressure_exponent
        common *= 1.0 - e.bedding_in * math.exp(-self._contact / _BEDDING_TIME)
        varied = 1.0 + e.disc_thickness * math.cos(turn + self._phase)
        varied *= 1.0 + e.friction_ripple * math.sin(_RIPPLE * self._contact)
        varied *= 1.0 + e.friction_deceleration * self._slowing
        return [
            self._level
            * (common * (1.0 - e.fade * (T - _TEMPERATURE)) * (1.0 - film) + _WET_FRICTION * film)
            * varied
            # From 0 below _STEP_AT to 1 above.
            * (1.0 + e.friction_step * (0.5 + 0.5 * math.tanh(2.0 * (T - _STEP_AT) / _STEP_WIDTH)))
            for T, film in zip(self.temperature, self.film, strict=True)
        ]

    def heat(self, powers: Sequence[float], speed: float, force: float) -> None:
        """Advance temperatures and films by one time step.

        Parameters
        ----------
        powers : [W] of friction, of each disc.
        speed, force : as in `friction`.
        """
        cooling = 20.0 + 5.0 * speed**0.8  # [W/K] of 1 m2, convection at a rotating disc
        for i, power in enumerate(powers):
            cooled = cooling * (self.temperature[i] - _AMBIENT)
            self.temperature[i] += self._dt * (_INTO_DISC * power - cooled) / _HEAT_CAPACITY
            self.film[i] *= math.exp(-self._dt * power / _DRYING_ENERGY)
        if force > 0.0 or self._contact > 0.0:
            self._contact += self._dt
        fall = self._speed - abs(speed) if not math.isnan(self._speed) else 0.0
        self._slowing += (fall - self._dt * self._slowing) / _SLOWING_LAG
        self._speed = abs(speed)
