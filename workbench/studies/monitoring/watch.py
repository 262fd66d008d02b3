"""Which quantities are watched, and the pass over all recordings in the order of their dates.

Of quantities that are alike, the entries of one array, each is watched against the others: what
moves all of them, from recording to recording, is no change of one. Their mean is watched, too.

Each estimate is compared with what its own past predicts, in standard deviations that the past
tells, too: by that neither level nor scatter must be known before. Sums of what is left over raise
alarms, at a stated rate of false ones.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import gammaincinv, ndtr, ndtri, stdtr, stdtrit

from workbench.arrays import Matrix, Vector
from workbench.studies.monitoring.estimate import reach
from workbench.system.parts import EstimatedQuantity

ALLOWANCE = 0.5
"""Standard deviations of one estimate by which a mean may be off: the test is the fastest for a
move of twice that. E. S. Page (1954), Biometrika 41, 100-115."""
LARGEST = 3.0
"""Standard deviations that one estimate counts as at most: a single wild one raises no alarm.
D. M. Hawkins (1993), J. Quality Technology 25, 248-261."""
SURE = 0.95  # probability, that of a range
_CELLS = 100  # of the chain; twice as many change run lengths by less than 1 %
_REACH = (0.01, 20.0)  # of thresholds; beyond the last, an alarm in 10^8 estimates


@cache
def threshold(rate: float) -> float:
    """Threshold of the sums at which a sound quantity raises alarms at this rate, up or down.

    Parameters
    ----------
    rate : alarms per estimate, the inverse of the mean number between them.

    Notes
    -----
    While one of the two sums is high the other is zero, and their rates add: D. M. Hawkins,
    D. H. Olwell (1998), Cumulative Sum Charts and Charting for Quality Improvement, chapter 3.
    """
    wanted = np.log(2.0 / rate)

    def excess(level: float) -> float:
        return float(np.log(run_length(level)) - wanted)

    least, most = _REACH
    return least if excess(least) > 0.0 else float(brentq(excess, least, most, xtol=1e-4))


def run_length(level: float, largest: float = LARGEST) -> float:
    """Mean number of sound estimates until a one-sided sum exceeds a level.

    Between zero and the level, the sum is a Markov chain of cells.
    Source: D. Brook, D. A. Evans (1972), Biometrika 59, 539-549.

    Parameters
    ----------
    largest : standard deviations that one estimate counts as at most.

    Examples
    --------
    336 for 4 and 930 for 5, by the table of J. M. Lucas, R. B. Crosier (1982), Technometrics 24,
    199-205:

    >>> [round(run_length(level, largest=np.inf), -1) for level in (4.0, 5.0)]
    [340.0, 930.0]
    """
    width = 2.0 * level / (2 * _CELLS - 1)
    middles = width * np.arange(_CELLS)
    step = middles[None, :] - middles[:, None] + ALLOWANCE

    def below(value: Matrix) -> Matrix:
        """Probability that an estimate counts as less."""
        inside: Matrix = np.where(value > -largest, ndtr(value), 0.0)
        return np.where(value > largest, 1.0, inside)

    chain = below(step + 0.5 * width) - below(step - 0.5 * width)
    chain[:, 0] = below(step + 0.5 * width)[:, 0]  # no sum is below zero
    return float(np.linalg.solve(np.eye(_CELLS) - chain, np.ones(_CELLS))[0])


@dataclass
class Scatter:
    """Variance of estimates about their past, over the stated one, pooled over like quantities."""

    # of a like quantity that is independent, where all are taken relative to each other
    share: float
    squares: float = 0.0
    freedom: float = 0.0

    @property
    def variance(self) -> float:
        """Ratio of the variances; NaN before the past tells one."""
        return self.squares / self.freedom if self.freedom >= 1.0 else np.nan

    @property
    def largest(self) -> float:
        """How far off an estimate may be by chance, in units of its stated deviation; or NaN."""
        if self.freedom < 1.0:
            return np.nan
        return float(stdtrit(self.freedom, float(ndtr(LARGEST))) * np.sqrt(self.variance))

    def add(self, square: float) -> None:
        """Add how far an estimate is off its past, squared, in units of its stated variance.

        An estimate far off counts as the largest that chance makes: a quantity that moves is not to
        hide the move of another, nor its own.
        """
        if square > LARGEST**2 * self.variance:  # never so without a past
            square = min(square, self.largest**2)
        self.squares += self.share * square
        self.freedom += self.share


@dataclass(frozen=True)
class LevelChange:
    """A change of level."""

    raised: int  # number of the recording at which it was told
    last: int  # number of the last recording before it
    # earliest, latest: likewise, of the 95 % range
    earliest: int
    latest: int
    # whether it leads back to the level before the last change, and so takes that back
    returns: bool
    # before, after: levels, and their standard deviations
    before: tuple[float, float]
    after: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """After minus before, and its standard deviation."""
        return self.after[0] - self.before[0], float(np.hypot(self.before[1], self.after[1]))


@dataclass
class Chart:
    """The past of one quantity since its last change."""

    scatter: Scatter  # of it, and of those like it
    # numbers, values, variances: of recordings, their estimates, and stated variances
    numbers: list[int] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    variances: list[float] = field(default_factory=list)
    # estimates as they count in the level: a wild one no more than chance makes
    kept: list[float] = field(default_factory=list)
    # up, down: sums
    up: float = 0.0
    down: float = 0.0
    changes: list[LevelChange] = field(default_factory=list)  # in their order

    @property
    def level(self) -> tuple[float, float]:
        """Mean since the last change, and its standard deviation; NaN before there is any."""
        if not self.kept:
            return np.nan, np.nan
        weight = 1.0 / np.array(self.variances)
        mean = float(weight @ np.array(self.kept) / weight.sum())
        return mean, float(np.sqrt(self.scatter.variance / weight.sum()))

    @property
    def trend(self) -> tuple[float, float]:
        """Slope by recording since the last change, and its standard deviation; NaN of one."""
        if len(self.values) < 2:
            return np.nan, np.nan
        weight, numbers = 1.0 / np.array(self.variances), np.array(self.numbers, np.float64)
        away = numbers - weight @ numbers / weight.sum()
        lever = float(weight @ away**2)
        slope = float(weight * away @ np.array(self.kept) / lever)
        return slope, float(np.sqrt(self.scatter.variance / lever))

    def surprise(self, value: float, variance: float) -> tuple[float, float]:
        """How far an estimate is off its past.

        In standard deviations, exactly normal and independent of each other while nothing changes,
        for the scatter is that of the same past: D. M. Hawkins (1987), The Statistician 36,
        299-316; and squared, in units of the stated variance. NaN without a past.
        """
        if not self.values:
            return np.nan, np.nan
        off = (value - self.level[0]) / self._deviation(variance)
        # The smaller tail, which rounding does not cut off.
        tail = stdtr(self.scatter.freedom, -abs(off) / np.sqrt(self.scatter.variance))
        return float(np.copysign(ndtri(tail), off)), float(off**2)

    def add(self, number: int, value: float, variance: float, surprise: float) -> None:
        """Add an estimate, and how far it is off its past in standard deviations."""
        if np.isfinite(surprise):
            counted = float(np.clip(surprise, -LARGEST, LARGEST))
            self.up = max(0.0, self.up + counted - ALLOWANCE)
            self.down = max(0.0, self.down - counted - ALLOWANCE)
        self.kept.append(self.bounded(value, variance, surprise))
        self.numbers.append(number)
        self.values.append(value)
        self.variances.append(variance)

    def bounded(self, value: float, variance: float, surprise: float) -> float:
        """The estimate, or as far off the level as chance makes."""
        if not abs(surprise) > LARGEST:
            return value
        reach, level = self.scatter.largest * self._deviation(variance), self.level[0]
        return float(np.clip(value, level - reach, level + reach))

    def _deviation(self, variance: float) -> float:
        """Deviation of an estimate from the level, as stated."""
        return float(np.sqrt(variance + 1.0 / np.sum(1.0 / np.array(self.variances))))

    def raised(self, level: float) -> bool:
        """Whether a sum exceeds the threshold."""
        return max(self.up, self.down) > level

    def part(self) -> LevelChange:
        """Part the past where its level most likely changed; what follows is the past from now on.

        By the ratio of likelihoods: D. V. Hinkley (1970), Biometrika 57, 1-17.
        """
        kept, weight = np.array(self.kept), 1.0 / np.array(self.variances)
        gain = _gains(kept, weight) / self.scatter.variance
        first = int(np.argmax(gain)) + 1  # of those after it
        likely = np.flatnonzero(gain > gain.max() - 2.0 * gammaincinv(0.5, SURE))
        before = Chart(self.scatter, kept=self.kept[:first], variances=self.variances[:first])
        last, earliest, latest = (
            self.numbers[k] for k in (first - 1, int(likely[0]), int(likely[-1]))
        )
        raised = self.numbers[-1]
        self.numbers, self.values = self.numbers[first:], self.values[first:]
        self.variances, self.up, self.down = self.variances[first:], 0.0, 0.0
        self.kept = self._bounded_since_change(before.level[0])
        change = LevelChange(
            raised, last, earliest, latest, self._returns(), before.level, self.level
        )
        self.changes.append(change)
        return change

    def _bounded_since_change(self, old: float) -> list[float]:
        """Estimates since a change as they count: what was wild for the old level may be the new.

        The new level is about where half of them have moved less, and half more; of two, the one
        that moved less.
        """
        values = sorted(self.values, key=lambda value: abs(value - old))
        about, largest = values[(len(values) - 1) // 2], self.scatter.largest
        reach = largest * np.sqrt(self.variances)
        return [float(value) for value in np.clip(self.values, about - reach, about + reach)]

    def _returns(self) -> bool:
        """Whether the level is what it was before the last change, as far as is known."""
        if not self.changes:
            return False
        (old, doubt), (new, own) = self.changes[-1].before, self.level
        return bool(abs(new - old) < -ndtri(0.5 * (1.0 - SURE)) * np.hypot(doubt, own))


def _gains(values: Vector, weight: Vector) -> Vector:
    """By how much chi-squared falls with another level from each estimate but the first on."""
    sums, weights = np.cumsum(weight * values), np.cumsum(weight)
    left, after = weights[:-1], weights[-1] - weights[:-1]
    step = sums[:-1] / left - (sums[-1] - sums[:-1]) / after
    gains: Vector = step**2 / (1.0 / left + 1.0 / after)
    return gains


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
