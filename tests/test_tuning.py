"""Tuning: it finds what was planted, wastes nothing, and loses nothing."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import differential_evolution, rosen

from workbench.__main__ import main
from workbench.case import Case, read_case
from workbench.commands.arguments import FULL_OBSERVER, MINIMAL_OBSERVER
from workbench.cosim import observe
from workbench.errors import InputError
from workbench.fmu import FMU
from workbench.objective import Weights, score
from workbench.observers import (
    DisturbanceObserver,
    FilterNoise,
    ParameterEstimator,
    reasoned_settings,
)
from workbench.tuning import (
    Job,
    Plan,
    ProcessPool,
    Search,
    SearchSpace,
    cross_validate,
    format_gains,
    from_vector,
    gain_names,
    judge_gains,
    read_gains,
    reasoned_gains,
    recording,
    search,
    search_space,
    sensitivities,
    to_vector,
    with_tuned,
)
from workbench.tuning.checkpoint import load
from workbench.tuning.cost import Bench, Candidate, Verdict
from workbench.tuning.evolution import first, latin_hypercube, propose, select
from workbench.tuning.search import identity
from workbench.tuning.workers import judge_all

CASES = ("03_dry_120_3.6", "08_wet_120_3.6", "10_wet_100_2.7_rev")
SAMPLES = slice(700, 1900)  # 6 s: first pressure and the beginning of the stop
SLOWEST, FASTEST = 1 / 40, 200.0


class Inline:
    """A pool of this process alone; may lose tasks that hold certain candidates."""

    size = 1
    deaths: tuple[type[BaseException], ...] = (BrokenExecutor,)

    def __init__(self, job: Job) -> None:
        self._bench = Bench(job)
        self.deadly: set[float] = set()
        self.submitted: list[list[float]] = []

    def submit(self, candidates: Sequence[Candidate]) -> "Future[list[Verdict]]":
        future: Future[list[Verdict]] = Future()
        firsts = [float(c.values[0]) for c in candidates]
        self.submitted.append(firsts)
        if self.deadly & set(firsts):
            future.set_exception(BrokenExecutor("a worker died"))
        else:
            future.set_result([self._bench.judge(c) for c in candidates])
        return future

    def close(self) -> None:
        self._bench.close()


@pytest.fixture(scope="module")
def cases(root: Path) -> list[Case]:
    cut = []
    for name in CASES:
        case = read_case(root / "cases" / name)
        signals = {s: getattr(case, s)[SAMPLES] for s in ("time", "pB", "tauR", "omegaW", "omegaR")}
        assert case.Fx is not None
        cut.append(replace(case, **signals, Fx=case.Fx[SAMPLES]))
    return cut


def prepare(name: str, path: Path, cases: Sequence[Case]) -> tuple[Job, SearchSpace]:
    with FMU(path) as fmu:
        gains = reasoned_gains(name, fmu)
        space = search_space(fmu, gains, SLOWEST, FASTEST)
    return Job(name, path.read_bytes(), {}, gains, tuple(map(recording, cases)), Weights()), space


@pytest.fixture(scope="module")
def problem(minimal_path: Path, cases: list[Case]) -> tuple[Job, SearchSpace]:
    return prepare("disturbance_observer", minimal_path, cases)


@pytest.fixture
def pool(problem: tuple[Job, SearchSpace]) -> Iterator[Inline]:
    inline = Inline(problem[0])
    yield inline
    inline.close()


SMALL = Plan(generations=4, population=1, seed=3)


# --- the algorithm ---


def test_generations_are_those_of_scipy_bit_for_bit() -> None:
    """Reference: SciPy's differential_evolution with the same random numbers."""
    n, generations, size = 4, 25, 20
    path: list[np.ndarray] = []
    differential_evolution(
        rosen,
        [(0.0, 1.0)] * n,
        rng=np.random.default_rng(5),
        popsize=size // n,
        maxiter=generations,
        tol=0.0,
        polish=False,
        updating="deferred",
        callback=lambda intermediate_result: path.append(intermediate_result.x.copy()),
    )

    def judged(members: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # SciPy's way from 0..1 to the bounds 0..1 rounds.
        z = np.array([rosen(0.5 + (x - 0.5)) for x in members])
        return z, z[:, np.newaxis]

    rng = np.random.default_rng(5)
    members = latin_hypercube(size, np.zeros(n), np.ones(n), rng)
    population = first(members, *judged(members))
    for expected in path:
        trials, order = propose(population, rng)
        population = select(population, trials, *judged(trials), order)
        assert_array_equal(0.5 + (population.members[0] - 0.5), expected)
    assert len(path) == generations


def test_planted_gains_are_found(root: Path, cases: list[Case], tmp_path: Path) -> None:
    """The force is replaced by what known gains estimate, so that these have z = 0."""
    path = root / "fmus" / "fmi2" / "FullObserver.fmu"
    with FMU(path) as fmu:
        reasoned = reasoned_gains("parameter_estimator", fmu)
        planted = from_vector(reasoned, to_vector(reasoned) * [1, 1, 0.5, 2, 1, 2, 1, 0.5])
        estimator = ParameterEstimator(fmu, planted)
        forces = [observe(case, estimator).signal("Fx") for case in cases]
    made = [replace(case, Fx=force) for case, force in zip(cases, forces, strict=True)]
    job, space = prepare("parameter_estimator", path, made)
    job = replace(job, weights=Weights(cW=0.0, cR=0.0))
    everything = range(len(made))
    inline = Inline(job)
    try:
        found = search(
            inline, job, space, everything, Plan(80, 5, seed=2), tmp_path / "checkpoint.json"
        )
        assert found is not None
        z_reasoned = judge_gains(inline, job, [to_vector(reasoned)]).max()
    finally:
        inline.close()
    assert found.z < 0.02 * z_reasoned
    wanted = to_vector(planted)
    # Columns that decide about the force; a tenth is what is left of z over its slope.
    assert_allclose(found.best[[3, 5, 7]], wanted[[3, 5, 7]], rtol=0.1)


# --- the search space ---


@pytest.mark.parametrize("name", ["disturbance_observer", "parameter_estimator", "ekf"])
def test_search_starts_at_the_reasoned_gains(root: Path, cases: list[Case], name: str) -> None:
    model = "FullObserver" if name == "parameter_estimator" else "MinimalObserver"
    job, space = prepare(name, root / "fmus" / "fmi2" / f"{model}.fmu", cases[:1])
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
    problem: tuple[Job, SearchSpace], pool: Inline, minimal: FMU, cases: list[Case]
) -> None:
    job, _ = problem
    gains = job.gains
    z_k = judge_gains(pool, job, [to_vector(gains)])[0]
    estimator = DisturbanceObserver(minimal, gains)  # type: ignore[arg-type]
    expected = [score(c, observe(c, estimator), 0.7, Weights()).z for c in cases]
    # The same terms, added in another order: 1200 roundings.
    assert_allclose(z_k, expected, rtol=1e-12)


