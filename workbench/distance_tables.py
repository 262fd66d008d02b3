"""Tables of `system.toml` on how a machine comes to rest, one reader each."""

from collections.abc import Collection

from workbench.comparison_tables import read_exclusion
from workbench.errors import InputError, closest
from workbench.expression import Expression
from workbench.system import System
from workbench.system_distance import (
    COMMAND,
    END,
    SPEED,
    Asked,
    Difference,
    Driven,
    Nominal,
    Rating,
    Stopping,
)
from workbench.tables import Table
from workbench.units import quantity, si_factor


def read_stopping(table: Table, system: System) -> Stopping:
    """How the machine stops."""
    table.refuse_unknown(
        "speed state rest longest timed_by asked inputs start differs outside nominal rating"
    )
    measured = {*system.signals, *(one.name for one in system.derived), *system.values}
    asked = _asked(table.table("asked"), measured)
    units = {one.name: one.unit for one in asked}
    names = set(units)
    if units.get(SPEED) != "m/s":
        raise table.wrong("asked", f"a table '{SPEED}' in m/s among what is asked for")
    inputs = table.table("inputs")
    inputs.refuse_unknown(one.name for one in system.inputs)
    driven = tuple(_driven(inputs, one.name, names) for one in system.inputs)
    states = system.states or ()
    start = table.table("start")
    timed_by = table.take("timed_by", str)
    state = table.take("state", str)
    rising = [one.name for one in driven if one.delay + one.lag > 0.0]
    _refuse(timed_by, rising, f"{table.where} timed_by", "an input that rises")
    _refuse(state, states, f"{table.where} state", "a continuous state of the model")
    for name in start.content:
        _refuse(name, states, f"{start.where} {name}", "a continuous state of the model")
    outputs = {one.name for one in system.outputs}
    outside = tuple(read_exclusion(one, system) for one in table.tables("outside"))
    for one in outside:
        _known(one.formula, {*outputs, *system.values}, "a measured output, or a parameter")
    return Stopping(
        speed=_formula(table, "speed", measured, "a measured signal, or a parameter"),
        state=state,
        rest=table.number("rest", "m/s"),
        longest=table.number("longest", "s"),
        timed_by=timed_by,
        asked=asked,
        driven=driven,
        start={name: _formula(start, name, names, "an asked quantity") for name in start.content},
        differences=tuple(_difference(one, system, states) for one in table.tables("differs")),
        outside=outside,
        nominal=_nominal(table.table("nominal"), names, measured) if "nominal" in table else None,
        rating=_rating(table.table("rating")) if "rating" in table else None,
    )


def _refuse(name: str, known: Collection[str], where: str, expected: str) -> None:
    if name not in known:
        raise InputError(
            where=where,
            found=f"'{name}'{closest(name, known)}",
            expected=expected,
            remedy="correct the name",
        )


def _known(formula: Expression, known: Collection[str], expected: str) -> Expression:
    for name in sorted(formula.names):
        _refuse(name, known, formula.where, expected)
    return formula


def _formula(table: Table, key: str, known: Collection[str], expected: str) -> Expression:
    return _known(Expression(table.take(key, str), f"{table.where} {key}"), known, expected)


def _asked(table: Table, measured: Collection[str]) -> tuple[Asked, ...]:
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("label unit shown is at usual")
        unit = own.unit("unit")
        shown = own.unit("shown", unit)
        si_factor(shown, unit, f"{own.where} shown")
        place = own.text("at", COMMAND)
        if place not in (COMMAND, END):
            raise own.wrong("at", f"{COMMAND} or {END}")
        formula = _formula(own, "is", measured, "a measured signal, or a parameter")
        label, usual = own.text("label", name), own.number("usual", unit)
        found.append(Asked(name, label, unit, shown, formula, place, usual))
    return tuple(found)


def _driven(inputs: Table, name: str, asked: Collection[str]) -> Driven:
    own = Table(inputs.take(name, dict), f"{inputs.where} {name}")
    own.refuse_unknown("is delay lag along")
    formula = _formula(own, "is", asked, "an asked quantity")
    delay, lag = own.number("delay", "s", 0.0), own.number("lag", "s", 0.0)
    return Driven(name, formula, delay, lag, "along" in own and own.take("along", bool))


def _difference(table: Table, system: System, states: Collection[str]) -> Difference:
    table.refuse_unknown("of spread share unit")
    of = table.texts("of")
    inputs = {one.name for one in system.inputs}
    for name in of:
        _refuse(name, {*inputs, *states}, f"{table.where} of", "an input, or a continuous state")
    if ("spread" in table) == ("share" in table):
        raise InputError(
            where=table.where,
            found="'spread' and 'share'" if "spread" in table else "neither 'spread' nor 'share'",
            expected="one of the two",
            remedy="say how far it moves, in its unit or as a share of its size",
        )
    if "share" in table:
        return Difference(of, table.number("share", "1"), relative=True)
    return Difference(of, table.number("spread", table.unit("unit", "1")), relative=False)


def _nominal(table: Table, asked: Collection[str], measured: Collection[str]) -> Nominal:
    table.refuse_unknown("mass rotating reference resistance within speeds")
    speeds = table.texts("speeds")
    return Nominal(
        mass=_formula(table, "mass", asked, "an asked quantity"),
        rotating=_formula(table, "rotating", measured, "a parameter"),
        reference=table.number("reference", "kg"),
        resistance=_formula(table, "resistance", measured, "a measured signal"),
        within=table.number("within", "1"),
        speeds=tuple(quantity(one, "m/s", f"{table.where} speeds") for one in speeds),
    )


def _rating(table: Table) -> Rating:
    table.refuse_unknown("label constants")
    constants = table.table("constants")
    found = {}
    for speed in constants.content:
        top, less = constants.numbers(speed, "1", 2)
        found[quantity(speed, "m/s", f"{constants.where} {speed}")] = (top, less)
    return Rating(table.take("label", str), found)
