"""MAT files of MATLAB up to version 7, and of scipy."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from workbench.recordings.formats.arrays import numbered, read_groups
from workbench.recordings.formats.contents import Contents


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a MAT file."""
    stream: Any = io.BytesIO(raw)  # which the stubs do not know that it takes
    content = loadmat(stream, simplify_cells=True, chars_as_strings=True)
    held = {name: _plain(value) for name, value in content.items() if not name.startswith("__")}
    groups, notes = read_groups(held)
    return Contents("MAT 5", groups, notes)


def _plain(value: Any) -> Any:
    """Arrays, texts, lists of texts, and mappings of them."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
        return _plain(numbered(value))
    if isinstance(value, np.ndarray) and value.dtype.kind in "OU":
        return [str(entry) for entry in value.ravel() if isinstance(entry, str)]
    return value
