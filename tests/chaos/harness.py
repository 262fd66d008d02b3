"""Ends long commands at random moments, lets them go on, and compares with an undisturbed run.

What must hold, whatever ended a run: the words it ends with are no traceback, no process and no
temporary file of it stays, and going on leads to the results of the run that nothing disturbed.
"""

import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from tests.processes import LONGEST, ROOT, comes_true, living

BEGUN = 0.2  # s from which on a command answers for itself, and no longer Python for it
ROOM = 64 * 2**20  # bytes, more than any of the commands writes
KINDS = ("kill", "interrupt", "terminate", "full disk")


@dataclass(frozen=True)
class Command:
    """A long command.

    Attributes
    ----------
    line : its arguments, to which the folder of its results is added.
    again : options with which it goes on after an end.
    results : what of a folder must be the same; seconds are not.
    """

    name: str
    line: tuple[str, ...]
    again: tuple[str, ...]
    results: Callable[[Path], Any]

    def arguments(self, out: Path, *, again: bool) -> list[str]:
        """Of a new process."""
        return [sys.executable, "-m", *self.line, str(out), *(self.again if again else ())]


@dataclass(frozen=True)
class Failure:
    """What did not hold: "end", "process", "words", "files" or "results", and how."""

    event: str
    message: str

    def __str__(self) -> str:
        return f"{self.event}: {self.message}"


@dataclass(frozen=True)
class Undisturbed:
    """What a command does when it is left alone."""

    command: Command
    results: Any
    seconds: float


def undisturbed(command: Command, folder: Path) -> Undisturbed:
    """Run a command to its end.

    Raises
    ------
    RuntimeError
        If it fails.
    """
    begin = time.monotonic()
    status, output = _run(command, folder, again=False)
    if status != 0:
        raise RuntimeError(f"{command.name}: {output}")
    return Undisturbed(command, command.results(folder / "out"), time.monotonic() - begin)


def disturb(usual: Undisturbed, disturbance: str, random: Random, folder: Path) -> list[Failure]:
    """End a run by one of `KINDS` at a random moment, go on, and compare.

    Returns
    -------
    failures : empty if all that must hold does.
    """
    if disturbance == "full disk":
        return _starved(usual, random.randrange(4, 400) * 1024, folder)
    failures: list[Failure] = []
    with _started(usual.command, folder, again=False) as process:
        try:
            process.wait(random.uniform(BEGUN, usual.seconds))
        except subprocess.TimeoutExpired:
            _send(process, disturbance)
        try:
            process.wait(LONGEST)
        except subprocess.TimeoutExpired:
            failures.append(Failure("end", f"none within {LONGEST:g} s"))
            os.killpg(process.pid, signal.SIGKILL)
    if not comes_true(lambda: not living(process.pid)):
        failures.append(Failure("process", f"{living(process.pid)} stay"))
    failures += _traceback(folder)
    if disturbance != "kill":  # nobody clears up after that, but the next run
        failures += _left(folder)
    return failures + _resumed(usual, folder)


def _resumed(usual: Undisturbed, folder: Path) -> list[Failure]:
    status, output = _run(usual.command, folder, again=True)
    if status != 0:
        return [Failure("results", f"none, status {status}: {output[-300:]}")]
    return _left(folder) + _changed(usual, folder / "out")


def _changed(usual: Undisturbed, out: Path) -> list[Failure]:
    same = usual.command.results(out) == usual.results
    return [] if same else [Failure("results", "others than those of an undisturbed run")]


def _starved(usual: Undisturbed, size: int, folder: Path) -> list[Failure]:
    """Run where the disk is full soon, then with room."""
    (folder / "out").mkdir(parents=True)
    (folder / "tmp").mkdir()
    out = shlex.quote(str(folder / "out"))
    first, again = (
        shlex.join(usual.command.arguments(folder / "out", again=again)) for again in (False, True)
    )
    script = (
        f"mount -t tmpfs -o size={size} tmpfs {out}\n"
        f"{first} >/dev/null 2>{shlex.quote(str(folder / 'said'))}; echo $?\n"
        f"mount -o remount,size={ROOM} {out}\n"
        f"{again} >/dev/null 2>&1; echo $?\n"
        f"cp -r {out} {shlex.quote(str(folder / 'kept'))}\n"
    )
    run = subprocess.run(
        [*_NAMESPACE, "sh", "-c", script],
        cwd=ROOT,
        env=_environment(folder),
        capture_output=True,
        text=True,
        check=False,
    )
    starved, resumed = map(int, run.stdout.split())
    failures = _traceback(folder) + _left(folder)
    if starved not in (0, 2):
        failures.append(Failure("words", f"status {starved} on a full disk of {size} bytes"))
    if resumed != 0:
        return [*failures, Failure("results", f"none after a full disk, status {resumed}")]
    return failures + _changed(usual, folder / "kept")


_NAMESPACE = ("unshare", "--user", "--map-root-user", "--mount")


def can_starve() -> bool:
    """Whether this machine lets users mount a small disk of their own."""
    if shutil.which("unshare") is None:
        return False
    mount = [*_NAMESPACE, "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    return subprocess.run(mount, capture_output=True, check=False).returncode == 0


def _started(command: Command, folder: Path, *, again: bool) -> subprocess.Popen[bytes]:
    (folder / "tmp").mkdir(parents=True, exist_ok=True)
    with (folder / "said").open("wb") as output:
        return subprocess.Popen(
            command.arguments(folder / "out", again=again),
            cwd=ROOT,
            env=_environment(folder),
            stdout=subprocess.DEVNULL,
            stderr=output,
            start_new_session=True,
        )


def _environment(folder: Path) -> dict[str, str]:
    return {**os.environ, "TMPDIR": str(folder / "tmp"), "OMP_NUM_THREADS": "1"}


def _run(command: Command, folder: Path, *, again: bool) -> tuple[int, str]:
    """Exit status of a run to its end, and what it said."""
    with _started(command, folder, again=again) as process:
        status = process.wait()
    return status, (folder / "said").read_text()


def _send(process: subprocess.Popen[bytes], disturbance: str) -> None:
    if disturbance == "interrupt":
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    else:
        process.send_signal(signal.SIGKILL if disturbance == "kill" else signal.SIGTERM)


def _traceback(folder: Path) -> list[Failure]:
    output = (folder / "said").read_text()
    return [Failure("words", output[-300:])] if "Traceback" in output else []


def _left(folder: Path) -> list[Failure]:
    """Temporary files, and those beside which results were being written."""
    parts = [path.name for path in (folder / "out").rglob("*.part")]
    left = sorted(path.name for path in (folder / "tmp").iterdir())
    return [Failure("files", f"{', '.join(parts + left)} stay")] if parts or left else []
