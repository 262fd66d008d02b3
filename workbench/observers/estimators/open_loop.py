"""What an observer must beat: the nominal model alone."""

from typing import Any, NamedTuple

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.models.fmu import FMU
from workbench.models.hybrid import HybridSimulation
from workbench.models.native import (
    compiled,
    evaluate,
    implicit,
    inlined,
    linearise,
    raise_on_failure,
    set_states,
    solve,
)
from workbench.observers.contract import Estimator
from workbench.observers.gains import Gains
from workbench.observers.layout import Layout, act, assign, measure, report
from workbench.system.system import System


class _State(NamedTuple):
    system: Matrix  # (n, n + 1) of the step, with its right-hand side
    inputs: Vector  # the sample before, and what acts in the step, see `act`
    acting: Vector


@inlined
def _step(model, layout, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """One linearly implicit Euler step of the model; y is not used."""
    n, system = model.x.size, state.system
    status = 0
    if h > 0.0:
        act(layout, state.inputs, u, state.acting)
        status = measure(model, state.acting) or evaluate(model)
        for i in range(n):
            system[i, n] = h * model.dx[i]
        status = status or linearise(model, n)
        implicit(model, h, system)
        status = status or solve(system)
        if status:
            return status
        for i in range(n):
            model.x[i] += system[i, n]
        status = set_states(model)
    assign(state.inputs, u)
    return status or measure(model, u) or report(model, layout, estimate)


@compiled
def _loop(model, layout, state, steps, u, y, estimates):  # type: ignore[no-untyped-def]
    for k in range(steps.size):
        status = _step(model, layout, state, steps[k], u[k], y[k], estimates[k])
        if status:
            return status
    return 0


class OpenLoop(Estimator):
    """The nominal model, driven by measured inputs, without feedback."""

    name = "open_loop"
    label = "open loop"
    rank = 0
    tunable = False
    _step = staticmethod(_step)
    _loop = staticmethod(_loop)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        n, m = len(fmu.states), len(system.inputs) + 1
        self._hybrid: HybridSimulation | None = None
        self._state = _State(np.zeros((n, n + 1)), np.zeros(m), np.zeros(m))

    def _arguments(self) -> tuple[Layout, Any]:
        return self._layout, self._state

    def _begin(self, u: Vector, y: Vector) -> None:
        self._model.x[:] = self.fmu.get_states()
        self._hybrid = None
        if self.fmu.has_events:
            held = np.array([signal.held for signal in self.system.inputs], np.bool_)
            inputs = self.fmu.variables([signal.name for signal in self.system.inputs])
            self._hybrid = HybridSimulation(self.fmu, inputs, held)
            self._hybrid.begin(u)

    def _run(self, steps: Vector, u: Matrix, y: Matrix) -> Matrix:
        """Rows of estimates; a model with events goes through them as FMI says."""
        if self._hybrid is None:
            return super()._run(steps, u, y)
        rows = np.full((steps.size, self._width), np.nan)
        samples, _ = self._samples(steps, u, y)
        model = self._model
        for row, sample in zip(rows, samples, strict=True):
            model.x[:] = self._hybrid.advance(float(sample[-1]), sample[:-1])
            model.u[: model.measured] = sample[:-1]
            raise_on_failure(report(model, self._layout, row), self.fmu)
        return rows
