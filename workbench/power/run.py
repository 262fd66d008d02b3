"""Sets of stops, made by the reference model and diagnosed, in worker processes."""

import hashlib
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, as_completed
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from workbench import diagnosis, rig
from workbench.case import read_cases
from workbench.diagnosis import CATALOGUE
from workbench.diagnosis.evidence import Court
from workbench.diagnosis.extension import build, source
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.verdict import judge
from workbench.fmu import CoSimulation
from workbench.pool import Pool, WorkerError
from workbench.power.journal import Journal, Judged, judged
from workbench.power.planting import Group
from workbench.rig import Scenario, Stop, simulate, write_recording

_RATE = 200  # [Hz] of the recordings
_JOURNAL = "sets.jsonl"


@dataclass(frozen=True)
class Setup:
    """How every set is made and diagnosed.

    Attributes
    ----------
    scenarios : the stops of a set.
    reference : multibody model, a Co-Simulation FMU, which makes the recordings.
    everything : FMU of the observer model with every effect at zero, which diagnoses them.
    """

    scenarios: tuple[Scenario, ...]
    reference: Path
    everything: Path


def measure_power(
    groups: Sequence[Group],
    scenarios: Sequence[Scenario],
    reference: Path,
    package: Path,
    out: Path,
    *,
    seed: int,
    workers: int,
    resume: bool,
    report: Callable[[str], None],
) -> tuple[list[Judged], bool]:
    """Make and diagnose sets of stops.

    Parameters
    ----------
    groups : as planned; sets that are judged already are left out.
    scenarios : the stops of a set.
    reference : multibody model that makes the recordings.
    package : `package.mo` of the Modelica library that diagnoses them.
    out : folder of the verdicts, and where a run resumes from.
    seed : of the plan.
    report : takes a line on each set.

    Returns
    -------
    results : of this and of resumed runs.
    interrupted : whether Ctrl-C ended the run; sets that were under way are in the results.

    Raises
    ------
    InputError
        If a model is not what it should be, or verdicts of another run are there.
    """
    with CoSimulation(reference):
        pass  # a file that is no FMU is refused here, once
    with tempfile.TemporaryDirectory(prefix="power-", ignore_cleanup_errors=True) as scratch:
        setup = Setup(tuple(scenarios), reference, Path(scratch) / "AllEffects.fmu")
        text = source("AllEffects", CATALOGUE, {}, {}, "Observer model with every effect, at zero")
        build(package, "AllEffects", text, setup.everything, every_platform=False)
        identity = {
            "seed": seed,
            "scenarios": [repr(scenario) for scenario in scenarios],
            "reference": _hash([reference]),
            "observer": _hash([setup.everything]),
            "code": _hash(sorted(f for m in (diagnosis, rig) for f in _sources(m.__path__))),
        }
        out.mkdir(parents=True, exist_ok=True)
        journal = Journal(out / _JOURNAL, identity, resume=resume)
        known = {one.planting.options for one in journal.results}
        left = [tuple(p for p in group if p.options not in known) for group in groups]
        interrupted = _run([one for one in left if one], setup, workers, journal, report)
        return journal.results, interrupted


def _run(
    groups: Sequence[Group],
    setup: Setup,
    workers: int,
    journal: Journal,
    report: Callable[[str], None],
) -> bool:
    """Judge all groups; returns whether the run was interrupted."""
    total = sum(map(len, groups))
    begin, done = time.perf_counter(), 0

    def collect(task: Future[list[Judged]]) -> None:
        nonlocal done
        for result in _results(task, open_tasks.pop(task)):
            journal.append(result)
            done += 1
            left = (time.perf_counter() - begin) / done * (total - done)
            name = " ".join(f"{n}={gain:g}" for n, gain in result.planting.gains.items())
            said = ", ".join(one.effect for one in result.causes) or result.verdict
            report(f"[{done:>4}/{total}] {name or 'clean':<40} {said}  about {left:.0f} s left")

    # Isolated: Ctrl-C is to leave alone what is under way, and a crash is to cost one group.
    with Pool(workers, nullcontext, setup, isolated=True) as pool:
        open_tasks = {pool.submit(_evaluate, group): group for group in groups}
        try:
            for task in as_completed(list(open_tasks)):
                collect(task)
        except KeyboardInterrupt:
            report("interrupted, finishing the sets that are under way")
            pool.finish()
            for task in [one for one in open_tasks if not one.cancelled()]:
                collect(task)
            return True
    return False


def _results(task: "Future[list[Judged]]", group: Group) -> list[Judged]:
    """What became of a group; a crash must not end a run of hours, and is counted."""
    try:
        return task.result()
    except WorkerError as error:
        return [Judged(one, "failed", (), None, None, 0.0, repr(error)) for one in group]


def _evaluate(setup: Setup, group: Group) -> list[Judged]:
    """Simulate once, then record and diagnose each set of a group, in a process of its own."""
    results: list[Judged] = []
    stops: list[Stop] = []
    for planting in group:
        begin = time.perf_counter()
        try:
            effects = planting.effects
            if not stops:
                stops = [
                    simulate(scenario, planting.seed, effects, setup.reference)
                    for scenario in setup.scenarios
                ]
            with tempfile.TemporaryDirectory() as folder:
                for stop in stops:
                    write_recording(stop, effects, _RATE, Path(folder) / stop.scenario.name)
                cases = read_cases([Path(folder)])
            with Court(setup.everything, {}, cases, 1) as court:
                found = judge(Fit(court, CATALOGUE), CATALOGUE, lambda _: None)
        except Exception as error:  # one set must not end a run of hours; it is counted
            seconds = time.perf_counter() - begin
            results.append(Judged(planting, "failed", (), None, None, seconds, repr(error)))
        else:
            results.append(judged(planting, found, time.perf_counter() - begin))
    return results


def _sources(folders: Sequence[str]) -> list[Path]:
    return [path for folder in folders for path in Path(folder).glob("*.py")]


def _hash(paths: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()
