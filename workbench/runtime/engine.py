"""With what something is worked out: processes, who hears of progress, and a folder."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

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
