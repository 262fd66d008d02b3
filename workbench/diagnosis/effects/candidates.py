"""What a diagnosis may find without a library of effects: in an FMU and its sensors alone.

Each parameter of the FMU may have another value, each state another start, each rate may lack a
term, and each sensor may read wrong: by its gain or zero, late, behind, or bent. No source is
needed: a parameter or a start is set, a reading is calculated beside the FMU, and a term is added
to the rates around it.
"""

import re
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.effects.catalogue import Effect
from workbench.errors import FMUError, unknown_name
from workbench.models.added import (
    CONSTANT,
    COULOMB,
    QUADRATIC,
    SPEED,
    STRIBECK,
    TERM,
    VISCOUS,
    RateTerm,
)
from workbench.models.description import Variable
from workbench.models.fmu import FMU, CoSimulation
from workbench.observers.operating import start_spreads
from workbench.recordings.channels.matching import COLD, ZERO_CELSIUS
from workbench.system.parts import StateNoise
from workbench.system.system import System
from workbench.system.units import three_digits, with_unit

CHANGE, COEFFICIENT = "change", "coefficient"
# Parameters of wrong sensors, see `SensorReading`.
GAIN, OFFSET, LAG, LOSS, LIMIT = "gain", "offset", "lag", "loss", "limit"
INPUT_LAG = "InputLag"
WIDTH, RECTIFIED, STEP = "width", "rectified", "step"
SHARES = (GAIN, LOSS, RECTIFIED)  # of a signal


class _SensorForm(NamedTuple):
    """How a sensor of `{label}` may be wrong: class, size, and what it is, for people."""

    model: str
    size: str
    text: str
    shape: str = ""


_ZERO = (
    _SensorForm("SensorGain", GAIN, "a sensor of {label} with another gain"),
    _SensorForm("SensorOffset", OFFSET, "a sensor of {label} with another zero"),
)
_INPUT = (_SensorForm(INPUT_LAG, LAG, "{label} that acts behind a lag of first order"),)
_OUTPUT = (
    _SensorForm("SensorLag", LAG, "a sensor of {label} behind a lag of first order"),
    _SensorForm(
        "SensorSaturation",
        LOSS,
        "a sensor of {label} that saturates: it loses so much of what is beyond a limit",
        LIMIT,
    ),
    _SensorForm(
        "SensorRectification",
        RECTIFIED,
        "a sensor of {label} that rectifies: 100% reads zero below zero, 200% the magnitude",
    ),
    _SensorForm(
        "SensorDeadZone", WIDTH, "a sensor of {label} that reads zero within a dead zone of zero"
    ),
    _SensorForm("SensorQuantisation", STEP, "a sensor of {label} that reads in steps"),
)
_FORMS = {
    COULOMB: "a term of constant size against {state} in its rate, as of Coulomb friction",
    STRIBECK: "a term against {state} in its rate that fades with speed, as of Stribeck friction",
    VISCOUS: "a term in proportion to {state} in its rate, as of viscous friction or a leak",
    QUADRATIC: "a quadratic term, as of drag, in the rate of {state}",
    CONSTANT: "a constant term in the rate of {state}",
}
_POWERS = {VISCOUS: 1, QUADRATIC: 2}
# Of the speed of a Stribeck term, over the state's size: what is fitted goes by shares from these.
_SPEEDS = (0.05, 0.2, 1.0)
_CHANGEABLE = ("fixed", "tunable")
# K: a hundredth is what a resistance thermometer of class B may be off at 0 degC (IEC 60751).
_TEMPERATURE = 30.0
# Of the least time that matters: a logger that scans five channels has neighbours as far apart.
LEAST_SKEWS = 2.0
_FACTOR = 10.0  # by which a parameter is larger or smaller at most, if the FMU has no bounds


def candidates(model: FMU, system: System) -> tuple[Effect, ...]:
    """List what may be wrong in an FMU and in the sensors of its signals.

    Parameters that the system fits in any case (levels, tolerances), or that only correct
    estimates, are none. A parameter that is zero needs a nominal value or bounds in the FMU: else
    nobody knows which change is small.

    Returns
    -------
    effects : parameters in the order of the FMU, gain and offset of each input and output, terms
        beside the rates, by state, starts of states, then other errors of sensors.
    """
    # An input that takes whole numbers alone cannot read a little more.
    whole = {v.name for v in model.description.variables if v.causality == "input" and not v.floats}
    sensors = [effect for effect in wrong_sensors(system) if effect.sensor not in whole]
    zeros = [effect for effect in sensors if effect.size in (GAIN, OFFSET)]
    others = [effect for effect in sensors if effect.size not in (GAIN, OFFSET)]
    own, terms = parameters(model, system), _terms(model, system)
    return (*own, *zeros, *terms, *_starts(model, system), *others)


