"""Reader of `system.toml`: a machine becomes a `System`, checked against its model at the door."""

import collections.abc
import math
import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

from workbench.errors import InputError
from workbench.models.description import Description, read_description
from workbench.system.check import check_model, check_references
from workbench.system.declaration import (
    REQUIRED,
    Either,
    Entry,
    Key,
    Scope,
    entries,
    is_table,
    key_names,
    kinds_of,
    table_name_of,
)
from workbench.system.expression import Expression
from workbench.system.parts import EstimatedQuantity, Model, Signal, StateNoise
from workbench.system.system import OBSERVER, System
from workbench.system.tables import Table, read_table
from workbench.system.units import check_unit, si_factor

T = TypeVar("T")


def read_system(
    path: Path, fmu: Path | None = None, names: Mapping[str, str] | None = None
) -> System:
    """Read a system file and check it against the FMU of its observer, if that is built.

    Parameters
    ----------
    fmu : of the observer, instead of that of the file.
    names : the FMU's names of variables by ours; they win over those of the file.

    Raises
    ------
    InputError
        At the first problem: the file and key, what was found, what was expected, what to do.
    """
    file = read_table(path, "give a system file, or the name of an installed one", 'title = "..."')
    return _read(file, path, {} if fmu is None else {OBSERVER: fmu}, names or {})


def system_of(content: Mapping[str, Any], path: Path) -> System:
    """Make a system of what would stand in its file, checked as `read_system` does.

    Parameters
    ----------
    path : that refusals name.
    """
    return _read(Table(content, str(path)), path, {}, {})


def with_built(system: System, paths: Mapping[str, Path]) -> System:
    """The same system, read again, with FMUs that were built for some roles.

    Raises
    ------
    InputError
        As `read_system`.
    """
    file = read_table(system.source, "keep the file while it is used", 'title = "..."')
    return _read(file, system.source, paths, system.names)


def _read(file: Table, path: Path, built: Mapping[str, Path], names: Mapping[str, str]) -> System:
    (models,) = (entry for entry in entries(System) if entry.field == "models")
    file.refuse_unknown(dict.fromkeys(name.partition(".")[0] for name in key_names(System)))
    roles: dict[str, Model] = _field(models, file, Scope(path, None))
    roles = {
        role: replace(model, path=built.get(role, model.path)) for role, model in roles.items()
    }
    fmu = roles[OBSERVER].path
    names = {**_names(file), **names}
    description = read_description(fmu).renamed(names) if fmu is not None else None
    units = {v.name: v.unit or "1" for v in description.variables} if description else None
    scope = Scope(path, units)
    values = _values(description) if description else {}
    fields = read_fields(
        System,
        file,
        scope,
        models=roles,
        source=path,
        library=path.parent / "package.mo",
        names=names,
        values=values,
        states=description.states if description else None,
    )
    system = System(**{**fields, "values": {**values, **fields["given"]}})
    if description:
        check_model(system, description)
    for problem in scope.problems:
        raise problem
    check_references(system, description, scope.references)
    return system


def _names(file: Table) -> dict[str, str]:
    """The FMU's names of variables by ours, that a file says."""
    names: dict[str, str] = {}
    ours: dict[str, str] = {}
    places = [(file.table("variables"), name, name) for name in file.table("variables").content]
    for entry in entries(System):
        inside = typing.get_args(entry.hint)
        if not inside or inside[0] not in (Signal, EstimatedQuantity, StateNoise):
            continue
        for group in (entry.name, *entry.key.aliases):
            if group in file:
                named = file.table(group)
                places += [
                    (named.table(name), "variable", name)
                    for name, content in named.content.items()
                    if isinstance(content, dict) and "variable" in content
                ]
    for table, key, name in places:
        variable = table.take(key, str)
        if names.setdefault(name, variable) != variable or ours.setdefault(variable, name) != name:
            raise InputError(
                where=table.place(key),
                found=f"'{variable}' for '{name}', after '{names[name]}' for "
                f"'{ours.get(variable, name)}'",
                expected="one name of yours for one variable of the FMU",
                remedy="give both the same name, or remove one",
            )
    return {name: variable for name, variable in names.items() if name != variable}


