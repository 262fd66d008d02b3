"""Frames and series that pandas wrote to HDF5, whole or as tables, with the names of columns.

Lists of names are pickled there, and are read as text: nothing is unpickled.
Source: pandas 2.2, pandas/io/pytables.py.
"""

import re
from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np

_PICKLED_NAME = re.compile(rb"V([^\n]*)\n")  # of protocol 0
_INDEX_NAME = re.compile(rb"Vindex_name\np\d+\nV([^\n]*)\n")
_COUNTED = re.compile(r"datetime64\[(ns|us|ms|s)\]")


def read_frame(group: h5py.Group) -> dict[str, Any] | None:
    """Columns of a group by name, the index first; None where pandas did not write it."""
    kind = _text(group.attrs.get("pandas_type", b""))
    if kind == "frame_table" and isinstance(group.get("table"), h5py.Dataset):
        return _table(group["table"])
    if kind == "series" and "values" in group and "index" in group:
        name = _text(group.attrs.get("name", b"")) or group.name.rpartition("/")[2]
        return {**_index(group["index"]), name: group["values"][()]}
    if kind != "frame" or "axis1" not in group:
        return None
    columns = _index(group["axis1"])
    for number in range(int(group.attrs.get("nblocks", 0))):
        names, values = group[f"block{number}_items"][()], group[f"block{number}_values"]
        if values.dtype.kind in "fiub":
            columns |= _named([_text(name) for name in names], values[()])
    return columns


def _table(table: h5py.Dataset) -> dict[str, Any]:
    """Columns of a table, some of which hold several of a frame."""
    rows = table[()]
    columns: dict[str, Any] = {}
    called = _INDEX_NAME.search(_bytes(table.parent.attrs.get("info", b"")))
    for field in rows.dtype.names or ():
        values = rows[field]
        names = _PICKLED_NAME.findall(_bytes(table.attrs.get(f"{field}_kind", b"")))
        if field == "index":
            name = _text(called[1]) if called else field
            columns |= _of_index(name, _text(table.attrs.get("index_kind", b"")), values)
        elif values.dtype.kind in "fiub":
            wide = values.reshape(len(values), -1)
            columns |= _named([_text(name) for name in names] or [field], wide)
    return columns


def _index(item: h5py.Dataset) -> dict[str, Any]:
    name = _text(item.attrs.get("name", b""))
    return _of_index(name, _text(item.attrs.get("kind", b"")), item[()])


def _of_index(name: str, kind: str, values: Any) -> dict[str, Any]:
    """An index by its name, as a time where it counts from 1970."""
    if counted := _COUNTED.match(kind):
        return {f"time [{counted[1]}]": values}
    return {name if name not in ("", "N.") else "index": values}


def _named(names: Sequence[str], values: Any) -> dict[str, Any]:
    return {
        name: np.ascontiguousarray(column) for name, column in zip(names, values.T, strict=True)
    }


def _bytes(value: Any) -> bytes:
    return value if isinstance(value, bytes) else str(value).encode()


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
