"""Workbooks of Excel: each sheet that holds a table is a group."""

import io
from collections.abc import Collection, Mapping, Sequence
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

import openpyxl

from workbench.errors import InputError
from workbench.recordings.formats.cells import by_tag, find_table, read_group
from workbench.recordings.formats.contents import Contents, Group

_HOUR = timedelta(hours=1)
_MOST = 1_048_576  # rows of a sheet of Excel
_WHOLE = 2.0**53  # below which doubles hold whole numbers


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a workbook, with formulas as Excel last computed them.

    Raises
    ------
    InputError
        If it holds no table.
    """
    book = openpyxl.load_workbook(io.BytesIO(raw), read_only=True, data_only=True)
    sheets = {sheet.title: list(sheet.iter_rows(values_only=True)) for sheet in book.worksheets}
    hidden = {sheet.title for sheet in book.worksheets if sheet.sheet_state != "visible"}
    return read_sheets(path, "Excel", sheets, hidden)


def read_sheets(
    path: Path, called: str, sheets: Mapping[str, Sequence[Sequence[Any]]], hidden: Collection[str]
) -> Contents:
    """Kind, groups and notes of rows of cells, by sheet.

    Raises
    ------
    InputError
        If no sheet holds a table.
    """
    groups: list[Group] = []
    notes: list[str] = []
    refusal: InputError | None = None
    for title, content in sheets.items():
        where = f"{path}, sheet '{title}'"
        rows = [[_text(cell) for cell in row] for row in content[:_MOST]]
        filled = [i for i, row in enumerate(rows) if any(row)]
        try:
            table = find_table([rows[i] for i in filled], [i + 1 for i in filled], where)
            parts = [read_group(part, tag or title, where) for tag, part in by_tag(table)]
        except InputError as error:
            refusal = error
            if filled:
                notes.append(f"sheet '{title}' was left out: {error.found}")
            continue
        groups += [group for group, *_ in parts]
        own = list(dict.fromkeys(note for *_, notes_of_part in parts for note in notes_of_part))
        notes += [f"sheet '{title}' is hidden"] * (title in hidden)
        notes += [f"sheet '{title}': {note}" for note in own]
        left = sum(i + 1 >= table.lines[0] for i in filled) - len(table.lines)
        if left:
            notes.append(f"sheet '{title}': {left} rows that are no samples were left out")
    if refusal is not None and not groups:
        raise refusal
    return Contents(f"{called}, {_count_text(len(groups), 'sheet')} with samples", groups, notes)


def _count_text(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' * (count != 1)}"


def _text(cell: Any) -> str:
    """A cell as a CSV would have it."""
    match cell:
        case None:
            return ""
        case bool():
            return str(int(cell))
        case float() if cell.is_integer() and abs(cell) < _WHOLE:
            return str(int(cell))
        case float() | int():
            return repr(cell)
        case datetime():
            return cell.isoformat(sep=" ")
        case time():
            return cell.isoformat()
        case timedelta():  # a stamp, in whatever unit its column is said to be
            return f"{cell // _HOUR}:{datetime.min + cell % _HOUR:%M:%S.%f}"
        case date():
            return cell.isoformat()
    return str(cell)
