"""Accuracy against the truth of the virtual rig: files, table, and the page."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from workbench.machines.wheelset.accuracy import (
    COVERED,
    NOISE,
    ROWS,
    Accuracy,
    Row,
    StopAccuracy,
    Worst,
    covered,
    needed_bands,
    worst,
)
from workbench.observers import label
from workbench.pages.answer import Answer, Measure, finite, with_answer
from workbench.pages.figures import ESTIMATORS
from workbench.pages.parts import Definitions, Dot, Dots, Numbers, Page, Part, Table, number
from workbench.pages.views import percent
from workbench.recordings.csv import csv_text
from workbench.runtime.files import write_json, write_whole
from workbench.system.system import System

_QUANTITIES = {field.name: field.metadata for field in fields(Accuracy) if field.metadata}
_CELL = 8  # characters, that of "+100.0 %"
_DIGITS = {"force": 2, "oscillation": 0}  # of percentages, else 1


def write_accuracies(stops: Sequence[StopAccuracy], path: Path) -> None:
    """Write one CSV: a line for each stop and estimator, `quantity [unit]`.

    A field is empty where there is nothing to judge, and `inf` if a delay never ends.
    """
    import pandas as pd

    lines = [
        {"case": stop.name, "estimator": name}
        | {f"{q} [{meta['unit']}]": getattr(result, q) for q, meta in _QUANTITIES.items()}
        | {f"covers_{q} [1]": result.bands[q].share if q in result.bands else None for q in COVERED}
        | {"failure": result.failure}
        for stop in stops
        for name, result in stop.estimators.items()
    ]
    write_whole(path, csv_text(pd.DataFrame(lines)))


def write_accuracy(
    system: System, stops: Sequence[StopAccuracy], provenance: Mapping[str, Any], path: Path
) -> None:
    """Write accuracy.json: each estimator in each stop, and the worst of them by row.

    What is not to be judged is left out; null is a delay that never ends, or of a failed run.
    `bands` are those of the system file by which bands would hold 95 % in these stops.
    """
    summary = {
        "provenance": provenance,
        "quantities": {name: dict(meta) for name, meta in _QUANTITIES.items()},
        "stops": {
            stop.name: {
                "title": stop.title,
                "wet_discs": stop.wet,
                "slides": stop.slides,
                "estimators": {name: _numbers(result) for name, result in stop.estimators.items()},
            }
            for stop in stops
        },
        "worst": {
            name: {
                row.text: {
                    "quantity": row.quantity,
                    "value": finite(worst_stop.value),
                    "stop": worst_stop.stop,
                }
                for row in ROWS
                if (worst_stop := worst(row, stops, name)) is not None
            }
            for name in stops[0].estimators
        },
        "bands": {
            name: {
                quantity: system.bands.get(name, {}).get(quantity, 1.0) * factor
                for quantity, factor in needed_band.items()
            }
            for name, needed_band in needed_bands(stops).items()
        },
    }
    write_json(path, with_answer(_answer(system, stops), summary))


def _answer(system: System, stops: Sequence[StopAccuracy]) -> Answer:
    """The worst of each row by estimator, and whose worst force is nearest."""
    headline, force = {}, {}
    for name in stops[0].estimators:
        for row in ROWS:
            if (worst_stop := worst(row, stops, name)) is not None:
                unit = str(_QUANTITIES[row.quantity]["unit"])
                factor = 1.0
                if unit == "1" and row.quantity != "muDC":
                    unit, factor = "%", 100.0
                value = finite(factor * row.badness(worst_stop.value))
                headline[f"{row.text}, {name}"] = Measure(value, unit, "lower")
        errors = [stop.estimators[name].force for stop in stops]
        if all(error is not None and math.isfinite(error) for error in errors):
            force[name] = max(error for error in errors if error is not None)
    details = {
        f"{stop.name}: error of the force, {name}": Measure(100.0 * result.force, "%", "lower")
        for stop in stops
        for name, result in stop.estimators.items()
        if result.force is not None and math.isfinite(result.force)
    }
    if not force:
        return Answer("No estimator has a force in every stop.", headline, details)
    best = min(force, key=lambda name: force[name])
    share = covered(stops, best, "Fx")
    held = ""
    if share is not None:
        held = f"; its 95 % bands contain the truth in {100.0 * share:.1f} % of the time"
    sentence = (
        f"Nearest to the true force is the {label(best, system)}: its error is "
        f"{percent(force[best])} of the mean force in the worst of {len(stops)} stops{held}."
    )
    return Answer(sentence, headline, details)


def _numbers(result: Accuracy) -> dict[str, Any]:
    if result.failure:
        return {"failure": result.failure}
    values = {name: getattr(result, name) for name in _QUANTITIES}
    numbers = {name: finite(value) for name, value in values.items() if value is not None}
    shares = {name: band.share for name, band in result.bands.items()}
    return numbers | ({"covers": shares} if shares else {})


def format_accuracy(stops: Sequence[StopAccuracy]) -> str:
    """Table for the terminal: the worst stop of each row, by estimator."""
    names = list(stops[0].estimators)
    width = max(len(row.text) for row in ROWS)
    header = " " * width + "".join(f"  {name:>{_CELL}}" for name in names)
    lines = ["Worst over the stops that a row concerns, below 5 Hz", header, "-" * len(header)]
    for row in ROWS:
        cells = (
            f"  {cell(row, worst(row, stops, name)):>{max(_CELL, len(name))}}" for name in names
        )
        lines.append(f"{row.text:<{width}}{''.join(cells)}")
    lines.append("-" * len(header))
    if _have_bands(stops, names):
        lines += [
            "Share of samples in which a 95 % band contains the truth, mean of all stops",
            header,
        ]
        lines += [f"{q:<{width}}{_covers(stops, names, q)}" for q in COVERED]
        lines.append("The same of the stop in which it contains the truth least")
        lines += [f"{q:<{width}}{_covers(stops, names, q, least=True)}" for q in COVERED]
        lines.append("-" * len(header))
    return "\n".join(lines + _failures(stops, {name: name for name in names}))


def _have_bands(stops: Sequence[StopAccuracy], names: Iterable[str]) -> bool:
    return any(covered(stops, name, quantity) is not None for name in names for quantity in COVERED)


def _failures(stops: Sequence[StopAccuracy], names: Mapping[str, str]) -> list[str]:
    """A line for each run that failed; `names` for people."""
    return [
        f"{stop.name}, {names[name]}: {result.failure}"
        for stop in stops
        for name, result in stop.estimators.items()
        if result.failure
    ]


def _covers(
    stops: Sequence[StopAccuracy], names: Sequence[str], quantity: str, *, least: bool = False
) -> str:
    shares = {name: covered(stops, name, quantity, least=least) for name in names}
    texts = {
        name: "" if share is None else f"{100.0 * share:.1f} %" for name, share in shares.items()
    }
    return "".join(f"  {texts[name]:>{max(_CELL, len(name))}}" for name in names)


def cell(row: Row, worst_stop: Worst | None) -> str:
    """A value as a text; empty if there is nothing to judge.

    >>> cell(ROWS[0], Worst("01", 0.00271)), cell(ROWS[4], Worst("09", 0.0729))
    ('0.27 %', '+7.3 %')
    >>> cell(ROWS[5], Worst("01", math.inf)), cell(ROWS[6], Worst("01", 0.02))
    ('never', 'none')
    """
    if worst_stop is None:
        return ""
    value = worst_stop.value
    if math.isnan(value):
        return "failed"
    if math.isinf(value):
        return "never"
    if row.quantity == "muDC":
        return f"{value:.3f}"
    if row.quantity == "rise_delay":
        return f"{value:.3f} s"
    if row.quantity == "oscillation" and value < NOISE:
        return "none"
    sign = "+" if row.quantity == "minimum_in_slide" else ""
    return f"{100.0 * value:{sign}.{_DIGITS.get(row.quantity, 1)}f} %"


def write_accuracy_page(
    system: System, summary: Mapping[str, Any], stops: Sequence[StopAccuracy], out: Path
) -> Path:
    """Write the page into the folder; returns its path."""
    names = {name: label(name, system) for name in stops[0].estimators}
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
    if _have_bands(stops, names):
        parts.insert(2, Part("bands", "What the bands hold", [_bands(stops, names)]))
    title = f"Estimates against the truth of {len(stops)} stops"
    page = Page(title, parts, "accuracy.json", warnings=_failures(stops, names))
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
        "Share of samples in which a 95 % band contains the truth: mean of all stops, and the "
        "stop in "
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
