"""JSON Schema of the summaries of `workbench power`: of its sets, and of each of its questions."""

from workbench.power import following, left_out
from workbench.power.planned import Foreseen
from workbench.power.sensitivity import Changed
from workbench.schemas.words import (
    FLAG,
    NUMBER,
    RUN,
    SHARE,
    TEXT,
    WHOLE,
    Schema,
    by_name,
    closed,
    declared,
    listed,
    or_null,
    summary,
)


def power_summaries() -> dict[str, Schema]:
    """Schema of each, by what was asked."""
    return {
        "power": _power(),
        "thresholds": _thresholds(),
        "sheet_error": _sheet_error(),
        "left_out": _left_out(),
        "plan": _plan(),
        "followed": _followed(),
    }


_SETS = closed(
    {"run": RUN, "workbench": TEXT, "seed": WHOLE, "stops": listed(TEXT), "interrupted": FLAG}
)


def _power() -> Schema:
    shares = ("false_alarms", "right_first", "right_first_above_noise", "right_alone")
    effect = {"rig": TEXT, "size": NUMBER, "unit": TEXT, "hidden": FLAG}
    outside = {"size": NUMBER, "unit": TEXT, "verdicts": by_name(by_name(WHOLE))}
    entries = {
        "sets": WHOLE,
        "failed": listed(closed({"rig": TEXT, "error": TEXT})),
        **{name: SHARE for name in (*shares, "unexplained", "coverage")},
        "pairs": closed({"both": SHARE, "both_seen_alone": SHARE}),
        "effects": by_name(closed({**effect, "right_first": by_name(SHARE), "coverage": SHARE})),
        "outside": by_name(closed(outside)),
        "confusion": by_name(by_name(WHOLE)),
        "wrong": listed(closed({"rig": TEXT, "said": listed(TEXT)})),
    }
    return summary("power", _SETS, entries)


def _thresholds() -> Schema:
    one = {"rig": TEXT, "kind": TEXT, "planted": listed(TEXT), "said": listed(TEXT)}
    sets = listed(closed({**one, "changed": listed(declared(Changed))}))
    return summary("power --thresholds", _SETS, {"usual": by_name(NUMBER), "sets": sets})


def _sheet_error() -> Schema:
    one = {"rig": TEXT, "wrong": by_name(NUMBER), "verdict": TEXT, "error": TEXT}
    one |= {"causes": listed(listed(TEXT)), "wrong_name": FLAG}
    return summary("power --sheet-error", _SETS, {"sets": listed(closed(one))})


def _left_out() -> Schema:
    texts = {name: listed(TEXT) for name in ("left_out", "named", "late", "laws", "slots")}
    ends = {
        name: or_null(NUMBER) for name in ("before", "after", "after_with_it", "function_error")
    }
    one = {
        "rig": TEXT,
        "verdict": TEXT,
        "error": TEXT,
        **texts,
        "asked": FLAG,
        "slot_right": or_null(FLAG),
        **dict.fromkeys(ends, or_null(NUMBER)),
    }
    shares = {name: SHARE for name in left_out.SHARES}
    return summary("power --leave-out-effect", _SETS, {**shares, "sets": listed(closed(one))})


def _followed() -> Schema:
    away = closed({"from": TEXT, "predicted": NUMBER, "shown": or_null(NUMBER)})
    texts = {name: TEXT for name in ("experiment", "verdict")}
    flags = {name: FLAG for name in ("foreseen", "parts")}
    said = {**texts, **flags, "named": listed(TEXT), "separations": listed(away)}
    made = closed(said)
    one = {
        **{name: TEXT for name in ("rig", "planted", "verdict", "sentence", "error")},
        "multiple": NUMBER,
        **{name: listed(TEXT) for name in ("group", "sensors")},
        "proposed": or_null(made),
        "drawn": listed(made),
        "sensed": or_null(closed({"sensor": TEXT, **said})),
    }
    shares = {name: SHARE for name in following.SHARES}
    return summary("power --follow", _SETS, {**shares, "sets": listed(closed(one))})


def _plan() -> Schema:
    entries = {"sizes": listed(NUMBER), "effects": listed(declared(Foreseen))}
    return summary("power --plan", _SETS, entries)
