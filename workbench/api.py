"""The workbench in a notebook: from a file to a figure in a few lines, each step a value.

import workbench as wb

system = wb.load_system("wheelset")
cases = wb.read_cases("my_recordings", system)
wb.observe(system, cases[0], "ekf").plot()
"""

import os
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from workbench import diagnosis, observers, recordings, tuning
from workbench.diagnosis import Outcome, laws
from workbench.diagnosis.laws import Proposal
from workbench.errors import InputError
from workbench.observers import Gains
from workbench.observers.replay import run_on_model
from workbench.observers.run import Run
from workbench.recordings.case import Case, check_recording, make_case, read_conditions
from workbench.recordings.channels import RecordingOptions, parse_named
from workbench.recordings.csv import header
from workbench.recordings.datasets import read_recorded, write_cases
from workbench.recordings.plausibility import Origin
from workbench.runtime.engine import Engine, silent
from workbench.runtime.files import locked_folder
from workbench.studies import design, monitoring
from workbench.studies.design import NextStop
from workbench.studies.distance import Distance, Effort, distance_of_stop
from workbench.studies.fit import FitSettings
from workbench.studies.fit import fit as fit_parameters
from workbench.studies.fit.outcome import FitOutcome
from workbench.studies.monitoring import RATE, MonitoringResult
from workbench.system.installed import usual_system
from workbench.system.parts import FittedParameter
from workbench.system.registry import load_system
from workbench.system.system import System
from workbench.system.tables import Table
from workbench.system.units import quantity, si_factor
from workbench.tuning import Lines, Plan, TuningResult, evaluators, pose

if TYPE_CHECKING:
    import pandas as pd


class Work(TypedDict, total=False):
    """With what something is worked out.

    Attributes
    ----------
    workers : processes, one per processor unless another number is given.
    report : takes a line on what is being done; prints it unless given.
    """

    workers: int | None
    report: Callable[[str], None]


class WrittenWork(Work, total=False):
    """Work that writes.

    Attributes
    ----------
    out : folder of what is written, such as an extended model; a temporary one unless given.
    """

    out: str | Path | None


class TuningWork(Work, total=False):
    """Work of `tune`.

    Attributes
    ----------
    generations : at most, 100.
    population : candidates per gain, 15.
    seed : of the search, 1.
    """

    generations: int
    population: int
    seed: int


def read_cases(
    path: str | Path | Sequence[str | Path],
    system: System | None = None,
    *,
    conditions: Mapping[str, Any] | None = None,
    columns: Mapping[str, str] | None = None,
    sample_rate: str | None = None,
) -> list[Case]:
    """Read case folders, folders of case folders, and log files.

    Parameters
    ----------
    system : that the recordings are of; unless given, the usual one, which comes with recordings.
    conditions : of files without a case.toml, as it has them, such as {"load": "2 kN"}.
    columns : channels of such files by signal, and by "time": {"time": "Zeit [ms]"}.
    sample_rate : of such files without times, "200 Hz".

    Raises
    ------
    InputError
        If a path holds no case, or a case cannot be read.

    Warns
    -----
    UserWarning
        Of what is unlikely in a recording; `Case.doubts` keeps it.
    """
    paths = [path] if isinstance(path, str | Path) else path
    known = system or load_system(usual_system())
    named = [f"{signal}={channel}" for signal, channel in (columns or {}).items()]
    options = RecordingOptions(
        conditions or {},
        dict(parse_named(column, "columns", known.signals) for column in named),
        None if sample_rate is None else 1.0 / quantity(sample_rate, "Hz", "sample_rate"),
    )
    cases = recordings.case.read_cases([Path(path) for path in paths], known, options)
    _warn(cases)
    return cases


def prepare_cases(which: str, source: str | Path, out: str | Path) -> tuple[list[Case], list[Case]]:
    """Turn a folder of published recordings into case folders, and read them.

    Parameters
    ----------
    which : name of a system whose recordings were published.
    source : folder that holds them.
    out : a new folder for the cases, or one that was written so before.

    Returns
    -------
    fitted, held_out : recordings; those that score a fit come separately.

    Raises
    ------
    InputError
        If the recordings are not in `source`, or are not those that were published.
    """
    written = write_cases(which, Path(source), Path(out))
    held_out = {recording.name for recording in written if recording.held_out}
    cases = read_cases(out, load_system(which))
    return (
        [case for case in cases if case.name not in held_out],
        [case for case in cases if case.name in held_out],
    )


