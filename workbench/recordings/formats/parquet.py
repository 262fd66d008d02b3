"""Parquet, Arrow and Feather: one table; units in the metadata of columns or in their names."""

import io
import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from workbench.recordings.formats.contents import Contents, FileChannel, Group
from workbench.recordings.formats.spelling import name_and_unit, spell_unit
from workbench.recordings.formats.tables.cells import Cells
from workbench.recordings.formats.tables.groups import read_group

_UNITS = (b"unit", b"units", b"Unit", b"Units", b"UNIT")
_END = b"\xff\xff\xff\xff\0\0\0\0"  # of a stream
_ABOUT = (b"description", b"comment", b"long_name")


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file of Parquet or Arrow."""
    bare = raw.rstrip(b"\0")  # with which some recorders fill what they have reserved
    stream = io.BytesIO(bare if bare.endswith((b"ARROW1", b"PAR1")) else raw)
    called = "Arrow"
    doubts: tuple[str, ...] = ()
    if raw.startswith(b"ARROW1"):
        table = pa.ipc.open_file(stream).read_all()
    elif raw.startswith(b"PAR1"):
        called, table = "Parquet", pq.ParquetFile(stream).read()
    else:
        table = pa.ipc.open_stream(stream).read_all()
        if _END not in raw[stream.tell() - len(_END) :]:
            doubts = ("the stream of Arrow has no end: batches may be missing",)
    channels: list[FileChannel] = []
    notes: list[str] = []
    texts: dict[str, list[str]] = {}
    for field, column in zip(table.schema, table.columns, strict=True):
        name, unit = name_and_unit(field.name)
        known = field.metadata or {}
        unit = unit or spell_unit(_first(known, _UNITS))
        about = _first(known, _ABOUT)
        arrow_type = field.type
        if pa.types.is_timestamp(arrow_type):
            channels.append(_stamps(name, column))
        elif pa.types.is_duration(arrow_type):
            steps = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[arrow_type.unit]
            values = _numbers(column.cast(pa.int64())) * steps
            channels.append(FileChannel(name, "s", values, about, stamp=True))
        elif pa.types.is_floating(arrow_type) or pa.types.is_integer(arrow_type):
            channels.append(FileChannel(name, unit, _numbers(column), about))
        elif pa.types.is_decimal(arrow_type) or pa.types.is_boolean(arrow_type):
            channels.append(FileChannel(name, unit, _numbers(column.cast(pa.float64())), about))
        else:
            texts[field.name] = ["" if cell is None else str(cell) for cell in column.to_pylist()]
    left: tuple[FileChannel, ...] = ()
    if texts:  # dates, times, or numbers as people write them
        rows = list(map(list, zip(*texts.values(), strict=True)))
        written, _, own = read_group(Cells.named(texts, rows), "", str(path))
        channels = [*written.channels, *channels]
        left, notes = written.left, [*notes, *own]
    return Contents(called, [Group("", tuple(channels), left=left)], notes, doubts)


def _first(known: dict[bytes, bytes], keys: tuple[bytes, ...]) -> str:
    return next((known[key].decode("utf-8", "replace") for key in keys if key in known), "")


def _numbers(column: pa.ChunkedArray) -> np.ndarray:
    values = column.to_numpy()
    return np.asarray(values, dtype=np.float64)


def _stamps(name: str, column: pa.ChunkedArray) -> FileChannel:
    """Time stamps, without what a float of seconds since 1970 would round."""
    units = {"s": 1, "ms": 1000, "us": 10**6, "ns": 10**9}[column.type.unit]
    counts = column.cast(pa.int64())
    first = next((value for value in counts.to_pylist() if value is not None), None)
    if first is None:
        return FileChannel(name, "s", np.full(len(column), math.nan), stamp=True)
    since = pa.compute.subtract(counts, first)
    return FileChannel(
        name,
        "s",
        _numbers(since) / units,
        start=first / units,
        stamp=True,
        zoned=column.type.tz is not None,
    )
