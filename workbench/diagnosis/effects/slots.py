"""Slots of a base model: its replaceable components, and how effects in one of them stand together.

All follows from the partial class that constrains a slot. Where each of its outputs is of the same
kind as the input of its place, values go in and come out, and effects form a chain: the k-th output
of one is the k-th input of the next. Where it is not, as where a speed goes in and a torque comes
out, each effect sees the same inputs, and what they change adds up. An output whose value in the
partial class is one of the inputs is handed on, by effects that say nothing of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from workbench.errors import InputError
from workbench.models.modelica import Library


@dataclass(frozen=True)
class Slot:
    """A place that effects fill."""

    name: str  # of the base model's component
    partial: str  # dotted name of the class that each effect in it extends
    counts: tuple[str, ...]  # numbers of places, Integer parameters of the partial class
    # inputs, outputs: of the partial class, in its order; outputs that it has an equation for are
    # left out
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    chained: bool  # whether outputs continue inputs; else changes add up
    nominal: str  # dotted name of the class in the base model
    settled: bool  # whether the base model gives that class its inputs and counts and nothing else
    handed: Mapping[str, str]  # outputs that are handed on, and the input that each is


def read_slots(library: Library, base: str) -> tuple[Slot, ...]:
    """Slots of a base model, in its order: replaceable components with a constraining class."""
    model = library.find(base).name
    slots = []
    for component in library.components(model).values():
        if "replaceable" not in component.prefixes or not component.constraint:
            continue
        partial = library.resolve(component.constraint, component.owner)
        if partial not in library.classes:
            raise InputError(
                where=component.where,
                found=f"slot '{component.name}' constrained by {partial}",
                expected=f"a class of {library.name}",
                remedy="constrain it by a partial class of the library",
            )
        declared = library.components(partial)
        inputs = [
            declaration for declaration in declared.values() if "input" in declaration.prefixes
        ]
        computed = {
            name
            for ancestor in (partial, *library.ancestors(partial))
            for name in library.classes[ancestor].equations
        }
        outputs = [
            declaration
            for declaration in declared.values()
            if "output" in declaration.prefixes
            and declaration.name not in computed
            and not declaration.modifier.value
        ]
        counts = tuple(
            declaration.name
            for declaration in declared.values()
            if declaration.type == "Integer" and "parameter" in declaration.prefixes
        )
        names = {*counts, *(variable.name for variable in inputs)}
        slots.append(
            Slot(
                name=component.name,
                partial=partial,
                counts=counts,
                inputs=tuple(variable.name for variable in inputs),
                outputs=tuple(output.name for output in outputs),
                chained=len(outputs) <= len(inputs)
                and all(
                    library.unit(inlet) == library.unit(outlet)
                    for inlet, outlet in zip(inputs, outputs, strict=False)
                ),
                nominal=library.resolve(component.type, component.owner),
                settled=component.modifier.inner.keys() <= names,
                handed={
                    declaration.name: declaration.modifier.value
                    for declaration in declared.values()
                    if "output" in declaration.prefixes and declaration.modifier.value in names
                },
            )
        )
    return tuple(slots)
