"""Arrays of numbers by their shape."""

import math
from collections.abc import Mapping
from functools import cache
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Tensor = NDArray[np.float64]

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
    for name, hint in _declared(record).items():
        if name not in given:
            array, shape = get_args(hint)
            (dtype,) = get_args(get_args(array)[1])
            given[name] = np.zeros([_length(text, sizes) for text in shape.split(",")], dtype)
    return record(**given)


@cache
def _declared(record: Any) -> dict[str, Any]:
    """Fields of a record as declared; to read them takes longer than a short loop runs."""
    return get_type_hints(record, include_extras=True)


def _length(text: str, sizes: Mapping[str, int]) -> int:
    """A sum of products of numbers and letters."""
    return sum(
        math.prod(sizes[part] if part in sizes else int(part) for part in term.strip().split("*"))
        for term in text.strip().split("+")
    )
