"""Closed forms that physics has, of one quantity, dimensionally consistent.

Each is a size times a function without dimension of the quantity over a parameter of its own unit:
power, saturation, decay, exponential growth, threshold (bent or stepped).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from workbench.diagnosis.laws.places import CLOCK, Law
from workbench.diagnosis.laws.splines import Knots
from workbench.diagnosis.laws.writing import LawClass, clock, effect, number, unit_of

MARK = "proposed, not known physics"
_ROUNDED = 0.01  # of the range, over which a kink is rounded: no event, and below what is resolved
_MATTERS = 0.01  # of an output: what parameters of machines are known to, at best
_TURNS = 1e-5  # of an output, of a harmonic: no tolerance turns with a shaft
# Sizes beyond which no law is sought, over what its free function and its output are; what of an
# output one may take.
_REACH, _KEPT = 10.0, 0.9
_WIDER = 10.0  # times bounds that bind are widened


@dataclass(frozen=True)
class Form:
    """A function of a quantity q, at most about 1 over its range."""

    name: str
    text: str  # for people, of `{q}`
    expression: str  # in Modelica, of {q}, {Q} the largest, {w} what is rounded, and {shape}
    shape: str = ""  # name of its parameter; empty if it has none
    unit: str = "{unit}"  # of the shape, {unit} of the quantity
    # of the shape to begin with, over the range of the quantity; of a power the exponents
    values: tuple[float, ...] = ()


FORMS = (
    Form("Linear", "in proportion to it", "{q}/{Q}"),
    Form("Power", "with a power of it", "(({q}/{Q})^2 + 1e-9)^(0.5*{shape})", "n", "1", (0.5, 2.0)),
    Form(
        name="Saturation",
        text="with it, ever less",
        expression="1.0 - exp(-{q}/{shape})",
        shape="scale",
        values=(0.05, 0.2, 0.6),
    ),
    Form(
        name="Growth",
        text="exponentially with it",
        expression="exp(({q} - {Q})/{shape})",
        shape="scale",
        values=(0.1, 0.3),
    ),
    Form(
        name="Threshold",
        text="in proportion to what of it is above a threshold",
        expression="0.5*({q} - {shape} + sqrt(({q} - {shape})^2 + {w}^2))/{Q}",
        shape="threshold",
        values=(0.2, 0.4, 0.6, 0.8),
    ),
    Form(
        name="Step",
        text="by a step at a threshold",
        expression="0.5*(1.0 + tanh(({q} - {shape})/{w}))",
        shape="threshold",
        values=(0.2, 0.4, 0.6, 0.8),
    ),
)
SIGNED = (
    Form("Sides", "by its sign alone, as hysteresis does", "tanh({q}/{w})"),
    Form("Rectifier", "with its size, whatever its sign", "sqrt({q}^2 + {w}^2)/{Q}"),
    Form(
        "Above", "in proportion to it where it is positive", "0.5*({q} + sqrt({q}^2 + {w}^2))/{Q}"
    ),
    Form(
        "Below", "in proportion to it where it is negative", "0.5*({q} - sqrt({q}^2 + {w}^2))/{Q}"
    ),
    Form(
        name="DeadZone",
        text="in proportion to what of it is beyond a dead zone",
        expression="({q} + 0.5*(sqrt(({q} - {shape})^2 + {w}^2)"
        " - sqrt(({q} + {shape})^2 + {w}^2)))/{Q}",
        shape="zone",
        values=(0.1, 0.3, 0.6),
    ),
    Form(
        name="Limiter",
        text="with it up to a limit to both sides",
        expression="tanh({q}/{shape})",
        shape="limit",
        values=(0.1, 0.3, 1.0),
    ),
)
HARMONIC = Form("Harmonic", "as a harmonic", "cosine*cos({a}) + sine*sin({a})")
CONSTANT = Form("Constant", "always alike", "1.0")


@dataclass(frozen=True)
class ClosedForm:
    """A closed form of a law."""

    law: Law
    form: Form
    knots: Knots | None  # range of what it depends on; None of a constant, and of what turns
    scale: float  # of the output, where the law is added to it
    largest: float  # of the law itself, as a free function; bounds of sizes follow from it
    room: float = 1.0  # times bounds are wider than usual

    @property
    def text(self) -> str:
        """What it is, for people."""
        return f"{self.law.text}: {self.form.text}"

    @property
    def widened(self) -> "ClosedForm":
        """The same with bounds further out."""
        return replace(self, room=_WIDER * self.room)

    @property
    def name(self) -> str:
        """Of its class."""
        place, influence = self.law.place, self.law.influence
        where = {"1.0": "Added", place.nominal: "Times"}.get(self.law.carrier.expression, "Share")
        by = "" if influence is None else influence.name
        return f"{place.name}{by}{where}{self.form.name}"

    @property
    def written(self) -> LawClass:
        """Its class."""
        lines, shapes = self._shape()
        sizes = ("cosine", "sine") if self._turns else (self.law.place.own("s"),)
        known = _bounded(self.law.carrier.unit, *self._reach())
        text = {"cosine": "Part of cosine", "sine": "Part of sine"}
        about = "Size, at the largest that was seen"
        declared, equations = clock(self.law.influence)
        times = f"({self._expression()})" if self._turns else f"{sizes[0]}*({self._expression()})"
        return LawClass(
            name=self.name,
            about=f"{MARK}: {self.text}",
            place=self.law.place,
            declarations=(
                *(f'parameter Real {n}({known}) = 0.0 "{text.get(n, about)}";' for n in sizes),
                *lines,
                *declared,
            ),
            equations=equations,
            change=f"{self.law.carrier.expression}*{times}",
            annotation=effect(
                sizes,
                (_TURNS if self._turns else _MATTERS) * self._unit,
                self.law.place.slot.name,
                shapes,
            ),
        )

    @property
    def _turns(self) -> bool:
        return self.law.influence is not None and self.law.influence.turns

    @property
    def _unit(self) -> float:
        """What a size is counted in: 1 of what is relative, else what the output is."""
        return self.scale if self.law.carrier.expression == "1.0" else 1.0

    def _reach(self) -> tuple[float, float]:
        far = self.room * _REACH * max(self._unit, self.largest)
        if self.law.carrier.expression != self.law.place.nominal:
            return -far, far
        # An inertia or a friction that is multiplied keeps its sign.
        return (-_KEPT, _KEPT) if self._turns else (-_KEPT, far)

    def _range(self) -> Knots:
        return self.knots or Knots(0.0, 1.0)

    def _expression(self) -> str:
        if self._turns:
            return self.form.expression.format(a=f"{number(2.0 * np.pi)}*{CLOCK}/period")
        knots, influence = self._range(), self.law.influence
        return self.form.expression.format(
            q="" if influence is None else influence.expression,
            Q=number(max(abs(knots.low), abs(knots.high))),
            w=number(_ROUNDED * (knots.high - knots.low)),
            shape=self.law.place.own(self.form.shape),
        )

    def _shape(self) -> tuple[tuple[str, ...], dict[str, tuple[float, ...]]]:
        """Declarations of what is not a size, and values to begin with."""
        form, influence, knots = self.form, self.law.influence, self._range()
        if influence is not None and influence.turns:
            unit, span = unit_of(influence.unit), number(influence.span)
            return (f'parameter Real period({unit}) = {span} "As errors have it";',), {}
        if not form.shape:
            return (), {}
        powers = form.shape == "n"
        # A zone or a limit is the same to both sides.
        sizes = knots if knots.low >= 0.0 else Knots(0.0, max(abs(knots.low), abs(knots.high)))
        values = form.values
        if not powers:
            shares = sizes.low + np.array(values) * (sizes.high - sizes.low)
            values = tuple(float(f"{value:.3g}") for value in shares)
        low, high = (0.1, 6.0) if powers else (min(values) / 20.0, 2.0 * sizes.high)
        unit = form.unit.format(unit="" if influence is None else influence.unit)
        known = _bounded(unit, low / self.room, high * self.room)
        shape = self.law.place.own(form.shape)
        line = f'parameter Real {shape}({known}) = {number(values[0])} "Of its form";'
        return (line,), {shape: values}


def candidates(
    law: Law, knots: Knots | None, scale: float, largest: float = 0.0
) -> Iterator[ClosedForm]:
    """Closed forms of a law; see `ClosedForm`."""
    if law.influence is not None and law.influence.turns:
        forms: tuple[Form, ...] = (HARMONIC,)
    elif knots is None or law.influence is None:
        forms = (CONSTANT,)
    else:
        # What has a scale or a threshold has no sign.
        forms = tuple(form for form in FORMS if not form.shape or knots.low >= 0.0)
        forms += SIGNED if knots.low < 0.0 < knots.high else ()
    for form in forms:
        yield ClosedForm(law, form, knots, scale, largest)


def _bounded(unit: str, low: float, high: float) -> str:
    return ", ".join(filter(None, (unit_of(unit), f"min={number(low)}, max={number(high)}")))
