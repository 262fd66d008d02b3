"""Machine-readable results, and the table on the terminal."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from workbench.case import Case
from workbench.cosim import Run
from workbench.files import write_whole
from workbench.fmu import Vector
from workbench.objective import Score, Weights, low_pass
from workbench.observers import ESTIMATE


@dataclass(frozen=True)
class CaseResult:
    """All estimators on one case: runs and scores by estimator name."""

    case: Case
    runs: Mapping[str, Run]
    scores: Mapping[str, Score]

    def measured_force(self) -> Vector | None:
        """Creep force as it judges, below 5 Hz [N], (n,); None where it was not measured."""
        return None if self.case.Fx is None else low_pass(self.case.time, self.case.Fx)

    def error(self, name: str) -> Vector | None:
        """Estimated minus measured creep force below 5 Hz [N], (n,); None without measurement."""
        if self.case.Fx is None:
            return None
        return low_pass(self.case.time, self.runs[name].signal("Fx") - self.case.Fx)

    def sigma(self, name: str, signal: str) -> Vector | None:
        """Standard deviation of an estimated signal, (n,); None for a method without."""
        sigma: Vector = self.runs[name].sigma[:, list(ESTIMATE).index(signal)]
        return None if np.isnan(sigma).all() else sigma


def write_estimates(result: CaseResult, path: Path) -> None:
    """Write one CSV of a case, all that its figure shows: time, then `source.signal [unit]`.

    The source is `measured` or an estimator. Signals that a method does not estimate are left out;
    `Fx_5Hz` and `Fx_error` are below 5 Hz, `sigma_...` are standard deviations, `muWR_claimed` is 1
    where muWR is near enough to the adhesion limit to be observable.
    """
    case = result.case
    columns = {
        "time [s]": case.time,
        "measured.pB [Pa]": case.pB,
        "measured.tauR [N.m]": case.tauR,
        "measured.omegaW [rad/s]": case.omegaW,
        "measured.omegaR [rad/s]": case.omegaR,
    }
    measured = result.measured_force()
    if case.Fx is not None and measured is not None:
        columns |= {"measured.Fx [N]": case.Fx, "measured.Fx_5Hz [N]": measured}
    for name, run in result.runs.items():
        for signal, unit in ESTIMATE.items():
            values, sigma = run.signal(signal), result.sigma(name, signal)
            if not np.isnan(values).all():
                columns[f"{name}.{signal} [{unit}]"] = values
            if sigma is not None:
                columns[f"{name}.sigma_{signal} [{unit}]"] = sigma
        if not np.isnan(run.signal("muWR")).all():
            columns[f"{name}.muWR_claimed [1]"] = run.muWR_claimed.astype(int)
        error = result.error(name)
        if error is not None:
            columns[f"{name}.Fx_error [N]"] = error
    text = pd.DataFrame(columns).to_csv(index=False, float_format="%.7g")
    write_whole(path, text)


def summarise(
    results: Sequence[CaseResult], weights: Weights, provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """Scores by case and estimator, weights of z, and what made them: the one source of numbers."""
    cases = {
        result.case.name: {
            "title": result.case.title,
            "estimators": {
                name: {
                    "Fx_rms_N": score.Fx_rms,
                    "Fx_nrmse": score.Fx_nrmse,
                    "z": score.z,
                    "outcome": result.runs[name].outcome.name,
                    "reason": score.reason,
                    "seconds": round(result.runs[name].seconds, 4),
                }
                for name, score in result.scores.items()
            },
        }
        for result in results
    }
    return {"provenance": provenance, "weights": asdict(weights), "cases": cases}


def label(name: str) -> str:
    """Name of an estimator for people.

    >>> label("open_loop"), label("ekf")
    ('open loop', 'extended Kalman filter')
    """
    full = {"ekf": "extended Kalman filter", "ukf": "unscented Kalman filter"}
    return full.get(name, name.replace("_", " "))


def percent(share: float) -> str:
    """A share in percent, as tables and figures give it.

    >>> percent(0.01117)
    '1.12 %'
    """
    return f"{100 * share:.2f} %"


def format_table(results: Sequence[CaseResult]) -> str:
    """Table for the terminal: error of the creep force, rms over mean, by case and estimator."""
    estimators = list(results[0].runs)
    width = max(len("case"), *(len(r.case.name) for r in results))
    header = f"{'case':<{width}}" + "".join(f"{name:>22}" for name in estimators)
    lines = [
        "Error of Fx, rms / mean while braking (below 5 Hz, first pressure to 1 m/s)",
        header,
        "-" * len(header),
    ]
    for result in results:
        cells = [_percent(result.scores[name]) for name in estimators]
        lines.append(f"{result.case.name:<{width}}" + "".join(f"{cell:>22}" for cell in cells))
    lines.append("-" * len(header))
    worst = [
        max((s for s in (r.scores[name].Fx_nrmse for r in results) if s is not None), default=None)
        for name in estimators
    ]
    cells = ["n/a" if value is None else percent(value) for value in worst]
    lines.append(f"{'worst':<{width}}" + "".join(f"{cell:>22}" for cell in cells))
    reasons = {
        f"{result.case.name}, {name}: {score.reason}"
        for result in results
        for name, score in result.scores.items()
        if score.reason
    }
    return "\n".join(lines + sorted(reasons))


def _percent(score: Score) -> str:
    return "n/a" if score.Fx_nrmse is None else percent(score.Fx_nrmse)
