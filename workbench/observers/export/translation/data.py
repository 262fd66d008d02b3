"""Settings and memory of a law in C: named tuples to structs and their contents."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.observers.export.translation.values import (
    BOOL,
    DOUBLE,
    INT,
    Array,
    Number,
    Record,
    Several,
    Type,
    c_number,
    literal,
    name_in_c,
)

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
