"""A search ends at the same gains with less work, other workers, after deaths and interruptions."""

import asyncio
import errno
import json
import math
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import workbench
from workbench.errors import InputError, WorkerError
from workbench.runtime.files import previous_path
from workbench.runtime.pool import Pool
from workbench.tuning import (
    Candidate,
    Checkpointing,
    Evaluation,
    Evaluator,
    NoWorkersError,
    Plan,
    Problem,
    Search,
    Workers,
    evaluate_all,
    evaluators,
    search,
)
from workbench.tuning.checkpoint import Checkpoint, Generation, Population, load, save
from workbench.tuning.search import identity

from .processes import LONGEST, comes_true, python

SMALL = Plan(generations=4, population=1, seed=3)


def run(pool: Workers, problem: Problem, path: Path, plan: Plan, **options) -> Search:
    job, space = problem.job, problem.space
    kept = Checkpointing(path, **options)
    return search(pool, job, space, range(len(job.recordings)), plan, kept)


@pytest.fixture(scope="session")
def alone(once, problem) -> Search:
    """What a search finds in this process, undisturbed."""

    def find(folder: Path) -> Search:
        with Pool(1, Evaluator, problem.job) as pool:
            return run(pool, problem, folder / "checkpoint.json", SMALL)

    return once("undisturbed search", find)


def test_economy_changes_nothing_but_the_work(problem, pool, tmp_path):
    plan = replace(SMALL, generations=8)
    thrifty = run(pool, problem, tmp_path / "a.json", plan)
    full = run(pool, problem, tmp_path / "b.json", replace(plan, economy=False))
    mark = identity(problem.job, problem.space, range(3), plan)
    a, b = (load(tmp_path / name, mark) for name in ("a.json", "b.json"))
    for name in ("members", "z", "z_k"):
        assert_array_equal(getattr(a.population, name), getattr(b.population, name))
    assert_array_equal(thrifty.best, full.best)
    assert sum(g.samples for g in thrifty.history) < 0.8 * sum(g.samples for g in full.history)
    assert thrifty.z < thrifty.history[0].z
    # SciPy asks for each population again; what is known of it is not evaluated again.
    assert all(g.candidates <= len(a.population.z) for g in thrifty.history)


# --- workers ---


def test_gains_do_not_depend_on_the_number_of_workers_nor_on_the_death_of_one(
    problem, alone, tmp_path
):
    """One process of two is killed while it works."""
    killed: list[int] = []
    with evaluators(problem.job, 2) as two:

        def kill_once(history: Sequence[object]) -> None:
            if not killed:
                killed.append(two.submit(pid).result())
                os.kill(killed[0], signal.SIGKILL)

        tuned = run(two, problem, tmp_path / "two.json", SMALL, report=kill_once)
        assert killed[0] not in {two.submit(pid).result() for _ in range(100)}
    assert_array_equal(tuned.best, alone.best)
    assert_array_equal(tuned.z_k, alone.z_k)
    assert [g.z for g in tuned.history] == [g.z for g in alone.history]


def pid(evaluator: Evaluator) -> int:
    return os.getpid()


@contextmanager
def on_cluster(address: str, problem: Problem, **options) -> Iterator[Workers]:
    from workbench.runtime.cluster import DaskPool

    with closing(DaskPool(address, Evaluator, problem.job, 60.0, **options)) as pool:
        yield pool


def test_a_cluster_finds_the_same_gains(problem, alone, tmp_path):
    import distributed

    # Dask pauses workers whose process is large, as this one is after hundreds of tests: no limit.
    options = {"n_workers": 1, "threads_per_worker": 2, "memory_limit": 0}
    with (
        distributed.LocalCluster(processes=False, dashboard_address=":0", **options) as cluster,
        on_cluster(cluster.scheduler_address, problem) as remote,
    ):
        tuned = run(remote, problem, tmp_path / "remote.json", SMALL)
    assert_array_equal(tuned.best, alone.best)


