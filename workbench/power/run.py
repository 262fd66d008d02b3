"""Sets of stops, made by the reference model and diagnosed, in worker processes."""

import hashlib
import multiprocessing
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

from threadpoolctl import threadpool_limits

from workbench import diagnosis, rig
from workbench.case import read_cases
from workbench.diagnosis import Effect
from workbench.diagnosis.evidence import Court
from workbench.diagnosis.extension import build, source
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.verdict import judge
from workbench.fmu import CoSimulation
from workbench.modelica import Library
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
    effects : that it has.
    """

    scenarios: tuple[Scenario, ...]
    reference: Path
    everything: Path
    effects: tuple[Effect, ...]


def measure(
    groups: Sequence[Group],
    scenarios: Sequence[Scenario],
    reference: Path,
    library: Library,
    base: str,
    effects: Sequence[Effect],
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
    library, base : the Modelica library that diagnoses them, and name of its observer model.
    effects : of the library, that are considered.
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
        everything = Path(scratch) / "AllEffects.fmu"
        setup = Setup(tuple(scenarios), reference, everything, tuple(effects))
        about = "Observer model with every effect, at zero"
        text = source(library, base, "AllEffects", effects, {}, {}, about)
        build(library, "AllEffects", text, everything, every_platform=False)
        identity = {
            "seed": seed,
            "scenarios": [repr(scenario) for scenario in scenarios],
            "reference": _hash([reference]),
            "observer": _hash([everything]),
            "effects": [repr(effect) for effect in effects],
            "code": _hash(sorted(f for m in (diagnosis, rig) for f in _sources(m.__path__))),
        }
        out.mkdir(parents=True, exist_ok=True)
        journal = Journal(out / _JOURNAL, identity, resume=resume)
        known = {one.planting.options for one in journal.results}
        left = [tuple(p for p in group if p.options not in known) for group in groups]
        interrupted = _run([one for one in left if one], setup, workers, scratch, journal, report)
        return journal.results, interrupted


def _run(
    groups: Sequence[Group],
    setup: Setup,
    workers: int,
    scratch: str,
    journal: Journal,
    report: Callable[[str], None],
) -> bool:
    """Judge all groups; returns whether the run was interrupted."""
    total = sum(map(len, groups))
    begin, done = time.perf_counter(), 0
    waiting = list(reversed(groups))
    running: set[Future[list[Judged]]] = set()

    def collect() -> None:
        nonlocal done
        finished = wait(running, return_when=FIRST_COMPLETED).done
        for future in finished:
            running.discard(future)
            for result in future.result():
                journal.append(result)
                done += 1
                left = (time.perf_counter() - begin) / done * (total - done)
                name = " ".join(f"{n}={gain:g}" for n, gain in result.planting.gains.items())
                said = ", ".join(one.effect for one in result.causes) or result.verdict
                report(f"[{done:>4}/{total}] {name or 'clean':<40} {said}  about {left:.0f} s left")

    # Not forked: a fork of a process with threads may lock up.
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, spawn, _begin, (scratch,)) as pool:
        try:
            while waiting or running:
                # No more than can be worked on at once: Ctrl-C waits for what is under way.
                while waiting and len(running) < workers:
                    running.add(pool.submit(_evaluate, waiting.pop(), setup))
                collect()
        except KeyboardInterrupt:
            report("interrupted, finishing the sets that are under way")
            while running:
                collect()
            return True
    return False


def _begin(scratch: str) -> None:
    """Prepare a process: it leaves Ctrl-C to the master and does not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_master, daemon=True).start()
    tempfile.tempdir = scratch
    # Matrices are small: with a pool of BLAS threads each, processes wait for one another.
    threadpool_limits(1)


def _end_with_master() -> None:
    if (master := multiprocessing.parent_process()) is not None:
        master.join()
        for child in multiprocessing.active_children():
            child.kill()
        os._exit(1)


def _evaluate(group: Group, setup: Setup) -> list[Judged]:
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
                found = judge(Fit(court, setup.effects), setup.effects, lambda _: None)
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
