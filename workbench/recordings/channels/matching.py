"""Channels that may be signals: by name, by unit, and by what values are plausible."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.channels.names import (
    EXACT,
    WITHIN,
    WORDS,
    NamedChannel,
    PlacedChannel,
    is_asked,
    likeness_to,
    words,
)
from workbench.recordings.formats import FileChannel
from workbench.recordings.formats.numbers import markers
from workbench.recordings.formats.spelling import (
    Conversion,
    conversion,
    is_unit,
    multiple,
    pressure_zero,
    spell_unit,
)
from workbench.system.parts import Signal
from workbench.system.system import System


@dataclass(frozen=True, eq=False)
class Assignment:
    """A channel that is taken for a signal."""

    file: int  # it stands in, counted from 0
    group: int  # in that file, counted from 0
    channel: FileChannel
    label: str  # the channel's name, with its group where several have it
    unit: str  # that its values are in
    # factor, zero: SI value is `factor*value + zero`
    factor: float
    zero: float
    formula: str  # what the recorder has in place of the signal; empty: the signal itself
    reason: str  # why this one, for people
    certain: bool  # whether name and unit are the system's own, so that nobody need be asked
    concluded: bool = False  # whether the file does not say the unit
    doubt: str = ""  # what somebody must confirm before it is taken, in words; empty: nothing
    missing: tuple[float, ...] = ()  # values of the channel that stand for no sample
    # those of them that the user declares; None: nothing is said of them
    declared: tuple[float, ...] | None = None

    @property
    def values(self) -> Vector:
        """(n,) SI, not finite in gaps."""
        samples = samples_of(self.channel, self.missing)
        return Conversion(self.factor, self.zero).applied(samples)

    @property
    def named(self) -> NamedChannel:
        """As it is stored; what the file says of the unit is left to it."""
        unit = self.unit if self.concluded or self.unit != self.channel.unit else ""
        return NamedChannel(self.label, unit, self.factor < 0.0, self.declared)


def samples_of(channel: FileChannel, missing: Sequence[float]) -> Vector:
    """(n,) values of a channel, NaN where one of some stands for no sample."""
    if not missing:
        return channel.values
    return np.where(np.isin(channel.values, missing), np.nan, channel.values)


def missing_of(
    channel: FileChannel, declared: tuple[float, ...] | None, column: str
) -> tuple[tuple[float, ...], str, str]:
    """Values that stand for no sample, what is said of them, and what somebody must confirm.

    Parameters
    ----------
    declared : by the user; None: known markers are taken, and others asked about.
    column : how the user names the channel, SIGNAL=CHANNEL.
    """
    if declared is not None:
        return declared, f"; {channel.unread} are no samples" if channel.unread else "", ""
    known, others = markers(channel.values)
    reason = "".join(f"; {value:g}, {count} times, is no sample" for value, count in known.items())
    doubt = ""
    if channel.unread:
        doubt = (
            f"'{channel.name}' has {channel.unread}, which are no numbers; correct them, or "
            f"--column '{column} missing none' takes them for no samples"
        )
    if others:
        counted = " and ".join(
            f"{value:.15g} in {count} samples" for value, count in others.items()
        )
        listed = ", ".join(f"{value:.15g}" for value in (*known, *others))
        doubt = (
            f"'{channel.name}' is {counted}, far outside of all others, and taken for no sample; "
            f"--column '{column} missing {listed}' confirms it, 'missing none' keeps all"
        )
    return (*known, *others), reason, doubt


def _impossible_value(name: str, unit: str, values: Vector, signal: Signal) -> str:
    """Why values cannot be those of a signal: the first that is not possible, and what may be."""
    low, high = signal.possible
    first = int(np.flatnonzero((values < low) | (values > high))[0])
    limits = f"{low:g} to {high:g} {signal.unit}"
    words = f"'{name}' in [{unit}] goes beyond what is possible, {limits}: "
    words += f"{values[first]:.6g} {signal.unit} in sample {first + 1}"
    for factor, meant in ((1e-3, "a thousandth"), (1e3, "a thousand times")):
        largest = factor * float(np.nanmax(np.abs(values)))
        if signal.scale / _TYPICAL <= largest <= signal.scale * _TYPICAL:
            words += f"; {meant} of it would be usual, so that the unit may be another one"
    return words


def is_difference(signal: Signal) -> bool:
    """Whether a temperature is a difference of two: it may be below zero, or is called one."""
    below = np.isfinite(signal.possible[0]) and signal.possible[0] < 0.0
    names = (signal.name, signal.label, *signal.called)
    called = any(_DIFFERENCE.search(name) for name in names)
    return signal.unit == "K" and bool(below or called)


def size_doubt(values: Vector, unit: str, signal: Signal, column: str) -> str:
    """That values are a thousand times what is usual, or have another zero; empty: they are not.

    Parameters
    ----------
    values : (n,) SI.
    column : how the user names the channel, SIGNAL=CHANNEL.
    """
    held = np.abs(values[np.abs(values) < _HUGE])
    if not held.size or not signal.scale > 0.0:
        return ""
    largest, middle = float(held.max()), float(np.median(held))
    ratio = largest / signal.scale
    confirms = f"--column '{column} [{unit}]' confirms [{unit}]"
    # A sensor at rest scatters by its noise, and no less; a small signal may be in its own unit.
    other = unit not in (signal.unit, signal.shown)
    fine = 0.0 < float(held.std()) < 0.2 * signal.noise
    moves = fine or (other and largest > 5.0 * signal.noise)
    unusual = unit.startswith("m") and unit not in USUAL_UNITS.get(signal.unit, ())
    mega = unusual and 1.0 / _THOUSANDFOLD < 1e9 * ratio < _THOUSANDFOLD  # mPa for MPa
    if ratio > _THOUSANDFOLD or mega or (1e-7 < ratio < 1.0 / _THOUSANDFOLD and moves):
        return (
            f"its largest value, {largest:.4g} {signal.unit}, is {ratio:.3g} times the typical "
            f"{signal.scale:g} {signal.unit}; {confirms}"
        )
    if signal.unit != "K" or is_difference(signal):
        return ""
    if signal.scale < COLD and unit in ("degC", "degF"):
        return (
            f"in [{unit}] it may be a temperature, or a difference of two; {confirms} for a "
            f"temperature, [K] takes 6 degC for 6 K"
        )
    if signal.scale >= COLD:
        shift = ZERO_CELSIUS if middle < COLD else -ZERO_CELSIUS
        if abs(middle + shift - signal.scale) < 0.5 * abs(middle - signal.scale):
            zero = "degC" if shift > 0.0 else "K"
            return f"its median is {middle:.4g} K, as if it were in [{zero}]; {confirms}"
    return ""


def meaning_doubt(
    channel: str, unit: str, values: Vector, names: Sequence[str], si: str, column: str
) -> str:
    """What a channel's name, unit or values leave open of its zero or its size; empty: nothing.

    Parameters
    ----------
    channel, unit : as the file has them.
    values : (n,) in the unit of the signal.
    names, si : of the signal, and its unit.
    column : how the user names the channel, SIGNAL=CHANNEL.
    """
    if conversion(si, "Pa") is not None:
        base, zero = pressure_zero(unit)
        zero = zero or _zero_in(channel)
        stated = next(filter(None, map(_zero_in, names)), "")
        if zero and zero != stated:
            means = "above that of the air" if zero == "gauge" else "above a vacuum"
            return (
                f"'{channel}' [{unit}] is a pressure {means}, and {names[0]} is "
                f"{stated or 'not said to be one'}; add or take off the pressure of the air where "
                f"they differ, --column '{column} [{base}]' takes the values as they are"
            )
    if match := _GALLON.search(unit):
        other = unit.replace(match[0], f"i{match[0]}")
        return (
            f"[{unit}] is taken as of US gallons, 3.785 l, and not of imperial ones, 4.546 l; "
            f"--column '{column} [{unit}]' confirms it, [{other}] takes the other"
        )
    if counted := multiple(unit, si):
        own, size = counted
        return (
            f"[{unit}] may be a unit of {size.factor:.4g} {si}, or [{own}] with the range of a "
            f"sensor; --column '{column} [{unit}]' takes the one, [{own}] the other"
        )
    if factor := _FACTOR.search(channel):
        return (
            f"its name has {factor[0]!r}; --column '{column} [{unit}]' takes the values as they "
            f"are, [0.1 {unit}] a tenth of them"
        )
    turn = conversion(si, "rad")
    if turn is not None and (rounds := _rounds(turn.factor * values)):
        return (
            f"its values go round (steps back by one turn: {rounds}); have the turns counted "
            f"before the import, or --column '{column} [{unit}]' keeps the jumps"
        )
    return ""


def doubts_of(
    channel: FileChannel, unit: str, values: Vector, signal: Signal, column: str
) -> Iterator[str]:
    """What is open of the size and the meaning of a channel; see `size_doubt`, `meaning_doubt`."""
    yield size_doubt(values, unit, signal, column)
    yield _remark_doubt(channel, unit, column)
    yield meaning_doubt(channel.name, unit, values, signal.names, signal.unit, column)


def _remark_doubt(channel: FileChannel, unit: str, column: str) -> str:
    """What a line of the file says of the size of a channel's values; empty: nothing."""
    if not channel.remark:
        return ""
    return (
        f"the file says {channel.remark!r}, and not whether it is applied; --column "
        f"'{column} [{unit}]' takes the values as they are, [0.1 {unit}] a tenth of them; a minus "
        "before the channel turns their sign"
    )


