"""Figures like Figs. 8 and 9 of Schwarz et al. (2018): inputs, outputs, creep force, residual.

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
from numpy.typing import NDArray

from workbench.cosim import Run
from workbench.fmu import Vector
from workbench.objective import BANDWIDTH, braking_window
from workbench.report.results import CaseResult, label, percent

# On white and on near black; at least 3:1 to the ground as WCAG 2.2 asks of graphics, and
# differing in lightness or in the blue-yellow axis, which colour-blind readers keep.
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
    time : (n,) [s].
    window : begin and end [s] of the time in which estimators are judged; None without braking.
    legend : (style, text) of each entry; from the ninth estimator on, styles repeat.
    panels : from top to bottom.
    """

    name: str
    title: str
    finding: str
    time: Vector
    window: tuple[float, float] | None
    legend: tuple[tuple[str, str], ...]
    panels: tuple[Panel, ...]


def case_figure(result: CaseResult, roller_radius: float) -> CaseFigure:
    """Describe the figure of a case.

    Residuals are shown as they are judged: below 5 Hz.

    Parameters
    ----------
    roller_radius : [m], ends the window in which estimators are judged.
    """
    case = result.case
    names = list(result.runs)
    styles = dict(zip(names, cycle(ESTIMATORS), strict=False))
    window = braking_window(case, roller_radius)
    force, force_range = _force(result, styles)
    residual = [
        Curve(styles[name], error / 1e3)
        for name in names
        if (error := result.error(name)) is not None
    ]
    reach = _reach([np.abs(curve.values[window]) for curve in residual])
    panels = [
        _panel(
            "Speed: omegaW (solid), omegaR (dashed) [rad/s]",
            [Curve("measured", case.omegaW), Curve("measured", case.omegaR, dashed=True)],
            height=0.8,
        ),
        _panel("Brake pressure pB [bar]", [Curve("measured", case.pB / 1e5)], height=0.55),
        _panel("Drive torque tauR [kN.m]", [Curve("measured", case.tauR / 1e3)], height=0.55),
        Panel("Creep force Fx [kN]", *force_range, 1.8, tuple(force)),
        Panel(
            f"Error of Fx, estimated - measured, below {BANDWIDTH:g} Hz [kN]",
            -reach,
            reach,
            1.1,
            tuple(residual),
        ),
        Panel(
            "Friction wheel-rail muWR [1], dashed where not observable; "
            "solid near the adhesion limit, if the contact is as in the model",
            0.0,
            0.6,
            0.8,
            tuple(
                part
                for (_, run), curve in zip(
                    _knowing(result, "muWR"), _estimated(result, styles, "muWR"), strict=True
                )
                for part in _claimed(curve, run.muWR_claimed)
            ),
        ),
        Panel("Friction disc-pad muDC [1]", 0.0, 0.6, 0.8, _estimated(result, styles, "muDC")),
    ]
    legend = [("measured", "measured")]
    if case.Fx is not None:
        legend = [
            ("measured", f"measured (Fx below {BANDWIDTH:g} Hz)"),
            ("raw", "measured Fx, unfiltered"),
        ]
    legend += [(styles[name], _legend(result, name)) for name in names]
    return CaseFigure(
        name=case.name,
        title=case.title,
        finding=_finding(result),
        time=case.time,
        window=(float(case.time[window.start]), float(case.time[window.stop - 1]))
        if window.stop > window.start
        else None,
        legend=tuple(legend),
        panels=tuple(panel for panel in panels if panel.curves),
    )


