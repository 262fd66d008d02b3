"""An estimator beside a recording, stage 4."""

import enum
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from workbench.case import Case
from workbench.companion import companion_part
from workbench.errors import FMUError
from workbench.fmu import Matrix, Vector
from workbench.observers import Estimate, Estimator, Gains
from workbench.observers.gains_file import usual_gains
from workbench.system import System
from workbench.systems import open_model

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SURE = 0.95  # probability, that of a band


class Ending(enum.Enum):
    """How a run ended; the value is the sentence for people."""

    OK = "ran to the end"
    NOT_FINITE = "the estimate left the finite numbers; the gains may be unstable"
    FMU_FAILED = "the FMU refused a call"


@dataclass(frozen=True)
class Run:
    """What one estimator made of one case.

    Attributes
    ----------
    case, estimator : names.
    columns : of the estimate, with units.
    time : (n,) [s].
    estimate : (n, w) NaN where not estimated, and after a failure.
    sigma : (n, w) standard deviations, NaN where the method has none.
    nis : (n,) normalised innovation squared, NaN where the method has none.
    ending : how it ended.
    message : what the FMU said, empty if nothing.
    seconds : wall time of the estimator.
    claimed : (n,) by estimated quantity that is not always shown, whether it is an estimate;
        elsewhere it is a guess that fits as well as any other, or stands in for something that the
        model has not.
    probability : (n,) by mode of an estimator that weighs models.
    """

    case: str
    estimator: str
    columns: Mapping[str, str]
    time: Vector
    estimate: Matrix
    sigma: Matrix
    nis: Vector
    ending: Ending
    message: str
    seconds: float
    claimed: Mapping[str, NDArray[np.bool_]]
    probability: Mapping[str, Vector] = field(default_factory=dict)

    def signal(self, name: str) -> Vector:
        """One column of the estimate, (n,)."""
        return self.estimate[:, list(self.columns).index(name)]

    def deviation(self, name: str) -> Vector:
        """Standard deviation of one column of the estimate, (n,)."""
        return self.sigma[:, list(self.columns).index(name)]

    def to_columns(self) -> dict[str, NDArray[Any]]:
        """What is known, (n,) by `signal [unit]`.

        Estimates, `sigma_...`, `..._claimed`, and `probability_...` of modes.
        """
        columns: dict[str, NDArray[Any]] = {}
        for name, unit in self.columns.items():
            if not np.isnan(self.signal(name)).all():
                columns[f"{name} [{unit}]"] = self.signal(name)
            if not np.isnan(self.deviation(name)).all():
                columns[f"sigma_{name} [{unit}]"] = self.deviation(name)
        for name, claimed in self.claimed.items():
            if not np.isnan(self.signal(name)).all():
                columns[f"{name}_claimed [1]"] = claimed.astype(int)
        for mode, probability in self.probability.items():
            columns[f"probability_{mode} [1]"] = probability
        return columns

    def to_frame(self) -> pd.DataFrame:
        """The estimate as a table: time, then the columns of `to_columns`."""
        return pd.DataFrame({"time [s]": self.time, **self.to_columns()})

    def to_dict(self) -> dict[str, Any]:
        """How it went, as plain numbers and texts."""
        return {
            "case": self.case,
            "estimator": self.estimator,
            "ending": self.ending.name,
            "message": self.message,
            "samples": self.time.size,
            "seconds": self.seconds,
        }

    def summary(self) -> str:
        """How it went, in one line."""
        ending = f"{self.ending.value} {self.message}".strip()
        return (
            f"{self.estimator} on {self.case}: {ending}; {self.time.size} samples in "
            f"{self.seconds:.2g} s"
        )

    def plot(self) -> "Figure":
        """Figure of all that was estimated."""
        from workbench.report.figures import sheet
        from workbench.report.run_figures import run_figure

        return sheet(run_figure(self))

    def _repr_html_(self) -> str:
        """Smallest, largest and typical values, for notebooks."""
        return f"<p>{escape(self.summary())}</p>{self.to_frame().describe().to_html()}"


def observed(case: Case, system: System, kind: type[Estimator], gains: Gains | None = None) -> Run:
    """Feed a recording to an estimator on the system's model, with its usual gains unless given.

    Raises
    ------
    InputError
        If the model is not fit for it.
    """
    with open_model(system, kind.role) as fmu:
        return replay(case, kind(fmu, system, gains or usual_gains(kind, fmu, system)))


