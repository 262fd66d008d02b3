"""Peak memory of processes, as Linux counts it in /proc."""

import re
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

_PERIOD = 0.02  # s between two looks at processes; a peak stays to be seen until a process ends


def peak_memory(process: int | str = "self") -> int:
    """Peak resident memory of a process by its number [bytes].

    The one of `getrusage` may be another's: a process starts with that of its parent.

    Raises
    ------
    ProcessLookupError
        If there is no such process, or it has ended and waits for its parent.
    """
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except FileNotFoundError:
        raise ProcessLookupError(f"no process {process}") from None
    if (peak := re.search(r"VmHWM:\s*(\d+) kB", status)) is None:
        raise ProcessLookupError(f"process {process} has ended")
    return 1024 * int(peak[1])


def watch_command(command: Sequence[str]) -> list[int]:
    """Run a command; returns the peaks of its process, first, and of those it started [bytes]."""
    peaks: dict[int, int] = {}
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as master:
        while master.poll() is None:
            for process in (master.pid, *_descendants(master.pid)):
                try:
                    peaks[process] = peak_memory(process)
                except ProcessLookupError:
                    continue
            time.sleep(_PERIOD)
    if master.returncode:
        raise subprocess.CalledProcessError(master.returncode, command)
    return list(peaks.values())


def _descendants(process: int) -> list[int]:
    """Processes that the threads of a process, and those that it started, have started."""
    children: list[int] = []
    with suppress(OSError):  # the process has ended
        for thread in Path(f"/proc/{process}/task").iterdir():
            with suppress(OSError):  # the thread has ended
                children += map(int, (thread / "children").read_text().split())
    return children + [descendant for child in children for descendant in _descendants(child)]
