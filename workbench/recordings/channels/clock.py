"""When the samples of a group were taken."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.recordings.channels.names import TIME, NamedChannel, is_time, listed, words
from workbench.recordings.formats import FileChannel, Group
from workbench.recordings.formats.spelling import conversion, spell_unit
from workbench.recordings.formats.stamps import MINUTES, goes_on, is_said, read_stamps, steps_of
from workbench.system.system import System

# Units of time that recorders leave out, and how far from those of usual recordings steps may be in
# the one that is meant. Where several are as likely, as seconds and minutes often are, none is.
_UNSTATED = ("ns", "us", "ms", "s", "min", "h", "d")
_LIKE = math.sqrt(1000.0)
# Counters that go round: bits in counts, ms or us of the unit; parts of a day, and a week.
_ROUNDS = tuple(
    sorted(
        {float(2**bits) * part for bits in (16, 24, 32) for part in (1.0, 1e-3, 1e-6)}
        | {
            float(seconds) * part
            for seconds in (60, 3600, 43200, 86400, 604800)
            for part in (1.0, 1e3, 1e6)
        }
        | {12.0, 24.0, 1440.0}
    )
)
_TURNS = 3  # of a counter to its first count, from which on they are no recordings begun anew
_UNIX = 8e8, 2.3e9  # [s] since 1970, that recordings are of: 1995 to 2042
# Counts from other dates: seconds from there to 1970, seconds of a count, and counts from 1995 on.
_EPOCHS = {
    "s since 1900, as NTP counts": (2208988800.0, 1.0),
    "s since 1904, as LabVIEW counts": (2082844800.0, 1.0),
    "100 ns since 1601, as Windows counts": (11644473600.0, 1e-7),
    "100 ns since the year 1, as .NET counts": (62135596800.0, 1e-7),
    "millionths of days since 1899, as WinCC counts": (2209161600.0, 0.0864),
}
_GPS = 315964800.0 - 18.0  # [s] from 1970 to the zero of GPS, less leap seconds since 2017
_WEEK = re.compile("(gps)?(week|wk|wn|weeknumber|weekno)|gwk")
_OF_WEEK = re.compile(
    "(gps|i)?(tow|sow|timeofweek|secondsofweek)(ms|s)?|gps(seconds|milliseconds|secs|ms|time(ms|s)?)|gms"
)
# Days: that of the year 1970, and what they count in recordings.
_DAYS = {
    "Excel": (25569.0, 30000.0, 50000.0),
    "modified Julian days": (40587.0, 50000.0, 66000.0),
    "MATLAB": (719529.0, 724000.0, 754000.0),
    "Julian days": (2440587.5, 2445000.0, 2475000.0),
}
_FROM_1904 = 1462 * 86400.0  # s that the other zero of workbooks is later: their option date1904
# Figures of dates and times, as of Unix' date: 1015, 101500, 240305101500, 202403051015.
_PACKED = ("%H%M", "%H%M%S", "%y%m%d%H%M", "%y%m%d%H%M%S", "%Y%m%d%H%M", "%Y%m%d%H%M%S")
_PACKED_MS = "%H%M%S%f"  # with three figures of milliseconds
_DAY = 86400.0  # s
_MIDNIGHT = 0.5  # of a day, by which times go back at its end
_UNITS_APART = (60.0, 3600.0, 86400.0, 1e3, 1e6, 1e9)
_DAYS_OF_YEAR = frozenset(("doy", "yday", "jday"))
_TWO_PARTS = re.compile(r"\d{1,4}:\d\d")
_FEWEST_RATES = 3  # of a channel, which are equal if it is a clock; one always is
_STEP_DIGITS = 6  # of a step beside the usual one that numbers of a file tell
_FEWEST_STEPS, _OFTEN = 4, 0.1  # of each size: fewer are samples that were lost
_SAME = 1e-3  # of a digit, which numbers in binary do not tell
_COARSE_DIGIT = 0.1  # of a step, below which digits of times cost nothing
_COARSE = 0.3  # of all rows: more that repeat a time are samples of one coarse stamp
_BY_CHANCE = 1e-3  # that a channel which moves from row to row stays in all rows of one time
_DRIFT = 1.01  # beyond which clocks differ by more than oscillators without a quartz do
_FACTOR = 1.5  # by which two clocks of one recording do not differ


@dataclass(frozen=True, eq=False)
class Clock:
    """Times of a group's samples."""

    channel: str  # name of the channel that holds them; empty: the file itself says them
    times: Vector  # (n,) s, NaN where there is none
    reason: str  # why these are the times, for people; `certain`: nothing was concluded
    start: float = math.nan  # of their zero [s since 1970], NaN where that is not known
    unit: str = "s"  # that the channel was read in
    certain: bool = True
    counted: bool = False  # whether samples are counted at a rate, and have no times of their own
    corrections: tuple[str, ...] = ()  # how they were made to go on, in words
    stated: str = ""  # how the user says that dates are to be read
    zoned: bool = False  # whether `start` is in UTC; else in some local time
    # when the recording began, where the times do not tell it but the file [s since 1970]
    dated: float = math.nan


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
    clock = _read_clock(group, named, step, system, where)
    if math.isfinite(clock.start):
        return clock
    beside = [c.start for c in group.channels if c.stamp and not c.doubt and math.isfinite(c.start)]
    if beside:
        return replace(clock, dated=beside[0])
    if not math.isfinite(group.begun):
        return clock
    shown = next((c.shown for c in group.channels if c.name == clock.channel), math.nan)
    day = group.begun - group.begun % _DAY
    # Times that begin at zero have gone since the begin.
    return replace(clock, dated=day + shown if shown > 0.0 else group.begun)


