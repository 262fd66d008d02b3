"""The physical effects that a Modelica library holds, each a class that describes itself.

An effect is a class with `annotation(__Workbench(effect(...)))`. It says there what neither its
code nor its description does: how large it must be to matter, and where stops can show it. Units,
bounds and defaults are those of its parameters; which slots it fills follows from the partial class
that it extends.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis.effects.slots import Slot, read_slots
from workbench.errors import InputError, require_known, unknown_name
from workbench.models.modelica import Class, Library

# --- what a class says of itself ---


@dataclass(frozen=True)
class AnnotationReader:
    """Part of an annotation, whose keys are asked for by type."""

    where: str  # it stands
    content: Mapping[str, Any]  # by key

    def only(self, *known: str) -> None:
        """Refuse other keys."""
        require_known(
            self.content,
            known,
            where=self.where,
            expected="some of {}",
            remedy="correct or remove it",
        )

    def text(self, key: str, default: str | None = None) -> str:
        """A text, which may be left out if there is a default."""
        return str(self._of(key, str, "a text in quotes", default))

    def number(self, key: str) -> float:
        """A number above 0."""
        value = float(self._of(key, float, "a number above 0", None))
        if value <= 0.0:
            raise self._wrong(key, "a number above 0")
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        """An array of texts."""
        return self._array(key, str, 'an array of texts, such as {"a", "b"}')

    def numbers(self, key: str) -> tuple[float, ...]:
        """An array of numbers, of which none is zero: a fit changes them by shares."""
        expected = "an array of numbers that are not 0, such as {0.5, 1.0}"
        values = self._array(key, float, expected)
        if 0.0 in values:
            raise self._wrong(key, expected)
        return values

    def part(self, key: str) -> "AnnotationReader":
        """What stands in its parentheses."""
        content = self._of(key, dict, f"{key}(...)", None)
        return AnnotationReader(f"{self.where}({key})", content)

    def _array(self, key: str, of: type, expected: str) -> tuple[Any, ...]:
        values = tuple(self._of(key, tuple, expected, None))
        if not all(isinstance(value, of) for value in values):
            raise self._wrong(key, expected)
        return values

    def _of(self, key: str, type_: type, expected: str, default: Any) -> Any:
        value = self.content.get(key, default)
        if not isinstance(value, type_):
            raise self._wrong(key, expected)
        return value

    def _wrong(self, key: str, expected: str) -> InputError:
        value = self.content.get(key)
        return InputError(
            where=self.where,
            found=f"no '{key}'" if value is None else f"{key} = {value!r}",
            expected=expected,
            remedy=f"give '{key}' in the annotation of the class",
        )


# --- effects ---


_TURNING = ("cosine", "sine")
_ARRAY = re.compile(r"zeros\((\w+)\)")


@dataclass(frozen=True)
class Where:
    """An effect is only in stops whose conditions say so, if those of any stop do."""

    condition: str  # of the stops: a state, or several
    state: str  # that the effect needs
    share: str  # parameter that is the share of those which have this state; empty if there is none


@dataclass(frozen=True)
class Unless:
    """An effect is not looked for if the conditions of any stop say something."""

    # condition, state: as of `Where`
    condition: str
    state: str
    because: str  # why, for people


@dataclass(frozen=True)
class Falling:
    """An effect shows only where an input falls, by more than a tenth of its greatest value."""

    signal: str  # input of the base model
    because: str  # why the effect cannot be seen where it does not, for people


@dataclass(frozen=True)
class Effect:
    """One effect of the library."""

    name: str  # of the Modelica class, also used in results; with its place where there are several
    model: str  # dotted name of the class
    slots: tuple[str, ...]  # of the base model that the class is plugged into
    # parameter that is zero in the nominal model; of an order-locked effect, which has the pair
    # `cosine` and `sine`, "cosine"
    size: str
    # least size worth a finding, in its SI unit: what tolerances, or differences between an
    # observer model and a real machine, may fake
    matters: float
    text: str  # what it is, for people
    separation: str  # the experiment that tells it from its likely twins
    # other parameters that are fitted once the effect is found, each with values to try
    shapes: tuple[tuple[str, tuple[float, ...]], ...] = ()
    hidden: str = ""  # why recorded stops cannot show the effect; empty if they can
    # where, unless, falling: which stops can show it; None if all can
    where: Where | None = None
    unless: Unless | None = None
    falling: Falling | None = None
    # why stops in which no state is restarted cannot show it; empty if they can
    restarted: str = ""
    # place, places: which of how many elements of `size`, from 1; 0 where it is no array
    place: int = 0
    places: int = 0
    # measured signals of the logger that is late; the effect is then none of a model
    late: tuple[str, ...] = ()
    sensor: str = ""  # measured signal whose sensor is wrong; the effect is then none of a model
    parameter: str = ""  # of the model itself, whose value is another one by the size
    told: float = 0.0  # size that readings tell without a fit, which then begins there

    @property
    def of_library(self) -> bool:
        """Whether a class of the library adds it to the model."""
        return not (self.late or self.sensor or self.parameter)

    @property
    def class_name(self) -> str:
        """Name of the Modelica class, without a place."""
        return self.model.rpartition(".")[2]

    @property
    def order_locked(self) -> bool:
        """Whether the effect turns with a shaft, with a phase of its own in each stop."""
        return self.size == _TURNING[0]

    @property
    def precision(self) -> Matrix:
        """Inverse covariance of its sizes as known beforehand; empty where nothing is."""
        return np.zeros((0, 0))

    @property
    def sizes(self) -> tuple[str, ...]:
        """Parameters that are zero in the nominal model."""
        return _TURNING if self.order_locked else (self.size,)

    @property
    def label(self) -> str:
        """Name of the size in results."""
        return "amplitude" if self.order_locked else self.size


def read_effects(library: Library, base: str) -> tuple[Effect, ...]:
    """Effects of a library, in its order; those of libraries that it uses are not among them.

    Of effects that nothing in the data tells apart the usual one stands first. Where the order of
    `package.order` does not serve that, `after="Other"` puts an effect right behind the other one.

    Parameters
    ----------
    base : name of the model whose slots they fill.

    Raises
    ------
    InputError
        If an effect fills no slot of the base model, lacks what it must say or says something else,
        or is not nominal by default.
    """
    slots = read_slots(library, base)
    effects: dict[str, Effect] = {}
    after: dict[str, str] = {}
    for cls in library.classes.values():
        if not cls.name.startswith(f"{library.name}."):
            continue
        annotation = AnnotationReader(f"{cls.where}, __Workbench", cls.vendor)
        annotation.only("effect")
        if "effect" not in cls.vendor:
            continue
        entry = annotation.part("effect")
        effect = _read(library, slots, cls, entry)
        if effect.name in effects:
            raise InputError(
                where=cls.where,
                found=f"a second effect {effect.name}",
                expected=f"one, which is {effects[effect.name].model}",
                remedy="rename one of the two",
            )
        effects[effect.name] = effect
        if other := entry.text("after", ""):
            after[effect.name] = other
    ordered = [effects[name] for name in _ordered(library, list(effects), after)]
    return tuple(placed for effect in ordered for placed in _placed(library, effect))


def choose(names: Sequence[str], effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Effects by name, in their order; all of them if none is named."""
    known = dict.fromkeys(name for effect in effects for name in (effect.class_name, effect.name))
    require_known(
        names,
        known,
        where="--effects {}".format,
        found="no effect of this name",
        expected="some of {}",
    )
    return tuple(
        effect for effect in effects if not names or {effect.name, effect.class_name} & set(names)
    )


