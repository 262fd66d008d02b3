"""Blocks of unknowns that only unknowns which they share couple, and how a model has them."""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from workbench.models.fmu import FMU, References
from workbench.observers.layout import Layout
from workbench.system.system import System

# An approximation must be worth it: operations of blocks, of those of all unknowns at once.
_WORTH = 0.5

Indices = NDArray[np.intp]


class Blocks(NamedTuple):
    """States and estimated quantities (unknowns of a filter) by blocks, the shared ones last."""

    # (N + 2,) where in `order` block i begins; the shared unknowns begin at first[N]
    first: Indices
    states: Indices  # (N + 1,) how many of them are states, which come first
    order: Indices  # (n + q,) number of an unknown among states and quantities
    # (N, k) value references of the rates of a block's states, then of the shared ones
    rates: References
    home: Indices  # (l,) block of each output that is fed; N: it depends on shared unknowns alone
    place: Indices  # (l,) where in `order` an output that is a state stands, -1: it is none


def blocks(fmu: FMU, system: System, layout: Layout) -> Blocks:
    """Divide the unknowns of a model by its model structure; one block if that says nothing.

    What an output that is no state depends on stays in one block.
    """
    n, dependencies = len(fmu.states), fmu.description.dependencies
    names = [*fmu.states, *system.corrections]
    number = {name: i for i, name in enumerate(names)}

    def knowns(name: str) -> list[int]:
        return [number[state] for state in dependencies.get(name, names) if state in number]

    rates = [knowns(name) for name in fmu.description.rates]
    fed = {j: knowns(output.name) for j, output in enumerate(system.outputs) if layout.seen[j] < 0}
    links = [(i, k) for i, row in enumerate(rates) for k in row]
    links += [(len(names) + j, k) for j, row in enumerate(fed.values()) for k in row]
    blocks, shared = divide(n, len(names), len(fed), links)
    parts = [*blocks, shared]
    order = np.array([k for part in parts for k in part], np.intp)
    block = {k: i for i, part in enumerate(parts) for k in part}
    where = {int(k): i for i, k in enumerate(order)}
    states = [sum(k < n for k in part) for part in parts]
    asked = [
        [k for k in part[:count] + shared[: states[-1]]]
        for part, count in zip(blocks, states, strict=False)
    ]
    references = np.zeros((len(blocks), max(map(len, asked), default=0)), np.uint32)
    for i, row in enumerate(asked):
        references[i, : len(row)] = fmu.rate_references[row]
    return Blocks(
        first=np.array([0, *accumulate(map(len, parts))], np.intp),
        states=np.array(states, np.intp),
        order=order,
        rates=references,
        home=np.array(
            [
                min((block[k] for k in fed[j]), default=len(blocks)) if j in fed else block[int(at)]
                for j, at in enumerate(layout.seen)
            ],
            np.intp,
        ),
        place=np.array([where[int(at)] if at >= 0 else -1 for at in layout.seen], np.intp),
    )


def divide(
    states: int, size: int, others: int, links: Iterable[tuple[int, int]]
) -> tuple[list[list[int]], list[int]]:
    """Like blocks of `size` unknowns, and those that they share, so that operations are few.

    One unknown after the other is shared, the one with most neighbours first. A block of m unknowns
    beside s shared ones takes (m + s)^3 operations. All are one block unless that saves half.

    Parameters
    ----------
    states : how many of the unknowns are states, the first ones.
    others : nodes beyond the unknowns which keep those together that they are linked with.
    links : pairs of nodes.
    """

    def shape(block: Sequence[int]) -> tuple[int, int]:
        return sum(k < states for k in block), len(block)

    adjacent = np.zeros((size + others, size + others), bool)
    for a, b in links:
        adjacent[a, b] = adjacent[b, a] = a != b
    left, shared = np.ones(size + others, bool), list[int]()
    fewest, best = _WORTH * size**3, ([list(range(size))], list[int]())
    while len(shared) < size - 1 and (len(shared) + 1) ** 3 < fewest:
        neighbours = np.where(left, adjacent[:, left].sum(axis=1), -1)
        shared.append(int(neighbours[:size].argmax()))
        left[shared[-1]] = False
        nodes = np.flatnonzero(left)
        components = _components(adjacent[np.ix_(nodes, nodes)], nodes, size)
        # Few unlike ones are shared: what stands between blocks is known of like ones.
        most = Counter(map(shape, components)).most_common(1)[0][0]
        alike = [block for block in components if shape(block) == most]
        border = shared + [k for block in components if shape(block) != most for k in block]
        operations = sum((len(block) + len(border)) ** 3 for block in alike)
        if operations < fewest:
            fewest, best = operations, (alike, sorted(border))
    return best


def _components(adjacent: NDArray[np.bool_], nodes: Indices, size: int) -> list[list[int]]:
    """Sets of nodes below `size` that are linked with each other, through any nodes."""
    _, label = connected_components(adjacent, directed=False)
    members: dict[int, list[int]] = {}
    for node, part in zip(nodes, label, strict=True):
        if node < size:
            members.setdefault(int(part), []).append(int(node))
    return list(members.values())


def widths(parts: Blocks) -> tuple[int, int]:
    """Most unknowns and most states that a block has."""
    sizes: Sequence[int] = np.diff(parts.first)[:-1].tolist()
    return max(sizes, default=0), max(parts.states[:-1].tolist(), default=0)
