"""Sets of recordings, made by a virtual rig and diagnosed, in worker processes."""

import hashlib
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from workbench import diagnosis
from workbench.diagnosis import Effect, Problem
from workbench.diagnosis.run import with_effects
from workbench.errors import WorkerError
from workbench.recordings.case import Case, read_cases
from workbench.runtime.engine import Engine, silent
from workbench.runtime.pool import Pool
from workbench.runtime.progress import StepReporter
from workbench.studies.power.diagnosing import diagnose_set
from workbench.studies.power.journal import Journal, SetVerdict, verdict_of
from workbench.studies.power.planting import Group, Planting, Repertoire
from workbench.studies.power.virtual_rig import VirtualRig
from workbench.system.system import System

_JOURNAL = "sets.jsonl"

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Setup:
    """How every set is made and diagnosed."""

    rig: VirtualRig  # makes the recordings
    asked: Problem  # of each set, but for its recordings
    everything: Path  # FMU of the observer model with every effect at zero, which diagnoses them

    @property
    def system(self) -> System:
        """Of the machine."""
        return self.asked.system

    def problem(self, cases: Sequence[Case]) -> Problem:
        """What is asked of a set."""
        return replace(self.asked, cases=cases)

    def record(self, planting: Planting, simulated: Any) -> list[Case]:
        """Write what the rig's sensors make of a simulation, and read it back."""
        with tempfile.TemporaryDirectory() as folder:
            self.rig.write(simulated, planting.gains, Path(folder))
            return read_cases([Path(folder)], self.system)

    @property
    def repertoire(self) -> Repertoire:
        """What can be planted, and what can be found."""
        return Repertoire(self.rig.plantables, tuple(self.asked.effects))


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

    @contextmanager
    def setup(self) -> Iterator[Setup]:
        """Build the FMU with all effects, which is there as long as this is open."""
        with tempfile.TemporaryDirectory(prefix="power-", ignore_cleanup_errors=True) as folder:
            yield Setup(self.rig, *with_effects(self.problem, Path(folder), silent))


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
            result = diagnose_set(setup.problem(cases), setup.everything)
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
