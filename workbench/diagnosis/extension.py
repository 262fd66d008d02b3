"""Modelica source of an observer model with effects of the catalogue, and its FMU.

An effect fills a slot: a value goes in, the value that acts comes out. Several effects of one slot
stand in a row. Needs the extra `[compiler]` to build; sources can be written without it.
"""

import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from workbench.diagnosis import shelf
from workbench.diagnosis.catalogue import Effect
from workbench.errors import InputError

LIBRARY = "WheelsetRig"
BASE = "MinimalObserver"


@dataclass(frozen=True)
class _Slot:
    """Interface of a slot: its partial class, what is chained, and what else goes in."""

    partial: str
    chain: tuple[tuple[str, str], ...]
    others: tuple[str, ...]


_QUANTITY = _Slot("Quantities.PartialQuantity", (("nominal", "actual"),), ("omega",))
_LOSS = _Slot("Losses.PartialLoss", (("omega", "tau"),), ())
_SPEED = _Slot("Sensors.PartialSpeedSensor", (("omega", "reading"),), ())
_SLOTS = {
    "padFriction": _Slot("Brakes.PartialPadFriction", (("level", "mu"),), ("Fperp", "v")),
    "cylinder": _Slot("Brakes.PartialCylinder", (("pB", "p"), ("restBefore", "rest")), ()),
    "adhesion": _Slot("Contact.PartialAdhesion", (("level", "mu0"),), ("w", "v", "Fx")),
    "wheelsetLoss": _LOSS,
    "rollerLoss": _LOSS,
    "wheelRadius": _QUANTITY,
    "rollerRadius": _QUANTITY,
    "wheelLoad": _QUANTITY,
    "creepStiffness": _QUANTITY,
    "wheelInertia": _QUANTITY,
    "driveTorque": _QUANTITY,
    "speedSensorW": _SPEED,
    "speedSensorR": _SPEED,
    "forceSensor": _Slot("Sensors.PartialForceSensor", (("F", "reading"),), ()),
}


def component(effect: Effect) -> str:
    """Name of an effect's component within its slot."""
    return effect.name[0].lower() + effect.name[1:]


def variables(effect: Effect, parameter: str) -> tuple[str, ...]:
    """Names in the FMU of one parameter of an effect, one for each of its slots."""
    return tuple(f"{slot}.{component(effect)}.{parameter}" for slot in effect.slots)


def source(
    name: str,
    effects: Sequence[Effect],
    values: Mapping[str, Mapping[str, float]],
    parameters: Mapping[str, float],
    about: str,
) -> str:
    """Write the Modelica source of the extended model.

    Parameters
    ----------
    name : of the model.
    effects : to plug in, in this order within a slot.
    values : by effect and parameter, SI; parameters that are not named keep their defaults.
    parameters : of the observer model itself, that differ from its defaults.
    about : one line, for the documentation.
    """
    nested: list[str] = []
    redeclared = [f"    {parameter}={float(value)!r}" for parameter, value in parameters.items()]
    for slot, interface in _SLOTS.items():
        chained = [effect for effect in effects if slot in effect.slots]
        if not chained:
            continue
        label = slot[0].upper() + slot[1:]
        nested.append(_composed(label, interface, chained, values))
        redeclared.append(f"    redeclare {label} {slot}")
    modifiers = ",\n".join(redeclared)
    return (
        f'model {name} "{about}"\n'
        + f"  extends {LIBRARY}.{BASE}(\n{modifiers});\n\n"
        + "\n".join(nested)
        + f"end {name};\n"
    )


def _composed(
    label: str,
    slot: _Slot,
    effects: Sequence[Effect],
    values: Mapping[str, Mapping[str, float]],
) -> str:
    lines = [
        f'  model {label} "{", ".join(effect.name for effect in effects)}"',
        f"    extends {LIBRARY}.{slot.partial};",
    ]
    before = {inlet: inlet for inlet, _ in slot.chain}
    for effect in effects:
        bindings = [f"{inlet}={source}" for inlet, source in before.items()]
        bindings += [f"{name}={name}" for name in slot.others]
        given = values.get(effect.name, {})
        bindings += [f"{parameter}={float(value)!r}" for parameter, value in given.items()]
        instance = component(effect)
        lines.append(
            f"    {LIBRARY}.{effect.package}.{effect.name} {instance}({', '.join(bindings)});"
        )
        before = {inlet: f"{instance}.{outlet}" for inlet, outlet in slot.chain}
    lines.append("  equation")
    lines += [f"    {outlet} = {before[inlet]};" for inlet, outlet in slot.chain]
    lines.append(f"  end {label};\n")
    return "\n".join(lines)


def build(package: Path, name: str, text: str, fmu: Path, *, every_platform: bool) -> None:
    """Compile the source of an extended model to an FMU; needs the extra [compiler].

    An FMU that was built before, of the same sources, is taken from where it is kept.

    Parameters
    ----------
    package : `package.mo` of the library that the source extends; it is left alone.
    every_platform : for all platforms, or only for this machine's.

    Raises
    ------
    InputError
        If the library is not there, or the source has errors.
    """
    if not package.is_file():
        raise InputError(
            where=str(package),
            found="no such file",
            expected=f"the package.mo of {LIBRARY}, which effects are taken from",
            remedy="give its path with --library, or run this in the workbench's folder",
        )

    def make(path: Path) -> None:
        from workbench import compiler  # an extra: everything else runs without it

        platforms = list(compiler.PLATFORMS) if every_platform else [compiler.native()]
        with tempfile.TemporaryDirectory() as scratch:
            library = Path(scratch) / LIBRARY
            shutil.copytree(package.parent, library)
            (library / f"{name}.mo").write_text(f"within {LIBRARY};\n{text}")
            compiler.build(library / "package.mo", f"{LIBRARY}.{name}", path, platforms=platforms)

    shelf.fetch(shelf.key(package.parent, name, text, f"{every_platform}"), fmu, make)
