"""What is tuned of an estimator, as a named vector, and where it is sought."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.system.units import quotient


@dataclass(frozen=True, eq=False)
class Gains:
    """Gains of one estimator.

    Attributes
    ----------
    estimator : its name.
    names : (n,) of the gains.
    values : (n,) in units that the estimator says.
    design : constants of the design that are not tuned, by name.
    source : where the values come from, for people.
    """

    estimator: str
    names: tuple[str, ...]
    values: Vector
    design: Mapping[str, Vector]
    source: str

    def __getitem__(self, name: str) -> float:
        """One gain by name."""
        return float(self.values[self.names.index(name)])

    def with_values(self, values: Vector, source: str = "") -> "Gains":
        """The same gains with other values, (n,)."""
        return replace(self, values=np.array(values, float), source=source or self.source)

    def summary(self) -> dict[str, object]:
        """The same as plain numbers and lists."""
        gains = dict(zip(self.names, self.values.tolist(), strict=True))
        design = {name: values.tolist() for name, values in self.design.items()}
        return {**gains, **design, "source": self.source}


def matrix_names(name: str, rows: int, columns: int) -> tuple[str, ...]:
    """Names of the entries of a matrix, row by row.

    >>> matrix_names("L", 1, 2)
    ('L11', 'L12')
    """
    # From ten rows or columns on, L111 could be read in two ways.
    mark = "_" if max(rows, columns) > 9 else ""
    return tuple(f"{name}{i + 1}{mark}{j + 1}" for i in range(rows) for j in range(columns))


def feedback_meanings(
    rows: Mapping[str, str], columns: Mapping[str, str]
) -> dict[str, tuple[str, str]]:
    """What entries of L do, by their names, and their units.

    Parameters
    ----------
    rows : what is corrected, with units.
    columns : outputs that correct it, with units; those of their integrals follow.
    """
    corrections = [(f"{name}", unit) for name, unit in columns.items()]
    integrals = [(f"∫ {name}", f"({unit}).s") for name, unit in columns.items()]
    names = matrix_names("L", len(rows), 2 * len(columns))
    meanings = [
        (f"{row} by {column}", quotient(own, unit))
        for row, own in rows.items()
        for column, unit in (*corrections, *integrals)
    ]
    return dict(zip(names, meanings, strict=True))


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """Coordinates in 0..1 for gains of any size and sign.

    A gain is smallest * sinh(s * asinh(largest / smallest)): proportional to s where it is too
    small to matter, logarithmic beyond, of either sign.
    """

    # smallest, largest: (n,) magnitudes between which a gain matters
    smallest: Vector
    largest: Vector
    # lower, upper: (n,) range of s: -1..1 for both signs
    lower: Vector
    upper: Vector
    start: Vector  # (n,) coordinates of the reasoned gains

    def gains(self, coordinates: Vector) -> Vector:
        """Gains (..., n) at coordinates (..., n)."""
        s = self.lower + coordinates * (self.upper - self.lower)
        return np.asarray(self.smallest * np.sinh(s * np.arcsinh(self.largest / self.smallest)))

    def coordinates(self, gains: Vector) -> Vector:
        """Coordinates (..., n) of gains (..., n)."""
        s = np.arcsinh(gains / self.smallest) / np.arcsinh(self.largest / self.smallest)
        return np.asarray((s - self.lower) / (self.upper - self.lower))

    def at_bound(self, coordinates: Vector) -> Vector:
        """Which gains, (n,) of bool, ended within 1 % of a bound."""
        return np.asarray((coordinates < 0.01) | (coordinates > 0.99))

    def starting_at(self, values: Vector) -> "SearchSpace":
        """The same space, begun at gains (n,)."""
        return replace(self, start=np.clip(self.coordinates(values), 0.0, 1.0))


def feedback_space(
    orders: Matrix, effects: Matrix, slowest: float, fastest: float, values: Vector
) -> SearchSpace:
    """Bounds of feedback gains that follow from the loops they close.

    By itself a gain L closes a loop of angular frequency w of some order r through an effect e,
    w^r = e L. It matters from the slowest w that a recording shows to the fastest that its samples
    carry.

    Parameters
    ----------
    orders, effects : of the loop of each gain, flattened to (n,).
    slowest, fastest : angular frequencies [rad/s].
    values : (n,) where the search begins.
    """
    order, effect = orders.ravel(), effects.ravel()
    ones = np.ones(order.size)
    space = SearchSpace(
        slowest**order / effect, fastest**order / effect, -ones, ones, np.zeros(order.size)
    )
    return space.starting_at(values)


def noise_space(values: Vector, reach: float) -> SearchSpace:
    """Bounds of noise levels: from 1/reach to reach times what they are thought to be."""
    smallest, largest = values / reach, values * reach
    # From the smallest level on: a filter without noise has no gain.
    lower = np.arcsinh(1.0) / np.arcsinh(largest / smallest)
    space = SearchSpace(smallest, largest, lower, np.ones(values.size), np.zeros(values.size))
    return space.starting_at(values)
