"""Types and values of translated Python in C, and settings and memory as structs of them."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from workbench.errors import InputError

INT, DOUBLE, BOOL = "int", "double", "bool"
_C_NUMBER = {INT: "int", DOUBLE: "double", BOOL: "int"}
_BRACKETED = re.compile(r"[(\[][^()\[\]]*[)\]]")
_ATOM = re.compile(r"[\w.]+(->\w+|\.\w+)*")


@dataclass(frozen=True)
class Number:
    """One number; `kind` is INT, DOUBLE or BOOL."""

    kind: str


@dataclass(frozen=True)
class Array:
    """Numbers in memory."""

    kind: str  # of the elements
    shape: tuple[int | None, ...]  # sizes, None where a size is known only as it runs
    strides: tuple[int, ...]  # elements from one index to the next, of each axis
    constant: bool  # whether it is only read


@dataclass(frozen=True)
class Record:
    """A named tuple: a struct of this name, passed by its address."""

    name: str
    fields: "tuple[tuple[str, Type], ...]"
    constant: bool


@dataclass(frozen=True)
class Several:
    """A tuple of records of one type, passed by the address of the first."""

    of: Record
    count: int


@dataclass(frozen=True)
class Results:
    """What a function returns: numbers of these kinds, none or several."""

    kinds: tuple[str, ...]

    @property
    def name(self) -> str:
        """In C."""
        if len(self.kinds) < 2:
            return _C_NUMBER[self.kinds[0]] if self.kinds else "void"
        return "LawResult_" + "".join(kind[0] for kind in self.kinds)

    @property
    def definition(self) -> str:
        """Struct of several numbers."""
        fields = [f"    {_C_NUMBER[kind]} part{k};\n" for k, kind in enumerate(self.kinds)]
        return f"typedef struct {{\n{''.join(fields)}}} {self.name};\n"


Type: TypeAlias = Number | Array | Record | Several | Results


@dataclass(frozen=True)
class Value:
    """An expression of C."""

    type: Type
    text: str  # of it; of an array or record its address
    known: float | None = None  # the number, if it is known now
    offset: str = ""  # of an array, elements from `text` on; empty: none
    sizes: "tuple[Value, ...]" = ()  # of an array, for each axis
    natural: bool = False  # a whole number that is never negative
    reads: bool = False  # depends on memory, which a call may change
    acts: bool = False  # changes memory or the model

    @property
    def kind(self) -> str:
        """Kind of a number."""
        assert isinstance(self.type, Number)
        return self.type.kind

    @property
    def operand(self) -> str:
        """Text that can stand beside an operator."""
        return self.text if _is_atom(self.text) else f"({self.text})"

    @property
    def address(self) -> str:
        """Text that is passed to a function."""
        return f"{self.text} + {self.offset}" if self.offset else self.text

    @property
    def member(self) -> str:
        """Text in front of the name of a field of a record."""
        return f"{self.text[1:]}." if self.text.startswith("&") else f"{self.text}->"


def _is_atom(text: str) -> bool:
    """Whether a text is a name, an element or a call, and not made of several by operators."""
    left, count = text, 1
    while count and not text.startswith("("):
        left, count = _BRACKETED.subn("", left)
    return _ATOM.fullmatch(left) is not None


def number(value: float) -> Value:
    """A constant."""
    kind = BOOL if isinstance(value, bool) else INT if isinstance(value, int) else DOUBLE
    natural = kind != DOUBLE and value >= 0
    return Value(Number(kind), literal(value), known=value, natural=natural)


def literal(value: float) -> str:
    """A constant in C, with all its digits."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return str(int(value)) if isinstance(value, int) else repr(float(value))


def expression(kind: str, text: str, *of: Value, natural: bool = False) -> Value:
    """A number that is made of others."""
    return Value(
        Number(kind),
        text,
        natural=natural,
        reads=any(operand.reads for operand in of),
        acts=any(operand.acts for operand in of),
    )


def common(first: str, second: str) -> str:
    """Kind that holds numbers of both kinds."""
    return first if first == second else DOUBLE if DOUBLE in (first, second) else INT


def declaration(type_: Type, name: str) -> str:
    """Declaration of a name that is not assigned again."""
    if isinstance(type_, Number):
        return f"const {_C_NUMBER[type_.kind]} {name}"
    if isinstance(type_, Array):
        return f"{'const ' * type_.constant}{_C_NUMBER[type_.kind]} *const {name}"
    if isinstance(type_, Results):
        return f"const {type_.name} {name}"
    record = type_.of if isinstance(type_, Several) else type_
    return f"{'const ' * record.constant}{record.name} *const {name}"


def c_number(kind: str) -> str:
    """Type of C of a kind of number."""
    return _C_NUMBER[kind]


def field(record: Value, name: str) -> Value | None:
    """A field of a record; None if it has none of this name."""
    assert isinstance(record.type, Record)
    value = dict(record.type.fields).get(name)
    if value is None:
        return None
    text = f"{record.member}{name_in_c(name)}"
    if isinstance(value, Number):
        return Value(value, text, reads=not record.type.constant)
    if isinstance(value, Array):
        type_ = replace(value, constant=record.type.constant)
        return Value(type_, text, sizes=tuple(number(size or 0) for size in value.shape))
    if isinstance(value, Several):
        return Value(replace(value, of=_as(value.of, record.type.constant)), text)
    assert isinstance(value, Record)
    return Value(_as(value, record.type.constant), f"&{text}")


