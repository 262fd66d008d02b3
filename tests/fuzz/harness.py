"""Reads mutants in this process, and notes what a reader must not do.

A reader of what users give may refuse it in words, or take it. Anything else is a failure: another
exception, more than ten seconds, a file outside of the folder it was given, a file that stays
behind, or a value that cannot be.
"""

import os
import shutil
import signal
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from types import FrameType
from typing import Any

import pytest

from tests.fuzz.mutations import Files, change_one
from workbench.errors import FMUError, InputError

LONGEST = 10.0  # s of processor time
# A reader that waits takes none of it; a machine that has other work lets readers wait.
LONGEST_WAIT = 60.0  # s
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = frozenset(
    f"os.{name}" for name in ("mkdir", "rename", "remove", "rmdir", "link", "symlink", "truncate")
)


@dataclass(frozen=True)
class Target:
    """A kind of file and its reader.

    Attributes
    ----------
    original : files by name, which are accepted as they are.
    read : reads what is in a folder.
    impossible : why a value that was read cannot be; empty if it can.
    change : makes a mutant; says what happened to it.
    """

    name: str
    original: Files
    read: Callable[[Path], Any]
    impossible: Callable[[Any], str] = lambda _: ""
    change: Callable[[Files, Random], tuple[Files, str]] = change_one


@dataclass(frozen=True)
class Failure:
    """A mutant that was not read as it should; `target`, `seed` and `number` make it again."""

    target: str
    seed: int
    number: int
    mutation: str
    message: str

    def __str__(self) -> str:
        mutant = f"{self.target}, seed {self.seed}, number {self.number} ({self.mutation})"
        return f"{mutant}: {self.message}"


@dataclass
class Report:
    """Outcomes by target, and what failed."""

    outcomes: dict[str, Counter[str]] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)


class Hang(BaseException):
    """A reader takes too long; no reader catches this."""


def generator(target: str, seed: int, number: int) -> Random:
    """What one mutant is drawn from, whatever was drawn before."""
    return Random(f"{target} {seed} {number}")


def fuzz(target: Target, seed: int, numbers: range, keep: Path | None = None) -> Report:
    """Read mutants of one target.

    Parameters
    ----------
    numbers : of the mutants.
    keep : folder in which those that fail are kept.
    """
    report = Report({target.name: Counter()})
    with tempfile.TemporaryDirectory(prefix="fuzz-") as scratch, _apart(Path(scratch)):
        for number in numbers:
            folder = Path(scratch) / "mutant"
            mutant, mutation = target.change(target.original, generator(target.name, seed, number))
            write(mutant, folder)
            outcome, reason = _outcome(target, folder, Path(scratch))
            report.outcomes[target.name][outcome] += 1
            if reason:
                failure = Failure(target.name, seed, number, mutation, reason)
                report.failures.append(failure)
                if keep is not None:
                    kept = keep / f"{target.name}-{seed}-{number}"
                    write({**mutant, "said.txt": f"{failure}\n".encode()}, kept)
            shutil.rmtree(folder)
    return report


def write(files: Files, folder: Path) -> None:
    """Write files into a folder, which is made as needed."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)


def _outcome(target: Target, folder: Path, scratch: Path) -> tuple[str, str]:
    """Class of what happened, and what was wrong with it; empty if nothing was."""
    outside: list[str] = []
    try:
        with _limited(), _watched(scratch, outside), warnings.catch_warnings(action="error"):
            value = target.read(folder)
    except (InputError, FMUError):
        outcome, reason = "refused", ""
    except Hang:
        outcome, reason = "hang", f"more than {LONGEST:g} s of processor time"
    except Exception as error:
        name = type(error).__name__
        outcome, reason = name, f"{name}: {error}"[:300]
    else:
        reason = target.impossible(value)
        outcome = "impossible" if reason else "accepted"
    left = sorted(path.name for path in (scratch / "tmp").iterdir())
    shutil.rmtree(scratch / "tmp")
    (scratch / "tmp").mkdir()
    if outside:
        return "writes outside", ", ".join(outside)
    if left and not reason:
        return "leaves files", ", ".join(left)
    return outcome, reason


@contextmanager
def _apart(folder: Path) -> Iterator[None]:
    """A temporary folder of its own, in which to see what stays, and a cache beside it."""
    (folder / "tmp").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempfile, "tempdir", str(folder / "tmp"))
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        patch.setenv("XDG_DATA_HOME", str(folder / "data"))
        yield


@contextmanager
def _limited() -> Iterator[None]:
    def stop(_: int, __: FrameType | None) -> None:
        raise Hang

    limits = {signal.ITIMER_PROF: LONGEST, signal.ITIMER_REAL: LONGEST_WAIT}
    kinds = (signal.SIGPROF, signal.SIGALRM)
    before = [signal.signal(number, stop) for number in kinds]
    try:
        for timer, seconds in limits.items():
            signal.setitimer(timer, seconds)
        yield
    finally:
        for timer in limits:
            signal.setitimer(timer, 0.0)
        for number, handler in zip(kinds, before, strict=True):
            signal.signal(number, handler)


class _Watch:
    """What Python opens for writing, makes, moves or removes; a hook of it stays for good."""

    def __init__(self) -> None:
        self.inside: str | None = None
        self.outside: list[str] = []
        sys.addaudithook(self._note)

    def _note(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.inside is None or event not in _CHANGES | {"open"}:
            return
        changes = event != "open" or (isinstance(arguments[2], int) and arguments[2] & _WRITES)
        paths = arguments[:2] if event != "open" else arguments[:1]
        # Last comes the descriptor of a folder that a relative path begins at, -1 without one.
        at = -1 if event in ("open", "os.truncate") else arguments[-1]
        begin = f"/proc/self/fd/{at}" if at >= 0 else ""
        for path in paths:
            if changes and isinstance(path, str | bytes | os.PathLike):
                whole = os.path.realpath(os.path.join(begin, os.fsdecode(path)))
                if not whole.startswith(f"{self.inside}/") and whole != os.devnull:
                    self.outside.append(whole)


_WATCH = _Watch()


@contextmanager
def _watched(folder: Path, outside: list[str]) -> Iterator[None]:
    """Note what is changed outside of a folder."""
    _WATCH.inside, _WATCH.outside = str(folder.resolve()), outside
    try:
        yield
    finally:
        _WATCH.inside = None