def _zero_in(name: str) -> str:
    """What words of a name say of the zero of a pressure: "gauge", "absolute", or nothing."""
    own = set(words(name))
    return "gauge" if own & _GAUGE else "absolute" if own & _ABSOLUTE else ""


def _rounds(values: Vector) -> int:
    """How often an angle within a turn jumps by a turn, where it moves by far less else."""
    held = values[np.isfinite(values)]
    steps = np.abs(np.diff(held))
    far = steps > math.pi
    usual = float(steps[~far].max(initial=0.0))
    turned = np.abs(steps[far] - 2.0 * math.pi) <= usual + 1e-3
    within = bool(held.size) and float(np.ptp(held)) <= 2.0 * math.pi * (1.0 + 1e-3)
    return int(far.sum()) if within and usual < math.pi / 2.0 and turned.all() else 0


def unit_doubt(signal: str, channel: str, unit: str) -> str:
    """That nobody has said a unit, and how to; brackets of a name may hold one."""
    match = _IN_BRACKETS.search(channel)
    problem = f"no unit that is known in the file, {match[0]} may be one" if match else ""
    problem = problem or "no unit in the file"
    return f"{problem}, --column '{signal}={channel} [{unit}]' confirms [{unit}]"


def unit_reason(reason: str, unit: str, concluded: bool) -> str:
    """Why a channel is taken, with what was concluded of its unit."""
    return f"{reason}; no unit in the file, only {unit} fits" if concluded else reason