def draw_case(figure: CaseFigure, paths: Iterable[Path]) -> None:
    """Draw a case with matplotlib, once, to each path (PNG or SVG by suffix)."""
    style = STYLE | {"axes.titlesize": 9, "axes.titlelocation": "left", "svg.fonttype": "none"}
    with mpl.rc_context(style):
        sheet = Figure(figsize=_SHEET)
        rows = sheet.subplots(
            len(figure.panels),
            1,
            sharex=True,
            squeeze=False,
            gridspec_kw=_placed([panel.height for panel in figure.panels], len(figure.legend)),
        )[:, 0]
        sheet.suptitle(f"{figure.name}: {figure.title}", fontsize=10, y=1.0 - 0.1 / _SHEET[1])
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
        sheet.legend(
            [Line2D([], [], color=LIGHT[style]) for style, _ in figure.legend],
            [text for _, text in figure.legend],
            loc="lower center",
            ncols=_ENTRIES,
            fontsize=8,
            frameon=False,
        )
        save_figure(sheet, paths)


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
    """Write one figure in each format, without the date, so that equal figures are equal files."""
    if layout := sheet.get_layout_engine():
        # To place the parts takes as long as to draw them, and is the same in each format.
        layout.execute(sheet)
        sheet.set_layout_engine(None)
    for path in paths:
        stamp = "Date" if path.suffix == ".svg" else "Software"
        sheet.savefig(path, dpi=110, metadata={stamp: None})


def _force(result: CaseResult, styles: dict[str, str]) -> tuple[list[Curve], tuple[float, float]]:
    """Curves of the force [kN], and the range that serves them.

    What was measured sets the range: an estimator may start or end with a spike, and the load
    cell rings at standstill.
    """
    curves = list(_estimated(result, styles, "Fx", 1e3))
    measured = result.measured_force()
    if result.case.Fx is None or measured is None:
        return curves, _range([curve.values for curve in curves])
    curves.insert(0, Curve("raw", result.case.Fx / 1e3))
    curves.append(Curve("measured", measured / 1e3))
    return curves, _range([measured / 1e3], margin=0.25)


def _knowing(result: CaseResult, signal: str) -> list[tuple[str, Run]]:
    """The estimators that know a signal."""
    return [(n, run) for n, run in result.runs.items() if np.isfinite(run.signal(signal)).any()]


def _claimed(curve: Curve, claimed: NDArray[np.bool_]) -> list[Curve]:
    """A curve in up to two parts: what is claimed, and dashed what is not."""
    parts = (
        replace(curve, values=np.where(claimed, curve.values, np.nan)),
        Curve(curve.style, np.where(claimed, np.nan, curve.values), dashed=True),
    )
    return [part for part in parts if np.isfinite(part.values).any()]


def _estimated(
    result: CaseResult, styles: dict[str, str], signal: str, unit: float = 1.0
) -> tuple[Curve, ...]:
    """One curve for each estimator that knows the signal, with its standard deviation."""
    curves = []
    for name, run in _knowing(result, signal):
        sigma = result.sigma(name, signal)
        scaled = None if sigma is None else sigma / unit
        curves.append(Curve(styles[name], run.signal(signal) / unit, scaled))
    return tuple(curves)


def _panel(title: str, curves: Sequence[Curve], height: float) -> Panel:
    return Panel(title, *_range([c.values for c in curves]), height, tuple(curves))


def _range(signals: Sequence[Vector], margin: float = 0.08) -> tuple[float, float]:
    """Lowest and highest value with a margin on both sides; 0 to 1 where there is none."""
    values = np.concatenate(signals)
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
    errors : magnitudes while braking, one array for each estimator, NaN where it failed.
    """
    peaks = sorted(float(e.max()) for e in errors if e.size and np.isfinite(e).all())
    return 1.1 * peaks[min(1, len(peaks) - 1)] if peaks else 1.0


def _legend(result: CaseResult, name: str) -> str:
    score = result.scores[name].Fx_nrmse
    return label(name) if score is None else f"{label(name)} ({percent(score)})"


def _finding(result: CaseResult) -> str:
    """Errors of the estimators, the least first."""
    judged = sorted(
        (score.Fx_nrmse, label(name), score.Fx_rms)
        for name, score in result.scores.items()
        if score.Fx_nrmse is not None and score.Fx_rms is not None
    )
    if not judged:
        reasons = sorted({score.reason for score in result.scores.values()})
        return f"Estimated, not judged: {'; '.join(reasons)}."
    share, first, rms = judged[0]
    others = ", ".join(f"{name} {percent(value)}" for value, name, _ in judged[1:])
    return f"The {first} errs least: {percent(share)} of the mean creep force, {rms:.0f} N rms" + (
        f"; {others}." if others else "."
    )
