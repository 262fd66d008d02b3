"""A system against its model: whatever its file names is there, and in the same unit."""

from collections.abc import Collection, Iterable, Iterator

from workbench.errors import InputError, closest, unknown_name
from workbench.models.description import Description
from workbench.system.experiments import SET_OR_DURATION, SET_OR_PARAMETER, SET_OR_VARIABLE
from workbench.system.parts import (
    CONDITION,
    FORMULA,
    OUTPUT,
    OUTPUT_OR_DERIVED,
    OUTPUT_THAT_IS_A_STATE,
    PARAMETER,
    PARAMETER_OR_STATE,
    QUANTITY,
    SCORED,
    SHOWN,
    SIGNAL,
    STATE,
    VARIABLE,
    DerivedSignal,
)
from workbench.system.stopping import ASKED, MOVED, OUTSIDE, RISING
from workbench.system.system import System
from workbench.system.units import is_known_unit, si_factor

_ROUNDED = 1e-3  # share by which a unit may be defined otherwise, as calories are

# What to do about a name in [parameters] that is no parameter, by its causality.
_REMEDIES = {
    "calculatedParameter": "set the parameters that it follows from",
    "structuralParameter": "export the model with the size that it is to have: sizes stay as they "
    "are here",
    "input": "record it, or give it a value in the model",
}
_NAME_IT = (
    "if the FMU names it otherwise, write variable = 'NAME' in the table of '{0}', or {0} = 'NAME' "
    "in [variables], or --map {0}=NAME"
)

_AS_THEY_ARE = "or write unit = '1' in its table, which takes values as they are"


def check_model(system: System, model: Description) -> None:
    """Refuse a model that estimators cannot work on; a variable without a unit is taken as SI.

    Raises
    ------
    InputError
        If it lacks a variable of the system, has a parameter without a value, or another unit.
    """
    variables = model.by_name
    for ours, unit in system.variables.items():
        theirs = system.names.get(ours, ours)
        where = f"{model.path}, variable '{theirs}'"
        if ours not in variables:
            if other := next((n for n, own in system.names.items() if own == theirs), ""):
                raise InputError(
                    where=str(system.source),
                    found=f"'{ours}', a variable of the FMU that is called '{other}' there as well",
                    expected="one name of yours for one variable of the FMU",
                    remedy=f"write '{other}' in its place, or remove one of the two",
                )
            raise unknown_name(
                ours,
                variables,
                where=str(model.path),
                found=f"no variable '{ours}'",
                expected=f"one for '{ours}' of {system.source}",
                remedy=_NAME_IT.format(ours),
            )
        needs_value = ours in system.constants or any(q.name == ours for q in system.estimated)
        if needs_value and variables[ours].start is None:
            raise InputError(
                where=where,
                found="no start value",
                expected=f"a parameter with a value for {ours}",
                remedy="make it a parameter of the model, or name another; "
                + _NAME_IT.format(ours),
            )
        declared = variables[ours].unit
        if declared and unit and not _is_same(declared, unit, where):
            taken = declared if is_known_unit(declared) else "1"
            raise InputError(
                where=where,
                found=f"unit [{declared}]",
                expected=f"[{unit}] for {ours}; nothing is converted silently",
                remedy=f"write unit = '{taken}' for it in {system.source.name}, and record it in "
                f"[{declared}], or export the model with this variable in {unit}",
            )
        if unit != "1":  # which takes values as they are
            _check_unit(declared or "1", model, where)
    _check_aliases(system, model)
    _check_ranges(system, model)
    _check_corrections(system, model)
    for name in system.given:
        if name not in model.names("parameter"):
            raise InputError(
                where=f"{system.source}, [parameters] {name}",
                found=f"a variable of causality {variables[name].causality}"
                if name in variables
                else "no such parameter of the model",
                expected=f"a parameter of {model.name}{closest(name, model.names('parameter'))}",
                remedy=_REMEDIES.get(variables[name].causality, "leave it out")
                if name in variables
                else "correct the name",
            )


