"""What the source of a Modelica class says, as values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Modifier:
    """What follows a name, as in `x(min=0) = 1`: a value, as text, and modifiers by name.

    Attributes
    ----------
    where : file and line; empty for one that nobody wrote.
    final : whether nothing may modify it further.
    redeclared : what `redeclare` declares under the name, a component or a class; its owner is the
        class in which it is written. None where the name is modified only.
    """

    value: str = ""
    inner: Mapping[str, "Modifier"] = field(default_factory=dict)
    where: str = ""
    final: bool = False
    redeclared: "Component | None" = None


@dataclass(frozen=True)
class Extends:
    """A class that another one extends, named as written there."""

    name: str
    modifier: Modifier
    where: str


@dataclass(frozen=True)
class Component:
    """A component of a class.

    Attributes
    ----------
    owner : dotted name of the class that declares it.
    type, constraint : as written there; `constraint` is empty without `constrainedby`.
    prefixes : such as input, parameter, final, replaceable; and protected.
    constraining : what modifies the constraint.
    """

    name: str
    owner: str
    type: str
    prefixes: frozenset[str]
    modifier: Modifier
    description: str
    where: str
    constraint: str = ""
    constraining: Modifier = field(default_factory=Modifier)


@dataclass(frozen=True)
class Connection:
    """Two ends of a `connect`, each as names from component to component."""

    ends: tuple[tuple[str, ...], tuple[str, ...]]
    where: str


@dataclass(frozen=True)
class Class:
    """A class as it is written.

    Attributes
    ----------
    name : dotted, from the library's on.
    kind : model, package, type, ...
    prefixes : such as partial, expandable, replaceable.
    constraint : of a replaceable class, named as written there; empty without `constrainedby`.
    constraining : what modifies the constraint.
    imports : (name, what it stands for); the name is "*" for all that a package holds.
    equations : components that stand alone on the left side of an equation.
    vendor : content of `annotation(__Workbench(...))`: numbers, strings, booleans, tuples and, for
        what stands in parentheses, mappings.
    experiment : what its annotation of that name says, as text by name.
    where : file and line.
    """

    name: str
    kind: str
    prefixes: frozenset[str]
    constraint: str
    constraining: Modifier
    description: str
    extends: tuple[Extends, ...]
    imports: tuple[tuple[str, str], ...]
    components: tuple[Component, ...]
    equations: frozenset[str]
    connections: tuple[Connection, ...]
    vendor: Mapping[str, Any]
    experiment: Mapping[str, str]
    where: str

    @property
    def partial(self) -> bool:
        """Whether it lacks something that others are to add."""
        return "partial" in self.prefixes
