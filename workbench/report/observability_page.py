"""The page of `observability`: what the samples can tell of each quantity, where, and how well."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench.observability import WINDOW, CaseObservability
from workbench.report.figures import CaseFigure, Curve, Panel
from workbench.report.parts import Cell, Heading, Part, Rows, number, write_parts
from workbench.report.recordings import placed
from workbench.report.views import called, capital, named, per_shown, shown_unit
from workbench.system import System

_STYLES = ("2", "1")  # of the models
_REACH = 3.0  # times the bound from which on an estimate serves: what is far above tells nothing


def write_observability_page(
    summary: Mapping[str, Any], done: Sequence[CaseObservability], planned: int, out: Path
) -> Path:
    """Write the page into the folder; returns its path.

    Parameters
    ----------
    summary : as written to observability.json.
    planned : number of cases that were asked for.
    """
    system = done[0].system
    figures = [_figure(one) for one in sorted(done, key=_share)]
    drawn = placed(figures, summary, out)
    names = ", ".join(capital(one.label) for one in system.estimated) or "States"
    parts = [
        Part("shown", "Where the samples tell least", (_EXPLAINED,), recordings=tuple(drawn[:1])),
        Part("cases", "Recordings", tables=(_cases(system, summary),), printed=True),
        Part("linear", "Linear test of the models", (_LINEAR,), tables=tuple(_states(summary))),
        Part("definitions", "Definitions", terms=_terms(summary)),
    ]
    if drawn[1:]:
        parts.insert(2, Part("others", "The other recordings", recordings=tuple(drawn[1:])))
    missing = planned - len(done)
    warnings = [f"Incomplete: {len(done)} of {planned} recordings, interrupted."] * bool(missing)
    path = out / "index.html"
    write_parts(
        f"What the measurements can tell: {names}",
        summary,
        parts,
        path,
        file="observability.json",
        warnings=warnings,
    )
    return path


_EXPLAINED = (
    "For each quantity the smallest standard deviation that any estimator can reach with the "
    "samples of one window; where it stays under the line, an estimate serves. Curves that leave a "
    "panel say that the samples tell nothing. A bound holds for a right model: an estimate may err "
    "by more where the model differs."
)
_LINEAR = (
    "One second about one operating point: what is left of the standard deviation of a state after "
    "it, over that before it. A state that keeps nearly all of it cannot be observed there."
)


def _share(one: CaseObservability) -> float:
    """Share of the judged windows in which all quantities can be told."""
    useful = one.tests[0].useful()
    return float(useful[one.judged].mean()) if one.judged.any() and useful.size else 1.0


def _figure(one: CaseObservability) -> CaseFigure:
    """An input, and the bounds of each quantity by model, at the ends of the windows."""
    system, time = one.system, one.tests[0].time
    at = np.searchsorted(one.case.time, time)
    panels = []
    for signal in system.inputs[:1]:
        unit = shown_unit(system, signal.name)
        values = one.case[signal.name][at] / per_shown(system, signal.name, unit)
        low, high = float(values.min()), float(values.max())
        room = 0.08 * (high - low) or 1.0
        title = f"{capital(named(system, signal.name))} [{unit}]"
        panels.append(
            Panel(title, unit, low - room, high + room, 0.6, (Curve("measured", values),))
        )
    for j, quantity in enumerate(system.estimated):
        line = Curve("raw", np.full(time.size, quantity.useful))
        curves = [
            Curve(style, np.interp(time, test.time, test.bound[:, j]))
            for test, style in zip(one.tests, _STYLES, strict=False)
        ]
        title = f"Bound of {called(system, quantity.name)} {quantity.name} [{quantity.unit}]"
        reach = _REACH * quantity.useful
        panels.append(Panel(title, quantity.unit, 0.0, reach, 1.0, (line, *curves)))
    legend = [("raw", "an estimate serves below")]
    legend += [(style, t.model) for t, style in zip(one.tests, _STYLES, strict=False)]
    share = f"All quantities can be told in {100.0 * _share(one):.0f} % of the judged time."
    return CaseFigure(
        name=one.case.name,
        title=one.case.title,
        finding=share if one.judged.any() else "Nothing is judged here.",
        time=time,
        window=None,
        legend=(("measured", "measured"), *legend),
        panels=tuple(panels),
    )


def _cases(system: System, summary: Mapping[str, Any]) -> Rows:
    columns = [Heading("recording", number=False), Heading("conditions", number=False)]
    for one in system.estimated:
        unit = "" if one.unit == "1" else f" [{one.unit}]"
        columns += [
            Heading(f"{one.name}, median{unit}"),
            Heading(
                f"{one.name} can be told [%]", meaning=f"time with a bound below {one.useful:g}"
            ),
            Heading(f"bound of {one.name}, median{unit}"),
        ]
    rows = []
    for name, case in summary["cases"].items():
        first = next(iter(case["models"].values()))
        cells = [Cell(case["title"])]
        for one in system.estimated:
            share = None if first["useful"] is None else first["useful"][one.correction]
            bound = None if first["median_bound"] is None else first["median_bound"][one.correction]
            cells += [
                number(case[f"median_{one.name}"], "{:.3g}".format),
                number(None if share is None else 100.0 * share, "{:.0f}".format, share),
                number(bound, "{:.2g}".format),
            ]
        rows.append((name, tuple(cells)))
    caption = (
        f"How well windows of {summary['window_s']:g} s know each quantity, over the judged time "
        "of each recording, by the first model."
    )
    return Rows("case-table", caption, tuple(columns), tuple(rows))


def _states(summary: Mapping[str, Any]) -> list[Rows]:
    tables = []
    for model, test in summary["linear"].items():
        rows = tuple(
            (
                name,
                (
                    number(100.0 * one["remaining"], "{:.2f}".format, one["remaining"]),
                    number(one["scale"], "{:.3g}".format),
                    Cell(_verdict(name, test)),
                ),
            )
            for name, one in test["states"].items()
        )
        columns = (
            Heading("state", number=False),
            Heading("left after a second [%]"),
            Heading("scale [unit of the state]"),
            Heading("verdict", number=False),
        )
        seen = "observable" if test["observable"] else "not observable"
        caption = f"{model}: rank {test['rank']} of {len(test['states'])}, {seen}."
        tables.append(Rows(f"linear-{model}", caption, columns, rows))
    return tables


def _verdict(name: str, test: Mapping[str, Any]) -> str:
    if name not in test["unobservable"]:
        return "observable"
    return "invisible" if name in test["invisible"] else "weakly seen"


def _terms(summary: Mapping[str, Any]) -> dict[str, str]:
    return {
        "Bound": "Cramer-Rao: no unbiased estimator has a smaller standard deviation, given the "
        f"noise of the sensors and {WINDOW:g} s of samples, with what is known beforehand.",
        "Can be told": "The bound is below the value from which on an estimate serves, which the "
        "system file gives for each quantity ("
        + ", ".join(f"{name} {value:g}" for name, value in summary["useful"].items())
        + ").",
        "Rank": "Number of directions in the space of states that one second of outputs shows "
        "beyond their noise.",
    }
