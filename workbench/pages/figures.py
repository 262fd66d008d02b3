"""Figures of recordings: panels of curves, described once and drawn twice.

To files by matplotlib here, and into the page, where they can be zoomed. Matplotlib takes longer to
load than all else together, so that it is imported where something is drawn.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from workbench.arrays import Vector
from workbench.runtime.files import replacing, warning_if_unwritable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = ("png", "svg")  # of figures as files

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
    """One line of a panel."""

    style: str  # key of LIGHT and DARK, which ties it to an entry of the legend
    values: Vector  # (n,) in the panel's unit, NaN where there is none
    # (n,) half of its band in the same unit, NaN where there is none; or None
    reach: Vector | None = None
    dashed: bool = False  # set apart from another curve of the same style


@dataclass(frozen=True)
class Panel:
    """Curves on one axis from `low` to `high`; `height` is relative to the other panels."""

    title: str
    unit: str
    low: float
    high: float
    height: float
    curves: tuple[Curve, ...]

    @classmethod
    def around(cls, title: str, unit: str, height: float, *curves: Curve) -> Self:
        """A panel that shows all of its curves, without their bands."""
        return cls(title, unit, *value_range([c.values for c in curves]), height, curves)


@dataclass(frozen=True)
class CaseFigure:
    """What the figure of a case shows."""

    # name, title: of the case
    name: str
    title: str
    finding: str  # what the figure says, for those who do not see it
    time: Vector  # (n,) [s], or of what `axis` names, rising
    # begin and end [s] of the time in which estimators are judged; None without
    window: tuple[float, float] | None
    # (style, text) of each entry; from the ninth estimator on, styles repeat
    legend: tuple[tuple[str, str], ...]
    panels: tuple[Panel, ...]  # from top to bottom
    # styles whose curves a page shows on demand, at a press of their entry of the legend
    hidden: frozenset[str] = frozenset()
    # what is at the bottom, and its unit; empty where it is a count
    axis: tuple[str, str] = ("time", "s")


def value_range(signals: Sequence[Vector], margin: float = 0.08) -> tuple[float, float]:
    """Lowest and highest value with a margin on both sides; 0 to 1 where there is none."""
    values = np.concatenate([*signals, []])  # none, where nothing was estimated
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    room = margin * (high - low) or 1.0
    return low - room, high + room


@contextmanager
def in_style(**own: Any) -> Iterator[None]:
    """Draw in the style of all, and by settings of one's own, with underscores for dots."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE | {name.replace("_", "."): value for name, value in own.items()}):
        yield


@contextmanager
def styled(width: float, height: float, **own: Any) -> Iterator["Figure"]:
    """An empty figure [inch], to be drawn on while the context lasts; see `in_style`."""
    from matplotlib.figure import Figure

    with in_style(**own):
        yield Figure(figsize=(width, height), layout="constrained")


def sheet(figure: CaseFigure) -> "Figure":
    """Draw a figure with matplotlib."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    with in_style(axes_titlesize=9, axes_titlelocation="left", svg_fonttype="none"):
        drawn = Figure(figsize=_SHEET)
        rows = drawn.subplots(
            len(figure.panels),
            1,
            sharex=True,
            squeeze=False,
            gridspec_kw=_layout([panel.height for panel in figure.panels], len(figure.legend)),
        )[:, 0]
        drawn.suptitle(f"{figure.name}: {figure.title}", fontsize=10, y=1.0 - 0.1 / _SHEET[1])
        for axes, panel in zip(rows, figure.panels, strict=True):
            for curve in panel.curves:
                colour = LIGHT[curve.style]
                line = "--" if curve.dashed else "-"
                width = {"raw": 0.5, "measured": 0.8}.get(curve.style, 1.2)
                axes.plot(figure.time, curve.values, line, color=colour, linewidth=width)
                if curve.reach is not None:
                    band = (curve.values - curve.reach, curve.values + curve.reach)
                    axes.fill_between(figure.time, *band, color=colour, alpha=0.2, linewidth=0)
            if figure.window:
                axes.axvspan(*figure.window, color=LIGHT["2"], alpha=0.05, linewidth=0)
            axes.set_title(panel.title, y=1.0)  # or all labels are measured to place it
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
    with in_style(svg_fonttype="none"):
        save_figure(drawn, paths)


def _layout(heights: Sequence[float], entries: int) -> dict[str, Any]:
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


def save_figure(sheet: "Figure", paths: Iterable[Path]) -> None:
    """Write one figure in each format, without the date, so that equal figures are equal files.

    One that cannot be written is warned of.
    """
    if layout := sheet.get_layout_engine():
        # To place the parts takes as long as to draw them, and is the same in each format.
        layout.execute(sheet)
        sheet.set_layout_engine(None)
    for path in paths:
        stamp = "Date" if path.suffix == ".svg" else "Software"
        with warning_if_unwritable(), replacing(path) as stream:
            sheet.savefig(stream, format=path.suffix[1:], dpi=110, metadata={stamp: None})
