"""Names and units of columns, as they stand above samples."""

import re
from collections.abc import Sequence

from workbench.errors import InputError
from workbench.recordings.formats.numbers import is_number
from workbench.recordings.formats.spelling import conversion, is_unit, name_and_unit, spell_unit
from workbench.recordings.formats.tables.cells import (
    TIME_NAME,
    UNIT_ROW,
    are_units,
    is_moment,
    says_nothing,
    trim,
)
from workbench.recordings.formats.tables.moments import PARTS_OF_SECOND, PARTS_OF_TIME
from workbench.recordings.formats.tables.preamble import INTERVAL

_STATED_UNITS = re.compile(r"\W*(units?|einheit(en)?)\s*[:=]\s*(?P<units>\S.*)", re.IGNORECASE)
_LISTED = (r"[,;|\t]\s*", r"[,;|]?\s+")  # marks between units in words
HEADER_ROWS = 5  # of names, units and kinds
# Labels of rows: of names, of units; and of a column that holds remarks.
_NAME_ROW = re.compile(
    r"((channel|kanal|signal|trace|sensor|long)[ _]?)?(names?|title|bezeichnung)\W*"
    r"|kanal|channel|signal|path",
    re.IGNORECASE,
)
_RULE = re.compile(r"[-=_+]+|\[data\]", re.IGNORECASE)  # of a table that is drawn, or follows
_REMARK = re.compile(r"comments?|remarks?|notes?|kommentar|bemerkung", re.IGNORECASE)
_QUOTIENT = re.compile(r"\s*(?P<name>[^/\s][^/]*?)\s*/\s*(?P<unit>[^\s/].*?)\s*")


def header(above: Sequence[Sequence[str]], width: int) -> tuple[list[str], list[str]]:
    """Names and units as they stand above samples of some width; empty where there are none."""
    rows = _with_index_name([_with_own_cells(row, width) for row in above], width)
    names, units = _names_and_units(rows, width)
    without_units = len(trim(names)) - 1
    if (
        len(units) == without_units > 0
        and TIME_NAME.match(names[0])
        and not conversion(units[0], "s")
    ):
        units = ["", *units]  # between spaces, dates and times have none
    return names, units


def refuse_narrow(
    names: Sequence[str], units: Sequence[str], samples: Sequence[Sequence[str]], where: str
) -> None:
    """Refuse a header that does not reach as far as the samples: which name is whose is not known.

    R writes row numbers without a name; numbers with decimal commas between commas are two cells.
    """
    named = len(trim(names))
    held = max(len(trim(row)) for row in samples)
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


def _with_own_cells(row: Sequence[str], width: int) -> Sequence[str]:
    """A row of units behind their label as cells, which other marks may part: units: s, mm."""
    match = _STATED_UNITS.fullmatch(" ".join(filter(None, map(str.strip, row))))
    cells = [re.split(mark, match["units"].strip()) for mark in _LISTED] if match else []
    return next((own for own in cells if len(own) == width and are_units(own)), row)


def _with_index_name(above: Sequence[Sequence[str]], width: int) -> Sequence[Sequence[str]]:
    """The same rows; where the last holds the name of times alone, this in the first of the names.

    So pandas writes it, below columns with names of several levels.
    """
    last = above[-1] if above else []
    begin = len(above) - 1
    while begin > 0 and len(above[begin - 1]) == width:
        begin -= 1
    if len(last) != width or len(trim(last)) != 1 or not TIME_NAME.match(last[0].strip()):
        return above
    names = above[begin:-1]
    named = [[last[0] if k == 0 else "", *row[1:]] for k, row in enumerate(names)]
    return [*above[:begin], *named]


def _names_and_units(above: Sequence[Sequence[str]], width: int) -> tuple[list[str], list[str]]:
    if pairs := _header_of_pairs(above, width):
        return pairs
    rows = _rows_of_header(above, width)
    at = next((i for i in range(1, len(rows)) if are_units(rows[i])), None)
    if at is None and len(rows) > 1 and are_units(rows[0]):
        rows = [*rows[1:2], rows[0], *rows[2:]]
        at = 1
    if at is not None and (names_and_units := _header_below(rows[at], rows[at + 1 :], width)):
        return names_and_units
    # Below units stand kinds, such as Avg; channel numbers are no names.
    named = [row for row in rows[:at] if not all(is_number(cell) for cell in row if cell)]
    is_labelled = at is None or (
        UNIT_ROW.fullmatch(rows[at][0]) and not _NAME_ROW.fullmatch(rows[at - 1][0])
    )
    labelled = _labelled_row(above, UNIT_ROW, width) if is_labelled else []
    if labelled and (own := _labelled_row(above, _NAME_ROW, width)):
        named = [own]
    if not named:
        return (rows[-1], []) if rows and at is None else ([], [])
    if at is None:
        with_units = max(named, key=_units_within)
        if 2 * _units_within(with_units) > width and all(with_units):  # above a row of kinds
            return with_units, []
        return _whole_names(named), [spell_unit(cell) for cell in labelled]
    units = [cell if is_unit(cell) or not says_nothing(cell) else "" for cell in rows[at]]
    names = _whole_names(named)
    for below in rows[at + 1 :]:  # dates and times may have their names there
        for i, cell in enumerate(below[: len(names)]):
            if not any(units[i : i + 1]) and cell.casefold() in {*PARTS_OF_SECOND, *PARTS_OF_TIME}:
                names[i] = cell
    return names, [spell_unit(cell) for cell in units]


