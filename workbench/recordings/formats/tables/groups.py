"""Columns of a table to channels, with what was changed and left out."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.formats.contents import FileChannel, Group
from workbench.recordings.formats.numbers import (
    all_plain,
    is_censored,
    is_like_number,
    is_missing,
    is_number,
    reading_of,
    values_of,
)
from workbench.recordings.formats.stamps import goes_on, is_said, is_stamp, read_stamps
from workbench.recordings.formats.tables.cells import Cells, Label, mostly
from workbench.recordings.formats.tables.moments import Columns, join_moments
from workbench.recordings.formats.tables.preamble import stated_begin, stated_step
from workbench.recordings.formats.tables.quality import leave_out_bad
from workbench.recordings.formats.tables.signs import signs_beside
from workbench.recordings.formats.tables.units import (
    conversion_note,
    numbers_within,
    one_unit,
    units_beside,
)

_FEW = 50  # rows that tell whether times go back
# What stands behind a name and is no unit, such as how its dates are written, or their zone.
_BEHIND_NAME = re.compile(r"\(([^()]+)\)$|, ((?:GMT|UTC)\S*)$")


def numbers_of(table: Cells) -> list[list[str]]:
    """Columns of a table that hold numbers, without those of dates such as 14.03.2026."""
    return [
        all_plain(cells)
        for cells in table.columns
        if mostly(cells, is_number) and not mostly(cells, is_stamp)
    ]


def read_group(
    table: Cells,
    name: str,
    where: str,
    beside: Sequence[Sequence[str]] = (),
    *,
    commas: bool = True,
) -> tuple[Group, str, list[str]]:
    """Channels of a table, how its numbers are written, and notes on what was left out.

    Parameters
    ----------
    beside : numbers of other tables of the file, which are written in the same way.
    commas : whether numbers may hold commas.

    Raises
    ------
    InputError
        If numbers can be read in two ways.
    """
    notes: list[str] = []
    columns, lines = table.columns, table.lines
    if turned := _newest_first(columns):
        columns, lines = [cells[::-1] for cells in columns], lines[::-1]
        notes.append(f"rows with the newest first were turned, by {turned}")
    names = [name for name, _ in table.labels]
    about, remarks = (dict(zip(names, own, strict=False)) for own in (table.about, table.remarks))
    joined = join_moments(Columns(table.labels[: len(columns)], columns))
    labels, columns = joined.labels, joined.cells
    said: dict[int, list[str]] = {i: [] for i in range(len(columns))}  # of what was changed
    for i, k, signs in signs_beside(labels, columns):
        if signs:
            columns[k] = list(map("".join, zip(signs, columns[k], strict=True)))
            said[k].append(f"its sign is taken from '{labels[i][0]}'")
        else:
            held = ", ".join(sorted({*columns[i]} - {""}))
            remarks[labels[k][0]] = f"'{labels[i][0]}' beside it with {held}"
    unnamed = {f"column {i}" for i, name in enumerate(table.names, 1) if not name.strip()}
    stamps: list[FileChannel] = []
    numbers: dict[int, list[str]] = {}
    factors: dict[int, Vector] = {}  # by row, of columns with several units
    texts: dict[int, list[str]] = {}
    for i, cells in enumerate(columns):
        if (channel := _moments(labels[i], cells)) is not None:
            stamps.append(channel)
            notes += [f"'{channel.name}' holds {channel.doubt}"] * bool(channel.doubt)
        elif mostly(cells, is_number):
            numbers[i] = all_plain(cells)
        elif (within := numbers_within(cells, labels[i][1])) is not None:
            bare, (unit, factors[i]) = within
            numbers[i], labels[i] = all_plain(bare), (labels[i][0], unit)
        elif any(cells) or labels[i][0] not in unnamed:
            texts[i] = cells
    for k, i in units_beside(labels, numbers, texts).items():
        rows = list(zip(numbers[k], texts.pop(i), strict=True))
        if one := one_unit([unit if is_number(cell) else None for cell, unit in rows]):
            labels[k], factors[k] = (labels[k][0], one[0]), one[1]
        else:
            del numbers[k]
            texts[k] = [" ".join(row) for row in rows]
    for k, factor in factors.items():
        said[k] += conversion_note(factor, labels[k][1])
    left: list[FileChannel] = []
    for i, cells in texts.items():
        notes.append(f"'{labels[i][0]}' holds {'texts' if any(cells) else 'nothing'}")
        none = np.full(len(cells), math.nan)
        left.append(FileChannel(labels[i][0], "", none, texts=tuple(cells)))
    for k, text, question in leave_out_bad(labels, columns, numbers):
        said[k] += [text] * bool(text)
        if question:
            remarks[labels[k][0]] = question
    reading = reading_of([*numbers.values(), *beside], where, commas=commas)
    channels: list[FileChannel] = []
    for i, cells in numbers.items():
        own, unit = labels[i]
        values = factors.get(i, 1.0) * values_of(cells, reading)
        channel = FileChannel(own, unit, values, about.get(own, ""), remark=remarks.get(own, ""))
        channel = _with_gaps(channel, cells, columns[i], lines)
        channel = replace(channel, corrections=(*said[i], *channel.corrections))
        notes += [f"'{own}': {text}" for text in channel.corrections]
        channels.append(channel)
    step, doubt = stated_step(table.head)
    group = Group(
        name,
        (*stamps, *channels),
        step=step,
        step_doubt=doubt,
        within=(name,) if name else (),
        left=tuple(left),
        begun=stated_begin(table.head),
    )
    return group, reading, notes


def _newest_first(columns: Sequence[Sequence[str]]) -> str:
    """The time stamp of the first row, where they go back from row to row; empty: they do not."""
    for cells in columns:
        few = cells[:_FEW]
        if not mostly(few, is_stamp) or _is_ordered(few) or not _is_ordered(few[::-1]):
            continue
        if _is_ordered(cells[::-1]):
            return f"'{next(filter(None, cells))}' in the first"
    return ""


def _is_ordered(cells: Sequence[str]) -> bool:
    """Whether time stamps go on from cell to cell."""
    stamps = read_stamps("", cells)
    return stamps is not None and not stamps.doubt and goes_on(stamps.values)


def _moments(label: Label, cells: Sequence[str]) -> FileChannel | None:
    """A column of time stamps; None where it is none."""
    if not mostly(cells, is_stamp):
        return None
    name, unit = label
    behind = _BEHIND_NAME.search(name)
    statements = (unit, behind[1] or behind[2] if behind else "")
    return read_stamps(name, cells, next(filter(is_said, statements), ""))


def _with_gaps(
    channel: FileChannel, cells: Sequence[str], written: Sequence[str], lines: Sequence[int]
) -> FileChannel:
    """The channel, with what is said of cells that are no numbers.

    Parameters
    ----------
    written : cells as the file has them, on its lines.
    """
    gaps = np.flatnonzero(np.isnan(channel.values)).tolist()
    beyond = [k for k in gaps if is_censored(cells[k])]
    bad = [k for k in gaps if not is_missing(cells[k]) and not is_censored(cells[k])]
    like = [k for k in bad if is_like_number(cells[k])]
    said = [
        f"{len(beyond)} cells say only that a value is below or above another, the first "
        f"{cells[k]!r} in line {lines[k]}; they are no samples"
        for k in beyond[:1]
    ]
    said += [
        f"{len(bad)} cells that are no numbers are gaps, the first {written[k]!r} in line "
        f"{lines[k]}"
        for k in bad[:1]
    ]
    return replace(
        channel,
        censored=tuple(beyond),
        unread=f"{len(like)} cells such as {written[like[0]]!r}" if like else "",
        corrections=tuple(said),
    )
