"""Estimators on recordings, a stage after the objective: results case by case, made in parallel."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from workbench.case import Case
from workbench.cosim import Ending, Run, observed, replay
from workbench.errors import InputError
from workbench.fmu import FMU, Vector
from workbench.objective import Score, judged_window, low_pass, score
from workbench.observers import Estimator, Gains
from workbench.observers.gains_file import read_gains, usual_gains
from workbench.observers.smoother import Smoother
from workbench.pool import Pool
from workbench.system import System
from workbench.systems import open_model

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# A 95 % band of deviations that are too small by the root of this covers 93 %.
OVERCONFIDENT = (1.960 / 1.812) ** 2
# [byte] that a smoother may take that nobody asked for; for each sample, it keeps five matrices.
_MOST = 5e8


@dataclass(frozen=True)
class CaseResult:
    """All estimators on one case: runs and scores by estimator name.

    Attributes
    ----------
    reference : the smoother's estimate, where no sensor is only there to judge by; else None.
    """

    system: System
    case: Case
    runs: Mapping[str, Run]
    scores: Mapping[str, Score]
    reference: Run | None

    def measured(self) -> Vector | None:
        """The judged signal as it judges, below the bandwidth, (n,); None if not measured."""
        judged, bandwidth = self.system.objective.judged, self.system.objective.bandwidth
        if judged not in self.case:
            return None
        return low_pass(self.case.time, self.case[judged], bandwidth)

    def error(self, name: str) -> Vector | None:
        """Estimated minus measured signal below the bandwidth, (n,); None if not measured."""
        judged, bandwidth = self.system.objective.judged, self.system.objective.bandwidth
        if judged not in self.case:
            return None
        error = self.runs[name].signal(judged) - self.case[judged]
        return low_pass(self.case.time, error, bandwidth)

    def surprise(self, name: str) -> float:
        """Variance of innovations over what a method says, where judged; 0 for one without."""
        window, run = judged_window(self.case, self.system), self.runs[name]
        nis = run.nis[window]
        if not (nis.size and np.isfinite(nis).all()):
            return 0.0
        fed = [one in run.columns for one in (*self.case.outputs, *self.case.aids)]
        return float(nis.mean() / np.isfinite(self.case.y[window][:, fed]).sum(axis=1).mean())

    def to_frame(self) -> pd.DataFrame:
        """All that the figure of the case shows: time, then `source.signal [unit]`.

        The source is `measured` or an estimator. Signals that a method does not estimate are left
        out; `..._5Hz` and `..._error` are the judged signal and its error below the bandwidth,
        `sigma_...` are standard deviations, `..._claimed` is 1 where a quantity may be claimed.
        """
        system, case = self.system, self.case
        judged, bandwidth = system.objective.judged, system.objective.bandwidth
        columns: dict[str, Any] = {"time [s]": case.time}
        for name, one in system.signals.items():
            if name in case:
                columns[f"measured.{name} [{one.unit}]"] = case[name]
        unit, measured = system.unit(judged), self.measured()
        if measured is not None and np.isfinite(bandwidth):
            columns[f"measured.{judged}_{bandwidth:g}Hz [{unit}]"] = measured
        for name, run in self.runs.items():
            columns |= {f"{name}.{key}": values for key, values in run.to_columns().items()}
            if (error := self.error(name)) is not None:
                columns[f"{name}.{judged}_error [{unit}]"] = error
        if (best := self.reference) is not None:
            columns |= {f"{best.estimator}.{key}": one for key, one in best.to_columns().items()}
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Title and doubts of the case, and scores by estimator, as plain numbers and texts."""
        judged = self.system.objective.judged
        unit = self.system.unit(judged)
        return {
            "title": self.case.title,
            "doubts": list(self.case.doubts),
            "reference": None if self.reference is None else self.reference.estimator,
            "estimators": {
                name: {
                    f"{judged}_rms_{unit}": one.rms,
                    f"{judged}_nrmse": one.nrmse,
                    "z": one.z,
                    "outcome": self.runs[name].ending.name,
                    "reason": one.reason,
                    "seconds": round(self.runs[name].seconds, 4),
                }
                for name, one in self.scores.items()
            },
        }

    def summary(self) -> str:
        """Scores by estimator, for people."""
        table = pd.DataFrame(self.to_dict()["estimators"]).T
        return f"{self.case.name}: {self.case.title}\n{table.to_string(na_rep='n/a')}"

    def plot(self) -> "Figure":
        """Figure of all that was measured and estimated."""
        from workbench.report.figures import sheet
        from workbench.report.run_figures import case_figure

        return sheet(case_figure(self))

    def _repr_html_(self) -> str:
        """The table of scores, for notebooks."""
        table = pd.DataFrame(self.to_dict()["estimators"]).T
        return str(table.to_html(na_rep="n/a"))


