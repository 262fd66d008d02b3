"""TDMS of LabVIEW and DIAdem: groups of channels, with waveforms or channels of times."""

import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from nptdms import TdmsFile
from nptdms.log import log_manager

from workbench.recordings.formats.arrays import stated_step
from workbench.recordings.formats.contents import Contents, FileChannel, Group
from workbench.recordings.formats.spelling import conversion, name_and_unit, spell_unit
from workbench.recordings.formats.stamps import read_stamps

_SCALES = {"Linear", "Polynomial", "Table", "Add", "Subtract", "AdvancedAPI"} | {
    *("RTD", "Strain", "Thermistor", "Thermocouple")
}
# Properties of a waveform, and their bytes in the file with four that tell their type.
_WAVEFORM = {"wf_start_time": 20, "wf_start_offset": 12, "wf_increment": 12}
_SAME = 1e-3  # by which two statements of a step may differ, as rates are rounded
_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units")


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file, in scaled values."""
    groups: list[Group] = []
    notes: list[str] = []
    doubts: list[str] = []
    with _take_down(doubts):
        file = TdmsFile.read(io.BytesIO(raw))
        held = file.groups()
        doubt = _doubt(raw, [channel.properties for group in held for channel in group.channels()])
        for group in held:
            groups += _groups(group, doubt, notes, {**file.properties, **group.properties})
    return Contents("TDMS", groups, notes, tuple(doubts))


@contextmanager
def _take_down(doubts: list[str]) -> Iterator[None]:
    """Take down what the library only prints, such as an end that is missing."""
    printed = io.StringIO()
    before = log_manager.console_handler.setStream(printed)
    try:
        yield
    finally:
        log_manager.console_handler.setStream(before)
        doubts += dict.fromkeys(line[:200] for line in printed.getvalue().splitlines())


def _doubt(raw: bytes, stated: Sequence[Mapping[str, Any]]) -> str:
    """That segments begin or step otherwise than those before them, in words; empty: none does.

    The library joins segments, and keeps what the last of them states.
    """
    for key, size in _WAVEFORM.items():
        written = {match[0] for match in re.finditer(key.encode() + b"(?s:.{%d})" % size, raw)}
        if len(written) > len({str(properties[key]) for properties in stated if key in properties}):
            return f"waveforms of several segments, of which each has its own '{key}'"
    return ""


def _groups(held: Any, doubt: str, notes: list[str], around: Mapping[str, Any]) -> list[Group]:
    """A group of the file; channels with other times or lengths are groups of their own.

    Parameters
    ----------
    around : properties of the group and the file.
    """
    by_times: dict[tuple[int, float, float, float], list[FileChannel]] = {}
    for recorded in held.channels():
        name, unit = name_and_unit(recorded.name)
        stated: Mapping[str, Any] = recorded.properties
        scales = {str(text) for key, text in stated.items() if key.endswith("]_Scale_Type")}
        if scales - _SCALES and stated.get("NI_Scaling_Status") != "scaled":
            # The library leaves what it cannot scale as it was recorded.
            notes.append(f"'{name}' has a scale that is not understood, {min(scales - _SCALES)!r}")
            continue
        unit = unit or spell_unit(str(next((stated[key] for key in _UNITS if key in stated), "")))
        values = recorded[:]
        step, offset = _waveform_clock(stated)
        beside = stated_step({**around, **stated})
        if step > 0.0 and abs(beside - step) > _SAME * step and not doubt:
            # LabVIEW writes an increment of 1 where nobody set one.
            doubt = f"waveforms with a step of {step:g} s, and beside them one of {beside:g} s"
        begun = stated.get("wf_start_time")
        start = _since_1970(begun) if begun is not None and step > 0.0 else np.nan
        if values.dtype.kind == "M":
            channel = _stamps(name, values)
        elif values.dtype.kind in "fiub":
            about = str(stated.get("description", ""))
            channel = FileChannel(name, unit, np.asarray(values, dtype=np.float64), about)
        elif (stamps := read_stamps(name, list(map(str, values)))) is not None:
            channel = stamps
        else:
            notes.append(f"'{name}' holds texts")
            continue
        key = values.size, step, offset, -1.0 if np.isnan(start) else start
        by_times.setdefault(key, []).append(channel)
    for key in [key for key in by_times if key[-1] < 0.0]:
        # Some state only of the first of several waveforms when it began.
        dated = [other for other in by_times if other[:-1] == key[:-1] and other[-1] >= 0.0]
        if len(dated) == 1 and key[1] > 0.0:
            by_times[dated[0]] += by_times.pop(key)
    groups = []
    for (size, step, offset, start), channels in by_times.items():
        if size < 2:
            continue
        clock = None
        if step > 0.0 and not doubt:
            times = offset + step * np.arange(size, dtype=np.float64)
            clock = FileChannel("time", "s", times, start=start if start >= 0.0 else np.nan)
        group = Group(held.name, tuple(channels), time=clock, within=(held.name,))
        groups.append(replace(group, step_doubt=doubt if step > 0.0 else ""))
    return groups


def _waveform_clock(stated: Mapping[str, Any]) -> tuple[float, float]:
    """Step and begin of a waveform [s]; zeros where it is none, or none over time."""
    step = float(stated.get("wf_increment", 0.0) or 0.0)
    # Without a unit LabVIEW means seconds; a spectrum has Hz.
    scale = conversion(spell_unit(str(stated.get("wf_xunit_string", "") or "s")), "s")
    if scale is None or not step > 0.0:
        return 0.0, 0.0
    return scale.factor * step, scale.factor * float(stated.get("wf_start_offset", 0.0) or 0.0)


def _since_1970(moment: Any) -> float:
    counted = np.datetime64(moment, "us").astype(np.int64)
    seconds = float(counted) * 1e-6
    return seconds if seconds > 0.0 else np.nan  # TDMS writes 1904 where it knows none


def _stamps(name: str, values: Any) -> FileChannel:
    """Time stamps, without what a float of seconds since 1970 would round."""
    known = ~np.isnat(values)
    first = values[known][0] if known.any() else np.datetime64(0, "us")
    times = (values - first) / np.timedelta64(1, "s")
    return FileChannel(
        name, "s", np.where(known, times, np.nan), start=_since_1970(first), stamp=True
    )
