"""Machine-readable results, and the table on the terminal."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup
from scipy.special import stdtrit

from workbench.arrays import Vector
from workbench.observers import label
from workbench.observers.simulation import CaseResult, followed
from workbench.observers.trust import Contradiction, contradiction_lines
from workbench.pages.answer import Answer, Measure, percentage, recordings, with_answer
from workbench.pages.columns import pack_estimates
from workbench.pages.figures import CaseFigure
from workbench.pages.parts import (
    Block,
    Cell,
    Definitions,
    Numbers,
    Page,
    Part,
    Table,
    Text,
    anchor,
    number,
    term,
    zoomable,
)
from workbench.pages.views import (
    below,
    called,
    capital,
    errs_least,
    inverse,
    numberless,
    percent,
    rounded,
    window,
)
from workbench.recordings.csv import header_text
from workbench.runtime.files import replacing
from workbench.system.system import System


def write_estimates(result: CaseResult, path: Path) -> None:
    """Write the data of a case, CSV or NPZ by suffix; see `CaseResult.to_columns`."""
    if path.suffix == ".npz":
        pack_estimates(result.to_columns(), path)
    else:
        write_numbers(result.to_columns(), path, 7)


def write_numbers(table: Mapping[str, Vector], path: Path, digits: int) -> None:
    """Write columns (n,) as pandas does, in a quarter of the time: a row at once, not a number."""
    row = ",".join([f"%.{digits}g"] * len(table)) + "\n"
    columns = [np.asarray(column, float) for column in table.values()]
    with replacing(path) as stream:
        stream.write(header_text(table).encode())
        for first in range(0, columns[0].size, _ROWS):
            part = np.column_stack([column[first : first + _ROWS] for column in columns]).tolist()
            stream.write(
                "".join(row % tuple(values) for values in part).replace("nan", "").encode()
            )


def summarise_runs(
    system: System, results: Sequence[CaseResult], provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """Scores by case and estimator, weights of z, and what made them: the one source of numbers."""
    summary = {
        "provenance": provenance,
        "weights": dict(system.objective.weights),
        "cases": {result.case.name: result.to_dict() for result in results},
    }
    return with_answer(simulation_answer(system, summary), summary)


def format_table(system: System, results: Sequence[CaseResult]) -> str:
    """Table for the terminal: error of the judged signal, rms over mean, by case and estimator."""
    names = list(results[0].runs)
    width = max(len("case"), *(len(r.case.name) for r in results))
    header = f"{'case':<{width}}" + "".join(f"{name:>22}" for name in names)
    objective = system.objective
    when = f" {objective.when}" if objective.when else ""
    limits = ", ".join(filter(None, (below(system), window(system))))
    lines = [f"Error of {objective.signal}, rms / mean{when} ({limits})", *followed(system)]
    lines += warning_lines({result.case.name: result.warnings() for result in results})
    lines += contradiction_lines({result.case.name: result.contradictions for result in results})
    lines += warning_lines({result.case.name: result.scale_notes() for result in results})
    lines += [header, "-" * len(header)]
    for result in results:
        cells = [_percent(result.scores[name].nrmse) for name in names]
        lines.append(f"{result.case.name:<{width}}" + "".join(f"{cell:>22}" for cell in cells))
    lines.append("-" * len(header))
    worst = [
        max((s for s in (r.scores[name].nrmse for r in results) if s is not None), default=None)
        for name in names
    ]
    lines.append(f"{'worst':<{width}}" + "".join(f"{_percent(value):>22}" for value in worst))
    reasons = {
        f"{result.case.name}, {name}: {score.reason}"
        for result in results
        for name, score in result.scores.items()
        if score.reason
    }
    return "\n".join(lines + sorted(reasons))


def _percent(share: float | None) -> str:
    return "n/a" if share is None else percent(share)


@dataclass(frozen=True)
class Standing:
    """How one estimator did on all cases; None where no case could be judged."""

    name: str  # key in the summary
    worst: float | None  # error of the judged signal, rms over mean [1]
    case: str  # where it was worst
    # error in a recording like these, with its 95 % interval if there are several [1]
    usual: tuple[float | None, float | None, float | None]
    z: float | None  # largest objective z_k [1]
    judged: int  # number of cases with an error
    seconds: float  # wall time of all its runs


def standings(summary: Mapping[str, Any], reference: str) -> list[Standing]:
    """Estimators, the one with the least worst case first; those never judged last."""
    cases: Mapping[str, Any] = summary["cases"]
    names = list(next(iter(cases.values()))["estimators"])
    table = []
    for name in names:
        scores = {case: values["estimators"][name] for case, values in cases.items()}
        shares = {case: s[f"{reference}_nrmse"] for case, s in scores.items()}
        errors = {case: share for case, share in shares.items() if share is not None}
        worst = max(errors, key=lambda case: errors[case], default="")
        table.append(
            Standing(
                name=name,
                worst=errors.get(worst),
                case=worst,
                usual=usual_error(list(errors.values())),
                z=max((s["z"] for s in scores.values() if s["z"] is not None), default=None),
                judged=len(errors),
                seconds=sum(s["seconds"] for s in scores.values()),
            )
        )
    # One that fails on a hard case must not win by having been judged on the easy ones.
    return sorted(table, key=lambda s: (-s.judged, s.worst if s.worst is not None else np.inf))


def usual_error(errors: Sequence[float]) -> tuple[float | None, float | None, float | None]:
    """Geometric mean of errors, and its 95 % interval: from recording to recording they scatter.

    They do so by factors, and few recordings have to do: Student's t of the logarithms.

    >>> [round(one, 3) for one in usual_error([0.1, 0.2, 0.4])]
    [0.2, 0.036, 1.119]
    >>> usual_error([0.25])
    (0.25, None, None)
    """
    if not errors or min(errors) <= 0.0:
        return None, None, None
    logarithms = np.log(errors)
    middle = float(np.exp(logarithms.mean()))
    count = len(errors)
    if count < 2:
        return middle, None, None
    reach = stdtrit(count - 1, 0.975) * logarithms.std(ddof=1) / np.sqrt(count)
    return middle, float(middle * np.exp(-reach)), float(middle * np.exp(reach))


def simulation_answer(system: System, summary: Mapping[str, Any]) -> Answer:
    """The answer of `simulate`."""
    reference = system.objective.signal
    ranking = standings(summary, reference)
    headline = {}
    for standing in ranking:
        headline[f"worst error of {reference}, {standing.name}"] = percentage(standing.worst)
        usual = [None if end is None else 100.0 * end for end in standing.usual]
        headline[f"usual error of {reference}, {standing.name}"] = Measure(
            usual[0], "%", "lower", *usual[1:]
        )
        headline[f"objective z, {standing.name}"] = Measure(standing.z, "1", "lower")
    details = {
        f"{case}: error of {reference}, {name}": percentage(score[f"{reference}_nrmse"])
        for case, values in summary["cases"].items()
        for name, score in values["estimators"].items()
    }
    trust = "".join(f" {line}" for line in _trust_lines(system, summary))
    return Answer(_ranked(system, summary, ranking) + trust, headline, details)


def _ranked(system: System, summary: Mapping[str, Any], ranking: Sequence[Standing]) -> str:
    """Who errs least, in a sentence."""
    best, count = ranking[0], len(summary["cases"])
    errors = [
        (standing.worst, label(standing.name, system))
        for standing in ranking
        if standing.worst is not None and standing.judged == best.judged
    ]
    if not errors:
        return f"{len(ranking)} estimators ran on {recordings(count)}; none could be scored."
    signal = called(system, system.objective.signal)
    first = f"{errs_least(errors)}: {percent(errors[0][0])} of the mean {signal} in"
    if best.judged == 1:
        return f"{first} {best.case}, the only scored recording; one cannot say how others differ."
    sentence = f"{first} the worst of {recordings(best.judged)}, {best.case}"
    if None not in best.usual:
        middle, low, high = (percent(end or 0.0) for end in best.usual)
        ends = f"{low.removesuffix(' %')} to {high.removesuffix(' %')}"
        sentence += f", {middle} (95 %: {ends}) in a usual one"
    return f"{sentence}."


def write_page(
    system: System,
    summary: Mapping[str, Any],
    figures: Sequence[CaseFigure],
    planned: int,
    path: Path,
    files: Sequence[str] = ("npz",),
) -> None:
    """Write the page.

    Parameters
    ----------
    summary : as written to summary.json.
    figures : one per case of the summary.
    planned : number of cases that were asked for; more than there are after an interruption.
    files : suffixes of the files of each case beside the page.
    """
    reference = system.objective.signal
    ranking = standings(summary, reference)
    best = ranking[0]

    def badness(name: str) -> float:
        error = summary["cases"][name]["estimators"][best.name][f"{reference}_nrmse"]
        return -np.inf if error is None else float(error)

    ordered = sorted(figures, key=lambda figure: badness(figure.name), reverse=True)
    order = [figure.name for figure in ordered]
    first, *others = zoomable(ordered, summary, path.parent, files=files)
    quantity = called(system, reference)
    shown = (
        f"From top to bottom: what was measured and fed to the estimators, the {quantity} measured "
        "and estimated, its error, and the quantities behind it. Estimators are scored in the "
        "shaded time. Bands, where an estimator knows its uncertainty, hold 95 %. If a recording "
        "has no validation sensor, the grey band is the reference. Curves that leave a "
        "panel are cut, most often of the open loop. The best two estimators and the open loop "
        "are shown; the legend shows the others."
    )
    title = "The worst recording" if best.worst is not None else "A recording"
    table = _cases(system, summary, ranking, order)
    cases: list[Block] = [table, *_doubts(system, summary, order)]
    parts = [
        Part("shown", title, [shown, first]),
        Part("estimators", "Estimators", [_estimators(system, ranking)], printed=True),
        Part("cases", "Cases, worst first", cases, printed=True),
        Part("definitions", "How errors are defined", [Definitions(_terms(system))]),
    ]
    if others:
        parts.insert(3, Part("figures", "The other recordings, worst first", others))
    missing = planned - len(order)
    incomplete = Markup(
        f"<strong>Incomplete:</strong> {len(order)} of {planned} cases, because the run was "
        "interrupted."
    )
    warnings = {name: case["warnings"] for name, case in summary["cases"].items()}
    page = Page(
        title=f"{capital(quantity)} estimated on {recordings(len(order))}",
        headline=_ranked(system, summary, ranking),
        parts=parts,
        warnings=[incomplete] * (missing > 0)
        + [Markup.escape(line) for line in _trust_lines(system, summary) + warning_lines(warnings)],
        run=_run(system, summary),
    )
    page.write(summary, path)


_ROWS = 20_000  # of a table that become text at once
_Z = Numbers("objective z", "mean weighed error over the whole recording; of several, the largest")


def _share(share: float | None) -> Cell:
    """A share as a number of percent, sorted as a share."""
    return Cell("n/a") if share is None else Cell(f"{100 * share:.2f}", share)


def _link(case: str) -> Markup:
    return Markup('<a href="#{}">{}</a>').format(quote(anchor(case)), case)


def _estimators(system: System, ranking: Sequence[Standing]) -> Table:
    quantity = called(system, system.objective.signal)
    rows = []
    for standing in ranking:
        middle, low, high = standing.usual
        usual = _share(middle)
        if low is not None and high is not None:
            usual = Cell(f"{usual.text} ({100 * low:.2f} to {100 * high:.2f})", middle)
        row = (
            label(standing.name, system),
            _share(standing.worst),
            _link(standing.case) if standing.case else "n/a",
            usual,
            number(standing.z, ".3f"),
            number(standing.judged, ""),
            number(standing.seconds, ".2f"),
        )
        rows.append(row)
    return Table(
        "estimator-table",
        "Each estimator over all cases, the one with the least worst case first. Errors are of the "
        f"{quantity}, rms over mean {system.objective.when or window(system)}.",
        (
            "estimator",
            Numbers("worst error [%]", sorted="ascending"),
            "worst case",
            Numbers(
                "usual error [%]",
                "geometric mean of the cases, with its 95 % interval by how they differ",
            ),
            _Z,
            Numbers("scored cases"),
            Numbers("computing time [s]"),
        ),
        rows,
    )


def _cases(
    system: System, summary: Mapping[str, Any], ranking: Sequence[Standing], order: Sequence[str]
) -> Table:
    reference, best = system.objective.signal, ranking[0]
    unit, quantity = system.unit(reference), called(system, reference)
    rows = []
    for name in order:
        case = summary["cases"][name]
        scores = case["estimators"]
        rms = scores[best.name][f"{reference}_rms_{unit}"]
        row = (
            _link(name),
            Markup('<span class="conditions">{}</span>').format(case["title"]),
            *(_share(scores[standing.name][f"{reference}_nrmse"]) for standing in ranking),
            Cell("n/a") if rms is None else Cell(rounded(rms), rms),
            number(scores[best.name]["z"], ".3f"),
        )
        rows.append(row)
    errors = [Numbers(f"{label(standing.name, system)} [%]") for standing in ranking]
    errors[0] = Numbers(errors[0].title, sorted="descending")
    root = Markup("{} error [{}]").format(
        term("rms", "root of the mean square, in the scored time"), unit
    )
    return Table(
        "case-table",
        f"Error of the {quantity} by case and estimator [% of its mean]; rms error and objective z "
        f"are those of the {label(best.name, system)}.",
        ("case", "conditions", *errors, Numbers(root), _Z),
        rows,
    )


def _trust_lines(system: System, summary: Mapping[str, Any]) -> list[str]:
    """What contradicts the ranking of estimators, or their bands."""
    tested = {
        name: {
            estimator: [Contradiction(**test) for test in tests]
            for estimator, tests in case["contradictions"].items()
        }
        for name, case in summary["cases"].items()
    }
    scales = {name: case.get("scale", ()) for name, case in summary["cases"].items()}
    return followed(system) + contradiction_lines(tested) + warning_lines(scales)


def warning_lines(warnings: Mapping[str, Sequence[str]]) -> list[str]:
    """What is said of recordings first: each sentence once, with where it holds.

    Of sentences that differ in numbers alone, the first stands for all.
    """
    cases: dict[str, dict[str, str]] = {}
    for name, texts in warnings.items():
        for text in texts:
            cases.setdefault(numberless(text), {}).setdefault(name, text)
    lines = []
    for alike in cases.values():
        name, text = next(iter(alike.items()))
        where = ", ".join(alike) if len(alike) < max(len(warnings), 2) else "All recordings"
        of = f" (figures of {name})" if len({*alike.values()}) > 1 else ""
        lines.append(f"{where}{of}: {text}.")
    return lines


def _doubts(system: System, summary: Mapping[str, Any], order: Sequence[str]) -> list[Text]:
    """What is unlikely in recordings, and why estimators failed."""
    texts = []
    for name in order:
        case = summary["cases"][name]
        texts += [f"{name}: {doubt}" for doubt in case["doubts"]]
        texts += [
            f"{name}, {label(estimator, system)}: {score['reason']}."
            for estimator, score in case["estimators"].items()
            if score["reason"]
        ]
    return [Text(text, warning=True) for text in texts]


def _terms(system: System) -> dict[str, str]:
    reference, limit = system.objective.signal, below(system)
    filtered = (
        f", without what is not {limit}, by a low-pass that shifts no phase (sensors ring above "
        "that)"
    )
    unseen = (
        ""
        if reference in (output.name for output in system.outputs)
        else (f" {reference} is a validation sensor; no estimator uses it.")
    )
    later = (
        ""
        if system.validated
        else " As what is weighed corrects the estimators, each estimate is compared with the line "
        "through the next samples, which it has not seen."
    )
    weighed = " + ".join(
        f"{weight} {inverse(system.unit(name))} · |error of {name}|"
        for name, weight in system.objective.weights.items()
    )
    return {
        f"Error of the {called(system, reference)}": f"Estimated minus measured {reference}"
        f"{filtered if limit else ''}; root of the mean square {window(system)}, over the mean of "
        f"|{reference}| in the same time.{unseen}",
        "Objective z": "As in equation (12) of Schwarz, Brembeck, Heckmann (2018): the mean over "
        f"the whole recording of {weighed}{f', of errors {limit}' if limit else ''}."
        f"{later} Of several "
        "cases, the largest counts.",
        "Computing time": "Wall time of the estimator on one processor, without reading, scoring "
        "and drawing. The first run on a machine compiles the loops of the "
        "estimators, and this "
        "time is in it.",
    }


_OTHER = ("run", "meanings", "workbench", "python", "packages", "fmu", "commit", "seed")


def _run(system: System, summary: Mapping[str, Any]) -> list[Block]:
    """Models, versions, and the settings of each estimator."""
    provenance = summary["provenance"]
    code = Markup("<code>{}</code>").format
    fmu = provenance["fmu"]
    models = {key: model for key, model in provenance.items() if key.endswith("_fmu")}
    packages = "".join(f", {name} {release}" for name, release in provenance["packages"].items())
    commit, seed = provenance["commit"], provenance.get("seed")
    terms = {
        "Model": f"{fmu['model']}, from {fmu['file']}",
        **{
            f"{label(key, system).replace(' fmu', '').capitalize()} model": Markup(
                "{}, from {}, SHA-256 <code>{}</code>"
            ).format(model["model"], model["file"], model["sha256"])
            for key, model in models.items()
        },
        "SHA-256 of the FMU": code(fmu["sha256"]),
        "Versions": f"workbench {provenance['workbench']}, Python {provenance['python']}{packages}",
        "Commit": code(commit) if commit else "not known: not run from a git checkout",
        "Random seed": "none, nothing in this run is random" if seed is None else str(seed),
        "Weights of z": ", ".join(f"{name} = {w}" for name, w in summary["weights"].items()),
    }
    meanings = provenance.get("meanings", {})
    tables = [
        _settings(label(key, system), settings, meanings.get(key, {}))
        for key, settings in provenance.items()
        if key not in (*_OTHER, *models) and isinstance(settings, Mapping)
    ]
    repeat = Markup("To repeat the run: <code>workbench simulate</code>.")
    return [Definitions(terms, grid=True), *tables, repeat]


def _settings(name: str, settings: Mapping[str, Any], meanings: Mapping[str, Any]) -> Table:
    """Settings of an estimator, with their units and what they do."""
    rows = []
    for setting, value in settings.items():
        if setting != "source":
            meaning = meanings.get(setting, {"unit": "", "text": ""})
            rows.append((setting, _setting(value), meaning["unit"], meaning["text"]))
    return Table(
        f"settings-{anchor(name)}",
        f"Settings of the {name}: {settings.get('source') or 'as usual'}",
        ("setting", "value", "unit", "what it does"),
        rows,
        sortable=False,
    )


def _setting(value: Any) -> str:
    """A setting as text; a matrix in columns."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {_significant(entry).strip()}" for key, entry in value.items())
    if isinstance(value, Sequence) and not isinstance(value, str):
        lines = (
            f"{'  '.join(map(_significant, row))}\n"
            if isinstance(row, Sequence) and not isinstance(row, str)
            else f"{_significant(row)}  "
            for row in value
        )
        return Markup("<pre>{}</pre>").format("".join(lines))
    return _significant(value).strip()


def _significant(value: object) -> str:
    """A setting, in a column if it is a number."""
    return f"{value:>9.4g}" if isinstance(value, (int, float)) else str(value)
