"""Modelica source of a base model with effects of its library, and its FMU.

Needs the extra `[compiler]` to build; sources can be written without it.
"""

import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from workbench import shelf
from workbench.diagnosis.catalogue import Effect
from workbench.diagnosis.slots import Slot, read_slots
from workbench.errors import InputError
from workbench.modelica import PACKAGE, Library, files, packages

_USED = "Used"  # before the name of another library


def component(name: str) -> str:
    """Name of a class's component within its slot.

    >>> component("Tank.Effects.DryFriction")
    'dryFriction'
    """
    short = name.rpartition(".")[2]
    return short[0].lower() + short[1:]


def variables(effect: Effect, parameter: str) -> tuple[str, ...]:
    """Names in the FMU of one parameter of an effect, one for each of its slots."""
    return tuple(f"{slot}.{component(effect.name)}.{parameter}" for slot in effect.slots)


def source(
    library: Library,
    base: str,
    name: str,
    effects: Sequence[Effect],
    values: Mapping[str, Mapping[str, float]],
    parameters: Mapping[str, float],
    about: str,
) -> str:
    """Write the Modelica source of the extended model.

    Parameters
    ----------
    base : name of the model that is extended.
    name : of the extended model.
    effects : to plug in, in this order within a slot.
    values : by effect and parameter, SI; parameters that are not named keep their defaults.
    parameters : of the base model itself, that differ from its defaults.
    about : one line, for the documentation.

    Raises
    ------
    InputError
        If effects of one slot cannot stand together.
    """
    nested: list[str] = []
    used: set[str] = set()
    redeclared = [f"    {parameter}={float(value)!r}" for parameter, value in parameters.items()]
    for slot in read_slots(library, base):
        inside = [effect for effect in effects if slot.name in effect.slots]
        if not inside:
            continue
        label = slot.name[0].upper() + slot.name[1:]
        if label == library.name:
            label += "Slot"  # it would hide the library
        used |= {one.partition(".")[0] for one in (slot.partial, slot.nominal)} - {library.name}
        slot = replace(
            slot, partial=_written(slot.partial, library), nominal=_written(slot.nominal, library)
        )
        if slot.chained or len(inside) == 1:
            nested.append(_chain(label, slot, inside, values))
        else:
            nested.append(_sum(label, slot, inside, values))
        redeclared.append(f"    redeclare {label} {slot.name}")
    modifiers = ",\n".join(redeclared)
    return (
        f'model {name} "{about}"\n'
        + "".join(f"  import {_USED}{one} = {one};\n" for one in sorted(used))
        + f"  extends {library.find(base).name}(\n{modifiers});\n\n"
        + "\n".join(nested)
        + f"end {name};\n"
    )


def _written(name: str, library: Library) -> str:
    """A class as the extended model names it, in which the library may hide another one."""
    return name if name.partition(".")[0] == library.name else _USED + name


def _chain(
    label: str,
    slot: Slot,
    effects: Sequence[Effect],
    values: Mapping[str, Mapping[str, float]],
) -> str:
    """Class whose effects hand on what goes in; of one effect, any outputs."""
    lines = []
    before = {inlet: inlet for inlet in slot.inputs}
    outlets: Mapping[str, str] = {}
    for effect in effects:
        lines.append(_declaration(effect.model, before, values.get(effect.name, {})))
        outlets = {outlet: f"{component(effect.name)}.{outlet}" for outlet in slot.outputs}
        before |= dict(zip(slot.inputs, outlets.values(), strict=False))
    return _class(label, slot, effects, lines, outlets)


def _sum(
    label: str,
    slot: Slot,
    effects: Sequence[Effect],
    values: Mapping[str, Mapping[str, float]],
) -> str:
    """Class whose effects each change the nominal output, which changes add up."""
    if not slot.settled:
        raise InputError(
            where=f"slot '{slot.name}'",
            found=f"{' and '.join(effect.name for effect in effects)} beside a {slot.nominal} "
            "that has parameters of its own in the base model",
            expected="one effect in this slot, whose outputs are of another kind than its inputs",
            remedy=f"choose one of them, or make {slot.nominal} with those parameters a class",
        )
    before = {inlet: inlet for inlet in slot.inputs}
    lines = [_declaration(slot.nominal, before, {})]
    lines += [_declaration(one.model, before, values.get(one.name, {})) for one in effects]
    nominal = component(slot.nominal)
    outlets = {
        outlet: " + ".join(
            [
                f"{nominal}.{outlet}",
                *(f"({component(e.name)}.{outlet} - {nominal}.{outlet})" for e in effects),
            ]
        )
        for outlet in slot.outputs
    }
    return _class(label, slot, effects, lines, outlets)


def _declaration(model: str, inputs: Mapping[str, str], values: Mapping[str, float]) -> str:
    bindings = [f"{name}={value}" for name, value in inputs.items()]
    bindings += [f"{name}={float(value)!r}" for name, value in values.items()]
    return f"    {model} {component(model)}({', '.join(bindings)});"


def _class(
    label: str,
    slot: Slot,
    effects: Sequence[Effect],
    declarations: Sequence[str],
    outlets: Mapping[str, str],
) -> str:
    return "\n".join(
        [
            f'  model {label} "{", ".join(effect.name for effect in effects)}"',
            f"    extends {slot.partial};",
            *declarations,
            "  equation",
            *(f"    {outlet} = {value};" for outlet, value in outlets.items()),
            f"  end {label};\n",
        ]
    )


def build(library: Library, name: str, text: str, fmu: Path, *, every_platform: bool) -> None:
    """Compile the source of an extended model to an FMU; needs the extra [compiler].

    An FMU that was built before, of the same sources, is taken from where it is kept.

    Parameters
    ----------
    library : that the source extends; its files are left alone.
    every_platform : for all platforms, or only for this machine's.

    Raises
    ------
    InputError
        If the source has errors.
    """

    def make(path: Path) -> None:
        from workbench import compiler  # an extra: everything else runs without it

        platforms = list(compiler.PLATFORMS) if every_platform else [compiler.native()]
        with tempfile.TemporaryDirectory() as scratch:
            package = Path(scratch) / library.name / PACKAGE
            _copy(library.file, package)
            for used in packages(library.file)[1:]:
                _copy(used, Path(scratch) / used.parent.name / PACKAGE)
            package.with_name(f"{name}.mo").write_text(f"within {library.name};\n{text}")
            compiler.build(package, f"{library.name}.{name}", path, platforms=platforms)

    shelf.fetch(shelf.key(library.file, name, text, f"{every_platform}"), fmu, make)


def _copy(library: Path, package: Path) -> None:
    """Copy a library; one of a single file becomes the `package.mo` of a folder."""
    for file in files(library):
        inside = PACKAGE if file == library else file.relative_to(library.parent)
        copy = package.parent / inside
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, copy)
