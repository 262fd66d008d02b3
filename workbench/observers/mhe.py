"""Moving horizon estimation: the best trajectory through the last samples, within bounds."""

from typing import NamedTuple

import numpy as np

from workbench.fmu import FMU, Matrix, Vector
from workbench.kernel import compiled, inlined, linearise, read
from workbench.observers.gains import Gains
from workbench.observers.kalman import (
    ExtendedKalmanFilter,
    begin,
    buffers,
    finish,
    predict,
    put,
    transition,
    variance,
)
from workbench.observers.layout import Layout, fading, measure, output
from workbench.observers.window import (
    Window,
    assign,
    assign_rows,
    bound,
    end,
    shift,
    solve_free,
    window,
)
from workbench.system import System

HORIZON = 20  # samples
ITERATIONS = 1  # of Gauss and Newton for each sample


class HorizonSettings(NamedTuple):
    """As those of the filters, and iterations for each sample."""

    layout: Layout
    relative: Vector
    floor: Vector
    walk: Vector
    spread: Vector
    iterations: int


class HorizonMemory(NamedTuple):
    """As that of the extended filter, and the window; held: (l,) last sample of each output."""

    z: Vector
    P: Matrix
    system: Matrix
    spread: Matrix
    change: Vector
    column: Vector
    held: Vector
    window: Window


@compiled
def _append(model, settings, memory, h, u, y):  # type: ignore[no-untyped-def]
    """Add a node where the estimate stands, and the sample that its step leads to."""
    window, held = memory.window, memory.held
    if window.count[0] == window.steps.size:
        shift(window)
    k = window.count[0]
    window.count[0] = k + 1
    for j in range(y.size):
        if not np.isnan(y[j]):
            held[j] = y[j]
    fade = fading(settings.layout, held)
    window.steps[k] = h
    assign(window.inputs[k], u)
    assign(window.samples[k], y)
    for j in range(y.size):
        window.levels[k, j] = variance(settings, fade, held, j)
        window.weight[k, j] = 1.0
    for i in range(memory.z.size):
        window.nodes[k, i] = memory.z[i]
        window.noise[k, i] = h * (fade * settings.walk[i]) ** 2
        window.active[k, i] = 0


@compiled
def _expand(model, settings, memory, k):  # type: ignore[no-untyped-def]
    """Take and linearise the step from a node, and the outputs there; returns a status."""
    window, layout, n = memory.window, settings.layout, model.x.size
    arrived, h = window.arrived[k], window.steps[k]
    for i in range(arrived.size):
        arrived[i] = window.nodes[k, i]
    status = measure(model, window.inputs[k])
    status = status or predict(model, settings, memory, arrived, h)
    status = status or transition(model, memory.spread, h)
    for i in range(n):
        for j in range(arrived.size):
            window.F[k, i, j] = memory.spread[i, n + j]
    if layout.columns > n:
        status = status or put(model, arrived) or read(model) or linearise(model, layout.columns)
    for j in range(layout.seen.size):
        at = layout.seen[j]
        if at >= 0:
            window.errors[k, j] = window.samples[k, j] - arrived[at]
        else:
            window.errors[k, j] = window.samples[k, j] - model.y[-1 - at]
            for i in range(arrived.size):
                window.slopes[k, j, i] = model.jacobian[i, n - 1 - at]
    return status


@compiled
def _iterate(model, settings, memory, row):  # type: ignore[no-untyped-def]
    """One iteration of Gauss and Newton; the estimate is what the last step leads to."""
    window, seen, status = memory.window, settings.layout.seen, 0
    last = window.count[0] - 1
    for k in range(last + 1):
        status = status or _expand(model, settings, memory, k)
    solve_free(window, seen)
    assign_rows(memory.P, window.P)
    bound(window, seen)
    for i in range(memory.z.size):
        memory.z[i] = end(window, last, i)
    for k in range(last + 1):
        for i in range(memory.z.size):
            window.nodes[k, i] += window.change[k, i]
    row[row.size - 1] = 0.0
    for j in range(seen.size):
        if window.total[last, j] > 0.0:
            row[row.size - 1] += window.surprise[last, j] ** 2 / window.total[last, j]
    return status


@compiled
def _law(model, settings, memory, h, u, y, row):  # type: ignore[no-untyped-def]
    window = memory.window
    if h == 0.0:
        status = begin(model, settings, memory, u, y)
        window.count[0] = 0
        assign(memory.held, y)
        assign(window.mean, memory.z)
        assign_rows(window.covariance, memory.P)
        return status or finish(model, settings, memory, row)
    status = 0
    _append(model, settings, memory, h, u, y)
    for _ in range(settings.iterations):
        status = status or _iterate(model, settings, memory, row)
    return status or finish(model, settings, memory, row)


@compiled
def _loop(model, settings, memory, steps, u, y, rows):  # type: ignore[no-untyped-def]
    for k in range(steps.size):
        status = _law(model, settings, memory, steps[k], u[k], y[k], rows[k])
        if status:
            return status
    return 0


class MovingHorizonEstimator(ExtendedKalmanFilter):
    """Best trajectory through the last samples, with the noise levels of the extended filter.

    Parameters
    ----------
    fmu : any model with the inputs and outputs of the system.
    gains : see ExtendedKalmanFilter; `horizon` samples and `iterations` are constants of the
        design.
    """

    name = "mhe"
    label = "moving horizon estimator"
    rank = 47
    _law = staticmethod(_law)
    _loop = staticmethod(_loop)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        n, q, outputs = len(fmu.states), len(system.estimated), len(system.outputs)
        self._settings = HorizonSettings(
            *self._settings, iterations=int(gains.design["iterations"][0])
        )
        low = np.concatenate([np.full(n, -np.inf), self._layout.low])
        high = np.concatenate([np.full(n, np.inf), self._layout.high])
        self._memory = HorizonMemory(
            *buffers(n, q),
            np.zeros(n + q),
            held=np.zeros(outputs),
            window=window(
                int(gains.design["horizon"][0]), n, len(system.inputs), outputs, low, high
            ),
        )

    @classmethod
    def reasoned(cls, fmu: FMU, system: System) -> Gains:
        """The noise of the sensors, and a horizon."""
        levels = super().reasoned(fmu, system)
        design = {"horizon": np.array([HORIZON]), "iterations": np.array([ITERATIONS])}
        return Gains(levels.estimator, levels.names, levels.values, design, levels.source)
