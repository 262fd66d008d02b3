"""A tuning from a model and recorded cases to gains, and to what they are worth."""

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from workbench.case import Case
from workbench.fmu import FMU, FMUError, Vector
from workbench.objective import Weights
from workbench.tuning.checkpoint import Generation
from workbench.tuning.cost import Job, recordings
from workbench.tuning.search import Plan, Search, search
from workbench.tuning.space import SearchSpace, reasoned_gains, search_space, to_vector
from workbench.tuning.validation import (
    Fold,
    Sensitivity,
    cross_validate,
    evaluate_gains,
    sensitivities,
    untuned_filter,
)
from workbench.tuning.workers import Workers

RADIUS_ERROR = 0.0005  # share of a radius: a wheel measured to a quarter of a millimetre


@dataclass(frozen=True, eq=False)
class Problem:
    """What is tuned, and where it is searched.

    Attributes
    ----------
    cases : that the job's recordings were made from.
    provenance : what the job was made from, for files of results.
    """

    job: Job
    space: SearchSpace
    cases: tuple[Case, ...]
    provenance: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Tuned:
    """What a tuning came to.

    Attributes
    ----------
    search : the best gains, and how they were found.
    before : (k,) z_k with the reasoned gains.
    sensitivities : of each gain; empty after an interruption, and so are the next two.
    beside : (k,) z_k of methods that were not tuned, by name.
    folds : those that were finished.
    interrupted : whether Ctrl-C ended it before its end.
    """

    problem: Problem
    plan: Plan
    search: Search
    before: Vector
    interrupted: bool
    sensitivities: Sequence[Sensitivity] = ()
    beside: Mapping[str, Vector] = field(default_factory=dict)
    folds: Sequence[Fold] = ()


class Progress:
    """Is told how a tuning goes; this one keeps it to itself."""

    def begins(self, fold: int) -> None:
        """A search begins: 0 for that on all cases, else the number of a fold."""

    def evolved(self, history: Sequence[Generation]) -> None:
        """A generation is done."""

    def found(self, tuned: Tuned) -> None:
        """Gains are found; what they are worth is not known yet."""

    def warn(self, message: str) -> None:
        """Something went wrong that the search survives."""


def prepare(
    estimator: str,
    fmu: Path,
    names: Mapping[str, str],
    cases: Sequence[Case],
    radius_error: float = RADIUS_ERROR,
) -> Problem:
    """Gains to start from, bounds to search in, and recordings to judge by.

    Parameters
    ----------
    estimator : its name, one of TUNABLE.
    fmu : its model.
    names : our names of variables to those in the FMU.
    radius_error : relative [1]; see `recordings`.

    Raises
    ------
    InputError
        If the FMU is not fit for the estimator, or a case cannot judge.
    """
    weights = Weights()
    # A recording shows nothing slower than itself, and its samples carry nothing faster.
    slowest = 1.0 / max(case.time[-1] - case.time[0] for case in cases)
    fastest = 1.0 / max(float(np.median(np.diff(case.time))) for case in cases)
    with FMU(fmu, names) as model:
        gains = reasoned_gains(estimator, model)
        space = search_space(model, gains, slowest, fastest)
        provenance = {
            "workbench": version("wheelset-workbench"),
            "python": platform.python_version(),
            "packages": {p: version(p) for p in ("fmpy", "numpy", "scipy", "numba")},
            "fmu": {"file": model.path.name, "model": model.name, "sha256": model.sha256},
            "cases": [case.name for case in cases],
            "radius_error": radius_error,
            "weights": asdict(weights),
        }
    judged = recordings(cases, radius_error)
    job = Job(estimator, fmu.read_bytes(), names, gains, judged, weights)
    return Problem(job, space, tuple(cases), provenance)


def tune(
    pool: Workers,
    problem: Problem,
    plan: Plan,
    checkpoints: Path,
    *,
    folds: int = 0,
    resume: bool = False,
    progress: Progress | None = None,
) -> Tuned | None:
    """Search on all cases, then find out what the gains are worth.

    Ctrl-C ends the search, or what follows it, and keeps what there is.

    Parameters
    ----------
    pool : workers prepared with the problem's job.
    checkpoints : folder where each search keeps its state after every generation.
    folds : how many times to tune without a part of the cases and evaluate on it; 0 for none.
    resume : go on from the checkpoints that are there.

    Returns
    -------
    Tuned, or None if it was interrupted before there was anything to return.

    Raises
    ------
    FMUError
        If the reasoned gains fail, so that there is nothing to start from.
    """
    run = _Run(pool, problem, plan, checkpoints, resume, progress or Progress())
    job = problem.job
    before = evaluate_gains(pool, job, [to_vector(job.gains)])[0]
    if not np.isfinite(before).all():
        raise FMUError(
            f"{problem.provenance['fmu']['file']}: the FMU fails, hangs or diverges with the "
            "untuned gains, so there is nothing to start from; see 'python -m workbench simulate'"
        )
    found = run.search(0, range(len(job.recordings)))
    if found is None:
        return None
    tuned = Tuned(problem, plan, found, before, found.interrupted)
    run.progress.found(tuned)
    return tuned if found.interrupted else run.examine(tuned, folds)


@dataclass(frozen=True, eq=False)
class _Run:
    """One call of `tune`."""

    pool: Workers
    problem: Problem
    plan: Plan
    checkpoints: Path
    resume: bool
    progress: Progress

    def search(self, fold: int, on: Sequence[int]) -> Search | None:
        """Search on some cases."""
        self.progress.begins(fold)
        return search(
            self.pool,
            self.problem.job,
            self.problem.space,
            on,
            self.plan,
            self.checkpoints / (f"checkpoint_fold{fold}.json" if fold else "checkpoint.json"),
            resume=self.resume,
            report=self.progress.evolved,
            warn=self.progress.warn,
        )

    def examine(self, tuned: Tuned, folds: int) -> Tuned:
        """Find out what gains are worth; Ctrl-C leaves out the rest."""
        pool, problem = self.pool, self.problem
        job, reasoned = problem.job, to_vector(problem.job.gains)
        try:
            effects = sensitivities(pool, job, problem.space, tuned.search)
            tuned = replace(tuned, sensitivities=effects)
            if job.estimator not in ("ekf", "ukf"):
                tuned = replace(tuned, beside={"ekf": untuned_filter(job)})
            if folds:
                done = cross_validate(
                    *(pool, job, problem.cases, reasoned, folds),
                    lambda number, on: self.search(number + 1, on),
                )
                tuned = replace(tuned, folds=done, interrupted=len(done) < folds)
        except KeyboardInterrupt:
            return replace(tuned, interrupted=True)
        return tuned
