"""Closed forms that physics has, of one quantity, dimensionally consistent.

Each is a size times a function without dimension of the quantity over a parameter of its own unit:
power, saturation, decay, exponential growth, threshold (bent or stepped).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.diagnosis.laws.places import CLOCK, Law, LawInfluence
from workbench.diagnosis.laws.splines import Knots
from workbench.diagnosis.laws.writing import LawClass, clock, effect, number, unit_of

MARK = "proposed, not known physics"
_ROUNDED = 0.01  # of the range, over which a kink is rounded: no event, and below what is resolved
_MATTERS = 0.01  # of an output: what parameters of machines are known to, at best
_TURNS = 1e-5  # of an output, of a harmonic: no tolerance turns with a shaft
_REACH, _KEPT = 10.0, 0.9  # sizes beyond which no law is sought; what of an output one may take


@dataclass(frozen=True)
class Form:
    """A function of a quantity q, at most about 1 over its range.

    Attributes
    ----------
    text : for people, of `{q}`.
    expression : in Modelica, of {q}, {Q} the largest, {w} what is rounded, and the shape.
    shape : name of its parameter; empty if it has none.
    unit : of the shape, {unit} of the quantity.
    values : of the shape to begin with, over the range of the quantity; of a power the exponents.
    """

    name: str
    text: str
    expression: str
    shape: str = ""
    unit: str = "{unit}"
    values: tuple[float, ...] = ()


FORMS = (
    Form("Linear", "in proportion to it", "{q}/{Q}"),
    Form("Power", "with a power of it", "(({q}/{Q})^2 + 1e-9)^(0.5*n)", "n", "1", (0.5, 2.0)),
    Form(
        name="Saturation",
        text="with it, ever less",
        expression="1.0 - exp(-{q}/scale)",
        shape="scale",
        values=(0.05, 0.2, 0.6),
    ),
    Form(
        name="Growth",
        text="exponentially with it",
        expression="exp(({q} - {Q})/scale)",
        shape="scale",
        values=(0.1, 0.3),
    ),
    Form(
        name="Threshold",
        text="in proportion to what of it is above a threshold",
        expression="0.5*({q} - threshold + sqrt(({q} - threshold)^2 + {w}^2))/{Q}",
        shape="threshold",
        values=(0.2, 0.4, 0.6, 0.8),
    ),
    Form(
        name="Step",
        text="by a step at a threshold",
        expression="0.5*(1.0 + tanh(({q} - threshold)/{w}))",
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
        expression="({q} + 0.5*(sqrt(({q} - zone)^2 + {w}^2) - sqrt(({q} + zone)^2 + {w}^2)))/{Q}",
        shape="zone",
        values=(0.1, 0.3, 0.6),
    ),
    Form(
        name="Limiter",
        text="with it up to a limit to both sides",
        expression="tanh({q}/limit)",
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
    written: LawClass

    @property
    def text(self) -> str:
        """What it is, for people."""
        return f"{self.law.text}: {self.form.text}"


def candidates(law: Law, knots: Knots | None, scale: float) -> Iterator[ClosedForm]:
    """Closed forms of a law.

    Parameters
    ----------
    knots : range of what it depends on; None of a constant.
    scale : of the output, where the law is added to it.
    """
    if law.influence is not None and law.influence.turns:
        yield ClosedForm(law, HARMONIC, _harmonic(law, law.influence, scale))
        return
    if knots is None or law.influence is None:
        yield ClosedForm(law, CONSTANT, _written(law, CONSTANT, Knots(0.0, 1.0), scale))
        return
    for form in FORMS:
        # What has a scale or a threshold has no sign.
        if not form.shape or knots.low >= 0.0:
            yield ClosedForm(law, form, _written(law, form, knots, scale))
    if knots.low < 0.0 < knots.high:
        for form in SIGNED:
            yield ClosedForm(law, form, _written(law, form, knots, scale))


def _harmonic(law: Law, influence: LawInfluence, scale: float) -> LawClass:
    """A harmonic of a period that errors have; its phase differs from recording to recording."""
    declared, equations = clock(influence)
    unit = _unit(law, scale)
    known = _bounded(law.carrier.unit, -_KEPT * unit, _KEPT * unit)
    period = f"parameter Real period({unit_of(influence.unit)}) = {number(influence.span)}"
    lines = [
        *(f'parameter Real {part}({known}) = 0.0 "Part of {part}";' for part in ("cosine", "sine")),
        f'{period} "As errors have it";',
    ]
    angle = f"{number(2.0 * np.pi)}*{CLOCK}/period"
    return LawClass(
        name=_name(law, HARMONIC),
        about=f"{MARK}: {law.text}: {HARMONIC.text}",
        place=law.place,
        declarations=(*lines, *declared),
        equations=equations,
        change=f"{law.carrier.expression}*({HARMONIC.expression.format(a=angle)})",
        annotation=effect(("cosine", "sine"), _TURNS * unit, law.place.slot.name, {}),
    )


def _unit(law: Law, scale: float) -> float:
    """What a size is counted in: 1 of what is relative, else what the output is."""
    return scale if law.carrier.expression == "1.0" else 1.0


def _bounded(unit: str, low: float, high: float) -> str:
    """Modifiers of a parameter."""
    return ", ".join(filter(None, (unit_of(unit), f"min={number(low)}, max={number(high)}")))


def _name(law: Law, form: Form) -> str:
    name = law.place.name + ("" if law.influence is None else law.influence.name)
    where = {"1.0": "Added", law.place.nominal: "Times"}.get(law.carrier.expression, "Share")
    return f"{name}{where}{form.name}"


def _written(law: Law, form: Form, knots: Knots, scale: float) -> LawClass:
    largest = max(abs(knots.low), abs(knots.high))
    declared, equations = clock(law.influence)
    quantity = "" if law.influence is None else law.influence.expression
    expression = form.expression.format(
        q=quantity, Q=number(largest), w=number(_ROUNDED * (knots.high - knots.low))
    )
    unit = _unit(law, scale)
    # An inertia or a friction that is multiplied keeps its sign.
    least = -_KEPT if law.carrier.expression == law.place.nominal else -_REACH * unit
    known = _bounded(law.carrier.unit, least, _REACH * unit)
    lines = [f'parameter Real s({known}) = 0.0 "Size, at the largest that was seen";']
    shapes = {}
    if form.shape:
        own = form.unit.format(unit="" if law.influence is None else law.influence.unit)
        powers = form.shape == "n"
        # A zone or a limit is the same to both sides.
        sizes = knots if knots.low >= 0.0 else Knots(0.0, largest)
        values = form.values if powers else _rounded(sizes, form.values)
        low, high = (0.1, 6.0) if powers else (min(values) / 20.0, 2.0 * sizes.high)
        shapes = {form.shape: values}
        given = _bounded(own, low, high)
        lines.append(f'parameter Real {form.shape}({given}) = {number(values[0])} "Of its form";')
    return LawClass(
        name=_name(law, form),
        about=f"{MARK}: {law.text}: {form.text}",
        place=law.place,
        declarations=(*lines, *declared),
        equations=equations,
        change=f"{law.carrier.expression}*s*({expression})",
        annotation=effect(("s",), _MATTERS * unit, law.place.slot.name, shapes),
    )


def _rounded(knots: Knots, shares: tuple[float, ...]) -> tuple[float, ...]:
    values = knots.low + np.array(shares) * (knots.high - knots.low)
    return tuple(float(f"{value:.3g}") for value in values)
