"""What an observer must beat: the roller's balance alone."""

from typing import NamedTuple

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.native import evaluate, inlined, read, set_states
from workbench.observers.contract import Estimator
from workbench.observers.gains import Gains
from workbench.observers.layout import measure
from workbench.system.system import System

TIME_CONSTANT = 0.2  # [s] of the low-pass that makes the differentiation causal


class _Settings(NamedTuple):
    roller: int
    column: int  # of the creep force among the estimates
    inertia: float
    radius: float
    time_constant: float


class _State(NamedTuple):
    filtered: Vector  # speed, torque


@inlined
def _step(model, settings, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """The roller's balance through a first-order low-pass (backward Euler)."""
    filtered = state.filtered
    model.x[settings.roller] = y[1]
    status = measure(model, u) or set_states(model) or evaluate(model) or read(model)
    # Torque on the roller besides the creep force, tauR - loss: the model's own balance gives it.
    torque = settings.inertia * model.dx[settings.roller] + settings.radius * model.y[0]
    if h == 0.0:
        filtered[0], filtered[1] = y[1], torque
    share = h / (settings.time_constant + h)
    filtered[0] += share * (y[1] - filtered[0])
    filtered[1] += share * (torque - filtered[1])
    acceleration = (y[1] - filtered[0]) / settings.time_constant
    estimate[settings.column] = (filtered[1] - settings.inertia * acceleration) / settings.radius
    return status


class DirectInversion(Estimator):
    """Creep force from the roller's balance, Fx = (tauR - JR*d(omegaR)/dt - loss)/rR.

    The balance is passed through one first-order low-pass of TIME_CONSTANT, which makes the
    differentiation causal: the same filter acts on torque and speed, so that they stay in step.

    Parameters
    ----------
    fmu : model with parameters JR, rR; its roller loss is used.
    """

    name = "direct_inversion"
    label = "direct inversion"
    rank = 10
    tunable = False
    _step = staticmethod(_step)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        if missing := [name for name in ("JR", "rR") if name not in fmu.defaults]:
            raise InputError(
                where=f"{fmu.place}, {self.name}",
                found=f"no parameter '{missing[0]}' with a value",
                expected="inertia and radius of the roller",
                remedy="add it to the model, or leave this estimator out",
            )
        self._settings = _Settings(
            fmu.states.index("omegaR"),
            list(system.columns).index("Fx"),
            fmu.defaults["JR"],
            fmu.defaults["rR"],
            TIME_CONSTANT,
        )
        self._state = _State(np.zeros(2))

    def _begin(self, u: Vector, y: Vector) -> None:
        self._model.x[:] = self.fmu.get_states()
