"""Workbooks of Excel and other programs: each sheet that holds a table is a group.

Formulas are as their program last computed them. Each reader imports the package that it needs.
"""

import io
from collections.abc import Collection, Mapping, Sequence
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

from workbench.errors import InputError
from workbench.recordings.formats.cells import by_tag, find_table, read_group
from workbench.recordings.formats.contents import Contents, Group
from workbench.runtime.supervision import quiet_panics

_LOOKED = 200  # rows that tell whether a sheet shows percent
_HOUR = timedelta(hours=1)
_MOST = 1_048_576  # rows of a sheet of Excel
_WHOLE = 2.0**53  # below which doubles hold whole numbers


def read_excel(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a workbook of Excel (.xlsx); see `_read_sheets`."""
    import openpyxl

    book = openpyxl.load_workbook(io.BytesIO(raw), read_only=True, data_only=True)
    sheets = {}
    for sheet in book.worksheets:
        above = [cell for row in sheet.iter_rows(max_row=_LOOKED) for cell in row]
        if any(cell.value is not None and "%" in cell.number_format for cell in above):
            sheets[sheet.title] = [
                [
                    cell.value if cell.value is None else _as_shown(cell.value, cell.number_format)
                    for cell in row
                ]
                for row in sheet.iter_rows()
            ]
        else:
            sheets[sheet.title] = list(sheet.iter_rows(values_only=True))
    hidden = {sheet.title for sheet in book.worksheets if sheet.sheet_state != "visible"}
    return _read_sheets(path, "Excel", sheets, hidden)


def read_excel_97(path: Path, raw: bytes) -> Contents:
    """The same of Excel 97 to 2003 (.xls)."""
    import xlrd

    def value(cell: Any) -> Any:
        """A cell as Python has it; None where it is empty, or a formula that failed."""
        if cell.ctype == xlrd.XL_CELL_DATE and cell.value >= 1.0:
            return xlrd.xldate_as_datetime(cell.value, book.datemode)
        if cell.ctype == xlrd.XL_CELL_DATE:  # the part of a day, to a millisecond as Excel shows it
            seconds, rest = divmod(round(cell.value * 86_400_000) % 86_400_000, 1000)
            return time(seconds // 3600, seconds // 60 % 60, seconds % 60, rest * 1000)
        if cell.ctype == xlrd.XL_CELL_NUMBER:
            return _as_shown(cell.value, formats[book.xf_list[cell.xf_index].format_key].format_str)
        if cell.ctype == xlrd.XL_CELL_TEXT:
            return cell.value
        return bool(cell.value) if cell.ctype == xlrd.XL_CELL_BOOLEAN else None

    log = io.StringIO()  # of what may be damaged
    book = xlrd.open_workbook(file_contents=raw, logfile=log, formatting_info=True)
    formats = book.format_map
    sheets = {
        sheet.name: [list(map(value, row)) for row in sheet.get_rows()] for sheet in book.sheets()
    }
    hidden = {sheet.name for sheet in book.sheets() if sheet.visibility}
    contents = _read_sheets(path, "Excel 97", sheets, hidden)
    doubts = dict.fromkeys(f"xlrd: {line[:200]}" for line in log.getvalue().splitlines())
    return contents._replace(doubts=tuple(doubts))


def read_others(path: Path, raw: bytes) -> Contents:
    """The same of OpenDocument (.ods), and of binary workbooks of Excel (.xlsb).

    Its library ends with a panic at some damaged files, which is no Exception, and says so on
    standard error.
    """
    from python_calamine import CalamineWorkbook, SheetTypeEnum, SheetVisibleEnum

    try:
        with quiet_panics():
            book = CalamineWorkbook.from_filelike(io.BytesIO(raw))
            kept = [sheet for sheet in book.sheets_metadata if sheet.typ == SheetTypeEnum.WorkSheet]
            sheets = {
                sheet.name: book.get_sheet_by_name(sheet.name).to_python(skip_empty_area=False)
                for sheet in kept
            }
    except BaseException as error:
        raise error if isinstance(error, Exception) else ValueError(str(error)) from None
    hidden = {sheet.name for sheet in kept if sheet.visible != SheetVisibleEnum.Visible}
    called = "OpenDocument" if b"opendocument.spreadsheet" in raw[:200] else "binary Excel"
    return _read_sheets(path, called, sheets, hidden)


def _read_sheets(
    path: Path, called: str, sheets: Mapping[str, Sequence[Sequence[Any]]], hidden: Collection[str]
) -> Contents:
    """Kind, groups and notes of rows of cells, by sheet."""
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
    count = f"{len(groups)} sheet{'s' * (len(groups) != 1)}"
    return Contents(f"{called}, {count} with samples", groups, notes)


def _as_shown(value: Any, form: str) -> Any:
    """A value as its cell shows it, if that is in percent: the number itself is a hundredth."""
    shown = "%" in form and isinstance(value, int | float)
    return f"{100.0 * value!r}%" if shown else value


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
