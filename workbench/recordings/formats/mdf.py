"""MDF of data loggers, version 3 and 4: each channel group has its own times."""

import io
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF

from workbench.recordings.formats.contents import Contents, FileChannel, Group
from workbench.recordings.formats.spelling import name_and_unit, spell_unit

_DEFAULT_YEAR = 1980  # of files whose recorder had no date
_TIME = 1  # what a group counts its samples by: 0 nothing said, 1 time, 2 angle, 3 way, 4 index


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a measurement file, in physical values."""
    if raw[64:68] != b"##HD" and raw[64:66] != b"HD":
        raise ValueError("no header")  # asammdf stumbles over itself without one
    groups: list[Group] = []
    notes: list[str] = []
    doubts: dict[str, None] = {}
    with _take_down(doubts), MDF(io.BytesIO(raw)) as file:
        version, start = file.version, _since_1970(file.start_time)
        for index, held in enumerate(file.groups):
            group = _group(file, index, held, start, notes)
            if group is not None:
                groups.append(group)
    return Contents(f"MDF {version}", groups, notes, tuple(doubts))


def _since_1970(moment: datetime) -> float:
    """Seconds from 1970; local times count as if they were of UTC, the default of 1980 as none."""
    known = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return known.timestamp() if known.year > _DEFAULT_YEAR else np.nan


@contextmanager
def _take_down(doubts: dict[str, None]) -> Iterator[None]:
    """Take down what the library only logs, such as blocks that are missing."""

    def take(record: logging.LogRecord) -> bool:
        doubts[f"asammdf: {record.getMessage()[:200]}"] = None
        return False

    logger = logging.getLogger("asammdf")
    logger.addFilter(take)
    try:
        yield
    finally:
        logger.removeFilter(take)


def _group(file: MDF, index: int, held: Any, start: float, notes: list[str]) -> Group | None:
    """Channels of one group with its times, or None without any."""
    master = file.masters_db.get(index)
    clock: FileChannel | None = None
    channels: list[FileChannel] = []
    for number, channel in enumerate(held.channels):
        if number == master:
            continue
        signal = file.get(group=index, index=number, ignore_invalidation_bits=True)
        name, unit = name_and_unit(channel.name)
        if signal.samples.dtype.kind not in "fiub" or signal.samples.ndim > 1:
            notes.append(f"'{name}' holds no numbers")
            continue
        formula = str(getattr(channel.conversion, "formula", "") or "")
        if formula.strip("X1x() ") and np.array_equal(
            signal.samples, file.get(group=index, index=number, raw=True).samples
        ):  # the library leaves what it cannot compute as it was recorded
            notes.append(f"'{name}' has a formula that is not understood, {formula[:60]!r}")
            continue
        values = np.asarray(signal.samples, dtype=np.float64)
        if signal.invalidation_bits is not None:
            values = np.where(np.asarray(signal.invalidation_bits), np.nan, values)
        channels.append(
            FileChannel(name, unit or spell_unit(signal.unit), values, signal.comment or "")
        )
        clock = FileChannel("time", "s", np.asarray(signal.timestamps, np.float64), start=start)
    if not channels or channels[0].values.size < 2:
        return None
    # Some are sampled over an angle or a way.
    timed = master is not None and getattr(held.channels[master], "sync_type", _TIME) <= _TIME
    title = str(getattr(held.channel_group, "acq_name", "") or "") or f"group {index + 1}"
    # Recorders may give several groups one name.
    within = title, str(index + 1)
    return Group(title, tuple(channels), time=clock if timed else None, within=within)
