"""The moving horizon estimator solves its problem: beside the Kalman filter and scipy's solvers.

Two tanks and a leak whose flow is estimated. The linear ones have a voltage as output; in the
others the leak's flow grows with its square and the voltage with the root of the level, but the
Jacobian of the states is constant, so that derivatives of a step are exact.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import OptimizeResult, least_squares, lsq_linear

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.observers import Estimate
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.estimators.moving_horizon.estimator import MovingHorizonEstimator
from workbench.observers.estimators.moving_horizon.window_cost import cost
from workbench.observers.estimators.smoother import Smoother
from workbench.system.registry import load_system, open_model
from workbench.system.system import System

from .built import build_here, machine_file
from .linear import with_steps

STEP = 2.0  # [s]
Filter = TypeVar("Filter", bound=ExtendedKalmanFilter)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("tanks")
    (folder / "package.mo").write_text(machine_file("leaking_tanks/package.mo"))
    for model in ("Linear", "Bent"):
        build_here(folder / "package.mo", f"Water.{model}", folder / f"{model}.fmu")
    return folder


def system(folder: Path, model: str, low: float = -1e-2, high: float = 1e-2) -> System:
    path = folder / "system.toml"
    path.write_text(machine_file("leaking_tanks/system.toml", model=model, low=low, high=high))
    return load_system(path)


@pytest.fixture(scope="module")
def bent(folder) -> Iterator[tuple[FMU, System]]:
    known = system(folder, "Bent")
    with open_model(known) as fmu:
        yield fmu, known


@pytest.fixture(scope="module")
def linear(folder) -> Iterator[tuple[FMU, System]]:
    known = system(folder, "Linear")
    with open_model(known) as fmu:
        yield fmu, known


def lost(model: str, leak: float | Vector) -> float | Vector:
    """Flow of a leak [m3/s]."""
    return leak if model == "Linear" else 5e3 * leak**2


def reading(model: str, h2: float) -> float:
    """Voltage of a level."""
    return 2.0 * h2 + 0.4 if model == "Linear" else 3.0 * float(np.sqrt(h2))


def recording(
    model: str = "Linear", count: int = 120, seed: int = 1, after: float = 2.5e-4
) -> tuple[Vector, Matrix, Matrix]:
    """Noisy samples of tanks whose leak opens from 1e-4 m3/s on half way; time, u, y."""
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(count)
    pump = np.where(time % 80.0 < 40.0, 1.4e-3, 0.8e-3)
    h1, h2, y = 0.95, 0.75, np.empty((count, 2))
    for k in range(count):
        y[k] = reading(model, h2), h1
        leak = 1e-4 if k < count // 2 else after
        between = 2e-3 * (h1 - h2)
        h1 += STEP * (pump[k] - between) / 0.5
        h2 += STEP * (between - 1e-3 * h2 - lost(model, leak)) / 0.5
    return time, pump[:, None], y + rng.normal(size=y.shape) * [0.005, 0.01]


A = np.array([[-2e-3, 2e-3], [2e-3, -3e-3]]) / 0.5
WALK = np.sqrt(STEP) * np.array([1e-4, 2e-4, 3e-6])
NOISE = np.array([0.005, 0.01])


def residuals(
    nodes: Vector, model: str, samples: tuple[Vector, Matrix, Matrix]
) -> tuple[Vector, Matrix]:
    """Textbook terms of the problem over a whole recording, and where the steps lead, (N, 3)."""
    _, u, y = samples
    s = nodes.reshape(-1, 3)
    inverse = np.linalg.inv(np.eye(2) - STEP * A)
    first = np.array([y[0, 1], 0.8, 0.0])
    spread = np.sqrt(np.array([0.01, 0.1, 5e-5]) ** 2 + WALK**2)
    ends = s.copy()
    for k, node in enumerate(s):
        inflow = np.array([u[k + 1, 0], -lost(model, 1e-4 + node[2])]) / 0.5
        ends[k, :2] += inverse @ (STEP * (A @ node[:2] + inflow))
    seen = np.column_stack([[reading(model, end[1]) for end in ends], ends[:, 0]])
    terms = [(s[0] - first) / spread, (s[1:] - ends[:-1]) / WALK, (y[1:] - seen) / NOISE]
    return np.concatenate([term.ravel() for term in terms]), ends


SIZES = np.array([0.01, 0.01, 1e-5])  # of what a node holds


def least(samples: tuple[Vector, Matrix, Matrix]) -> OptimizeResult:
    """Best nodes, by scipy on the textbook terms of tanks with a bent leak, from true levels."""
    nodes = samples[0].size - 1
    return least_squares(
        lambda x: residuals(x, "Bent", samples)[0],
        *(np.tile([0.95, 0.75, 0.0], nodes),),
        x_scale=np.tile(SIZES, nodes),
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )


def stepping_by_euler(estimator: Filter) -> Filter:
    """An estimator to which errors of steps are nothing, as in the textbook terms."""
    for step in estimator.steps:
        step.weight[0] = 0.0
    return estimator


def horizon(
    fmu: FMU, known: System, samples: int, iterations: int = 1, rare: float = 1e-6
) -> MovingHorizonEstimator:
    gains = MovingHorizonEstimator.default_gains(fmu, known)
    design = {
        **gains.design,
        "horizon": np.array([samples]),
        "iterations": np.array([iterations]),
        "rare": np.array([rare]),
    }
    gains = type(gains)(gains.estimator, gains.names, gains.values, design, "")
    return stepping_by_euler(MovingHorizonEstimator(fmu, known, gains))


def smoother(fmu: FMU, known: System, rare: float = 1e-300) -> Smoother:
    gains = Smoother.default_gains(fmu, known)
    design = {**gains.design, "rare": np.array([rare])}
    gains = type(gains)("smoother", gains.names, gains.values, design, "")
    return stepping_by_euler(Smoother(fmu, known, gains))


def kalman(fmu: FMU, known: System, samples: tuple[Vector, Matrix, Matrix]) -> Estimate:
    return stepping_by_euler(ExtendedKalmanFilter.untuned(fmu, known)).run(*samples)


def test_samples_that_come_late_count_as_if_they_had_come_in_time(linear):
    """Reference: the same samples in time; the level of the first tank comes 5 steps late."""
    time, u, y = recording()
    late = 5
    expected = horizon(*linear, 20).run(time, u, y)
    estimator = horizon(*linear, 20)
    estimator.init(time[0], u[0], y[0])
    for k in range(1, 60):
        estimator.step(time[k], u[k], np.array([np.nan, y[k, 1]]))
        if k > late:
            estimator.fill_in(late, np.array([y[k - late, 0], np.nan]))
    for age in range(late):
        estimator.fill_in(age, np.array([y[59 - age, 0], np.nan]))
    estimate = estimator.step(time[60], u[60], y[60])
    # Rounding, over the 1e6 that lie between variances of levels and flows.
    assert_allclose(estimate.values, expected.values[60], rtol=1e-9)
    assert_allclose(estimate.sigma, expected.sigma[60], rtol=1e-9)
    with pytest.raises(InputError, match="20 steps old"):
        estimator.fill_in(20, y[40])


@pytest.mark.parametrize("accurate", [False, True])
@pytest.mark.parametrize("samples", [1, 2, 7, 20, 200])
def test_on_a_linear_model_it_is_the_kalman_filter(linear, samples, accurate):
    expected = with_steps(ExtendedKalmanFilter.untuned(*linear), recording(), accurate)
    estimate = with_steps(horizon(*linear, samples), recording(), accurate)
    # Rounding of double precision, over the 1e6 that lie between variances of levels and flows.
    scale = np.abs(expected.values).max(axis=0)
    assert_allclose(estimate.values / scale, expected.values / scale, rtol=0, atol=1e-10)
    assert_allclose(estimate.sigma, expected.sigma, rtol=1e-10)
    assert_allclose(estimate.nis, expected.nis, rtol=1e-8, atol=1e-10)


def test_a_full_horizon_solves_the_nonlinear_least_squares_problem(bent):
    """Reference: scipy on the textbook terms, from the true levels."""
    samples = recording("Bent", 30)
    best = least(samples)
    estimator = horizon(*bent, 40, iterations=8)
    estimator.run(*samples)
    window = estimator._state.window
    data = window.data
    count = data.filled[0]
    # Differences of scipy's derivatives are good to 1e-8 of a term; a standard deviation is 1.
    assert_allclose(data.nodes[:count] / SIZES, best.x.reshape(-1, 3) / SIZES, rtol=0, atol=2e-4)
    assert cost(window) == pytest.approx(2.0 * best.cost, rel=1e-7)
    assert_allclose(
        estimator._state.filter.z[:2], residuals(best.x, "Bent", samples)[1][-1, :2], atol=2e-6
    )


def test_with_active_bounds_it_is_the_bounded_least_squares_solution(folder):
    """Reference: scipy's BVLS on the dense problem; and the conditions of Karush, Kuhn, Tucker."""
    known = system(folder, "Linear", low=0.9e-4, high=1.5e-4)
    samples = recording("Linear", 40, after=4e-4)
    unit = np.tile([0.01, 0.01, 1e-5], 39)
    inverse = np.linalg.inv(np.eye(2) - STEP * A)

    def node(end: Vector, k: int) -> Vector:
        """Where a step came from, which a linear problem tells from where it leads."""
        inflow = np.array([samples[1][k + 1, 0], -1e-4 - end[2]]) / 0.5
        return np.array([*np.linalg.solve(inverse, end[:2]) - STEP * inflow, end[2]])

    def terms(scaled: Vector) -> Vector:
        ends = (scaled * unit).reshape(-1, 3)
        nodes = np.concatenate([node(end, k) for k, end in enumerate(ends)])
        return residuals(nodes, "Linear", samples)[0]

    offset = terms(np.zeros(unit.size))
    matrix = np.column_stack([terms(column) - offset for column in np.eye(unit.size)])
    low = np.tile([-np.inf, -np.inf, -0.1e-4], 39) / unit
    high = np.tile([np.inf, np.inf, 0.5e-4], 39) / unit
    best = lsq_linear(matrix, -offset, (low, high), method="bvls", tol=1e-14, max_iter=1000)
    assert (best.active_mask == 1).sum() > 5
    with open_model(known) as fmu:
        estimator = horizon(fmu, known, 50, rare=1e-300)
        estimator.run(*samples)
        window = estimator._state.window
        data, bounds = window.data, window.solution
        solution = data.arrived[: data.filled[0]] / unit.reshape(-1, 3)
    # Rounding, grown by a condition number of about 1e5.
    assert_allclose(solution, best.x.reshape(-1, 3), rtol=0, atol=1e-6)
    gradient = matrix.T @ (matrix @ solution.ravel() + offset)
    active = bounds.active[: data.filled[0]].ravel()
    np.testing.assert_array_equal(active, best.active_mask)
    size = np.abs(matrix).T @ np.abs(matrix @ solution.ravel() + offset)
    assert np.abs(gradient[active == 0] / size[active == 0]).max() < 1e-8
    assert (gradient[active == 1] <= 0.0).all()
    assert (bounds.multiplier[: data.filled[0]].ravel()[active != 0] >= 0.0).all()


