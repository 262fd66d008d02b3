"""JSON: a record for each sample, a list for each channel, or structures of them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.recordings.formats.arrays import by_place, read_groups
from workbench.recordings.formats.contents import Contents, Group
from workbench.recordings.formats.spelling import name_and_unit, spell_unit
from workbench.recordings.formats.tables.cells import Cells
from workbench.recordings.formats.tables.groups import read_group
from workbench.recordings.formats.tables.samples import find_table

_SCALAR = str | int | float | bool | None
_FEWEST = 3  # rows of a table
# Lists of times and values, and which of the two is the time: Prometheus, others, Graphite.
_PAIRS = {"values": 0, "data": 0, "datapoints": 1}
_UNITS = ("units", "unit", "einheiten")


def is_json(raw: bytes) -> bool:
    """Whether a file begins as JSON does, and no CSV."""
    begin = raw[:200].lstrip(b"\xef\xbb\xbf \r\n\t")
    inner = begin[1:].lstrip()
    return (begin[:1] == b"{" and inner[:1] in (b'"', b"}")) or (
        begin[:1] == b"[" and inner[:1] in (b"[", b"{")
    )


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file, a document or one for each line.

    Raises
    ------
    InputError
        If it is no JSON, or its numbers can be read in two ways.
    """
    document = _document(path, raw.decode("utf-8-sig", "replace"))
    groups: list[Group] = []
    notes: list[str] = []
    tables: list[tuple[str, list[list[Any]], Mapping[str, Any]]] = []
    arrays = _arrays(_split_tables("", document, {}, tables))
    for name, rows, units in tables:
        where = f"{path}, '{name}'" if name else str(path)
        group, _, own = read_group(_table(rows, units, where), name, where)
        groups += [group] * bool(group.channels)
        notes += own
    nested, left = read_groups(arrays if isinstance(arrays, Mapping) else {"data": arrays})
    return Contents("JSON", [*groups, *nested], [*notes, *left])


def _document(path: Path, text: str) -> Any:
    """What a file holds; documents of lines are a list."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        fault: Exception = error
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    documents: list[Any] = []
    for number, line in lines:
        try:
            documents.append(json.loads(line))
        except (ValueError, RecursionError) as error:
            of_line = len(documents) > 1  # else the file is one document, with a fault
            raise InputError(
                where=f"{path}, line {number if of_line else getattr(fault, 'lineno', 1)}",
                found=f"text that is no JSON ({error if of_line else fault})",
                expected="one document, or one in each line",
                remedy="copy or export it again, whole",
            ) from None
    return documents


def _split_tables(
    name: str,
    value: Any,
    units: Mapping[str, Any],
    tables: list[tuple[str, list[list[Any]], Mapping[str, Any]]],
) -> Any:
    """Take tables out of a document, with the units beside them; returns the rest."""
    rows = _rows(value)
    if rows is not None:
        tables.append((name, rows, units))
        return {}
    if isinstance(value, list) and value and all(isinstance(entry, Mapping) for entry in value):
        if all(signals := list(map(_pairs, value))):
            for entry, rows in zip(value, signals, strict=True):
                called = rows[0][1]
                tables.append((called, rows, {**units, called: entry.get("unit", "")}))
            return {}
        named = [entry.get("name") or f"{name}({k})" for k, entry in enumerate(value, 1)]
        parts = zip(named, value, strict=True)
        return [_split_tables(str(own), entry, units, tables) for own, entry in parts]
    if not isinstance(value, Mapping):
        return value
    stated = next((entry for key, entry in value.items() if key.lower() in _UNITS), units)
    own = stated if isinstance(stated, Mapping) else units
    return {key: _split_tables(key, entry, own, tables) for key, entry in value.items()}


def _rows(value: Any) -> list[list[Any]] | None:
    """Rows of a table with its names first; None where a value is no table.

    A table is a list of records or of rows, `columns` with `data` or `values`, or a mapping of
    mappings of one kind: of columns by row, or of rows by column. Records of one signal each may
    be in lists of their own.
    """
    value = _joined(value)
    if isinstance(value, Mapping):
        columns, data, index = (value.get(key) for key in ("columns", "data", "index"))
        data = value.get("values") if data is None else data
        if isinstance(columns, list) and isinstance(data, list) and _are_lists(data):
            stated = isinstance(index, list) and len(index) == len(data) and _tells(index)
            left = ["index", *index] if stated and isinstance(index, list) else []
            rows = [columns, *data]
            return [[left[k], *row] for k, row in enumerate(rows)] if left else rows
        value = _records(value)
    if not isinstance(value, list) or len(value) < 2:
        return None
    if all(isinstance(record, Mapping) for record in value):
        flat = [_flat(record) for record in value]
        if not all(map(_is_record, flat)):
            return None
        names = list(dict.fromkeys(key for record in flat for key in record))
        return [names, *([record.get(key) for key in names] for record in flat)]
    return value if _are_lists(value) and any(isinstance(cell, str) for cell in value[0]) else None


def _joined(value: Any) -> Any:
    """Records of lists of one signal each, as Home Assistant has them; else the value."""
    lists = isinstance(value, list) and all(isinstance(own, list) and own for own in value)
    if lists and all(isinstance(record, Mapping) for own in value for record in own):
        # What the first of them says alone holds for all.
        return [{**own[0], **record} for own in value for record in own]
    return value


def _pairs(signal: Mapping[str, Any]) -> list[list[Any]]:
    """Rows of a signal that has its name beside a list of pairs, names first; or none."""
    name = next((signal[key] for key in ("metric", "name", "target") if key in signal), None)
    key = next((key for key in _PAIRS if isinstance(signal.get(key), list)), "")
    rows = signal.get(key, [])
    if (
        name is None
        or "columns" in signal
        or not rows
        or not _are_lists(rows)
        or {len(row) for row in rows} != {2}
    ):
        return []
    at = _PAIRS[key]
    called = _name_of_metric(name) if isinstance(name, Mapping) else str(name)
    return [["time", called], *([row[at], row[1 - at]] for row in rows)]


def _name_of_metric(labels: Mapping[str, Any]) -> str:
    """The name of a metric with its labels, as Prometheus writes it."""
    name = str(labels.get("__name__", ""))
    tags = ",".join(f'{key}="{value}"' for key, value in labels.items() if key != "__name__")
    return f"{name}{{{tags}}}" if tags else name


def _records(value: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Records of a mapping of mappings; empty: it is none, or shorter than a recording."""
    members = list(value.values())
    if len(members) < 2 or not all(map(_is_record, members)):
        return []
    inner = list(members[0])
    if any(list(member) != inner for member in members):
        return []
    by_row = len(members) > len(inner)  # else by column, as pandas writes
    rows = dict(value) if by_row else {k: {name: m[k] for name, m in value.items()} for k in inner}
    columns = zip(*(row.values() for row in rows.values()), strict=True)
    texts = [[isinstance(cell, str) for cell in cells if cell is not None] for cells in columns]
    # Texts beside numbers in one column describe something.
    if len(rows) < _FEWEST or not all(all(cells) or not any(cells) for cells in texts):
        return []
    stated = _tells(list(rows))
    return [{**({"index": key} if stated else {}), **row} for key, row in rows.items()]


