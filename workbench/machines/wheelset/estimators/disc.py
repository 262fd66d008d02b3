"""The disturbance observer with a physical model of pad friction, which the paper leaves open."""

from typing import Any, NamedTuple

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.native import compiled, inlined
from workbench.observers.estimators.disturbance import (
    DisturbanceObserver,
    ObserverSettings,
    ObserverState,
    disturbance_step,
)
from workbench.observers.gains import Gains
from workbench.system.system import System


class DiscModel(NamedTuple):
    """Trend of disc-pad friction with speed and disc temperature, T.

    Nominal muDC is multiplied by (1 + slope (1 - v/speed)) (1 - fade (T - temperature)); the discs
    of an axle are one lump, capacity dT/dt = share * power - cooling (T - ambient). Water on the
    discs is no part of it. Defaults are the middle of ranges usual for disc brakes with organic
    pads, identified from no recording: 60 to 110 kg and 460 to 540 J/(kg.K) a disc, a share of
    0.90 to 0.98, 15 to 30 + (5 to 10) v^0.8 W/(m2.K) on 0.8 to 1.5 m2, slope 0.1 to 0.4, fade up
    to 1e-3 /K.
    """

    # change of friction over one reference speed, relative to that at the reference [1]
    slope: float = 0.25
    fade: float = 5e-4  # loss per warming [1/K]
    # speed, temperature: of nominal friction: rolling velocity [m/s], disc [degC]
    speed: float = 22.0
    temperature: float = 100.0
    capacity: float = 3 * 85.0 * 500.0  # heat capacity of all discs on the axle [J/K]
    share: float = 0.94  # of friction power that heats the discs; the pads take the rest [1]
    cooling: float = 3 * 120.0  # of all discs, at medium speed [W/K]
    ambient: float = 20.0  # of the air, and of the discs at the start [degC]


class _DiscSettings(NamedTuple):
    observer: ObserverSettings
    disc: DiscModel
    wheelset: int  # states
    roller: int
    friction: int  # muDC among the estimated quantities
    nominal: float
    inertia: float  # of the wheelset, turns an effect on der(omegaW) into a torque
    radius: float  # of the roller


class _DiscState(NamedTuple):
    observer: ObserverState
    temperature: Vector  # (1,) [degC]


@compiled
def _trend(disc, nominal, speed, temperature):  # type: ignore[no-untyped-def]
    """Physical muDC minus nominal."""
    of_speed = 1.0 + disc.slope * (1.0 - abs(speed) / disc.speed)
    return nominal * (of_speed * (1.0 - disc.fade * (temperature - disc.temperature)) - 1.0)


@inlined
def _step(model, settings, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """Warm the disc, move what friction decays to, then the law of the observer."""
    disc, observer, friction = settings.disc, state.observer, settings.friction
    if h > 0.0:
        n = model.x.size
        # The effect of muDC on der(omegaW) is the brake torque per muDC, over the inertia.
        effect = model.jacobian[n + friction, settings.wheelset]
        torque = settings.inertia * effect * (settings.nominal + observer.z[friction])
        power = disc.share * abs(torque * model.x[settings.wheelset])
        warmer = state.temperature[0] - disc.ambient
        state.temperature[0] += h * (power - disc.cooling * warmer) / disc.capacity
        speed = settings.radius * model.x[settings.roller]
        before = observer.target[friction]
        after = _trend(disc, settings.nominal, speed, state.temperature[0])
        observer.target[friction], observer.drift[friction] = after, after - before
    return disturbance_step(model, settings.observer, observer, h, u, y, estimate)


class DiscObserver(DisturbanceObserver):
    """Disturbance observer whose muDC decays to what speed and temperature of the disc make it.

    The heat of a sample is that of the effect that muDC had at the sample before.

    Parameters
    ----------
    fmu, gains : see DisturbanceObserver; the model has the parameter JW, the wheelset's inertia
        [kg.m2].
    disc : see DiscModel.

    Raises
    ------
    InputError
        If the model lacks a variable of an estimator, or JW.

    Notes
    -----
    What the trend is worth, measured with the defaults of DiscModel on the fourteen stops of
    `cases`, whose pads follow laws of the same form with other numbers: with reasoned gains the
    mean error of Fx stays 0.21 % dry and falls from 0.58 to 0.51 % with water; in the slowest wet
    stop it rises from 1.18 to 1.24 %. The error of muDC stays 0.6e-3. With a tenth of the gain on
    muDC, errors of dry stops are nearly halved: Fx 0.34 to 0.20 %, muDC 0.6e-3 to 0.3e-3.
    """

    name = "disturbance_observer_disc"
    label = "disturbance observer, disc model"
    rank = 60
    standard = False
    tunable = False
    tuned_as = DisturbanceObserver.name
    _step = staticmethod(_step)

    def __init__(
        self, fmu: FMU, system: System, gains: Gains, disc: DiscModel | None = None
    ) -> None:
        super().__init__(fmu, system, gains)
        if "JW" not in fmu.defaults:
            raise InputError(
                where=f"{fmu.place}, {self.name}",
                found="no parameter 'JW' with a value",
                expected="the inertia of the wheelset, which tells the heat of the discs",
                remedy="add JW to the model, or leave this estimator out",
            )
        friction = [quantity.name for quantity in system.estimated].index("muDC")
        self._disc = _DiscSettings(
            observer=self._settings,
            disc=disc or DiscModel(),
            wheelset=fmu.states.index("omegaW"),
            roller=fmu.states.index("omegaR"),
            friction=friction,
            nominal=float(self._layout.nominal[friction]),
            inertia=fmu.defaults["JW"],
            radius=fmu.defaults["rR"],
        )
        self._temperature = np.zeros(1)

    def settings(self) -> dict[str, object]:
        """Gains, and constants of the discs."""
        return {**super().settings(), "disc": self._disc.disc._asdict()}

    def _arguments(self) -> tuple[Any, Any]:
        return self._disc, _DiscState(self._state, self._temperature)

    def _begin(self, u: Vector, y: Vector) -> None:
        super()._begin(u, y)
        settings, disc = self._disc, self._disc.disc
        self._temperature[0] = disc.ambient
        # Nothing has been braked yet.
        self._model.jacobian[:] = 0.0
        trend = _trend(disc, settings.nominal, settings.radius * y[1], disc.ambient)
        self._state.z[settings.friction] = self._state.target[settings.friction] = trend
