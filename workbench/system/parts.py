"""What a system is made of: models, signals, quantities, and what counts."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from workbench.errors import InputError
from workbench.system.declaration import Either, Scope, Unit, declared, key, table_name
from workbench.system.expression import Expression
from workbench.system.tables import Table

# What names in a file refer to, as refusals say it; `check.known_names` tells which there are.
PARAMETER = "a parameter of the model"
STATE = "a continuous state of the model"
VARIABLE = "a variable of the model"
SIGNAL = "a signal of this system"
FORMULA = "a measured or derived signal, or a parameter of the model"
OUTPUT = "a measured output of this system"
OUTPUT_OR_DERIVED = "a measured output, or a derived signal"
OUTPUT_THAT_IS_A_STATE = "a measured output that is a continuous state of the model"
PARAMETER_OR_STATE = f"{PARAMETER}, or {STATE}"
SCORED = "a measured output, or a reference signal"
SHOWN = f"{STATE}, or a measured output"
CONDITION = "a condition of this system"
QUANTITY = "an estimated quantity of this system"

_VARIABLE = "name of the variable in the FMU, if different"

ENDLESS = float("inf")
_ALL = (-ENDLESS, ENDLESS)
_LIMITS = "the lower limit before the upper one"
_NOISY = "a standard deviation above 0; only inputs are exactly known"


def unit_above(scope: Scope, _: str) -> str:
    """The unit that this table says, or the next one that it is in."""
    while "unit" not in scope.own:
        assert scope.above is not None
        scope = scope.above
    return scope.own["unit"] or "1"


def columns_of(whole: Mapping[str, Any]) -> dict[str, str]:
    """Columns of an estimate, with units."""
    estimated = whole["estimated"]
    return {
        **{output.name: output.unit for output in whole["outputs"]},
        **{quantity.correction: quantity.unit for quantity in estimated},
        **{quantity.name: quantity.unit for quantity in estimated},
        **whole["reported"],
    }


def units_of(whole: Mapping[str, Any]) -> dict[str, str]:
    """SI units of all signals: derived ones, columns of estimates, measured ones."""
    measured = ("inputs", "outputs", "reference_signals", "intermittent")
    return {
        **{signal.name: signal.unit for signal in whole["derived"]},
        **columns_of(whole),
        **{signal.name: signal.unit for group in measured for signal in whole[group]},
    }


def unit_of_signal(scope: Scope, _: str) -> str | None:
    """The unit of the signal that the table names, None where there is no such signal."""
    return units_of(scope.whole).get(scope.own["signal"])


def _units(group: str) -> Any:
    def unit(scope: Scope, name: str) -> str | None:
        return {part.name: part.unit for part in scope.whole[group]}.get(name)

    return unit


def names_of(*groups: str) -> Any:
    """Names of parts of the system that were read so far."""

    def names(scope: Scope) -> Iterable[str]:
        return [part.name for group in groups for part in scope.whole[group]]

    return names


def _fmu(table: Table, name: str, scope: Scope) -> Path:
    return (scope.file.parent / table.take(name, str)).resolve()


@declared
class Model:
    """Model of a role."""

    SOME: ClassVar = ("class", "fmu")

    modelica: str = key(
        "Modelica class, without the library's name; diagnosis, exported observers, and a model "
        "without an FMU need it",
        name="class",
        absent="",
        otherwise="none",
    )
    path: Path | None = key(
        "file beside the system file, FMI 2.0 or 3.0",
        name="fmu",
        absent=None,
        otherwise="compiled from the library",
        read=_fmu,
        schema={"type": "string", "minLength": 1},
    )

    def check(self, table: Table, scope: Scope) -> None:
        """Refuse a model of nothing."""
        if not self.modelica and self.path is None:
            raise InputError(
                where=table.where,
                found="neither 'class' nor 'fmu'",
                expected="a Modelica class, the file of an FMU, or both",
                remedy="add class = NAME, or fmu = FILE",
            )

    @property
    def name(self) -> str:
        """Modelica class, without the library's name.

        Raises
        ------
        InputError
            If the system does not say it: what is asked for needs Modelica.
        """
        if not self.modelica:
            raise InputError(
                where="system file, [models]",
                found=f"the FMU {self.path.name if self.path else ''}, and no 'class'",
                expected="the Modelica class of this model, which is read for what you ask for",
                remedy='write class = "NAME", with the library package.mo beside the system file',
            )
        return self.modelica


@declared
class Mode:
    """A structure between a quantity and the sensor that reads it: one mode of vibration."""

    frequency: float = key("of the mode", "Hz")
    damping: float = key("ratio")
    late: float = key(
        "standard deviation of an additional delay, such as an amplifier's filter", "s"
    )


@declared
class RecordedAs:
    """What recorders have in the place of a signal."""

    formula: Expression = key("of the signal and of parameters", name="is", of=FORMULA)
    unit: Unit = key("of the formula")

    def check(self, table: Table, scope: Scope) -> None:
        """Refuse a formula of something else."""
        assert scope.above is not None
        name = scope.above.own["name"]
        if name not in self.formula.names:
            raise table.wrong("is", f"a formula of {name}")


@declared
class Signal:
    """A measured signal, and the model's variable of this name."""

    name: str = table_name()
    variable: str = key(_VARIABLE, absent="{name}")
    unit: Unit = key("of the model's variable")
    noise: float = key(
        "standard deviation of one sample; 0 for an exactly known input, such as a command",
        "{unit}",
        least=0.0,
        expected=_NOISY,
    )
    scale: float = key("typical size", "{unit}", above=0.0, expected="a size above 0")
    shown: Unit = key("unit in figures", absent="{unit}", like="unit")
    label: str = key("what it is, for people", absent="{name}")
    relative_noise: float = key("additional noise, as a fraction of the signal", absent=0.0)
    relative_error: float = key(
        "systematic error that filters allow for, as a fraction of the signal",
        absent="{relative_noise}",
    )
    scale_error: float = key("error of its scale that tuned gains must tolerate", absent=0.0)
    reading: str = key(
        "output of the model that simulates the sensor reading", absent="{name}", of=VARIABLE
    )
    mode: Mode | None = key("vibration mode between machine and sensor", absent=None)
    smoothed: tuple[float, float] | tuple[()] = key(
        '`["0.15 s", "2 s"]`: windows of a parabola and of a line that take the noise from an '
        "input where it allows that, before it drives a simulation",
        "s",
        (),
    )
    held: bool | str = key(
        "true: an input keeps the value of a sample until the next one. `before`: a sample is the "
        "mean since the sample before, as of cyclers and energy meters. `false`: it is "
        "interpolated linearly, which attenuates an oscillation of nine samples a period by 4 %",
        absent=False,
        choices=("before",),
    )
    resolution: float = key("quantisation step of the reading", "{unit}", 0.0, otherwise="unknown")
    limits: tuple[float, float] = key(
        '`["0 V", "10 V"]`: limits of the sensor; samples at them are excluded',
        "{unit}",
        name="saturates",
        otherwise="never",
        absent=_ALL,
        ordered=True,
        expected=_LIMITS,
    )
    plausible: tuple[float, float] = key(
        '`["-1 bar", "20 bar"]`: samples outside give a warning',
        "{unit}",
        otherwise="all",
        absent=_ALL,
        ordered=True,
        expected=_LIMITS,
    )
    possible: tuple[float, float] = key(
        "a recording with samples outside is refused",
        "{unit}",
        otherwise="all",
        absent=_ALL,
        ordered=True,
        expected=_LIMITS,
    )
    called: tuple[str, ...] = key(
        '`["Bremsdruck", "pC"]`: other names in log files; see [import](import.md)', absent=()
    )
    recorded_as: RecordedAs | None = key(
        "what log files hold instead: a formula of this signal and parameters", absent=None
    )

    def deviation(self, values: Any) -> Any:
        """Standard deviation of samples of these values [unit]."""
        return self.noise + self.relative_noise * np.abs(values)

    @property
    def hold(self) -> float:
        """When a sample of an input acts: 1: until the next one, -1: since the one before.

        0: on a straight line to the next one.
        """
        return -1.0 if self.held == "before" else float(self.held)

    @property
    def otherwise_held(self) -> dict[str, "Signal"]:
        """The same input, held in each other way, by how the system file says that."""
        ways: dict[str, bool | str] = {"true": True, "false": False, '"before"': "before"}
        return {key: replace(self, held=way) for key, way in ways.items() if way != self.held}

    @property
    def exact(self) -> bool:
        """Whether it is known without an error, as a command is."""
        return self.noise == 0.0 and self.relative_noise == 0.0 and self.resolution == 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """What people and recorders call it."""
        return self.name, self.label, *self.called

    @property
    def noise_at_scale(self) -> float:
        """Standard deviation of a sample of typical size [unit]."""
        return self.noise + self.relative_noise * self.scale


