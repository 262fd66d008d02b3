"""Reader of `system.toml`: a machine becomes a `System`, checked against its model at the door."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from workbench.description import Description, read_description
from workbench.errors import InputError, closest
from workbench.expression import Expression
from workbench.system import (
    OBSERVER,
    Channel,
    Comparison,
    Condition,
    Derived,
    Estimated,
    Exclusion,
    Export,
    Fading,
    Following,
    Influence,
    Leading,
    Level,
    Mode,
    Model,
    Objective,
    OperatingPoint,
    Rest,
    Rolling,
    Signal,
    System,
    Threshold,
    View,
)
from workbench.tables import Table, read_table
from workbench.units import si_factor

_BLOCK, _LASTING = 5, 20  # samples of a block, and blocks of a lasting error, unless said otherwise
_WAYS = ("value", "size", "rate", "integral", "turn")


def read_system(path: Path) -> System:
    """Read a system file and check it against the model of its observer.

    Raises
    ------
    InputError
        At the first problem: the file and key, what was found, what was expected, what to do.
    """
    file = read_table(path, "give a system file, or the name of an installed one", 'title = "..."')
    file.refuse_unknown(
        ["name", "title", "companion", "reported", "models", "parameters", "inputs", "outputs", "judged"]
        + ["derived", "estimated", "states", "feedback", "points", "conditions", "objective"]
        + ["tuning", "diagnosis", "figures", "export", "shortest", "sample_time"]
    )
    system = _signals(file, path)
    system = _placed(file, with_model(system, OBSERVER, system.models[OBSERVER].path))
    _check_names(system)
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
        values=_values(description) | system.given,
        states=system.states or description.states,
    )


def _values(description: Description) -> dict[str, float]:
    return {
        v.name: float(v.start) for v in description.variables if v.real and v.start is not None
    }


def check_model(system: System, model: Description) -> None:
    """Refuse a model that estimators cannot work on; a variable without a unit is taken as SI.

    Raises
    ------
    InputError
        If it lacks a variable of the system, has a parameter without a value, or another unit.
    """
    variables = {v.name: v for v in model.variables}
    for ours, unit in system.variables.items():
        theirs = system.names.get(ours, ours)
        where = f"{model.path}, variable '{theirs}'"
        if ours not in variables:
            raise InputError(
                where=str(model.path),
                found=f"no variable '{ours}'{closest(ours, variables)}",
                expected=f"one for '{ours}' of {system.source}",
                remedy=f"use an FMU that has it, or map its name: --map {ours}=NAME",
            )
        needs_value = ours in system.constants or any(q.name == ours for q in system.estimated)
        if needs_value and variables[ours].start is None:
            raise InputError(
                where=where,
                found="no start value",
                expected=f"a parameter with a value for {ours}",
                remedy=f"make it a parameter of the model, or map another: --map {ours}=NAME",
            )
        declared = variables[ours].unit
        if declared and unit not in ("1", "") and si_factor(declared, unit, where) != 1.0:
            raise InputError(
                where=where,
                found=f"unit [{declared}]",
                expected=f"[{unit}] for {ours}; nothing is converted silently",
                remedy=f"export the model with this variable in {unit}",
            )
    for name in system.given:
        if name not in model.names("parameter"):
            raise InputError(
                where=f"{system.source}, [parameters] {name}",
                found="no such parameter of the model",
                expected=f"a parameter of {model.name}{closest(name, model.names('parameter'))}",
                remedy="correct the name",
            )


def _signals(file: Table, path: Path) -> System:
    """The system without what its model must be known for."""
    models = {
        role: _model(Table(file.table("models").take(role, dict), f"{path}, [models] {role}"), path)
        for role in file.table("models").content
    }
    if OBSERVER not in models:
        raise InputError(
            where=f"{path}, [models]",
            found=f"roles {', '.join(models) or 'none'}",
            expected=f"a model in the role '{OBSERVER}', which estimators run on",
            remedy=f'add {OBSERVER} = {{ class = "NAME" }}',
        )
    description = None
    if (fmu := models[OBSERVER].path) is not None:
        description = read_description(fmu)
    units = {v.name: v.unit or "1" for v in description.variables} if description else {}
    groups = {group: _measured(file, group) for group in ("inputs", "outputs", "judged")}
    for group in ("inputs", "outputs"):
        if not groups[group]:
            raise InputError(
                where=str(path),
                found=f"no [{group}]",
                expected="measured inputs, which drive the model, and outputs, which correct it",
                remedy=f"add a table [{group}.NAME] for each",
            )
    parameters = file.table("parameters")
    return System(
        name=file.text("name", path.resolve().parent.name),
        title=file.take("title", str),
        source=path,
        library=path.parent / "package.mo",
        models=models,
        names={},
        given={name: parameters.number(name, units.get(name, "1")) for name in parameters.content},
        values={},
        walks=_of_states(file, "walk"),
        spreads=_of_states(file, "spread"),
        **groups,
        derived=_derived(file.table("derived")),
        estimated=_estimated(file.table("estimated")),
        reported={name: units.get(name, "1") for name in file.texts("reported")},
        conditions=_conditions(file.table("conditions")),
        design=OperatingPoint({}, {}, {}),
        tested=OperatingPoint({}, {}, {}),
        objective=Objective("", {}, 0.0, None, None, ""),
        comparison=Comparison(0.0, 0.0, 0.0, 0.0, (), None, None, None, {}, {}, (), ()),
        companion=file.text("companion", ""),
        shortest=file.number("shortest", "s", 0.0),
        settles=file.table("points").number("settles", "s", 10.0),
        sample_time=file.number("sample_time", "s"),
    )


def _model(table: Table, path: Path) -> Model:
    table.refuse_unknown(("class", "fmu"))
    fmu = table.text("fmu", "")
    return Model(table.take("class", str), (path.parent / fmu).resolve() if fmu else None)


def _of_states(file: Table, key: str) -> dict[str, float]:
    tables = {name: _sub(file, "states", name) for name in file.table("states").content}
    for table in tables.values():
        table.refuse_unknown(("walk", "spread"))
    return {name: table.number(key, "1") for name, table in tables.items() if key in table}


def _sub(file: Table, group: str, name: str) -> Table:
    return Table(file.table(group).take(name, dict), f"{file.where}, [{group}.{name}]")


def _measured(file: Table, group: str) -> tuple[Signal, ...]:
    found = []
    for name in file.table(group).content:
        table = _sub(file, group, name)
        table.refuse_unknown(
            ("unit", "shown", "label", "noise", "relative_noise", "relative_error")
            + ("scale", "scale_error", "reading", "mode", "smoothed")
        )
        unit = table.take("unit", str)
        shown = table.text("shown", unit)
        si_factor(unit, unit, f"{table.where} unit")
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
                mode=_mode(table.table("mode")) if "mode" in table else None,
                smoothed=table.numbers("smoothed", "s", 2) if "smoothed" in table else (),
            )
        )
    return tuple(found)


def _mode(table: Table) -> Mode:
    table.refuse_unknown(("frequency", "damping", "late"))
    return Mode(
        table.number("frequency", "Hz"), table.number("damping", "1"), table.number("late", "s")
    )


def _derived(table: Table) -> tuple[Derived, ...]:
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown(("is", "unit", "label"))
        formula = Expression(own.take("is", str), f"{own.where} is")
        found.append(Derived(name, own.take("unit", str), own.text("label", name), formula))
    return tuple(found)


def _estimated(table: Table) -> tuple[Estimated, ...]:
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown(
            ("correction", "label", "unit", "range", "prior", "walk", "spread", "memory")
            + ("useful", "acts_on", "claimed")
        )
        unit = own.text("unit", "1")
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
                claimed={key: own.table("claimed").take(key, str) for key in own.table("claimed").content},
            )
        )
    return tuple(found)


def _conditions(table: Table) -> tuple[Condition, ...]:
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown(("label", "unit", "least", "above", "choices", "count", "parameters", "sign"))
        choices: list[Any] = own.take("choices", list) if "choices" in own else []
        if bool(choices) == ("unit" in own):
            raise InputError(
                where=own.where,
                found="a unit and choices" if choices else "neither a unit nor choices",
                expected="either the unit of a quantity, or the choices",
                remedy='write unit = "m/s", or choices = ["dry", "wet"]',
            )
        parameters = own.table("parameters")
        for choice in parameters.content:
            if choice not in map(str, choices):
                raise parameters.wrong(choice, f"one of {', '.join(map(str, choices))}")
        found.append(
            Condition(
                name=name,
                label=own.text("label", name),
                unit=own.text("unit", ""),
                least=own.number("above", "1", own.number("least", "1", -math.inf)),
                exclusive="above" in own,
                choices=tuple(choices),
                count=own.take("count", int) if "count" in own else 0,
                parameters={
                    choice: {key: float(value) for key, value in parameters.take(choice, dict).items()}
                    for choice in parameters.content
                },
                sign="sign" in own and own.take("sign", bool),
            )
        )
    return tuple(found)


def _placed(file: Table, system: System) -> System:
    """The system with all that names its signals."""
    feedback, tuning = file.table("feedback"), file.table("tuning")
    feedback.refuse_unknown(("fades", "rolls"))
    tuning.refuse_unknown(("follows",))
    points = file.table("points")
    points.refuse_unknown(("settles", "design", "tested"))
    design = _point(points, "design", system)
    return replace(
        system,
        design=design,
        tested=_point(points, "tested", system) if "tested" in points else design,
        objective=_objective(file.table("objective"), system),
        comparison=_comparison(file.table("diagnosis"), system),
        fading=_fading(feedback.table("fades"), system) if "fades" in feedback else None,
        rolling=_rolling(feedback.table("rolls")) if "rolls" in feedback else None,
        following=_following(tuning.table("follows")) if "follows" in tuning else None,
        panels=tuple(_view(table, system) for table in file.tables("figures")),
        export=_export(file.table("export"), system),
    )


def _point(points: Table, name: str, system: System) -> OperatingPoint:
    table = points.table(name)
    table.refuse_unknown(("inputs", "held", "quantities"))
    inputs, held, quantities = (table.table(key) for key in ("inputs", "held", "quantities"))
    inputs.refuse_unknown(one.name for one in system.inputs)
    quantities.refuse_unknown(one.name for one in system.estimated)
    units = {one.name: one.unit for one in (*system.inputs, *system.estimated)}
    return OperatingPoint(
        {key: inputs.number(key, units[key]) for key in inputs.content},
        {key: Expression(held.take(key, str), f"{held.where} {key}") for key in held.content},
        {key: quantities.number(key, units[key]) for key in quantities.content},
    )


def _export(table: Table, system: System) -> Export:
    table.refuse_unknown(("classes", "start"))
    classes = table.table("classes")
    return Export(
        {name: classes.take(name, str) for name in classes.content},
        _point(table, "start", system) if "start" in table else OperatingPoint({}, {}, {}),
    )


def _threshold(table: Table, system: System) -> Threshold:
    table.refuse_unknown(("signal", "above"))
    signal = table.take("signal", str)
    system.refuse_missing(signal, f"{table.where} signal")
    return Threshold(signal, table.number("above", system.unit(signal)))


def _objective(table: Table, system: System) -> Objective:
    table.refuse_unknown(("judged", "weights", "bandwidth", "begins", "ends", "when"))
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
        begins=_threshold(table.table("begins"), system) if "begins" in table else None,
        ends=_threshold(table.table("ends"), system) if "ends" in table else None,
        when=table.text("when", ""),
    )


def _fading(table: Table, system: System) -> Fading:
    table.refuse_unknown(("signal", "half"))
    signal = table.take("signal", str)
    system.refuse_missing(signal, f"{table.where} signal")
    system.slopes(signal)
    return Fading(signal, table.number("half", system.unit(signal)))


def _rolling(table: Table) -> Rolling:
    table.refuse_unknown(("follower", "leader", "zero"))
    return Rolling(table.take("follower", str), table.take("leader", str), table.take("zero", str))


def _following(table: Table) -> Following:
    table.refuse_unknown(("quantity", "within", "left"))
    return Following(
        table.take("quantity", str), table.number("within", "s"), table.number("left", "1")
    )


def _view(table: Table, system: System) -> View:
    table.refuse_unknown(("title", "note", "signals", "height", "low", "high"))
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


def _comparison(table: Table, system: System) -> Comparison:
    table.refuse_unknown(
        ("begins", "rest", "leads", "channels", "tolerances", "levels", "excluded", "influences")
        + ("block", "lasting", "least", "settling")
    )
    block = table.number("block", "s", _BLOCK * system.sample_time)
    lasting = table.number("lasting", "s", _LASTING * block)
    tolerances, levels = table.table("tolerances"), table.table("levels")
    channels = tuple(
        Channel(one.name, one.unit, one.formula) for one in _derived(table.table("channels"))
    )
    default = tuple(
        Channel(one.name, one.unit, Expression(one.name, str(system.source)))
        for one in (*system.outputs, *system.judged)
    )
    return Comparison(
        block=block,
        lasting=lasting,
        least=table.number("least", "s", 2.0 * lasting),
        settling=table.number("settling", "s", 0.0),
        channels=channels or default,
        leading=_leading(table.table("leads")) if "leads" in table else None,
        begins=_threshold(table.table("begins"), system) if "begins" in table else None,
        rest=_rest(table.table("rest"), system) if "rest" in table else None,
        tolerances={name: tolerances.number(name, "1") for name in tolerances.content},
        levels={name: _level(levels, name) for name in levels.content},
        exclusions=tuple(_exclusion(one, system) for one in table.tables("excluded")),
        influences=_influences(table.table("influences")),
    )


def _influences(table: Table) -> tuple[Influence, ...]:
    found = []
    for name in table.content:
        own = Table(table.take(name, dict), f"{table.where} {name}")
        own.refuse_unknown(("is", "unit", "way"))
        way = own.text("way", "value")
        if way not in _WAYS:
            raise own.wrong("way", f"one of {', '.join(_WAYS)}")
        formula = Expression(own.take("is", str), f"{own.where} is")
        found.append(Influence(name, own.take("unit", str), formula, way))
    return tuple(found)


def _leading(table: Table) -> Leading:
    table.refuse_unknown(("output", "together", "ripple"))
    output = table.take("output", str)
    return Leading(output, table.texts("together") or (output,), table.number("ripple", "1", 1.0))


def _rest(table: Table, system: System) -> Rest:
    table.refuse_unknown(("signal", "output", "zero"))
    signal = table.take("signal", str)
    system.refuse_missing(signal, f"{table.where} signal")
    unit = system.unit(signal)
    return Rest(signal, table.take("output", str), table.number("zero", unit))


def _level(levels: Table, name: str) -> Level:
    table = Table(levels.take(name, dict), f"{levels.where} {name}")
    table.refuse_unknown(("by", "spread"))
    return Level(table.text("by", ""), table.number("spread", "1", math.inf))


def _exclusion(table: Table, system: System) -> Exclusion:
    table.refuse_unknown(
        ("reason", "is", "above", "below", "from_rest", "within", "smoothed", "only_while")
        + ("to_the_end",)
    )
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
        only_while=_threshold(while_, system) if "only_while" in table else None,
        to_the_end="to_the_end" in table and table.take("to_the_end", bool),
    )


def _check_names(system: System) -> None:
    """Refuse formulas and tables that name what neither model nor recordings have."""
    known = {*system.signals, *(one.name for one in system.derived), *system.values}
    formulas = [
        *(one.formula for one in system.derived),
        *(one.formula for one in system.comparison.channels),
        *(one.formula for one in system.comparison.exclusions),
        *(one.formula for one in system.comparison.influences),
    ]
    for formula in formulas if system.values else ():
        for name in formula.names - known:
            raise InputError(
                where=formula.where,
                found=f"'{name}'{closest(name, known)}",
                expected="a measured or derived signal, or a parameter of the model",
                remedy="correct the name",
            )
    tables: Mapping[str, Mapping[str, Any]] = {
        "diagnosis.tolerances": system.comparison.tolerances,
        "diagnosis.levels": system.comparison.levels,
        **{
            f"conditions.{one.name}.parameters": choice
            for one in system.conditions
            for choice in one.parameters.values()
        },
    }
    for table, entries in tables.items() if system.values else ():
        for name in entries:
            if name not in system.values:
                raise InputError(
                    where=f"{system.source}, [{table}] {name}",
                    found=f"no such parameter of the model{closest(name, system.values)}",
                    expected=f"a parameter of {system.models[OBSERVER].name}",
                    remedy="correct the name",
                )