def _read_clock(
    group: Group, named: NamedChannel | None, step: float | None, system: System, where: str
) -> Clock:
    count = np.arange(group.channels[0].values.size, dtype=np.float64)
    if step is not None:
        return Clock("", count * step, f"every {step:g} s, as given", counted=True)
    if named is not None:
        own = (*group.channels, *group.left)
        channel_of_time = next((channel for channel in own if channel.name == named.channel), None)
        if channel_of_time is not None:
            clock = _candidate(channel_of_time, group, system) if not named.unit else None
            if clock is None or not clock.certain:
                clock = _named_clock(channel_of_time, named, system, where)
            return _going_on(clock, group, where)
    if group.time is not None:
        time, reason = group.time, "the file says it"
        own_clock = Clock("", time.values, reason, start=time.start, zoned=time.zoned)
        beside = [c for channel in group.channels if (c := _candidate(channel, group, system))]
        going = [clock for clock in beside if clock.certain and _goes_on(clock.times, group)]
        return _beside_others(_going_on(own_clock, group, where), going, where)
    if (weeks := _weeks_of_gps(group)) is not None:
        return _going_on(weeks, group, where)
    # Stamps are often coarser than a counted time beside them.
    channels = sorted(group.channels, key=lambda channel: channel.stamp)
    clocks = [clock for channel in channels if (clock := _candidate(channel, group, system))]
    if going := [clock for clock in clocks if clock.certain and _goes_on(clock.times, group)]:
        clock = _beside_others(_going_on(going[0], group, where), going[1:], where)
        return _beside_stated(clock, group.step, where)
    for channel in channels:
        if channel.doubt:
            raise InputError(
                where=f"{where}, '{channel.name}'",
                found=channel.doubt,
                expected="times that go on in one way",
                remedy=f"say the order of days, --column '{TIME}={channel.name} [YMD]', or [DMY] "
                "or [MDY]; where hours count to 12, export them to 24. Where parts of a second are "
                "in doubt, export as many digits of each, or say [%H:%M:%S.%f] of decimals. Or "
                "give --sample-rate '200 Hz'",
            )
    if group.step_doubt:
        raise InputError(
            where=where,
            found=group.step_doubt,
            expected="one time between samples",
            remedy="say it, --sample-rate '200 Hz'",
        )
    back = [c for c in clocks if c.certain and is_time(c.channel) and not goes_on(c.times)]
    if back:  # segments, between which a stated rate knows no gap
        return _going_on(back[0], group, where)
    if math.isfinite(group.step):
        reason = f"every {group.step:g} s, as the file says"
        return Clock("", count * group.step, reason, certain=False, counted=True)
    if clocks:
        first = next((c for c in clocks if _goes_on(c.times, group)), clocks[0])
        return _going_on(first, group, where)
    raise _no_time(group, system, where)


