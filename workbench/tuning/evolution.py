"""Differential evolution, one generation at a time: SciPy's algorithm as a map of a population.

SciPy's `differential_evolution` cannot be stopped, stored and resumed to the same bits through its
public functions; this module makes the same draws in the same order, and walks the same path.
Source: R. Storn, K. Price (1997), Differential Evolution, J. Global Optimization 11, best1bin with
dither and deferred updating, as in SciPy 1.17.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.fmu import Matrix, Vector

DITHER = (0.5, 1.0)  # range of the differential weight, drawn anew each generation (SciPy)
CROSSOVER = 0.7  # probability that a coordinate comes from the mutant (SciPy)


@dataclass(frozen=True, eq=False)
class Population:
    """Candidates of one generation; the best is the first.

    Attributes
    ----------
    members : (s, n) coordinates in 0..1.
    z : (s,) objective of each.
    z_k : (s, k) objective of each in each case.
    order : (s,) permutation from which partners are drawn; part of the state of the algorithm.
    """

    members: Matrix
    z: Vector
    z_k: Matrix
    order: NDArray[np.intp]


def latin_hypercube(size: int, lower: Vector, upper: Vector, rng: np.random.Generator) -> Matrix:
    """Spread candidates evenly over the box lower..upper; returns (size, n)."""
    n = lower.size
    samples = rng.uniform(size=(size, n)) / size
    samples += np.linspace(0.0, 1.0, size, endpoint=False)[:, np.newaxis]
    columns = [samples[rng.permutation(size), j] for j in range(n)]
    return lower + np.column_stack(columns) * (upper - lower)


def first(members: Matrix, z: Vector, z_k: Matrix) -> Population:
    """The population of generation 0."""
    return _best_first(Population(members, z, z_k, np.arange(z.size)))


def propose(population: Population, rng: np.random.Generator) -> tuple[Matrix, NDArray[np.intp]]:
    """Trials (s, n), one for each member, and the permutation after drawing them."""
    members, order = population.members, population.order.copy()
    size, n = members.shape
    weight = rng.uniform(*DITHER)
    partners = np.empty((size, 2), np.intp)
    for i in range(size):
        rng.shuffle(order)
        head = order[:6]
        partners[i] = head[head != i][:2]
    mutants = members[0] + weight * (members[partners[:, 0]] - members[partners[:, 1]])
    forced = rng.integers(n, size=size)
    crossed = rng.uniform(size=(size, n)) < CROSSOVER
    crossed[np.arange(size), forced] = True
    trials = np.where(crossed, mutants, members)
    outside = (trials > 1.0) | (trials < 0.0)
    trials[outside] = rng.uniform(size=int(outside.sum()))
    return trials, order


def select(
    population: Population, trials: Matrix, z: Vector, z_k: Matrix, order: NDArray[np.intp]
) -> Population:
    """The next generation: a trial takes its parent's place if it is no worse."""
    accepted = z <= population.z
    return _best_first(
        Population(
            np.where(accepted[:, np.newaxis], trials, population.members),
            np.where(accepted, z, population.z),
            np.where(accepted[:, np.newaxis], z_k, population.z_k),
            order,
        )
    )


def has_converged(population: Population, tolerance: float) -> bool:
    """Whether the standard deviation of z has fallen below a share of its mean."""
    z = population.z
    return bool(np.isfinite(z).all() and np.std(z) <= tolerance * abs(np.mean(z)))


def _best_first(population: Population) -> Population:
    """Swap the best with the first."""
    swap = np.arange(population.z.size)
    best = int(np.argmin(population.z))
    swap[[0, best]] = swap[[best, 0]]
    return Population(
        population.members[swap], population.z[swap], population.z_k[swap], population.order
    )
