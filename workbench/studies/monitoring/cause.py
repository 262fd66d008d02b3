"""The cause of a change: a diagnosis of recordings after it, of a machine known from those before.

Tolerances leave open how a machine differs from others; the recordings before the change show it:
its levels are theirs, as sure as their scatter makes them. What differs from them needs a cause.
"""

from dataclasses import replace

import numpy as np

from workbench.studies.monitoring.outcome import MonitoringResult
from workbench.system.comparison import Level
from workbench.system.system import System

_MOST = 8  # recordings that are diagnosed: scatter from one to the next is small in their mean


def recordings_after(result: MonitoringResult) -> list[str]:
    """The last recordings, all of them after the last change, by name.

    After the range in which it may have been, where two are left then.
    """
    last = max((change for _, change in result.changes), key=lambda change: change.last)
    surely = result.names[last.latest + 1 :]
    return list((surely if len(surely) > 1 else result.names[last.last + 1 :])[-_MOST:])


def known_from_before(result: MonitoringResult) -> System:
    """The system with levels of this machine, as recordings before the first change show them.

    Of quantities that are alike, only what differs between them; what is common to all is left as
    it was.
    """
    first = min(change.last for _, change in result.changes)
    levels: dict[str, Level] = dict(result.system.comparison.levels)
    given: dict[str, float] = {}
    for track in result.tracks:
        level = levels.get(track.name)
        nominal = result.system.values.get(track.name)
        values, deviations = track.values[: first + 1], track.deviations[: first + 1]
        estimated = np.isfinite(values)
        if level is None or nominal is None or estimated.sum() < 2:
            continue
        weight = 1.0 / deviations[estimated] ** 2
        mean = float(weight @ values[estimated] / weight.sum())
        deviation = float(np.sqrt(track.scatter / weight.sum()))
        if track.against:  # the mean of the others is not that of all
            array = track.name.partition("[")[0]
            alike = sum(t.against and t.name.partition("[")[0] == array for t in result.tracks)
            share = 1.0 - 1.0 / alike
            mean, deviation = nominal + share * mean, share * deviation
        given[track.name] = mean
        # From one recording to the next it scatters on, in those after the change as well.
        usual = np.median(deviations[estimated]) * np.sqrt(track.scatter / _MOST)
        deviation = float(np.hypot(deviation, usual))
        levels[track.name] = replace(level, spread=min(level.spread, deviation / abs(mean)))
    return replace(
        result.system,
        given={**result.system.given, **given},
        values={**result.system.values, **given},
        comparison=replace(result.system.comparison, levels=levels),
    )
