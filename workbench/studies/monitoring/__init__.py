"""Condition monitoring: what has changed on a machine, since when, over many recordings.

folder -> recordings that are new -> estimates -> state on the disk -> watch -> changes

The cause of a change is asked of a diagnosis of recordings after it, of a machine known from those
before. Tolerances leave open how a machine differs from others; the recordings before the change
show it: its levels are theirs, as sure as their scatter makes them. What differs from them needs a
cause.
"""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.recordings.case import Case, read_case
from workbench.runtime.engine import Engine, StepReporter
from workbench.runtime.pool import Pool
from workbench.runtime.resources import own_version
from workbench.studies.monitoring.estimate import RecordingEstimator, open_estimator, watched
from workbench.studies.monitoring.outcome import MonitoringResult as MonitoringResult
from workbench.studies.monitoring.outcome import conclude
from workbench.studies.monitoring.state import (
    RecordingFolder,
    RecordingResult,
    State,
    open_state,
    recording_folders,
)
from workbench.studies.monitoring.watch import Track as Track
from workbench.system.comparison import Level
from workbench.system.registry import open_model
from workbench.system.system import OBSERVER, System

RATE = 0.01
"""Alarms per recording of a healthy machine, all quantities together: one in a hundred stops."""
STATE = "state.sqlite"

Reader = Callable[[Path, System], Case]


def monitor(
    system: System,
    folder: Path,
    engine: Engine,
    *,
    rate: float = RATE,
    read: Reader = read_case,
) -> MonitoringResult:
    """Estimate the new recordings of a folder, and say what has changed in all of them.

    A recording that the state knows is not estimated again, one that is there twice counts once,
    one that cannot be used is listed with its reason. The order is that of dates.

    Parameters
    ----------
    folder : holds a folder for each recording of one machine.
    engine : whose folder takes the state, from which a run goes on.
    rate : alarms per recording that a sound machine may raise.
    read : makes a case of a folder; a function of a module.
    """
    if not watched(system):
        raise InputError(
            where=str(system.source),
            found="no estimated quantity that can be watched",
            expected="quantities in [estimated] that no condition sets",
            remedy="name some parameters of the model there, each with its 'correction'. That is "
            "an input of the model, 0 by default, which is added to the parameter",
        )
    with open_model(system, OBSERVER) as model:
        identity = {
            "workbench": own_version(),
            "system": hashlib.sha256(system.source.read_bytes()).hexdigest(),
            "model": model.sha256,
        }
    sizes = len(watched(system)), len(system.work)
    with open_state(engine.out / STATE, identity, sizes) as state:
        new = state.missing(recording_folders(folder))
        interrupted = _estimate(system, new, state, engine, read)
        results = state.all()
        if interrupted and not any(result.estimate for result in results):
            raise KeyboardInterrupt  # there is nothing to conclude from
        return conclude(system, results, rate, folder, interrupted=interrupted)


def _estimate(
    system: System, new: list[RecordingFolder], state: State, engine: Engine, read: Reader
) -> bool:
    """Estimate new recordings; returns whether Ctrl-C ended it. Estimates until then are kept."""
    if not new:
        return False
    progress = StepReporter(engine.report, len(new))
    with Pool(min(engine.workers, len(new)), open_estimator, system) as pool:
        try:
            results = pool.completed(partial(_estimate_folder, read), new)
            for number, result in results:
                state.add(result)
                progress.step(new[number].name)
        except KeyboardInterrupt:
            return True
    return False


def _estimate_folder(
    read: Reader, estimator: RecordingEstimator, recording: RecordingFolder
) -> RecordingResult:
    date, estimate, refusal, estimator.warned = "", None, "", ""
    try:
        case = read(recording.path, estimator.system)
        date, estimate = case.date, estimator(case)
    except InputError as error:
        refusal = str(error)
    except Exception as error:  # one recording must not cost the others; it is listed
        refusal = f"{recording.path}: found what no reader expects ({error!r})"
    warned = "" if refusal else estimator.warned
    return RecordingResult(recording.name, recording.content, date, estimate, refusal, warned)


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
