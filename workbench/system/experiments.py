"""What may be run next on a machine: what may be varied, and what it costs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from workbench.errors import InputError
from workbench.system.declaration import Scope, Unit, declared, key, table_name
from workbench.system.expression import Expression
from workbench.system.parts import STATE, Condition, Ranged, Signal, names_of, refuse_no_sensor
from workbench.system.tables import Table
from workbench.system.units import quantity

STEP, STAIRCASE, SINE, RELEASE = "step", "staircase", "sine", "release"
_USUAL = (STEP, STAIRCASE, SINE)
_PROFILES = (*_USUAL, RELEASE)  # a release leaves the range: a machine has to allow it

# What names refer to, see `parts`.
SET_OR_PARAMETER = "a parameter of the model, or what is set"
SET_OR_DURATION = "duration, or what is set"
SET_OR_VARIABLE = "a variable of the model, or what is set"


def _unit_of_input(scope: Scope, _: str) -> str | None:
    units = {signal.name: signal.unit for signal in scope.whole["inputs"]}
    return units.get(scope.own["name"])


@declared
class VariedInput(Ranged):
    """An input that follows a profile."""

    name: str = table_name()
    range: tuple[float, float] = key("least and largest demand", unit=_unit_of_input, ordered=True)
    profiles: tuple[str, ...] = key(
        f"kinds to try; `{RELEASE}` is a demand that returns to zero, whatever the range",
        choices=_PROFILES,
        absent=_USUAL,
        otherwise=f"all but `{RELEASE}`",
    )
    begins: float = key("time before which the demand is zero", "s", 0.0)
    every: float = key(
        "duration of a step, or of a demand before its release, and period of a sine; a second "
        "sine has twice that period",
        "s",
        above=0.0,
    )
    lags: tuple[float, ...] = key(
        'first-order lags in series from the demand to the input, `["0.5 s"]`', "s", ()
    )


@declared
class ControlledInput:
    """An input that follows from the model's variables, as a controller makes it."""

    name: str = table_name()
    formula: Expression = key(
        'formula of variables of the model, `"k*(1 - y)"`', name="is", of=SET_OR_VARIABLE
    )


@dataclass(frozen=True)
class Setting:
    """A value of something that may be set, SI, and how it was written."""

    value: float | int | str | tuple[str | int, ...]
    text: str


def _set_values(table: Table, name: str, scope: Scope) -> tuple[Setting, ...]:
    texts = table.texts(name)
    if not texts:
        raise table.wrong(name, "one value or more")
    return tuple(Setting(quantity(t, scope.own["unit"], table.where), t) for t in texts)


@declared
class FurtherSetting:
    """What is set besides conditions, and only the inputs tell, by formulas in its name."""

    name: str = table_name()
    label: str = key("what it is, for people", absent="{name}")
    unit: Unit = key("of its values")
    values: tuple[Setting, ...] = key(
        "that may be set, as texts with a unit",
        read=_set_values,
        schema={"type": "array", "items": {"type": "string"}, "minItems": 1},
    )


def _refuse_taken(
    settings: tuple[FurtherSetting, ...], table: Table, name: str, scope: Scope
) -> None:
    groups = ("inputs", "outputs", "reference_signals", "intermittent", "conditions")
    taken = {*names_of(*groups)(scope), *scope.whole["values"]}
    for setting in settings:
        if setting.name in taken:
            expected = "a name that no signal, parameter or condition has"
            raise table.table(name).wrong(setting.name, expected)


def _conditions(table: Table, name: str, scope: Scope) -> dict[str, tuple[Setting, ...]]:
    """Values of conditions that may be set."""
    own = table.table(name)
    known = {condition.name: condition for condition in scope.whole["conditions"]}
    own.refuse_unknown(known)
    settings = {}
    for condition in own.content:
        values: list[Any] = own.take(condition, list)
        if not values:
            raise own.wrong(condition, "one value or more")
        settings[condition] = tuple(_setting(own, known[condition], value) for value in values)
    return settings


def _setting(table: Table, condition: Condition, value: Any) -> Setting:
    where = table.place(condition.name)
    if condition.unit:
        if not isinstance(value, str):
            raise table.wrong(condition.name, f'quantities such as "2 {condition.unit}"')
        return Setting(quantity(value, condition.unit, where), value)
    entries = value if condition.count and isinstance(value, list) else [value]
    if len(entries) != max(1, condition.count) or not all(
        entry in condition.choices and type(entry) is type(condition.choices[0])
        for entry in entries
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


@declared
class EndsBelow:
    """A recording ends where the absolute value of a formula is below a level, SI."""

    formula: Expression = key("formula of variables of the model", name="is", of=SET_OR_VARIABLE)
    below: float = key("level of its absolute value, SI")


@declared
class Cost:
    """Of one recording, in a unit for people."""

    formula: Expression = key(
        "formula in `duration` [s] and in settings that are numbers, SI",
        name="is",
        of=SET_OR_DURATION,
        absent=lambda scope: Expression("duration", str(scope.file)),
        otherwise="`duration`",
    )
    unit: str = key("of the formula, for people", absent="s")


@declared
class Experiments:
    """All that may be run."""

    lasts: float = key("longest recording", "s")
    ends: EndsBelow | None = key(
        "condition that ends it earlier", absent=None, otherwise="at its longest"
    )
    conditions: Mapping[str, tuple[Setting, ...]] = key(
        'values of a condition that may be set, `speed = ["10 m/s", "20 m/s"]`; of others that are '
        "quantities, `agrees` tells",
        absent={},
        otherwise="as usual",
        read=_conditions,
        schema={"type": "object", "additionalProperties": {"type": "array", "minItems": 1}},
    )
    further: tuple[FurtherSetting, ...] = key(
        "further settings that act through the inputs; formulas use their names",
        name="settings",
        absent=(),
        check=_refuse_taken,
    )
    start: Mapping[str, Expression] = key(
        "formulas of states, in parameters and in settings that are numbers",
        keys=STATE,
        of=SET_OR_PARAMETER,
        absent={},
        otherwise="nominal",
    )
    inputs: tuple[VariedInput | ControlledInput, ...] = key(
        "each input of the model: it follows profiles, or a formula, `is`",
        keys=names_of("inputs"),
        every=True,
    )
    cost: Cost = key("of a recording")
    sensors: tuple[Signal, ...] = key(
        "validation sensors that could be added", absent=(), check=refuse_no_sensor
    )

    @property
    def settings(self) -> dict[str, tuple[Setting, ...]]:
        """Values of conditions, others are as usual; and of what is set besides."""
        return {**self.conditions, **{setting.name: setting.values for setting in self.further}}

    @property
    def labels(self) -> dict[str, str]:
        """What is set besides conditions, for people."""
        return {setting.name: setting.label for setting in self.further}

    @property
    def varied(self) -> tuple[VariedInput, ...]:
        """Inputs that follow profiles."""
        return tuple(varied for varied in self.inputs if isinstance(varied, VariedInput))

    @property
    def driven(self) -> dict[str, Expression]:
        """Formulas of inputs that follow from the model's variables."""
        return {
            controlled.name: controlled.formula
            for controlled in self.inputs
            if isinstance(controlled, ControlledInput)
        }
