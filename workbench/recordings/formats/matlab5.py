"""MAT files of MATLAB up to version 7, of scipy, and results of Modelica tools (MAT 4)."""

import io
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatlabOpaque

from workbench.recordings.formats.arrays import Opaque, by_place, read_groups
from workbench.recordings.formats.contents import Contents, FileChannel, Group
from workbench.recordings.formats.matlab_objects import read_objects
from workbench.recordings.formats.spelling import spell_unit

_UNIT = re.compile(r".*\[([^\[\]|]*)(\|[^\[\]]*)?\]\s*")  # of a description: Level [m|cm]
_RESULT = frozenset({"Aclass", "name", "dataInfo", "data_2"})


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a MAT file."""
    words = "MAT 5" if raw.startswith(b"MATLAB") else "MAT 4"
    stream: Any = io.BytesIO(raw)  # which the stubs do not know that it takes
    if words == "MAT 4":
        plain = loadmat(stream, chars_as_strings=False)
        if plain.keys() >= _RESULT:
            return _result(plain)
        stream.seek(0)
    content = loadmat(stream, simplify_cells=True, chars_as_strings=True)
    members = {name: value for name, value in content.items() if not str(name).startswith("__")}
    if any(map(_holds_object, members.values())):
        held = read_objects(raw)
    else:
        held = {name: _plain(value) for name, value in members.items()}
    groups, notes = read_groups(held)
    if not groups and any(isinstance(value, Opaque) for value in held.values()):
        raise ValueError("; ".join(notes))
    return Contents(words, groups, notes)


def _holds_object(value: Any) -> bool:
    if isinstance(value, dict):
        return any(map(_holds_object, value.values()))
    cells = isinstance(value, np.ndarray) and value.dtype == object
    return isinstance(value, MatlabOpaque) or (cells and any(map(_holds_object, value.flat)))


def _plain(value: Any) -> Any:
    """Arrays, texts, lists of texts, and mappings of them."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    listed = isinstance(value, list | np.ndarray) and len(np.shape(value)) == 1 and len(value) > 0
    if listed and all(isinstance(entry, dict) for entry in value):
        return _plain(by_place(list(value)))
    if isinstance(value, np.ndarray) and value.dtype.kind in "OU":
        return [str(entry) for entry in value.ravel() if isinstance(entry, str)]
    return value


def _result(content: Mapping[str, Any]) -> Contents:
    """Trajectories that Dymola and OpenModelica write, with names and units of variables.

    `dataInfo` says of each variable the matrix that holds it, and its row there, below 0 where its
    sign is the other one; the format is that which OpenModelica reads in read_matlab4.c.
    """
    turned = "binTrans" in _texts(content["Aclass"])

    def variables(name: str) -> list[str]:
        table = content.get(name, np.empty((0, 0), dtype="U1"))
        return _texts(table.T if turned else table)

    names, about = variables("name"), variables("description")
    info = np.asarray(content["dataInfo"]).astype(int)
    info = info.T if turned else info
    data = np.asarray(content["data_2"], dtype=np.float64)
    data = data if turned else data.T
    times = data[0]
    # At an event there are samples before and after it, of one time.
    last = np.append(np.diff(times) > 0.0, True)
    notes = []
    if left := int((~last).sum()):
        notes.append(f"{left} samples before events were left out, of the times of those after")
    if fixed := int((info[:, 0] == 1).sum()):
        notes.append(f"{fixed} parameters and constants were left out")
    channels = []
    for k, name in enumerate(names):
        matrix, row = int(info[k, 0]), int(info[k, 1])
        unit = _UNIT.fullmatch(about[k]) if k < len(about) else None
        if matrix == 2 and abs(row) > 1:
            values = np.sign(row) * data[abs(row) - 1][last]
            stated = spell_unit(unit[1]) if unit else ""
            channels.append(FileChannel(name, stated, values, about[k] if k < len(about) else ""))
    clock = FileChannel("time", "s", times[last])
    return Contents("MAT 4, results of a Modelica tool", [Group("", (clock, *channels))], notes)


def _texts(table: np.ndarray) -> list[str]:
    """Rows of characters as texts."""
    rows = np.atleast_2d(table)
    return ["".join(map(str, row)).rstrip("\0 ") for row in rows]