def match(
    named: Mapping[str, Assignment], places: Sequence[PlacedChannel], system: System
) -> tuple[dict[str, Assignment], dict[str, str]]:
    """Channels by signal, those that are named and those that names and units tell; and doubts.

    Doubts say why a signal has no channel. One that a recording may be without is not assigned by
    its unit alone: its doubt says what it may be.
    """
    assigned, doubts = dict(named), dict[str, str]()
    _by_name(assigned, doubts, places, system)
    assigned |= _by_unit((*system.inputs, *system.outputs), assigned, doubts, places, system)
    for name, channel in _by_unit(
        system.reference_signals, assigned, doubts, places, system
    ).items():
        doubts[name] = f"it may be '{channel.label}'; {channel.doubt}"
    return assigned, doubts


def _candidate(
    place: PlacedChannel, signal: Signal, system: System, likeness: int
) -> tuple[Assignment | None, str]:
    """A channel as a signal, or None and why it cannot be."""
    channel, column = place.channel, f"{signal.name}={place.label}"
    missing, gaps, marked = missing_of(channel, None, column)
    samples = samples_of(channel, missing)
    unit = stated = channel.unit or unit_in_name(channel.name, signal, system)
    if not stated:
        fitting = fitting_units(samples, signal, system)
        if len(fitting) != 1:
            fits = f"as {' or '.join(fitting)}" if fitting else "in no usual unit"
            return None, f"'{channel.name}' has no unit and is plausible {fits}"
        unit = fitting[0]
    concluded = not stated and unit != "1"
    way = conversion_to(unit, signal, system)
    if way is None:
        known = "of another dimension" if is_unit(unit) else "that is not known"
        return None, f"'{channel.name}' is in [{unit}], a unit {known}"
    scale, formula = way
    values = scale.applied(samples)
    low, high = signal.possible
    if not np.isfinite(values).any():
        return None, f"'{channel.name}' holds no numbers"
    if np.nanmin(values) < low or np.nanmax(values) > high:
        words = _impossible_value(channel.name, unit, values, signal)
        beyond = np.unique(samples[(values < low) | (values > high)])
        if beyond.size == 1:
            marker = f"{beyond[0]:.15g}"
            words += f"; if {marker} is no sample, say --column '{column} missing {marker}'"
        return None, words
    reason = "name and unit" if likeness else "the only one of its unit"
    doubt = ""
    if concluded:
        doubt = unit_doubt(signal.name, place.label, unit)
    elif not likeness:
        confirms = f"--column '{signal.name}={place.label}' confirms it"
        doubt = f"nothing but its unit speaks for it, {confirms}"
    own_doubts = (marked, *doubts_of(channel, unit, values, signal, column))
    doubt = "; ".join(filter(None, (doubt, *own_doubts)))
    return Assignment(
        file=place.file,
        group=place.group,
        channel=channel,
        label=place.label,
        unit=unit,
        factor=scale.factor,
        zero=scale.zero,
        formula=formula,
        reason=unit_reason(reason, unit, concluded) + gaps,
        certain=likeness == EXACT
        and channel.name == signal.name
        and bool(channel.unit)
        and not any(own_doubts),
        concluded=concluded,
        doubt=doubt,
        missing=missing,
    ), ""


