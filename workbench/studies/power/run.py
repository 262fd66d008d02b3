"""Sets of recordings, made by a virtual rig and diagnosed, in worker processes."""

import hashlib
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, as_completed
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from workbench import diagnosis
from workbench.arrays import Vector
from workbench.diagnosis import Diagnosis, Effect, Problem
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Joint, Key
from workbench.diagnosis.inference.rivals import Rivals, gathered
from workbench.diagnosis.inference.score_test import shapes, signatures
from workbench.diagnosis.inference.search import FittedModel, examine, extended
from workbench.diagnosis.inference.verdict import conclude
from workbench.diagnosis.laws import one_law
from workbench.diagnosis.run import Result, ask_fit, with_effects
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.simulator import WhitenedResiduals
from workbench.errors import WorkerError
from workbench.recordings.case import Case, read_cases
from workbench.runtime.engine import ALONE, Engine, StepReporter, silent
from workbench.runtime.pool import Pool
from workbench.studies.power.journal import Journal, SetVerdict, verdict_of
from workbench.studies.power.planting import Group, Planting, Repertoire
from workbench.studies.power.virtual_rig import VirtualRig
from workbench.system.system import System

_NONE: Mapping[Key, tuple[float, Sequence[Case]]] = {}


def diagnose_set(problem: Problem, everything: Path) -> Diagnosis:
    """Diagnose one set of recordings, in this process alone.

    Parameters
    ----------
    everything : FMU with all effects of the problem, at zero.
    """

    def concluded(shown: Problem, _: ResidualModel, fit: Fit) -> Diagnosis:
        return conclude(fit, shown.effects, silent)

    result = _ask(problem, everything, concluded)
    if result.verdict != "found":
        return result
    law = one_law(result, problem, ALONE)
    return result.outdone(law) if law else result


def information_of_set(
    problem: Problem,
    everything: Path,
    others: Mapping[Key, tuple[float, Sequence[Case]]] = _NONE,
) -> tuple[Joint, Sequence[Effect]]:
    """Linearise one set about the nominal model: what it says of each effect and each level.

    Errors have the variance of the sensors' noise; levels and what differs between recordings have
    the tolerances of the system file.

    Parameters
    ----------
    others : by the name of an effect that the catalogue lacks, its size and the same recordings
        with it; its signature is the difference of their errors, over that size.

    Returns
    -------
    joint : of the set.
    effects : that it can show, with their shapes.
    """

    def informed(
        shown: Problem, _: ResidualModel, fit: Fit
    ) -> tuple[Joint, list[WhitenedResiduals], Sequence[Effect]]:
        candidates = [
            (effect, shape)
            for effect in shown.effects
            if not fit.unknowns.presence.unseen(effect)
            for shape in shapes(effect)
        ]
        lin = fit.linearise(fit.at(fit.unknowns.start()), (), candidates)
        lin = replace(lin, variance_factors=np.ones(lin.variance_factors.size))
        joint = fit.quadratics(lin, signatures(candidates))
        return joint, list(lin.residuals), shown.effects

    def begun(_: Problem, __: ResidualModel, fit: Fit) -> Sequence[WhitenedResiduals]:
        return fit.at(fit.unknowns.start()).residuals

    joint, usual, effects = _ask(problem, everything, informed)
    for key, (size, changed) in others.items():
        errors = _ask(replace(problem, cases=changed), everything, begun)
        joint = joint.joined(key, [column / size for column in map(_accounted, errors, usual)])
    return joint, effects


def _accounted(changed: WhitenedResiduals, usual: WhitenedResiduals) -> Vector:
    """What a model with the effect takes from errors and rest, (b*c + q,), as long as both last."""
    blocks = min(len(changed.errors), len(usual.errors))
    errors = np.zeros_like(usual.errors)
    errors[:blocks] = usual.errors[:blocks] - changed.errors[:blocks]
    return np.append(errors.ravel(), usual.rest - changed.rest)


