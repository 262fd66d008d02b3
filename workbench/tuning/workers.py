"""Candidates, evaluated by workers of this machine or of a cluster."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Protocol

import numpy as np

from workbench.errors import WorkerError
from workbench.runtime.pool import Pool
from workbench.tuning.cost import Candidate, Evaluation, Evaluator, Job

LIMIT = 60.0  # [s] for one candidate, which takes about 0.1 s


class Workers(Protocol):
    """Who evaluates candidates: a `workbench.runtime.pool.Pool`, or one like it."""

    def submit(
        self, function: Callable[[Evaluator, Candidate], Evaluation], candidate: Candidate, /
    ) -> "Future[Evaluation]":
        """Have a worker evaluate a candidate.

        WorkerError if it cannot, NoWorkersError if there is none.
        """


def evaluators(job: Job, workers: int, limit: float = LIMIT) -> Pool[Evaluator]:
    """Processes of this machine that evaluate candidates of a job.

    Parameters
    ----------
    limit : for one candidate [s].
    """
    return Pool(workers, Evaluator, job, limit=limit)


def evaluate_all(pool: Workers, candidates: Sequence[Candidate], cases: int) -> list[Evaluation]:
    """Evaluate candidates; one that kills its workers, or takes too long, is infinitely bad.

    Parameters
    ----------
    cases : number of cases of the job.
    """
    tasks: list[Future[Evaluation]] = []
    evaluations = []
    try:
        tasks.extend(pool.submit(Evaluator.evaluate, candidate) for candidate in candidates)
        for candidate, task in zip(candidates, tasks, strict=True):
            try:
                evaluations.append(task.result())
            except WorkerError:
                lost = np.full(cases, np.inf)
                evaluations.append(Evaluation(np.inf, lost, 0, candidate.order[0], crashed=True))
    finally:
        # After Ctrl-C nobody waits for the others.
        for task in tasks:
            task.cancel()
    return evaluations
