"""A table of cells as people and recorders lay it out: names, units, then samples."""

import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from workbench.errors import InputError
from workbench.foreign.contents import FileChannel, Group
from workbench.foreign.spelling import is_unit, named, spelled
from workbench.foreign.stamps import has_day, has_day_alone, is_stamp, read_stamps
from workbench.recording import Vector

_MISSING = frozenset(
    ("", "nan", "na", "n/a", "n.a.", "#n/a", "#nv", "-", "--", "---", "null", "none", "inf", "-inf")
)
_DIGITS = frozenset("0123456789+-.,eE")
_LOOKS_NUMERIC = re.compile(r"[+-]?[0-9.,]*[0-9][0-9.,]*([eE][+-]?[0-9]+)?")
_GROUPED = re.compile(r"[+-]?\d{1,3}([ \u00a0\u202f'\u2019]\d{3})+([.,]\d+)?")
_SPACES = re.compile(r"[ \u00a0\u202f'\u2019]")
_SET = re.compile("[ \u00a0\u202f'\u2019\u2212]")
_EXPONENT = r"([eE][+-]?\d+)?"
_POINT, _COMMA = "decimal points", "decimal commas"
_THOUSANDS_POINT = "decimal commas, points between thousands"
_THOUSANDS_COMMA = "decimal points, commas between thousands"
# Ways to read a number, and what takes it to a text of Python.
_READINGS: dict[str, tuple[re.Pattern[str], Callable[[str], str]]] = {
    _POINT: (re.compile(rf"[+-]?(\d+\.?\d*|\.\d+){_EXPONENT}"), str),
    _COMMA: (
        re.compile(rf"[+-]?(\d+,?\d*|,\d+){_EXPONENT}"),
        lambda text: text.replace(",", "."),
    ),
    _THOUSANDS_POINT: (
        re.compile(rf"[+-]?(\d+|[1-9]\d{{0,2}}(\.\d{{3}})+)(,\d*)?{_EXPONENT}"),
        lambda text: text.replace(".", "").replace(",", "."),
    ),
    _THOUSANDS_COMMA: (
        re.compile(rf"[+-]?(\d+|[1-9]\d{{0,2}}(,\d{{3}})+)(\.\d*)?{_EXPONENT}"),
        lambda text: text.replace(",", ""),
    ),
}
_LARGEST = 1e100  # no measurement comes near
_STEP = re.compile(
    r"(?P<what>sampl|abtast|scan|rate|freq|interval|increment|step|schritt|\bdt\b)[^0-9]*"
    r"(?P<value>\d+([.,]\d+)?([eE][+-]?\d+)?)[\s;,\t\"']*\(?\[?(?P<unit>kHz|Hz|1/s|S/s|ms|us|µs|s)\b",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Cells:
    """Rows of cells, and where the samples among them begin.

    Attributes
    ----------
    rows : of one width.
    lines : of the file, from 1, on which they stand.
    head : lines above the samples, as text.
    names, units : cells of the header; empty where there is none.
    """

    rows: list[list[str]]
    lines: list[int]
    head: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]


def find_table(rows: Sequence[Sequence[str]], lines: Sequence[int], where: str) -> Cells:
    """Find samples and header among rows of any width.

    Parameters
    ----------
    lines : of the file, on which the rows stand.

    Raises
    ------
    InputError
        If there are no two columns of samples, or their names do not reach as far as they do.
    """
    data = [i for i, row in enumerate(rows) if _is_data(row)]
    width = Counter(len(rows[i]) for i in data).most_common(1)[0][0] if data else 0
    samples = [i for i in data if len(rows[i]) == width or len(_trimmed(rows[i])) == width]
    # A line of a preamble may hold numbers, too, but not several one after the other.
    first = next((i for i, j in zip(samples, samples[2:], strict=False) if j == i + 2), None)
    if first is None or width < 2:
        raise InputError(
            where=where,
            found="no columns of numbers",
            expected="a table: names, then a row for each sample, at least a time and a signal",
            remedy="export the recording as a table",
        )
    names, units, used = _header(rows[:first], width)
    head = tuple(" ".join(filter(None, row)) for row in rows[: first - used])
    kept = [i for i in samples if i >= first]
    found = [list(rows[i][:width]) for i in kept]
    if used:
        _refuse_narrow(names, units, found, f"{where}, above line {lines[first]}")
    else:
        names = [f"column {i + 1}" for i in range(width)]
    filled = (tuple((row + [""] * width)[:width]) for row in (names, units))
    return Cells(found, [lines[i] for i in kept], head, *filled)


