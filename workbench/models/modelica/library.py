"""Libraries of Modelica classes: files and folders, and what a name means.

Source: Modelica Language Specification 3.6, sections 5.3 (lookup of names) and 13.4 (files).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from workbench.errors import InputError, unknown_name
from workbench.models.modelica.classes import Class, Component, Modifier
from workbench.models.modelica.files import PACKAGE, is_installed, packages, read
from workbench.models.modelica.source import DEEPEST, Reader


class _Classes(dict[str, Class]):
    """Classes by dotted name; those of installed libraries are read when they are asked for.

    Walking through it gives those that have been read.
    """

    def __init__(self, installed: Sequence[Path]) -> None:
        super().__init__()
        self._installed = {_library_name(file): file for file in installed}
        self._absent: set[str] = set()

    def __contains__(self, name: object) -> bool:
        if super().__contains__(name):
            return True
        if not isinstance(name, str) or name.partition(".")[0] not in self._installed:
            return False
        if name not in self._absent:
            self._read(name)
        return super().__contains__(name)

    def __missing__(self, name: str) -> Class:
        if name in self:
            return self[name]
        raise KeyError(name)

    def get(self, name: str, default: Any = None) -> Any:
        """The class of a name, or `default`."""
        return super().get(name, default) if name in self else default

    def beside(self, more: Iterable[Class]) -> "_Classes":
        """The same with some more."""
        other = copy(self)
        other._absent = set(self._absent)
        other.update((cls.name, cls) for cls in more)
        return other

    def _read(self, name: str) -> None:
        """Read the files on the way to a class: of its library, of each package, and its own."""
        self._absent.add(name)
        root, *parts = name.split(".")
        file = self._installed[root]
        if not super().__contains__(root):
            self._take(file, "")
        enclosing = root
        for part in parts:
            dotted = f"{enclosing}.{part}"
            if not super().__contains__(dotted):
                if file.name != PACKAGE:
                    return
                places = (file.parent / part / PACKAGE, file.parent / f"{part}.mo")
                file = next((place for place in places if place.is_file()), file)
                if file not in places:
                    return
                self._take(file, enclosing)
            else:
                file = Path(self[dotted].where.rpartition(":")[0])
                if part not in (file.stem, file.parent.name):
                    return  # a class within a file has all others within it in that file, too
            enclosing = dotted

    def _take(self, file: Path, enclosing: str) -> None:
        for cls in Reader(file, read(file)).file(enclosing):
            self.setdefault(cls.name, cls)


def _library_name(file: Path) -> str:
    """Name of a library by its file, whose folder may bear the version, too."""
    return file.parent.name.partition(" ")[0] if file.name == PACKAGE else file.stem


class Library:
    """The classes of a Modelica library and of those that it uses, and what their names mean.

    Parameters
    ----------
    file : `package.mo` of the library, or its only file.
    classes : all, in the order of `package.order` and of the files; those of used libraries last.
    installed : libraries of MODELICAPATH that it uses; their classes are read when they are named.
    """

    def __init__(self, file: Path, classes: list[Class], installed: Sequence[Path] = ()) -> None:
        self.file = file
        self.name = classes[0].name  # of the library
        self.classes = _Classes(installed)  # by dotted name
        for cls in classes:
            if cls.name in self.classes:
                raise InputError(
                    where=cls.where,
                    found=f"a second class {cls.name}",
                    expected=f"one, which is in {self.classes[cls.name].where}",
                    remedy="remove one of the two, or rename it",
                )
            self.classes[cls.name] = cls
        self._bases: dict[str, tuple[str, ...]] = {}

    def extended(self, place: Path, more: Path) -> "Library":
        """The library at the place of a copy, which has one file more beside its `package.mo`."""
        other = copy(self)
        other.file, other._bases = place, {}
        other.classes = self.classes.beside(_read(more, self.name))
        return other

    def find(self, name: str) -> Class:
        """The class of a name, dotted from the library's name on, or from what follows it."""
        for dotted in (name, f"{self.name}.{name}"):
            if dotted in self.classes:
                return self.classes[dotted]
        raise unknown_name(
            f"{self.name}.{name}",
            self.classes,
            where=str(self.file),
            found=f"no class '{name}'",
            expected=f"a class of {self.name}",
            remedy="correct the name, or give another library",
        )

    def resolve(self, name: str, scope: str) -> str:
        """Dotted name of what `name` means in a class; `name` itself if it is of no class here."""
        head, *members = name.removeprefix(".").split(".")
        scopes = [""] if name.startswith(".") else _outward(scope)
        full_name = next((visible for at in scopes if (visible := self._visible(head, at))), "")
        if full_name not in self.classes:
            return ".".join([full_name or head, *members])
        for part in members:
            if not (inside := self.inside(part, full_name)):
                hidden = f"; to mean the library {head}, import it" if head != full_name else ""
                raise InputError(
                    where=self.classes[scope].where,
                    found=f"'{name}', but {full_name} has no class '{part}'",
                    expected="a class of the library",
                    remedy=f"correct the name{hidden}",
                )
            full_name = inside
        return full_name

    def bases(self, name: str) -> tuple[str, ...]:
        """Dotted names of what a class extends directly."""
        if name not in self._bases:
            self._bases[name] = ()  # while they are looked up, nothing is inherited from them
            self._bases[name] = tuple(
                self.resolve(extend.name, name) for extend in self.classes[name].extends
            )
        return self._bases[name]

    def ancestors(self, name: str) -> tuple[str, ...]:
        """Dotted names of what a class extends, directly or through others.

        Raises
        ------
        InputError
            If a class extends itself, or one of them does.
        """
        return tuple(dict.fromkeys(self._ancestors(name, (name,))))

    def _ancestors(self, name: str, below: tuple[str, ...]) -> Iterator[str]:
        for base in self.bases(name):
            if base in below:
                way = below[below.index(base) + 1 :]
                by = f", by {', '.join(way)}" if way else ""
                raise InputError(
                    where=self.classes[base].where,
                    found=f"{base} extends itself{by}",
                    expected="a class that ends in one without 'extends'",
                    remedy="correct what it extends",
                )
            if len(below) > DEEPEST:
                raise InputError(
                    where=self.classes[base].where,
                    found=f"{base}, which {len(below)} classes extend one after the other",
                    expected=f"{DEEPEST} at most",
                    remedy="extend fewer in a line",
                )
            if base in self.classes:
                yield base
                yield from self._ancestors(base, (*below, base))

    def components(self, name: str) -> dict[str, Component]:
        """Components of a class, inherited ones first, with the types and values it gives them."""
        self.ancestors(name)  # refuses a class that extends itself
        components: dict[str, Component] = {}
        for base, dotted in zip(self.classes[name].extends, self.bases(name), strict=True):
            inherited = self.components(dotted) if dotted in self.classes else {}
            for key, component in self.modified(inherited, base.modifier).items():
                modifier = component.modifier
                if key in components:  # a class may be inherited on two ways
                    modifier = _merge(components[key].modifier, modifier)
                components[key] = replace(component, modifier=modifier)
        return components | {
            component.name: component for component in self.classes[name].components
        }

    def modified(
        self, components: Mapping[str, Component], modifier: Modifier
    ) -> dict[str, Component]:
        """Components of a class as a modifier leaves them; what it names and is none is ignored."""
        modified = dict(components)
        for key, modification in modifier.inner.items():
            new = modification.redeclared
            if key in modified and new is None:
                modified[key] = replace(
                    modified[key], modifier=_merge(modified[key].modifier, modification)
                )
            elif key in modified and new is not None:
                modified[key] = self._redeclare(modified[key], new)
            elif new is not None:  # a class, of which components may be
                for name, old in components.items():
                    if self.resolve(old.type, old.owner).rpartition(".")[2] == key:
                        modified[name] = replace(
                            modified[name], type=self._absolute(new.type, new.owner)
                        )
        return modified

    def _redeclare(self, old: Component, new: Component) -> Component:
        constraint, scope = old.constraint or old.type, old.owner
        if new.constraint:
            constraint, scope = new.constraint, new.owner
        return replace(
            old,
            type=self._absolute(new.type, new.owner),
            prefixes=(old.prefixes - {"replaceable"}) | (new.prefixes - {"redeclare"}),
            constraint=self._absolute(constraint, scope),
            modifier=_merge(old.constraining, new.modifier),
        )

    def _absolute(self, name: str, scope: str) -> str:
        """A name that means in any scope what `name` means in one."""
        full_name = self.resolve(name, scope)
        return f".{full_name}" if full_name in self.classes else name

    def part(self, name: str, path: Sequence[str]) -> Component | None:
        """Component of a class, or of a component of it, by its path; None if there is none."""
        modifier, component = Modifier(), None
        for part in path:
            parts = self.components(name) if name in self.classes else {}
            component = self.modified(parts, modifier).get(part)
            if component is None:
                return None
            name, modifier = self.resolve(component.type, component.owner), component.modifier
        return component

    def unit(self, component: Component) -> str:
        """Unit of a component; where it has none, the name of the type that could have one."""
        modifier, name, scope = component.modifier, component.type, component.owner
        candidate = ""
        while "unit" not in modifier.inner:
            name = self.resolve(name, scope)
            if name not in self.classes or not self.bases(name):
                return candidate or name
            self.ancestors(name)  # refuses a type that is its own
            candidate, scope, base = name, name, self.classes[name].extends[0]
            modifier, name = base.modifier, base.name
        return modifier.inner["unit"].value.strip('"')

    def _visible(self, name: str, scope: str) -> str:
        """Class of a simple name, by the declarations and imports of one scope; empty if none."""
        if full_name := self.inside(name, scope):
            return full_name
        for alias, target in self.classes[scope].imports if scope else ():
            if alias == name:
                return target.removeprefix(".")
            if alias == "*" and (full_name := self.inside(name, target)):
                return full_name
        return ""

    def inside(self, name: str, of: str) -> str:
        """Class within another one, or within what that extends; empty if none."""
        holders = (of, *self.ancestors(of)) if of in self.classes else (of,)
        inside = (f"{holder}.{name}".removeprefix(".") for holder in holders)
        return next((name for name in inside if name in self.classes), "")