def _beside_others(clock: Clock, others: Sequence[Clock], where: str) -> Clock:
    """The clock, with what others of its recording say that differs; refuses other units."""
    corrections = list(clock.corrections)
    for first, second in combinations((clock, *others), 2):
        spans = [float(np.nanmax(c.times) - np.nanmin(c.times)) for c in (first, second)]
        ratio = max(spans) / min(spans)
        names = [f"'{c.channel}'" if c.channel else "times of the file" for c in (first, second)]
        rate = f"or --sample-rate '{(first.times.size - 1) / spans[0]:.6g} Hz'"
        statement = (
            f"{names[0]} in [{first.unit}] over {spans[0]:.6g} s, and {names[1]} in "
            f"[{second.unit}] over {spans[1]:.6g} s"
        )
        if ratio > _FACTOR:
            raise InputError(
                where=where,
                found=f"{statement}, {ratio:.4g} times apart",
                expected="clocks of one recording that agree",
                remedy=f"say which is right and in which unit, --column '{TIME}={second.channel}' "
                + (f"or --column '{TIME}={first.channel} [UNIT]'" if first.channel else rate),
            )
        apart = abs(spans[0] - spans[1])
        if first is clock and ratio > _DRIFT and apart > 2.0 * max(map(_tick, (first, second))):
            corrections.append(
                f"{statement}; {names[0]} is taken, --column '{TIME}={second.channel}' takes "
                "the other"
            )
    return replace(clock, corrections=tuple(corrections))


def _tick(clock: Clock) -> float:
    """What a clock counts by: its shortest step [s]."""
    steps = steps_of(clock.times)
    return float(steps[steps > 0.0].min(initial=math.inf))


def _beside_stated(clock: Clock, step: float, where: str) -> Clock:
    """The clock, with what a file states of its steps where that is another one."""
    steps = steps_of(clock.times)
    usual = float(np.median(steps[steps > 0.0]))  # rows of one time have other channels
    ratio = max(usual, step) / min(usual, step)
    if not ratio > _FACTOR:
        return clock
    statement = f"times every {usual:.6g} s, and the file states a sample every {step:.6g} s"
    if any(abs(ratio / factor - 1.0) < 0.02 for factor in _UNITS_APART):
        raise InputError(
            where=f"{where}, '{clock.channel}'",
            found=f"{statement}, {ratio:.4g} times apart",
            expected="one time between samples",
            remedy=f"say which is right, --column '{TIME}={clock.channel} [UNIT]', or "
            f"--sample-rate '{1.0 / step:.6g} Hz'",
        )
    return replace(clock, corrections=(*clock.corrections, f"{statement}; the times are taken"))


def _no_time(group: Group, system: System, where: str) -> InputError:
    """What a group has in place of times."""
    problem, name = f"no time among {listed([channel.name for channel in group.channels])}", "NAME"
    for channel in group.left:
        if is_time(channel.name):
            text = next(filter(None, channel.texts), "")
            if not text:
                continue
            return InputError(
                where=where,
                found=f"no time: '{channel.name}' holds texts such as '{text}', no date that is "
                "known",
                expected="dates, times of day, or a channel of seconds",
                remedy=f"say how they are written, --column '{TIME}={channel.name} "
                "[%d.%m.%Y %H:%M:%S]', or give --sample-rate '200 Hz'",
            )
    for channel in group.channels:
        if is_time(channel.name) and channel.unit and conversion(channel.unit, "s") is None:
            problem, name = f"'{channel.name}' in [{channel.unit}], no unit of time", channel.name
        named = is_time(channel.name) or {"year", "years", "jahr"}.intersection(words(channel.name))
        if not channel.unit and named and _counts_years(channel.values):
            return InputError(
                where=where,
                found=f"'{channel.name}' from {channel.values[0]:.6f} on, which may be years with "
                "decimals, of 365, 366 or 365.25 days",
                expected="dates, times of day, or a channel of seconds",
                remedy="export dates, or give --sample-rate '200 Hz'; if they have a unit of their "
                f"own, say it, --column '{TIME}={channel.name} [UNIT]'",
            )
        if not channel.unit and is_time(channel.name):
            units = _likely_units(channel.values, system)
            likely = f"likely in {' or in '.join(units)}" if units else "likely in none"
            problem, name = f"'{channel.name}' without a unit, {likely}", channel.name
    return InputError(
        where=where,
        found=problem,
        expected="a channel of times, or a known rate",
        remedy=f"name it, --column '{TIME}={name} [UNIT]', or give --sample-rate '200 Hz'",
    )


