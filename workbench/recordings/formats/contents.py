"""What a recorder's file holds, before anybody says which channel is which signal."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from workbench.arrays import Vector


@dataclass(frozen=True, eq=False)
class FileChannel:
    """One channel of a file."""

    name: str  # as the recorder has it
    unit: str  # as the file spells it; empty where it says none
    values: Vector  # (n,) in that unit, NaN where the recorder has no number
    about: str = ""  # what the file says of it beside the name
    # of time stamps, the time from which they count [s since 1970]; NaN: none is known
    start: float = math.nan
    stamp: bool = False  # whether values are times that were written as dates or times of day
    # of time stamps without a known date, what they show where they count from [s]; NaN: no time of
    # day
    shown: float = math.nan
    zoned: bool = False  # whether `start` is in UTC; else in some local time
    # how time stamps were made to go on, and what of values was changed or left out, in words
    corrections: tuple[str, ...] = ()
    # why time stamps cannot be read before somebody says how, in words; empty: they can
    doubt: str = ""
    # samples of which the file says only that they are below or above another value
    censored: tuple[int, ...] = ()
    # a cell that looks like a number and is not read as one, and how many there are, in words;
    # empty: there is none
    unread: str = ""
    # a line of the file that says that values are not in its unit, or have a factor; empty: none
    remark: str = ""
    # (n,) cells of time stamps, or of texts that nobody knows; empty for numbers
    texts: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Group:
    """Channels that were sampled together."""

    name: str  # of a sheet, a table or a group of the file; empty where it has one alone
    channels: tuple[FileChannel, ...]  # (n,) samples each
    # what the file itself says when its samples were taken, in s; None: one of the channels may be
    # the time
    time: FileChannel | None = None
    step: float = math.nan  # time between two samples that the file states [s]; NaN: it states none
    # why what the file states of it cannot be taken, in words; empty: nothing is
    step_doubt: str = ""
    # names of what holds it in the file, outermost first: a sheet, nested structures
    within: tuple[str, ...] = ()
    left: tuple[FileChannel, ...] = ()  # texts beside the channels, which a user may say are times
    # when the recording began, as the file says beside its times [s since 1970]; NaN: it does not
    # say
    begun: float = math.nan

    def renamed(self, name: str) -> "Group":
        """The same group with another name."""
        return replace(self, name=name)


@dataclass(frozen=True, eq=False)
class RecordedFile:
    """A file as it was read."""

    path: Path
    format: str  # format, and what was found of it, in words
    groups: tuple[Group, ...]
    notes: tuple[str, ...]  # what was left out or understood, in words
    sha256: str  # of the file
    doubts: tuple[str, ...] = ()  # why it may be damaged, in words


class Contents(NamedTuple):
    """What the reader of a format finds in a file; see `RecordedFile`."""

    format: str
    groups: list[Group]
    notes: list[str]
    doubts: tuple[str, ...] = ()
