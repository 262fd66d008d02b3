"""The disturbance observer of Schwarz, Brembeck, Heckmann (2018), equations (8) to (10).

The states of the minimal model are joined by the friction deviations dmuWR and dmuDC, which decay
with rates T_WR, T_DC; all four are corrected by L [dy; integral of dy], dy = y - y_hat.

Two factors of the rows of L are ours, because measured stops coast, reverse and end at standstill:
authority (a friction is corrected in proportion to the effect it has) and fading (below walking
pace, measured slip is noise).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_are
from scipy.optimize import brentq

from workbench.fmu import FMU, Matrix, Vector

# Wheel-rail from very low to dry adhesion (Polach 2005), disc-pad as in Schwarz et al. (2018).
FRICTION_RANGE = np.array([[0.03, 0.55], [0.10, 0.45]])

# Rolling velocity [m/s] at which feedback is down to half: noise of 0.003 rad/s in omegaR is then
# a creepage of 0.4 %, as much as a braked wheel has.
FADING_SPEED = 0.5


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
    _hold_in_equilibrium(fmu, point)
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


def _hold_in_equilibrium(fmu: FMU, point: OperatingPoint) -> None:
    """Put the FMU where the creep force carries the brake torque at the given speed."""
    radii = fmu.variables(["rW", "rR"])
    inputs = fmu.variables(["pB", "tauR", "dmuWR", "dmuDC"])
    wheelset, roller = fmu.states.index("omegaW"), fmu.states.index("omegaR")
    fmu.start({"omegaW": 0.0, "omegaR": 0.0})
    rW, rR = fmu.get(radii)
    fmu.set(inputs, np.array([point.pressure, 0.0, 0.0, 0.0]))

    def acceleration(slip: float) -> float:
        x = np.empty(2)
        x[wheelset], x[roller] = (point.speed - slip) / rW, point.speed / rR
        fmu.set_states(x)
        return float(fmu.derivatives()[wheelset])

    # At this speed the creep force rises up to a slip beyond 0.2 m/s for all contacts.
    acceleration(float(brentq(acceleration, 0.0, 0.2, xtol=1e-9)))


class DisturbanceObserver:
    """Minimal model with friction deviations as states, corrected by measured speeds.

    A row of L that acts on a friction is multiplied by that friction's authority: its effect on
    der(omegaW) over the effect at the design point, limited to -1..1. It vanishes without brake
    pressure (muDC) and without slip (muWR), where the paper finds them not observable, and has the
    sign of the rotation, as a friction force has and a friction coefficient has not.

    The step is linearly implicit in all states, feedback included, so that any gain keeps a stable
    step. The deviations are kept within the physical range of the coefficients.

    Parameters
    ----------
    fmu : model with states omegaW, omegaR, inputs pB, tauR, dmuWR, dmuDC and outputs Fx, slip.
    gains : see DisturbanceGains.
    """

    name = "disturbance_observer"

    def __init__(self, fmu: FMU, gains: DisturbanceGains) -> None:
        self._fmu = fmu
        self._gains = gains
        self._inputs = fmu.variables(["pB", "tauR", "dmuWR", "dmuDC"])
        self._corrections = fmu.variables(["dmuWR", "dmuDC"])
        self._outputs = fmu.variables(["Fx", "slip"])
        self._order = [fmu.states.index(name) for name in ("omegaW", "omegaR")]
        self._nominal = np.zeros(2)
        self._roller_radius = fmu.defaults["rR"]
        self._t = 0.0
        # omegaW, omegaR, dmuWR, dmuDC, then the integrals of dy.
        self._z = np.zeros(6)

    def init(self, t: float, u: Vector, y: Vector) -> Vector:
        """Start from measured speeds and nominal friction."""
        self._fmu.start({"omegaW": y[0], "omegaR": y[1]})
        self._nominal = self._fmu.get(self._fmu.variables(["muWR", "muDC"])).copy()
        self._t = t
        self._z[:] = 0.0
        self._z[:2] = y
        return self._estimate(u)

    def step(self, t: float, u: Vector, y: Vector) -> Vector:
        """One linearly implicit Euler step of equation (9) to time t."""
        h = t - self._t
        self._t = t
        z = self._z
        decay = np.array([self._gains.T_WR, self._gains.T_DC])
        innovation = y - z[:2]

        self._inject(u)
        A = self._fmu.state_jacobian()[np.ix_(self._order, self._order)]
        B = self._fmu.input_jacobian(self._corrections)[self._order]
        L = self._scaled_gains(B[0], self._roller_radius * y[1])

        rates = np.empty(6)
        rates[:2] = self._fmu.derivatives()[self._order]
        rates[2:4] = decay * z[2:4]
        rates[:4] += L @ np.concatenate([innovation, z[4:]])
        rates[4:] = innovation

        jacobian = np.zeros((6, 6))
        jacobian[:2, :2] = A
        jacobian[:2, 2:4] = B
        jacobian[[2, 3], [2, 3]] = decay
        jacobian[:4, :2] -= L[:, :2]
        jacobian[:4, 4:] = L[:, 2:]
        jacobian[[4, 5], [0, 1]] = -1.0

        z += np.linalg.solve(np.eye(6) - h * jacobian, h * rates)
        low, high = (FRICTION_RANGE - self._nominal[:, None]).T
        z[2:4] = np.clip(z[2:4], low, high)
        return self._estimate(u)

    def _scaled_gains(self, effect: Vector, speed: float) -> Matrix:
        """L with the authority of the frictions, faded out towards standstill; (4, 4)."""
        authority = np.clip(effect / self._gains.effect, -1.0, 1.0)
        fading = speed**2 / (speed**2 + FADING_SPEED**2)
        return self._gains.L * (fading * np.array([1.0, 1.0, *authority]))[:, None]

    def _inject(self, u: Vector) -> None:
        """Set states, measured inputs and friction deviations of the FMU."""
        x = np.empty(2)
        x[self._order] = self._z[:2]
        self._fmu.set_states(x)
        self._fmu.set(self._inputs, np.concatenate([u, self._z[2:4]]))

    def _estimate(self, u: Vector) -> Vector:
        self._inject(u)
        friction = self._nominal + self._z[2:4]
        return np.concatenate([self._z[:2], friction, self._fmu.get(self._outputs)])
