"""JSON Schema of the files that people write: system, case, gains."""

from workbench.conditions import UNKNOWN
from workbench.observers import estimators
from workbench.schemas.words import (
    FLAG,
    NAMED,
    NUMBER,
    PAIR,
    QUANTITY,
    TEXT,
    Schema,
    by_name,
    closed,
    listed,
)
from workbench.system import System
from workbench.system_conditions import FIRST, LARGEST, Condition
from workbench.system_distance import COMMAND, END, SPEED


def _file(title: str, schema: Schema) -> Schema:
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **schema}


def gains_schema(system: System) -> Schema:
    """Of a `gains.toml` for an estimator of a system."""
    names = [name for name, kind in estimators(system).items() if kind.tunable]
    entries = {
        "estimator": {"enum": names},
        "gains": {**by_name(NUMBER), "minProperties": 1},
        "design": by_name(listed(NUMBER)),
        "provenance": {"type": "object"},
    }
    title = f"gains.toml of {system.name}"
    return _file(title, closed(entries, optional="design provenance"))


def case_schema(system: System) -> Schema:
    """Of the `case.toml` of a system."""
    conditions = {one.name: _condition(one) for one in system.conditions}
    unsaid = " ".join(one.name for one in system.conditions if one.sets)
    columns = closed(dict.fromkeys(("time", *system.signals), _COLUMN), optional="*")
    measurement = {
        "file": {**NAMED, "description": "recording in this folder"},
        "columns": columns,
        "counts_from": {**TEXT, "description": "time with unit"},
    }
    entries = {
        "title": NAMED,
        "date": {**TEXT, "description": "when it was recorded, ISO 8601"},
        "measurement": closed(measurement, optional="columns counts_from"),
        "conditions": closed(conditions, optional=unsaid),
        "model": closed({"names": by_name(NAMED)}, optional="names"),
    }
    title = f"case.toml of {system.name}: {system.title}"
    optional = "date model" if conditions else "date model conditions"
    return _file(title, closed(entries, optional=optional))


_COLUMN = {
    "type": ["string", "object"],
    "required": ["channel"],
    "properties": {"channel": NAMED, "unit": TEXT, "reversed": FLAG},
    "additionalProperties": False,
}


def _condition(one: Condition) -> Schema:
    """Of what was set before a recording; nobody need know it, but for a sign."""
    known = _known_condition(one)
    return known if one.sign else {"anyOf": [known, {"const": UNKNOWN}]}


def _known_condition(one: Condition) -> Schema:
    about = {"description": one.label}
    if not one.choices:
        return about | {"type": "string", "pattern": r"^\s*[-+0-9.eE]+ \S+", "$comment": one.unit}
    choice: Schema = {"enum": list(one.choices)}
    if not one.count:
        return about | choice
    return about | {"type": "array", "items": choice, "minItems": one.count, "maxItems": one.count}


