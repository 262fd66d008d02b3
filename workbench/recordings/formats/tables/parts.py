"""Parts of a table with times of their own: rows of one signal each, columns behind a clock."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from workbench.recordings.formats.contents import FileChannel, Group
from workbench.recordings.formats.numbers import is_missing, is_number
from workbench.recordings.formats.spelling import name_and_unit, spell_unit
from workbench.recordings.formats.tables.cells import Cells, is_clock
from workbench.recordings.formats.tables.samples import FEWEST
from workbench.recordings.formats.tables.units import PARTS_OF_TAGS, conversion_note, one_unit

_WORDS = re.compile(r"[^\W\d_]+")
_LETTERS = frozenset("abcdefghijklmnopqrstuvwxyz")  # that count columns: Time A, Time B; t1 has one


def parts_of_tables(tables: Sequence[Cells]) -> list[tuple[str, Cells]]:
    """Tables with times of their own, by name; a table alone that holds no several has none.

    Rows may hold one value of one signal that a column names, as historians of plants export: a
    tag, a time and a value, perhaps with its unit. Or columns of times stand before others each.
    """
    named = [(f"table {k}" * (len(tables) > 1), table) for k, table in enumerate(tables, 1)]
    return [(f"{name} {tag}".strip(), own) for name, table in named for tag, own in _parts(table)]


def _parts(table: Cells) -> list[tuple[str, Cells]]:
    names = [name_and_unit(name)[0].casefold() for name in table.names]
    at = {part: i for i, name in enumerate(names) if (part := PARTS_OF_TAGS.get(name))}
    tagged = at.keys() >= {"tag", "value"}
    return (_by_tag(table, at) if tagged else _by_clock(table)) or [("", table)]


def _by_tag(table: Cells, at: Mapping[str, int]) -> list[tuple[str, Cells]]:
    """A table for each tag; none where tags are too many, or numbers.

    Parameters
    ----------
    at : columns of tags, values and perhaps units.
    """
    columns = table.columns
    tags = list(dict.fromkeys(columns[at["tag"]]))
    if not 1 < len(tags) <= len(table.rows) / FEWEST or any(map(is_number, tags)):
        return []
    tables = []
    for tag in tags:
        kept = [k for k, own in enumerate(columns[at["tag"]]) if own == tag]
        names, units = list(table.names), list(table.units)
        names[at["value"]], names[at["tag"]] = tag, "tag"
        if "unit" in at:
            own_units = {columns[at["unit"]][k] for k in kept}
            units[at["value"]] = spell_unit(own_units.pop()) if len(own_units) == 1 else ""
        part = replace(table.part(kept), names=tuple(names), units=tuple(units))
        tables.append((tag, part))
    return tables


def _by_clock(table: Cells) -> list[tuple[str, Cells]]:
    """A table for each column of times, with the columns behind it; none where these are alike."""
    labels = table.labels
    columns = table.columns
    at = [i for i, cells in enumerate(columns) if is_clock(labels[i], cells)]
    if len(at) < 2:
        return []
    blocks = list(pairwise([*at, len(columns)]))
    behind = [[name for name, _ in labels[a + 1 : b] if name] for a, b in blocks]
    alike = {
        tuple(sorted(_words([labels[a][0]]) - _words(own) - _LETTERS))
        for a, own in zip(at, behind, strict=True)
    }
    # Or each column ends where its times do, and these elsewhere than others.
    lengths = [{_length(columns[i]) for i in range(a, b) if any(columns[i])} for a, b in blocks]
    apart = max(map(len, lengths)) == 1 and len(set().union(*lengths)) > 1
    same = len({tuple(columns[a]) for a in at}) == 1
    if not all(behind) or same or not (apart or len(alike) == 1):
        return []
    tables = []
    for (clock, b), own in zip(blocks, behind, strict=True):
        a = clock if clock != at[0] else 0
        part = table.part([k for k, cell in enumerate(columns[clock]) if not is_missing(cell)])
        part = replace(
            part,
            rows=[row[a:b] for row in part.rows],
            names=table.names[a:b],
            units=table.units[a:b],
            about=table.about[a:b],
            remarks=table.remarks[a:b],
        )
        tables.append((own[0], part))
    return tables


def _length(cells: Sequence[str]) -> int:
    """Cells up to the last one that holds anything."""
    return max((k + 1 for k, cell in enumerate(cells) if not is_missing(cell)), default=0)


def _words(names: Sequence[str]) -> set[str]:
    return {word for name in names for word in _WORDS.findall(name.casefold())}


def by_tag(group: Group) -> list[Group]:
    """Groups of one signal each, where rows hold one value of one that a column names; else it."""
    at = {PARTS_OF_TAGS.get(name_and_unit(c.name)[0].casefold()): c for c in group.channels}
    texts = {PARTS_OF_TAGS.get(c.name.casefold()): c.texts for c in group.left}
    value, tags = at.get("value"), texts.get("tag", ())
    called = list(dict.fromkeys(filter(None, tags)))
    if value is None or not 1 < len(called) <= len(tags) / FEWEST:
        return [group]
    groups = []
    for tag in called:
        rows = [k for k, own in enumerate(tags) if own == tag]
        units = [texts["unit"][k] if "unit" in texts else value.unit for k in rows]
        unit, factors = one_unit(units) or ("", np.ones(len(rows)))
        own_value = _rows_of(value, rows)
        own_value = replace(own_value, name=tag, unit=unit, values=factors * own_value.values)
        if note := conversion_note(factors, unit):
            own_value = replace(own_value, corrections=tuple(note))
        channels = (own_value if c is value else _rows_of(c, rows) for c in group.channels)
        own_group = replace(
            group,
            name=tag,
            channels=tuple(channels),
            time=_rows_of(group.time, rows) if group.time else None,
            within=(*group.within, tag),
            left=(),
        )
        groups.append(own_group)
    return groups


def _rows_of(channel: FileChannel, rows: list[int]) -> FileChannel:
    """Some samples of a channel."""
    return replace(
        channel,
        values=channel.values[rows],
        texts=tuple(channel.texts[k] for k in rows) if channel.texts else (),
        censored=tuple(np.flatnonzero(np.isin(rows, channel.censored)).tolist()),
    )
