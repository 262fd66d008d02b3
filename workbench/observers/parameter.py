"""The parameter estimator of Schwarz, Brembeck, Heckmann (2018), equation (7).

The frictions of the model follow the measured speeds directly, (dmuWR, dmuDC) = L [dy; integral of
dy]: a PI controller that drives the model onto the measurement. The states are left alone.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.fmu import FMU, Matrix, Vector
from workbench.kernel import compiled, evaluate, linearise, solve
from workbench.observers.contract import (
    FRICTION_RANGE,
    Estimator,
    clip,
    correct,
    fading,
    measure,
    report,
)
from workbench.observers.disturbance import OperatingPoint, hold_in_equilibrium


@dataclass(frozen=True)
class ParameterGains:
    """Gains of the parameter estimator.

    Attributes
    ----------
    L : (2, 4) rows dmuWR, dmuDC; columns dy (2) [1/rad s], integral of dy (2) [1/rad].
    effect : (2,) d(der(omegaW))/d(muWR, muDC) [rad/s2] from which on a friction has full authority.
    """

    L: Matrix
    effect: Vector


def pole_placed_gains(
    fmu: FMU,
    point: OperatingPoint | None = None,
    bandwidth: float = 15.0,
    damping: float = 0.7,
    slip_bandwidth: float = 2.0,
) -> ParameterGains:
    """Gains from the linearised model, by its two time scales.

    The eigenvalues of the model are far apart: slip settles within milliseconds, the common speed
    of wheelset and roller only integrates. Along the slow eigenvector dmuDC acts as a torque on
    that speed, so a PI controller from its deviation places two poles. dmuWR shifts the slip that
    belongs to a force; an integral controller from the deviation of slip follows it.

    Parameters
    ----------
    fmu : full or minimal observer model; its state is left at the operating point.
    bandwidth, damping : of the pair of poles of dmuDC [rad/s], [1].
    slip_bandwidth : of the pole of dmuWR [rad/s].
    """
    hold_in_equilibrium(fmu, point or OperatingPoint())
    order = [fmu.states.index(name) for name in ("omegaW", "omegaR")]
    A = fmu.state_jacobian()[np.ix_(order, order)]
    B = fmu.input_jacobian(fmu.variables(["dmuWR", "dmuDC"]))[order]
    rates, left = np.linalg.eig(A.T)
    slow, fast = left[:, np.argmax(rates.real)].real, left[:, np.argmin(rates.real)].real
    rolling = np.array([fmu.defaults["rR"] / fmu.defaults["rW"], 1.0])
    effect_on_speed = float(slow @ B[:, 1] / (slow @ rolling))
    shift_of_slip = -float(fast @ B[:, 0] / rates.real.min())
    L = np.zeros((2, 4))
    L[0, 2:] = slip_bandwidth / shift_of_slip * fast
    L[1, 1] = 2 * damping * bandwidth / effect_on_speed
    L[1, 3] = bandwidth**2 / effect_on_speed
    return ParameterGains(L, B[0].copy())


class _Settings(NamedTuple):
    order: NDArray[np.intp]
    nominal: Vector
    low: Vector
    high: Vector
    L: Matrix
    effect: Vector
    radius: float


class _Memory(NamedTuple):
    integral: Vector  # of the gains times dy: the slow part of dmuWR, dmuDC
    gains: Matrix  # (2, 4) with authority
    friction: Vector
    system: Matrix
    change: Matrix


@compiled
def _law(plant, settings, memory, h, u, y, row):  # type: ignore[no-untyped-def]
    """One linearly implicit Euler step of model and PI controller together."""
    order, integral, gains = settings.order, memory.integral, memory.gains
    friction, system, change = memory.friction, memory.system, memory.change
    n = plant.x.size
    status = measure(plant, u)
    if h > 0.0:
        status = status or evaluate(plant)
        for i in range(n):
            change[i, 0] = h * plant.dx[i]
        status = status or linearise(plant, n)
        fade = fading(settings.radius * y[1])
        for i in range(2):
            # Authority has the sign of the rotation and vanishes without pressure or slip.
            effect = plant.jacobian[n + i, order[0]] / settings.effect[i]
            share = fade * clip(effect, -1.0, 1.0)
            for j in range(4):
                gains[i, j] = share * settings.L[i, j]
        for i in range(n):
            for j in range(n):
                system[i, j] = -h * plant.jacobian[j, i]
            system[i, i] += 1.0
        # The controller at the end of the step is part of the implicit equation.
        for k in range(2):
            wanted = integral[k] - friction[k]
            for j in range(2):
                gain = gains[k, j] + h * gains[k, 2 + j]
                wanted += gain * (y[j] - plant.x[order[j]])
                for i in range(n):
                    system[i, order[j]] += h * plant.jacobian[n + k, i] * gain
            for i in range(n):
                change[i, 0] += h * plant.jacobian[n + k, i] * wanted
        status = status or solve(system, change)
        if status:
            return status
        for i in range(n):
            plant.x[i] += change[i, 0]
        for k in range(2):
            direct = 0.0
            for j in range(2):
                innovation = y[j] - plant.x[order[j]]
                integral[k] += h * gains[k, 2 + j] * innovation
                direct += gains[k, j] * innovation
            integral[k] = clip(integral[k], settings.low[k], settings.high[k])
            friction[k] = clip(integral[k] + direct, settings.low[k], settings.high[k])
        status = correct(plant, friction[0], friction[1])
    return status or report(plant, order, settings.nominal, row)


@compiled
def _loop(plant, settings, memory, steps, u, y, rows):  # type: ignore[no-untyped-def]
    for k in range(steps.size):
        status = _law(plant, settings, memory, steps[k], u[k], y[k], rows[k])
        if status:
            return status
    return 0


class ParameterEstimator(Estimator):
    """Full or minimal model whose frictions are set by a PI controller from measured speeds.

    As in the disturbance observer, a friction is corrected in proportion to its authority, feedback
    fades out towards standstill, and frictions stay within their physical range; the integral stops
    at the same limits, so that it does not wind up.

    Parameters
    ----------
    fmu : any model with the inputs and outputs of an estimator.
    gains : see ParameterGains.
    """

    name = "parameter_estimator"
    _law = staticmethod(_law)
    _loop = staticmethod(_loop)

    def __init__(self, fmu: FMU, gains: ParameterGains) -> None:
        super().__init__(fmu)
        n = len(fmu.states)
        low, high = (FRICTION_RANGE - self._nominal[:, None]).T
        self._settings = _Settings(
            order=self._order,
            nominal=self._nominal,
            low=np.ascontiguousarray(low),
            high=np.ascontiguousarray(high),
            L=np.ascontiguousarray(gains.L),
            effect=np.ascontiguousarray(gains.effect),
            radius=self._radius,
        )
        self._memory = _Memory(
            integral=np.zeros(2),
            gains=np.zeros((2, 4)),
            friction=np.zeros(2),
            system=np.zeros((n, n)),
            change=np.zeros((n, 1)),
        )

    def _arguments(self) -> tuple[Any, Any]:
        return self._settings, self._memory

    def _begin(self, u: Vector, y: Vector) -> None:
        self._plant.x[:] = self.fmu.get_states()
        self._memory.integral[:] = 0.0
        self._memory.friction[:] = 0.0
