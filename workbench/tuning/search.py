"""The search: generation after generation of candidates, judged by the workers."""

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.fmu import Matrix, Vector
from workbench.tuning.checkpoint import Checkpoint, Generation, load, save
from workbench.tuning.cost import Candidate, Job, Verdict
from workbench.tuning.evolution import (
    Population,
    first,
    has_converged,
    latin_hypercube,
    propose,
    select,
)
from workbench.tuning.space import SearchSpace, to_vector
from workbench.tuning.workers import Pool, judge_all

SPREAD = 0.1  # of the first candidates about the reasoned gains, as a share of the search space
TOLERANCE = 1e-3  # spread of z in the population below which more generations gain nothing


@dataclass(frozen=True)
class Plan:
    """How to search.

    Attributes
    ----------
    generations : after the initial population.
    population : candidates per gain.
    seed : of the random numbers.
    economy : drop candidates that have lost; the result is the same without, later.
    """

    generations: int = 100
    population: int = 15
    seed: int = 0
    economy: bool = True


@dataclass(frozen=True, eq=False)
class Search:
    """What a search found.

    Attributes
    ----------
    best : (n,) gains.
    coordinates : (n,) the same in the search space.
    z : objective.
    z_k : (k,) objective in each case that was searched on, in their order.
    cases : numbers of these cases in the job.
    history : generations, the initial one first.
    interrupted : whether it was stopped before its end.
    """

    best: Vector
    coordinates: Vector
    z: float
    z_k: Vector
    cases: tuple[int, ...]
    history: tuple[Generation, ...]
    interrupted: bool


def identity(job: Job, space: SearchSpace, cases: Sequence[int], plan: Plan) -> str:
    """Hash of everything that a search depends on, but for its length."""
    digest = hashlib.sha256(job.fmu)
    what = [job.estimator, dict(job.names), vars(job.weights), job.friction_left, list(cases)]
    digest.update(json.dumps([*what, plan.population, plan.seed]).encode())
    for recording in job.recordings:
        digest.update(recording.name.encode())
        for values in recording[2:]:
            digest.update(np.ascontiguousarray(values).tobytes())
    for values in (to_vector(job.gains), *vars(space).values()):
        digest.update(values.tobytes())
    return digest.hexdigest()


def search(
    pool: Pool,
    job: Job,
    space: SearchSpace,
    cases: Sequence[int],
    plan: Plan,
    checkpoint: Path,
    *,
    resume: bool = False,
    report: Callable[[Sequence[Generation]], None] = lambda history: None,
    warn: Callable[[str], None] = lambda message: None,
) -> Search | None:
    """Minimise the worst of z_k over cases by differential evolution.

    Parameters
    ----------
    pool : workers equipped with the job.
    cases : numbers of the cases to search on.
    checkpoint : file that is written after every generation.
    resume : go on from it, if it is there.
    report : called with the history after every generation.
    warn : called where a checkpoint cannot be written; the search goes on.

    Returns
    -------
    Search, or None if it was interrupted before there was anything to return.
    """
    mark = identity(job, space, cases, plan)
    rng = np.random.default_rng(plan.seed)
    history: list[Generation] = []
    population: Population | None = None
    if resume and (before := load(checkpoint, mark)) is not None:
        population, history = before.population, list(before.history)
        rng.bit_generator.state = before.rng
    interrupted = False
    try:
        while population is None or not _is_done(population, history, plan):
            begin = time.perf_counter()
            if population is None:
                size = max(5, plan.population * space.start.size)
                near = [np.clip(space.start + side * SPREAD, 0.0, 1.0) for side in (-1, 1)]
                trials = latin_hypercube(size, near[0], near[1], rng)
                trials[0] = space.start
                verdicts = _judge(pool, job, space, trials, np.full(size, np.inf), list(cases))
                population = first(trials, *_values(verdicts))
            else:
                trials, order = propose(population, rng)
                limits = population.z if plan.economy else np.full(len(trials), np.inf)
                # The case that decides about the best decides about most.
                hardest = sorted(cases, key=population.z_k[0].__getitem__, reverse=True)
                verdicts = _judge(pool, job, space, trials, limits, hardest)
                population = select(population, trials, *_values(verdicts), order)
            history.append(_generation(job, cases, population, verdicts, begin))
            state = Checkpoint(mark, population, dict(rng.bit_generator.state), tuple(history))
            try:
                save(state, checkpoint)
            except OSError as error:
                warn(f"{checkpoint} not written, the one before is kept: {error.strerror}")
            report(history)
    except KeyboardInterrupt:
        interrupted = True
    if population is None:
        return None
    return Search(
        best=space.gains(population.members[0]),
        coordinates=population.members[0],
        z=float(population.z[0]),
        z_k=population.z_k[0][list(cases)],
        cases=tuple(cases),
        history=tuple(history),
        interrupted=interrupted,
    )


def _is_done(population: Population, history: Sequence[Generation], plan: Plan) -> bool:
    return len(history) > plan.generations or has_converged(population, TOLERANCE)


def _judge(
    pool: Pool,
    job: Job,
    space: SearchSpace,
    trials: Matrix,
    limits: Vector,
    order: Sequence[int],
) -> list[Verdict]:
    candidates = [
        Candidate(space.gains(trial), float(limit), tuple(order))
        for trial, limit in zip(trials, limits, strict=True)
    ]
    return judge_all(pool, candidates, len(job.recordings))


def _values(verdicts: Sequence[Verdict]) -> tuple[Vector, Matrix]:
    return np.array([v.z for v in verdicts]), np.array([v.z_k for v in verdicts])


def _generation(
    job: Job,
    cases: Sequence[int],
    population: Population,
    verdicts: Sequence[Verdict],
    begin: float,
) -> Generation:
    names = [recording.name for recording in job.recordings]
    z_k = population.z_k[0]
    hardest = sorted(cases, key=z_k.__getitem__, reverse=True)
    worst, second = hardest[0], hardest[min(1, len(hardest) - 1)]
    unstable = [v.unstable for v in verdicts]
    return Generation(
        z=float(population.z[0]),
        worst=names[worst],
        second=names[second],
        margin=float(1.0 - z_k[second] / z_k[worst]) if np.isfinite(z_k[worst]) else 0.0,
        candidates=len(verdicts),
        samples=sum(v.samples for v in verdicts),
        of=len(verdicts) * sum(job.recordings[k].steps.size for k in cases),
        unstable={names[k]: unstable.count(k) for k in cases if k in unstable},
        crashed=sum(v.crashed for v in verdicts),
        seconds=time.perf_counter() - begin,
    )
