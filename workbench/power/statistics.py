"""How often the diagnosis was right, with intervals, from verdicts on sets that hide something."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import fields
from itertools import permutations
from typing import Any

from scipy.stats import binomtest

from workbench.diagnosis import Effect
from workbench.power.journal import Judged
from workbench.power.planting import BY_NAME, PLANTABLE
from workbench.rig import Effects

VISIBLE = 2.0  # times the size that matters: beyond what tolerances may hide
CLEAR = 4.0  # standard deviations that a size must have to be more than noise
_UNITS = {one.name: one.metadata["unit"] for one in fields(Effects)}


def share(outcomes: Iterable[bool]) -> dict[str, Any]:
    """Hits, trials, their ratio and its 95 % interval.

    The interval is that of C. J. Clopper and E. S. Pearson (1934), Biometrika 26, 404-413: it
    covers in at least 95 %, however few trials there are.

    >>> found = share([False] * 10)
    >>> found["share"], found["low"], round(found["high"], 4)
    (0.0, 0.0, 0.3085)
    """
    values = list(outcomes)
    hits, of = sum(values), len(values)
    if not of:
        return {"hits": 0, "of": 0, "share": None, "low": 0.0, "high": 1.0}
    low, high = binomtest(hits, of).proportion_ci(0.95, method="exact")
    return {"hits": hits, "of": of, "share": hits / of, "low": float(low), "high": float(high)}


def named_right(result: Judged) -> bool:
    """Whether what was planted, or a group that it is in, is named first."""
    return bool(result.causes) and any(
        BY_NAME[name].effect in result.causes[0].group for name in result.planting.gains
    )


def above_noise(result: Judged) -> bool:
    """Whether anything was seen, or could have been: the planted size is clear of its scatter.

    The scatter is the least that any estimate from these stops has, by the noise of their sensors,
    the tolerances of the plant and all other effects at sizes that do not matter.
    """
    return result.verdict != "nothing" or (result.clearness or 0.0) > CLEAR


def named_all(result: Judged) -> bool:
    """Whether each effect that was planted has a cause of its own that is it, or its group."""
    planted = [BY_NAME[name].effect for name in result.planting.gains]
    return any(
        all(effect in cause.group for effect, cause in zip(planted, chosen, strict=True))
        for chosen in permutations(result.causes, len(planted))
    )


def intervals_cover(result: Judged, effects: Sequence[Effect]) -> list[bool]:
    """For each interval of the planted effect, if it was named first: whether it holds the truth.

    A size within the interval of its twin is no claim, and is not judged.
    """
    ((name, gain),) = result.planting.gains.items()
    plantable = BY_NAME[name]
    if result.first != plantable.effect:
        return []
    label = next(one.label for one in effects if one.name == plantable.effect)
    true = {**plantable.shapes, label: abs(gain) if label == "amplitude" else gain}
    stated = result.causes[0].parameters
    return [low <= true[key] <= high for key, (_, low, high) in stated.items() if key in true]


def summarise(results: Sequence[Judged], effects: Sequence[Effect]) -> dict[str, Any]:
    """All statistics of a run, as they are written to power.json.

    A share has `hits`, `of`, `share` and the 95 % interval `low` to `high`. Sizes are multiples of
    the size that matters. A diagnosis that failed counts as neither right nor "nothing".
    """
    hidden = {effect.name for effect in effects if effect.hidden}
    kinds: dict[str, list[Judged]] = {"clean": [], "single": [], "pair": [], "outside": []}
    for result in results:
        kinds[result.planting.kind].append(result)
    by_name: dict[str, list[Judged]] = {}
    for result in kinds["single"] + kinds["outside"]:
        by_name.setdefault(next(iter(result.planting.gains)), []).append(result)
    known = [one for one in PLANTABLE if one.effect and one.name in by_name]
    visible = [
        result
        for one in known
        if one.effect not in hidden
        for result in by_name[one.name]
        if result.planting.multiple >= VISIBLE
    ]
    confusion = {"none": kinds["clean"]} | {
        one.effect or one.name: _large(by_name[one.name])
        for one in PLANTABLE
        if one.name in by_name
    }
    return {
        "sets": len(results),
        "failed": [
            {"rig": one.planting.options, "error": one.error}
            for one in results
            if one.verdict == "failed"
        ],
        "false_alarms": share(one.verdict != "nothing" for one in kinds["clean"]),
        "right_first": share(map(named_right, visible)),
        "right_first_above_noise": share(map(named_right, filter(above_noise, visible))),
        "right_alone": share(named_right(one) and len(one.causes) == 1 for one in visible),
        "pairs": _pairs(kinds["pair"], by_name),
        "unexplained": share(
            one.verdict == "unexplained"
            for one in kinds["outside"]
            if one.planting.multiple >= VISIBLE
        ),
        "coverage": share(
            held for one in kinds["single"] for held in intervals_cover(one, effects)
        ),
        "effects": {
            one.effect: {
                "rig": one.name,
                "size": one.size(effects),
                "unit": _UNITS[one.name],
                "hidden": one.effect in hidden,
                "right_first": {
                    size: share(map(named_right, some))
                    for size, some in _by_size(by_name[one.name]).items()
                },
                "coverage": share(
                    held
                    for result in by_name[one.name]
                    for held in intervals_cover(result, effects)
                ),
            }
            for one in known
        },
        "outside": {
            one.name: {
                "size": one.size(effects),
                "unit": _UNITS[one.name],
                "verdicts": {
                    size: dict(Counter(result.verdict for result in some))
                    for size, some in _by_size(by_name[one.name]).items()
                },
            }
            for one in PLANTABLE
            if not one.effect and one.name in by_name
        },
        "confusion": {
            row: dict(Counter(one.first for one in some)) for row, some in confusion.items()
        },
        "wrong": [
            {"rig": one.planting.options, "said": [cause.effect for cause in one.causes]}
            for one in results
            if one.causes and not named_right(one)
        ],
    }


def _pairs(pairs: Sequence[Judged], by_name: dict[str, list[Judged]]) -> dict[str, Any]:
    """Shares of pairs; those `seen_alone` have effects that mostly are found alone, as large."""

    def seen(name: str, multiple: float) -> bool:
        alone = [one for one in by_name.get(name, []) if one.planting.multiple == multiple]
        return 2 * sum(map(named_right, alone)) > len(alone)

    return {
        "both": share(map(named_all, pairs)),
        "both_seen_alone": share(
            named_all(one)
            for one in pairs
            if all(seen(name, one.planting.multiple) for name in one.planting.gains)
        ),
    }


def _large(results: Sequence[Judged]) -> list[Judged]:
    return [one for one in results if one.planting.multiple >= VISIBLE]


def _by_size(results: Sequence[Judged]) -> dict[str, list[Judged]]:
    sizes = sorted({one.planting.multiple for one in results})
    return {f"{size:g}": [r for r in results if r.planting.multiple == size] for size in sizes}
