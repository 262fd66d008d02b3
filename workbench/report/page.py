"""The page of `simulate`: one HTML file that needs nothing else, and can be read without scripts.

Numbers come from the summary, curves from the figures.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import write_whole
from workbench.report.answers import standings
from workbench.report.figures import CaseFigure
from workbench.report.recordings import placed
from workbench.report.templates import rendered
from workbench.report.views import below, called, inverse, label, rounded, window
from workbench.system import System


def write_page(
    system: System,
    summary: Mapping[str, Any],
    figures: Sequence[CaseFigure],
    planned: int,
    path: Path,
) -> None:
    """Write the page; files of each case are expected beside it.

    Parameters
    ----------
    summary : as written to summary.json.
    figures : one per case of the summary.
    planned : number of cases that were asked for; more than there are after an interruption.
    """
    judged = system.objective.judged
    ranking = standings(summary, judged)
    best = ranking[0]

    def badness(name: str) -> float:
        error = summary["cases"][name]["estimators"][best.name][f"{judged}_nrmse"]
        return -np.inf if error is None else float(error)

    by_name = {figure.name: figure for figure in figures}
    order = sorted(by_name, key=badness, reverse=True)
    drawn = placed([by_name[name] for name in order], summary, path.parent)
    text = rendered(
        "page.html",
        summary,
        lambda name: label(name, system),
        standings=ranking,
        best=best,
        order=order,
        drawings=dict(zip(order, drawn, strict=True)),
        planned=planned,
        judged=judged,
        unit=system.unit(judged),
        called=called(system, judged),
        when=system.objective.when or window(system),
        window=window(system),
        below=below(system),
        fed=judged in (one.name for one in system.outputs),
        rounded=rounded,
        weights=[
            (weight, inverse(system.unit(name)), name)
            for name, weight in system.objective.weights.items()
        ],
    )
    write_whole(path, text)