def system_schema() -> Schema:
    """Of every `system.toml`."""
    formula = {**NAMED, "description": "a formula of signals and parameters, SI"}
    quantities, formulas = by_name(QUANTITY), by_name(formula)
    level = closed({"signal": NAMED, "above": QUANTITY})
    below = closed({"signal": NAMED, "below": QUANTITY})
    made = closed({"is": formula, "unit": TEXT})
    measured = by_name(_measured(made))
    point = {"inputs": quantities, "held": formulas, "quantities": quantities}
    points = {
        "settles": QUANTITY,
        **dict.fromkeys(("design", "tested"), closed(point, optional="*")),
    }
    derived = by_name(closed({"is": formula, "unit": TEXT, "label": TEXT}, optional="label"))
    feedback = {
        "fades": closed({"signal": NAMED, "half": QUANTITY}),
        "rolls": closed(dict.fromkeys(("follower", "leader", "zero"), NAMED)),
        "learns": QUANTITY,
    }
    follows = closed({"quantity": NAMED, "within": QUANTITY, "left": QUANTITY})
    cutting = {"begins": level, "ends": below}
    cutting |= dict.fromkeys(("released", "before", "after"), QUANTITY)
    figure = {"title": NAMED, "note": TEXT, "signals": listed(NAMED)}
    figure |= dict.fromkeys(("height", "low", "high"), QUANTITY)
    start = closed(point, optional="*")
    entries = {
        "name": NAMED,
        "title": NAMED,
        "companion": NAMED,
        "reported": listed(NAMED),
        "models": {**by_name(closed({"class": NAMED, "fmu": NAMED}, optional="fmu"))},
        "parameters": quantities,
        "inputs": measured,
        "outputs": {**measured, "minProperties": 1},
        "judged": measured,
        "aids": measured,
        "derived": derived,
        "estimated": by_name(_estimated()),
        "states": by_name(closed({"walk": QUANTITY, "spread": QUANTITY}, optional="*")),
        "feedback": closed(feedback, optional="*"),
        "points": closed(points, optional="*"),
        "conditions": by_name(_condition_kind(formula)),
        "objective": _objective(level),
        "tuning": closed({"follows": follows}, optional="*"),
        "diagnosis": _comparison(formula, level),
        "figures": listed(closed(figure, optional="note height low high")),
        "export": closed({"classes": by_name(NAMED), "start": start}, optional="*"),
        **dict.fromkeys(("shortest", "sample_time"), QUANTITY),
        "fewest": NUMBER,
        "cases": NAMED,
        "sampling": closed({"slowest": QUANTITY, "gaps": PAIR}, optional="*"),
        "redundancies": listed(_redundancy(formula, level, below)),
        "loggers": by_name(listed(TEXT)),
        "next": _experiments(formula, made, measured),
        "cutting": closed(cutting, optional="released before after"),
        "bands": by_name(by_name(NUMBER)),
        "work": by_name(closed({"is": formula, "label": TEXT}, optional="label")),
        "distance": _stopping(formula, level),
    }
    needed = {"title", "models", "outputs", "sample_time"}
    optional = " ".join(name for name in entries if name not in needed)
    return _file("system.toml", closed(entries, optional=optional))


def _redundancy(formula: Schema, level: Schema, below: Schema) -> Schema:
    redundancy = {
        **dict.fromkeys(("reason", "unit"), NAMED),
        **dict.fromkeys(("is", "equals", "stores"), formula),
        "over": QUANTITY,
        "within": PAIR,
        "slack": QUANTITY,
        "only_while": {"anyOf": [level, below]},
    }
    return closed(redundancy, optional="stores over slack only_while")


def _objective(level: Schema) -> Schema:
    objective = {
        "judged": NAMED,
        "weights": by_name(NUMBER),
        "bandwidth": QUANTITY,
        "begins": level,
        "ends": level,
        "when": TEXT,
    }
    return closed(objective, optional="*")


def _measured(made: Schema) -> Schema:
    entries = {
        **dict.fromkeys(("unit", "shown", "label", "reading"), NAMED),
        **dict.fromkeys(("noise", "relative_noise", "relative_error", "scale"), QUANTITY),
        **dict.fromkeys(("scale_error", "resolution"), QUANTITY),
        "mode": closed(dict.fromkeys(("frequency", "damping", "late"), QUANTITY)),
        **dict.fromkeys(("smoothed", "saturates", "plausible", "possible"), PAIR),
        "held": FLAG,
        "called": listed(NAMED),
        "recorded_as": made,
    }
    needed = {"unit", "noise", "scale"}
    return closed(entries, optional=" ".join(name for name in entries if name not in needed))


def _estimated() -> Schema:
    entries = {
        **dict.fromkeys(("correction", "label", "unit", "acts_on"), NAMED),
        **dict.fromkeys(("range", "prior"), PAIR),
        **dict.fromkeys(
            ("walk", "start", "spread", "relative_error", "scatter", "memory", "useful"), QUANTITY
        ),
        "claimed": by_name(TEXT),
        "watched": FLAG,
    }
    needed = {"correction", "range", "walk"}
    return closed(entries, optional=" ".join(name for name in entries if name not in needed))


def _condition_kind(formula: Schema) -> Schema:
    agrees = {"is": formula, "at": {"enum": [FIRST, LARGEST]}, "within": PAIR, "slack": QUANTITY}
    entries = {
        **dict.fromkeys(("label", "unit", "sets"), NAMED),
        **dict.fromkeys(("least", "above", "lasts"), QUANTITY),
        "choices": {"type": "array", "minItems": 1},
        "count": {"type": "integer", "minimum": 1},
        "parameters": by_name(by_name(QUANTITY)),
        **dict.fromkeys(("told", "sign"), FLAG),
        "agrees": closed(agrees, optional="at slack"),
    }
    either = [{"required": ["unit"]}, {"required": ["choices"]}]
    return {**closed(entries, optional="*"), "oneOf": either}


