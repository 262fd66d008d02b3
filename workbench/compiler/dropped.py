"""What is right in Modelica, but dropped by the front end without a word (rumoca 0.10.2)."""

from collections.abc import Iterable

from workbench.errors import InputError
from workbench.modelica import Library


def refuse_dropped(library: Library, reached: Iterable[str]) -> None:
    """Refuse a redeclaration, by a class that extends, of what its base has from its own base.

    Raises
    ------
    InputError
        With file and line.
    """
    for name in reached:
        for extends, kind in zip(library.classes[name].extends, library.bases(name), strict=True):
            if kind not in library.classes:
                continue
            inherited = set(library.components(kind))
            inherited -= {one.name for one in library.classes[kind].components}
            for slot, modifier in extends.modifier.inner.items():
                if modifier.redeclared is not None and slot in inherited:
                    raise InputError(
                        where=modifier.where,
                        found=f"a redeclaration of '{slot}', which {kind} inherits",
                        expected="one of a component that the extended class itself declares, as "
                        "the Modelica front end needs",
                        remedy=f"declare '{slot}' in {kind}, or extend the class that declares it",
                    )
