"""A table of cells, and what a cell, a row or a column of it is."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from workbench.recordings.formats.numbers import is_missing, is_number
from workbench.recordings.formats.spelling import conversion, is_unit, name_and_unit
from workbench.recordings.formats.stamps import has_day, has_day_alone, is_said, is_stamp

_DIGITS = frozenset("0123456789+-.,eE")
UNIT_ROW = re.compile(
    r"(y[ _]|v|eng(ineering)?[ _]?)?(units?|unit[ _]?(label|name)|einheit(en)?)\W*", re.IGNORECASE
)
TIME_NAME = re.compile(r"(time|zeit|date|datum)", re.IGNORECASE)
# What recorders write into a row of units above record numbers, dates and times.
_NO_UNIT = re.compile(
    r"(ts|rn|no|nr|num|number|#|date|time|datum|zeit|date ?& ?time|id|index|text|sequence"
    r"|yr|mo|dy|hr|mn)\.?"  # parts of a date, of buoys
    r"|[A-Z]\d{4,}",  # of Graphtec's alarms
    re.IGNORECASE,
)
Label = tuple[str, str]  # name and unit of a column


@dataclass(frozen=True)
class Cells:
    """Rows of cells, and where the samples among them begin."""

    rows: list[list[str]]  # of one width
    lines: list[int]  # of the file, from 1, on which they stand
    head: tuple[str, ...]  # lines above the samples, as text
    # names, units: cells of the header; empty where there is none
    names: tuple[str, ...]
    units: tuple[str, ...]
    # what a row of the preamble says of each column, which begins with its name
    about: tuple[str, ...] = ()
    # the line above samples that says of each column that its values are not as named
    remarks: tuple[str, ...] = ()

    @classmethod
    def named(cls, names: Iterable[str], rows: list[list[str]]) -> "Cells":
        """Rows below their names, which may hold units, and nothing else."""
        own = tuple(names)
        return cls(rows, list(range(1, len(rows) + 1)), (), own, ("",) * len(own))

    @property
    def labels(self) -> list[Label]:
        """Names and units of columns; a name is made where there is none."""
        parts = zip(map(name_and_unit, self.names), self.units, strict=True)
        return [
            (name or f"column {i}", unit or below)
            for i, ((name, unit), below) in enumerate(parts, 1)
        ]

    @property
    def columns(self) -> list[list[str]]:
        """Cells by column, without space around them."""
        return [[cell.strip() for cell in column] for column in zip(*self.rows, strict=True)]

    def part(self, kept: Sequence[int]) -> "Cells":
        """Some rows of the table."""
        rows, lines = [self.rows[k] for k in kept], [self.lines[k] for k in kept]
        return replace(self, rows=rows, lines=lines)


def trim(row: Sequence[str]) -> Sequence[str]:
    """A row without empty cells at its end."""
    end = len(row)
    while end and not row[end - 1].strip():
        end -= 1
    return row[:end]


def mostly(cells: Sequence[str], is_one: Callable[[str], bool]) -> bool:
    """Whether more than half of the cells that hold anything are of a kind."""
    few = cells[:: max(1, len(cells) // 1000)]  # a thousand tell, if they hold anything
    held = [cell for cell in few if not is_missing(cell)]
    if not held:
        held = [cell for cell in cells if not is_missing(cell)]
    return len(held) > 0 and 2 * sum(map(is_one, held)) > len(held)


def is_sample(cell: str) -> bool:
    """Whether a cell is a number or a time."""
    return is_number(cell) or is_stamp(cell)


def is_text(cell: str) -> bool:
    """Whether a cell is neither a number nor a time, nor says that there is none."""
    text = cell.strip().strip("'\"")
    if not text or text[0] in "0123456789+-.<>=":
        return False
    return not (is_missing(text) or is_sample(text))


def is_moment(cell: str) -> bool:
    """Whether a cell is a date with a time of day, as no header has it."""
    return is_stamp(cell) and has_day([cell]) and not has_day_alone([cell])


def is_data(row: Sequence[str]) -> bool:
    """Whether a row holds two numbers or times, and little else."""
    if _DIGITS.issuperset("".join(row)) and sum(cell[-1:].isdigit() for cell in row) > 1:
        return True  # as nearly all rows are
    held = [cell.strip() for cell in row if not is_missing(cell)]
    count = sum(map(is_sample, held))
    return count >= min(2, max(1, len(row) - 1)) and 3 * count > len(held)


def is_time_alone(row: Sequence[str], width: int) -> bool:
    """Whether a row of a table has a time or a number in its first cell, and nothing else."""
    text = row[0].strip() if len(row) == width > 1 else ""
    return bool(text) and not any(map(str.strip, row[1:])) and is_sample(text)


def are_units(row: Sequence[str]) -> bool:
    """Whether most cells of a row are units, but for those of columns that have none."""
    silent = (says_nothing, is_number, is_said)  # DD/MM/YYYY is above dates
    held = [cell for cell in row if not any(says(cell) for says in silent)]
    return bool(held) and sum(map(is_unit, held)) >= 0.6 * len(held)


def says_nothing(cell: str) -> bool:
    """Whether a cell in a row of units is of a column that has none, such as one of dates."""
    return not cell or bool(_NO_UNIT.fullmatch(cell) or UNIT_ROW.fullmatch(cell))


def is_clock(label: Label, cells: Sequence[str]) -> bool:
    """Whether a column may be one of times: it says so, and holds times or numbers."""
    name, unit = label
    named = TIME_NAME.match(name) or (unit and conversion(unit, "s"))
    return bool(named) and mostly(cells, is_sample)
