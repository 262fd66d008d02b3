"""JSON Schema of the summaries that commands write.

Shapes that the code declares as dataclasses are read from them. Objects are closed: a key that a
file has and its schema has not is a mistake in one of the two.
"""

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, Union

from workbench.diagnosis.inference.nearest import NearestCandidate
from workbench.diagnosis.inference.nuisance import ShiftedLevel
from workbench.diagnosis.inference.residuals import Dependence
from workbench.diagnosis.inference.sample_errors import Errors
from workbench.diagnosis.inference.timing import LateSignals
from workbench.observers import estimators_of
from workbench.observers.trust import Contradiction
from workbench.pages.answer import Measure
from workbench.recordings.case import UNKNOWN
from workbench.studies.distance.outcome import SafetyLevel
from workbench.studies.distance.rare_events import PlainSampling
from workbench.studies.fit.outcome import LOSSES, FittedValue
from workbench.studies.power import Scale, following, left_out
from workbench.studies.power.campaign import EffectChance, EffectLimit
from workbench.studies.power.sensitivity import VerdictChange
from workbench.system.installed import installed_plugins
from workbench.system.parts import Condition, StepTracking
from workbench.system.plugins import load
from workbench.system.reference import schema
from workbench.system.system import System
from workbench.tuning.recipe import Fold

Schema = dict[str, Any]

TEXT: Schema = {"type": "string"}
NAMED: Schema = {"type": "string", "minLength": 1}
FLAG: Schema = {"type": "boolean"}
WHOLE: Schema = {"type": "integer"}
NUMBER: Schema = {"type": "number"}
ANY: Schema = {}
HASH: Schema = {"type": "string", "pattern": "^[0-9a-f]{64}$"}


