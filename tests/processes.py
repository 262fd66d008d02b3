"""What processes of a session do, seen from beside."""

import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


def comes_true(condition: Callable[[], bool]) -> bool:
    """Wait a minute at most, which a machine that has other work to do may need."""
    end = time.monotonic() + 60.0
    while not (true := condition()) and time.monotonic() < end:
        time.sleep(0.02)
    return true


@contextmanager
def ending(process: "subprocess.Popen[str]") -> Iterator["subprocess.Popen[str]"]:
    """Wait for a process at the end of the block; where the block fails, end it."""
    with process:
        try:
            yield process
        except BaseException:
            process.kill()
            raise


def living(session: int) -> list[int]:
    """Processes of a session that are not zombies."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            state = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it ended meanwhile
        if int(state[3]) == session and state[0] != "Z":
            found.append(int(entry.name))
    return found
