"""What the source of a Modelica class says, as values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Modifier:
    """What follows a name, as in `x(min=0) = 1`: a value, as text, and modifiers by name."""

    value: str = ""
    inner: Mapping[str, "Modifier"] = field(default_factory=dict)
    where: str = ""  # file and line; empty for one that nobody wrote
    final: bool = False  # whether nothing may modify it further
    # what `redeclare` declares under the name, a component or a class; its owner is the class in
    # which it is written. None where the name is modified only.
    redeclared: "Component | None" = None


@dataclass(frozen=True)
class Extends:
    """A class that another one extends, named as written there."""

    name: str
    modifier: Modifier
    where: str


@dataclass(frozen=True)
class Component:
    """A component of a class."""

    name: str
    owner: str  # dotted name of the class that declares it
    # type, constraint: as written there; `constraint` is empty without `constrainedby`
    type: str
    # such as input, parameter, final, replaceable; and protected
    prefixes: frozenset[str]
    modifier: Modifier
    description: str
    where: str
    constraint: str = ""
    constraining: Modifier = field(default_factory=Modifier)  # what modifies the constraint


@dataclass(frozen=True)
class Connection:
    """Two ends of a `connect`, each as names from component to component."""

    ends: tuple[tuple[str, ...], tuple[str, ...]]
    where: str


@dataclass(frozen=True)
class Class:
    """A class as it is written."""

    name: str  # dotted, from the library's on
    kind: str  # model, package, type, ..
    # such as partial, expandable, replaceable; `der` of a function that is derived of another
    prefixes: frozenset[str]
    constraint: str  # of a replaceable class, named as written there; empty without `constrainedby`
    constraining: Modifier  # what modifies the constraint
    description: str
    extends: tuple[Extends, ...]
    # (name, what it stands for); the name is "*" for all that a package holds
    imports: tuple[tuple[str, str], ...]
    components: tuple[Component, ...]
    equations: frozenset[str]  # components that stand alone on the left side of an equation
    connections: tuple[Connection, ...]
    # content of `annotation(__Workbench(...))`: numbers, strings, booleans, tuples and, for what
    # stands in parentheses, mappings
    vendor: Mapping[str, Any]
    experiment: Mapping[str, str]  # what its annotation of that name says, as text by name
    where: str  # file and line

    @property
    def partial(self) -> bool:
        """Whether it lacks something that others are to add."""
        return "partial" in self.prefixes