def test_a_case_without_force_is_refused(cases: list[Case]) -> None:
    with pytest.raises(InputError, match="no column 'Fx'"):
        recording(replace(cases[0], Fx=None))


def test_a_lost_candidate_is_dropped_where_it_has_lost(
    problem: tuple[Job, SearchSpace], pool: Inline
) -> None:
    job, _ = problem
    values = to_vector(job.gains)
    order = tuple(range(len(CASES)))
    [whole] = judge_all(pool, [Candidate(values, np.inf, order)], len(CASES))
    [kept] = judge_all(pool, [Candidate(values, whole.z, order)], len(CASES))
    [lost] = judge_all(pool, [Candidate(values, np.nextafter(whole.z, 0), order)], len(CASES))
    first_case = job.recordings[0].steps.size
    [early] = judge_all(pool, [Candidate(values, 0.01 * whole.z, order)], len(CASES))
    assert kept.z == whole.z
    assert (lost.z, lost.unstable) == (np.inf, -1)
    assert early.samples < first_case


def test_unstable_candidates_are_counted_and_cost_little(
    problem: tuple[Job, SearchSpace], pool: Inline
) -> None:
    """The roller's deviation fed back with the wrong sign, as fast as the samples allow."""
    job, _ = problem
    values = to_vector(job.gains)
    values[[0, 5]] = -0.99 * FASTEST
    [verdict] = judge_all(pool, [Candidate(values, np.inf, (1, 0, 2))], len(CASES))
    assert verdict.z == np.inf
    assert verdict.unstable == 1
    assert verdict.samples <= job.recordings[1].steps.size


# --- economy, reproducibility ---


