"""Rivals fitted again to what another model predicts of one experiment, however far they bend."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench.diagnosis.catalogue import Effect
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.linearised import Linearised
from workbench.diagnosis.quadratic import Joint, Key, Quadratic
from workbench.fmu import Matrix, Vector


class Refit(Fit):
    """Least squares of a rival against the response of a true model, without noise.

    What recordings so far know of its unknowns holds it as a prior does.

    Parameters
    ----------
    fit : of the one recording.
    begun : the rival as it was fitted, about the experiment's own start.
    true : whitened errors of the true model, (n,).
    information : (p, p) of the rival's common unknowns in the recordings so far.
    """

    def __init__(self, fit: Fit, begun: Linearised, true: Vector, information: Matrix) -> None:
        self.__dict__.update(vars(fit))
        self._begun, self._true, self._information = begun, true, information

    def quadratics(self, lin: Linearised, extra: Sequence[Key] = ()) -> Joint:
        """As of `Fit`: away from the true model, and from where the rival began."""
        joint = super().quadratics(lin, extra)
        (one,), begun = joint.systems, self._begun.point
        deviations = one.deviations - begun.deviations[0]
        system = replace(one, r=one.r - self._true, deviations=deviations)
        now, then = ({**point.sizes, **point.levels} for point in (lin.point, begun))
        d = np.array([now[key] - then[key] for key in joint.shared])
        N = self._information
        return replace(joint, systems=(system,), prior=Quadratic(N, N @ d, float(d @ N @ d), 0))

    def left(self, active: Sequence[Effect]) -> tuple[float, Matrix]:
        """Chi-squared that the rival leaves, and whitened errors by block and channel, (b, c)."""
        value, lin = self.least(self._begun, active, self._begun.inflation)
        (one,) = self.quadratics(lin).systems
        return value, one.r[:-1].reshape(-1, one.channels)
