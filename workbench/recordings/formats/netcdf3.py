"""NetCDF of the classic format, which is no HDF5, with what attributes say of its variables."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import netcdf_file

from workbench.recordings.formats.arrays import read_groups
from workbench.recordings.formats.contents import Contents
from workbench.recordings.formats.hdf5 import scaled


def read(path: Path, raw: bytes) -> Contents:
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
                content[f"{name}_unit"] = unit.decode("utf-8", "replace")
    groups, notes = read_groups(content)
    return Contents("NetCDF", groups, notes)