def closed(entries: Mapping[str, Schema], *, optional: str = "") -> Schema:
    """An object with these entries and no others; those named in `optional` may be missing.

    Entries of one schema may stand in one key, with spaces between their names.
    """
    properties = {name: schema for names, schema in entries.items() for name in names.split()}
    missing = optional.split() if optional != "*" else list(properties)
    unknown = set(missing) - set(properties)
    assert not unknown, unknown
    return {
        "type": "object",
        "required": [name for name in properties if name not in missing],
        "properties": properties,
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

VERSIONS = {"workbench python": TEXT, "commit": or_null(TEXT), "packages": by_name(TEXT)}
FMU = closed({"file model": TEXT, "sha256": HASH})
RUN = closed(
    {
        "command workbench system title": TEXT,
        "date": {"type": "string", "format": "date-time"},
        "commit": or_null(TEXT),
        "data": by_name(or_null(HASH)),
    }
)
MEASURES = by_name(declared(Measure))
ANSWER = closed({"sentence": NAMED, "headline details": MEASURES})
ERROR = or_null(NUMBER)
TEXTS, NUMBERS = listed(TEXT), listed(NUMBER)
MATRIX = listed(NUMBERS)
BOTH = closed({"before after": NUMBER})
VALUE = closed({"value": NUMBER, "unit": TEXT})
SHARE = closed({"hits of": WHOLE, "share": ERROR, "low high": NUMBER})
MODEL_RUN = {"run": RUN, **VERSIONS, "system": TEXT, "fmu": FMU}


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
    provenance = {"run": RUN, "workbench machine": TEXT, "seed": WHOLE, "stops": TEXTS}
    sets = closed({**provenance, "interrupted": FLAG}, optional="machine")

    def asked(option: str, entries: Mapping[str, Schema]) -> Schema:
        return summary(f"power --{option}", sets, entries)

    varied = {"rig kind": TEXT, "planted said": TEXTS, "changed": listed(declared(VerdictChange))}
    wrong = {"rig verdict error": TEXT, "wrong": by_name(NUMBER), "causes": listed(TEXTS)}
    effect = {"rig unit": TEXT, "size": NUMBER, "hidden": FLAG, "right_first": by_name(SHARE)}
    outside = {"size": NUMBER, "unit": TEXT, "verdicts": by_name(by_name(WHOLE))}
    power = {
        "sets": WHOLE,
        "scale": declared(Scale),
        "failed": listed(closed({"rig error": TEXT})),
        "false_alarms right_first right_first_above_noise right_alone unexplained coverage "
        "partly_right": SHARE,
        "pairs": closed({"both both_seen_alone": SHARE}),
        "effects": by_name(closed({**effect, "coverage": SHARE})),
        "outside": by_name(closed(outside)),
        "confusion": by_name(by_name(WHOLE)),
        "wrong partly_wrong": listed(closed({"rig": TEXT, "said": TEXTS})),
    }
    sheet = listed(closed({**wrong, "wrong_name": FLAG}))
    proposed = {" ".join(left_out.SHARES): SHARE, "sets": listed(declared(left_out.LeftOutRow))}
    followed = {" ".join(following.SHARES): SHARE, "sets": listed(declared(following.FollowingRow))}
    return {
        "power": summary("power", sets, power),
        "thresholds": asked(
            "thresholds", {"usual": by_name(NUMBER), "sets": listed(closed(varied))}
        ),
        "sheet_error": asked("sheet-error", {"sets": sheet}),
        "left_out": asked("leave-out-effect", proposed),
        "plan": asked("plan", {"sizes": NUMBERS, "effects": listed(declared(EffectChance))}),
        "oracle": asked("oracle", {"effects": listed(declared(EffectLimit))}),
        "followed": asked("follow", followed),
    }


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
    score = {"z": ERROR, "outcome reason": TEXT, "seconds": {"type": "number", "minimum": 0}}
    # Of the judged signal, whatever its name.
    scores = closed(score) | {"patternProperties": {r"_rms_|_nrmse$": ERROR}}
    case = {
        "title": TEXT,
        "doubts warnings scale guesses": TEXTS,
        "reference": or_null(TEXT),
        "inseparable": listed(closed({"names": TEXTS, "correlation": NUMBER})),
        "contradicted": by_name(NUMBER),
        "contradictions": by_name(listed(declared(Contradiction))),
        "estimators": by_name(scores),
    }
    meanings = by_name(by_name(closed({"text unit": TEXT})))
    provenance = {
        **closed({"run": RUN, **VERSIONS, "fmu": FMU, "meanings": meanings}),
        "additionalProperties": {"type": "object"},  # other models, settings of each estimator
    }
    entries = {"weights": by_name(NUMBER), "cases": by_name(closed(case))}
    return summary("simulate", provenance, entries)


def _tune() -> Schema:
    gain = {"meaning unit": TEXT, "value reasoned lower upper": NUMBER, "at_bound": FLAG}
    work = {
        "generations candidates crashed folds as_good last": WHOLE,
        "seconds saved": NUMBER,
        "interrupted converged": FLAG,
    }
    provenance = {
        "run": RUN,
        "workbench python system judged_by": TEXT,
        "packages": by_name(TEXT),
        "fmu": FMU,
        "cases": TEXTS,
        "scale_errors weights": by_name(NUMBER),
        "seed population": WHOLE,
    }
    entries = {
        "estimator label judged": TEXT,
        "bandwidth": ERROR,
        "follows": or_null(declared(StepTracking)),
        "z z_reasoned": NUMBER,
        "cases": by_name(closed({"z_k z_k_reasoned": NUMBER, "unstable": WHOLE})),
        "gains": by_name(closed({**gain, "as_good": NUMBERS})),
        "sensitivity": by_name(closed({"less more without": ERROR, "matters": FLAG})),
        "folds": listed(declared(Fold, nullable=True)),
        "beside": by_name(closed({"label worst": TEXT, "z": ERROR})),
        "work": closed(work),
        "convergence": NUMBERS,
        "warned": TEXT,
    }
    return summary("tune", closed(provenance), entries)


def _diagnose() -> Schema:
    size = {
        "value": NUMBER,
        "low high beyond": ERROR,
        "unit text": TEXT,
        "limit": {"enum": ["", "least", "greatest"]},
    }
    cause = {
        "effect text separation": TEXT,
        "parameters": by_name(closed(size)),
        "phases": or_null(NUMBERS),
        "confusable_with": TEXTS,
        "explained": NUMBER,
    }
    estimate = closed({"value low high": NUMBER, "unit": TEXT, "inside": ERROR})
    gain = {"measure": TEXT, "before after low high": NUMBER, "recordings": by_name(BOTH)}
    candidate = {
        "effect unit": TEXT,
        "shape": by_name(NUMBER),
        "size gain held_out": NUMBER,
        "sigma": ERROR,
        "shape_units": by_name(TEXT),
    }
    step = {"before": NUMBER, "rivals": listed(closed({"effect": TEXT, "misfit": NUMBER}))}
    model = {
        "partial": FLAG,
        "modelica fmu": or_null(TEXT),
        "difference_from_fit": ERROR,
        "without": TEXTS,
    }
    certainty = {
        "unknowns": TEXTS,
        "correlations": MATRIX,
        "likelihood": by_name(closed({"low high": ERROR})),
        "starts": closed(
            {"behind": listed(ERROR), "same": WHOLE, "lower": NUMBER, "sentence": TEXT}
        ),
    }
    recording = {"errors deviations furthest": NUMBERS, "common own": MATRIX}
    rival = {
        "effects": TEXTS,
        "sizes levels": listed({"type": "array"}),
        "recordings": listed(closed(recording)),
        "prior": closed({"matrix": MATRIX, "gradient": NUMBERS, "constant": NUMBER}),
        "explained": NUMBER,
    }
    rivals = {
        "models": listed(closed(rival)),
        "effects signals": TEXTS,
        "given": by_name(NUMBER),
        "inflation": NUMBERS,
    }
    entries = {
        "verdict": {"enum": ["nothing", "found", "partly explained", "unexplained"]},
        "sentence": NAMED,
        "interrupted noise_alone": FLAG,
        "warnings partial next_steps cases": TEXTS,
        "doubts": by_name(TEXTS),
        "causes": listed(closed(cause)),
        "gain": or_null(closed(gain)),
        "model": closed(model),
        "nearest": listed(declared(NearestCandidate)),
        "late": or_null(declared(LateSignals)),
        "lasting_errors": by_name(BOTH),
        "dependences": listed(declared(Dependence)),
        "confusability": closed({"effects": TEXTS, "cosines": MATRIX}),
        "candidates": listed(closed(candidate)),
        "steps": listed(closed(step)),
        "not_visible channels": by_name(TEXT),
        "shifted_levels": listed(declared(ShiftedLevel)),
        "levels": by_name(VALUE),
        "deviations start_values": by_name(by_name(NUMBER)),
        "set_aside": by_name(by_name(WHOLE)),
        "errors": listed(declared(Errors)),
        "observers": by_name(by_name(closed({"before after": ERROR}))),
        "smoothed": or_null(closed({"recording": TEXT, "models": by_name(by_name(estimate))})),
        "rivals": or_null(closed(rivals)),
        "certainty": or_null(closed(certainty)),
    }
    provenance = {"run": RUN, "workbench system": TEXT, "model": FMU, "effects": TEXTS}
    return summary("diagnose", closed(provenance), entries)


def _observability() -> Schema:
    numbers = by_name(NUMBER)
    case = {
        "title": TEXT,
        "judged_windows": WHOLE,
        "models": by_name(closed({"useful median_bound states_observable": or_null(numbers)})),
        "warnings": TEXTS,
    }
    linear = {
        "observable": FLAG,
        "rank": WHOLE,
        "states": by_name(closed({"at scale remaining": NUMBER})),
        "information": NUMBERS,
        "unobservable invisible": TEXTS,
    }
    entries = {
        "operating_point": closed({"inputs quantities": numbers, "held": by_name(TEXT)}),
        "noise": by_name(closed({"absolute relative": NUMBER})),
        "window_s stride_s linear_s": NUMBER,
        "prior useful": numbers,
        "linear": by_name(closed(linear)),
        "cases": by_name({**closed(case), "patternProperties": {"^median_": ERROR}}),
    }
    provenance = closed({"run": RUN, **VERSIONS, "fmus": listed(FMU)})
    return summary("observability", provenance, entries)


def _next() -> Schema:
    tried = closed(
        {
            "experiment": TEXT,
            "groups": listed(listed(WHOLE)),
            "separation chance duration": NUMBER,
            "separations": MATRIX,
            "deviation": BOTH,
            "cost": VALUE,
            "inputs": by_name(closed({"profile": TEXT, "levels": NUMBERS, "every": NUMBER})),
            "conditions settings": by_name(ANY),
        }
    )
    entries = {
        "sentence": NAMED,
        "rivals": TEXTS,
        "parts": FLAG,
        "tried": {**listed(tried), "minItems": 1},
        "sensors": by_name(tried),
    }
    provenance = {"run": RUN, "workbench system diagnosis": TEXT}
    return summary("next", closed(provenance), entries)


def _distance() -> Schema:
    entries = {
        "sentence": NAMED,
        "asked distance": by_name(NUMBER),
        "conditions": by_name(ANY),
        "deceleration response width": NUMBER,
        "nominal": closed({"distance deceleration": NUMBER}),
        "outside": ANY,
        "safety": or_null(listed(declared(SafetyLevel))),
        "plain": or_null(declared(PlainSampling)),
        "stops": listed({"type": "object", "required": ["stop", "held"]}),
        "held": closed({"of stops": WHOLE}),
        "warnings": TEXTS,
        "interrupted": FLAG,
    }
    provenance = {"run": RUN, **VERSIONS, "system": TEXT, "models": by_name(FMU), "seed": WHOLE}
    return summary("distance", closed(provenance), entries)


def _fit() -> Schema:
    errors = closed({"nominal fitted": ERROR})
    direction = {"text": NAMED, "parts": by_name(NUMBER), "spread": NUMBER}
    entries = {
        "sentence": NAMED,
        "reliable interrupted": FLAG,
        "doubts notes": listed(NAMED),
        "values": by_name(declared(FittedValue)),
        "correlation": MATRIX,
        "not_identified": listed(closed(direction)),
        "recordings": by_name(
            closed({"held_out": FLAG, "rms": by_name(errors), "over_noise": errors})
        ),
        "loss": {"enum": list(LOSSES)},
        "costs": NUMBERS,
        "differential_evolution": TEXT,
    }
    return summary("fit", closed({**MODEL_RUN, "seed": WHOLE}), entries)


def _monitor() -> Schema:
    quantity = {
        "label unit": TEXT,
        "level standard_error trend_by_recording trend_standard_error scatter": ERROR,
        "told_in": WHOLE,
    }
    entries = {
        "sentences": listed(NAMED),
        "recordings": WHOLE,
        "order": {"enum": ["dates", "names"]},
        "first last": NAMED,
        "rate threshold": NUMBER,
        "alarms": listed({"type": "object", "required": ["told_at", "quantity", "change"]}),
        "quantities": by_name(closed(quantity)),
        "work": by_name(closed({"label": TEXT, "work of_the_mean": NUMBER})),
        "refused again warned": by_name(TEXT),
        "interrupted": FLAG,
    }
    return summary("monitor", closed(MODEL_RUN), entries)


def _fleet() -> Schema:
    machine = {"machine": NAMED, "recordings alarms": WHOLE, "refusal": TEXT}
    entries = {
        "recordings": WHOLE,
        "seconds": NUMBER,
        "machines": listed(closed(machine)),
        "interrupted": FLAG,
    }
    return summary("monitor --fleet", closed(MODEL_RUN), entries)


def _bench() -> Schema:
    ratios = {"ratios": by_name(NUMBER)}
    call = {
        "unit": TEXT,
        "states inputs": WHOLE,
        "derivatives derivatives_fmi nonzeros jacobian jacobian_fmi step": NUMBER,
        "steps_per_second": NUMBER,
    }
    observer = {
        "observer": TEXT,
        "states": WHOLE,
        "step times_real_time long": NUMBER,
        "by_rate": by_name(NUMBER),
        "fmpy c": ERROR,
    }
    observers = {
        "case": TEXT,
        "steps": listed(closed(observer)),
        "processes": closed({"cases peak_memory": WHOLE, "one two": NUMBER}),
        "compilation": by_name(NUMBER),
        "horizon": closed({"unknowns samples": WHOLE, "ours ipopt": NUMBER, **ratios}),
    }
    evaluation = {"estimator": TEXT, "steps": WHOLE, "ours fmpy z": NUMBER, **ratios}
    workers = {"cases candidates": WHOLE, "one two": NUMBER, "dask": ERROR, **ratios}
    tuning = {
        "case": TEXT,
        "evaluations": listed(closed(evaluation)),
        "workers": closed(workers),
        "memory": closed({"master worker total": WHOLE}),
    }
    entries = {
        "machine": closed({"processor system": TEXT}),
        "seed": WHOLE,
        "calls": by_name(closed({**call, **ratios})),
        "observers": closed(observers),
        "tuning": closed(tuning),
    }
    return summary("bench", closed({"run": RUN}), entries)
