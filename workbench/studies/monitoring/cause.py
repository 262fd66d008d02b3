"""The cause of a change: a diagnosis of recordings after it, of a machine known from those before.

What tolerances leave open between machines, the recordings before the change have told of this one:
its levels are theirs, as sure as their scatter makes them. What differs from them needs a cause.
"""

from collections.abc import Mapping
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
    """The system with levels of this machine, as recordings before the first change told them.

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
        told = np.isfinite(values)
        if level is None or nominal is None or told.sum() < 2:
            continue
        weight = 1.0 / deviations[told] ** 2
        mean = float(weight @ values[told] / weight.sum())
        known = float(np.sqrt(track.scatter / weight.sum()))
        if track.against:  # the mean of the others is not that of all
            share = 1.0 - 1.0 / _alike(result, track.name)
            mean, known = nominal + share * mean, share * known
        given[track.name] = mean
        # From one recording to the next it scatters on, in those after the change as well.
        known = float(np.hypot(known, np.median(deviations[told]) * np.sqrt(track.scatter / _MOST)))
        levels[track.name] = replace(level, spread=min(level.spread, known / abs(mean)))
    return _with_levels(result.system, given, levels)


def _alike(result: MonitoringResult, name: str) -> int:
    """How many entries the array of a quantity has."""
    array = name.partition("[")[0]
    return sum(track.against and track.name.partition("[")[0] == array for track in result.tracks)


def _with_levels(system: System, given: Mapping[str, float], levels: Mapping[str, Level]) -> System:
    return replace(
        system,
        given={**system.given, **given},
        values={**system.values, **given},
        comparison=replace(system.comparison, levels=levels),
    )
