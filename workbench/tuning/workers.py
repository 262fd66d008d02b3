"""Who judges candidates: processes of this machine, or workers of a Dask cluster; one interface.

A worker that dies costs its task. What was in its hands is judged again, one candidate at a time;
one that then kills a worker again is infinitely bad. A worker that hangs ends itself.
"""

import faulthandler
import multiprocessing
import os
import pickle
import signal
import tempfile
import threading
from collections.abc import Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from pathlib import Path
from typing import Protocol

import numpy as np
from threadpoolctl import threadpool_limits

from workbench.tuning.cost import Bench, Candidate, Job, Verdict

_JOB = "job.pickle"  # in the folder of a pool
_PREPARATION = 600.0  # [s] to load the model and compile its loop, on a busy machine

# What this process was equipped with; a worker lives for one job.
_equipment: list[tuple[Bench, float]] = []
_one_at_a_time = threading.Lock()


class Pool(Protocol):
    """Where tasks run.

    Attributes
    ----------
    size : number of workers.
    deaths : exceptions of a task whose worker died.
    """

    size: int
    deaths: tuple[type[BaseException], ...]

    def submit(self, candidates: Sequence[Candidate]) -> "Future[list[Verdict]]":
        """Judge candidates in a worker; after a death the pool is whole again."""

    def close(self) -> None:
        """Stop the workers."""


class ProcessPool:
    """Processes of this machine; each keeps a model and the recordings.

    Parameters
    ----------
    timeout : for one candidate [s].
    """

    deaths: tuple[type[BaseException], ...] = (BrokenExecutor,)

    def __init__(self, job: Job, size: int, timeout: float) -> None:
        self.size = size
        self._timeout = timeout
        self._folder = tempfile.TemporaryDirectory(prefix="tune-", ignore_cleanup_errors=True)
        # In a file, because handing so much to a process that dies as it starts waits for ever.
        Path(self._folder.name, _JOB).write_bytes(pickle.dumps(job))
        self._executor = self._start()

    def _start(self) -> ProcessPoolExecutor:
        # Not forked: a fork of a process with threads may lock up.
        return ProcessPoolExecutor(
            self.size,
            multiprocessing.get_context("spawn"),
            _begin,
            (self._folder.name, self._timeout),
        )

    def submit(self, candidates: Sequence[Candidate]) -> "Future[list[Verdict]]":
        """See Pool."""
        try:
            return self._executor.submit(judge, candidates)
        except BrokenExecutor:
            self._executor.shutdown(wait=False)
            self._executor = self._start()
            return self._executor.submit(judge, candidates)

    def close(self) -> None:
        """See Pool."""
        self._executor.shutdown(cancel_futures=True)
        self._folder.cleanup()


def _begin(folder: str, timeout: float) -> None:
    """Prepare a process: it leaves Ctrl-C to the master and does not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_master, daemon=True).start()
    tempfile.tempdir = folder
    equip(pickle.loads(Path(folder, _JOB).read_bytes()), timeout)


def _end_with_master() -> None:
    if (master := multiprocessing.parent_process()) is not None:
        master.join()
        os._exit(1)


def equip(job: Job, timeout: float) -> None:
    """Give this process what it needs to judge candidates of a job."""
    with _one_at_a_time:
        for bench, _ in _equipment:
            bench.close()
        faulthandler.dump_traceback_later(_PREPARATION, exit=True)
        # Matrices are small: with a pool of BLAS threads each, workers wait for one another.
        threadpool_limits(1)
        _equipment[:] = [(Bench(job), timeout)]
        faulthandler.cancel_dump_traceback_later()


def judge(candidates: Sequence[Candidate]) -> list[Verdict]:
    """Judge candidates in this process, which ends if one takes longer than the timeout."""
    with _one_at_a_time:
        bench, timeout = _equipment[0]
        verdicts = []
        for candidate in candidates:
            faulthandler.dump_traceback_later(timeout, exit=True)
            verdicts.append(bench.judge(candidate))
        faulthandler.cancel_dump_traceback_later()
        return verdicts


def judge_all(pool: Pool, candidates: Sequence[Candidate], cases: int) -> list[Verdict]:
    """Judge candidates in the workers; verdicts in the order of candidates.

    Parameters
    ----------
    cases : number of cases of the job.
    """
    verdicts: dict[int, Verdict] = {}
    everything = range(len(candidates))
    tasks = portions(everything, pool.size)
    lost = _judge_tasks(pool, candidates, tasks, 2 * pool.size, verdicts)
    for i in lost:
        # Alone, so that nothing is blamed for the death of another.
        if _judge_tasks(pool, candidates, [range(i, i + 1)], 1, verdicts):
            verdicts[i] = Verdict(np.inf, np.full(cases, np.inf), 0, candidates[i].order[0], True)
    return [verdicts[i] for i in everything]


def portions(candidates: range, workers: int) -> list[range]:
    """Tasks that shrink: few, because each costs some milliseconds, and small at the end.

    Each is two thirds of what a worker would get of the rest, so that all workers end together,
    however candidates differ in cost. After C. Polychronopoulos, D. Kuck (1987), Guided
    Self-Scheduling, IEEE Transactions on Computers C-36, who take all of it.

    >>> [len(task) for task in portions(range(20), 2)]
    [6, 4, 3, 2, 1, 1, 1, 1, 1]
    """
    tasks = []
    while candidates:
        size = max(1, 2 * len(candidates) // (3 * workers))
        tasks.append(candidates[:size])
        candidates = candidates[size:]
    return tasks


def _judge_tasks(
    pool: Pool,
    candidates: Sequence[Candidate],
    tasks: Sequence[range],
    at_once: int,
    verdicts: dict[int, Verdict],
) -> list[int]:
    """Judge tasks, so many at once; returns the candidates that a worker died with."""
    lost: list[int] = []
    running: dict[Future[list[Verdict]], range] = {}
    waiting = list(reversed(tasks))
    while waiting or running:
        while waiting and len(running) < at_once:
            task = waiting.pop()
            running[pool.submit([candidates[i] for i in task])] = task
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            task = running.pop(future)
            try:
                verdicts.update(zip(task, future.result(), strict=True))
            except pool.deaths:
                lost.extend(task)
    return lost
