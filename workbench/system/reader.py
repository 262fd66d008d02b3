"""Reader of `system.toml`: a machine becomes a `System`, checked against its model at the door."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from workbench.errors import InputError, closest
from workbench.models.description import Description, read_description
from workbench.system.check import check_model, check_references
from workbench.system.comparison import (
    RATE,
    Channel,
    Comparison,
    Exclusion,
    Influence,
    LeadingOutput,
    Level,
    Rest,
    Wander,
)
from workbench.system.experiments import (
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
from workbench.system.expression import Expression
from workbench.system.parts import (
    FIRST,
    LARGEST,
    Agreement,
    Condition,
    DerivedSignal,
    EstimatedQuantity,
    Export,
    FeedbackFading,
    Mode,
    Model,
    Objective,
    OperatingPoint,
    RecordingSplit,
    Redundancy,
    RollingStates,
    Sampling,
    Signal,
    StepTracking,
    Store,
    Threshold,
    Tolerance,
    View,
)
from workbench.system.plugins import plugin_of
from workbench.system.stopping import (
    COMMAND,
    END,
    SPEED,
    AskedQuantity,
    Difference,
    DrivenInput,
    Nominal,
    Rating,
    Stopping,
)
from workbench.system.system import OBSERVER, System
from workbench.system.tables import Table, read_table
from workbench.system.units import check_unit, quantity, si_factor

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


def _recorded_as(signal: Table, name: str) -> DerivedSignal:
    """What recorders have in the place of a signal."""
    table = signal.table("recorded_as")
    table.refuse_unknown("is unit")
    formula = Expression(table.take("is", str), f"{table.where} is")
    if name not in formula.names:
        raise table.wrong("is", f"a formula of {name}")
    return DerivedSignal(name, table.unit("unit"), formula.text, formula)


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


def read_derived(table: Table, unit: str = "") -> tuple[DerivedSignal, ...]:
    """What is made of measured signals and of parameters; in one unit, or each in its own."""
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        if unit:
            own.refuse_unknown("is label")
        else:
            own.refuse_unknown("is unit label")
        formula = Expression(own.take("is", str), f"{own.where} is")
        found.append(
            DerivedSignal(name, unit or own.unit("unit"), own.text("label", name), formula)
        )
    return tuple(found)


def read_estimated(table: Table) -> tuple[EstimatedQuantity, ...]:
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
            EstimatedQuantity(
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
    quantities.refuse_unknown(quantity.name for quantity in system.estimated)
    units = {one.name: one.unit for one in system.inputs}
    units |= {quantity.name: quantity.unit for quantity in system.estimated}
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
    first = (*system.reference_signals, *system.outputs)[0].name
    judged = table.text("judged", first)
    compared = {signal.name: signal for signal in (*system.outputs, *system.reference_signals)}
    weights = table.table("weights")
    weights.refuse_unknown(compared)
    if judged not in compared:
        raise table.wrong("judged", f"one of {', '.join(compared)}")
    return Objective(
        signal=judged,
        # Else each deviation counts by the size of its signal.
        weights={name: weights.number(name, "1") for name in weights.content}
        or {name: 1.0 / one.scale for name, one in compared.items()},
        bandwidth=table.number("bandwidth", "Hz", math.inf),
        begins=read_threshold(table.table("begins"), system) if "begins" in table else None,
        ends=read_threshold(table.table("ends"), system) if "ends" in table else None,
        when=table.text("when", ""),
    )


def read_fading(table: Table, system: System) -> FeedbackFading:
    """A signal, a sum of outputs, with which feedback fades."""
    table.refuse_unknown("signal half")
    signal = table.take("signal", str)
    system.refuse_missing(signal, f"{table.where} signal")
    return FeedbackFading(signal, table.number("half", system.unit(signal)))


def read_rolling(table: Table) -> RollingStates:
    """Two states that roll along."""
    table.refuse_unknown("follower leader zero")
    return RollingStates(
        table.take("follower", str), table.take("leader", str), table.take("zero", str)
    )


def read_following(table: Table) -> StepTracking:
    """A quantity that gains must find in time."""
    table.refuse_unknown("quantity within left")
    quantity, within = table.take("quantity", str), table.number("within", "s")
    return StepTracking(quantity, within, table.number("left", "1"))


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


_BLOCK, _LASTING = 5, 20  # samples of a block, and blocks of a lasting error, unless said otherwise


_LEFT = 0.03  # of a detailed model: laws that differ in form agree to some 3 %


_WAYS = ("value", "size", "rate", "integral", "turn")


def read_comparison(table: Table, system: System) -> Comparison:
    """How the diagnosis compares."""
    table.refuse_unknown(
        "begins rest leads channels tolerances levels wander excluded influences block lasting "
        "least settling left false_alarms"
    )
    block = table.number("block", "s", _BLOCK * system.sample_time)
    lasting = table.number("lasting", "s", _LASTING * block)
    tolerances, levels = table.table("tolerances"), table.table("levels")
    return Comparison(
        block=block,
        lasting=lasting,
        least=table.number("least", "s", 2.0 * lasting),
        settling=table.number("settling", "s", 0.0),
        left=table.number("left", "1", _LEFT),
        false_alarms=_rate(table),
        channels=read_channels(table.table("channels"), system),
        leading=read_leading(table.table("leads")) if "leads" in table else None,
        begins=read_threshold(table.table("begins"), system) if "begins" in table else None,
        rest=read_rest(table.table("rest"), system) if "rest" in table else None,
        tolerances={name: tolerances.number(name, "1") for name in tolerances.content},
        levels={name: read_level(levels, name) for name in levels.content},
        wander=read_wander(table.table("wander")),
        exclusions=tuple(read_exclusion(one, system) for one in table.tables("excluded")),
        influences=read_influences(table.table("influences")),
    )


def _rate(table: Table) -> float:
    rate = table.number("false_alarms", "1", RATE)
    if not 0.0 < rate < 1.0:
        raise table.wrong("false_alarms", "a share between 0 and 1")
    return rate


def read_channels(table: Table, system: System) -> tuple[Channel, ...]:
    """Channels as declared; else what is measured, one by one."""
    measured = {signal.name: signal for signal in (*system.outputs, *system.reference_signals)}
    if not table.content:
        usual = {n: {"is": n, "unit": one.unit, "shown": one.shown} for n, one in measured.items()}
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


def read_leading(table: Table) -> LeadingOutput:
    """A slow motion that an output leads."""
    table.refuse_unknown("output together ripple")
    output = table.take("output", str)
    return LeadingOutput(
        output, table.texts("together") or (output,), table.number("ripple", "1", 1.0)
    )


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


def read_wander(table: Table) -> dict[str, Wander]:
    """What differs along a recording."""
    found = {}
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("share over")
        found[name] = Wander(own.number("share", "1"), own.number("over", "s"))
    return found


def read_exclusion(table: Table, system: System) -> Exclusion:
    """Samples that do not count."""
    table.refuse_unknown(
        "reason is above below from_rest within smoothed only_while to_the_end restarted uncertain"
    )
    if ("above" in table) == ("below" in table):
        raise InputError(
            where=table.where,
            found="'above' and 'below'" if "above" in table else "neither 'above' nor 'below'",
            expected="one of the two",
            remedy="say from which level on samples do not count",
        )
    while_, uncertain = table.table("only_while"), table.table("uncertain")
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
        restarted=table.texts("restarted"),
        uncertain={name: uncertain.number(name, "1") for name in uncertain.content},
    )


def read_stopping(table: Table, system: System) -> Stopping:
    """How the machine stops."""
    table.refuse_unknown(
        "speed state rest longest timed_by asked inputs start differs outside nominal rating"
    )
    measured = {*system.signals, *(signal.name for signal in system.derived), *system.values}
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
    outputs = {output.name for output in system.outputs}
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


def _asked(table: Table, measured: Collection[str]) -> tuple[AskedQuantity, ...]:
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
        found.append(AskedQuantity(name, label, unit, shown, formula, place, usual))
    return tuple(found)


def _driven(inputs: Table, name: str, asked: Collection[str]) -> DrivenInput:
    own = Table(inputs.take(name, dict), f"{inputs.where} {name}")
    own.refuse_unknown("is delay lag along")
    formula = _formula(own, "is", asked, "an asked quantity")
    delay, lag = own.number("delay", "s", 0.0), own.number("lag", "s", 0.0)
    return DrivenInput(name, formula, delay, lag, "along" in own and own.take("along", bool))


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
        speeds=tuple(quantity(speed, "m/s", f"{table.where} speeds") for speed in speeds),
    )


def _rating(table: Table) -> Rating:
    table.refuse_unknown("label constants")
    constants = table.table("constants")
    found = {}
    for speed in constants.content:
        top, less = constants.numbers(speed, "1", 2)
        found[quantity(speed, "m/s", f"{constants.where} {speed}")] = (top, less)
    return Rating(table.take("label", str), found)


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
    table.refuse_unknown(condition.name for condition in system.conditions)
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
    taken = {*system.signals, *system.values, *(condition.name for condition in system.conditions)}
    for name in table.content:
        if name in taken:
            raise table.wrong(name, "a name that no signal, parameter or condition has")
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown("label unit values")
        unit, texts = own.take("unit", str), own.texts("values")
        if not texts:
            raise own.wrong("values", "one value or more")
        check_unit(unit, f"{own.where} unit")
        found[name] = tuple(Setting(quantity(text, unit, own.where), text) for text in texts)
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


def read_redundancy(table: Table, system: System) -> Redundancy:
    """Two formulas that tell the same."""
    table.refuse_unknown("reason is equals stores over unit within slack only_while")
    while_ = table.table("only_while")
    side = "above" if "above" in while_ else "below"
    only = read_threshold(while_, system, side) if "only_while" in table else None
    return Redundancy(
        reason=table.take("reason", str),
        formula=Expression(table.take("is", str), f"{table.where} is"),
        other=Expression(table.take("equals", str), f"{table.where} equals"),
        unit=table.unit("unit"),
        tolerance=read_tolerance(table, table.unit("unit")),
        store=_store(table) if "stores" in table or "over" in table else None,
        while_below=only if side == "below" else None,
        while_above=only if side == "above" else None,
    )


def _store(table: Table) -> Store:
    formula = Expression(table.take("stores", str), f"{table.where} stores")
    table.take("over", str)
    return Store(formula, positive(table, "over"))


def read_cutting(table: Table, system: System) -> RecordingSplit:
    """Which parts of a long recording are recordings of their own."""
    table.refuse_unknown("begins ends released before after")
    return RecordingSplit(
        begins=read_threshold(table.table("begins"), system),
        ends=read_threshold(table.table("ends"), system, "below"),
        released=table.number("released", "s", 0.0),
        before=table.number("before", "s", 0.0),
        after=table.number("after", "s", 0.0),
    )


def read_sampling(table: Table) -> Sampling:
    """Which times between samples are likely."""
    table.refuse_unknown("slowest gaps")
    likely, possible = table.numbers("gaps", "s", 2) if "gaps" in table else (math.inf, math.inf)
    if likely > possible:
        raise table.wrong("gaps", "the longest likely time before the longest possible one")
    return Sampling(table.number("slowest", "s", math.inf), likely, possible)


def read_loggers(table: Table, signals: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Measured signals by the logger that records them."""
    found: dict[str, tuple[str, ...]] = {}
    for logger in table.content:
        own = table.texts(logger)
        if not logger.isidentifier() or not own:
            raise InputError(
                where=f"{table.where} {logger}",
                found="no signal"
                if logger.isidentifier()
                else f"'{logger}', a name of no one word",
                expected="a name of letters and digits, and the measured signals of this logger",
                remedy=f'write for instance second = ["{signals[0]}"]',
            )
        for k, name in enumerate(own):
            taken = next((other for other, names in found.items() if name in names), "")
            if name not in signals:
                problem = f"'{name}'{closest(name, signals)}"
            elif taken or name in own[:k]:
                problem = f"'{name}' a second time, after that of {taken or logger}"
            else:
                continue
            raise InputError(
                where=f"{table.where} {logger}",
                found=problem,
                expected=f"measured signals, each of one logger: {', '.join(signals)}",
                remedy="correct the name" if name not in signals else "name it once",
            )
        found[logger] = own
    return found


