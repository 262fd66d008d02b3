"""Free functions of one quantity: cubic B-splines whose coefficients are a smooth process.

Coefficients c ~ N(0, v K), K_ij = exp(-((i - j)/l)^2/2) in units of the distance of knots. Size and
length are those under which the data are likeliest. Source: C. E. Rasmussen, C. K. I. Williams
(2006), Gaussian Processes for Machine Learning, sections 2.7 (finite bases) and 5.4 (marginal
likelihood); S. N. Wood (2017), Generalized Additive Models, 2nd ed., section 5.8 (the same as a
penalty).
"""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Matrix, Vector

COEFFICIENTS = 10
"""Of one function: seven intervals, of which a bend takes one."""
_LENGTHS = (0.7, 1.5, 3.0, 6.0)  # distances of knots: from a bend at each to nearly straight
APART = (1e-3,)
"""Of coefficients none of which is like the next."""
_VARIANCES = np.logspace(-3.0, 7.0, 41)  # over that which the data just show
_JITTER = 1e-6  # of the covariance, so that it has an inverse


@dataclass(frozen=True)
class Knots:
    """Where a function lives: constant beyond its ends."""

    # low, high: ends
    low: float
    high: float

    @property
    def step(self) -> float:
        """Distance of knots."""
        return (self.high - self.low) / (COEFFICIENTS - 3)

    def basis(self, values: Vector) -> Matrix:
        """Basis functions at values (n,), (n, COEFFICIENTS)."""
        x = np.clip((values - self.low) / self.step, 0.0, COEFFICIENTS - 3)
        away = np.abs(x[:, None] - (np.arange(COEFFICIENTS) - 1.0))
        penalty: Matrix = (
            np.maximum(0.0, 2.0 - away) ** 3 - 4.0 * np.maximum(0.0, 1.0 - away) ** 3
        ) / 6.0
        return penalty


@dataclass(frozen=True, eq=False)
class Smoothness:
    """What is known of coefficients beforehand, and what the data say of that."""

    evidence: float  # log of the marginal likelihood, over that of no function
    covariance: Matrix  # (K, K) of the coefficients beforehand
    coefficients: Vector  # (K,) the likeliest
    posterior: Matrix  # (K, K) their covariance


def kernel(length: float, count: int = COEFFICIENTS) -> Matrix:
    """Correlation of coefficients, (count, count)."""
    at = np.arange(count)
    covariance: Matrix = np.exp(-0.5 * ((at[:, None] - at) / length) ** 2) + _JITTER * np.eye(count)
    return covariance


def smoothest(
    N: Matrix, g: Vector, lengths: tuple[float, ...] = _LENGTHS, most: float = np.inf
) -> Smoothness:
    """Size and length under which the data are likeliest.

    Parameters
    ----------
    N, g : chi-squared is c'N c + 2 g'c + constant; other unknowns are eliminated.
    lengths : that are tried; `APART` of coefficients that do not follow each other.
    most : standard deviation beforehand, at most.

    Notes
    -----
    With c = L z, L L' = v K, the evidence is -log det(I + L'N L)/2 + g'L (I + L'N L)^-1 L'g/2
    (Rasmussen & Williams 2006, equation 2.30, by the matrix inversion lemma).
    """
    best: tuple[float, Matrix] | None = None
    count = g.size
    for length in lengths if count > 1 else APART:
        K = kernel(length, count)
        root = np.linalg.cholesky(K)
        values, vectors = np.linalg.eigh(root.T @ N @ root)
        values = np.maximum(values, 0.0)
        squares = (vectors.T @ (root.T @ g)) ** 2
        for variance in np.minimum(_VARIANCES / max(values.max(), 1e-300), most**2):
            spread = 1.0 + variance * values
            evidence = 0.5 * float((variance * squares / spread - np.log(spread)).sum())
            if best is None or evidence > best[0]:
                best = evidence, variance * K
    assert best is not None
    posterior = np.linalg.inv(N + np.linalg.inv(best[1]))
    return Smoothness(best[0], best[1], -posterior @ g, posterior)
