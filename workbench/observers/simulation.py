"""Estimators on recordings, a stage after the objective: results case by case, made in parallel."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.arrays import Vector
from workbench.errors import FMUError, InputError
from workbench.models.fmu import FMU
from workbench.models.instance import EventError
from workbench.observers import Estimator, Gains, label
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.observers.estimators.smoother import Smoother
from workbench.observers.gains import read_gains, usual_gains
from workbench.observers.observability import guesses, information
from workbench.observers.operating import DesignPointError
from workbench.observers.replay import replay, run_on_model
from workbench.observers.run import (
    Ending,
    Run,
    claimed_parts,
    half_band,
    probability_panel,
)
from workbench.observers.score import (
    Score,
    judged_window,
    low_pass,
    score,
    scored_column,
    with_readings,
)
from workbench.observers.trajectory import trajectory
from workbench.observers.trust import (
    TOO_COARSE,
    Contradiction,
    contradiction_lines,
    contradictions,
    normalised_innovations,
    sampling_doubt,
    spread_doubt,
    start_doubt,
    step_doubt,
    time_doubt,
    unit_doubt,
)
from workbench.pages.figures import ESTIMATORS, CaseFigure, Curve, Panel, value_range
from workbench.pages.views import (
    amount,
    below,
    called,
    errs_least,
    per_shown,
    percent,
    shown_unit,
    titled,
    views,
)
from workbench.recordings.case import Case
from workbench.runtime.pool import Pool
from workbench.system.parts import View
from workbench.system.registry import open_model
from workbench.system.system import System

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# [byte] that a smoother may take that nobody asked for; for each sample, it keeps five matrices.
_MOST = 5e8


@dataclass(frozen=True)
class CaseResult:
    """All estimators on one case: runs and scores by estimator name."""

    system: System
    case: Case
    runs: Mapping[str, Run]
    scores: Mapping[str, Score]
    # the smoother's estimate, where no sensor is only there to judge by; else None
    reference: Run | None
    # estimated quantities that the recording cannot tell apart, and states among them, and their
    # correlation
    inseparable: Mapping[tuple[str, ...], float] = field(default_factory=dict)
    untold: tuple[str, ...] = ()  # estimated quantities that it does not show, whatever others are
    # what is said of its start, and of its samples beside the model's time constants
    doubts: tuple[str, ...] = ()
    # why bands are too narrow, where its samples say so, see `sampling_doubt` and `time_doubt`
    unresolved: str = ""
    # of an open loop's error that coarse steps make, see `step_doubt`; 0 if it did not run
    step_share: float = 0.0

    def measured(self) -> Vector | None:
        """The judged signal as it judges, below the bandwidth, (n,); None if not measured."""
        reference, bandwidth = self.system.objective.signal, self.system.objective.bandwidth
        if reference not in self.case:
            return None
        return low_pass(self.case.time, self.case[reference], bandwidth)

    def error(self, name: str) -> Vector | None:
        """Estimated minus measured signal below the bandwidth, (n,); None if not measured."""
        reference, bandwidth = self.system.objective.signal, self.system.objective.bandwidth
        if reference not in self.case:
            return None
        run = self.runs[name]
        column = scored_column(self.system, run.columns, reference)
        error = run.signal(column) - self.case[reference]
        return low_pass(self.case.time, error, bandwidth)

    def surprise(self, name: str) -> float:
        """Variance of innovations over what a method says, where judged; 0 for one without.

        Of the whole recording where nothing is judged. The first sample has no innovation.
        """
        nis, counts = normalised_innovations(self.case, self.runs[name], self.system)
        return float(nis.sum() / counts.sum()) if counts.sum() else 0.0

    @cached_property
    def contradictions(self) -> dict[str, list[Contradiction]]:
        """Tests of innovations that contradict the bands of estimators, see `trust`."""
        tested = {
            name: contradictions(self.case, run, self.system, self._reason)
            for name, run in self.runs.items()
        }
        return {name: tests for name, tests in tested.items() if tests}

    @property
    def _reason(self) -> str:
        """Why bands are too narrow, where the recording shows it by itself."""
        if self.unresolved:
            return self.unresolved
        guessed = " and ".join(self.guessed)
        return f"estimates wander, as the recording does not tell {guessed}" if guessed else ""

    @property
    def contradicted(self) -> dict[str, float]:
        """Estimators whose innovations are larger than their bands allow, and `surprise` of each.

        The other tests stand in `contradictions`.
        """
        return {
            name: test.value
            for name, tests in self.contradictions.items()
            for test in tests
            if test.test == "variance" and test.narrow
        }

    def guesses(self) -> list[str]:
        """What is said of quantities that the recording does not tell, or not apart."""
        return guesses(self.inseparable, self.untold)

    def useless(self, name: str) -> bool:
        """Whether 95 % bands of an estimator miss more often than they hold, by its innovations.

        What residuals share in time may be the sensor's own, as a reading that is old: it counts
        where the samples do not resolve the model, or inputs are held otherwise.
        """
        return any(
            test.useless and test.narrow and (test.test == "variance" or self.unresolved)
            for test in self.contradictions.get(name, ())
        )

    @property
    def guessed(self) -> list[str]:
        """Estimated quantities of which no estimate can be claimed."""
        together = {name for names in self.inseparable for name in names}
        return [q.name for q in self.system.estimated if q.name in {*together, *self.untold}]

    def warnings(self) -> list[str]:
        """What is said first of the recording: guesses, and doubts by the model."""
        return [*self.guesses(), *self.doubts]

    def scale_notes(self) -> list[str]:
        """What a percent is, where the judged signal stays farther from zero than it moves.

        Errors are over the mean of its size, as are those of Schwarz et al. (2018). Zero of an
        absolute temperature, pressure or position may lie far from all that the machine does.
        """
        measured, name = self.measured(), self.system.objective.signal
        window = judged_window(self.case, self.system)
        if measured is None or window.stop - window.start < 2:
            return []
        low, high = float(measured[window].min()), float(measured[window].max())
        mean, span = float(np.mean(np.abs(measured[window]))), high - low
        if not 0.0 < span < mean:
            return []
        unit = self.system.unit(name)
        return [
            f"{name} moves by {amount(span, unit)}, far from zero: 1 % of its mean is "
            f"{amount(0.01 * mean, unit)}, which is {100.0 * 0.01 * mean / span:.2g} % of that"
        ]

    def to_frame(self) -> "pd.DataFrame":
        """All that the figure of the case shows, as a table; see `to_columns`."""
        import pandas as pd  # takes its time, and files are written without it

        return pd.DataFrame(self.to_columns())

    def to_columns(self) -> dict[str, Vector]:
        """All that the figure of the case shows, (n,) each: time, then `source.signal [unit]`.

        The source is `measured` or an estimator. Signals that a method does not estimate are left
        out; `..._5Hz` and `..._error` are the judged signal and its error below the bandwidth,
        `sigma_...` are standard deviations, `..._claimed` is 1 where a quantity may be claimed.
        """
        system, case = self.system, self.case
        reference, bandwidth = system.objective.signal, system.objective.bandwidth
        columns: dict[str, Vector] = {"time [s]": case.time}
        for name, signal in system.signals.items():
            if name in case:
                columns[f"measured.{name} [{signal.unit}]"] = case[name]
        unit, measured = system.unit(reference), self.measured()
        if measured is not None and np.isfinite(bandwidth):
            columns[f"measured.{reference}_{bandwidth:g}Hz [{unit}]"] = measured
        for name, run in self.runs.items():
            columns |= {f"{name}.{key}": values for key, values in run.to_columns().items()}
            if (error := self.error(name)) is not None:
                columns[f"{name}.{reference}_error [{unit}]"] = error
        if (best := self.reference) is not None:
            columns |= {
                f"{best.estimator}.{key}": to_column for key, to_column in best.to_columns().items()
            }
        return columns

    def to_dict(self) -> dict[str, Any]:
        """Title and doubts of the case, and scores by estimator, as plain numbers and texts."""
        reference = self.system.objective.signal
        unit = self.system.unit(reference)
        return {
            "title": self.case.title,
            "doubts": [*self.case.doubts, *self.warnings()],
            "warnings": self.warnings(),
            "scale": self.scale_notes(),
            "guesses": self.guessed,
            "inseparable": [
                {"names": list(names), "correlation": round(correlation, 6)}
                for names, correlation in self.inseparable.items()
            ],
            "contradicted": {name: round(ratio, 3) for name, ratio in self.contradicted.items()},
            "contradictions": {
                name: [{**asdict(test), "value": round(test.value, 3)} for test in tests]
                for name, tests in self.contradictions.items()
            },
            "reference": None if self.reference is None else self.reference.estimator,
            "estimators": {
                name: {
                    f"{reference}_rms_{unit}": score.rms,
                    f"{reference}_nrmse": score.nrmse,
                    "z": score.z,
                    "outcome": self.runs[name].ending.name,
                    "reason": score.reason,
                    "seconds": round(self.runs[name].seconds, 4),
                }
                for name, score in self.scores.items()
            },
        }

    def summary(self) -> str:
        """Scores by estimator, for people."""
        import pandas as pd

        table = pd.DataFrame(self.to_dict()["estimators"]).T
        title = f"{self.case.name}: {self.case.title}"
        contradicted = contradiction_lines({self.case.name: self.contradictions})
        lines = [*followed(self.system), *self.warnings(), *contradicted, *self.scale_notes()]
        return "\n".join([title, *lines, table.to_string(na_rep="n/a")])

    def plot(self) -> "Figure":
        """Figure of all that was measured and estimated."""
        from workbench.pages.figures import sheet

        return sheet(case_figure(self))

    def _repr_html_(self) -> str:
        """The table of scores, for notebooks."""
        import pandas as pd

        table = pd.DataFrame(self.to_dict()["estimators"]).T
        return str(table.to_html(na_rep="n/a"))


@dataclass(frozen=True)
class Simulation:
    """What runs on every case; travels to the processes."""

    system: System
    # kinds, gains: of the estimators by name, in the order of the results
    kinds: Mapping[str, type[Estimator]]
    gains: Mapping[str, Gains]

    @contextmanager
    def estimators(self) -> Iterator[dict[str, Estimator]]:
        """The estimators, by name, while their models are open."""
        with ExitStack() as stack:
            models = _models(stack, self.system, self.kinds)
            yield {
                name: estimator(models[estimator.role], self.system, self.gains[name])
                for name, estimator in self.kinds.items()
            }

    def meanings(self) -> dict[str, dict[str, tuple[str, str]]]:
        """What each gain of each estimator does, and its unit."""
        with ExitStack() as stack:
            models = _models(stack, self.system, self.kinds)
            return {
                name: estimator.meanings(models[estimator.role], self.system, self.gains[name])
                for name, estimator in self.kinds.items()
            }

    def run(self, case: Case, *, last_first: bool = False) -> CaseResult:
        """All estimators on one case, in this process; the last of them first on request."""
        with self.estimators() as estimators:
            order = [*reversed(estimators)] if last_first else [*estimators]
            done = {name: replay(case, estimators[name]) for name in order}
            runs = {name: done[name] for name in estimators}
            doubts = [estimator.doubt for estimator in estimators.values()]
        warned = [run.message for run in runs.values() if run.ending is Ending.OK and run.message]
        scores = {name: score(case, run, self.system) for name, run in runs.items()}
        result = CaseResult(self.system, case, runs, scores, self._reference(case, runs))
        narrow = any(test.narrow for tests in result.contradictions.values() for test in tests)
        coarse = [name for name in runs if self.kinds[name].coarse_steps]
        result = replace(result, **self._knowledge(case, narrow, runs.get(OpenLoop.name), coarse))
        result = replace(
            result,
            doubts=(
                *warned[:1],  # that of one estimator tells
                *result.doubts,
                *filter(None, doubts),
            ),
        )
        guessed = {name: np.zeros(case.time.size, bool) for name in result.guessed}
        marked = {
            name: replace(run, claimed={**run.claimed, **guessed}) for name, run in runs.items()
        }
        best = result.reference
        if best is not None:
            best = replace(best, claimed={**best.claimed, **guessed})
        return replace(result, runs=marked, reference=best)

    def warnings(self, case: Case) -> list[str]:
        """What is said first of a recording, see `CaseResult.warnings`, before estimators run."""
        return CaseResult(self.system, case, {}, {}, None, **self._knowledge(case)).warnings()

    def _knowledge(
        self,
        case: Case,
        narrow: bool = False,
        open_loop: Run | None = None,
        coarse: Sequence[str] = (),
    ) -> dict[str, Any]:
        """What a recording tells, by the model alone, as fields of the result.

        Little where the model cannot be linearised along the recording.

        Parameters
        ----------
        narrow : whether bands are too narrow, so that samples may be too far apart.
        open_loop : its run, where its error is shown.
        coarse : estimators whose steps may not do, see `step_doubt`.
        """
        unit = assumed = ""
        try:
            with open_model(self.system) as fmu:
                unit = unit_doubt(fmu, self.system, case)
                if any(estimator.adapts for estimator in self.kinds.values()):
                    assumed = spread_doubt(fmu, self.system, case)
                known = information(fmu, self.system, case)
                path = trajectory(fmu, self.system, case)
                clock = "" if path is None else time_doubt(fmu, self.system, case, path)
                start = start_doubt(fmu, self.system, case)
                sampling, why = "", TOO_COARSE if clock else ""
                if narrow:
                    sampling, reason = sampling_doubt(fmu, self.system, case)
                    why = why or reason
                share, step = 0.0, ""
                if open_loop is not None:
                    share, step = step_doubt(fmu, self.system, case, open_loop, coarse)
        except EventError:
            unchecked = (
                "what the recording tells of quantities is not checked: the model has events"
            )
            doubts = (unit, unchecked if self.system.estimated else "", assumed)
            return {"doubts": tuple(filter(None, doubts))}
        except (InputError, FMUError, np.linalg.LinAlgError):
            return {"doubts": tuple(filter(None, (unit, assumed)))}
        return {
            "inseparable": {} if known is None else known.inseparable,
            "untold": () if known is None else known.untold,
            "doubts": tuple(filter(None, (clock, unit, start, sampling, step, assumed))),
            "unresolved": why,
            "step_share": share,
        }

    def _reference(self, case: Case, runs: Mapping[str, Run]) -> Run | None:
        """The smoother's estimate, where a recording has nothing that is only there to judge by."""
        kept = 5 * 8 * case.time.size * len(self.system.columns) ** 2
        if any(signal.name in case for signal in self.system.reference_signals) or kept > _MOST:
            return None
        return runs.get(Smoother.name) or smoother_run(case, self.system)


