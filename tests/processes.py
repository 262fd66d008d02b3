"""Python in processes of its own, and what processes of a session do, seen from beside."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# In PYTHONPATH: Python as where there is neither fork nor its like, nor locks of files.
ELSEWHERE = f"{ROOT / 'tests' / 'platforms'}{os.pathsep}{ROOT}"
# [s] Above what a machine a third as fast as usual needs to compile all loops, 140 s of processor
# time, while three workers share two processors: 140 * 3 * 3/2 = 630 s.
LONGEST = 900.0
COMPILER = shutil.which("cc") or shutil.which("gcc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="needs a C compiler")


@contextmanager
def running(
    *arguments: str | Path, cwd: str | Path = ROOT, **environment: str | None
) -> "Iterator[subprocess.Popen[str]]":
    """Run Python beside the block, in a session of its own; where the block fails, end it.

    Parameters
    ----------
    environment : beside that of the tests; None takes a variable out.
    """
    changed = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    process = subprocess.Popen(
        [sys.executable, *map(str, arguments)],
        cwd=cwd,
        env={name: value for name, value in changed.items() if value is not None},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    with process:
        try:
            yield process
        except BaseException:
            process.kill()
            raise


def python(
    *arguments: str | Path, cwd: str | Path = ROOT, **environment: str | None
) -> "subprocess.CompletedProcess[str]":
    """Run Python to its end; see `running`."""
    with running(*arguments, cwd=cwd, **environment) as process:
        out, errors = process.communicate(timeout=LONGEST)
    return subprocess.CompletedProcess(process.args, process.returncode, out, errors)


def comes_true(condition: Callable[[], bool]) -> bool:
    """Wait for a condition, as long as a busy machine may need."""
    end = time.monotonic() + LONGEST
    while not (true := condition()) and time.monotonic() < end:
        time.sleep(0.02)
    return true


def living(session: int) -> list[int]:
    """Processes of a session that are not zombies."""
    alive = []
    for number in map(int, filter(str.isdigit, os.listdir("/proc"))):
        try:
            if os.getsid(number) != session:
                continue
            state = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it ended meanwhile
        if state[0] != "Z":
            alive.append(number)
    return alive
