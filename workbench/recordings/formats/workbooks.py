"""Workbooks of Excel and other programs: each sheet that holds a table is a group.

Formulas are as their program last computed them. Each reader imports the package that it needs.
"""

import io
import math
import re
import struct
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from datetime import date, datetime, time, timedelta
from decimal import Decimal
from pathlib import Path
from typing import Any

from workbench.errors import InputError
from workbench.recordings.formats.contents import Contents, Group
from workbench.recordings.formats.numbers import is_number
from workbench.recordings.formats.tables.groups import read_group
from workbench.recordings.formats.tables.parts import parts_of_tables
from workbench.recordings.formats.tables.samples import find_tables
from workbench.runtime.supervision import quiet_panics

_LOOKED = 200  # rows that tell whether a sheet shows percent
_HOUR = timedelta(hours=1)
_MOST = 1_048_576  # rows of a sheet of Excel
_WHOLE = 2.0**53  # below which doubles hold whole numbers
_LITERAL = re.compile(r'"[^"]*"|[\\_*].')  # of a number format: shown as it stands, or not at all
_PERCENT_CELL = re.compile(rb"<[^<>]*\boffice:value-type=[\"']percentage[\"'][^<>]*>")
_VALUE = re.compile(rb"\boffice:value=[\"']([^\"']*)[\"']")
# Records of a binary workbook of Excel ([MS-XLSB], section 2.3): cells with a short number, one
# that is stored or computed, and a text; formats, styles of cells, begin and end of these.
_SHORT, _NUMBERS, _TEXT, _FORMAT, _STYLE, _STYLES = 2, (5, 9), 6, 44, 47, (617, 618)


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
            seconds, milliseconds = divmod(round(cell.value * 86_400_000) % 86_400_000, 1000)
            return time(seconds // 3600, seconds // 60 % 60, seconds % 60, milliseconds * 1000)
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
            is_document = b"opendocument.spreadsheet" in raw[:200]
            with_percent = _document_with_percent if is_document else _binary_with_percent
            book = CalamineWorkbook.from_filelike(io.BytesIO(with_percent(raw)))
            kept = [sheet for sheet in book.sheets_metadata if sheet.typ == SheetTypeEnum.WorkSheet]
            sheets = {
                sheet.name: book.get_sheet_by_name(sheet.name).to_python(skip_empty_area=False)
                for sheet in kept
            }
    except BaseException as error:
        raise error if isinstance(error, Exception) else ValueError(str(error)) from None
    hidden = {sheet.name for sheet in kept if sheet.visible != SheetVisibleEnum.Visible}
    return _read_sheets(path, "OpenDocument" if is_document else "binary Excel", sheets, hidden)


def _document_with_percent(raw: bytes) -> bytes:
    """A workbook of OpenDocument whose cells in percent are texts: its library tells no formats."""

    def text(value: re.Match[bytes]) -> bytes:
        return f'office:string-value="{_as_shown(float(value[1]), "%")}"'.encode()

    def shown(part: bytes) -> bytes:
        return _PERCENT_CELL.sub(
            lambda cell: _VALUE.sub(text, cell[0]).replace(b"percentage", b"string"), part
        )

    return _changed(raw, r"content\.xml", shown)


def _binary_with_percent(raw: bytes) -> bytes:
    """The same of a binary workbook of Excel."""
    with zipfile.ZipFile(io.BytesIO(raw)) as parts:
        listing = parts.read("xl/styles.bin") if "xl/styles.bin" in parts.namelist() else b""
    forms, styles, listed = {9: "0%", 10: "0.00%"}, list[str](), False
    for kind, content, _ in _records(listing):
        listed = kind == _STYLES[0] or (listed and kind != _STYLES[1])
        if kind == _FORMAT:
            forms[int.from_bytes(content[:2], "little")] = content[6:].decode("utf-16-le")
        elif kind == _STYLE and listed:
            styles.append(forms.get(int.from_bytes(content[2:4], "little"), ""))

    def shown(part: bytes) -> bytes:
        records: list[bytes] = []
        for kind, content, record in _records(part):
            place, number = content[:8], content[8:]
            if kind in (_SHORT, *_NUMBERS) and "%" in (form := styles[place[4] + 256 * place[5]]):
                value = _short(number) if kind == _SHORT else struct.unpack_from("<d", number)[0]
                text = str(_as_shown(value, form)).encode("utf-16-le")
                length = struct.pack("<I", len(text) // 2)
                record = bytes([_TEXT, 12 + len(text)]) + place + length + text
            records.append(record)
        return b"".join(records)

    return (
        _changed(raw, r"xl/worksheets/[^/]*\.bin", shown) if any("%" in f for f in styles) else raw
    )


def _short(number: bytes) -> float:
    """A number of 30 bits: whole, or the upper half of a double; perhaps in hundredths."""
    (bits,) = struct.unpack_from("<i", number)
    (value,) = struct.unpack("<d", struct.pack("<2i", 0, bits & ~3))
    return float(bits >> 2 if bits & 2 else value) / (100.0 if bits & 1 else 1.0)


def _records(part: bytes) -> Iterator[tuple[int, bytes, bytes]]:
    """Records of a part of a binary workbook: kind, content, and all bytes ([MS-XLSB], 2.1.4)."""
    at = 0
    while at < len(part):
        begin, kind = at, part[at]
        if kind & 128:
            at += 1
            kind = kind & 127 | part[at] << 7
        size, shift, more = 0, 0, True
        while more:
            at += 1
            size |= (part[at] & 127) << shift
            shift, more = shift + 7, part[at] & 128 != 0 and shift < 21
        at += 1 + size
        yield kind, part[at - size : at], part[begin:at]


def _changed(raw: bytes, parts: str, change: Callable[[bytes], bytes]) -> bytes:
    """A workbook with other content in some parts, of which a pattern has the names."""
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(raw)) as old, zipfile.ZipFile(packed, "w") as new:
        for name in old.namelist():
            part = old.read(name)
            new.writestr(name, change(part) if re.fullmatch(parts, name) else part)
    return packed.getvalue()


def _read_sheets(
    path: Path, called: str, sheets: Mapping[str, Sequence[Sequence[Any]]], hidden: Collection[str]
) -> Contents:
    """Kind, groups and notes of rows of cells, by sheet."""
    groups: list[Group] = []
    notes: list[str] = []
    refusal: InputError | None = None
    for title, content in sheets.items():
        where = f"{path}, sheet '{title}'"
        marked = any(map(_has_marked_text, content[:_MOST]))
        write = _unmarked if marked else _text
        rows = [[write(cell) for cell in row] for row in content[:_MOST]]
        filled = [i for i, row in enumerate(rows) if any(row)]
        try:
            tables = find_tables([rows[i] for i in filled], [i + 1 for i in filled], where)
            parts = [
                read_group(
                    part, f"{title} {tag}".strip() if len(sheets) > 1 else tag or title, where
                )
                for tag, part in parts_of_tables(tables)
            ]
        except InputError as error:
            refusal = error
            if filled:
                notes.append(f"sheet '{title}' was left out: {error.found}")
            continue
        groups += [group for group, *_ in parts]
        own = list(dict.fromkeys(note for *_, notes_of_part in parts for note in notes_of_part))
        notes += [f"sheet '{title}' is hidden"] * (title in hidden)
        notes += [f"sheet '{title}': {note}" for note in own]
        left = sum(i + 1 >= tables[0].lines[0] for i in filled)
        left -= sum(len(table.lines) for table in tables) + sum(len(t.head) for t in tables[1:])
        if left:
            notes.append(f"sheet '{title}': {left} rows that are no samples were left out")
    if refusal is not None and not groups:
        raise refusal
    count = f"{len(groups)} sheet{'s' * (len(groups) != 1)}"
    return Contents(f"{called}, {count} with samples", groups, notes)


def _as_shown(value: Any, form: str) -> Any:
    """A value as its cell shows it, if that is in percent: the number itself is a hundredth.

    A literal % of the format stands behind the number itself.
    """
    if "%" not in form or not isinstance(value, int | float):
        return value
    return f"{100.0 * value if '%' in _LITERAL.sub('', form) else value!r}%"


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


def _has_marked_text(row: Sequence[Any]) -> bool:
    """Whether a text beside numbers is one with a decimal mark, or one between thousands."""
    texts = [
        c for c in row if isinstance(c, str) and ("." in c or "," in c) and is_number(c.strip())
    ]
    return bool(texts) and any(isinstance(cell, int | float) for cell in row)


def _unmarked(cell: Any) -> str:
    """The same, numbers without decimal marks: they tell nothing of texts beside them.

    >>> _unmarked(4.071), _unmarked(-1e-7), _unmarked(5.0)
    ('4071E-3', '-1E-7', '5')
    """
    if not isinstance(cell, float) or cell.is_integer() or not math.isfinite(cell):
        return _text(cell)
    sign, digits, exponent = Decimal(repr(cell)).as_tuple()
    return f"{'-' * sign}{''.join(map(str, digits))}E{exponent}"
