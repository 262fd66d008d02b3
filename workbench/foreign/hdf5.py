"""MAT 7.3, which is HDF5, and plain HDF5 with units in attributes."""

import io
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from workbench.foreign.arrays import read_groups
from workbench.foreign.contents import Contents

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
    found: dict[str, Any] = {}
    for name, item in group.items():
        if name.startswith("#"):
            continue
        if isinstance(item, h5py.Group):
            found[name] = _members(item, file)
            continue
        value = _value(item, file)
        if value is None:
            continue
        found[name] = value
        unit = next((item.attrs[key] for key in _UNITS if key in item.attrs), None)
        if unit is not None:
            found[f"{name}_unit"] = unit.decode() if isinstance(unit, bytes) else str(unit)
    return found


def _value(item: h5py.Dataset, file: h5py.File) -> Any:
    kind = item.attrs.get(_CLASS, b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
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
