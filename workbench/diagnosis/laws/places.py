"""Where a law may act, and what it may depend on: outputs of slots, and what is present there."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.effects.slots import Slot
from workbench.errors import InputError
from workbench.models.modelica import Library
from workbench.models.modelica.classes import Component
from workbench.models.native import compiled
from workbench.system.units import check_unit, quotient

CLOCK = "clock"  # of a generated class [s]
LOST = "lost"  # of a generated class: time constant with which heat is lost [s]
_LOSES = (10.0, 3.0, 1.0)  # such time constants, by the longest recording: a tenth goes, to most
_THERE = 0.02  # share of its largest size from which on an input is there
_VARIES = 1e-3  # share of its size by which a quantity has to vary, to be an influence


@dataclass(frozen=True)
class Quantity:
    """An input or output of a slot."""

    name: str
    unit: str  # empty where the library does not say
    text: str


@dataclass(frozen=True)
class Place:
    """An output of a slot."""

    slot: Slot
    text: str  # what the slot is, for people
    output: Quantity
    inputs: tuple[Quantity, ...]  # of the slot

    @property
    def name(self) -> str:
        """Of a class that acts here.

        One name in the whole model: slot and output.
        """
        return "".join(part[0].upper() + part[1:] for part in (self.slot.name, self.output.name))

    @property
    def nominal(self) -> str:
        """Expression of the output as it is without a law, in a generated class."""
        if self.slot.chained:
            return self.slot.inputs[self.slot.outputs.index(self.output.name)]
        return f"unchanged.{self.output.name}"

    def own(self, name: str) -> str:
        """A name for what a generated class declares, which its slot does not have."""
        taken = {*self.slot.inputs, *self.slot.outputs, *self.slot.counts, *self.slot.handed}
        while name in taken:
            name += "_"
        return name

    def at(self, watched: Mapping[str, Vector], name: str) -> Vector:
        """An input or output along a recording."""
        return watched[f"{self.slot.name}.{name}"]


@dataclass(frozen=True)
class LawInfluence:
    """What a law may depend on."""

    # "value", "size" or "rate" of an input, "time", "since", the time for which an input has been
    # there, "work", the integral of the size of a power, or "turn", that of the size of an input,
    # or time, over and over again
    kind: str
    # inputs, and an output that is a coefficient, whose product it is
    factors: tuple[Quantity, ...] = ()
    # [s] over which a rate is taken; time constant with which work is lost, 0 if it is kept; period
    # of what turns; size [unit] above which an input is there
    span: float = 0.0

    @property
    def name(self) -> str:
        """Part of a Modelica name."""
        parts = (self.kind, *(factor.name for factor in self.factors))
        return "".join(part[0].upper() + part[1:] for part in parts)

    @property
    def cools(self) -> bool:
        """Whether it is heat that is lost again."""
        return self.kind == "work" and self.span > 0.0

    @property
    def turns(self) -> bool:
        """Whether it begins anew with each period, with a phase of its own in each recording."""
        return self.kind == "turn"

    @property
    def unit(self) -> str:
        """Its unit, empty where it is not known."""
        if self.kind in ("time", "since") or (self.turns and not self.factors):
            return "s"
        if self.turns:
            return quotient(self.factors[0].unit, "Hz")
        if self.kind == "rate" and self.factors[0].unit:
            return quotient(self.factors[0].unit, "s")
        return "J" if self.kind == "work" else self.factors[0].unit

    @property
    def text(self) -> str:
        """What it is, for people."""
        if self.kind == "time":
            return "time since the beginning"
        if self.turns:
            clock = f"the way of {self.factors[0].name}" if self.factors else "time"
            own = f" ({self.factors[0].text})" if self.factors else ""
            return f"{clock}{own}, with a period of {self.span:.4g} {self.unit}"
        if self.kind == "since":
            return f"the time since {self.factors[0].name} ({self.factors[0].text}) began"
        product = " x ".join(f"{factor.name} ({factor.text})" for factor in self.factors)
        before = {"size": "the size of ", "rate": "the rate of ", "work": "heat, the work of "}
        lost = f", lost with a time constant of {self.span:g} s" if self.cools else ""
        return before.get(self.kind, "") + product + lost

    @property
    def short(self) -> str:
        """What it is, by names."""
        if self.kind == "time":
            return "time"
        if self.turns:
            return f"turns of {self.factors[0].name}" if self.factors else "turns in time"
        product = "*".join(factor.name for factor in self.factors)
        if self.kind == "size":
            return f"|{product}|"
        before = {"rate": "rate of ", "work": "heat of ", "since": "time since "}
        return before.get(self.kind, "") + product

    @property
    def expression(self) -> str:
        """In a generated class."""
        match self.kind:
            case "value":
                return self.factors[0].name
            case "size":
                return f"noEvent(abs({self.factors[0].name}))"
            case "rate":
                return self.rate
        return CLOCK

    @property
    def rate(self) -> str:
        """Of `CLOCK`, as an expression; empty where it is not needed."""
        if self.kind == "time" or (self.turns and not self.factors):
            return "1.0"
        if self.turns:
            return f"noEvent(abs({self.factors[0].name}))"
        if self.kind == "since":
            return f"tanh(noEvent(abs({self.factors[0].name}))/{self.span!r})"
        if self.kind == "rate":
            return f"({self.factors[0].name} - {CLOCK})/{self.span!r}"
        if self.kind == "work":
            power = f"noEvent(abs({'*'.join(factor.name for factor in self.factors)}))"
            return f"{power} - {CLOCK}/{LOST}" if self.cools else power
        return ""

    def course(self, place: Place, watched: Mapping[str, Vector], time: Vector) -> Vector:
        """Its values along a recording, (n,)."""
        if self.kind == "time" or not self.factors:
            since: Vector = time - time[0]
            return since
        product: Vector = np.prod(
            [place.at(watched, factor.name) for factor in self.factors], axis=0
        )
        if self.kind == "value":
            return product
        if self.kind == "size":
            return np.abs(product)
        if self.kind == "rate":
            slope: Vector = (product - _followed(product, time, self.span)) / self.span
            return slope
        power = np.abs(product)  # or a speed
        if self.kind == "since":
            power = np.tanh(power / self.span)
        if self.cools:
            return self.span * _followed(power, time, self.span)
        done: Vector = np.append(0.0, np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(time)))
        return done


def _followed(course: Vector, time: Vector, span: float) -> Vector:
    """What follows a course, from zero, with a time constant [s], (n,)."""
    late = np.zeros_like(course)
    _follow(course, np.exp(-np.diff(time) / span), late)
    return late


@compiled
def _follow(course, shares, late):  # type: ignore[no-untyped-def]
    """Fill late (n,): late' = m + share (late - m), m the mean of two samples of the course."""
    for k in range(shares.size):
        middle = 0.5 * (course[k] + course[k + 1])
        late[k + 1] = middle + shares[k] * (late[k] - middle)


