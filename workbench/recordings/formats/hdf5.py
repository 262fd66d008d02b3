"""MAT 7.3, which is HDF5, and plain HDF5 with units in attributes."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from workbench.recordings.formats.arrays import numbered, read_groups
from workbench.recordings.formats.contents import Contents

_CLASS = "MATLAB_class"
_UNITS = ("unit", "units", "Unit", "Units")


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file."""
    with h5py.File(io.BytesIO(raw), "r") as file:
        content = _members(file, file)
    groups, notes = read_groups(content)
    return Contents("MAT 7.3" if raw.startswith(b"MATLAB") else "HDF5", groups, notes)


def _members(group: h5py.Group, file: h5py.File) -> dict[str, Any]:
    """What a group holds, by name; #refs# are what cells point at."""
    structures = _structures(group, file)
    return numbered(structures) if structures else _entries(dict(group.items()), file)


def _entries(items: Mapping[str, Any], file: h5py.File) -> dict[str, Any]:
    """Values of entries, their units, and what is nested in them."""
    members: dict[str, Any] = {}
    for name, item in items.items():
        if name.startswith("#"):
            continue
        if isinstance(item, h5py.Group):
            members[name] = _members(item, file)
            continue
        value = _value(item, file)
        if value is None:
            continue
        members[name] = value
        unit = next((item.attrs[key] for key in _UNITS if key in item.attrs), None)
        if unit is not None:
            members[f"{name}_unit"] = unit.decode() if isinstance(unit, bytes) else str(unit)
    return members


def _structures(group: h5py.Group, file: h5py.File) -> list[dict[str, Any]]:
    """Of an array of structures each one: a field is a list of references; empty: it is none."""
    fields = dict(group.items())
    if _class_of(group) != "struct" or not all(map(_refers, fields.values())):
        return []
    if len({field.size for field in fields.values()}) != 1:
        return []
    rows = zip(*(np.ravel(field[()]) for field in fields.values()), strict=True)
    return [_entries({k: file[r] for k, r in zip(fields, row, strict=True)}, file) for row in rows]


def _refers(item: Any) -> bool:
    """Whether a dataset holds references, and is no list of a cell array."""
    held = isinstance(item, h5py.Dataset) and h5py.check_ref_dtype(item.dtype) is not None
    return held and _class_of(item) != "cell"


def _class_of(item: Any) -> str:
    """What MATLAB says that an entry is; empty where it says nothing."""
    kind = item.attrs.get(_CLASS, b"")
    return kind.decode() if isinstance(kind, bytes) else str(kind)


def _value(item: h5py.Dataset, file: h5py.File) -> Any:
    kind = _class_of(item)
    if item.dtype.kind == "O" and h5py.check_ref_dtype(item.dtype) is not None:
        entries = [_value(file[reference], file) for reference in np.ravel(item[()])]
        return [entry for entry in entries if isinstance(entry, str)]
    value = item[()]
    if kind == "char":
        return "".join(map(chr, np.ravel(np.asarray(value).T, order="F").astype(int)))
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        return None
    # MATLAB counts columns first.
    return value.T
