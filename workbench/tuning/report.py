"""The page of `tune`: what the search gained, what is wrong with it, what each gain is worth.

Numbers come from the summary alone; what is here orders and places them.
"""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workbench.pages.answer import Answer, Measure
from workbench.pages.drawing import ticks_within
from workbench.pages.templates import rendered
from workbench.runtime.files import write_whole
from workbench.tuning.validation import NEGLIGIBLE, STEP

_REASONED, _TUNED = "0", "2"  # styles of curves


_DOTS = {"left": 250, "width": 620, "row": 24, "top": 34}  # of the figure of the cases [px]


_CURVE = {"left": 58, "width": 850, "height": 220, "top": 16}  # of the convergence [px]


def headline(summary: Mapping[str, Any]) -> str:
    """The result in one sentence."""
    z, before = summary["z"], summary["z_reasoned"]
    moved = "falls" if z < before else "rises"
    result = (
        f"z stays at {z:.4g}, because no candidate was better than the reasoned gains"
        if z == before
        else f"z, the objective of the worst case, {moved} from {before:.4g} with the reasoned "
        f"gains to {z:.4g} with the tuned ones ({100 * (z / before - 1):+.1f} %)"
    )
    worst, *others = _worst_first(summary)
    if others:
        margin = 100 * (1 - others[0]["z_k"] / worst["z_k"])
        place = f"the worst case is {worst['name']}, by {margin:.1f} % over {others[0]['name']}"
    else:
        place = f"the only case is {worst['name']}"
    bound = [name for name, gain in summary["gains"].items() if gain["at_bound"]]
    end = f"{', '.join(bound) or 'no gain'} ended at a bound of the search"
    work = summary["work"]
    stop = f"Interrupted after generation {work['generations']}: " * work["interrupted"]
    return f"{stop}{result}; {place}; {end}."


def bad_news(summary: Mapping[str, Any]) -> list[str]:
    """What speaks against the tuned gains, a sentence each."""
    news = []
    if summary["work"]["interrupted"]:
        news.append(
            "Incomplete: the search was interrupted, so nothing says yet what each gain is worth, "
            "or how the gains do on cases they have not seen. The same command with --resume goes "
            "on from there."
        )
    elif (done := len(summary["folds"])) < (asked := summary["work"]["folds"]):
        news.append(
            f"Incomplete: the search without each fold was interrupted after {done} of {asked}. "
            "The same command with --resume goes on from there."
        )
    if worse := [case for case in _worst_first(summary) if case["z_k"] > case["z_k_reasoned"]]:
        cases = ", ".join(
            f"{case['name']} ({case['z_k_reasoned']:.4g} to {case['z_k']:.4g})" for case in worse
        )
        news.append(f"Worse than with the reasoned gains: {cases}.")
    folds = _folds(summary)
    if missed := [fold for fold in folds if not fold["better"]]:
        news.append(
            f"On cases they have not seen, tuned gains are not better than the reasoned ones in "
            f"{len(missed)} of {len(folds)} folds: {'; '.join(_why(summary, f) for f in missed)}."
        )
    for entry in summary.get("beside", {}).values():
        if entry["z"] is not None and entry["z"] < summary["z"]:
            news.append(
                f"Better without any tuning: {entry['label']}, z = {entry['z']:.4g}. It makes its "
                "gains anew at every sample, where these are the same at every one."
            )
    falls = {name: fall for name, e in summary["sensitivity"].items() if (fall := _fall(e))}
    if falls:
        news.append(
            f"z would still fall, by up to {100 * max(falls.values()):.1f} %, with another value "
            f"of one gain alone ({', '.join(falls)}): the search had not converged."
        )
    if crashed := summary["work"]["crashed"]:
        news.append(f"Candidates that crashed or blocked their worker: {crashed}.")
    return news


