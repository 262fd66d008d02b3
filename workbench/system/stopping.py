"""How a machine comes to rest: what a stop is asked for, what drives it, what standards say."""

from collections.abc import Mapping
from dataclasses import dataclass

from workbench.system.comparison import Exclusion
from workbench.system.expression import Expression

COMMAND, END = "command", "end"  # where a recording tells what was asked of it
SPEED = "speed"  # the quantity that every stop is asked for: that at the command [m/s]


@dataclass(frozen=True)
class AskedQuantity:
    """A quantity that a stop is asked for.

    Attributes
    ----------
    formula : of measured signals, that tells it of a recorded stop.
    place : of the recording: COMMAND or END of the rise.
    usual : unless it is said, SI.
    """

    name: str
    label: str
    unit: str
    shown: str
    formula: Expression
    place: str
    usual: float


@dataclass(frozen=True)
class DrivenInput:
    """An input of the model in a stop.

    Attributes
    ----------
    formula : of asked quantities: where it goes.
    delay, lag : [s] after the command, then of first order.
    along : whether a recorded stop has it by the place, as the way has it.
    """

    name: str
    formula: Expression
    delay: float
    lag: float
    along: bool


@dataclass(frozen=True)
class Difference:
    """What differs from stop to stop, beside the tolerances of the diagnosis.

    Attributes
    ----------
    of : states at the command, or inputs, which it moves together.
    spread : standard deviation, in their unit, or a share of their size.
    relative : whether it is a share.
    """

    of: tuple[str, ...]
    spread: float
    relative: bool


@dataclass(frozen=True)
class Nominal:
    """Formulas of asked quantities that standards correct measured distances by.

    Attributes
    ----------
    mass : that is weighed [kg].
    rotating : mass that what turns adds [kg].
    reference : nominal mass [kg].
    resistance : along a recording, of gradients and curves, over weight.
    within : share of the nominal speed by which a measured one may differ.
    speeds : nominal ones [m/s].
    """

    mass: Expression
    rotating: Expression
    reference: float
    resistance: Expression
    within: float
    speeds: tuple[float, ...]


@dataclass(frozen=True)
class Rating:
    """A percentage that stands for a distance: C/s - D, with constants by nominal speed.

    Attributes
    ----------
    constants : C [m] and D by speed [m/s].
    """

    label: str
    constants: Mapping[float, tuple[float, float]]


@dataclass(frozen=True)
class Stopping:
    """How a machine stops.

    Attributes
    ----------
    speed : formula of measured signals: the speed over ground [m/s].
    state : of the model, whose integral is the way.
    rest : [m/s] below which a constant rate leads to rest.
    longest : [s] that a stop may last.
    timed_by : input that tells when the command of a recording was given.
    asked : what a stop is asked for.
    driven : inputs.
    start : formulas of states at the command, of asked quantities.
    differences : beside tolerances.
    outside : when a stop is beyond what the model claims.
    nominal, rating : of standards, or None.
    """

    speed: Expression
    state: str
    rest: float
    longest: float
    timed_by: str
    asked: tuple[AskedQuantity, ...]
    driven: tuple[DrivenInput, ...]
    start: Mapping[str, Expression]
    differences: tuple[Difference, ...]
    outside: tuple[Exclusion, ...]
    nominal: Nominal | None
    rating: Rating | None

    @property
    def response(self) -> float:
        """Mean time from the command to an equivalent step of what rises [s]."""
        rising = [one.delay + one.lag for one in self.driven if one.delay + one.lag > 0.0]
        return sum(rising) / len(rising) if rising else 0.0