def followed(system: System) -> list[str]:
    """Say that what scores estimators corrects them, if it does."""
    scored = system.objective.signal
    if scored not in (output.name for output in system.outputs):
        return []
    return [
        f"{scored} corrects the estimators that it scores: its errors say how closely each follows "
        "the sensor, not how right it is. A validation sensor would score them."
    ]


def hidden(system: System) -> tuple[str, ...]:
    """What an estimate says that no sensor feeds it: quantities, and outputs that are reported."""
    fed = {*system.corrections, *(output.name for output in system.outputs)}
    return tuple(name for name in system.columns if name not in fed)


def smoother_run(case: Case, system: System) -> Run | None:
    """The best estimate of a recording that is over; None where nothing is hidden.

    And where the model is not fit for it, or it fails.
    """
    if not hidden(system):
        return None
    try:
        run = run_on_model(case, system, Smoother)
    except InputError:
        return None
    return run if run.ending is Ending.OK else None


def prepare(
    system: System,
    kinds: Mapping[str, type[Estimator]],
    file: Path | None = None,
    tuned: bool = True,
    leave_out: Callable[[str, InputError], None] | None = None,
) -> Simulation:
    """Estimators with their gains.

    Parameters
    ----------
    file : of tuned gains, for the estimator that it names.
    tuned : whether the others have the gains that were tuned for the system, where there are any.
    leave_out : called with each estimator that the design point does not let be designed, and why;
        None: that is an error, as it is if none can be.
    """
    gains: dict[str, Gains] = {}
    with ExitStack() as stack:
        models = _models(stack, system, kinds)
        system = with_readings(system, list(models.values()))
        for place, (name, estimator) in enumerate(kinds.items(), 1):
            try:
                gains[name] = gains_for(estimator, models[estimator.role], system, tuned)
            except DesignPointError as error:
                if leave_out is None or (place == len(kinds) and not gains):
                    raise
                leave_out(name, error)
    kinds = {name: kinds[name] for name in gains}
    if file is not None:
        gains |= _gains_of_file(kinds, gains, file)
    return Simulation(system, kinds, gains)


