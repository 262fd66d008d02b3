"""What is tuned of an estimator, as a named vector; where it is sought; its file, `gains.toml`."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.system.plugins import find_plugin
from workbench.system.system import System
from workbench.system.tables import LARGEST, read_table, shown
from workbench.system.units import quotient

if TYPE_CHECKING:
    from workbench.observers.contract import Estimator


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
    limits = np.ones(order.size)
    space = SearchSpace(
        slowest**order / effect, fastest**order / effect, -limits, limits, np.zeros(order.size)
    )
    return space.starting_at(values)


def noise_space(values: Vector, reach: float) -> SearchSpace:
    """Bounds of noise levels: from 1/reach to reach times what they are thought to be."""
    smallest, largest = values / reach, values * reach
    # From the smallest level on: a filter without noise has no gain.
    lower = np.arcsinh(1.0) / np.arcsinh(largest / smallest)
    space = SearchSpace(smallest, largest, lower, np.ones(values.size), np.zeros(values.size))
    return space.starting_at(values)


_AGAIN = "take the gains.toml that 'workbench tune' wrote"


def read_gains(path: Path, reasoned: Mapping[str, Gains]) -> Gains:
    """Gains of a file, for the estimator that it names.

    Parameters
    ----------
    reasoned : gains of the estimators that it may be for, by name; their values are not used.
    """
    content = _content(path)
    blank = reasoned[estimator_of(path, reasoned)]
    given = _table(content, "gains", path)
    if missing := [name for name in blank.names if name not in given]:
        raise _wrong(path, f"no {missing[0]} in [gains]", f"the gains {', '.join(blank.names)}")
    if unknown := [name for name in given if name not in blank.names]:
        raise _wrong(path, f"{unknown[0]} in [gains]", f"the gains {', '.join(blank.names)}")
    values = np.array([_number(given[name], name, path) for name in blank.names])
    design = _table(content, "design", path)
    constants = {
        name: _constants(design.get(name), name, len(usual), path)
        for name, usual in blank.design.items()
    }
    source = f"tuned, {path.name}"
    return Gains(blank.estimator, blank.names, values, constants, source)


def estimator_of(path: Path, known: Collection[str]) -> str:
    """Name of the estimator that a file of gains is for, one of those that are known."""
    estimator = _content(path).get("estimator")
    if not isinstance(estimator, str) or estimator not in known:
        raise _wrong(path, f"estimator = {shown(estimator)}", f"one of {', '.join(known)}")
    return estimator


def format_gains(gains: Gains, meaning: str, provenance: Mapping[str, Any]) -> str:
    """The text of a file of gains; numbers have all their digits."""
    values = map(float, gains.values)
    comment = "".join(f"# {line}\n" for line in meaning.splitlines())
    parts = [
        tomli_w.dumps({"estimator": gains.estimator}),
        comment + tomli_w.dumps({"gains": dict(zip(gains.names, values, strict=True))}),
    ]
    if gains.design:
        design = {name: constants.tolist() for name, constants in gains.design.items()}
        parts.append("# constants of the design\n" + tomli_w.dumps({"design": design}))
    return "\n".join([*parts, tomli_w.dumps({"provenance": provenance})])


def usual_gains(estimator: "type[Estimator]", fmu: FMU, system: System) -> Gains:
    """Gains of an estimator where none are given.

    Those that the system's plugin brings serve the model that they were tuned on; another one
    gets gains that follow from its linearisation. The FMU is left at an operating point.
    """
    reasoned = estimator.default_gains(fmu, system)
    name = estimator.tuned_as or estimator.name
    path = tuned_file(system, name)
    if path is None:
        return reasoned
    tuned_on = _content(path).get("provenance", {}).get("fmu", {}).get("model")
    return read_gains(path, {name: reasoned}) if tuned_on == fmu.name else reasoned


def tuned_file(system: System, name: str) -> Path | None:
    """The file of tuned gains that a system's plugin brings for an estimator, if it does."""
    gains = find_plugin(system.plugin).gains
    path = gains / f"{name}.toml" if gains else None
    return path if path and path.exists() else None


def _content(path: Path) -> Mapping[str, Any]:
    return read_table(path, _AGAIN, 'estimator = "NAME"').content


def _table(content: Mapping[str, Any], name: str, path: Path) -> dict[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, dict):
        raise _wrong(path, f"{name} = {shown(table)}", f"a table [{name}]")
    return table


def _constants(given: object, name: str, count: int, path: Path) -> Vector:
    """Constants of the design, which gains are divided by."""
    if isinstance(given, list) and len(given) == count:
        values = np.array([_number(value, name, path) for value in given])
        if values.all():
            return values
    raise _wrong(path, f"{name} = {shown(given)} in [design]", f"{count} numbers other than zero")


def _number(value: object, name: str, path: Path) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _wrong(path, f"{name} = {shown(value)}", "a number")
    if not abs(value) < LARGEST:  # refuses NaN, too
        raise _wrong(path, f"{name} = {shown(value)}", "a finite number")
    return float(value)


def _wrong(path: Path, found: str, expected: str = "a file as the tuning writes it") -> InputError:
    return InputError(where=str(path), found=found, expected=expected, remedy=_AGAIN)
