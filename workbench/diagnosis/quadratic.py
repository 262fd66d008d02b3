"""Chi-squared as a quadratic form: sums, minima and covariances of least squares."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.fmu import Matrix, Vector


@dataclass(frozen=True, eq=False)
class Quadratic:
    """Chi-squared of one stop over the common unknowns, c + 2 g z + z N z; local ones eliminated.

    Attributes
    ----------
    N : (p, p); g : (p,); c : scalar, about the present point.
    rows : number of whitened errors.
    """

    N: Matrix
    g: Vector
    c: float
    rows: int

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
    scale, values, vectors = _spectrum(N)
    inverse: Matrix = (vectors / np.maximum(values, 1e-12)) @ vectors.T
    return inverse * scale[:, None] * scale[None, :]


def _spectrum(N: Matrix) -> tuple[Vector, Vector, Matrix]:
    """Scale of each unknown, whatever its unit; eigenvalues and eigenvectors of what remains."""
    scale: Vector = 1.0 / np.sqrt(np.maximum(np.diag(N), 1e-100))
    values, vectors = np.linalg.eigh(N * scale[:, None] * scale[None, :])
    return scale, values, vectors


def minimum(total: Quadratic) -> Vector:
    """Where chi-squared is least; unknowns that the data do not show stay."""
    scale, values, vectors = _spectrum(total.N)
    kept = values > 1e-10 * values[-1]
    along = vectors[:, kept]
    step: Vector = -scale * (along @ ((along.T @ (scale * total.g)) / values[kept]))
    return step
