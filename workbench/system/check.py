"""A system against its model: whatever its file names is there, and in the same unit."""

from collections.abc import Collection, Iterator

from workbench.errors import InputError, closest
from workbench.models.description import Description
from workbench.system.system import System
from workbench.system.units import si_factor


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


def check_references(system: System, model: Description) -> None:
    """Refuse names in the system's file that neither model nor recordings have.

    Raises
    ------
    InputError
        At the first: where it stands, and what is like it. Also if feedback fades with a signal
        that is no sum of outputs.
    """
    variables = {variable.name for variable in model.variables}
    references = (*_formulas(system), *_parameters(system), *_of_model(system, variables))
    for where, name, known, expected in (*references, *_of_system(system)):
        if name not in known:
            raise InputError(
                where=where,
                found=f"'{name}'{closest(name, known)}",
                expected=expected,
                remedy="correct the name",
            )
    if system.fading:
        system.slopes(system.fading.signal)  # a sum of outputs, or refused


# Where a name stands, the name, what it may be, and that in words.
_Reference = tuple[str, str, Collection[str], str]


def _formulas(system: System) -> Iterator[_Reference]:
    measured = {*system.signals, *system.values}
    expected = "a measured or derived signal, or a parameter of the model"
    for signal in system.derived:  # made of those before it
        for name in sorted(signal.formula.names):
            yield signal.formula.where, name, frozenset(measured), expected
        measured.add(signal.name)
    compared = system.comparison
    for formula in (
        *(
            side
            for redundancy in system.redundancies
            for side in (redundancy.formula, redundancy.other)
        ),
        *(redundancy.store.formula for redundancy in system.redundancies if redundancy.store),
        *(condition.agrees.formula for condition in system.conditions if condition.agrees),
        *(signal.recorded_as.formula for signal in system.signals.values() if signal.recorded_as),
        *(one.formula for one in system.work),
        *(channel.formula for channel in compared.channels),
        *(exclusion.formula for exclusion in compared.exclusions),
        *(influence.formula for influence in compared.influences),
    ):
        for name in sorted(formula.names):
            yield formula.where, name, measured, expected
    for point in (system.design, system.tested, system.export.start):
        for formula in point.held.values():
            for name in sorted(formula.names):
                yield formula.where, name, system.values, "a parameter of the model"
    yield from _of_experiments(system)


def _of_experiments(system: System) -> Iterator[_Reference]:
    """Names in formulas of what may be run next."""
    asked = system.experiments
    if asked is None:
        return
    state = "a continuous state of the model"
    for name, formula in asked.start.items():
        yield formula.where, name, system.states or (), state
        for key in sorted(formula.names):
            expected = "a parameter of the model, or what is set"
            yield formula.where, key, {*system.values, *asked.settings}, expected
    for key in sorted(asked.cost.formula.names):
        expected = "duration, or what is set"
        yield asked.cost.formula.where, key, {"duration", *asked.settings}, expected


def _parameters(system: System) -> Iterator[_Reference]:
    tables = [
        ("diagnosis.tolerances", system.comparison.tolerances),
        ("diagnosis.wander", system.comparison.wander),
        ("diagnosis.levels", system.comparison.levels),
        *(
            ("diagnosis.excluded", exclusion.uncertain)
            for exclusion in system.comparison.exclusions
        ),
        *(
            (f"conditions.{condition.name}.parameters", parameters)
            for condition in system.conditions
            for parameters in condition.parameters.values()
        ),
        *(
            (f"conditions.{condition.name}.sets", [condition.sets])
            for condition in system.conditions
            if condition.sets
        ),
    ]
    for table, entries in tables:
        for name in entries:
            where = f"{system.source}, [{table}] {name}"
            yield where, name, system.values, "a parameter of the model"


def _of_model(system: System, variables: Collection[str]) -> Iterator[_Reference]:
    """States and outputs of the model."""
    state, output = "a continuous state of the model", "a variable of the model"
    states, compared = system.states or (), system.comparison
    shown = (*states, *(output.name for output in system.outputs))
    for name in (*system.walks, *system.spreads):
        yield f"{system.source}, [states.{name}]", name, states, state
    for quantity in system.estimated:
        if quantity.acts_on:
            where = f"{system.source}, [estimated] {quantity.name} acts_on"
            yield where, quantity.acts_on, shown, f"{state}, or a measured output"
    for signal in system.signals.values():
        if signal.reading != signal.name:
            yield f"{system.source}, {signal.name} reading", signal.reading, variables, output
    if rolling := system.rolling:
        where = f"{system.source}, [feedback] rolls"
        yield f"{where} follower", rolling.follower, states, state
        yield f"{where} leader", rolling.leader, states, state
        yield f"{where} zero", rolling.zero, variables, output
    for point in (system.design, system.tested, system.export.start):
        for name, formula in point.held.items():
            yield formula.where, name, states, state
    if asked := system.experiments:
        ends = [] if asked.ends is None else [asked.ends.formula]
        for formula in (*asked.driven.values(), *ends):
            known = {*variables, *system.values, *asked.settings}
            for name in sorted(formula.names):
                yield formula.where, name, known, f"{output}, or what is set"
        for sensor in asked.sensors:
            where = f"{system.source}, [next.sensors.{sensor.name}] reading"
            yield where, sensor.reading, variables, output
    if rest := compared.rest:
        yield f"{system.source}, [diagnosis] rest output", rest.output, variables, output
    for name in compared.leading.together if compared.leading else ():
        yield f"{system.source}, [diagnosis] leads together", name, states, state
    measured = [output.name for output in system.outputs if output.name in states]
    for name in (name for exclusion in compared.exclusions for name in exclusion.restarted):
        where = f"{system.source}, [[diagnosis.excluded]] restarted"
        yield where, name, measured, "a measured output that is a continuous state of the model"


def _of_system(system: System) -> Iterator[_Reference]:
    """Conditions, quantities and outputs of the system itself."""
    conditions = [condition.name for condition in system.conditions]
    for quantity in system.estimated:
        for name in quantity.claimed:
            where = f"{system.source}, [estimated] {quantity.name} claimed"
            yield where, name, conditions, "a condition of this system"
    for parameter, level in system.comparison.levels.items():
        if level.by:
            where = f"{system.source}, [diagnosis] levels {parameter} by"
            yield where, level.by, conditions, "a condition of this system"
    if fading := system.fading:
        where = f"{system.source}, [feedback] fades signal"
        known = [
            *(output.name for output in system.outputs),
            *(signal.name for signal in system.derived),
        ]
        yield where, fading.signal, known, "a measured output, or a derived signal"
    if following := system.following:
        where = f"{system.source}, [tuning] follows quantity"
        known = [quantity.name for quantity in system.estimated]
        yield where, following.quantity, known, "an estimated quantity of this system"
    if leading := system.comparison.leading:
        where = f"{system.source}, [diagnosis] leads output"
        known = [output.name for output in system.outputs]
        yield where, leading.output, known, "a measured output of this system"
