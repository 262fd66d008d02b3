"""What is right in Modelica, but dropped by the front end (rumoca 0.10.2)."""

from collections.abc import Iterable

from workbench.errors import InputError
from workbench.models.modelica import Library
from workbench.models.modelica.classes import Component, Modifier


def refuse_dropped(library: Library, reached: Iterable[str]) -> None:
    """Refuse what would be lost: a redeclaration, or a value.

    The redeclaration by a class that extends of what its base has from its own base; the value
    that is given together with attributes to what is inherited, or to a part of a part, as in
    `extends Part(k(max=2.0)=1.0)`.

    Raises
    ------
    InputError
        With file and line.
    """
    for name in reached:
        _refuse_redeclarations(library, name)
        for extends in library.classes[name].extends:
            _refuse_values(extends.modifier)
        for component in library.classes[name].components:
            for modification in component.modifier.inner.values():
                _refuse_values(_inside(modification))
            if "outer" in component.prefixes:
                _refuse_outer(component)


def _refuse_outer(component: Component) -> None:
    """Refuse an outer variable: the front end misses the equation that ties it to the inner one."""
    if component.type in ("Real", "Integer", "Boolean") and not component.prefixes & {
        "parameter",
        "constant",
    }:
        raise InputError(
            where=component.where,
            found=f"'outer {component.type} {component.name}'",
            expected="an outer component of a model, as the Modelica front end needs",
            remedy=f"put '{component.name}' into a model, and declare that inner and outer",
        )


def _refuse_redeclarations(library: Library, name: str) -> None:
    for extends, base in zip(library.classes[name].extends, library.bases(name), strict=True):
        if base not in library.classes:
            continue
        inherited = set(library.components(base))
        inherited -= {component.name for component in library.classes[base].components}
        for slot, modifier in extends.modifier.inner.items():
            if modifier.redeclared is not None and slot in inherited:
                raise InputError(
                    where=modifier.where,
                    found=f"a redeclaration of '{slot}', which {base} inherits",
                    expected="one of a component that the extended class itself declares, as "
                    "the Modelica front end needs",
                    remedy=f"declare '{slot}' in {base}, or extend the class that declares it",
                )


def _refuse_values(modifier: Modifier) -> None:
    """Refuse values beside attributes at any depth below that of a declaration itself."""
    for name, given in modifier.inner.items():
        if given.value and given.inner:
            raise InputError(
                where=given.where,
                found=f"a value of '{name}' together with {', '.join(given.inner)}",
                expected="one of the two, as the Modelica front end loses the value",
                remedy=f"give '{name}' its value alone, or its attributes in a class of its own",
            )
        _refuse_values(_inside(given))


def _inside(modifier: Modifier) -> Modifier:
    return modifier if modifier.redeclared is None else modifier.redeclared.modifier
