"""What the source of a Modelica class says, as values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Modifier:
    """What follows a name, as in `x(min=0) = 1`: a value, as text, and modifiers by name.

    A redeclaration stands under its own text.
    """

    value: str = ""
    inner: Mapping[str, "Modifier"] = field(default_factory=dict)


@dataclass(frozen=True)
class Extends:
    """A class that another one extends, named as written there."""

    name: str
    modifier: Modifier


@dataclass(frozen=True)
class Component:
    """A component of a class.

    Attributes
    ----------
    owner : dotted name of the class that declares it.
    type, constraint : as written there; `constraint` is empty without `constrainedby`.
    prefixes : such as input, parameter, final, replaceable.
    """

    name: str
    owner: str
    type: str
    prefixes: frozenset[str]
    modifier: Modifier
    constraint: str
    description: str
    where: str


@dataclass(frozen=True)
class Class:
    """A class as it is written.

    Attributes
    ----------
    name : dotted, from the library's on.
    kind : model, package, type, ...
    imports : (name, what it stands for); the name is "*" for all that a package holds.
    equations : components that stand alone on the left side of an equation.
    vendor : content of `annotation(__Workbench(...))`: numbers, strings, booleans, tuples and, for
        what stands in parentheses, mappings.
    where : file and line.
    """

    name: str
    kind: str
    partial: bool
    description: str
    extends: tuple[Extends, ...]
    imports: tuple[tuple[str, str], ...]
    components: tuple[Component, ...]
    equations: frozenset[str]
    vendor: Mapping[str, Any]
    where: str