def _by_name(
    assigned: dict[str, Assignment],
    doubts: dict[str, str],
    places: Sequence[PlacedChannel],
    system: System,
) -> None:
    """Assign channels whose names tell, the most alike first; doubts say why a signal has none."""
    candidates: dict[int, list[tuple[Signal, Assignment]]] = {EXACT: [], WORDS: [], WITHIN: []}
    for signal in system.signals.values():
        for place in places:
            likeness = likeness_to(place.channel.name, place.channel.about, signal.names)
            if likeness and is_asked(place.channel.name) and not signal.exact:
                doubts[signal.name] = f"'{place.channel.name}' is asked for, not measured"
            elif likeness:
                channel, doubt = _candidate(place, signal, system, likeness)
                if channel is not None:
                    candidates[likeness].append((signal, channel))
                else:
                    doubts[signal.name] = doubt
    settled = set(assigned)
    for level in candidates.values():
        taken = {id(assignment.channel) for assignment in assigned.values()}
        left = [(s, o) for s, o in level if s.name not in settled and id(o.channel) not in taken]
        for signal, channel in left:
            rivals = [o.label for s, o in left if s is signal]
            claims = [s.name for s, o in left if o.channel is channel.channel]
            settled.add(signal.name)
            if len(rivals) == len(claims) == 1:
                assigned[signal.name] = channel
            elif len(rivals) > 1:
                doubts[signal.name] = f"it may be {' or '.join(map(repr, rivals))}"
            else:
                doubts[signal.name] = f"'{channel.channel.name}' may be {' or '.join(claims)}"


def _by_unit(
    signals: Sequence[Signal],
    assigned: Mapping[str, Assignment],
    doubts: Mapping[str, str],
    places: Sequence[PlacedChannel],
    system: System,
) -> dict[str, Assignment]:
    """The only channel that has its unit, for each signal that alone lacks one of it."""
    taken = {id(assignment.channel) for assignment in assigned.values()}
    fitting = [
        (signal, channel)
        for signal in signals
        if signal.name not in assigned and signal.name not in doubts
        for place in places
        if id(place.channel) not in taken
        and place.channel.unit
        and not is_asked(place.channel.name)
        and (channel := _candidate(place, signal, system, 0)[0]) is not None
    ]
    return {
        signal.name: channel
        for signal, channel in fitting
        if sum(s is signal or o.channel is channel.channel for s, o in fitting) == 1
    }


