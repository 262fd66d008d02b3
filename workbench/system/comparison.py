"""How recordings of a system are compared with its model: what a diagnosis rests on."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from workbench.system.declaration import Either, Scope, Unit, declared, key, table_name
from workbench.system.expression import Expression
from workbench.system.parts import (
    CONDITION,
    ENDLESS,
    FORMULA,
    OUTPUT,
    OUTPUT_THAT_IS_A_STATE,
    PARAMETER,
    SIGNAL,
    STATE,
    VARIABLE,
    Signal,
    Threshold,
    unit_of_signal,
)

RATE = 0.002
"""Sets of a healthy machine that may be called something else, unless its system says otherwise: a
tenth of the 2 % that power allows, since noise of real sensors has heavier tails, and tests on one
set are several."""

WAYS = ("value", "size", "rate", "integral", "turn")


def _label(scope: Scope) -> str:
    """That of the measured signal of this name, else the name."""
    name: str = scope.own["name"]
    return next((signal.label for signal in _compared(scope) if signal.name == name), name)


def _compared(scope: Scope) -> list[Signal]:
    """What is measured of the model, aids last."""
    groups = ("outputs", "reference_signals", "intermittent")
    return [signal for group in groups for signal in scope.whole[group]]


@declared
class Channel:
    """What the diagnosis compares: a sum of readings, each times a constant."""

    name: str = table_name()
    unit: Unit = key("of the formula")
    label: str = key("what it is, for people", absent=_label, otherwise="the signal's, or the name")
    shown: Unit = key("unit in figures of its errors", absent="{unit}", like="unit")
    formula: Expression = key("of measured signals and parameters", name="is", of=FORMULA)


def _measured(scope: Scope) -> tuple[Channel, ...]:
    """What is measured, one by one."""
    return tuple(
        Channel(
            signal.name,
            signal.unit,
            signal.label,
            signal.shown,
            Expression.of(signal.name, str(scope.file)),
        )
        for signal in _compared(scope)
    )


@declared
class LeadingOutput:
    """A slow motion that integrates the noise of inputs: a measured output leads it."""

    output: str = key("the measured one", of=OUTPUT)
    together: tuple[str, ...] = key(
        "states that its correction scales alike",
        of=STATE,
        absent=lambda scope: (scope.own["output"],),
        otherwise="`output`",
    )
    ripple: float = key(
        "standard deviation of the disturbance, over that of the noise of the inputs", absent=1.0
    )


@declared
class Rest:
    """An input that is measured while it is steady, against what the model says.

    At rest, before it is applied, or held, some time after.
    """

    signal: str = key("the input", of=SIGNAL)
    output: str = key("of the model: its reading then", of=VARIABLE)
    zero: float = key("standard deviation of the mean of a good sensor", unit=unit_of_signal)
    held_from: float = key(
        "time after it is applied from which it is held until it falls; then the mean is taken",
        "s",
        0.0,
        otherwise="it is at rest, before it is applied",
    )
    by: str = key(
        "condition that the reading depends on: without it, a recording is excluded here",
        of=CONDITION,
        absent="",
    )


@declared
class Level:
    """A parameter that differs by nature from recording to recording, and needs no cause."""

    by: str = key(
        "test condition; each of its choices has a nuisance parameter", of=CONDITION, absent=""
    )
    spread: float = key(
        "relative standard deviation of the common value", absent=ENDLESS, otherwise="any"
    )
    deviation: float = key(
        "standard deviation of the common value in the parameter's SI unit, instead of `spread` if "
        "the data sheet's value is zero",
        absent=ENDLESS,
        otherwise="any",
    )

    @property
    def free(self) -> bool:
        """Whether nothing is expected of it."""
        return bool(np.isinf(self.spread) and np.isinf(self.deviation))


@declared
class Wander:
    """What a parameter differs by along one recording, for each channel by itself."""

    share: float = key("relative standard deviation")
    over: float = key("correlation time", "s")


@declared
class Exclusion:
    """When samples do not count."""

    EITHER: ClassVar = Either(
        ("above", "below"),
        expected="one of the two",
        remedy="say from which value on samples are excluded",
    )

    reason: str = key("why, for people")
    formula: Expression = key("of measured signals and parameters", name="is", of=FORMULA)
    above: float = key(
        "absolute value, SI, above which samples are excluded",
        absent=ENDLESS,
        otherwise="`below` instead",
    )
    below: float = key(
        "absolute value, SI, below which samples are excluded",
        absent=-ENDLESS,
        otherwise="`above` instead",
    )
    from_rest: bool = key("it counts from its median before the input is applied", absent=False)
    smoothed: float = key("over which it is averaged", "s", 0.0)
    within: float = key("time around such samples that is excluded too", "s", 0.0)
    only_while: Threshold | None = key("it counts", absent=None, otherwise="always")
    to_the_end: bool = key("everything after it is excluded", absent=False)
    restarted: tuple[str, ...] = key(
        "measured outputs that are states: each block begins with their measured values, and the "
        "samples count, unless systematic errors remain there with every model",
        absent=(),
        of=OUTPUT_THAT_IS_A_STATE,
    )
    uncertain: Mapping[str, float] = key(
        "relative standard deviation of parameters of the law that is simplified there, such as "
        "`{ mu = 0.04 }`",
        absent={},
        keys=PARAMETER,
    )


@declared
class Influence:
    """What errors may go with."""

    name: str = table_name()
    formula: Expression = key("of measured signals and parameters", name="is", of=FORMULA)
    unit: Unit = key("of the formula")
    way: str = key(
        "what of the formula; an angle with a phase of its own in each recording is a `turn`",
        choices=WAYS,
        absent="value",
    )


_BLOCK, _LASTING = 5, 20  # samples of a block, and blocks of a lasting error, unless said otherwise
_LEAST_SKEW = 0.1  # of a sample time
_LEFT = 0.03  # of a detailed model: laws that differ in form agree to some 3 %


@declared
class Comparison:
    """How the diagnosis compares recordings with the model."""

    block: float = key(
        "time over which errors are averaged for all statistics; short against the machine's "
        "motions, at most a fifth of a period of an oscillation",
        "s",
        lambda scope: _BLOCK * scope.whole["sample_time"],
        otherwise=f"{_BLOCK} samples",
    )
    lasting: float = key(
        "duration from which an error is systematic; of an oscillation, half a period",
        "s",
        lambda scope: _LASTING * scope.own["block"],
        otherwise=f"{_LASTING} blocks",
    )
    least: float = key(
        "least compared length of a recording",
        "s",
        lambda scope: 2.0 * scope.own["lasting"],
        otherwise="2 `lasting`",
    )
    settling: float = key("warm-up at the start", "s", 0.0)
    left: float = key(
        f"fraction of the systematic error that correct effects may leave: {_LEFT} for a detailed "
        "model, more for a simple one",
        absent=_LEFT,
    )
    false_alarms: float = key(
        "fraction of data sets of a healthy machine with a false alarm; thresholds follow from it",
        absent=RATE,
        above=0.0,
        below=1.0,
        expected="a share between 0 and 1",
    )
    least_skew: float = key(
        "least time offset that is reported",
        "s",
        # Within it, a clock is a matter of how inputs are held between samples.
        lambda scope: _LEAST_SKEW * scope.whole["sample_time"],
        otherwise=f"{_LEAST_SKEW} samples",
    )
    begins: Threshold | None = key(
        "input whose application starts the test, and how far above its rest", absent=None
    )
    rests: tuple[Rest, ...] = key(
        "readings of inputs while they are steady", name="rest", absent=()
    )
    leading: LeadingOutput | None = key(
        "output that corrects a slow motion, which integrates the noise of inputs",
        name="leads",
        absent=None,
    )
    channels: tuple[Channel, ...] = key(
        "compared signals", absent=_measured, otherwise="outputs, reference signals and aids"
    )
    tolerances: Mapping[str, float] = key(
        "relative standard deviation of parameters from recording to recording",
        absent={},
        keys=PARAMETER,
    )
    levels: Mapping[str, Level] = key("nuisance parameters", absent={}, keys=PARAMETER)
    wander: Mapping[str, Wander] = key(
        "parameters that differ along a recording, for each channel by itself",
        absent={},
        keys=PARAMETER,
    )
    exclusions: tuple[Exclusion, ...] = key("excluded samples", name="excluded", absent=())
    influences: tuple[Influence, ...] = key(
        "further operating variables for the correlation of errors on the page", absent=()
    )