def _is_same(declared: str, unit: str, where: str) -> bool:
    """Whether a unit of a model is one of a system; 1 is also that of values as they are.

    Raises
    ------
    InputError
        If it is of another dimension.
    """
    try:
        return si_factor(declared, unit, where) == 1.0
    except InputError:
        if unit != "1" and is_known_unit(declared):
            raise
        return unit == "1"


def _check_unit(name: str, model: Description, where: str) -> None:
    """Refuse a unit that the model defines as many times what its name says, or with a zero."""
    base, size, zero = model.units.get(name, ("", 1.0, 0.0))
    try:
        factor = si_factor(name, base, where) if base else size
    except InputError:  # of an unknown unit, or one that counts radians otherwise
        return
    if zero:
        raise InputError(
            where=where,
            found=f"unit [{name}], whose zero the model defines at {zero:g} {base}",
            expected=f"0 {base}, as its name says",
            remedy="correct the unit in the model, such as degC for K, and export it again; "
            f"{_AS_THEY_ARE}",
        )
    if abs(factor / size - 1.0) > _ROUNDED:
        raise InputError(
            where=where,
            found=f"unit [{name}], which the model defines as {size:g} {base}",
            expected=f"{factor:g} {base}, as its name says",
            remedy=f"correct the unit in the model, and export it again; {_AS_THEY_ARE}",
        )


def _check_aliases(system: System, model: Description) -> None:
    """Refuse what estimators set under one name and the model has under another, too.

    One of the two would overwrite the other. Of aliases, FMI lets one be set at most.
    """
    settable = [v for v in model.variables if v.causality in ("input", "parameter") and not v.array]
    known = {(v.type, v.reference, v.element): v.name for v in reversed(settable)}
    names = {*(signal.name for signal in system.inputs), *system.corrections}
    for variable in settable:
        other = known[variable.type, variable.reference, variable.element]
        if other != variable.name and names & {other, variable.name}:
            raise InputError(
                where=f"{model.path}, variable '{variable.name}'",
                found=f"another name of '{other}': both have the value reference "
                f"{variable.reference}",
                expected="values of their own, since both can be set",
                remedy="export the model again, with a value reference for each",
            )


def _check_ranges(system: System, model: Description) -> None:
    """Refuse values that the model does not allow, of [parameters] and of conditions."""
    given = [(f"[parameters] {name}", name, value) for name, value in system.given.items()]
    for condition in system.conditions:
        for parameters in condition.parameters.values():
            given += [(f"[conditions.{condition.name}]", *item) for item in parameters.items()]
    variables = model.by_name
    for where, name, value in given:
        variable = variables.get(name)
        if variable is None:
            continue
        low, high = variable.limits
        if not low <= value <= high:
            raise InputError(
                where=f"{system.source}, {where}",
                found=f"{name} = {value:g} {variable.unit or ''}".rstrip(),
                expected=f"{low:g} to {high:g}, the range of {model.name}",
                remedy="correct the value, or the range in the model",
            )


def _check_corrections(system: System, model: Description) -> None:
    """Refuse corrections that estimators cannot set, or that are something else as well."""
    variables = model.by_name
    taken = {signal.name: "a measured input" for signal in system.inputs}
    taken |= {
        signal.name: "a measured output" for signal in (*system.outputs, *system.intermittent)
    }
    taken |= {quantity.name: "an estimated quantity" for quantity in system.estimated}
    for quantity in system.estimated:
        name = quantity.correction
        variable = variables[name]
        settable = variable.causality == "input" or (
            variable.causality == "parameter" and variable.variability == "tunable"
        )
        if name in taken or not settable:
            own = f"a {variable.variability} variable of causality {variable.causality}"
            raise InputError(
                where=f"{system.source}, [estimated.{quantity.name}] correction",
                found=f"'{name}', which is {taken.get(name, own)}",
                expected="an input or tunable parameter of the model, 0 by default, that only this "
                f"correction sets and that is added to {quantity.name}",
                remedy=f"give the model such an input, say 'd{quantity.name}', and name it",
            )
        taken[name] = "the correction of another quantity"
    columns = {*(output.name for output in system.outputs), *system.corrections}
    columns |= {quantity.name for quantity in system.estimated}
    for name in system.reported:
        if name in columns:
            raise InputError(
                where=f"{system.source}, reported",
                found=f"'{name}', which is {taken[name]} as well",
                expected="outputs of the model that estimates do not have without it",
                remedy="leave it out of 'reported'",
            )


