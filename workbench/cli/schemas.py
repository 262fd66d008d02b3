"""JSON Schema of the summaries that commands write.

Shapes that the code declares as dataclasses are read from them. Objects are closed: a key that a
file has and its schema has not is a mistake in one of the two.
"""

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, Union

from workbench.diagnosis.inference.nuisance import ShiftedLevel
from workbench.diagnosis.inference.residuals import Dependence
from workbench.diagnosis.inference.sample_errors import Errors
from workbench.diagnosis.inference.timing import LateSignals
from workbench.diagnosis.inference.verdict import NearestCandidate
from workbench.observers import estimators_of
from workbench.observers.trust import Contradiction
from workbench.pages.answer import Measure
from workbench.recordings.case import UNKNOWN
from workbench.studies.distance.outcome import SafetyLevel
from workbench.studies.distance.plain import PlainLevel
from workbench.studies.fit.outcome import LOSSES, FittedValue
from workbench.studies.power import following, left_out
from workbench.studies.power.campaign import EffectChance, EffectLimit
from workbench.studies.power.sensitivity import VerdictChange
from workbench.system.installed import installed_plugins
from workbench.system.parts import Condition, StepTracking
from workbench.system.plugins import load
from workbench.system.reference import schema
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


def declared(cls: type, *, nullable: bool = False) -> Schema:
    """A dataclass or TypedDict as JSON has it; `nullable` numbers are null where there are none."""
    entries = {name: _schema_of(hint) for name, hint in typing.get_type_hints(cls).items()}
    if nullable:
        entries = {
            name: or_null(entry) if entry == NUMBER else entry for name, entry in entries.items()
        }
    return closed(entries)


def _schema_of(hint: Any) -> Schema:
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Union, types.UnionType):
        return or_null(_schema_of(next(part for part in inside if part is not type(None))))
    if origin is typing.Literal:
        return {"enum": list(inside)}
    if origin in (Mapping, dict):
        return by_name(_schema_of(inside[1]))
    if origin in (Sequence, list) or (origin is tuple and inside[-1] is ...):
        return listed(_schema_of(inside[0]))
    if origin is tuple:
        size = len(inside)
        return {**listed(_schema_of(inside[0])), "minItems": size, "maxItems": size}
    if typing.is_typeddict(hint) or dataclasses.is_dataclass(hint):
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
    names = [name for name, cls in estimators_of(system).items() if cls.tunable]
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
        "model_time": {**TEXT, "description": "time with unit"},
    }
    entries = {
        "title": NAMED,
        "date": {**TEXT, "description": "when it was recorded, ISO 8601"},
        "measurement": closed(measurement, optional="columns counts_from model_time"),
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
    return _file("system.toml", schema(System))


def power_summaries() -> dict[str, Schema]:
    """Schema of each, by what was asked."""
    return {
        "power": _power(),
        "thresholds": _thresholds(),
        "sheet_error": _sheet_error(),
        "left_out": _left_out(),
        "plan": _plan(),
        "oracle": summary("power --oracle", _SETS, {"effects": listed(declared(EffectLimit))}),
        "followed": _following(),
    }


_SETS = closed(
    {
        "run": RUN,
        "workbench": TEXT,
        "seed": WHOLE,
        "stops": listed(TEXT),
        "machine": TEXT,
        "interrupted": FLAG,
    },
    optional="machine",
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
    row = {"rig": TEXT, "kind": TEXT, "planted": listed(TEXT), "said": listed(TEXT)}
    sets = listed(closed({**row, "changed": listed(declared(VerdictChange))}))
    return summary("power --thresholds", _SETS, {"usual": by_name(NUMBER), "sets": sets})


def _sheet_error() -> Schema:
    row = {"rig": TEXT, "wrong": by_name(NUMBER), "verdict": TEXT, "error": TEXT}
    row |= {"causes": listed(listed(TEXT)), "wrong_name": FLAG}
    return summary("power --sheet-error", _SETS, {"sets": listed(closed(row))})


def _left_out() -> Schema:
    shares = {name: SHARE for name in left_out.SHARES}
    rows = listed(declared(left_out.LeftOutRow))
    return summary("power --leave-out-effect", _SETS, {**shares, "sets": rows})


def _following() -> Schema:
    shares = {name: SHARE for name in following.SHARES}
    rows = listed(declared(following.FollowingRow))
    return summary("power --follow", _SETS, {**shares, "sets": rows})


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
        "fit": _fit(),
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
    trust = {
        "warnings": listed(TEXT),
        "guesses": listed(TEXT),
        "inseparable": listed(closed({"names": listed(TEXT), "correlation": NUMBER})),
        "contradicted": by_name(NUMBER),
        "contradictions": by_name(listed(declared(Contradiction))),
    }
    case = closed({**texts, **trust, "estimators": by_name(score)})
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
    limit = {"enum": ["", "least", "greatest"]}
    numbers = {"value": NUMBER, "low": ERROR, "high": ERROR, "beyond": ERROR}
    size = {**numbers, "unit": TEXT, "limit": limit, "text": TEXT}
    cause = closed(
        {
            "effect": TEXT,
            "text": TEXT,
            "parameters": by_name(closed(size)),
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
    model = {
        "partial": FLAG,
        "modelica": or_null(TEXT),
        "fmu": or_null(TEXT),
        "difference_from_fit": ERROR,
    }
    entries = {
        "verdict": {"enum": ["nothing", "found", "partly explained", "unexplained"]},
        "sentence": NAMED,
        "interrupted": FLAG,
        "warnings": listed(TEXT),
        "doubts": by_name(listed(TEXT)),
        "causes": listed(cause),
        "gain": or_null(closed(gain)),
        "model": closed(model),
        "partial": listed(TEXT),
        "noise_alone": FLAG,
        "nearest": listed(declared(NearestCandidate)),
        "next_steps": listed(TEXT),
        "late": or_null(declared(LateSignals)),
        "lasting_errors": by_name(BOTH),
        "dependences": listed(declared(Dependence)),
        "confusability": closed({"effects": listed(TEXT), "cosines": matrix}),
        "candidates": listed(closed(candidate)),
        "steps": listed(closed(step)),
        "not_visible": by_name(TEXT),
        "shifted_levels": listed(declared(ShiftedLevel)),
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
        **closed(
            {
                "title": TEXT,
                "judged_windows": WHOLE,
                "models": by_name(closed(model)),
                "warnings": listed(TEXT),
            }
        ),
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
        "linear_s": NUMBER,
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


def _fit() -> Schema:
    errors = closed({"nominal": ERROR, "fitted": ERROR})
    recording = {"held_out": FLAG, "rms": by_name(errors), "over_noise": errors}
    direction = {"text": NAMED, "parts": by_name(NUMBER), "spread": NUMBER}
    entries = {
        "sentence": NAMED,
        "reliable": FLAG,
        "doubts": listed(NAMED),
        "values": by_name(declared(FittedValue)),
        "correlation": listed(listed(NUMBER)),
        "not_identified": listed(closed(direction)),
        "recordings": by_name(closed(recording)),
        "loss": {"enum": list(LOSSES)},
        "costs": listed(NUMBER),
        "differential_evolution": TEXT,
        "interrupted": FLAG,
        "notes": listed(NAMED),
    }
    provenance = {"run": RUN, **VERSIONS, "system": TEXT, "fmu": FMU, "seed": WHOLE}
    return summary("fit", closed(provenance), entries)


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