def test_of_several_calls_in_a_task_only_the_one_that_ends_its_workers_is_lost(monkeypatch):
    """Powers of 2 by a cluster, whose worker would die of 2^7."""
    import distributed

    from workbench.runtime import cluster

    sizes, work, send = [], cluster._work, cluster.DaskPool._send

    def note_size(pool: cluster.DaskPool[float], task: cluster._Task) -> None:
        sizes.append(len(task.calls))
        send(pool, task)

    def die_of_seven(function: Callable[..., float], calls: Sequence[tuple[int]]) -> list[float]:
        if (7,) in calls:
            raise distributed.KilledWorker("a task", SimpleNamespace(address="here"), 3)
        return work(function, calls)

    monkeypatch.setattr(cluster, "_work", die_of_seven)
    monkeypatch.setattr(cluster.DaskPool, "_send", note_size)
    options = {"n_workers": 1, "threads_per_worker": 1, "memory_limit": 0}
    with (
        distributed.LocalCluster(processes=False, dashboard_address=":0", **options) as local,
        closing(cluster.DaskPool(local.scheduler_address, nullcontext, 2.0, 60.0)) as pool,
    ):
        answers = pool.submit_all(math.pow, [(k,) for k in range(40)])
        results = [answer.exception() or answer.result() for answer in answers]
    assert isinstance(results.pop(7), WorkerError)
    assert results == [2.0**k for k in range(40) if k != 7]
    # Tasks become smaller, so that workers end together; the calls of the first are tried alone.
    assert sizes == [16, 12, 6, 3, 2, 1, *[1] * 16]


LATE = """
import pickle, time
from types import SimpleNamespace
from workbench.runtime import cluster


def refuse(given):
    raise ValueError(given)


cluster._PREPARATION = 0.5
worker = SimpleNamespace(periodic_callbacks={})
try:
    cluster._make_ready(pickle.dumps((refuse, "no model", 1.0)), worker)
except ValueError:
    time.sleep(1.5)
    print("alive")
"""


def test_a_worker_that_could_not_be_prepared_is_not_ended_for_it_later():
    """It may belong to somebody else's process, and may be of use to the next who asks."""
    run = python("-c", LATE)
    assert (run.returncode, run.stdout) == (0, "alive\n"), run.stderr


BLOCK = """import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "workbench":
            raise ModuleNotFoundError(f"No module named {name!r}")
sys.meta_path.insert(0, Block())
"""


