"""What tuned gains are worth: on cases they have not seen, and each gain by itself."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.case import Case
from workbench.cosim import observe
from workbench.fmu import Matrix, Vector
from workbench.objective import score
from workbench.observers import ExtendedKalmanFilter, FilterNoise
from workbench.tuning.cost import DIVERGED, Candidate, Evaluator, Job, load_model
from workbench.tuning.search import Search
from workbench.tuning.space import SearchSpace, build, from_vector, gain_names, to_vector
from workbench.tuning.workers import Workers, evaluate_all

STEP = 0.02  # of a gain's search range: a factor of 1.4 to 1.9 in a gain that matters
NEGLIGIBLE = 0.01  # relative change of z that does not matter


@dataclass(frozen=True)
class Fold:
    """Gains tuned without some cases, judged on these.

    Attributes
    ----------
    cases : left out.
    worst : the recording that is worst among them with tuned gains.
    tuned : worst z_k over them with gains tuned on the others.
    reasoned : the same with untuned gains.
    z : worst z_k over the cases that were tuned on.
    force, force_reasoned : worst error of the creep force over the cases left out, rms over mean
        below 5 Hz [1], with tuned and with untuned gains; nan where it cannot be judged.
    """

    cases: tuple[str, ...]
    worst: str
    tuned: float
    reasoned: float
    z: float
    force: float
    force_reasoned: float


@dataclass(frozen=True)
class Sensitivity:
    """What z does when one gain is changed and the others stay.

    Attributes
    ----------
    gain : its name.
    less, more : relative change of z after a step of the gain down and up its search range.
    without : relative change of z with the gain at zero; infinite if that is no estimator.
    """

    gain: str
    less: float
    more: float
    without: float

    @property
    def matters(self) -> bool:
        """Whether z notices the gain."""
        return max(abs(self.less), abs(self.more), abs(self.without)) > NEGLIGIBLE


def evaluate_gains(pool: Workers, job: Job, gains: Sequence[Vector]) -> Matrix:
    """z_k of gains in all cases, (g, k); infinite in all where an estimate diverges."""
    order = tuple(range(len(job.recordings)))
    candidates = [Candidate(values, np.inf, order) for values in gains]
    return np.array([one.z_k for one in evaluate_all(pool, candidates, len(order))])


def untuned_filter(job: Job) -> Vector:
    """z_k of an EKF with the noise levels of the sensors, which nobody tuned, (k,)."""
    kalman = replace(
        job, estimator=ExtendedKalmanFilter.name, gains=FilterNoise(), friction_left=np.inf
    )
    order = tuple(range(len(job.recordings)))
    with Evaluator(kalman) as evaluator:
        return evaluator.evaluate(Candidate(to_vector(FilterNoise()), np.inf, order)).z_k


def force_errors(job: Job, cases: Sequence[Case], gains: Sequence[Vector]) -> Matrix:
    """Error of the creep force by gains in each case, (g, k), as `Score.Fx_nrmse` [1].

    nan where a run failed or a case cannot be judged.
    """
    with load_model(job) as fmu:
        radius = fmu.defaults["rR"]
        errors = [
            [score(case, observe(case, one), radius, job.weights).Fx_nrmse for case in cases]
            for one in (build(job.estimator, fmu, from_vector(job.gains, g)) for g in gains)
        ]
    return np.array(errors, dtype=float)


def split(stops: Sequence[str], folds: int) -> list[tuple[int, ...]]:
    """Deal recordings out to folds, so that each holds different conditions and whole stops.

    >>> split(["a", "b", "c", "a", "b", "c"], 2)
    [(0, 2, 3, 5), (1, 4)]
    """
    names = list(dict.fromkeys(stops))
    fold = [names.index(stop) % folds for stop in stops]
    return [tuple(k for k, mine in enumerate(fold) if mine == number) for number in range(folds)]


def cross_validate(
    pool: Workers,
    job: Job,
    cases: Sequence[Case],
    reasoned: Vector,
    folds: int,
    tune: Callable[[int, Sequence[int]], Search | None],
) -> list[Fold]:
    """Tune without each fold and judge on it.

    Parameters
    ----------
    cases : that the job's recordings were made from.
    reasoned : (n,) untuned gains.
    tune : searches on some cases; called with the number of the fold and the cases. Ends the whole
        by returning None or an interrupted search.
    """
    everything = range(len(job.recordings))
    results: list[Fold] = []
    for number, held_out in enumerate(split([one.stop for one in job.recordings], folds)):
        found = tune(number, [k for k in everything if k not in held_out])
        if found is None or found.interrupted:
            break
        tuned, untuned = evaluate_gains(pool, job, [found.best, reasoned])
        names = tuple(dict.fromkeys(job.recordings[k].stop for k in held_out))
        left_out = [case for case in cases if case.name in names]
        force, force_untuned = force_errors(job, left_out, [found.best, reasoned]).max(axis=1)
        worst = max(held_out, key=lambda k: float(tuned[k]))
        results.append(
            Fold(
                cases=names,
                worst=job.recordings[worst].name,
                tuned=float(tuned[worst]),
                reasoned=float(untuned[list(held_out)].max()),
                z=found.z,
                force=float(force),
                force_reasoned=float(force_untuned),
            )
        )
    return results


def sensitivities(pool: Workers, job: Job, space: SearchSpace, found: Search) -> list[Sensitivity]:
    """Change one gain after the other."""
    names = gain_names(job.gains)
    changed: list[Vector] = []
    for i in range(len(names)):
        for step in (-STEP, STEP):
            coordinates = found.coordinates.copy()
            coordinates[i] = np.clip(coordinates[i] + step, 0.0, 1.0)
            changed.append(space.gains(coordinates))
        without = found.best.copy()
        without[i] = 0.0
        changed.append(without)
    z = evaluate_gains(pool, job, changed)[:, list(found.cases)].max(axis=1)
    change = np.where(z < DIVERGED, z / found.z - 1.0, np.inf).reshape(-1, 3)
    return [
        Sensitivity(name, float(less), float(more), float(without))
        for name, (less, more, without) in zip(names, change, strict=True)
    ]
