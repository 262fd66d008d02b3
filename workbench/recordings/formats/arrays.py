"""Named arrays, as MAT and NumPy files have them, to groups of channels."""

import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.recordings.formats.contents import Contents, FileChannel, Group
from workbench.recordings.formats.spelling import conversion, name_and_unit, spell_unit
from workbench.recordings.formats.stamps import is_stamp, read_stamps

_UNIT = re.compile(r"(?P<of>.*?)[_.]?(units?|einheit)", re.IGNORECASE)
_VALUES = ("data", "values", "value", "val", "v", "daten", "y")
_TIMES = ("time", "t", "zeit", "times", "x")
_RATES = (
    *("fs", "samplerate", "samplingrate", "abtastrate"),
    *("samplefrequency", "samplingfrequency", "abtastfrequenz"),
)
_STEPS = ("dt", "ts", "sampletime", "deltat", "abtastzeit", "sampleinterval", "samplinginterval")
_TIME_UNITS = ("timeunit", "time_unit")
_PLACE = re.compile(r"\(\d+\)")  # of a structure in an array of them
_SINCE = re.compile(r"(?P<unit>\w+) since (?P<date>.+)")  # as netCDF has units of time
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


class Opaque(str):
    """What only another program reads, in words."""


def _collect(
    within: tuple[str, ...],
    content: Mapping[str, Any],
    groups: list[Group],
    notes: list[str],
    step: float = math.nan,
) -> None:
    content = _with_own_names(_plotted_signals(_with_headers(content)))
    units, step = _units(content), stated_step(content, step)
    by_size: dict[int, list[FileChannel]] = {}
    for key, value in content.items():
        name, unit = name_and_unit(key)
        unit = unit or units.get(key, "")
        if isinstance(value, Opaque):
            notes.append(f"'{key}' is {value}")
        elif isinstance(value, list) and len(value) > 2 and any(map(is_stamp, value[:100])):
            if (stamps := read_stamps(name, value)) is not None:
                by_size.setdefault(len(value), []).append(stamps)
        elif isinstance(value, Mapping):
            name, value = _element(name, value)
            timed = _simulink(name, value) or _time_series(name, value)
            if timed is not None:
                groups.append(replace(timed, within=within))
            elif (channel := _single(name, value)) is not None:
                by_size.setdefault(channel.values.size, []).append(channel)
            else:
                _collect((*within, key), value, groups, notes, step)
        elif isinstance(value, np.ndarray):
            value = _real(value) if value.ndim <= 2 else _real(np.squeeze(value))
            if value.dtype.kind not in "fiub" and value.size > 1:
                notes.append(f"'{key}' holds no real numbers")
            for channel in _columns(name, unit, value, content):
                by_size.setdefault(channel.values.size, []).append(channel)
            if value.ndim > 2:
                notes.append(f"'{key}' has {value.ndim} dimensions")
    several = [size for size in by_size if size > 1]
    for size in several:
        name = "/".join(within if len(by_size) == 1 else (*within, f"{size} samples"))
        doubt = _other_times(by_size, size) if len(several) > 1 and math.isnan(step) else ""
        groups.append(Group(name, tuple(by_size[size]), step=step, step_doubt=doubt, within=within))


def _other_times(by_size: Mapping[int, Sequence[FileChannel]], size: int) -> str:
    """That channels have no times of their own, and which have not as many samples; or nothing."""
    clocks = {n: c for n, held in by_size.items() for c in held if c.name.lower() in _TIMES}
    if not clocks or size in clocks:
        return ""
    count, clock = next(iter(clocks.items()))
    names = ", ".join(channel.name for channel in by_size[size][:5])
    return f"no times for {size} samples of {names}: '{clock.name}' has {count}"


def _real(value: np.ndarray) -> np.ndarray:
    """Numbers without an imaginary part, where it is zero in all of them."""
    return value.real if value.dtype.kind == "c" and not value.imag.any() else value


def _element(name: str, content: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]]:
    """Name and content of a signal that says its own name, such as one of a Dataset of Simulink."""
    own = next((v for k, v in content.items() if k.lower() == "name" and isinstance(v, str)), "")
    values = next(
        (v for k, v in content.items() if k.lower() == "values" and isinstance(v, Mapping)), None
    )
    numbered = _PLACE.fullmatch(name) is not None
    label = own if own and (numbered or values is not None) else name
    return label, content if values is None else values


