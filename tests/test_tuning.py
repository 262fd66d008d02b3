"""Tuning: it finds what was planted, wastes nothing, and judges what it has found."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.case import Case
from workbench.cosim import observe
from workbench.errors import InputError
from workbench.fmu import FMU
from workbench.objective import Weights, score
from workbench.observers import DisturbanceObserver, ParameterEstimator
from workbench.pool import Pool
from workbench.tuning import (
    Candidate,
    Evaluator,
    Job,
    Plan,
    Search,
    SearchSpace,
    cross_validate,
    evaluate_all,
    evaluate_gains,
    from_vector,
    gain_names,
    reasoned_gains,
    recording,
    search,
    sensitivities,
    to_vector,
)

FASTEST = 200.0  # [rad/s] that the samples of a recording carry


# --- the algorithm ---


def test_planted_gains_are_found(
    root: Path,
    prepare: Callable[..., tuple[Job, SearchSpace]],
    stop_beginnings: list[Case],
    inline: Callable[[Job], Pool[Evaluator]],
    tmp_path: Path,
) -> None:
    """The force is replaced by what known gains estimate, so that these have z = 0."""
    path = root / "fmus" / "fmi2" / "FullObserver.fmu"
    with FMU(path) as fmu:
        reasoned = reasoned_gains("parameter_estimator", fmu)
        planted = from_vector(reasoned, to_vector(reasoned) * [1, 1, 0.5, 2, 1, 2, 1, 0.5])
        estimator = ParameterEstimator(fmu, planted)
        forces = [observe(case, estimator).signal("Fx") for case in stop_beginnings]
    made = [replace(case, Fx=force) for case, force in zip(stop_beginnings, forces, strict=True)]
    job, space = prepare("parameter_estimator", path, made)
    job = replace(job, weights=Weights(cW=0.0, cR=0.0))
    everything = range(len(made))
    pool = inline(job)
    found = search(pool, job, space, everything, Plan(80, 5, seed=2), tmp_path / "checkpoint.json")
    assert found is not None
    z_reasoned = evaluate_gains(pool, job, [to_vector(reasoned)]).max()
    assert found.z < 0.02 * z_reasoned
    wanted = to_vector(planted)
    # Columns that decide about the force; a tenth is what is left of z over its slope.
    assert_allclose(found.best[[3, 5, 7]], wanted[[3, 5, 7]], rtol=0.1)


# --- the search space ---


@pytest.mark.parametrize("name", ["disturbance_observer", "parameter_estimator", "ekf"])
def test_search_starts_at_the_reasoned_gains(
    root: Path,
    prepare: Callable[..., tuple[Job, SearchSpace]],
    stop_beginnings: list[Case],
    name: str,
) -> None:
    model = "FullObserver" if name == "parameter_estimator" else "MinimalObserver"
    job, space = prepare(name, root / "fmus" / "fmi2" / f"{model}.fmu", stop_beginnings[:1])
    reasoned = to_vector(job.gains)
    # Rounding of sinh(asinh), with arguments up to 30.
    assert_allclose(space.gains(space.start), reasoned, rtol=1e-12, atol=1e-12)
    assert not space.at_bound(space.start).any()
    assert len(gain_names(job.gains)) == reasoned.size


def test_every_gain_of_the_observer_reaches_both_signs_and_no_disturbance_grows(
    problem: tuple[Job, SearchSpace],
) -> None:
    _, space = problem
    lower, upper = space.gains(np.zeros(18)), space.gains(np.ones(18))
    assert (lower < 0.0).all()
    assert (upper[:16] > 0.0).all()
    assert_array_equal(upper[16:], 0.0)
    assert_array_equal(space.gains(np.full(18, 0.5))[:16], 0.0)


def test_bounds_are_the_loops_that_samples_can_carry(problem: tuple[Job, SearchSpace]) -> None:
    """A gain of a speed on itself: 1/h; one of omegaW on muDC: the loop's frequency is 1/h."""
    job, space = problem
    effect = np.abs(job.gains.effect)  # type: ignore[union-attr]
    largest = space.gains(np.ones(18)).reshape(-1)
    assert_allclose(largest[0], FASTEST, rtol=1e-12)
    assert_allclose(np.sqrt(effect[1] * largest[12]), FASTEST, rtol=1e-9)


# --- the cost ---


