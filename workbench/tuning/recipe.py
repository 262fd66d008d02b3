"""A tuning from a model and recorded cases to gains, and to what they are worth.

That is on cases they have not seen, and each gain by itself.
"""

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError, require_known
from workbench.observers import Estimator, Gains, SearchSpace, estimators_of
from workbench.observers.gains import format_gains
from workbench.observers.replay import replay, run_on_model
from workbench.observers.run import Ending
from workbench.observers.score import score, with_readings
from workbench.observers.trajectory import doubts_along
from workbench.pages.answer import finite
from workbench.recordings.case import Case
from workbench.runtime.engine import StepReporter
from workbench.runtime.pool import NoWorkersError
from workbench.runtime.resources import own_version
from workbench.system.registry import open_model
from workbench.system.system import System
from workbench.tuning.checkpoint import Generation
from workbench.tuning.cost import (
    DIVERGED,
    Candidate,
    Evaluator,
    Job,
    Workers,
    evaluate_all,
    job_estimator,
    load_model,
    recordings,
)
from workbench.tuning.search import Checkpointing, Plan, Search, search

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


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


@dataclass(frozen=True, eq=False)
class Problem:
    """What is tuned, and where it is searched."""

    job: Job
    space: SearchSpace
    cases: tuple[Case, ...]  # that the job's recordings were made from
    meanings: Mapping[str, tuple[str, str]]  # what each gain does, and its unit, by its name
    provenance: Mapping[str, Any]  # what the job was made from, for files of results


@dataclass(frozen=True, eq=False)
class TuningResult:
    """What a tuning came to.

    Attributes
    ----------
    search : the best gains, and how they were found.
    before : (k,) z_k with the model-based gains.
    sensitivities : of each gain; empty after an interruption, and so are the next two.
    beside : (k,) z_k of methods that were not tuned, by name.
    folds : those that were finished.
    interrupted : whether Ctrl-C ended it before its end.
    warned : what the FMU warned of with the best gains; empty: nothing.
    """

    problem: Problem
    plan: Plan
    search: Search
    before: Vector
    interrupted: bool
    sensitivities: Sequence[Sensitivity] = ()
    beside: Mapping[str, Vector] = field(default_factory=dict)
    folds: Sequence[Fold] = ()
    warned: str = ""

    @property
    def gains(self) -> Gains:
        """The gains that were found, for whoever runs the estimator."""
        return self.problem.job.gains.with_values(self.search.best, "tuned")

    def to_frame(self) -> "pd.DataFrame":
        """Gains by name: what each does, its unit, its value, and that before tuning."""
        import pandas as pd

        names, meanings = self.gains.names, self.problem.meanings
        return pd.DataFrame(
            {
                "meaning": [meanings[name][0] for name in names],
                "unit": [meanings[name][1] for name in names],
                "value": self.gains.values,
                "reasoned": self.problem.job.gains.values,
            },
            index=pd.Index(names, name="gain"),
        )

    def to_dict(self) -> dict[str, Any]:
        """All that is known of the tuning, as in summary.json."""
        return summarise_tuning(self)

    def summary(self) -> str:
        """Table of cases, and what is to be said of gains and folds."""
        from workbench.tuning.report import format_tuned

        return format_tuned(self.to_dict())

    def plot(self) -> "Figure":
        """Figure of how the search converged."""
        from workbench.tuning.report import convergence

        return convergence(self.search.history)

    def _repr_html_(self) -> str:
        """Gains as a table, for notebooks."""
        table: str = self.to_frame().to_html()
        return table


class Progress:
    """Is told how a tuning goes; this one keeps it to itself."""

    def begins(self, fold: int) -> None:
        """A search begins: 0 for that on all cases, else the number of a fold."""

    def evolved(self, history: Sequence[Generation]) -> None:
        """A generation is done."""

    def found(self, tuned: TuningResult) -> None:
        """Gains are found; what they are worth is not known yet."""

    def warn(self, message: str) -> None:
        """Something went wrong that the search survives."""


