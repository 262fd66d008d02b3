"""Tables, timetables, dates and durations of MATLAB, which it stores as objects of its own.

How it does is undocumented; the package `mat-io` reads what is known of it.
"""

import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workbench.recordings.formats.arrays import Opaque, by_place
from workbench.runtime.files import temporary_folder
from workbench.runtime.resources import installing

_ZONED = "MATLAB datetime was saved with timezone"
_OBJECT = (
    "an object that only MATLAB reads: save it as a timetable, a structure, "
    "table2struct(X, 'ToScalar', true), or as CSV"
)


def read_objects(raw: bytes) -> dict[str, Any]:
    """Variables of a MAT file with its objects as arrays, texts and mappings.

    A table is a mapping of its columns, with `NAME_unit` where it states units. Dates are texts, in
    UTC where MATLAB has a zone.

    Raises
    ------
    ValueError
        If the package that reads them is missing.
    """
    try:
        from matio import load_from_mat  # only such files need it
    except ImportError:
        raise ValueError(
            f"objects of MATLAB, which the package 'mat-io' reads: {installing('files')}"
        ) from None
    with temporary_folder() as folder, warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        path = Path(folder, "variables.mat")
        path.write_bytes(raw)
        content = load_from_mat(path, add_table_attrs=True)
    zoned = any(str(warning.message).startswith(_ZONED) for warning in warned)
    held = {name: value for name, value in content.items() if not name.startswith("__")}
    return _members(held.items(), "Z" * zoned)


def _members(entries: Iterable[tuple[str, Any]], zone: str) -> dict[str, Any]:
    """Values by name, and the units of those that have one of their own."""
    members: dict[str, Any] = {}
    for name, value in entries:
        members[name] = _plain(value, zone)
        if getattr(value, "dtype", np.dtype("f8")).kind == "m":
            members[f"{name}_unit"] = "s"
    return members


def _plain(value: Any, zone: str) -> Any:
    if hasattr(value, "columns"):
        return _columns(value, zone)
    if isinstance(value, Mapping):
        return _members(value.items(), zone)
    if not isinstance(value, np.ndarray):
        return value if isinstance(value, str | int | float) else Opaque(_OBJECT)
    if value.dtype.names:
        entries = [
            _members(zip(value.dtype.names, record, strict=True), zone) for record in value.ravel()
        ]
        return entries[0] if len(entries) == 1 else by_place(entries)
    if value.dtype.kind == "M":
        return [f"{text}{zone}" for text in np.datetime_as_string(value.ravel(), unit="ns")]
    if value.dtype.kind == "m":
        return value / np.timedelta64(1, "s")
    if value.dtype.kind in "OUT":
        cells = [_plain(entry, zone) for entry in value.ravel()]
        texts = [cell for cell in cells if isinstance(cell, str)]
        return cells[0] if len(cells) == 1 else texts or by_place(cells)
    return value


def _columns(frame: Any, zone: str) -> dict[str, Any]:
    """Columns of a table (a pandas.DataFrame) with their units; of a timetable, times first."""
    columns = {str(name): frame[name].to_numpy() for name in frame.columns}
    units = frame.attrs.get("VariableUnits") or frame.attrs.get("varUnits") or []
    stated = dict(zip(columns, units, strict=False))
    times = frame.index.to_numpy()
    if times.dtype.kind in "Mm":
        columns = {str(frame.index.name or "Time"): times, **columns}
    return {
        **_members(columns.items(), zone),
        **{f"{name}_unit": str(unit) for name, unit in stated.items() if unit},
    }
