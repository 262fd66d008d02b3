"""The page of `accuracy`: estimates against the truth, the worst of each row, and every stop."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from workbench.machines.wheelset.accuracy import COVERED, ROWS, StopAccuracy, covered, worst
from workbench.machines.wheelset.accuracy_report import cell
from workbench.observers import label
from workbench.pages.figures import ESTIMATORS
from workbench.pages.parts import Definitions, Dot, Dots, Numbers, Page, Part, Table, number
from workbench.system.system import System


def write_accuracy_page(
    system: System, summary: Mapping[str, Any], stops: Sequence[StopAccuracy], out: Path
) -> Path:
    """Write the page into the folder; returns its path.

    Parameters
    ----------
    summary : as written to accuracy.json.
    """
    names = {name: label(name, system) for name in stops[0].estimators}
    failures = [
        f"{stop.name}, {names[name]}: {result.failure}"
        for stop in stops
        for name, result in stop.estimators.items()
        if result.failure
    ]
    shown = "Each dot is a stop: error of the estimated force, rms over the mean of the truth."
    terms = {
        name.replace("_", " "): f"{quantity['text']} [{quantity['unit']}]"
        for name, quantity in summary["quantities"].items()
    }
    parts = [
        Part("shown", "Error of the force in every stop", [shown, _forces(stops, names)]),
        Part("worst", "Worst stop by quantity", [_worst(stops, names)], printed=True),
        Part("stops", "Every stop", [_stops(stops, names)]),
        Part("definitions", "Definitions", [Definitions(terms)]),
    ]
    if any(covered(stops, name, quantity) is not None for name in names for quantity in COVERED):
        parts.insert(2, Part("bands", "What the bands hold", [_bands(stops, names)]))
    title = f"Estimates against the truth of {len(stops)} stops"
    page = Page(title, parts, "accuracy.json", warnings=failures)
    return page.write(summary, out / "index.html")


def _forces(stops: Sequence[StopAccuracy], names: Mapping[str, str]) -> Dots:
    rows, words = [], []
    for k, (name, text) in enumerate(names.items()):
        errors = [stop.estimators[name].force for stop in stops]
        known = [100.0 * error for error in errors if error is not None and math.isfinite(error)]
        style = ESTIMATORS[k % len(ESTIMATORS)]
        rows.append((text, tuple(Dot(error, style) for error in known)))
        if known:
            words.append(f"{text} up to {max(known):.2f} %")
    finding = f"Worst stop: {'; '.join(words)}."
    return Dots(finding, "error of the force [%], logarithmic", tuple(rows), logarithmic=True)


def _worst(stops: Sequence[StopAccuracy], names: Mapping[str, str]) -> Table:
    rows = []
    for row in ROWS:
        stops_of_row = (worst(row, stops, name) for name in names)
        cells = (f"{cell(row, stop)} ({stop.stop})" if stop else "" for stop in stops_of_row)
        rows.append((row.text, *cells))
    caption = "The worst of the stops that a row concerns, below 5 Hz; the stop in brackets."
    return Table("worst-table", caption, ("quantity", *names.values()), rows)


def _bands(stops: Sequence[StopAccuracy], names: Mapping[str, str]) -> Table:
    rows = []
    for least in (False, True):
        for quantity in COVERED:
            shares = [covered(stops, name, quantity, least=least) for name in names]
            cells = (
                number(None if share is None else 100.0 * share, ".1f", share) for share in shares
            )
            rows.append((f"{quantity}, {'least' if least else 'mean'}", *cells))
    columns = ("quantity", *(Numbers(f"{name} [%]") for name in names.values()))
    caption = (
        "Share of samples in which a 95 % band holds the truth: mean of all stops, and the stop in "
        "which it does so least; far below 95 % the filter is overconfident there."
    )
    return Table("band-table", caption, columns, rows)


def _stops(stops: Sequence[StopAccuracy], names: Mapping[str, str]) -> Table:
    rows = []
    for stop in stops:
        forces = (stop.estimators[name].force for name in names)
        known = (None if f is None or not math.isfinite(f) else 100.0 * f for f in forces)
        rows.append((stop.name, stop.title, *(number(force, ".2f") for force in known)))
    columns = ("stop", "conditions", *(Numbers(f"{text} [%]") for text in names.values()))
    caption = "Error of the force in each stop; all quantities are in accuracy.csv."
    return Table("stop-table", caption, columns, rows)
