"""Moving horizon estimation: the best trajectory through the last samples, within bounds."""

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, ndtri

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.native import (
    assign,
    compiled,
    inlined,
    linearise,
    raise_on_failure,
    read,
    read_only,
)
from workbench.observers.estimators.kalman import (
    ExtendedKalmanFilter,
    FilterState,
    Learning,
    begin,
    drive,
    finish,
    learn,
    note,
    reset,
    room,
    trust,
    variance,
)
from workbench.observers.estimators.moving_horizon.window import (
    Window,
    end,
    shift,
    solve_free,
    window,
)
from workbench.observers.estimators.moving_horizon.window_bounds import bound
from workbench.observers.estimators.moving_horizon.window_cost import cost, reweigh
from workbench.observers.estimators.step import (
    Step,
    advance,
    begin_interval,
    follow_error,
    interval,
    judge_sample,
)
from workbench.observers.gains import Gains
from workbench.observers.layout import Layout, assign_rows, fading, measure, put
from workbench.system.system import System

HORIZON = 20  # samples
ITERATIONS = 1  # of Gauss and Newton for each sample
# Share of clean samples that are taken for outliers or jumps: one in 80 min at 200 Hz.
RARE = 1e-6
_SHORTEST = 0.1  # share of a change that is still tried
_ROUNDS = 5  # of weights, in each iteration
ROUNDING = 1e-9  # share of the cost that is not told apart


class HorizonSettings(NamedTuple):
    """As those of the filters, and what is of the window."""

    layout: Layout
    relative: Vector
    floor: Vector
    walk: Vector
    spread: Vector
    learning: Learning  # see Learning; a window notices what surprises by `largest_nis`
    driven: Vector
    driven_relative: Vector
    iterations: int  # for each sample
    limit: float  # deviation of a sample from which it is an outlier [standard deviations]
    largest_nis: float  # normalised innovation squared from which a quantity has jumped
    fading: float  # share of its noise that the next step keeps


class HorizonState(NamedTuple):
    """What the law remembers: that of a filter, held (l,) last samples, and the window."""

    filter: FilterState
    held: Vector
    window: Window


@inlined
def _append(settings, state, h, u, y):  # type: ignore[no-untyped-def]
    """Add a node where the estimate stands, and the sample that its step leads to."""
    window, held, levels = state.window, state.held, state.filter.levels
    data, solution = window.data, window.solution
    if data.filled[0] == data.steps.size:
        shift(window)
    k = data.filled[0]
    data.filled[0] = k + 1
    for j in range(y.size):
        if not np.isnan(y[j]):
            held[j] = y[j]
    fade = fading(settings.layout, held)
    data.steps[k] = h
    assign(data.inputs[k], state.filter.step.inputs)
    assign(data.reached[k], u)
    assign(data.samples[k], y)
    for j in range(y.size):
        levels.noise[j] = variance(settings, fade, held, j)
        data.levels[k, j] = levels.sample[j] * levels.noise[j]
        data.weight[k, j] = 1.0
    for i in range(state.filter.z.size):
        data.nodes[k, i] = state.filter.z[i]
        data.noise[k, i] = h * (fade * settings.walk[i]) ** 2
        solution.active[k, i] = 0
        before = data.wider[k - 1, i] if k > 0 else data.older[i]
        share = levels.walk[i] * room(settings, state.filter.P, i)
        data.wider[k, i] = max(share, settings.fading * before)
    for i in range(state.filter.least.size):
        least = state.filter.least[i] / data.wider[k, i]
        data.noise[k, i] = max(data.noise[k, i], least)


@inlined
def expand(model, settings, state, k):  # type: ignore[no-untyped-def]
    """Take and linearise the step from a node, and the outputs there; returns a status."""
    window, layout, n = state.window, settings.layout, model.x.size
    data = window.data
    arrived, step = data.arrived[k], state.filter.step
    for i in range(arrived.size):
        arrived[i] = data.nodes[k, i]
    interval(layout, step, data.inputs[k], data.reached[k])
    status = measure(model, step.end)
    status = status or advance(model, layout, step, arrived, data.steps[k], True)
    assign_rows(data.F[k], step.F)
    if layout.columns > n:
        status = status or measure(model, data.reached[k])
        status = status or put(model, arrived) or linearise(model, layout.columns) or read(model)
    for j in range(layout.seen.size):
        at = layout.seen[j]
        if at >= 0:
            data.errors[k, j] = data.samples[k, j] - arrived[at]
        else:
            data.errors[k, j] = data.samples[k, j] - model.y[-1 - at]
            for i in range(arrived.size):
                data.slopes[k, j, i] = model.jacobian[i, n - 1 - at]
    return status


