"""Machine-readable results, and the table on the terminal."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import t

from workbench.observers import label
from workbench.observers.simulation import CaseResult
from workbench.pages.answer import Answer, Measure, recordings, with_answer
from workbench.pages.figures import CaseFigure
from workbench.pages.measures import percentage
from workbench.pages.recordings import placed
from workbench.pages.templates import rendered
from workbench.pages.views import below, called, inverse, percent, rounded, window
from workbench.runtime.files import write_whole
from workbench.system.system import System


def write_estimates(result: CaseResult, path: Path) -> None:
    """Write one CSV of a case; see `CaseResult.to_frame`."""
    write_numbers(result.to_frame(), path, 7)


def write_numbers(frame: pd.DataFrame, path: Path, digits: int) -> None:
    """Write a table as pandas does, in a quarter of the time: a row at once, not a number."""
    row = ",".join([f"%.{digits}g"] * frame.shape[1]) + "\n"
    rows = "".join(row % tuple(values) for values in frame.to_numpy(float).tolist())
    write_whole(path, frame.head(0).to_csv(index=False) + rows.replace("nan", ""))


def summarise_runs(
    system: System, results: Sequence[CaseResult], provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """Scores by case and estimator, weights of z, and what made them: the one source of numbers."""
    summary = {
        "provenance": provenance,
        "weights": dict(system.objective.weights),
        "cases": {result.case.name: result.to_dict() for result in results},
    }
    return with_answer(simulated(system, summary), summary)


def format_table(system: System, results: Sequence[CaseResult]) -> str:
    """Table for the terminal: error of the judged signal, rms over mean, by case and estimator."""
    names = list(results[0].runs)
    width = max(len("case"), *(len(r.case.name) for r in results))
    header = f"{'case':<{width}}" + "".join(f"{name:>22}" for name in names)
    objective = system.objective
    when = f" {objective.when}" if objective.when else ""
    limits = ", ".join(filter(None, (below(system), window(system))))
    lines = [f"Error of {objective.signal}, rms / mean{when} ({limits})", header, "-" * len(header)]
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
    """How one estimator did on all cases; None where no case could be judged.

    Attributes
    ----------
    name : key in the summary.
    worst : error of the judged signal, rms over mean [1].
    case : where it was worst.
    usual : error in a recording like these, with its 95 % interval if there are several [1].
    z : largest objective z_k [1].
    judged : number of cases with an error.
    seconds : wall time of all its runs.
    """

    name: str
    worst: float | None
    case: str
    usual: tuple[float | None, float | None, float | None]
    z: float | None
    judged: int
    seconds: float


def standings(summary: Mapping[str, Any], judged: str) -> list[Standing]:
    """Estimators, the one with the least worst case first; those never judged last.

    Parameters
    ----------
    judged : name of the judged signal.
    """
    cases: Mapping[str, Any] = summary["cases"]
    names = list(next(iter(cases.values()))["estimators"])
    table = []
    for name in names:
        scores = {case: values["estimators"][name] for case, values in cases.items()}
        shares = {case: s[f"{judged}_nrmse"] for case, s in scores.items()}
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
    reach = t.ppf(0.975, count - 1) * logarithms.std(ddof=1) / np.sqrt(count)
    return middle, float(middle * np.exp(-reach)), float(middle * np.exp(reach))


def simulated(system: System, summary: Mapping[str, Any]) -> Answer:
    """The answer of `simulate`."""
    judged = system.objective.signal
    ranking = standings(summary, judged)
    best = ranking[0]
    headline = {}
    for standing in ranking:
        headline[f"worst error of {judged}, {standing.name}"] = percentage(standing.worst)
        usual = [None if end is None else 100.0 * end for end in standing.usual]
        headline[f"usual error of {judged}, {standing.name}"] = Measure(
            usual[0], "%", "lower", *usual[1:]
        )
        headline[f"objective z, {standing.name}"] = Measure(standing.z, "1", "lower")
    details = {
        f"{case}: error of {judged}, {name}": percentage(score[f"{judged}_nrmse"])
        for case, values in summary["cases"].items()
        for name, score in values["estimators"].items()
    }
    count = len(summary["cases"])
    if best.worst is None:
        sentence = f"{len(ranking)} estimators ran on {recordings(count)}; none could be judged."
        return Answer(sentence, headline, details)
    share, signal = percent(best.worst), called(system, judged)
    first = f"The {label(best.name, system)} errs least: {share} of the mean {signal} in"
    if best.judged == 1:
        only = f"{best.case}, the only recording that was judged; one cannot say how others differ."
        return Answer(f"{first} {only}", headline, details)
    sentence = f"{first} the worst of {recordings(best.judged)}, {best.case}"
    if None not in best.usual:
        middle, low, high = (percent(end or 0.0) for end in best.usual)
        ends = f"{low.removesuffix(' %')} to {high.removesuffix(' %')}"
        sentence += f", {middle} (95 %: {ends}) in a usual one"
    return Answer(f"{sentence}.", headline, details)


def write_page(
    system: System,
    summary: Mapping[str, Any],
    figures: Sequence[CaseFigure],
    planned: int,
    path: Path,
) -> None:
    """Write the page; files of each case are expected beside it.

    Parameters
    ----------
    summary : as written to summary.json.
    figures : one per case of the summary.
    planned : number of cases that were asked for; more than there are after an interruption.
    """
    judged = system.objective.signal
    ranking = standings(summary, judged)
    best = ranking[0]

    def badness(name: str) -> float:
        error = summary["cases"][name]["estimators"][best.name][f"{judged}_nrmse"]
        return -np.inf if error is None else float(error)

    by_name = {figure.name: figure for figure in figures}
    order = sorted(by_name, key=badness, reverse=True)
    drawn = placed([by_name[name] for name in order], summary, path.parent)
    text = rendered(
        "page.html",
        summary,
        lambda name: label(name, system),
        standings=ranking,
        best=best,
        order=order,
        drawings=dict(zip(order, drawn, strict=True)),
        planned=planned,
        judged=judged,
        unit=system.unit(judged),
        called=called(system, judged),
        when=system.objective.when or window(system),
        window=window(system),
        below=below(system),
        fed=judged in (output.name for output in system.outputs),
        rounded=rounded,
        weights=[
            (weight, inverse(system.unit(name)), name)
            for name, weight in system.objective.weights.items()
        ],
    )
    write_whole(path, text)
