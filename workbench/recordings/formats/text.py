"""CSV of any locale: encoding, separator, decimal mark, preamble and units are found."""

import csv
import re
import unicodedata
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.recordings.csv import is_cut
from workbench.recordings.formats.contents import Contents
from workbench.recordings.formats.numbers import is_missing, is_number
from workbench.recordings.formats.tables.cells import Cells, is_sample
from workbench.recordings.formats.tables.groups import numbers_of, read_group
from workbench.recordings.formats.tables.parts import parts_of_tables
from workbench.recordings.formats.tables.samples import find_table, find_tables
from workbench.recordings.formats.tables.units import is_quantity

_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars", ",": "commas", " ": "spaces"}
_COMMENT = re.compile(r"(?!\"#\")\s*\"?(#+|%+|//+|!+|\*+)\s*")
_RECEIVED = re.compile(r"(?P<time>\d\d:\d\d:\d\d\.\d{1,6}) -> ")
_QUOTED = re.compile(r'"([^"]*)"')
_DIGIT = re.compile(r"(?![0-9])\d")
_INCREMENT = re.compile(r"\s*(increment|tInc\s*=\s*(?P<value>\S+?)s?)\s*", re.IGNORECASE)
_BEFORE_UNIT = re.compile(r"(?<=[^\s\])])\s+(?=[\[(])")  # between a name and its unit
# Encodings that only dates or names of times in the letters of their countries tell.
_OF_ASIA = {"gb18030": "GB 18030", "shift_jis": "Shift JIS", "euc_kr": "EUC-KR", "big5": "Big5"}
_ASIAN_TIMES = re.compile(r"\d[年년]|日期|日時|时间|時間|時刻|시간|날짜|일시")
_SAMPLED = 200  # lines from the middle of a file, which tell how it is laid out
_FOLDED = 5  # lines over which a name in quotation marks may go
_HABIT = 0.05  # of rows; fewer that end early are no habit of a writer
_UNEVEN = 0.9  # of lines with as many cells as most have; fewer, and columns are at fixed places


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file of text.

    Raises
    ------
    InputError
        If it holds no table, or one that can be read in two ways.
    """
    text, encoding = _decode(path, raw)
    text = text.replace("\ufeff", "")  # of parts that were joined
    if not text.isascii():  # digits of Arabic and other scripts mean what ours do
        text = _DIGIT.sub(lambda digit: str(unicodedata.decimal(digit[0])), text)
        text = text.replace("\u066b", ".")
    text = text.replace("\r\r\n", "\n").replace("\r\n", "\n").replace("\r", "\n")
    lines = text.rstrip("\n").split("\n")
    # Monitors of serial ports put a time before what they receive.
    if 2 * sum(_RECEIVED.match(line) is not None for line in lines) > len(lines):
        mark = _separator(path, [_RECEIVED.sub("", line) for line in lines])
        lines = [_RECEIVED.sub(rf"\g<time>{mark}", line) for line in lines]
    labview = lines[0].startswith("LabVIEW Measurement")
    tabs = labview and "Separator\tTab" in map(str.strip, lines[:_SAMPLED])
    separator = "\t" if tabs else _separator(path, lines)
    rows, numbers, broken = _rows(lines, separator)
    rows, numbers = _with_step(rows, numbers)
    rows, padded = (rows, 0) if separator == " " else _filled(rows)
    if beside := _preamble_beside(rows):
        height, width = beside
        names = [f"column {i + 1}" for i in range(width, len(rows[0]))]
        rows = [*(row[:width] for row in rows[:height]), names, *(row[width:] for row in rows)]
        numbers = [*numbers[:height], numbers[0], *numbers]
    if not labview:
        *tables, table = find_tables(rows, numbers, str(path))
    else:
        tables, table = [], _of_labview(find_table(rows, numbers, str(path)))
        ends = [line for line in lines if line.startswith("***End_of_Header***")]
        if len(ends) > 2 and not any(row[0].strip() for row in table.rows):
            raise InputError(
                where=str(path),
                found=f"{len(ends) - 1} segments without a column of times",
                expected="times, as nobody knows what lies between two segments",
                remedy="export it with X values, or part the file before each header",
            )
    cut = (
        _cut_line(table)
        if table.lines[-1] == len(lines) and text[-1:] in "0123456789.,eE+-"
        else ""
    )
    if cut:
        table = replace(table, rows=table.rows[:-1], lines=table.lines[:-1])
    tables.append(table)
    # Between commas, a number has a comma only in quotation marks.
    commas = separator != "," or any("," in c for own in tables for row in own.rows for c in row)
    tagged = parts_of_tables(tables)
    written = [cells for _, own in tagged for cells in numbers_of(own)] if len(tagged) > 1 else []
    parts = [read_group(own, tag, str(path), written, commas=commas) for tag, own in tagged]
    groups, reading = [group for group, *_ in parts], parts[0][1]
    notes = list(dict.fromkeys(note for *_, own in parts for note in own))
    words = ["CSV", _SEPARATORS[separator], reading, encoding]
    begin = tables[0].lines[0]
    kept = {line for own in tables for line in own.lines}
    below = sorted({number for number in numbers if number >= begin})
    heads = sum(len(own.head) for own in tables[1:])
    broken += max(0, len(below) - len(kept) - heads - bool(cut))
    if broken:
        first = next((number for number in below if number not in kept), 0)
        at = f", the first in line {first}" if first else ""
        notes.append(f"{broken} lines that are no samples were left out{at}")
    if padded:
        notes.append(f"{padded} lines end before the last column: the cells they lack are empty")
    words.append(f"samples from line {begin}")
    return Contents(", ".join(words), groups, notes, (cut,) if cut else ())


def _cut_line(table: Cells) -> str:
    """That the last line ends within a number, in words; empty: it does not."""
    last = max((k for k, cell in enumerate(table.rows[-1]) if cell.strip()), default=-1)
    column = [row[last] for row in table.rows]
    if not is_cut(column):
        return ""
    return (
        f"line {table.lines[-1]} was left out: the file ends there within a line, and its last "
        f"number {column[-1].strip()!r} is shorter than those above it"
    )


def _decode(path: Path, raw: bytes) -> tuple[str, str]:
    """Text and name of its encoding."""
    raw = raw.rstrip(b"\0")  # with which some recorders fill what they have reserved
    if raw.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
        return (raw + b"\0" * (-len(raw) % 4)).decode("utf-32", "replace"), "UTF-32"
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return (raw + b"\0" * (len(raw) % 2)).decode("utf-16", "replace"), "UTF-16"
    begin = raw[:2000]
    for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):  # of mostly Latin letters
        if b"\0" in begin and begin[first::2].count(0) > 0.4 * len(begin):
            return (raw + b"\0" * (len(raw) % 2)).decode(encoding, "replace"), "UTF-16"
    if b"\0" in raw:
        raise InputError(
            where=str(path),
            found="zero bytes, which no text has",
            expected="a CSV, or a file of a format that is read",
            remedy="export the recording as CSV in the program that wrote it",
        )
    try:
        return raw.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError:
        for encoding, called in _OF_ASIA.items():
            with suppress(UnicodeDecodeError):
                if _ASIAN_TIMES.search(text := raw.decode(encoding)):
                    return text, called
        # Bytes that Windows-1252 leaves free are none of a table either.
        return raw.decode("cp1252", "replace"), "Windows-1252"


def _separator(path: Path, lines: Sequence[str]) -> str:
    """The separator with which most cells in the middle of the file are numbers or times."""
    middle_lines = _middle(_without_comments(lines))
    scores: dict[str, float] = {}
    for mark in _SEPARATORS:
        if mark == " ":
            rows = [line.split() for line in middle_lines]
        else:  # a mark within quotation marks parts no cells
            rows = [
                [cell.strip().replace("\0", mark) for cell in line.split(mark)]
                for line in (
                    _QUOTED.sub(lambda match: match[1].replace(mark, "\0"), line)  # noqa: B023
                    for line in middle_lines
                )
            ]
        widths = [len(row) for row in rows]
        if not widths or max(widths) < 2:
            continue
        width = max(set(widths), key=widths.count)
        cells = [cell for row in rows for cell in row]
        good = sum(is_missing(cell) or is_sample(cell) or is_quantity(cell) for cell in cells)
        even = widths.count(width) / len(widths)
        if width > 1:
            scores[mark] = good / len(cells) * even
    if not scores:
        raise InputError(
            where=str(path),
            found="no columns",
            expected="a table with semicolons, tabs, commas, bars or spaces between its columns",
            remedy="export the recording as CSV",
        )
    # Of equals the first: a semicolon separates for certain, a comma may be a decimal mark.
    return max(scores, key=lambda mark: scores[mark])


def _without_comments(lines: Sequence[str]) -> list[str]:
    """Lines that hold something, and begin with no mark of comments."""
    return [line for line in lines if line.strip() and not _COMMENT.match(line)]


def _middle(lines: Sequence[str]) -> Sequence[str]:
    """Lines from the middle, which tell how all are laid out."""
    begin = max(0, (len(lines) - _SAMPLED) // 2)
    return lines[begin : begin + _SAMPLED]


def _rows(lines: Sequence[str], separator: str) -> tuple[list[list[str]], list[int], int]:
    """Rows of cells, the lines they stand on, and how many lines could not be split."""
    rows: list[list[str]] = []
    numbers: list[int] = []
    broken = 0
    left = 0  # lines that are part of one above
    sampled = False  # whether a line of samples without a mark of comments has come
    edges = _edges(lines) if separator == " " else []
    for number, line in enumerate(lines, 1):
        if left:
            left -= 1
            continue
        bare = line[match.end() :] if (match := _COMMENT.match(line)) else line
        if not bare.strip():
            continue
        if edges and match is None:
            cells = [line[a:b].strip() for a, b in pairwise(edges)]
        elif separator == " ":
            cells = _BEFORE_UNIT.sub("", bare).split()
        elif '"' not in bare:
            cells = bare.split(separator)
        else:
            try:
                cells, left = _split_quoted(bare, lines[number : number + _FOLDED], separator)
            except (csv.Error, ValueError):
                broken += 1
                continue
        if match and sampled and _are_numbers(cells):
            cells = [line]  # samples that somebody took out
        sampled = sampled or (match is None and len(cells) > 1 and _are_numbers(cells))
        rows.append(cells)
        numbers.append(number)
    return rows, numbers, broken


def _filled(rows: list[list[str]]) -> tuple[list[list[str]], int]:
    """Rows with the empty cells that some writers leave out at their ends, and how many had none.

    Where the longest rows of numbers have as many cells as the names above them. A few short rows
    are accidents, and may end within a number; so may the last one.
    """
    lengths = sorted({len(row) for row in rows if len(row) > 1}, reverse=True)
    width = next((n for n in lengths if any(_are_numbers(r) for r in rows if len(r) == n)), 0)
    if all(len(row) >= width or not _are_numbers(row) for row in rows):
        return rows, 0  # as nearly always
    numeric = [i for i, row in enumerate(rows) if len(row) > 1 and _are_numbers(row)]
    short = [i for i in numeric if len(rows[i]) < width and i < len(rows) - 1]
    habit = len(short) >= _HABIT * len(numeric)
    if habit and rows and len(rows[-1]) in {len(rows[i]) for i in short} and _are_numbers(rows[-1]):
        short.append(len(rows) - 1)  # as long as others
    names = rows[numeric[0] - 1] if short and habit and numeric[0] else []
    if len(names) != width or not all(map(str.strip, names)) or any(map(is_number, names)):
        return rows, 0
    filled = list(rows)
    for i in short:
        filled[i] = rows[i] + [""] * (width - len(rows[i]))
    return filled, len(short)


def _are_numbers(row: Sequence[str]) -> bool:
    """Whether a row begins with a number or a time, as most of its cells are."""
    kinds = list(map(is_sample, row))
    return kinds[0] and 2 * sum(kinds) >= len(kinds)


def _split_quoted(line: str, below: Sequence[str], separator: str) -> tuple[list[str], int]:
    """Cells of a line with quotation marks, and how many lines below it they go on."""
    count = 0
    while line.count('"') % 2 and count < len(below):
        line = f"{line} {below[count]}"
        count += 1
    # A quoted part of a name is none of a cell: "PLC_1".flow
    strict = line.count('"') % 2 > 0 or re.search(r'"\.\w', line) is None
    (cells,) = csv.reader([line], delimiter=separator, strict=strict, skipinitialspace=True)
    return cells, count


def _edges(lines: Sequence[str]) -> list[int]:
    """Where columns of fixed places begin and end; none where spaces alone part cells.

    Columns are parted by places that are blank in all lines of samples.
    """
    bare = _without_comments(lines)
    numeric_lines = list(filter(_is_numeric, _middle(bare)))
    widths = [len(line.split()) for line in numeric_lines]
    if not widths or widths.count(max(set(widths), key=widths.count)) >= _UNEVEN * len(widths):
        return []
    length = max(map(len, bare))
    filled = np.zeros(length + 2, dtype=bool)
    for line in numeric_lines:
        for place, character in enumerate(line, 1):
            filled[place] |= not character.isspace()
    # A column ends behind its last figure: numbers of fixed columns stand at their right ends.
    ends = np.flatnonzero(filled[:-1] & ~filled[1:])
    return [0, *ends[:-1].tolist(), length]


def _is_numeric(line: str) -> bool:
    """Whether most of what stands in a line are numbers or times."""
    cells = line.split()
    return 2 * sum(map(is_sample, cells)) > len(cells)


def _preamble_beside(rows: Sequence[Sequence[str]]) -> tuple[int, int] | None:
    """Rows and columns of a preamble that stands left of samples, as oscilloscopes write it.

    Samples go on from the first row to the last; on their left all cells are empty but the first.
    """
    width = max(map(len, rows), default=0)
    if not any(is_number(cell.strip()) for row in rows[:1] for cell in row):
        return None  # names, as nearly always
    if len(rows) < _SAMPLED // 10 or {len(row) for row in rows} != {width}:
        return None
    columns = [[cell.strip() for cell in column] for column in zip(*rows, strict=True)]
    first = next((i for i, cells in enumerate(columns) if all(map(is_number, cells))), 0)
    left = [k for k, row in enumerate(rows) if any(cell.strip() for cell in row[:first])]
    height = left[-1] + 1 if left else 0
    return (height, first) if 1 < height < len(rows) // 2 and left[0] == 0 else None


def _with_step(rows: list[list[str]], numbers: list[int]) -> tuple[list[list[str]], list[int]]:
    """The same rows, with begin and step that stand behind names as a line above them.

    So oscilloscopes write samples without times: X,CH1,Start,Increment or CH1(V),t0 =0,tInc = 1e-6.
    """
    names, below = [*rows, [], []][:2]
    at = next((i for i, cell in enumerate(names) if _INCREMENT.fullmatch(cell)), 0)
    match = _INCREMENT.fullmatch(names[at]) if at > 1 else None
    value = "".join((match["value"] or "", *below[at : at + 1])).strip() if match else ""
    if match is None or not is_number(value):
        return rows, numbers
    first = [names[: at - 1], below if match["value"] else below[: at - 1]]
    return [[f"dt {value} s"], *first, *rows[2:]], [numbers[0], *numbers]


def _of_labview(table: Cells) -> Cells:
    """A table of LabVIEW: X_Value is the time, or steps of Delta_X are, both in seconds."""
    names = tuple("time" if name == "X_Value" else name for name in table.names)
    units = tuple(
        "s" if name == "time" else unit for name, unit in zip(names, table.units, strict=True)
    )
    steps = dict.fromkeys(
        step for line in table.head if line.startswith("Delta_X ") for step in line.split()[1:]
    )
    return replace(
        table, names=names, units=units, head=(*table.head, *(f"dt {s} s" for s in steps))
    )