def refuse_no_sensor(signals: tuple[Signal, ...], table: Table, name: str, scope: Scope) -> None:
    """Refuse what corrects estimates, or scores them, and is exactly known, or a mean."""
    for signal in signals:
        own = table.table(name).table(signal.name)
        if signal.noise == 0.0:
            raise own.wrong("noise", _NOISY)
        if signal.held == "before":
            raise own.wrong(
                "held",
                "a value at the sample: only inputs may be means of the time before; a sensor's "
                "mean needs an output of the model that forms it",
            )


@declared
class DerivedSignal:
    """A signal made of measured ones and of parameters."""

    name: str = table_name()
    formula: Expression = key("formula, in SI units, of signals before it", name="is")
    unit: Unit = key("of the formula")
    label: str = key("what it is, for people", absent="{name}")


@declared
class FrictionPower:
    """A power of friction that wears something [W]."""

    name: str = table_name()
    formula: Expression = key(
        "formula of measured signals, parameters and estimated quantities [W]",
        name="is",
        of=FORMULA,
    )
    label: str = key("what it wears, for people", absent="{name}")


@declared
class Candidates:
    """What a diagnosis of an FMU without a library of effects considers; `*` is any letters."""

    only: tuple[str, ...] = key(
        'parameters of the FMU, `"motor.*"`, and errors of sensors, `"SensorGain[*]"`',
        absent=(),
        otherwise="all",
    )
    without: tuple[str, ...] = key("candidates to leave out", absent=())
    matters: float = key(
        "least change worth reporting: over a parameter's value, of a gain, over a signal's scale, "
        "or over 30 K of a temperature",
        absent=0.01,
    )