def test_a_sample_that_is_far_off_hardly_moves_it(linear):
    clean = recording()
    spoiled = clean[0], clean[1], clean[2].copy()
    spoiled[2][40, 0] += 1.0  # two hundred standard deviations
    shifts = []
    for run in (
        lambda samples: kalman(*linear, samples),
        lambda samples: horizon(*linear, 20).run(*samples),
    ):
        values = [run(samples).values[:, 2] for samples in (clean, spoiled)]
        shifts.append(np.abs(values[1] - values[0])[45:60].max())
    assert shifts[1] < 0.1 * shifts[0]


def test_missing_samples_are_left_out(linear):
    """Reference: the Kalman filter, in which the sample of so large a noise is worth nothing."""
    time, u, y = recording()
    gaps = y.copy()
    gaps[30:40] = np.nan
    gaps[50::3, 1] = np.nan
    estimate = horizon(*linear, 15).run(time, u, gaps)
    complete = horizon(*linear, 200).run(time, u, gaps)
    assert np.isfinite(estimate.values).all()
    # A window and the whole recording agree, so that samples before the gap are kept in its mean.
    assert_allclose(estimate.values, complete.values, rtol=1e-9, atol=1e-12)
    # Nothing is seen in the gap, so that it knows less with each sample.
    assert (np.diff(estimate.sigma[29:40, 0]) > 0.0).all()


