"""Power of the diagnosis: figures, file and table."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from workbench.files import write_json
from workbench.lab import with_unit
from workbench.power import CLEAR, VISIBLE, Findable
from workbench.report.answers import powered, with_answer
from workbench.report.diagnosis_figures import draw_heat
from workbench.report.figures import LIGHT, STYLE, save_figure
from workbench.report.power_page import write_power_page

_COLUMNS = 5  # of power curves
_LINE, _MARK = LIGHT["2"], LIGHT["0"]


def write_power(
    summary: Mapping[str, Any],
    effects: Sequence[Findable],
    provenance: Mapping[str, Any],
    out: Path,
) -> None:
    """Write power.json and, as PNG and SVG, what there is of curves, confusion and coverage.

    Parameters
    ----------
    effects : of the library, in whose order they stand.
    """
    content = {"provenance": provenance, **summary}
    told = with_answer(powered(summary), content)
    write_json(out / "power.json", told)
    write_power_page(told, out)
    names = [effect.name for effect in effects]
    measured = summary["effects"]
    with mpl.rc_context(STYLE | {"font.size": 8}):
        figures = {"confusion": _confusion(summary["confusion"], names)} if summary["sets"] else {}
        if measured:
            figures |= {"power": _curves(measured), "coverage": _coverage(summary)}
        for name, figure in figures.items():
            save_figure(figure, [out / f"{name}.png", out / f"{name}.svg"])


def _curves(effects: Mapping[str, Any]) -> Figure:
    """Share named right against size, one panel for each effect."""
    columns = min(_COLUMNS, len(effects))
    rows = -(-len(effects) // columns)
    sheet = Figure(figsize=(0.6 + 2.1 * columns, 1.0 + 1.4 * rows), layout="constrained")
    panels = sheet.subplots(rows, columns, sharey=True, squeeze=False)
    for axes in panels.flat[len(effects) :]:
        axes.set_visible(False)
    for axes, (name, one) in zip(panels.flat, effects.items(), strict=False):
        shares = list(one["right_first"].values())
        places = range(len(shares))
        low, high = ([100.0 * entry[key] for entry in shares] for key in ("low", "high"))
        axes.vlines(places, low, high, color=LIGHT["raw"], linewidth=2.0)
        axes.plot(places, [100.0 * entry["share"] for entry in shares], "o-", color=_LINE)
        hidden = ", hidden" if one["hidden"] else ""
        axes.set_title(f"{name}\n1 = {with_unit(one['size'], one['unit'])}{hidden}", fontsize=6.5)
        axes.set_xticks(places, list(one["right_first"]))
        axes.set_ylim(-5.0, 105.0)
    for row in panels:
        row[0].set_ylabel("[%]")
    sheet.suptitle("Named right, with 95 % interval, against size over the least that matters")
    return sheet


def _confusion(confusion: Mapping[str, Mapping[str, int]], names: Sequence[str]) -> Figure:
    """Planted by named, each row in percent."""
    said = {name for row in confusion.values() for name in row}
    order = ["nothing", *names, "unexplained", "failed"]
    columns = [name for name in order if name in said or name in confusion]
    table = np.array(
        [
            [100.0 * row.get(name, 0) / max(sum(row.values()), 1) for name in columns]
            for row in confusion.values()
        ]
    ).reshape(len(confusion), len(columns))
    sheet = Figure(
        figsize=(3.0 + 0.3 * len(columns), 2.5 + 0.25 * len(confusion)), layout="constrained"
    )
    axes = sheet.subplots()
    axes.grid(visible=False)
    draw_heat(axes, table, 100.0)
    axes.set_xticks(range(len(columns)), columns, rotation=90)
    labels = [f"{name} ({sum(row.values())})" for name, row in confusion.items()]
    axes.set_yticks(range(len(confusion)), labels)
    axes.set_xlabel("named first; twins under their own name")
    axes.set_ylabel("planted (sets)")
    sheet.suptitle(f"Named first [%], from size {VISIBLE:g} on")
    return sheet


def _coverage(summary: Mapping[str, Any]) -> Figure:
    """Share of the 95 % intervals that hold the truth, by effect."""
    rows = {name: one["coverage"] for name, one in summary["effects"].items()}
    rows = {name: one for name, one in rows.items() if one["of"]} | {"all": summary["coverage"]}
    sheet = Figure(figsize=(7.5, 1.2 + 0.22 * len(rows)), layout="constrained")
    axes = sheet.subplots()
    heights = range(len(rows))
    low, high = ([100.0 * one[key] for one in rows.values()] for key in ("low", "high"))
    axes.hlines(heights, low, high, color=LIGHT["raw"], linewidth=2.0)
    values = [np.nan if one["share"] is None else 100.0 * one["share"] for one in rows.values()]
    axes.plot(values, heights, "o", color=_LINE)
    axes.axvline(95.0, color=_MARK, linewidth=0.8)
    axes.set_yticks(heights, [f"{name} ({one['of']})" for name, one in rows.items()])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 101.0)
    axes.set_xlabel("95 % intervals that hold the planted value [%]")
    return sheet


def format_power(summary: Mapping[str, Any]) -> str:
    """Table for the terminal."""
    effects, outside = summary["effects"], summary["outside"]
    sizes = sorted({float(s) for one in effects.values() for s in one["right_first"]})
    header = f"{'effect':<30}{'1 is':>18}" + "".join(f"{f'x {s:g}':>8}" for s in sizes)
    lines = [
        f"{summary['sets']} sets of recordings, {len(summary['failed'])} failed",
        f"false alarms on clean sets          {_text(summary['false_alarms'])}",
        f"right cause or its group first      {_text(summary['right_first'])}   from {VISIBLE:g} "
        "times the size that matters",
        f"... where it is above noise         {_text(summary['right_first_above_noise'])}   from "
        f"{CLEAR:g} standard deviations on",
        f"... and no other cause              {_text(summary['right_alone'])}",
        f"both of a pair                      {_text(summary['pairs']['both'])}",
        f"... each of which is found alone    {_text(summary['pairs']['both_seen_alone'])}",
        f'unknown cause is "unexplained"      {_text(summary["unexplained"])}',
        f"95 % intervals that hold the truth  {_text(summary['coverage'])}",
        "",
        header + f"{'coverage':>11}",
        "-" * (len(header) + 11),
    ]
    for name, one in effects.items():
        row = f"{name:<30}{with_unit(one['size'], one['unit']):>18}"
        row += "".join(f"{_count(one['right_first'].get(f'{size:g}')):>8}" for size in sizes)
        lines.append(row + f"{_count(one['coverage']):>11}" + "  hidden" * one["hidden"])
    for name, one in outside.items():
        said = (
            f"x {size}: " + ", ".join(f"{n} {verdict}" for verdict, n in verdicts.items())
            for size, verdicts in one["verdicts"].items()
        )
        lines.append(f"{name:<30}{with_unit(one['size'], one['unit']):>18}  {'; '.join(said)}")
    return "\n".join(lines)


def _count(one: Mapping[str, Any] | None) -> str:
    return f"{one['hits']}/{one['of']}" if one and one["of"] else "-"


def _text(one: Mapping[str, Any]) -> str:
    if not one["of"]:
        return f"{'-':>8}"
    low, high = 100.0 * one["low"], 100.0 * one["high"]
    return f"{100.0 * one['share']:6.1f} % ({low:.1f} to {high:.1f} %, {_count(one)})"
