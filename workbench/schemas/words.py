"""Words of JSON Schema (2020-12), and what all summaries share."""

import dataclasses
import types
import typing
from collections.abc import Mapping
from typing import Any, Union

from workbench.answer import Measure

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


def by_name(one: Schema) -> Schema:
    """An object whose keys are names of things."""
    return {"type": "object", "additionalProperties": one}


def listed(one: Schema) -> Schema:
    """An array of one kind of things."""
    return {"type": "array", "items": one}


def or_null(one: Schema) -> Schema:
    """What JSON has null for, where there is none."""
    return {"anyOf": [one, {"type": "null"}]}


def declared(kind: type, *, nullable: bool = False) -> Schema:
    """A dataclass as JSON has it; with `nullable`, its numbers are null where there are none."""
    hints = typing.get_type_hints(kind)
    entries = {one.name: _typed(hints[one.name]) for one in dataclasses.fields(kind)}
    if nullable:
        entries = {name: or_null(one) if one == NUMBER else one for name, one in entries.items()}
    return closed(entries)


def _typed(hint: Any) -> Schema:
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Union, types.UnionType):
        kinds = [one for one in inside if one is not type(None)]
        return or_null(_typed(kinds[0]))
    if origin is typing.Literal:
        return {"enum": list(inside)}
    if origin is tuple:
        one = listed(_typed(inside[0]))
        return (
            one if inside[-1] is ... else {**one, "minItems": len(inside), "maxItems": len(inside)}
        )
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