def run(
    pool: object, problem: tuple[Job, SearchSpace], path: Path, plan: Plan, **options
) -> Search:
    job, space = problem
    found = search(pool, job, space, range(len(job.recordings)), plan, path, **options)
    assert found is not None
    return found


def test_economy_changes_nothing_but_the_work(
    problem: tuple[Job, SearchSpace], pool: Inline, tmp_path: Path
) -> None:
    plan = replace(SMALL, generations=8)
    thrifty = run(pool, problem, tmp_path / "a.json", plan)
    full = run(pool, problem, tmp_path / "b.json", replace(plan, economy=False))
    mark = identity(*problem, range(3), plan)
    a, b = (load(tmp_path / name, mark) for name in ("a.json", "b.json"))
    assert a is not None
    assert b is not None
    for name in ("members", "z", "z_k", "order"):
        assert_array_equal(getattr(a.population, name), getattr(b.population, name))
    assert a.rng == b.rng
    assert_array_equal(thrifty.best, full.best)
    assert sum(g.samples for g in thrifty.history) < 0.8 * sum(g.samples for g in full.history)
    assert thrifty.z < thrifty.history[0].z


def test_gains_do_not_depend_on_the_number_of_workers_nor_on_the_death_of_one(
    problem: tuple[Job, SearchSpace], pool: Inline, tmp_path: Path
) -> None:
    """One process of two is killed while it works."""
    job, _ = problem
    alone = run(pool, problem, tmp_path / "alone.json", SMALL)
    two = ProcessPool(job, 2, 60.0)
    killed = []

    def kill_once(history: Sequence[object]) -> None:
        if not killed:
            killed.append(next(iter(two._executor._processes)))
            os.kill(killed[0], signal.SIGKILL)

    try:
        found = run(two, problem, tmp_path / "two.json", SMALL, report=kill_once)
    finally:
        two.close()
    assert killed
    assert_array_equal(found.best, alone.best)
    assert_array_equal(found.z_k, alone.z_k)


def test_a_cluster_finds_the_same_gains(
    problem: tuple[Job, SearchSpace], pool: Inline, tmp_path: Path
) -> None:
    distributed = pytest.importorskip("distributed")
    from workbench.tuning.cluster import DaskPool

    job, _ = problem
    alone = run(pool, problem, tmp_path / "alone.json", SMALL)
    options = {"n_workers": 1, "threads_per_worker": 2, "dashboard_address": None}
    with distributed.LocalCluster(processes=False, **options) as cluster:
        remote = DaskPool(job, cluster.scheduler_address, 60.0)
        try:
            found = run(remote, problem, tmp_path / "remote.json", SMALL)
        finally:
            remote.close()
    assert_array_equal(found.best, alone.best)


def test_a_candidate_that_hangs_ends_its_worker_and_is_infinitely_bad(
    problem: tuple[Job, SearchSpace],
) -> None:
    job, _ = problem
    endless = (0,) * 100_000  # at 1 ms a case, two minutes
    hasty = ProcessPool(job, 1, 0.3)
    try:
        [verdict] = judge_all(hasty, [Candidate(to_vector(job.gains), np.inf, endless)], 3)
    finally:
        hasty.close()
    assert verdict.crashed
    assert verdict.z == np.inf


def test_only_the_candidate_that_kills_workers_is_lost(
    problem: tuple[Job, SearchSpace], pool: Inline
) -> None:
    _, space = problem
    values = [space.gains(np.clip(space.start + 0.001 * i, 0, 1)) for i in range(40)]
    candidates = [Candidate(v, np.inf, (0, 1, 2)) for v in values]
    undisturbed = judge_all(pool, candidates, 3)
    pool.deadly = {float(values[7][0])}
    verdicts = judge_all(pool, candidates, 3)
    assert [v.crashed for v in verdicts] == [i == 7 for i in range(40)]
    others = [i for i in range(40) if i != 7]
    assert_array_equal([verdicts[i].z for i in others], [undisturbed[i].z for i in others])
    # Its task had others in it, so it was judged again by itself.
    assert [float(values[7][0])] in pool.submitted


# --- checkpoints ---