def _refuse_narrow(
    names: Sequence[str], units: Sequence[str], samples: Sequence[Sequence[str]], where: str
) -> None:
    """Refuse a header that does not reach as far as the samples: which name is whose is not known.

    R writes row numbers without a name; numbers with decimal commas between commas are two cells.
    """
    named = len(_trimmed(names))
    held = max(len(_trimmed(row)) for row in samples)
    if named >= held and (not units or len(units) >= named):
        return
    raise InputError(
        where=where,
        found=f"{named} names over {held} columns of samples"
        if named < held
        else f"{len(units)} units below {named} names",
        expected="as many cells in each row, so that each column has its own name and unit",
        remedy="name every column, that of row numbers, too; between commas, write decimal points "
        "or put numbers into quotation marks",
    )


def _trimmed(row: Sequence[str]) -> Sequence[str]:
    """A row without empty cells at its end."""
    end = len(row)
    while end and not row[end - 1].strip():
        end -= 1
    return row[:end]


def _is_data(row: Sequence[str]) -> bool:
    """Whether a row holds two numbers or times, and little else."""
    if _DIGITS.issuperset("".join(row)) and sum(cell[-1:].isdigit() for cell in row) > 1:
        return True  # as nearly all rows are
    held = [cell.strip() for cell in row if cell.strip().lower() not in _MISSING]
    count = sum(_is_number(cell) or is_stamp(cell) for cell in held)
    return count >= min(2, max(1, len(row) - 1)) and 3 * count > len(held)


