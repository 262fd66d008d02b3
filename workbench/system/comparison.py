"""How recordings of a system are compared with its model: what a diagnosis rests on."""

from collections.abc import Mapping
from dataclasses import dataclass

from workbench.system.expression import Expression
from workbench.system.parts import Threshold


@dataclass(frozen=True)
class Channel:
    """What the diagnosis compares: a sum of readings, each times a constant.

    Attributes
    ----------
    label : what it is, for people.
    shown : unit in figures of its errors.
    """

    name: str
    unit: str
    label: str
    shown: str
    formula: Expression


@dataclass(frozen=True)
class LeadingOutput:
    """A slow motion that integrates the noise of inputs: a measured output leads it.

    Attributes
    ----------
    output : the measured one.
    together : states that its correction scales alike.
    ripple : standard deviation of what moves it, over that of the noise of the inputs [1].
    """

    output: str
    together: tuple[str, ...]
    ripple: float


@dataclass(frozen=True)
class Rest:
    """An input that is measured at rest, before it is applied, against what the model says of it.

    Attributes
    ----------
    signal : the input.
    output : of the model: its reading at rest.
    zero : standard deviation of a good sensor's zero [unit].
    """

    signal: str
    output: str
    zero: float


RATE = 0.002
"""Sets of a sound machine that may be called something else, unless its system says otherwise: a
tenth of the 2 % that power allows, since noise of real sensors has heavier tails, and tests on one
set are several."""


@dataclass(frozen=True)
class Level:
    """A parameter that differs by nature from recording to recording, and needs no cause.

    Attributes
    ----------
    by : condition whose choices have a level each; empty: one for all.
    spread : relative standard deviation of the common level, infinite: anything.
    """

    by: str
    spread: float


@dataclass(frozen=True)
class Wander:
    """What a parameter differs by along one recording, for each channel by itself.

    Attributes
    ----------
    share : relative standard deviation.
    over : [s] correlation time.
    """

    share: float
    over: float


@dataclass(frozen=True)
class Exclusion:
    """When samples do not count.

    Attributes
    ----------
    reason : for people.
    formula : in measured signals and parameters.
    above, below : a level of its absolute value, infinite for none.
    from_rest : whether it counts from its median before the input is applied.
    within : [s] around such samples that do not count either.
    smoothed : [s] over which the formula is averaged.
    only_while : and only while a signal is above a level, or None.
    to_the_end : whether nothing after it counts.
    restarted : measured outputs, which are states. Such samples do count, if each of their blocks
        is predicted from these states as measured before it; unless errors last there nevertheless.
    uncertain : relative standard deviation of parameters of a law that is simplified there.
    """

    reason: str
    formula: Expression
    above: float
    below: float
    from_rest: bool
    within: float
    smoothed: float
    only_while: Threshold | None
    to_the_end: bool
    restarted: tuple[str, ...]
    uncertain: Mapping[str, float]


@dataclass(frozen=True)
class Influence:
    """What errors may go with.

    Attributes
    ----------
    way : of the formula: its "value", "size", "rate", "integral", or "turn", an angle, whose phase
        belongs to one recording.
    """

    name: str
    unit: str
    formula: Expression
    way: str


@dataclass(frozen=True)
class Comparison:
    """How the diagnosis compares recordings with the model.

    Attributes
    ----------
    block : [s] whose mean errors are the unit of all statistics.
    lasting : [s] from which on an error is no noise.
    least : [s] of a recording that must count.
    settling : [s] at the start, in which the simulation finds its states.
    left : share of lasting errors that right causes may leave: what the model simplifies [1].
    false_alarms : share of sets of a sound machine that may be called something else [1].
    channels : what is compared, in this order.
    leading : a motion that is led, or None.
    begins : input that is applied in each recording, and by how much above its rest.
    rest : readings before that.
    tolerances : relative standard deviation of parameters from recording to recording.
    levels : parameters that differ by nature.
    wander : parameters that differ along a recording.
    exclusions : samples that do not count.
    influences : what errors may go with, besides the measured signals.
    """

    block: float
    lasting: float
    least: float
    settling: float
    left: float
    false_alarms: float
    channels: tuple[Channel, ...]
    leading: LeadingOutput | None
    begins: Threshold | None
    rest: Rest | None
    tolerances: Mapping[str, float]
    levels: Mapping[str, Level]
    wander: Mapping[str, Wander]
    exclusions: tuple[Exclusion, ...]
    influences: tuple[Influence, ...]
