"""With what something is worked out: processes, a folder, and who hears how far it is."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

_EVERY = 5.0  # [s] between two lines: seldom enough to be read, often enough to be seen alive


class ProgressReporter:
    """Says now and then how far work is, from any thread.

    Parameters
    ----------
    report : takes a line.
    noun : what is counted, in the plural.
    interval : least time between two lines [s].
    """

    def __init__(self, report: Callable[[str], None], noun: str, interval: float = _EVERY) -> None:
        self._report, self._noun, self._interval = report, noun, interval
        self._lock = threading.Lock()
        self._count, self._last = 0, time.perf_counter()

    def part(self, total: int) -> Callable[[object], None]:
        """Begin a part of so many; what is returned is called, with anything, after each.

        The time left is that of the part, since nobody knows how many parts there will be.
        """
        begin, done = time.perf_counter(), 0

        def count(_: object) -> None:
            nonlocal done
            now = time.perf_counter()
            with self._lock:
                done += 1
                self._count += 1
                if now - self._last < self._interval:
                    return
                self._last = now
                line = f"{self._count} {self._noun}"
                if total > done and now - begin >= self._interval:
                    left = (now - begin) / done * (total - done)
                    line += f", about {left:.0f} s left of these {total}"
            self._report(line)

        return count


class StepReporter:
    """Says after each of a known number of steps what came of it, and the time left."""

    def __init__(self, report: Callable[[str], None], total: int) -> None:
        self._report, self._total, self._done = report, total, 0
        self._begin = time.perf_counter()

    def step(self, text: str) -> None:
        """One step more is done."""
        self._done += 1
        left = (time.perf_counter() - self._begin) / self._done * (self._total - self._done)
        place = f"{self._done:>{len(str(self._total))}}/{self._total}"
        self._report(f"[{place}] {text}, about {left:.0f} s left")


Reporter = Callable[[str], None]


def silent(line: str) -> None:
    """Tell nobody, as where progress of each part would hide that of all."""


@dataclass(frozen=True)
class Engine:
    """With what something is worked out."""

    workers: int = 1  # processes
    report: Reporter = silent  # takes a line on what is being done
    out: Path = Path()  # folder of what is written on the way


ALONE = Engine()
"""This process, which tells nobody and writes nothing."""