def considered(system: System, candidates: Iterable[Effect]) -> tuple[Effect, ...]:
    """Those candidates that `[candidates]` of the system file does not exclude."""
    chosen, effects = system.candidates, {effect.name: effect for effect in candidates}
    names = _matching(chosen.only, effects, system) if chosen.only else set(effects)
    names -= _matching(chosen.without, effects, system)
    return tuple(effect for name, effect in effects.items() if name in names)


def _matching(patterns: Iterable[str], names: Collection[str], system: System) -> set[str]:
    """Names that patterns stand for; each must stand for one at least."""
    matching: set[str] = set()
    for pattern in patterns:
        # Names have brackets, as `tank[1].level`: only * is special.
        expression = re.compile(".*".join(map(re.escape, pattern.split("*"))))
        fitting = {name for name in names if expression.fullmatch(name)}
        if not fitting:
            raise unknown_name(
                pattern,
                names,
                where=f"{system.source}, [candidates]",
                expected="a parameter of the FMU that may differ, or an error of a sensor",
                remedy="correct the name; 'workbench diagnose --list' lists all",
            )
        matching |= fitting
    return matching


def own_bounds(nominal: float, declared: tuple[float, float]) -> tuple[float, float]:
    """Least and greatest change of a parameter of the model.

    Parameters
    ----------
    declared : least and greatest value by the FMU, infinite for none. Without them a parameter
        keeps its sign, and is at most ten times as large or as small.
    """
    low, high = declared
    if nominal:
        ends = sorted((nominal / _FACTOR, nominal * _FACTOR))
        low, high = (end if np.isinf(d) else d for end, d in zip(ends, (low, high), strict=True))
    return low - nominal, high - nominal


def rate_terms(model: FMU, system: System) -> tuple[RateTerm, ...]:
    """Terms that may be missing beside the rates of an FMU's states.

    A state that another state is the rate of, as a position is of a speed, has none: what moves it
    acts on the speed. None for an FMU around which no other can be built.
    """
    if model.version != "2.0" or sys.platform == "win32" or isinstance(model, CoSimulation):
        return ()
    model.start({})
    x, scale = model.get_states(), _scales(model, system)
    # The start, and each state moved by its scale to either side, (2s + 1, s); rates there.
    points = np.vstack([x, x + np.diag(scale), x - np.diag(scale)])
    rates = np.array([_rates(model, point) for point in points])
    works = np.isfinite(rates).all(axis=1)
    points, rates = points[works], rates[works]
    terms = []
    for i, state in enumerate(model.states):
        if any(np.array_equal(rates[:, i], other) for other in points.T):
            continue
        typical = float(np.abs(rates[:, i]).max(initial=0.0)) or float(scale[i])
        own = model.units.get(state, "")
        rate = model.units.get(model.description.rates[i]) or (f"{own}/s" if own else "")
        for form, text in _FORMS.items():
            power = _POWERS.get(form, 0)
            terms.append(
                RateTerm(
                    name=f"{TERM}{form}.{state}",
                    state=i,
                    form=form,
                    typical=typical / float(scale[i]) ** power,
                    unit=("1/s" if power == 1 else f"({rate})/({own})2" if power else rate)
                    if own
                    else "",
                    scale=float(scale[i]),
                    state_unit=own,
                    text=text.format(state=state),
                )
            )
    return tuple(terms)


def of_moving_states(
    effects: Sequence[Effect], runs: Mapping[str, Sequence[tuple[Vector, Vector]]], matters: float
) -> Iterator[Effect]:
    """Effects, of which terms beside the rates of some states matter by how these states move.

    Parameters
    ----------
    runs : time [s] and values of a state in each recording, by its name.
    matters : least change worth reporting, over what is typical.
    """
    for effect in effects:
        form, _, state = effect.parameter.removeprefix(TERM).partition(".")
        own = runs.get(state, ()) if effect.size == COEFFICIENT else ()
        if way := float(sum(np.abs(np.diff(values)).sum() for _, values in own)):
            rate = way / sum(float(np.ptp(time)) for time, _ in own)
            size = max(float(np.abs(values).max()) for _, values in own)
            effect = replace(effect, matters=matters * rate / size ** _POWERS.get(form, 0))
        yield effect


def zero(unit: str, size: float) -> float:
    """Zero of a sensor: of temperatures that of Celsius, by which thermometers are calibrated."""
    return ZERO_CELSIUS if unit == "K" and size >= COLD else 0.0


def _moves(unit: str, size: float) -> float:
    """By how much a quantity of a typical size differs from itself: no temperature by its own."""
    return _TEMPERATURE if zero(unit, size) else size


def _scales(model: FMU, system: System) -> Vector:
    """Typical size of each state, (s,): of its signal, its nominal value, its start, or 1."""
    nominal = {v.name: v.nominal for v in model.description.variables}
    nominal |= {name: signal.scale for name, signal in system.signals.items()}
    starts = zip(model.states, np.abs(model.get_states()), strict=True)
    return np.array([nominal.get(name) or start or 1.0 for name, start in starts])


def _rates(model: FMU, states: Vector) -> Vector:
    """Rates at states, NaN where the model does not work."""
    try:
        model.set_states(states)
        return model.derivatives()
    except FMUError:
        return np.full(states.size, np.nan)