@dataclass(frozen=True)
class Carrier:
    """What a function is multiplied by before it is added to an output."""

    expression: str  # in a generated class; "1.0" of what is added as it is
    unit: str  # of the function
    text: str  # for people, as "multiplies flow" or "adds to flow"

    def course(self, place: Place, watched: Mapping[str, Vector]) -> Vector:
        """Its values along a recording, (n,)."""
        output = place.at(watched, place.output.name)
        if self.expression == "1.0":
            return np.ones_like(output)
        return output if self.expression == place.nominal else place.at(watched, self.expression)


@dataclass(frozen=True)
class Law:
    """Something that acts at a place and depends on something."""

    place: Place
    carrier: Carrier
    influence: LawInfluence | None  # None for a constant

    @property
    def short(self) -> str:
        """Where it acts and on what it depends, by their names."""
        where = f"{self.place.slot.name}.{self.place.output.name}"
        return f"{where} by {'itself' if self.influence is None else self.influence.short}"

    @property
    def text(self) -> str:
        """What it is, for people."""
        action = f"something that {self.carrier.text}, {self.place.text}"
        if self.influence is None:
            return f"{action}, whatever else happens"
        return f"{action}, and depends on {self.influence.text}"


def places(library: Library, base: str, slots: Sequence[Slot]) -> Iterator[Place]:
    """Outputs of the slots of a model, where a law can be written.

    A slot of several elements, or whose nominal class has parameters of its own in the base model,
    is left out.
    """
    model = library.components(library.find(base).name)
    for slot in slots:
        if slot.counts or not (slot.chained or slot.settled):
            continue
        parts, bindings = library.components(slot.partial), model[slot.name].modifier.inner
        inputs = []
        for name in slot.inputs:
            known = _quantity(library, parts[name])
            if not known.unit and name in bindings:
                known = replace(known, unit=_unit_of(library, model, bindings[name].value))
            inputs.append(known)
        for output in slot.outputs:
            text = _lower(model[slot.name].description or slot.name)
            yield Place(slot, text, _quantity(library, parts[output]), tuple(inputs))


def _lower(text: str) -> str:
    return text if text[1:2].isupper() else text[:1].lower() + text[1:]


