"""Which files a library is made of: its own, and those of the libraries that it uses."""

from pathlib import Path

from workbench.errors import InputError
from workbench.models.modelica.tokens import Cursor
from workbench.runtime import resources

PACKAGE = "package.mo"


def packages(file: Path) -> tuple[Path, ...]:
    """A library and all that it uses, directly or through others: `package.mo` of each.

    What `annotation(uses(Name(version="1.0")))` names is looked for beside the library, as
    `Name/package.mo`, then among the libraries that come with the workbench. The version is
    for people.

    Parameters
    ----------
    file : `package.mo` of the library, or its only file; it comes first in what is returned.

    Raises
    ------
    InputError
        If there is no such file, or a library that it uses is in neither place.
    """
    places = {file: file.resolve()}
    waiting = [file]
    while waiting:
        package = waiting.pop(0)
        for name, where in _Uses(package, read(package)).names().items():
            used = _used(name, package, where)
            if used.resolve() not in places.values():
                places[used] = used.resolve()
                waiting.append(used)
    return tuple(places)


def files(package: Path) -> tuple[Path, ...]:
    """Files of one library: Modelica and order in the folder of a `package.mo`; else itself."""
    if package.name != PACKAGE:
        return (package,)
    return tuple(sorted(p for p in package.parent.rglob("*") if p.suffix in (".mo", ".order")))


def beside(file: Path) -> Path:
    """Folder in which libraries stand beside this one."""
    return file.parent.parent if file.name == PACKAGE else file.parent


def read(file: Path) -> str:
    """Text of a file.

    Raises
    ------
    InputError
        If there is none, or it is not UTF-8.
    """
    if not file.is_file():
        raise InputError(
            where=str(file),
            found="no such file",
            expected="the package.mo of a Modelica library, or its only file",
            remedy="give its path, with --library on the command line",
        )
    try:
        return file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            where=str(file),
            found=f"no text ({error})",
            expected="Modelica in UTF-8",
            remedy="save the file as UTF-8",
        ) from None


class _Uses(Cursor):
    """Reads what a library says of others, whatever else is in its file."""

    def names(self) -> dict[str, str]:
        """Names of used libraries, each with file and line."""
        names: dict[str, str] = {}
        while self.token.kind != "end":
            if self.advance().text != "uses" or not self.took("("):
                continue
            while not self.took(")"):
                where = self.where
                names[self.identifier()] = where
                self.group()
                self.took(",")
        return names


def _used(name: str, by: Path, where: str) -> Path:
    places = [folder / name / PACKAGE for folder in (beside(by), resources.modelica())]
    for place in places:
        if place.is_file():
            return place
    raise InputError(
        where=where,
        found=f"uses({name}), but no such library",
        expected=f"{places[0]}, or a library that comes with the workbench",
        remedy=f"put {name} there, or remove it from the annotation",
    )
