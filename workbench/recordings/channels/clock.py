"""When the samples of a group were taken."""

import math
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.recordings.channels.names import TIME, NamedChannel, is_time, listed
from workbench.recordings.formats import FileChannel, Group
from workbench.recordings.formats.spelling import conversion
from workbench.system.system import System

# Units of time that recorders leave out, and how far from those of usual recordings steps may be in
# the one that is meant. Where several are as likely, as seconds and minutes often are, none is.
_UNSTATED = ("ns", "us", "ms", "s", "min", "h", "d")
_LIKE = math.sqrt(1000.0)


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
    """

    channel: str
    times: Vector
    start: float
    unit: str
    reason: str
    certain: bool
    counted: bool = False


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
        If there is no time, or none that goes on.
    """
    count = np.arange(group.channels[0].values.size, dtype=np.float64)
    if step is not None:
        return Clock("", count * step, math.nan, "s", f"every {step:g} s, as given", True, True)
    if named is not None:
        found = next((channel for channel in group.channels if channel.name == named.channel), None)
        if found is not None:
            return _going_on(_named(found, named, system, where), where)
    if group.time is not None:
        one = group.time
        return _going_on(Clock("", one.values, one.start, "s", "the file says it", True), where)
    # Stamps are often coarser than a counted time beside them.
    channels = sorted(group.channels, key=lambda channel: channel.stamp)
    clocks = [clock for channel in channels if (clock := _candidate(channel, group, system))]
    for clock in clocks:
        if clock.certain and _increases(clock.times):
            return clock
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


def _no_time(group: Group, system: System, where: str) -> InputError:
    """What a group has in place of times."""
    found, name = f"no time among {listed([channel.name for channel in group.channels])}", "NAME"
    for channel in group.channels:
        if not channel.unit and is_time(channel.name):
            units = _unstated(channel.values, system)
            likely = f"likely in {' or in '.join(units)}" if units else "likely in none"
            found, name = f"'{channel.name}' without a unit, {likely}", channel.name
    return InputError(
        where=where,
        found=found,
        expected="a channel of times, or a known rate",
        remedy=f"name it, --column '{TIME}={name} [UNIT]', or give --sample-rate '200 Hz'",
    )


def _named(channel: FileChannel, named: NamedChannel, system: System, where: str) -> Clock:
    # Stamps are in seconds, whatever the name of their column says.
    own = channel.unit if channel.stamp else named.unit or channel.unit
    likely = [own] if own else _unstated(channel.values, system)
    unit = likely[0] if len(likely) == 1 else ""
    found = conversion(unit, "s") if unit else None
    if found is None:
        raise InputError(
            where=f"{where}, '{channel.name}'",
            found=f"times in [{unit}]" if unit else "times without a unit",
            expected="a unit of time",
            remedy=f"give it, --column '{TIME}={channel.name} [UNIT]'",
        )
    times = found.factor * channel.values
    reason = "named" if own else f"named; {_concluded(unit)}"
    return Clock(channel.name, times, channel.start, unit, reason, bool(own))


def _candidate(channel: FileChannel, group: Group, system: System) -> Clock | None:
    """A channel that may be the time, by its name, its unit and its place."""
    if channel.stamp:
        return Clock(channel.name, channel.values, channel.start, "s", "time stamps", True)
    found = conversion(channel.unit, "s") if channel.unit else None
    if found is not None and (is_time(channel.name) or channel is group.channels[0]):
        times = found.factor * channel.values
        return Clock(channel.name, times, math.nan, channel.unit, "name and unit", True)
    if not channel.unit and is_time(channel.name):
        likely = _unstated(channel.values, system)
        scale = conversion(likely[0], "s") if len(likely) == 1 else None
        if scale is not None:
            times = scale.factor * channel.values
            return Clock(channel.name, times, math.nan, likely[0], _concluded(likely[0]), False)
    return None


def _concluded(unit: str) -> str:
    return f"no unit in the file; in {unit} it is sampled as is usual"


def _unstated(values: Vector, system: System) -> list[str]:
    """The units in which times step as those of usual recordings."""
    held = values[np.isfinite(values)]
    steps = np.diff(held)
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
    found = f"{held[late + 1]:.9g} s after {held[late]:.9g} s" if late >= 0 else "no times"
    count = int((np.diff(held) <= 0).sum()) if held.size > 1 else 0
    raise InputError(
        where=f"{where}, '{clock.channel}'" if clock.channel else where,
        found=f"{found} in sample {late + 2}" + (f", and {count - 1} more" if count > 1 else ""),
        expected="times that go on",
        remedy="if samples are evenly spaced say how, --sample-rate '200 Hz'; else export more "
        "digits",
    )
