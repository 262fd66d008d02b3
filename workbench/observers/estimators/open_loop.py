"""What an observer must beat: the nominal model alone."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError
from workbench.models.description import MODEL_EXCHANGE
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.hybrid import CoSimulationRun, HybridSimulation
from workbench.models.instance import EventError
from workbench.models.native import assign, inlined, set_states
from workbench.observers.contract import Estimate, Estimator
from workbench.observers.estimators.step import (
    Step,
    advance,
    begin_alone,
    euler,
    judge,
    model_step,
    restart,
    unbearable,
)
from workbench.observers.gains import Gains
from workbench.observers.layout import (
    Layout,
    measure,
    measure_end,
    output,
    report,
    write_estimate,
)
from workbench.system.system import System

# Of a signal's scale: a tenth of it, which no figure shows, is all that steps may err by in an open
# loop that is off by more.
_FAR = 0.02


class _Settings(NamedTuple):
    layout: Layout
    noise: Vector  # (l,) standard deviation of a sample of each output
    most: Vector  # (l,) distance from what is measured, over noise, of which a tenth is borne


@inlined
def _step(model, settings, step, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """Take the step of the model; y only tells how much of the error is the step's."""
    layout, status = settings.layout, 0
    if h == 0.0:
        restart(step, u)
        return measure(model, u) or report(model, layout, estimate)
    assign(step.x, model.x)
    status = begin_alone(model, layout, step, step.x, u, h) or measure(model, step.end)
    if step.accurate[0] > 0.0:
        status = status or advance(model, layout, step, step.x, h, False)
    else:
        # The error goes on as W (error + g) with this step; g of this one follows with the next.
        for i in range(step.x.size):
            step.system[i, step.x.size + 1] = step.error[i] + step.left[i]
        status = status or euler(model, layout, step, step.x, h, False)
        for i in range(step.x.size):
            step.error[i] = step.system[i, step.x.size + 1]
        assign(step.ended, step.end)
        step.lasted[0] = h
    assign(model.x, step.x)
    assign(step.inputs, u)
    status = status or set_states(model)
    if step.accurate[0] > 0.0:  # with evaluations at other inputs
        status = status or measure(model, u)
    else:
        status = status or measure_end(model, step.end, u)
    status = status or report(model, layout, estimate)
    if step.accurate[0] == 0.0:
        _judge(model, settings, step, y)
    return status


@inlined
def _judge(model, settings, step, y):  # type: ignore[no-untyped-def]
    """Compare what steps have made of the outputs with noise, and with what is measured."""
    shown, allowed, n = 0.0, 0.0, model.x.size
    for j in range(y.size):
        at, noise = settings.layout.seen[j], settings.noise[j]
        if noise == 0.0:
            continue
        off = step.error[at] if at >= 0 else 0.0
        if at < 0:
            for i in range(n):
                off += model.jacobian[i, n - 1 - at] * step.error[i]
        distance = 0.0 if np.isnan(y[j]) else (y[j] - output(model, settings.layout, j)) / noise
        shown += (off / noise) ** 2
        allowed += max(1.0, min(abs(distance), settings.most[j]) ** 2)
    judge(step, 0, shown, allowed)


def _same(estimate: Estimate, other: Estimate) -> bool:
    return np.array_equal(estimate.values, other.values, equal_nan=True)


class OpenLoop(Estimator):
    """The nominal model, driven by measured inputs, without feedback."""

    name = "open_loop"
    label = "open loop"
    rank = 0
    tunable = False
    co_simulates = True
    _step = staticmethod(_step)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        n = len(fmu.states)
        self._simulation: HybridSimulation | CoSimulationRun | None = None
        self._eventful = False  # known where an FMU names no events, and asks for one on the way
        self._read = fmu.typed(self._outputs)
        # Whether the compiled loop can set and read all that there is.
        self._plain = (
            not self._read.others
            and all(fmu.is_continuous(signal.name) for signal in system.inputs)
            and all(map(fmu.is_real, fmu.states))
        )
        noise = np.array([output.noise_at_scale for output in system.outputs])
        # Nothing rolls along in a model alone.
        scale = np.array([output.scale for output in system.outputs])
        most = np.divide(_FAR * scale, noise, out=np.zeros_like(noise), where=noise > 0.0)
        self._settings = _Settings(self._layout._replace(follower=-1), noise, most)
        step = model_step(fmu, np.zeros(n), len(system.inputs), n, self._layout.columns)
        self._state = step._replace(system=np.zeros((n, n + 2)))

    @property
    def steps(self) -> tuple[Step, ...]:
        """See Estimator."""
        return (self._state,)

    def run(self, time: Vector, u: Matrix, y: Matrix) -> Estimate:
        """See Estimator; accurate steps, where they turn out to be needed, begin at the start.

        So does a simulation that goes through events, where one turns up that nothing announced.
        """
        self._eventful = False
        try:
            estimate = self._repeatable(partial(super().run, time, u, y))
        except EventError:
            self._eventful = True
            return super().run(time, u, y)
        if not unbearable(self._state):
            return estimate
        self.start(u[0], y[0])
        self._state.accurate[0] = 1.0
        return self.advance(np.diff(time, prepend=time[0]), u, y)

    def _repeatable(self, run: Callable[[], Estimate]) -> Estimate:
        """A run that is the same when it is repeated; a model that draws random numbers is refused.

        It looks as one that remembers steps; of a Co-Simulation nothing tells. One that a reset
        does not take back to its start has its library loaded anew: some keep values in it.
        """
        fmu = self.fmu
        alone = isinstance(fmu, CoSimulation) and not fmu.is_own
        estimate = run()
        if not (alone or fmu.remembers_steps) or _same(estimate, run()):
            return estimate
        if alone:
            fmu.renew(reload=True)
            estimate = run()
            fmu.renew(reload=True)
            if _same(estimate, run()):
                return estimate
        raise FMUError(
            f"{fmu.called}: the same run gives other results when it is repeated. Export "
            "it without random numbers, or with a fixed seed that a reset restores"
        )

    def _begin(self, u: Vector, y: Vector) -> None:
        if self.fmu.interface == MODEL_EXCHANGE:
            self._model.x[:] = self.fmu.get_states()
        self._simulation = None
        inputs = self.fmu.typed([signal.name for signal in self.system.inputs])
        if isinstance(self.fmu, CoSimulation):
            self._simulation = CoSimulationRun(self.fmu, inputs, self.system.holds)
        elif self._eventful or self.fmu.has_events or not self._plain:
            self._simulation = HybridSimulation(self.fmu, inputs, self.system.holds)
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
