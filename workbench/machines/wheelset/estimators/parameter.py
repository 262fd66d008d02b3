"""The parameter estimator with gains that know the two time scales of wheelset and roller."""

import numpy as np

from workbench.models.fmu import FMU
from workbench.observers.estimators import parameter
from workbench.observers.estimators.disturbance import effects
from workbench.observers.gains import Gains
from workbench.observers.operating import linearised
from workbench.system.system import System

BANDWIDTH, DAMPING = 15.0, 0.7  # of the pair of poles of dmuDC [rad/s], [1]
SLIP_BANDWIDTH = 2.0  # of the pole of dmuWR [rad/s]


class WheelsetParameterEstimator(parameter.ParameterEstimator):
    """See `workbench.observers.estimators.parameter`; only its gains before tuning are others."""

    name = parameter.ParameterEstimator.name

    @classmethod
    def default_gains(cls, fmu: FMU, system: System) -> Gains:
        """Gains from the linearised model, by its two time scales.

        The eigenvalues of the model are far apart: slip settles within milliseconds, the common
        speed of wheelset and roller only integrates. Along the slow eigenvector dmuDC acts as a
        torque on that speed, so a PI controller from its deviation places two poles. dmuWR shifts
        the slip that belongs to a force; an integral controller from the deviation of slip follows
        it.
        """
        model = linearised(fmu, system)
        speeds = model.of(("omegaW", "omegaR"))
        rates, left = np.linalg.eig(speeds.A.T)
        slow, fast = left[:, np.argmax(rates.real)].real, left[:, np.argmin(rates.real)].real
        rolling = np.array([fmu.defaults["rR"] / fmu.defaults["rW"], 1.0])
        effect_on_speed = float(slow @ speeds.B[:, 1] / (slow @ rolling))
        shift_of_slip = -float(fast @ speeds.B[:, 0] / rates.real.min())
        L = np.zeros((2, 4))
        L[0, 2:] = SLIP_BANDWIDTH / shift_of_slip * fast
        L[1, 1] = 2 * DAMPING * BANDWIDTH / effect_on_speed
        L[1, 3] = BANDWIDTH**2 / effect_on_speed
        source = "pole placement in the two time scales of the linearised model"
        return cls.of(L, effects(fmu, system, model), source)