def read_library(file: Path) -> Library:
    """Read a Modelica library, and those that it uses.

    Parameters
    ----------
    file : `package.mo` of a library of folders and files, or a library of one file.

    Raises
    ------
    InputError
        With file and line, if something is not Modelica, or not in its place; if a library that it
        uses is not found.
    """
    own: list[Path] = []
    installed: list[Path] = []
    for package in packages(file):
        (installed if package != file and is_installed(package) else own).append(package)
    return Library(file, [cls for package in own for cls in _read(package, "")], installed)


@lru_cache(maxsize=1024)  # files: a campaign, and each command of a session, reads them anew
def _classes(file: Path, text: str, enclosing: str) -> tuple[Class, ...]:
    """Classes of a file with this text."""
    return tuple(Reader(file, text).file(enclosing))


def _read(file: Path, enclosing: str) -> Iterator[Class]:
    """Classes of a file and, of a package.mo, of all files and folders beside it."""
    classes = _classes(file, read(file), enclosing)
    name = classes[0].name
    is_package = file.name == "package.mo"
    expected = file.parent.name if is_package else file.stem
    if enclosing and name.rpartition(".")[2] != expected:
        raise InputError(
            where=classes[0].where,
            found=f"class {name}",
            expected=f"a class named {expected}, as the file or folder is",
            remedy="rename one of the two",
        )
    yield from classes
    if is_package:
        children = {path.stem: path for path in file.parent.glob("*.mo") if path != file}
        children |= {path.parent.name: path for path in file.parent.glob("*/package.mo")}
        listing = file.with_name("package.order")
        order = listing.read_text().split() if listing.is_file() else []
        for child in sorted(children, key=lambda c: (order.index(c) if c in order else 1e9, c)):
            yield from _read(children[child], name)


def _outward(scope: str) -> list[str]:
    """A class, the classes around it, and the level of the library itself."""
    parts = scope.split(".")
    return [".".join(parts[:count]) for count in range(len(parts), -1, -1)]


def _merge(old: Modifier, new: Modifier) -> Modifier:
    inner = dict(old.inner)
    for name, modification in new.inner.items():
        inner[name] = _merge(inner[name], modification) if name in inner else modification
    return Modifier(
        value=new.value or old.value,
        inner=inner,
        where=new.where or old.where,
        final=new.final or old.final,
        redeclared=new.redeclared or old.redeclared,
    )