def read_system(path: Path) -> System:
    """Read a system file and check it against the FMU of its observer, if that is built.

    Raises
    ------
    InputError
        At the first problem: the file and key, what was found, what was expected, what to do.
    """
    file = read_table(path, "give a system file, or the name of an installed one", 'title = "..."')
    file.refuse_unknown(
        "name title plugin companion reported models parameters inputs outputs judged aids derived "
        "estimated states feedback points conditions objective tuning diagnosis figures "
        "export shortest fewest sample_time cases sampling redundancies next cutting distance work "
        "loggers bands"
    )
    return _read(file, path, _models(file, path))


def with_built(system: System, paths: Mapping[str, Path]) -> System:
    """The same system, read again, with FMUs that were built for some roles.

    Raises
    ------
    InputError
        As `read_system`.
    """
    file = read_table(system.source, "keep the file while it is used", 'title = "..."')
    built = {
        role: replace(model, path=paths.get(role, model.path))
        for role, model in system.models.items()
    }
    return _read(file, system.source, built)


def _read(file: Table, path: Path, models: Mapping[str, Model]) -> System:
    system = _signals(file, path, models)
    model = models[OBSERVER].path
    system = _placed(file, with_model(system, OBSERVER, model))
    if model is not None:
        check_references(system, read_description(model))
    return system


