"""Power of the diagnosis: figures, file and table."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis import Effect
from workbench.diagnosis.figures import draw_heat
from workbench.pages.answer import Answer, Measure, share_measure, share_with_interval, with_answer
from workbench.pages.figures import LIGHT, in_style, save_figure, styled
from workbench.pages.parts import (
    Cell,
    Definitions,
    Dot,
    Dots,
    Numbers,
    Page,
    Part,
    Table,
    number,
    term,
)
from workbench.pages.views import capital
from workbench.runtime.files import write_json
from workbench.studies.power import CLEAR, following, left_out
from workbench.studies.power.campaign import SURE, EffectChance, EffectLimit
from workbench.studies.power.sensitivity import FACTORS, ThresholdSensitivity
from workbench.system.units import with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Check:
    """Result of a check of the diagnosis, for a file and for people."""

    name: str  # of the file
    answer: Answer
    content: Mapping[str, Any]  # of the file, beside its answer and what was run
    text: str  # table for the terminal

    def write(self, provenance: Mapping[str, Any], out: Path) -> Path:
        """Write the file; returns its path."""
        path = out / f"{self.name}.json"
        write_json(path, with_answer(self.answer, {"provenance": provenance, **self.content}))
        return path


def thresholds_check(results: Sequence[ThresholdSensitivity], usual: Mapping[str, float]) -> Check:
    """Report which verdicts half and twice of each threshold change."""
    sets = [
        {
            "rig": result.planting.options,
            "kind": result.planting.kind,
            "planted": result.planting.effects,
            "said": result.said,
            "changed": [asdict(change) for change in result.changed],
        }
        for result in results
    ]
    changes = sum(bool(result.changed) for result in results)
    answer = Answer(
        f"Half or twice of a threshold changes what is said of {changes} of {len(results)} sets.",
        {"sets of which something else is said": Measure(float(changes), "1", "lower")},
    )
    lines = [f"{len(results)} sets, each threshold times {' and '.join(map(str, FACTORS))}", ""]
    idle = []
    for name, value in usual.items():
        rows = [
            f"{name} {value:.4g} -> {change.value:.4g}: {', '.join(result.said)} becomes "
            f"{', '.join(change.said)} ({result.planting.options})"
            for result in results
            for change in result.changed
            if change.threshold == name
        ]
        if not rows:
            idle.append(f"{name} {value:.4g}")
        lines += rows
    lines += ["", f"nothing changes by: {', '.join(idle)}"]
    return Check("thresholds", answer, {"usual": usual, "sets": sets}, "\n".join(lines))


def sheet_check(rows: Sequence[Mapping[str, Any]]) -> Check:
    """Report verdicts on machines that differ from their sheet, and the number of wrong names."""
    lines = [f"{'wrong in the data sheet':<26} {'verdict':<12} causes"]
    for row in rows:
        error = " ".join(f"{name}={gain:+g}" for name, gain in row["wrong"].items())
        causes = ", ".join(" or ".join(group) for group in row["causes"])
        mark = "  WRONG NAME" if row["wrong_name"] else ""
        lines.append(f"{error:<26} {row['verdict']:<12} {causes or row['error']}{mark}")
    wrong = sum(row["wrong_name"] for row in rows)
    lines += ["", f"{wrong} of {len(rows)} sets have a wrong name"]
    answer = Answer(
        f"A wrong data sheet leads to a wrong name in {wrong} of {len(rows)} sets.",
        {"sets with a wrong name": Measure(float(wrong), "1", "lower")},
    )
    return Check("sheet_error", answer, {"sets": list(rows)}, "\n".join(lines))


def left_out_check(rows: Sequence[Mapping[str, Any]]) -> Check:
    """Report laws proposed for causes that were left out, and how often they act in their slot."""
    lines = []
    for row in rows:
        cause = ", ".join(row["left_out"]) or row["rig"]
        mark = {True: "right slot", False: "NOT THE SLOT", None: "no cause"}[row["slot_right"]]
        named = f", {' and '.join(row['named'])}" * bool(row["named"])
        late = f", {' and '.join(row['late'])} late" * bool(row["late"])
        nothing = f"nothing proposed ({row['verdict']}{named}{late})"
        laws = "; ".join(row["laws"]) or row["error"] or nothing
        lines.append(f"{cause:<30} {mark if row['asked'] else '':<16} {laws}")
    summary = left_out.summarise_left_out(rows)
    right = summary["right_slot"]
    sentence = (
        f"The slot of the cause that was left out is proposed in {right['hits']} of {right['of']} "
        "sets that nothing else explains."
    )
    headline = _measures(summary, left_out.SHARES, lower=("clean",))
    lines += ["", *_shares(summary, left_out.SHARES)]
    content = {**summary, "sets": list(rows)}
    return Check("left_out", Answer(sentence, headline), content, "\n".join(lines))


def following_check(rows: Sequence[Mapping[str, Any]]) -> Check:
    """Report groups, verdicts after the proposed recording was made, and all shares."""
    lines = []
    for row in rows:
        text = " or ".join(row["group"]) or row["error"] or row["verdict"]
        if (proposed := row["proposed"]) is not None:
            then = " or ".join(proposed["named"]) or proposed["verdict"]
            drawn = ["parts" if other["parts"] else "does not" for other in row["drawn"]]
            text += f" -> {then} (one that is drawn: {', '.join(drawn)}): {proposed['experiment']}"
        if (sensed := row["sensed"]) is not None:
            then = " or ".join(sensed["named"]) or sensed["verdict"]
            text += f"; with a sensor of {sensed['sensor']}: {then}"
        lines.append(f"{row['planted']:<30} x{row['multiple']:<4g} {text}")
    summary = following.summarise_following(rows)
    proposed, others = summary["proposed"], summary["drawn"]
    sentence = (
        f"The recording that is proposed parts {proposed['hits']} of {proposed['of']} groups, one "
        f"that is drawn {others['hits']} of {others['of']}."
    )
    headline = _measures(summary, following.SHARES, lower=("drawn", "never"))
    lines += ["", *_shares(summary, following.SHARES)]
    content = {**summary, "sets": list(rows)}
    return Check("followed", Answer(sentence, headline), content, "\n".join(lines))


def _measures(
    summary: Mapping[str, Any], texts: Mapping[str, str], lower: Sequence[str]
) -> dict[str, Measure]:
    return {
        texts[name]: Measure(
            entry["share"], "1", "lower" if name in lower else "higher", entry["low"], entry["high"]
        )
        for name, entry in summary.items()
    }


def _shares(summary: Mapping[str, Any], texts: Mapping[str, str]) -> list[str]:
    return [
        f"{entry['hits']} of {entry['of']} {texts[name]} "
        f"({entry['low']:.0%} to {entry['high']:.0%})"
        for name, entry in summary.items()
    ]


def campaign_check(rows: Sequence[EffectChance], sizes: Sequence[float]) -> Check:
    """Report chances that planned recordings show effects, by size.

    Parameters
    ----------
    sizes : multiples of what matters.
    """
    seen = sum(row.least is not None and row.least <= sizes[-1] * row.matters for row in rows)
    sentence = (
        f"Of {len(rows)} effects, these recordings show {seen} with a chance of {SURE:.0%} or more "
        f"at {sizes[-1]:g} times the size that matters."
    )
    headline = {f"effects shown at {sizes[-1]:g} times": Measure(float(seen), "1", "higher")}
    lines = [f"{'effect':<30}{'1 is':>18}" + "".join(f"{f'x {s:g}':>8}" for s in sizes)]
    lines[0] += f"{f'found by {SURE:.0%} from':>24}"
    for chance in rows:
        row = f"{chance.effect:<30}{with_unit(chance.matters, chance.unit):>18}"
        if chance.least is None:
            lines.append(f"{row}  these recordings cannot show it")
            continue
        row += "".join(f"{f'{share:.0%}':>8}" for _, share in chance.chances)
        lines.append(f"{row}{with_unit(chance.least, chance.unit):>24}")
    content = {"sizes": list(sizes), "effects": list(map(asdict, rows))}
    return Check("plan", Answer(sentence, headline), content, "\n".join(lines))


def oracle_check(rows: Sequence[EffectLimit]) -> Check:
    """Report the least sizes that recordings can show, whatever the diagnosis."""
    shown = [row for row in rows if row.sigma is not None]
    alone = sum(row.told is not None for row in shown)
    sentence = (
        f"Of {len(rows)} effects, these recordings can show {len(shown)}; of {alone} they "
        "tell the place or cause."
    )
    headline = {"effects that can be shown": Measure(float(len(shown)), "1", "higher")}
    lines = [
        f"{'effect':<30}{'one sigma':>18}{f'found by {SURE:.0%} from':>24}  "
        "discriminated from the most similar"
    ]
    for row in rows:
        if row.sigma is None or row.found is None:
            lines.append(f"{row.effect:<30}  these recordings cannot show it")
            continue
        sizes = [with_unit(row.sigma, row.unit), with_unit(row.found, row.unit)]
        discriminated = "never" if row.told is None else f"from {with_unit(row.told, row.unit)}"
        lines.append(f"{row.effect:<30}{sizes[0]:>18}{sizes[1]:>24}  {row.like}: {discriminated}")
    return Check(
        "oracle", Answer(sentence, headline), {"effects": list(map(asdict, rows))}, "\n".join(lines)
    )


def draw_chances(rows: Sequence[EffectChance], sizes: Sequence[float], out: Path) -> None:
    """Draw the chances that effects are named, by effect and size, to plan.png and plan.svg."""
    table = np.array(
        [[100.0 * c for _, c in row.chances] or [0.0] * len(sizes) for row in rows]
    ).reshape(len(rows), len(sizes))
    with styled(3.5 + 0.5 * len(sizes), 1.5 + 0.25 * len(rows)) as sheet:
        axes = _heat(sheet, table, [f"{size:g}" for size in sizes], [row.effect for row in rows])
        axes.set_xlabel("size over the least that matters")
        sheet.suptitle("Chance that the planned recordings show it [%]")
    with in_style():
        save_figure(sheet, [out / "plan.png", out / "plan.svg"])


def _heat(
    sheet: "Figure", table: Matrix, columns: Sequence[str], rows: Sequence[str], turned: float = 0.0
) -> "Axes":
    axes = sheet.subplots()
    axes.grid(visible=False)
    draw_heat(axes, table)
    axes.set_xticks(range(len(columns)), columns, rotation=turned)
    axes.set_yticks(range(len(rows)), rows)
    return axes


_STYLE = "2"
_INTERVAL = (
    "Intervals hold the true share in at least 95 % of such runs, however few sets there are "
    "(Clopper and Pearson 1934)."
)


def write_power_page(summary: Mapping[str, Any], out: Path) -> Path:
    """Write the page into the folder; returns its path."""
    provenance = summary["provenance"]
    warnings = []
    if provenance["interrupted"]:
        warnings.append("Interrupted: the same command with --resume goes on from here.")
    if summary["failed"]:
        warnings.append(f"{len(summary['failed'])} diagnoses failed; they count as not right.")
    machine = f"Recordings are made by {provenance.get('machine', 'a simulated rig')}."
    parts = [
        Part(
            "shown",
            "How often it is right",
            [machine, _INTERVAL, _share_dots(summary["answer"])],
        ),
        Part("definitions", "Definitions", [Definitions(_TERMS)]),
    ]
    if summary["effects"]:
        parts.insert(1, Part("effects", "By effect and size", [_effects(summary)], printed=True))
    if summary["confusion"]:
        parts.insert(-1, Part("confusion", "What is taken for what", [_confusion_rows(summary)]))
    title = f"How often the diagnosis is right: {summary['sets']} sets of recordings"
    page = Page(title, parts, "power.json", warnings=warnings)
    return page.write(summary, out / "index.html")


def _share_dots(answer: Mapping[str, Any]) -> Dots:
    rows, shares = [], []
    for name, measure in answer["headline"].items():
        dots: tuple[Dot, ...] = ()
        if measure["value"] is not None:
            dots = (Dot(measure["value"], _STYLE, measure["low"], measure["high"]),)
            shares.append(f"{name} {measure['value']:.0f} %")
        rows.append((name, dots))
    finding = "Shares of sets with their 95 % intervals: " + (", ".join(shares) or "none") + "."
    return Dots(finding, "share of sets [%]", tuple(rows), high=100.0)


def _effects(summary: Mapping[str, Any]) -> Table:
    effects, scale = summary["effects"], summary["scale"]
    sizes = sorted(
        {size for effect in effects.values() for size in effect["right_first"]}, key=float
    )
    columns = [
        "effect",
        term("1 is", scale["unit"]),
        *(Numbers(f"x {size} [%]") for size in sizes),
        Numbers("intervals hold [%]"),
        "remark",
    ]
    rows = [
        (
            name,
            with_unit(effect["size"], effect["unit"]),
            *(_share(effect["right_first"].get(size)) for size in sizes),
            _share(effect["coverage"]),
            "hidden" if effect["hidden"] else "",
        )
        for name, effect in effects.items()
    ]
    if scale["chances"]:
        chances = (scale["chances"][size] for size in sizes)
        cells = (number(100.0 * chance, ".0f", chance) for chance in chances)
        rows.append(("an oracle", Cell(""), *cells, Cell(""), "by chance"))
    caption = (
        "Fraction of sets in which the injected effect, or a group that it is in, is named first, "
        f"by its size over {scale['unit']}; hits and sets in brackets."
    )
    return Table("effect-table", caption, columns, rows)


def _share(share: Mapping[str, Any] | None) -> Cell:
    if share is None or not share["of"]:
        return Cell("n/a")
    percent = 100.0 * share["share"]
    return Cell(f"{percent:.0f} ({share['hits']}/{share['of']})", percent, share["share"])


def _confusion_rows(summary: Mapping[str, Any]) -> Table:
    names = dict.fromkeys(name for row in summary["confusion"].values() for name in row)
    rows = []
    for planted, row in summary["confusion"].items():
        of = sum(row.values())
        counts = (row.get(name, 0) for name in names)
        cells = (number(float(count), ".0f", count / of if of else 0.0) for count in counts)
        rows.append((planted, *cells))
    visible = summary["scale"]["visible"]
    caption = f"Sets by injected effect (rows, from size {visible:g} on) and what was named first."
    columns = ("planted", *(Numbers(name) for name in names))
    return Table("confusion-table", caption, columns, rows)


_TERMS = {
    "Set": "Recordings of one simulated machine, with tolerances of its own, in which one effect, "
    "two, one that the catalogue lacks, or none was injected.",
    "Right": "The injected effect is named first, or is in the group of those that the "
    "data cannot tell from the one named.",
    "False alarm": "A cause is named, or something called unexplained, in a set without any.",
    "Hidden": "No recording of this kind can show it; it counts as neither right nor wrong.",
}

_COLUMNS = 5  # of power curves
_LINE, _MARK = LIGHT["2"], LIGHT["0"]


def write_power(
    summary: Mapping[str, Any],
    effects: Sequence[Effect],
    provenance: Mapping[str, Any],
    out: Path,
) -> None:
    """Write power.json and, as PNG and SVG, what there is of curves, confusion and coverage.

    Parameters
    ----------
    effects : of the library, in whose order they stand.
    """
    content = with_answer(power_answer(summary), {"provenance": provenance, **summary})
    write_json(out / "power.json", content)
    write_power_page(content, out)
    names = [effect.name for effect in effects]
    measured = summary["effects"]
    figures = {"confusion": _confusion(summary, names)} if summary["sets"] else {}
    if measured:
        figures |= {"power": _curves(measured, summary["scale"]), "coverage": _coverage(summary)}
    with in_style(font_size=8):
        for name, figure in figures.items():
            save_figure(figure, [out / f"{name}.png", out / f"{name}.svg"])


def _curves(effects: Mapping[str, Any], scale: Mapping[str, Any]) -> "Figure":
    """Share named right against size, one panel for each effect, beside an oracle's chance."""
    columns = min(_COLUMNS, len(effects))
    rows = -(-len(effects) // columns)
    with styled(0.6 + 2.1 * columns, 1.0 + 1.4 * rows, font_size=8) as sheet:
        panels = sheet.subplots(rows, columns, sharey=True, squeeze=False)
        for axes in panels.flat[len(effects) :]:
            axes.set_visible(False)
        for axes, (name, effect) in zip(panels.flat, effects.items(), strict=False):
            shares = list(effect["right_first"].values())
            places = range(len(shares))
            low, high = ([100.0 * entry[key] for entry in shares] for key in ("low", "high"))
            axes.vlines(places, low, high, color=LIGHT["raw"], linewidth=2.0)
            if scale["chances"]:
                chances = [100.0 * scale["chances"][size] for size in effect["right_first"]]
                axes.plot(places, chances, "--", color=_MARK, linewidth=0.8)
            axes.plot(places, [100.0 * entry["share"] for entry in shares], "o-", color=_LINE)
            hidden = ", hidden" if effect["hidden"] else ""
            axes.set_title(
                f"{name}\n1 = {with_unit(effect['size'], effect['unit'])}{hidden}", fontsize=6.5
            )
            axes.set_xticks(places, list(effect["right_first"]))
            axes.set_ylim(-5.0, 105.0)
        for row in panels:
            row[0].set_ylabel("[%]")
        oracle = "; dashed: an oracle" * bool(scale["chances"])
        sheet.suptitle(f"Named right, with 95 % interval{oracle}. Sizes over {scale['unit']}")
    return sheet


def _confusion(summary: Mapping[str, Any], names: Sequence[str]) -> "Figure":
    confusion: Mapping[str, Mapping[str, int]] = summary["confusion"]
    named = {name for row in confusion.values() for name in row}
    order = ["nothing", *names, "partly explained", "unexplained", "failed"]
    columns = [name for name in order if name in named or name in confusion]
    table = np.array(
        [
            [100.0 * row.get(name, 0) / max(sum(row.values()), 1) for name in columns]
            for row in confusion.values()
        ]
    ).reshape(len(confusion), len(columns))
    with styled(3.0 + 0.3 * len(columns), 2.5 + 0.25 * len(confusion), font_size=8) as sheet:
        labels = [f"{name} ({sum(row.values())})" for name, row in confusion.items()]
        axes = _heat(sheet, table, columns, labels, turned=90.0)
        axes.set_xlabel("named first; indistinguishable effects under their own name")
        axes.set_ylabel("injected (sets)")
        sheet.suptitle(f"Named first [%], from size {summary['scale']['visible']:g} on")
    return sheet


def _coverage(summary: Mapping[str, Any]) -> "Figure":
    rows = {name: effect["coverage"] for name, effect in summary["effects"].items()}
    rows = {name: row for name, row in rows.items() if row["of"]} | {"all": summary["coverage"]}
    with styled(7.5, 1.2 + 0.22 * len(rows), font_size=8) as sheet:
        axes = sheet.subplots()
        heights = range(len(rows))
        low, high = ([100.0 * row[key] for row in rows.values()] for key in ("low", "high"))
        axes.hlines(heights, low, high, color=LIGHT["raw"], linewidth=2.0)
        values = [np.nan if row["share"] is None else 100.0 * row["share"] for row in rows.values()]
        axes.plot(values, heights, "o", color=_LINE)
        axes.axvline(95.0, color=_MARK, linewidth=0.8)
        axes.set_yticks(heights, [f"{name} ({row['of']})" for name, row in rows.items()])
        axes.invert_yaxis()
        axes.set_xlim(0.0, 101.0)
        axes.set_xlabel("95 % intervals that contain the injected value [%]")
    return sheet


def format_power(summary: Mapping[str, Any]) -> str:
    """Table for the terminal."""
    effects, outside, scale = summary["effects"], summary["outside"], summary["scale"]
    sizes = sorted({float(s) for effect in effects.values() for s in effect["right_first"]})
    header = f"{'effect':<30}{'1 is':>18}" + "".join(f"{f'x {s:g}':>8}" for s in sizes)
    lines = [
        f"{summary['sets']} sets of recordings, {len(summary['failed'])} failed",
        f"false alarms on clean sets          {_text(summary['false_alarms'])}",
        f"right cause or its group first      {_text(summary['right_first'])}   from "
        f"{scale['visible']:.2g} times {scale['unit']}",
        f"... where it is above noise         {_text(summary['right_first_above_noise'])}   from "
        f"{CLEAR:g} standard deviations on",
        f"... and no other cause              {_text(summary['right_alone'])}",
        f"right first, where partly explained {_text(summary['partly_right'])}",
        f"both of a pair                      {_text(summary['pairs']['both'])}",
        f"... each of which is found alone    {_text(summary['pairs']['both_seen_alone'])}",
        f'unknown cause is "unexplained"      {_text(summary["unexplained"])}',
        f"95 % intervals that contain the truth  {_text(summary['coverage'])}",
        "",
        header + f"{'coverage':>11}",
        "-" * (len(header) + 11),
    ]
    for name, effect in effects.items():
        row = f"{name:<30}{with_unit(effect['size'], effect['unit']):>18}"
        row += "".join(f"{_count(effect['right_first'].get(f'{size:g}')):>8}" for size in sizes)
        lines.append(row + f"{_count(effect['coverage']):>11}" + "  hidden" * effect["hidden"])
    if scale["chances"]:
        row = "".join(f"{scale['chances'][f'{size:g}']:>8.0%}" for size in sizes)
        lines.append(f"{'an oracle, by chance':<48}{row}")
    for name, unknown in outside.items():
        verdicts = (
            f"x {size}: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.items())
            for size, counts in unknown["verdicts"].items()
        )
        size = with_unit(unknown["size"], unknown["unit"])
        lines.append(f"{name:<30}{size:>18}  {'; '.join(verdicts)}")
    for of, rows in (("with", summary["wrong"]), ("partly explained by", summary["partly_wrong"])):
        lines += ["", f"sets {of} a wrong name: {len(rows)}"]
        lines += [f"  {' and '.join(row['said'])} ({row['rig']})" for row in rows]
    return "\n".join(lines)


def _count(share: Mapping[str, Any] | None) -> str:
    return f"{share['hits']}/{share['of']}" if share and share["of"] else "-"


def _text(share: Mapping[str, Any]) -> str:
    if not share["of"]:
        return f"{'-':>8}"
    low, high = 100.0 * share["low"], 100.0 * share["high"]
    return f"{100.0 * share['share']:6.1f} % ({low:.1f} to {high:.1f} %, {_count(share)})"


def power_answer(summary: Mapping[str, Any]) -> Answer:
    """The answer of `power`."""
    shares = {
        "right cause or its group first": summary["right_first"],
        "right cause first, above noise": summary["right_first_above_noise"],
        "right cause and no other": summary["right_alone"],
        "both of a pair": summary["pairs"]["both"],
        "unknown cause is unexplained": summary["unexplained"],
        "intervals that contain the truth": summary["coverage"],
    }
    headline = {"false alarms on clean sets": share_measure(summary["false_alarms"], "lower")}
    headline |= {name: share_measure(share, "higher") for name, share in shares.items()}
    details = {
        f"{effect} x {size}: named right": share_measure(named, "higher")
        for effect, values in summary["effects"].items()
        for size, named in values["right_first"].items()
    }
    words = []
    if (right := summary["right_first"])["of"]:
        words.append(
            f"the diagnosis names the right cause, or its group, in {share_with_interval(right)}"
        )
    if (false := summary["false_alarms"])["of"]:
        words.append(f"names one where there is none in {share_with_interval(false)}")
    if (hold := summary["coverage"])["of"]:
        words.append(
            f"its 95 % intervals contain the truth in {share_with_interval(hold, 'intervals')}"
        )
    return Answer(f"{capital('; '.join(words) or 'too few sets for a share')}.", headline, details)
