"""Files of a predicted distance: distance.json, three tables, a figure, the page."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from workbench.files import write_json, write_whole
from workbench.report.answers import stopping, with_answer
from workbench.report.distance_page import write_distance_page
from workbench.report.figures import LIGHT, STYLE, save_figure
from workbench.stopping import Distance
from workbench.stopping.outcome import QUANTILES, PastStop, Safety

_MOST = 60  # past stops that have names below the figure


def write_distance(found: Distance, provenance: Mapping[str, Any], out: Path) -> Path:
    """Write distance.json, tables as CSV, the figure and the page; returns this.

    Parameters
    ----------
    provenance : what was run.
    """
    summary = {**found.to_dict(), "provenance": provenance}
    told = with_answer(stopping(summary), summary)
    write_json(out / "distance.json", told)
    tables = {"stops": found.to_frame(), "quantiles": found.quantiles()}
    if found.safety is not None:
        tables["safety"] = pd.DataFrame(map(asdict, found.safety.levels))
    if found.plain is not None:
        tables["plain"] = pd.DataFrame(map(asdict, found.plain.levels))
    for name, table in tables.items():
        write_whole(out / f"{name}.csv", table.to_csv(index=False, float_format="%.6g"))
    figure = out / "distance.png"
    save_figure(distance_figure(found), [figure, figure.with_suffix(".svg")])
    return write_distance_page(found, told, out)


def distance_figure(found: Distance) -> Figure:
    """Draw the distribution with its quantiles, past stops with their bands, the safety level."""
    rows = 2 if found.safety is None else 3
    with mpl.rc_context(STYLE):
        sheet = Figure(figsize=(9.0, 0.5 + 2.9 * rows), layout="constrained")
        panels = sheet.subplots(rows)
        _distribution(panels[0], found)
        _past(panels[1], found.past)
        if found.safety is not None:
            _levels(panels[2], found.safety)
    return sheet


def _distribution(axes: Axes, found: Distance) -> None:
    distances = found.ahead.distances
    axes.hist(distances, bins=60, density=True, color=LIGHT["raw"], alpha=0.5)
    top = axes.get_ylim()[1]
    for share in QUANTILES:
        at = found.ahead.quantile(share)
        axes.axvline(at, color=LIGHT["2"], linewidth=1.5 if share == 0.5 else 0.8)
        axes.text(at, top, f" {100 * share:g} %", fontsize=7, rotation=90, va="top", ha="right")
    axes.axvline(found.nominal, color=LIGHT["1"], linestyle="--", label="model as its sheet says")
    axes.legend(fontsize=7, frameon=False)
    axes.set(title=found.sentence, xlabel="distance [m]", ylabel="density [1/m]")
    axes.title.set_fontsize(9)


def _past(axes: Axes, past: tuple[PastStop, ...]) -> None:
    """Each stop and its band, over the middle of what the others predict."""
    middle = np.array([one.forecast.quantile(0.5) for one in past])
    low, high = np.array([one.forecast.band for one in past]).T / middle
    made = np.array([one.recorded.distance for one in past]) / middle
    inside = np.array([not one.recorded.outside for one in past])
    place = np.arange(len(past))
    axes.vlines(place, low, high, color=LIGHT["2"], linewidth=4.0, alpha=0.35, label="95 %")
    axes.plot(place[inside], made[inside], "o", color=LIGHT["measured"], markersize=4)
    axes.plot(
        *(place[~inside], made[~inside], "x"),
        color=LIGHT["1"],
        markersize=5,
        label="beyond what the model claims",
    )
    axes.legend(fontsize=7, frameon=False)
    axes.set(title="past stops, each over what the others predict", ylabel="distance, of predicted")
    names = [one.recorded.stop.name for one in past] if len(past) <= _MOST else []
    axes.set_xticks(place[: len(names)], names, rotation=90 if len(past) > 8 else 15, fontsize=6)


def _levels(axes: Axes, safety: Safety) -> None:
    decades = np.array([one.decade for one in safety.levels])
    ratio, low, high = np.array([(one.ratio, one.low, one.high) for one in safety.levels]).T
    axes.errorbar(
        *(decades, ratio),
        yerr=np.maximum(0.0, [ratio - low, high - ratio]),
        color=LIGHT["2"],
        marker="o",
        markersize=4,
        capsize=3,
    )
    axes.set(
        title=f"deceleration over the nominal one, {safety.nominal:.3f} m/s2, that all but one "
        "stop in so many reach",
        xlabel="one stop in",
        ylabel="ratio",
    )
    axes.title.set_fontsize(9)
    axes.set_xticks(decades, [f"1e{k}" for k in decades])
