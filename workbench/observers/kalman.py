"""Kalman filters for states and frictions at once, which Schwarz et al. (2018) name as open work.

The friction deviations dmuWR and dmuDC are random walks beside the states of any model that has
them as inputs. Both filters predict with the linearly implicit step of the model. Towards
standstill, where measured slip is noise, the measurement noise grows and the model noise fades.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.fmu import FMU, Matrix, Vector
from workbench.kernel import compiled, evaluate, inlined, linearise, solve
from workbench.observers.contract import (
    FRICTION_RANGE,
    Estimator,
    clip,
    correct,
    fading,
    measure,
    report,
    rolling_ratio,
    slipping,
    stick,
)

# Distance of sigma points, as a share of the cubature rule's: a friction that nothing is known of
# has a wide sigma, and points as far as that would slide where the wheel rolls.
POINT_DISTANCE = 0.2

# Share of feedback (see `fading`) below which the unscented filter takes the tangent: under 1 m/s
# the slip law bends within a fraction of sigma.
TANGENT_SHARE = 0.8


@dataclass(frozen=True)
class FilterNoise:
    """Noise levels of the Kalman filters.

    Attributes
    ----------
    omegaW_relative, omegaW, omegaR : standard deviation of one sample: share of the speed, and
        [rad/s] (a pole wheel on the axle, an encoder on the roller). A good pole wheel scatters by
        0.03 %; 0.1 % leaves room for its eccentricity and for an error of the wheel radius, which
        a filter that trusts the slip would take for a change of friction.
    model : unmodelled acceleration, random walk of every state [unit of the state / sqrt(s)].
    muWR, muDC : random walk of the frictions [1/sqrt(s)]: a drying disc or a patch of rail changes
        them by 0.05 within a second.
    initial_friction : what is known of the frictions at the start [1].
    """

    omegaW_relative: float = 1e-3
    omegaW: float = 0.002
    omegaR: float = 0.003
    model: float = 0.01
    muWR: float = 0.05
    muDC: float = 0.05
    initial_friction: float = 0.1


class _Settings(NamedTuple):
    order: NDArray[np.intp]
    nominal: Vector
    low: Vector
    high: Vector
    relative: float
    floor: Vector
    walk: Vector
    radius: float
    ratio: float


class _Memory(NamedTuple):
    z: Vector  # states, dmuWR, dmuDC
    P: Matrix
    gain: Matrix
    system: Matrix
    transition: Matrix
    change: Matrix
    work: Matrix


@inlined
def _copy(source, target):  # type: ignore[no-untyped-def]
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@compiled
def _predict_mean(plant, settings, memory, z, h):  # type: ignore[no-untyped-def]
    """Advance z by one linearly implicit step; leaves I - h*A in memory.system; a status."""
    n = plant.x.size
    for i in range(n):
        plant.x[i] = z[i]
    status = correct(plant, z[n], z[n + 1]) or evaluate(plant)
    for i in range(n):
        memory.change[i, 0] = h * plant.dx[i]
    memory.change[n, 0] = memory.change[n + 1, 0] = 0.0
    status = status or linearise(plant, n)
    for i in range(n + 2):
        for j in range(n + 2):
            memory.system[j, i] = -h * plant.jacobian[i, j] if j < n else 0.0
        memory.system[i, i] += 1.0
    _copy(memory.system, memory.work)
    status = status or solve(memory.work, memory.change)
    wheelset, roller = settings.order
    before = slipping(z, wheelset, roller, settings.ratio)
    for i in range(n + 2):
        z[i] += memory.change[i, 0]
    stick(z, wheelset, roller, settings.ratio, settings.radius, before)
    return status


@compiled
def _measurement_noise(settings, y):  # type: ignore[no-untyped-def]
    """Variances of omegaW and omegaR [rad2/s2], raised towards standstill."""
    fade = max(fading(settings.radius * y[1]), 1e-3)
    wheelset = settings.floor[0] + settings.relative * abs(y[0])
    return (wheelset / fade) ** 2, (settings.floor[1] / fade) ** 2


@compiled
def _conclude(plant, settings, memory, row):  # type: ignore[no-untyped-def]
    """Limit the frictions, report the estimate and its standard deviations; returns a status."""
    z, P, n = memory.z, memory.P, plant.x.size
    for i in range(2):
        z[n + i] = clip(z[n + i], settings.low[i], settings.high[i])
    for i in range(n):
        plant.x[i] = z[i]
    status = correct(plant, z[n], z[n + 1]) or linearise(plant, n + 2)
    status = status or report(plant, settings.order, settings.nominal, row)
    width = 8
    for i in range(2):
        row[width + i] = np.sqrt(P[settings.order[i], settings.order[i]])
        row[width + 2 + i] = row[width + 4 + i] = np.sqrt(P[n + i, n + i])
        variance = 0.0
        for j in range(n + 2):
            for k in range(n + 2):
                variance += plant.jacobian[j, n + i] * P[j, k] * plant.jacobian[k, n + i]
        row[width + 6 + i] = np.sqrt(max(variance, 0.0))
    return status


@compiled
def _start(plant, settings, memory, u, y):  # type: ignore[no-untyped-def]
    """Covariance of the first sample; returns a status."""
    noise = _measurement_noise(settings, y)
    for i in range(2):
        memory.P[settings.order[i], settings.order[i]] = noise[i]
    return measure(plant, u)


@compiled
def _update(settings, memory, y, noise, row):  # type: ignore[no-untyped-def]
    """Correct mean and covariance by a sample, measured as states (Joseph form); the NIS."""
    z, P, K = memory.z, memory.P, memory.gain
    size = z.size
    a, b = settings.order
    s_aa, s_bb, s_ab = P[a, a] + noise[0], P[b, b] + noise[1], P[a, b]
    determinant = s_aa * s_bb - s_ab * s_ab
    innovation_a, innovation_b = y[0] - z[a], y[1] - z[b]
    for i in range(size):
        K[i, 0] = (P[i, a] * s_bb - P[i, b] * s_ab) / determinant
        K[i, 1] = (P[i, b] * s_aa - P[i, a] * s_ab) / determinant
    row[16] = (
        innovation_a**2 * s_bb - 2 * innovation_a * innovation_b * s_ab + innovation_b**2 * s_aa
    ) / determinant
    for i in range(size):
        z[i] += K[i, 0] * innovation_a + K[i, 1] * innovation_b
    # (I - K H) P (I - K H)' + K R K'
    T = memory.transition
    for i in range(size):
        for j in range(size):
            T[i, j] = P[i, j] - K[i, 0] * P[a, j] - K[i, 1] * P[b, j]
    for i in range(size):
        for j in range(i + 1):
            value = (
                T[i, j]
                - T[i, a] * K[j, 0]
                - T[i, b] * K[j, 1]
                + K[i, 0] * noise[0] * K[j, 0]
                + K[i, 1] * noise[1] * K[j, 1]
            )
            P[i, j] = P[j, i] = value


@compiled
def _ekf_law(plant, settings, memory, h, u, y, row):  # type: ignore[no-untyped-def]
    """Predict by the linearised model, correct by the sample."""
    if h == 0.0:
        status = _start(plant, settings, memory, u, y)
        return status or _conclude(plant, settings, memory, row)
    P, size = memory.P, memory.z.size
    status = measure(plant, u) or _predict_mean(plant, settings, memory, memory.z, h)
    # P <- (I - hA)^-1 (P + hQ) (I - hA)^-T: two solutions with the matrix of the step.
    fade = fading(settings.radius * y[1])
    for i in range(size):
        P[i, i] += h * (fade * settings.walk[i]) ** 2
    _copy(memory.system, memory.work)
    status = status or solve(memory.work, P)
    _copy(P.T, memory.transition)
    _copy(memory.system, memory.work)
    status = status or solve(memory.work, memory.transition)
    if status:
        return status
    _copy(memory.transition, P)
    _update(settings, memory, y, _measurement_noise(settings, y), row)
    return _conclude(plant, settings, memory, row)


@compiled
def _ekf(plant, settings, memory, steps, u, y, rows):  # type: ignore[no-untyped-def]
    for k in range(steps.size):
        status = _ekf_law(plant, settings, memory, steps[k], u[k], y[k], rows[k])
        if status:
            return status
    return 0


@compiled
def _triangularise(stack, m, root):  # type: ignore[no-untyped-def]
    """Reduce m rows, (m, n), to the triangle root, (n, n): root' root = stack' stack."""
    n = stack.shape[1]
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


class _PointMemory(NamedTuple):
    z: Vector
    P: Matrix
    gain: Matrix
    system: Matrix
    transition: Matrix
    change: Matrix
    work: Matrix
    root: Matrix  # upper triangle, P = root' root
    points: Matrix  # (2 size, size)
    stack: Matrix  # (2 size, size)


@compiled
def _root_to_covariance(memory):  # type: ignore[no-untyped-def]
    size = memory.z.size
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for k in range(j + 1):
                total += memory.root[k, i] * memory.root[k, j]
            memory.P[i, j] = memory.P[j, i] = total


@compiled
def _covariance_to_root(memory):  # type: ignore[no-untyped-def]
    """Cholesky's root of P; directions that rounding has left without variance get none."""
    P, root = memory.P, memory.root
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
def _ukf_law(plant, settings, memory, h, u, y, row):  # type: ignore[no-untyped-def]
    """Square-root unscented filter with 2n points of equal weight."""
    z, root, points, stack = memory.z, memory.root, memory.points, memory.stack
    size = z.size
    if h == 0.0:
        status = _start(plant, settings, memory, u, y)
        for i in range(size):
            root[i, i] = np.sqrt(memory.P[i, i])
        return status or _conclude(plant, settings, memory, row)
    fade = fading(settings.radius * y[1])
    spread = POINT_DISTANCE * np.sqrt(1.0 * size)
    if fade < TANGENT_SHARE:
        status = _ekf_law(plant, settings, memory, h, u, y, row)
        _covariance_to_root(memory)
        return status
    status = measure(plant, u)
    for i in range(size):
        # Model noise enters before the step, whose implicit form damps it as it damps the state.
        for j in range(size):
            stack[i, j] = root[i, j]
            stack[size + i, j] = np.sqrt(h) * fade * settings.walk[i] if j == i else 0.0
    _triangularise(stack, 2 * size, root)
    n = plant.x.size
    for i in range(size):
        for side in range(2):
            point = points[2 * i + side]
            for j in range(size):
                point[j] = z[j] + (1 - 2 * side) * spread * root[i, j]
            for j in range(2):
                point[n + j] = clip(point[n + j], settings.low[j], settings.high[j])
            status = status or _predict_mean(plant, settings, memory, point, h)
    if status:
        return status
    for j in range(size):
        total = 0.0
        for i in range(2 * size):
            total += points[i, j]
        z[j] = total / (2 * size)
    share = np.sqrt(0.5) / spread
    for i in range(2 * size):
        for j in range(size):
            stack[i, j] = share * (points[i, j] - z[j])
    _triangularise(stack, 2 * size, root)
    _root_to_covariance(memory)
    noise = _measurement_noise(settings, y)
    _update(settings, memory, y, noise, row)
    # The root of the Joseph form: rows of root (I - K H)', and of the gain times the noise.
    a, b = settings.order
    for i in range(size):
        for j in range(size):
            stack[i, j] = (
                root[i, j] - root[i, a] * memory.gain[j, 0] - root[i, b] * memory.gain[j, 1]
            )
    for j in range(size):
        stack[size, j] = memory.gain[j, 0] * np.sqrt(noise[0])
        stack[size + 1, j] = memory.gain[j, 1] * np.sqrt(noise[1])
    _triangularise(stack, size + 2, root)
    _root_to_covariance(memory)
    return _conclude(plant, settings, memory, row)


