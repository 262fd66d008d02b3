"""Named arrays, as MAT files have them, to groups of channels."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.recordings.formats.contents import FileChannel, Group
from workbench.recordings.formats.spelling import named, spelled

_UNIT = re.compile(r"(?P<of>.*?)[_.]?(units?|einheit)", re.IGNORECASE)
_VALUES = ("data", "values", "value", "daten", "y")
_TIMES = ("time", "t", "zeit", "times", "x")
_RATES = ("fs", "samplerate", "sample_rate", "samplingrate", "sampling_rate", "abtastrate")
_STEPS = ("dt", "ts", "sampletime", "sample_time", "delta_t", "abtastzeit")
_TEXTS = ("name", "description", "comment", "label")


def read_groups(content: Mapping[str, Any]) -> tuple[list[Group], list[str]]:
    """Groups of nested arrays and texts, and notes on what was left out.

    Vectors of one length are a group; a structure with a time and values is a channel with its own
    times (`data`, `time`, `unit`, `time_unit`); any other structure is a group of its own. A text
    `NAME_unit` is the unit of NAME, a list `units` those of all vectors in their order.

    Parameters
    ----------
    content : arrays, texts, lists of texts and mappings, by name.
    """
    groups: list[Group] = []
    notes: list[str] = []
    _collect((), content, groups, notes)
    return groups, notes


def _collect(
    within: tuple[str, ...], content: Mapping[str, Any], groups: list[Group], notes: list[str]
) -> None:
    units = _units(content)
    by_size: dict[int, list[FileChannel]] = {}
    for key, value in content.items():
        name, unit = named(key)
        unit = unit or units.get(key, "")
        if isinstance(value, Mapping):
            timed = _simulink(name, value) or _timed(name, value)
            if timed is not None:
                groups.append(replace(timed, within=within))
            elif (channel := _single(name, value)) is not None:
                by_size.setdefault(channel.values.size, []).append(channel)
            else:
                _collect((*within, key), value, groups, notes)
        elif isinstance(value, np.ndarray):
            if value.dtype.kind not in "fiub" and value.size > 1:
                notes.append(f"'{key}' holds no real numbers")
            for channel in _columns(name, unit, value, content):
                by_size.setdefault(channel.values.size, []).append(channel)
            if value.ndim > 2:
                notes.append(f"'{key}' has {value.ndim} dimensions")
    for size, channels in by_size.items():
        if size > 1:
            name = "/".join(within if len(by_size) == 1 else (*within, f"{size} samples"))
            groups.append(Group(name, tuple(channels), step=_step(content), within=within))


def _step(content: Mapping[str, Any]) -> float:
    """Time between samples that a number beside the arrays states [s]; NaN without one."""
    for key, value in content.items():
        if isinstance(value, Mapping | str | list) or np.size(value) != 1:
            continue
        number = float(np.ravel(value)[0])
        if key.lower() in _RATES and number > 0.0:
            return 1.0 / number
        if key.lower() in _STEPS and number > 0.0:
            return number
    return math.nan


def _units(content: Mapping[str, Any]) -> dict[str, str]:
    """Units by name, from texts beside the arrays."""
    units: dict[str, str] = {}
    vectors = [key for key, value in content.items() if isinstance(value, np.ndarray)]
    for key, value in content.items():
        match = _UNIT.fullmatch(key)
        if match is None:
            continue
        if isinstance(value, str) and match["of"]:
            units[match["of"]] = spelled(value)
        elif isinstance(value, list) and len(value) == len(vectors):
            units |= {name: spelled(unit) for name, unit in zip(vectors, value, strict=True)}
        elif isinstance(value, Mapping):
            texts = {name: unit for name, unit in value.items() if isinstance(unit, str)}
            units |= {name: spelled(unit) for name, unit in texts.items()}
    return units


def _entry(content: Mapping[str, Any], names: tuple[str, ...]) -> tuple[str, Any]:
    """Key and value of the first entry that has one of some names."""
    return next(
        ((key, entry) for key, entry in content.items() if key.lower() in names), ("", None)
    )


def _timed(name: str, content: Mapping[str, Any]) -> Group | None:
    """A structure with times and values of one channel, such as a time series."""
    key, times = _entry(content, _TIMES)
    channel = _single(name, content)
    if channel is None or not isinstance(times, np.ndarray):
        return None
    if times.size != channel.values.size or times.size < 2:
        return None
    clock = FileChannel(key, _units(content).get(key, ""), _flat(times))
    return Group(name, (clock, channel))


def _simulink(name: str, content: Mapping[str, Any]) -> Group | None:
    """What Simulink logs as a structure with time: times, and a list of signals with values."""
    times, signals = content.get("time"), content.get("signals")
    if not isinstance(times, np.ndarray) or not isinstance(signals, Mapping):
        return None
    held = {"(1)": signals} if "values" in signals else signals
    channels: list[FileChannel] = []
    for key, signal in held.items():
        values = signal.get("values") if isinstance(signal, Mapping) else None
        if not isinstance(values, np.ndarray):
            return None
        label = str(signal.get("label") or "").strip() or key
        own, unit = named(label)
        unit = unit or (spelled(entry) if isinstance(entry := signal.get("unit"), str) else "")
        channels += [replace(channel, about=key) for channel in _columns(own, unit, values, {})]
    if not channels or len({channel.values.size for channel in channels}) > 1:
        return None
    if times.size != channels[0].values.size:  # without time, where Simulink leaves it empty
        return Group(name, tuple(channels))
    return Group(name, (FileChannel("time", "s", _flat(times)), *channels))


def _single(name: str, content: Mapping[str, Any]) -> FileChannel | None:
    """A structure with values of one channel, and its unit."""
    key, values = _entry(content, _VALUES)
    if not isinstance(values, np.ndarray) or values.size != max(values.shape, default=0):
        return None
    clock, _ = _entry(content, _TIMES)
    others = [held for other, held in content.items() if other not in (key, clock)]
    if any(isinstance(held, np.ndarray) and held.size == values.size > 1 for held in others):
        return None  # one of several channels
    _, unit = _entry(content, ("unit", "units", "einheit"))
    _, about = _entry(content, _TEXTS)
    return FileChannel(
        name,
        spelled(unit) if isinstance(unit, str) else _units(content).get(key, ""),
        _flat(values),
        about if isinstance(about, str) else "",
    )


def _columns(
    name: str, unit: str, value: np.ndarray, content: Mapping[str, Any]
) -> list[FileChannel]:
    """Channels of an array: one of a vector, one of each column of a table.

    A table's columns are named by a list of as many texts beside it, if there is one.
    """
    if value.dtype.kind not in "fiub" or value.ndim > 2:
        return []
    if value.ndim < 2 or 1 in value.shape:
        return [FileChannel(name, unit, _flat(value))]
    table = value if value.shape[0] >= value.shape[1] else value.T
    width = table.shape[1]
    lists = {key: held for key, held in content.items() if isinstance(held, list)}
    lists = {key: held for key, held in lists.items() if len(held) == width}
    units = next((held for key, held in lists.items() if _UNIT.fullmatch(key)), [unit] * width)
    names = [held for key, held in lists.items() if not _UNIT.fullmatch(key)]
    own = names[0] if len(names) == 1 else [f"{name}({i + 1})" for i in range(width)]
    labels = [named(label) for label in own]
    return [
        FileChannel(label, stated or spelled(units[i]), _flat(table[:, i]))
        for i, (label, stated) in enumerate(labels)
    ]


def _flat(value: np.ndarray) -> np.ndarray:
    return np.asarray(value, dtype=np.float64).ravel()


def numbered(entries: Sequence[Any]) -> dict[str, Any]:
    """Structures of an array of them, by the place that MATLAB gives them."""
    return {f"({number})": entry for number, entry in enumerate(entries, 1)}
