"""With what something is worked out: processes, who hears of progress, and a folder."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Reporter = Callable[[str], None]


def silent(line: str) -> None:
    """Tell nobody, as where progress of each part would hide that of all."""


@dataclass(frozen=True)
class Engine:
    """With what something is worked out.

    Attributes
    ----------
    workers : processes.
    report : takes a line on what is being done.
    out : folder of what is written on the way.
    """

    workers: int = 1
    report: Reporter = silent
    out: Path = Path()


ALONE = Engine()
"""This process, which tells nobody and writes nothing."""