def _named_clock(channel: FileChannel, named: NamedChannel, system: System, where: str) -> Clock:
    """The channel that the user says is the time, in the unit or the format that is said."""
    if channel.texts:
        return _named_stamps(channel, named.unit, system, where)
    # Durations are in seconds, whatever the name of their column says.
    own = channel.unit if channel.stamp else named.unit or channel.unit
    if not own and (since := _since(channel, system)) is not None:
        return since
    likely = [own] if own else _likely_units(channel.values, system)
    unit = likely[0] if len(likely) == 1 else ""
    scale = conversion(unit, "s") if unit else None
    if scale is None:
        raise InputError(
            where=f"{where}, '{channel.name}'",
            found=f"times in [{unit}]" if unit else "times without a unit",
            expected="a unit of time",
            remedy=f"give it, --column '{TIME}={channel.name} [UNIT]'",
        )
    reason = "named" if own else f"named; {_unit_reason(unit)}"
    clock = _count_clock(channel, unit, scale.factor, reason)
    start = channel.start if math.isfinite(channel.start) else clock.start
    return replace(clock, start=start, certain=bool(own))


def _named_stamps(channel: FileChannel, unit: str, system: System, where: str) -> Clock:
    """Dates and times of day, as the user says that they are written."""
    how = unit if is_said(unit) else ""
    read = read_stamps(channel.name, channel.texts, how) if how else channel
    if read is not None and not read.doubt and np.isfinite(read.values).any():
        clock = replace(_stamp_clock(read), stated=how)
        return clock if how else _minutes_or_hours(clock, channel, system)
    text = next(filter(None, channel.texts), "")
    none = f"which are none of [{how}]" if how else "no date that is known"
    raise InputError(
        where=f"{where}, '{channel.name}'",
        found=read.doubt if read is not None and read.doubt else f"texts such as '{text}', {none}",
        expected="dates or times of day",
        remedy=f"say how they are written, --column '{TIME}={channel.name} [DMY]', or [MDY], "
        "[YMD], [%d.%m.%Y %H:%M:%S]",
    )


def _stamp_clock(channel: FileChannel) -> Clock:
    return Clock(
        channel=channel.name,
        times=channel.values,
        start=channel.start,
        reason="; ".join(("time stamps", *channel.corrections)),
        corrections=channel.corrections,
        zoned=channel.zoned,
    )


def _candidate(channel: FileChannel, group: Group, system: System) -> Clock | None:
    """A channel that may be the time, by its name, its unit and its place."""
    if channel.stamp:
        return None if channel.doubt else _minutes_or_hours(_stamp_clock(channel), channel, system)
    scale = conversion(channel.unit, "s") if channel.unit else None
    days = channel.unit == "d" and is_time(channel.name)
    if days and (since := _since(channel, system)) is not None:
        return since
    if scale is not None and (is_time(channel.name) or channel is group.channels[0]):
        return _count_clock(channel, channel.unit, scale.factor, "name and unit")
    if not channel.unit and is_time(channel.name) and not _counts_years(channel.values):
        *before, last = words(channel.name)
        # elapsed_ms; but Time - h beside Amplitude - h is of a signal h
        own = last in system.signals and any(
            words(c.name)[-1:] == (last,) for c in group.channels if c is not channel
        )
        last = spell_unit(last)
        scale = conversion(last, "s") if before and not own else None
        since = None if last in _likely_units(channel.values, system) else _since(channel, system)
        if scale is not None and since is None:
            return _count_clock(channel, last, scale.factor, "name and unit")
        if (since := _since(channel, system)) is not None:
            return since
        if (packed := _packed_clock(channel)) is not None:
            return packed
        likely = _likely_units(channel.values, system)
        scale = conversion(likely[0], "s") if len(likely) == 1 else None
        if scale is not None:
            clock = _count_clock(channel, likely[0], scale.factor, _unit_reason(likely[0]))
            return replace(clock, certain=False)
    return None


def _counts_years(values: Vector) -> bool:
    """Whether numbers may be years with their decimals, such as 2026.912."""
    held = values[np.isfinite(values)]
    whole = bool((held % 1.0 == 0.0).all())
    return not whole and bool(((held > 1900.0) & (held < 2100.0)).all())