def _reach(scope: Scope) -> float:
    """Standard deviation of what is anywhere in the range."""
    low, high = scope.own["range"]
    return float((high - low) / np.sqrt(12.0))


class Ranged:
    """What has a range."""

    range: tuple[float, float]

    @property
    def low(self) -> float:
        """Least value [unit]."""
        return self.range[0]

    @property
    def high(self) -> float:
        """Largest value [unit]."""
        return self.range[1]


@declared
class EstimatedQuantity(Ranged):
    """A parameter of the model that observers estimate."""

    name: str = table_name()
    variable: str = key(_VARIABLE, absent="{name}")
    unit: Unit = key("of the parameter", absent="1")
    correction: str = key("input of the model that is added to the parameter")
    range: tuple[float, float] = key("limits of the estimate", "{unit}", ordered=True)
    walk: float = key("random walk, per square root of a second", "{unit}")
    label: str = key("what it is, for people", absent="{name}")
    prior: tuple[float, float] = key("uniform prior", "{unit}", "{range}")
    start: float = key("start value of filters", "{unit}", float("nan"), otherwise="nominal")
    spread: float = key(
        "standard deviation at the start", "{unit}", _reach, otherwise="that of the range, uniform"
    )
    relative_error: float = key(
        "systematic error of the estimate due to the model, as a fraction; part of its band",
        absent=0.0,
    )
    scatter: float = key(
        "recording-to-recording standard deviation of a healthy machine; see "
        "[monitoring](monitor.md)",
        "{unit}",
        0.0,
    )
    memory: float = key(
        "time in which a deviation is forgotten", "s", ENDLESS, otherwise="for ever"
    )
    useful: float = key(
        "largest standard deviation of a useful estimate; if `claimed` has a rule, it must be met "
        "for `(useful/walk)^2` seconds",
        "{unit}",
        lambda scope: 0.1 * _reach(scope),
        otherwise="a tenth of the range's spread",
    )
    acts_on: str = key(
        "state whose rate shows its effect, or output that shows it at once; a correction is in "
        "proportion to that",
        absent="",
        of=SHOWN,
    )
    claimed: Mapping[str, str] = key(
        'test conditions in which the estimate is valid, `{ phase = "charge" }`; elsewhere it '
        "absorbs errors of the model",
        absent={},
        otherwise="always",
        keys=CONDITION,
    )
    watched: bool = key(
        "false: [monitoring](monitor.md) leaves it out, since a recording shows it only together "
        "with its prior",
        absent=True,
    )


