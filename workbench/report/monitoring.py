"""Files of condition monitoring: summary.json, tables, a figure of the history, the page."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from workbench.files import write_json, write_whole
from workbench.fmu import Vector
from workbench.lab import BAND
from workbench.monitoring import Monitored, Track
from workbench.report.answers import watched, with_answer
from workbench.report.figures import LIGHT, STYLE, save_figure
from workbench.report.monitoring_page import write_monitoring_page

_COLUMNS = 4  # of panels
_POINT, _LEVEL, _ALARM = LIGHT["2"], LIGHT["measured"], LIGHT["7"]


def write_monitored(found: Monitored, provenance: Mapping[str, Any], out: Path) -> Path:
    """Write all files; returns the page.

    Parameters
    ----------
    provenance : what was run.
    """
    summary = {**found.to_dict(), "provenance": provenance}
    told = with_answer(watched(summary), summary)
    write_json(out / "summary.json", told)
    for name, frame in (
        ("estimates", found.to_frame()),
        ("alarms", found.alarms()),
        ("work", found.worked()),
    ):
        write_whole(out / f"{name}.csv", frame.to_csv(index=False, float_format="%.8g"))
    figure = out / "history.png"
    save_figure(history_figure(found), [figure, figure.with_suffix(".svg")])
    return write_monitoring_page(found, told, out)


def history_figure(found: Monitored) -> Figure:
    """Draw each quantity over the recordings: estimates, levels, changes and alarms."""
    tracks = [one for one in found.tracks if np.isfinite(one.values).any()]
    rows = -(-len(tracks) // _COLUMNS)
    with mpl.rc_context(STYLE | {"font.size": 8}):
        sheet = Figure(figsize=(11.0, 0.8 + 1.5 * rows), layout="constrained")
        panels = list(sheet.subplots(rows, _COLUMNS, sharex=True, squeeze=False).flat)
        heights = _heights(tracks)
        for axes, track in zip(panels, tracks, strict=False):
            middle = float(np.nanmedian(track.values))
            _draw(axes, track, found)
            height = heights[track.against, track.unit]
            axes.set_ylim(middle - height, middle + height)
            axes.set_title(f"{track.label} [{track.unit}]".replace(" [1]", ""), fontsize=7)
        for axes in panels[len(tracks) :]:
            axes.set_visible(False)
        sheet.supxlabel(f"recording, {found.names[0]} to {found.names[-1]}")
        sheet.suptitle(
            "Estimates with 95 % bands, levels, changes (dashed, with 95 % range) and alarms (line)"
        )
    return sheet


def _heights(tracks: list[Track]) -> dict[tuple[bool, str], float]:
    """Half the range of panels by what they show: the same for all that are alike."""
    heights: dict[tuple[bool, str], float] = {}
    for track in tracks:
        away = np.nanmax(np.abs(track.values - np.nanmedian(track.values)) + _half(track))
        key = track.against, track.unit
        heights[key] = max(heights.get(key, 0.0), 1.1 * float(away))
    return heights


def _half(track: Track) -> Vector:
    """Half of the 95 % band of each estimate."""
    scale = float(np.sqrt(np.nan_to_num(track.scatter, nan=1.0)))
    half: Vector = BAND * scale * track.deviations
    return half


def _draw(axes: Axes, track: Track, found: Monitored) -> None:
    numbers = np.arange(1, len(found.names) + 1)
    axes.errorbar(
        numbers,
        track.values,
        _half(track),
        fmt=".",
        color=_POINT,
        ecolor=LIGHT["raw"],
        elinewidth=0.6,
        markersize=4,
    )
    begin = 0.5
    for change in track.changes:
        end = change.last + 1.5
        axes.hlines(change.before[0], begin, end, color=_LEVEL)
        axes.axvspan(change.earliest + 1.0, change.latest + 2.0, color=_ALARM, alpha=0.12)
        axes.axvline(end, color=_ALARM, linestyle="--", linewidth=0.8)
        axes.axvline(change.raised + 1.0, color=_ALARM, linewidth=1.2)
        begin = end
    if np.isfinite(track.level[0]):
        axes.hlines(track.level[0], begin, numbers[-1] + 0.5, color=_LEVEL)