def _comparison(formula: Schema, level: Schema) -> Schema:
    channel = {"is": formula, **dict.fromkeys(("unit", "label", "shown"), NAMED)}
    ways = {"enum": ["value", "size", "rate", "integral", "turn"]}
    influence = {"is": formula, "unit": TEXT, "way": ways}
    leads = {"output": NAMED, "together": listed(NAMED), "ripple": QUANTITY}
    entries = {
        "begins": level,
        "rest": closed({"signal": NAMED, "output": NAMED, "zero": QUANTITY}),
        "leads": closed(leads, optional="together ripple"),
        "channels": by_name(closed(channel, optional="label shown")),
        "tolerances": by_name(NUMBER),
        "levels": by_name(closed({"by": TEXT, "spread": NUMBER}, optional="*")),
        "wander": by_name(closed({"share": NUMBER, "over": QUANTITY})),
        "excluded": listed(_exclusion(formula, level)),
        "influences": by_name(closed(influence, optional="way")),
        **dict.fromkeys(
            ("block", "lasting", "least", "settling", "left", "false_alarms"), QUANTITY
        ),
    }
    return closed(entries, optional="*")


def _exclusion(formula: Schema, level: Schema) -> Schema:
    excluded = {
        "reason": NAMED,
        "is": formula,
        **dict.fromkeys(("above", "below", "within", "smoothed"), QUANTITY),
        **dict.fromkeys(("from_rest", "to_the_end"), FLAG),
        "only_while": level,
        "restarted": listed(NAMED),
        "uncertain": by_name(NUMBER),
    }
    outside = " ".join(name for name in excluded if name not in ("reason", "is"))
    either = [{"required": ["above"]}, {"required": ["below"]}]
    return {**closed(excluded, optional=outside), "oneOf": either}


def _stopping(formula: Schema, level: Schema) -> Schema:
    asked = {
        **dict.fromkeys(("label", "unit", "shown"), NAMED),
        "is": formula,
        "at": {"enum": [COMMAND, END]},
        "usual": QUANTITY,
    }
    driven = {"is": formula, **dict.fromkeys(("delay", "lag"), QUANTITY), "along": FLAG}
    differs = {"of": listed(NAMED), **dict.fromkeys(("spread", "share"), QUANTITY), "unit": NAMED}
    nominal = dict.fromkeys(("mass", "rotating", "resistance"), formula)
    nominal |= {"reference": QUANTITY, "within": QUANTITY, "speeds": listed(QUANTITY)}
    constants = by_name({"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2})
    either = [{"required": ["spread"]}, {"required": ["share"]}]
    entries = {
        "speed": formula,
        **dict.fromkeys(("state", "timed_by"), NAMED),
        **dict.fromkeys(("rest", "longest"), QUANTITY),
        "asked": {**by_name(closed(asked, optional="label shown at")), "required": [SPEED]},
        "inputs": by_name(closed(driven, optional="delay lag along")),
        "start": by_name(formula),
        "differs": listed({**closed(differs, optional="spread share unit"), "oneOf": either}),
        "outside": listed(_exclusion(formula, level)),
        "nominal": closed(nominal),
        "rating": closed({"label": NAMED, "constants": constants}),
    }
    return closed(entries, optional="differs outside nominal rating")


def _experiments(formula: Schema, made: Schema, measured: Schema) -> Schema:
    profiles = {"type": "array", "items": {"enum": ["step", "staircase", "sine", "release"]}}
    varied = {
        "range": PAIR,
        "profiles": profiles,
        **dict.fromkeys(("begins", "every"), QUANTITY),
        "lags": listed(QUANTITY),
    }
    follows = closed(varied, optional="profiles begins lags")
    besides = {"label": NAMED, "unit": NAMED, "values": listed(QUANTITY)}
    entries = {
        "lasts": QUANTITY,
        "ends": closed({"is": formula, "below": QUANTITY}),
        "conditions": by_name({"type": "array", "minItems": 1}),
        "settings": by_name(closed(besides, optional="label")),
        "start": by_name(formula),
        "inputs": by_name({"anyOf": [follows, closed({"is": formula})]}),
        "cost": {**made, "required": []},
        "sensors": measured,
    }
    return closed(entries, optional="ends conditions settings start inputs cost sensors")
