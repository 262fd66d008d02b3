"""How often the diagnosis was right, with intervals, from verdicts on sets that hide something."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from functools import partial
from itertools import permutations
from typing import Any

from workbench.studies.power.journal import SetVerdict
from workbench.studies.power.planting import Repertoire

CLEAR = 4.0  # standard deviations that a size must have to be more than noise


def share(outcomes: Iterable[bool]) -> dict[str, Any]:
    """Hits, trials, their ratio and its 95 % interval.

    The interval is that of C. J. Clopper and E. S. Pearson (1934), Biometrika 26, 404-413: it
    covers in at least 95 %, however few trials there are.

    >>> none = share([False] * 10)
    >>> none["share"], none["low"], round(none["high"], 4)
    (0.0, 0.0, 0.3085)
    """
    from scipy.stats import binomtest  # takes its time, and little else needs it

    values = list(outcomes)
    hits, of = sum(values), len(values)
    if not of:
        return {"hits": 0, "of": 0, "share": None, "low": 0.0, "high": 1.0}
    low, high = binomtest(hits, of).proportion_ci(0.95, method="exact")
    return {"hits": hits, "of": of, "share": hits / of, "low": float(low), "high": float(high)}


def named_right(result: SetVerdict) -> bool:
    """Whether what was planted, or a group that it is in, is named first."""
    return bool(result.causes) and any(
        effect in result.causes[0].group for effect in result.planting.effects
    )


def named_in_part(result: SetVerdict) -> bool:
    """Whether what was planted, or its group, is the first cause of what is partly explained."""
    return any(effect in group for group in result.parts[:1] for effect in result.planting.effects)


def above_noise(result: SetVerdict) -> bool:
    """Whether a finding was possible: something was found, or the size is clear of its scatter.

    The scatter is the least that any estimate from these stops has, by the noise of their sensors,
    the tolerances of the plant and all other effects at sizes that do not matter.
    """
    return result.verdict != "nothing" or (result.clearness or 0.0) > CLEAR


def named_all(result: SetVerdict) -> bool:
    """Whether each effect that was planted has a cause of its own that is it, or its group."""
    planted = result.planting.effects
    return any(
        all(effect in cause.group for effect, cause in zip(planted, chosen, strict=True))
        for chosen in permutations(result.causes, len(planted))
    )


def intervals_cover(result: SetVerdict, repertoire: Repertoire) -> list[bool]:
    """Whether each interval of the planted effect, if it was named first, holds the truth.

    Intervals of a twin that is named in its place claim nothing, and are left out.
    """
    ((name, gain),) = result.planting.gains.items()
    plantable = repertoire.plantable(name)
    if result.first != plantable.effect:
        return []
    label = repertoire.label(plantable.effect)
    true = {**plantable.shapes, label: abs(gain) if label == "amplitude" else gain}
    stated = result.causes[0].parameters
    return [low <= true[key] <= high for key, (_, low, high) in stated.items() if key in true]


def summarise(results: Sequence[SetVerdict], repertoire: Repertoire) -> dict[str, Any]:
    """All statistics of a run, as they are written to power.json.

    A share has `hits`, `of`, `share` and the 95 % interval `low` to `high`. Sizes are multiples of
    the unit of `scale`. A diagnosis that failed counts as neither right nor "nothing".
    """
    scale = repertoire.scale
    large = partial(_large, visible=scale.visible)
    kinds: dict[str, list[SetVerdict]] = {"clean": [], "single": [], "pair": [], "outside": []}
    for result in results:
        kinds[result.planting.kind].append(result)
    by_name: dict[str, list[SetVerdict]] = {}
    for result in kinds["single"] + kinds["outside"]:
        by_name.setdefault(next(iter(result.planting.gains)), []).append(result)
    visible = [
        result
        for plantable in repertoire.plantables
        if plantable.effect and plantable.effect not in repertoire.hidden
        for result in large(by_name.get(plantable.name, []))
    ]
    confusion = {"none": kinds["clean"]} | {
        plantable.effect or plantable.name: large(by_name[plantable.name])
        for plantable in repertoire.plantables
        if plantable.name in by_name
    }
    return {
        "sets": len(results),
        "scale": asdict(scale),
        "failed": [
            {"rig": result.planting.options, "error": result.error}
            for result in results
            if result.verdict == "failed"
        ],
        "false_alarms": share(result.verdict != "nothing" for result in kinds["clean"]),
        "right_first": share(map(named_right, visible)),
        "right_first_above_noise": share(map(named_right, filter(above_noise, visible))),
        "right_alone": share(named_right(result) and len(result.causes) == 1 for result in visible),
        "pairs": _pairs(kinds["pair"], by_name),
        "unexplained": share(result.verdict == "unexplained" for result in large(kinds["outside"])),
        "coverage": _coverage(kinds["single"], repertoire),
        "effects": _by_effect(by_name, repertoire),
        "outside": _outside(by_name, repertoire),
        "confusion": {
            row: dict(Counter(result.first for result in sets)) for row, sets in confusion.items()
        },
        "wrong": [
            {"rig": result.planting.options, "said": [cause.effect for cause in result.causes]}
            for result in results
            if result.causes and not named_right(result)
        ],
        "partly_right": share(named_in_part(result) for result in results if result.parts),
        "partly_wrong": [
            {"rig": result.planting.options, "said": [group[0] for group in result.parts]}
            for result in results
            if result.parts and not named_in_part(result)
        ],
    }


def _coverage(results: Iterable[SetVerdict], repertoire: Repertoire) -> dict[str, Any]:
    return share(held for result in results for held in intervals_cover(result, repertoire))


def _by_effect(by_name: dict[str, list[SetVerdict]], repertoire: Repertoire) -> dict[str, Any]:
    return {
        plantable.effect: {
            "rig": plantable.name,
            "size": repertoire.size(plantable),
            "unit": plantable.unit,
            "hidden": plantable.effect in repertoire.hidden,
            "right_first": {
                size: share(map(named_right, sets))
                for size, sets in _by_size(by_name[plantable.name]).items()
            },
            "coverage": _coverage(by_name[plantable.name], repertoire),
        }
        for plantable in repertoire.plantables
        if plantable.effect and plantable.name in by_name
    }


def _outside(by_name: dict[str, list[SetVerdict]], repertoire: Repertoire) -> dict[str, Any]:
    return {
        plantable.name: {
            "size": repertoire.size(plantable),
            "unit": plantable.unit,
            "verdicts": {
                size: dict(Counter(result.verdict for result in sets))
                for size, sets in _by_size(by_name[plantable.name]).items()
            },
        }
        for plantable in repertoire.plantables
        if not plantable.effect and plantable.name in by_name
    }


def _pairs(pairs: Sequence[SetVerdict], by_name: dict[str, list[SetVerdict]]) -> dict[str, Any]:
    """Shares of pairs; those `seen_alone` have effects that mostly are found alone, as large."""

    def seen(name: str, multiple: float) -> bool:
        alone = [result for result in by_name.get(name, []) if result.planting.multiple == multiple]
        return 2 * sum(map(named_right, alone)) > len(alone)

    return {
        "both": share(map(named_all, pairs)),
        "both_seen_alone": share(
            named_all(pair)
            for pair in pairs
            if all(seen(name, pair.planting.multiple) for name in pair.planting.gains)
        ),
    }


def _large(results: Sequence[SetVerdict], visible: float) -> list[SetVerdict]:
    return [result for result in results if result.planting.multiple >= visible]


def _by_size(results: Sequence[SetVerdict]) -> dict[str, list[SetVerdict]]:
    sizes = sorted({result.planting.multiple for result in results})
    return {f"{size:g}": [r for r in results if r.planting.multiple == size] for size in sizes}


def named_wrong(result: SetVerdict) -> bool:
    """Whether a cause was named that is not the error of the sheet, nor its stated twin."""
    return any(
        not any(effect and effect in cause.group for effect in result.planting.effects)
        for cause in result.causes
    )


def summarise_sheet(results: Sequence[SetVerdict]) -> list[dict[str, Any]]:
    """Verdict on each set, as it is written to sheet_error.json."""
    return [
        {
            "rig": result.planting.options,
            "wrong": dict(result.planting.gains),
            "verdict": result.verdict,
            "causes": [[cause.effect, *cause.confusable_with] for cause in result.causes],
            "wrong_name": named_wrong(result),
            "error": result.error,
        }
        for result in results
    ]