def _header(above: Sequence[Sequence[str]], width: int) -> tuple[list[str], list[str], int]:
    """Names and units as they stand above the samples, and how many rows these and others are."""
    rows: list[list[str]] = []
    used = 0
    for row in reversed(above):
        used += 1
        if not _trimmed(row):
            continue
        cells = [cell.strip() for cell in row]
        if len(_trimmed(cells)) > width or len(_trimmed(cells)) < max(2, width // 2):
            used -= 1
            break
        rows.insert(0, cells)
        if len(rows) == 3:
            break
    if not rows:
        return [], [], 0
    at = next((i for i in range(1, len(rows)) if _are_units(rows[i])), None)
    if at is None:
        return rows[-1], [], used
    return rows[at - 1], [spelled(cell) for cell in rows[at]], used


def _are_units(cells: Sequence[str]) -> bool:
    held = [cell for cell in cells if cell]
    return bool(held) and sum(map(is_unit, held)) >= 0.75 * len(held)


def read_group(
    table: Cells, name: str, where: str, *, commas: bool = True
) -> tuple[Group, str, list[str]]:
    """Channels of a table, how its numbers are written, and notes on what was left out.

    Parameters
    ----------
    commas : whether numbers may hold commas.

    Raises
    ------
    InputError
        If numbers can be read in two ways.
    """
    columns = [[cell.strip() for cell in column] for column in zip(*table.rows, strict=True)]
    stamps: list[FileChannel] = []
    numbers: dict[int, list[str]] = {}
    notes: list[str] = []
    labels = [_label(table, i) for i in range(len(columns))]
    labels, columns = _joined(labels, columns)
    for i, cells in enumerate(columns):
        if _mostly(cells, is_stamp):
            channel = read_stamps(labels[i][0], cells)
            if channel is None:
                notes.append(f"'{labels[i][0]}' holds dates that can be read in two ways")
            else:
                stamps.append(channel)
        elif _mostly(cells, _is_number):
            numbers[i] = _all_plain(cells)
        elif any(cells):
            notes.append(f"'{labels[i][0]}' holds texts")
    reading = _reading(list(numbers.values()), where, commas=commas)
    channels: list[FileChannel] = []
    for i, cells in numbers.items():
        values = _values(cells, reading)
        gaps = np.flatnonzero(np.isnan(values)).tolist()
        bad = [k for k in gaps if cells[k].lower() not in _MISSING]
        if bad:
            notes.append(
                f"'{labels[i][0]}': {len(bad)} cells that are no numbers are gaps, the first "
                f"{columns[i][bad[0]]!r} in line {table.lines[bad[0]]}"
            )
        channels.append(FileChannel(*labels[i], values))
    return Group(name, (*stamps, *channels), step=_stated_step(table.head)), reading, notes


def _joined(
    labels: list[tuple[str, str]], columns: list[list[str]]
) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """The same columns, with one of days and one of times of day as one."""
    kinds = [_mostly(cells, is_stamp) and has_day_alone(cells) for cells in columns]
    clocks = [_mostly(cells, is_stamp) and not has_day(cells) for cells in columns]
    if not any(kinds) or not any(clocks):
        return labels, columns
    day, clock = kinds.index(True), clocks.index(True)
    joined = [f"{one} {other}" for one, other in zip(columns[day], columns[clock], strict=True)]
    left = [i for i in range(len(columns)) if i not in (day, clock)]
    name = f"{labels[day][0]} {labels[clock][0]}", ""
    return [name, *(labels[i] for i in left)], [joined, *(columns[i] for i in left)]


def _label(table: Cells, i: int) -> tuple[str, str]:
    """Name and unit of a column."""
    name, unit = named(table.names[i])
    return name or f"column {i + 1}", unit or table.units[i]


def _mostly(cells: Sequence[str], is_one: Callable[[str], bool]) -> bool:
    """Whether more than half of the cells that hold anything are of a kind."""
    few = cells[:: max(1, len(cells) // 1000)]  # a thousand tell, if they hold anything
    held = [cell for cell in few if cell.lower() not in _MISSING]
    if not held:
        held = [cell for cell in cells if cell.lower() not in _MISSING]
    return len(held) > 0 and 2 * sum(map(is_one, held)) > len(held)


def _is_number(cell: str) -> bool:
    return _LOOKS_NUMERIC.fullmatch(_plain(cell)) is not None


def _all_plain(cells: list[str]) -> list[str]:
    """Cells without signs of type setting, which most columns have none of."""
    return [_plain(cell) for cell in cells] if _SET.search("".join(cells)) else cells


def _plain(cell: str) -> str:
    """A cell without signs of type setting."""
    text = cell.replace("\u2212", "-") if "\u2212" in cell else cell
    return _SPACES.sub("", text) if _GROUPED.fullmatch(text) else text


def _reading(columns: Sequence[Sequence[str]], where: str, *, commas: bool) -> str:
    """The one way in which all numbers can be read.

    Raises
    ------
    InputError
        If there are two that differ, or none.
    """
    marks = frozenset().union(*("".join(cells) for cells in columns)) & {",", "."}
    if not commas or not marks:
        return _POINT
    cells = (cell for column in columns for cell in column if "," in cell or "." in cell)
    if len(marks) == 1:
        usual, other = (_POINT, _THOUSANDS_POINT) if "." in marks else (_COMMA, _THOUSANDS_COMMA)
        # The first number that no mark between thousands explains decides: mostly the first at all.
        found = set(islice(cells, 1)) if _all_fit(columns, other) else set()
        different = [usual, other] if found else [usual]
    else:
        found = {cell for cell in cells if _LOOKS_NUMERIC.fullmatch(cell)}
        ways = {
            name: tuple(float(python(cell)) for cell in sorted(found))
            for name, (pattern, python) in _READINGS.items()
            if all(map(pattern.fullmatch, found))
        }
        different = list({values: name for name, values in reversed(ways.items())}.values())
    if len(different) == 1:
        return different[0]
    example = min(found, key=len)
    raise InputError(
        where=where,
        found=f"numbers such as '{example}', which can be read with {' or with '.join(different)}"
        if different
        else "numbers with decimal points and others with decimal commas",
        expected="one decimal mark, and a number that tells it from one between thousands",
        remedy="export the recording again, with more decimals and no marks between thousands",
    )


def _all_fit(columns: Sequence[Sequence[str]], reading: str) -> bool:
    """Whether all numbers with a mark can be read so; ends at the first that cannot."""
    pattern, _ = _READINGS[reading]
    return all(
        pattern.fullmatch(cell)
        for column in columns
        for cell in column
        if ("," in cell or "." in cell) and _LOOKS_NUMERIC.fullmatch(cell)
    )


def _values(cells: Sequence[str], reading: str) -> Vector:
    """Numbers of a column, (n,); NaN where there is none."""
    pattern, python = _READINGS[reading]
    plain = reading == _POINT
    try:  # nearly always all are numbers, and Python's own reader is the fastest
        values = np.array([float(cell if plain else python(cell)) for cell in cells])
    except ValueError:
        values = np.array(
            [float(python(cell)) if pattern.fullmatch(cell) else math.nan for cell in cells]
        )
    return np.where(np.abs(values) < _LARGEST, values, np.nan)


def _stated_step(head: Sequence[str]) -> float:
    """Time between samples that a preamble states [s]; NaN without one."""
    for line in head:
        if match := _STEP.search(line):
            value = float(match["value"].replace(",", "."))
            unit = match["unit"]
            if value > 0.0 and unit.lower() in ("khz", "hz", "1/s", "s/s"):
                return 1.0 / (value * (1e3 if unit.lower() == "khz" else 1.0))
            if value > 0.0 and not re.search("rate|freq", line, re.IGNORECASE):
                return value * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}[unit.lower()]
    return math.nan
