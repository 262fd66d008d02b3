"""Figures like Figs. 8 and 9 of Schwarz et al. (2018): inputs, outputs, what is judged, residual.

A figure is described once, as panels of curves, and drawn twice: to files by matplotlib here, and
into the page, where it can be zoomed.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from workbench.cosim import Run
from workbench.files import replacing, spared
from workbench.fmu import Vector
from workbench.objective import judged_window
from workbench.report.views import (
    below,
    called,
    label,
    per_shown,
    percent,
    rounded,
    shown_unit,
    titled,
    views,
)
from workbench.simulation import OVERCONFIDENT, CaseResult
from workbench.system import View

# On white and near black: 3:1 to the ground or more, as WCAG 2.2 asks of graphics, differing in
# lightness or in the blue-yellow axis, which colour-blind readers keep.
LIGHT = {
    "measured": "#111111",
    "raw": "#8c8c8c",
    "0": "#a3195b",
    "1": "#c26a00",
    "2": "#0060b0",
    "3": "#00795c",
    "4": "#6a3fb5",
    "5": "#7a5230",
    "6": "#5b6b00",
    "7": "#b3261e",
}
DARK = {
    "measured": "#f2f2f2",
    "raw": "#7d838c",
    "0": "#ff7eb0",
    "1": "#ffb454",
    "2": "#5cb3ff",
    "3": "#4cd1a5",
    "4": "#c3a6ff",
    "5": "#d9b08c",
    "6": "#c6d24a",
    "7": "#ff8f80",
}
ESTIMATORS = tuple(style for style in LIGHT if style.isdigit())
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "lines.linewidth": 1.0,
    "svg.hashsalt": "workbench",
}
_SHEET = (9.0, 11.0)  # [inch]
_ENTRIES = 3  # of a legend side by side


@dataclass(frozen=True)
class Curve:
    """One line of a panel.

    Attributes
    ----------
    style : key of LIGHT and DARK, which ties it to an entry of the legend.
    values : (n,) in the panel's unit, NaN where there is none.
    sigma : (n,) standard deviation in the same unit, NaN where there is none; or None.
    dashed : set apart from another curve of the same style.
    """

    style: str
    values: Vector
    sigma: Vector | None = None
    dashed: bool = False


@dataclass(frozen=True)
class Panel:
    """Curves on one axis from `low` to `high`; `height` is relative to the other panels."""

    title: str
    unit: str
    low: float
    high: float
    height: float
    curves: tuple[Curve, ...]


@dataclass(frozen=True)
class CaseFigure:
    """What the figure of a case shows.

    Attributes
    ----------
    name, title : of the case.
    finding : what the figure says, for those who do not see it.
    time : (n,) [s], or of what `axis` names, rising.
    window : begin and end [s] of the time in which estimators are judged; None without.
    legend : (style, text) of each entry; from the ninth estimator on, styles repeat.
    panels : from top to bottom.
    axis : what is at the bottom, and its unit; empty where it is a count.
    """

    name: str
    title: str
    finding: str
    time: Vector
    window: tuple[float, float] | None
    legend: tuple[tuple[str, str], ...]
    panels: tuple[Panel, ...]
    axis: tuple[str, str] = ("time", "s")


def case_figure(result: CaseResult) -> CaseFigure:
    """Describe the figure of a case.

    Residuals are shown as they are judged: below the bandwidth.
    """
    system, case = result.system, result.case
    styles = dict(zip(result.runs, cycle(ESTIMATORS), strict=False))
    window = judged_window(case, system)
    judged, panels = case.time[window], []
    for view in views(system):
        panels.append(_seen(result, styles, view))
        if system.objective.judged in view.signals:
            panels.append(_residual(result, styles, window))
    panels.append(_probabilities(result.runs.values()))
    return CaseFigure(
        name=case.name,
        title=case.title,
        finding=_finding(result),
        time=case.time,
        window=(float(judged[0]), float(judged[-1])) if judged.size else None,
        legend=tuple(_legend(result, styles)),
        panels=tuple(panel for panel in panels if panel.curves),
    )


def run_figure(run: Run) -> CaseFigure:
    """Describe a figure of one estimate alone, a panel for each signal."""
    panels = []
    for name, unit in run.columns.items():
        if not np.isnan(run.signal(name)).all():
            curve = Curve("2", run.signal(name), _known(run.deviation(name)))
            panels.append(_panel(name, unit, _claimed(curve, run, name)))
    panels += [panel for panel in [_probabilities([run])] if panel.curves]
    legend = (("2", run.estimator),)
    return CaseFigure(run.case, run.summary(), "", run.time, None, legend, tuple(panels))


def sheet(figure: CaseFigure) -> Figure:
    """Draw a figure with matplotlib."""
    own = {"axes.titlesize": 9, "axes.titlelocation": "left", "svg.fonttype": "none"}
    with mpl.rc_context(STYLE | own):
        drawn = Figure(figsize=_SHEET)
        rows = drawn.subplots(
            len(figure.panels),
            1,
            sharex=True,
            squeeze=False,
            gridspec_kw=_placed([panel.height for panel in figure.panels], len(figure.legend)),
        )[:, 0]
        drawn.suptitle(f"{figure.name}: {figure.title}", fontsize=10, y=1.0 - 0.1 / _SHEET[1])
        for axes, panel in zip(rows, figure.panels, strict=True):
            for curve in panel.curves:
                colour = LIGHT[curve.style]
                line = "--" if curve.dashed else "-"
                width = {"raw": 0.5, "measured": 0.8}.get(curve.style, 1.2)
                axes.plot(figure.time, curve.values, line, color=colour, linewidth=width)
                if curve.sigma is not None:
                    band = (curve.values - curve.sigma, curve.values + curve.sigma)
                    axes.fill_between(figure.time, *band, color=colour, alpha=0.2, linewidth=0)
            if figure.window:
                axes.axvspan(*figure.window, color=LIGHT["2"], alpha=0.05, linewidth=0)
            axes.set_title(panel.title)
            axes.set_ylim(panel.low, panel.high)
        rows[-1].set_xlim(figure.time[0], figure.time[-1])
        rows[-1].set_xlabel("time [s]")
        drawn.legend(
            [Line2D([], [], color=LIGHT[style]) for style, _ in figure.legend],
            [text for _, text in figure.legend],
            loc="lower center",
            ncols=_ENTRIES,
            fontsize=8,
            frameon=False,
        )
    return drawn


def draw_case(figure: CaseFigure, paths: Iterable[Path]) -> None:
    """Draw a case with matplotlib, once, to each path (PNG or SVG by suffix)."""
    drawn = sheet(figure)
    with mpl.rc_context(STYLE | {"svg.fonttype": "none"}):
        save_figure(drawn, paths)


def _placed(heights: Sequence[float], entries: int) -> dict[str, Any]:
    """Where panels stand on a sheet above a legend; to have it found takes longer than to draw."""
    width, height = _SHEET
    bottom, top = 0.6 + 0.17 * -(-entries // _ENTRIES), height - 0.5  # [inch]
    gap = 0.36
    panel = (top - bottom - gap * (len(heights) - 1)) / len(heights)
    return {
        "left": 0.8 / width,
        "right": 1.0 - 0.1 / width,
        "bottom": bottom / height,
        "top": top / height,
        "hspace": gap / panel,
        "height_ratios": heights,
    }


def save_figure(sheet: Figure, paths: Iterable[Path]) -> None:
    """Write one figure in each format, without the date, so that equal figures are equal files.

    One that cannot be written is warned of.
    """
    if layout := sheet.get_layout_engine():
        # To place the parts takes as long as to draw them, and is the same in each format.
        layout.execute(sheet)
        sheet.set_layout_engine(None)
    for path in paths:
        stamp = "Date" if path.suffix == ".svg" else "Software"
        with spared(), replacing(path) as stream:
            sheet.savefig(stream, format=path.suffix[1:], dpi=110, metadata={stamp: None})


def _seen(result: CaseResult, styles: dict[str, str], view: View) -> Panel:
    """One panel: what was measured of its signals, and what was estimated.

    Of the judged signal, what was measured sets the range: an estimator may start or end with a
    spike, and a sensor may ring.
    """
    system, case = result.system, result.case
    unit = shown_unit(system, view.signals[0])
    fed = {one.name for one in (*system.inputs, *system.outputs)}
    curves: list[Curve] = []
    measured = None
    for number, name in enumerate(view.signals):
        factor, judged = per_shown(system, name, unit), name == system.objective.judged
        if judged or name not in fed:
            curves += _estimated(result, styles, name, factor)
        if judged and (measured := result.measured()) is not None:
            measured = measured / factor
            if below(system):
                curves.insert(0, Curve("raw", case[name] / factor))
            curves.append(Curve("measured", measured))
        elif name in case or any(one.name == name for one in system.derived):
            values = system.signal(name, case.signals) / factor
            curves.append(Curve("measured", values, dashed=number > 0))
    signals = [curve.values for curve in curves]
    low, high = _range(signals) if measured is None else _range([measured], margin=0.25)
    return Panel(
        titled(view, unit),
        unit,
        low if view.low is None else view.low,
        high if view.high is None else view.high,
        view.height,
        tuple(curves),
    )


def _residual(result: CaseResult, styles: dict[str, str], window: slice) -> Panel:
    """Error of the judged signal by estimator."""
    system = result.system
    judged = system.objective.judged
    unit = shown_unit(system, judged)
    curves = [
        Curve(styles[name], error / per_shown(system, judged, unit))
        for name in result.runs
        if (error := result.error(name)) is not None
    ]
    reach = _reach([np.abs(curve.values[window]) for curve in curves])
    within = f", {below(system)}" if below(system) else ""
    title = f"Error of {judged}, estimated - measured{within} [{unit}]"
    return Panel(title, unit, -reach, reach, 1.1, tuple(curves))


def _probabilities(runs: Iterable[Run]) -> Panel:
    """Probability of each mode of the estimators that weigh models, one line style each."""
    modes = [one for run in runs for one in run.probability.items()]
    title = "Probability of " + ", ".join(name.replace("_", " ") for name, _ in modes) + " [1]"
    curves = [Curve(ESTIMATORS[i % len(ESTIMATORS)], one) for i, (_, one) in enumerate(modes)]
    return Panel(title, "1", -0.05, 1.05, 0.6, tuple(curves))


def _estimated(
    result: CaseResult, styles: dict[str, str], signal: str, factor: float
) -> list[Curve]:
    """Curves of each estimator that knows the signal, with its standard deviation."""
    curves = []
    for name, run in result.runs.items():
        if signal in run.columns and np.isfinite(run.signal(signal)).any():
            sigma = result.sigma(name, signal)
            scaled = None if sigma is None else sigma / factor
            curves += _claimed(
                Curve(styles[name], run.signal(signal) / factor, scaled), run, signal
            )
    return curves


def _claimed(curve: Curve, run: Run, signal: str) -> list[Curve]:
    """A curve in up to two parts: what is claimed, and dashed what is not."""
    if signal not in run.claimed:
        return [curve]
    claimed = run.claimed[signal]
    parts = (
        replace(curve, values=np.where(claimed, curve.values, np.nan)),
        Curve(curve.style, np.where(claimed, np.nan, curve.values), dashed=True),
    )
    return [part for part in parts if np.isfinite(part.values).any()]


def _known(sigma: Vector) -> Vector | None:
    """Standard deviations, or None where there is none."""
    return None if np.isnan(sigma).all() else sigma


def _panel(name: str, unit: str, curves: Sequence[Curve]) -> Panel:
    ends = _range([curve.values for curve in curves])
    return Panel(f"{name} [{unit}]", unit, *ends, 1.0, tuple(curves))


def _range(signals: Sequence[Vector], margin: float = 0.08) -> tuple[float, float]:
    """Lowest and highest value with a margin on both sides; 0 to 1 where there is none."""
    values = np.concatenate([*signals, []])  # none, where nothing was estimated
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    room = margin * (high - low) or 1.0
    return low - room, high + room


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
    system, judged = result.system, result.system.objective.judged
    entries = [("measured", "measured")]
    if judged in result.case and below(system):
        entries = [
            ("measured", f"measured ({judged} {below(system)})"),
            ("raw", f"measured {judged}, unfiltered"),
        ]
    for name, style in styles.items():
        share, text = result.scores[name].nrmse, label(name, system)
        entries.append((style, text if share is None else f"{text} ({percent(share)})"))
    return entries


def _finding(result: CaseResult) -> str:
    """Errors of the estimators, the least first."""
    system, signal = result.system, result.system.objective.judged
    judged = sorted(
        (score.nrmse, label(name, system), score.rms)
        for name, score in result.scores.items()
        if score.nrmse is not None and score.rms is not None
    )
    if not judged:
        reasons = sorted({score.reason for score in result.scores.values()})
        return f"Estimated, not judged: {'; '.join(reasons)}."
    share, first, rms = judged[0]
    others = ", ".join(f"{name} {percent(value)}" for value, name, _ in judged[1:])
    trust = "".join(
        f" The {label(name, system)} is overconfident: its innovations have {ratio:.1f} times the "
        "variance that it says."
        for name in result.runs
        if (ratio := result.surprise(name)) > OVERCONFIDENT
    )
    return (
        f"The {first} errs least: {percent(share)} of the mean {called(system, signal)}, "
        f"{rounded(rms)} {system.unit(signal)} rms" + (f"; {others}." if others else ".") + trust
    )
