"""What a Modelica library says of others that is not so: modifiers, redeclarations, connections.

Front ends differ in what they refuse, and some drop a modifier of an element that does not exist
without a word. Here each is held against what the class, with all that it inherits and all that is
redeclared in it, has.

Source: Modelica Language Specification 3.6, sections 4.9 (attributes of predefined types), 5.4
(inner and outer), 6 (which class may stand for another), 7.2 and 7.3 (modifiers and
redeclarations) and 9.1 (connections).
"""

import re
from collections.abc import Iterator, Mapping
from typing import NoReturn

from workbench.errors import InputError, closest
from workbench.models.modelica.classes import Class, Component, Connection, Modifier
from workbench.models.modelica.files import STANDARD
from workbench.models.modelica.library import Library

_SCALAR = frozenset({"quantity", "min", "max", "start", "fixed"})
ATTRIBUTES = {
    "Real": _SCALAR | {"unit", "displayUnit", "nominal", "unbounded", "stateSelect"},
    "Integer": _SCALAR,
    "Boolean": frozenset({"quantity", "start", "fixed"}),
    "String": frozenset({"quantity", "start", "fixed"}),
    "enumeration": _SCALAR,
}
# Predefined, without attributes.
_OTHERS = frozenset({"StateSelect", "AssertionLevel", "ExternalObject", "Clock"})
_NOTHING = Modifier()
# A text, or an array of them.
_TEXTS = re.compile(r'"[^"]*"(\s*\+\s*"[^"]*")*|[{](\s*[{},]|\s*"[^"]*")*')


def check(library: Library, model: str = "") -> tuple[str, ...]:
    """Refuse what a model, or every class of a library, says of others that is not so.

    Parameters
    ----------
    model : dotted name. It is held to what it reaches by components and bases, and to have an
        `inner` for each `outer`. Without it, all classes of the library and of those that it uses
        are held to what they say, each by itself.

    Returns
    -------
    Dotted names of the classes that were held to it.

    Raises
    ------
    InputError
        With file and line: an unknown, protected or final element that is modified, a
        redeclaration that does not fit its place, a connection of what is no connector or of two
        kinds, an unknown class, an `outer` that nothing is around.
    """
    checker = _Checker(library)
    waiting = [library.find(model).name] if model else list(library.classes)
    for name in waiting:
        waiting += [reached for reached in checker.reached(name) if reached not in waiting]
    if model:
        for outer in checker.outside(library.find(model).name, _NOTHING, ()):
            _refuse(
                outer.where,
                f"'outer {outer.name}' in {outer.owner}, which {model} has",
                f"an 'inner {outer.name}' around it",
                f"declare 'inner {outer.type} {outer.name}' in {model}",
            )
    return tuple(waiting)