def test_cost_is_z_of_the_objective(
    problem: tuple[Job, SearchSpace],
    pool: Pool[Evaluator],
    minimal: FMU,
    stop_beginnings: list[Case],
) -> None:
    job, _ = problem
    gains = job.gains
    z_k = evaluate_gains(pool, job, [to_vector(gains)])[0]
    estimator = DisturbanceObserver(minimal, gains)  # type: ignore[arg-type]
    expected = [score(c, observe(c, estimator), 0.7, Weights()).z for c in stop_beginnings]
    # The same terms, added in another order: 1200 roundings.
    assert_allclose(z_k, expected, rtol=1e-12)


def test_a_case_without_force_is_refused(stop_beginnings: list[Case]) -> None:
    with pytest.raises(InputError, match="no column 'Fx'"):
        recording(replace(stop_beginnings[0], Fx=None))


def test_a_lost_candidate_is_dropped_where_it_has_lost(
    problem: tuple[Job, SearchSpace], pool: Pool[Evaluator]
) -> None:
    job, _ = problem
    values = to_vector(job.gains)
    cases = len(job.recordings)
    order = tuple(range(cases))
    [whole] = evaluate_all(pool, [Candidate(values, np.inf, order)], cases)
    [kept] = evaluate_all(pool, [Candidate(values, whole.z, order)], cases)
    [lost] = evaluate_all(pool, [Candidate(values, np.nextafter(whole.z, 0), order)], cases)
    first_case = job.recordings[0].steps.size
    [early] = evaluate_all(pool, [Candidate(values, 0.01 * whole.z, order)], cases)
    assert kept.z == whole.z
    assert (lost.z, lost.unstable) == (np.inf, -1)
    assert early.samples < first_case


def test_unstable_candidates_are_counted_and_cost_little(
    problem: tuple[Job, SearchSpace], pool: Pool[Evaluator]
) -> None:
    """The roller's deviation fed back with the wrong sign, as fast as the samples allow."""
    job, _ = problem
    values = to_vector(job.gains)
    values[[0, 5]] = -0.99 * FASTEST
    [evaluation] = evaluate_all(pool, [Candidate(values, np.inf, (1, 0, 2))], 3)
    assert evaluation.z == np.inf
    assert evaluation.unstable == 1
    assert evaluation.samples <= job.recordings[1].steps.size


# --- validation ---


def test_folds_are_judged_by_gains_that_have_not_seen_them(
    root: Path,
    problem: tuple[Job, SearchSpace],
    pool: Pool[Evaluator],
    stop_beginnings: list[Case],
    tmp_path: Path,
) -> None:
    job, space = problem
    plan = Plan(generations=1, population=1, seed=3)
    seen: list[Sequence[int]] = []

    def tune(number: int, on: Sequence[int]) -> Search | None:
        seen.append(on)
        return search(pool, job, space, on, plan, tmp_path / f"{number}.json")

    reasoned = to_vector(job.gains)
    folds = cross_validate(pool, job, stop_beginnings, reasoned, 3, tune)
    assert seen == [[1, 2], [0, 2], [0, 1]]
    z_k = evaluate_gains(pool, job, [reasoned])[0]
    assert [fold.cases for fold in folds] == [(r.name,) for r in job.recordings]
    assert_array_equal([fold.reasoned for fold in folds], z_k)
    assert all(np.isfinite(fold.tuned) for fold in folds)
    with FMU(root / "fmus" / "fmi2" / "MinimalObserver.fmu") as fmu:
        observer = DisturbanceObserver(fmu, reasoned_gains(job.estimator, fmu))
        for fold, case in zip(folds, stop_beginnings, strict=True):
            expected = score(case, observe(case, observer), fmu.defaults["rR"], Weights())
            assert fold.force_reasoned == expected.Fx_nrmse
    # Held-out force is judged by the gains that were found, not by the reasoned ones.
    assert all(0.0 < fold.force != fold.force_reasoned for fold in folds)


def test_a_gain_without_effect_does_not_matter(
    problem: tuple[Job, SearchSpace], pool: Pool[Evaluator], tmp_path: Path
) -> None:
    """A decay of 0.02 1/s forgets 12 % of a deviation in 6 s; L42 is the loop of muDC."""
    job, space = problem
    plan = Plan(generations=1, population=1, seed=3)
    found = search(pool, job, space, range(len(job.recordings)), plan, tmp_path / "c.json")
    assert found is not None
    matters = {e.gain: e.matters for e in sensitivities(pool, job, space, found)}
    assert matters["L42"]
    assert not matters["T_WR"]