def with_model(system: System, role: str, path: Path | None) -> System:
    """The same system with another FMU in a role, checked; its parameters are then those of it.

    Raises
    ------
    InputError
        If the FMU lacks a variable, or has it in another unit.
    """
    models = {**system.models, role: replace(system.model(role), path=path)}
    changed = replace(system, models=models)
    if role != OBSERVER or path is None:
        return changed
    description = read_description(path).renamed(system.names)
    check_model(changed, description)
    return replace(
        changed,
        values={**_values(description), **system.given},
        states=description.states if system.states is None else system.states,
    )


def _values(description: Description) -> dict[str, float]:
    return {v.name: float(v.start) for v in description.variables if v.real and v.start is not None}


def _models(file: Table, path: Path) -> dict[str, Model]:
    """Models by role."""
    roles = file.table("models").content
    models = {role: read_model(within(file, "models", role), path) for role in roles}
    if OBSERVER not in models:
        raise InputError(
            where=f"{path}, [models]",
            found=f"roles {', '.join(models) or 'none'}",
            expected=f"a model in the role '{OBSERVER}', which estimators run on",
            remedy=f'add {OBSERVER} = {{ class = "NAME" }}',
        )
    return models


def _measured(file: Table) -> dict[str, tuple[Signal, ...]]:
    """Measured signals by group."""
    groups = {group: read_measured(file, group) for group in GROUPS}
    if not groups["outputs"]:
        raise InputError(
            where=file.where,
            found="no [outputs]",
            expected="measured outputs, which correct the model",
            remedy="add a table [outputs.NAME] for each",
        )
    return groups