def replay(case: Case, estimator: Estimator) -> Run:
    """Feed a recording to an estimator, sample by sample; a failure is a value of the run."""
    begin = time.perf_counter()
    system = estimator.system
    blank = np.full((case.time.size, len(system.columns)), np.nan)
    estimate = Estimate(
        blank, blank, blank[:, 0], np.full((len(blank), len(estimator.modes)), np.nan)
    )
    claimed: dict[str, NDArray[np.bool_]] = {}
    ending, message = Ending.OK, ""
    try:
        estimator.tell(case.conditions)
        estimate = estimator.run(case.time, case.u, case.y)
        seconds = time.perf_counter() - begin
        values = np.asarray(estimate.values)
        given = np.isfinite(values[0])  # what the method estimates at all
        if not given.any():
            ending, message = Ending.NOT_FINITE, "from the start"
        elif (lost := np.flatnonzero(~np.isfinite(values[:, given]).all(axis=1))).size:
            ending = Ending.NOT_FINITE
            message = f"at t = {case.time[lost[0]]:.3f} s"
        claimed = _claims(case, estimator, values, np.asarray(estimate.probability))
    except FMUError as error:
        seconds = time.perf_counter() - begin
        ending, message = Ending.FMU_FAILED, str(error)
    told = np.asarray(estimate.values), np.asarray(estimate.sigma)
    values, sigma = with_indirect(system.under(case.conditions), *told)
    return Run(
        case=case.name,
        estimator=estimator.name,
        columns={**system.columns, **{n: one.unit for n, (one, _) in system.indirect.items()}},
        time=case.time,
        estimate=values,
        sigma=sigma,
        nis=np.asarray(estimate.nis),
        ending=ending,
        message=message,
        seconds=seconds,
        claimed=claimed or {name: np.zeros(case.time.size, bool) for name in _doubted(estimator)},
        probability=dict(zip(estimator.modes, np.asarray(estimate.probability).T, strict=True)),
    )


def with_indirect(system: System, values: Matrix, sigma: Matrix) -> tuple[Matrix, Matrix]:
    """Estimates and standard deviations, (n, w + d), with those of `System.indirect` behind them.

    Standard deviations to first order: by what a formula changes over both of its column's.
    """
    more, deviations = [values], [sigma]
    for one, name in system.indirect.values():
        at = list(system.columns).index(name)
        value, reach = values[:, at], sigma[:, at]
        middle, high, low = (
            system.evaluate(one.formula, {name: column})
            for column in (value, value + reach, value - reach)
        )
        more.append(middle[:, None])
        deviations.append(0.5 * np.abs(high - low)[:, None])
    return np.hstack(more), np.hstack(deviations)


def _rules(estimator: Estimator) -> Mapping[str, object]:
    """Rules of the system's companion on when a quantity is shown, by its name."""
    part = companion_part(estimator.system.companion, "claims")
    return part.CLAIMS if part else {}


def _doubted(estimator: Estimator) -> list[str]:
    """Estimated quantities that are not always shown."""
    rules = _rules(estimator)
    return [one.name for one in estimator.system.estimated if one.claimed or one.name in rules]


def _claims(
    case: Case, estimator: Estimator, values: Matrix, probability: Matrix
) -> dict[str, NDArray[np.bool_]]:
    """Where quantities may be claimed; of several models, by those that are hardly wrong.

    A rule judges by the estimate itself, which may pass through what the rule asks for: where a
    linearised filter first sees a quantity, a noisy sample may lead it far off, and makes it sure.
    So the rule must be met for as long as the quantity takes to walk as far as is useful.
    """
    rules, system = _rules(estimator), estimator.system
    claimed = {}
    for name in _doubted(estimator):
        one = next(one for one in system.estimated if one.name == name)
        met = all(
            key in estimator.finds or case.conditions[key] == value
            for key, value in one.claimed.items()
        )
        if met and name in rules:
            shares = [rules[name](fmu, system, values) for fmu in estimator.models]  # type: ignore[operator]
            weights = probability if estimator.modes else np.ones((case.time.size, 1))
            sure = (np.column_stack(shares) * weights).sum(axis=1) > SURE
            span = (one.useful / one.walk) ** 2 if one.walk > 0.0 else 0.0
            claimed[name] = lasting(sure, case.time, span)
        else:
            claimed[name] = np.full(case.time.size, met)
    return claimed


def lasting(met: NDArray[np.bool_], time: Vector, span: float) -> NDArray[np.bool_]:
    """Where a condition has been met for so long [s], (n,).

    >>> lasting(np.array([1, 0, 1, 1, 1], bool), np.arange(5.0), 2.0).tolist()
    [False, False, False, True, True]
    """
    unmet = np.maximum.accumulate(np.where(met, time[0], time))
    kept: NDArray[np.bool_] = met & (time - unmet >= span)
    return kept