def gains_for(estimator: type[Estimator], fmu: FMU, system: System, tuned: bool) -> Gains:
    """Gains of an estimator, tuned or reasoned; the FMU is left at an operating point."""
    return usual_gains(estimator, fmu, system) if tuned else estimator.default_gains(fmu, system)


def _gains_of_file(
    kinds: Mapping[str, type[Estimator]], gains: Mapping[str, Gains], file: Path
) -> dict[str, Gains]:
    """Gains of a file, by each estimator that takes them."""
    takers: dict[str, list[str]] = {}
    for name, estimator in kinds.items():
        if estimator.tunable or estimator.tuned_as:
            takers.setdefault(estimator.tuned_as or name, []).append(name)
    given = read_gains(file, {owner: gains[names[0]] for owner, names in takers.items()})
    return next(
        {name: replace(given, estimator=name) for name in names}
        for names in takers.values()
        if given.estimator in names
    )


def simulate(
    simulation: Simulation,
    cases: Sequence[Case],
    workers: int = 1,
    note: Callable[[CaseResult], None] | None = None,
) -> Iterator[CaseResult]:
    """All cases, in the order they end; who leaves the loop drops the others.

    Parameters
    ----------
    workers : processes; 1: this one.
    note : called with each result where it was made, such as to write files.
    """
    with Pool(min(workers, len(cases)), nullcontext, (simulation, note)) as pool:
        try:
            for _, result in pool.completed(_work, [*enumerate(cases)]):
                yield result
        except KeyboardInterrupt:
            pool.finish()
            raise


