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
    Threshold,
    unit_of_signal,
)

RATE = 0.002
"""Sets of a sound machine that may be called something else, unless its system says otherwise: a
tenth of the 2 % that power allows, since noise of real sensors has heavier tails, and tests on one
set are several."""

WAYS = ("value", "size", "rate", "integral", "turn")


def _label(scope: Scope) -> str:
    """That of the measured signal of this name, else the name."""
    name: str = scope.own["name"]
    compared = (*scope.whole["outputs"], *scope.whole["reference_signals"])
    return next((signal.label for signal in compared if signal.name == name), name)


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
        for signal in (*scope.whole["outputs"], *scope.whole["reference_signals"])
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
        "standard deviation of what moves it, over that of the noise of the inputs", absent=1.0
    )


@declared
class Rest:
    """An input that is measured at rest, before it is applied, against what the model says."""

    signal: str = key("the input", of=SIGNAL)
    output: str = key("of the model: its reading at rest", of=VARIABLE)
    zero: float = key("standard deviation of a good sensor's zero", unit=unit_of_signal)


@declared
class Level:
    """A parameter that differs by nature from recording to recording, and needs no cause."""

    by: str = key("condition whose choices have a level each", of=CONDITION, absent="")
    spread: float = key(
        "relative standard deviation of the common level", absent=ENDLESS, otherwise="any"
    )
    deviation: float = key(
        "standard deviation of the common level in the parameter's SI unit, in place of `spread` "
        "where the sheet's value is zero",
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
        remedy="say from which level on samples do not count",
    )

    reason: str = key("why, for people")
    formula: Expression = key("of measured signals and parameters", name="is", of=FORMULA)
    above: float = key(
        "level of its absolute value, SI, above which samples do not count",
        absent=ENDLESS,
        otherwise="`below` instead",
    )
    below: float = key(
        "level of its absolute value, SI, below which samples do not count",
        absent=-ENDLESS,
        otherwise="`above` instead",
    )
    from_rest: bool = key("it counts from its median before the input is applied", absent=False)
    smoothed: float = key("over which it is averaged", "s", 0.0)
    within: float = key("around such samples that do not count either", "s", 0.0)
    only_while: Threshold | None = key("it counts", absent=None, otherwise="always")
    to_the_end: bool = key("nothing after it counts", absent=False)
    restarted: tuple[str, ...] = key(
        "measured outputs that are states: each block begins with these as measured, and such "
        "samples do count, unless errors last there whatever is found",
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
        "what of the formula: an angle, whose phase belongs to one recording, is a `turn`",
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
        "time whose mean errors are the unit of all statistics; short against all that the machine "
        "does, of what swings a fifth of a period at most",
        "s",
        lambda scope: _BLOCK * scope.whole["sample_time"],
        otherwise=f"{_BLOCK} samples",
    )
    lasting: float = key(
        "from which on an error is no noise; of what swings, half a period",
        "s",
        lambda scope: _LASTING * scope.own["block"],
        otherwise=f"{_LASTING} blocks",
    )
    least: float = key(
        "of a recording that must count",
        "s",
        lambda scope: 2.0 * scope.own["lasting"],
        otherwise="2 `lasting`",
    )
    settling: float = key("at the start, in which the simulation finds its states", "s", 0.0)
    left: float = key(
        f"share of lasting errors that right causes may leave: {_LEFT} for a detailed model, more "
        "for one that simplifies",
        absent=_LEFT,
    )
    false_alarms: float = key(
        "share of sets of a sound machine that may be called something else; thresholds follow "
        "from it",
        absent=RATE,
        above=0.0,
        below=1.0,
        expected="a share between 0 and 1",
    )
    least_skew: float = key(
        "by which a signal is late at least, to be late",
        "s",
        # Within it, a clock is a matter of how inputs are held between samples.
        lambda scope: _LEAST_SKEW * scope.whole["sample_time"],
        otherwise=f"{_LEAST_SKEW} samples",
    )
    begins: Threshold | None = key("input that is applied, by how much above its rest", absent=None)
    rests: tuple[Rest, ...] = key("readings before that", name="rest", absent=())
    leading: LeadingOutput | None = key(
        "an output that leads a slow motion, which integrates the noise of inputs",
        name="leads",
        absent=None,
    )
    channels: tuple[Channel, ...] = key(
        "what is compared", absent=_measured, otherwise="outputs and reference signals"
    )
    tolerances: Mapping[str, float] = key(
        "relative standard deviation of parameters from recording to recording",
        absent={},
        keys=PARAMETER,
    )
    levels: Mapping[str, Level] = key(
        "parameters that differ by nature and are calibrated", absent={}, keys=PARAMETER
    )
    wander: Mapping[str, Wander] = key(
        "parameters that differ along a recording, for each channel by itself",
        absent={},
        keys=PARAMETER,
    )
    exclusions: tuple[Exclusion, ...] = key("samples that do not count", name="excluded", absent=())
    influences: tuple[Influence, ...] = key(
        "what errors may go with, besides the measured signals, for the page", absent=()
    )