# Units that recorders use and may leave out, by the SI unit of what they measure.
USUAL_UNITS = {
    "Pa": ("Pa", "kPa", "MPa", "mbar", "bar", "psi"),
    "rad/s": ("rad/s", "rpm", "rev/s", "deg/s"),
    "rad": ("rad", "deg", "rev"),
    "m/s": ("m/s", "km/h", "mph"),
    "m": ("m", "cm", "mm"),
    "N": ("N", "kN", "lbf"),
    "N.m": ("N.m", "kN.m", "lbf.ft"),
    "V": ("V", "mV"),
    "A": ("A", "mA"),
    "K": ("K", "degC"),
}
ZERO_CELSIUS = 273.15  # K
_DIFFERENCE = re.compile(
    r"differen[cz]|delta|\u0394|\bd[ _]?T\b|spreizung|spread|superheat|subcool|\b(rise|lift)\b",
    re.IGNORECASE,
)
_IN_BRACKETS = re.compile(r"[({<][^(){}<>\d]+[)}>]$")
# A factor in a name: flow x10, flow/1000; but Aux10 and x10 are none.
_FACTOR = re.compile(r"((?<=[\s([])x|(?<=.)[\u00d7*/])\s?10(0*|\^[+-]?\d+)(?!\w)")
_GALLON = re.compile(r"\b(gal|gallon|gpm)\b")
_WORDS = frozenset(("in", "atm"))  # units that mean something else in a name: h_in, p_atm
_HUGE = 1e100  # no sample, and its square would be no number
COLD = 100.0  # K, below which no machine's temperature is
_THOUSANDFOLD = 300.0  # times the typical size of a signal: a unit is another one
_GAUGE = frozenset(("gauge", "gage", "rel", "relative", "relativ", "ueberdruck"))
_ABSOLUTE = frozenset(("abs", "absolute", "absolut", "absolutdruck"))
_TYPICAL = 10.0  # times the typical size of a signal, or a tenth, is what its largest sample may be


def conversion_to(unit: str, signal: Signal, system: System) -> tuple[Conversion, str] | None:
    """How values in a unit become a signal, and by which formula; None: in no way."""
    direct = conversion(unit, signal.unit)
    if direct is not None:
        turned = Conversion(direct.factor) if is_difference(signal) else direct
        return turned, ""
    other = signal.recorded_as
    conversion_to_other = conversion(unit, other.unit) if other is not None else None
    if other is None or conversion_to_other is None:
        return None
    (slope,) = other.formula.slopes((signal.name,), system.values)
    return Conversion(
        conversion_to_other.factor / slope, conversion_to_other.zero / slope
    ), other.formula.text


def fitting_units(samples: Vector, signal: Signal, system: System) -> list[str]:
    """Usual units in which values without a unit have the signal's typical size."""
    others = USUAL_UNITS.get(signal.recorded_as.unit, ()) if signal.recorded_as else ()
    fitting: list[str] = []
    for unit in dict.fromkeys(
        (signal.shown, *USUAL_UNITS.get(signal.unit, (signal.unit,)), *others)
    ):
        way = conversion_to(unit, signal, system)
        if way is None:
            continue
        values = way[0].applied(samples)
        size = float(np.nanmax(np.abs(values), initial=0.0))
        low, high = signal.plausible
        typical = signal.scale / _TYPICAL <= size <= signal.scale * _TYPICAL
        if typical and np.nanmin(values) >= low and np.nanmax(values) <= high:
            fitting.append(unit)
    return fitting


def unit_in_name(name: str, signal: Signal, system: System) -> str:
    """A unit at the end of a name, as in `p_bar`; one letter may mean anything."""
    _, _, last = name.replace(" ", "_").rpartition("_")
    unit = spell_unit(last)
    is_apart = len(last) > 1 and last != name and last.lower() not in _WORDS
    return unit if is_apart and conversion_to(unit, signal, system) else ""
