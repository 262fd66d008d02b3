"""The search: SciPy's differential evolution, a call for each generation.

Between two calls the state is a population and a number, so that a search can be stopped, stored
and resumed to the same gains, on any number of workers.
Source: R. Storn, K. Price (1997), Differential Evolution, J. Global Optimization 11, in SciPy's
form: best1bin, dither, deferred updating.
"""

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.observers import SearchSpace
from workbench.runtime.pool import NoWorkersError
from workbench.tuning.checkpoint import Checkpoint, Generation, Population, load, save
from workbench.tuning.cost import Candidate, Evaluation, Job, Workers, evaluate_all

SPREAD = 0.1  # of the first candidates about the reasoned gains, as a share of the search space
TOLERANCE = 1e-3  # spread of z in the population below which more generations gain nothing


@dataclass(frozen=True)
class Plan:
    """How to search."""

    generations: int = 100  # after the initial population
    population: int = 15  # candidates per gain
    seed: int = 0  # of the random numbers
    economy: bool = True  # drop candidates that have lost; the result is the same without, later
    # how many times to tune without a part of the cases and evaluate on it; 0 for none
    folds: int = 0


@dataclass(frozen=True)
class Checkpointing:
    """Where a search keeps its state, and who hears of it."""

    file: Path  # written after every generation
    resume: bool = False  # go on from it, if it is there
    # called with the history after every generation
    report: Callable[[Sequence[Generation]], None] = lambda history: None
    # called where it cannot be written, or is damaged and the one before is read
    warn: Callable[[str], None] = lambda message: None


@dataclass(frozen=True, eq=False)
class Search:
    """What a search found."""

    best: Vector  # (n,) gains
    coordinates: Vector  # (n,) the same in the search space
    z: float  # objective
    z_k: Vector  # (k,) objective in each case that was searched on, in their order
    cases: tuple[int, ...]  # numbers of these cases in the job
    history: tuple[Generation, ...]  # generations, the initial one first
    last: Population  # candidates of the last one
    converged: bool  # whether z of these candidates is the same within TOLERANCE
    interrupted: bool  # whether it was stopped before its end


def identity(job: Job, space: SearchSpace, cases: Sequence[int], plan: Plan) -> str:
    """Hash of everything that a search depends on, but for its length."""
    digest = hashlib.sha256(job.fmu)
    inputs = [job.estimator, repr(job.system), job.follows, list(cases), plan.population, plan.seed]
    digest.update(json.dumps(inputs).encode())
    for recording in job.recordings:
        conditions = sorted(recording.conditions.items())
        digest.update(f"{recording.name} {conditions}".encode())
        for values in recording.sampled:
            digest.update(np.ascontiguousarray(values).tobytes())
    for values in (job.gains.values, *vars(space).values()):
        digest.update(values.tobytes())
    return digest.hexdigest()


def search(
    pool: Workers,
    job: Job,
    space: SearchSpace,
    cases: Sequence[int],
    plan: Plan,
    kept: Checkpointing,
) -> Search | None:
    """Minimise the worst of z_k over cases by differential evolution.

    Parameters
    ----------
    pool : workers prepared with the job.
    cases : numbers of the cases to search on.

    Returns
    -------
    Search, or None if it was interrupted before there was anything to return.
    """
    mark = identity(job, space, cases, plan)
    state = load(kept.file, mark, kept.warn) if kept.resume else None
    interrupted = False
    try:
        while state is None or not (state.converged or len(state.history) > plan.generations):
            begin = time.perf_counter()
            history, population = ((), None) if state is None else (state.history, state.population)
            objective = _Objective(pool, job, space, cases, plan, population)
            population, converged = _evolve(objective, space, plan, len(history))
            history = (*history, _generation(job, cases, population, objective.evaluations, begin))
            state = Checkpoint(mark, population, converged, history)
            try:
                save(state, kept.file)
            except InputError as error:
                kept.warn(f"the checkpoint before is kept: {error}")
            kept.report(history)
    except KeyboardInterrupt:
        interrupted = True
    except NoWorkersError as error:
        interrupted = True
        kept.warn(f"{error}; the best so far is kept, and --resume goes on from there")
    if state is None:
        return None
    best = state.population
    return Search(
        best=space.gains(best.members[0]),
        coordinates=best.members[0],
        z=float(best.z[0]),
        z_k=best.z_k[0][list(cases)],
        cases=tuple(cases),
        history=state.history,
        last=best,
        converged=state.converged,
        interrupted=interrupted,
    )