def rivals_of_set(problem: Problem, everything: Path) -> tuple[Diagnosis, Rivals | None]:
    """Diagnose one set, and keep its remaining candidates; None where no cause is found."""

    def concluded(
        shown: Problem, simulations: ResidualModel, fit: Fit
    ) -> tuple[Diagnosis, Rivals | None]:
        result = conclude(fit, shown.effects, silent)
        rivals = result.rivals
        return result, gathered(simulations, fit, result.base, rivals) if rivals else None

    return _ask(problem, everything, concluded)


def distances_in_set(
    problem: Problem, everything: Path, true: str, others: Sequence[str]
) -> tuple[Diagnosis, dict[str, float]]:
    """Diagnose one set, and measure how far effects stay from the true one, each fitted alone.

    What an experiment promises is the least chi-squared of a wrong model, in units of what the
    right one leaves wrong in each channel. The fit of a diagnosis is another one, which lets a
    channel go that is wrong. So each is fitted again, in these units.

    Returns
    -------
    distances : by name [standard deviations], negative if it is nearer than the true one; of those
        that could be fitted.
    """

    def measured(shown: Problem, __: ResidualModel, fit: Fit) -> tuple[Diagnosis, dict[str, float]]:
        result = conclude(fit, shown.effects, silent)
        base, trial = examine(fit, result.base, shown.effects, silent)
        fits: dict[str, FittedModel | None] = {}
        for score in trial.scores():
            name = score.effect.name
            if name in (true, *others) and name not in fits:
                fits[name] = extended(fit, base, score)
        if (right := fits.get(true)) is None:
            return result, {}
        _, settled = fit.least(right.linearised, right.active, right.linearised.variance_factors)
        units = fit.at(settled.point).variance_factors
        least = {
            name: fit.least(fitted.linearised, fitted.active, units)[0]
            for name, fitted in fits.items()
            if fitted is not None
        }
        return result, {
            name: distance(c - least[true]) for name, c in least.items() if name != true
        }

    return _ask(problem, everything, measured)


def distance(chi_squared: float) -> float:
    """Standard deviations of a difference of chi-squared, with its sign."""
    return float(np.sign(chi_squared) * np.sqrt(abs(chi_squared)))


def _ask(
    problem: Problem,
    everything: Path,
    ask: Callable[[Problem, ResidualModel, Fit], Result],
) -> Result:
    """Ask a fit, in this process alone; see `ask_fit`."""
    source = ModelSource(everything, problem.system, problem.system.given)
    return ask_fit(problem, source, ALONE, ask)


_JOURNAL = "sets.jsonl"

Item = TypeVar("Item")


@dataclass(frozen=True, eq=False)
class PowerStudy:
    """Whose power is measured: a diagnosis of what a virtual rig records."""

    problem: Problem  # what is asked of each set, but for its recordings
    rig: VirtualRig  # makes the recordings

    @property
    def system(self) -> System:
        """Of the machine."""
        return self.problem.system

    @property
    def effects(self) -> Sequence[Effect]:
        """What may be found."""
        return self.problem.effects

    @property
    def repertoire(self) -> Repertoire:
        """What can be planted, and what can be found."""
        return Repertoire(self.rig.plantables, tuple(self.effects))

    @contextmanager
    def setup(self) -> Iterator["Setup"]:
        """Build the FMU with all effects, which is there as long as this is open."""
        with tempfile.TemporaryDirectory(prefix="power-", ignore_cleanup_errors=True) as folder:
            problem, everything = with_effects(self.problem, Path(folder), silent)
            yield Setup(problem, self.rig, everything)


@dataclass(frozen=True, eq=False)
class Setup(PowerStudy):
    """How every set is made and diagnosed."""

    everything: Path  # FMU of the observer model with every effect at zero, which diagnoses them

    def problem_of(self, cases: Sequence[Case]) -> Problem:
        """What is asked of a set."""
        return replace(self.problem, cases=cases)

    def record(self, planting: Planting, simulated: Any) -> list[Case]:
        """Write what the rig's sensors make of a simulation, and read it back."""
        with tempfile.TemporaryDirectory() as folder:
            self.rig.write(simulated, planting.gains, Path(folder))
            return read_cases([Path(folder)], self.system)