def check_references(
    system: System, model: Description | None, references: Iterable[tuple[str, str, str]]
) -> None:
    """Refuse names in the system's file that neither model nor recordings have.

    Parameters
    ----------
    model : of the observer, None before there is one: what refers to it is not looked up.
    references : place, name, and what it refers to.

    Raises
    ------
    InputError
        At the first: where it stands, and what is like it. Also if feedback fades with a signal
        that is no sum of outputs.
    """
    known = known_names(system, model)
    for signal, earlier in _derived_signals(system) if model else ():
        for name in sorted(signal.formula.names):
            _refuse_unknown(name, earlier, signal.formula.where, FORMULA)
    for where, name, of in references:
        if of in known:
            listed = f": {', '.join(known[of])}" if of in (SIGNAL, SCORED) else ""
            _refuse_unknown(name, known[of], where, of + listed)
    if system.fading and model:
        system.slopes(system.fading.signal)  # a sum of outputs, or refused


def _refuse_unknown(name: str, known: Collection[str], where: str, expected: str) -> None:
    if name not in known:
        raise unknown_name(name, known, where=where, expected=expected)


def _derived_signals(system: System) -> Iterator[tuple[DerivedSignal, Collection[str]]]:
    """Derived signals, and what each may be made of: also those before it."""
    measured = {*system.signals, *system.values}
    for signal in system.derived:
        yield signal, measured
        measured = {*measured, signal.name}


def known_names(system: System, model: Description | None) -> dict[str, Collection[str]]:
    """Names that there are, by what they refer to; without a model, those of the system alone."""
    inputs = [signal.name for signal in system.inputs]
    outputs = [signal.name for signal in system.outputs]
    derived = [signal.name for signal in system.derived]
    known: dict[str, Collection[str]] = {
        SIGNAL: list(dict.fromkeys([*system.signals, *derived, *system.columns])),
        SCORED: [*outputs, *(signal.name for signal in system.reference_signals)],
        OUTPUT: outputs,
        OUTPUT_OR_DERIVED: [*outputs, *derived],
        CONDITION: [condition.name for condition in system.conditions],
        QUANTITY: [quantity.name for quantity in system.estimated],
    }
    if asked := system.experiments:
        known[SET_OR_DURATION] = ["duration", *asked.settings]
    if stopping := system.stopping:
        known[ASKED] = [quantity.name for quantity in stopping.asked]
        known[RISING] = [driven.name for driven in stopping.driven if driven.rises]
    if model is None:
        return known
    states, variables = model.states, [variable.name for variable in model.variables]
    settings = asked.settings if asked else {}
    return known | {
        PARAMETER: system.values,
        PARAMETER_OR_STATE: {*system.values, *states},
        STATE: states,
        VARIABLE: variables,
        FORMULA: {*system.signals, *derived, *system.values},
        SHOWN: [*states, *outputs],
        OUTPUT_THAT_IS_A_STATE: [name for name in outputs if name in states],
        SET_OR_PARAMETER: {*system.values, *settings},
        SET_OR_VARIABLE: {*variables, *system.values, *settings},
        MOVED: {*inputs, *states},
        OUTSIDE: {*outputs, *system.values},
    }