def test_a_full_disk_costs_a_warning_and_keeps_the_checkpoint_before(
    problem: tuple[Job, SearchSpace],
    pool: Inline,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    undisturbed = run(pool, problem, tmp_path / "undisturbed.json", SMALL)
    path = tmp_path / "checkpoint.json"
    warnings: list[str] = []
    kept: list[bytes] = []

    def fill_disk(history: Sequence[object]) -> None:
        if len(history) == 2:
            kept.append(path.read_bytes())

            def refuse(number: int) -> None:
                raise OSError(errno.ENOSPC, "No space left on device")

            monkeypatch.setattr(os, "fsync", refuse)

    found = run(pool, problem, path, SMALL, report=fill_disk, warn=warnings.append)
    assert path.read_bytes() == kept[0]
    assert not list(tmp_path.glob("*.part"))
    assert len(warnings) == SMALL.generations - 1
    assert "No space left on device" in warnings[0]
    assert_array_equal(found.best, undisturbed.best)


def test_interruption_keeps_the_best_so_far_and_resuming_changes_nothing(
    problem: tuple[Job, SearchSpace], pool: Inline, tmp_path: Path
) -> None:
    whole = run(pool, problem, tmp_path / "whole.json", SMALL)

    def interrupt(history: Sequence[object]) -> None:
        if len(history) == 3:
            raise KeyboardInterrupt

    path = tmp_path / "checkpoint.json"
    part = run(pool, problem, path, SMALL, report=interrupt)
    assert part.interrupted
    assert len(part.history) == 3
    rest = run(pool, problem, path, SMALL, resume=True)
    assert_array_equal(rest.best, whole.best)
    assert [g.z for g in rest.history] == [g.z for g in whole.history]


def test_another_search_does_not_go_on_from_a_checkpoint(
    problem: tuple[Job, SearchSpace], pool: Inline, tmp_path: Path
) -> None:
    path = tmp_path / "checkpoint.json"
    run(pool, problem, path, SMALL)
    with pytest.raises(InputError, match="another search"):
        run(pool, problem, path, replace(SMALL, seed=4), resume=True)
    path.write_text(path.read_text()[:-100])
    with pytest.raises(InputError, match="no checkpoint"):
        run(pool, problem, path, SMALL, resume=True)


# --- validation ---


def test_folds_are_judged_by_gains_that_have_not_seen_them(
    problem: tuple[Job, SearchSpace], pool: Inline, tmp_path: Path
) -> None:
    job, space = problem
    plan = replace(SMALL, generations=1)
    seen: list[Sequence[int]] = []

    def tune(number: int, on: Sequence[int]) -> Search | None:
        seen.append(on)
        return search(pool, job, space, on, plan, tmp_path / f"{number}.json")

    reasoned = to_vector(job.gains)
    folds = cross_validate(pool, job, reasoned, 3, tune)
    assert seen == [[1, 2], [0, 2], [0, 1]]
    z_k = judge_gains(pool, job, [reasoned])[0]
    assert [fold.cases for fold in folds] == [(name,) for name in CASES]
    assert_array_equal([fold.reasoned for fold in folds], z_k)
    assert all(np.isfinite(fold.tuned) for fold in folds)


def test_a_gain_without_effect_does_not_matter(
    problem: tuple[Job, SearchSpace], pool: Inline, tmp_path: Path
) -> None:
    """A decay of 0.02 1/s forgets 12 % of a deviation in 6 s; L42 is the loop of muDC."""
    job, space = problem
    found = run(pool, problem, tmp_path / "c.json", replace(SMALL, generations=1))
    matters = {e.gain: e.matters for e in sensitivities(pool, job, space, found)}
    assert matters["L42"]
    assert not matters["T_WR"]


# --- gains.toml ---


@pytest.mark.parametrize("name", ["disturbance_observer", "parameter_estimator", "ekf", "ukf"])
def test_gains_read_back_to_the_bit(root: Path, tmp_path: Path, name: str) -> None:
    model = "FullObserver" if name == "parameter_estimator" else "MinimalObserver"
    with FMU(root / "fmus" / "fmi2" / f"{model}.fmu") as fmu:
        gains = reasoned_gains(name, fmu)
    path = tmp_path / "gains.toml"
    path.write_text(format_gains(name, gains, {"z": 0.1, "cases": ['a "b"'], "z_k": {"a.b": 1}}))
    estimator, read = read_gains(path)
    assert estimator == name
    assert_array_equal(to_vector(read), to_vector(gains))
    if not isinstance(read, FilterNoise):
        assert_array_equal(read.effect, gains.effect)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("gains = ", "no TOML"),
        ("[gains]", "estimator = None"),
        ('estimator = "ekf"\n[gains]\nmodel = 1', r"no omegaW_relative in \[gains\]"),
        ('estimator = "parameter_estimator"\n[gains]', "effect = None"),
    ],
)
def test_a_wrong_file_of_gains_is_refused(tmp_path: Path, text: str, match: str) -> None:
    path = tmp_path / "gains.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=match):
        read_gains(path)


