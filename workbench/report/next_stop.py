"""Files of the next experiments: next.json, a table of all that were tried, a figure."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from workbench.experiments import NextStop
from workbench.files import write_json, write_whole
from workbench.report.answers import proposed, with_answer
from workbench.report.figures import ESTIMATORS, LIGHT, STYLE, save_figure
from workbench.report.next_stop_page import write_next_stop_page
from workbench.units import si_factor

_BAND = 2.0  # standard deviations of a block's mean


def write_next_stop(found: NextStop, provenance: Mapping[str, Any], out: Path) -> Path:
    """Write next.json, experiments.csv, the figure of the best ones and the page; returns this.

    Parameters
    ----------
    provenance : what was run.
    """
    summary = {**found.to_dict(), "provenance": provenance}
    told = with_answer(proposed(summary), summary)
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
        for column, one in enumerate(proposals):
            case, predicted = one.prediction.case, one.prediction
            title = f"{column + 1}. {one.text}".replace("; ", "\n")
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