@declared
class StateNoise:
    """What is known of a state of the model, in its unit."""

    name: str = table_name()
    variable: str = key(_VARIABLE, absent="{name}")
    walk: float | None = key(
        "random walk beyond the model, per square root of a second",
        unit=lambda scope, _: unit_in_model(scope, scope.own["name"]),
        absent=None,
        otherwise="2e-4 of its nominal value",
    )
    spread: float | None = key(
        "standard deviation at the start, where no output shows it: in a library, none of its name",
        unit=lambda scope, _: unit_in_model(scope, scope.own["name"]),
        absent=None,
        otherwise="its nominal value, without one its start value, 1 at least; or that of any "
        "value from its `min` to its `max`, if less",
    )


def unit_in_model(scope: Scope, name: str) -> str:
    """Unit of a variable of the model; 1 where it has none, or does not say it."""
    return (scope.units or {}).get(name, "1")


def _unit_of_variable(scope: Scope, _: str) -> str | None:
    """Unit of the variable that the table names, None where there is no such variable."""
    return (scope.units or {}).get(scope.own["name"])


@declared
class FittedParameter:
    """A parameter of the model, or a state whose start is, that `workbench fit` fits."""

    name: str = table_name()
    range: tuple[float, float] = key(
        "bounds of the fit",
        unit=_unit_of_variable,
        absent=_ALL,
        otherwise="any value",
        ordered=True,
        expected=_LIMITS,
    )
    prior: tuple[float, float] | tuple[()] = key(
        '`["2 Ohm", "0.1 Ohm"]`: expected value and its standard deviation',
        unit=lambda scope, _: unit_in_model(scope, scope.own["name"]),
        absent=(),
        otherwise="nothing",
    )
    by_recording: bool | None = key(
        "true: each recording has a value of its own",
        absent=None,
        otherwise="a parameter is the same in all, the start of a state is not",
    )


@declared
class Threshold:
    """A signal, and the level above which something holds, in absolute value."""

    signal: str = key("measured or derived", of=SIGNAL)
    level: float = key("level of its size", name="above", unit=unit_of_signal)


@declared
class BelowThreshold(Threshold):
    """A signal, and the level below which something holds, in absolute value."""

    level: float = key("level of its size", name="below", unit=unit_of_signal)


@declared
class Tolerance:
    """By how much two values that tell the same may differ."""

    within: tuple[float, float] = key(
        "`[0.05, 0.3]`: largest likely and possible difference, as a fraction of the larger "
        "value, in the median of all samples; 2 is never refused",
        least=0.0,
        ordered=True,
        equal=True,
        expected="the largest likely share before the largest possible one",
    )
    slack: float = key(
        "difference that is ignored, and least size of both for a comparison", unit_above, 0.0
    )

    @property
    def likely(self) -> float:
        """Largest share that is likely [1]."""
        return self.within[0]

    @property
    def possible(self) -> float:
        """Largest share that is possible [1]."""
        return self.within[1]


@declared
class RecordingSplit:
    """Which parts of a long recording are recordings of their own."""

    begins: Threshold = key("a part begins where the size of a signal rises above a level")
    ends: BelowThreshold = key("and ends where that of another falls below one, which it was above")
    released: float = key(
        "longest time below the level within a part; a part with a longer one is left out", "s", 0.0
    )
    before: float = key("time that is kept before a part", "s", 0.0)
    after: float = key("time that is kept after a part", "s", 0.0)


@declared
class Store:
    """What a flow in and a flow out differ by is stored."""

    formula: Expression = key(
        'of a balance: the storage [`unit` times s], such as `"J*w"`', name="stores", of=FORMULA
    )
    over: float = key("of a balance: time over which both are averaged", "s", above=0.0)


