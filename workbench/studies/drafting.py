"""A system file for an FMU, from its model description and recordings.

What two places agree on is written as it is; what was concluded has its reason as a comment beside
it; what nobody but a user can know is a line with QUESTION.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.data.cleaning import deviation_beside_switching, levels_of
from workbench.errors import InputError
from workbench.models.description import MODEL_EXCHANGE, Description, Variable
from workbench.recordings.channels import (
    TIME,
    MergedRecording,
    NamedChannel,
    RecordingOptions,
    listed,
    merge,
    propose_recordings,
)
from workbench.recordings.channels.clock import usual_step
from workbench.recordings.channels.matching import COLD, USUAL_UNITS, meaning_doubt
from workbench.recordings.channels.names import (
    EXACT,
    PlacedChannel,
    is_asked,
    is_time,
    likeness_to,
    placed_channels,
)
from workbench.recordings.formats import FileChannel, RecordedFile
from workbench.recordings.formats.spelling import conversion, spell_unit
from workbench.system.reader import system_of
from workbench.system.units import is_known_unit

_TYPICAL = 10.0  # times its nominal value, or a tenth, is what a variable's largest sample may be
_NOISELESS = 1e-4  # of its range: below the error of usual sensors; only a simulation is finer
_LIVE = 30  # parameters that are proposed for a fit; more are listed in a comment
_BLOCK, _BLOCKS = 5, 40  # samples of a usual block, and blocks that a diagnosis needs
_REACH = 5.0  # times a parameter, and a fifth, where the model states no range


@dataclass(frozen=True, eq=False)
class DraftSignal:
    """A variable of the FMU that was recorded."""

    name: str  # in the system file; that of the variable where it is one word
    variable: Variable
    role: str  # of the table in the system file
    unit: str  # in which the model has it, 1 where the workbench does not know it
    channel: NamedChannel  # that holds it
    reason: str  # why, for people
    doubt: str = ""  # what somebody must confirm, in words; empty: nothing


@dataclass(frozen=True, eq=False)
class Draft:
    """What is known of a system before its file is written."""

    description: Description
    signals: tuple[DraftSignal, ...]
    recordings: tuple[MergedRecording, ...]  # of all files, in the units of the signals
    time: NamedChannel | None  # channel of the times, None where the file itself says them
    questions: tuple[str, ...]  # what somebody must confirm, in words
    unmatched: Mapping[str, str]  # variables of the FMU without a channel, and why, in words
    left: tuple[str, ...]  # channels that nobody takes

    @property
    def columns(self) -> dict[str, NamedChannel]:
        """Channels by signal, as `workbench import` takes them."""
        columns = {signal.name: signal.channel for signal in self.signals}
        return columns | ({TIME: self.time} if self.time else {})

    def samples(self, signal: DraftSignal) -> list[Vector]:
        """(n,) of each recording, in the unit of a signal."""
        return [recording.signals[signal.name] for recording in self.recordings]


def signal_names(description: Description) -> dict[str, str]:
    """Names in a system file, one word each, of the variables that a recording may hold."""
    names: dict[str, str] = {}
    for variable in description.variables:
        shown = re.sub(r"\W+", "_", variable.name).strip("_")
        while shown in names.values() or not shown.isidentifier():
            shown = f"{shown}_" if shown.isidentifier() else f"v{shown}"
        names[variable.name] = shown
    return names


def draft_system(
    description: Description, files: Sequence[RecordedFile], known: RecordingOptions
) -> Draft:
    """Match an FMU's variables with channels of files, by name, unit and plausible values.

    Parameters
    ----------
    known : channels that the user names by signal, and the step of files without times.

    Raises
    ------
    InputError
        If no output of the FMU has a channel, or the times of a file cannot be read.
    """
    signals, unmatched, left = _match(description, files, known.columns)
    where = ", ".join(str(file.path) for file in files)
    if not any(signal.role == "outputs" for signal in signals):
        outputs = description.names("output") or description.states
        raise InputError(
            where=where,
            found=f"no channel that is an output of the model: {listed(left)}"
            + "".join(f"; {name}: {unmatched[name]}" for name in outputs if name in unmatched),
            expected=f"one of {listed(list(outputs))}",
            remedy="name it, --column 'VARIABLE=CHANNEL [unit]'",
        )
    system = system_of(_provisional(description, files, signals), Path(where))
    columns = {signal.name: signal.channel for signal in signals}
    columns |= {TIME: known.columns[TIME]} if TIME in known.columns else {}
    recordings, questions, time = [], [s.doubt for s in signals if s.doubt], None
    for file in files:
        held = propose_recordings([file], system, {}, replace(known, columns=columns))
        questions += [*held.problems, *held.doubts]
        time = time or held.named.get(TIME)
        recordings += [merge(part.files, part.proposal, system) for part in held.held]
    asked = tuple(dict.fromkeys(questions))
    return Draft(description, tuple(signals), tuple(recordings), time, asked, unmatched, left)


def _match(
    description: Description, files: Sequence[RecordedFile], named: Mapping[str, NamedChannel]
) -> tuple[list[DraftSignal], dict[str, str], tuple[str, ...]]:
    """Signals, why other inputs and outputs have no channel, and channels that nobody takes."""
    names = signal_names(description)
    places: dict[str, PlacedChannel] = {}
    for place in placed_channels(files[:1]):
        if not _is_time(place.channel):
            places.setdefault(place.channel.name, place)
    signals: dict[str, DraftSignal] = {}
    pairs: list[tuple[int, str, DraftSignal]] = []  # rank, variable, what it would be
    reasons: dict[str, str] = {}
    # Of variables that are one, an input is meant before an output, and that before others.
    order = {"output": 1, "input": 2}
    meant = {
        v.reference: v.name
        for v in sorted(reversed(description.variables), key=lambda v: order.get(v.causality, 0))
    }
    for variable in description.variables:
        own = names[variable.name]
        role = {"input": "inputs", "output": "outputs"}.get(variable.causality, "")
        moves = variable.causality == "local" and variable.variability == "continuous"
        role = role or "outputs" * (
            moves and variable.real and variable.name not in description.rates
        )
        if not role or not variable.holds_number or variable.array:
            continue
        if channel := named.get(own):
            _refuse_unconverted(own, variable, channel, places)
            unit = spell_unit(variable.unit or "") or channel.unit or "1"
            unit = unit if is_known_unit(unit) else "1"
            signals[own] = DraftSignal(own, variable, role, unit, channel, "named by you")
            continue
        called = [variable.name, own, variable.name.split(".")[-1], variable.text]
        for place in places.values():
            likeness = likeness_to(
                place.channel.name, place.channel.about, [c for c in called if c]
            )
            # A variable that is no output is meant only where a channel has its name.
            if likeness < EXACT and variable.causality == "local":
                continue
            if is_asked(place.channel.name) and role == "outputs" and likeness != EXACT:
                continue
            signal, why = _candidate(own, variable, role, place, likeness)
            # The whole name goes before parts of it, and an output before what is within.
            whole = likeness_to(place.channel.name, "", [variable.name, own]) == EXACT
            rank = 2 * (likeness + whole) + (variable.causality != "local")
            if not whole and variable.name != meant[variable.reference] and not variable.of:
                continue
            if signal:
                pairs.append((rank, own, signal))
            elif likeness:
                reasons[own] = why
    for level in sorted({rank for rank, *_ in pairs}, reverse=True):
        taken = {signal.channel.channel for signal in signals.values()}
        open_pairs = [
            signal
            for rank, own, signal in pairs
            if rank == level and own not in signals and signal.channel.channel not in taken
        ]
        for signal in open_pairs:
            rivals = [s.channel.channel for s in open_pairs if s.name == signal.name]
            claims = [s.name for s in open_pairs if s.channel.channel == signal.channel.channel]
            if len(rivals) == len(claims) == 1:
                signals[signal.name] = signal
            elif level > 1:
                choice = listed([repr(name) for name in (rivals if len(rivals) > 1 else claims)])
                reasons[signal.name] = (
                    f"it may be {choice}"
                    if len(rivals) > 1
                    else (f"'{signal.channel.channel}' may be {choice}")
                )
    needed = [v for v in description.variables if v.causality in ("input", "output")]
    unmatched = {
        variable.name: reasons.get(names[variable.name], "no channel has its name")
        for variable in needed
        if names[variable.name] not in signals and not variable.array
    }
    taken = {signal.channel.channel for signal in signals.values()}
    left = tuple(
        f"{name} [{place.channel.unit}]" if place.channel.unit else name
        for name, place in places.items()
        if name not in taken
    )
    return list(signals.values()), unmatched, left


def _refuse_unconverted(
    name: str, variable: Variable, channel: NamedChannel, places: Mapping[str, PlacedChannel]
) -> None:
    """Refuse a channel in another unit than a variable whose unit has a zero of its own."""
    own = spell_unit(variable.unit or "")
    place = places.get(channel.channel)
    stated = channel.unit or (place.channel.unit if place else "")
    if own and not is_known_unit(own) and stated not in ("", "1", own):
        raise InputError(
            where=f"column '{channel.channel}'",
            found=f"[{stated}], and [{own}] in the model's variable '{variable.name}'",
            expected=f"[{own}], which the workbench does not convert",
            remedy=f"convert the column to [{own}] before, and name it --column '{name}="
            f"{channel.channel} [{own}]'",
        )


def _is_time(channel: FileChannel) -> bool:
    """Whether a channel is one of times: `T [degC]` is not."""
    timely = not channel.unit or conversion(channel.unit, "s") is not None
    return channel.stamp or (is_time(channel.name) and timely)


def _candidate(
    name: str, variable: Variable, role: str, place: PlacedChannel, likeness: int
) -> tuple[DraftSignal | None, str]:
    """A channel as a variable, or None and why it cannot be."""
    stated, own = place.channel.unit, spell_unit(variable.unit or "")
    if not likeness and not (stated and own):
        return None, ""
    doubt = "" if likeness else f"{name}: nothing but its unit speaks for '{place.channel.name}'"
    why = f"its name, '{place.channel.name}'" if likeness else "the only one of its unit"
    unit, read_in = own or stated or "1", stated or own or "1"
    if own and not is_known_unit(own):  # such as degC, which has a zero of its own
        if stated not in ("", own):
            return None, (
                f"'{place.channel.name}' is in [{stated}], the model's variable in [{own}], "
                "to which nothing is converted: convert the column before"
            )
        why += f"; the workbench does not convert [{own}], values are taken as they are"
        if not stated:
            doubt = doubt or f"{name}: no unit in the file, [{own}] of the model is taken"
        unit = read_in = "1"
    elif own and variable.relative and (way := conversion(stated, own)) and way.zero:
        read_in = own
        why += f"; a difference in the model, so that [{stated}] is read as [{own}]"
    elif own and stated and conversion(stated, own) is None:
        return None, f"'{place.channel.name}' is in [{stated}], the model's variable in [{own}]"
    elif own and not stated:
        doubt = doubt or f"{name}: no unit in the file, [{own}] of the model is taken"
    elif stated and not own:
        unit, text, sure = _without_unit(variable, place.channel.values, stated)
        why += f"; {text}"
        doubt = doubt or ("" if sure else f"{name}: {text}")
    way = conversion(read_in, unit)
    if way is None:
        unit, read_in, way = "1", "1", conversion("1", "1")
    assert way is not None
    values = way.factor * place.channel.values + way.zero
    if not np.isfinite(values).any():
        return None, f"'{place.channel.name}' holds no numbers"
    low, high = variable.limits
    if np.nanmax(values) < low or np.nanmin(values) > high:
        return None, f"no sample of '{place.channel.name}' is within {low:g} to {high:g}"
    size = float(np.nanmax(np.abs(values)))
    typical, of = abs(variable.nominal or 0.0), "nominal"
    if not typical:
        typical, of = abs(_start(variable)), "start"
    if typical and size and not 1 / 300.0 < size / typical < 300.0:
        doubt = doubt or (
            f"{name}: its largest sample, {size:.4g}, is {size / typical:.3g} times the model's "
            f"{of} value {typical:g} [{unit}]"
        )
    if meant := meaning_doubt(
        place.channel.name,
        read_in,
        values,
        (name, variable.name, variable.text),
        unit,
        f"{name}={place.channel.name}",
    ):
        doubt = doubt or f"{name}: {meant}"
    channel = NamedChannel(place.channel.name, read_in)
    return DraftSignal(name, variable, role, unit, channel, why, doubt), ""


def _start(variable: Variable) -> float:
    """Start value as a number, of which a Boolean has two; 0 where there is none."""
    text = variable.start or "0"
    return float(text == "true") if text in ("true", "false") else float(text)


def _without_unit(variable: Variable, values: Vector, stated: str) -> tuple[str, str, bool]:
    """Unit that the model has where it says none, why, and whether anything tells it."""
    base = next((si for si, others in USUAL_UNITS.items() if stated in others), stated)
    if base == stated:
        return stated, f"the model says no unit, [{stated}] of the file is taken", True
    typical = abs(variable.nominal or _start(variable))
    fitting = []
    for unit, way in ((base, conversion(stated, base)), (stated, conversion(stated, stated))):
        # A unit with a zero of its own, as degC, is that of a plain number.
        size = values if way is None else way.factor * values + way.zero
        largest = float(np.nanmax(np.abs(size), initial=0.0))
        if typical and 1.0 / _TYPICAL <= largest / typical <= _TYPICAL:
            fitting.append(unit)
    unit = fitting[0] if len(fitting) == 1 else base
    known = unit if is_known_unit(unit) else "1"
    if len(fitting) == 1:
        return known, f"the model says no unit; its value {typical:g} fits [{unit}]", True
    return known, f"the model says no unit; [{unit}] is taken, and [{stated}] in the file", False


def _provisional(
    description: Description, files: Sequence[RecordedFile], signals: Sequence[DraftSignal]
) -> dict[str, Any]:
    """Content of a system file that recordings can be read with: sizes and noise are not known."""
    steps = [group.step for group in files[0].groups if math.isfinite(group.step)]
    steps += [
        usual_step(channel)
        for group in files[0].groups
        for channel in group.channels
        if _is_time(channel) and not channel.stamp
    ]
    content: dict[str, Any] = {
        "title": description.name or description.path.stem,
        "sample_time": f"{next((s for s in steps if s > 0.0), 1.0):.6g} s",
        "models": {"observer": {"fmu": str(description.path.resolve())}},
    }
    channels = {channel.name: channel for group in files[0].groups for channel in group.channels}
    for signal in signals:
        channel = channels.get(signal.channel.channel)
        values = channel.values if channel else np.ones(1)
        stated = signal.channel.unit or (channel.unit if channel else "")
        if way := conversion(stated or signal.unit, signal.unit):
            # A model that is warm at its start does not mean a difference of temperatures.
            warm = abs(signal.variable.nominal or _start(signal.variable)) >= COLD
            values = way.factor * values + way.zero * warm
        size = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
        content.setdefault(signal.role, {})[signal.name] = {
            "variable": signal.variable.name,
            "unit": signal.unit,
            "noise": _quantity(1e-3 * size, signal.unit),
            "scale": _quantity(size, signal.unit),
        }
    return content


# --- the file ---


def _quantity(value: float, unit: str) -> Any:
    """A quantity as TOML has it: a text with its unit, a number without."""
    return float(f"{value:.4g}") if unit == "1" else f"{value:.4g} {unit}"


def _entry(key: str, value: Any, why: str = "") -> str:
    text = json.dumps(value, ensure_ascii=False)
    return f"{key} = {text}" + (f"  # {why}" if why else "")


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def system_text(draft: Draft, fmu: str) -> str:
    """The system file, with the reason of each value that was concluded."""
    model, times = draft.description, [recording.time for recording in draft.recordings]
    step = float(np.median(np.concatenate([np.diff(time) for time in times])))
    lines = [
        f"# {model.name}: written from the model description of {fmu} and "
        f"{len(times)} recordings. Values with a comment were",
        "# concluded, for the reason that it gives: change what you know better.",
    ]
    lines += [f"# QUESTION: {question}" for question in draft.questions]
    title = model.text or model.name or Path(fmu).stem
    lines += ["", _entry("title", " ".join(title.split()))]
    lines += [_entry("sample_time", f"{step:.6g} s", "median step of the recordings")]
    lines += ['cases = "recordings"', *_reported(draft), "", "[models]"]
    lines += [f"observer = {{ fmu = {json.dumps(fmu)} }}"]
    if MODEL_EXCHANGE not in model.interfaces or model.event_indicators:
        reason = (
            "has events" if MODEL_EXCHANGE in model.interfaces else "is for Co-Simulation alone"
        )
        lines += [f"# The model {reason}: of the estimators, the open loop runs on it."]
    for signal in sorted(draft.signals, key=lambda signal: signal.role):
        lines += _signal_table(draft, signal)
    lines += _missing(draft)
    lines += _states(draft)
    lines += _blocks(min(map(np.size, times)), step)
    return "\n".join([*lines, *_candidates(model)]) + "\n"


def _reported(draft: Draft) -> list[str]:
    model, taken = draft.description, {signal.variable.name for signal in draft.signals}
    names = [
        v.name
        for v in model.variables
        if v.causality == "output"
        and v.real
        and v.name not in taken
        and is_known_unit(v.unit or "1")
    ]
    plain = [name for name in names if name.isidentifier()]
    return [_entry("reported", plain, "outputs of the model that were not measured")] * bool(plain)


def _signal_table(draft: Draft, signal: DraftSignal) -> list[str]:
    variable, unit = signal.variable, signal.unit
    samples = draft.samples(signal)
    largest = max(float(np.abs(values).max()) for values in samples)
    low, high = min(v.min() for v in samples), max(v.max() for v in samples)
    lines = ["", f"# {signal.reason}", f"[{signal.role}.{_key(signal.name)}]"]
    lines += [_entry("variable", variable.name)] * (variable.name != signal.name)
    ours = "as the file says" if not variable.unit else "of the model's variable"
    if variable.unit and unit != variable.unit:
        ours = f"the model says [{variable.unit}], which is not converted"
    lines += [_entry("unit", unit, ours)]
    lines += [_entry("label", " ".join(variable.text.split()))] * bool(variable.text.strip())
    if signal.role == "inputs" and _steps(samples):
        lines += [_entry("noise", _quantity(0.0, unit), "it stays for samples on end: a command")]
        lines += ["held = true  # it stays as it is from sample to sample, and jumps"]
    else:
        own = signal.role == "inputs"
        inputs = [] if own else [draft.samples(s) for s in draft.signals if s.role == "inputs"]
        lines += _noise(samples, inputs, unit, float(high - low), may_be_exact=own)
        if own and levels_of(np.concatenate(samples)):  # the same ones in all recordings
            lines += ["held = true  # it jumps from level to level, and reads nothing between"]
    scale, why = largest or abs(_start(variable)) or 1.0, "largest sample"
    if variable.nominal and 0.1 < largest / abs(variable.nominal) < 10.0:
        scale, why = abs(variable.nominal), "nominal value of the model"
    lines += [_entry("scale", _quantity(scale, unit), why)]
    if variable.minimum is not None and variable.maximum is not None:
        limits = [variable.minimum, variable.maximum]
        if limits[0] <= low and high <= limits[1] and all(map(math.isfinite, limits)):
            written = [_quantity(limit, unit) for limit in limits]
            lines += [_entry("possible", written, "min and max of the model")]
        else:
            lines += [
                f"# QUESTION: the model has it from {limits[0]:g} to {limits[1]:g}, and the "
                f"recordings from {low:.4g} to {high:.4g}."
            ]
    return lines


def _steps(samples: Sequence[Vector]) -> bool:
    """Whether a signal is set: it is on or off, or most samples are exactly the one before.

    Of those that are not, most stand alone; a ramp, or what lags, moves for samples on end.
    """
    moved = [np.diff(values) != 0.0 for values in samples]
    further = np.concatenate([m[1:][m[:-1]] for m in moved])  # after a move
    stays = np.concatenate(moved).mean() < 0.5 and 2 * further.sum() <= further.size
    return bool(stays or np.unique(np.concatenate(samples)).size == 2)


def _noise(
    samples: Sequence[Vector],
    driving: Sequence[Sequence[Vector]],
    unit: str,
    span: float,
    *,
    may_be_exact: bool,
) -> list[str]:
    """Noise of a sensor, from differences of samples, and the step in which it is read.

    Parameters
    ----------
    driving : samples of each input, in each recording; none of a sensor of an input.
    """
    if span == 0.0:
        noise = _NOISELESS * (abs(float(samples[0][0])) or 1.0)
        question = "it stays where it is in all recordings: what is the noise of its sensor?"
        return [f"# QUESTION: {question}", _entry("noise", _quantity(noise, unit), "a guess")]
    moving = zip(*driving, strict=True) if driving else [()] * len(samples)
    pairs = zip(samples, moving, strict=True)
    noise = float(np.median([deviation_beside_switching(values, own) for values, own in pairs]))
    why = "from differences of samples; what lasts longer than a sample is not in it"
    lines = []
    if noise < _NOISELESS * span and may_be_exact:
        noise, why = 0.0, "its samples scatter by less than 1e-4 of its range: taken as exact"
    elif not noise > _NOISELESS * span:
        noise = _NOISELESS * span
        why = "its samples scatter by less: 1e-4 of its range, so that no sensor is trusted blindly"
    levels = np.unique(np.concatenate(samples))
    if 1 < levels.size < 0.25 * sum(map(np.size, samples)):
        resolution = float(np.diff(levels).min())
        if resolution > _NOISELESS * span:
            text = "least step between its samples, which repeat"
            lines = [_entry("resolution", _quantity(resolution, unit), text)]
    return [_entry("noise", _quantity(noise, unit), why), *lines]


def _missing(draft: Draft) -> list[str]:
    """Inputs that nothing drives, and channels that nobody takes."""
    variables = draft.description.by_name
    lines = [
        f"# QUESTION: {name} drives the model, and {why}; it stays at its start value "
        f"{variables[name].start or 0}. Import a recording with it, and add [inputs.NAME]."
        for name, why in draft.unmatched.items()
        if variables[name].causality == "input"
    ]
    lines += [f"# channels that are not used: {listed(draft.left)}"] * bool(draft.left)
    return ["", *lines] if lines else []


def _states(draft: Draft) -> list[str]:
    """Where states begin that no recording has the name of."""
    variables = draft.description.by_name
    measured = {signal.variable.name for signal in draft.signals}
    hidden = [name for name in draft.description.states if name not in measured]
    if not hidden:
        return []
    begins = [
        f"{name} at {variables[name].start or 'its start value'} [{variables[name].unit or '1'}]"
        for name in hidden
    ]
    return [
        "",
        f"# Unless an output shows them, states begin as the model says: {listed(begins)}.",
        "# [states.NAME] spread says how far from there one may begin; else its nominal value, or",
        "# its start value if the model states none.",
    ]


def _blocks(samples: int, step: float) -> list[str]:
    """Shorter blocks than usual where the shortest recording has too few of those."""
    size = samples // _BLOCKS
    if not 0 < size < _BLOCK:
        return []
    why = f"a {_BLOCKS}th of the shortest recording, the least that a diagnosis compares"
    return ["", "[diagnosis]", _entry("block", f"{size * step:.6g} s", why)]


def _candidates(model: Description) -> list[str]:
    """Parameters that a fit may change, with ranges."""
    parameters = [
        v
        for v in model.variables
        if v.causality == "parameter"
        and v.real
        and v.start is not None
        and v.initial != "calculated"
    ]
    lines = []
    for parameter in parameters[:_LIVE]:
        unit, start = parameter.unit or "1", float(parameter.start or 0.0)
        low, high, why = parameter.minimum, parameter.maximum, "min and max of the model"
        if low is None or high is None or not np.isfinite([low, high]).all():
            beyond = sorted((start / _REACH, start * _REACH))
            low = beyond[0] if low is None or not low > beyond[0] else low
            high = beyond[1] if high is None or not high < beyond[1] else high
            why = "a fifth to five times its value: the model states no range"
        table = f"fit.{_key(parameter.name)}"
        about = f"{' '.join(parameter.text.split())}; " if parameter.text else ""
        if not low < high:
            lines += [f"# [{table}] is 0, and the model states no range: add it with a range"]
            continue
        written = [_quantity(limit, unit) for limit in (low, high)]
        lines += [f"# {about}{start:.4g} {unit} in the model; {why}"]
        lines += [f"[{table}]", _entry("range", written)]
    if more := parameters[_LIVE:]:
        lines += [f"# further parameters: {listed([v.name for v in more], 100)}"]
    if not lines:
        return []
    return [
        "",
        "# --- what 'workbench fit' fits: remove the tables of what you know ---",
        "",
        *lines,
    ]
