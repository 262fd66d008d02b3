"""The page of `power`: how often the diagnosis is right, by effect and size."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from workbench.lab import with_unit
from workbench.power import VISIBLE
from workbench.report.parts import Cell, Dot, Dots, Heading, Part, Rows, number, write_parts

_STYLE = "2"
_INTERVAL = (
    "Intervals hold the true share in at least 95 % of such runs, however few sets there are "
    "(Clopper and Pearson 1934)."
)


def write_power_page(summary: Mapping[str, Any], out: Path) -> Path:
    """Write the page into the folder; returns its path.

    Parameters
    ----------
    summary : as written to power.json.
    """
    provenance = summary["provenance"]
    warnings = []
    if provenance["interrupted"]:
        warnings.append("Interrupted: the same command with --resume goes on from here.")
    if summary["failed"]:
        warnings.append(f"{len(summary['failed'])} diagnoses failed; they count as not right.")
    parts = [
        Part("shown", "How often it is right", (_INTERVAL,), dots=(_shares(summary),)),
        Part("definitions", "Definitions", terms=_TERMS),
    ]
    if summary["effects"]:
        tables = (_effects(summary),)
        parts.insert(1, Part("effects", "By effect and size", tables=tables, printed=True))
    if summary["confusion"]:
        parts.insert(-1, Part("confusion", "What is taken for what", tables=(_confusion(summary),)))
    path = out / "index.html"
    title = f"How often the diagnosis is right: {summary['sets']} sets of recordings"
    write_parts(title, summary, parts, path, file="power.json", warnings=warnings)
    return path


def _shares(summary: Mapping[str, Any]) -> Dots:
    """The headline as dots with their intervals."""
    rows = []
    for name, one in summary["answer"]["headline"].items():
        known = one["value"] is not None
        dot = (Dot(one["value"], _STYLE, one["low"], one["high"]),) if known else ()
        rows.append((name, dot))
    told = [
        f"{name} {one['value']:.0f} %"
        for name, one in summary["answer"]["headline"].items()
        if one["value"] is not None
    ]
    finding = "Shares of sets with their 95 % intervals: " + (", ".join(told) or "none") + "."
    return Dots(finding, "share of sets [%]", tuple(rows), high=100.0)


def _effects(summary: Mapping[str, Any]) -> Rows:
    """Effects by sizes, a cell for each share."""
    effects = summary["effects"]
    sizes = sorted({size for one in effects.values() for size in one["right_first"]}, key=float)
    columns = [
        Heading("effect", number=False),
        Heading("1 is", number=False, meaning="least size that is worth a finding"),
        *(Heading(f"x {size} [%]") for size in sizes),
        Heading("intervals hold [%]"),
        Heading("remark", number=False),
    ]
    rows = []
    for name, one in effects.items():
        cells = [Cell(with_unit(one["size"], one["unit"]))]
        cells += [_share(one["right_first"].get(size)) for size in sizes]
        cells += [_share(one["coverage"]), Cell("hidden" if one["hidden"] else "")]
        rows.append((name, tuple(cells)))
    caption = (
        "Share of sets in which the planted effect, or a group that it is in, is named first, by "
        "its size over the least that is worth a finding; hits and sets in brackets."
    )
    return Rows("effect-table", caption, tuple(columns), tuple(rows))


def _share(one: Mapping[str, Any] | None) -> Cell:
    if one is None or not one["of"]:
        return Cell("n/a")
    counts = f"({one['hits']}/{one['of']})"
    return number(
        100.0 * one["share"], lambda percent: f"{percent:.0f} {counts}", heat=one["share"]
    )


def _confusion(summary: Mapping[str, Any]) -> Rows:
    """Planted by named."""
    said = dict.fromkeys(name for row in summary["confusion"].values() for name in row)
    rows = []
    for planted, row in summary["confusion"].items():
        of = sum(row.values())
        cells = tuple(
            number(float(row.get(name, 0)), "{:.0f}".format, row.get(name, 0) / of if of else 0.0)
            for name in said
        )
        rows.append((planted, cells))
    caption = f"Sets by what was planted (rows, from size {VISIBLE:g} on) and what was named first."
    columns = (Heading("planted", number=False), *(Heading(name) for name in said))
    return Rows("confusion-table", caption, columns, tuple(rows))


_TERMS = {
    "Set": "Recordings of one virtual machine, with tolerances of its own, in which one effect, "
    "two, one that the catalogue lacks, or none was planted.",
    "Right": "The effect that was planted is named first, or is in the group of those that the "
    "data cannot tell from the one named.",
    "False alarm": "A cause is named, or something called unexplained, in a set without any.",
    "Hidden": "No recording of this kind can show it; it counts as neither right nor wrong.",
}
