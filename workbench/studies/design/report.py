"""Files of the next experiments: next.json, a table of all that were tried, a figure, the page."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.pages.answer import Answer, Measure, percentage, whole_percent, with_answer
from workbench.pages.figures import (
    ESTIMATORS,
    LIGHT,
    CaseFigure,
    Curve,
    Panel,
    save_figure,
    styled,
)
from workbench.pages.parts import Definitions, Numbers, Page, Part, Table, number, zoomable
from workbench.pages.views import capital
from workbench.recordings.csv import csv_text
from workbench.runtime.files import write_json, write_whole
from workbench.studies.design import NextStop, RankedExperiment
from workbench.system.units import si_factor

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BAND = 2.0  # standard deviations of a block's mean
_TERMS = {
    "Separation": "How far apart two responses stay when each model is fitted again, in standard "
    "deviations: the least of all pairs that are parted, whichever is true.",
    "Chance": "That the right cause, or its group, is then named by the diagnosis.",
    "Precision gain": "By how much the standard deviation of a size shrinks, when the recording is "
    "added to those that there are.",
}


def write_next_stop(proposal: NextStop, provenance: Mapping[str, Any], out: Path) -> Path:
    """Write next.json, experiments.csv, the figure of the best ones and the page; returns this."""
    content = {**proposal.to_dict(), "provenance": provenance}
    summary = with_answer(design_answer(content), content)
    write_json(out / "next.json", summary)
    write_whole(out / "experiments.csv", csv_text(proposal.to_frame()))
    save_figure(responses_figure(proposal), [out / "responses.png", out / "responses.svg"])
    return write_next_stop_page(proposal, summary, out)


def design_answer(summary: Mapping[str, Any]) -> Answer:
    """The answer of `next`."""
    best = summary["tried"][0]
    headline = {
        "cost of the best experiment": Measure(best["cost"]["value"], best["cost"]["unit"], "lower")
    }
    if len(summary["rivals"]) > 1:
        headline["separation"] = Measure(best["separation"], "1", "higher")
        headline["chance that the right cause is named"] = percentage(best["chance"], "higher")
        sure = f" The right one is then named with a chance of {whole_percent(best['chance'])}."
        return Answer(summary["sentence"] + sure * summary["parts"], headline)
    before, after = best["deviation"]["before"], best["deviation"]["after"]
    headline["precision gain"] = Measure(before / after, "1", "higher")
    return Answer(summary["sentence"], headline)


def responses_figure(proposal: NextStop) -> "Figure":
    """Draw the best experiments side by side: inputs, then what each model leaves by channel."""
    system, best = proposal.system, proposal.proposals
    varied = best[0].prediction.candidate.profiles
    rows = len(varied) + len(proposal.channels)
    with styled(4.2 * len(best), 0.8 + 1.5 * rows, font_size=8) as sheet:
        panels = sheet.subplots(rows, len(best), sharey="row", sharex="col", squeeze=False)
        for column, experiment in enumerate(best):
            prediction = experiment.prediction
            case = prediction.case
            title = f"{column + 1}. {experiment.text}".replace("; ", "\n")
            panels[0, column].set_title(title, fontsize=7, loc="left")
            for axes, profile in zip(panels[:, column], varied, strict=False):
                signal = system.signals[profile.input.name]
                factor = si_factor(signal.shown, signal.unit, signal.name)
                axes.plot(case.time, case[signal.name] / factor, color=LIGHT["measured"])
            for c, axes in enumerate(panels[len(varied) :, column]):
                axes.axhspan(-_BAND, _BAND, color=LIGHT["raw"], alpha=0.2, linewidth=0.0)
                curves = zip(proposal.names, prediction.left, ESTIMATORS, strict=False)
                for name, left, style in curves:
                    axes.plot(prediction.block_time, left[:, c], color=LIGHT[style], label=name)
            panels[-1, column].set_xlabel("time [s]")
        for axes, profile in zip(panels[:, 0], varied, strict=False):
            signal = system.signals[profile.input.name]
            axes.set_ylabel(f"{signal.name} [{signal.shown}]")
        for axes, channel in zip(panels[len(varied) :, 0], proposal.channels, strict=True):
            axes.set_ylabel(f"{channel.name} [noise]")
        sheet.legend(
            *panels[-1, 0].get_legend_handles_labels(),
            loc="outside lower center",
            ncols=3,
            fontsize=7,
            frameon=False,
            title=f"what each leaves where {proposal.names[0]} is true, in units of the noise",
            title_fontsize=7,
        )
    return sheet


def write_next_stop_page(proposal: NextStop, summary: Mapping[str, Any], out: Path) -> Path:
    """Write the page into the folder; returns its path."""
    figures = [_figure(proposal, best, k) for k, best in enumerate(proposal.proposals, 1)]
    first, *others = zoomable(figures, summary, out)
    shown = (
        f"What each model would leave unexplained of the response, where {proposal.names[0]} is "
        "true, in units of the noise of a block's mean. A model that leaves the grey band is "
        "discriminated."
    )
    parts = [
        Part("shown", "The recording to make next", [shown, first]),
        Part("tried", "All experiments that were tried, best first", [_experiments(summary)]),
        Part("definitions", "Definitions", [Definitions(_TERMS)]),
    ]
    if others:
        parts.insert(1, Part("others", "Other proposals", others))
    return Page("The next recording", parts, "next.json").write(summary, out / "index.html")


def _figure(proposal: NextStop, experiment: RankedExperiment, place: int) -> CaseFigure:
    prediction = experiment.prediction
    time = prediction.block_time
    panels = []
    for profile in prediction.candidate.profiles:
        signal = proposal.system.signals[profile.input.name]
        factor = si_factor(signal.shown, signal.unit, signal.name)
        values = np.interp(time, prediction.case.time, prediction.case[signal.name]) / factor
        title = f"{capital(signal.label)} {signal.name} [{signal.shown}]"
        panels.append(Panel.around(title, signal.shown, 0.6, Curve("measured", values)))
    for c, channel in enumerate(proposal.channels):
        curves = tuple(
            Curve(style, left[:, c])
            for left, style in zip(prediction.left, ESTIMATORS, strict=False)
        )
        band = Curve("raw", np.zeros(time.size), np.full(time.size, _BAND))
        reach = 1.1 * max(_BAND, *(float(np.abs(curve.values).max()) for curve in curves))
        title = f"{capital(channel.label)} {channel.name}: prediction error [noise]"
        panels.append(Panel(title, "noise", -reach, reach, 1.0, (band, *curves)))
    legend = [("measured", "input"), ("raw", f"±{_BAND:g} standard deviations of the noise")]
    legend += list(zip(ESTIMATORS, proposal.names, strict=False))
    return CaseFigure(
        name=f"Proposal {place}",
        title=capital(experiment.text),
        finding=f"Cost {experiment.cost:.3g} {experiment.unit}.",
        time=time,
        window=None,
        legend=tuple(legend),
        panels=tuple(panels),
    )


def _experiments(summary: Mapping[str, Any]) -> Table:
    single = len(summary["rivals"]) == 1
    columns: list[object] = ["place", "experiment"]
    if single:
        columns.append(
            Numbers("precision gain", "standard deviation of its size before over after")
        )
    else:
        columns += [Numbers("separation [standard deviations]"), Numbers("chance [%]")]
    columns.append(Numbers(f"cost [{summary['tried'][0]['cost']['unit']}]"))
    rows = []
    for k, experiment in enumerate(summary["tried"], 1):
        row: list[object] = [str(k), experiment["experiment"]]
        if single:
            deviation = experiment["deviation"]
            row.append(number(deviation["before"] / deviation["after"], ".2g"))
        else:
            chance = experiment["chance"]
            row += [number(experiment["separation"], ".1f"), number(100.0 * chance, ".0f", chance)]
        rows.append((*row, number(experiment["cost"]["value"], ".3g")))
    return Table("tried-table", "What each experiment would tell.", columns, rows)
