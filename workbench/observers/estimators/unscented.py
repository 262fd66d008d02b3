"""The square-root unscented Kalman filter, with the noise levels of the extended one."""

from typing import Annotated, NamedTuple

import numpy as np

from workbench.arrays import Matrix, Vector, zeros
from workbench.models.fmu import FMU
from workbench.models.native import assign, compiled, linearise, read
from workbench.observers.estimators.kalman import (
    ExtendedKalmanFilter,
    Levels,
    begin,
    drive,
    ekf_step,
    filter_state,
    finish,
    learn,
    note,
    process_noise,
    reset,
    surprises,
    variance,
)
from workbench.observers.estimators.step import (
    Step,
    advance,
    begin_interval,
    follow_error,
    judge_sample,
)
from workbench.observers.gains import Gains
from workbench.observers.layout import clip, fading, measure, put
from workbench.system.system import System

# Distance of sigma points, as a share of the cubature rule's: a quantity that nothing is known of
# has a wide sigma, and points as far as that would be where the model never is.
POINT_DISTANCE = 0.2

# Share of feedback below which the filter takes the tangent: the model bends there within a
# fraction of sigma.
TANGENT_SHARE = 0.8


class PointsState(NamedTuple):
    """As that of the extended filter, and root (upper triangle, P = root' root), points, stack."""

    z: Annotated[Vector, "s"]
    P: Annotated[Matrix, "s, s"]
    step: Step
    product: Annotated[Matrix, "n, s"]
    least: Annotated[Vector, "n"]
    change: Annotated[Vector, "s"]
    column: Annotated[Vector, "k"]
    levels: Levels
    start: Annotated[Vector, "s"]  # z before the step
    off: Annotated[Vector, "l"]  # error of steps in the outputs
    root: Annotated[Matrix, "s, s"]
    points: Annotated[Matrix, "2*s, s"]
    seen: Annotated[Matrix, "2*s, l"]  # outputs at the points
    stack: Annotated[Matrix, "2*s + l, s + l"]
    triangle: Annotated[Matrix, "s + l, s + l"]


@compiled
def triangularise(stack, root):  # type: ignore[no-untyped-def]
    """Reduce rows, (m, n), to the triangle root, (n, n): root' root = stack' stack."""
    m, n = stack.shape
    for k in range(n):
        norm = 0.0
        for i in range(k, m):
            norm += stack[i, k] * stack[i, k]
        norm = np.sqrt(norm)
        if norm == 0.0:
            continue
        alpha = -norm if stack[k, k] > 0 else norm
        head = stack[k, k] - alpha
        square = -alpha * head
        for j in range(k + 1, n):
            dot = head * stack[k, j]
            for i in range(k + 1, m):
                dot += stack[i, k] * stack[i, j]
            factor = dot / square
            stack[k, j] -= factor * head
            for i in range(k + 1, m):
                stack[i, j] -= factor * stack[i, k]
        stack[k, k] = alpha
    for i in range(n):
        for j in range(n):
            root[i, j] = stack[i, j] if j >= i else 0.0


@compiled
def _root_to_covariance(state):  # type: ignore[no-untyped-def]
    size = state.z.size
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for k in range(j + 1):
                total += state.root[k, i] * state.root[k, j]
            state.P[i, j] = state.P[j, i] = total


@compiled
def _covariance_to_root(state):  # type: ignore[no-untyped-def]
    """Cholesky's root of P; directions that rounding has left without variance get none."""
    P, root = state.P, state.root
    size = P.shape[0]
    for i in range(size):
        for j in range(i, size):
            total = P[i, j]
            for k in range(i):
                total -= root[k, i] * root[k, j]
            if j == i:
                root[i, i] = np.sqrt(total) if total > 0.0 else 0.0
            else:
                root[i, j] = total / root[i, i] if root[i, i] > 0.0 else 0.0


