"""CSV of any locale: encoding, separator, decimal mark, preamble and units are found."""

import csv
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from workbench.errors import InputError
from workbench.recordings.formats.cells import find_table, read_group
from workbench.recordings.formats.contents import Contents

_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars", ",": "commas", " ": "spaces"}
_COMMENT = re.compile(r"\s*\"?(#+|%+|//+|!+|\*+)\s*")
_BEFORE_UNIT = re.compile(r"\s+(?=[\[(])")  # between a name and its unit
_SAMPLED = 200  # lines from the middle of a file, which tell how it is laid out
_CELL = re.compile(r"\s*[+-]?[0-9.,:/TZ\s+-]*[0-9][0-9.,:/TZ\s+-]*([eE][+-]?[0-9]+)?\s*")


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file of text.

    Raises
    ------
    InputError
        If it holds no table, or one that can be read in two ways.
    """
    text, encoding = _decoded(path, raw)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n").split("\n")
    separator = _separator(path, lines)
    rows, numbers, broken = _rows(lines, separator)
    table = find_table(rows, numbers, str(path))
    # Between commas, a number has a comma only in quotation marks.
    commas = separator != "," or any("," in cell for row in table.rows for cell in row)
    group, reading, notes = read_group(table, "", str(path), commas=commas)
    words = ["CSV", _SEPARATORS[separator], reading, encoding]
    below = [number for number in numbers if number >= table.lines[0]]
    broken += len(below) - len(table.lines)
    if broken:
        kept = set(table.lines)
        first = next((number for number in below if number not in kept), 0)
        at = f", the first in line {first}" if first else ""
        notes.append(f"{broken} lines that are no samples were left out{at}")
    words.append(f"samples from line {table.lines[0]}")
    return Contents(", ".join(words), [group], notes)


def _decoded(path: Path, raw: bytes) -> tuple[str, str]:
    """Text and name of its encoding."""
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return raw.decode("utf-16", "replace"), "UTF-16"
    if b"\0" in raw:
        raise InputError(
            where=str(path),
            found="zero bytes, which no text has",
            expected="a CSV, or a file of a recorder with its usual ending",
            remedy="give the file its own ending (.mf4, .tdms, .mat, .xlsx, .parquet), or export "
            "it as CSV",
        )
    try:
        return raw.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError:
        # Bytes that Windows-1252 leaves free are none of a table either.
        return raw.decode("cp1252", "replace"), "Windows-1252"


def _separator(path: Path, lines: Sequence[str]) -> str:
    """The separator with which most cells in the middle of the file are numbers or times."""
    middle = [line for line in lines if line.strip() and not _COMMENT.match(line)]
    begin = max(0, (len(middle) - _SAMPLED) // 2)
    some = middle[begin : begin + _SAMPLED]
    scores: dict[str, float] = {}
    for mark in _SEPARATORS:
        split = _splitter(mark)
        rows = [split(line) for line in some]
        widths = [len(row) for row in rows]
        if not widths or max(widths) < 2:
            continue
        width = max(set(widths), key=widths.count)
        cells = [cell for row in rows for cell in row]
        good = sum(not cell.strip() or bool(_CELL.fullmatch(cell)) for cell in cells)
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


def _splitter(mark: str) -> Callable[[str], list[str]]:
    if mark == " ":
        return lambda line: line.split()
    return lambda line: line.replace('"', "").split(mark)


def _rows(lines: Sequence[str], separator: str) -> tuple[list[list[str]], list[int], int]:
    """Rows of cells, the lines they stand on, and how many lines could not be split."""
    rows: list[list[str]] = []
    numbers: list[int] = []
    broken = 0
    for number, line in enumerate(lines, 1):
        bare = line[match.end() :] if (match := _COMMENT.match(line)) else line
        if not bare.strip():
            continue
        if separator == " ":
            cells = _BEFORE_UNIT.sub("", bare).split()
        elif '"' not in bare:
            cells = bare.split(separator)
        else:
            try:
                (cells,) = csv.reader([bare], delimiter=separator, strict=True)
            except (csv.Error, ValueError):
                broken += 1
                continue
        rows.append(cells)
        numbers.append(number)
    return rows, numbers, broken
