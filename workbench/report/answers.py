"""What each command found, from its summary: a sentence, and the numbers to compare runs by."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t

from workbench.answer import Answer, Better, Measure
from workbench.lab import BAND
from workbench.report.views import called, label, percent
from workbench.system import System


def with_answer(answer: Answer, summary: Mapping[str, Any]) -> dict[str, Any]:
    """A summary that begins with its answer."""
    return {"answer": answer.to_dict(), **summary}


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
    judged = system.objective.judged
    ranking = standings(summary, judged)
    best = ranking[0]
    headline = {}
    for one in ranking:
        headline[f"worst error of {judged}, {one.name}"] = _percent(one.worst)
        usual = [None if end is None else 100.0 * end for end in one.usual]
        headline[f"usual error of {judged}, {one.name}"] = Measure(
            usual[0], "%", "lower", *usual[1:]
        )
        headline[f"objective z, {one.name}"] = Measure(one.z, "1", "lower")
    details = {
        f"{case}: error of {judged}, {name}": _percent(score[f"{judged}_nrmse"])
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


def recordings(count: int) -> str:
    """A number of recordings in words."""
    return "one recording" if count == 1 else f"{count} recordings"


def tuned(sentence: str, summary: Mapping[str, Any]) -> Answer:
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
        f"{name}: z_k": Measure(one["z_k"], "1", "lower") for name, one in summary["cases"].items()
    }
    return Answer(sentence, headline, details)


def diagnosed(summary: Mapping[str, Any]) -> Answer:
    """The answer of `diagnose`."""
    headline, details = {}, {}
    if (gain := summary["gain"]) is not None:
        low, high = gain["low"], gain["high"]
        headline["error on held-out recordings, nominal"] = Measure(gain["before"], "1", "lower")
        headline["error on held-out recordings, extended"] = Measure(
            gain["after"], "1", "lower", low, high
        )
    for cause in summary["causes"]:
        for name, one in cause["parameters"].items():
            headline[f"{cause['effect']}, {name}"] = Measure(
                one["value"], one["unit"], "", one["low"], one["high"]
            )
        headline[f"{cause['effect']}, explained"] = _percent(cause["explained"], "higher")
    for one in summary["errors"]:
        name = f"{one['recording']}: error of {one['channel']}"
        details[f"{name}, nominal"] = Measure(one["rms"][0], one["unit"], "lower")
        details[f"{name}, extended"] = Measure(one["rms"][1], one["unit"], "lower")
    return Answer(summary["sentence"], headline, details)


def observed(system: System, summary: Mapping[str, Any]) -> Answer:
    """The answer of `observability`."""
    headline, details = {}, {}
    cases = summary["cases"]
    words = []
    for one in system.estimated:
        shares, bounds = {}, {}
        for case, values in cases.items():
            first = next(iter(values["models"].values()))
            if first["useful"] is not None:
                shares[case] = first["useful"][one.correction]
                bounds[case] = first["median_bound"][one.correction]
        for case, share in shares.items():
            details[f"{case}: time in which {one.name} can be told"] = _percent(share, "higher")
            details[f"{case}: bound of {one.name}"] = Measure(bounds[case], one.unit, "lower")
        if shares:
            middle = float(np.median(list(shares.values())))
            headline[f"time in which {one.name} can be told, median"] = _percent(middle, "higher")
            low, high = min(shares.values()), max(shares.values())
            between = f" ({_whole(low)} to {_whole(high)})" if len(shares) > 1 else ""
            words.append(
                f"{one.label} {one.name} to {one.useful:g}{_unit(one.unit)} in {_whole(middle)} of "
                f"the judged time{between}"
            )
    first, test = next(iter(summary["linear"].items()))
    seen = "can" if test["observable"] else "cannot"
    window = f"{summary['window_s']:g} s of samples"
    said = f"{window} can tell {'; '.join(words)}. " if words else ""
    states = f"All states of {first} {seen} be observed in the linear test."
    if not test["observable"]:
        states = f"Not all states of {first} can be observed: {', '.join(test['unobservable'])}."
    return Answer(f"{said[:1].upper()}{said[1:]}{states}", headline, details)


def powered(summary: Mapping[str, Any]) -> Answer:
    """The answer of `power`."""
    shares = {
        "right cause or its group first": summary["right_first"],
        "right cause first, above noise": summary["right_first_above_noise"],
        "right cause and no other": summary["right_alone"],
        "both of a pair": summary["pairs"]["both"],
        "unknown cause is unexplained": summary["unexplained"],
        "intervals that hold the truth": summary["coverage"],
    }
    headline = {"false alarms on clean sets": _share(summary["false_alarms"], "lower")}
    headline |= {name: _share(one, "higher") for name, one in shares.items()}
    details = {
        f"{effect} x {size}: named right": _share(one, "higher")
        for effect, values in summary["effects"].items()
        for size, one in values["right_first"].items()
    }
    words = []
    if (right := summary["right_first"])["of"]:
        words.append(f"the diagnosis names the right cause, or its group, in {_interval(right)}")
    if (false := summary["false_alarms"])["of"]:
        words.append(f"names one where there is none in {_interval(false)}")
    if (hold := summary["coverage"])["of"]:
        words.append(f"its 95 % intervals hold the truth in {_interval(hold, 'intervals')}")
    said = "; ".join(words) or "too few sets for a share"
    return Answer(f"{said[:1].upper()}{said[1:]}.", headline, details)


def proposed(summary: Mapping[str, Any]) -> Answer:
    """The answer of `next`."""
    best = summary["tried"][0]
    several = len(summary["rivals"]) > 1
    headline = {
        "cost of the best experiment": Measure(best["cost"]["value"], best["cost"]["unit"], "lower")
    }
    if several:
        headline["separation"] = Measure(best["separation"], "1", "higher")
        headline["chance that the right cause is named"] = _percent(best["chance"], "higher")
        sure = f" The right one is then named with a chance of {_whole(best['chance'])}."
        return Answer(summary["sentence"] + sure * summary["parts"], headline)
    before, after = best["deviation"]["before"], best["deviation"]["after"]
    headline["times as sure"] = Measure(before / after, "1", "higher")
    return Answer(summary["sentence"], headline)


def stopping(summary: Mapping[str, Any]) -> Answer:
    """The answer of `distance`."""
    shares = summary["distance"]
    middle, low, high = (shares[share] for share in ("0.5", "0.025", "0.975"))
    headline = {
        "distance": Measure(middle, "m", "lower", low, high),
        "deceleration": Measure(summary["deceleration"], "m/s2", "higher"),
    }
    for one in summary["safety"] or []:
        name = f"deceleration over the nominal one, all but one stop in 1e{one['decade']}"
        headline[name] = Measure(one["ratio"], "1", "higher", one["low"], one["high"])
    details = {
        f"{one['stop']}: measured over predicted distance": Measure(
            one["distance [m]"] / one["predicted [m]"], "1"
        )
        for one in summary["stops"]
    }
    return Answer(summary["sentence"], headline, details)


def watched(summary: Mapping[str, Any]) -> Answer:
    """The answer of `monitor`."""
    said, count = summary["sentences"], recordings(summary["recordings"])
    headline = {"alarms": Measure(len(summary["alarms"]), "1", "lower")}
    details = {}
    for name, one in summary["quantities"].items():
        level, sure = one["level"], one["standard_error"]
        ends = (None, None)
        if level is not None and sure is not None:
            ends = (level - BAND * sure, level + BAND * sure)
        details[f"level of {name}"] = Measure(level, one["unit"], "", *ends)
    return Answer(
        "; ".join(said) + "." if said else f"Nothing changed in {count}.", headline, details
    )


def _percent(share: float | None, better: Better = "lower") -> Measure:
    return Measure(None if share is None else 100.0 * share, "%", better)


def _share(one: Mapping[str, Any], better: Better) -> Measure:
    """A share of sets; without any there is nothing to compare."""
    if not one["of"]:
        return Measure(None, "%", better)
    value, low, high = (100.0 * one[key] for key in ("share", "low", "high"))
    return Measure(value, "%", better, low, high)


def _interval(one: Mapping[str, Any], of: str = "sets") -> str:
    low, high = 100.0 * one["low"], 100.0 * one["high"]
    share = _whole(one["share"])
    return f"{one['hits']} of {one['of']} {of}, {share} (95 %: {low:.0f} to {high:.0f})"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _whole(share: float) -> str:
    """A share in whole percent.

    >>> _whole(0.906)
    '91 %'
    """
    return f"{100.0 * share:.0f} %"