@dataclass(frozen=True)
class Simulation:
    """What runs on every case; travels to the processes.

    Attributes
    ----------
    kinds, gains : of the estimators by name, in the order of the results.
    """

    system: System
    kinds: Mapping[str, type[Estimator]]
    gains: Mapping[str, Gains]

    @contextmanager
    def estimators(self) -> Iterator[dict[str, Estimator]]:
        """The estimators, by name, while their models are open."""
        with ExitStack() as stack:
            models = _models(stack, self.system, self.kinds)
            yield {
                name: kind(models[kind.role], self.system, self.gains[name])
                for name, kind in self.kinds.items()
            }

    def meanings(self) -> dict[str, dict[str, tuple[str, str]]]:
        """What each gain of each estimator does, and its unit."""
        with ExitStack() as stack:
            models = _models(stack, self.system, self.kinds)
            return {
                name: kind.meanings(models[kind.role], self.system, self.gains[name])
                for name, kind in self.kinds.items()
            }

    def run(self, case: Case) -> CaseResult:
        """All estimators on one case, in this process."""
        with self.estimators() as estimators:
            runs = {name: replay(case, one) for name, one in estimators.items()}
        scores = {name: score(case, run, self.system) for name, run in runs.items()}
        return CaseResult(self.system, case, runs, scores, self._reference(case, runs))

    def _reference(self, case: Case, runs: Mapping[str, Run]) -> Run | None:
        """The smoother's estimate, where a recording has nothing that is only there to judge by."""
        kept = 5 * 8 * case.time.size * len(self.system.columns) ** 2
        if any(one.name in case for one in self.system.judged) or kept > _MOST:
            return None
        return runs.get(Smoother.name) or smoothed(case, self.system)


def hidden(system: System) -> tuple[str, ...]:
    """What an estimate says that no sensor feeds it: quantities, and outputs that are reported."""
    fed = {*system.corrections, *(one.name for one in system.outputs)}
    return tuple(name for name in system.columns if name not in fed)


def smoothed(case: Case, system: System) -> Run | None:
    """The best estimate of a recording that is over; None where nothing is hidden.

    And where the model is not fit for it, or it fails.
    """
    if not hidden(system):
        return None
    try:
        run = observed(case, system, Smoother)
    except InputError:
        return None
    return run if run.ending is Ending.OK else None


def prepare(
    system: System,
    kinds: Mapping[str, type[Estimator]],
    file: Path | None = None,
    tuned: bool = True,
) -> Simulation:
    """Estimators with their gains.

    Parameters
    ----------
    file : of tuned gains, for the estimator that it names.
    tuned : whether the others have the gains that were tuned for the system, where there are any.

    Raises
    ------
    InputError
        If an estimator cannot run on the system's models, or the file cannot be read.
    """
    with ExitStack() as stack:
        models = _models(stack, system, kinds)
        gains = {
            name: gains_for(kind, models[kind.role], system, tuned) for name, kind in kinds.items()
        }
    if file is not None:
        gains |= _given(kinds, gains, file)
    return Simulation(system, kinds, gains)


def gains_for(kind: type[Estimator], fmu: FMU, system: System, tuned: bool) -> Gains:
    """Gains of an estimator, tuned or reasoned; the FMU is left at an operating point."""
    return usual_gains(kind, fmu, system) if tuned else kind.reasoned(fmu, system)


def _given(
    kinds: Mapping[str, type[Estimator]], gains: Mapping[str, Gains], file: Path
) -> dict[str, Gains]:
    """Gains of a file, by each estimator that takes them."""
    takers: dict[str, list[str]] = {}
    for name, kind in kinds.items():
        if kind.tunable or kind.tuned_as:
            takers.setdefault(kind.tuned_as or name, []).append(name)
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
            for _, result in pool.completed(_work, cases):
                yield result
        except KeyboardInterrupt:
            pool.finish()
            raise


def _work(given: tuple[Simulation, Callable[[CaseResult], None] | None], case: Case) -> CaseResult:
    simulation, note = given
    result = simulation.run(case)
    if note is not None:
        note(result)
    return result


def _models(
    stack: ExitStack, system: System, kinds: Mapping[str, type[Estimator]]
) -> dict[str, FMU]:
    roles = dict.fromkeys(kind.role for kind in kinds.values())
    return {role: stack.enter_context(open_model(system, role)) for role in roles}
