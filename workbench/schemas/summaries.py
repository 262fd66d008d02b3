"""JSON Schema of the summaries that commands write.

Shapes that the code declares as dataclasses are read from them. Objects are closed: a key that a
file has and its schema has not is a mistake in one of the two.
"""

from workbench.companion import companion_part
from workbench.diagnosis.sample_errors import Errors
from workbench.installed import companions
from workbench.schemas.power_summaries import power_summaries
from workbench.schemas.words import (
    ANY,
    BOTH,
    ERROR,
    FLAG,
    FMU,
    INTERVAL,
    NAMED,
    NUMBER,
    RUN,
    TEXT,
    VALUE,
    VERSIONS,
    WHOLE,
    Schema,
    by_name,
    closed,
    declared,
    listed,
    or_null,
    summary,
)
from workbench.stopping.outcome import SafetyLevel
from workbench.stopping.plain import PlainLevel
from workbench.tuning.validation import Fold


def summaries() -> dict[str, Schema]:
    """Schema of each summary, by the command that writes it, also those of companions."""
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
    for name in companions():
        if part := companion_part(name, "schemas"):
            own |= {command: made() for command, made in part.SUMMARIES.items()}
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
    case = closed({**texts, "estimators": by_name(score)})
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
            **{name: one for name, one in VERSIONS.items() if name != "commit"},
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
        "follows": or_null(closed({"quantity": TEXT, "within": NUMBER, "left": NUMBER})),
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
        "late": or_null(closed({"signals": listed(TEXT), "skew": NUMBER, "sigma": NUMBER})),
        "lasting_errors": by_name(BOTH),
        "dependences": listed(closed({"channel": TEXT, "influence": TEXT, **ends})),
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