@declared
class Redundancy:
    """Two formulas of measured signals that agree while a third signal is small, or is large."""

    reason: str = key("why they agree, for people")
    formula: Expression = key(
        'formula of measured signals, such as `"r1*w1"`', name="is", of=FORMULA
    )
    other: Expression = key('what it equals, such as `"r2*w2"`', name="equals", of=FORMULA)
    unit: Unit = key("of both")
    tolerance: Tolerance = key(inline=True)
    store: Store | None = key(inline=True, absent=None)
    only_while: BelowThreshold | Threshold | None = key(
        "they are compared", absent=None, otherwise="always"
    )

    @property
    def while_below(self) -> Threshold | None:
        """Signal that must be below a level, if one must be."""
        return self.only_while if isinstance(self.only_while, BelowThreshold) else None

    @property
    def while_above(self) -> Threshold | None:
        """Signal that must be above a level, if one must be."""
        return None if isinstance(self.only_while, BelowThreshold) else self.only_while


@declared
class Sampling:
    """Times between samples [s]."""

    slowest: float = key(
        "longest time between samples at which estimates stay valid; longer ones give a warning",
        "s",
        ENDLESS,
        otherwise="any",
    )
    gaps: tuple[float, float] = key(
        '`["0.1 s", "2 s"]`: longest likely and longest possible gap in a recording',
        "s",
        (ENDLESS, ENDLESS),
        otherwise="any",
        ordered=True,
        equal=True,
        expected="the longest likely time before the longest possible one",
    )

    @property
    def gap(self) -> float:
        """Longest time without a sample that is likely [s]."""
        return self.gaps[0]

    @property
    def largest_gap(self) -> float:
        """Longest time without a sample that is possible [s]."""
        return self.gaps[1]


@declared
class FeedbackFading:
    """Feedback fades out where a signal is small."""

    signal: str = key("a sum of outputs", of=OUTPUT_OR_DERIVED)
    half: float = key("its size at which half of the feedback is left", unit=unit_of_signal)


@declared
class RollingStates:
    """Two states in a fixed ratio while an output is zero, which saturates."""

    follower: str = key("state that follows the other", of=STATE)
    leader: str = key("state that it follows", of=STATE)
    zero: str = key("output of the model that is zero while the follower rolls along", of=VARIABLE)


@declared
class OperatingPoint:
    """Where a model is linearised: inputs given, some states held, all others at rest."""

    inputs: Mapping[str, float] = key(
        "of the model; others are as the model starts them",
        unit=_units("inputs"),
        keys=names_of("inputs"),
        absent={},
    )
    held: Mapping[str, Expression] = key(
        "formulas of states, in parameters of the model; all others are at rest",
        keys=STATE,
        of=PARAMETER,
        absent={},
    )
    quantities: Mapping[str, float] = key(
        "estimated ones that are not nominal",
        unit=_units("estimated"),
        keys=names_of("estimated"),
        absent={},
    )


AT_REST = OperatingPoint({}, {}, {})


@declared
class Objective:
    """By what estimators are scored and tuned."""

    signal: str = key(
        "signal whose error counts",
        name="judged",
        aliases=("signal",),
        of=SCORED,
        absent=lambda scope: (*scope.whole["reference_signals"], *scope.whole["outputs"])[0].name,
        otherwise="first reference signal, else the first output",
    )
    weights: Mapping[str, float] = key(
        "of mean absolute deviations, per unit",
        keys=names_of("outputs", "reference_signals"),
        absent=lambda scope: {
            signal.name: 1.0 / signal.scale
            for signal in (*scope.whole["outputs"], *scope.whole["reference_signals"])
        },
        otherwise="1 over `scale` of each",
    )
    bandwidth: float = key(
        "highest frequency of deviations that count", "Hz", ENDLESS, otherwise="all"
    )
    begins: Threshold | None = key(
        "start of the scored time: first sample above", absent=None, otherwise="at once"
    )
    ends: Threshold | None = key(
        "end of the scored time: last sample above", absent=None, otherwise="at the end"
    )
    when: str = key("name of the scored time, for people", absent="")


@declared
class StepTracking:
    """What tuned gains must do: find a step of a quantity within a time, but for a share."""

    quantity: str = key("that steps", of=QUANTITY)
    within: float = key("time in which the step must be found", "s")
    left: float = key("fraction of the step that may remain")