@inlined
def _learn(settings, state):  # type: ignore[no-untyped-def]
    """Let noise levels follow the last sample, as those of a filter without a window."""
    window, levels = state.window, state.filter.levels
    data, solution = window.data, window.solution
    last = data.filled[0] - 1
    for j in range(levels.sample.size):
        levels.scatter[j] = levels.sample[j]  # as thought, of a sample that is missing
        if solution.total[last, j] > 0.0:
            explained = solution.total[last, j] - data.levels[last, j]
            note(levels, j, solution.surprise[last, j], explained, levels.noise[j])
    assign_rows(levels.before, solution.before)
    assign_rows(state.filter.P, solution.P)
    assign(state.filter.change, solution.moved)
    learn(settings, state.filter, fading(settings.layout, state.held), data.steps[last])


@compiled
def _fill_in(model, settings, state, k, y):  # type: ignore[no-untyped-def]
    """Put samples that were missing to node k; returns a status."""
    for j in range(y.size):
        if not np.isnan(y[j]):
            state.window.data.samples[k, j] = y[j]
    return expand(model, settings, state, k)


@compiled
def _solve(settings, state, new, estimate):  # type: ignore[no-untyped-def]
    """Best change of the nodes, to first order; the estimate is what the last step leads to.

    Parameters
    ----------
    new : whether it is the first time that the last sample is met.
    """
    window, seen = state.window, settings.layout.seen
    data, solution = window.data, window.solution
    last = data.filled[0] - 1
    solve_free(window, seen)
    nis = 0.0
    for j in range(seen.size):
        if solution.total[last, j] > 0.0:
            nis += solution.surprise[last, j] ** 2 / solution.total[last, j]
    estimate[estimate.size - 1] = nis
    learns, age = settings.learning.within < np.inf, state.filter.levels.age[0]
    if nis > settings.largest_nis and not (learns and age < settings.learning.within):
        data.alert[0] = 1
        trust(state.filter.levels)
    if new and learns and data.alert[0] == 0:
        _learn(settings, state)
    for _ in range(_ROUNDS):
        if not reweigh(window, settings.limit, settings.fading):
            break
        solve_free(window, seen)
    assign_rows(state.filter.P, solution.P)
    bound(window, seen)
    for i in range(state.filter.z.size):
        state.filter.z[i] = end(window, last, i)


@compiled
def _follow_sample(settings, state, nis):  # type: ignore[no-untyped-def]
    """Carry the error of steps on by the last sample, as its gain does with every innovation."""
    window, step, seen = state.window, state.filter.step, settings.layout.seen
    data, solution = window.data, window.solution
    k, shown, count = data.filled[0] - 1, 0.0, 0.0
    if step.accurate[0] > 0.0:
        return
    for j in range(seen.size):
        total, off = solution.total[k, j], 0.0
        if total == 0.0:
            continue
        if seen[j] >= 0:
            off = step.error[seen[j]]
        else:
            for i in range(step.error.size):
                off += data.slopes[k, j, i] * step.error[i]
        for i in range(step.error.size):
            step.error[i] -= solution.gain[k, j, i] / total * off
        shown += off * off / total
        count += 1.0
    judge_sample(step, state.filter.P, fading(settings.layout, state.held), shown, count, nis)


@compiled
def move(model, settings, state, share):  # type: ignore[no-untyped-def]
    """Move the nodes by a share of their change and take the steps from there; a status."""
    window, status = state.window, 0
    data, solution = window.data, window.solution
    for k in range(data.filled[0]):
        for i in range(state.filter.z.size):
            data.nodes[k, i] += share * solution.change[k, i]
        status = status or expand(model, settings, state, k)
    return status


@compiled
def _relinearise(model, settings, state):  # type: ignore[no-untyped-def]
    """Move the nodes by the change that was found, as far as it lowers the cost; a status.

    Nodes stay where they were linearised if no part of it does.
    """
    before, share = cost(state.window), 1.0
    status = move(model, settings, state, share)
    while not status and share > 0.0:
        if cost(state.window) <= before + ROUNDING * (1.0 + before):
            break
        less = 0.5 * share if share > _SHORTEST else 0.0
        status = move(model, settings, state, less - share)
        share = less
    return status