@compiled
def _ukf(plant, settings, memory, steps, u, y, rows):  # type: ignore[no-untyped-def]
    for k in range(steps.size):
        status = _ukf_law(plant, settings, memory, steps[k], u[k], y[k], rows[k])
        if status:
            return status
    return 0


class ExtendedKalmanFilter(Estimator):
    """Continuous-discrete extended Kalman filter with frictions as random walks.

    Prediction by one linearly implicit step with the FMU's Jacobian, for mean and covariance;
    correction in Joseph form. Source: D. Simon, Optimal State Estimation, Wiley 2006, chapter 13.

    Parameters
    ----------
    fmu : any model with the inputs and outputs of an estimator.
    noise : see FilterNoise.
    """

    name = "ekf"
    _law = staticmethod(_ekf_law)
    _loop = staticmethod(_ekf)

    def __init__(self, fmu: FMU, noise: FilterNoise | None = None) -> None:
        super().__init__(fmu)
        noise = noise or FilterNoise()
        n = len(fmu.states)
        low, high = (FRICTION_RANGE - self._nominal[:, None]).T
        self._initial_friction = noise.initial_friction
        self._settings = _Settings(
            order=self._order,
            nominal=self._nominal,
            low=np.ascontiguousarray(low),
            high=np.ascontiguousarray(high),
            relative=noise.omegaW_relative,
            floor=np.array([noise.omegaW, noise.omegaR]),
            walk=np.array([noise.model] * n + [noise.muWR, noise.muDC]),
            radius=self._radius,
            ratio=rolling_ratio(fmu),
        )
        self._memory: _Memory | _PointMemory = _Memory(*_buffers(n + 2))

    def _arguments(self) -> tuple[Any, Any]:
        return self._settings, self._memory

    def _begin(self, u: Vector, y: Vector) -> None:
        n = len(self.fmu.states)
        self._memory.z[:] = 0.0
        self._memory.z[:n] = self.fmu.get_states()
        self._memory.P[:] = 0.0
        np.fill_diagonal(self._memory.P, [self._settings.walk[0] ** 2] * n + [0.0, 0.0])
        for i in (n, n + 1):
            self._memory.P[i, i] = self._initial_friction**2


