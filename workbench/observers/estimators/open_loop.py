"""What an observer must beat: the nominal model alone."""

from typing import Any, NamedTuple

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.models.description import MODEL_EXCHANGE
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.hybrid import CoSimulationRun, HybridSimulation
from workbench.models.native import (
    compiled,
    evaluate,
    implicit,
    inlined,
    linearise,
    set_states,
    solve,
)
from workbench.observers.contract import Estimator
from workbench.observers.gains import Gains
from workbench.observers.layout import Layout, act, assign, measure, report, write_estimate
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
    co_simulates = True
    _step = staticmethod(_step)
    _loop = staticmethod(_loop)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        n, m = len(fmu.states), len(system.inputs) + 1
        self._simulation: HybridSimulation | CoSimulationRun | None = None
        unseen = [output.name for output in system.outputs if output.name not in fmu.states]
        self._read = fmu.typed([*system.reported, *unseen])
        # Whether the compiled loop can set and read all that there is.
        self._plain = (
            not self._read.others
            and all(fmu.is_continuous(signal.name) for signal in system.inputs)
            and all(map(fmu.is_real, fmu.states))
        )
        self._state = _State(np.zeros((n, n + 1)), np.zeros(m), np.zeros(m))

    def _arguments(self) -> tuple[Layout, Any]:
        return self._layout, self._state

    def _begin(self, u: Vector, y: Vector) -> None:
        if self.fmu.interface == MODEL_EXCHANGE:
            self._model.x[:] = self.fmu.get_states()
        self._simulation = None
        held = np.array([signal.held for signal in self.system.inputs], np.bool_)
        inputs = self.fmu.typed([signal.name for signal in self.system.inputs])
        if isinstance(self.fmu, CoSimulation):
            self._simulation = CoSimulationRun(self.fmu, inputs, held)
        elif self.fmu.has_events or not self._plain:
            self._simulation = HybridSimulation(self.fmu, inputs, held)
        if self._simulation is not None:
            self._simulation.begin(u)

    def _run(self, steps: Vector, u: Matrix, y: Matrix) -> Matrix:
        """Rows of estimates; models with events, and Co-Simulations, run as FMI says."""
        if self._simulation is None:
            return super()._run(steps, u, y)
        rows = np.full((steps.size, self._width), np.nan)
        samples, _ = self._samples(steps, u, y)
        model = self._model
        for row, sample in zip(rows, samples, strict=True):
            model.x[:] = self._simulation.advance(float(sample[-1]), sample[:-1])
            model.u[: model.measured] = sample[:-1]
            model.y[:] = self.fmu.get_typed(self._read)
            write_estimate(model, self._layout, row)
        return rows
