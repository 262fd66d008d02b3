"""Arrays of numbers by their shape."""

import math
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Tensor = NDArray[np.float64]

_Length = tuple[tuple[str, ...], ...]  # terms of a sum, each of factors
_Record = TypeVar("_Record", bound=tuple[Any, ...])


def zeros(record: type[_Record], sizes: Mapping[str, int], **given: Any) -> _Record:
    """Make a record whose arrays are zero, of the shapes that its fields declare.

    Parameters
    ----------
    record : named tuple; a field says its shape as `Annotated[Matrix, "n, 2*s + 1"]`.
    sizes : of the letters in shapes.
    given : fields that begin with something else, or are no arrays.

    Examples
    --------
    >>> from typing import Annotated, NamedTuple
    >>> class State(NamedTuple):
    ...     x: Annotated[Vector, "n"]
    ...     P: Annotated[Matrix, "n, 2*n + 1"]
    >>> zeros(State, {"n": 1})
    State(x=array([0.]), P=array([[0., 0., 0.]]))
    """
    for name, (shape, dtype) in _declared(record).items():
        if name not in given:
            given[name] = np.zeros([_length(terms, sizes) for terms in shape], dtype)
    return record(**given)


@cache
def _declared(record: Any) -> dict[str, tuple[tuple[_Length, ...], Any]]:
    """Shapes and types of the fields that declare one; to read them takes longer than a loop."""
    declared = {}
    for name, hint in get_type_hints(record, include_extras=True).items():
        if get_origin(hint) is Annotated:
            array, shape = get_args(hint)
            (dtype,) = get_args(get_args(array)[1])
            declared[name] = tuple(_terms(length) for length in shape.split(",")), dtype
    return declared


def _terms(length: str) -> _Length:
    """Factors of the terms of a length, as ((2, s), (1,)) of "2*s + 1"."""
    return tuple(
        tuple(factor.strip() for factor in term.split("*")) for term in length.strip().split("+")
    )


def _length(terms: _Length, sizes: Mapping[str, int]) -> int:
    """A sum of products of numbers and letters."""
    return sum(
        math.prod(sizes[part] if part in sizes else int(part) for part in factors)
        for factors in terms
    )
