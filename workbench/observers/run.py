"""What an estimator made of a recording, with its figure."""

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.pages.figures import ESTIMATORS, CaseFigure, Curve, Panel
from workbench.system.units import BAND

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


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
    message : why it ended so, or what the FMU warned of; empty: nothing.
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
        for name, valid in self.claimed.items():
            if not np.isnan(self.signal(name)).all():
                columns[f"{name}_claimed [1]"] = valid.astype(int)
        for mode, probability in self.probability.items():
            columns[f"probability_{mode} [1]"] = probability
        return columns

    def to_frame(self) -> "pd.DataFrame":
        """The estimate as a table: time, then the columns of `to_columns`."""
        import pandas as pd

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
        ending = f"{self.ending.value}{';' * (self.ending is Ending.OK)} {self.message}".strip("; ")
        return (
            f"{self.estimator} on {self.case}: {ending}; {self.time.size} samples in "
            f"{self.seconds:.2g} s"
        )

    def plot(self) -> "Figure":
        """Figure of all that was estimated."""
        from workbench.pages.figures import sheet

        return sheet(run_figure(self))

    def _repr_html_(self) -> str:
        """Smallest, largest and typical values, for notebooks."""
        return f"<p>{escape(self.summary())}</p>{self.to_frame().describe().to_html()}"


def run_figure(run: Run) -> CaseFigure:
    """Describe a figure of one estimate alone, a panel for each signal."""
    panels = []
    for name, unit in run.columns.items():
        if not np.isnan(run.signal(name)).all():
            curve = Curve("2", run.signal(name), half_band(run, name, 1.0))
            curves = claimed_parts(curve, run, name)
            panels.append(Panel.around(f"{name} [{unit}]", unit, 1.0, *curves))
    panels += [panel for panel in [probability_panel([run])] if panel.curves]
    return CaseFigure(
        name=run.case,
        title=run.summary(),
        finding="",
        time=run.time,
        window=None,
        legend=(("2", run.estimator),),
        panels=tuple(panels),
    )


def probability_panel(runs: Iterable[Run]) -> Panel:
    """Probability of each mode of the estimators that weigh models, one line style each."""
    modes = [mode for run in runs for mode in run.probability.items()]
    title = "Probability of " + ", ".join(name.replace("_", " ") for name, _ in modes) + " [1]"
    curves = [
        Curve(ESTIMATORS[i % len(ESTIMATORS)], probability)
        for i, (_, probability) in enumerate(modes)
    ]
    return Panel(title, "1", -0.05, 1.05, 0.6, tuple(curves))


def claimed_parts(curve: Curve, run: Run, signal: str) -> list[Curve]:
    """A curve in up to two parts: what is claimed, and dashed what is not."""
    if signal not in run.claimed:
        return [curve]
    valid = run.claimed[signal]
    parts = (
        replace(curve, values=np.where(valid, curve.values, np.nan)),
        Curve(curve.style, np.where(valid, np.nan, curve.values), dashed=True),
    )
    return [part for part in parts if np.isfinite(part.values).any()]


def half_band(run: Run, signal: str, factor: float) -> Vector | None:
    """Half of the 95 % band of an estimated signal, in its panel's unit; None without."""
    sigma = run.deviation(signal)
    return None if np.isnan(sigma).all() else BAND * sigma / factor