# --- as a user runs it ---


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, root: Path) -> Path:
    """Two short recordings."""
    cases = tmp_path_factory.mktemp("cases")
    for name in CASES[:2]:
        (cases / name).mkdir()
        source = root / "cases" / name
        (cases / name / "case.toml").write_text((source / "case.toml").read_text())
        table = pd.read_csv(source / "measured.csv").iloc[SAMPLES]
        table.to_csv(cases / name / "measured.csv", index=False)
    return cases


def command(folder: Path, out: Path, *options: str) -> list[str]:
    search = ["--cases", str(folder), "--budget", "15", "--population", "4", "--workers", "1"]
    return ["tune", "parameter_estimator", *search, "--out", str(out), *options]


def test_a_run_that_is_killed_resumes_to_the_result_of_one_that_is_not(
    root: Path, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    checkpoint = killed / "checkpoint.json"
    arguments = [sys.executable, "-m", "workbench", *command(folder, killed)]
    with subprocess.Popen(arguments, cwd=root, stdout=subprocess.DEVNULL) as master:
        deadline = time.monotonic() + 60.0
        while not checkpoint.exists() and time.monotonic() < deadline:
            time.sleep(0.005)
        workers = children(master.pid)
        master.kill()
    assert checkpoint.exists()
    assert workers
    # A worker notices the death of its master at once; 10 s are for a busy machine.
    deadline = time.monotonic() + 10.0
    while any(alive(pid) for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [pid for pid in workers if alive(pid)]
    # As if it had been killed inside a checkpoint, which is written beside and then renamed.
    half = checkpoint.read_bytes()[:1000]
    checkpoint.with_name("checkpoint.json.part").write_bytes(half)
    assert len(json.loads(checkpoint.read_text())["history"]) < 16
    monkeypatch.chdir(root)
    assert main(command(folder, killed, "--resume")) == 0
    assert main(command(folder, whole)) == 0
    assert (killed / "gains.toml").read_bytes() == (whole / "gains.toml").read_bytes()


def children(pid: int) -> list[int]:
    """Processes that a process started, from /proc."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found.append(int(status.parent.name))
    return found


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and waits for its parent does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_results_keep_their_contract(
    root: Path,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(root)
    arguments = command(folder, tmp_path, "--folds", "2", "--budget", "2", "--live")
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert "evaluations/s" in printed
    assert "of work saved" in printed
    assert "not seen: 03_dry_120_3.6" in printed
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert set(summary["gains"]) == {f"L{i}{j}" for i in (1, 2) for j in (1, 2, 3, 4)}
    assert summary["z"] == max(case["z_k"] for case in summary["cases"].values())
    assert summary["z"] <= summary["z_reasoned"]
    assert len(summary["folds"]) == 2
    assert len(summary["provenance"]["fmu"]["sha256"]) == 64
    estimator, gains = read_gains(tmp_path / "gains.toml")
    assert estimator == "parameter_estimator"
    assert_array_equal(to_vector(gains), [g["value"] for g in summary["gains"].values()])
    for name in ("convergence.png", "cases.png"):
        assert (tmp_path / name).stat().st_size > 10_000
    assert not list(tmp_path.glob("*.part"))
    with FMU(MINIMAL_OBSERVER) as minimal, FMU(FULL_OBSERVER) as full:
        settings = with_tuned(reasoned_settings(minimal, full), gains)
    assert settings.parameter is gains


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (["--folds", "3"], "3 with 2 cases"),
        (["--fmu", "README.md"], "no FMU"),
        (["--cluster", "tcp://127.0.0.1:1"], "--cluster"),
    ],
)
def test_a_users_mistake_gives_status_2_and_a_message(
    root: Path,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    match: str,
) -> None:
    monkeypatch.chdir(root)
    assert main(command(folder, tmp_path, *options)) == 2
    captured = capsys.readouterr().err
    assert match in captured
    assert "Traceback" not in captured