def write_tuning_page(summary: Mapping[str, Any], folder: Path) -> Path:
    """Write the page into the folder, beside gains.toml and the figures; returns its path.

    Parameters
    ----------
    summary : as written to summary.json.
    """
    text = rendered(
        "tuning.html",
        summary,
        headline=headline(summary),
        news=bad_news(summary),
        cases=_worst_first(summary),
        gains=_gains(summary),
        folds=_folds(summary),
        compared=_compared(summary),
        dots=_dots(summary),
        curve=_convergence(summary),
        styles={"reasoned": _REASONED, "tuned": _TUNED},
        gains_path=shlex.quote(str(folder / "gains.toml")),
        follows=summary["follows"],
        negligible=NEGLIGIBLE,
        step=STEP,
    )
    path = folder / "index.html"
    write_whole(path, text)
    return path


def _worst_first(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Cases with their names."""
    cases = [{"name": name, **case} for name, case in summary["cases"].items()]
    return sorted(cases, key=lambda case: -case["z_k"])


def _gains(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Gains with what they do, and what z does when they change; None after an interruption."""
    rows = []
    for name, gain in summary["gains"].items():
        effect = summary["sensitivity"].get(name)
        remarks = ["⚠ at bound"] if gain["at_bound"] else []
        if effect is not None and not effect["matters"]:
            remarks.append("does not matter")
        if effect is not None and _fall(effect):
            remarks.append("not converged")
        rows.append({**gain, "name": name, "effect": effect} | {"remark": ", ".join(remarks)})
    return rows


def _fall(effect: Mapping[str, float | None]) -> float:
    """How much z would fall if the gain alone were changed; 0 where that is negligible."""
    changes = (effect["less"], effect["more"], effect["without"])
    fall = -min((change for change in changes if change is not None), default=0.0)
    return fall if fall > NEGLIGIBLE else 0.0


def _folds(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Folds, the worst first; z is None where an estimate diverges."""
    rows = [
        {**fold, "better": fold["tuned"] is not None and fold["tuned"] < fold["reasoned"]}
        for fold in summary["folds"]
    ]
    return sorted(rows, key=lambda fold: -np.inf if fold["tuned"] is None else -fold["tuned"])


def _compared(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """These gains among untuned estimators, the least z first; empty if there is none to compare.

    A z is None where an estimate diverges.
    """
    if not summary.get("beside"):
        return []
    name, cases = summary["label"], summary["cases"]
    rows = [
        {
            "name": f"{name}, {how}",
            "z": summary[z],
            "worst": max(cases, key=lambda c: cases[c][z_k]),
        }
        for how, z, z_k in (("tuned", "z", "z_k"), ("reasoned", "z_reasoned", "z_k_reasoned"))
    ]
    rows[0]["found"] = True
    rows += [{"name": entry["label"], **entry} for entry in summary["beside"].values()]
    return sorted(rows, key=lambda row: np.inf if row["z"] is None else row["z"])


def _why(summary: Mapping[str, Any], fold: Mapping[str, Any]) -> str:
    """Why tuned gains are not better on a fold, by what its worst case does when it is tuned on."""
    worst, tuned = fold["worst"], fold["tuned"]
    case = summary["cases"][worst]
    change = f"{worst} ({case['z_k_reasoned']:.4g} to "
    change += "no estimate)" if tuned is None else f"{tuned:.4g})"
    if case["z_k"] < case["z_k_reasoned"]:
        return f"{change} asks of the gains what no case asks that was tuned on"
    return f"{change} loses also where it is tuned on, because the worst case gains at its cost"


def _dots(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Pairs of dots on an axis from zero, in pixels, the worst case first."""
    cases = _worst_first(summary)
    left, width, row, top = _DOTS["left"], _DOTS["width"], _DOTS["row"], _DOTS["top"]
    high = 1.05 * max(case[key] for case in cases for key in ("z_k", "z_k_reasoned"))

    def at(value: float) -> float:
        return float(left + width * value / high)

    return {
        **_DOTS,
        "rows": [
            {
                "name": case["name"],
                "y": top + row * (k + 0.5),
                "reasoned": at(case["z_k_reasoned"]),
                "tuned": at(case["z_k"]),
            }
            for k, case in enumerate(cases)
        ],
        "z": at(summary["z"]),
        "ticks": [(at(value), text) for value, text in ticks_within(0.0, high, 8)],
        "bottom": top + row * len(cases),
        "total": left + width + 40,
    }


def _convergence(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Best z by generation, in pixels; it holds until a better candidate is found."""
    best, before = summary["convergence"], summary["z_reasoned"]
    left, width, height, top = (_CURVE[key] for key in ("left", "width", "height", "top"))
    low, high = min(*best, before), max(*best, before)
    room = 0.08 * (high - low or high)
    low, high = low - room, high + room
    last = len(best) - 1

    def across(generation: float) -> float:
        return left + width * generation / max(last, 1)

    def down(z: float) -> float:
        return float(top + height * (high - z) / (high - low))

    steps = (f"H{across(k):.1f}V{down(z):.1f}" for k, z in enumerate(best))
    whole = ((value, text) for value, text in ticks_within(0.0, max(last, 1), 10) if value % 1 == 0)
    return {
        **_CURVE,
        "path": f"M{across(0):.1f} {down(best[0]):.1f}" + "".join(steps),
        "end": (across(last), down(best[-1])),
        "before": down(before),
        "across": [(across(value), text) for value, text in whole],
        "down": [(down(value), text) for value, text in ticks_within(low, high, 6)],
        "bottom": top + height,
        "total": left + width + 40,
    }


def format_tuned(summary: Mapping[str, Any]) -> str:
    """Table for the terminal: cases, and what is to be said of gains and folds."""
    cases = summary["cases"]
    width = max(map(len, cases))
    lines = [f"{'case':<{width}} {'reasoned':>9} {'tuned':>9}  z_k, worst first"]
    for name, case in sorted(cases.items(), key=lambda item: -item[1]["z_k"]):
        lines.append(f"{name:<{width}} {case['z_k_reasoned']:>9.4f} {case['z_k']:>9.4f}")
    work = summary["work"]
    lines.append(
        f"z = {summary['z']:.5f} after {work['generations']} generations, {work['candidates']} "
        f"candidates, {work['saved']:.0%} of the work saved, {work['seconds']:.0f} s"
    )
    if bound := [name for name, gain in summary["gains"].items() if gain["at_bound"]]:
        lines.append(f"at a bound of the search: {', '.join(bound)}")
    if effects := summary["sensitivity"]:
        idle = [name for name, effect in effects.items() if not effect["matters"]]
        lines.append(f"gains that do not matter (z within 1 %): {', '.join(idle) or 'none'}")
    for name, entry in summary["beside"].items():
        z = "diverges" if entry["z"] is None else f"z = {entry['z']:.5f}"
        lines.append(f"{name}, not tuned: {z}, worst {entry['worst']}")
    for fold in summary["folds"]:
        tuned, reasoned, error, untuned = (
            np.inf if fold[name] is None else fold[name]
            for name in ("tuned", "reasoned", "error", "error_reasoned")
        )
        verdict = "better" if tuned < reasoned else "not better"
        lines.append(
            f"not seen: {', '.join(fold['cases'])}: z {tuned:.4f}, {verdict} than reasoned "
            f"{reasoned:.4f}; seen: {fold['z']:.4f}; error of {summary['judged']} {error:.2%}, "
            f"reasoned {untuned:.2%}"
        )
    return "\n".join(lines)


def tuning_answer(sentence: str, summary: Mapping[str, Any]) -> Answer:
    """The answer of `tune`.

    Parameters
    ----------
    sentence : that its page begins with.
    """
    headline = {
        "z, tuned": Measure(summary["z"], "1", "lower"),
        "z, reasoned": Measure(summary["z_reasoned"], "1", "lower"),
    }
    unseen = [fold["tuned"] for fold in summary["folds"]]
    if unseen:
        worst = None if None in unseen else max(unseen)
        headline["z on cases not seen, worst"] = Measure(worst, "1", "lower")
    details = {
        f"{name}: z_k": Measure(case["z_k"], "1", "lower")
        for name, case in summary["cases"].items()
    }
    return Answer(sentence, headline, details)
