"""Sets of recordings, made by a virtual rig and diagnosed, in worker processes."""

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
from typing import Any

from threadpoolctl import threadpool_limits

from workbench import diagnosis
from workbench.case import read_cases
from workbench.diagnosis import Effect
from workbench.power.diagnosing import build_everything, diagnose_set
from workbench.power.journal import Diagnosed, Journal, diagnosed
from workbench.power.planting import Group, Repertoire
from workbench.power.virtual_rig import VirtualRig
from workbench.system import System

_JOURNAL = "sets.jsonl"


@dataclass(frozen=True)
class Setup:
    """How every set is made and diagnosed.

    Attributes
    ----------
    rig : makes the recordings.
    everything : FMU of the observer model with every effect at zero, which diagnoses them.
    effects : that it has.
    """

    system: System
    rig: VirtualRig
    everything: Path
    effects: tuple[Effect, ...]

    @property
    def repertoire(self) -> Repertoire:
        """What can be planted, and what can be found."""
        return Repertoire(self.rig.plantables, self.effects)


def diagnose_sets(
    groups: Sequence[Group],
    system: System,
    rig: VirtualRig,
    effects: Sequence[Effect],
    out: Path,
    *,
    seed: int,
    workers: int,
    resume: bool,
    report: Callable[[str], None],
) -> tuple[list[Diagnosed], bool]:
    """Make and diagnose sets of recordings.

    Parameters
    ----------
    groups : as planned; sets that are diagnosed already are left out.
    rig : makes the recordings.
    effects : of the system's library, which may be found.
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
    with tempfile.TemporaryDirectory(prefix="power-", ignore_cleanup_errors=True) as scratch:
        setup = Setup(system, rig, Path(scratch) / "AllEffects.fmu", tuple(effects))
        build_everything(system, effects, setup.everything)
        identity = {
            "seed": seed,
            **rig.identity,
            "observer": _hash([setup.everything]),
            "effects": [repr(effect) for effect in effects],
            "code": _hash(sorted(f for p in diagnosis.__path__ for f in Path(p).glob("*.py"))),
        }
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
    """Diagnose all groups; returns whether the run was interrupted."""
    total = sum(map(len, groups))
    begin, done = time.perf_counter(), 0
    waiting = list(reversed(groups))
    running: set[Future[list[Diagnosed]]] = set()

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


def _evaluate(group: Group, setup: Setup) -> list[Diagnosed]:
    """Simulate once, then record and diagnose each set of a group, in a process of its own."""
    results: list[Diagnosed] = []
    simulated: Any = None
    for planting in group:
        begin = time.perf_counter()
        try:
            if simulated is None:
                simulated = setup.rig.simulate(planting.seed, planting.gains)
            with tempfile.TemporaryDirectory() as folder:
                setup.rig.write(simulated, planting.gains, Path(folder))
                cases = read_cases([Path(folder)], setup.system)
            found = diagnose_set(setup.system, setup.effects, setup.everything, cases)
        except Exception as error:  # one set must not end a run of hours; it is counted
            seconds = time.perf_counter() - begin
            results.append(Diagnosed(planting, "failed", (), None, None, seconds, repr(error)))
        else:
            seconds = time.perf_counter() - begin
            results.append(diagnosed(planting, found, setup.repertoire, seconds))
    return results


def _hash(paths: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()
