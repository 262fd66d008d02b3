"""When the samples of a group were taken."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.recordings.channels.names import TIME, NamedChannel, is_time, listed
from workbench.recordings.formats import FileChannel, Group
from workbench.recordings.formats.spelling import conversion
from workbench.recordings.formats.stamps import is_said, read_stamps
from workbench.system.system import System

# Units of time that recorders leave out, and how far from those of usual recordings steps may be in
# the one that is meant. Where several are as likely, as seconds and minutes often are, none is.
_UNSTATED = ("ns", "us", "ms", "s", "min", "h", "d")
_LIKE = math.sqrt(1000.0)
# Counters that go round: bits, and parts of a day, in counts, ms or us of the unit.
_ROUNDS = tuple(
    sorted(
        {float(2**bits) * part for bits in (16, 24, 32) for part in (1.0, 1e-3, 1e-6)}
        | {float(rest) * part for rest in (60, 3600, 43200, 86400) for part in (1.0, 1e3, 1e6)}
    )
)
_UNIX = 8e8, 2.3e9  # [s] since 1970, that recordings are of: 1995 to 2042
# Days of spreadsheets: that of the year 1970, and what they count from 1982 to 2064.
_DAYS = {"Excel": (25569.0, 30000.0, 60000.0), "MATLAB": (719529.0, 724000.0, 754000.0)}
_FACTOR = 1.5  # by which two clocks of one recording do not differ


@dataclass(frozen=True, eq=False)
class Clock:
    """Times of a group's samples.

    Attributes
    ----------
    channel : name of the channel that holds them; empty: the file itself says them.
    times : (n,) s, NaN where there is none.
    start : of their zero [s since 1970], NaN where that is not known.
    unit : that the channel was read in.
    reason : why these are the times, for people; `certain`: nothing was concluded.
    counted : whether samples are counted at a rate, and have no times of their own.
    corrections : how they were made to go on, in words.
    stated : how the user says that dates are to be read.
    zoned : whether `start` is in UTC; else in some local time.
    """

    channel: str
    times: Vector
    start: float
    unit: str
    reason: str
    certain: bool
    counted: bool = False
    corrections: tuple[str, ...] = ()
    stated: str = ""
    zoned: bool = False


def read_clock(
    group: Group, named: NamedChannel | None, step: float | None, system: System, where: str
) -> Clock:
    """Times of a group's samples.

    Parameters
    ----------
    named : the channel that the user says is the time.
    step : between two samples, as the user says [s]; it wins over all that the file says.

    Raises
    ------
    InputError
        If there is no time, none that goes on, or two that contradict each other.
    """
    count = np.arange(group.channels[0].values.size, dtype=np.float64)
    if step is not None:
        return Clock("", count * step, math.nan, "s", f"every {step:g} s, as given", True, True)
    if named is not None:
        own = (*group.channels, *group.left)
        channel_of_time = next((channel for channel in own if channel.name == named.channel), None)
        if channel_of_time is not None:
            return _going_on(_named(channel_of_time, named, system, where), where)
    if group.time is not None:
        time = group.time
        said = "the file says it"
        own_clock = Clock("", time.values, time.start, "s", said, True, zoned=time.zoned)
        return _going_on(own_clock, where)
    # Stamps are often coarser than a counted time beside them.
    channels = sorted(group.channels, key=lambda channel: channel.stamp)
    clocks = [clock for channel in channels if (clock := _candidate(channel, group, system))]
    if going := [clock for clock in clocks if clock.certain and _increases(clock.times)]:
        _refuse_contradiction(going, where)
        return going[0]
    for channel in channels:
        if channel.doubt:
            raise InputError(
                where=f"{where}, '{channel.name}'",
                found=channel.doubt,
                expected="times that go on in one way",
                remedy=f"say the order of days, --column '{TIME}={channel.name} [YMD]', or [DMY] "
                "or [MDY]",
            )
    if group.step_doubt:
        raise InputError(
            where=where,
            found=group.step_doubt,
            expected="one time between samples",
            remedy="say it, --sample-rate '200 Hz'",
        )
    if math.isfinite(group.step):
        said = f"every {group.step:g} s, as the file says"
        return Clock("", count * group.step, math.nan, "s", said, False, True)
    if clocks:
        return _going_on(next((c for c in clocks if _increases(c.times)), clocks[0]), where)
    raise _no_time(group, system, where)


def _refuse_contradiction(clocks: Sequence[Clock], where: str) -> None:
    """Refuse clocks of one recording of which one is so many times as fast as another."""
    for clock, other in combinations(clocks, 2):
        spans = [float(np.nanmax(c.times) - np.nanmin(c.times)) for c in (clock, other)]
        ratio = max(spans) / min(spans)
        if ratio > _FACTOR:
            raise InputError(
                where=where,
                found=f"'{clock.channel}' in [{clock.unit}] over {spans[0]:.6g} s, and "
                f"'{other.channel}' in [{other.unit}] over {spans[1]:.6g} s, {ratio:.4g} times "
                "apart",
                expected="clocks of one recording that agree",
                remedy=f"say which is right and in which unit, --column '{TIME}={other.channel}' "
                f"or --column '{TIME}={clock.channel} [UNIT]'",
            )


def _no_time(group: Group, system: System, where: str) -> InputError:
    """What a group has in place of times."""
    problem, name = f"no time among {listed([channel.name for channel in group.channels])}", "NAME"
    for channel in group.left:
        if is_time(channel.name):
            text = next(filter(None, channel.texts), "")
            return InputError(
                where=where,
                found=f"no time: '{channel.name}' holds texts such as '{text}', no date that is "
                "known",
                expected="dates, times of day, or a channel of seconds",
                remedy=f"say how they are written, --column '{TIME}={channel.name} "
                "[%d.%m.%Y %H:%M:%S]', or give --sample-rate '200 Hz'",
            )
    for channel in group.channels:
        if not channel.unit and is_time(channel.name):
            units = _unstated(channel.values, system)
            likely = f"likely in {' or in '.join(units)}" if units else "likely in none"
            problem, name = f"'{channel.name}' without a unit, {likely}", channel.name
    return InputError(
        where=where,
        found=problem,
        expected="a channel of times, or a known rate",
        remedy=f"name it, --column '{TIME}={name} [UNIT]', or give --sample-rate '200 Hz'",
    )


def _named(channel: FileChannel, named: NamedChannel, system: System, where: str) -> Clock:
    """The channel that the user says is the time, in the unit or the format that is said."""
    if channel.texts:
        return _named_stamps(channel, named.unit, where)
    # Durations are in seconds, whatever the name of their column says.
    own = channel.unit if channel.stamp else named.unit or channel.unit
    if not own and (since := _since(channel, system)) is not None:
        return since
    likely = [own] if own else _unstated(channel.values, system)
    unit = likely[0] if len(likely) == 1 else ""
    scale = conversion(unit, "s") if unit else None
    if scale is None:
        raise InputError(
            where=f"{where}, '{channel.name}'",
            found=f"times in [{unit}]" if unit else "times without a unit",
            expected="a unit of time",
            remedy=f"give it, --column '{TIME}={channel.name} [UNIT]'",
        )
    reason = "named" if own else f"named; {_concluded(unit)}"
    clock = _counting(channel, unit, scale.factor, reason)
    start = channel.start if math.isfinite(channel.start) else clock.start
    return replace(clock, start=start, certain=bool(own))


def _named_stamps(channel: FileChannel, unit: str, where: str) -> Clock:
    """Dates and times of day, as the user says that they are written."""
    how = unit if is_said(unit) else ""
    read = read_stamps(channel.name, channel.texts, how) if how else channel
    if read is not None and not read.doubt and np.isfinite(read.values).any():
        return replace(_stamped(read), stated=how)
    text = next(filter(None, channel.texts), "")
    none = f"which are none of [{how}]" if how else "no date that is known"
    raise InputError(
        where=f"{where}, '{channel.name}'",
        found=read.doubt if read is not None and read.doubt else f"texts such as '{text}', {none}",
        expected="dates or times of day",
        remedy=f"say how they are written, --column '{TIME}={channel.name} [DMY]', or [MDY], "
        "[YMD], [%d.%m.%Y %H:%M:%S]",
    )


def _stamped(channel: FileChannel) -> Clock:
    return Clock(
        channel=channel.name,
        times=channel.values,
        start=channel.start,
        unit="s",
        reason="; ".join(("time stamps", *channel.corrections)),
        certain=True,
        corrections=channel.corrections,
        zoned=channel.zoned,
    )


def _candidate(channel: FileChannel, group: Group, system: System) -> Clock | None:
    """A channel that may be the time, by its name, its unit and its place."""
    if channel.stamp:
        return None if channel.doubt else _stamped(channel)
    scale = conversion(channel.unit, "s") if channel.unit else None
    if scale is not None and (is_time(channel.name) or channel is group.channels[0]):
        return _counting(channel, channel.unit, scale.factor, "name and unit")
    if not channel.unit and is_time(channel.name):
        if (since := _since(channel, system)) is not None:
            return since
        likely = _unstated(channel.values, system)
        scale = conversion(likely[0], "s") if len(likely) == 1 else None
        if scale is not None:
            clock = _counting(channel, likely[0], scale.factor, _concluded(likely[0]))
            return replace(clock, certain=False)
    return None


def _counting(channel: FileChannel, unit: str, factor: float, reason: str) -> Clock:
    """Times that are numbers; a counter that goes round goes on."""
    values, words = _unwrapped(channel.values)
    start = math.nan
    first = next((float(value) for value in values if math.isfinite(value)), math.nan)
    if _UNIX[0] <= first * factor <= _UNIX[1] and is_time(channel.name):
        values, start = values - first, first * factor
    with np.errstate(over="ignore"):  # what no clock counts
        times = factor * values
    return Clock(
        channel=channel.name,
        times=times,
        start=start,
        unit=unit,
        reason="; ".join((reason, *words)),
        certain=True,
        corrections=words,
        zoned=math.isfinite(start),
    )


def _unwrapped(values: Vector) -> tuple[Vector, tuple[str, ...]]:
    """A counter that goes on where it went round; and that it was, in words."""
    known = np.flatnonzero(np.isfinite(values))
    steps = np.diff(values[known])
    back, ahead = np.flatnonzero(steps < 0.0), steps[steps > 0.0]
    if not back.size or back.size > 0.5 * steps.size:
        return values, ()
    usual = float(np.median(ahead))
    fitting = [
        period
        for period in _ROUNDS
        if period > 2.0 * usual and (np.abs(steps[back] + period - usual) <= 0.5 * usual).all()
    ]
    if len(fitting) != 1:
        return values, ()
    rounds = np.zeros(known.size)
    rounds[back + 1] = fitting[0]
    whole = values.copy()
    whole[known] += np.cumsum(rounds)
    times = "once" if back.size == 1 else f"{back.size} times"
    return whole, (f"the counter goes round at {fitting[0]:.10g}, {times}",)


def _since(channel: FileChannel, system: System) -> Clock | None:
    """Numbers without a unit that count from a date: since 1970, or days of a spreadsheet.

    None where samples would be a thousand times as far apart as those of usual recordings.
    """
    held = channel.values[np.isfinite(channel.values)]
    if held.size < 2:
        return None
    clock = None
    for unit, factor in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if _UNIX[0] <= held.min() * factor and held.max() * factor <= _UNIX[1]:
            clock = _counting(channel, unit, factor, f"{unit} since 1970")
    likely = _unstated(channel.values, system)
    for name, (zero, least, most) in _DAYS.items():
        whole = bool((held == np.round(held)).all())
        if least <= held.min() and held.max() <= most and not whole and "s" not in likely:
            # Doubles hold such days to microseconds; files mostly to a tenth of a second.
            times = np.round((channel.values - held[0]) * 86400.0, 6)
            start = (float(held[0]) - zero) * 86400.0
            clock = Clock(channel.name, times, start, "d", f"days as {name} counts them", True)
    if clock is None:
        return None
    steps = np.abs(np.diff(clock.times[np.isfinite(clock.times)]))
    ratio = float(np.median(steps)) / system.sample_time
    return clock if 1.0 / _LIKE < ratio < _LIKE else None


def _concluded(unit: str) -> str:
    return f"no unit in the file; in {unit} it is sampled as is usual"


def _unstated(values: Vector, system: System) -> list[str]:
    """The units in which times step as those of usual recordings."""
    steps = np.diff(values[np.isfinite(values)])
    usual = float(np.median(steps)) if steps.size else 0.0
    scales = {unit: conversion(unit, "s") for unit in _UNSTATED}
    ratios = {u: usual * s.factor / system.sample_time for u, s in scales.items() if s}
    return [unit for unit, ratio in ratios.items() if 1.0 / _LIKE < ratio < _LIKE]


def _increases(times: Vector) -> bool:
    held = times[np.isfinite(times)]
    return held.size > 1 and bool((np.diff(held) > 0).all())


def _going_on(clock: Clock, where: str) -> Clock:
    """The clock, if it goes on from sample to sample.

    Raises
    ------
    InputError
        If it repeats itself, or goes back.
    """
    if _increases(clock.times):
        return clock
    held = clock.times[np.isfinite(clock.times)]
    late = int(np.argmin(np.diff(held) > 0)) if held.size > 1 else -1
    fault = f"{held[late + 1]:.9g} s after {held[late]:.9g} s" if late >= 0 else "no times"
    count = int((np.diff(held) <= 0).sum()) if held.size > 1 else 0
    raise InputError(
        where=f"{where}, '{clock.channel}'" if clock.channel else where,
        found=f"{fault} in sample {late + 2}" + (f", and {count - 1} more" if count > 1 else ""),
        expected="times that go on",
        remedy="if samples are evenly spaced say how, --sample-rate '200 Hz'; else export more "
        "digits",
    )