def _tells(index: Sequence[Any]) -> bool:
    """Whether what stands before rows is more than their numbers."""
    numbers = list(map(str, range(len(index))))
    return [str(entry) for entry in index] != numbers


def _flat(record: Mapping[str, Any]) -> dict[str, Any]:
    """A record with entries of nested ones by names with points, or with the unit beside them."""
    flat: dict[str, Any] = {}
    for key, value in record.items():
        if isinstance(value, Mapping) and value.keys() == {"value", "unit"}:
            flat[f"{key} [{value['unit']}]"] = value["value"]
            continue
        inner = _flat(value) if isinstance(value, Mapping) else {"": value}
        flat |= {f"{key}.{name}" if name else key: entry for name, entry in inner.items()}
    return flat


def _is_record(value: Any) -> bool:
    return isinstance(value, Mapping) and all(isinstance(v, _SCALAR) for v in value.values())


def _are_lists(value: Sequence[Any]) -> bool:
    """Whether a list holds rows of single values."""
    return len(value) > 1 and all(
        isinstance(row, list) and all(isinstance(cell, _SCALAR) for cell in row) for row in value
    )


def _table(rows: Sequence[Sequence[Any]], units: Mapping[str, Any], where: str) -> Cells:
    """Cells of a table; where names are those of keys, none is searched for."""
    cells = [[_cell(value) for value in row] for row in rows]
    names, *body = cells
    if not all(len(row) == len(names) for row in body):
        return find_table(cells, range(1, len(cells) + 1), where)
    stated = [units.get(name) or units.get(name_and_unit(name)[0]) for name in names]
    spelled = [spell_unit(unit) if isinstance(unit, str) else "" for unit in stated]
    return replace(Cells.named(names, body), units=tuple(spelled))


def _cell(value: Any) -> str:
    """A value as a CSV would have it."""
    if value is None:
        return ""
    return str(int(value)) if isinstance(value, bool) else str(value)


def _arrays(value: Any) -> Any:
    """Lists of numbers as arrays, with gaps where there is none, and mappings of them."""
    if isinstance(value, Mapping):
        return {key: _arrays(entry) for key, entry in value.items()}
    if not isinstance(value, list) or not value:
        return value
    if all(isinstance(entry, Mapping) for entry in value):
        return _arrays(by_place(value))
    if all(isinstance(entry, int | float | None) for entry in value):
        return np.array([np.nan if entry is None else entry for entry in value], dtype=np.float64)
    if _are_lists(value) and len({len(row) for row in value}) == 1:
        try:
            return np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            return None
    return value
