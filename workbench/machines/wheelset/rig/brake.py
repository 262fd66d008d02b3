"""The pneumatic brake with its wheel-slide protection."""

import enum
import math

DEAD_TIME = 0.2  # [s] from the demand to the first pressure
PROTECTION_PERIOD = 0.010  # [s]

# Valve and cylinder together lag by 0.9 s, as an electro-pneumatic brake does.
_SUPPLY_LAG, _FILL_LAG, _VENT_LAG = 0.5, 0.4, 0.2  # [s]

_PLAY = 20e3  # [Pa] the pressure turns back before the calipers change side; less than p0

_REFERENCE_FALL = 2.2  # [m/s2] no train slows down faster: 1.75 at 4.2 bar, and hot or sharp pads
_ACCELERATION_LAG = 0.03  # [s]
_SLIDING = 0.08  # slip above which pressure is let out
_ROLLING = 0.04  # slip below which it is filled again
_FALLING = -6.0  # [m/s2] of a wheel that leaves the train's speed
_RECOVERING = 2.0  # [m/s2] of a wheel on its way back, which needs no further venting
_SLOWEST = 1.5  # [m/s] below, poles pass too rarely to tell slip


class Valve(enum.Enum):
    """State of the dump valve."""

    FILL = enum.auto()
    HOLD = enum.auto()
    VENT = enum.auto()


class Brake:
    """Pressures from the distributor to the pads.

    Parameters
    ----------
    pad_lag : [s] of the pads behind the cylinder pressure.
    hysteresis : share of the force that friction of the calipers takes or gives.
    dt : [s] time between two steps.
    """

    def __init__(self, pad_lag: float, hysteresis: float, dt: float) -> None:
        self.cylinder = 0.0  # [Pa] gauge pressure where it is measured
        self.pads = 0.0  # [Pa] gauge pressure that presses the pads
        # force of the calipers over that of calipers without friction
        self.efficiency = 1.0 + hysteresis
        self._hysteresis = hysteresis
        self._side = -1.0  # of the play: 1 where pressure has risen, -1 where it has fallen
        self._supply = 0.0
        self._distribute = 1.0 - math.exp(-dt / _SUPPLY_LAG)
        self._fill = 1.0 - math.exp(-dt / _FILL_LAG)
        self._vent = 1.0 - math.exp(-dt / _VENT_LAG)
        self._press = 1.0 - math.exp(-dt / pad_lag) if pad_lag > 0.0 else 1.0

    def step(self, demand: float, valve: Valve) -> None:
        """Advance by one time step towards `demand` [Pa], as far as the dump valve allows."""
        self._supply += self._distribute * (demand - self._supply)
        if valve is Valve.FILL:
            self.cylinder += self._fill * (self._supply - self.cylinder)
        elif valve is Valve.VENT:
            self.cylinder -= self._vent * self.cylinder
        rise = self._press * (self.cylinder - self.pads)
        self.pads += rise
        self._side = min(1.0, max(-1.0, self._side + 2.0 * rise / _PLAY))
        self.efficiency = 1.0 - self._hysteresis * self._side


class WheelSlideProtection:
    """Dump valve control from the wheel's speed alone.

    The speed of the train is not measured: its reference follows the wheel, but falls no faster
    than a train can. Source of the principle: UIC 541-05, EN 15595.

    Parameters
    ----------
    speed : [m/s] circumferential speed of the wheel at the start.
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._reference = speed
        self._acceleration = 0.0

    def step(self, speed: float) -> Valve:
        """State of the valve until the next call, PROTECTION_PERIOD later."""
        rate = (speed - self._speed) / PROTECTION_PERIOD
        smooth = 1.0 - math.exp(-PROTECTION_PERIOD / _ACCELERATION_LAG)
        self._acceleration += smooth * (rate - self._acceleration)
        self._speed = speed
        self._reference = max(speed, self._reference - _REFERENCE_FALL * PROTECTION_PERIOD)
        if self._reference < _SLOWEST:
            return Valve.FILL
        slip = 1.0 - speed / self._reference
        slides = slip > _SLIDING and self._acceleration < _RECOVERING
        if slides or self._acceleration < _FALLING:
            return Valve.VENT
        return Valve.HOLD if slip > _ROLLING else Valve.FILL