class _Objective:
    """z of all candidates of a generation, which SciPy asks for at once.

    It is asked first for the population before, whose z is known, then for a trial beside each
    member. With deferred updating trial i competes with member i and no other, so that a trial has
    lost where its z exceeds that of the member.
    """

    def __init__(
        self,
        pool: Workers,
        job: Job,
        space: SearchSpace,
        cases: Sequence[int],
        plan: Plan,
        before: Population | None,
    ) -> None:
        self._pool, self._job, self._space = pool, job, space
        self._known: dict[bytes, tuple[float, Vector]] = {}
        self._limits: Vector | None = None
        self._order = tuple(cases)
        self.before = before
        self.evaluations: list[Evaluation] = []  # of the candidates that were not known
        if before is not None:
            for member, z, z_k in zip(before.members, before.z, before.z_k, strict=True):
                self._known[member.tobytes()] = float(z), z_k
            # The case that decides about the best decides about most.
            self._order = tuple(sorted(cases, key=before.z_k[0].__getitem__, reverse=True))
            if plan.economy:
                self._limits = before.z

    def __call__(self, coordinates: Matrix) -> Vector:
        """Z of candidates, (s,), by their coordinates (n, s); infinite of those that have lost."""
        candidates = coordinates.T
        limits = np.full(len(candidates), np.inf) if self._limits is None else self._limits
        known = [self._known.get(candidate.tobytes()) for candidate in candidates]
        new = [i for i, result in enumerate(known) if result is None]
        asked = [
            Candidate(self._space.gains(candidates[i]), float(limits[i]), self._order) for i in new
        ]
        evaluations = evaluate_all(self._pool, asked, len(self._job.recordings))
        self.evaluations += evaluations
        z = np.array([np.inf if result is None else result[0] for result in known])
        for i, evaluation in zip(new, evaluations, strict=True):
            z[i] = evaluation.z
            # Of equal candidates one may have lost, against a better member.
            if np.isfinite(evaluation.z):
                self._known[candidates[i].tobytes()] = evaluation.z, evaluation.z_k
        return z

    def z_k(self, members: Matrix) -> Matrix:
        """Objective of members (s, n) in each case, (s, k); infinite of those that failed."""
        failed = np.inf, np.full(len(self._job.recordings), np.inf)
        return np.array([self._known.get(member.tobytes(), failed)[1] for member in members])


def _evolve(
    objective: _Objective, space: SearchSpace, plan: Plan, number: int
) -> tuple[Population, bool]:
    """Generation `number` from the one before, and whether the search has converged."""
    rng = np.random.default_rng([plan.seed, number])
    if objective.before is None:
        from scipy.stats.qmc import LatinHypercube  # takes its time, and little else needs it

        size = max(5, plan.population * space.start.size)  # SciPy's least is 5
        low, high = (np.clip(space.start + side * SPREAD, 0.0, 1.0) for side in (-1, 1))
        members = low + LatinHypercube(space.start.size, rng=rng).random(size) * (high - low)
        members[0] = space.start
    else:
        members = objective.before.members
    result = differential_evolution(
        objective,  # type: ignore[arg-type]  # of all candidates at once
        Bounds(np.zeros(space.start.size), np.ones(space.start.size)),
        init=members,
        maxiter=min(number, 1),
        tol=TOLERANCE,
        rng=rng,
        polish=False,
        updating="deferred",
        vectorized=True,
    )
    population = Population(
        result.population, result.population_energies, objective.z_k(result.population)
    )
    return population, bool(result.success)


def _generation(
    job: Job,
    cases: Sequence[int],
    population: Population,
    evaluations: Sequence[Evaluation],
    begin: float,
) -> Generation:
    names = [recording.name for recording in job.recordings]
    z_k = population.z_k[0]
    hardest = sorted(cases, key=z_k.__getitem__, reverse=True)
    worst, second = hardest[0], hardest[min(1, len(hardest) - 1)]
    unstable = [evaluation.unstable for evaluation in evaluations]
    return Generation(
        z=float(population.z[0]),
        worst=names[worst],
        second=names[second],
        margin=float(1.0 - z_k[second] / z_k[worst]) if np.isfinite(z_k[worst]) else 0.0,
        candidates=len(evaluations),
        samples=sum(evaluation.samples for evaluation in evaluations),
        of=len(evaluations) * sum(job.recordings[k].steps.size for k in cases),
        unstable={names[k]: unstable.count(k) for k in cases if k in unstable},
        crashed=sum(evaluation.crashed for evaluation in evaluations),
        seconds=time.perf_counter() - begin,
    )