def with_starts(system: System, model: FMU) -> System:
    """The system with an uncertain start of each state that no output shows and that may be set."""
    known = {state.name: state for state in system.state_noise}
    spreads = dict(zip(model.states, start_spreads(model, system), strict=True))
    if isinstance(model, CoSimulation):  # which sets nothing that it calculates
        able = _settable(model)
        spreads = {name: spread for name, spread in spreads.items() if name in able}
    for name, spread in spreads.items():
        state = known.get(name, StateNoise(name, name, None, None))
        if name not in system.signals and state.spread is None:
            known[name] = replace(state, spread=float(spread))
    return replace(system, state_noise=tuple(known.values()))


def without_guesses(system: System, model: FMU) -> System:
    """The system with those deviations of starts alone that `with_starts` did not guess."""
    names = {state.name: state for state in system.state_noise}
    guesses = start_spreads(model, replace(system, state_noise=()))
    for name, guess in zip(model.states, guesses, strict=True):
        if name in names and names[name].spread == guess:
            names[name] = replace(names[name], spread=None)
    return replace(system, state_noise=tuple(names.values()))


def parameters(model: FMU, system: System) -> Iterator[Effect]:
    """Parameters that may have another value; none that the system fits in any case."""
    compare = system.comparison
    fitted = {*compare.levels, *compare.tolerances, *system.corrections}
    for variable in model.description.variables:
        if (
            variable.causality != "parameter"
            or variable.variability not in _CHANGEABLE
            or variable.initial == "calculated"
            or variable.name in fitted
            or variable.name not in model.defaults
        ):
            continue
        value = model.defaults[variable.name]
        size = _size(variable, value)
        if size == 0.0:
            continue
        about = f" ({variable.text})" if variable.text else ""
        nominal = with_unit(value, variable.unit) if variable.unit else three_digits(value)
        yield Effect(
            name=variable.name,
            model=variable.name,
            slots=(),
            size=CHANGE,
            matters=system.candidates.matters * size,
            text=f"another value of {variable.name}{about} than {nominal}",
            separation=f"a measurement of {variable.name} by itself",
            parameter=variable.name,
        )


def _terms(model: FMU, system: System) -> Iterator[Effect]:
    for term in rate_terms(model, system):
        state = model.states[term.state]
        yield Effect(
            name=f"{term.form.capitalize()}Term[{state}]",
            model=term.name,
            slots=(),
            size=COEFFICIENT,
            matters=system.candidates.matters * term.typical,
            text=term.text,
            separation=f"recordings in which {state} moves otherwise",
            shapes=((SPEED, tuple(term.scale * share for share in _SPEEDS)),)
            if term.form == STRIBECK
            else (),
            parameter=term.name,
        )


def _size(variable: Variable, value: float) -> float:
    """What a change of a parameter is compared with; 0 if nothing says it."""
    if value:
        return abs(value)
    if variable.minimum is not None and variable.maximum is not None:
        return variable.maximum - variable.minimum
    return abs(variable.nominal or 0.0)


def _starts(model: FMU, system: System) -> Iterator[Effect]:
    """Starts of states that no output is; they must differ from the FMU's in all recordings."""
    for name, spread in zip(model.states, start_spreads(model, system), strict=True):
        if name in system.signals or name not in model.defaults or not spread:
            continue  # a start that is exact has no error
        if isinstance(model, CoSimulation) and name not in _settable(model):
            continue
        unit = model.units.get(name, "")
        value = model.defaults[name]
        nominal = with_unit(value, unit) if unit else three_digits(value)
        yield Effect(
            name=f"Start[{name}]",
            model=name,
            slots=(),
            size=CHANGE,
            matters=system.candidates.matters * float(spread),
            text=f"another start of {name} in all recordings than {nominal}",
            separation=f"a measurement of {name} where a recording begins",
            parameter=name,
        )


def _settable(model: FMU) -> set[str]:
    """Variables of a Co-Simulation FMU whose starts may be set."""
    return {v.name for v in model.description.variables if v.initial in ("exact", "approx")}


def wrong_sensors(system: System) -> Iterator[Effect]:
    """Errors of the sensors of all signals, inputs first."""
    inputs, compare = {signal.name for signal in system.inputs}, system.comparison
    for signal in system.signals.values():
        for form in (*_ZERO, *(_INPUT if signal.name in inputs else _OUTPUT)):
            moves = _moves(signal.unit, signal.scale)
            least = system.candidates.matters * (1.0 if form.size in SHARES else moves)
            yield Effect(
                name=f"{form.model}[{signal.name}]",
                model=form.model,
                slots=(),
                size=form.size,
                matters=LEAST_SKEWS * compare.least_skew if form.size == LAG else least,
                text=form.text.format(label=signal.label),
                separation=f"a second sensor of {signal.label}",
                shapes=((form.shape, (signal.scale,)),) if form.shape else (),
                sensor=signal.name,
            )