def _minutes_or_hours(clock: Clock, channel: FileChannel, system: System) -> Clock:
    """Times such as 10:15 in hours and minutes, or in minutes and seconds if that is more usual."""
    texts = [text for text in channel.texts if text]
    if not texts or not all(map(_TWO_PARTS.fullmatch, texts)):
        return clock
    other = read_stamps(channel.name, channel.texts, MINUTES)
    steps = steps_of(clock.times)
    usual = float(np.median(steps)) if steps.size else math.nan
    # Sixty times as far apart: the reading that is nearer to usual steps.
    if other is None or not usual / system.sample_time > math.sqrt(60.0):
        return clock
    reason = f"minutes and seconds, as samples are {usual / 60.0:.4g} s apart then"
    return replace(
        _stamp_clock(other), certain=False, reason=reason, unit=MINUTES, channel=channel.name
    )


def _packed_clock(channel: FileChannel) -> Clock | None:
    """Times in figures such as 101500, where they go on evenly as such, and not as numbers."""
    held = channel.values[np.isfinite(channel.values)]
    if held.size < 3 or (held < 0.0).any() or (held >= 1e14).any():
        return None
    whole, parts = np.floor(channel.values), channel.values % 1.0
    known = np.isfinite(channel.values)
    uneven = _unevenness(held)
    for form in (*_PACKED, _PACKED_MS):
        digits = {"%H%M": 4, "%H%M%S": 6, _PACKED_MS: 9}.get(
            form, 2 * len(form) // 2 + ("%Y" in form) * 2
        )
        if held.max() >= 10.0**digits or ("%d" in form and held.min() < 10.0 ** (digits - 2)):
            continue
        try:
            moments = [datetime.strptime(f"{int(v):0{digits}d}", form) for v in whole[known]]
        except ValueError:
            continue
        times = np.full(channel.values.size, math.nan)
        seconds = np.array([(moment - moments[0]).total_seconds() for moment in moments])
        alone = "%d" not in form
        if alone:
            seconds += _DAY * np.concatenate(
                [[0.0], np.cumsum(np.diff(seconds) < -_MIDNIGHT * _DAY)]
            )
        times[known] = seconds + (parts[known] - parts[known][0])
        if not _increases(times) or _unevenness(times[known]) >= uneven:
            continue
        start = math.nan if alone else (moments[0] - datetime(1970, 1, 1)).total_seconds()
        name = re.sub("%", "", form)
        return Clock(channel.name, times, f"figures of time, {name}", start=start)
    return None


def _unevenness(times: Vector) -> float:
    """How far the longest step is above the usual one; infinite where one goes back."""
    steps = np.diff(times)
    return math.inf if (steps <= 0.0).any() else float(steps.max() / np.median(steps))


def _count_clock(channel: FileChannel, unit: str, factor: float, reason: str) -> Clock:
    """Times that are numbers; a counter that goes round goes on."""
    values, rounds = _unwrap(channel.values)
    start = channel.start
    first = next((float(value) for value in values if math.isfinite(value)), math.nan)
    if math.isfinite(start):
        pass  # the file says from when times count
    elif _UNIX[0] <= first * factor <= _UNIX[1] and is_time(channel.name):
        values, start = values - first, first * factor
        if "gps" in words(channel.name):
            start, reason = start + _GPS, f"{unit} of GPS"
    with np.errstate(over="ignore"):  # what no clock counts
        times = factor * values
    return Clock(
        channel=channel.name,
        times=times,
        start=start,
        unit=unit,
        reason="; ".join((reason, *rounds)),
        corrections=rounds,
        zoned=channel.zoned or (math.isfinite(start) and not math.isfinite(channel.start)),
    )


