"""Where samples stand among rows of cells, and which tables they are of."""

import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise, zip_longest

from workbench.errors import InputError
from workbench.recordings.formats.numbers import is_number
from workbench.recordings.formats.spelling import name_and_unit, spell_unit
from workbench.recordings.formats.tables.cells import (
    Cells,
    are_units,
    is_data,
    is_text,
    is_time_alone,
    trim,
)
from workbench.recordings.formats.tables.header import (
    HEADER_ROWS,
    header,
    refuse_narrow,
    with_slashes,
)
from workbench.recordings.formats.tables.moments import with_whole_stamps
from workbench.recordings.formats.tables.scaling import (
    refuse_scales,
    refuse_units_within,
    remarks,
)
from workbench.recordings.formats.tables.units import without_units

_STATISTICS = re.compile(
    r"(min|max|avg|mean|std|average|median|rms|sum|total|minim\w+|maxim\w+|st(d|andard)[ ._]*dev\w*"
    r"|mittel\w*|mw|summe|standardabw\w*|stabw|moyenne|gemiddelde)\W*",
    re.IGNORECASE,
)
_MOST_STATISTICS = 10  # rows at an end of a table; more are states
_MOST_TURNED = 500  # rows of a table whose channels are rows
FEWEST = 3  # samples one after the other


def find_tables(rows: Sequence[Sequence[str]], lines: Sequence[int], where: str) -> list[Cells]:
    """Find all tables that stand below each other, each with a header of its own.

    A header that comes again, as at the begin of a page, begins no table where its times go on.

    Parameters
    ----------
    lines : of the file, on which the rows stand.

    Raises
    ------
    InputError
        See `find_table`.
    """
    tables: list[Cells] = []
    rows_at = dict(zip(lines, rows, strict=True))
    while (begin := _next_table(table := find_table(rows, lines, where), rows, lines)) is not None:
        tables.append(find_table(rows[:begin], lines[:begin], where))
        rows, lines = rows[begin:], lines[begin:]
    for own in (*tables, table):
        refuse_units_within(own, rows_at, where)
    return [*tables, table]


def _next_table(table: Cells, rows: Sequence[Sequence[str]], lines: Sequence[int]) -> int | None:
    """Row at which a table below begins, with its preamble."""
    samples = set(table.lines)
    # There is none below a table whose channels are rows.
    others = (i for i, line in enumerate(lines) if line > table.lines[0] and line not in samples)
    begin = next((i for i in others if _begins_table(rows, i, table, lines)), None)
    while begin is not None and lines[begin - 1] not in samples:
        begin -= 1
    return begin


def _begins_table(
    rows: Sequence[Sequence[str]], i: int, table: Cells, lines: Sequence[int]
) -> bool:
    """Whether a row below samples is a header of others than those of a table."""
    names = [cell.strip() for cell in trim(rows[i])]
    if len(names) < 2 or not all(map(is_text, names)):
        return False
    below = next((k for k in range(i + 1, len(rows)) if is_data(rows[k])), len(rows))
    following = rows[below : below + FEWEST]
    if below - i > HEADER_ROWS or len(following) < FEWEST or all(map(_is_statistic, following)):
        return False
    if any(len(trim(row)) > len(names) or not is_data(row) for row in following):
        return False
    if names == [cell.strip() for cell in trim(table.names)]:
        units = [
            [spell_unit(cell) for cell in row] for row in rows[i + 1 : below] if are_units(row)
        ]
        if any(trim(own) != list(trim(table.units)) for own in units):
            return True
        last = table.rows[bisect_left(table.lines, lines[i]) - 1][0]
        pair = last.replace(",", "."), following[0][0].replace(",", ".")
        return all(map(is_number, pair)) and float(pair[1]) <= float(pair[0])
    known = {name_and_unit(name)[0] for name in table.names}
    return any(name_and_unit(name)[0] in known or name_and_unit(name)[1] for name in names)


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
    if turned := _rows_of_channels(rows):
        return find_table(turned, range(1, len(turned) + 1), where)
    samples = _samples(rows, lines, is_data)
    if len(samples) < FEWEST:  # numbers may have units behind them
        samples = _samples(rows, lines, lambda row: is_data(without_units(row)))
    width = Counter(len(rows[i]) for i in samples).most_common(1)[0][0] if samples else 0
    first = _first_of_several(rows, samples, width)
    if first is None or width < 2:
        raise InputError(
            where=where,
            found="no columns of numbers",
            expected="a table: names, then a row for each sample, at least a time and a signal",
            remedy="export the recording as a table",
        )
    above = rows[:first]
    refuse_scales(above, lines, width, where)
    names, units = header(above, width)
    kept = [i for i in samples if i >= first]
    body = [list(rows[i][:width]) for i in kept]
    if 0 < len(trim(names)) == width - 1:
        body = with_whole_stamps(body)
        width = len(body[0])
    if names:
        refuse_narrow(names, units, body, f"{where}, above line {lines[first]}")
    else:
        names = [f"column {i + 1}" for i in range(width)]
    names = names if units else with_slashes(names)
    # Recorders of portable kind name channels CH1 above samples, and say further up what they are.
    listed = {row[0].strip(): row[1].strip() for row in above if len(row) > 2}
    table = Cells(
        rows=body,
        lines=[lines[i] for i in kept],
        head=tuple(" ".join(filter(None, row)) for row in above),
        names=tuple((names + [""] * width)[:width]),
        units=tuple((units + [""] * width)[:width]),
        about=tuple(text if (text := listed.get(name, "")) not in names else "" for name in names),
    )
    return replace(table, remarks=remarks(table, above))


