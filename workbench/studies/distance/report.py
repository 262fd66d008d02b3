"""Files of a predicted distance: distance.json, tables, a figure, the page."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from workbench.pages.answer import Answer, Measure, with_answer
from workbench.pages.figures import CaseFigure, Curve, Panel, save_figure
from workbench.pages.parts import (
    Definitions,
    Dot,
    Dots,
    Numbers,
    Page,
    Part,
    Table,
    tabulated,
    zoomable,
)
from workbench.recordings.csv import csv_text
from workbench.runtime.files import write_json, write_whole
from workbench.studies.distance import Distance
from workbench.studies.distance.outcome import PastStop, distance_figure

_POINTS = 200  # of the drawn distribution
_MADE, _AWAY = "2", "7"
_LESS = "stop shorter"
_RATE = Numbers("deceleration [m/s2]", "equivalent, after the response")
_EXPLAINED = (
    "How likely the stop that was asked for is shorter than any distance; 95 of 100 are in the "
    "shaded range. Below it each past stop beside what the others predict of it, without having "
    "seen it: the line is where 95 of 100 are expected, the point what was measured."
)
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


def write_distance(result: Distance, provenance: Mapping[str, Any], out: Path) -> Path:
    """Write distance.json, tables as CSV, the figure and the page; returns this."""
    import pandas as pd

    content = {**result.to_dict(), "provenance": provenance}
    summary = with_answer(distance_answer(content), content)
    write_json(out / "distance.json", summary)
    tables = {"stops": result.to_frame(), "quantiles": result.quantiles()}
    if result.safety is not None:
        tables["safety"] = pd.DataFrame(map(asdict, result.safety.levels))
    if result.plain is not None:
        tables["plain"] = pd.DataFrame(map(asdict, result.plain.levels))
    for name, table in tables.items():
        write_whole(out / f"{name}.csv", csv_text(table))
    save_figure(distance_figure(result), [out / "distance.png", out / "distance.svg"])
    return write_distance_page(result, summary, out)


def distance_answer(summary: Mapping[str, Any]) -> Answer:
    """The answer of `distance`."""
    shares = summary["distance"]
    middle, low, high = (shares[share] for share in ("0.5", "0.025", "0.975"))
    headline = {
        "distance": Measure(middle, "m", "lower", low, high),
        "deceleration": Measure(summary["deceleration"], "m/s2", "higher"),
    }
    for level in summary["safety"] or []:
        name = f"deceleration over the nominal one, all but one stop in 1e{level['decade']}"
        headline[name] = Measure(level["ratio"], "1", "higher", level["low"], level["high"])
    details = {
        f"{stop['stop']}: measured over predicted distance": Measure(
            stop["distance [m]"] / stop["predicted [m]"], "1"
        )
        for stop in summary["stops"]
    }
    return Answer(summary["sentence"], headline, details)


def write_distance_page(result: Distance, summary: Mapping[str, Any], out: Path) -> Path:
    """Write the page into the folder; returns its path."""
    (distribution,) = zoomable([_distribution(result)], summary, out)
    parts = [
        Part(
            "shown",
            "The stop that was asked for, and those that were made",
            [_EXPLAINED, distribution, _past(result.past)],
        ),
        Part("quantiles", "Distances by chance", [_quantiles(result)], printed=True),
        Part("stops", "Stops that were made", [_stops(result)], printed=True),
        Part("definitions", "Definitions", [Definitions(_TERMS)]),
    ]
    if safety := summary["safety"]:
        parts.insert(2, Part("safety", "Safety level", [_levels(safety), _safety(safety)]))
    warnings = list(summary["warnings"])
    if result.interrupted:
        warnings.insert(0, "Interrupted: runs of the safety level are missing.")
    title = "Distance of a stop that was not made"
    page = Page(title, parts, "distance.json", warnings=warnings)
    return page.write(summary, out / "index.html")


def _past(past: Sequence[PastStop]) -> Dots:
    """Measured over the middle of what the others predict, on its band."""
    rows, ends = [], []
    for stop in past:
        middle = stop.forecast.quantile(0.5)
        low, high = (end / middle for end in stop.forecast.band)
        measured = stop.recorded.distance / middle
        style = _AWAY if stop.recorded.outside else _MADE
        rows.append((stop.recorded.stop.name, (Dot(measured, style, low, high),)))
        ends += [low, high, measured]
    valid = [stop for stop in past if not stop.recorded.outside]
    held = sum(stop.held for stop in valid)
    finding = (
        f"{held} of {len(valid)} past stops are where the others predict them with 95 %"
        + "; red ones are beyond what the model claims" * (len(valid) < len(past))
        + "."
    )
    axis = "measured distance over the predicted one"
    room = 0.05 * (max(ends) - min(ends))
    ends += [min(ends) - room, max(ends) + room]
    return Dots(finding, axis, tuple(rows), (1.0, "predicted"), min(ends), max(ends))


def _distribution(result: Distance) -> CaseFigure:
    ahead = result.ahead
    # Its far ends are those of the safety level, which say more than what was drawn there.
    at = np.linspace(ahead.quantile(0.001), ahead.quantile(0.999), _POINTS)
    share = 100.0 * np.searchsorted(ahead.distances, at) / ahead.distances.size
    sheet = np.where(at >= result.nominal, 100.0, 0.0)
    curves = (Curve("2", share), Curve("raw", sheet))
    panel = Panel("Stops that are shorter [%]", "%", 0.0, 105.0, 1.6, curves)
    return CaseFigure(
        name="The stop that was asked for",
        title=result.sentence.removesuffix("."),
        finding=f"With data-sheet values, the model goes {result.nominal:.1f} m.",
        time=at,
        window=ahead.band,
        legend=(("2", _LESS), ("raw", "model of the data sheet")),
        panels=(panel,),
        axis=("distance", "m"),
    )


def _quantiles(result: Distance) -> Table:
    return tabulated(
        "quantile-table",
        "The stop that was asked for.",
        result.quantiles().to_dict("records"),
        [
            (_LESS, lambda quantile: f"{100.0 * quantile['share']:g} %", ""),
            (Numbers("distance [m]"), "distance [m]", ".1f"),
            (_RATE, "deceleration [m/s2]", ".3f"),
        ],
    )


def _stops(result: Distance) -> Table:
    corrected = Numbers("corrected [m]", "to nominal speed, mass and a level, straight way")

    def nominal(stop: Mapping[str, Any]) -> float | None:
        distance = float(stop["nominal_distance [m]"])
        return None if np.isnan(distance) else distance

    return tabulated(
        "stop-table",
        "Past stops, each as it was measured and as the others predict it.",
        result.to_frame().to_dict("records"),
        [
            ("stop", lambda stop: str(stop["stop"]), ""),
            (Numbers("speed [km/h]"), lambda stop: 3.6 * stop["speed [m/s]"], ".1f"),
            (Numbers("measured [m]"), "distance [m]", ".1f"),
            (
                Numbers("predicted [m]", "middle of what the other stops say"),
                "predicted [m]",
                ".1f",
            ),
            (Numbers("95 % from [m]"), "low [m]", ".1f"),
            (Numbers("to [m]"), "high [m]", ".1f"),
            (_RATE, "deceleration [m/s2]", ".3f"),
            (corrected, nominal, ".1f"),
            ("remark", lambda s: s["outside"] or ("" if s["held"] else "not in its range"), ""),
        ],
    )


def _levels(safety: Sequence[Mapping[str, Any]]) -> Dots:
    rows = [
        (
            f"one stop in 1e{level['decade']}",
            (Dot(level["ratio"], _MADE, level["low"], level["high"]),),
        )
        for level in safety
    ]
    last = safety[-1]
    finding = (
        f"All but one stop in 1e{last['decade']} reach {last['ratio']:.3f} of the nominal "
        f"deceleration (95 %: {last['low']:.3f} to {last['high']:.3f})."
    )
    ends = [end for level in safety for end in (level["low"], level["high"])]
    room = 0.05 * (max(ends) - min(ends))
    axis = "deceleration that is reached, over the nominal one"
    return Dots(finding, axis, rows, None, min(ends) - room, max(ends) + room)


def _safety(safety: Sequence[Mapping[str, Any]]) -> Table:
    variation = Numbers("variation [%]", "of the probability, from run to run")
    return tabulated(
        "safety-table",
        "Deceleration over the nominal one that all but one stop in so many reach.",
        safety,
        [
            ("one stop in", lambda level: f"1e{level['decade']}", ""),
            (Numbers("ratio"), "ratio", ".4f"),
            (Numbers("95 % from"), "low", ".4f"),
            (Numbers("to"), "high", ".4f"),
            (variation, lambda level: 100.0 * level["variation"], ".1f"),
            (Numbers("by plain sampling [stops]", "that would tell as much"), "plain_stops", ".1e"),
        ],
    )
