"""How a machine comes to rest: what a stop is asked for, what drives it, what standards say."""

from collections.abc import Mapping
from typing import ClassVar

from workbench.system.comparison import Exclusion
from workbench.system.declaration import Either, Scope, Unit, declared, key, table_name
from workbench.system.expression import Expression
from workbench.system.parts import FORMULA, STATE, names_of
from workbench.system.tables import Table
from workbench.system.units import quantity

COMMAND, END = "command", "end"  # where a recording tells what was asked of it
SPEED = "speed"  # the quantity that every stop is asked for: that at the command [m/s]

# What names refer to, see `parts`.
ASKED = "an asked quantity"
MOVED = "an input, or a continuous state"
RISING = "an input that rises"
OUTSIDE = "a measured output, or a parameter"


@declared
class AskedQuantity:
    """A quantity that a stop is asked for."""

    name: str = table_name()
    label: str = key("what it is, for people", absent="{name}")
    unit: Unit = key("of the quantity")
    shown: Unit = key("unit in figures", absent="{unit}", like="unit")
    formula: Expression = key(
        "formula of measured signals: its value in a recorded stop", name="is", of=FORMULA
    )
    place: str = key(
        "where a recorded stop shows it: at its `command`, or at its `end`, after all build-up",
        name="at",
        choices=(COMMAND, END),
        absent=COMMAND,
    )
    usual: float = key("default value", "{unit}")


@declared
class DrivenInput:
    """An input of the model in a stop."""

    name: str = table_name()
    formula: Expression = key("formula of demands: its final value", name="is", of=ASKED)
    delay: float = key("after the command", "s", 0.0)
    lag: float = key("of first order, then", "s", 0.0)
    along: bool = key("it depends on the position, not on time", absent=False)

    @property
    def rises(self) -> bool:
        """Whether it takes time to be where it goes."""
        return self.delay + self.lag > 0.0


@declared
class Difference:
    """What differs from stop to stop, beside the tolerances of the diagnosis."""

    EITHER: ClassVar = Either(
        ("spread", "share"),
        expected="one of the two",
        remedy="say how far it moves, in its unit or as a share of its size",
    )

    of: tuple[str, ...] = key("inputs, or states at the command, which it moves together", of=MOVED)
    unit: Unit = key("of the spread", absent="1")
    absolute: float | None = key(
        "standard deviation", "{unit}", None, name="spread", otherwise="`share` instead"
    )
    share: float | None = key(
        "standard deviation, as a share of their size", absent=None, otherwise="`spread` instead"
    )

    @property
    def relative(self) -> bool:
        """Whether its spread is a share."""
        return self.share is not None

    @property
    def spread(self) -> float:
        """Standard deviation, in their unit, or as a share of their size."""
        spread = self.absolute if self.share is None else self.share
        assert spread is not None
        return spread


@declared
class Outside(Exclusion):
    """When a stop is beyond what the model claims."""

    formula: Expression = key("of measured outputs and parameters", name="is", of=OUTSIDE)


@declared
class Nominal:
    """Formulas of asked quantities that standards correct measured distances by."""

    mass: Expression = key("formula of demands: weighed mass [kg]", of=ASKED)
    rotating: Expression = key(
        "formula of parameters: equivalent mass of rotating parts [kg]", of=FORMULA
    )
    reference: float = key("nominal mass", "kg")
    resistance: Expression = key(
        "resistance of gradients and curves along a recording, over weight", of=FORMULA
    )
    within: float = key("allowed deviation of a measured speed, as a fraction of the nominal one")
    speeds: tuple[float, ...] = key("nominal ones", "m/s")


def _constants(table: Table, name: str, scope: Scope) -> dict[float, tuple[float, ...]]:
    """Two constants by speed [m/s]."""
    constants = table.table(name)
    return {
        quantity(speed, "m/s", constants.place(speed)): constants.numbers(speed, "1", 2)
        for speed in constants.content
    }


@declared
class Rating:
    """A percentage that stands for a distance: C/s - D, with constants by nominal speed."""

    label: str = key("what it is, for people")
    constants: Mapping[float, tuple[float, float]] = key(
        '`{ "120 km/h" = [C, D] }`, of a percentage C/s - D, s in m',
        read=_constants,
        schema={
            "type": "object",
            "additionalProperties": {
                "type": "array",
                "items": {"type": "number"},
                "minItems": 2,
                "maxItems": 2,
            },
        },
    )


@declared
class Stopping:
    """How a machine stops."""

    speed: Expression = key("formula of measured signals: the speed over ground [m/s]", of=FORMULA)
    state: str = key("state of the model whose integral is the distance [m/s]", of=STATE)
    rest: float = key("speed below which a constant rate leads to rest", "m/s")
    longest: float = key("longest time of a stop", "s")
    timed_by: str = key(
        "input with `delay` or `lag` that shows when the command was given", of=RISING
    )
    asked: tuple[AskedQuantity, ...] = key(
        f"demands of a stop; `{SPEED}` is required", schema={"required": [SPEED]}
    )
    driven: tuple[DrivenInput, ...] = key(
        "each input of the model", name="inputs", keys=names_of("inputs"), every=True
    )
    start: Mapping[str, Expression] = key(
        "formulas of demands: states at the command",
        keys=STATE,
        of=ASKED,
        absent={},
        otherwise="nominal",
    )
    differences: tuple[Difference, ...] = key(
        "recording-to-recording variation beside `tolerances`, one sigma", name="differs", absent=()
    )
    outside: tuple[Outside, ...] = key(
        "stops outside the validity range of the model, as `diagnosis.excluded`",
        absent=(),
        otherwise="never",
    )
    nominal: Nominal | None = key("how standards correct measured distances", absent=None)
    rating: Rating | None = key(
        "percentage of a standard that corresponds to a distance", absent=None
    )

    def check(self, table: Table, scope: Scope) -> None:
        """Refuse stops that are not asked for a speed."""
        if {quantity.name: quantity.unit for quantity in self.asked}.get(SPEED) != "m/s":
            raise table.wrong("asked", f"a table '{SPEED}' in m/s among what is asked for")

    @property
    def response(self) -> float:
        """Mean time from the command to an equivalent step of what rises [s]."""
        rising = [driven.delay + driven.lag for driven in self.driven if driven.rises]
        return sum(rising) / len(rising) if rising else 0.0
