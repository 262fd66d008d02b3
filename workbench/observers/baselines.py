"""What an observer must beat: the nominal model alone, and the roller's balance alone."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.fmu import FMU, Matrix, Vector
from workbench.kernel import compiled, evaluate, inlined, linearise, read, set_states, solve
from workbench.observers.contract import Estimator, measure, report


class _OpenLoopSettings(NamedTuple):
    order: NDArray[np.intp]
    nominal: Vector


class _OpenLoopMemory(NamedTuple):
    system: Matrix
    change: Matrix


@inlined
def _open_loop_law(plant, settings, memory, h, u, y, row):  # type: ignore[no-untyped-def]
    """One linearly implicit Euler step of the model; y is not used."""
    system, change = memory.system, memory.change
    n = plant.x.size
    status = measure(plant, u)
    if h > 0.0:
        status = status or evaluate(plant)
        for i in range(n):
            change[i, 0] = h * plant.dx[i]
        status = status or linearise(plant, n)
        for i in range(n):
            for j in range(n):
                system[i, j] = -h * plant.jacobian[j, i]
            system[i, i] += 1.0
        status = status or solve(system, change)
        if status:
            return status
        for i in range(n):
            plant.x[i] += change[i, 0]
        status = set_states(plant)
    return status or report(plant, settings.order, settings.nominal, row)


@compiled
def _open_loop(plant, settings, memory, steps, u, y, rows):  # type: ignore[no-untyped-def]
    for k in range(steps.size):
        status = _open_loop_law(plant, settings, memory, steps[k], u[k], y[k], rows[k])
        if status:
            return status
    return 0


class OpenLoop(Estimator):
    """The nominal model, driven by measured inputs, without feedback."""

    name = "open_loop"
    _law = staticmethod(_open_loop_law)
    _loop = staticmethod(_open_loop)

    def __init__(self, fmu: FMU) -> None:
        super().__init__(fmu)
        self._settings = _OpenLoopSettings(self._order, self._nominal)
        n = len(fmu.states)
        self._memory = _OpenLoopMemory(np.zeros((n, n)), np.zeros((n, 1)))

    def _arguments(self) -> tuple[Any, Any]:
        return self._settings, self._memory

    def _begin(self, u: Vector, y: Vector) -> None:
        self._plant.x[:] = self.fmu.get_states()


class _InversionSettings(NamedTuple):
    order: NDArray[np.intp]
    inertia: float
    radius: float
    time_constant: float


class _InversionMemory(NamedTuple):
    filtered: Vector  # speed, torque


@inlined
def _inversion_law(plant, settings, memory, h, u, y, row):  # type: ignore[no-untyped-def]
    """The roller's balance through a first-order low-pass (backward Euler)."""
    filtered = memory.filtered
    plant.x[settings.order[1]] = y[1]
    status = measure(plant, u) or set_states(plant) or evaluate(plant) or read(plant)
    # Torque on the roller besides the creep force, tauR - loss: the model's own balance gives it.
    torque = settings.inertia * plant.dx[settings.order[1]] + settings.radius * plant.y[0]
    if h == 0.0:
        filtered[0], filtered[1] = y[1], torque
    share = h / (settings.time_constant + h)
    filtered[0] += share * (y[1] - filtered[0])
    filtered[1] += share * (torque - filtered[1])
    acceleration = (y[1] - filtered[0]) / settings.time_constant
    row[6] = (filtered[1] - settings.inertia * acceleration) / settings.radius
    return status


@compiled
def _inversion(plant, settings, memory, steps, u, y, rows):  # type: ignore[no-untyped-def]
    for k in range(steps.size):
        status = _inversion_law(plant, settings, memory, steps[k], u[k], y[k], rows[k])
        if status:
            return status
    return 0


class DirectInversion(Estimator):
    """Creep force from the roller's balance, Fx = (tauR - JR*d(omegaR)/dt - loss)/rR.

    The balance is passed through one first-order low-pass of `time_constant`, which makes the
    differentiation causal: the same filter acts on torque and speed, so that they stay in step.

    Parameters
    ----------
    fmu : model with parameters JR, rR; its roller loss is used.
    time_constant : of the filter [s].
    """

    name = "direct_inversion"
    _law = staticmethod(_inversion_law)
    _loop = staticmethod(_inversion)

    def __init__(self, fmu: FMU, time_constant: float = 0.2) -> None:
        super().__init__(fmu)
        self._settings = _InversionSettings(
            self._order, fmu.defaults["JR"], self._radius, time_constant
        )
        self._memory = _InversionMemory(np.zeros(2))

    def _arguments(self) -> tuple[Any, Any]:
        return self._settings, self._memory

    def _begin(self, u: Vector, y: Vector) -> None:
        self._plant.x[:] = self.fmu.get_states()
