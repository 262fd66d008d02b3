"""The page of `simulate`: one HTML file that needs nothing else, and can be read without scripts.

Numbers come from the summary, curves from the figures. A panel of a figure is an `svg` of its own,
whose view box is time [ms] by value; zooming is a change of that view box.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from workbench.fmu import Vector
from workbench.objective import BANDWIDTH, FIRST_PRESSURE, LOWEST_SPEED
from workbench.report.figures import DARK, LIGHT, CaseFigure, Curve, Panel
from workbench.report.results import _write, label, percent

_SIZE = 4.5e6  # [byte] that all curves may take, so that a page opens at once
_BLOCK = 13  # [byte] two points of a noisy curve
_BLOCKS = (200, 1400)  # least and most per curve, each drawn by its extremes
_LEVELS = 4000  # units of a panel's height: 1 % of it can be zoomed to full height
_LEFT, _WIDTH, _RIGHT = 58, 890, 12  # of the panels [px]
_HEIGHT = 110  # of a panel of height 1 [px]
_HEAD, _FOOT = 24, 40  # room for a panel's title, for the time axis [px]


@dataclass(frozen=True)
class Standing:
    """How one estimator did on all cases; None where no case could be judged.

    Attributes
    ----------
    name : key in the summary.
    worst, median : error of Fx, rms over mean [1].
    case : where it was worst.
    z : largest objective z_k [1].
    judged : number of cases with an error.
    seconds : wall time of all its runs.
    """

    name: str
    worst: float | None
    median: float | None
    case: str
    z: float | None
    judged: int
    seconds: float


def standings(summary: Mapping[str, Any]) -> list[Standing]:
    """Estimators, the one with the least worst case first; those never judged last."""
    cases: Mapping[str, Any] = summary["cases"]
    names = list(next(iter(cases.values()))["estimators"])
    table = []
    for name in names:
        scores = {case: values["estimators"][name] for case, values in cases.items()}
        errors = {case: s["Fx_nrmse"] for case, s in scores.items() if s["Fx_nrmse"] is not None}
        worst = max(errors, key=lambda case: errors[case], default="")
        table.append(
            Standing(
                name=name,
                worst=errors.get(worst),
                median=median(errors.values()) if errors else None,
                case=worst,
                z=max((s["z"] for s in scores.values() if s["z"] is not None), default=None),
                judged=len(errors),
                seconds=sum(s["seconds"] for s in scores.values()),
            )
        )
    # One that fails on a hard case must not win by having been judged on the easy ones.
    return sorted(table, key=lambda s: (-s.judged, s.worst if s.worst is not None else np.inf))


def write_page(
    summary: Mapping[str, Any], figures: Sequence[CaseFigure], planned: int, path: Path
) -> None:
    """Write the page; files of each case are expected beside it.

    Parameters
    ----------
    summary : as written to summary.json.
    figures : one per case of the summary.
    planned : number of cases that were asked for; more than there are after an interruption.
    """
    ranking = standings(summary)
    best = ranking[0]
    # A band has two edges of a quarter of the blocks.
    curves = sum(
        1.0 if curve.sigma is None else 1.5
        for figure in figures
        for panel in figure.panels
        for curve in panel.curves
    )
    blocks = int(np.clip(_SIZE / (_BLOCK * curves), *_BLOCKS))
    drawn = {figure.name: _drawing(figure, blocks) for figure in figures}

    def badness(name: str) -> float:
        error = summary["cases"][name]["estimators"][best.name]["Fx_nrmse"]
        return -np.inf if error is None else float(error)

    environment = Environment(
        autoescape=True,
        loader=PackageLoader("workbench", "report"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "label": label,
        "percent": percent,
        "anchor": _anchor,
        "significant": _significant,
    }
    text = environment.get_template("page.html").render(
        summary=summary,
        standings=ranking,
        best=best,
        order=sorted(drawn, key=badness, reverse=True),
        drawings=drawn,
        planned=planned,
        colours={"light": LIGHT, "dark": DARK},
        bandwidth=BANDWIDTH,
        first_pressure=FIRST_PRESSURE / 1e5,
        lowest_speed=LOWEST_SPEED,
    )
    _write(path, text)


def _anchor(name: str) -> str:
    return re.sub(r"\s", "_", name)


def _significant(value: object) -> str:
    """A setting, in a column if it is a number."""
    return f"{value:>9.4g}" if isinstance(value, (int, float)) else str(value)


def _drawing(figure: CaseFigure, blocks: int) -> dict[str, Any]:
    """Geometry of a figure for the template, in pixels, and in the units of the panels inside."""
    begin, end = float(figure.time[0]), float(figure.time[-1])
    panels = []
    top = 0
    for panel in figure.panels:
        height = round(_HEIGHT * panel.height)
        top += _HEAD
        panels.append(
            {
                "title": panel.title,
                "top": top,
                "height": height,
                "low": panel.low,
                "high": panel.high,
                "ticks": [
                    (top + height * (panel.high - value) / (panel.high - panel.low), text)
                    for value, text in _ticks(panel.low, panel.high, max(3, height // 28))
                ],
                "zero": round(_LEVELS * panel.high / (panel.high - panel.low))
                if panel.low < 0 < panel.high
                else None,
                "curves": [_curve(figure.time, curve, panel, blocks) for curve in panel.curves],
            }
        )
        top += height
    return {
        "figure": figure,
        "left": _LEFT,
        "width": _WIDTH,
        "total": _LEFT + _WIDTH + _RIGHT,
        "bottom": top,
        "height": top + _FOOT,
        "levels": _LEVELS,
        "begin": begin,
        "duration": round(1e3 * (end - begin)),
        "window": None
        if figure.window is None
        else [round(1e3 * (edge - begin)) for edge in figure.window],
        "ticks": [
            (_LEFT + _WIDTH * (value - begin) / (end - begin), text)
            for value, text in _ticks(begin, end, 12)
        ],
        "panels": panels,
    }


def _ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    values = MaxNLocator(most, steps=[1, 2, 5, 10]).tick_values(low, high)
    inside = [float(value) for value in values if low <= value <= high]
    return [(value, f"{value:.6g}".replace("-", "\N{MINUS SIGN}")) for value in inside]


def _curve(time: Vector, curve: Curve, panel: Panel, blocks: int) -> dict[str, Any]:
    """Path of a curve, and of the band of one standard deviation if it has one."""
    milliseconds = np.rint(1e3 * (time - time[0]))
    scale = _LEVELS / (panel.high - panel.low)

    def levels(values: Vector) -> Vector:
        # Values far outside are seen nowhere; cut, they cost fewer digits.
        return np.clip(np.rint((panel.high - values) * scale), -_LEVELS, 2 * _LEVELS)

    kept = extremes(curve.values, blocks)
    x, y = milliseconds[kept], levels(curve.values[kept])
    known = np.isfinite(y)
    runs = np.split(np.arange(y.size), np.flatnonzero(np.diff(known)) + 1)
    band = ""
    if curve.sigma is not None:
        kept = extremes(curve.values, blocks // 4)
        kept = kept[np.isfinite(curve.values[kept] + curve.sigma[kept])]
        if kept.size:
            values, sigma, there = curve.values[kept], curve.sigma[kept], milliseconds[kept]
            edges = np.r_[levels(values + sigma), levels(values - sigma)[::-1]]
            band = _path(np.r_[there, there[::-1]], edges) + "z"
    return {
        "style": curve.style,
        "dashed": curve.dashed,
        "path": "".join(_path(x[run], y[run]) for run in runs if known[run[0]]),
        "band": band,
    }


def extremes(values: Vector, blocks: int) -> NDArray[np.intp]:
    """Indices of the lowest and highest value of each block, and of both ends.

    A curve through them covers the same pixels as the whole curve as long as a block is no wider
    than a pixel. A block with a NaN is a gap.

    >>> extremes(np.array([0.0, 5.0, 1.0, 2.0, 2.0, 9.0, 3.0, 4.0]), 2)
    array([0, 1, 4, 5, 7])
    """
    size = -(-values.size // blocks)
    first = np.arange(0, values.size, size)
    table = np.pad(values, (0, first.size * size - values.size), mode="edge")
    table = table.reshape(first.size, size)
    kept = np.r_[0, first + table.argmin(axis=1), first + table.argmax(axis=1), values.size - 1]
    return np.unique(np.minimum(kept, values.size - 1))


def _path(x: Vector, y: Vector) -> str:
    """Path through points on a grid of whole numbers, in relative steps, which are short."""
    dx, dy = np.diff(x), np.diff(y)
    # A point on the way from one neighbour to the other adds nothing.
    straight = (dx[:-1] * dy[1:] == dx[1:] * dy[:-1]) & (dx[:-1] * dx[1:] + dy[:-1] * dy[1:] >= 0)
    kept = np.r_[0, np.flatnonzero(~straight) + 1, x.size - 1]
    points = np.column_stack([x[kept], y[kept]]).astype(int)
    steps = " ".join(map(str, np.diff(points, axis=0).ravel()))
    return f"M{points[0, 0]} {points[0, 1]}l{steps}".replace(" -", "-")