def with_model(system: System, role: str, path: Path | None) -> System:
    """The same system with another FMU in a role, checked; its parameters are then those of it."""
    models = {**system.models, role: replace(system.model(role), path=path)}
    changed = replace(system, models=models)
    if role != OBSERVER or path is None:
        return changed
    description = read_description(path).renamed(system.names)
    check_model(changed, description)
    return replace(
        changed,
        values={**_values(description), **system.given},
        states=description.states if system.states is None else system.states,
    )


def _values(description: Description) -> dict[str, float]:
    return {
        v.name: float(v.start) for v in description.variables if v.scalar and v.start is not None
    }


# --- values of what is declared ---


def read(cls: type[T], table: Table, scope: Scope, name: str = "") -> T:
    """Make a value of a table within the one of a scope.

    Parameters
    ----------
    name : of the table, where its class has it as a field.

    Raises
    ------
    InputError
        At the first problem: the place, what was found, what was expected, what to do.
    """
    inner = scope.within()
    value = cls(**read_fields(cls, table, inner, name))
    if check := getattr(value, "check", None):
        check(table, inner)
    return value


def read_fields(
    cls: type, table: Table, scope: Scope, name: str = "", **given: Any
) -> dict[str, Any]:
    """Fields of a value; those that are `given` are known, or no file has them; see `read`."""
    values = scope.own
    values.update(given)
    if named := table_name_of(cls):
        values[named] = name
    known = list(key_names(cls))
    table.refuse_unknown(dict.fromkeys(key.partition(".")[0] for key in known))
    for outer in dict.fromkeys(key.partition(".")[0] for key in known if "." in key):
        own = [key.partition(".")[2] for key in known if key.startswith(f"{outer}.")]
        table.table(outer).refuse_unknown(own)
    if either := getattr(cls, "EITHER", None):
        _refuse_both(either, table)
    for entry in entries(cls):
        if entry.field not in given:
            values[entry.field] = _field(entry, table, scope)
    return values


def _refuse_both(either: Either, table: Table) -> None:
    there = [name for name in either.names if name in table]
    if len(there) != 1:
        word, names = (" and ", there) if there else (" nor ", list(either.names))
        raise InputError(
            where=table.where,
            found=("" if there else "neither ") + word.join(f"'{name}'" for name in names),
            expected=either.expected,
            remedy=either.remedy,
        )


def _field(entry: Entry, table: Table, scope: Scope) -> Any:
    declared, name = entry.key, entry.name
    if "." in name:
        outer, _, name = name.partition(".")
        table = table.table(outer)
    name = next((other for other in (name, *declared.aliases) if other in table), name)
    item = _Item(declared, table, name, scope)
    if declared.inline:
        return item.inline(kinds_of(entry.hint)[0])
    there = name in table and (scope.units is not None or not declared.of_model)
    says = there and (declared.read or _says(entry.hint, table.content[name]))
    if declared.absent is not REQUIRED and not says:
        return _absent(declared.absent, scope)
    value = declared.read(table, name, scope) if declared.read else item.value(entry.hint)
    if declared.check:
        declared.check(value, table, name, scope)
    return value


def _says(hint: Any, content: Any) -> bool:
    """Whether an entry says anything: not a table of things by name without any, or no texts."""
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if origin is tuple and inside[0] is str:
        return bool(content != [])
    by_name = bool(origin is tuple and inside and table_name_of(kinds_of(inside[0])[0]))
    return bool(content != {}) or not (by_name or origin is collections.abc.Mapping)


def _absent(absent: Any, scope: Scope) -> Any:
    if callable(absent):
        return absent(scope)
    if isinstance(absent, str) and absent.startswith("{"):
        return scope.own[absent.strip("{}")]
    return absent


