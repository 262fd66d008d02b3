"""Modelica source of a base model with effects of its library, and its FMU.

Needs the extra `[compiler]` to build; sources can be written without it.
"""

import shutil
import tempfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.effects.slots import Slot, read_slots
from workbench.errors import InputError
from workbench.models import fmu_cache
from workbench.models.modelica import PACKAGE, Library, files, packages

USED = "Used"  # before the name of another library


def component(name: str) -> str:
    """Name of a class's component within its slot.

    >>> component("Tank.Effects.DryFriction")
    'dryFriction'
    """
    short = name.rpartition(".")[2]
    return short[0].lower() + short[1:]


def variables(effect: Effect, parameter: str) -> tuple[str, ...]:
    """Names in the FMU of one parameter of an effect, one for each of its slots.

    Of a clock or a sensor, which no FMU has, its own name.
    """
    if effect.parameter:
        own = effect.parameter
        return (own if parameter in effect.sizes else f"{own}.{parameter}",)
    if not effect.of_library:
        return (f"{effect.name}.{parameter}",)
    element = f"[{effect.place}]" if effect.place else ""
    return tuple(
        f"{slot}.{component(effect.class_name)}.{parameter}{element}" for slot in effect.slots
    )


def sizes_by_component(effects: Iterable[Effect]) -> dict[str, list[str]]:
    """Variables of the FMU that are the sizes of a component: without them it is nominal."""
    by_component: dict[str, list[str]] = {}
    for effect in (effect for effect in effects if effect.of_library):
        for name in (name for size in effect.sizes for name in variables(effect, size)):
            by_component.setdefault(name.rpartition(".")[0], []).append(name)
    return by_component


def parameter_of(effect: Effect, variable: str) -> str:
    """Parameter of an effect that a variable of the FMU is, empty if it is none."""
    parameter = variable.rpartition(".")[2].partition("[")[0]
    return parameter if variable in variables(effect, parameter) else ""


@dataclass(frozen=True, eq=False)
class ExtendedModel:
    """A model of a library with effects plugged in."""

    library: Library
    base: str  # name of the model that is extended
    name: str  # of the extended model
    effects: Sequence[Effect]  # to plug in, in this order within a slot
    about: str  # one line, for the documentation
    # by effect and parameter, SI; parameters that are not named keep their defaults
    values: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    # of the base model itself, that differ from its defaults; of an array, all entries
    parameters: Mapping[str, float] = field(default_factory=dict)

    def source(self) -> str:
        """Write the Modelica source.

        Raises
        ------
        InputError
            If effects of one slot cannot stand together.
        """
        library, nested = self.library, []
        used: set[str] = set()
        redeclared = [f"    {modifier}" for modifier in _modifiers(self.parameters)]
        for slot in read_slots(library, self.base):
            plugged = [effect for effect in self.effects if slot.name in effect.slots]
            if not (inside := _bindings(plugged, self.values)):
                continue
            label = slot.name[0].upper() + slot.name[1:]
            if label == library.name:
                label += "Slot"  # it would hide the library
            used |= {name.partition(".")[0] for name in (slot.partial, slot.nominal)}
            slot = replace(
                slot, partial=written(slot.partial, library), nominal=written(slot.nominal, library)
            )
            write = _chain if slot.chained or len(inside) == 1 else _sum
            nested.append(write(label, slot, inside))
            redeclared.append(f"    redeclare {label} {slot.name}")
        modifiers = ",\n".join(redeclared)
        return (
            f'model {self.name} "{self.about}"\n'
            + "".join(
                f"  import {USED}{name} = {name};\n" for name in sorted(used - {library.name})
            )
            + f"  extends {library.find(self.base).name}(\n{modifiers});\n\n"
            + "\n".join(nested)
            + f"end {self.name};\n"
        )


def _modifiers(parameters: Mapping[str, float]) -> list[str]:
    """Parameters as a modification has them: of an array, all entries at once, which are there."""
    arrays: dict[str, dict[int, float]] = {}
    written = {}
    for name, value in parameters.items():
        array, _, place = name.partition("[")
        if place:
            arrays.setdefault(array, {})[int(place.rstrip("]"))] = value
        else:
            written[name] = repr(float(value))
    for array, entries in arrays.items():
        values = ", ".join(repr(float(entries[place])) for place in sorted(entries))
        written[array] = f"{{{values}}}"
    return [f"{name}={value}" for name, value in written.items()]


def written(name: str, library: Library) -> str:
    """A class as the extended model names it, in which the library may hide another one."""
    return name if name.partition(".")[0] == library.name else USED + name


