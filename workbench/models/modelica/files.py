"""Which files a library is made of: its own, and those of the libraries that it uses."""

import os
import re
from pathlib import Path

from workbench.errors import InputError
from workbench.models.modelica.source import Cursor
from workbench.runtime import resources

PACKAGE = "package.mo"
# What to do about a name of the standard library that is not found.
STANDARD = (
    'write annotation(uses(Modelica(version="4.0.0"))) in the package, and set MODELICAPATH to the '
    "folder that holds the library"
)


def packages(file: Path) -> tuple[Path, ...]:
    """A library and all that it uses, directly or through others: `package.mo` of each.

    What `annotation(uses(Name(version="1.0")))` names is looked for beside the library, as
    `Name/package.mo`, then among the libraries that come with the workbench, then in the folders
    of the environment variable MODELICAPATH, as `Name/package.mo`, `Name 4.0.0/package.mo` with the
    version, or `Name.mo`. Elsewhere the version is for people.

    Parameters
    ----------
    file : `package.mo` of the library, or its only file; it comes first in what is returned.
    """
    resolved = {file: file.resolve()}
    waiting = [file]
    while waiting:
        package = waiting.pop(0)
        for name, (version, where) in _Uses(package, read(package)).names().items():
            used = _used(name, version, package, where)
            if used.resolve() not in resolved.values():
                resolved[used] = used.resolve()
                waiting.append(used)
    return tuple(resolved)


def is_installed(package: Path) -> bool:
    """Whether a library stands in a folder of MODELICAPATH: it is of others, and may be large."""
    return any(folder in package.parents for folder in _modelica_path())


def _modelica_path() -> list[Path]:
    folders = os.environ.get("MODELICAPATH", "").split(os.pathsep)
    return [Path(folder).absolute() for folder in folders if folder]


def files(package: Path) -> tuple[Path, ...]:
    """Files of one library: Modelica and order in the folder of a `package.mo`; else itself."""
    if package.name != PACKAGE:
        return (package,)
    return tuple(sorted(p for p in package.parent.rglob("*") if p.suffix in (".mo", ".order")))


def library_folder(file: Path) -> Path:
    """Folder in which libraries stand beside this one."""
    return file.parent.parent if file.name == PACKAGE else file.parent


def read(file: Path) -> str:
    """Text of a file."""
    if not file.is_file():
        raise InputError(
            where=str(file),
            found="no such file",
            expected="the package.mo of a Modelica library, or its only file",
            remedy="give its path, with --library on the command line",
        )
    marked = "a byte order mark before its text, at which the Modelica front end stops"
    try:
        text = file.read_text(encoding="utf-8")
        found = marked * text.startswith("\ufeff")
    except UnicodeDecodeError as error:
        found = f"no text ({error})"
    if found:
        raise InputError(
            where=str(file),
            found=found,
            expected="Modelica in UTF-8",
            remedy="save the file as UTF-8, without a byte order mark",
        )
    return text


class _Uses(Cursor):
    """Reads what a library says of others, whatever else is in its file."""

    def names(self) -> dict[str, tuple[str, str]]:
        """Version, and file and line, of each used library by its name."""
        names: dict[str, tuple[str, str]] = {}
        while self.token.kind != "end":
            if self.advance().text != "uses" or not self.took("("):
                continue
            while not self.took(")"):
                where, name = self.where, self.identifier()
                self.expect("(")
                version = re.search(r'version\s*=\s*"([^"]*)"', self.skip(")"))
                self.expect(")")
                names[name] = (version[1] if version else "", where)
                self.took(",")
        return names


def _used(name: str, version: str, by: Path, where: str) -> Path:
    places = [folder / name / PACKAGE for folder in (library_folder(by), resources.modelica())]
    for folder in _modelica_path():
        places += [folder / f"{name} {version}" / PACKAGE, folder / name / PACKAGE]
        places += [folder / f"{name}.mo"]
    for place in places:
        if place.is_file():
            return place
    raise InputError(
        where=where,
        found=f"uses({name}), but no such library",
        expected=f"{places[0]}, a library that comes with the workbench, or one in a folder of the "
        "environment variable MODELICAPATH",
        remedy=f"put {name} there, or set MODELICAPATH to the folder that holds it",
    )