@pytest.mark.parametrize("seed", range(4))
def test_more_iterations_never_raise_the_cost(bent, seed):
    """Levels a tenth off at the start, so that the first iterations go a long way."""
    time, u, y = recording("Bent", 25, seed)
    y[0, 1] += 0.3
    costs = []
    for iterations in (1, 2, 4, 8):
        estimator = horizon(*bent, 40, iterations, rare=1e-300)
        estimator.run(time, u, y)
        costs.append(cost(estimator._state.window))
    # Rounding of a sum of about a hundred squares; steps are refused beyond 1e-9 of it.
    assert (np.diff(costs) <= 1e-6 * costs[0]).all()


# --- the smoother, the same problem over a whole recording ---


def test_the_smoother_is_the_batch_least_squares_solution(linear):
    """Reference: the dense problem of a linear model, by an orthogonal factorisation."""
    samples = recording("Linear", 60)
    unit = np.tile([0.01, 0.01, 1e-5], 59)
    offset = residuals(np.zeros(unit.size), "Linear", samples)[0]
    columns = [residuals(column, "Linear", samples)[0] - offset for column in np.diag(unit)]
    matrix = np.column_stack(columns)
    best = np.linalg.lstsq(matrix, -offset, rcond=None)[0] * unit
    deviations = np.linalg.norm(np.linalg.inv(np.linalg.qr(matrix, mode="r")), axis=1) * unit
    estimate = smoother(*linear).run(*samples)
    ends = residuals(best, "Linear", samples)[1]
    h1, dleak = estimate.values[1:, 1], estimate.values[1:, 2]
    # Rounding, grown by a condition number of 1e3.
    assert_allclose(h1, ends[:, 0], rtol=1e-10)
    assert_allclose(dleak, ends[:, 2], rtol=0, atol=1e-10 * 1e-4)
    assert_allclose(estimate.sigma[1:, 2], deviations.reshape(-1, 3)[:, 2], rtol=1e-9)