class UnscentedKalmanFilter(ExtendedKalmanFilter):
    """Square-root unscented Kalman filter: no derivative of the filter, the same noise levels.

    Sigma points of equal weight, each advanced by the linearly implicit step; the covariance is
    scaled by their distance, see POINT_DISTANCE. All updates are orthogonal triangularisations,
    without downdates.
    Source: R. van der Merwe, E. Wan (2001), The square-root unscented Kalman filter for state and
    parameter estimation, ICASSP; I. Arasaratnam, S. Haykin (2009), Cubature Kalman filters.

    Parameters
    ----------
    fmu : any model with the inputs and outputs of an estimator.
    noise : see FilterNoise.
    """

    name = "ukf"
    _law = staticmethod(_ukf_law)
    _loop = staticmethod(_ukf)

    def __init__(self, fmu: FMU, noise: FilterNoise | None = None) -> None:
        super().__init__(fmu, noise)
        size = len(fmu.states) + 2
        self._memory = _PointMemory(
            *_buffers(size),
            root=np.zeros((size, size)),
            points=np.zeros((2 * size, size)),
            stack=np.zeros((2 * size, size)),
        )

    def _begin(self, u: Vector, y: Vector) -> None:
        super()._begin(u, y)
        assert isinstance(self._memory, _PointMemory)
        self._memory.root[:] = 0.0


def _buffers(size: int) -> tuple[Vector, Matrix, Matrix, Matrix, Matrix, Matrix, Matrix]:
    square = [np.zeros((size, size)) for _ in range(4)]
    return (
        np.zeros(size),
        square[0],
        np.zeros((size, 2)),
        square[1],
        square[2],
        np.zeros((size, 1)),
        square[3],
    )