def _first_of_several(
    rows: Sequence[Sequence[str]], samples: Sequence[int], width: int
) -> int | None:
    """The first sample that others follow: lines of a preamble may hold numbers, too.

    Between samples of slow channels, those of fast ones may have a time alone.
    """
    taken = set(samples)
    others = (i for i, row in enumerate(rows) if i not in taken and is_time_alone(row, width))
    known = sorted({*samples, *others})
    runs = (i for i, j in zip(known, known[2:], strict=False) if j == i + 2)
    return next((i for i in runs if samples), None)


def _samples(
    rows: Sequence[Sequence[str]], lines: Sequence[int], is_sample: Callable[[Sequence[str]], bool]
) -> list[int]:
    """Places of the rows that are samples, of one width.

    A row whose first cell is a text, where those of samples are none, is one of statistics or of
    settings, and so are rows that say it at the begin or the end; one or two rows below an empty
    line at the end are sums.
    """
    data = [i for i, row in enumerate(rows) if is_sample(row)]
    width = Counter(len(rows[i]) for i in data).most_common(1)[0][0] if data else 0
    samples = [i for i in data if len(rows[i]) == width or len(trim(rows[i])) == width]
    texts = {i for i in samples if is_text(rows[i][0])}
    if 2 * len(texts) < len(samples):
        samples = [i for i in samples if i not in texts]
    above = _statistics_at_begin([rows[i] for i in samples[: 2 * _MOST_STATISTICS]])
    below = _statistics_at_begin([rows[i] for i in samples[: -2 * _MOST_STATISTICS : -1]])
    samples = samples[above : len(samples) - below]
    empty = [lines[j] - lines[i] > j - i for i, j in pairwise(samples)]  # lines that are no rows
    numbers = [str(k + 1) for k in range(width)]  # of channels, above an empty line
    if any(empty[:1]) and [cell.strip(' "') for cell in rows[samples[0]]] == numbers:
        samples, empty = samples[1:], empty[1:]
    for k in range(max(2, len(samples) - FEWEST + 1), len(samples)):
        if empty[k - 1] and not empty[k - 2]:
            return samples[:k]
    return samples


def _is_statistic(row: Sequence[str]) -> bool:
    return any(map(_STATISTICS.fullmatch, map(str.strip, row)))


def _statistics_at_begin(rows: Sequence[Sequence[str]]) -> int:
    """How many rows at an end say that they are statistics, where those beside them do not."""
    says = [_is_statistic(row) for row in rows]
    count = sum(says)
    return count if count <= min(_MOST_STATISTICS, len(says) - 1) and all(says[:count]) else 0


def _rows_of_channels(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Columns as rows, where each channel is a row with its name first; empty: they are none."""
    data = [row for row in rows if is_data(row)] if len(rows) < _MOST_TURNED else []
    width = max(map(len, data), default=0)
    if not 2 <= len(data) <= width // 4 or not all(is_text(row[0]) for row in data):
        return []
    return [list(column) for column in zip_longest(*data, fillvalue="")]