class Lines(Progress):
    """A line on each generation, with the time left."""

    def __init__(self, plan: Plan, report: Callable[[str], None]) -> None:
        self._report = report
        self._generations = StepReporter(report, plan.generations + 1)

    def evolved(self, history: Sequence[Generation]) -> None:
        """See Progress."""
        self._generations.step(f"z {history[-1].z:.5f}")

    def warn(self, message: str) -> None:
        """See Progress."""
        self._report(f"warning: {message}")


def pose(
    system: System,
    estimator: str,
    cases: Sequence[Case],
    scale_errors: Mapping[str, float] | None = None,
    judge_by: str | None = None,
) -> Problem:
    """Gains to start from, bounds to search in, and recordings to score by.

    Parameters
    ----------
    estimator : its name.
    scale_errors : relative [1], by output; see `recordings`. None: as the system says.
    judge_by : estimator to score by where no sensor does, see `with_reference`. None: as measured.
    """
    estimator_class = tunable(system, estimator)
    if judge_by is not None:
        cases = with_reference(cases, system, judge_by)
    if scale_errors is None:
        scale_errors = {
            output.name: output.scale_error for output in system.outputs if output.scale_error
        }
    # A recording shows nothing slower than itself, and its samples carry nothing faster.
    slowest = 1.0 / max(case.time[-1] - case.time[0] for case in cases)
    fastest = 1.0 / max(float(np.median(np.diff(case.time))) for case in cases)
    with open_model(system, estimator_class.role) as model:
        doubts_along(model, system, cases)
        system = with_readings(system, [model])
        gains = estimator_class.default_gains(model, system)
        space = estimator_class.space(model, system, gains, slowest, fastest)
        meanings = estimator_class.meanings(model, system, gains)
        provenance = {
            "workbench": own_version(),
            "python": platform.python_version(),
            "packages": {p: version(p) for p in ("fmpy", "numpy", "scipy", "numba")},
            "system": system.name,
            "fmu": {"file": model.path.name, "model": model.name, "sha256": model.sha256},
            "cases": [case.name for case in cases],
            "scale_errors": dict(scale_errors),
            "weights": dict(system.objective.weights),
            "judged_by": judge_by or "sensors",
        }
        content = model.path.read_bytes()
    recorded = recordings(cases, system, scale_errors)
    job = Job(estimator, system, content, gains, recorded)
    return Problem(job, space, tuple(cases), meanings, provenance)


def tunable(system: System, estimator: str) -> type[Estimator]:
    """An estimator that has gains."""
    tunable = {name: cls for name, cls in estimators_of(system).items() if cls.tunable}
    return _known(estimator, tunable, "", "none with gains of this name")


def _known(
    estimator: str, known: Mapping[str, type[Estimator]], use: str, found: str
) -> type[Estimator]:
    require_known([estimator], known, where=f"estimator '{estimator}'{use}", found=found)
    return known[estimator]


