"""Files of the next experiments: next.json, a table of all that were tried, a figure."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from workbench.pages.answer import Answer, Measure, with_answer
from workbench.pages.figures import ESTIMATORS, LIGHT, STYLE, CaseFigure, Curve, Panel, save_figure
from workbench.pages.measures import percentage, whole_percent
from workbench.pages.parts import Cell, Heading, Part, Rows, number, write_parts
from workbench.pages.recordings import placed
from workbench.pages.views import capital
from workbench.runtime.files import write_json, write_whole
from workbench.studies.design import NextStop, RankedExperiment
from workbench.system.units import si_factor


def write_next_stop_page(found: NextStop, summary: Mapping[str, Any], out: Path) -> Path:
    """Write the page into the folder; returns its path.

    Parameters
    ----------
    summary : as written to next.json.
    """
    figures = [_figure(found, proposal, k) for k, proposal in enumerate(found.proposals, 1)]
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


def _figure(found: NextStop, experiment: RankedExperiment, place: int) -> CaseFigure:
    """Inputs and what each model leaves by channel, at the blocks."""
    predicted = experiment.prediction
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
        title=capital(experiment.text),
        finding=f"Cost {experiment.cost:.3g} {experiment.unit}.",
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

_BAND = 2.0  # standard deviations of a block's mean


def write_next_stop(found: NextStop, provenance: Mapping[str, Any], out: Path) -> Path:
    """Write next.json, experiments.csv, the figure of the best ones and the page; returns this.

    Parameters
    ----------
    provenance : what was run.
    """
    summary = {**found.to_dict(), "provenance": provenance}
    told = with_answer(design_answer(summary), summary)
    write_json(out / "next.json", told)
    write_whole(out / "experiments.csv", found.to_frame().to_csv(index=False, float_format="%.6g"))
    figure = out / "responses.png"
    save_figure(responses_figure(found), [figure, figure.with_suffix(".svg")])
    return write_next_stop_page(found, told, out)


def responses_figure(found: NextStop) -> Figure:
    """Draw the best experiments side by side: inputs, then what each model leaves by channel."""
    system, proposals = found.system, found.proposals
    varied = proposals[0].prediction.candidate.profiles
    rows = len(varied) + len(found.channels)
    with mpl.rc_context(STYLE | {"font.size": 8}):
        sheet = Figure(figsize=(4.2 * len(proposals), 0.8 + 1.5 * rows), layout="constrained")
        panels = sheet.subplots(rows, len(proposals), sharey="row", sharex="col", squeeze=False)
        for column, proposal in enumerate(proposals):
            case, predicted = proposal.prediction.case, proposal.prediction
            title = f"{column + 1}. {proposal.text}".replace("; ", "\n")
            panels[0, column].set_title(title, fontsize=7, loc="left")
            for axes, profile in zip(panels[:, column], varied, strict=False):
                signal = system.signals[profile.input.name]
                factor = si_factor(signal.shown, signal.unit, signal.name)
                axes.plot(case.time, case[signal.name] / factor, color=LIGHT["measured"])
            for c, axes in enumerate(panels[len(varied) :, column]):
                axes.axhspan(-_BAND, _BAND, color=LIGHT["raw"], alpha=0.2, linewidth=0.0)
                for name, left, style in zip(found.names, predicted.left, ESTIMATORS, strict=False):
                    axes.plot(predicted.block_time, left[:, c], color=LIGHT[style], label=name)
            panels[-1, column].set_xlabel("time [s]")
        for axes, profile in zip(panels[:, 0], varied, strict=False):
            signal = system.signals[profile.input.name]
            axes.set_ylabel(f"{signal.name} [{signal.shown}]")
        for axes, channel in zip(panels[len(varied) :, 0], found.channels, strict=True):
            axes.set_ylabel(f"{channel.name} [noise]")
        handles, labels = panels[-1, 0].get_legend_handles_labels()
        legend = f"what each leaves where {found.names[0]} is true, in units of the noise"
        sheet.legend(
            handles,
            labels,
            loc="outside lower center",
            ncols=3,
            fontsize=7,
            frameon=False,
            title=legend,
            title_fontsize=7,
        )
    return sheet


def design_answer(summary: Mapping[str, Any]) -> Answer:
    """The answer of `next`."""
    best = summary["tried"][0]
    several = len(summary["rivals"]) > 1
    headline = {
        "cost of the best experiment": Measure(best["cost"]["value"], best["cost"]["unit"], "lower")
    }
    if several:
        headline["separation"] = Measure(best["separation"], "1", "higher")
        headline["chance that the right cause is named"] = percentage(best["chance"], "higher")
        sure = f" The right one is then named with a chance of {whole_percent(best['chance'])}."
        return Answer(summary["sentence"] + sure * summary["parts"], headline)
    before, after = best["deviation"]["before"], best["deviation"]["after"]
    headline["times as sure"] = Measure(before / after, "1", "higher")
    return Answer(summary["sentence"], headline)
