"""What the diagnosis makes of other thresholds, a wrong sheet, causes it lacks, a plan: files."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from workbench.answer import Answer, Measure
from workbench.files import write_json
from workbench.lab import with_unit
from workbench.power import following, left_out
from workbench.power.planned import SURE, Foreseen
from workbench.power.sensitivity import FACTORS, Varied
from workbench.report.answers import with_answer
from workbench.report.diagnosis_figures import draw_heat
from workbench.report.figures import STYLE, save_figure


def write_thresholds(
    results: Sequence[Varied],
    usual: Mapping[str, float],
    provenance: Mapping[str, Any],
    out: Path,
) -> None:
    """Write thresholds.json.

    Parameters
    ----------
    usual : value of each threshold.
    """
    sets = [
        {
            "rig": one.planting.options,
            "kind": one.planting.kind,
            "planted": one.planting.effects,
            "said": one.said,
            "changed": [asdict(other) for other in one.changed],
        }
        for one in results
    ]
    changes = sum(bool(one.changed) for one in results)
    sentence = (
        f"Half or twice of a threshold changes what is said of {changes} of {len(results)} sets."
    )
    headline = {"sets of which something else is said": Measure(float(changes), "1", "lower")}
    content = {"provenance": provenance, "usual": usual, "sets": sets}
    write_json(out / "thresholds.json", with_answer(Answer(sentence, headline), content))


def format_thresholds(results: Sequence[Varied], usual: Mapping[str, float]) -> str:
    """Table of what changes, and the thresholds that change nothing."""
    lines = [f"{len(results)} sets, each threshold times {' and '.join(map(str, FACTORS))}", ""]
    idle = []
    for name, value in usual.items():
        rows = [
            (change, one) for one in results for change in one.changed if change.threshold == name
        ]
        if not rows:
            idle.append(f"{name} {value:.4g}")
        for change, one in rows:
            lines.append(
                f"{name} {value:.4g} -> {change.value:.4g}: {', '.join(one.said)} becomes "
                f"{', '.join(change.said)} ({one.planting.options})"
            )
    return "\n".join([*lines, "", f"nothing changes by: {', '.join(idle)}"])


def write_sheet(
    rows: Sequence[Mapping[str, Any]], provenance: Mapping[str, Any], out: Path
) -> None:
    """Write sheet_error.json."""
    wrong = sum(row["wrong_name"] for row in rows)
    sentence = f"A wrong data sheet leads to a wrong name in {wrong} of {len(rows)} sets."
    headline = {"sets with a wrong name": Measure(float(wrong), "1", "lower")}
    content = {"provenance": provenance, "sets": list(rows)}
    write_json(out / "sheet_error.json", with_answer(Answer(sentence, headline), content))


def format_sheet(rows: Sequence[Mapping[str, Any]]) -> str:
    """Table of what was said, and the number of wrong names."""
    lines = [f"{'wrong in the sheet':<26} {'verdict':<12} causes"]
    for row in rows:
        error = " ".join(f"{name}={gain:+g}" for name, gain in row["wrong"].items())
        causes = ", ".join(" or ".join(group) for group in row["causes"])
        mark = "  WRONG NAME" if row["wrong_name"] else ""
        lines.append(f"{error:<26} {row['verdict']:<12} {causes or row['error']}{mark}")
    wrong = sum(row["wrong_name"] for row in rows)
    return "\n".join([*lines, "", f"{wrong} of {len(rows)} sets have a wrong name"])


def write_left_out(
    summary: Mapping[str, Any],
    rows: Sequence[Mapping[str, Any]],
    provenance: Mapping[str, Any],
    out: Path,
) -> None:
    """Write left_out.json.

    Parameters
    ----------
    summary : shares of all.
    """
    right = summary["right_slot"]
    sentence = (
        f"The slot of the cause that was left out is proposed in {right['hits']} of {right['of']} "
        "sets that nothing else explains."
    )
    answer = Answer(sentence, _measures(summary, left_out.SHARES, lower=("clean",)))
    content = {"provenance": provenance, **summary, "sets": list(rows)}
    write_json(out / "left_out.json", with_answer(answer, content))


def format_left_out(summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> str:
    """Table of what was proposed, and how often it acts where the cause did."""
    lines = []
    for row in rows:
        what = ", ".join(row["left_out"]) or row["rig"]
        mark = {True: "right slot", False: "NOT THE SLOT", None: "no cause"}[row["slot_right"]]
        said = "; ".join(row["laws"]) or row["error"] or _nothing(row)
        lines.append(f"{what:<30} {mark if row['asked'] else '':<16} {said}")
    return "\n".join([*lines, "", *_shares(summary, left_out.SHARES)])


def _nothing(row: Mapping[str, Any]) -> str:
    named = f", {' and '.join(row['named'])}" * bool(row["named"])
    late = f", {' and '.join(row['late'])} late" * bool(row["late"])
    return f"nothing proposed ({row['verdict']}{named}{late})"


def _measures(
    summary: Mapping[str, Any], texts: Mapping[str, str], lower: Sequence[str]
) -> dict[str, Measure]:
    """Shares as numbers of an answer."""
    return {
        texts[name]: Measure(
            one["share"], "1", "lower" if name in lower else "higher", one["low"], one["high"]
        )
        for name, one in summary.items()
    }


def _shares(summary: Mapping[str, Any], texts: Mapping[str, str]) -> list[str]:
    return [
        f"{one['hits']} of {one['of']} {texts[name]} ({one['low']:.0%} to {one['high']:.0%})"
        for name, one in summary.items()
    ]


def write_followed(
    summary: Mapping[str, Any],
    rows: Sequence[Mapping[str, Any]],
    provenance: Mapping[str, Any],
    out: Path,
) -> None:
    """Write followed.json.

    Parameters
    ----------
    summary : shares of all.
    """
    made, drawn = summary["proposed"], summary["drawn"]
    sentence = (
        f"The recording that is proposed parts {made['hits']} of {made['of']} groups, one that is "
        f"drawn {drawn['hits']} of {drawn['of']}."
    )
    headline = _measures(summary, following.SHARES, lower=("drawn", "never"))
    content = {"provenance": provenance, **summary, "sets": list(rows)}
    write_json(out / "followed.json", with_answer(Answer(sentence, headline), content))


def format_followed(summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> str:
    """Table of what was left together and what was said then, and all shares."""
    lines = []
    for row in rows:
        made = row["proposed"]
        said = " or ".join(row["group"]) or row["error"] or row["verdict"]
        if made is not None:
            then = " or ".join(made["named"]) or made["verdict"]
            drawn = ["parts" if one["parts"] else "does not" for one in row["drawn"]]
            said += f" -> {then} (one that is drawn: {', '.join(drawn)}): {made['experiment']}"
        if (sensed := row["sensed"]) is not None:
            then = " or ".join(sensed["named"]) or sensed["verdict"]
            said += f"; with a sensor of {sensed['sensor']}: {then}"
        lines.append(f"{row['planted']:<30} x{row['multiple']:<4g} {said}")
    return "\n".join([*lines, "", *_shares(summary, following.SHARES)])


def write_plan(
    rows: Sequence[Foreseen], sizes: Sequence[float], provenance: Mapping[str, Any], out: Path
) -> None:
    """Write plan.json and the figure of chances.

    Parameters
    ----------
    sizes : multiples of what matters.
    """
    seen = sum(one.least is not None and one.least <= sizes[-1] * one.matters for one in rows)
    sentence = (
        f"Of {len(rows)} effects, these recordings show {seen} with a chance of {SURE:.0%} or more "
        f"at {sizes[-1]:g} times the size that matters."
    )
    headline = {f"effects shown at {sizes[-1]:g} times": Measure(float(seen), "1", "higher")}
    content = {"provenance": provenance, "sizes": list(sizes), "effects": list(map(asdict, rows))}
    write_json(out / "plan.json", with_answer(Answer(sentence, headline), content))
    with mpl.rc_context(STYLE):
        save_figure(_chances(rows, sizes), [out / "plan.png", out / "plan.svg"])


def format_plan(rows: Sequence[Foreseen], sizes: Sequence[float]) -> str:
    """Table of chances, by size."""
    lines = [f"{'effect':<30}{'1 is':>18}" + "".join(f"{f'x {s:g}':>8}" for s in sizes)]
    lines[0] += f"{f'found by {SURE:.0%} from':>24}"
    for one in rows:
        row = f"{one.effect:<30}{with_unit(one.matters, one.unit):>18}"
        if one.least is None:
            lines.append(f"{row}  these recordings cannot show it")
            continue
        row += "".join(f"{f'{chance:.0%}':>8}" for _, chance in one.chances)
        lines.append(f"{row}{with_unit(one.least, one.unit):>24}")
    return "\n".join(lines)


def _chances(rows: Sequence[Foreseen], sizes: Sequence[float]) -> Figure:
    """Chance that an effect is named [%], by effect and size."""
    table = np.array(
        [[100.0 * c for _, c in one.chances] or [0.0] * len(sizes) for one in rows]
    ).reshape(len(rows), len(sizes))
    sheet = Figure(figsize=(3.5 + 0.5 * len(sizes), 1.5 + 0.25 * len(rows)), layout="constrained")
    axes = sheet.subplots()
    axes.grid(visible=False)
    draw_heat(axes, table, 100.0)
    axes.set_xticks(range(len(sizes)), [f"{size:g}" for size in sizes])
    axes.set_yticks(range(len(rows)), [one.effect for one in rows])
    axes.set_xlabel("size over the least that matters")
    sheet.suptitle("Chance that the planned recordings show it [%]")
    return sheet