def _signals(file: Table, path: Path, models: Mapping[str, Model]) -> System:
    """The system without what its model must be known for."""
    fmu = models[OBSERVER].path
    description = read_description(fmu) if fmu is not None else None
    units = {v.name: v.unit or "1" for v in description.variables} if description else {}
    groups = _measured(file)
    # Units are known when the model is.
    parameters = file.table("parameters") if description else Table({}, "")
    states = file if description else Table({}, "")
    return System(
        name=file.text("name", path.resolve().parent.name),
        title=file.take("title", str),
        source=path,
        library=path.parent / "package.mo",
        models=models,
        names={},
        given={name: parameters.number(name, units.get(name, "1")) for name in parameters.content},
        values={},
        walks=read_of_states(states, "walk", units),
        spreads=read_of_states(states, "spread", units),
        inputs=groups["inputs"],
        outputs=groups["outputs"],
        reference_signals=groups["judged"],
        intermittent=groups["aids"],
        derived=read_derived(file.table("derived")),
        estimated=read_estimated(file.table("estimated")),
        work=read_derived(file.table("work"), "W"),
        reported={name: units.get(name, "1") for name in file.texts("reported")},
        conditions=read_condition_kinds(file.table("conditions")),
        design=OperatingPoint({}, {}, {}),
        tested=OperatingPoint({}, {}, {}),
        objective=Objective("", {}, 0.0, None, None, ""),
        comparison=Comparison(
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0, (), None, None, None, {}, {}, {}, (), ()
        ),
        plugin=plugin_of(file),
        shortest=file.number("shortest", "s", 0.0),
        fewest=round(file.number("fewest", "1", 20.0)),
        cases=path.parent / cases if (cases := file.text("cases", "")) else None,
        settles=file.table("points").number("settles", "s", 10.0),
        sample_time=file.number("sample_time", "s"),
        sampling=read_sampling(file.table("sampling")),
        loggers=read_loggers(
            file.table("loggers"), [n.name for own in groups.values() for n in own]
        ),
    )


def _placed(file: Table, system: System) -> System:
    """The system with all that names its signals."""
    feedback, tuning = file.table("feedback"), file.table("tuning")
    feedback.refuse_unknown("fades rolls learns")
    tuning.refuse_unknown("follows")
    points = file.table("points")
    points.refuse_unknown("settles design tested")
    design = read_point(points, "design", system)
    return replace(
        system,
        design=design,
        tested=read_point(points, "tested", system) if "tested" in points else design,
        objective=read_objective(file.table("objective"), system),
        comparison=read_comparison(file.table("diagnosis"), system),
        fading=read_fading(feedback.table("fades"), system) if "fades" in feedback else None,
        rolling=read_rolling(feedback.table("rolls")) if "rolls" in feedback else None,
        learns=positive(feedback, "learns"),
        bands=read_bands(file, system),
        following=read_following(tuning.table("follows")) if "follows" in tuning else None,
        panels=tuple(read_view(table, system) for table in file.tables("figures")),
        export=read_export(file.table("export"), system),
        redundancies=tuple(read_redundancy(table, system) for table in file.tables("redundancies")),
        experiments=read_experiments(file.table("next"), system) if "next" in file else None,
        cutting=read_cutting(file.table("cutting"), system) if "cutting" in file else None,
        stopping=read_stopping(file.table("distance"), system) if "distance" in file else None,
    )