@compiled
def _spread(model, settings, state, spread, h, u):  # type: ignore[no-untyped-def]
    """Advance all sigma points and read their outputs; leaves their mean in z; a status."""
    z, root, points, layout = state.z, state.root, state.points, settings.layout
    size, n, status = z.size, model.x.size, 0
    for i in range(size):
        for side in range(2):
            point = points[2 * i + side]
            for j in range(size):
                point[j] = z[j] + (1 - 2 * side) * spread * root[i, j]
            for j in range(size - n):
                point[n + j] = clip(point[n + j], layout.low[j], layout.high[j])
            status = status or advance(model, layout, state.step, point, h, False)
            if layout.columns > n:
                status = status or measure(model, u) or put(model, point) or read(model)
                status = status or measure(model, state.step.end)
            for j in range(layout.seen.size):
                at = layout.seen[j]
                state.seen[2 * i + side, j] = point[at] if at >= 0 else model.y[-1 - at]
    for j in range(size):
        total = 0.0
        for i in range(2 * size):
            total += points[i, j]
        z[j] = total / (2 * size)
    return status


@compiled
def _lead(model, settings, state, h, u):  # type: ignore[no-untyped-def]
    """Take the step of the mean, for its error, or for its parts, which points take; a status."""
    layout, step, point, n = settings.layout, state.step, state.change, model.x.size
    assign(point, state.z)
    if step.accurate[0] > 0.0:
        return advance(model, layout, step, point, h, False)
    status = advance(model, layout, step, point, h, True)
    follow_error(step)
    if layout.columns > n:
        status = status or measure(model, u) or put(model, point)
        status = status or linearise(model, layout.columns) or measure(model, step.end)
    for j in range(layout.seen.size):
        at = layout.seen[j]
        state.off[j] = step.predicted[at] if at >= 0 else 0.0
        if at < 0:
            for i in range(point.size):
                state.off[j] += model.jacobian[i, n - 1 - at] * step.predicted[i]
    return status


@compiled
def _absorb(settings, state, spread, fade, y, estimate):  # type: ignore[no-untyped-def]
    """Correct mean and root by a sample, in one triangularisation.

    Rows are the points' deviations of outputs and unknowns, and the noise of the outputs. The
    triangle holds the root of the innovations' covariance, the gain times it, and the new root.
    Source: M. Morf, T. Kailath (1975), IEEE Trans. Autom. Control 20, 487-497.
    """
    z, stack, triangle, levels = state.z, state.stack, state.triangle, state.levels
    size, outputs = z.size, y.size
    share = np.sqrt(0.5) / spread
    for j in range(outputs):
        missing, mean = np.isnan(y[j]), 0.0
        for i in range(2 * size):
            mean += state.seen[i, j]
        mean /= 2 * size
        for i in range(2 * size):
            stack[i, j] = 0.0 if missing else share * (state.seen[i, j] - mean)
        for i in range(outputs):
            stack[2 * size + i, j] = 0.0
        # What is missing is one that no unknown moves, and nothing is made of it.
        noise = 1.0 if missing else levels.sample[j] * variance(settings, fade, y, j)
        stack[2 * size + j, j] = np.sqrt(noise)
        state.column[j] = 0.0 if missing else y[j] - mean
    for j in range(size):
        state.change[j] = levels.before[j, j] = 0.0
        for i in range(2 * size):
            stack[i, outputs + j] = share * (state.points[i, j] - z[j])
            levels.before[j, j] += stack[i, outputs + j] ** 2
    for i in range(outputs):
        for j in range(size):
            stack[2 * size + i, outputs + j] = 0.0
    triangularise(stack, triangle)
    estimate[estimate.size - 1] = 0.0
    for j in range(outputs):
        white = state.column[j]
        for i in range(j):
            white -= triangle[i, j] * state.column[outputs + i]
        if np.isnan(y[j]):
            levels.scatter[j] = levels.sample[j]
        else:
            noise = variance(settings, fade, y, j)
            note(levels, j, white, triangle[j, j] ** 2 - levels.sample[j] * noise, noise)
        white /= triangle[j, j]
        state.column[outputs + j] = white
        estimate[estimate.size - 1] += white * white
        for i in range(size):
            state.change[i] += triangle[j, outputs + i] * white
    follow_sample(state, triangle, y)
    for i in range(size):
        z[i] += state.change[i]
    for i in range(size):
        for j in range(size):
            state.root[i, j] = triangle[outputs + i, outputs + j]


