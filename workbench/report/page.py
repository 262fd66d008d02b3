"""The page of `simulate`: one HTML file that needs nothing else, and can be read without scripts.

Numbers come from the summary, curves from the figures.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import write_whole
from workbench.report.answers import standings
from workbench.report.drawing import drawing
from workbench.report.figures import CaseFigure
from workbench.report.templates import environment
from workbench.report.views import below, called, inverse, label, rounded, window
from workbench.system import System

_SIZE = 4.5e6  # [byte] that all curves may take, so that a page opens at once
_BLOCK = 13  # [byte] two points of a noisy curve
_BLOCKS = (200, 1400)  # least and most per curve, each drawn by its extremes


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
    # A band has two edges of a quarter of the blocks.
    curves = sum(
        1.0 if curve.sigma is None else 1.5
        for figure in figures
        for panel in figure.panels
        for curve in panel.curves
    )
    blocks = int(np.clip(_SIZE / (_BLOCK * curves), *_BLOCKS))
    drawn = {figure.name: drawing(figure, blocks) for figure in figures}

    def badness(name: str) -> float:
        error = summary["cases"][name]["estimators"][best.name][f"{judged}_nrmse"]
        return -np.inf if error is None else float(error)

    text = (
        environment(lambda name: label(name, system))
        .get_template("page.html")
        .render(
            summary=summary,
            standings=ranking,
            best=best,
            order=sorted(drawn, key=badness, reverse=True),
            drawings=drawn,
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
    )
    write_whole(path, text)
