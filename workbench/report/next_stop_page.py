"""The page of `next`: the experiment that parts what a diagnosis could not."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workbench.experiments import NextStop, RankedExperiment
from workbench.report.figures import ESTIMATORS, CaseFigure, Curve, Panel
from workbench.report.parts import Cell, Heading, Part, Rows, number, write_parts
from workbench.report.recordings import placed
from workbench.report.views import capital
from workbench.units import si_factor

_BAND = 2.0  # standard deviations of a block's mean


def write_next_stop_page(found: NextStop, summary: Mapping[str, Any], out: Path) -> Path:
    """Write the page into the folder; returns its path.

    Parameters
    ----------
    summary : as written to next.json.
    """
    figures = [_figure(found, one, k) for k, one in enumerate(found.proposals, 1)]
    drawn = placed(figures, summary, out)
    parts = [
        Part(
            "shown",
            "The recording to make next",
            (
                f"What each model would leave unexplained of the response, where {found.names[0]} "
                "is true, in units of the noise of a block's mean. A model that leaves the grey "
                "band is told apart.",
            ),
            recordings=tuple(drawn[:1]),
        ),
        Part("tried", "All experiments that were tried, best first", tables=(_tried(summary),)),
        Part("definitions", "Definitions", terms=_TERMS),
    ]
    if drawn[1:]:
        others = Part("others", "Other proposals", recordings=tuple(drawn[1:]))
        parts.insert(1, others)
    path = out / "index.html"
    write_parts("The next recording", summary, parts, path, file="next.json")
    return path


def _figure(found: NextStop, one: RankedExperiment, place: int) -> CaseFigure:
    """Inputs and what each model leaves by channel, at the blocks."""
    predicted = one.prediction
    time = predicted.block_time
    panels = []
    for profile in predicted.candidate.profiles:
        signal = found.system.signals[profile.input.name]
        factor = si_factor(signal.shown, signal.unit, signal.name)
        values = np.interp(time, predicted.case.time, predicted.case[signal.name]) / factor
        low, high = float(values.min()), float(values.max())
        room = 0.08 * (high - low) or 1.0
        title = f"{capital(signal.label)} {signal.name} [{signal.shown}]"
        given = (Curve("measured", values),)
        panels.append(Panel(title, signal.shown, low - room, high + room, 0.6, given))
    for c, channel in enumerate(found.channels):
        curves = tuple(
            Curve(style, left[:, c])
            for left, style in zip(predicted.left, ESTIMATORS, strict=False)
        )
        band = Curve("raw", np.zeros(time.size), np.full(time.size, _BAND))
        reach = 1.1 * max(_BAND, *(float(np.abs(curve.values).max()) for curve in curves))
        title = f"{capital(channel.label)} {channel.name}: what is left [noise]"
        panels.append(Panel(title, "noise", -reach, reach, 1.0, (band, *curves)))
    legend = [("measured", "input"), ("raw", f"±{_BAND:g} standard deviations of the noise")]
    legend += list(zip(ESTIMATORS, found.names, strict=False))
    return CaseFigure(
        name=f"Proposal {place}",
        title=capital(one.text),
        finding=f"Cost {one.cost:.3g} {one.unit}.",
        time=time,
        window=None,
        legend=tuple(legend),
        panels=tuple(panels),
    )


def _tried(summary: Mapping[str, Any]) -> Rows:
    single = len(summary["rivals"]) == 1
    unit = summary["tried"][0]["cost"]["unit"]
    told = (
        [Heading("times as sure", meaning="standard deviation of its size before over after")]
        if single
        else [Heading("separation [standard deviations]"), Heading("chance [%]")]
    )
    rows = []
    for k, one in enumerate(summary["tried"], 1):
        ends = one["deviation"]
        cells = (
            [number(ends["before"] / ends["after"], "{:.2g}".format)]
            if single
            else [
                number(one["separation"], "{:.1f}".format),
                number(100.0 * one["chance"], "{:.0f}".format, one["chance"]),
            ]
        )
        cost = number(one["cost"]["value"], "{:.3g}".format)
        rows.append((str(k), (Cell(one["experiment"]), *cells, cost)))
    columns = (
        Heading("place", number=False),
        Heading("experiment", number=False),
        *told,
        Heading(f"cost [{unit}]"),
    )
    return Rows("tried-table", "What each experiment would tell.", columns, tuple(rows))


_TERMS = {
    "Separation": "How far apart two responses stay when each model is fitted again, in standard "
    "deviations: the least of all pairs that are parted, whichever is true.",
    "Chance": "That the right cause, or its group, is then named by the diagnosis.",
    "Times as sure": "By how much the standard deviation of a size shrinks, when the recording is "
    "added to those that there are.",
}
