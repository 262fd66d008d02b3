"""Condition monitoring: what has changed on a machine, since when, over many recordings.

folder -> recordings that are new -> estimates -> state on the disk -> watch -> changes
"""

import hashlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

from workbench.errors import InputError
from workbench.recordings.case import Case, read_case
from workbench.runtime.engine import Engine
from workbench.runtime.pool import Pool
from workbench.runtime.progress import StepReporter
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
            remedy="name some parameters of the model there, with corrections",
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
