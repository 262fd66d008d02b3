"""Chi-squared as a quadratic form: sums, minima and covariances of least squares."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve
from scipy.linalg.lapack import dpocon, dpotrf

from workbench.arrays import Matrix, Vector

# (effect, parameter), (quantity, choice) of a level, ("", quantity) of what differs by nature.
Key = tuple[str, str]

_ROUNDING = 1e-12  # least eigenvalue of a scaled normal matrix that is not rounding
_SHOWN = 1e-10  # share of the largest from which on the data show what an eigenvalue stands for
_ALONE = 1e-8  # share of what an unknown explains alone, below which others do as well
_CERTAIN = 1e-7  # reciprocal condition far above both, however it is estimated


@dataclass(frozen=True, eq=False)
class Quadratic:
    """Chi-squared of one stop over common unknowns, c + 2 g z + z N z; local ones eliminated."""

    N: Matrix  # (p, p)
    g: Vector  # (p,)
    c: float  # scalar, about the present point
    rows: int  # number of whitened errors

    def at(self, z: Vector) -> float:
        """Chi-squared at a step z, (p,)."""
        return float(self.c + 2.0 * self.g @ z + z @ self.N @ z)

    def columns(self, transform: Matrix) -> "Quadratic":
        """The same for unknowns w with z = transform w, (p, q)."""
        return Quadratic(transform.T @ self.N @ transform, transform.T @ self.g, self.c, self.rows)


def add(parts: Sequence[Quadratic]) -> Quadratic:
    """Sum of chi-squared."""
    return Quadratic(
        np.sum([part.N for part in parts], axis=0),
        np.sum([part.g for part in parts], axis=0),
        sum(part.c for part in parts),
        sum(part.rows for part in parts),
    )


def covariance(N: Matrix) -> Matrix:
    """Inverse of a normal matrix, (p, p); large where the data do not show an unknown."""
    scale, scaled = _scaled(N)
    if (factor := _definite(scaled)) is not None:
        inverse: Matrix = cho_solve(factor, np.eye(len(N)), check_finite=False)
    else:
        values, vectors = np.linalg.eigh(scaled)
        inverse = (vectors / np.maximum(values, _ROUNDING)) @ vectors.T
    return inverse * scale[:, None] * scale[None, :]


def _solved(N: Matrix, right: Matrix) -> Matrix:
    """Solve N x = right; where rounding leaves several solutions, by the least of them."""
    try:
        return np.asarray(np.linalg.solve(N, right), np.float64)
    except np.linalg.LinAlgError:
        scale, scaled = _scaled(N)
        least = np.linalg.lstsq(scaled, (scale * right.T).T, rcond=_ROUNDING)[0]
        solved: Matrix = (scale * least.T).T
        return solved


def _scaled(N: Matrix) -> tuple[Vector, Matrix]:
    """Scale of each unknown, whatever its unit, and what remains of a normal matrix."""
    scale: Vector = 1.0 / np.sqrt(np.maximum(np.diag(N), 1e-100))
    return scale, N * scale[:, None] * scale[None, :]


def _definite(scaled: Matrix) -> tuple[Matrix, bool] | None:
    """Factor of a matrix all of whose unknowns the data show beyond doubt; None of others.

    For those an eigenvalue decomposition tells which; it takes thirty times as long.
    """
    factor, failed = dpotrf(scaled) if scaled.size else (scaled, True)
    if failed:
        return None
    left, _ = dpocon(factor, np.abs(scaled).sum(axis=0).max(initial=0.0))
    return (factor, False) if left > _CERTAIN else None


def beside(N: Matrix, at: Sequence[int]) -> Matrix:
    """Information on all unknowns where some are fitted freely, N - N_a (N_aa)^-1 N_a', (p, p).

    Units of unknowns differ by ten powers of ten: unscaled, the least of them would be rounding.
    """
    scale, scaled = _scaled(N)
    solved = np.linalg.lstsq(scaled[np.ix_(at, at)], scaled[at], rcond=None)[0]
    left: Matrix = (scaled - scaled[:, at] @ solved) / scale[:, None] / scale[None, :]
    return left


def minimum(total: Quadratic) -> Vector:
    """Where chi-squared is least; unknowns that the data do not show stay."""
    scale, scaled = _scaled(total.N)
    if (factor := _definite(scaled)) is not None:
        best: Vector = -scale * cho_solve(factor, scale * total.g, check_finite=False)
        return best
    values, vectors = np.linalg.eigh(scaled)
    kept = values > _SHOWN * values.max(initial=0.0)
    along = vectors[:, kept]
    step: Vector = -scale * (along @ ((along.T @ (scale * total.g)) / values[kept]))
    return step


def minima_of(N: Matrix, g: Vector, sets: NDArray[np.intp]) -> tuple[Matrix, Vector]:
    """Where chi-squared 2 g z + z N z is least over few unknowns, the others zero; its falls.

    Parameters
    ----------
    sets : (k, m) numbers of the unknowns of each set.

    Returns
    -------
    z : (k, m) of each set; the least of them where its unknowns are twins.
    falls : (k,) of chi-squared.
    """
    scale, scaled = _scaled(N)
    own, slopes = scaled[sets[:, :, None], sets[:, None, :]], (scale * g)[sets]
    z = -np.einsum("kij,kj->ki", np.linalg.pinv(own, rcond=_ROUNDING, hermitian=True), slopes)
    falls: Vector = -np.einsum("ki,ki->k", z, slopes)
    return z * scale[sets], falls


def minimum_within(total: Quadratic, low: Vector, high: Vector) -> Vector:
    """Where chi-squared is least within bounds of the step, (p,) each.

    What would leave them is held there, and the others do their best beside that.
    """
    step, free = minimum(total), np.ones(len(low), np.bool_)
    while (beyond := free & ((step < low) | (step > high))).any():
        free &= ~beyond
        step = np.where(free, 0.0, np.clip(step, low, high))
        N, g = total.N[np.ix_(free, free)], (total.g + total.N @ step)[free]
        step[free] = minimum(Quadratic(N, g, 0.0, total.rows))
    return step


@dataclass(frozen=True, eq=False)
class RecordingSystem:
    """Whitened errors of a stop, r + J z + P l, with l ~ N(-prior, 1) where `prior` has entries."""

    r: Vector  # (n,)
    J: Matrix  # (n, p)
    P: Matrix  # (n, q)
    deviations: Vector  # (d,) of the present point, of the first unknowns in l; phases are free
    furthest: Vector  # (q,) from zero, of a deviation or of a step of what is no deviation
    channels: int  # c; r holds the errors of blocks, each by channel, and last those at rest
    # (q,) entries of l that are not free any more; NaN of those that are. None: all are.
    held: Vector | None = None
    rests: int = 1  # number of errors at rest

    @property
    def blocks(self) -> int:
        """Number of errors of blocks."""
        return self.r.size - self.rests

    def errors(self, z: Vector) -> Matrix:
        """Whitened errors of the blocks, (b, c), for a step z of the common unknowns."""
        errors: Matrix = self.r + self.J @ z + self.P @ self.local(z)
        return errors[: self.blocks].reshape(-1, self.channels)

    @property
    def slopes(self) -> Matrix:
        """(b*c, p) derivatives of the errors of blocks by z, where l follows."""
        follows, _ = self.follows()
        slopes: Matrix = (self.J + self.P @ follows)[: self.blocks]
        return slopes

    @property
    def _free(self) -> NDArray[np.bool_]:
        """(q,) Which entries of l are free."""
        return np.ones(self.P.shape[1], np.bool_) if self.held is None else np.isnan(self.held)

    def _about(self) -> tuple[Vector, Vector]:
        """Errors (n,) and deviations (d,) where what is held has its value."""
        if self.held is None:
            return self.r, self.deviations
        moved = np.nan_to_num(self.held)
        return self.r + self.P @ moved, self.deviations + moved[: self.deviations.size]

    def _local(self) -> tuple[Matrix, Matrix, Vector]:
        """Normal matrix of what is free of l, its coupling to z, its gradient."""
        free, (r, deviations) = self._free, self._about()
        P = self.P[:, free]
        prior, away = np.zeros((2, free.size))
        prior[: deviations.size], away[: deviations.size] = 1.0, deviations
        return P.T @ P + np.diag(prior[free] + 1e-9), P.T @ self.J, P.T @ r + away[free]

    def eliminated(self) -> Quadratic:
        """Chi-squared over z alone."""
        normal, coupling, gradient = self._local()
        both = np.column_stack([coupling, gradient])
        solved = _solved(normal, both)
        r, deviations = self._about()
        N: Matrix = self.J.T @ self.J - coupling.T @ solved[:, :-1]
        g: Vector = self.J.T @ r - coupling.T @ solved[:, -1]
        c = r @ r + deviations @ deviations - gradient @ solved[:, -1]
        return Quadratic(N, g, float(c), r.size)

    def local(self, z: Vector) -> Vector:
        """Best l for a step z of the common unknowns."""
        normal, coupling, gradient = self._local()
        step = np.zeros(self.P.shape[1]) if self.held is None else np.nan_to_num(self.held)
        step[self._free] = _solved(normal, -coupling @ z - gradient)
        return step

    def follows(self) -> tuple[Matrix, Matrix]:
        """How l follows z, (q, p), and its covariance about that, (q, q)."""
        normal, coupling, _ = self._local()
        own = _solved(normal, np.eye(len(normal)))
        return -own @ coupling, own

    @property
    def chi_squared(self) -> float:
        """At the point itself, tolerances included."""
        return float(self.r @ self.r + self.deviations @ self.deviations)

    def holding(self, z: Vector) -> "RecordingSystem":
        """The same where entries of l that a step z takes beyond bounds are held there."""
        begun = np.zeros(self.P.shape[1])
        begun[: self.deviations.size] = self.deviations
        step, free = self.local(z), self._free
        beyond = free & (np.abs(begun + step) > self.furthest)
        if not beyond.any():
            return self
        ends = np.clip(begun + step, -self.furthest, self.furthest) - begun
        return replace(self, held=np.where(free & ~beyond, np.nan, np.where(free, ends, step)))

    def moved(self, z: Vector) -> "RecordingSystem":
        """About a step z of the common unknowns, with the best l within bounds."""
        held, more = self, self.holding(z)
        while more is not held:
            held, more = more, more.holding(z)
        step = held.local(z)
        r, deviations = self.r + self.J @ z + self.P @ step, self.deviations
        return replace(self, r=r, deviations=deviations + step[: deviations.size])

    def compressed(self) -> "RecordingSystem":
        """The same chi-squared in as few rows as it has unknowns, which are of no channel."""
        p, q = self.J.shape[1], self.P.shape[1]
        R = np.asarray(np.linalg.qr(np.column_stack([self.J, self.P, self.r]), "r"), np.float64)
        return replace(self, r=R[:, -1], J=R[:, :p], P=R[:, p : p + q], channels=1)


def part_edges(blocks: int, parts: int) -> NDArray[np.intp]:
    """First block of each part of a recording, and the end of the last one, (parts + 1,)."""
    return np.linspace(0, blocks, parts + 1).astype(np.intp)


def _cut(system: RecordingSystem, parts: int) -> tuple[RecordingSystem, ...]:
    """One recording in parts, of blocks that follow each other; the first has errors at rest."""
    edges = part_edges(system.blocks // system.channels, parts) * system.channels
    at_rest = np.arange(system.blocks, system.r.size)
    cut = []
    for first, end in pairwise(edges):
        rows = np.append(np.arange(first, end), at_rest)
        weight = np.ones(rows.size)
        weight[end - first :] = first == 0
        part = (system.r[rows] * weight, system.J[rows] * weight[:, None], system.P[rows])
        given = system.deviations, system.furthest, system.channels
        cut.append(RecordingSystem(*part, *given, rests=system.rests))
    return tuple(cut)


@dataclass(frozen=True, eq=False)
class Joint:
    """All stops over the common unknowns."""

    shared: tuple[Key, ...]  # names of the unknowns
    known: tuple[Key, ...]  # those that the point has; the others are candidates
    levels: tuple[Key, ...]  # those that differ by nature, in no need of a cause
    systems: tuple[RecordingSystem, ...]
    prior: Quadratic

    def apart(self, parts: int) -> "Joint":
        """The same in parts of which each can be held out: recordings, or parts of a single one.

        Nothing differs from recording to recording then, and its own unknowns are common ones.
        """
        if len(self.systems) > 1:
            return self
        (part,) = self.systems
        own = tuple(("", f"own {j}") for j in range(part.P.shape[1]))
        known, extra = len(self.known), self.shared[len(self.known) :]
        J = np.hstack([part.J[:, :known], part.P, part.J[:, known:]])
        at = slice(known, known + part.deviations.size)  # of the new unknowns that have a prior
        N, g = np.zeros((J.shape[1],) * 2), np.zeros(J.shape[1])
        old = np.delete(np.arange(J.shape[1]), range(known, known + len(own)))
        N[np.ix_(old, old)], g[old] = self.prior.N, self.prior.g
        N[at, at], g[at] = np.eye(part.deviations.size), part.deviations
        c = self.prior.c + float(part.deviations @ part.deviations)
        none = np.zeros(0)
        return Joint(
            shared=(*self.known, *own, *extra),
            known=(*self.known, *own),
            levels=(*self.levels, *own),
            systems=_cut(
                replace(part, J=J, P=J[:, :0], deviations=none, furthest=none, held=None), parts
            ),
            prior=Quadratic(N, g, c, 0),
        )

    def joined(self, key: Key, columns: Sequence[Vector]) -> "Joint":
        """The same with a further unknown, by its derivatives in each recording, (n,) each."""
        systems = tuple(
            replace(system, J=np.column_stack([system.J, column]))
            for system, column in zip(self.systems, columns, strict=True)
        )
        N, g = np.pad(self.prior.N, (0, 1)), np.pad(self.prior.g, (0, 1))
        prior = replace(self.prior, N=N, g=g)
        return replace(self, shared=(*self.shared, key), systems=systems, prior=prior)

    @property
    def chi_squared(self) -> float:
        """At the point itself, tolerances and the prior included."""
        return sum(system.chi_squared for system in self.systems) + self.prior.c

    def stops(self) -> list[Quadratic]:
        """Chi-squared of each stop."""
        return [system.eliminated() for system in self.systems]

    def total(self) -> Quadratic:
        """Chi-squared of all stops and the prior."""
        return add([*self.stops(), self.prior])

    def reduced(self, keys: Sequence[Key]) -> tuple[Matrix, Vector]:
        """Normal matrix and gradient of some unknowns, the others at their best."""
        total = self.total()
        own = np.array([key in keys for key in self.shared])
        others = total.N[np.ix_(~own, ~own)]
        both = np.column_stack([total.N[np.ix_(~own, own)], total.g[~own]])
        solved = np.linalg.lstsq(others, both, rcond=None)[0]
        before = np.diag(total.N)[own]
        N = total.N[np.ix_(own, own)] - total.N[np.ix_(own, ~own)] @ solved[:, :-1]
        g = total.g[own] - total.N[np.ix_(own, ~own)] @ solved[:, -1]
        # What the others do as well, but for rounding, the data do not show.
        shown = np.diag(N) > _ALONE * before
        return N * np.outer(shown, shown), g * shown

    def covariance(self) -> Matrix:
        """Of the common unknowns, then of each deviation's mean over all stops, (p + d, p + d)."""
        count = self.systems[0].deviations.size
        follows, own = zip(*(system.follows() for system in self.systems), strict=True)
        mean = np.mean(follows, axis=0)[:count]
        common = covariance(self.total().N)
        both = np.vstack([np.eye(len(common)), mean])
        spread: Matrix = both @ common @ both.T
        spread[len(common) :, len(common) :] += np.mean(own, axis=0)[:count, :count] / len(own)
        return spread

    def solve(self, low: Vector, high: Vector) -> tuple[Vector, list[Vector]]:
        """Best step of the common unknowns, and of the local ones of each stop, within bounds.

        Parameters
        ----------
        low, high : (p,) of the step.
        """
        systems = self.systems
        while True:
            step = minimum_within(replace(self, systems=systems).total(), low, high)
            held = tuple(system.holding(step) for system in systems)
            if held == systems:
                return step, [system.local(step) for system in systems]
            systems = held
