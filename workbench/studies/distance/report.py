"""Files of a predicted distance: distance.json, three tables, a figure, the page."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from workbench.pages.answer import Answer, Measure, with_answer
from workbench.pages.figures import CaseFigure, Curve, Panel, save_figure
from workbench.pages.parts import Cell, Dot, Dots, Heading, Part, Rows, number, write_parts
from workbench.pages.recordings import placed
from workbench.runtime.files import write_json, write_whole
from workbench.studies.distance import Distance
from workbench.studies.distance.outcome import PastStop, distance_figure

_POINTS = 200  # of the drawn distribution


_MADE, _AWAY = "2", "7"


_LESS = "stop shorter"


def write_distance_page(found: Distance, summary: Mapping[str, Any], out: Path) -> Path:
    """Write the page into the folder; returns its path.

    Parameters
    ----------
    summary : as written to distance.json.
    """
    parts = [
        Part(
            "shown",
            "The stop that was asked for, and those that were made",
            (_EXPLAINED,),
            dots=(_past(found.past),),
            recordings=tuple(placed([_distribution(found)], summary, out)),
        ),
        Part("quantiles", "Distances by chance", tables=(_quantiles(found),), printed=True),
        Part("stops", "Stops that were made", tables=(_stops(found),), printed=True),
        Part("definitions", "Definitions", terms=_TERMS),
    ]
    if found.safety is not None:
        level = Part("safety", "Safety level", dots=(_levels(summary),), tables=(_safety(summary),))
        parts.insert(2, level)
    warnings = list(summary["warnings"])
    if found.interrupted:
        warnings.insert(0, "Interrupted: runs of the safety level are missing.")
    path = out / "index.html"
    title = "Distance of a stop that was not made"
    write_parts(title, summary, parts, path, file="distance.json", warnings=warnings)
    return path


_EXPLAINED = (
    "How likely the stop that was asked for is shorter than any distance; 95 of 100 are in the "
    "shaded range. Below it each past stop beside what the others predict of it, without having "
    "seen it: the line is where 95 of 100 are expected, the point what was measured."
)


def _past(past: tuple[PastStop, ...]) -> Dots:
    """Measured over the middle of what the others predict, on its band."""
    rows, ends = [], []
    for one in past:
        middle = one.forecast.quantile(0.5)
        low, high = (end / middle for end in one.forecast.band)
        made = one.recorded.distance / middle
        style = _AWAY if one.recorded.outside else _MADE
        rows.append((one.recorded.stop.name, (Dot(made, style, low, high),)))
        ends += [low, high, made]
    claimed = [one for one in past if not one.recorded.outside]
    held = sum(one.held for one in claimed)
    finding = (
        f"{held} of {len(claimed)} past stops are where the others predict them with 95 %"
        + "; red ones are beyond what the model claims" * (len(claimed) < len(past))
        + "."
    )
    axis = "measured distance over the predicted one"
    room = 0.05 * (max(ends) - min(ends))
    ends += [min(ends) - room, max(ends) + room]
    return Dots(finding, axis, tuple(rows), (1.0, "predicted"), min(ends), max(ends))


def _distribution(found: Distance) -> CaseFigure:
    """Share of stops that are shorter, over the distance."""
    ahead = found.ahead
    # Its far ends are those of the safety level, which say more than what was drawn there.
    at = np.linspace(ahead.quantile(0.001), ahead.quantile(0.999), _POINTS)
    share = 100.0 * np.searchsorted(ahead.distances, at) / ahead.distances.size
    sheet = np.where(at >= found.nominal, 100.0, 0.0)
    curves = (Curve("2", share), Curve("raw", sheet))
    panel = Panel("Stops that are shorter [%]", "%", 0.0, 105.0, 1.6, curves)
    return CaseFigure(
        name="The stop that was asked for",
        title=found.sentence.removesuffix("."),
        finding=f"As its sheet says, the model goes {found.nominal:.1f} m.",
        time=at,
        window=ahead.band,
        legend=(("2", _LESS), ("raw", "model as its sheet says")),
        panels=(panel,),
        axis=("distance", "m"),
    )


def _quantiles(found: Distance) -> Rows:
    frame = found.quantiles()
    columns = (
        Heading(_LESS, number=False),
        Heading("distance [m]"),
        Heading("deceleration [m/s2]", meaning="equivalent, after the response"),
    )
    rows = tuple(
        (
            f"{100.0 * share:g} %",
            (number(distance, "{:.1f}".format), number(rate, "{:.3f}".format)),
        )
        for share, distance, rate in frame.to_numpy()
    )
    return Rows("quantile-table", "The stop that was asked for.", columns, rows)


def _stops(found: Distance) -> Rows:
    columns = (
        Heading("stop", number=False),
        Heading("speed [km/h]"),
        Heading("measured [m]"),
        Heading("predicted [m]", meaning="middle of what the other stops say"),
        Heading("95 % from [m]"),
        Heading("to [m]"),
        Heading("deceleration [m/s2]", meaning="equivalent, after the response"),
        Heading("corrected [m]", meaning="to nominal speed, mass and a level, straight way"),
        Heading("remark", number=False),
    )
    rows = []
    for one in found.to_frame().to_dict("records"):
        nominal = one["nominal_distance [m]"]
        remark = one["outside"] or ("" if one["held"] else "not in its range")
        cells = [
            number(3.6 * one["speed [m/s]"], "{:.1f}".format),
            *(number(one[f"{key} [m]"], "{:.1f}".format) for key in _OF_A_STOP),
            number(one["deceleration [m/s2]"], "{:.3f}".format),
            number(None if np.isnan(nominal) else nominal, "{:.1f}".format),
            Cell(remark),
        ]
        rows.append((str(one["stop"]), tuple(cells)))
    caption = "Past stops, each as it was measured and as the others predict it."
    return Rows("stop-table", caption, columns, tuple(rows))


_OF_A_STOP = ("distance", "predicted", "low", "high")


def _levels(summary: Mapping[str, Any]) -> Dots:
    rows = tuple(
        (f"one stop in 1e{one['decade']}", (Dot(one["ratio"], _MADE, one["low"], one["high"]),))
        for one in summary["safety"]
    )
    last = summary["safety"][-1]
    finding = (
        f"All but one stop in 1e{last['decade']} reach {last['ratio']:.3f} of the nominal "
        f"deceleration (95 %: {last['low']:.3f} to {last['high']:.3f})."
    )
    ends = [end for one in summary["safety"] for end in (one["low"], one["high"])]
    room = 0.05 * (max(ends) - min(ends))
    axis = "deceleration that is reached, over the nominal one"
    return Dots(finding, axis, rows, None, min(ends) - room, max(ends) + room)


def _safety(summary: Mapping[str, Any]) -> Rows:
    columns = (
        Heading("one stop in", number=False),
        Heading("ratio"),
        Heading("95 % from"),
        Heading("to"),
        Heading("variation [%]", meaning="of the probability, from run to run"),
        Heading("by plain sampling [stops]", meaning="that would tell as much"),
    )
    rows = tuple(
        (
            f"1e{one['decade']}",
            (
                *(number(one[key], "{:.4f}".format) for key in ("ratio", "low", "high")),
                number(100.0 * one["variation"], "{:.1f}".format),
                number(one["plain_stops"], "{:.1e}".format),
            ),
        )
        for one in summary["safety"]
    )
    caption = "Deceleration over the nominal one that all but one stop in so many reach."
    return Rows("safety-table", caption, columns, rows)


_TERMS = {
    "Predicted by the others": "The fit to all stops but this one, with what the model left of "
    "them.",
    "Beyond what the model claims": "The system file says where: such a stop says nothing of the "
    "model, and its distance is no prediction.",
    "Deceleration": "Equivalent: constant after the response, over the same distance (EN 14531-1).",
    "Safety level": "By subset simulation (Au and Beck 2001). Beyond what the past stops show it "
    "follows from tolerances and from the forms of their distributions.",
    "Sheet": "The model with its nominal parameters, before any stop was looked at.",
}


def write_distance(found: Distance, provenance: Mapping[str, Any], out: Path) -> Path:
    """Write distance.json, tables as CSV, the figure and the page; returns this.

    Parameters
    ----------
    provenance : what was run.
    """
    summary = {**found.to_dict(), "provenance": provenance}
    told = with_answer(distance_answer(summary), summary)
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


def distance_answer(summary: Mapping[str, Any]) -> Answer:
    """The answer of `distance`."""
    shares = summary["distance"]
    middle, low, high = (shares[share] for share in ("0.5", "0.025", "0.975"))
    headline = {
        "distance": Measure(middle, "m", "lower", low, high),
        "deceleration": Measure(summary["deceleration"], "m/s2", "higher"),
    }
    for one in summary["safety"] or []:
        name = f"deceleration over the nominal one, all but one stop in 1e{one['decade']}"
        headline[name] = Measure(one["ratio"], "1", "higher", one["low"], one["high"])
    details = {
        f"{stop['stop']}: measured over predicted distance": Measure(
            stop["distance [m]"] / stop["predicted [m]"], "1"
        )
        for stop in summary["stops"]
    }
    return Answer(summary["sentence"], headline, details)
