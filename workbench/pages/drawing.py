"""A figure of a recording as geometry for a page, where it can be zoomed and read.

A panel of a figure is an `svg` of its own, whose view box is time [ms] by value; zooming is a
change of that view box, and curves are drawn anew from all samples, which come along.
"""

import base64
import json
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Vector
from workbench.pages.figures import CaseFigure, Curve, Panel

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