def _unwrap(values: Vector) -> tuple[Vector, tuple[str, ...]]:
    """A counter that goes on where it went round; and that it was, in words."""
    known = np.flatnonzero(np.isfinite(values))
    steps = np.diff(values[known])
    back, ahead = np.flatnonzero(steps < 0.0), steps[steps > 0.0]
    if not back.size or back.size > 0.5 * steps.size:
        return values, ()
    # Once or twice back to the very first count, it is as likely that of another recording.
    if back.size < _TURNS and (values[known[back + 1]] == values[known[0]]).all():
        return values, ()
    usual = float(np.median(ahead))
    residual = {
        period: float(np.abs(steps[back] + period - usual).max()) / usual
        for period in _ROUNDS
        if period > 2.0 * usual
    }
    best, *others = sorted(residual, key=lambda period: residual[period])[:2] or [math.nan]
    # Of periods that are near each other, one must fit clearly better.
    rival = min((residual[period] for period in others), default=math.inf)
    if not residual.get(best, math.inf) <= 0.5 or rival <= max(2.0 * residual[best], 0.05):
        return values, ()
    rounds = np.zeros(known.size)
    rounds[back + 1] = best
    whole = values.copy()
    whole[known] += np.cumsum(rounds)
    times = "once" if back.size == 1 else f"{back.size} times"
    return whole, (f"the counter goes round at {best:.10g}, {times}",)


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
            clock = _count_clock(channel, unit, factor, f"{unit} since 1970")
    for reason, (zero, factor) in _EPOCHS.items():
        if _UNIX[0] <= held.min() * factor - zero and held.max() * factor - zero <= _UNIX[1]:
            times = (channel.values - held[0]) * factor
            start = float(held[0]) * factor - zero
            if clock and ("ntp" in words(channel.name) or start > datetime.now(UTC).timestamp()):
                continue
            counted = "seconds are counted from 1904, as LabVIEW does", "NTP, from 1900,"
            other = _other_zero(start, clock.start, *counted) if clock else ()
            clock = Clock(channel.name, times, reason, start=start, corrections=other)
    likely = _likely_units(channel.values, system)
    for name, (zero, least, most) in _DAYS.items():
        whole = bool((held == np.round(held)).all())
        if least <= held.min() and held.max() <= most and not whole and "s" not in likely:
            # Doubles hold such days to microseconds; files mostly to a tenth of a second.
            times = np.round((channel.values - held[0]) * _DAY, 6)
            start = round((float(held[0]) - zero) * _DAY, 3)
            reason = f"days as {name} counts them" if name in ("Excel", "MATLAB") else name
            counted = "days are counted from 1900", "a workbook that counts from 1904"
            other = _other_zero(start, start + _FROM_1904, *counted) if name == "Excel" else ()
            clock = Clock(channel.name, times, reason, start=start, unit="d", corrections=other)
    if _DAYS_OF_YEAR.intersection(words(channel.name)) and held.max() <= 367.0:
        clock = Clock(channel.name, channel.values * _DAY, "days of a year", unit="d")
    if clock is None:
        return None
    steps = np.abs(steps_of(clock.times))
    ratio = float(np.median(steps)) / system.sample_time
    return clock if 1.0 / _LIKE < ratio < _LIKE else None


def usual_step(channel: FileChannel) -> float:
    """Median step of times that are numbers [s], by their unit, or by the date that they count to.

    NaN where there are too few of them. Numbers that nothing tells are taken as seconds.
    """
    held = channel.values[np.isfinite(channel.values)]
    if held.size < 3:
        return math.nan
    own_unit = channel.unit or (spell_unit(words(channel.name)[-1]) if channel.name else "")
    scale = conversion(own_unit, "s") if channel.unit or len(words(channel.name)) > 1 else None
    counts = [(0.0, 10.0**-k) for k in (0, 3, 6, 9)] + [*_EPOCHS.values()]
    counts += [(zero * _DAY, _DAY) for zero, _, _ in _DAYS.values()]
    dated = (
        factor
        for zero, factor in counts
        if _UNIX[0] <= held.min() * factor - zero and held.max() * factor - zero <= _UNIX[1]
    )
    factor = scale.factor if scale else next(dated, 1.0)
    return factor * float(np.median(np.abs(np.diff(held))))


