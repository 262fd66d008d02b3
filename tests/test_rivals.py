"""What recordings so far say of a model, kept without them: against all of them side by side."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.inference.quadratic import Joint, Quadratic, RecordingSystem
from workbench.diagnosis.inference.rivals import Rival

# Normal equations of numbers whose condition is some ten: rounding, and the solver's own tolerance.
NEAR = {"rtol": 1e-6, "atol": 1e-7}
SIZE, DRY, WET = ("effect", "size"), ("friction", "dry"), ("friction", "wet")
SIGMA = 0.5  # of each friction, of which something is known
AWAY = 0.3  # of that of the wet one as fitted, in these


def recording(rng: np.random.Generator, common: int, furthest: float) -> RecordingSystem:
    """Twelve blocks of three channels; two tolerances and a phase."""
    r, J, P = rng.normal(size=37), rng.normal(size=(37, common)), rng.normal(size=(37, 3))
    bounds = np.array([furthest, furthest, 0.5])
    return RecordingSystem(r, J, P, rng.uniform(-0.2, 0.2, 2), bounds, channels=3)


@pytest.mark.parametrize("furthest", [0.1, 0.3, 9.0])
def test_a_recording_in_few_rows_has_the_same_chi_squared(furthest):
    rng = np.random.default_rng(1)
    whole = recording(rng, 2, furthest)
    few = whole.compressed()
    assert few.r.shape == (2 + 3 + 1,)
    for z in rng.normal(size=(20, 2)):
        assert_allclose(few.moved(z).chi_squared, whole.moved(z).chi_squared, rtol=1e-9)
        assert_allclose(few.eliminated().at(z), whole.eliminated().at(z), rtol=1e-9)


def brute(r: Vector, P: Matrix, begun: Vector, prior: Vector, bounds: Vector) -> float:
    """Least of |r + P l|^2 + prior (begun + l)^2 within bounds of begun + l, by SciPy."""
    matrix = np.vstack([P, np.diag(np.sqrt(prior))])
    right = np.concatenate([r, np.sqrt(prior) * begun])
    solution = lsq_linear(matrix, -right, (-bounds - begun, bounds - begun), tol=1e-13)
    return 2.0 * float(solution.cost)


@pytest.mark.parametrize("furthest", [0.25, 0.6, 9.0])
def test_tolerances_follow_a_step_as_far_as_their_bounds(furthest):
    rng = np.random.default_rng(2)
    one = recording(rng, 2, furthest)
    begun, prior = np.append(one.deviations, 0.0), np.array([1.0, 1.0, 0.0])
    for z in rng.normal(size=(20, 2)):
        least = brute(one.r + one.J @ z, one.P, begun, prior, one.furthest)
        moved = one.moved(z)
        assert_allclose(moved.chi_squared, least, **NEAR)
        assert np.abs(moved.deviations).max() <= furthest + 1e-9


def rival(rng: np.random.Generator, furthest: float) -> Rival:
    """Two recordings on a dry rail and two on a wet one."""
    systems = []
    for other in (2, 2, 1, 1):
        one = recording(rng, 3, furthest)
        one.J[:, other] = 0.0
        systems.append(one.compressed())
    N = np.diag([0.0, SIGMA**-2, SIGMA**-2])
    prior = Quadratic(N, np.array([0.0, 0.0, AWAY / SIGMA]), AWAY**2, 0)
    return Rival(("effect",), {SIZE: 1.0}, {DRY: 0.3, WET: 0.1}, tuple(systems), prior, 0.0)


# What has met a bound is not let go again, as a solver does that frees it where others have moved.
@pytest.mark.parametrize(("furthest", "above"), [(0.3, 1e-3), (9.0, 1e-6)])
def test_recordings_so_far_hold_the_unknowns_of_new_ones(furthest, above):
    """Reference: all of them side by side, with what new ones do not have among their own."""
    one = rival(np.random.default_rng(3), furthest)
    shared = (SIZE, ("friction", "greasy"), DRY)
    so_far = one.so_far(shared, 3.0)
    assert_allclose(so_far.chi_squared, one.chi_squared, rtol=1e-12)
    # Side by side: the friction that new ones lack, then the three own unknowns of each recording.
    P = np.zeros((4 * 7, 1 + 4 * 3))
    for k, system in enumerate(one.recordings):
        P[7 * k : 7 * k + 7, 0] = system.J[:, 2] * SIGMA
        P[7 * k : 7 * k + 7, 1 + 3 * k : 4 + 3 * k] = system.P
    begun = np.concatenate([[AWAY], *(np.append(o.deviations, 0.0) for o in one.recordings)])
    prior = np.append(1.0, np.tile([1.0, 1.0, 0.0], 4))
    bounds = np.concatenate([[3.0], *(o.furthest for o in one.recordings)])
    r = np.concatenate([o.r for o in one.recordings])
    J = np.vstack([o.J for o in one.recordings])
    for size, dry, greasy in np.random.default_rng(4).normal(size=(20, 3)):
        least = brute(r + J @ [size, dry, 0.0], P, begun, prior, bounds)
        found = so_far.moved(np.array([size, greasy, dry])).chi_squared
        assert least * (1.0 - 1e-6) <= found <= least * (1.0 + above)


def test_information_is_that_of_all_recordings_and_of_what_was_known():
    one = rival(np.random.default_rng(5), 9.0)
    keys = (*one.sizes, *one.levels)
    joint = Joint(keys, keys, tuple(one.levels), one.recordings, one.prior)
    assert_allclose(one.information, joint.total().N, rtol=1e-12)
    # Of all unknowns that new recordings have too, nothing is eliminated.
    held = one.so_far(keys, 3.0).eliminated().N + one.prior.N
    assert_allclose(held, one.information, rtol=1e-9, atol=1e-9)