def _work(
    given: tuple[Simulation, Callable[[CaseResult], None] | None], numbered: tuple[int, Case]
) -> CaseResult:
    simulation, note = given
    number, case = numbered
    # On a machine's first run, each of two workers compiles the loops that the other has not.
    result = simulation.run(case, last_first=number % 2 == 1)
    if note is not None:
        note(result)
    return result


def _models(
    stack: ExitStack, system: System, kinds: Mapping[str, type[Estimator]]
) -> dict[str, FMU]:
    roles = dict.fromkeys(estimator.role for estimator in kinds.values())
    return {role: stack.enter_context(open_model(system, role)) for role in roles}


_REFERENCE = "raw"  # style
_SHOWN = 3  # estimators whose curves can be told apart: best, runner-up and baseline


def case_figure(result: CaseResult, styles: Sequence[str] = ESTIMATORS) -> CaseFigure:
    """Describe the figure of a case.

    Residuals are shown as they are judged: below the bandwidth. Bands hold 95 %.
    """
    system, case = result.system, result.case
    chosen = dict(zip(result.runs, cycle(styles), strict=False))
    window = judged_window(case, system)
    counted, panels = case.time[window], []
    for view in views(system):
        panels.append(_signal_panel(result, chosen, view))
        if system.objective.signal in view.signals:
            panels.append(_residual_panel(result, chosen, window))
    panels.append(probability_panel(result.runs.values()))
    return CaseFigure(
        name=case.name,
        title=case.title,
        finding=_finding(result),
        time=case.time,
        window=(float(counted[0]), float(counted[-1])) if counted.size else None,
        legend=tuple(_legend(result, chosen)),
        hidden=_on_demand(result, chosen),
        panels=tuple(panel for panel in panels if panel.curves),
    )