@compiled
def horizon_step(model, settings, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """Estimate the last samples anew, with one that is added; returns a status."""
    window = state.window
    data = window.data
    if h == 0.0:
        status = begin(model, settings, state.filter, u, y)
        reset(state.filter.levels)
        data.filled[0] = 0
        data.alert[0] = 0
        for i in range(state.filter.z.size):
            data.older[i] = 1.0
        assign(state.held, y)
        assign(data.mean, state.filter.z)
        assign_rows(data.covariance, state.filter.P)
        return status or finish(model, settings, state.filter, estimate)
    step, z = state.filter.step, state.filter.z
    status = put(model, z) or begin_interval(model, settings.layout, step, z, u, h)
    status = status or drive(model, settings, state.filter, z, step.end, h)
    _append(settings, state, h, u, y)
    status = status or expand(model, settings, state, data.filled[0] - 1)
    follow_error(step)
    for iteration in range(settings.iterations):
        _solve(settings, state, iteration == 0, estimate)
        if iteration == 0:
            _follow_sample(settings, state, estimate[estimate.size - 1])
        status = status or _relinearise(model, settings, state)
    assign(step.inputs, u)
    return status or measure(model, u) or finish(model, settings, state.filter, estimate)


class MovingHorizonEstimator(ExtendedKalmanFilter):
    """Best trajectory through the last samples, with the noise levels of the extended filter.

    Multiple shooting, one node for each sample, with the step and its derivatives of the filter;
    one iteration of Gauss and Newton for each sample unless more are asked for. A sample that
    leaves the window has its part in mean and covariance of the oldest node, by the recursion about
    the smoothed trajectory, so that none counts twice and a linear model gives the Kalman filter.
    Bounds are the ranges of quantities. Samples that are NaN are left out, but for the first.
    Outliers have Huber's loss, and quantities may jump, see `reweigh`; both where a clean recording
    would show it in `rare` of its samples.
    Sources: C. Rao, J. Rawlings, J. Lee (2001), Automatica 37, 1619-1628; M. Tenny, J. Rawlings
    (2002), Efficient moving horizon estimation, ACC (smoothing update); B. Bell (1994), SIAM J.
    Optim. 4, 626-636 (smoother and Gauss-Newton); M. Diehl et al. (2005), SIAM J. Control Optim.
    43, 1714-1736 (one iteration for each sample).

    Parameters
    ----------
    gains : see ExtendedKalmanFilter; `horizon` [samples], `iterations` and `rare` are constants of
        the design.
    """

    passes_events = False
    name = "mhe"
    label = "moving horizon estimator"
    rank = 46
    standard = False
    _step = staticmethod(horizon_step)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        n, outputs = len(fmu.states), len(self.system.outputs)
        samples, iterations, rare = (
            float(gains.design[name][0]) for name in ("horizon", "iterations", "rare")
        )
        of = self._settings
        self._settings = HorizonSettings(
            *(of.layout, of.relative, of.floor, of.walk, of.spread, of.learning),
            *(of.driven, of.driven_relative),
            iterations=round(iterations),
            limit=float(ndtri(1.0 - 0.5 * rare)),
            largest_nis=float(chdtri(outputs, rare)),
            fading=float(np.exp(-1.0 / samples)),
        )
        low = np.concatenate([np.full(n, -np.inf), self._layout.low])
        high = np.concatenate([np.full(n, np.inf), self._layout.high])
        self._state = HorizonState(
            self._state,
            held=np.zeros(outputs),
            window=window(round(samples), n, len(system.inputs) + 1, outputs, low, high),
        )

    @property
    def steps(self) -> tuple[Step, ...]:
        """See Estimator."""
        return (self._state.filter.step,)

    @property
    def window(self) -> Window:
        """The problem of the last sample and its solution."""
        window: Window = self._state.window
        return window

    def fill_in(self, age: int, y: Vector) -> None:
        """Take samples that come late; they count from the next step on.

        Parameters
        ----------
        age : steps since they were taken, 0 of the last one.
        y : (l,) measured outputs; NaN where there is none, or it came in time.

        Raises
        ------
        InputError
            If they are older than the horizon, or than the first step.
        """
        k = int(self.window.data.filled[0]) - 1 - age
        if age < 0 or k < 0:
            raise InputError(
                where=f"estimator {self.name}",
                found=f"samples that are {age} steps old",
                expected=f"0 to {self.window.data.filled[0] - 1}, as many as the horizon has",
                remedy="give a longer horizon in [design] of the gains",
            )
        raise_on_failure(
            _fill_in(self._model, self._settings, self._state, k, read_only(y)), self.fmu
        )

    def _begin(self, u: Vector, y: Vector) -> None:
        state, self._state = self._state, self._state.filter
        super()._begin(u, y)
        self._state = state

    @classmethod
    def default_gains(cls, fmu: FMU, system: System) -> Gains:
        """The noise of the sensors, and a horizon."""
        levels = super().default_gains(fmu, system)
        design = {"horizon": HORIZON, "iterations": ITERATIONS, "rare": RARE}
        constants = {name: np.array([float(value)]) for name, value in design.items()}
        return Gains(levels.estimator, levels.names, levels.values, constants, levels.source)
