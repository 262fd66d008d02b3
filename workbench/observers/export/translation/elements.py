"""Elements, rows and pieces of arrays in C."""

from collections.abc import Sequence
from typing import TypeAlias

from workbench.observers.export.translation.values import (
    INT,
    Array,
    Number,
    Value,
    expression,
    number,
)

Piece: TypeAlias = tuple[Value | None, Value | None]  # first element, and that after the last one


def sizes_of(array: Value) -> tuple[Value, ...]:
    """Sizes of an array, for each axis."""
    assert isinstance(array.type, Array)
    return array.sizes


def element(index: Value, size: Value) -> str:
    """An index as C takes it: from the end where Python's is negative."""
    if index.known is not None:
        known = int(index.known)
        if known < 0 and size.known is not None:
            return str(known + int(size.known))
        if known >= 0:
            return str(known)
    return index.text if index.natural else f"python_index({index.text}, {size.text})"


def view(array: Value, indices: Sequence[Value | Piece]) -> Value:
    """An element of an array, or the part that some indices leave."""
    type_ = array.type
    assert isinstance(type_, Array)
    terms = [array.offset] if array.offset else []
    sizes: list[Value] = []
    strides: list[int] = []
    for axis, stride in enumerate(type_.strides):
        size = array.sizes[axis]
        if axis >= len(indices):
            sizes.append(size)
            strides.append(stride)
            continue
        index = indices[axis]
        if isinstance(index, tuple):
            first, size = _piece(index, size)
            sizes.append(size)
            strides.append(stride)
        else:
            first = element(index, size)
        if first != "0":
            terms.append(_times(first, stride))
    offset = " + ".join(terms)
    if len(terms) == 1 and offset.startswith("("):
        offset = offset[1:-1]
    if not sizes:
        return Value(Number(type_.kind), f"{array.text}[{offset or '0'}]", reads=not type_.constant)
    shape = tuple(int(size.known) if size.known is not None else None for size in sizes)
    left = Array(type_.kind, shape, tuple(strides), type_.constant)
    return Value(left, array.text, offset=offset, sizes=tuple(sizes))


def _times(index: str, stride: int) -> str:
    if stride == 1:
        return index if index.isidentifier() or index.isdigit() else f"({index})"
    if index.isdigit():
        return str(int(index) * stride)
    return f"{stride} * {index}" if index.isidentifier() else f"{stride} * ({index})"


def _piece(piece: Piece, size: Value) -> tuple[str, Value]:
    """First element of a slice, and its size."""
    first, last = (
        _end(end, size, instead) for end, instead in zip(piece, (number(0), size), strict=True)
    )
    if first.known is not None and last.known is not None:
        return first.text, number(max(int(last.known - first.known), 0))
    if first.known == 0:
        return "0", last
    return first.text, expression(INT, f"python_length({first.text}, {last.text})", natural=True)


def _end(end: Value | None, size: Value, instead: Value) -> Value:
    if end is None:
        return instead
    if end.known is not None and size.known is not None:
        known, count = int(end.known), int(size.known)
        return number(min(max(known + count if known < 0 else known, 0), count))
    if end.known == 0:
        return end
    return expression(INT, f"python_end({end.text}, {size.text})", natural=True)