def _signal_panel(result: CaseResult, styles: dict[str, str], view: View) -> Panel:
    """One panel: what was measured of its signals, and what was estimated.

    Of the judged signal, what was measured sets the range: an estimator may start or end with a
    spike, and a sensor may ring.
    """
    system, case = result.system, result.case
    unit = shown_unit(system, view.signals[0])
    fed = {signal.name for signal in (*system.inputs, *system.outputs)}
    known = [(styles[name], run) for name, run in result.runs.items()]
    best = [] if result.reference is None else [(_REFERENCE, result.reference)]
    curves: list[Curve] = []
    measured, here = None, system.under(case.conditions)
    for number, name in enumerate(view.signals):
        factor, is_reference = per_shown(system, name, unit), name == system.objective.signal
        if is_reference or name not in fed:
            for style, run in known if name in fed else known + best:
                curves += _estimate_curves(run, style, name, factor)
        if is_reference and (measured := result.measured()) is not None:
            measured = measured / factor
            if below(system):
                curves.insert(0, Curve("raw", case[name] / factor))
            curves.append(Curve("measured", measured))
        elif name in case or _is_fed(system, name):
            values = here.signal(name, case.signals) / factor
            curves.append(Curve("measured", values, dashed=number > 0))
    signals = [curve.values for curve in curves]
    low, high = value_range(signals) if measured is None else value_range([measured], margin=0.25)
    return Panel(
        titled(view, unit),
        unit,
        low if view.low is None else view.low,
        high if view.high is None else view.high,
        view.height,
        tuple(curves),
    )