@declared
class View:
    """What one panel of a figure shows: measured or estimated signals on one axis."""

    title: str = key("before the unit")
    note: str = key("after the unit", absent="")
    signals: tuple[str, ...] = key("on one axis, measured or estimated", absent=(), of=SIGNAL)
    height: float = key("relative", absent=1.0)
    low: float | None = key(
        "of the axis, in the shown unit", absent=None, otherwise="what the signals need"
    )
    high: float | None = key(
        "of the axis, in the shown unit", absent=None, otherwise="what the signals need"
    )


@declared
class Export:
    """Estimators as FMUs that run without Python, and their package."""

    classes: Mapping[str, str] = key(
        "names of FMUs in the library, by estimator; the default is that of the Python class",
        absent={},
    )
    start: OperatingPoint = key(
        "point at which a package starts the reference model", absent=AT_REST, otherwise="at rest"
    )


FIRST, LARGEST = "first", "largest"  # of the values along a recording


@declared
class Agreement:
    """What a recording says of a condition."""

    formula: Expression = key(
        "of measured signals, in the unit of the condition", name="is", of=FORMULA
    )
    place: str = key(
        "which value along the recording is compared",
        name="at",
        choices=(FIRST, LARGEST),
        absent=FIRST,
    )
    tolerance: Tolerance = key(inline=True)


@declared
class Condition:
    """What was set before a recording, and what it means."""

    EITHER: ClassVar = Either(
        ("unit", "choices"),
        expected="either the unit of a quantity, or the choices",
        remedy='write unit = "m/s", or choices = ["new", "worn"]',
    )

    name: str = table_name()
    label: str = key("what it is, for people", absent="{name}")
    unit: Unit = key("of a quantity", absent="")
    smallest: float = key(
        "smallest quantity, in that unit", name="least", absent=-ENDLESS, otherwise="none"
    )
    above: float = key("what it must be above", absent=-ENDLESS, otherwise="none")
    choices: tuple[str | int, ...] = key("words or whole numbers", absent=())
    count: int = key("number of entries, where it is a list", absent=0, otherwise="not a list")
    sets: str = key(
        "parameter of the model that a quantity is, such as a load; nobody needs to say it: it is "
        "then as in the model",
        aliases=("variable",),
        absent="",
        of=PARAMETER,
    )
    parameters: Mapping[str, Mapping[str, float]] = key(
        "parameters of the model for each choice, SI: `hot = { k = 0.28 }`; `imm` runs a filter "
        "for each",
        absent={},
        keys=PARAMETER,
    )
    told: bool = key(
        "true: estimators use the stated choice, except `imm`, which finds it itself; estimated "
        "quantities start there",
        absent=False,
    )
    lasts: float = key(
        "mean time until the choice changes during a recording",
        "s",
        ENDLESS,
        otherwise="for ever",
        above=0.0,
    )
    sign: bool = key("whether it is the sign of the recording's signals", absent=False)
    agrees: Agreement | None = key(
        "formula that checks the condition against the recording", absent=None
    )

    def check(self, table: Table, scope: Scope) -> None:
        """Refuse what does not go together."""
        if not self.unit and not self.choices:
            raise table.wrong("choices", "one choice or more")
        if self.choices and "sets" in table:
            raise table.wrong("sets", "[conditions.NAME.parameters], where there are choices")
        for choice in self.parameters:
            if choice not in map(str, self.choices):
                expected = f"one of {', '.join(map(str, self.choices))}"
                raise table.table("parameters").wrong(choice, expected)
        if self.agrees and (self.count or any(isinstance(c, str) for c in self.choices)):
            raise InputError(
                where=table.where,
                found="'agrees' of words, or of a list",
                expected="a quantity, or choices that are whole numbers",
                remedy="remove 'agrees'",
            )

    @property
    def exclusive(self) -> bool:
        """Whether it must be above its least."""
        return self.above > -ENDLESS

    @property
    def least(self) -> float:
        """Smallest quantity, or what it must be above [unit]."""
        return self.above if self.exclusive else self.smallest

    def means(self, value: object) -> Mapping[str, float]:
        """Parameters of the model that it sets where it is this, SI; none where nobody knows."""
        if self.sets and isinstance(value, float):
            return {self.sets: value}
        return self.parameters.get(str(value), {})
