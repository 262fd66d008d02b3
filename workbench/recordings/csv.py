"""The text of a recording: CSV to columns of numbers, nothing guessed."""

import csv
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError, closest
from workbench.runtime.files import read_text

if TYPE_CHECKING:
    import pandas as pd

_HEADER_CELL = re.compile(r"(?P<name>.*?)\s*(?:\[\s*(?P<unit>[^\[\]]*?)\s*\])?")
_NUMBER_CHARACTERS = frozenset("0123456789+-eE., ")
_NUMBER = re.compile(r" *[+-]?[0-9.,]*[0-9][0-9.,]*([eE][+-]?[0-9]+)? *")
_THOUSANDS = re.compile(r" *[+-]?[1-9][0-9]{0,2}[.,][0-9]{3} *")
_TOGETHER = 20_000  # lines that are taken apart at once
_STAND_IN = "0"  # in empty fields that may be, while numbers are read
# Of n numbers of one length a last one is shorter by chance in 1 of 2.7*n files at most.
_TELLING = 10
_RARE = 0.01  # share of numbers that are as short as one that may be cut
_LARGEST = 1e100  # no measurement comes near; leaves room for the factors of units


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a recording."""

    unit: str  # as the header spells it
    # (n,) finite numbers in that unit, NaN where a field may be empty and is; row i stands on line
    # i + 2 of the file
    values: Vector


def header(cell: str) -> tuple[str, str | None]:
    """Name and unit of a column, None without one.

    >>> header("pressure [kPa]")
    ('pressure', 'kPa')
    >>> header("tank[1].level [m]")
    ('tank[1].level', 'm')
    """
    match = _HEADER_CELL.fullmatch(cell.strip())
    return (match["name"], match["unit"] or None) if match else (cell, None)


def is_cut(cells: Sequence[str]) -> bool:
    """Whether the last number of a column lacks digits that the others have.

    All others have equally many behind their decimal mark, and it has fewer; or it has so few as
    one number in a hundred has at most.

    >>> is_cut(["1.2345"] * 10 + ["1.2"]), is_cut(["1.25", "1.5"] * 5 + ["1.2"])
    (True, False)
    """
    marks = [max(cell.rfind("."), cell.rfind(",")) for cell in map(str.strip, cells)]
    whole = max(marks[:-1], default=-1) < 0
    *sizes, last = [
        0 if mark < 0 and not whole else len(cell.strip()) - mark - 1
        for cell, mark in zip(cells, marks, strict=True)
    ]
    if len(sizes) < _TELLING:
        return False
    as_few = sum(size <= last for size in sizes)
    same = min(sizes) == max(sizes)
    return as_few == 0 if same else as_few + 1 <= _RARE * len(cells)


def csv_text(table: "pd.DataFrame", digits: int | None = 6) -> str:
    """A table as CSV, in which no name is a formula of a spreadsheet.

    A quotation mark stands before what begins with a sign of one: OWASP, CSV Injection.

    Parameters
    ----------
    digits : of numbers; None for all that they have.
    """
    plain = table.rename(columns=_escaped)
    for name in plain.select_dtypes(exclude="number"):
        plain[name] = plain[name].map(_escaped)
    return plain.to_csv(index=False, float_format=None if digits is None else f"%.{digits}g")


def rows_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """As `csv_text`, of rows that have their cells by column; pandas takes its time to load."""
    names = dict.fromkeys(name for row in rows for name in row)
    lines = StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow(map(_escaped, names))
    writer.writerows([_cell(row.get(name)) for name in names] for row in rows)
    return lines.getvalue()


def _cell(value: Any) -> Any:
    """What stands in a cell, which is empty for no value and no number."""
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return _escaped(value)


def header_text(names: Iterable[str]) -> str:
    """The first line of a CSV; see `csv_text`."""
    line = StringIO()
    csv.writer(line, lineterminator="\n").writerow(map(_escaped, names))
    return line.getvalue()


def _escaped(value: Any) -> Any:
    formula = isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r"))
    return f"'{value}" if formula else value


def table_text(columns: Mapping[str, Vector]) -> str:
    """Text of a recording, with all digits; empty where nothing was measured.

    Parameters
    ----------
    columns : (n,) each, by `name [unit]`.

    >>> table_text({"time [s]": np.array([0.0, 0.1]), "p [bar]": np.array([1.5, np.nan])}).split()
    ['time', '[s],p', '[bar]', '0.0,1.5', '0.1,']
    """
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [",".join("" if math.isnan(value) else repr(value) for value in row) for row in rows]
    return "\n".join([",".join(columns), *lines]) + "\n"


def read_columns(
    path: Path,
    required: Sequence[str],
    optional: Sequence[str] = (),
    with_gaps: Collection[str] = (),
) -> dict[str, Column]:
    """Read named columns of a recording.

    The separator is a comma, a semicolon or a tab. Numbers have a decimal point; with
    semicolons or tabs they may have a decimal comma instead, throughout the file. What
    could be read in two ways is refused.

    Parameters
    ----------
    path : CSV file with one header line, `name [unit]` per column.
    required, optional : names of columns, matched exactly; all others are ignored.
    with_gaps : names of those that may have empty fields.

    Returns
    -------
    columns : by name; an optional column that the file lacks is absent.

    Raises
    ------
    InputError
        At the first problem, with its line and column.
    """
    text = read_text(path, "correct 'file' in the table [measurement] of case.toml")
    lines, ended = text.rstrip("\n").split("\n"), text.endswith("\n")
    del text
    _refuse_long(path, lines)
    separator = _separator(path, lines[0])
    (cells,) = _split(path, lines[:1], separator)
    places = _find(path, cells, required, optional)
    if len(lines) < 2:
        raise InputError(
            where=f"{path}, line 2",
            found="the end of the file after the header",
            expected="rows of numbers",
            remedy="export the recording again, with its samples",
        )
    if not ended and len(cells) - 1 in {index for index, _ in places.values()}:
        _refuse_cut(path, [line.rpartition(separator)[2] for line in lines[1:]])
    parts: dict[str, list[Vector]] = {name: [] for name in places}
    # A part at a time: the cells of all as text take twenty times what they hold. Between
    # semicolons and tabs, all numbers together tell the decimal mark.
    size = _TOGETHER if separator == "," else len(lines)
    for first in range(1, len(lines), size):
        table = list(zip(*_split(path, lines, separator, first, first + size), strict=True))
        texts = {name: table[index] for name, (index, _) in places.items()}
        gaps = {
            name: [not cell.strip() for cell in texts[name]] for name in places if name in with_gaps
        }
        for name, empty in gaps.items():
            texts[name] = tuple(np.where(empty, _STAND_IN, texts[name]).tolist())
        values = _numbers(list(texts.values()), separator)
        if values is None:
            raise _first_problem(path, texts, separator, first + 1)
        for name, column in zip(texts, values, strict=True):
            parts[name].append(np.where(gaps[name], np.nan, column) if name in gaps else column)
    return {name: Column(unit, np.concatenate(parts[name])) for name, (_, unit) in places.items()}


def _refuse_cut(path: Path, cells: Sequence[str]) -> None:
    if is_cut(cells):
        raise InputError(
            where=f"{path}, line {len(cells) + 1}",
            found=f"'{cells[-1]}' at the end, shorter than the numbers above it and without the "
            "end of a line",
            expected="a last line that is not cut within a number",
            remedy="remove the line; if the number is whole, end its line",
        )


def _refuse_long(path: Path, lines: list[str]) -> None:
    lengths = list(map(len, lines))
    longest = max(lengths)
    if longest > csv.field_size_limit():
        line = lengths.index(longest)
        raise InputError(
            where=f"{path}, line {line + 1}",
            found=f"{longest} characters, '{lines[line][:60]}'...",
            expected=f"a sample, in at most {csv.field_size_limit()} characters",
            remedy="export the recording again, with a line for each sample",
        )


def _separator(path: Path, header: str) -> str:
    separators = [mark for mark in ",;\t" if mark in header]
    if len(separators) == 1:
        return separators[0]
    names = {",": "commas", ";": "semicolons", "\t": "tabs"}
    if not header.strip():
        fault = "an empty file or an empty first line"
    elif not separators:
        fault = f"no separator in '{header[:60]}'"
    else:
        fault = " and ".join(names[mark] for mark in separators)
    raise InputError(
        where=f"{path}, line 1",
        found=fault,
        expected="a header 'name [unit]' per column with one kind of separator: "
        "comma, semicolon or tab",
        remedy="write the header as the first line and keep other separators out of it",
    )


def _split(
    path: Path, lines: list[str], separator: str, first: int = 0, end: int | None = None
) -> list[list[str]]:
    """Fields of the lines from `first` to `end`, as many in each as in the header."""
    part = lines[first:end]
    try:
        rows = list(csv.reader(part, delimiter=separator, strict=True))
    except csv.Error:
        rows = []
    for number, line in enumerate(part if len(rows) != len(part) else (), first + 1):
        try:
            list(csv.reader([line], delimiter=separator, strict=True))
        except csv.Error:
            raise InputError(
                where=f"{path}, line {number}",
                found="a quotation that does not end before the next separator or the end of the "
                "line",
                expected="fields without quotation marks, or quoted within one line",
                remedy="correct or remove the quotation marks",
            ) from None
    (header,) = csv.reader(lines[:1], delimiter=separator)
    for number, row in enumerate(rows, first + 1):
        if len(row) != len(header):
            raise InputError(
                where=f"{path}, line {number}",
                found=f"{len(row)} fields in '{lines[number - 1][:60]}'",
                expected=f"{len(header)} as in the header",
                remedy="complete or remove the line; a file with decimal commas needs "
                "semicolons between its fields, and no number has thousands separators",
            )
    return rows


def _find(
    path: Path, cells: list[str], required: Sequence[str], optional: Sequence[str]
) -> dict[str, tuple[int, str]]:
    """Return index and unit of each wanted column."""
    parsed = [header(cell) for cell in cells]
    names = [name for name, _ in parsed]
    columns: dict[str, tuple[int, str]] = {}
    for name in (*required, *optional):
        indices = [index for index, other in enumerate(names) if other == name]
        if not indices and name in optional:
            continue
        where = f"{path}, line 1, column '{name}'"
        if not indices:
            raise InputError(
                where=where,
                found=f"no such column among {', '.join(names)}",
                expected=f"a column '{name} [unit]'{closest(name, names)}",
                remedy="rename the column, or name it in [measurement.columns] of case.toml",
            )
        if len(indices) > 1:
            raise InputError(
                where=where,
                found=f"{len(indices)} columns of this name",
                expected="one",
                remedy="rename or remove the others",
            )
        unit = parsed[indices[0]][1]
        if not unit:
            raise InputError(
                where=where,
                found=f"no unit in '{cells[indices[0]]}'",
                expected=f"'{name} [unit]'",
                remedy="write the unit in brackets behind the name",
            )
        columns[name] = indices[0], unit
    return columns


def _numbers(columns: Sequence[Sequence[str]], separator: str) -> list[Vector] | None:
    """Convert all cells, or return None if one of them is not beyond doubt a number."""
    characters = frozenset().union(*("".join(column) for column in columns))
    mark = "," if "," in characters else "."
    if not characters <= _NUMBER_CHARACTERS or {",", "."} <= characters or mark == separator:
        return None
    # Every number with a mark, such as 1.234, may have it between thousands.
    marked = (cell for column in columns for cell in column if mark in cell)
    if separator != "," and mark in characters and all(map(_THOUSANDS.fullmatch, marked)):
        return None
    try:
        values = [
            np.array([float(cell) for cell in "\n".join(column).replace(",", ".").split("\n")])
            for column in columns
        ]
    except ValueError:
        return None
    if not all(np.abs(column).max() < _LARGEST for column in values):
        return None
    return values


def _first_problem(
    path: Path, cells: Mapping[str, Sequence[str]], separator: str, first_line: int
) -> InputError:
    """Name the first cell that `_numbers` stumbles over."""
    ambiguous = "one decimal mark throughout the file, and no thousands separators"
    mark, number, place = "", "", str(path)  # the first decimal mark, its number and where
    for line, row in enumerate(zip(*cells.values(), strict=True), first_line):
        for name, cell in zip(cells, row, strict=True):
            where = f"{path}, line {line}, column '{name}'"
            text = cell.strip(" ")
            marks = [character for character in text if character in ",."]
            doubtful = len(marks) > 1 or marks == [separator]
            is_number = _NUMBER.fullmatch(text) is not None
            if is_number and not doubtful:
                is_number = abs(float(text.replace(",", "."))) < _LARGEST
            if not is_number:
                return InputError(
                    where=where,
                    found=repr(text) if text else "an empty field",
                    expected="a finite number",
                    remedy="correct the field, or remove its line",
                )
            if marks and not doubtful and not mark:
                mark, number, place = marks[0], text, where
            if doubtful or (marks and marks[0] != mark):
                before = "" if doubtful else f" after '{number}' ({place})"
                return InputError(
                    where=where,
                    found=f"'{text}'{before}, which is ambiguous",
                    expected=ambiguous,
                    remedy="export the recording again, without thousands separators",
                )
    return InputError(
        where=place,
        found=f"'{number}' and no number that tells a decimal mark from a thousands separator",
        expected=ambiguous,
        remedy="write the decimals of at least one number with other than three digits",
    )