def test_the_smoother_knows_no_less_than_the_filter_and_ends_where_it_does(linear):
    samples = recording()
    estimate, filtered = smoother(*linear).run(*samples), kalman(*linear, samples)
    assert (estimate.sigma <= filtered.sigma * (1.0 + 1e-12)).all()
    assert estimate.sigma[40, 2] < 0.8 * filtered.sigma[40, 2]
    # Rounding, over the 1e6 that lie between variances of levels and flows.
    assert_allclose(estimate.values[-1], filtered.values[-1], rtol=1e-10)
    assert_allclose(estimate.sigma[-1], filtered.sigma[-1], rtol=1e-10)


def test_the_smoother_solves_the_nonlinear_least_squares_problem(bent):
    """Reference: scipy on the textbook terms, from the true levels."""
    samples = recording("Bent", 60)
    best = least(samples)
    estimate = smoother(*bent).run(*samples)
    ends = residuals(best.x, "Bent", samples)[1]
    # Differences of scipy's derivatives are good to 1e-8 of a term; a standard deviation is 1.
    assert_allclose(estimate.values[1:, 1] / 0.01, ends[:, 0] / 0.01, rtol=0, atol=2e-4)
    assert_allclose(estimate.values[1:, 2] / 1e-5, ends[:, 2] / 1e-5, rtol=0, atol=2e-3)


def test_the_smoother_keeps_quantities_within_their_bounds(folder):
    """Reference: the moving horizon that holds the whole recording, whose bounds are exact."""
    known = system(folder, "Linear", low=0.9e-4, high=1.5e-4)
    samples = recording("Linear", 40, after=4e-4)
    with open_model(known) as fmu:
        estimator = horizon(fmu, known, 50, rare=1e-300)
        estimator.run(*samples)
        window = estimator._state.window
        data = window.data
        expected = data.arrived[: data.filled[0]]
        estimate = smoother(fmu, known).run(*samples)
    assert (np.abs(estimate.values[1:, 2] - 0.5e-4) < 1e-15).sum() > 5
    assert_allclose(estimate.values[1:, 2], expected[:, 2], rtol=0, atol=1e-6 * 1e-5)
    assert_allclose(estimate.values[1:, 1], expected[:, 0], rtol=0, atol=1e-6 * 0.01)


def test_the_smoother_refuses_a_recording_that_is_not_over(linear):
    time, u, y = recording()
    estimator = smoother(*linear)
    with pytest.raises(InputError, match="a part of a recording"):
        estimator.init(time[0], u[0], y[0])
    with pytest.raises(InputError, match="a part of a recording"):
        estimator.step(time[1], u[1], y[1])
    with pytest.raises(InputError, match="a part of a recording"):
        estimator.advance(np.diff(time), u[1:], y[1:])
