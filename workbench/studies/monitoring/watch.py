"""Which quantities are watched, and the pass over all recordings in the order of their dates.

Of quantities that are alike, the entries of one array, each is watched against the others: what
moves all of them, from recording to recording, is no change of one. Their mean is watched, too.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.studies.monitoring.chart import LARGEST, Chart, LevelChange, Scatter, threshold
from workbench.studies.monitoring.estimate import reach
from workbench.system.parts import EstimatedQuantity

_FEWEST = 3  # of an array: of two, nothing tells which has moved
_OBSERVED = 0.5  # share of the variance before a recording that it must take away
_ROUNDS = 64  # at most; each halves what wild entries do to each other, as half are wild at most


@dataclass(frozen=True, eq=False)
class Track:
    """One watched quantity over all recordings."""

    name: str  # of the quantity, or of the array for the mean of its entries
    unit: str  # SI
    label: str  # for people
    against: bool  # whether it is taken relative to the others of its array
    # values, deviations: (n,) estimates of the recordings, and standard deviations as stated: by
    # the noise of the sensors and the usual scatter; NaN where a recording does not show it
    values: Vector
    deviations: Vector
    surprises: Vector  # (n,) standard deviations off its past, NaN without one
    changes: tuple[LevelChange, ...]  # of its level
    level: tuple[float, float]  # mean since the last change, and its standard deviation
    trend: tuple[float, float]  # by recording since then, and its standard deviation
    scatter: float  # ratio of the variance about the past to the stated one

    @property
    def scale(self) -> float:
        """Of stated deviations: the scatter about the past, where that is more than stated."""
        return float(np.sqrt(max(1.0, np.nan_to_num(self.scatter, nan=1.0))))


@dataclass(eq=False)
class _Group:
    """Quantities that are alike, and directions in which they are watched."""

    name: str
    members: tuple[EstimatedQuantity, ...]
    columns: list[int]  # (m,) of them in an estimate
    # (k, m) entries against the others, then their mean; of a single quantity, itself
    directions: Matrix = field(init=False)
    charts: list[Chart] = field(init=False)
    known: Vector = field(init=False)  # (k,) variance before a recording
    # (m,) variance from recording to recording of a sound machine
    usual: Vector = field(init=False)
    # (m,) by which entries are off their first level, since they changed
    moved: Vector = field(init=False)
    rows: list[tuple[Vector, Vector, Vector]] = field(default_factory=list)

    def __post_init__(self) -> None:
        m = len(self.members)
        self.directions = np.ones((1, 1))
        scatters = [Scatter(1.0)]
        if m > 1:
            against = (np.eye(m) * m - 1.0) / (m - 1.0)
            self.directions = np.vstack([against, np.full((1, m), 1.0 / m)])
            scatters = [Scatter((m - 1.0) / m)] * m + scatters
        self.charts = [Chart(scatter) for scatter in scatters]
        self.usual = np.array([member.scatter**2 for member in self.members])
        self.moved = np.zeros(m)
        before = np.array([reach(member) ** 2 for member in self.members])
        self.known = np.square(self.directions) @ before

    @property
    def against(self) -> bool:
        """Whether there are others."""
        return len(self.members) > 1

    def take(self, number: int, values: Vector, covariance: Matrix, level: float) -> None:
        """Take the estimates of one recording, (m,) and (m, m)."""
        noise = np.diag(self.directions @ covariance @ self.directions.T)
        spread = noise + np.square(self.directions) @ self.usual
        shown = noise < (1.0 - _OBSERVED) * self.known
        watched, surprises, squares = self._compare(values, spread, shown)
        self.rows.append((watched, np.where(shown, np.sqrt(spread), np.nan), surprises))
        for k in np.flatnonzero(np.isfinite(squares)):
            self.charts[k].scatter.add(squares[k])
        for k in np.flatnonzero(shown):
            self.charts[k].add(number, watched[k], spread[k], surprises[k])
        for k in np.flatnonzero(shown):
            if self.charts[k].raised(level):
                self.charts[k].part()
            if self.against and k < len(self.members) and self.charts[k].changes:
                self.moved[k] = self.charts[k].level[0] - self.charts[k].changes[0].before[0]

    def _compare(
        self, values: Vector, spread: Vector, shown: NDArray[np.bool_]
    ) -> tuple[Vector, Vector, Vector]:
        """Estimates by direction, how far they are off their past, and that squared, (k,) each.

        An entry that has moved, once told, is no news of the others, nor is more of a wild entry
        than chance makes.
        """
        m, away = len(self.members), self.moved.copy()
        wild: list[int] = []
        for _ in range(_ROUNDS):
            watched = self.directions @ (values - away)
            if self.against:
                watched[:-1] += away
            surprises, squares = np.array(
                [
                    self.charts[k].surprise(watched[k], spread[k]) if shown[k] else (np.nan, np.nan)
                    for k in range(len(self.charts))
                ]
            ).T
            before = away.copy()
            for k in wild:  # what others that are wild did to it has changed
                bound = self.charts[k].bounded(watched[k], spread[k], surprises[k])
                away[k] = self.moved[k] + watched[k] - bound
            size = np.abs(surprises[:m])
            size[wild] = np.nan
            # Of more than half, nobody could tell which are wild.
            if self.against and np.nanmax(size, initial=0.0) > LARGEST and len(wild) < m // 2:
                wild.append(int(np.nanargmax(size)))
            elif np.allclose(away, before, rtol=0.0, atol=1e-3 * np.sqrt(spread.min())):
                break
        return np.where(shown, watched, np.nan), surprises, squares

    def tracks(self) -> list[Track]:
        """Each direction over all recordings."""
        values, deviations, surprises = (
            np.array(column).T for column in zip(*self.rows, strict=True)
        )
        names = [(member.name, member.label, self.against) for member in self.members]
        if self.against:
            names.append((self.name, f"mean of {self.members[0].label} and the like", False))
        return [
            Track(
                name=name,
                unit=self.members[0].unit,
                label=label,
                against=against,
                values=values[k],
                deviations=deviations[k],
                surprises=surprises[k],
                changes=tuple(self.charts[k].changes),
                level=self.charts[k].level,
                trend=self.charts[k].trend,
                scatter=self.charts[k].scatter.variance,
            )
            for k, (name, label, against) in enumerate(names)
        ]


def grouped_quantities(estimated: Sequence[EstimatedQuantity]) -> list[_Group]:
    """Entries of one array together, where there are enough; all others alone."""
    arrays: dict[str, list[int]] = {}
    for column, quantity in enumerate(estimated):
        arrays.setdefault(re.sub(r"\[\d+\]$", "", quantity.name), []).append(column)
    groups = []
    for name, columns in arrays.items():
        alike = [columns] if len(columns) >= _FEWEST else [[column] for column in columns]
        for own in alike:
            members = tuple(estimated[column] for column in own)
            groups.append(_Group(name if len(own) > 1 else members[0].name, members, own))
    return groups


def watch(
    estimated: Sequence[EstimatedQuantity],
    values: Matrix,
    covariances: Sequence[Matrix],
    rate: float,
) -> tuple[list[Track], float]:
    """Watch all quantities over recordings in their order.

    Parameters
    ----------
    values : (n, q) of the recordings; covariances : (q, q) of each.
    rate : alarms per recording that a sound machine may raise, all quantities together.

    Returns
    -------
    tracks : of what is watched.
    level : threshold of the sums; rates of quantities add (Bonferroni).
    """
    groups = grouped_quantities(estimated)
    level = threshold(rate / sum(len(group.charts) for group in groups))
    for number, (row, covariance) in enumerate(zip(values, covariances, strict=True)):
        for group in groups:
            group.take(
                number, row[group.columns], covariance[np.ix_(group.columns, group.columns)], level
            )
    return [track for group in groups for track in group.tracks()], level
