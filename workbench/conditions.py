"""What was set before a recording: as it is written, and as the recording itself shows it."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.plausibility import shown_by
from workbench.recording import Vector
from workbench.system import Condition, System
from workbench.tables import Table, shown
from workbench.units import quantity

Value = float | int | str | tuple[Any, ...]
UNKNOWN = "unknown"  # a condition that nobody knows any more


def read_conditions(table: Table, system: System) -> dict[str, Value]:
    """Conditions of a recording, as the system declares them.

    What nobody knows any more is written as "unknown", and is UNKNOWN then; what sets a parameter
    of the model may be missing, and is so then.

    Raises
    ------
    InputError
        If one is missing, none of the system, or none of its choices; or the sign of the signals
        is unknown.
    """
    table.refuse_unknown(one.name for one in system.conditions)
    signs = [f"'{one.name}' holds the sign" for one in system.conditions if one.sign]
    remedy = "; ".join(["give the magnitude", *signs])
    said = [one for one in system.conditions if one.name in table or not one.sets]
    return {one.name: _condition(table, one, remedy) for one in said}


def _condition(table: Table, one: Condition, remedy: str) -> Value:
    """One condition; `remedy` for a quantity that is too small."""
    if table.content.get(one.name) == UNKNOWN and not one.sign:
        return UNKNOWN
    if one.count:
        items = table.take(one.name, list)
        if len(items) != one.count:
            raise InputError(
                where=f"{table.where} {one.name}",
                found=f"{len(items)} entries",
                expected=str(one.count),
                remedy=f"write one of {_either(one)} for each",
            )
        return tuple(
            _choice(one, item, f"{table.where} {one.name}[{i}]") for i, item in enumerate(items)
        )
    if one.choices:
        value: object = table.take(one.name, type(one.choices[0]))
        return _choice(one, value, f"{table.where} {one.name}")
    where = f"{table.where} {one.name}"
    text = table.take(one.name, str)
    number = quantity(text, one.unit, where)
    if number < one.least or (one.exclusive and number == one.least):
        raise InputError(
            where=where,
            found=repr(text),
            expected=f"{'above' if one.exclusive else 'no less than'} {one.least:g} {one.unit}",
            remedy=remedy,
        )
    return number


def _choice(one: Condition, value: object, where: str) -> str | int:
    for choice in one.choices:
        if type(value) is type(choice) and value == choice:
            return choice
    raise InputError(
        where=where, found=shown(value), expected=_either(one), remedy="write one of them"
    )


def _either(one: Condition) -> str:
    return " or ".join(map(repr, one.choices))


def conditions_shown(signals: Mapping[str, Vector], system: System) -> dict[str, Any]:
    """Conditions that a recording shows, as `read_conditions` takes them.

    They are what the system file says that tells them (`agrees`); a choice only where it is one of
    its choices.

    Parameters
    ----------
    signals : (n,) each, SI.
    """
    found: dict[str, Any] = {}
    for one in system.conditions:
        value = shown_by(one, signals, system)
        if value is None or not np.isfinite(value):
            continue
        if not one.choices:
            if value > one.least or (value == one.least and not one.exclusive):
                found[one.name] = f"{value:.6g} {one.unit}"
        elif value in one.choices:
            found[one.name] = next(choice for choice in one.choices if choice == value)
    return found