def _is_fed(system: System, name: str) -> bool:
    """Whether a signal is derived from what is fed; a sensor that only judges has its own panel."""
    references = {signal.name for signal in system.reference_signals}
    return any(
        signal.name == name and not signal.formula.names & references for signal in system.derived
    )


def _residual_panel(result: CaseResult, styles: dict[str, str], window: slice) -> Panel:
    """Error of the judged signal by estimator."""
    system = result.system
    reference = system.objective.signal
    unit = shown_unit(system, reference)
    curves = [
        Curve(styles[name], error / per_shown(system, reference, unit))
        for name in result.runs
        if (error := result.error(name)) is not None
    ]
    reach = _reach([np.abs(curve.values[window]) for curve in curves])
    within = f", {below(system)}" if below(system) else ""
    title = f"Error of {reference}, estimated - measured{within} [{unit}]"
    return Panel(title, unit, -reach, reach, 1.1, tuple(curves))


def _estimate_curves(run: Run, style: str, signal: str, factor: float) -> list[Curve]:
    """Curves of an estimator that knows the signal, with its band."""
    if signal not in run.columns or not np.isfinite(run.signal(signal)).any():
        return []
    curve = Curve(style, run.signal(signal) / factor, half_band(run, signal, factor))
    return claimed_parts(curve, run, signal)


def _reach(errors: Sequence[Vector]) -> float:
    """Half the axis of the residual: shows all of the best two, and cuts an open loop.

    Parameters
    ----------
    errors : magnitudes where they count, one array for each estimator, NaN where it failed.
    """
    peaks = sorted(float(e.max()) for e in errors if e.size and np.isfinite(e).all())
    return 1.1 * peaks[min(1, len(peaks) - 1)] if peaks else 1.0


def _legend(result: CaseResult, styles: dict[str, str]) -> list[tuple[str, str]]:
    """Style and text of each entry."""
    system, reference = result.system, result.system.objective.signal
    entries = [("measured", "measured")]
    if reference in result.case and below(system):
        entries = [
            ("measured", f"measured ({reference} {below(system)})"),
            ("raw", f"measured {reference}, unfiltered"),
        ]
    for name, style in styles.items():
        share, text = result.scores[name].nrmse, label(name, system)
        entries.append((style, text if share is None else f"{text} ({percent(share)})"))
    if result.reference is not None:
        best = label(result.reference.estimator, system)
        entries.append((_REFERENCE, f"reference, as no sensor reads it: {best}"))
    return entries


def _on_demand(result: CaseResult, styles: Mapping[str, str]) -> frozenset[str]:
    """Styles of all estimators but the best, the runner-up and the open loop, whose curves hide."""
    errors = {n: s.nrmse for n, s in result.scores.items() if s.nrmse is not None}
    shown = {*sorted(errors, key=errors.__getitem__)[:2], "open_loop"}
    if len(shown & styles.keys()) < _SHOWN:
        return frozenset()
    return frozenset(styles.values()) - {styles[name] for name in shown}


def _finding(result: CaseResult) -> str:
    """Errors of the estimators, the least first."""
    system, signal = result.system, result.system.objective.signal
    shares = sorted(
        (score.nrmse, label(name, system), score.rms)
        for name, score in result.scores.items()
        if score.nrmse is not None and score.rms is not None
    )
    if not shares:
        reasons = sorted({score.reason for score in result.scores.values()})
        return f"Estimated, not scored: {'; '.join(reasons)}."
    share, _, rms = shares[0]
    first = errs_least([(value, name) for value, name, _ in shares])
    others = ", ".join(f"{name} {percent(value)}" for value, name, _ in shares[1:])
    trust = "".join(
        f" {line}" for line in contradiction_lines({result.case.name: result.contradictions})
    )
    return (
        f"{first}: {percent(share)} of the mean {called(system, signal)}, "
        f"{amount(rms, system.unit(signal))} rms" + (f"; {others}." if others else ".") + trust
    )
