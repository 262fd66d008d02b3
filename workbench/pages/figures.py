"""Figures of recordings: panels of curves, described once and drawn twice.

To files by matplotlib, and into the page, where they can be zoomed: there a panel is an `svg` of
its own, whose view box is time [ms] by value; zooming is a change of that view box, and curves are
drawn anew from all samples, which come along. Matplotlib takes longer to load than all else
together, so that it is imported where something is drawn.
"""

import base64
import json
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

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

    def __post_init__(self) -> None:
        """Give a panel without a height, as of nothing but zeros, that of 1 to both sides."""
        if not self.low < self.high:
            low, high = value_range([np.array([self.low, self.high])])
            object.__setattr__(self, "low", low)
            object.__setattr__(self, "high", high)

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


_CODES = 65534
_NONE = 65535
_TICKS = 2**32 - 1  # of the time from the first to the last sample


def pack_samples(figure: CaseFigure) -> tuple[str, str]:
    """All samples of a figure: ranges of the channels as JSON, and their codes.

    The first two channels are the high and the low half of the time in ticks of the whole; then
    come values and, where there are any, halves of bands, curve by curve.
    """
    begin, end = float(figure.time[0]), float(figure.time[-1])
    ticks = np.rint((figure.time - begin) / (end - begin) * _TICKS).astype(np.uint64)
    rows = [(ticks >> 16).astype(np.uint16), (ticks & 0xFFFF).astype(np.uint16)]
    curves: list[list[list[float]]] = []
    for panel in figure.panels:
        for curve in panel.curves:
            ranges = []
            for values in (curve.values, curve.reach):
                if values is not None:
                    codes, low, high = _codes(values)
                    rows.append(codes)
                    ranges.append([low, high])
            curves.append(ranges)
    header = json.dumps({"samples": figure.time.size, "curves": curves}, separators=(",", ":"))
    return header, base64.b64encode(zlib.compress(_planes(rows), 9)).decode()


def _codes(values: Vector) -> tuple[NDArray[np.uint16], float, float]:
    """Codes of a channel, and its lowest and highest value; 0 and 0 where it has none."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(values.size, _NONE, np.uint16), 0.0, 0.0
    low, high = float(values[known].min()), float(values[known].max())
    share = (np.where(known, values, low) - low) / ((high - low) or 1.0)
    return np.where(known, np.rint(share * _CODES), _NONE).astype(np.uint16), low, high


def _planes(rows: Sequence[NDArray[np.uint16]]) -> bytes:
    """Differences of each row, small ones as small numbers, low bytes first."""
    table = np.stack(rows)
    steps = np.diff(table, axis=1, prepend=np.uint16(0)).astype(np.int16).astype(np.int32)
    folded = ((steps << 1) ^ (steps >> 31)).astype(np.uint16)
    return (folded & 0xFF).astype(np.uint8).tobytes() + (folded >> 8).astype(np.uint8).tobytes()


_LEVELS = 4000  # units of a panel's height: 1 % of it can be zoomed to full height
_LEFT, _WIDTH, _RIGHT = 58, 890, 40  # of the panels [px]
_BLOCKS = 450  # of a curve before it is drawn anew, each by its extremes: a pixel each
_MOST = 2_400_000  # [byte] of a figure's samples; of longer ones only the extremes are drawn
FURTHER = {"m/s": ("km/h", 3.6)}  # units that people read beside the one of a panel
_HEIGHT = 110  # of a panel of height 1 [px]
_HEAD, _FOOT = 24, 40  # room for a panel's title, for the time axis [px]


def drawing(figure: CaseFigure) -> dict[str, Any]:
    """Geometry of a figure for the template, in pixels, and in the units of the panels inside."""
    header, samples = pack_samples(figure)
    whole = len(samples) <= _MOST
    begin, end = float(figure.time[0]), float(figure.time[-1])
    panels: list[dict[str, Any]] = []
    top = 0
    for panel in figure.panels:
        height = round(_HEIGHT * panel.height)
        top += _HEAD
        panels.append(
            {
                "title": panel.title,
                "unit": panel.unit,
                "further": _further(panel, top, height),
                "top": top,
                "height": height,
                "low": panel.low,
                "high": panel.high,
                "ticks": [
                    (top + height * (panel.high - value) / (panel.high - panel.low), text)
                    for value, text in ticks_within(panel.low, panel.high, max(3, height // 28))
                ],
                "zero": round(_LEVELS * panel.high / (panel.high - panel.low))
                if panel.low < 0 < panel.high
                else None,
                "curves": [_curve(figure.time, curve, panel) for curve in panel.curves],
            }
        )
        top += height
    drawn = [curve for panel in panels for curve in panel["curves"]]
    size = sum(len(curve["path"]) + len(curve["band"]) for curve in drawn)
    return {
        "figure": figure,
        "size": (len(samples) if whole else 0) + size,  # [byte] about, on the page
        "told": header,
        "samples": samples if whole else "",
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
            for value, text in ticks_within(begin, end, 12)
        ],
        "panels": panels,
    }


def ticks_within(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Round values from low to high, at most so many, each with its text."""
    from matplotlib.ticker import MaxNLocator  # loaded where something is drawn

    values = MaxNLocator(most, steps=[1, 2, 5, 10]).tick_values(low, high)
    inside = [float(value) for value in values if low <= value <= high]
    return [(value, f"{value:.6g}".replace("-", "\N{MINUS SIGN}")) for value in inside]


def _further(panel: Panel, top: float, height: float) -> dict[str, Any] | None:
    """Ticks of a further unit at the right, None where there is none."""
    if panel.unit not in FURTHER:
        return None
    unit, factor = FURTHER[panel.unit]
    low, high = factor * panel.low, factor * panel.high
    ticks = [
        (top + height * (high - value) / (high - low), text)
        for value, text in ticks_within(low, high, max(3, round(height) // 28))
    ]
    return {"unit": unit, "factor": factor, "ticks": ticks}


def _curve(time: Vector, curve: Curve, panel: Panel) -> dict[str, Any]:
    """Path of a curve, and of the band of one standard deviation if it has one."""
    milliseconds = np.rint(1e3 * (time - time[0]))
    scale = _LEVELS / (panel.high - panel.low)

    def levels(values: Vector) -> Vector:
        # Values far outside are seen nowhere; cut, they cost fewer digits.
        return np.clip(np.rint((panel.high - values) * scale), -_LEVELS, 2 * _LEVELS)

    kept = extremes(curve.values, _BLOCKS)
    x, y = milliseconds[kept], levels(curve.values[kept])
    known = np.isfinite(y)
    runs = np.split(np.arange(y.size), np.flatnonzero(np.diff(known)) + 1)
    band = ""
    if curve.reach is not None:
        kept = extremes(curve.values, _BLOCKS // 2)
        kept = kept[np.isfinite(curve.values[kept] + curve.reach[kept])]
        if kept.size:
            values, reach, there = curve.values[kept], curve.reach[kept], milliseconds[kept]
            edges = np.r_[levels(values + reach), levels(values - reach)[::-1]]
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