def diagnose_sets(
    groups: Sequence[Group], study: PowerStudy, engine: Engine, *, seed: int, resume: bool
) -> tuple[list[SetVerdict], bool]:
    """Make and diagnose sets of recordings.

    Parameters
    ----------
    groups : as planned; sets that are diagnosed already are left out.
    engine : whose folder takes the verdicts, and is where a run resumes from.
    seed : of the plan.

    Returns
    -------
    results : of this and of resumed runs.
    interrupted : whether Ctrl-C ended the run; sets that were under way are in the results.
    """
    with study.setup() as setup:
        identity = {
            "seed": seed,
            **study.rig.identity,
            "observer": _hash([setup.everything]),
            "effects": [repr(effect) for effect in study.effects],
            "code": _hash(sorted(f for p in diagnosis.__path__ for f in Path(p).rglob("*.py"))),
        }
        journal = Journal(engine.out / _JOURNAL, identity, resume=resume)
        if journal.damaged:
            numbers = ", ".join(map(str, journal.damaged))
            engine.report(
                f"warning: {_JOURNAL}, lines {numbers} are damaged; these sets are made again"
            )
        known = {result.planting.options for result in journal.results}
        left = [tuple(p for p in group if p.options not in known) for group in groups]
        progress = StepReporter(engine.report, sum(map(len, left)))

        def collect(group: Group, verdicts: list[SetVerdict] | WorkerError) -> None:
            if isinstance(verdicts, WorkerError):
                verdicts = [_failure(planting, verdicts) for planting in group]
            for result in verdicts:
                journal.append(result)
                name = " ".join(f"{n}={gain:g}" for n, gain in result.planting.gains.items())
                causes = ", ".join(cause.effect for cause in result.causes) or result.verdict
                progress.step(f"{name or 'clean':<40} {causes}")

        groups = [group for group in left if group]
        return journal.results, work_off(setup, engine, _evaluate, groups, collect)


def work_off(
    setup: Setup,
    engine: Engine,
    function: Callable[[Setup, Item], Result],
    items: Sequence[Item],
    collect: Callable[[Item, Result | WorkerError], None],
) -> bool:
    """Have workers take items, and collect what comes of each, in the order in which it does.

    Isolated: Ctrl-C leaves alone what is under way, which is collected, and a crash costs one item.

    Returns
    -------
    interrupted : whether Ctrl-C ended it.
    """
    with Pool(engine.workers, nullcontext, setup, isolated=True) as pool:
        open_tasks = {pool.submit(function, item): item for item in items}

        def finish(task: Future[Result]) -> None:
            item = open_tasks.pop(task)
            try:
                result: Result | WorkerError = task.result()
            except WorkerError as error:  # a crash must not end a run of hours; it is counted
                result = error
            collect(item, result)

        try:
            for task in as_completed(list(open_tasks)):
                finish(task)
        except KeyboardInterrupt:
            engine.report("interrupted, finishing the sets that are under way")
            pool.finish()
            for task in [open_task for open_task in open_tasks if not open_task.cancelled()]:
                finish(task)
            return True
    return False


def _failure(planting: Planting, error: Exception, seconds: float = 0.0) -> SetVerdict:
    return SetVerdict(planting, "failed", (), None, None, seconds, repr(error))


def _evaluate(setup: Setup, group: Group) -> list[SetVerdict]:
    """Simulate once, then record and diagnose each set of a group, in a process of its own."""
    results: list[SetVerdict] = []
    simulated: Any = None
    for planting in group:
        begin = time.perf_counter()
        try:
            if simulated is None:
                simulated = setup.rig.simulate(planting.seed, planting.gains)
            cases = setup.record(planting, simulated)
            result = diagnose_set(setup.problem_of(cases), setup.everything)
        except Exception as error:  # one set must not end a run of hours; it is counted
            results.append(_failure(planting, error, time.perf_counter() - begin))
        else:
            seconds = time.perf_counter() - begin
            results.append(verdict_of(planting, result, setup.repertoire, seconds))
    return results


def _hash(paths: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()
