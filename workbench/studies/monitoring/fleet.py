"""Many machines of one kind, one task for each: their recordings lie wherever they are kept.

A worker copies what is new of a machine's recordings to itself, goes on from the state that it is
given, and hands back files: it needs no folder in common with who asks.
"""

import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import Future, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from workbench.errors import InputError
from workbench.runtime.engine import Engine, StepReporter
from workbench.runtime.files import write_whole
from workbench.studies.monitoring import STATE, MonitoringResult, Reader, monitor
from workbench.system.system import System


@dataclass(frozen=True)
class Fleet:
    """Machines that are watched, and how; workers are sent it."""

    system: System
    location: str  # folder that holds one for each machine, or its URL, which fsspec reads
    rate: float  # alarms per recording that a sound machine may raise
    read: Reader  # makes a case of a folder
    # writes a result into a folder. Functions of modules.
    write: Callable[[MonitoringResult, Path], object]

    @property
    def _remote(self) -> Any:
        """File system and path of a URL; None of a folder of this machine."""
        if "://" not in self.location:
            return None
        import fsspec  # an extra: folders need none

        return fsspec.url_to_fs(self.location)

    def machines(self) -> list[str]:
        """Names of all machines."""
        try:
            if (remote := self._remote) is None:
                entries = [path for path in Path(self.location).iterdir() if path.is_dir()]
                names = sorted(entry.name for entry in entries if not entry.name.startswith("."))
            else:
                system, path = remote
                listed = system.ls(path, detail=True)
                names = sorted(Path(o["name"]).name for o in listed if o["type"] == "directory")
            reason = "a folder without folders"
        except (OSError, ValueError, ImportError) as error:
            names, reason = [], f"what cannot be read ({error})"
        if not names:
            raise InputError(
                where=self.location,
                found=reason,
                expected="a folder for each machine, which holds one for each recording",
                remedy="correct it; other kinds of URLs need the packages that fsspec names",
            )
        return names

    def fetch(self, machine: str, to: Path) -> Path:
        """Folder of a machine's recordings; copies those that are not on this computer."""
        if (remote := self._remote) is None:
            return Path(self.location) / machine
        system, path = remote
        base = f"{path.rstrip('/')}/{machine}"
        for file in system.find(base):
            target = to / file.removeprefix(base).lstrip("/")
            target.parent.mkdir(parents=True, exist_ok=True)
            system.get_file(file, str(target))
        return to


@dataclass(frozen=True)
class MachineResult:
    """What became of one machine."""

    machine: str
    recordings: int = 0  # that count
    alarms: int = 0  # in all of them
    refusal: str = ""  # why there is no result; empty if there is one
    files: dict[str, bytes] = field(default_factory=dict)  # that were written, by name


class FleetWorkers(Protocol):
    """A pool of this machine, or of a cluster."""

    def submit(
        self, function: Callable[[Fleet, str, bytes], MachineResult], name: str, state: bytes, /
    ) -> "Future[MachineResult]":
        """Have a worker watch a machine."""


@contextmanager
def open_fleet(fleet: Fleet) -> Iterator[Fleet]:
    """Prepare a worker: it needs no more than the fleet."""
    yield fleet


def watch_machine(fleet: Fleet, machine: str, state: bytes) -> MachineResult:
    """Watch one machine, in a worker.

    Parameters
    ----------
    state : that an earlier run left; empty: none.
    """
    with tempfile.TemporaryDirectory() as temporary:
        out = Path(temporary) / "out"
        out.mkdir()
        if state:
            (out / STATE).write_bytes(state)
        try:
            folder = fleet.fetch(machine, Path(temporary) / "recordings")
            engine = Engine(out=out)
            result = monitor(fleet.system, folder, engine, rate=fleet.rate, read=fleet.read)
            fleet.write(result, out)
        except InputError as error:
            return MachineResult(machine, refusal=str(error))
        except Exception as error:  # one machine must not cost the others; it is listed
            return MachineResult(machine, refusal=f"{machine}: {error!r}")
        files = {path.name: path.read_bytes() for path in sorted(out.iterdir())}
        return MachineResult(machine, len(result.names), len(result.changes), "", files)


def watch_fleet(
    fleet: Fleet, engine: Engine, pool: FleetWorkers
) -> tuple[list[MachineResult], bool]:
    """Watch all machines, each into a folder of its own.

    Parameters
    ----------
    engine : whose folder holds those of the machines, from whose states a run goes on.

    Returns
    -------
    watched : by name.
    interrupted : whether Ctrl-C left some out; their states are as they were.
    """
    names, results, interrupted = fleet.machines(), list[MachineResult](), False
    tasks: list[Future[MachineResult]] = []
    progress = StepReporter(engine.report, len(names))
    try:
        for name in names:
            before = engine.out / name / STATE
            state = before.read_bytes() if before.is_file() else b""
            tasks.append(pool.submit(watch_machine, name, state))
        for task in as_completed(tasks):
            result = task.result()
            for file, content in result.files.items():
                write_whole(engine.out / result.machine / file, content)
            results.append(result)
            progress.step(result.machine)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        for task in tasks:
            task.cancel()
    return sorted(results, key=lambda machine: machine.machine), interrupted
