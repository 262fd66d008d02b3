"""Arrays of NumPy by name (.npz), of numbers and texts alone: no objects are unpickled."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from workbench.recordings.formats.arrays import Opaque, read_groups
from workbench.recordings.formats.contents import Contents


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file."""
    content: dict[str, Any] = {}
    with np.load(io.BytesIO(raw), allow_pickle=False) as arrays:
        for name in arrays.files:
            try:
                array = arrays[name]
            except ValueError:  # of objects
                content[name] = Opaque("an array of objects of Python")
                continue
            if array.dtype.names:
                content[name] = {field: array[field] for field in array.dtype.names}
            elif array.dtype.kind in "mM":
                content[name] = np.datetime_as_string(array) if array.dtype.kind == "M" else array
                content[name] = [str(value) for value in content[name].ravel()]
            elif array.dtype.kind in "US":
                texts = [str(value) for value in np.char.asarray(array).ravel()]
                content[name] = texts if array.ndim else texts[0]
            else:
                content[name] = array
    groups, notes = read_groups(content)
    return Contents("arrays of NumPy", groups, notes)