def case_from_frame(
    system: System,
    frame: "pd.DataFrame",
    conditions: Mapping[str, Any] | None = None,
    name: str = "frame",
) -> Case:
    """A recording from a table whose columns are named `signal [unit]`, as in a file.

    Parameters
    ----------
    frame : "time [s]" and the measured signals; other columns are ignored.
    conditions : as in case.toml, such as {"load": "2 kN"}.

    Raises
    ------
    InputError
        If a signal is missing, has no unit or another one, or conditions are not those of the
        system.
    """
    where = f"table '{name}'"
    units = {"time": "s", **{signal.name: signal.unit for signal in system.signals.values()}}
    signals = {}
    for column in map(str, frame.columns):
        signal, unit = header(column)
        if signal in units:
            factor = si_factor(unit or "", units[signal], f"{where}, column '{column}'")
            signals[signal] = frame[column].to_numpy(float, copy=True) * factor
    required = ["time", *(signal.name for signal in (*system.inputs, *system.outputs))]
    if missing := [signal for signal in required if signal not in signals]:
        raise InputError(
            where=where,
            found=f"no column '{missing[0]}' among {', '.join(map(str, frame.columns))}",
            expected=f"a column '{missing[0]} [{units[missing[0]]}]'",
            remedy="name the columns as signals of the system, with units",
        )
    time = signals.pop("time")
    check_recording(time, system, f"{where}, column 'time'", None)
    values = read_conditions(Table(conditions or {}, f"{where}, conditions"), system)
    origin = Origin(where, None, {}, f"{where}, conditions")
    case = make_case(name, (time, signals), values, system, origin)
    _warn([case])
    return case


def _warn(cases: Sequence[Case]) -> None:
    """Warn of what is unlikely in recordings."""
    for case in cases:
        for doubt in case.doubts:
            warnings.warn(doubt, stacklevel=3)


def observe(system: System, case: Case, estimator: str, gains: Gains | None = None) -> Run:
    """Run one estimator along a recording.

    Parameters
    ----------
    estimator : its name.
    gains : such as those of `tune`; else what is usual for the model.

    Raises
    ------
    InputError
        If there is no such estimator, or the model is not fit for it.
    """
    (chosen,) = observers.choose(system, [estimator]).values()
    return run_on_model(case, system, chosen, gains)


def tune(
    system: System,
    estimator: str,
    cases: Sequence[Case],
    *,
    judge_by: str | None = None,
    **work: Unpack[TuningWork],
) -> TuningResult | None:
    """Find the gains whose worst case is best; see `workbench.tuning.tune`.

    Parameters
    ----------
    judge_by : estimator to score by if no sensor does, "smoother"; by measured signals if None.
    work : generations, population, seed, workers, report; see `TuningWork`.

    Returns
    -------
    The result, or None if it was interrupted before there was anything to return.
    """
    problem = pose(system, estimator, cases, judge_by=judge_by)
    plan, engine = _planned(**work)
    with (
        tempfile.TemporaryDirectory(prefix="tune-") as temporary,
        evaluators(problem.job, engine.workers) as pool,
    ):
        progress = Lines(plan, engine.report)
        return tuning.tune(pool, problem, plan, Path(temporary), progress=progress)


def _planned(
    *, generations: int = 100, population: int = 15, seed: int = 1, **work: Unpack[Work]
) -> tuple[Plan, Engine]:
    return Plan(generations, population, seed), _engine(**work)


def _engine(
    *,
    workers: int | None = None,
    report: Callable[[str], None] = print,
    out: str | Path | None = None,
) -> Engine:
    return Engine(workers or os.cpu_count() or 1, report, Path(out or ""))


def _writing(name: str, work: WrittenWork) -> Engine:
    """As `_engine`; into a temporary folder of this name unless another one is given."""
    engine = _engine(**work)
    given = work.get("out") is not None
    return engine if given else replace(engine, out=Path(tempfile.mkdtemp(prefix=f"{name}-")))


def diagnose(
    system: System,
    cases: Sequence[Case],
    *,
    held_out: Sequence[Case] = (),
    effects: Sequence[str] = (),
    certainty: bool = False,
    **work: Unpack[WrittenWork],
) -> Outcome:
    """Find what the system's model lacks; see `workbench.diagnosis.diagnose`.

    Parameters
    ----------
    held_out : recordings on which only the errors of both models are measured.
    effects : names of those to consider; all of the library, or of the FMU, unless some are given.
    certainty : whether it is asked how sure the sizes are, by fits of their own.
    work : workers, report, and out, the folder of the extended model; see `WrittenWork`.

    Raises
    ------
    InputError
        If recordings or library cannot be used.
    """
    problem = diagnosis.problem_of(system, cases, effects, held_out)
    engine = _writing("diagnosis", work)
    outcome = diagnosis.diagnose(problem, engine, certainty=certainty)
    return laws.compared_with_one_law(outcome, problem, engine)


