"""The block Kalman filter is the extended one, but for what it takes for the same in all pairs.

Vessels on a common header are a linear machine of like parts, on which it is exact; of a train,
whose bogies differ, it is an approximation.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.observers.contract import Estimate
from workbench.observers.estimators.block_filter.blocks import divide
from workbench.observers.estimators.block_filter.filter import BlockKalmanFilter
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.operating import walks
from workbench.system.registry import open_model
from workbench.system.system import System

from . import growth
from .built import declare, machine_file
from .systems import TRAIN

COUNT = 5
EVERY = range(1, COUNT + 1)


def library() -> str:
    """Modelica of the vessels: the level of each is measured as a voltage, which is no state."""
    flow = "2e-3*(header - h{i})"
    return machine_file(
        "vessels/package.mo",
        inputs="\n".join(f'input Real dleak{i}(unit="m3/s");' for i in EVERY),
        outputs="\n".join(
            f'output Real h{i}(unit="m", start=0.8, fixed=true, nominal=1.0);'
            f'output Real reading{i}(unit="V") = 2.0*h{i};'
            for i in EVERY
        ),
        leaks=" - ".join(f"(leak[{i}] + dleak{i})" for i in EVERY),
        equations="\n".join(
            f"0.5*der(h{i}) = {flow.format(i=i)} - leak[{i}] - dleak{i};" for i in EVERY
        ),
        flows=" - ".join(flow.format(i=i) for i in EVERY),
    )


@pytest.fixture(scope="module")
def vessels(tmp_path_factory) -> System:
    outputs = "\n".join(
        f'[outputs.reading{i}]\nunit = "V"\nnoise = "0.02 V"\nscale = "2 V"\n' for i in EVERY
    )
    estimated = "\n".join(
        f'[estimated."leak[{i}]"]\ncorrection = "dleak{i}"\nunit = "m3/s"\n'
        'range = ["-1e-2 m3/s", "1e-2 m3/s"]\nwalk = "3e-6 m3/s"\nspread = "5e-5 m3/s"\n'
        for i in EVERY
    )
    system = machine_file("vessels/system.toml", outputs=outputs, estimated=estimated)
    return declare(tmp_path_factory.mktemp("vessels"), library(), system, Vessels="Water.Vessels")


@pytest.fixture(scope="module")
def filling(vessels) -> Iterator[FMU]:
    with open_model(vessels) as fmu:
        yield fmu


@pytest.fixture(scope="module")
def train(tmp_path_factory) -> System:
    """Two vehicles of four axles, whose wheel loads shift as bodies pitch."""
    return growth.build(2, tmp_path_factory.mktemp("train"))


@pytest.fixture(scope="module")
def rolling(train) -> Iterator[FMU]:
    with open_model(train) as fmu:
        yield fmu


def made(fmu: FMU, system: System) -> tuple[ExtendedKalmanFilter, BlockKalmanFilter]:
    gains = ExtendedKalmanFilter.default_gains(fmu, system)
    plain = ExtendedKalmanFilter(fmu, system, gains)
    plain.steps[0].weight[0] = 0.0  # nothing ends Euler's steps, which those of blocks are
    return plain, BlockKalmanFilter(fmu, system, gains)


def recording(system: System, samples: int) -> tuple[Vector, Matrix, Matrix]:
    """Noise about rest: what a linear filter makes of it, it makes of any recording."""
    random = np.random.default_rng(3)
    t = system.sample_time * np.arange(samples, dtype=np.float64)
    u = np.full((samples, 1), 1e-3)
    y = np.array([1.6] * COUNT + [3.0]) + 0.05 * random.standard_normal((samples, COUNT + 1))
    return t, u, y


def assert_alike(estimate: Estimate, expected: Estimate, rtol: float) -> None:
    """Estimates within a share of their standard deviations, and these."""
    apart = (estimate.values - expected.values) / np.where(
        expected.sigma > 0.0, expected.sigma, 1.0
    )
    assert_allclose(apart, 0.0, atol=rtol)
    assert_allclose(estimate.sigma, expected.sigma, rtol=rtol)
    assert_allclose(estimate.nis, expected.nis, rtol=rtol)


# --- blocks ---


def test_unknowns_that_only_shared_ones_tie_are_blocks(filling, vessels, rolling, train):
    """Level and leak of a vessel; four states, pads and radii of a bogie."""
    for fmu, system, size, count, shared in (
        (filling, vessels, 2, COUNT, {"header", "doffset"}),
        (rolling, train, 8, 4, {"vTrain", "a", "braking", "dbias"}),
    ):
        _, estimator = made(fmu, system)
        names = np.array([*fmu.states, *system.corrections])
        parts = estimator._blocks
        assert set(np.diff(parts.first)[:-1]) == {size}
        assert parts.first.size - 2 == count
        assert set(names[parts.order[parts.first[-2] :]]) == shared


def test_unlike_parts_and_small_gains_are_one_block():
    """A chain of three, of which blocks would save less than half; and parts of all sizes."""
    assert divide(3, 3, 0, [(0, 1), (1, 2)]) == ([[0, 1, 2]], [])
    star = [(0, k) for k in range(1, 9)]
    assert divide(9, 9, 0, star) == ([[k] for k in range(1, 9)], [0])
    unlike = [(0, k) for k in range(1, 11)] + [(2, 3), (4, 5), (5, 6), (7, 8), (8, 9), (9, 10)]
    assert divide(11, 11, 0, unlike) == ([list(range(11))], [])


def test_outputs_keep_together_what_they_depend_on():
    star = [(0, k) for k in range(1, 9)]
    pairs = [(9 + k, 1 + 2 * k + side) for k in range(4) for side in range(2)]
    assert divide(9, 9, 4, star + pairs) == ([[1, 2], [3, 4], [5, 6], [7, 8]], [0])


def test_a_model_without_blocks_has_the_extended_filter():
    """Of this train loads shift by the pads of all axles at once: each depends on each other."""
    system = TRAIN
    with open_model(system) as fmu:
        plain, estimator = made(fmu, system)
        t, u, y = growth.stop(system)
        first = slice(0, 20)
        estimate, expected = (ekf.run(t[first], u[first], y[first]) for ekf in (estimator, plain))
    np.testing.assert_array_equal(estimate.values, expected.values)
    np.testing.assert_array_equal(estimate.sigma, expected.sigma)


def test_a_model_whose_structure_is_not_said_is_one_block(filling, vessels):
    """As of exporters that leave it out, which FMI allows."""
    description = filling.description
    filling.description = replace(description, dependencies={})
    _, estimator = made(filling, vessels)
    filling.description = description
    assert estimator._blocks.first.tolist() == [0, 12, 12]


def test_levels_are_not_learnt_of_blocks(filling, vessels):
    with pytest.raises(InputError, match="noise levels that are to be learnt"):
        made(filling, replace(vessels, learns=2.0))


# --- where it is exact ---


@pytest.mark.parametrize("differences", [False, True])
def test_like_parts_of_a_linear_machine_are_filtered_exactly(filling, vessels, differences):
    """400 samples; rounding adds up to 1e-9, differences of a linear model to 1e-6."""
    filling.has_directional_derivatives = not differences
    plain, estimator = made(filling, vessels)
    filling.has_directional_derivatives = True
    samples = recording(vessels, 400)
    estimate, expected = estimator.run(*samples), plain.run(*samples)
    assert_alike(estimate, expected, 1e-5 if differences else 1e-8)
    assert_allclose(estimator.covariance, plain.covariance, rtol=1e-6, atol=1e-16)


def faded(estimator: BlockKalmanFilter, y: Vector) -> float:
    """Share of the feedback, see the system file."""
    layout = estimator._settings.filter.layout
    pace = (layout.pace @ y) ** 2
    return float(pace / (pace + layout.half**2))


def dense_step(estimator: BlockKalmanFilter, u: Vector, y: Vector) -> tuple[Vector, Matrix]:
    """Mean and covariance after a step, by matrices of all unknowns."""
    fmu, settings, h = estimator.fmu, estimator._settings.filter, estimator.system.sample_time
    fade = faded(estimator, y)
    n, z, P = len(fmu.states), estimator._state.z.copy(), estimator._joint()
    inputs = fmu.variables([variable.name for variable in estimator.system.inputs])
    corrections = fmu.variables(estimator.system.corrections)
    fmu.set_states(z[:n])
    fmu.set(inputs, u)
    fmu.set(corrections, z[n:])
    M = np.eye(z.size)
    M[:n, :n] -= h * fmu.state_jacobian()
    M[:n, n:] -= h * fmu.input_jacobian(corrections)
    rates = np.concatenate([fmu.derivatives(), np.zeros(z.size - n)])
    F = np.linalg.inv(M)
    return z + F @ (h * rates), F @ (P + h * np.diag((fade * settings.walk) ** 2)) @ F.T


def marginals(estimator: BlockKalmanFilter) -> Iterator[Any]:
    """Places of each block together with the shared unknowns."""
    parts = estimator._blocks
    shared = parts.order[parts.first[-2] :]
    for begin, end in zip(parts.first[:-2], parts.first[1:-1], strict=True):
        yield np.ix_(*[np.concatenate([parts.order[begin:end], shared])] * 2)


def blind(estimator: BlockKalmanFilter, samples: Any, k: int) -> tuple[Vector, Matrix]:
    """Run up to sample k, and take it with endless noise; returns what a step should make of it."""
    t, u, y = samples
    estimator.run(t[:k], u[:k], y[:k])
    expected, noise = dense_step(estimator, u[k], y[k]), estimator._settings.filter.floor
    sensors = noise.copy()
    noise[:] = 1e12
    estimator.advance(np.diff(t[k - 1 : k + 1]), u[k : k + 1], y[k : k + 1])
    noise[:] = sensors
    return expected


def test_a_step_keeps_what_is_known_of_a_block_and_the_shared_unknowns(rolling, train):
    """Amid a stop, against matrices of all unknowns, to rounding; pairs of blocks nearly."""
    _, estimator = made(rolling, train)
    z, P = blind(estimator, growth.stop(train), 60)
    sigma = np.sqrt(np.diag(P))
    assert_allclose((estimator._state.z - z) / sigma, 0.0, atol=1e-9)
    apart = np.abs(estimator._joint() - P) / np.outer(sigma, sigma)
    for own in marginals(estimator):
        assert apart[own].max() < 1e-9
    assert 1e-6 < apart.max() < 0.01  # what a bogie in front has in common with one behind


def test_a_sample_is_taken_as_by_matrices_of_all_unknowns(rolling, train):
    """After no time, within which nothing moves; y tells of all unknowns at once."""
    _, estimator = made(rolling, train)
    t, u, y = growth.stop(train)
    blind(estimator, (t, u, y), 60)
    z, P, settings = estimator._state.z.copy(), estimator._joint(), estimator._settings.filter
    estimate = estimator.advance(np.array([1e-15]), u[60:61], y[60:61])
    seen = settings.layout.seen
    noise = (settings.floor + settings.relative * np.abs(y[60])) / faded(estimator, y[60])
    R = np.diag(noise**2)
    S = P[np.ix_(seen, seen)] + R
    K, innovation = np.linalg.solve(S, P[seen]).T, y[60] - z[seen]
    after = P - K @ P[seen]
    sigma = np.sqrt(np.diag(after))
    assert_allclose(estimate.nis[0], innovation @ np.linalg.solve(S, innovation), rtol=1e-6)
    assert_allclose((estimator._state.z - z - K @ innovation) / sigma, 0.0, atol=1e-6)
    assert_allclose((estimator._joint() - after) / np.outer(sigma, sigma), 0.0, atol=1e-6)


# --- where it is an approximation ---


def stops(
    fmu: FMU, system: System, count: int, share: Vector | None = None, mass: float = 48e3
) -> Iterator[tuple[Any, Vector]]:
    """Stops of the model itself with noise of the sensors, and the true quantities.

    Pads and radii differ between axles as in the data sheet: 3 % one sigma, radii up to 0.4 mm; the
    speed walks as the system file says. Up to some 5 m/s, where feedback begins to fade.

    Parameters
    ----------
    share : (4,) of the usual pressure in each bogie.
    mass : of the first vehicle [kg].
    """
    bogies = np.ones(4) if share is None else share
    h, axles, samples = system.sample_time, 8, 240
    inputs = fmu.variables([variable.name for variable in system.inputs])
    corrections = fmu.variables(system.corrections)
    outputs = [fmu.states.index(output.name) for output in system.outputs]
    speed = fmu.states.index("vTrain")
    walk = walks(fmu, system)[speed]
    for seed in range(count):
        random = np.random.default_rng(seed)
        pads = 0.3 * random.normal(1.0, 0.03, axles)
        radii = 0.46 + random.uniform(-4e-4, 4e-4, axles)
        bias = random.normal(0.0, 0.02)
        given = {f"muDC[{i + 1}]": pads[i] for i in range(axles)}
        given |= {f"r[{i + 1}]": radii[i] for i in range(axles)}
        # Creep is not differentiable where there is none.
        start = {f"omega{i + 1}": 25.0 / radii[i] * (1.0 - 1e-5) for i in range(axles)}
        fmu.start({**start, "vTrain": 25.0}, given)
        fmu.set(corrections, np.array([0.0] * (2 * axles) + [bias]))
        u, y = np.zeros((samples, len(system.inputs))), np.zeros((samples, len(outputs)))
        for k in range(samples):
            pressure = 2.4e5 * (1.0 - np.exp(-max(k * h - 10.0, 0.0) / 0.45))
            u[k] = [*(pressure * bogies), mass, 48e3, 0.0, 0.0, 0.0]
            fmu.set(inputs, u[k])
            x = fmu.step(h).copy()
            x[speed] += walk * np.sqrt(h) * random.standard_normal()
            fmu.set_states(x)
            y[k] = x[outputs]
        for j, output in enumerate(system.outputs):
            y[:, j] += output.deviation(y[:, j]) * random.standard_normal(samples)
        truth = np.concatenate([pads, radii, [bias]])
        yield (h * np.arange(samples), u, y), truth


def test_estimates_of_a_train_are_those_of_the_extended_filter(rolling, train):
    """Thirty stops. Differences of d standard deviations add d^2/2 to a root mean square error, and
    bands that are 3 % narrower hold 94.3 % in place of 95 %.
    """
    plain, estimator = made(rolling, train)
    apart, narrower, held = [], [], []
    first = list(train.columns).index(train.estimated[0].name)
    for samples, truth in stops(rolling, train, 30):
        estimate, expected = estimator.run(*samples), plain.run(*samples)
        apart.append(((estimate.values - expected.values) / expected.sigma)[1:])
        narrower.append((estimate.sigma / expected.sigma)[1:])
        own = slice(first, first + truth.size)
        for run in (estimate, expected):
            error = np.abs(run.values[:, own] - truth)
            held.append(error < 1.96 * run.sigma[:, own])
    assert np.sqrt(np.mean(np.square(apart), axis=(0, 1))).max() < 0.15
    assert_allclose(narrower, 1.0, atol=0.03)
    ours, theirs = (np.mean(held[side::2]) for side in (0, 1))
    assert abs(ours - theirs) < 0.005
    assert ours > 0.95


@pytest.mark.parametrize(
    ("unlike", "within"),
    [({"mass": 1.2 * 48e3}, 0.15), ({"share": np.array([1.0, 0.0, 1.0, 1.0])}, 1.0)],
    ids=["laden", "released"],
)
def test_what_is_known_of_unlike_bogies_is_a_covariance(rolling, train, unlike, within):
    """Along a stop in which a vehicle has a fifth more mass, or a bogie does not brake at all.

    Of that the friction seems known better than it is; of the laden one nearly as well as it is.
    """
    plain, estimator = made(rolling, train)
    ((t, u, y), _) = next(stops(rolling, train, 1, **unlike))
    estimator.start(u[0], y[0])
    steps, sigma = np.diff(t, prepend=t[0]), []
    for k in range(t.size):
        own = slice(k, k + 1)
        sigma.append(estimator.advance(steps[own], u[own], y[own]).sigma[0])
        joint = estimator._joint()
        scale = np.sqrt(np.diag(joint))
        scale[scale == 0.0] = 1.0  # of what nothing moves yet
        known = joint / np.outer(scale, scale)
        assert_allclose(known, known.T, atol=1e-12)
        assert np.linalg.eigvalsh(known).min() > -1e-9
    apart = np.array(sigma) / plain.run(t, u, y).sigma - 1.0
    assert np.abs(apart).max() < within
