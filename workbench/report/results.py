"""Machine-readable results, and the table on the terminal."""

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from workbench.case import Case
from workbench.cosim import Run
from workbench.objective import Score, Weights
from workbench.observers import ESTIMATE


@dataclass(frozen=True)
class CaseResult:
    """All estimators on one case: runs and scores by estimator name."""

    case: Case
    runs: Mapping[str, Run]
    scores: Mapping[str, Score]


def write_estimates(result: CaseResult, path: Path) -> None:
    """Write one CSV of all estimates of a case: time, then `estimator.signal [unit]`.

    Signals that a method does not estimate are left out.
    """
    columns = {"time [s]": result.case.time}
    for name, run in result.runs.items():
        for signal, unit in ESTIMATE.items():
            values = run.signal(signal)
            if not np.isnan(values).all():
                columns[f"{name}.{signal} [{unit}]"] = values
    text = pd.DataFrame(columns).to_csv(index=False, float_format="%.7g")
    _write(path, text)


def write_summary(
    results: Sequence[CaseResult], weights: Weights, provenance: Mapping[str, Any], path: Path
) -> None:
    """Write summary.json: scores by case and estimator, weights of z, and what made them."""
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
    summary = {"provenance": provenance, "weights": asdict(weights), "cases": cases}
    _write(path, json.dumps(summary, indent=2) + "\n")


def _write(path: Path, text: str) -> None:
    """Write whole or not at all."""
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    with os.fdopen(handle, "w") as stream:
        stream.write(text)
    Path(name).chmod(0o644)
    Path(name).replace(path)


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
    cells = ["n/a" if value is None else f"{100 * value:.2f} %" for value in worst]
    lines.append(f"{'worst':<{width}}" + "".join(f"{cell:>22}" for cell in cells))
    reasons = {
        f"{result.case.name}, {name}: {score.reason}"
        for result in results
        for name, score in result.scores.items()
        if score.reason
    }
    return "\n".join(lines + sorted(reasons))


def _percent(score: Score) -> str:
    return "n/a" if score.Fx_nrmse is None else f"{100 * score.Fx_nrmse:.2f} %"
