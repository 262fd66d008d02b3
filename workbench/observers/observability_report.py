"""Observability of states and estimated quantities: figure, files and table."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Vector
from workbench.observers.observability import (
    STRIDE,
    CaseObservability,
    LinearTest,
    WindowTest,
    guesses,
    prior,
    tested_span,
)
from workbench.observers.report import write_numbers
from workbench.pages.answer import (
    Answer,
    Measure,
    percentage,
    unit_suffix,
    whole_percent,
    with_answer,
)
from workbench.pages.figures import CaseFigure, Curve, Panel, draw_case
from workbench.pages.parts import Definitions, Numbers, Page, Part, Table, number, zoomable
from workbench.pages.views import called, capital, named, per_shown, shown_unit
from workbench.runtime.files import write_json
from workbench.system.system import System


def draw_observability(observability: CaseObservability, path: Path) -> None:
    """Draw one recording to `path` (PNG): an input, then the bounds of quantities by model.

    Without either there is nothing to draw.
    """
    figure = _figure(observability)
    if figure.panels:
        draw_case(figure, [path])


def write_windows(observability: CaseObservability, path: Path) -> None:
    """Write one CSV of a recording: end of the window, bounds and remaining shares by model."""
    system, first = observability.system, observability.tests[0]
    at = np.searchsorted(observability.case.time, first.time)
    columns: dict[str, Vector] = {"time [s]": first.time}
    for signal in system.inputs:
        factor = per_shown(system, signal.name, signal.shown)
        columns[f"{signal.name} [{signal.shown}]"] = observability.case[signal.name][at] / factor
    for name in (*system.reported, *(quantity.name for quantity in system.estimated)):
        columns[f"{name} [{system.unit(name)}]"] = observability.run.signal(name)[at]
    columns["judged [1]"] = observability.judged.astype(float)
    for test in observability.tests:
        for j, quantity in enumerate(system.estimated):
            columns[f"{test.model}.bound_{quantity.correction} [{quantity.unit}]"] = test.bound[
                :, j
            ]
        for j, name in enumerate(test.states):
            columns[f"{test.model}.remaining_{name} [1]"] = test.remaining[:, j]
    write_numbers(columns, path, 6)


def write_observability(
    system: System,
    linear: Sequence[LinearTest],
    done: Sequence[CaseObservability],
    provenance: Mapping[str, Any],
    path: Path,
) -> None:
    """Write observability.json: the linear test of each model, shares of each recording."""
    point = system.tested
    summary = {
        "provenance": provenance,
        "operating_point": {
            "inputs": dict(point.inputs),
            "held": {name: formula.text for name, formula in point.held.items()},
            "quantities": dict(point.quantities),
        },
        "noise": {
            signal.name: {"absolute": signal.noise, "relative": signal.relative_noise}
            for signal in (*system.inputs, *system.outputs)
        },
        "window_s": done[0].tests[0].span,
        "stride_s": max(STRIDE, system.sample_time),
        "linear_s": tested_span(system),
        "prior": dict(zip(system.corrections, prior(system).tolist(), strict=True)),
        "useful": {quantity.correction: quantity.useful for quantity in system.estimated},
        "linear": {test.model: _linear(test) for test in linear},
        "cases": {
            result.case.name: {
                "title": result.case.title,
                "judged_windows": int(result.judged.sum()),
                "warnings": _warnings(result),
                **{f"median_{name}": value for name, value in _medians(result).items()},
                "models": {test.model: _shares(test, result) for test in result.tests},
            }
            for result in done
        },
    }
    write_json(path, with_answer(observability_answer(system, summary), summary))


def _warnings(result: CaseObservability) -> list[str]:
    """What the FMU warned of, and what the whole recording does not tell, or not apart."""
    known, warned = result.information, result.run.message
    untold = [] if known is None else guesses(known.inseparable, known.untold)
    return [warned, *untold] if warned else untold


def _linear(test: LinearTest) -> dict[str, Any]:
    return {
        "observable": test.observable,
        "rank": test.rank,
        "states": {
            name: {"at": float(x), "scale": float(scale), "remaining": float(remaining)}
            for name, x, scale, remaining in zip(
                test.states, test.x, test.scale, test.remaining, strict=True
            )
        },
        "information": test.information.tolist(),
        "unobservable": test.unobservable,
        "invisible": test.invisible,
    }


def _medians(observability: CaseObservability) -> dict[str, float | None]:
    """Quantities of the trajectory, on which their bounds depend; None if nothing is judged."""
    at = np.searchsorted(observability.case.time, observability.tests[0].time[observability.judged])
    names = [quantity.name for quantity in observability.system.estimated]
    return {
        n: float(np.median(observability.run.signal(n)[at])) if at.size else None for n in names
    }


def _shares(test: WindowTest, observability: CaseObservability) -> dict[str, Any]:
    """Shares of the judged windows; None for a recording without."""
    if not observability.judged.any():
        return {"useful": None, "median_bound": None, "states_observable": None}
    useful = test.useful()[observability.judged].mean(axis=0)
    median = np.median(test.bound[observability.judged], axis=0)
    observable = test.states_observable()[observability.judged].mean(axis=0)
    names = observability.system.corrections
    return {
        "useful": dict(zip(names, useful.tolist(), strict=True)),
        "median_bound": dict(zip(names, median.tolist(), strict=True)),
        "states_observable": dict(zip(test.states, observable.tolist(), strict=True)),
    }


def format_observability(
    system: System, linear: Sequence[LinearTest], done: Sequence[CaseObservability]
) -> str:
    """Table for the terminal: linear test by model and state, shares of judged time by case."""
    return "\n".join(
        [
            *(f"{result.case.name}: {text}." for result in done for text in _warnings(result)),
            *_linear_lines(system, linear),
            "",
            *_case_lines(system, done),
            "Bounds are floors, for a right model at the estimated quantities (their medians), "
            "which are constant within\nthe window. An estimate may err by far more where the "
            "model differs.",
        ]
    )


def _linear_lines(system: System, linear: Sequence[LinearTest]) -> list[str]:
    span = tested_span(system)
    lines = [
        f"Linear test: {span:g} s at {_point(system)}; left = standard deviation after it over "
        "before it"
    ]
    for test in linear:
        verdict = "observable" if test.observable else "not observable"
        information = ", ".join(f"{value:.2g}" for value in test.information[::-1])
        lines.append(f"{test.model}: rank {test.rank} of {len(test.states)}, {verdict}")
        lines.append(f"  information by direction, observable above 1: {information}")
        for name, scale, left in zip(test.states, test.scale, test.remaining, strict=True):
            strength = "invisible" if name in test.invisible else "weak"
            remark = f"  {strength}" if name in test.unobservable else ""
            lines.append(f"  {name:<10} scale {scale:8.3g}   left {100 * left:6.2f} %{remark}")
    return lines


def _point(system: System) -> str:
    """The operating point in the units of people."""
    parts = []
    for name, value in system.tested.inputs.items():
        unit = shown_unit(system, name)
        parts.append(f"{name} {value / per_shown(system, name, unit):g} {unit}")
    parts += [f"{name} {formula.text}" for name, formula in system.tested.held.items()]
    parts += [f"{name} {value:g}" for name, value in system.tested.quantities.items()]
    return ", ".join(parts) or "rest"


def _case_lines(system: System, done: Sequence[CaseObservability]) -> list[str]:
    first, last = done[0].tests[0], done[0].tests[-1]
    width = max([len("case"), *(len(result.case.name) for result in done)])
    header = f"{'case':<{width}}" + "".join(
        f"{quantity.name:>9}{f'{quantity.correction} < {quantity.useful:g}':>16}{'median':>10}"
        for quantity in system.estimated
    )
    hidden = [name for name in last.states if name not in first.states]
    if not (system.estimated or hidden):
        return []
    header += "".join(f"{name:>11}" for name in hidden)
    span = first.span
    lines = [
        f"Share of time {system.objective.when or 'that is scored'} in which {span:g} s of samples "
        f"tell: {', '.join(system.corrections)} ({first.model})"
        + (f", states ({last.model})" if hidden else ""),
        header,
        "-" * len(header),
    ]
    for result in done:
        row = f"{result.case.name:<{width}}"
        shares, states = _shares(result.tests[0], result), _shares(result.tests[-1], result)
        if shares["useful"] is None:
            lines.append(f"{row}  nothing is scored")
            continue
        medians = _medians(result)
        for quantity in system.estimated:
            row += f"{medians[quantity.name]:>9.2g}"
            row += f"{100 * shares['useful'][quantity.correction]:>14.0f} %"
            row += f"{shares['median_bound'][quantity.correction]:>10.2g}"
        row += "".join(f"{100 * states['states_observable'][name]:>9.0f} %" for name in hidden)
        lines.append(row)
    return lines


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
    figures = [_figure(result) for result in sorted(done, key=_share)]
    first, *others = zoomable(figures, summary, out)
    names = ", ".join(capital(quantity.label) for quantity in system.estimated) or "States"
    parts = [
        Part("shown", "Where the samples tell least", [_EXPLAINED, first]),
        Part("cases", "Recordings", [_cases(system, summary)], printed=True),
        Part("linear", "Linear test of the models", [_LINEAR, *_states(summary)]),
        Part("definitions", "Definitions", [Definitions(_terms(summary))]),
    ]
    if others:
        parts.insert(2, Part("others", "The other recordings", others))
    missing = planned - len(done)
    warnings = [f"Incomplete: {len(done)} of {planned} recordings, interrupted."] * bool(missing)
    warnings += [
        f"{name}: {text}." for name, c in summary["cases"].items() for text in c["warnings"]
    ]
    title = f"What the measurements can tell: {names}"
    page = Page(title, parts, "observability.json", warnings=warnings)
    return page.write(summary, out / "index.html")


_EXPLAINED = (
    "For each quantity the smallest standard deviation that any estimator can reach with the "
    "samples of one window; where it stays under the line, an estimate serves. Curves that leave a "
    "panel say that the samples tell nothing. A bound holds for a right model: an estimate may err "
    "by more where the model differs."
)
_LINEAR = (
    "Some time about one operating point: the standard deviation of a state after it, over that "
    "before it. A state that keeps nearly all of it cannot be observed there."
)


def _share(observability: CaseObservability) -> float:
    """Share of the judged windows in which all quantities can be told."""
    useful = observability.tests[0].useful()
    return (
        float(useful[observability.judged].mean())
        if observability.judged.any() and useful.size
        else 1.0
    )


def _figure(observability: CaseObservability) -> CaseFigure:
    """An input, and the bounds of each quantity by model, at the ends of the windows."""
    system, time = observability.system, observability.tests[0].time
    at = np.searchsorted(observability.case.time, time)
    panels = []
    for signal in system.inputs[:1]:
        unit = shown_unit(system, signal.name)
        values = observability.case[signal.name][at] / per_shown(system, signal.name, unit)
        title = f"{capital(named(system, signal.name))} [{unit}]"
        panels.append(Panel.around(title, unit, 0.6, Curve("measured", values)))
    for j, quantity in enumerate(system.estimated):
        line = Curve("raw", np.full(time.size, quantity.useful))
        curves = [
            Curve(style, np.interp(time, test.time, test.bound[:, j]))
            for test, style in zip(observability.tests, _STYLES, strict=False)
        ]
        title = f"Bound of {called(system, quantity.name)} {quantity.name} [{quantity.unit}]"
        reach = _REACH * quantity.useful
        panels.append(Panel(title, quantity.unit, 0.0, reach, 1.0, (line, *curves)))
    legend = [("raw", "an estimate serves below")]
    legend += [(style, t.model) for t, style in zip(observability.tests, _STYLES, strict=False)]
    share = (
        f"All quantities are identifiable in {100.0 * _share(observability):.0f} % of the scored "
        "time."
    )
    return CaseFigure(
        name=observability.case.name,
        title=observability.case.title,
        finding=share if observability.judged.any() else "Nothing is scored here.",
        time=time,
        window=None,
        legend=(("measured", "measured"), *legend),
        panels=tuple(panels),
    )


def _cases(system: System, summary: Mapping[str, Any]) -> Table:
    columns: list[object] = ["recording", "conditions"]
    for quantity in system.estimated:
        unit = "" if quantity.unit == "1" else f" [{quantity.unit}]"
        columns += [
            Numbers(f"{quantity.name}, median{unit}"),
            Numbers(
                f"{quantity.name} identifiable [%]",
                meaning=f"time with a bound below {quantity.useful:g}",
            ),
            Numbers(f"bound of {quantity.name}, median{unit}"),
        ]
    rows = []
    for name, case in summary["cases"].items():
        first = next(iter(case["models"].values()))
        cells = [case["title"]]
        for quantity in system.estimated:
            share = None if first["useful"] is None else first["useful"][quantity.correction]
            bound = (
                None
                if first["median_bound"] is None
                else first["median_bound"][quantity.correction]
            )
            cells += [
                number(case[f"median_{quantity.name}"], ".3g"),
                number(None if share is None else 100.0 * share, ".0f", share),
                number(bound, ".2g"),
            ]
        rows.append((name, *cells))
    caption = (
        f"How well windows of {summary['window_s']:g} s know each quantity, over the scored time "
        "of each recording, by the first model."
    )
    return Table("case-table", caption, columns, rows)


def _states(summary: Mapping[str, Any]) -> list[Table]:
    tables = []
    for model, test in summary["linear"].items():
        rows = [
            (
                name,
                number(100.0 * state["remaining"], ".2f", state["remaining"]),
                number(state["scale"], ".3g"),
                _verdict(name, test),
            )
            for name, state in test["states"].items()
        ]
        columns = (
            "state",
            Numbers(f"left after {summary['linear_s']:g} s [%]"),
            Numbers("scale [unit of the state]"),
            "verdict",
        )
        seen = "observable" if test["observable"] else "not observable"
        caption = f"{model}: rank {test['rank']} of {len(test['states'])}, {seen}."
        tables.append(Table(f"linear-{model}", caption, columns, rows))
    return tables


def _verdict(name: str, test: Mapping[str, Any]) -> str:
    if name not in test["unobservable"]:
        return "observable"
    return "invisible" if name in test["invisible"] else "weakly seen"


def _terms(summary: Mapping[str, Any]) -> dict[str, str]:
    return {
        "Bound": "Cramer-Rao: no unbiased estimator has a smaller standard deviation, given the "
        f"noise of the sensors and {summary['window_s']:g} s of samples, with what is known "
        "beforehand.",
        "Identifiable": "The bound is below the value from which on an estimate serves, which the "
        "system file gives for each quantity ("
        + ", ".join(f"{name} {value:g}" for name, value in summary["useful"].items())
        + ").",
        "Rank": "Number of directions in the space of states that "
        f"{summary['linear_s']:g} s of outputs show beyond their noise.",
    }


def observability_answer(system: System, summary: Mapping[str, Any]) -> Answer:
    """The answer of `observability`."""
    headline, details = {}, {}
    cases = summary["cases"]
    words = []
    for quantity in system.estimated:
        shares, bounds = {}, {}
        for case, values in cases.items():
            first = next(iter(values["models"].values()))
            if first["useful"] is not None:
                shares[case] = first["useful"][quantity.correction]
                bounds[case] = first["median_bound"][quantity.correction]
        for case, share in shares.items():
            details[f"{case}: time in which {quantity.name} is identifiable"] = percentage(
                share, "higher"
            )
            details[f"{case}: bound of {quantity.name}"] = Measure(
                bounds[case], quantity.unit, "lower"
            )
        if shares:
            middle = float(np.median(list(shares.values())))
            headline[f"time in which {quantity.name} is identifiable, median"] = percentage(
                middle, "higher"
            )
            low, high = min(shares.values()), max(shares.values())
            between = f" ({whole_percent(low)} to {whole_percent(high)})" if len(shares) > 1 else ""
            words.append(
                f"{quantity.label} {quantity.name} to {quantity.useful:g}"
                f"{unit_suffix(quantity.unit)} in {whole_percent(middle)} of the scored "
                f"time{between}"
            )
    first, test = next(iter(summary["linear"].items()))
    seen = "can" if test["observable"] else "cannot"
    window = f"{summary['window_s']:g} s of samples"
    reach = f"{window} can tell {'; '.join(words)}. " if words else ""
    states = f"All states of {first} {seen} be observed in the linear test."
    if not test["observable"]:
        states = f"Not all states of {first} can be observed: {', '.join(test['unobservable'])}."
    texts = dict.fromkeys(text for values in cases.values() for text in values["warnings"])
    doubts = "".join(f"{text.partition(':')[0]}. " for text in texts)
    return Answer(f"{doubts}{reach[:1].upper()}{reach[1:]}{states}", headline, details)