def _rows_of_header(above: Sequence[Sequence[str]], width: int) -> list[list[str]]:
    """The rows next above samples that may hold names, units and kinds, from above."""
    rows: list[list[str]] = []
    for row in reversed(above):
        cells = [cell.strip() for cell in row]
        if len(cells) == width + 1 and _REMARK.fullmatch(cells[-1]):
            cells = cells[:width]
        if not trim(cells) or all(_RULE.fullmatch(cell) for cell in cells):
            continue
        if len(cells) == width and any(map(is_moment, cells)):
            continue  # a sample of texts, as historians begin with: Pt Created
        if len(trim(cells)) > width or len(trim(cells)) < max(2, (width + 1) // 2):
            break
        rows.insert(0, cells)
        if len(rows) == HEADER_ROWS:
            break
    return rows


def _header_below(
    units: list[str], below: Sequence[list[str]], width: int
) -> tuple[list[str], list[str]] | None:
    """Names and units, where settings with a row of units stand above the header; else None."""
    if not below or len(trim(below[-1])) != width or len(set(below[-1])) != width:
        return None
    names = below[-1]
    if all(names) and 2 * _units_within(names) > width:
        return names, []
    labelled = UNIT_ROW.fullmatch(units[0]) and not UNIT_ROW.fullmatch(names[0])
    if labelled and TIME_NAME.match(names[0]):
        return names, [spell_unit(cell) if is_unit(cell) else "" for cell in units]
    return None


def _header_of_pairs(
    above: Sequence[Sequence[str]], width: int
) -> tuple[list[str], list[str]] | None:
    """Names and units, where rows repeat their label before each value, over times; else None."""
    rows = [[cell.strip() for cell in row] for row in above if len(row) >= width > 2]
    paired = [row[:width] for row in rows if len(set(row[:width:2])) == 1]
    names = next((row for row in paired if _NAME_ROW.fullmatch(row[0])), None)
    units = next((row for row in paired if UNIT_ROW.fullmatch(row[0])), None)
    if names is None or units is None or width % 2:
        return None
    clock = next((name_and_unit(row[0])[1] for row in paired if INTERVAL.search(row[0])), "")
    return (
        [cell if i % 2 else f"{names[i + 1]} time" for i, cell in enumerate(names)],
        [spell_unit(cell) if i % 2 else clock for i, cell in enumerate(units)],
    )


def _units_within(row: Sequence[str]) -> int:
    """How many names of a row have a unit behind them."""
    return sum(bool(name_and_unit(cell)[1]) for cell in row)


def _labelled_row(above: Sequence[Sequence[str]], label: re.Pattern[str], width: int) -> list[str]:
    """The row of a preamble that a label of its own says what it is, over all columns; or none."""
    for row in reversed(above):
        cells = [cell.strip() for cell in row]
        if width < 2 * len(trim(cells)) <= 2 * width and label.fullmatch(cells[0]):
            return ["", *cells[1:], *[""] * (width - len(cells))]
    return []


def _whole_names(rows: Sequence[list[str]]) -> list[str]:
    """The last row; where its names are not enough, with what stands over each of them.

    A cell over several columns holds its text in the first of them.
    """
    names = rows[-1]
    held = [name for name in names if name]
    if len(rows) < 2 or (len(set(held)) == len(held) and len(held) == len(trim(names))):
        return names
    over, last = [], ""
    for cell in rows[-2] + [""] * (len(names) - len(rows[-2])):
        last = cell or last
        over.append(last)
    names = names + [""] * (len(over) - len(names))
    return [" ".join(filter(None, pair)) for pair in zip(over, names, strict=True)]


def with_slashes(names: list[str]) -> list[str]:
    """Names with units in brackets, where most are written as quotients: t/s, U/V, Ewe/V."""
    matches = [_QUOTIENT.fullmatch(name) for name in names]
    units = [match["unit"] if match and is_unit(match["unit"]) else "" for match in matches]
    if sum(map(bool, units)) < max(2, len(names) / 3):
        return names
    return [
        f"{match['name']} [{unit}]" if match and unit else name
        for name, match, unit in zip(names, matches, units, strict=True)
    ]
