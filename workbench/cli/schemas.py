"""JSON Schema of the summaries that commands write.

Shapes that the code declares as dataclasses are read from them. Objects are closed: a key that a
file has and its schema has not is a mistake in one of the two.
"""

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, Union

from workbench.diagnosis.inference.residuals import Dependence
from workbench.diagnosis.inference.sample_errors import Errors
from workbench.diagnosis.inference.timing import LateSignals
from workbench.observers import estimators_of
from workbench.pages.answer import Measure
from workbench.recordings.case import UNKNOWN
from workbench.studies.distance.outcome import SafetyLevel
from workbench.studies.distance.plain import PlainLevel
from workbench.studies.power import following, left_out
from workbench.studies.power.planned import EffectChance
from workbench.studies.power.sensitivity import VerdictChange
from workbench.system.installed import installed_plugins
from workbench.system.parts import FIRST, LARGEST, Condition, StepTracking
from workbench.system.plugins import load
from workbench.system.stopping import COMMAND, END, SPEED
from workbench.system.system import System
from workbench.tuning.validation import Fold

Schema = dict[str, Any]

TEXT: Schema = {"type": "string"}


NAMED: Schema = {"type": "string", "minLength": 1}


FLAG: Schema = {"type": "boolean"}


WHOLE: Schema = {"type": "integer"}


NUMBER: Schema = {"type": "number"}


ANY: Schema = {}


HASH: Schema = {"type": "string", "pattern": "^[0-9a-f]{64}$"}


QUANTITY: Schema = {
    "type": ["number", "string"],
    "pattern": r"^\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)? *\S.*$",
    "description": 'a text with a unit, "4.2 bar"; a number where the unit is 1',
}


PAIR: Schema = {"type": "array", "items": QUANTITY, "minItems": 2, "maxItems": 2}


def closed(entries: Mapping[str, Schema], *, optional: str = "") -> Schema:
    """An object with these entries and no others; those named in `optional` may be missing."""
    missing = optional.split() if optional != "*" else list(entries)
    unknown = set(missing) - set(entries)
    assert not unknown, unknown
    return {
        "type": "object",
        "required": [name for name in entries if name not in missing],
        "properties": dict(entries),
        "additionalProperties": False,
    }


def by_name(schema: Schema) -> Schema:
    """An object whose keys are names of things."""
    return {"type": "object", "additionalProperties": schema}


def listed(schema: Schema) -> Schema:
    """An array of one kind of things."""
    return {"type": "array", "items": schema}


def or_null(schema: Schema) -> Schema:
    """What JSON has null for, where there is none."""
    return {"anyOf": [schema, {"type": "null"}]}


def declared(kind: type, *, nullable: bool = False) -> Schema:
    """A dataclass as JSON has it; with `nullable`, its numbers are null where there are none."""
    hints = typing.get_type_hints(kind)
    entries = {field.name: _typed(hints[field.name]) for field in dataclasses.fields(kind)}
    if nullable:
        entries = {
            name: or_null(entry) if entry == NUMBER else entry for name, entry in entries.items()
        }
    return closed(entries)


def _typed(hint: Any) -> Schema:
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Union, types.UnionType):
        return or_null(_typed(next(kind for kind in inside if kind is not type(None))))
    if origin is typing.Literal:
        return {"enum": list(inside)}
    if origin in (Mapping, dict):
        return by_name(_typed(inside[1]))
    if origin in (Sequence, list) or (origin is tuple and inside[-1] is ...):
        return listed(_typed(inside[0]))
    if origin is tuple:
        return {**listed(_typed(inside[0])), "minItems": len(inside), "maxItems": len(inside)}
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return declared(hint)
    return {str: TEXT, float: NUMBER, int: WHOLE, bool: FLAG}[hint]


# --- what summaries share ---

VERSIONS = {"workbench": TEXT, "commit": or_null(TEXT), "python": TEXT, "packages": by_name(TEXT)}


FMU = closed({"file": TEXT, "model": TEXT, "sha256": HASH})