@compiled
def follow_sample(state, triangle, y):  # type: ignore[no-untyped-def]
    """Carry the error of steps on by a sample, as its gain does with every innovation."""
    error, off, shown, count = state.step.error, state.off, 0.0, 0.0
    outputs = y.size
    if state.step.accurate[0] > 0.0:
        return
    for j in range(outputs):
        white = 0.0 if np.isnan(y[j]) else off[j]
        count += 0.0 if np.isnan(y[j]) else 1.0
        for i in range(j):
            white -= triangle[i, j] * off[i]
        off[j] = white / triangle[j, j]
        shown += off[j] * off[j]
        for i in range(error.size):
            error[i] -= triangle[j, outputs + i] * off[j]
    state.step.seen[0], state.step.seen[1] = shown, count


@compiled
def _step(model, settings, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """Square-root unscented filter with 2n points of equal weight."""
    z, root, stack = state.z, state.root, state.stack
    size, layout = z.size, settings.layout
    if h == 0.0:
        reset(state.levels)
        status = begin(model, settings, state, u, y)
        _covariance_to_root(state)
        return status or finish(model, settings, state, estimate)
    fade = fading(layout, y)
    if fade < TANGENT_SHARE:
        status = ekf_step(model, settings, state, h, u, y, estimate)
        _covariance_to_root(state)
        return status
    status = put(model, z) or begin_interval(model, layout, state.step, z, u, h)
    status = status or drive(model, settings, state, z, state.step.end, h)
    for i in range(size):
        # Model noise enters before the step, whose implicit form damps it as it damps the state.
        moves = np.sqrt(process_noise(settings, state, fade, h, i))
        state.start[i] = z[i]
        for j in range(size):
            stack[i, j] = root[i, j]
            stack[size + i, j] = moves if j == i else 0.0
    triangularise(stack[: 2 * size, :size], root)
    spread = POINT_DISTANCE * np.sqrt(1.0 * size)
    status = status or _lead(model, settings, state, h, u)
    state.step.given[0] = 1.0
    status = status or _spread(model, settings, state, spread, h, u)
    state.step.given[0] = 0.0
    if status:
        return status
    _absorb(settings, state, spread, fade, y, estimate)
    if settings.learning.within < np.inf:
        if surprises(settings, state.levels, estimate[estimate.size - 1]):
            for i in range(size):
                z[i] = state.start[i]
            status = ekf_step(model, settings, state, h, u, y, estimate)
            _covariance_to_root(state)
            return status
        state.levels.surprised[0] = 0.0
    assign(state.step.inputs, u)
    seen, nis = state.step.seen, estimate[estimate.size - 1]
    status = measure(model, u)
    _root_to_covariance(state)
    judge_sample(state.step, state.P, fade, seen[0], seen[1], nis)
    if settings.learning.within < np.inf:
        learn(settings, state, fade, h)
    return status or finish(model, settings, state, estimate)


class UnscentedKalmanFilter(ExtendedKalmanFilter):
    """Square-root unscented Kalman filter: no derivative of the filter, the same noise levels.

    Sigma points of equal weight, each advanced by the linearly implicit step; the covariance is
    scaled by their distance, see POINT_DISTANCE. All updates are orthogonal triangularisations,
    without downdates.
    Source: R. van der Merwe, E. Wan (2001), The square-root unscented Kalman filter for state and
    parameter estimation, ICASSP; I. Arasaratnam, S. Haykin (2009), Cubature Kalman filters.
    """

    name = "ukf"
    label = "unscented Kalman filter"
    rank = 45
    _step = staticmethod(_step)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        size, outputs = len(self._settings.walk), len(self.system.outputs)
        filter_ = filter_state(self._state.step, outputs, max(size, 2 * outputs))
        self._state = zeros(PointsState, {"s": size, "l": outputs}, **filter_._asdict())

    @staticmethod
    def _distance(size: int) -> float:
        """That of the cubature rule: a mean that all points share lies within them."""
        return float(np.sqrt(size))

    @staticmethod
    def _moments(values: Matrix, distance: float) -> tuple[Vector, Matrix]:
        """Mean and deviations of points of equal weight; see the extended filter."""
        mean = values[1:].mean(axis=0)
        return mean, (values[1:] - mean) / (np.sqrt(2.0) * distance)

    def _begin(self, u: Vector, y: Vector) -> None:
        super()._begin(u, y)
        self._state.root[:] = 0.0
