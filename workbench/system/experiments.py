"""What may be run next on a machine: what may be varied, and what it costs."""

from collections.abc import Mapping
from dataclasses import dataclass

from workbench.system.expression import Expression
from workbench.system.parts import Signal

STEP, STAIRCASE, SINE, RELEASE = "step", "staircase", "sine", "release"


@dataclass(frozen=True)
class VariedInput:
    """An input that follows a profile.

    Attributes
    ----------
    low, high : range of the demand [unit].
    profiles : kinds that are tried.
    begins : [s] before which the demand is zero.
    every : [s] that a stair lasts, and the period of a sine; after it, a demand is released.
    lags : [s] of first order, one after the other, from the demand to the input.
    """

    name: str
    low: float
    high: float
    profiles: tuple[str, ...]
    begins: float
    every: float
    lags: tuple[float, ...]


@dataclass(frozen=True)
class Setting:
    """A value of something that may be set, SI, and how it was written."""

    value: float | int | str | tuple[str | int, ...]
    text: str


@dataclass(frozen=True)
class EndsBelow:
    """A recording ends where the absolute value of a formula is below a level, SI."""

    formula: Expression
    below: float


@dataclass(frozen=True)
class Cost:
    """Of one recording, in a unit for people.

    Attributes
    ----------
    formula : in `duration` [s] and in settings that are numbers, SI.
    """

    formula: Expression
    unit: str


@dataclass(frozen=True)
class Experiments:
    """All that may be run.

    Attributes
    ----------
    lasts : [s] of a recording, at most.
    ends : before that, or None.
    settings : of conditions by name, others are as usual, or as the recording says; and of what is
        set besides, which only the inputs tell.
    labels : of what is set besides, by name.
    start : formulas of states, in parameters and in settings that are numbers.
    varied : inputs that follow profiles.
    driven : formulas of inputs that follow from the model's variables, as by a controller.
    cost : of a recording.
    sensors : that could be added: readings of the model, and their noise.
    """

    lasts: float
    ends: EndsBelow | None
    settings: Mapping[str, tuple[Setting, ...]]
    labels: Mapping[str, str]
    start: Mapping[str, Expression]
    varied: tuple[VariedInput, ...]
    driven: Mapping[str, Expression]
    cost: Cost
    sensors: tuple[Signal, ...]