RUN = closed(
    {
        "command": TEXT,
        "date": {"type": "string", "format": "date-time"},
        "workbench": TEXT,
        "commit": or_null(TEXT),
        "system": TEXT,
        "title": TEXT,
        "data": by_name(or_null(HASH)),
    }
)


MEASURES = by_name(declared(Measure))


ANSWER = closed({"sentence": NAMED, "headline": MEASURES, "details": MEASURES})


ERROR = or_null(NUMBER)


BOTH = closed({"before": NUMBER, "after": NUMBER})


VALUE = closed({"value": NUMBER, "unit": TEXT})


INTERVAL = closed({"value": NUMBER, "low": NUMBER, "high": NUMBER, "unit": TEXT})


SHARE = closed({"hits": WHOLE, "of": WHOLE, "share": ERROR, "low": NUMBER, "high": NUMBER})


def summary(command: str, provenance: Schema, entries: Mapping[str, Schema]) -> Schema:
    """Of the summary that a command writes."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"what 'workbench {command}' writes",
        **closed({"answer": ANSWER, "provenance": provenance, **entries}),
    }


def _file(title: str, schema: Schema) -> Schema:
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **schema}


def gains_schema(system: System) -> Schema:
    """Of a `gains.toml` for an estimator of a system."""
    names = [name for name, kind in estimators_of(system).items() if kind.tunable]
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
    conditions = {condition.name: _condition(condition) for condition in system.conditions}
    unsaid = " ".join(condition.name for condition in system.conditions if condition.sets)
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


def _condition(condition: Condition) -> Schema:
    """Of what was set before a recording; nobody need know it, but for a sign."""
    known = _known_condition(condition)
    return known if condition.sign else {"anyOf": [known, {"const": UNKNOWN}]}


def _known_condition(condition: Condition) -> Schema:
    about = {"description": condition.label}
    if not condition.choices:
        return about | {
            "type": "string",
            "pattern": r"^\s*[-+0-9.eE]+ \S+",
            "$comment": condition.unit,
        }
    choice: Schema = {"enum": list(condition.choices)}
    if not condition.count:
        return about | choice
    return about | {
        "type": "array",
        "items": choice,
        "minItems": condition.count,
        "maxItems": condition.count,
    }


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
        "plugin": NAMED,
        "companion": {**NAMED, "deprecated": True, "description": "the name of 'plugin' until 0.1"},
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
    sets = listed(closed({**one, "changed": listed(declared(VerdictChange))}))
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
    entries = {"sizes": listed(NUMBER), "effects": listed(declared(EffectChance))}
    return summary("power --plan", _SETS, entries)


def summaries() -> dict[str, Schema]:
    """Schema of each summary, by the command that writes it, also those of plugins."""
    own = {
        "simulate": _simulate(),
        "tune": _tune(),
        "diagnose": _diagnose(),
        "observability": _observability(),
        **power_summaries(),
        "next": _next(),
        "distance": _distance(),
        "monitor": _monitor(),
        "fleet": _fleet(),
        "bench": _bench(),
    }
    for plugin in installed_plugins():
        own |= {command: made() for command, made in (load(plugin.summaries) or {}).items()}
    return own


def _simulate() -> Schema:
    score = {
        "type": "object",
        "required": ["z", "outcome", "reason", "seconds"],
        "properties": {
            "z": ERROR,
            "outcome": TEXT,
            "reason": TEXT,
            "seconds": {"type": "number", "minimum": 0},
        },
        # Of the judged signal, whatever its name.
        "patternProperties": {r"_rms_|_nrmse$": ERROR},
        "additionalProperties": False,
    }
    texts = {"title": TEXT, "doubts": listed(TEXT), "reference": or_null(TEXT)}
    numbers = {"contradicted": by_name(NUMBER)}
    case = closed({**texts, **numbers, "estimators": by_name(score)})
    meanings = by_name(by_name(closed({"text": TEXT, "unit": TEXT})))
    provenance = {
        **closed({"run": RUN, **VERSIONS, "fmu": FMU, "meanings": meanings}),
        "additionalProperties": {"type": "object"},  # other models, settings of each estimator
    }
    entries = {"weights": by_name(NUMBER), "cases": by_name(case)}
    return summary("simulate", provenance, entries)


def _tune() -> Schema:
    of_gain = {name: NUMBER for name in ("value", "reasoned", "lower", "upper")}
    gain = closed(
        {"meaning": TEXT, "unit": TEXT, **of_gain, "at_bound": FLAG, "as_good": listed(NUMBER)}
    )
    changes = {name: ERROR for name in ("less", "more", "without")}
    counts = ("generations", "candidates", "crashed", "folds", "as_good", "last")
    work = {name: WHOLE for name in counts}
    work |= {"seconds": NUMBER, "saved": NUMBER, "interrupted": FLAG, "converged": FLAG}
    provenance = closed(
        {
            "run": RUN,
            **{name: version for name, version in VERSIONS.items() if name != "commit"},
            "system": TEXT,
            "fmu": FMU,
            "cases": listed(TEXT),
            "scale_errors": by_name(NUMBER),
            "weights": by_name(NUMBER),
            "judged_by": TEXT,
            "seed": WHOLE,
            "population": WHOLE,
        }
    )
    entries = {
        "estimator": TEXT,
        "label": TEXT,
        "judged": TEXT,
        "bandwidth": ERROR,
        "follows": or_null(declared(StepTracking)),
        "z": NUMBER,
        "z_reasoned": NUMBER,
        "cases": by_name(closed({"z_k": NUMBER, "z_k_reasoned": NUMBER, "unstable": WHOLE})),
        "gains": by_name(gain),
        "sensitivity": by_name(closed({**changes, "matters": FLAG})),
        "folds": listed(declared(Fold, nullable=True)),
        "beside": by_name(closed({"label": TEXT, "z": ERROR, "worst": TEXT})),
        "work": closed(work),
        "convergence": listed(NUMBER),
    }
    return summary("tune", provenance, entries)


def _diagnose() -> Schema:
    cause = closed(
        {
            "effect": TEXT,
            "text": TEXT,
            "parameters": by_name(INTERVAL),
            "phases": or_null(listed(NUMBER)),
            "confusable_with": listed(TEXT),
            "explained": NUMBER,
            "separation": TEXT,
        }
    )
    of_band = {name: NUMBER for name in ("value", "low", "high")}
    estimate = closed({**of_band, "unit": TEXT, "inside": ERROR})
    ends = {name: NUMBER for name in ("before", "after")}
    gain = {"measure": TEXT, **ends, "low": NUMBER, "high": NUMBER, "recordings": by_name(BOTH)}
    candidate = {
        "effect": TEXT,
        "shape": by_name(NUMBER),
        "size": NUMBER,
        "sigma": ERROR,
        "unit": TEXT,
        "shape_units": by_name(TEXT),
        "gain": NUMBER,
        "held_out": NUMBER,
    }
    step = {"before": NUMBER, "rivals": listed(closed({"effect": TEXT, "misfit": NUMBER}))}
    matrix = listed(listed(NUMBER))
    model = {"modelica": or_null(TEXT), "fmu": or_null(TEXT), "difference_from_fit": ERROR}
    entries = {
        "verdict": {"enum": ["nothing", "found", "unexplained"]},
        "sentence": NAMED,
        "interrupted": FLAG,
        "doubts": by_name(listed(TEXT)),
        "causes": listed(cause),
        "gain": or_null(closed(gain)),
        "model": closed(model),
        "partial": listed(TEXT),
        "late": or_null(declared(LateSignals)),
        "lasting_errors": by_name(BOTH),
        "dependences": listed(declared(Dependence)),
        "confusability": closed({"effects": listed(TEXT), "cosines": matrix}),
        "candidates": listed(closed(candidate)),
        "steps": listed(closed(step)),
        "not_visible": by_name(TEXT),
        "levels": by_name(VALUE),
        "deviations": by_name(by_name(NUMBER)),
        "set_aside": by_name(by_name(WHOLE)),
        "channels": by_name(TEXT),
        "errors": listed(declared(Errors)),
        "start_values": by_name(by_name(NUMBER)),
        "observers": by_name(by_name(closed({"before": ERROR, "after": ERROR}))),
        "smoothed": or_null(closed({"recording": TEXT, "models": by_name(by_name(estimate))})),
        "rivals": or_null(_rivals(matrix)),
        "certainty": or_null(_certainty(matrix)),
        "cases": listed(TEXT),
    }
    provenance = {"run": RUN, "workbench": TEXT, "system": TEXT, "model": FMU}
    return summary("diagnose", closed({**provenance, "effects": listed(TEXT)}), entries)


def _certainty(matrix: Schema) -> Schema:
    starts = {"behind": listed(ERROR), "same": WHOLE, "lower": NUMBER, "sentence": TEXT}
    certainty = {
        "unknowns": listed(TEXT),
        "correlations": matrix,
        "likelihood": by_name(closed({"low": ERROR, "high": ERROR})),
        "starts": closed(starts),
    }
    return closed(certainty)


def _rivals(matrix: Schema) -> Schema:
    numbers = listed(NUMBER)
    recording = {
        "errors": numbers,
        "common": matrix,
        "own": matrix,
        "deviations": numbers,
        "furthest": numbers,
    }
    rival = {
        "effects": listed(TEXT),
        "sizes": listed({"type": "array"}),
        "levels": listed({"type": "array"}),
        "recordings": listed(closed(recording)),
        "prior": closed({"matrix": matrix, "gradient": numbers, "constant": NUMBER}),
        "explained": NUMBER,
    }
    rivals = {
        "models": listed(closed(rival)),
        "effects": listed(TEXT),
        "given": by_name(NUMBER),
        "signals": listed(TEXT),
        "inflation": numbers,
    }
    return closed(rivals)


def _observability() -> Schema:
    numbers = by_name(NUMBER)
    model = {name: or_null(numbers) for name in ("useful", "median_bound", "states_observable")}
    case = {
        **closed({"title": TEXT, "judged_windows": WHOLE, "models": by_name(closed(model))}),
        "patternProperties": {"^median_": ERROR},
    }
    state = closed({"at": NUMBER, "scale": NUMBER, "remaining": NUMBER})
    linear = {
        "observable": FLAG,
        "rank": WHOLE,
        "states": by_name(state),
        "information": listed(NUMBER),
        "unobservable": listed(TEXT),
        "invisible": listed(TEXT),
    }
    entries = {
        "operating_point": closed(
            {"inputs": numbers, "held": by_name(TEXT), "quantities": numbers}
        ),
        "noise": by_name(closed({"absolute": NUMBER, "relative": NUMBER})),
        "window_s": NUMBER,
        "stride_s": NUMBER,
        "prior": numbers,
        "useful": numbers,
        "linear": by_name(closed(linear)),
        "cases": by_name(case),
    }
    provenance = closed({"run": RUN, **VERSIONS, "fmus": listed(FMU)})
    return summary("observability", provenance, entries)


def _next() -> Schema:
    profile = closed({"profile": TEXT, "levels": listed(NUMBER), "every": NUMBER})
    tried = closed(
        {
            "experiment": TEXT,
            "groups": listed(listed(WHOLE)),
            "separation": NUMBER,
            "chance": NUMBER,
            "separations": listed(listed(NUMBER)),
            "deviation": BOTH,
            "cost": VALUE,
            "duration": NUMBER,
            "inputs": by_name(profile),
            "conditions": by_name(ANY),
            "settings": by_name(ANY),
        }
    )
    entries = {
        "sentence": NAMED,
        "rivals": listed(TEXT),
        "parts": FLAG,
        "tried": {**listed(tried), "minItems": 1},
        "sensors": by_name(tried),
    }
    provenance = {"run": RUN, "workbench": TEXT, "system": TEXT, "diagnosis": TEXT}
    return summary("next", closed(provenance), entries)


def _distance() -> Schema:
    entries = {
        "sentence": NAMED,
        "asked": by_name(NUMBER),
        "conditions": by_name(ANY),
        "distance": by_name(NUMBER),
        "deceleration": NUMBER,
        "response": NUMBER,
        "nominal": closed({"distance": NUMBER, "deceleration": NUMBER}),
        "outside": ANY,
        "width": NUMBER,
        "safety": or_null(listed(declared(SafetyLevel))),
        "plain": or_null(closed({"samples": WHOLE, "levels": listed(declared(PlainLevel))})),
        "stops": listed({"type": "object", "required": ["stop", "held"]}),
        "held": closed({"of": WHOLE, "stops": WHOLE}),
        "warnings": listed(TEXT),
        "interrupted": FLAG,
    }
    provenance = {"run": RUN, **VERSIONS, "system": TEXT, "models": by_name(FMU), "seed": WHOLE}
    return summary("distance", closed(provenance), entries)


def _monitor() -> Schema:
    numbers = ("level", "standard_error", "trend_by_recording", "trend_standard_error", "scatter")
    quantity = {"label": TEXT, "unit": TEXT, **{name: ERROR for name in numbers}, "told_in": WHOLE}
    worn = {"label": TEXT, "work": NUMBER, "of_the_mean": NUMBER}
    entries = {
        "sentences": listed(NAMED),
        "recordings": WHOLE,
        "order": {"enum": ["dates", "names"]},
        "first": NAMED,
        "last": NAMED,
        "rate": NUMBER,
        "threshold": NUMBER,
        "alarms": listed({"type": "object", "required": ["told_at", "quantity", "change"]}),
        "quantities": by_name(closed(quantity)),
        "work": by_name(closed(worn)),
        "refused": by_name(TEXT),
        "again": by_name(TEXT),
        "interrupted": FLAG,
    }
    provenance = {"run": RUN, **VERSIONS, "system": TEXT, "fmu": FMU}
    return summary("monitor", closed(provenance), entries)


def _fleet() -> Schema:
    machine = {"machine": NAMED, "recordings": WHOLE, "alarms": WHOLE, "refusal": TEXT}
    entries = {
        "recordings": WHOLE,
        "seconds": NUMBER,
        "machines": listed(closed(machine)),
        "interrupted": FLAG,
    }
    provenance = {"run": RUN, **VERSIONS, "system": TEXT, "fmu": FMU}
    return summary("monitor --fleet", closed(provenance), entries)


def _bench() -> Schema:
    ratios = {"ratios": by_name(NUMBER)}
    wholes = dict.fromkeys(("states", "inputs"), WHOLE)
    spent = ("derivatives", "derivatives_fmi", "nonzeros", "jacobian", "jacobian_fmi", "step")
    call = {"unit": TEXT, **wholes, **dict.fromkeys((*spent, "steps_per_second"), NUMBER)}
    observer = {
        "observer": TEXT,
        "states": WHOLE,
        **dict.fromkeys(("step", "times_real_time", "long"), NUMBER),
        "by_rate": by_name(NUMBER),
        **dict.fromkeys(("fmpy", "c"), or_null(NUMBER)),
    }
    processes = {"cases": WHOLE, "one": NUMBER, "two": NUMBER, "peak_memory": WHOLE}
    horizon = {"unknowns": WHOLE, "samples": WHOLE, "ours": NUMBER, "ipopt": NUMBER}
    observers = {
        "case": TEXT,
        "steps": listed(closed(observer)),
        "processes": closed(processes),
        "compilation": by_name(NUMBER),
        "horizon": closed({**horizon, **ratios}),
    }
    evaluation = {"estimator": TEXT, "steps": WHOLE, "ours": NUMBER, "fmpy": NUMBER, "z": NUMBER}
    workers = {"cases": WHOLE, "candidates": WHOLE, "one": NUMBER, "two": NUMBER}
    tuning = {
        "case": TEXT,
        "evaluations": listed(closed({**evaluation, **ratios})),
        "workers": closed({**workers, "dask": or_null(NUMBER), **ratios}),
        "memory": closed(dict.fromkeys(("master", "worker", "total"), WHOLE)),
    }
    entries = {
        "machine": closed({"processor": TEXT, "system": TEXT}),
        "seed": WHOLE,
        "calls": by_name(closed({**call, **ratios})),
        "observers": closed(observers),
        "tuning": closed(tuning),
    }
    return summary("bench", closed({"run": RUN}), entries)
