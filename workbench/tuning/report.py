"""What `tune` writes beside gains: the answer, the page, figures, and the table on the terminal.

Numbers come from the summary alone; what is here orders and places them.
"""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from workbench.pages.answer import Answer, Measure, recordings
from workbench.pages.parts import (
    Block,
    Cell,
    Definitions,
    Dot,
    Dots,
    Numbers,
    Page,
    Part,
    Source,
    Steps,
    Table,
    number,
    tabulated,
    term,
)
from workbench.pages.views import capital, percent
from workbench.runtime.files import replacing, warning_if_unwritable
from workbench.tuning.checkpoint import Generation
from workbench.tuning.recipe import NEGLIGIBLE, STEP

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_REASONED, _TUNED = "0", "2"  # styles of curves


def headline(summary: Mapping[str, Any]) -> str:
    """The result in one sentence."""
    z, before = summary["z"], summary["z_reasoned"]
    moved = "falls" if z < before else "rises"
    result = (
        f"z stays at {z:.4g}, because no candidate was better than the model-based gains"
        if z == before
        else f"z, the objective of the worst case, {moved} from {before:.4g} with the model-based "
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
    if warned := summary.get("warned"):
        news.append(f"{warned}.")
    if worse := [case for case in _worst_first(summary) if case["z_k"] > case["z_k_reasoned"]]:
        cases = ", ".join(
            f"{case['name']} ({case['z_k_reasoned']:.4g} to {case['z_k']:.4g})" for case in worse
        )
        news.append(f"Worse than with the model-based gains: {cases}.")
    folds = _folds(summary)
    if missed := [fold for fold in folds if not fold["better"]]:
        news.append(
            f"On cases they have not seen, tuned gains are not better than the model-based ones in "
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
    """Write the page into the folder, beside gains.toml and the figures; returns its path."""
    parts = [
        Part("cases", "Cases, worst first", [_cases(summary), _dots(summary)]),
        Part("gains", "Gains", _gains(summary, folder), printed=True),
        Part("search", "Search", [_convergence(summary), _work(summary)]),
        Part("definitions", "Definitions", [Definitions(_terms(summary))]),
    ]
    if compared := _comparison(summary):
        parts.insert(1, Part("beside", "Other estimators, not tuned", [compared]))
    if summary["folds"]:
        parts.insert(1, Part("folds", "On cases not seen, worst first", [_unseen(summary)]))
    cases = recordings(len(summary["provenance"]["cases"]))
    page = Page(
        title=f"{capital(summary['label'])}, tuned on {cases}",
        parts=parts,
        headline=headline(summary),
        warnings=bad_news(summary),
        run=[Definitions(_run(summary["provenance"]), grid=True)],
    )
    return page.write(summary, folder / "index.html")


def _worst_first(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    cases = [{"name": name, **case} for name, case in summary["cases"].items()]
    return sorted(cases, key=lambda case: -case["z_k"])


def _z(value: float | None) -> Cell:
    """A z as a cell; that of what diverges sorts as the worst."""
    return Cell("diverges", np.inf) if value is None else number(value, ".4f")


def _change(value: float | None) -> Cell:
    return _z(value) if value is None else Cell(f"{round(100 * value, 1) + 0:+.1f} %", value)


def _cases(summary: Mapping[str, Any]) -> Table:
    unstable = "gains with which an estimate diverged or the model failed here first"
    meaning = "objective of one case: the mean weighed error over its recording"
    return tabulated(
        "case-table",
        "Objective of each case. A candidate is unstable where its estimate diverged or the model "
        "failed; it is counted in the case where that showed first.",
        _worst_first(summary),
        [
            ("case", "name", ""),
            (Numbers(term("z_k", meaning) + ", model-based"), "z_k_reasoned", ".4f"),
            (Numbers("z_k, tuned", sorted="descending"), "z_k", ".4f"),
            (Numbers("change"), lambda c: _change(c["z_k"] / c["z_k_reasoned"] - 1), ""),
            (Numbers("unstable candidates", unstable), lambda c: number(c["unstable"], ""), ""),
        ],
    )


def _dots(summary: Mapping[str, Any]) -> Dots:
    cases = _worst_first(summary)
    pairs = (f"{case['name']} {case['z_k_reasoned']:.4f} to {case['z_k']:.4f}" for case in cases)
    return Dots(
        finding=f"Objective of each case, model-based to tuned: {', '.join(pairs)}.",
        axis="objective of the case, z_k [1]",
        rows=[
            (
                case["name"],
                (Dot(case["z_k_reasoned"], _REASONED), Dot(case["z_k"], _TUNED, diamond=True)),
            )
            for case in cases
        ],
        mark=(summary["z"], "z, tuned"),
        paired=True,
        caption=Markup(
            "Objective of each case with the model-based and with the tuned gains; the search "
            "lowers "
            'the largest. Data and figure: <a href="summary.json">JSON</a>, '
            '<a href="cases.png">PNG</a>'
        ),
        legend=((_REASONED, "model-based gains (circle)"), (_TUNED, "tuned gains (diamond)")),
    )


def _folds(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    rows = [
        {**fold, "better": fold["tuned"] is not None and fold["tuned"] < fold["reasoned"]}
        for fold in summary["folds"]
    ]
    return sorted(rows, key=lambda fold: -np.inf if fold["tuned"] is None else -fold["tuned"])


def _unseen(summary: Mapping[str, Any]) -> Table:
    reference = summary["judged"]
    below = f", below {summary['bandwidth']:g} Hz" if summary["bandwidth"] else ""

    def error(share: float | None) -> Cell:
        return Cell("not scored", np.inf) if share is None else Cell(percent(share), share)

    def verdict(fold: Mapping[str, Any]) -> object:
        return "better" if fold["better"] else Cell("⚠ not better", warning=True)

    untuned = Numbers(f"error of {reference}, model-based")
    tuned = Numbers(f"error of {reference}, tuned without them")
    without = Numbers("z, tuned without them", sorted="descending")
    return tabulated(
        "fold-table",
        "Gains tuned without some of the cases and scored on these, against the model-based gains "
        f"on the same. The error of {reference} is the worst of the cases, rms over mean{below}.",
        _folds(summary),
        [
            ("left out", lambda fold: ", ".join(fold["cases"]), ""),
            (Numbers("z, model-based"), lambda fold: _z(fold["reasoned"]), ""),
            (without, lambda fold: _z(fold["tuned"]), ""),
            (Numbers("z of the cases tuned on"), lambda fold: _z(fold["z"]), ""),
            (untuned, lambda fold: error(fold["error_reasoned"]), ""),
            (tuned, lambda fold: error(fold["error"]), ""),
            ("worst of them", "worst", ""),
            ("verdict", verdict, ""),
        ],
    )


def _comparison(summary: Mapping[str, Any]) -> Table | None:
    """These gains among untuned estimators, the least z first; None if there is none to compare."""
    if not summary.get("beside"):
        return None
    name, cases = summary["label"], summary["cases"]
    rows = [
        (f"{name}, {how}", summary[z], max(cases, key=lambda case: cases[case][z_k]))
        for how, z, z_k in (("tuned", "z", "z_k"), ("model-based", "z_reasoned", "z_k_reasoned"))
    ]
    rows += [(other["label"], other["z"], other["worst"]) for other in summary["beside"].values()]
    rows.sort(key=lambda row: np.inf if row[1] is None else row[1])
    return Table(
        "beside-table",
        "The same objective on the same cases, the least worst case first.",
        ("estimator", Numbers("z", sorted="ascending"), "worst case"),
        [(label, _z(z), worst) for label, z, worst in rows],
        marked=[f"{name}, tuned"],
    )


def _gains(summary: Mapping[str, Any], folder: Path) -> list[Block]:
    """What each gain does and is worth; an interrupted search does not say what z does by it."""
    known = summary["sensitivity"]
    good = term("as good", f"with a z that is larger by {100 * NEGLIGIBLE:g} % at most")
    changes = (
        ", and how z changes when this gain alone becomes a little less, a little more, or zero"
        if known
        else ""
    )
    caption = Markup(
        "Each gain, the range that was searched, and that of the last candidates that are {}, in "
        "which all gains change at once: others compensate for a wide one{}."
    ).format(good, changes)
    rows = []
    for name, gain in summary["gains"].items():
        effect = known.get(name)
        remarks = ["⚠ at bound"] if gain["at_bound"] else []
        if effect is not None and not effect["matters"]:
            remarks.append("does not matter")
        if effect is not None and _fall(effect):
            remarks.append("not converged")
        low, high = gain["as_good"]
        cells = [
            gain["meaning"],
            number(gain["value"], ".4g"),
            number(gain["reasoned"], ".4g"),
            f"{gain['lower']:.4g}, {gain['upper']:.4g}",
            f"{low:.4g}, {high:.4g}",
            gain["unit"],
        ]
        if effect is not None:
            cells += [_change(effect[key]) for key in ("less", "more", "without")]
        rows.append((name, *cells, Cell(", ".join(remarks), warning=gain["at_bound"])))
    columns: list[object] = ["gain", "what it does", Numbers("tuned"), Numbers("model-based")]
    columns += ["searched from, to", "as good, from, to", "unit"]
    if known:
        columns += [Numbers("z, less"), Numbers("z, more"), Numbers("z, without")]
    interrupted = "The search was interrupted before it was found what z does when a gain changes."
    use = Markup('With all digits in <a href="gains.toml">gains.toml</a>. To use them:')
    path = shlex.quote(str(folder / "gains.toml"))
    return [
        *([] if known else [interrupted]),
        Table("gain-table", caption, [*columns, "remark"], rows),
        use,
        Source(f"workbench simulate --gains {path}"),
    ]


def _fall(effect: Mapping[str, float | None]) -> float:
    """How much z would fall if the gain alone were changed; 0 where that is negligible."""
    changes = (effect["less"], effect["more"], effect["without"])
    fall = -min((change for change in changes if change is not None), default=0.0)
    return fall if fall > NEGLIGIBLE else 0.0


def _why(summary: Mapping[str, Any], fold: Mapping[str, Any]) -> str:
    """Why tuned gains are not better on a fold, by what its worst case does when it is tuned on."""
    worst, tuned = fold["worst"], fold["tuned"]
    case = summary["cases"][worst]
    change = f"{worst} ({case['z_k_reasoned']:.4g} to "
    change += "no estimate)" if tuned is None else f"{tuned:.4g})"
    if case["z_k"] < case["z_k_reasoned"]:
        return f"{change} asks of the gains what no case asks that was tuned on"
    return f"{change} loses also where it is tuned on, because the worst case gains at its cost"


def _convergence(summary: Mapping[str, Any]) -> Steps:
    best, reasoned = summary["convergence"], summary["z_reasoned"]
    return Steps(
        finding=f"Best z by generation: {best[0]:.4f} at first, {best[-1]:.4f} after "
        f"{summary['work']['generations']} generations; {reasoned:.4f} with the model-based gains.",
        axis="generation; 0 is the initial population",
        values=best,
        style=_TUNED,
        mark=(reasoned, "model-based gains"),
        caption=Markup(
            "z of the best candidate. Data and figure, with the work saved and the unstable "
            'candidates: <a href="summary.json">JSON</a>, <a href="convergence.png">PNG</a>'
        ),
    )


def _work(summary: Mapping[str, Any]) -> Definitions:
    work = summary["work"]
    unstable = sum(case["unstable"] for case in summary["cases"].values())
    converged = ", then converged: z of all candidates was the same" * work["converged"]
    terms = {
        "Generations": f"{work['generations']}{', then interrupted' * work['interrupted']}"
        f"{converged}",
        "As good": f"{work['as_good']} of the last {work['last']} candidates, within "
        f"{100 * NEGLIGIBLE:g} % of the best z",
        "Candidates": f"{work['candidates']}, of which {unstable} were unstable",
        "Work saved": f"{percent(work['saved'])}, by dropping candidates that have lost",
        "Time": f"{work['seconds']:.1f} s",
        "Crashed or blocked workers": str(work["crashed"]),
    }
    return Definitions(terms, grid=True)


def _terms(summary: Mapping[str, Any]) -> dict[str, str]:
    provenance, follows = summary["provenance"], summary["follows"]
    below = f", below {summary['bandwidth']:g} Hz" if summary["bandwidth"] else ""
    weighed = " + ".join(f"{w} · |error of {name}|" for name, w in provenance["weights"].items())
    scaled = "".join(
        f", and again with {name} {100 * error:g} % off, alternately to both sides, as a sensor "
        "reads whose scale is not known better: gains that trust the difference of two outputs to "
        "the last digit fail on any other machine"
        for name, error in provenance["scale_errors"].items()
    )
    treatment = f"Each case as it is{scaled}."
    if (judge := provenance["judged_by"]) != "sensors":
        treatment += (
            f" A quantity that no output of the model measures is scored by the {judge}, which "
            "knows the "
            "whole recording, not by a sensor."
        )
    terms = {
        "Objective z": "The largest z_k of all cases, equations (11) and (12) of Schwarz, "
        "Brembeck, Heckmann (2018): z_k is the mean over the whole recording of "
        f"{weighed} in SI units{below}.",
        "Scored recordings": treatment,
    }
    observer = "L11" in summary["gains"]
    if observer and follows:
        terms["Candidates refused"] = (
            f"Those that leave more than {100 * follows['left']:g} % of a step of "
            f"{follows['quantity']} {follows['within']:g} s or four times as long after it, by the "
            "linearised model: they would have measured signals right while what is estimated "
            "drifts behind."
        )
    terms["Model-based gains"] = (
        "Those before tuning, from the linearised model or the noise of the sensors. The search "
        "starts around them."
    )
    if observer:
        terms["What a gain does"] = (
            "It corrects the first by the second: by the deviation of a measured output from its "
            "estimate, or by the integral ∫ of this deviation."
        )
    return terms | {
        "Bounds": "From the slowest loop that a recording shows to the fastest that its samples "
        "carry; for levels of noise, a hundredth to a hundred times the model-based ones. A gain "
        "within 1 % of its range from an end is at a bound: something better may lie beyond, or it "
        "does not matter.",
        "A little less, a little more": f"{100 * STEP:g} % of the searched range, on its "
        f"logarithmic scale. A gain does not matter if z stays within {100 * NEGLIGIBLE:g} % with "
        "less, with more and without it; it has not converged if z falls by more than that.",
        "Work saved": "z_k only grows along a recording, so that a candidate has lost as soon as "
        "it exceeds the one it has to beat, and the rest of its samples need no evaluation. The "
        "result is the same.",
    }


def _run(provenance: Mapping[str, Any]) -> dict[str, str]:
    fmu = provenance["fmu"]
    packages = "".join(f", {name} {release}" for name, release in provenance["packages"].items())
    return {
        "Model": f"{fmu['model']}, from {fmu['file']}",
        "SHA-256 of the FMU": Markup("<code>{}</code>").format(fmu["sha256"]),
        "Versions": f"workbench {provenance['workbench']}, Python {provenance['python']}{packages}",
        "Cases": ", ".join(provenance["cases"]),
        "Random seed": str(provenance["seed"]),
        "Candidates per gain": str(provenance["population"]),
        **{
            f"Scale of {name}": f"{100 * error:g} % off"
            for name, error in provenance["scale_errors"].items()
        },
        "Weights of z": ", ".join(f"{name} = {w}" for name, w in provenance["weights"].items()),
    }


def draw_convergence(history: Sequence[Generation], path: Path) -> None:
    """Draw `convergence` to a file."""
    _save(convergence(history), path)


def convergence(history: Sequence[Generation]) -> "Figure":
    """Best z and share of work saved, by generation."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    generations = np.arange(len(history))
    top.step(generations, [g.z for g in history], where="post")
    top.set(ylabel="best z [1]", title=f"z = {history[-1].z:.4g}, worst case {history[-1].worst}")
    bottom.plot(generations, [100 * g.saved for g in history], label="work saved")
    share = [100 * sum(g.unstable.values()) / g.candidates for g in history]
    bottom.plot(generations, share, "--", label="unstable candidates")
    bottom.set(xlabel="generation", ylabel="[%]", ylim=(0, 100))
    bottom.legend()
    for axes in (top, bottom):
        axes.grid(alpha=0.3)
    return figure


def draw_cases(cases: Mapping[str, Mapping[str, float]], path: Path) -> None:
    """Draw z_k of each case of a summary with reasoned and with tuned gains."""
    from matplotlib.figure import Figure

    names = list(cases)
    before, after = ([case[z] for case in cases.values()] for z in ("z_k_reasoned", "z_k"))
    figure = Figure(figsize=(8, 1.2 + 0.32 * len(names)), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(names))
    axes.barh(rows - 0.2, before, 0.4, label="model-based", color="0.7")
    axes.barh(rows + 0.2, after, 0.4, label="tuned")
    axes.axvline(max(after), color="0.3", linestyle=":", label="z, tuned")
    axes.set_yticks(rows, names)
    axes.invert_yaxis()
    axes.set_xlabel("z_k [1]")
    axes.legend()
    _save(figure, path)


def _save(figure: "Figure", path: Path) -> None:
    with warning_if_unwritable(), replacing(path) as stream:
        figure.savefig(stream, format="png", dpi=120)


def format_tuned(summary: Mapping[str, Any]) -> str:
    """Table for the terminal: cases, and what is to be said of gains and folds."""
    cases = summary["cases"]
    width = max(map(len, cases))
    lines = [f"warning: {summary['warned']}"] * bool(summary.get("warned"))
    lines.append(f"{'case':<{width}} {'model-based':>11} {'tuned':>9}  z_k, worst first")
    for name, case in sorted(cases.items(), key=lambda item: -item[1]["z_k"]):
        lines.append(f"{name:<{width}} {case['z_k_reasoned']:>11.4f} {case['z_k']:>9.4f}")
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
            f"not seen: {', '.join(fold['cases'])}: z {tuned:.4f}, {verdict} than model-based "
            f"{reasoned:.4f}; seen: {fold['z']:.4f}; error of {summary['judged']} {error:.2%}, "
            f"model-based {untuned:.2%}"
        )
    return "\n".join(lines)


def tuning_answer(sentence: str, summary: Mapping[str, Any]) -> Answer:
    """The answer of `tune`."""
    headline = {
        "z, tuned": Measure(summary["z"], "1", "lower"),
        "z, model-based": Measure(summary["z_reasoned"], "1", "lower"),
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
