"""One table of a page, and the commands that make it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Table = list[Sequence[str]]  # the first row is the header
Summary = Mapping[str, Any]


@dataclass(frozen=True)
class Figure:
    """A table and the commands that make it.

    Attributes
    ----------
    commands : of the workbench; they read and write below `{out}`, and may ask for `{recordings}`.
    summaries : files that the commands write, below the folder of results.
    table : of the summaries, in their order.
    long : whether they take many minutes, or hours.
    """

    commands: tuple[str, ...]
    summaries: tuple[Path, ...]
    table: Callable[..., Table]
    long: bool = False

    @property
    def recorded(self) -> bool:
        """Whether recordings are needed that are not part of the repository."""
        return any("{recordings}" in command for command in self.commands)