def _quantity(library: Library, component: Component) -> Quantity:
    text = _lower(component.description or component.name)
    return Quantity(component.name, _known_unit(library, component), text)


def _known_unit(library: Library, component: Component) -> str:
    """Unit of a component; empty where the library does not say, as of a type of any speed."""
    unit = library.unit(component)
    try:
        check_unit(unit, component.where)
    except InputError:
        return ""
    return unit


def _unit_of(library: Library, model: Mapping[str, Component], expression: str) -> str:
    """Unit of what an input is bound to, `w` or `motor.w`; empty of any other expression."""
    first, *path = expression.strip().split(".")
    component = model.get(first)
    for name in path:
        if component is None:
            break
        of = library.resolve(component.type, component.owner)
        component = library.components(of).get(name) if of in library.classes else None
    return "" if component is None else _known_unit(library, component)


def laws(
    place: Place, recordings: Sequence[tuple[Vector, Mapping[str, Vector]]], span: float
) -> Iterator[Law]:
    """All laws at a place that the recordings can show.

    Parameters
    ----------
    recordings : times and what is watched, of the nominal model.
    span : [s] over which rates are taken.
    """
    every = [watched for _, watched in recordings]
    longest = max(float(np.ptp(time)) for time, _ in recordings)
    able: list[LawInfluence | None] = [None]
    for influence in _influences(place, every, span, longest):
        if _varies([influence.course(place, watched, time) for time, watched in recordings]):
            able.append(influence)
    for carrier in _carriers(place, every):
        yield from (Law(place, carrier, influence) for influence in able)


def turning(place: Place) -> Iterator[LawInfluence]:
    """What may begin anew with each period, which is not known yet: time, what inputs turn."""
    yield LawInfluence("turn")
    for variable in place.inputs:
        if variable.unit and quotient(variable.unit, "Hz") in ("m", "rad"):
            yield LawInfluence("turn", (variable,))


def turning_laws(
    place: Place, recordings: Sequence[tuple[Vector, Mapping[str, Vector]]], influence: LawInfluence
) -> Iterator[Law]:
    """Laws that begin anew with each period of an influence; `recordings` as of `laws`."""
    for carrier in _carriers(place, [watched for _, watched in recordings]):
        yield Law(place, carrier, influence)


def _varies(recordings: Sequence[Vector]) -> bool:
    """Whether something varies within any recording: between them, tolerances do."""
    size = max(float(np.abs(recording).max()) for recording in recordings)
    return any(np.ptp(recording) > _VARIES * size for recording in recordings)


def _carriers(place: Place, recordings: Sequence[Mapping[str, Vector]]) -> Iterator[Carrier]:
    output = place.output
    values = [place.at(recording, output.name) for recording in recordings]
    target = f"{output.name} ({output.text})"
    if any(np.any(value) for value in values):
        yield Carrier(place.nominal, "1", f"multiplies {target}")
    if _varies(values) or not any(np.any(value) for value in values):
        yield Carrier("1.0", output.unit, f"adds to {target}")
    for variable in place.inputs:
        passes = place.slot.chained and variable.name == place.nominal
        own = [place.at(watched, variable.name) for watched in recordings]
        if output.unit and variable.unit == output.unit and not passes and _varies(own):
            yield Carrier(
                variable.name, "1", f"adds a share of {variable.name} ({variable.text}) to {target}"
            )


def _influences(
    place: Place, recordings: Sequence[Mapping[str, Vector]], span: float, longest: float
) -> Iterator[LawInfluence]:
    for variable in place.inputs:
        own = [place.at(watched, variable.name) for watched in recordings]
        values = np.concatenate(own)
        both = values.min() < -0.1 * values.max() and values.max() > -0.1 * values.min()
        yield LawInfluence("value", (variable,))
        if both:
            yield LawInfluence("size", (variable,))
        if _varies(own):
            yield LawInfluence("rate", (variable,), span)
        there = _THERE * float(np.abs(values).max())
        if max(abs(float(course[0])) for course in own) < there:
            yield LawInfluence("since", (variable,), float(f"{there:.2g}"))
    yield LawInfluence("time")
    known = [variable for variable in place.inputs if variable.unit not in ("", "1")]
    for count in (2, 3):
        for group in combinations(known, count):
            product = ".".join(f"({variable.unit})" for variable in group)
            if quotient(product, "W") in ("1", "rad"):
                # What has no unit is the coefficient of that power, such as one of friction.
                factors = (*group, place.output) if place.output.unit == "1" else group
                yield LawInfluence("work", factors)
                for times in _LOSES:
                    yield LawInfluence("work", factors, float(f"{times * longest:.2g}"))
