"""Modelica classes that are generated: probes, free functions and closed forms in a slot."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from workbench.diagnosis.effects.extension import USED, copied, written
from workbench.diagnosis.laws.places import CLOCK, LOST, LawInfluence, Place
from workbench.models.modelica import Library
from workbench.runtime.files import write_whole

PACKAGE = "Proposed"  # of the classes, within the library


@dataclass(frozen=True)
class LawClass:
    """A generated class."""

    name: str
    about: str
    place: Place
    declarations: tuple[str, ...]  # lines of its parameters and variables
    equations: tuple[str, ...]  # lines, besides those of its outputs
    change: str  # expression of what is added to the output of its place
    annotation: str = ""  # content of its `annotation`, empty if it has none

    def source(self, library: Library) -> str:
        """The class in Modelica."""
        slot = self.place.slot
        lines = [
            f'  model {self.name} "{self.about}"',
            f"    extends {written(slot.partial, library)};",
            *(f"    {line}" for line in self.declarations),
        ]
        if slot.chained:
            nominal = dict(zip(slot.outputs, slot.inputs, strict=False))
        else:
            bindings = ", ".join(f"{name}={name}" for name in slot.inputs)
            nominal = {output: f"unchanged.{output}" for output in slot.outputs}
            lines += [
                "  protected",
                f"    {written(slot.nominal, library)} unchanged({bindings}) "
                '"As it is without this law";',
            ]
        lines += ["  equation", *(f"    {line}" for line in self.equations)]
        for output, value in nominal.items():
            change = f" + {self.change}" if output == self.place.output.name else ""
            lines.append(f"    {output} = {value}{change};")
        if self.annotation:
            lines.append(f"    annotation ({self.annotation});")
        return "\n".join([*lines, f"  end {self.name};"])


def clock(influence: LawInfluence | None) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Declarations and equations that an influence needs."""
    if influence is None or not influence.rate:
        return (), ()
    unit = influence.factors[0].unit if influence.kind == "rate" else influence.unit
    known = ", ".join(filter(None, (unit_of(unit), "start=0.0", "fixed=true")))
    declared = [f'Real {CLOCK}({known}) "Of {influence.text}";']
    if influence.cools:
        value = number(influence.span)
        declared.insert(
            0, f'parameter Real {LOST}(unit="s") = {value} "Time constant of what is lost";'
        )
    return tuple(declared), (f"der({CLOCK}) = {influence.rate};",)


def package(library: Library, classes: Iterable[LawClass]) -> str:
    """Source of a package with classes of slots of a library."""
    every = list(classes)
    slots = [law.place.slot for law in every]
    names = {name.partition(".")[0] for slot in slots for name in (slot.partial, slot.nominal)}
    return "\n".join(
        [
            f"within {library.name};",
            f'package {PACKAGE} "Laws that were proposed from recordings: not known physics"',
            *(f"  import {USED}{name} = {name};" for name in sorted(names - {library.name})),
            *(law.source(library) for law in every),
            f"end {PACKAGE};\n",
        ]
    )


def extended_library(library: Library, classes: Iterable[LawClass], folder: Path) -> Library:
    """A copy of a library, in a folder, that has such a package."""
    file = copied(library, folder)
    generated = file.with_name(f"{PACKAGE}.mo")
    write_whole(generated, package(library, classes))
    return library.extended(file, generated)


def number(value: float) -> str:
    """A number as Modelica writes it."""
    return repr(float(value))


def unit_of(unit: str) -> str:
    """Modifier of a unit that may not be known.

    >>> unit_of("N"), unit_of("")
    ('unit="N"', '')
    """
    return f'unit="{unit}"' if unit else ""


def effect(
    sizes: tuple[str, ...], matters: float, slot: str, shapes: Mapping[str, tuple[float, ...]]
) -> str:
    """Annotation of an effect."""
    names = ", ".join(f'"{size}"' for size in sizes)
    size = names if len(sizes) == 1 else f"{{{names}}}"
    parts = [f"size={size}", f"matters={number(matters)}", f'slots={{"{slot}"}}']
    if shapes:
        tried = ", ".join(
            f"{name}={{{', '.join(map(number, values))}}}" for name, values in shapes.items()
        )
        parts.append(f"shapes({tried})")
    parts.append('separation="recordings in which what it depends on goes otherwise"')
    return f"__Workbench(effect({', '.join(parts)}))"
