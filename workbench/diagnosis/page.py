"""The page of a diagnosis: what shows it, its causes, what cannot be told apart, the gain.

Numbers come from the summary alone; what is here orders and places them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from workbench.diagnosis.figures import EXTENDED, NOMINAL, estimate_figure, lasting_blocks
from workbench.diagnosis.outcome import NOT_OF_A_MODEL
from workbench.observers import label
from workbench.observers.simulation import CaseResult
from workbench.pages.answer import recordings, unit_suffix
from workbench.pages.figures import PICTURES, CaseFigure
from workbench.pages.parts import (
    Article,
    Block,
    Cell,
    Definitions,
    Dot,
    Dots,
    Matrix,
    Numbers,
    Page,
    Part,
    Provenance,
    Recording,
    Source,
    Table,
    Text,
    anchor,
    joined,
    number,
    term,
    zoomable,
)
from workbench.pages.views import called, capital, duration, named, per_shown, shown_unit
from workbench.system.system import System
from workbench.system.units import si_factor

_FLAGGED = 2.5  # standard deviations of a tolerance that deserve a look
_SIMILAR = 0.7  # cosine from which on a pair is worth a word
_PAIRS = 8  # that are put in words
_TOGETHER = 0.3  # correlation of errors that is worth a word: a tenth of the variance
_CLEAR = 0.05  # share of variance that is a dependence worth a word
_READ = 4  # of them that are put in words


def write_diagnosis_page(
    system: System,
    summary: Mapping[str, Any],
    figures: Sequence[CaseFigure],
    best: CaseResult | None,
    folder: Path,
    related: Mapping[str, str] | None = None,
) -> Path:
    """Write the page into the folder, with links to data and pictures there; returns its path.

    Parameters
    ----------
    summary : as written to summary.json.
    figures : one for each recording, the one that shows most first.
    best : estimate of that one, see `best_estimate`.
    related : what a file says that belongs to this diagnosis, by its path from the folder.
    """
    more = [] if best is None else [estimate_figure(best)]
    suffixes = ("csv", *PICTURES) if (folder / "confusability.svg").is_file() else ("csv",)
    first, *others = zoomable([figures[0], *more, *figures[1:]], summary, folder, files=suffixes)
    estimate = replace(others.pop(0), files=(), headed=False) if more else None
    explained = bool(summary["causes"])
    title = "recording that shows it best" if explained else "recording with the largest errors"
    parts = [
        Part("shown", f"The {title}", [*_shown(system, summary, figures, others, first)]),
        Part("dependences", "What the errors go with", _dependences(summary, suffixes)),
        Part("causes", "Causes, strongest first", [*_causes(summary)], printed=True),
        Part("confusability", "Indistinguishable effects", _confusable(summary, suffixes)),
        Part("gain", "Gain in cross-validation", [*_gain(system, summary, suffixes)]),
    ]
    if estimate is not None:
        title = f"The best estimate of {summary['smoothed']['recording']}"
        parts.append(Part("estimate", title, _estimate(system, summary["smoothed"], estimate)))
    if summary["model"]["fmu"] is not None:
        parts.append(Part("model", "The extended model", _model(summary["model"], folder)))
    parts.append(
        Part("baseline", "Nuisance parameters, tolerances, excluded samples", _baseline(summary))
    )
    if others:
        parts.append(Part("recordings", "The other recordings, clearest first", others))
    parts.append(
        Part("definitions", "Definitions", [Definitions(_terms(system, summary, figures))])
    )
    page = Page(
        title=f"What the model lacks: diagnosis of {recordings(len(summary['cases']))}",
        parts=parts,
        headline=Markup("<strong>{}.</strong> {}{}").format(
            summary["verdict"].capitalize(), summary["sentence"], _unseen(summary)
        ),
        warnings=_warnings(system, summary),
        related=related or {},
        run=[Provenance(), Definitions({"Recordings": ", ".join(summary["cases"])}, grid=True)],
    )
    return page.write(summary, folder / "index.html")


def _unseen(summary: Mapping[str, Any]) -> Markup | str:
    """What the headline says of effects that these recordings cannot show."""
    if not (names := list(summary["not_visible"])):
        return ""
    text = Markup(
        ' Not visible by these recordings: {}; <a href="#causes">why, and what would show them</a>.'
    )
    return text.format(", ".join(names))


def _extended(summary: Mapping[str, Any]) -> list[str]:
    """Effects of the extended model: the causes, or those that explain a part."""
    return [cause["effect"] for cause in summary["causes"]] or list(summary["partial"])


def _warnings(system: System, summary: Mapping[str, Any]) -> list[str]:
    warnings = []
    if summary["interrupted"]:
        warnings.append(
            "The search was interrupted: the causes below were found before that, and there may be "
            "more."
        )
    warnings += summary["warnings"]
    warnings += [doubt for doubts in summary["doubts"].values() for doubt in doubts]
    judged = [
        signal.name for signal in system.reference_signals if signal.name not in summary["channels"]
    ]
    if judged:
        missing = capital(" and ".join(named(system, name) for name in judged))
        warnings.append(
            f"{missing} was not measured: its errors are not compared, and no balance is formed "
            "that needs it."
        )
    return warnings


def _balanced(figures: Sequence[CaseFigure]) -> bool:
    return figures[0].panels[-1].curves[0].style == "measured"


def _driven(system: System) -> str:
    """What a simulation runs from; a machine that is only released has no inputs."""
    inputs = " and ".join(signal.label for signal in system.inputs)
    return f"the measured {inputs}" if inputs else "its start"


def _shown(
    system: System,
    summary: Mapping[str, Any],
    figures: Sequence[CaseFigure],
    others: Sequence[Recording],
    first: Recording,
) -> list[Block]:
    added = " and ".join(_extended(summary))
    compared = _compared(summary)
    ran = f", {compared}; errors of free runs are in a table below" if compared else ""
    text = (
        f"The model ran from {_driven(system)}{ran}. Where a curve stays outside the "
        "grey band, the simulation is wrong by more than noise explains"
    )
    if summary["causes"]:
        text += f"; the effect is what the model with {added} takes away"
    elif added:
        text += f"; what the model with {added} leaves is not explained"
    text += "."
    if _balanced(figures):
        text += (
            " The lowest panels show what the measurements have and the equations of the nominal "
            "model have not; a short peak where something sets in is made by their smoothing."
        )
    if not others:
        return [text, first]
    names = (other.drawing["figure"].name for other in others)
    link = Markup('<a href="#{}">{}</a>').format
    links = joined(", ", [link(quote(anchor(name)), name) for name in names])
    return [text, first, Markup("The other recordings: {}.").format(links)]


def _files(name: str, suffixes: Sequence[str], text: str = "Data of the figure") -> Markup:
    """Links to the data and pictures of a figure."""
    links = (f'<a href="{name}.{suffix}">{suffix.upper()}</a>' for suffix in suffixes)
    return Markup("{}: ").format(text) + Markup(", ").join(map(Markup, links))


def _dependences(summary: Mapping[str, Any], suffixes: Sequence[str]) -> list[Block]:
    """Shares by influence and channel, the strongest influence first, and their reading."""
    table, added = summary["dependences"], " and ".join(_extended(summary))
    shares: dict[str, dict[str, Mapping[str, Any]]] = {}
    for share in sorted(table, key=lambda share: -max(share["before"], share["after"])):
        shares.setdefault(share["influence"], {})[share["channel"]] = share

    def clear(key: str) -> str:
        strong = sorted((s for s in table if s[key] > _CLEAR), key=lambda share: -share[key])
        return "; ".join(
            f"{s['channel']} with {s['influence']}, {100 * s[key]:.0f} %" for s in strong[:_READ]
        )

    before, after = clear("before"), clear("after")
    text = (
        f"Clearest in the nominal model: {before} of the variance."
        if before
        else "No error of the nominal model follows any influence clearly."
    )
    if added:
        left = f"What remains with {added}: {after}." if after else f"With {added}, none is left."
        text += f" {left}"
    models = ["before", "after"] if added else ["before"]
    second = "extended" if summary["causes"] else "with a part"
    titles = {"before": "nominal", "after": second}
    channels = list(summary["lasting_errors"])
    rows = []
    for influence, by_channel in shares.items():
        values = [by_channel[channel][model] for channel in channels for model in models]
        rows.append((influence, *(Cell(f"{100 * v:.0f} %", v, v) for v in values)))
    caption = (
        "Share of the variance of an error that follows an influence, beyond chance, over all "
        "recordings. Influences overlap: in a recording, many things run together."
    )
    columns = [Numbers(f"{channel}, {titles[m]}") for channel in channels for m in models]
    return [
        text,
        Table("dependence-table", caption, ["influence", *columns], rows),
        _files("dependences", suffixes),
    ]


def _causes(summary: Mapping[str, Any]) -> list[Block]:
    verdict, partial = summary["verdict"], " and ".join(summary["partial"])
    certainty = summary["certainty"]
    blocks: list[Block] = []
    if verdict == "nothing":
        blocks.append(
            "None. Every effect of the catalogue that these recordings could show was tried, and "
            "none is large and significant enough; how near each came is in the table."
        )
    elif summary["late"]:
        blocks.append(
            Markup(
                "None that is sure: clocks of signals explain clearly more{}, and the system file "
                "has no such logger. Say in <code>[loggers]</code> which signals share a logger, "
                "and diagnose again."
            ).format(f" than {partial}" if partial else "")
        )
    elif verdict == "unexplained":
        part = f"; {partial} would explain a part, which is no proof" if partial else ""
        blocks.append(
            Markup(
                "None that is sure. Errors remain that are far above noise, and no effect of the "
                'catalogue takes them away{}. What they go with is <a href="#dependences">above'
                "</a>."
            ).format(part)
        )
    elif verdict == "partly explained":
        blocks.append(
            Markup(
                "These causes are a part of what is missing. No effect of the catalogue explains "
                'the rest; what that goes with is <a href="#dependences">above</a>.'
            )
        )
    if summary["nearest"]:
        rows = [
            (" and ".join(n["effects"]), number(n["removed"], ".0%"), "; ".join(n["reasons"]))
            for n in summary["nearest"]
        ]
        caption = "Candidates that come nearest, and why they are not accepted."
        columns = ("effects", Numbers("removed in cross-validation"), "why not")
        blocks.append(Table("nearest-table", caption, columns, rows, sortable=False))
    if summary["next_steps"]:
        blocks.append(f"What to do: {'; '.join(summary['next_steps'])}.")
    for place, cause in enumerate(summary["causes"], 1):
        title = f"{place}. {cause['effect']}: {cause['text']}"
        blocks.append(
            Article(
                f"cause-{place}",
                title,
                _cause(cause, certainty, noise_alone=summary["noise_alone"]),
            )
        )
    if certainty:
        blocks.append(_starts(certainty["starts"]))
    blocks += [_step(place, step) for place, step in enumerate(summary["steps"], 1)]
    blocks += [_candidates(summary), Markup('Data: <a href="candidates.csv">CSV</a>')]
    hidden = Markup("Not visible in these recordings: <strong>{}</strong>, {}.").format
    return [*blocks, *(hidden(name, reason) for name, reason in summary["not_visible"].items())]


def _cause(
    cause: Mapping[str, Any], certainty: Mapping[str, Any] | None, *, noise_alone: bool
) -> list[Block]:
    """One cause: its parameters, what makes up for them, and what cannot be told from it."""
    effect = cause["effect"]
    columns = [
        "parameter",
        Numbers("value"),
        Numbers("95 %, from"),
        Numbers("to"),
        "unit",
        "that is",
    ]
    noise: str = ""
    if certainty:
        columns += [Numbers("by noise alone, from"), Numbers("to")]
        noise = Markup(", and beside them {}; n/a where its bounds come first").format(
            term(
                "what noise alone allows",
                "where chi-squared has risen by 3.84 while the parameter is held and all else is "
                "fitted anew",
            )
        )
    rows = []
    for name, size in cause["parameters"].items():
        row = [
            name,
            *(number(size[key], ".4g") for key in ("value", "low", "high")),
            *(size["unit"], size["text"]),
        ]
        if certainty:
            ends = certainty["likelihood"][f"{effect} {name}"]
            row += [number(ends["low"], ".4g"), number(ends["high"], ".4g")]
        rows.append(row)
    held = (
        "intervals that hold the true value in 95 of 100 diagnoses"
        if noise_alone
        else "intervals that are widened because what remains is no noise: the law may be wrong in "
        "form"
    )
    caption = Markup("Parameters of {}, with {}{}.").format(effect, held, noise)
    explains = Markup(
        "Explains <strong>{:.1f} %</strong> of what can be explained, in cross-validation."
    ).format(100 * cause["explained"])
    parameters = f"parameters-{anchor(effect)}"
    blocks: list[Block] = [explains, Table(parameters, caption, columns, rows, sortable=False)]
    if certainty:
        blocks += [_traded(certainty, effect, name) for name in cause["parameters"]]
    if cause["phases"] is not None:
        phases = ", ".join(f"{phase:.2f}" for phase in cause["phases"])
        blocks.append(
            "Turns with a shaft; its phase in each recording [rad], which belongs to that "
            f"recording alone: {phases}."
        )
    if twins := ", ".join(cause["confusable_with"]):
        text = Markup("These data cannot tell it from <strong>{}</strong>. What would: {}.")
        blocks.append(Text(text.format(twins, cause["separation"]), warning=True))
    else:
        blocks.append(
            "No other effect of the catalogue explains these data as well. To confirm it by "
            f"experiment: {cause['separation']}."
        )
    return blocks


def _traded(certainty: Mapping[str, Any], effect: str, name: str) -> str:
    """Unknowns whose errors go with that of a size, the closest first."""
    size = f"{effect} {name}"
    rows = dict(zip(certainty["unknowns"], certainty["correlations"], strict=True))
    pairs = [pair for pair in zip(rows, rows[size], strict=True) if pair[0] != size]
    pairs.sort(key=lambda pair: -abs(pair[1]))
    others = [pair for pair in pairs if abs(pair[1]) >= _TOGETHER][:_READ]
    if not others:
        return (
            f"The error of {name} goes with that of no other size, level or tolerance "
            f"(correlations below {_TOGETHER})."
        )
    correlation = term(
        "correlation",
        "of the errors that noise makes, -1 to 1; by recording is what differs between recordings "
        "within its tolerance, in the mean",
    )
    correlations = [
        Markup("{} ({}{:+.2f})").format(other, "" if k else correlation + " ", value)
        for k, (other, value) in enumerate(others)
    ]
    return Markup(
        "Others compensate for an error of {}, which is correlated with that of {}."
    ).format(name, joined(", ", correlations))


def _starts(starts: Mapping[str, Any]) -> Text:
    text = (
        f"{starts['sentence']} They began with levels as usual, and with sizes from the negative "
        "of what was found to three times that."
    )
    if starts["same"] < len(starts["behind"]):
        ends = ("no end" if c is None else f"{round(c, 1) + 0:.1f}" for c in starts["behind"])
        text += f" Chi-squared beyond the best: {', '.join(ends)}."
    return Text(text, warning=bool(starts["lower"]))


def _step(place: int, step: Mapping[str, Any]) -> Markup:
    misfit = term("chi-squared", "sum of squared errors in units of their standard deviation")
    rival_text = Markup("{} ({} {:.0f})").format
    rivals = [rival_text(rival["effect"], misfit, rival["misfit"]) for rival in step["rivals"]]
    return Markup("Step {} of the search fitted {}; without, it was {:.0f}.").format(
        place, joined(", ", rivals), step["before"]
    )


def _candidates(summary: Mapping[str, Any]) -> Table:
    """The best variant of each effect, best first, and what became of it."""
    twins = {twin for cause in summary["causes"] for twin in cause["confusable_with"]}
    causes = [cause["effect"] for cause in summary["causes"]]
    outcomes = {
        **dict.fromkeys(twins, "as good as the cause"),
        **dict.fromkeys(summary["partial"], "explains a part"),
        **dict.fromkeys(causes, "cause"),
    }
    best: dict[str, Mapping[str, Any]] = {}
    for candidate in summary["candidates"]:
        best.setdefault(candidate["effect"], candidate)
    rows = []
    for effect, candidate in best.items():
        size, sigma = candidate["size"], candidate["sigma"]
        shape = (
            f"{name} = {value:.3g}{unit_suffix(candidate['shape_units'][name])}"
            for name, value in candidate["shape"].items()
        )
        row = (
            effect,
            number(size, ".3g"),
            number(sigma, ".2g"),
            candidate["unit"],
            number(abs(size) / sigma if sigma else None, ".1f"),
            *(
                Cell(f"{round(candidate[key], 1) + 0:.1f}", candidate[key])
                for key in ("gain", "held_out")
            ),
            ", ".join(shape),
            outcomes.get(effect, ""),
        )
        rows.append(row)
    columns = (
        "effect",
        Numbers("size"),
        Numbers("standard deviation"),
        "unit",
        Numbers("size over deviation"),
        Numbers(
            "fall, in sample",
            "by how much chi-squared falls on recordings that the effect was fitted to",
        ),
        Numbers(
            "fall, cross-validated",
            "by how much chi-squared falls on each recording by a fit to the others",
            sorted="descending",
        ),
        "shape",
        "outcome",
    )
    caption = (
        "All candidates about the nominal model, each alone and in its best variant. Errors are "
        "weighed by all that the nominal model leaves; chi-squared falls on recordings that the "
        "effect was fitted to, and in cross-validation."
    )
    return Table("candidate-table", caption, columns, rows, marked=causes)


def _confusable(summary: Mapping[str, Any], suffixes: Sequence[str]) -> list[Block]:
    names, cosines = summary["confusability"]["effects"], summary["confusability"]["cosines"]
    if not names:
        return ["No effect of the catalogue was compared."]
    causes = [cause["effect"] for cause in summary["causes"]]
    pairs = [
        (names[i], names[j], 100 * cosines[i][j])
        for i in range(len(names))
        for j in range(i)
        if cosines[i][j] >= _SIMILAR
    ]
    pairs = sorted(pairs, key=lambda pair: -pair[2])[:_PAIRS]
    alike = "; ".join(f"{first} and {other} ({cosine:.0f})" for first, other, cosine in pairs)
    read = " ".join(f"{first} and {other}: {cosine:.0f}." for first, other, cosine in pairs)
    caption = (
        "Cosine of the angle between what two effects leave in the errors, levels and tolerances "
        "apart, in percent; 100 is indistinguishable, numbers are given from 70 on"
        f"{', the effect that was found is framed' if causes else ''}. Data of the figure"
    )
    text = "No two effects of the catalogue leave similar traces in these recordings and signals."
    if pairs:
        text = (
            f"In these recordings and signals, the most alike are {alike}. Effects at nearly 100 "
            "are named together."
        )
    return [
        text,
        Matrix(
            finding=f"Similarity of the signatures of {len(names)} effects, 0 to 100. "
            f"{read or 'None are alike.'}",
            names=names,
            shares=cosines,
            least=_SIMILAR,
            marked=causes,
            caption=_files("confusability", suffixes, caption),
        ),
    ]


def _gain(system: System, summary: Mapping[str, Any], suffixes: Sequence[str]) -> list[Block]:
    blocks: list[Block] = []
    if (gain := summary["gain"]) is None:
        blocks.append("Nothing was extended, so that there is no gain to measure.")
    else:
        text = Markup(
            "Cross-validation: each recording was predicted from a fit to the others. Its error is "
            "<strong>{:.2f}</strong> without, and <strong>{:.2f}</strong> with what is named "
            "(95 %: {:.2f} to {:.2f}). Measured is the {}."
        )
        ends = (gain[key] for key in ("before", "after", "low", "high"))
        blocks += [text.format(*ends, gain["measure"]), _dots(gain, suffixes)]
    blocks.append(_errors(system, summary))
    if observers := summary.get("observers"):
        blocks.append(_observers(system, summary["cases"], observers))
    return blocks


def _dots(gain: Mapping[str, Any], suffixes: Sequence[str]) -> Dots:
    """Errors of both models, the worst recording first, then all."""
    ranked = sorted(gain["recordings"].items(), key=lambda item: -item[1]["before"])
    values = [1.0, *(gain[key] for key in ("low", "high", "before", "after"))]
    values += [error[key] for _, error in ranked for key in ("before", "after")]
    errors = (f"{name} {e['before']:.1f} to {e['after']:.1f}, " for name, e in ranked)
    rows = [
        (name, (Dot(e["before"], NOMINAL), Dot(e["after"], EXTENDED, diamond=True)))
        for name, e in ranked
    ]
    total = "all recordings"
    after = Dot(gain["after"], EXTENDED, gain["low"], gain["high"], diamond=True)
    return Dots(
        finding=f"Error in units of the noise, nominal to extended: {''.join(errors)}{total} "
        f"{gain['before']:.1f} to {gain['after']:.1f}.",
        axis="error in units of the noise, logarithmic",
        rows=[*rows, (total, (Dot(gain["before"], NOMINAL), after))],
        mark=(1.0, "noise alone"),
        low=min(values) / 1.15,
        high=max(values) * 1.15,
        logarithmic=True,
        paired=True,
        total=total,
        caption=_files("gain", suffixes),
        legend=(
            (NOMINAL, "nominal model (circle)"),
            (EXTENDED, "extended model (diamond); the line is the 95 % interval"),
        ),
    )


def _errors(system: System, summary: Mapping[str, Any]) -> Table:
    """Errors of samples, in the units of figures; of both models if there are two."""
    shown = {channel.name: channel.shown for channel in system.comparison.channels}
    models = ("nominal", "extended") if _extended(summary) else ("nominal",)
    rows = []
    for error in summary["errors"]:
        unit = shown[error["channel"]]
        factor = si_factor(unit, error["unit"], error["channel"])
        sizes = (error[key][i] for i in range(len(models)) for key in ("rms", "mean_absolute"))
        fitted = "held out" if error["held_out"] else "yes"
        channel = f"{error['channel']} [{unit}]"
        cells = [number(size / factor, ".3g") for size in sizes]
        free = error["free_run"][: len(models)]
        cells += [Cell("n/a") if e is None else number(e / factor, ".3g") for e in free]
        rows.append((error["recording"], fitted, channel, *cells))
    compared = _compared(summary)
    titles = [f"{size}, {m}" for m in models for size in ("root mean square", "mean absolute")]
    titles += [f"free run: root mean square, {m}" for m in models]
    caption = Markup(
        "Errors of single samples in the units of the sensors: first of the simulation that is "
        "compared, {}, then of a free run, which no measured output corrects. Of recordings given "
        "by --held-out, only states at the start and tolerances were fitted. Data: "
        '<a href="errors.csv">errors.csv</a>'
    ).format(compared or "itself a free run")
    columns = ("recording", "fitted", "channel", *map(Numbers, titles))
    return Table("error-table", caption, columns, rows)


def _compared(summary: Mapping[str, Any]) -> str:
    """What corrects the simulations that are compared; empty for free runs."""
    signals = dict.fromkeys(e["corrected"] for e in summary["errors"] if e["corrected"])
    return f"corrected by {' and by '.join(signals)}" if signals else ""


def _observers(system: System, cases: Sequence[str], observers: Mapping[str, Any]) -> Table:
    objective = system.objective
    error = (
        f"error of the {called(system, objective.signal)}, rms over mean {objective.when}".rstrip()
    )

    def share(value: float | None) -> Cell:
        return Cell("n/a") if value is None else Cell(f"{100 * value:.2f}", value)

    rows = [
        (
            case,
            *(share(e[case][key]) for e in observers.values() for key in ("before", "after")),
        )
        for case in cases
    ]
    columns = [
        Numbers(f"{label(name, system)}, {model}")
        for name in observers
        for model in ("nominal", "extended")
    ]
    caption = f"Observers built on the nominal and on the extended model: {error} [%]."
    return Table("observer-table", caption, ("recording", *columns), rows)


def _estimate(system: System, smoothed: Mapping[str, Any], recording: Recording) -> list[Block]:
    """Rows on the best estimates, by quantity, in the units of figures; a cell for each model."""
    names = [name.replace("_", " ") for name in smoothed["models"]]
    models = list(smoothed["models"].values())
    rows = []
    for name in dict.fromkeys(name for model in models for name in model):
        unit = shown_unit(system, name)
        factor, cells = per_shown(system, name, unit), []
        for estimate in (model.get(name) for model in models):
            if estimate is None:
                cells += [Cell("n/a"), Cell("n/a")]
                continue
            inside = estimate["inside"]
            share = Cell("n/a") if inside is None else Cell(f"{100 * inside:.1f}", inside)
            cells += [_with_band(estimate, factor), share]
        rows.append((f"{capital(named(system, name))} [{unit}]", *cells))
    text = (
        f"What the smoother makes of {smoothed['recording']} with the "
        f"{' and with the '.join(names)}, from inputs and outputs alone, with bands that hold 95 % "
        "if the model is right. Validation sensors are drawn beside; one that is itself the "
        "cause stays outside."
    )
    caption = Markup(
        "Means of estimates, and of the ends of their bands, where they are scored and valid; and "
        "the share of a sensor's means over {} that lie in the band with the sensor's "
        'own noise. Data: <a href="smoothed.csv">smoothed.csv</a>'
    ).format(duration(system.comparison.block))
    columns = [column for name in names for column in (Numbers(name), Numbers("sensor inside [%]"))]
    table = Table("estimate-table", caption, ("quantity", *columns), rows, sortable=False)
    return [text, recording, table]


def _with_band(estimate: Mapping[str, Any], factor: float) -> Cell:
    """A mean and half of its band in another unit, in digits that tell the band."""
    value, half = estimate["value"] / factor, 0.5 * (estimate["high"] - estimate["low"]) / factor
    digits = max(0, 1 - int(np.floor(np.log10(half)))) if half > 0.0 else 4
    return Cell(f"{value:.{digits}f} ± {half:.{digits}f}", value)


def _model(model: Mapping[str, Any], folder: Path) -> list[Block]:
    links = []
    for key, kind in (("modelica", "Modelica source"), ("fmu", "FMU")):
        if model[key] is not None:  # what is written into the folder is linked from there
            path = Path(model[key]).relative_to(folder).as_posix()
            links.append(Markup('{} <a href="{}">{}</a>').format(kind, quote(path), path))
    part = "It explains a part of what is missing. " * model["partial"]
    text = Markup("{}{}, beside this page. {} predicts as the fit does: the largest difference on ")
    text = text.format(
        part, Markup(" and ").join(links), "It" if len(links) < 2 else "Compiled, it"
    )
    text += Markup("these recordings is {:.1e} standard deviations of the noise.").format(
        model["difference_from_fit"]
    )
    blocks: list[Block] = [text]
    if model["without"]:
        blocks.append(f"Without {', '.join(model['without'])}: {NOT_OF_A_MODEL}.")
    if model["modelica"] is not None:
        blocks.append(Source(Path(model["modelica"]).read_text(), "Modelica source"))
    again = f"workbench diagnose NEW_RECORDINGS --model {model['fmu']} --out results/next"
    return [
        *blocks,
        "Next, to see on new recordings whether anything is still missing:",
        Source(again),
    ]


def _baseline(summary: Mapping[str, Any]) -> list[Block]:
    def deviation(value: float) -> Cell:
        far = abs(value) > _FLAGGED
        return Cell(f"{'⚠ ' * far}{value:+.2f}", value, warning=far)

    def table(name: str, caption: str, by_recording: Mapping[str, Any], cell: Any) -> Table:
        columns = map(Numbers, next(iter(by_recording.values())))
        rows = [(case, *map(cell, row.values())) for case, row in by_recording.items()]
        return Table(name, caption, ("recording", *columns), rows)

    levels = {
        name: f"{level['value']:.4g}{unit_suffix(level['unit'])}"
        for name, level in summary["levels"].items()
    }
    return [
        "Nuisance parameters differ from day to day without a fault. They are fitted for every "
        "model alike and need "
        "no cause:",
        Definitions(levels, grid=True),
        table(
            "deviation-table",
            "Deviation of each recording from the common value, in standard deviations of the "
            f"machine's tolerance; beyond {_FLAGGED} it is flagged, and may hide something.",
            summary["deviations"],
            deviation,
        ),
        table(
            "aside-table",
            "Excluded samples, which are never fitted, by reason; a sample may have several.",
            summary["set_aside"],
            lambda count: number(count, ""),
        ),
    ]


def _terms(
    system: System, summary: Mapping[str, Any], figures: Sequence[CaseFigure]
) -> dict[str, str]:
    compare = system.comparison
    block, leading = duration(compare.block), compare.leading
    led = "" if leading is None else " and ".join(called(system, n) for n in leading.together)
    along = (
        f"; only the common motion of {led} is led along the measured one, slowly enough that "
        "errors stay visible"
    )
    terms = {
        "Prediction error": f"Measured minus predicted, in means over {block}. The model is "
        f"simulated from {_driven(system)}{along if led else ''}. Shown are running "
        f"means over {duration(lasting_blocks(system) * compare.block)}, or over {block} where a "
        "cause turns with a shaft or errors swing; the band is two standard deviations of what "
        "noise alone leaves in them.",
    }
    if _balanced(figures):
        terms["Residuals"] = (
            "What is missing in an equation of the nominal model, from smoothed measurements. They "
            "are for the eye; the search uses prediction errors."
        )
    terms |= {
        "Cross-validation": "Each recording is scored with parameters fitted to the other "
        "recordings only. An effect that merely bends to noise gains nothing "
        "there.",
        "Held-out recordings": "Those named by --held-out. Nothing common was ever fitted to them, "
        "and no effect chosen by them.",
        "Chi-squared": "Sum of squared errors in units of their standard deviation. An effect is "
        "considered if its size and the fall in cross-validation are both significant, and if "
        "it is larger than what tolerances of the machine explain.",
    }
    if summary["certainty"]:
        terms["By noise alone"] = (
            "The 95 % interval also holds that laws differ in form, and that other effects may be "
            "present at sizes that do not matter. With neither, a parameter lies where "
            "chi-squared, with it held and all else fitted anew, is at most 3.84 above the least: "
            "ends at unequal distances say that the law bends."
        )
    return terms | {
        "Explained": "Fraction of the mean square of systematic errors, less that of noise, which "
        "disappears in cross-validation when the cause is added to the others.",
    }
