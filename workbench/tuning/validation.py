"""What tuned gains are worth: on cases they have not seen, and each gain by itself."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.observers import SearchSpace, estimators_of
from workbench.observers.replay import replay
from workbench.observers.score import score
from workbench.recordings.case import Case
from workbench.tuning.cost import (
    DIVERGED,
    Candidate,
    Evaluator,
    Job,
    Workers,
    evaluate_all,
    job_estimator,
    load_model,
)
from workbench.tuning.search import Search

STEP = 0.02  # of a gain's search range: a factor of 1.4 to 1.9 in a gain that matters
NEGLIGIBLE = 0.01  # relative change of z that does not matter


@dataclass(frozen=True)
class Fold:
    """Gains tuned without some cases, judged on these."""

    cases: tuple[str, ...]  # left out
    worst: str  # the recording that is worst among them with tuned gains
    tuned: float  # worst z_k over them with gains tuned on the others
    reasoned: float  # the same with untuned gains
    z: float  # worst z_k over the cases that were tuned on
    # error, error_reasoned: worst error of the judged signal over the cases left out, rms over mean
    # [1], with tuned and with untuned gains; nan where it cannot be judged
    error: float
    error_reasoned: float


@dataclass(frozen=True)
class Sensitivity:
    """What z does when one gain is changed and the others stay."""

    gain: str  # its name
    # less, more: relative change of z after a step of the gain down and up its search range
    less: float
    more: float
    without: float  # relative change of z with the gain at zero; infinite if that is no estimator

    @property
    def matters(self) -> bool:
        """Whether z notices the gain."""
        return max(abs(self.less), abs(self.more), abs(self.without)) > NEGLIGIBLE


def evaluate_gains(pool: Workers, job: Job, gains: Sequence[Vector]) -> Matrix:
    """z_k of gains in all cases, (g, k); infinite in all where an estimate diverges."""
    order = tuple(range(len(job.recordings)))
    candidates = [Candidate(values, np.inf, order) for values in gains]
    return np.array([evaluation.z_k for evaluation in evaluate_all(pool, candidates, len(order))])


def untuned_filters(job: Job) -> dict[str, Vector]:
    """z_k, (k,), of the simplest method that makes its gains as it goes, which nobody tuned.

    It is left out where such a method is what is tuned.
    """
    known, system = estimators_of(job.system), job.system
    with load_model(job) as fmu:
        makes = {
            name: estimator.default_gains(fmu, system)
            for name, estimator in known.items()
            if estimator.tunable and estimator.adapts
        }
    if not makes or job.estimator in makes:
        return {}
    name, gains = next(iter(makes.items()))
    order = tuple(range(len(job.recordings)))
    with Evaluator(replace(job, estimator=name, gains=gains, follows=False)) as evaluator:
        return {name: evaluator.evaluate(Candidate(gains.values, np.inf, order)).z_k}


def errors(job: Job, cases: Sequence[Case], gains: Sequence[Vector]) -> Matrix:
    """Error of the judged signal by gains in each case, (g, k), as `Score.nrmse` [1].

    nan where a run failed or a case cannot be judged.
    """
    with load_model(job) as fmu:
        rows = [
            [score(case, replay(case, estimator), job.system).nrmse for case in cases]
            for estimator in (job_estimator(job, fmu, job.gains.with_values(g)) for g in gains)
        ]
    return np.array(rows, dtype=float)


def split(cases: Sequence[str], folds: int) -> list[tuple[int, ...]]:
    """Deal recordings out to folds, so that each holds different conditions and whole cases.

    >>> split(["a", "b", "c", "a", "b", "c"], 2)
    [(0, 2, 3, 5), (1, 4)]
    """
    names = list(dict.fromkeys(cases))
    fold = [names.index(case) % folds for case in cases]
    return [tuple(k for k, mine in enumerate(fold) if mine == number) for number in range(folds)]


def cross_validate(
    pool: Workers,
    job: Job,
    cases: Sequence[Case],
    folds: int,
    tune: Callable[[int, Sequence[int]], Search | None],
) -> list[Fold]:
    """Tune without each fold and judge on it.

    Parameters
    ----------
    cases : that the job's recordings were made from.
    tune : searches on some cases; called with the number of the fold and the cases. Ends the whole
        by returning None or an interrupted search.
    """
    everything, reasoned = range(len(job.recordings)), job.gains.values
    results: list[Fold] = []
    for number, held_out in enumerate(
        split([recording.case for recording in job.recordings], folds)
    ):
        result = tune(number, [k for k in everything if k not in held_out])
        if result is None or result.interrupted:
            break
        tuned, untuned = evaluate_gains(pool, job, [result.best, reasoned])
        names = tuple(dict.fromkeys(job.recordings[k].case for k in held_out))
        left_out = [case for case in cases if case.name in names]
        error, error_untuned = errors(job, left_out, [result.best, reasoned]).max(axis=1)
        worst = max(held_out, key=lambda k: float(tuned[k]))
        results.append(
            Fold(
                cases=names,
                worst=job.recordings[worst].name,
                tuned=float(tuned[worst]),
                reasoned=float(untuned[list(held_out)].max()),
                z=result.z,
                error=float(error),
                error_reasoned=float(error_untuned),
            )
        )
    return results


def sensitivities(pool: Workers, job: Job, space: SearchSpace, result: Search) -> list[Sensitivity]:
    """Change one gain after the other."""
    names = job.gains.names
    changed: list[Vector] = []
    for i in range(len(names)):
        for step in (-STEP, STEP):
            coordinates = result.coordinates.copy()
            coordinates[i] = np.clip(coordinates[i] + step, 0.0, 1.0)
            changed.append(space.gains(coordinates))
        without = result.best.copy()
        without[i] = 0.0
        changed.append(without)
    z = evaluate_gains(pool, job, changed)[:, list(result.cases)].max(axis=1)
    change = np.where(z < DIVERGED, z / result.z - 1.0, np.inf).reshape(-1, 3)
    return [
        Sensitivity(name, float(less), float(more), float(without))
        for name, (less, more, without) in zip(names, change, strict=True)
    ]
