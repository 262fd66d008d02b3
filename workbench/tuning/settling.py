"""How fast a tuned observer finds the friction of the pads, by its linearisation.

z judges speeds and force. An observer may have them right by correcting its speeds directly, while
its friction drifts behind, and friction is what it is asked for. Such candidates are refused.
"""

import numpy as np
from scipy.linalg import expm

from workbench.fmu import FMU, Matrix
from workbench.observers import DisturbanceGains, FilterNoise, OperatingPoint, ParameterGains
from workbench.observers.disturbance import hold_in_equilibrium
from workbench.tuning.space import Gains

SETTLED = 0.05  # share of a step of friction that may be left
HALF_SECOND = 0.5  # [s] within which a force is to be followed
LATER = 4  # half seconds, when what a leak takes shows


class Settling:
    """Error of muDC after a step of it, from the model linearised at light service braking.

    Parameters
    ----------
    fmu : the estimator's model; its state is left at the operating point.
    """

    def __init__(self, fmu: FMU) -> None:
        hold_in_equilibrium(fmu, OperatingPoint())
        self._speeds = [fmu.states.index(name) for name in ("omegaW", "omegaR")]
        self._A = fmu.state_jacobian()
        self._B = fmu.input_jacobian(fmu.variables(["dmuWR", "dmuDC"]))

    def left(self, gains: Gains) -> float:
        """Share of the step that is not found after half a second or two, the larger [1].

        A Kalman filter makes its gains as it goes and is not judged.
        """
        match gains:
            case DisturbanceGains():
                dynamics, error = self._disturbance_observer(gains)
            case ParameterGains():
                dynamics, error = self._parameter_estimator(gains)
            case FilterNoise():
                return 0.0
        transition = expm(dynamics * HALF_SECOND)
        later = np.linalg.matrix_power(transition, LATER)
        return max(abs(float(error @ after[:, -1])) for after in (transition, later))

    def _disturbance_observer(self, gains: DisturbanceGains) -> tuple[Matrix, Matrix]:
        """Errors of speeds, estimated frictions, integrals of dy, true frictions: d/dt of all."""
        order = np.ix_(self._speeds, self._speeds)
        A, B, zero = self._A[order], self._B[self._speeds], np.zeros((2, 2))
        L, T = gains.L, np.diag([gains.T_WR, gains.T_DC])
        dynamics = np.block(
            [
                [A - L[:2, :2], -B, -L[:2, 2:], B],
                [L[2:, :2], T, L[2:, 2:], zero],
                [np.eye(2), zero, zero, zero],
                [zero, zero, zero, zero],
            ]
        )
        return dynamics, np.array([0, 0, 0, -1.0, 0, 0, 0, 1.0])

    def _parameter_estimator(self, gains: ParameterGains) -> tuple[Matrix, Matrix]:
        """Errors of states, integrals of dy, true frictions; the estimate is L [dy, integral]."""
        n = len(self._A)
        C = np.zeros((2, n))
        C[[0, 1], self._speeds] = 1.0
        estimate = np.hstack([gains.L[:, :2] @ C, gains.L[:, 2:], np.zeros((2, 2))])
        truth = np.hstack([np.zeros((2, n + 2)), np.eye(2)])
        dynamics = np.zeros((n + 4, n + 4))
        dynamics[:n, :n] = self._A
        dynamics[:n] += self._B @ (truth - estimate)
        dynamics[n : n + 2, :n] = C
        return dynamics, (truth - estimate)[1]
