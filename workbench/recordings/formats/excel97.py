"""Workbooks of Excel 97 to 2003 (.xls): each sheet that holds a table is a group."""

import io
from datetime import time
from pathlib import Path
from typing import Any

import xlrd
from xlrd.sheet import Cell

from workbench.recordings.formats.contents import Contents
from workbench.recordings.formats.excel import read_sheets


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a workbook, with formulas as Excel last computed them.

    Raises
    ------
    InputError
        If it holds no table.
    """
    log = io.StringIO()  # of what may be damaged
    book = xlrd.open_workbook(file_contents=raw, logfile=log)
    sheets = {
        sheet.name: [[_value(cell, book.datemode) for cell in row] for row in sheet.get_rows()]
        for sheet in book.sheets()
    }
    hidden = {sheet.name for sheet in book.sheets() if sheet.visibility}
    contents = read_sheets(path, "Excel 97", sheets, hidden)
    doubts = dict.fromkeys(f"xlrd: {line[:200]}" for line in log.getvalue().splitlines())
    return contents._replace(doubts=tuple(doubts))


def _value(cell: Cell, datemode: int) -> Any:
    """A cell as Python has it; None where it is empty, or a formula that failed."""
    if cell.ctype == xlrd.XL_CELL_DATE:
        moment = xlrd.xldate_as_datetime(cell.value, datemode)
        return moment if cell.value >= 1.0 else _of_day(cell.value)
    if cell.ctype in (xlrd.XL_CELL_TEXT, xlrd.XL_CELL_NUMBER):
        return cell.value
    return bool(cell.value) if cell.ctype == xlrd.XL_CELL_BOOLEAN else None


def _of_day(part: float) -> time:
    """A time of day, of the part of a day that is over, to a millisecond as Excel shows it."""
    milliseconds = round(part * 86_400_000) % 86_400_000
    seconds, rest = divmod(milliseconds, 1000)
    return time(seconds // 3600, seconds // 60 % 60, seconds % 60, rest * 1000)
