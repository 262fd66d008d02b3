"""Tuning: it finds what was planted, wastes nothing, and judges what it has found."""

import json
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.observers import Gains, estimators_of
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.gains import format_gains, read_gains, usual_gains
from workbench.observers.replay import replay
from workbench.observers.score import score
from workbench.observers.simulation import prepare
from workbench.runtime.files import write_whole
from workbench.system.registry import open_model
from workbench.system.system import System
from workbench.tuning import (
    Candidate,
    Checkpointing,
    Plan,
    Search,
    TuningResult,
    cross_validate,
    evaluate_all,
    evaluate_gains,
    pose,
    recording,
    search,
    sensitivities,
    summarise_tuning,
    tunable,
)
from workbench.tuning.checkpoint import Population

from .processes import comes_true, living, running
from .recordings import write_beginnings

FASTEST = 200.0  # [rad/s] that the samples of a recording carry


# --- the algorithm ---


@pytest.mark.long
def test_planted_gains_are_found(system, prepare, stop_beginnings, inline, tmp_path):
    """The force is replaced by what known gains estimate, so that these have z = 0."""
    name = "parameter_estimator"
    cls = estimators_of(system)[name]
    with open_model(system, cls.role) as fmu:
        reasoned = cls.default_gains(fmu, system)
        planted = reasoned.values * [1, 1, 0.5, 2, 1, 2, 1, 0.5]
        estimator = cls(fmu, system, reasoned.with_values(planted))
        forces = [replay(case, estimator).signal("Fx") for case in stop_beginnings]
    pairs = zip(stop_beginnings, forces, strict=True)
    problem = prepare(name, [case.with_signals({"Fx": force}) for case, force in pairs])
    job = replace(problem.job, system=judging_force_alone(system))
    everything = range(len(forces))
    pool = inline(job)
    plan = Plan(80, 5, seed=2)
    tuned = search(
        pool, job, problem.space, everything, plan, Checkpointing(tmp_path / "checkpoint.json")
    )
    assert tuned.z < 0.02 * evaluate_gains(pool, job, [reasoned.values]).max()
    # Columns that decide about the force; a tenth is what is left of z over its slope.
    assert_allclose(tuned.best[[3, 5, 7]], planted[[3, 5, 7]], rtol=0.1)


def judging_force_alone(system: System) -> System:
    weights = {"omegaW": 0.0, "omegaR": 0.0, "Fx": 1e-3}
    return replace(system, objective=replace(system.objective, weights=weights))


# --- the search space ---


@pytest.mark.parametrize("name", ["disturbance_observer", "parameter_estimator", "ekf"])
def test_search_starts_at_the_reasoned_gains(prepare, stop_beginnings, name):
    problem = prepare(name, stop_beginnings[:1])
    gains, space = problem.job.gains, problem.space
    # Rounding of sinh(asinh), with arguments up to 30.
    assert_allclose(space.gains(space.start), gains.values, rtol=1e-12, atol=1e-12)
    assert not space.at_bound(space.start).any()
    assert len(gains.names) == gains.values.size


def test_every_gain_of_the_observer_reaches_both_signs_and_no_disturbance_grows(problem):
    space = problem.space
    lower, upper = space.gains(np.zeros(18)), space.gains(np.ones(18))
    assert (lower < 0.0).all()
    assert (upper[:16] > 0.0).all()
    assert_array_equal(upper[16:], 0.0)
    assert_array_equal(space.gains(np.full(18, 0.5))[:16], 0.0)


def test_bounds_are_the_loops_that_samples_can_carry(problem):
    """A gain of a speed on itself: 1/h; one of omegaW on muDC: the loop's frequency is 1/h."""
    effect = np.abs(problem.job.gains.design["effect"])
    largest = problem.space.gains(np.ones(18)).reshape(-1)
    assert_allclose(largest[0], FASTEST, rtol=1e-12)
    assert_allclose(np.sqrt(effect[1] * largest[12]), FASTEST, rtol=1e-9)


# --- the cost ---


def test_cost_is_z_of_the_objective(problem, pool, system, minimal, stop_beginnings):
    gains = problem.job.gains
    z_k = evaluate_gains(pool, problem.job, [gains.values])[0]
    estimator = DisturbanceObserver(minimal, system, gains)
    expected = [score(c, replay(c, estimator), system).z for c in stop_beginnings]
    # The same terms, added in another order: 1200 roundings.
    assert_allclose(z_k, expected, rtol=1e-12)


def test_a_case_without_force_is_refused(system, stop_beginnings):
    with pytest.raises(InputError, match="no column 'Fx'"):
        recording(stop_beginnings[0].without(["Fx"]), system)


def test_a_lost_candidate_is_dropped_where_it_has_lost(problem, pool):
    job = problem.job
    values = job.gains.values
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