def _weeks_of_gps(group: Group) -> Clock | None:
    """Times by the number of a week and what has gone of it, as receivers of satellites count."""
    named = {"".join(words(channel.name)): channel for channel in group.channels}
    week = next((named[name] for name in named if _WEEK.fullmatch(name)), None)
    within = next((named[name] for name in named if _OF_WEEK.fullmatch(name)), None)
    if week is None or within is None:
        return None
    parts = conversion(within.unit, "s") if within.unit else None
    largest = float(np.nanmax(within.values, initial=0.0))
    factor = parts.factor if parts else 1.0 if largest <= 7.0 * _DAY else 1e-3
    times = 7.0 * _DAY * (week.values - week.values[0]) + factor * within.values
    # Receivers that count to 1023 weeks do not tell the date.
    first = float(week.values[0])
    start = 7.0 * _DAY * first + _GPS if first >= 1024.0 else math.nan
    reason = f"weeks of GPS, with {within.name}"
    unit = within.unit if parts else "s" if factor == 1.0 else "ms"
    return Clock(within.name, times, reason, start=start, unit=unit, zoned=True)


def _other_zero(start: float, other: float, counted: str, called: str) -> tuple[str, ...]:
    """That times may count from another date, where they are not of tomorrow then."""
    first, second = (datetime.fromtimestamp(day, UTC) for day in (start, other))
    if second > datetime.now(UTC):
        return ()
    return (
        f"{counted}, the first is {first:%Y-%m-%d}; {called} means {second:%Y-%m-%d}. Times are "
        "the same, correct 'date' in case.toml if it is so",
    )


def _unit_reason(unit: str) -> str:
    return f"no unit in the file; in {unit} it is sampled as is usual"


def _likely_units(values: Vector, system: System) -> list[str]:
    """The units in which times step as those of usual recordings."""
    steps = steps_of(values)
    steps = steps[steps != 0.0]
    usual = float(np.median(steps)) if steps.size else 0.0
    scales = {unit: conversion(unit, "s") for unit in _UNSTATED}
    ratios = {u: usual * s.factor / system.sample_time for u, s in scales.items() if s}
    return [unit for unit, ratio in ratios.items() if 1.0 / _LIKE < ratio < _LIKE]


def _increases(times: Vector) -> bool:
    held = times[np.isfinite(times)]
    return held.size > 1 and bool((np.diff(held) > 0).all())


def _goes_on(times: Vector, group: Group) -> bool:
    """Whether times go on, but for rows of one time that hold one sample, or an event."""
    return _increases(times) or _rows_of_one_time(times, group) > 0


def _as_even(clock: Clock) -> Clock:
    """The clock with even times, where its own are these in few digits: 0, 0.02, 0.03, 0.05 min.

    All times are then within half a digit of a line.
    """
    known = np.flatnonzero(np.isfinite(clock.times))
    times, places = clock.times[known], np.arange(known.size)
    digit = _digit(times)
    if not digit:
        return clock
    for step in _round_steps(float(np.polyfit(places, times - times[0], 1)[0])):
        apart = times - times[0] - step * places
        # Half a digit around all times; within, the first stays where it is.
        least, most = float(apart.max()) - 0.5 * digit, float(apart.min()) + 0.5 * digit
        if least <= most + _SAME * digit and digit > _COARSE_DIGIT * step:
            even = clock.times.copy()
            even[known] = times[0] + min(max(least, 0.0), most) + step * places
            note = f"times have digits of {digit:.4g} s; taken as even, every {step:.6g} s"
            return replace(clock, times=even, corrections=(*clock.corrections, note))
    return clock


def _digit(times: Vector) -> float:
    """The digit to which times are rounded [s], by which its steps of two sizes differ; or 0."""
    usual = float(np.median(np.diff(times)))
    steps = np.round(np.diff(times) / usual, _STEP_DIGITS)
    sizes, counts = np.unique(steps, return_counts=True)
    often = counts.min() >= max(_FEWEST_STEPS, _OFTEN * steps.size)
    return float(np.ptp(sizes)) * usual if sizes.size == 2 and often else 0.0


def _round_steps(step: float) -> Iterator[float]:
    """A step, or a rate, in figures that become more: the roundest is first."""
    for figures in range(1, _STEP_DIGITS):
        yield float(f"{step:.{figures}g}")
        yield 1.0 / float(f"{1.0 / step:.{figures}g}")