def _placed(library: Library, effect: Effect) -> list[Effect]:
    """An effect whose size is an array, `zeros(n)`, in each of its places."""
    components = library.components(effect.model)
    array = _ARRAY.fullmatch(components[effect.size].modifier.value)
    if array is None:
        return [effect]
    if effect.shapes:
        raise InputError(
            where=components[effect.size].where,
            found=f"shapes of {effect.name}, which has a size for each place",
            expected="none: one shape would have to serve all places",
            remedy="remove them, or make each place an effect of its own",
        )
    count = components[array[1]].modifier.value if array[1] in components else array[1]
    if not count.isdigit():
        raise InputError(
            where=components[effect.size].where,
            found=f"{effect.size} = zeros({array[1]})",
            expected=f"'parameter Integer {array[1]} = 8', a number of places",
            remedy="give the class that number",
        )
    names = [(place, f"{effect.name}[{place}]") for place in range(1, int(count) + 1)]
    return [replace(effect, name=name, place=k, places=int(count)) for k, name in names]


def _read(library: Library, slots: Sequence[Slot], cls: Class, entry: AnnotationReader) -> Effect:
    entry.only(
        *("size", "matters", "shapes", "separation", "hidden", "slots", "after"),
        *("where", "unless", "falling", "restarted"),
    )
    size = entry.content.get("size")
    if isinstance(size, tuple) and sorted(size) == sorted(_TURNING):
        size = _TURNING[0]
    else:
        size = entry.text("size")
    shapes = (
        entry.part("shapes") if "shapes" in entry.content else AnnotationReader(entry.where, {})
    )
    where = _texts(entry, "where", "condition", "is", "share")
    unless = _texts(entry, "unless", "condition", "is", "because")
    falling = _texts(entry, "falling", "signal", "because")
    effect = Effect(
        name=cls.name.rpartition(".")[2],
        model=cls.name,
        slots=_slots(library, slots, cls, entry),
        size=size,
        matters=entry.number("matters"),
        text=_within_sentence(cls.description),
        separation=entry.text("separation"),
        shapes=tuple((name, shapes.numbers(name)) for name in shapes.content),
        hidden=entry.text("hidden", ""),
        where=Where(*where) if where else None,
        unless=Unless(*unless) if unless else None,
        falling=Falling(*falling) if falling else None,
        restarted="".join(_texts(entry, "restarted", "because")),
    )
    _check_parameters(library, cls, effect)
    _check_extends(library, cls)
    return effect