class _Checker:
    """Holds classes of a library against each other."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self._reached: dict[str, None] = {}

    def reached(self, name: str) -> tuple[str, ...]:
        """Check what one class says; returns the classes that it names."""
        self._reached = {}
        written = self.library.classes[name]
        for base in written.extends:
            type_name = self._type(base.name, name, base.where)
            self._modifier(base.modifier, type_name, _NOTHING, inherits=True)
        if written.constraint:
            self._type(written.constraint, name, written.where)
            _repeated(written.constraining, _NOTHING, "what stands in its place")
        seen: dict[str, str] = {}
        for component in written.components:
            if component.name in seen:
                _refuse(
                    component.where,
                    f"a second element '{component.name}' of {name}",
                    f"one, which is in {seen[component.name]}",
                    "remove one of the two, or rename it",
                )
            seen[component.name] = component.where
            self._component(component)
            if "redeclare" in component.prefixes:
                for old in self._redeclared(component, written):
                    _repeated(old.constraining, component.modifier, f"'{component.name}'")
        for connection in written.connections:
            self._connection(connection, name)
        return tuple(self._reached)

    def outside(
        self, type_name: str, modifier: Modifier, around: tuple[str, ...]
    ) -> Iterator[Component]:
        """Outer components of a class, as modified, for which it has no inner one."""
        cls = self.library.classes.get(type_name)
        if cls is None:
            return
        if type_name in around:
            _refuse(
                cls.where,
                f"{type_name}, which has a component of its own class",
                "components that end in predefined types",
                "remove it",
            )
        parts = self._parts(type_name, modifier).values()
        inner = {part.name for part in parts if "inner" in part.prefixes}
        for part in parts:
            if "outer" not in part.prefixes:
                deeper = self.outside(self._type_of(part), part.modifier, (*around, type_name))
                yield from (outer for outer in deeper if outer.name not in inner)
            elif "inner" not in part.prefixes:
                yield part

    # --- what a class declares ---

    def _component(self, component: Component) -> None:
        type_name = self._type(component.type, component.owner, component.where)
        self._modifier(component.modifier, type_name, _NOTHING, inherits=False)
        if component.constraint:
            constraint = self._type(component.constraint, component.owner, component.where)
            self._modifier(component.constraining, constraint, _NOTHING, inherits=False)
            _repeated(component.constraining, component.modifier, f"'{component.name}'")
            self._fits(type_name, constraint, component)

    def _redeclared(self, component: Component, written: Class) -> Iterator[Component]:
        """What an element that is declared anew was in the classes that its own one extends."""
        for base in written.extends:
            parts = self._parts(self.library.resolve(base.name, written.name), base.modifier)
            if component.name in parts:
                yield parts[component.name]

    def _type(self, name: str, scope: str, where: str) -> str:
        """Dotted name of a class that something is of."""
        full_name = self.library.resolve(name, scope)
        if full_name in self.library.classes:
            self._reached[full_name] = None
        elif full_name not in ATTRIBUTES.keys() | _OTHERS and name:
            short = {known.rpartition(".")[2] for known in self.library.classes}
            _refuse(
                where,
                f"no class '{name}'{closest(name.rpartition('.')[2], short)}",
                f"a class that is known in {scope}",
                f"correct the name, or {self._source_of(full_name)}",
            )
        return full_name

    def _source_of(self, full_name: str) -> str:
        """What to do for a class that may be one of another library."""
        library, _, within = full_name.partition(".")
        if library == "Modelica":
            return STANDARD
        if within and library not in self.library.classes:
            return f'say that the package uses it: annotation (uses({library}(version="...")))'
        return "import it"

    def _parts(self, type_name: str, modifier: Modifier) -> Mapping[str, Component]:
        """Components of a class, as modified."""
        if type_name not in self.library.classes:
            return {}
        return self.library.modified(self.library.components(type_name), modifier)

    def _predefined(self, type_name: str) -> str:
        """Predefined type that a class extends in the end; empty if none."""
        self._lineage(type_name)  # refuses a type that is its own
        while (cls := self.library.classes.get(type_name)) is not None:
            if not cls.extends:
                return "enumeration" if cls.kind == "type" else ""
            type_name = self._type(cls.extends[0].name, type_name, cls.extends[0].where)
        return type_name

    # --- modifiers ---

    def _modifier(
        self, modifier: Modifier, type_name: str, before: Modifier, *, inherits: bool
    ) -> None:
        """Check a modifier of something of a class, which has been modified before.

        Where a class inherits, it may modify what is protected.
        """
        predefined = self._predefined(type_name)
        if predefined:
            self._attributes(modifier, predefined, type_name, before)
            return
        parts = self._parts(type_name, before)
        redeclared = {n: m for n, m in modifier.inner.items() if m.redeclared and n not in parts}
        parts = self.library.modified(parts, Modifier(inner=redeclared))
        for name, modification in modifier.inner.items():
            part = parts.get(name)
            if part is None:
                self._class(name, modification, type_name, parts)
                continue
            if "protected" in part.prefixes and not inherits:
                _refuse(
                    modification.where,
                    f"a modifier of '{name}', which is protected in {part.owner}",
                    "a public element",
                    f"make '{name}' public, or set it in a class that extends {type_name}",
                )
            if "final" in part.prefixes or part.modifier.final:
                _refuse(
                    modification.where,
                    f"a modifier of '{name}', which is final in {part.where}",
                    "an element that may change",
                    "remove the modifier, or the 'final'",
                )
            if modification.redeclared is not None:
                self._redeclaration(part, modification.redeclared)
            else:
                self._modifier(modification, self._type_of(part), part.modifier, inherits=False)

    def _attributes(
        self, modifier: Modifier, predefined: str, type_name: str, before: Modifier
    ) -> None:
        known = ATTRIBUTES.get(predefined, frozenset())
        for name, modification in modifier.inner.items():
            if name not in known or modification.inner or modification.redeclared is not None:
                unfit = f"'{name}'{closest(name, known)}" if name not in known else f"'{name}(...)'"
                _refuse(
                    modification.where,
                    f"a modifier {unfit} of {predefined}",
                    f"one of {', '.join(sorted(known)) or 'none'}",
                    "correct or remove it",
                )
            if name == "unit" and not _TEXTS.fullmatch(modification.value):
                _refuse(
                    modification.where,
                    f"unit={modification.value}",
                    "a text in quotes or, of an array, one for each element in braces",
                    'write unit="m", unit={"m", "s"}, or each unit="m"',
                )
            if self._final(name, type_name, before):
                _refuse(
                    modification.where,
                    f"a modifier '{name}', which is final in {type_name}",
                    "an attribute that may change",
                    "remove it, or choose another type",
                )

    def _final(self, attribute: str, type_name: str, before: Modifier) -> bool:
        """Whether a type, or what modified it before, has fixed an attribute for good."""
        modifiers = [before]
        while (cls := self.library.classes.get(type_name)) is not None and cls.extends:
            modifiers.append(cls.extends[0].modifier)
            type_name = self.library.bases(type_name)[0]
        return any(m.inner[attribute].final for m in modifiers if attribute in m.inner)

    # --- redeclarations ---

    def _class(
        self, name: str, modifier: Modifier, type_name: str, parts: Mapping[str, Component]
    ) -> None:
        """Check a modifier of a class within another one."""
        inside = self.library.inside(name, type_name)
        if not inside:
            _refuse(
                modifier.where,
                f"a modifier of '{name}', but {type_name or 'it'} has no such element"
                f"{closest(name, parts)}",
                f"one of {', '.join(parts) or 'none'}",
                "correct the name, or remove the modifier",
            )
        if modifier.redeclared is None:
            self._modifier(modifier, inside, _NOTHING, inherits=False)
            return
        old = self.library.classes[inside]
        if "replaceable" not in old.prefixes:
            _not_replaceable(modifier.where, name, old.where)
        new = modifier.redeclared
        made = self._type(new.type, new.owner, new.where)
        self._modifier(new.modifier, made, _NOTHING, inherits=True)
        wanted = self._type(old.constraint, inside, old.where) if old.constraint else inside
        self._fits(made, wanted, new)

    def _redeclaration(self, old: Component, new: Component) -> None:
        if "replaceable" not in old.prefixes:
            _not_replaceable(new.where, old.name, old.where)
        self._component(new)
        wanted = self.library.resolve(old.constraint or old.type, old.owner)
        self._fits(self._type_of(new), wanted, new)

    def _fits(self, made: str, wanted: str, where: Component) -> None:
        """Check that a class has what another one, in whose place it stands, has."""
        lacking = self._lacking(made, wanted)
        if lacking:
            _refuse(
                where.where,
                f"{made} for '{where.name}', without {', '.join(lacking)}",
                f"a class that has all that {wanted} has",
                f"extend {wanted}, or choose another class",
            )

    def _lacking(self, made: str, wanted: str, around: tuple[str, ...] = ()) -> list[str]:
        """What a class lacks of another one: its public components, with their predefined types."""
        if made == wanted or wanted in self._lineage(made) or wanted in around:
            return []
        if self._predefined(made) != self._predefined(wanted):
            return [self._predefined(wanted) or wanted]
        have = self._parts(made, _NOTHING)
        lacking = []
        for name, part in self._parts(wanted, _NOTHING).items():
            if "protected" in part.prefixes:
                continue
            mine = have.get(name)
            if mine is None or self._lacking(
                self._type_of(mine), self._type_of(part), (*around, wanted)
            ):
                lacking.append(f"{part.type} {name}")
        return lacking

    def _lineage(self, type_name: str) -> tuple[str, ...]:
        return self.library.ancestors(type_name) if type_name in self.library.classes else ()

    def _type_of(self, component: Component) -> str:
        return self.library.resolve(component.type, component.owner)

    # --- connections ---

    def _connection(self, connection: Connection, owner: str) -> None:
        left, right = (self._end(names, connection, owner) for names in connection.ends)
        if left is None or right is None:
            return  # within an expandable connector, which gets what is connected to it
        first, other = self._signature(left), self._signature(right)
        if first != other:
            ends = " and ".join(".".join(names) for names in connection.ends)
            _refuse(
                connection.where,
                f"a connection of {ends}, which are {left} and {right}",
                "two connectors of the same variables",
                "connect what is of one kind",
            )

    def _end(self, names: tuple[str, ...], connection: Connection, owner: str) -> str | None:
        """Class of a connector at one end; None for what an expandable connector may get."""
        type_name, modifier, whole = owner, _NOTHING, ".".join(names)
        for name in names:
            parts = self._parts(type_name, modifier)
            if name not in parts:
                cls = self.library.classes.get(type_name)
                if cls is not None and "expandable" in cls.prefixes:
                    return None
                _refuse(
                    connection.where,
                    f"connect with '{whole}', but {type_name} has no '{name}'"
                    f"{closest(name, parts)}",
                    "a connector",
                    "correct the name",
                )
            part = parts[name]
            if "protected" in part.prefixes and type_name != owner:
                _refuse(
                    connection.where,
                    f"connect with '{whole}', but '{name}' is protected in {type_name}",
                    "a public connector",
                    f"make '{name}' public",
                )
            type_name, modifier = self._type_of(part), part.modifier
        cls = self.library.classes.get(type_name)
        lineage = () if cls is None else (cls.name, *self.library.ancestors(cls.name))
        if cls is None or not any(self.library.classes[n].kind == "connector" for n in lineage):
            _refuse(
                connection.where,
                f"connect with '{whole}', which is a {type_name}",
                "a connector",
                "connect connectors; write an equation for anything else",
            )
        return type_name

    def _signature(self, type_name: str) -> object:
        """What two connectors must share: a predefined type, or names, kinds and what flows."""
        return self._predefined(type_name) or {
            name: (part.prefixes & {"flow", "stream"}, self._signature(self._type_of(part)))
            for name, part in self._parts(type_name, _NOTHING).items()
        }


def _not_replaceable(where: str, name: str, declared: str) -> NoReturn:
    _refuse(
        where,
        f"a redeclaration of '{name}', which is not replaceable in {declared}",
        "a replaceable element",
        f"declare '{name}' replaceable, or modify it without 'redeclare'",
    )


def _repeated(constraining: Modifier, given: Modifier, of: str) -> None:
    """Refuse what `constrainedby` modifies and a declaration does not: the front end drops it."""
    for name, modification in constraining.inner.items():
        own = given.inner.get(name, _NOTHING)
        new = modification.redeclared
        if (modification.value and not own.value) or (new and not own.redeclared):
            clause = f"redeclare {new.type} {name}" if new else f"{name}={modification.value}"
            _refuse(
                modification.where,
                f"a modifier ({clause}) after 'constrainedby', and not for {of}",
                "the same modifier where a component is declared, and none of a class",
                f"write ({clause}) at each declaration, too; of a class, at each of its components",
            )
        _repeated(modification, own, of)


def _refuse(where: str, found: str, expected: str, remedy: str) -> NoReturn:
    raise InputError(where=where, found=found, expected=expected, remedy=remedy)
