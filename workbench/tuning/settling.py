"""How fast a tuned observer finds a quantity, by its linearisation.

z judges what is measured. An observer may have that right by correcting its states directly, while
its quantities drift behind, and they are what it is asked for. Such candidates are refused.
"""

import numpy as np
from scipy.linalg import expm

from workbench.models.fmu import FMU
from workbench.observers import Estimator, Gains
from workbench.observers.operating import linearised
from workbench.system.system import System

LATER = 4  # times the time that is allowed, when what a leak takes shows


class Settling:
    """Error of a quantity after a step of it, from the model linearised at the design point.

    Parameters
    ----------
    fmu : the estimator's model; its state is left at the operating point.
    kind : of estimator.
    """

    def __init__(self, fmu: FMU, system: System, kind: type[Estimator]) -> None:
        self._model = linearised(fmu, system).of(kind.acts_on(fmu, system))
        self._kind, self._asked = kind, system.following
        self._names = [quantity.name for quantity in system.estimated]

    def left(self, gains: Gains) -> float:
        """Share of the step that is not found after the time allowed or later, the larger [1].

        A method that makes its gains as it goes is not judged.
        """
        model, asked = self._model, self._asked
        error_model = self._kind.error_dynamics(model.A, model.B, model.C, gains)
        if error_model is None or asked is None:
            return 0.0
        dynamics, error = error_model
        quantity = self._names.index(asked.quantity)
        transition = expm(dynamics * asked.within)
        later = np.linalg.matrix_power(transition, LATER)
        column = quantity - len(self._names)
        return max(abs(float(error[quantity] @ power[:, column])) for power in (transition, later))

    def follows(self, gains: Gains) -> bool:
        """Whether a step is found in time, as the system asks."""
        return self._asked is None or self.left(gains) < self._asked.left
