"""Tables of a TOML file, each key declared once: as the field of a dataclass.

The field says what the key means, in which unit it is written, within which bounds, and what it is
where nobody writes it. The reader, the JSON Schema and the reference for people walk these fields.
"""

import dataclasses
import math
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, Union, dataclass_transform

from workbench.errors import InputError
from workbench.system.tables import Table

T = TypeVar("T")
Unit = Annotated[str, "unit"]
"""A unit as Modelica writes it."""

REQUIRED = object()
"""There is nothing that a key is where nobody writes it."""


@dataclass
class Scope:
    """What is known while a table is read: units, defaults and checks may depend on it."""

    file: Path  # that is read
    units: Mapping[str, str] | None  # of all variables of the model, None before there is one
    own: dict[str, Any] = field(default_factory=dict)  # fields of this table that were read so far
    above: "Scope | None" = None  # scope of the table that this one is in
    # names of things that are looked up when all is read: place, name, what it names
    references: list[tuple[str, str, str]] = field(default_factory=list)
    # found on the way; they are said when the model itself is found to be right
    problems: list[InputError] = field(default_factory=list)

    @property
    def whole(self) -> dict[str, Any]:
        """Fields of the whole file that were read so far."""
        return self.own if self.above is None else self.above.whole

    def within(self) -> "Scope":
        """Scope of a table within this one."""
        return dataclasses.replace(self, own={}, above=self)


@dataclass(frozen=True)
class Key:
    """How a field stands in a file."""

    meaning: str = ""  # for people
    # of the key, where it is not the field's; `table.key` stands in a table of its own
    name: str = ""
    aliases: tuple[str, ...] = ()  # further names, as files of an older version have them
    # SI, of numbers. `{field}` is the unit that another field of the table says; a function tells
    # it of the scope and the name of the entry, None where that is unknown, a NaN then.
    unit: "str | Callable[[Scope, str], str | None]" = "1"
    # what the field is where there is no key, or a function of the scope that tells it. A text such
    # as `{name}` is another field.
    absent: Any = REQUIRED
    otherwise: str = ""  # what that is in words, where `absent` does not show it
    # above, least, below: bounds of numbers
    above: float = -math.inf
    least: float = -math.inf
    below: float = math.inf
    # whether the first of two numbers must be the smaller one; `equal`: or the same
    ordered: bool = False
    equal: bool = False
    expected: str = ""  # the bounds in words, for the message of an error
    choices: tuple[str, ...] = ()  # texts that it may be
    like: str = ""  # field whose unit a unit must be convertible to
    of: str = ""  # what a text, or the names of a formula, refer to
    # what the keys of a mapping refer to; or a function that tells which there are
    keys: "str | Callable[[Scope], Iterable[str]]" = ""
    every: bool = False  # whether all of these keys must be there
    inline: bool = False  # whether the keys of its table stand among those of this one
    # refuses what no other option does; takes the value, the table, the key, and the scope
    check: "Callable[[Any, Table, str, Scope], None] | None" = None
    # reads what no type says; takes the table, the key, and the scope
    read: "Callable[[Table, str, Scope], Any] | None" = None
    schema: Mapping[str, Any] = field(default_factory=dict)  # more of its JSON Schema
    of_model: bool = False  # whether it is left out while there is no model

    def bounded(self, values: Iterable[float]) -> bool:
        """Whether numbers are within the bounds, and in order."""
        numbers = list(values)
        pairs = pairwise(numbers)
        inside = all(x > self.above and x >= self.least and x < self.below for x in numbers)
        return inside and (
            not self.ordered or all(a < b or (self.equal and a == b) for a, b in pairs)
        )


def key(meaning: str = "", unit: Any = "1", absent: Any = REQUIRED, **options: Any) -> Any:
    """A field that stands in a file; see `Key`."""
    return field(metadata={"key": Key(meaning, unit=unit, absent=absent, **options)})


def table_name() -> Any:
    """A field that is the name of the table itself."""
    return field(metadata={"key": None})


@dataclass_transform(frozen_default=True, field_specifiers=(key, table_name))
def declared(cls: type[T]) -> type[T]:
    """A table of a file: a frozen dataclass."""
    return dataclass(frozen=True)(cls)


@dataclass(frozen=True)
class Either:
    """Keys of a table of which there must be one; `EITHER` of its class."""

    names: tuple[str, ...]
    expected: str
    remedy: str


class Entry(NamedTuple):
    """A key of a table: the field, its type, how it stands in the file, and its name there."""

    field: str
    hint: Any
    key: Key
    name: str
    optional: bool = False  # whether it is one of several that only stand there together


@cache
def entries(cls: type) -> tuple[Entry, ...]:
    """All keys of a table, in the order in which they are read."""
    hints = typing.get_type_hints(cls, include_extras=True)
    return tuple(
        Entry(f.name, hints[f.name], f.metadata["key"], f.metadata["key"].name or f.name)
        for f in dataclasses.fields(cls)
        if f.metadata.get("key")
    )


def is_table(kind: Any) -> bool:
    """Whether values of a type are tables of a file."""
    return dataclasses.is_dataclass(kind) and any(
        "key" in f.metadata for f in dataclasses.fields(kind)
    )


def table_name_of(cls: type) -> str:
    """The field that is the name of the table, if there is one."""
    fields = dataclasses.fields(cls) if is_table(cls) else ()
    return next((f.name for f in fields if f.metadata.get("key", 0) is None), "")


def key_names(cls: type) -> Iterator[str]:
    """Names of keys that a table may have; `table.key` of those in a table of their own."""
    for entry in entries(cls):
        if entry.key.inline:
            yield from key_names(kinds_of(entry.hint)[0])
        else:
            yield entry.name
            yield from entry.key.aliases


def kinds_of(hint: Any) -> list[Any]:
    """What a value may be, but for None."""
    if typing.get_origin(hint) in (Union, types.UnionType):
        return [kind for kind in typing.get_args(hint) if kind is not types.NoneType]
    return [hint]
