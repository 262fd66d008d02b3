"""The disturbance observer of Schwarz, Brembeck, Heckmann (2018), equations (8) to (10).

The states of the minimal model are joined by the friction deviations dmuWR and dmuDC, which decay
with rates T_WR, T_DC; all four are corrected by L [dy; integral of dy], dy = y - y_hat.

Two factors of the rows of L are ours, because measured stops coast, reverse and end at standstill:
authority (a friction is corrected in proportion to the effect it has) and fading (below walking
pace, measured slip is noise).

The paper leaves a physical model of g_D open; `DiscModel` is one for muDC, with textbook values.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are
from scipy.optimize import brentq

from workbench.errors import InputError
from workbench.fmu import FMU, Matrix, Vector
from workbench.kernel import compiled, evaluate, inlined, linearise, solve
from workbench.observers.contract import (
    FRICTION_RANGE,
    Estimator,
    check_model,
    clip,
    correct,
    fading,
    measure,
    report,
    rolling_ratio,
    slipping,
    stick,
)


@dataclass(frozen=True)
class DisturbanceGains:
    """Gains of the disturbance observer.

    Attributes
    ----------
    L : (4, 4) rows omegaW, omegaR, dmuWR, dmuDC; columns dy (2), integral of dy (2).
        Units: 1/s and 1/s2 for the speeds, 1/rad and 1/(rad.s) for the frictions.
    T_WR, T_DC : rates at which a friction deviation decays [1/s], negative.
    effect : (2,) d(der(omegaW))/d(muWR, muDC) [rad/s2] from which on a friction has full authority.
    """

    L: Matrix
    T_WR: float
    T_DC: float
    effect: Vector


class DiscModel(NamedTuple):
    """Trend of disc-pad friction with speed and disc temperature, T.

    Nominal muDC is multiplied by (1 + slope (1 - v/speed)) (1 - fade (T - temperature)); the discs
    of an axle are one lump, capacity dT/dt = share * power - cooling (T - ambient). Water on the
    discs is no part of it. Defaults are the middle of ranges usual for disc brakes with organic
    pads, identified from no recording: 60 to 110 kg and 460 to 540 J/(kg.K) a disc, a share of
    0.90 to 0.98, 15 to 30 + (5 to 10) v^0.8 W/(m2.K) on 0.8 to 1.5 m2, slope 0.1 to 0.4, fade up
    to 1e-3 /K.

    Attributes
    ----------
    slope : change of friction over one reference speed, relative to that at the reference [1].
    fade : loss per warming [1/K].
    speed, temperature : of nominal friction: rolling velocity [m/s], disc [degC].
    capacity : heat capacity of all discs on the axle [J/K].
    share : of friction power that heats the discs; the pads take the rest [1].
    cooling : of all discs, at medium speed [W/K].
    ambient : of the air, and of the discs at the start [degC].
    """

    slope: float = 0.25
    fade: float = 5e-4
    speed: float = 22.0
    temperature: float = 100.0
    capacity: float = 3 * 85.0 * 500.0
    share: float = 0.94
    cooling: float = 3 * 120.0
    ambient: float = 20.0


@dataclass(frozen=True)
class OperatingPoint:
    """Where the model is linearised: lightly braked, so that full authority comes early in a stop.

    Attributes
    ----------
    speed : rolling velocity [m/s], half of 160 km/h.
    pressure : brake cylinder pressure [Pa], that of a light service braking.
    """

    speed: float = 22.0
    pressure: float = 1.5e5


@dataclass(frozen=True)
class NoiseLevels:
    """What the stationary Kalman gain trades off.

    Attributes
    ----------
    omegaW, omegaR : standard deviation of one sample [rad/s]; that of a pole wheel is 0.03 % +
        0.002 rad/s, taken at 160 km/h.
    sample_time : of the recording [s].
    model : unmodelled acceleration of wheelset and roller, random walk [rad/s / sqrt(s)].
    muWR, muDC : random walk of the frictions [1/sqrt(s)]: a drying disc or a patch of rail changes
        them by 0.05 within a second.
    decay : rate at which a friction deviation is forgotten [1/s]; 50 s outlast a stop.
    """

    omegaW: float = 0.03
    omegaR: float = 0.003
    sample_time: float = 0.005
    model: float = 0.01
    muWR: float = 0.05
    muDC: float = 0.05
    decay: float = -0.02


def stationary_gains(
    fmu: FMU, point: OperatingPoint | None = None, noise: NoiseLevels | None = None
) -> DisturbanceGains:
    """Gains from the linearised model: the stationary Kalman filter of the extended system.

    The model is linearised through the FMU's directional derivatives where the creep force carries
    the brake torque, extended by the two friction states, and the filter's Riccati equation is
    solved. The gain on the integral of dy is zero: the friction states are integrators already.
    Source: D. Simon, Optimal State Estimation, Wiley 2006, section 8.4.

    Parameters
    ----------
    fmu : minimal observer model; its state is left at the operating point.
    """
    point = point or OperatingPoint()
    noise = noise or NoiseLevels()
    corrections = fmu.variables(["dmuWR", "dmuDC"])
    hold_in_equilibrium(fmu, point)
    extended = np.zeros((4, 4))
    order = [fmu.states.index(name) for name in ("omegaW", "omegaR")]
    extended[:2, :2] = fmu.state_jacobian()[np.ix_(order, order)]
    extended[:2, 2:] = fmu.input_jacobian(corrections)[order]
    extended[2, 2] = extended[3, 3] = noise.decay
    measured = np.eye(2, 4)
    process = np.array([noise.model, noise.model, noise.muWR, noise.muDC])
    # White noise of a continuous signal that, sampled, has the given variance.
    measurement = np.array([noise.omegaW, noise.omegaR]) * np.sqrt(noise.sample_time)
    # In units of the noise, both noise matrices are the identity and the equation is well scaled.
    A = extended * process / process[:, None]
    C = measured * process / measurement[:, None]
    covariance = solve_continuous_are(A.T, C.T, np.eye(4), np.eye(2))
    gain = process[:, None] * (covariance @ C.T) / measurement
    return DisturbanceGains(
        L=np.hstack([gain, np.zeros((4, 2))]),
        T_WR=noise.decay,
        T_DC=noise.decay,
        effect=extended[0, 2:].copy(),
    )


def hold_in_equilibrium(fmu: FMU, point: OperatingPoint) -> None:
    """Put the FMU where the creep force carries the brake torque at the given speed.

    Raises
    ------
    InputError
        If estimators cannot work on the FMU.
    """
    check_model(fmu)
    radii = fmu.variables(["rW", "rR"])
    inputs = fmu.variables(["pB", "tauR", "dmuWR", "dmuDC"])
    wheelset, roller = fmu.states.index("omegaW"), fmu.states.index("omegaR")
    # The radius that acts may be another than rW.
    ratio = rolling_ratio(fmu)
    rW, rR = fmu.get(radii)
    fmu.set(inputs, np.array([point.pressure, 0.0, 0.0, 0.0]))
    x = fmu.get_states()
    x[roller] = point.speed / rR
    x[wheelset] = ratio * x[roller]
    fmu.set_states(x)
    # States that follow inputs alone, as in a cylinder that fills, are where they settle.
    A = fmu.state_jacobian()
    rates = A.diagonal()
    alone = (rates < 0.0) & (np.count_nonzero(A, axis=1) == 1)
    x[alone] -= fmu.derivatives()[alone] / rates[alone]

    def acceleration(slip: float) -> float:
        x[wheelset] = ratio * x[roller] - slip / rW
        fmu.set_states(x)
        return float(fmu.derivatives()[wheelset])

    # At this speed the creep force rises up to a slip beyond 0.2 m/s for all contacts.
    acceleration(float(brentq(acceleration, 0.0, 0.2, xtol=1e-9)))


class _Settings(NamedTuple):
    order: NDArray[np.intp]
    nominal: Vector
    low: Vector
    high: Vector
    L: Matrix
    decay: Vector
    effect: Vector
    radius: float
    ratio: float
    disc: DiscModel
    inertia: float  # of the wheelset, turns an effect on der(omegaW) into a torque


class _Memory(NamedTuple):
    z: Vector  # omegaW, omegaR, dmuWR, dmuDC
    integral: Vector  # of dy
    disc: Vector  # temperature [degC], physical dmuDC [1]
    system: Matrix
    change: Matrix
    others: Vector  # explicit change of every state of the model; those besides the speeds use it


@compiled
def _trend(disc, nominal, speed, temperature):  # type: ignore[no-untyped-def]
    """Physical muDC minus nominal."""
    of_speed = 1.0 + disc.slope * (1.0 - abs(speed) / disc.speed)
    return nominal * (of_speed * (1.0 - disc.fade * (temperature - disc.temperature)) - 1.0)


@inlined
def _law(plant, settings, memory, h, u, y, row):  # type: ignore[no-untyped-def]
    """One linearly implicit Euler step of equation (9); other states each by themselves."""
    z, integral, order = memory.z, memory.integral, settings.order
    system, change, disc = memory.system, memory.change, settings.disc
    n = plant.x.size
    status = measure(plant, u)
    if h > 0.0:
        status = status or evaluate(plant)
        for i in range(2):
            change[i, 0] = h * plant.dx[order[i]]
            change[2 + i, 0] = h * settings.decay[i] * z[2 + i]
        for i in range(n):
            memory.others[i] = h * plant.dx[i]
        status = status or linearise(plant, n)
        # The effect of muDC on der(omegaW) is the brake torque per muDC, over the inertia.
        torque = settings.inertia * plant.jacobian[n + 1, order[0]] * (settings.nominal[1] + z[3])
        power = disc.share * abs(torque * z[0])
        memory.disc[0] += (
            h * (power - disc.cooling * (memory.disc[0] - disc.ambient)) / disc.capacity
        )
        trend = memory.disc[1]
        memory.disc[1] = _trend(disc, settings.nominal[1], settings.radius * z[1], memory.disc[0])
        # The deviation decays towards the physical friction, which moves on.
        change[3, 0] += memory.disc[1] - trend - h * settings.decay[1] * memory.disc[1]
        fade = fading(settings.radius * y[1])
        for i in range(4):
            share = fade
            if i >= 2:
                # Authority has the sign of the rotation and vanishes without pressure or slip.
                effect = plant.jacobian[n + i - 2, order[0]] / settings.effect[i - 2]
                share *= clip(effect, -1.0, 1.0)
            for j in range(2):
                # The integral at the end of the step is part of the implicit equation.
                direct, integrated = share * settings.L[i, j], share * settings.L[i, 2 + j]
                gain = direct + h * integrated
                change[i, 0] += h * (gain * (y[j] - z[j]) + integrated * integral[j])
                system[i, j] = h * gain
                system[i, 2 + j] = 0.0
                if i < 2:
                    system[i, j] -= h * plant.jacobian[order[j], order[i]]
                    system[i, 2 + j] -= h * plant.jacobian[n + j, order[i]]
            system[i, i] += 1.0 if i < 2 else 1.0 - h * settings.decay[i - 2]
        status = status or solve(system, change)
        if status:
            return status
        before = slipping(z, 0, 1, settings.ratio)
        for i in range(2):
            z[i] += change[i, 0]
            integral[i] += h * (y[i] - z[i])
            z[2 + i] = clip(z[2 + i] + change[2 + i, 0], settings.low[i], settings.high[i])
        stick(z, 0, 1, settings.ratio, settings.radius, before)
        for i in range(n):
            if i != order[0] and i != order[1]:
                plant.x[i] += memory.others[i] / (1.0 - h * plant.jacobian[i, i])
    plant.x[order[0]], plant.x[order[1]] = z[0], z[1]
    return status or correct(plant, z[2], z[3]) or report(plant, order, settings.nominal, row)


@compiled
def _loop(plant, settings, memory, steps, u, y, rows):  # type: ignore[no-untyped-def]
    for k in range(steps.size):
        status = _law(plant, settings, memory, steps[k], u[k], y[k], rows[k])
        if status:
            return status
    return 0


class DisturbanceObserver(Estimator):
    """Minimal model with friction deviations as states, corrected by measured speeds.

    A row of L that acts on a friction is multiplied by that friction's authority: its effect on
    der(omegaW) over the effect at the design point, limited to -1..1. It vanishes without brake
    pressure (muDC) and without slip (muWR), where the paper finds them not observable, and has the
    sign of the rotation, as a friction force has and a friction coefficient has not.

    The step is linearly implicit in speeds and frictions, feedback included, so that any gain keeps
    a stable step. Other states of the model, such as the temperature of a disc, are not corrected
    and step each by themselves, implicit in their own value. The deviations are kept within the
    physical range of the coefficients.

    Parameters
    ----------
    fmu : minimal model, also extended by effects with states of their own.
    gains : see DisturbanceGains.
    disc : physical trend of muDC; None for a constant. Needs the parameter JW of the model, the
        wheelset's inertia [kg.m2].

    Raises
    ------
    InputError
        If the model lacks a variable of an estimator, or JW with a disc.

    Notes
    -----
    What the trend is worth, measured with the defaults of DiscModel on the fourteen stops of
    `cases`, whose pads follow laws of the same form with other numbers: with the gains of
    `stationary_gains` the mean error of Fx stays 0.21 % dry and falls from 0.58 to 0.51 % with
    water; in the slowest wet stop it rises from 1.18 to 1.24 %. The error of muDC stays 0.6e-3.
    With a tenth of the gain on muDC, errors of dry stops are nearly halved: Fx 0.34 to 0.20 %,
    muDC 0.6e-3 to 0.3e-3.
    """

    name = "disturbance_observer"
    _law = staticmethod(_law)
    _loop = staticmethod(_loop)

    def __init__(self, fmu: FMU, gains: DisturbanceGains, disc: DiscModel | None = None) -> None:
        super().__init__(fmu)
        if disc is not None:
            self.name = "disturbance_observer_disc"
            if "JW" not in fmu.defaults:
                raise InputError(
                    where=f"{fmu.path}, {self.name}",
                    found="no parameter 'JW' with a value",
                    expected="the inertia of the wheelset, which tells the heat of the discs",
                    remedy="add JW to the model, or leave this estimator out",
                )
        low, high = (FRICTION_RANGE - self._nominal[:, None]).T
        decay = np.array([gains.T_WR, gains.T_DC])
        self._settings = _Settings(
            order=self._order,
            nominal=self._nominal,
            low=np.ascontiguousarray(low),
            high=np.ascontiguousarray(high),
            L=np.ascontiguousarray(gains.L),
            decay=decay,
            effect=np.ascontiguousarray(gains.effect),
            radius=self._radius,
            ratio=rolling_ratio(fmu),
            disc=disc or DiscModel(slope=0.0, fade=0.0),
            inertia=fmu.defaults["JW"] if disc else 0.0,
        )
        self._memory = _Memory(
            z=np.zeros(4),
            integral=np.zeros(2),
            disc=np.zeros(2),
            system=np.zeros((4, 4)),
            change=np.zeros((4, 1)),
            others=np.zeros(len(fmu.states)),
        )

    def _arguments(self) -> tuple[Any, Any]:
        return self._settings, self._memory

    def _begin(self, u: Vector, y: Vector) -> None:
        disc = self._settings.disc
        trend = _trend(disc, self._nominal[1], self._radius * y[1], disc.ambient)
        self._memory.disc[:] = [disc.ambient, trend]
        self._memory.z[:] = [y[0], y[1], 0.0, trend]
        self._memory.integral[:] = 0.0
        self._plant.x[:] = self.fmu.get_states()
