"""Tables of `system.toml` on what may be run next, one reader each."""

from typing import Any

from workbench.errors import InputError
from workbench.expression import Expression
from workbench.system import System
from workbench.system_conditions import Condition
from workbench.system_experiments import (
    RELEASE,
    SINE,
    STAIRCASE,
    STEP,
    Cost,
    EndsBelow,
    Experiments,
    Setting,
    VariedInput,
)
from workbench.system_tables import read_measured
from workbench.tables import Table
from workbench.units import check_unit, quantity

_USUAL = (STEP, STAIRCASE, SINE)
_KINDS = (*_USUAL, RELEASE)  # which leaves the range: a machine has to allow it


def read_experiments(table: Table, system: System) -> Experiments:
    """What may be run next."""
    table.refuse_unknown("lasts ends conditions settings start inputs cost sensors")
    inputs, start = table.table("inputs"), table.table("start")
    besides, labels = _besides(table.table("settings"), system)
    inputs.refuse_unknown(one.name for one in system.inputs)
    varied: list[VariedInput] = []
    driven: dict[str, Expression] = {}
    for signal in system.inputs:
        own = Table(inputs.take(signal.name, dict), f"{inputs.where} {signal.name}")
        if "is" in own:
            own.refuse_unknown("is")
            driven[signal.name] = Expression(own.take("is", str), f"{own.where} is")
        else:
            varied.append(read_varied(own, signal.name, signal.unit))
    return Experiments(
        lasts=table.number("lasts", "s"),
        ends=_ending(table.table("ends")) if "ends" in table else None,
        settings={**_settings(table.table("conditions"), system), **besides},
        labels=labels,
        start={
            key: Expression(start.take(key, str), f"{start.where} {key}") for key in start.content
        },
        varied=tuple(varied),
        driven=driven,
        cost=_cost(table.table("cost")),
        sensors=read_measured(table, "sensors"),
    )


def read_varied(table: Table, name: str, unit: str) -> VariedInput:
    """An input that follows profiles."""
    table.refuse_unknown("range profiles begins every lags")
    low, high = table.numbers("range", unit, 2)
    if not low < high:
        raise table.wrong("range", "[low, high]")
    profiles = table.texts("profiles") or _USUAL
    if not set(profiles) <= set(_KINDS):
        raise table.wrong("profiles", f"some of {', '.join(_KINDS)}")
    every = table.number("every", "s")
    if every <= 0.0:
        raise table.wrong("every", "a time above 0")
    lags = table.numbers("lags", "s", len(table.take("lags", list))) if "lags" in table else ()
    return VariedInput(name, low, high, profiles, table.number("begins", "s", 0.0), every, lags)


def _ending(table: Table) -> EndsBelow:
    table.refuse_unknown("is below")
    return EndsBelow(
        Expression(table.take("is", str), f"{table.where} is"), table.number("below", "1")
    )


def _cost(table: Table) -> Cost:
    """By default the time that a recording lasts."""
    table.refuse_unknown("is unit")
    formula = Expression(table.text("is", "duration"), f"{table.where} is")
    return Cost(formula, table.text("unit", "s"))


def _settings(table: Table, system: System) -> dict[str, tuple[Setting, ...]]:
    """Values of conditions that may be set."""
    table.refuse_unknown(one.name for one in system.conditions)
    found = {}
    for name in table.content:
        values: list[Any] = table.take(name, list)
        if not values:
            raise table.wrong(name, "one value or more")
        condition = system.condition(name)
        found[name] = tuple(_setting(table, condition, value) for value in values)
    return found


def _besides(table: Table, system: System) -> tuple[dict[str, tuple[Setting, ...]], dict[str, str]]:
    """Values of what is set and is no condition of a recording, and what it is called."""
    found: dict[str, tuple[Setting, ...]] = {}
    labels: dict[str, str] = {}
    taken = {*system.signals, *system.values, *(one.name for one in system.conditions)}
    for name in table.content:
        if name in taken:
            raise table.wrong(name, "a name that no signal, parameter or condition has")
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("label unit values")
        unit, texts = own.take("unit", str), own.texts("values")
        if not texts:
            raise own.wrong("values", "one value or more")
        check_unit(unit, f"{own.where} unit")
        found[name] = tuple(Setting(quantity(one, unit, own.where), one) for one in texts)
        labels[name] = own.text("label", name)
    return found, labels


def _setting(table: Table, condition: Condition, value: Any) -> Setting:
    where = f"{table.where} {condition.name}"
    if condition.unit:
        if not isinstance(value, str):
            raise table.wrong(condition.name, f'quantities such as "2 {condition.unit}"')
        return Setting(quantity(value, condition.unit, where), value)
    entries = value if condition.count and isinstance(value, list) else [value]
    if len(entries) != max(1, condition.count) or not all(
        one in condition.choices and type(one) is type(condition.choices[0]) for one in entries
    ):
        count = f"{condition.count} of " if condition.count else ""
        raise InputError(
            where=where,
            found=repr(value),
            expected=f"{count}{', '.join(map(str, condition.choices))}",
            remedy="correct the value",
        )
    text = ", ".join(map(str, entries))
    return Setting(tuple(entries) if condition.count else entries[0], text)