def test_unstable_candidates_are_counted_and_cost_little(problem, pool):
    """The roller's deviation fed back with the wrong sign, as fast as the samples allow."""
    job = problem.job
    values = job.gains.values.copy()
    values[[0, 5]] = -0.99 * FASTEST
    [evaluation] = evaluate_all(pool, [Candidate(values, np.inf, (1, 0, 2))], 3)
    assert evaluation.z == np.inf
    assert evaluation.unstable == 1
    assert evaluation.samples <= job.recordings[1].steps.size


# --- validation ---


def test_folds_are_judged_by_gains_that_have_not_seen_them(
    system, problem, pool, stop_beginnings, minimal, tmp_path
):
    job, space = problem.job, problem.space
    plan = Plan(generations=1, population=1, seed=3)
    seen: list[Sequence[int]] = []

    def tune(number: int, on: Sequence[int]) -> Search | None:
        seen.append(on)
        return search(pool, job, space, on, plan, Checkpointing(tmp_path / f"{number}.json"))

    reasoned = job.gains.values
    folds = cross_validate(pool, job, stop_beginnings, 3, tune)
    assert seen == [[1, 2], [0, 2], [0, 1]]
    z_k = evaluate_gains(pool, job, [reasoned])[0]
    assert [fold.cases for fold in folds] == [(r.name,) for r in job.recordings]
    assert_array_equal([fold.reasoned for fold in folds], z_k)
    assert all(np.isfinite(fold.tuned) for fold in folds)
    observer = DisturbanceObserver.untuned(minimal, system)
    for fold, case in zip(folds, stop_beginnings, strict=True):
        assert fold.error_reasoned == score(case, replay(case, observer), system).nrmse
    # Held-out force is judged by the gains that were found, not by the reasoned ones.
    assert all(0.0 < fold.error != fold.error_reasoned for fold in folds)


def test_a_gain_without_effect_does_not_matter(problem, pool, tmp_path):
    """A decay of 0.02 1/s forgets 12 % of a deviation in 6 s; L42 is the loop of muDC."""
    job, space = problem.job, problem.space
    plan = Plan(generations=1, population=1, seed=3)
    tuned = search(
        pool, job, space, range(len(job.recordings)), plan, Checkpointing(tmp_path / "c.json")
    )
    matters = {e.gain: e.matters for e in sensitivities(pool, job, space, tuned)}
    assert matters["L42"]
    assert not matters["T_muWR"]


def test_gains_are_as_good_as_the_last_candidates_that_lose_one_percent_at_most(
    problem, pool, tmp_path
):
    job, space = problem.job, problem.space
    plan = Plan(generations=0, population=1, seed=3)
    ended = search(
        pool, job, space, range(len(job.recordings)), plan, Checkpointing(tmp_path / "c.json")
    )
    assert not ended.converged
    members = np.tile(ended.coordinates, (3, 1))
    members[:, 0] = 0.55, 0.65, 0.95
    last = Population(members, ended.z * np.array([1.0, 1.009, 1.011]), ended.last.z_k[:3])
    tuned = TuningResult(problem, plan, replace(ended, last=last), ended.z_k, interrupted=False)
    summary = summarise_tuning(tuned)
    assert (summary["work"]["as_good"], summary["work"]["last"]) == (2, 3)
    assert_allclose(summary["gains"]["L11"]["as_good"], space.gains(members)[:2, 0])
    low, high = summary["gains"]["L21"]["as_good"]
    assert low == high == ended.best[job.gains.names.index("L21")]


# --- what gains are judged by ---


def test_without_a_load_cell_gains_are_judged_as_with_one(system, stop_beginnings, inline):
    """What a sensor and the smoother differ by is added to every z: what gains change is alike.

    3e-3 is a mean of 3 N, of forces of 10 kN; the observer gains up to 42 N by being tuned.
    """
    name = "disturbance_observer"
    measured = pose(system, name, stop_beginnings, {}).job
    blind = [case.without(["Fx"]) for case in stop_beginnings]
    estimated = pose(system, name, blind, {}, "smoother").job
    with open_model(system) as fmu:
        tuned = usual_gains(estimators_of(system)[name], fmu, system).values
    candidates = [measured.gains.values, tuned]
    z = [evaluate_gains(inline(job), job, candidates) for job in (measured, estimated)]
    by_cell, by_smoother = (after - before for before, after in z)
    assert_allclose(by_smoother, by_cell, rtol=0.0, atol=3e-3)
    assert by_cell.min() < -0.03


def test_what_is_judged_by_must_know_the_whole_recording(system, stop_beginnings):
    with pytest.raises(InputError, match=r"knows whole recordings.* expected one of smoother"):
        pose(system, "disturbance_observer", stop_beginnings, {}, "ekf")


# --- the command ---


# --- gains.toml ---


def default_gains(system: System, name: str) -> Gains:
    cls = tunable(system, name)
    with open_model(system, cls.role) as fmu:
        return cls.default_gains(fmu, system)


