"""Units that stand in cells: behind each number, or in a column beside them."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.formats.numbers import is_missing, is_number
from workbench.recordings.formats.spelling import conversion, is_unit, spell_unit
from workbench.recordings.formats.tables.cells import TIME_NAME, Label, mostly

_WITH_UNIT = re.compile(
    r"\s*(?P<number>[+-]?\s?[\d.,]*\d([eE][+-]?\d+)?)\s*(?P<unit>[^\W\d][^\s;,|]{0,9}|%|°\S)\s*"
)
_FORTRAN = re.compile(r"(\d\.?)[dD]([+-]?\d+)")
_STATES = {"true": "1", "false": "0", "on": "1", "off": "0"}
# Columns of a table with a row for each value: whose it is, the value, its unit.
PARTS_OF_TAGS = {
    **dict.fromkeys(("tag", "tagname", "tag name", "signal", "variable", "channel", "name"), "tag"),
    **dict.fromkeys(
        ("kanal", "sensor", "point", "measurement", "_field", "messstelle", "varname"), "tag"
    ),
    # of Grafana, Home Assistant and Kepware
    **dict.fromkeys(("series", "metric", "entity_id", "_name"), "tag"),
    **dict.fromkeys(("value", "wert", "_value", "messwert", "val", "varvalue", "state"), "value"),
    "physical value": "value",  # of decoded CAN
    **dict.fromkeys(("unit", "units", "einheit", "uom"), "unit"),
    "attributes.unit_of_measurement": "unit",  # of Home Assistant
}


def is_quantity(cell: str) -> bool:
    """Whether a cell is a number with a unit behind it."""
    return _WITH_UNIT.fullmatch(cell) is not None


def without_units(cells: Sequence[str]) -> list[str]:
    """Cells, of numbers with units behind them the numbers alone."""
    return [match["number"] if (match := _WITH_UNIT.fullmatch(c)) else c for c in cells]


def units_beside(
    labels: Sequence[Label],
    numbers: Mapping[int, Sequence[str]],
    texts: Mapping[int, Sequence[str]],
) -> dict[int, int]:
    """For columns of numbers with their units in one beside them, the column of these.

    So meters write them that choose a range by themselves. A column of values of several signals,
    which another one names, is for `by_tag`.
    """
    parts = [PARTS_OF_TAGS.get(name.casefold(), "") for name, _ in labels]
    tagged = any(parts[i] == "tag" and len(set(cells)) > 1 for i, cells in texts.items())
    units = {}
    for k in numbers:
        name, unit = labels[k]
        if unit or (tagged and parts[k] == "value"):
            continue
        # One before belongs to a column of numbers before that, if it has no unit.
        taken = k - 2 in numbers and not any((labels[k - 2][1], TIME_NAME.match(labels[k - 2][0])))
        near = {k + 1, *([] if taken else [k - 1])} & texts.keys()
        own = (
            i
            for i in near
            if _is_label_of_units(labels[i][0], name) and any(map(is_unit, {*texts[i]} - {""}))
        )
        if (at := max(own, default=-1)) >= 0:
            units[k] = at
    return units


def _is_label_of_units(label: str, name: str) -> bool:
    """Whether a column has the units of one of some name: Unit, or h unit of h."""
    own = label.casefold().removeprefix(name.casefold()).strip(" _.")
    return PARTS_OF_TAGS.get(own) == "unit"


def one_unit(units: Sequence[str | None]) -> tuple[str, Vector] | None:
    """The unit that most rows have, and factors that take the values of each to it, (n,).

    None where there are several, of which one cannot be converted.

    Parameters
    ----------
    units : (n,), None of a row without a number.
    """
    counts = Counter(unit for unit in units if unit is not None)
    if not counts:
        return None
    common = spell_unit(counts.most_common(1)[0][0])
    factors = dict.fromkeys(counts, 1.0)
    for unit in counts if len(counts) > 1 else ():
        scale = conversion(spell_unit(unit), common)
        if scale is None or scale.zero:
            return None
        factors[unit] = scale.factor
    return common, np.array([1.0 if unit is None else factors[unit] for unit in units])


def conversion_note(factors: Vector, unit: str) -> list[str]:
    """That samples were taken to a unit, (n,) by `one_unit`; nothing where none had another one."""
    count = int((factors != 1.0).sum())
    return [f"{count} samples in other units were taken to [{unit}]"] * bool(count)


def numbers_within(cells: Sequence[str], unit: str) -> tuple[list[str], tuple[str, Vector]] | None:
    """Numbers of cells that hold their unit, too, or are written as no other; and `one_unit`.

    Texts of a spreadsheet (="1.5"), exponents of Fortran (1.5D+02), and what is on or off.
    """
    held = [cell for cell in cells if not is_missing(cell) or cell.casefold() in _STATES]
    ones = np.ones(len(cells))
    if held and unit in ("", "1") and all(cell.casefold() in _STATES for cell in held):
        return [_STATES.get(cell.casefold(), cell) for cell in cells], (unit or "1", ones)
    plainer = [_FORTRAN.sub(r"\1E\2", cell.removeprefix("=").strip("'\"")) for cell in cells]
    if mostly(plainer, is_number):
        return plainer, (unit, ones)
    matches = [_WITH_UNIT.fullmatch(cell) for cell in plainer]
    one = one_unit([match["unit"] if match else None for match in matches])
    if one is None or not is_unit(one[0]) or 2 * sum(map(bool, matches)) <= len(held):
        return None
    if unit and spell_unit(unit) != one[0]:
        return None
    return without_units(plainer), one