def _rows_of_one_time(times: Vector, group: Group) -> int:
    """How many rows have the time of the row before, where all of them may have it; else 0.

    Loggers write channels of several rates into rows of their own, or a row twice. Simulations
    write a row before an event and one after it: what moves between all other rows stays there.
    If all channels move between rows of one time, the stamps are coarser than the samples.
    """
    rows = np.flatnonzero(np.isfinite(times))
    steps = np.diff(times[rows])
    again = steps == 0.0
    if not again.any() or again.all() or (steps < 0.0).any():
        return 0
    jumps, chance = np.zeros(steps.size, dtype=bool), 1.0
    for channel in group.channels:
        values = channel.values[rows]
        moves = np.diff(values)
        within, between = (moves[mask & np.isfinite(moves)] for mask in (again, ~again))
        if not within.size or not between.size or _is_clock(channel, moves, steps):
            continue
        jumps |= again & np.isfinite(moves) & (moves != 0.0)
        if not within.any():
            chance = min(chance, float((between == 0.0).mean()) ** within.size)
    event = again.mean() < _COARSE and chance < _BY_CHANCE
    return int(again.sum()) if event or not jumps.any() else 0


def _is_clock(channel: FileChannel, moves: Vector, steps: Vector) -> bool:
    """Whether a channel moves as the times do, or counts parts of them."""
    if channel.stamp or is_time(channel.name):
        return True
    known = np.isfinite(moves) & (steps > 0.0)
    rates = moves[known] / steps[known]
    usual = float(np.median(rates)) if rates.size >= _FEWEST_RATES else 0.0
    return usual != 0.0 and float(np.isclose(rates, usual, rtol=1e-3).mean()) > 0.9


def _holds_values(group: Group, clock: Clock) -> NDArray[np.bool_]:
    """Whether samples, (n,), have a number in a channel beside the times."""
    held = np.zeros(clock.times.size, np.bool_)
    for channel in group.channels:
        if not channel.stamp and channel.name != clock.channel and channel.values.size == held.size:
            held |= np.isfinite(channel.values)
    return held


def _going_on(clock: Clock, group: Group, where: str) -> Clock:
    """The clock, if it goes on from sample to sample; samples without a time are told."""
    lost = np.flatnonzero(~np.isfinite(clock.times) & _holds_values(group, clock))
    if lost.size:
        note = f"{lost.size} samples without a time are left out, the first is sample {lost[0] + 1}"
        clock = replace(clock, corrections=(*clock.corrections, note))
    if _increases(clock.times):
        return clock if clock.counted else _as_even(clock)
    if again := _rows_of_one_time(clock.times, group):
        note = f"{again} rows have the time of the row before; of one time, the last value is kept"
        return replace(clock, reason=f"{clock.reason}; {note}")
    held = clock.times[np.isfinite(clock.times)]
    late = int(np.argmin(np.diff(held) > 0)) if held.size > 1 else -1
    fault = f"{held[late + 1]:.9g} s after {held[late]:.9g} s" if late >= 0 else "no times"
    count = int((np.diff(held) <= 0).sum()) if held.size > 1 else 0
    fault += f" in sample {late + 2}" + (f", and {count - 1} more" if count > 1 else "")
    remedy = (
        "if samples are evenly spaced say how, --sample-rate '200 Hz'; else export more digits, "
        "and results of a simulation without rows at its events"
    )
    if held.size > 1 and (np.diff(held) < 0).all():
        fault += ": the newest sample stands first"
        remedy = "sort the rows by their time"
    elif held.size > 1 and (held[1:][np.diff(held) <= 0] <= held[0]).all() and held[0] < held[-1]:
        fault += ": times begin anew"
        remedy = f"part the file before sample {late + 2}, where another recording begins"
    elif held.size > 1 and count < 0.1 * held.size and (np.diff(held) < 0).any():
        remedy = "sort the rows by their time if they were mixed, or part the file there"
        if np.unique(held).size < held.size:
            remedy = "delete rows that stand there twice, or part the file there"
    elif held.size > 1 and count >= _COARSE * held.size and not (np.diff(held) < 0).any():
        fault += ": stamps are coarser than samples"
        # From the first sample of one stamp to that of another: both ends may be cut.
        first = np.flatnonzero(np.diff(held) > 0) + 1
        about = ""
        if first.size > 1:
            rate = (first[-1] - first[0]) / (held[first[-1]] - held[first[0]])
            about = f", about --sample-rate '{rate:.4g} Hz'"
        remedy = (
            f"say the rate{about}, or export more digits, and results of a simulation without rows "
            "at its events"
        )
    raise InputError(
        where=f"{where}, '{clock.channel}'" if clock.channel else where,
        found=fault,
        expected="times that go on",
        remedy=remedy,
    )
