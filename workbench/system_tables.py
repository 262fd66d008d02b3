"""Tables of `system.toml`, one reader each."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from workbench.errors import InputError
from workbench.expression import Expression
from workbench.system import System
from workbench.system_conditions import FIRST, LARGEST, Agreement, Condition
from workbench.system_parts import (
    Derived,
    Estimated,
    Export,
    Fading,
    Following,
    Mode,
    Model,
    Objective,
    OperatingPoint,
    Rolling,
    Signal,
    Threshold,
    Tolerance,
    View,
)
from workbench.tables import Table
from workbench.units import si_factor

GROUPS = ("inputs", "outputs", "judged", "aids")  # of measured signals


def read_model(table: Table, path: Path) -> Model:
    """A model in a role, whose FMU stands beside the system file."""
    table.refuse_unknown("class fmu")
    fmu = table.text("fmu", "")
    return Model(table.take("class", str), (path.parent / fmu).resolve() if fmu else None)


def read_of_states(file: Table, key: str, units: Mapping[str, str]) -> dict[str, float]:
    """A number of each state that has it, by name.

    Parameters
    ----------
    units : of the model's variables.
    """
    tables = {name: within(file, "states", name) for name in file.table("states").content}
    for table in tables.values():
        table.refuse_unknown("walk spread")
    return {
        name: table.number(key, units.get(name, "1"))
        for name, table in tables.items()
        if key in table
    }


def within(file: Table, group: str, name: str) -> Table:
    """A table `[group.name]`."""
    return Table(file.table(group).take(name, dict), f"{file.where}, [{group}.{name}]")


def read_bands(file: Table, system: System) -> dict[str, dict[str, float]]:
    """Reach of bands over that by standard deviations, by estimator and quantity."""
    tables = {name: within(file, "bands", name) for name in file.table("bands").content}
    for table in tables.values():
        table.refuse_unknown(" ".join(system.columns))
    return {
        name: {quantity: _above_zero(table, quantity) for quantity in table.content}
        for name, table in tables.items()
    }


def _above_zero(table: Table, key: str) -> float:
    value = table.number(key, "1")
    if not value > 0.0:
        raise table.wrong(key, "a number above 0")
    return value


def read_measured(file: Table, group: str) -> tuple[Signal, ...]:
    """Measured signals of one of the GROUPS."""
    found = []
    for name in file.table(group).content:
        table = within(file, group, name)
        table.refuse_unknown(
            "unit shown label noise relative_noise relative_error scale scale_error reading "
            "mode smoothed held resolution saturates plausible possible called recorded_as"
        )
        unit = table.unit("unit")
        shown = table.text("shown", unit)
        si_factor(shown, unit, f"{table.where} shown")
        relative = table.number("relative_noise", "1", 0.0)
        noise = table.number("noise", unit)
        if noise < 0.0 or (noise == 0.0 and group != "inputs"):
            raise table.wrong(
                "noise", "a standard deviation above 0; only inputs are exactly known"
            )
        scale = table.number("scale", unit)
        if not scale > 0.0:
            raise table.wrong("scale", "a size above 0")
        found.append(
            Signal(
                name=name,
                unit=unit,
                label=table.text("label", name),
                shown=shown,
                noise=noise,
                relative_noise=relative,
                relative_error=table.number("relative_error", "1", relative),
                scale=scale,
                scale_error=table.number("scale_error", "1", 0.0),
                reading=table.text("reading", name),
                mode=read_mode(table.table("mode")) if "mode" in table else None,
                smoothed=table.numbers("smoothed", "s", 2) if "smoothed" in table else (),
                held="held" in table and table.take("held", bool),
                resolution=table.number("resolution", unit, 0.0),
                limits=_limits(table, "saturates", unit),
                plausible=_limits(table, "plausible", unit),
                possible=_limits(table, "possible", unit),
                called=table.texts("called"),
                recorded_as=_recorded_as(table, name) if "recorded_as" in table else None,
            )
        )
    return tuple(found)


def _recorded_as(signal: Table, name: str) -> Derived:
    """What recorders have in the place of a signal."""
    table = signal.table("recorded_as")
    table.refuse_unknown("is unit")
    formula = Expression(table.take("is", str), f"{table.where} is")
    if name not in formula.names:
        raise table.wrong("is", f"a formula of {name}")
    return Derived(name, table.unit("unit"), formula.text, formula)


def _limits(table: Table, key: str, unit: str) -> tuple[float, float]:
    """Lower and upper limit of a signal, infinite unless they are given."""
    if key not in table:
        return -math.inf, math.inf
    low, high = table.numbers(key, unit, 2)
    if low >= high:
        raise table.wrong(key, "the lower limit before the upper one")
    return low, high


def read_mode(table: Table) -> Mode:
    """A mode of vibration before a sensor."""
    table.refuse_unknown("frequency damping late")
    return Mode(
        table.number("frequency", "Hz"), table.number("damping", "1"), table.number("late", "s")
    )


def read_derived(table: Table, unit: str = "") -> tuple[Derived, ...]:
    """What is made of measured signals and of parameters; in one unit, or each in its own."""
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        if unit:
            own.refuse_unknown("is label")
        else:
            own.refuse_unknown("is unit label")
        formula = Expression(own.take("is", str), f"{own.where} is")
        found.append(Derived(name, unit or own.unit("unit"), own.text("label", name), formula))
    return tuple(found)


def read_estimated(table: Table) -> tuple[Estimated, ...]:
    """Estimated quantities."""
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown(
            "correction label unit range prior walk start spread relative_error scatter memory "
            "useful acts_on claimed watched"
        )
        unit = own.unit("unit", "1")
        low, high = own.numbers("range", unit, 2)
        if not low < high:
            raise own.wrong("range", "[low, high]")
        prior = own.numbers("prior", unit, 2) if "prior" in own else (low, high)
        reach = (high - low) / math.sqrt(12.0)
        found.append(
            Estimated(
                name=name,
                correction=own.take("correction", str),
                label=own.text("label", name),
                unit=unit,
                low=low,
                high=high,
                prior=(prior[0], prior[1]),
                walk=own.number("walk", unit),
                start=own.number("start", unit, math.nan),
                spread=own.number("spread", unit, reach),
                relative_error=own.number("relative_error", "1", 0.0),
                scatter=own.number("scatter", unit, 0.0),
                memory=own.number("memory", "s", math.inf),
                useful=own.number("useful", unit, 0.1 * reach),
                acts_on=own.text("acts_on", ""),
                claimed={
                    key: own.table("claimed").take(key, str) for key in own.table("claimed").content
                },
                watched="watched" not in own or own.take("watched", bool),
            )
        )
    return tuple(found)


def read_condition_kinds(table: Table) -> tuple[Condition, ...]:
    """Conditions, and the parameters that they mean."""
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown(
            "label unit least above choices count sets parameters told lasts sign agrees"
        )
        choices: list[Any] = own.take("choices", list) if "choices" in own else []
        if bool(choices) == ("unit" in own):
            raise InputError(
                where=own.where,
                found="a unit and choices" if choices else "neither a unit nor choices",
                expected="either the unit of a quantity, or the choices",
                remedy='write unit = "m/s", or choices = ["new", "worn"]',
            )
        if choices and "sets" in own:
            raise own.wrong("sets", "[conditions.NAME.parameters], where there are choices")
        parameters = own.table("parameters")
        for choice in parameters.content:
            if choice not in map(str, choices):
                raise parameters.wrong(choice, f"one of {', '.join(map(str, choices))}")
        found.append(
            Condition(
                name=name,
                label=own.text("label", name),
                unit="" if choices else own.unit("unit"),
                least=own.number("above", "1", own.number("least", "1", -math.inf)),
                exclusive="above" in own,
                choices=tuple(choices),
                count=own.take("count", int) if "count" in own else 0,
                sets=own.text("sets", ""),
                parameters={
                    choice: {
                        key: parameters.table(choice).number(key, "1")
                        for key in parameters.take(choice, dict)
                    }
                    for choice in parameters.content
                },
                told="told" in own and own.take("told", bool),
                lasts=positive(own, "lasts"),
                sign="sign" in own and own.take("sign", bool),
                agrees=_agreement(own) if "agrees" in own else None,
            )
        )
    return tuple(found)


def _agreement(condition: Table) -> Agreement:
    """What a recording says of a condition."""
    table = condition.table("agrees")
    if "count" in condition or any(
        isinstance(c, str) for c in condition.content.get("choices", [])
    ):
        raise InputError(
            where=condition.where,
            found="'agrees' of words, or of a list",
            expected="a quantity, or choices that are whole numbers",
            remedy="remove 'agrees'",
        )
    table.refuse_unknown("is at within slack")
    place = table.text("at", FIRST)
    if place not in (FIRST, LARGEST):
        raise table.wrong("at", f"'{FIRST}' or '{LARGEST}'")
    unit = condition.text("unit", "1")
    formula = Expression(table.take("is", str), f"{table.where} is")
    return Agreement(formula, place, read_tolerance(table, unit))


def read_tolerance(table: Table, unit: str) -> Tolerance:
    """By how much two values in a unit may differ."""
    likely, possible = table.numbers("within", "1", 2)
    if not 0.0 <= likely <= possible:
        raise table.wrong("within", "the largest likely share before the largest possible one")
    return Tolerance(likely, possible, table.number("slack", unit, 0.0))


def positive(table: Table, key: str) -> float:
    """A time [s], infinite where none is given."""
    time = table.number(key, "s", math.inf)
    if not time > 0.0:
        raise table.wrong(key, "a time above 0")
    return time


def read_point(points: Table, name: str, system: System) -> OperatingPoint:
    """An operating point."""
    table = points.table(name)
    table.refuse_unknown("inputs held quantities")
    inputs, held, quantities = (table.table(key) for key in ("inputs", "held", "quantities"))
    inputs.refuse_unknown(one.name for one in system.inputs)
    quantities.refuse_unknown(one.name for one in system.estimated)
    units = {one.name: one.unit for one in system.inputs}
    units |= {one.name: one.unit for one in system.estimated}
    return OperatingPoint(
        {key: inputs.number(key, units[key]) for key in inputs.content},
        {key: Expression(held.take(key, str), f"{held.where} {key}") for key in held.content},
        {key: quantities.number(key, units[key]) for key in quantities.content},
    )


def read_export(table: Table, system: System) -> Export:
    """Estimators that the library has as Modelica classes."""
    table.refuse_unknown("classes start")
    classes = table.table("classes")
    return Export(
        {name: classes.take(name, str) for name in classes.content},
        read_point(table, "start", system) if "start" in table else OperatingPoint({}, {}, {}),
    )


def read_threshold(table: Table, system: System, side: str = "above") -> Threshold:
    """A signal and the level on one `side` of which something holds, above or below."""
    table.refuse_unknown(("signal", side))
    signal = table.take("signal", str)
    system.refuse_missing(signal, f"{table.where} signal")
    return Threshold(signal, table.number(side, system.unit(signal)))


def read_objective(table: Table, system: System) -> Objective:
    """What is judged, and how it is weighed."""
    table.refuse_unknown("judged weights bandwidth begins ends when")
    first = (*system.judged, *system.outputs)[0].name
    judged = table.text("judged", first)
    compared = {one.name: one for one in (*system.outputs, *system.judged)}
    weights = table.table("weights")
    weights.refuse_unknown(compared)
    if judged not in compared:
        raise table.wrong("judged", f"one of {', '.join(compared)}")
    return Objective(
        judged=judged,
        # Else each deviation counts by the size of its signal.
        weights={name: weights.number(name, "1") for name in weights.content}
        or {name: 1.0 / one.scale for name, one in compared.items()},
        bandwidth=table.number("bandwidth", "Hz", math.inf),
        begins=read_threshold(table.table("begins"), system) if "begins" in table else None,
        ends=read_threshold(table.table("ends"), system) if "ends" in table else None,
        when=table.text("when", ""),
    )


def read_fading(table: Table, system: System) -> Fading:
    """A signal, a sum of outputs, with which feedback fades."""
    table.refuse_unknown("signal half")
    signal = table.take("signal", str)
    system.refuse_missing(signal, f"{table.where} signal")
    return Fading(signal, table.number("half", system.unit(signal)))


def read_rolling(table: Table) -> Rolling:
    """Two states that roll along."""
    table.refuse_unknown("follower leader zero")
    return Rolling(table.take("follower", str), table.take("leader", str), table.take("zero", str))


def read_following(table: Table) -> Following:
    """A quantity that gains must find in time."""
    table.refuse_unknown("quantity within left")
    quantity, within = table.take("quantity", str), table.number("within", "s")
    return Following(quantity, within, table.number("left", "1"))


def read_view(table: Table, system: System) -> View:
    """A panel of the figures."""
    table.refuse_unknown("title note signals height low high")
    signals = table.texts("signals")
    for signal in signals:
        system.refuse_missing(signal, f"{table.where} signals")
    return View(
        title=table.take("title", str),
        note=table.text("note", ""),
        signals=signals,
        height=table.number("height", "1", 1.0),
        low=table.number("low", "1") if "low" in table else None,
        high=table.number("high", "1") if "high" in table else None,
    )
