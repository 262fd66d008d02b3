"""What is set before a recording, as a system file declares it."""

from collections.abc import Mapping
from dataclasses import dataclass

from workbench.expression import Expression
from workbench.system_parts import Tolerance

FIRST, LARGEST = "first", "largest"  # of the values along a recording


@dataclass(frozen=True)
class Agreement:
    """What a recording says of a condition.

    Attributes
    ----------
    formula : of measured signals, in the unit of the condition.
    place : FIRST or LARGEST, which of its values tells the condition.
    """

    formula: Expression
    place: str
    tolerance: Tolerance


@dataclass(frozen=True)
class Condition:
    """What was set before a recording, and what it means.

    Attributes
    ----------
    unit : SI of a quantity; empty for a word or a whole number.
    least : smallest quantity; `exclusive`: above it.
    choices : words or whole numbers that it may be.
    count : of entries, where it is a list; 0: no list.
    sets : parameter of the model that a quantity is, and that is as usual where nobody says;
        empty: none.
    parameters : of the model by choice, which it sets.
    told : whether estimators are told what it sets.
    lasts : mean time until another choice takes its place, under way; infinite: never [s].
    sign : whether it is the sign of the recording's signals.
    label : for people.
    agrees : what the recording says of it, or None.
    """

    name: str
    label: str
    unit: str
    least: float
    exclusive: bool
    choices: tuple[str | int, ...]
    count: int
    sets: str
    parameters: Mapping[str, Mapping[str, float]]
    told: bool
    lasts: float
    sign: bool
    agrees: Agreement | None

    def means(self, said: object) -> Mapping[str, float]:
        """Parameters of the model that it sets where it is this, SI; none where nobody knows."""
        if self.sets and isinstance(said, float):
            return {self.sets: said}
        return self.parameters.get(str(said), {})