def _chain(label: str, slot: Slot, given: Mapping[str, Mapping[str, str]]) -> str:
    """Class whose effects hand on what goes in; of one effect, any outputs.

    Parameters
    ----------
    given : values of parameters, as they are written, by class of the effects.
    """
    lines = []
    before = {name: name for name in (*slot.counts, *slot.inputs)}
    outlets: Mapping[str, str] = {}
    for model, values in given.items():
        lines.append(_declaration(model, {**before, **values}))
        outlets = {outlet: f"{component(model)}.{outlet}" for outlet in slot.outputs}
        before |= dict(zip(slot.inputs, outlets.values(), strict=False)) | _handed(slot, model)
    return _class(label, slot, given, lines, outlets)


def _sum(label: str, slot: Slot, given: Mapping[str, Mapping[str, str]]) -> str:
    """Class whose effects each change the nominal output, which changes add up; see `_chain`."""
    if not slot.settled:
        raise InputError(
            where=f"slot '{slot.name}'",
            found=f"{' and '.join(map(_short, given))} beside a {slot.nominal} "
            "that has parameters of its own in the base model",
            expected="one effect in this slot, whose outputs are of another kind than its inputs",
            remedy=f"choose one of them, or make {slot.nominal} with those parameters a class",
        )
    before = {name: name for name in (*slot.counts, *slot.inputs)}
    lines = [_declaration(slot.nominal, before)]
    for model, values in given.items():
        lines.append(_declaration(model, {**before, **values}))
        before |= _handed(slot, model)
    nominal = component(slot.nominal)
    outlets = {
        outlet: " + ".join(
            [
                f"{nominal}.{outlet}",
                *(f"({component(model)}.{outlet} - {nominal}.{outlet})" for model in given),
            ]
        )
        for outlet in slot.outputs
    }
    return _class(label, slot, given, lines, outlets)


def _bindings(
    effects: Sequence[Effect], values: Mapping[str, Mapping[str, float]]
) -> dict[str, dict[str, str]]:
    """Values of parameters, as they are written, by class; those of its places in one array."""
    arrays: dict[str, dict[str, list[float]]] = {}
    for effect in effects:
        of_class = arrays.setdefault(effect.model, {})
        for name, value in values.get(effect.name, {}).items():
            array = of_class.setdefault(name, [0.0] * max(1, effect.places))
            array[effect.place - 1] = float(value)
    placed = {effect.model for effect in effects if effect.place}
    return {
        model: {
            name: f"{{{', '.join(map(repr, array))}}}" if model in placed else repr(array[0])
            for name, array in of_class.items()
        }
        for model, of_class in arrays.items()
    }


def _declaration(model: str, bindings: Mapping[str, str]) -> str:
    given = ", ".join(f"{name}={value}" for name, value in bindings.items())
    return f"    {model} {component(model)}({given});"


def _handed(slot: Slot, model: str) -> dict[str, str]:
    """Inputs of the next one in a slot, of what an effect hands on."""
    return {inlet: f"{component(model)}.{outlet}" for outlet, inlet in slot.handed.items()}


def _short(model: str) -> str:
    return model.rpartition(".")[2]


def _class(
    label: str,
    slot: Slot,
    models: Collection[str],
    declarations: Sequence[str],
    outlets: Mapping[str, str],
) -> str:
    *_, last = models
    handed = ", ".join(f"{outlet}={component(last)}.{outlet}" for outlet in slot.handed)
    return "\n".join(
        [
            f'  model {label} "{", ".join(map(_short, models))}"',
            f"    extends {slot.partial}{f'({handed})' if handed else ''};",
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
    """

    def make(path: Path) -> None:
        from workbench.models import compiler  # an extra: everything else runs without it

        platforms = list(compiler.PLATFORMS) if every_platform else [compiler.native()]
        with tempfile.TemporaryDirectory() as scratch:
            package = copied(library, Path(scratch))
            package.with_name(f"{name}.mo").write_text(f"within {library.name};\n{text}")
            compiler.build(package, f"{library.name}.{name}", path, platforms=platforms)

    fmu_cache.fetch(fmu_cache.key(library.file, name, text, f"{every_platform}"), fmu, make)


def copied(library: Library, folder: Path) -> Path:
    """Copy a library and those that it uses into a folder; returns its `package.mo` there."""
    package = folder / library.name / PACKAGE
    _copy(library.file, package)
    for used in packages(library.file)[1:]:
        _copy(used, folder / used.parent.name / PACKAGE)
    return package


def _copy(library: Path, package: Path) -> None:
    """Copy a library; one of a single file becomes the `package.mo` of a folder."""
    for file in files(library):
        inside = PACKAGE if file == library else file.relative_to(library.parent)
        copy = package.parent / inside
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, copy)