def tune(
    pool: Workers,
    problem: Problem,
    plan: Plan,
    checkpoints: Path,
    *,
    resume: bool = False,
    progress: Progress | None = None,
) -> TuningResult | None:
    """Search on all cases, then find out what the gains are worth.

    Ctrl-C ends the search, or what follows it, and keeps what there is.

    Parameters
    ----------
    pool : workers prepared with the problem's job.
    checkpoints : folder where each search keeps its state after every generation.
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
    before = evaluate_gains(pool, job, [job.gains.values])[0]
    if not np.isfinite(before).all():
        reason = _events(job) or "see 'workbench simulate'"
        raise FMUError(
            f"{problem.provenance['fmu']['file']}: the FMU fails, hangs or diverges with the "
            f"untuned gains, so there is nothing to start from; {reason}"
        )
    result = run.search(0, range(len(job.recordings)))
    if result is None:
        return None
    warned = _warnings(problem, result.best)
    tuned = TuningResult(problem, plan, result, before, result.interrupted, warned=warned)
    run.progress.found(tuned)
    return tuned if result.interrupted else run.examine(tuned)


def _warnings(problem: Problem, gains: Vector) -> str:
    """What is first said of the FMU in a case, with these gains; empty: nothing in any."""
    job = problem.job
    estimator_class = estimators_of(job.system)[job.estimator]
    with open_model(job.system, estimator_class.role) as fmu:
        estimator = estimator_class(fmu, job.system, job.gains.with_values(gains))
        for case in problem.cases:
            run = replay(case, estimator)
            if run.ending is Ending.OK and run.message:
                return f"{case.name}: {run.message}"
    return ""


def _events(job: Job) -> str:
    """What is said of a model whose events the estimator does not go through; empty for others."""
    with load_model(job) as fmu:
        fmu.start({})
        passes = estimators_of(job.system)[job.estimator].passes_events and fmu.saves_state
        if passes or not fmu.has_events:
            return ""
    return (
        f"it has events, which {job.estimator} does not go through. Tune ekf or ukf with an FMU "
        "that saves its state (canGetAndSetFMUState), or replace jumps by smooth functions"
    )


@dataclass(frozen=True, eq=False)
class _Run:
    pool: Workers
    problem: Problem
    plan: Plan
    checkpoints: Path
    resume: bool
    progress: Progress

    def search(self, fold: int, on: Sequence[int]) -> Search | None:
        self.progress.begins(fold)
        file = self.checkpoints / (f"checkpoint_fold{fold}.json" if fold else "checkpoint.json")
        kept = Checkpointing(file, self.resume, self.progress.evolved, self.progress.warn)
        return search(self.pool, self.problem.job, self.problem.space, on, self.plan, kept)

    def examine(self, tuned: TuningResult) -> TuningResult:
        pool, problem, folds = self.pool, self.problem, self.plan.folds
        job = problem.job
        try:
            effects = sensitivities(pool, job, problem.space, tuned.search)
            tuned = replace(tuned, sensitivities=effects)
            tuned = replace(tuned, beside=untuned_filters(job))
            if folds:
                done = cross_validate(
                    pool, job, problem.cases, folds, lambda number, on: self.search(number + 1, on)
                )
                tuned = replace(tuned, folds=done, interrupted=len(done) < folds)
        except KeyboardInterrupt:
            return replace(tuned, interrupted=True)
        except NoWorkersError as error:
            self.progress.warn(f"{error}; what the gains are worth is not known")
            return replace(tuned, interrupted=True)
        return tuned


def tuned_gains(tuned: TuningResult) -> str:
    """The text of gains.toml, with what the gains come from."""
    job, search = tuned.problem.job, tuned.search
    at_bound = tuned.problem.space.at_bound(search.coordinates)
    came_from = {
        **_provenance(tuned),
        "z": search.z,
        "z_k": _by_case(tuned, search.z_k),
        "generations": len(search.history) - 1,
        "interrupted": search.interrupted,
        "at_bound": [n for n, at in zip(job.gains.names, at_bound, strict=True) if at],
    }
    meaning = estimators_of(job.system)[job.estimator].meaning
    return format_gains(job.gains.with_values(search.best), meaning, came_from)


def summarise_tuning(tuned: TuningResult) -> dict[str, Any]:
    """All that is known of a tuning, as it is written to summary.json."""
    search, history, job = tuned.search, tuned.search.history, tuned.problem.job
    following = job.system.following if job.follows else None
    before, after = (_by_case(tuned, z_k) for z_k in (tuned.before, search.z_k))
    return {
        "estimator": job.estimator,
        "label": estimators_of(job.system)[job.estimator].label,
        "judged": job.system.objective.signal,
        "bandwidth": finite(job.system.objective.bandwidth),
        "follows": None if following is None else vars(following),
        "z": search.z,
        "z_reasoned": max(before.values()),
        "cases": {
            name: {
                "z_k": after[name],
                "z_k_reasoned": before[name],
                "unstable": sum(g.unstable.get(name, 0) for g in history),
            }
            for name in after
        },
        "gains": _gains(tuned),
        "sensitivity": {
            e.gain: {
                **{change: finite(getattr(e, change)) for change in ("less", "more", "without")},
                "matters": e.matters,
            }
            for e in tuned.sensitivities
        },
        "folds": [
            {name: finite(v) if isinstance(v, float) else v for name, v in asdict(fold).items()}
            for fold in tuned.folds
        ],
        "beside": {
            name: {
                "label": estimators_of(job.system)[name].label,
                "z": finite(float(z_k.max())),
                "worst": list(after)[int(z_k.argmax())],
            }
            for name, z_k in tuned.beside.items()
        },
        "work": {
            "generations": len(history) - 1,
            "candidates": sum(g.candidates for g in history),
            "seconds": sum(g.seconds for g in history),
            "saved": 1.0 - sum(g.samples for g in history) / sum(g.of for g in history),
            "crashed": sum(g.crashed for g in history),
            "interrupted": search.interrupted,
            "converged": search.converged,
            "as_good": len(_as_good(tuned)),
            "last": len(search.last.z),
            "folds": tuned.plan.folds,  # asked for; an interruption may have left fewer
        },
        "convergence": [g.z for g in history],
        "warned": tuned.warned,
        "provenance": _provenance(tuned),
    }


def _provenance(tuned: TuningResult) -> dict[str, Any]:
    plan = tuned.plan
    return {**tuned.problem.provenance, "seed": plan.seed, "population": plan.population}


def _by_case(tuned: TuningResult, z_k: Vector) -> dict[str, float]:
    names = (recording.name for recording in tuned.problem.job.recordings)
    return dict(zip(names, z_k.tolist(), strict=True))


def _gains(tuned: TuningResult) -> dict[str, dict[str, Any]]:
    job, space, search = tuned.problem.job, tuned.problem.space, tuned.search
    names, reasoned = job.gains.names, job.gains.values
    lower, upper = space.gains(np.array([np.zeros(len(names)), np.ones(len(names))]))
    at_bound, as_good = space.at_bound(search.coordinates), _as_good(tuned)
    return {
        name: {
            "meaning": tuned.problem.meanings[name][0],
            "unit": tuned.problem.meanings[name][1],
            "value": float(search.best[i]),
            "reasoned": float(reasoned[i]),
            "lower": float(lower[i]),
            "upper": float(upper[i]),
            "at_bound": bool(at_bound[i]),
            "as_good": [float(as_good[:, i].min()), float(as_good[:, i].max())],
        }
        for i, name in enumerate(names)
    }


def _as_good(tuned: TuningResult) -> Matrix:
    """Gains of the last candidates whose z is the best but for what does not matter, (s, n)."""
    last = tuned.search.last
    return tuned.problem.space.gains(last.members[last.z <= (1.0 + NEGLIGIBLE) * last.z[0]])


def with_reference(cases: Sequence[Case], system: System, estimator: str) -> list[Case]:
    """Recordings with the estimate of what is judged in the place of its measurement.

    Machines in service lack sensors that a rig has. Measured outputs of the model stay.

    Parameters
    ----------
    estimator : name of one that knows whole recordings; any other would be judged by its like.
    """
    offline = {name: cls for name, cls in estimators_of(system).items() if cls.offline}
    found = "none of this name that knows whole recordings"
    smoother = _known(estimator, offline, " to score by", found)
    referenced = []
    for case in cases:
        run = run_on_model(case, system, smoother)
        if run.ending is not Ending.OK:
            raise InputError(
                where=str(case.source),
                found=f"{estimator}: {run.ending.value} {run.message}".strip(),
                expected="an estimate to score by",
                remedy="leave this case out of the tuning with --cases",
            )
        references = [name for name in system.objective.weights if name not in case.outputs]
        referenced.append(case.with_signals({name: run.signal(name) for name in references}))
    return referenced