@contextmanager
def dask(*arguments: str, path: Path | None = None) -> Iterator[subprocess.Popen[bytes]]:
    """A scheduler or a worker in a process of its own, which finds modules in `path` first."""
    here = path or Path(__file__).parent.parent
    environment = {**os.environ, "PYTHONPATH": str(here)}
    command = [sys.executable, "-m", f"distributed.cli.dask_{arguments[0]}", *arguments[1:]]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(
        [*command, "--dashboard-address", ":0"], env=environment, cwd=here, **quiet
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def worker(
    address: str, path: Path | None = None
) -> AbstractContextManager[subprocess.Popen[bytes]]:
    return dask("worker", address, "--no-nanny", "--nthreads", "1", path=path)


@pytest.fixture
def scheduler(tmp_path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Address and process of a scheduler."""
    file = tmp_path / "scheduler.json"
    with dask("scheduler", "--scheduler-file", str(file), "--port", "0") as process:
        assert comes_true(lambda: file.exists() and file.read_text() != "")
        yield json.loads(file.read_text())["address"], process


def test_a_cluster_without_workers_is_refused_in_words(scheduler, problem):
    refused = pytest.raises(
        InputError, match=r"found no workers; .* start workers with 'dask worker"
    )
    with refused, on_cluster(scheduler[0], problem, patience=1.0):
        pass


def test_only_workers_with_the_same_code_get_work(scheduler, problem, alone, tmp_path):
    """One lacks the project, one has a constant of its objective otherwise."""
    import distributed

    address, _ = scheduler
    lacking, other = tmp_path / "lacking", tmp_path / "other"
    lacking.mkdir()
    (lacking / "sitecustomize.py").write_text(BLOCK)
    shutil.copytree(Path(workbench.__file__).parent, other / "workbench")
    changed = other / "workbench" / "observers" / "score.py"
    changed.write_text(changed.read_text() + "\nBETTER = 2.0\n")
    warnings: list[str] = []
    with worker(address, lacking), worker(address, other):
        with distributed.Client(address) as client:
            client.wait_for_workers(2, timeout=LONGEST)
        refused = pytest.raises(InputError, match="code of workbench none, here")
        with refused, on_cluster(address, problem, warn=warnings.append):
            pass
        assert len(warnings) == 2
        warnings.clear()
        with worker(address), distributed.Client(address) as client:
            client.wait_for_workers(3, timeout=LONGEST)
            with on_cluster(address, problem, warn=warnings.append) as remote:
                tuned = run(remote, problem, tmp_path / "remote.json", SMALL)
    assert len(warnings) == 2
    assert all("it gets no work" in warning for warning in warnings)
    assert_array_equal(tuned.best, alone.best)


def test_a_scheduler_that_dies_keeps_the_best_and_resuming_changes_nothing(
    scheduler, problem, pool, alone, tmp_path
):
    address, process = scheduler
    warnings: list[str] = []

    def die_in_time(history: Sequence[object]) -> None:
        if len(history) == 2:
            process.kill()

    path = tmp_path / "checkpoint.json"
    # A busy machine may take long to start one.
    with worker(address), on_cluster(address, problem, patience=120.0) as remote:
        part = run(remote, problem, path, SMALL, report=die_in_time, warn=warnings.append)
        with pytest.raises(NoWorkersError, match="does not answer"):
            remote.submit(pid).result()
    assert part.interrupted
    assert len(part.history) >= 2
    assert "--resume goes on from there" in warnings[0]
    assert_array_equal(run(pool, problem, path, SMALL, resume=True).best, alone.best)


def test_a_cluster_whose_workers_are_gone_says_so(scheduler, problem, tmp_path):
    address, _ = scheduler
    with worker(address) as process, on_cluster(address, problem, patience=120.0) as remote:
        remote._patience = 2.0
        process.kill()
        with pytest.raises(NoWorkersError, match=r"all workers of the cluster .* are gone"):
            remote.submit(pid).result(timeout=120)
        # Another joins too late for this pool.
        with pytest.raises(NoWorkersError):
            remote.submit(pid).result(timeout=120)


def test_an_answer_that_a_dead_scheduler_owes_holds_up_no_other_pool(
    scheduler, problem, monkeypatch
):
    """Dask hands over the answers of all clients of a process in one thread, which the end of the
    interpreter waits for; a client may wait for ever there for a result that it knows is made."""
    import distributed

    async def never(client: object, futures: object) -> None:
        await asyncio.Event().wait()

    address, process = scheduler
    with worker(address), on_cluster(address, problem, patience=120.0) as remote:
        monkeypatch.setattr(distributed.Client, "_gather", never)
        owed = remote.submit(pid)
        assert comes_true(lambda: remote._tasks[owed].done.status == "finished")
        process.kill()
        with pytest.raises(NoWorkersError, match="does not answer"):
            owed.result(timeout=120)
    assert distributed.Future._cb_executor.submit(pid, None).result(timeout=30) == os.getpid()


def test_a_candidate_that_hangs_ends_its_worker_and_is_infinitely_bad(problem):
    job = problem.job
    endless = (0,) * 100_000  # at 1 ms a case, two minutes
    with evaluators(job, 1, limit=0.3) as hasty:
        [evaluation] = evaluate_all(hasty, [Candidate(job.gains.values, np.inf, endless)], 3)
    assert evaluation.crashed
    assert evaluation.z == np.inf


class Deadly:
    """A pool whose workers die of a certain candidate."""

    def __init__(self, pool: Pool[Evaluator], candidate: float) -> None:
        self._pool = pool
        self._candidate = candidate

    def submit_all(
        self,
        function: Callable[[Evaluator, Candidate], Evaluation],
        calls: Sequence[tuple[Candidate]],
    ) -> "list[Future[Evaluation]]":
        return [
            self._pool.submit(die)
            if candidate.values[0] == self._candidate
            else self._pool.submit(function, candidate)
            for (candidate,) in calls
        ]


def die(evaluator: Evaluator) -> Evaluation:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("it lives")


def test_only_the_candidate_that_kills_workers_is_lost(problem, pool):
    job, space = problem.job, problem.space
    values = [space.gains(np.clip(space.start + 0.001 * i, 0, 1)) for i in range(20)]
    candidates = [Candidate(v, np.inf, (0, 1, 2)) for v in values]
    undisturbed = evaluate_all(pool, candidates, 3)
    with evaluators(job, 2) as two:
        evaluations = evaluate_all(Deadly(two, float(values[7][0])), candidates, 3)
    assert [evaluation.crashed for evaluation in evaluations] == [i == 7 for i in range(20)]
    others = [i for i in range(20) if i != 7]
    assert_array_equal([evaluations[i].z for i in others], [undisturbed[i].z for i in others])


# --- checkpoints ---


def test_a_full_disk_costs_a_warning_and_keeps_the_checkpoint_before(
    problem, pool, alone, tmp_path, monkeypatch
):
    path = tmp_path / "checkpoint.json"
    warnings: list[str] = []
    kept: list[bytes] = []

    def fill_disk(history: Sequence[object]) -> None:
        if len(history) == 2:
            kept.append(path.read_bytes())

            def refuse(number: int) -> None:
                raise OSError(errno.ENOSPC, "No space left on device")

            monkeypatch.setattr(os, "fsync", refuse)

    tuned = run(pool, problem, path, SMALL, report=fill_disk, warn=warnings.append)
    assert path.read_bytes() == kept[0]
    assert not list(tmp_path.glob("*.part"))
    assert len(warnings) == SMALL.generations - 1
    assert "No space left on device" in warnings[0]
    assert_array_equal(tuned.best, alone.best)


def test_interruption_keeps_the_best_so_far_and_resuming_changes_nothing(
    problem, pool, alone, tmp_path
):
    def interrupt(history: Sequence[object]) -> None:
        if len(history) == 3:
            raise KeyboardInterrupt

    path = tmp_path / "checkpoint.json"
    part = run(pool, problem, path, SMALL, report=interrupt)
    assert part.interrupted
    assert len(part.history) == 3
    resumed = run(pool, problem, path, SMALL, resume=True)
    assert_array_equal(resumed.best, alone.best)
    assert [g.z for g in resumed.history] == [g.z for g in alone.history]


def test_another_search_does_not_go_on_from_a_checkpoint(problem, pool, tmp_path):
    path = tmp_path / "checkpoint.json"
    run(pool, problem, path, SMALL)
    with pytest.raises(InputError, match="another search"):
        run(pool, problem, path, replace(SMALL, seed=4), resume=True)
    path.write_text(path.read_text()[:-100])
    previous_path(path).unlink()
    with pytest.raises(InputError, match="no checkpoint"):
        run(pool, problem, path, SMALL, resume=True)


def test_a_damaged_checkpoint_gives_way_to_the_one_before(problem, pool, tmp_path):
    path = tmp_path / "checkpoint.json"
    whole = run(pool, problem, path, SMALL)
    path.write_text(path.read_text().replace('"z":', '"z": ', 1).replace("0.", "0.1", 1))
    warnings: list[str] = []
    tuned = run(pool, problem, path, SMALL, resume=True, warn=warnings.append)
    assert_array_equal(tuned.best, whole.best)
    assert "its checksum is another one" in warnings[0]
    assert len(tuned.history) == len(whole.history)


@pytest.fixture
def saved(tmp_path) -> tuple[Path, Checkpoint]:
    rng = np.random.default_rng(1)
    population = Population(rng.random((6, 3)), rng.random(6), rng.random((6, 2)))
    generation = Generation(0.1, "a", "b", 0.2, 6, 100, 120, {"a": 1}, 0, 0.5)
    checkpoint = Checkpoint("mark", population, False, (generation, generation))
    path = tmp_path / "checkpoint.json"
    save(checkpoint, path)
    return path, checkpoint


def test_a_folder_that_has_gone_costs_a_warning_and_not_the_search(saved):
    """A search warns of an InputError and goes on; another error lost the best gains."""
    path, checkpoint = saved
    path.unlink()
    path.parent.rmdir()
    path.parent.write_text("a file in its place")
    with pytest.raises(InputError, match="cannot be written"):
        save(checkpoint, path)


def test_no_damage_of_a_checkpoint_goes_unseen(saved):
    """Bytes replaced, cut out, doubled: what is read is what was written, or refused."""
    path, checkpoint = saved
    written = path.read_bytes()
    rng = np.random.default_rng(2)
    refused = 0
    for _ in range(2000):
        first, last = sorted(rng.integers(0, len(written), 2))
        middle = [b"", bytes(rng.integers(32, 127, 3).tolist()), 2 * written[first:last]]
        last = min(last, first + 8)
        path.write_bytes(written[:first] + middle[rng.integers(3)] + written[last:])
        try:
            loaded = load(path, "mark")
        except InputError:
            refused += 1
        else:
            assert loaded.history == checkpoint.history
            for name in ("members", "z", "z_k"):
                assert_array_equal(
                    getattr(loaded.population, name), getattr(checkpoint.population, name)
                )
    assert refused > 1900
