"""What an observer must beat: the nominal model alone, and the roller's balance alone."""

import numpy as np

from workbench.fmu import FMU, Vector


class OpenLoop:
    """The nominal model, driven by measured inputs, without feedback.

    Parameters
    ----------
    fmu : model with inputs pB, tauR and outputs omegaW, omegaR, Fx, slip.
    """

    name = "open_loop"

    def __init__(self, fmu: FMU) -> None:
        self._fmu = fmu
        self._inputs = fmu.variables(["pB", "tauR"])
        self._outputs = fmu.variables(["omegaW", "omegaR", "muWR", "muDC", "Fx", "slip"])
        self._t = 0.0

    def init(self, t: float, u: Vector, y: Vector) -> Vector:
        """Start from the measured speeds."""
        self._fmu.start({"omegaW": y[0], "omegaR": y[1]})
        self._fmu.set(self._inputs, u)
        self._t = t
        return self._fmu.get(self._outputs).copy()

    def step(self, t: float, u: Vector, y: Vector) -> Vector:
        """Advance; y is not used."""
        self._fmu.set(self._inputs, u)
        self._fmu.step(t - self._t)
        self._t = t
        return self._fmu.get(self._outputs).copy()


class DirectInversion:
    """Creep force from the roller's balance, Fx = (tauR - JR*d(omegaR)/dt - loss)/rR.

    The balance is passed through one first-order low-pass of `time_constant`, which makes the
    differentiation causal: the same filter acts on torque and speed, so that they stay in step.

    Parameters
    ----------
    fmu : model with parameters JR, rR and outputs Fx; its roller loss is used.
    time_constant : of the filter [s].
    """

    name = "direct_inversion"

    def __init__(self, fmu: FMU, time_constant: float = 0.2) -> None:
        self._fmu = fmu
        self._time_constant = time_constant
        self._inputs = fmu.variables(["pB", "tauR"])
        self._balance = fmu.variables(["der(omegaR)", "Fx", "JR", "rR"])
        self._speed = fmu.states.index("omegaR")
        self._t = 0.0
        self._filtered_speed = 0.0
        self._filtered_torque = 0.0

    def _net_torque(self, u: Vector, y: Vector) -> tuple[float, float, float]:
        """Torque on the roller besides the creep force, tauR - loss [N.m]; JR and rR."""
        x = self._fmu.get_states()
        x[self._speed] = y[1]
        self._fmu.set_states(x)
        self._fmu.set(self._inputs, u)
        acceleration, force, inertia, radius = self._fmu.get(self._balance)
        return inertia * acceleration + radius * force, inertia, radius

    def init(self, t: float, u: Vector, y: Vector) -> Vector:
        """Start the filter at the first sample, at constant speed."""
        self._fmu.start({"omegaW": y[0], "omegaR": y[1]})
        self._t = t
        self._filtered_speed = y[1]
        self._filtered_torque, _, radius = self._net_torque(u, y)
        return _force_only(self._filtered_torque / radius)

    def step(self, t: float, u: Vector, y: Vector) -> Vector:
        """Advance the filter by one sample (backward Euler)."""
        h = t - self._t
        self._t = t
        torque, inertia, radius = self._net_torque(u, y)
        share = h / (self._time_constant + h)
        self._filtered_speed += share * (y[1] - self._filtered_speed)
        self._filtered_torque += share * (torque - self._filtered_torque)
        acceleration = (y[1] - self._filtered_speed) / self._time_constant
        return _force_only((self._filtered_torque - inertia * acceleration) / radius)


def _force_only(force: float) -> Vector:
    return np.array([np.nan, np.nan, np.nan, np.nan, force, np.nan])
