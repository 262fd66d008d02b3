"""What declarations of tables say to others: JSON Schema for editors, rows of a page for people."""

import collections.abc
import math
import typing
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Annotated, Any

from workbench.system.declaration import (
    REQUIRED,
    Entry,
    Key,
    entries,
    is_table,
    kinds_of,
    table_name_of,
)
from workbench.system.expression import Expression

Schema = dict[str, Any]

_TEXT: Schema = {"type": "string", "minLength": 1}
_QUANTITY: Schema = {"type": "string", "pattern": r"^\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)? *\S.*$"}
_NUMBER: Schema = {**_QUANTITY, "type": ["number", "string"]}  # in a unit that may be 1


def schema(cls: type) -> Schema:
    """JSON Schema of a table.

    A table is closed: a key that it may not have is a mistake. Keys of tables of their own, such as
    `feedback.fades`, are put together.
    """
    properties: Schema = {}
    required = []
    for entry in _inner_keys(cls):
        described = _of_entry(entry)
        outer, _, inner = entry.name.rpartition(".")
        if outer:
            own = properties.setdefault(outer, _closed_table({}, []))
            own["properties"][inner] = described
            continue
        properties |= {name: described for name in (entry.name, *entry.key.aliases)}
        if _is_required(entry):
            required.append([entry.name, *entry.key.aliases])
    made = _closed_table(properties, [names[0] for names in required if len(names) == 1])
    if choices := [[{"required": [n]} for n in names] for names in required if len(names) > 1]:
        made["allOf"] = [{"anyOf": names} for names in choices]
    if either := getattr(cls, "EITHER", None):
        made["oneOf"] = [{"required": [name]} for name in either.names]
    if some := getattr(cls, "SOME", None):
        made["anyOf"] = [{"required": [name]} for name in some]
    return made


def _closed_table(properties: Schema, required: list[str]) -> Schema:
    return {
        "type": "object",
        "required": required,
        "properties": properties,
        "additionalProperties": False,
    }


def _inner_keys(cls: type) -> Iterator[Entry]:
    """Keys of a table, those included that are fields of another class."""
    for entry in entries(cls):
        if entry.key.inline:
            optional = entry.key.absent is None
            for inner in entries(kinds_of(entry.hint)[0]):
                yield inner._replace(optional=True) if optional else inner
        else:
            yield entry


def _is_required(entry: Entry) -> bool:
    """Whether a key must be there: it has no default, and is no table whose keys all have one."""
    if entry.optional or entry.key.absent is not REQUIRED:
        return False
    kind = kinds_of(entry.hint)[0]
    return not is_table(kind) or any(_is_required(inner) for inner in _inner_keys(kind))


def _of_entry(entry: Entry) -> Schema:
    about = {"description": entry.key.meaning} if entry.key.meaning else {}
    if entry.key.read:
        return {**about, **entry.key.schema}
    described = _of_type(entry.hint, entry.key)
    several = described.get("type") == "object" and "additionalProperties" in described
    if several and entry.key.absent is REQUIRED and "properties" not in described:
        described = {**described, "minProperties": 1}
    return {**about, **described, **entry.key.schema}


def _of_type(hint: Any, declared: Key) -> Schema:
    kinds = kinds_of(hint)
    kind, origin, inside = kinds[0], typing.get_origin(kinds[0]), typing.get_args(kinds[0])
    if is_table(kind):
        described = [schema(other) for other in kinds]
        return described[0] if len(kinds) == 1 else {"anyOf": described}
    if kind in (str, bool) and declared.choices:
        return {"enum": [*([True, False] if kind is bool else []), *declared.choices]}
    if origin is tuple and is_table(kinds_of(inside[0])[0]):
        item = _of_type(inside[0], declared)
        if table_name_of(kinds_of(inside[0])[0]):
            return {"type": "object", "additionalProperties": item}
        return {"anyOf": [{"type": "array", "items": item}, item]}
    if origin is tuple:
        sizes = {} if inside[-1] is ... else {"minItems": len(inside), "maxItems": len(inside)}
        several = kinds_of(inside[0])
        items = {} if len(several) > 1 else {"items": _of_type(inside[0], declared)}
        return {"type": "array", **items, **sizes}
    if origin is collections.abc.Mapping:
        return {"type": "object", "additionalProperties": _of_type(inside[1], declared)}
    of_a_unit = declared.unit != "1" and isinstance(declared.unit, str) and declared.unit[0] != "{"
    number = _QUANTITY if of_a_unit else _NUMBER
    plain = {float: number, bool: {"type": "boolean"}, int: {"type": "integer", "minimum": 1}}
    return plain.get(kind, _TEXT)


