"""Rivals fitted again to what another model predicts of one experiment, however far they bend."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint
from workbench.diagnosis.inference.quadratic import Joint, Key, RecordingSystem


class Refit(Fit):
    """Least squares of a rival against the response of a true model, without noise.

    Recordings so far go on counting, as their derivatives have them.

    Parameters
    ----------
    fit : of the one recording.
    begun : the rival as it was fitted, about the experiment's own start.
    true : whitened errors of the true model, (n,).
    so_far : the recordings so far, over the rival's common unknowns.
    """

    def __init__(
        self, fit: Fit, begun: LinearizedPoint, true: Vector, so_far: RecordingSystem
    ) -> None:
        self.__dict__.update(vars(fit))
        self._begun, self._true, self._so_far = begun, true, so_far

    def quadratics(self, lin: LinearizedPoint, extra: Sequence[Key] = ()) -> Joint:
        """As of `Fit`: away from the true model, and from where the rival began."""
        joint = super().quadratics(lin, extra)
        (one,), begun = joint.systems, self._begun.point
        deviations = one.deviations - begun.deviations[0]
        system = replace(one, r=one.r - self._true, deviations=deviations)
        now, then = ({**point.sizes, **point.levels} for point in (lin.point, begun))
        z = np.array([now[key] - then[key] for key in joint.shared])
        return replace(joint, systems=(system, self._so_far.moved(z)))

    def left(self, active: Sequence[Effect]) -> tuple[float, Matrix]:
        """Chi-squared that the rival leaves beyond what it began with.

        Returns
        -------
        left : chi-squared.
        errors : whitened, of the experiment by block and channel, (b, c).
        """
        right = self._so_far.chi_squared + self.quadratics(self._begun).prior.c
        value, lin = self.least(self._begun, active, self._begun.variance_factors, right)
        system = self.quadratics(lin.derived_as(self._begun)).systems[0]
        return value - right, system.r[:-1].reshape(-1, system.channels)