def propose(
    diagnosed: Outcome,
    *,
    held_out: Sequence[Case] = (),
    effects: Sequence[str] = (),
    **work: Unpack[WrittenWork],
) -> Proposal:
    """Infer a law for what no effect explains; see `workbench.diagnosis.laws.propose`.

    Parameters
    ----------
    diagnosed : a diagnosis that left something unexplained, that needed several effects, or beside
        whose one cause errors last.
    held_out, effects, work : as of `diagnose`.

    Raises
    ------
    InputError
        If nothing is missing, or one effect explains it.
    """
    if not laws.needs_law(diagnosed):
        raise InputError(
            where="the diagnosis",
            found=f"the verdict '{diagnosed.diagnosis.verdict}'",
            expected="'unexplained', several causes, or one beside which errors last",
            remedy="ask for no law: nothing is missing, or one effect explains it",
        )
    problem = diagnosis.problem_of(diagnosed.system, diagnosed.cases, effects, held_out)
    return laws.propose(diagnosed, problem, _writing("proposal", work))


def monitor(
    system: System,
    history: str | Path,
    *,
    out: str | Path | None = None,
    false_alarms: float = RATE,
    workers: int | None = None,
) -> MonitoringResult:
    """Say what has changed on a machine over many recordings; see `studies.monitoring.monitor`.

    Parameters
    ----------
    history : folder that holds a folder for each recording of one machine.
    out : folder of the state, from which the next call goes on; a temporary one unless another is
        given.
    false_alarms : false alarms per recording of a healthy machine, all quantities together.
    workers : processes, one per processor unless another number is given.

    Raises
    ------
    InputError
        If no recording can be used, or the state is of another model.
    """
    with tempfile.TemporaryDirectory(prefix="monitor-") as temporary:
        folder = Path(out) if out is not None else Path(temporary)
        with locked_folder(folder):
            return monitoring.monitor(
                system,
                Path(history),
                _engine(workers=workers, report=silent, out=folder),
                rate=false_alarms,
                read=read_recorded,
            )


def fit(
    system: System,
    cases: Sequence[Case],
    parameters: Sequence[str | FittedParameter] = (),
    *,
    held_out: Sequence[Case] = (),
    settings: FitSettings | None = None,
    **work: Unpack[Work],
) -> FitOutcome:
    """Fit parameters of the system's FMU to recordings; see `workbench.studies.fit.fit`.

    Parameters
    ----------
    parameters : names or patterns of parameters, and of states whose starts are fitted; those of
        `[fit]` of the system file unless some are given.
    held_out : recordings on which only errors are measured.
    settings : starts, loss, seed; the usual ones unless they are given.
    work : workers and report; see `Work`.

    Raises
    ------
    InputError
        If there is no such parameter, or the model cannot be simulated with its own values.
    """
    chosen = settings or FitSettings()
    return fit_parameters(
        system, cases, parameters, _engine(**work), held_out=held_out, settings=chosen
    )


def next_stop(diagnosed: Outcome, **work: Unpack[Work]) -> NextStop:
    """Find the recording that tells apart what a diagnosis could not.

    See `workbench.studies.design.next_stop`.

    Parameters
    ----------
    diagnosed : a diagnosis that found a cause.
    work : workers and report; see `Work`.

    Raises
    ------
    InputError
        If nothing was found, or the system does not say what may be varied.
    """
    if diagnosed.rivals is None:
        raise InputError(
            where="the diagnosis",
            found=f"the verdict '{diagnosed.diagnosis.verdict}'",
            expected="a named effect, whose candidates or size need another recording",
            remedy="diagnose more recordings first",
        )
    return design.next_stop(diagnosed.system, diagnosed.rivals, _engine(**work))


def distance(
    system: System,
    stops: Sequence[Case],
    asked: Mapping[str, Any] | None = None,
    *,
    effort: Effort | None = None,
    **work: Unpack[Work],
) -> Distance:
    """Predict the distance of a stop from past ones; see `workbench.studies.distance`.

    Parameters
    ----------
    stops : recordings of past stops of the same machine.
    asked : of the stop, by the names of the system file: {"speed": "160 km/h"}; the rest is usual.
    effort : how much is drawn, the usual unless it is given.
    work : workers and report; see `Work`.

    Raises
    ------
    InputError
        If the system does not say how it stops, or a recording holds no stop.
    """
    return distance_of_stop(system, stops, asked or {}, effort or Effort(), _engine(**work))