# --- for people ---


def tables(cls: type) -> dict[str, type]:
    """All tables that there may be in a table, and itself, by the name of the class."""
    classes = {cls.__name__: cls}
    for entry in _inner_keys(cls):
        for inner in _tables_in(entry.hint):
            if inner.__name__ not in classes:
                classes |= tables(inner)
    return classes


def _tables_in(hint: Any) -> list[type]:
    kinds = [kind for part in kinds_of(hint) for kind in (part, *typing.get_args(part))]
    return [kind for part in kinds for kind in kinds_of(part) if is_table(kind)]


def reference(cls: type, separate: Collection[type] = ()) -> str:
    """Keys of a table as a table of Markdown.

    Parameters
    ----------
    separate : tables that have a place of their own; keys of others stand beside theirs.
    """
    lines = ["| key | value | default | meaning |", "| --- | --- | --- | --- |"]
    lines += [f"| {' | '.join(row)} |" for row in _rows(cls, separate, "")]
    return "\n".join(lines)


def _rows(
    cls: type, separate: Collection[type], before: str
) -> Iterator[tuple[str, str, str, str]]:
    for entry in _inner_keys(cls):
        name = f"{before}{entry.name}"
        also = "".join(f", `{before}{alias}`" for alias in entry.key.aliases)
        yield f"`{name}`{also}", _value_of(entry), _default(entry), entry.key.meaning
        for inner in _tables_in(entry.hint):
            if inner not in separate:
                by_name = ".NAME" if table_name_of(inner) or "by name" in _value_of(entry) else ""
                yield from _rows(inner, separate, f"{name}{by_name}.")


def _value_of(entry: Entry) -> str:
    """What kind of value a key takes, in words."""
    if entry.key.choices and kinds_of(entry.hint)[0] is str:
        return ", ".join(f"`{choice}`" for choice in entry.key.choices)
    if entry.key.schema.get("type") == "array":
        return "list of text"
    return _words(entry.hint, entry.key)


def _words(hint: Any, declared: Key) -> str:
    kinds = kinds_of(hint)
    kind, origin, inside = kinds[0], typing.get_origin(kinds[0]), typing.get_args(kinds[0])
    if is_table(kind):
        return " or ".join(_table(other) for other in kinds)
    if origin is Annotated:
        return "unit"
    if origin is tuple:
        item = kinds_of(inside[0])[0]
        if is_table(item):
            return "a table by name" if table_name_of(item) else "tables, `[[...]]`"
        words = "text" if item is not float else _number(declared)
        return f"list of {words}" if inside[-1] is ... else ", ".join([words] * len(inside))
    if origin is collections.abc.Mapping:
        return f"{_words(inside[1], declared)} by name"
    if kind is float:
        return _number(declared)
    if kind is bool and declared.choices:
        return f"true, false, {', '.join(f'`{choice}`' for choice in declared.choices)}"
    named = {Expression: "formula", bool: "true or false", int: "whole number", Path: "folder"}
    return named.get(kind, "name" if declared.of else "text")


def _table(kind: type) -> str:
    names = [entry.name for entry in _inner_keys(kind)]
    return f"`{{ {', '.join(names)} }}`" if len(names) <= 4 else "a table"


def _number(declared: Key) -> str:
    if callable(declared.unit):
        return "[its unit]"
    if declared.unit == "1":
        return "number"
    return "[`unit`]" if declared.unit.startswith("{") else f"[{declared.unit}]"


def _default(entry: Entry) -> str:
    """What a key is where nobody writes it, in words."""
    absent, otherwise = entry.key.absent, entry.key.otherwise
    if otherwise or _is_required(entry):
        return otherwise
    if entry.optional or absent in (REQUIRED, None, "", (), {}):
        return "none"
    if isinstance(absent, bool):
        return str(absent).lower()
    if isinstance(absent, str):
        name = absent.strip("{}")
        return "the name" if name == "name" else f"`{name}`"
    if isinstance(absent, float) and not math.isinf(absent):
        unit = entry.key.unit
        plain = callable(unit) or unit == "1" or unit.startswith("{")
        return f"{absent:g}" if plain else f"{absent:g} {unit}"
    return str(absent)