def _as(record: Record, constant: bool) -> Record:
    return replace(record, constant=constant)


# Words of C that may be names in Python, and what the runtime defines.
_RESERVED = (
    *("auto", "case", "char", "const", "default", "do", "double", "enum", "extern", "float"),
    *("goto", "inline", "int", "long", "register", "restrict", "short", "signed", "sizeof"),
    *("static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile"),
    *("NA", "NP", "NU", "NW", "NX", "NNZ_P", "NNZ_XU"),
)


def name_in_c(name: str) -> str:
    """A Python name, which may be a word of C."""
    return f"{name}_" if name in _RESERVED else name


_LARGEST_INT = 2**31 - 1


class Data:
    """The structs of one translated law."""

    def __init__(self, where: str) -> None:
        self._where = where
        self._structs: dict[tuple[str, tuple[tuple[str, Type], ...]], str] = {}

    def type_of(self, value: Any, place: str) -> Type:
        """Type of a value, as it stands in a record.

        Raises
        ------
        InputError
            If it is nothing that has a fixed size in C.
        """
        if isinstance(value, tuple) and hasattr(value, "_fields"):
            fields = tuple(
                (name, self.type_of(entry, f"{place}.{name}"))
                for name, entry in zip(value._fields, value, strict=True)
            )
            return Record(self._struct(type(value).__name__, fields), fields, constant=False)
        if isinstance(value, tuple):
            return self._several(value, place)
        if isinstance(value, np.ndarray):
            return self._array(value, place)
        if isinstance(value, bool | np.bool_):
            return Number(BOOL)
        if isinstance(value, int | np.integer):
            self._check_whole(value, place)
            return Number(INT)
        if isinstance(value, float | np.floating):
            return Number(DOUBLE)
        raise self._refusal(place, f"{type(value).__name__}, which has no fixed size")

    def _several(self, values: Sequence[Any], place: str) -> Several:
        types = [self.type_of(value, f"{place}[{k}]") for k, value in enumerate(values)]
        if not types or not isinstance(types[0], Record) or len(set(types)) > 1:
            raise self._refusal(place, "a tuple that is not of named tuples of one type")
        return Several(types[0], len(types))

    def _array(self, value: np.ndarray, place: str) -> Array:
        if not value.flags.c_contiguous:
            raise self._refusal(place, "an array that is not contiguous")
        kinds = {"f": DOUBLE, "i": INT, "u": INT, "b": BOOL}
        kind = kinds.get(value.dtype.kind)
        if kind is None or (kind == DOUBLE and value.dtype != np.float64):
            raise self._refusal(place, f"an array of {value.dtype}")
        if kind == INT and value.size:
            self._check_whole(max(int(value.max()), -int(value.min())), place)
        strides = tuple(step // value.itemsize for step in value.strides)
        if value.size == 0:  # whose strides numpy leaves open
            strides = tuple(int(np.prod(value.shape[k + 1 :])) for k in range(value.ndim))
        return Array(kind, value.shape, strides, constant=False)

    def _check_whole(self, value: Any, place: str) -> None:
        if abs(value) > _LARGEST_INT:
            raise self._refusal(place, f"a whole number beyond {_LARGEST_INT}")

    def _refusal(self, place: str, found: str) -> InputError:
        return InputError(
            where=f"{self._where}, {place}",
            found=found,
            expected="named tuples of contiguous arrays of numbers, numbers, and such tuples",
            remedy="give the law these alone, so that it fits into fixed memory",
        )

    def _struct(self, name: str, fields: tuple[tuple[str, Type], ...]) -> str:
        key = name, fields
        if key not in self._structs:
            base, taken = f"Law{name.lstrip('_')}", set(self._structs.values())
            names = [base, *(f"{base}{k}" for k in range(2, len(taken) + 3))]
            self._structs[key] = next(name for name in names if name not in taken)
        return self._structs[key]

    def definitions(self) -> str:
        """All structs, in an order in which C takes them."""
        return "\n".join(
            f"typedef struct {{\n{_fields(fields)}}} {name};\n"
            for (_, fields), name in self._structs.items()
        )


def _fields(fields: tuple[tuple[str, Type], ...]) -> str:
    # A struct of C has a field, and an array an element.
    listed = "".join(f"    {_field(name_in_c(name), type_)};\n" for name, type_ in fields)
    return listed or "    int none;\n"


def _field(name: str, type_: Type) -> str:
    if isinstance(type_, Number):
        return f"{c_number(type_.kind)} {name}"
    if isinstance(type_, Array):
        size = int(np.prod([length or 0 for length in type_.shape]))
        return f"{c_number(type_.kind)} {name}[{max(size, 1)}]"
    if isinstance(type_, Several):
        return f"{type_.of.name} {name}[{type_.count}]"
    return f"{type_.name} {name}"


def contents(value: Any) -> str:
    """Initialiser of a value in C.

    >>> contents((np.array([1.0, np.inf]), 2))
    '{{1.0, INFINITY}, 2}'
    """
    if isinstance(value, tuple):
        return "{" + (", ".join(contents(entry) for entry in value) or "0") + "}"
    if isinstance(value, np.ndarray):
        flat = value.ravel().tolist()
        if not any(number != 0 for number in flat):
            return "{0}"
        return "{" + ", ".join(literal(number) for number in flat) + "}"
    return literal(value.item() if isinstance(value, np.generic) else value)
