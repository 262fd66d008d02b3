"""Tables of `system.toml`, one reader each."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from workbench.errors import InputError
from workbench.expression import Expression
from workbench.system import System
from workbench.system_comparison import (
    Channel,
    Comparison,
    Exclusion,
    Influence,
    Leading,
    Level,
    Rest,
)
from workbench.system_parts import (
    Condition,
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
    View,
)
from workbench.tables import Table
from workbench.units import si_factor

_BLOCK, _LASTING = 5, 20  # samples of a block, and blocks of a lasting error, unless said otherwise
_WAYS = ("value", "size", "rate", "integral", "turn")


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


def read_measured(file: Table, group: str) -> tuple[Signal, ...]:
    """Measured signals of a group: inputs, outputs or judged."""
    found = []
    for name in file.table(group).content:
        table = within(file, group, name)
        table.refuse_unknown(
            "unit shown label noise relative_noise relative_error scale scale_error reading "
            "mode smoothed held"
        )
        unit = table.unit("unit")
        shown = table.text("shown", unit)
        si_factor(shown, unit, f"{table.where} shown")
        relative = table.number("relative_noise", "1", 0.0)
        found.append(
            Signal(
                name=name,
                unit=unit,
                label=table.text("label", name),
                shown=shown,
                noise=table.number("noise", unit),
                relative_noise=relative,
                relative_error=table.number("relative_error", "1", relative),
                scale=table.number("scale", unit),
                scale_error=table.number("scale_error", "1", 0.0),
                reading=table.text("reading", name),
                mode=read_mode(table.table("mode")) if "mode" in table else None,
                smoothed=table.numbers("smoothed", "s", 2) if "smoothed" in table else (),
                held="held" in table and table.take("held", bool),
            )
        )
    return tuple(found)


def read_mode(table: Table) -> Mode:
    """A mode of vibration before a sensor."""
    table.refuse_unknown("frequency damping late")
    return Mode(
        table.number("frequency", "Hz"), table.number("damping", "1"), table.number("late", "s")
    )


def read_derived(table: Table) -> tuple[Derived, ...]:
    """Signals made of measured ones and of parameters."""
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("is unit label")
        formula = Expression(own.take("is", str), f"{own.where} is")
        found.append(Derived(name, own.unit("unit"), own.text("label", name), formula))
    return tuple(found)


def read_estimated(table: Table) -> tuple[Estimated, ...]:
    """Estimated quantities."""
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown(
            "correction label unit range prior walk spread memory useful acts_on claimed"
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
                spread=own.number("spread", unit, reach),
                memory=own.number("memory", "s", math.inf),
                useful=own.number("useful", unit, 0.1 * reach),
                acts_on=own.text("acts_on", ""),
                claimed={
                    key: own.table("claimed").take(key, str) for key in own.table("claimed").content
                },
            )
        )
    return tuple(found)


def read_condition_kinds(table: Table) -> tuple[Condition, ...]:
    """Conditions, and the parameters that they mean."""
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("label unit least above choices count parameters sign")
        choices: list[Any] = own.take("choices", list) if "choices" in own else []
        if bool(choices) == ("unit" in own):
            raise InputError(
                where=own.where,
                found="a unit and choices" if choices else "neither a unit nor choices",
                expected="either the unit of a quantity, or the choices",
                remedy='write unit = "m/s", or choices = ["new", "worn"]',
            )
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
                parameters={
                    choice: {
                        key: float(value) for key, value in parameters.take(choice, dict).items()
                    }
                    for choice in parameters.content
                },
                sign="sign" in own and own.take("sign", bool),
            )
        )
    return tuple(found)


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


def read_threshold(table: Table, system: System) -> Threshold:
    """A signal and the level above which something holds."""
    table.refuse_unknown("signal above")
    signal = table.take("signal", str)
    system.refuse_missing(signal, f"{table.where} signal")
    return Threshold(signal, table.number("above", system.unit(signal)))


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
    return Following(
        table.take("quantity", str), table.number("within", "s"), table.number("left", "1")
    )


def read_view(table: Table, system: System) -> View:
    """A panel of the figures."""
    table.refuse_unknown("title note signals height low high")
    signals = table.texts("signals")
    for signal in signals:
        system.refuse_missing(signal, f"{table.where} signals")
    low, high = (table.number(key, "1", math.nan) for key in ("low", "high"))
    return View(
        title=table.take("title", str),
        note=table.text("note", ""),
        signals=signals,
        height=table.number("height", "1", 1.0),
        low=None if math.isnan(low) else low,
        high=None if math.isnan(high) else high,
    )


def read_comparison(table: Table, system: System) -> Comparison:
    """How the diagnosis compares."""
    table.refuse_unknown(
        "begins rest leads channels tolerances levels excluded influences block lasting "
        "least settling"
    )
    block = table.number("block", "s", _BLOCK * system.sample_time)
    lasting = table.number("lasting", "s", _LASTING * block)
    tolerances, levels = table.table("tolerances"), table.table("levels")
    return Comparison(
        block=block,
        lasting=lasting,
        least=table.number("least", "s", 2.0 * lasting),
        settling=table.number("settling", "s", 0.0),
        channels=read_channels(table.table("channels"), system),
        leading=read_leading(table.table("leads")) if "leads" in table else None,
        begins=read_threshold(table.table("begins"), system) if "begins" in table else None,
        rest=read_rest(table.table("rest"), system) if "rest" in table else None,
        tolerances={name: tolerances.number(name, "1") for name in tolerances.content},
        levels={name: read_level(levels, name) for name in levels.content},
        exclusions=tuple(read_exclusion(one, system) for one in table.tables("excluded")),
        influences=read_influences(table.table("influences")),
    )


def read_channels(table: Table, system: System) -> tuple[Channel, ...]:
    """Channels as declared; else what is measured, one by one."""
    measured = {one.name: one for one in (*system.outputs, *system.judged)}
    if not table.content:
        usual = {name: {"is": name, "unit": one.unit} for name, one in measured.items()}
        table = Table(usual, table.where)
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("is unit label shown")
        unit = own.take("unit", str)
        shown = own.text("shown", unit)
        si_factor(shown, unit, f"{own.where} shown")
        label = own.text("label", measured[name].label if name in measured else name)
        formula = Expression(own.take("is", str), f"{own.where} is")
        found.append(Channel(name, unit, label, shown, formula))
    return tuple(found)


def read_influences(table: Table) -> tuple[Influence, ...]:
    """What errors may go with."""
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("is unit way")
        way = own.text("way", "value")
        if way not in _WAYS:
            raise own.wrong("way", f"one of {', '.join(_WAYS)}")
        formula = Expression(own.take("is", str), f"{own.where} is")
        found.append(Influence(name, own.unit("unit"), formula, way))
    return tuple(found)


def read_leading(table: Table) -> Leading:
    """A slow motion that an output leads."""
    table.refuse_unknown("output together ripple")
    output = table.take("output", str)
    return Leading(output, table.texts("together") or (output,), table.number("ripple", "1", 1.0))


def read_rest(table: Table, system: System) -> Rest:
    """An input that is measured at rest."""
    table.refuse_unknown("signal output zero")
    signal = table.take("signal", str)
    system.refuse_missing(signal, f"{table.where} signal")
    unit = system.unit(signal)
    return Rest(signal, table.take("output", str), table.number("zero", unit))


def read_level(levels: Table, name: str) -> Level:
    """A parameter that differs by nature."""
    table = Table(levels.take(name, dict), f"{levels.where} {name}")
    table.refuse_unknown("by spread")
    return Level(table.text("by", ""), table.number("spread", "1", math.inf))


def read_exclusion(table: Table, system: System) -> Exclusion:
    """Samples that do not count."""
    table.refuse_unknown("reason is above below from_rest within smoothed only_while to_the_end")
    if ("above" in table) == ("below" in table):
        raise InputError(
            where=table.where,
            found="'above' and 'below'" if "above" in table else "neither 'above' nor 'below'",
            expected="one of the two",
            remedy="say from which level on samples do not count",
        )
    while_ = table.table("only_while")
    return Exclusion(
        reason=table.take("reason", str),
        formula=Expression(table.take("is", str), f"{table.where} is"),
        above=table.number("above", "1", math.inf),
        below=table.number("below", "1", -math.inf),
        from_rest="from_rest" in table and table.take("from_rest", bool),
        within=table.number("within", "s", 0.0),
        smoothed=table.number("smoothed", "s", 0.0),
        only_while=read_threshold(while_, system) if "only_while" in table else None,
        to_the_end="to_the_end" in table and table.take("to_the_end", bool),
    )