def _slots(
    library: Library, slots: Sequence[Slot], cls: Class, entry: AnnotationReader
) -> tuple[str, ...]:
    extended = library.ancestors(cls.name)
    # A class that adds inputs to the partial class of a slot is for one that has them.
    parts = library.components(cls.name).items()
    asked = {name for name, part in parts if "input" in part.prefixes and not part.modifier.value}
    fitting = tuple(
        slot.name for slot in slots if slot.partial in extended and asked <= set(slot.inputs)
    )
    if not fitting:
        partials = dict.fromkeys(slot.partial for slot in slots)
        raise InputError(
            where=cls.where,
            found=f"effect {cls.name}, which extends no slot of the base model",
            expected=f"one that extends {' or '.join(partials) or 'a slot, but there is none'}",
            remedy="let it extend the partial class of its slot, or remove its annotation",
        )
    chosen = entry.texts("slots") if "slots" in entry.content else fitting
    require_known(
        chosen,
        fitting,
        where=entry.where,
        found="slot '{}'",
        expected="some of {}, which it fits by the class it extends",
    )
    return tuple(name for name in fitting if name in chosen)


def _texts(entry: AnnotationReader, part: str, *keys: str) -> tuple[str, ...]:
    """Texts of a part of the annotation, in this order; none if it is not there."""
    if part not in entry.content:
        return ()
    inner = entry.part(part)
    inner.only(*keys)
    return tuple(inner.text(key, "" if key == "share" else None) for key in keys)


def _check_extends(library: Library, cls: Class) -> None:
    """Refuse `extends Law(p(max=1) = 0.5)`, of which the compiler takes the value alone."""
    for name in (cls.name, *library.ancestors(cls.name)):
        for base in library.classes[name].extends:
            for key, modifier in base.modifier.inner.items():
                if modifier.value and modifier.inner:
                    raise InputError(
                        where=library.classes[name].where,
                        found=f"{key}(...) = {modifier.value} where it extends {base.name}",
                        expected="a value or attributes, not both",
                        remedy="give the attributes in a class between the two",
                    )


def _check_parameters(library: Library, cls: Class, effect: Effect) -> None:
    """All that the annotation names is a parameter, and a size is zero by default."""
    components = library.components(cls.name)
    parameters = {name: c for name, c in components.items() if "parameter" in c.prefixes}
    shared = (effect.where.share,) if effect.where and effect.where.share else ()
    for name in (*effect.sizes, *(name for name, _ in effect.shapes), *shared):
        if name not in parameters:
            raise unknown_name(
                name,
                parameters,
                where=cls.where,
                found=f"effect {cls.name} without a parameter '{name}'",
                expected=f"one of {', '.join(parameters) or 'its parameters, but it has none'}",
                remedy="correct the annotation, or declare the parameter",
            )
    for name in effect.sizes:
        value = parameters[name].modifier.value
        if value not in ("0", "0.0") and not _ARRAY.fullmatch(value):
            raise InputError(
                where=parameters[name].where,
                found=f"{name} = {value}" if value else f"{name} without a value",
                expected=f"'= 0.0': by default, {cls.name} is the nominal model exactly",
                remedy="let the size of the effect be zero by default",
            )


def _ordered(library: Library, names: list[str], after: Mapping[str, str]) -> list[str]:
    ordered = [name for name in names if name not in after]
    waiting = [name for name in names if name in after]
    while waiting:
        ready = [name for name in waiting if after[name] in ordered]
        if not ready:
            raise unknown_name(
                after[waiting[0]],
                ordered,
                where=f"{library.file}, effect {waiting[0]}",
                found=f'after="{after[waiting[0]]}"',
                expected="another effect, which does not stand after this one",
            )
        ordered.insert(ordered.index(after[ready[0]]) + 1, ready[0])
        waiting.remove(ready[0])
    return ordered


def _within_sentence(description: str) -> str:
    """A description as it is read within a sentence.

    >>> _within_sentence("Pads that lag"), _within_sentence("CO2 in the air")
    ('pads that lag', 'CO2 in the air')
    """
    if description[1:2].isupper():
        return description
    return description[:1].lower() + description[1:]


def variant(effect: Effect, shape: Mapping[str, float]) -> str:
    """Name of a candidate with a shape, such as 'Hysteresis tau=1.4'."""
    return " ".join([effect.name, *(f"{name}={value:g}" for name, value in shape.items())])
