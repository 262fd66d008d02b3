"""Machine-readable results, and the table on the terminal."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from workbench.files import write_whole
from workbench.report.answers import simulated, with_answer
from workbench.report.views import below, percent, window
from workbench.simulation import CaseResult
from workbench.system import System


def write_estimates(result: CaseResult, path: Path) -> None:
    """Write one CSV of a case; see `CaseResult.to_frame`."""
    write_numbers(result.to_frame(), path, 7)


def write_numbers(frame: pd.DataFrame, path: Path, digits: int) -> None:
    """Write a table as pandas does, in a quarter of the time: a row at once, not a number."""
    row = ",".join([f"%.{digits}g"] * frame.shape[1]) + "\n"
    rows = "".join(row % tuple(values) for values in frame.to_numpy(float).tolist())
    write_whole(path, frame.head(0).to_csv(index=False) + rows.replace("nan", ""))


def summarise_runs(
    system: System, results: Sequence[CaseResult], provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """Scores by case and estimator, weights of z, and what made them: the one source of numbers."""
    summary = {
        "provenance": provenance,
        "weights": dict(system.objective.weights),
        "cases": {result.case.name: result.to_dict() for result in results},
    }
    return with_answer(simulated(system, summary), summary)


def format_table(system: System, results: Sequence[CaseResult]) -> str:
    """Table for the terminal: error of the judged signal, rms over mean, by case and estimator."""
    names = list(results[0].runs)
    width = max(len("case"), *(len(r.case.name) for r in results))
    header = f"{'case':<{width}}" + "".join(f"{name:>22}" for name in names)
    objective = system.objective
    when = f" {objective.when}" if objective.when else ""
    limits = ", ".join(filter(None, (below(system), window(system))))
    lines = [f"Error of {objective.judged}, rms / mean{when} ({limits})", header, "-" * len(header)]
    for result in results:
        cells = [_percent(result.scores[name].nrmse) for name in names]
        lines.append(f"{result.case.name:<{width}}" + "".join(f"{cell:>22}" for cell in cells))
    lines.append("-" * len(header))
    worst = [
        max((s for s in (r.scores[name].nrmse for r in results) if s is not None), default=None)
        for name in names
    ]
    lines.append(f"{'worst':<{width}}" + "".join(f"{_percent(value):>22}" for value in worst))
    reasons = {
        f"{result.case.name}, {name}: {score.reason}"
        for result in results
        for name, score in result.scores.items()
        if score.reason
    }
    return "\n".join(lines + sorted(reasons))


def _percent(share: float | None) -> str:
    return "n/a" if share is None else percent(share)