def _plotted_signals(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Signals `Y` over the times `X`, as test stands store what they plot, by their names.

    Of several times, `XIndex` of each signal says which are its own.
    """
    parts = {key.lower(): value for key, value in content.items()}
    times, signals = parts.get("x"), parts.get("y")
    if not isinstance(times, Mapping) or not isinstance(signals, Mapping):
        return content
    held = {"(1)": signals} if "(1)" not in signals else signals
    clocks = {"(1)": times} if "(1)" not in times else times
    rasters: dict[str, dict[str, Any]] = {place: {} for place in clocks}
    for key, member in [*clocks.items(), *held.items()]:
        _, values = _entry(member, _VALUES) if isinstance(member, Mapping) else ("", None)
        if not isinstance(values, np.ndarray):
            return content
        is_clock = member is clocks.get(key)
        index = 1 if len(clocks) == 1 else _entry(member, ("xindex",))[1]
        place = key if is_clock else f"({index})"
        if place not in rasters:
            return content
        name = "time" if is_clock else _element(key, member)[0]
        _, unit = _entry(member, ("unit", "units"))
        rasters[place] |= {name: values, f"{name}_unit": unit if isinstance(unit, str) else ""}
    return rasters if len(rasters) > 1 else rasters["(1)"]


def _with_headers(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Arrays `NAME_Data` by the names and units that `NAME_Header` says, as catman writes them.

    What the header of the file states of its rate stands beside them.
    """
    heads = {key[:-6].lower(): key for key in content if key.lower().endswith("header")}
    heads = {stem: key for stem, key in heads.items() if isinstance(content[key], Mapping)}
    ends = {key: key[:-4].lower() for key in content if key.lower().endswith("data")}
    named = {key: content[heads[stem]] for key, stem in ends.items() if stem in heads}
    if not named:
        return content
    members: dict[str, Any] = {
        key: entry
        for stem, header in heads.items()
        if stem not in ends.values()
        for key, entry in content[header].items()
        if not isinstance(entry, Mapping)
    }
    labels = [_entry(header, ("signalname", "channelname", "name"))[1] for header in named.values()]
    for key, entry in content.items():
        if key not in named:
            members |= {key: entry} if key not in heads.values() else {}
            continue
        _, label = _entry(named[key], ("signalname", "channelname", "name"))
        own = label if isinstance(label, str) and label and labels.count(label) == 1 else key
        _, unit = _entry(named[key], ("unit", "units", "einheit"))
        members |= {own: entry, f"{own}_unit": unit if isinstance(unit, str) else ""}
    return members


def _with_own_names(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Arrays of inputs and outputs by the names beside them, as of System Identification.

    `InputName` and `InputUnit` are those of `InputData` or `u`, `OutputName` those of `OutputData`
    or `y`.
    """
    members = dict(content)
    for side, letter in (("Input", "u"), ("Output", "y")):
        key = next((key for key in (f"{side}Data", letter) if key in content), "")
        values, names = content.get(key), content.get(f"{side}Name")
        units = content.get(f"{side}Unit", "")
        names = [names] if isinstance(names, str) else names
        units = [units] if isinstance(units, str) else units
        if not isinstance(values, np.ndarray) or not isinstance(names, list):
            continue
        table = np.atleast_2d(values)
        table = table if table.shape[0] >= table.shape[1] else table.T
        if table.shape[1] != len(names) or "" in names:
            continue
        for part in (key, f"{side}Name", f"{side}Unit"):
            members.pop(part, None)
        for i, name in enumerate(names):
            members[name] = table[:, i]
            members[f"{name}_unit"] = units[i] if i < len(units) else ""
    return members


def stated_step(content: Mapping[str, Any], outer: float = math.nan) -> float:
    """Time between samples that a number beside the arrays states [s]; else that further out."""
    unit = next((v for k, v in content.items() if k.lower() in _TIME_UNITS), "s")
    scale = conversion(spell_unit(unit), "s") if isinstance(unit, str) else None
    for key, value in content.items():
        name, unit = name_and_unit(key)
        name = name.lower().replace("_", "").replace(" ", "")
        if name not in (*_RATES, *_STEPS) or np.size(value) != 1:
            continue
        try:
            number = float(np.ravel(value)[0])
        except (TypeError, ValueError):
            continue
        own = conversion(unit, "Hz" if name in _RATES else "s") if unit else None
        factor = own.factor if own else 1.0 if name in _RATES or scale is None else scale.factor
        if number > 0.0 and name in _RATES:
            return 1.0 / (factor * number)
        if number > 0.0 and (own or scale):
            return factor * number
    return outer


def _units(content: Mapping[str, Any]) -> dict[str, str]:
    """Units by name, from texts beside the arrays."""
    units: dict[str, str] = {}
    vectors = [key for key, value in content.items() if isinstance(value, np.ndarray)]
    for key, value in content.items():
        match = _UNIT.fullmatch(key)
        if match is None:
            continue
        if isinstance(value, str) and match["of"]:
            units[match["of"]] = spell_unit(value)
        elif isinstance(value, list) and len(value) == len(vectors):
            units |= {name: spell_unit(unit) for name, unit in zip(vectors, value, strict=True)}
        elif isinstance(value, Mapping):
            texts = {name: unit for name, unit in value.items() if isinstance(unit, str)}
            units |= {name: spell_unit(unit) for name, unit in texts.items()}
    return units


def _entry(content: Mapping[str, Any], names: tuple[str, ...]) -> tuple[str, Any]:
    """Key and value of the first entry that has one of some names."""
    return next(
        ((key, entry) for key, entry in content.items() if key.lower() in names), ("", None)
    )


def _time_series(name: str, content: Mapping[str, Any]) -> Group | None:
    """A structure with times and values of one channel, such as a time series."""
    key, times = _entry(content, _TIMES)
    channel = _single(name, content)
    stamps = read_stamps(key, times) if isinstance(times, list) else None
    if channel is not None and stamps is not None and stamps.values.size == channel.values.size:
        return Group(name, (stamps, channel))
    if channel is None or not isinstance(times, np.ndarray):
        return None
    if times.size != channel.values.size or times.size < 2:
        return None
    unit = _units(content).get(key, "") or _inner_units(content, "TimeInfo")
    clock = FileChannel(key, unit, _flat(times))
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
        label = str(signal.get("label") or "").strip() or (key if len(held) > 1 else name)
        own, unit = name_and_unit(label)
        unit = unit or (spell_unit(entry) if isinstance(entry := signal.get("unit"), str) else "")
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
    values = _real(values)
    clock, _ = _entry(content, _TIMES)
    others = [held for other, held in content.items() if other not in (key, clock)]
    if any(
        isinstance(held, np.ndarray) and max(held.shape, default=0) == values.size > 1
        for held in others
    ):
        return None  # one of several channels
    _, unit = _entry(content, ("unit", "units", "einheit"))
    _, about = _entry(content, _TEXTS)
    return FileChannel(
        name,
        spell_unit(unit)
        if isinstance(unit, str)
        else _units(content).get(key, "") or _inner_units(content, "DataInfo"),
        _flat(values),
        about if isinstance(about, str) else "",
    )


def _inner_units(content: Mapping[str, Any], key: str) -> str:
    """Units that a time series has in a structure beside its arrays; empty: none."""
    unit = content[key].get("Units") if isinstance(content.get(key), Mapping) else None
    return spell_unit(unit) if isinstance(unit, str) else ""


def _columns(
    name: str, unit: str, value: np.ndarray, content: Mapping[str, Any]
) -> list[FileChannel]:
    """Channels of an array: one of a vector, one of each column of a table.

    A table's columns are named by a list of as many texts beside it, if there is one.
    """
    if value.dtype.kind not in "fiub" or value.ndim > 2:
        return []
    if value.ndim < 2 or 1 in value.shape:
        return [_channel(name, unit, _flat(value))]
    table = value if value.shape[0] >= value.shape[1] else value.T
    width = table.shape[1]
    lists = {key: held for key, held in content.items() if isinstance(held, list)}
    lists = {key: held for key, held in lists.items() if len(held) == width}
    units = next((held for key, held in lists.items() if _UNIT.fullmatch(key)), [unit] * width)
    names = [held for key, held in lists.items() if not _UNIT.fullmatch(key)]
    own = names[0] if len(names) == 1 else [f"{name}({i + 1})" for i in range(width)]
    labels = [name_and_unit(label) for label in own]
    return [
        FileChannel(label, stated or spell_unit(units[i]), _flat(table[:, i]))
        for i, (label, stated) in enumerate(labels)
    ]


def _channel(name: str, unit: str, values: np.ndarray) -> FileChannel:
    """A channel; of times such as "seconds since 2024-03-05" with their date."""
    since = _SINCE.fullmatch(unit)
    zero = read_stamps("", [since["date"]] * 2) if since else None
    if since is None or zero is None or not math.isfinite(zero.start):
        return FileChannel(name, unit, values)
    return FileChannel(name, spell_unit(since["unit"]), values, start=zero.start, zoned=zero.zoned)


def _flat(value: np.ndarray) -> np.ndarray:
    return np.asarray(value, dtype=np.float64).ravel()


def by_place(entries: Sequence[Any]) -> dict[str, Any]:
    """Structures of an array of them, by the place that MATLAB gives them."""
    return {f"({number})": entry for number, entry in enumerate(entries, 1)}


def read_npz(path: Path, raw: bytes) -> Contents:
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
