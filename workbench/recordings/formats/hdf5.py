"""MAT 7.3, which is HDF5, plain HDF5 with units in attributes, and NetCDF.

Frames and series that pandas wrote are read with the names of their columns, whole or as tables.
Lists of names are pickled there, and are read as text: nothing is unpickled.
Source: pandas 2.2, pandas/io/pytables.py.
"""

import io
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import netcdf_file

from workbench.recordings.formats.arrays import Opaque, by_place, read_groups
from workbench.recordings.formats.contents import Contents
from workbench.recordings.formats.matlab_objects import read_objects

_PICKLED_NAME = re.compile(rb"V([^\n]*)\n")  # of protocol 0
_INDEX_NAME = re.compile(rb"Vindex_name\np\d+\nV([^\n]*)\n")
_COUNTED = re.compile(r"datetime64\[(ns|us|ms|s)\]")


def read_frame(group: h5py.Group) -> dict[str, Any] | None:
    """Columns of a group by name, the index first; None where pandas did not write it."""
    layout = _text(group.attrs.get("pandas_type", b""))
    if layout == "frame_table" and isinstance(group.get("table"), h5py.Dataset):
        return _table(group["table"])
    if layout == "series" and "values" in group and "index" in group:
        name = _text(group.attrs.get("name", b"")) or group.name.rpartition("/")[2]
        return {**_index(group["index"]), name: group["values"][()]}
    if layout != "frame" or "axis1" not in group:
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


def _of_index(name: str, dtype: str, values: Any) -> dict[str, Any]:
    """An index by its name, as a time where it counts from 1970."""
    if counted := _COUNTED.match(dtype):
        return {f"time [{counted[1]}]": values}
    return {name if name not in ("", "N.") else "index": values}


def _named(names: Sequence[str], values: Any) -> dict[str, Any]:
    return {
        name: np.ascontiguousarray(column) for name, column in zip(names, values.T, strict=True)
    }


def _bytes(value: Any) -> bytes:
    return value if isinstance(value, bytes) else str(value).encode()


def _text(value: Any) -> str:
    """A text; in the encoding of Western Windows where its bytes are no UTF-8, as of °C."""
    if not isinstance(value, bytes):
        return str(value)
    try:
        return value.decode()
    except UnicodeDecodeError:
        return value.decode("cp1252", "replace")


_CLASS = "MATLAB_class"
_DECODED = "MATLAB_object_decode"
_RATES = ("fs", "sample_rate", "samplerate", "sampling_rate", "dt", "sample_time")
_NAMES = ("columns", "column_names", "names", "channels", "channel_names", "labels", "fields")
_UNITS = ("unit", "units")
_SCALING = ("scale_factor", "add_offset")  # of the conventions for climate and forecast (CF)
_UNSAID = {  # others, and what they are where they change nothing
    **dict.fromkeys(("scale", "gain", "factor", "slope", "multiplier"), 1.0),
    **dict.fromkeys(("offset", "intercept"), 0.0),
}
_NONE = ("_fillvalue", "missing_value")


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file."""
    with h5py.File(io.BytesIO(raw), "r") as file:
        content = _members(file, file)
    if raw.startswith(b"MATLAB") and _holds_object(content):
        content = read_objects(raw)
    groups, notes = read_groups(content)
    return Contents("MAT 7.3" if raw.startswith(b"MATLAB") else "HDF5", groups, notes)


def _holds_object(value: Any) -> bool:
    inner = value.values() if isinstance(value, Mapping) else ()
    return isinstance(value, Opaque) or any(map(_holds_object, inner))


def _members(group: h5py.Group, file: h5py.File) -> dict[str, Any]:
    """What a group holds, by name; #refs# are what cells point at."""
    if (frame := read_frame(group)) is not None:
        return frame
    structures = _structures(group, file)
    if structures:
        return by_place(structures)
    return {**_entries(dict(group.items()), file), **_attributes(group, ("unit", "units", *_RATES))}


def _attributes(item: Any, keys: Collection[str]) -> dict[str, Any]:
    """Texts and numbers that attributes of an entry state under some names."""
    statements: dict[str, Any] = {}
    for key, value in item.attrs.items():
        if key.lower() in keys:
            statements[key] = _text(value) if isinstance(value, bytes) else value
            if np.size(value) == 1 and not isinstance(statements[key], str):
                statements[key] = np.ravel(value)[0]
    return statements


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
        members[name] = scaled(value, item.attrs)
        for key, rate in _attributes(item, _RATES).items():
            # Of channels with rates of their own, no one is that of all.
            members[key] = rate if members.get(key, rate) == rate else np.nan
        for key in (*_NAMES, *_UNITS):
            labels = item.attrs.get(key)
            if isinstance(labels, np.ndarray | list) and len(labels) > 1:
                members[f"{name}_{key}"] = list(map(_text, labels))
        unit = next((text for key, text in item.attrs.items() if key.lower() in _UNITS), None)
        if unit is not None and np.size(unit) == 1:
            members[f"{name}_unit"] = _text(np.ravel(unit)[0])
    return members


def scaled(value: Any, attributes: Mapping[str, Any]) -> Any:
    """Values in the unit of their entry, NaN where they are those that stand for none."""
    stated = {key.lower(): text for key, text in attributes.items() if np.size(text) == 1}
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu":
        return value
    numbers = {
        key: float(np.ravel(x)[0]) for key, x in stated.items() if np.asarray(x).dtype.kind in "fiu"
    }
    if scaling := next((f"{k} = {x:g}" for k, x in numbers.items() if _UNSAID.get(k, x) != x), ""):
        return Opaque(f"stated with {scaling}, and nobody says whether that is applied")
    if not numbers.keys() & {*_SCALING, *_NONE}:
        return value
    kept = np.where(
        np.isin(value, [numbers[key] for key in _NONE if key in numbers]), np.nan, value
    )
    factor, zero = (
        numbers.get(key, neutral) for key, neutral in zip(_SCALING, (1.0, 0.0), strict=True)
    )
    return factor * kept + zero


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
    return _text(item.attrs.get(_CLASS, b""))


def _value(item: h5py.Dataset, file: h5py.File) -> Any:
    matlab_class = _class_of(item)
    if _DECODED in item.attrs:
        return Opaque(f"an object of MATLAB ({matlab_class})")
    if item.dtype.names:  # rows of a table
        rows = item[()]
        return {name: rows[name] for name in item.dtype.names if rows[name].dtype.kind in "fiub"}
    if item.dtype.kind == "O" and h5py.check_ref_dtype(item.dtype) is not None:
        entries = [_value(file[reference], file) for reference in np.ravel(item[()])]
        return [entry for entry in entries if isinstance(entry, str)]
    value = item[()]
    if matlab_class == "char":
        return "".join(map(chr, np.ravel(np.asarray(value).T, order="F").astype(int)))
    if isinstance(value, np.ndarray) and value.dtype.kind in "SO":
        return list(map(_text, value.flat))
    if isinstance(value, bytes):
        return _text(value)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        return None
    # MATLAB counts columns first.
    return value.T


def read_netcdf(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file."""
    content: dict[str, Any] = {}
    with netcdf_file(io.BytesIO(raw), mmap=False) as file:
        for name, variable in file.variables.items():
            values, stated = variable.data, vars(variable)["_attributes"]
            if values.dtype.kind not in "fiub":
                continue
            native = np.asarray(values).astype(values.dtype.newbyteorder("="))
            content[name] = scaled(native, stated)
            if unit := stated.get("units"):
                content[f"{name}_unit"] = _text(unit)
    groups, notes = read_groups(content)
    return Contents("NetCDF", groups, notes)