@dataclass(frozen=True)
class _Item:
    """An entry of a table, as it is declared."""

    declared: Key
    table: Table
    name: str
    scope: Scope

    def value(self, hint: Any) -> Any:
        """The entry as a value of a type."""
        kinds = kinds_of(hint)
        kind, origin, inside = kinds[0], typing.get_origin(kinds[0]), typing.get_args(kinds[0])
        if origin is Annotated:
            return self._unit()
        if kind is float:
            return self._numbers([self.table.content.get(self.name)])[0]
        if kind is bool and str in kinds and isinstance(self.table.content[self.name], str):
            (text,) = self._choices([self.table.take(self.name, str)], "true, false or ")
            return text
        if kind in (bool, int):
            return self.table.take(self.name, kind)
        if kind is Path:
            return self.scope.file.parent / self.table.take(self.name, str)
        if kind is str:
            (text,) = self._choices([self.table.take(self.name, str)], "one of ")
            return text
        if kind is Expression:
            return self._formula()
        if is_table(kind):
            within = self.table.table(self.name)
            # The class that has most of the keys, of those that it may be.
            fitting = max(kinds, key=lambda kind: sum(name in within for name in key_names(kind)))
            return read(fitting, within, self.scope, self.name)
        if origin is tuple:
            return self._several(inside)
        return dict(self._entries(inside[1]))

    def inline(self, cls: type) -> Any:
        """A value whose keys stand among those of the table; None where none does and none must."""
        if self.declared.absent is None and not any(key in self.table for key in key_names(cls)):
            return None
        inner = self.scope.within()
        for entry in entries(cls):
            inner.own[entry.field] = _field(entry, self.table, inner)
        return cls(**inner.own)

    def _entries(self, hint: Any) -> Iterator[tuple[str, Any]]:
        """Entries that are alike, by name; those of the innermost table refer to `keys`."""
        within = self.table.table(self.name)
        names, keys = list(within.content), self.declared.keys
        table = is_table(kinds_of(hint)[0])
        if typing.get_origin(hint) is collections.abc.Mapping:
            pass
        elif callable(keys):
            known = list(keys(self.scope))
            try:
                within.refuse_unknown(known)
            except InputError as error:
                if self.declared.every:
                    raise
                self.scope.problems.append(error)
            names = known if self.declared.every else [name for name in names if name in known]
        elif keys:
            self.scope.references += [
                (within.table(name).where if table else within.place(name), name, keys)
                for name in names
            ]
        for name in names:
            if table:
                within.take(name, dict)
            yield name, _Item(self.declared, within, name, self.scope).value(hint)

    def _several(self, inside: tuple[Any, ...]) -> tuple[Any, ...]:
        """Tables by name, a list of tables, of numbers or of texts."""
        kind, *others = kinds_of(inside[0])
        if is_table(kind):
            if table_name_of(kind):
                return tuple(value for _, value in self._entries(inside[0]))
            return tuple(read(kind, part, self.scope) for part in self.table.tables(self.name))
        if kind is str and not others:
            return self._choices(self.table.texts(self.name), "some of ")
        items = self.table.take(self.name, list)
        if kind is not float:
            return tuple(items)
        if inside[-1] is not ... and len(items) != len(inside):
            raise self.table.wrong(self.name, f"{len(inside)} numbers")
        return self._numbers(items)

    def _unit(self) -> str:
        unit, where = self.table.take(self.name, str), self.table.place(self.name)
        if self.declared.like:
            si_factor(unit, self.scope.own[self.declared.like], where)
        else:
            check_unit(unit, where)
        return unit

    def _numbers(self, items: Iterable[Any]) -> tuple[float, ...]:
        of = self.declared.unit
        unit = of(self.scope, self.name) if callable(of) else of.format(**self.scope.own)
        if unit is None:  # that of a name that is none, which is refused when all is read
            return (math.nan,)
        numbers = tuple(self.table.quantity(self.name, item, unit) for item in items)
        if not self.declared.bounded(numbers):
            thing = f"a {'time' if unit == 's' else 'number'} above 0"
            raise self.table.wrong(
                self.name,
                self.declared.expected or ("[low, high]" if self.declared.ordered else thing),
            )
        return numbers

    def _choices(self, texts: Sequence[str], some: str) -> tuple[str, ...]:
        """Texts that may be here."""
        choices, of = self.declared.choices, self.declared.of
        for text in texts:
            if choices and text not in choices:
                raise self.table.wrong(self.name, some + ", ".join(choices))
            if of:
                self.scope.references.append((self.table.place(self.name), text, of))
        return tuple(texts)

    def _formula(self) -> Expression:
        where, of = self.table.place(self.name), self.declared.of
        formula = Expression(self.table.take(self.name, str), where)
        self.scope.references += [(where, part, of) for part in sorted(formula.names) if of]
        return formula