@pytest.mark.parametrize("name", ["disturbance_observer", "parameter_estimator", "ekf", "ukf"])
def test_gains_read_back_to_the_bit(system, tmp_path, name):
    gains = default_gains(system, name)
    provenance = {"z": 0.1, "cases": ['a "b"'], "z_k": {"a.b": 1}}
    path = tmp_path / "gains.toml"
    path.write_text(format_gains(gains, tunable(system, name).meaning, provenance))
    # Values to read into are not those that were written.
    read = read_gains(path, {name: gains.with_values(np.zeros(gains.values.size))})
    assert read.estimator == name
    assert read.names == gains.names
    assert_array_equal(read.values, gains.values)
    assert set(read.design) == set(gains.design)
    for constant, values in gains.design.items():
        assert_array_equal(read.design[constant], values)


@pytest.mark.parametrize(
    "name", ['a "quoted" one', "back\\slash", "two\nlines", "a'b", 'x"""', "é"]
)
def test_gains_tuned_on_cases_of_any_name_can_be_read_back(tmp_path, name):
    gains = Gains("ekf", ("a", "b"), np.array([0.1, 1e-300]), {}, "")
    came_from = {"cases": [name], "z_k": {name: 0.1}, "fmu": {"file": name}}
    path = tmp_path / "gains.toml"
    write_whole(path, format_gains(gains, name, came_from))
    assert_array_equal(read_gains(path, {"ekf": gains}).values, gains.values)
    assert tomllib.loads(path.read_text())["provenance"] == came_from


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("gains = ", "text that is no TOML"),
        ("[gains]", "estimator = None"),
        ('estimator = "ekf"\n[gains]\nmodel = 1', r"no omegaW in \[gains\]"),
        (
            'estimator = "parameter_estimator"\n[gains]\n'
            + "".join(f"L{i}{j} = 1\n" for i in (1, 2) for j in (1, 2, 3, 4)),
            "effect = None",
        ),
    ],
)
def test_a_wrong_file_of_gains_is_refused(system, tmp_path, text, match):
    path = tmp_path / "gains.toml"
    path.write_text(text)
    known = {name: default_gains(system, name) for name in ("ekf", "parameter_estimator")}
    with pytest.raises(InputError, match=match):
        read_gains(path, known)


# --- as a user runs it ---


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root) -> Path:
    """Two short recordings."""
    return write_beginnings(tmp_path_factory.mktemp("cases"))


def command(folder: Path, out: Path, *options: str) -> list[str]:
    search = ["--cases", str(folder), "--budget", "6", "--population", "4", "--workers", "1"]
    return ["tune", "parameter_estimator", *search, "--out", str(out), *options]


def test_a_run_that_is_killed_resumes_to_the_result_of_one_that_is_not(
    root, folder, tmp_path, monkeypatch
):
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    checkpoint = killed / "checkpoint.json"
    with running("-m", "workbench", *command(folder, killed)) as master:
        assert comes_true(checkpoint.exists)
        assert len(living(master.pid)) > 1
        master.kill()
    assert comes_true(lambda: not living(master.pid))
    # As if it had been killed inside a checkpoint, which is written beside and then renamed.
    checkpoint.with_name("checkpoint.json.part").write_bytes(checkpoint.read_bytes()[:1000])
    assert len(json.loads(checkpoint.read_text())["history"]) < 7
    monkeypatch.chdir(root)
    assert main(command(folder, killed, "--resume")) == 0
    assert main(command(folder, whole)) == 0
    assert (killed / "gains.toml").read_bytes() == (whole / "gains.toml").read_bytes()


def test_results_keep_their_contract(root, system, folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(root)
    assert main(command(folder, tmp_path, "--folds", "2", "--budget", "2", "--live")) == 0
    printed, progress = capsys.readouterr()
    assert "evaluations/s" in progress
    assert "of work saved" in progress
    assert "not seen: 03_dry_120_3.6" in printed
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert set(summary["gains"]) == {f"L{i}{j}" for i in (1, 2) for j in (1, 2, 3, 4)}
    assert summary["z"] == max(case["z_k"] for case in summary["cases"].values())
    assert summary["z"] <= summary["z_reasoned"]
    assert len(summary["folds"]) == 2
    assert len(summary["provenance"]["fmu"]["sha256"]) == 64
    path = tmp_path / "gains.toml"
    gains = read_gains(path, {"parameter_estimator": default_gains(system, "parameter_estimator")})
    assert_array_equal(gains.values, [g["value"] for g in summary["gains"].values()])
    for name in ("convergence.png", "cases.png"):
        assert (tmp_path / name).stat().st_size > 10_000
    assert not list(tmp_path.glob("*.part"))
    cls = tunable(system, "parameter_estimator")
    assert_array_equal(prepare(system, {cls.name: cls}, path).gains[cls.name].values, gains.values)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (["--folds", "3"], "3 with 2 cases"),
        (["--fmu", "README.md"], "no FMU"),
        (["--cluster", "tcp://127.0.0.1:1"], "--cluster"),
    ],
)
def test_a_users_mistake_gives_status_2_and_a_message(
    root, folder, tmp_path, monkeypatch, capsys, options, match
):
    monkeypatch.chdir(root)
    assert main(command(folder, tmp_path, *options)) == 2
    captured = capsys.readouterr().err
    assert match in captured
    assert "Traceback" not in captured
