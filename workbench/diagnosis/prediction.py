"""Prediction errors of a model along a recorded stop: what the data say that the model does not.

The model is simulated from the measured inputs. Only its slow motion, the common speed of wheelset
and roller, is led along the measured roller speed, by the stationary Kalman gain for the noise of
torque and roller speed: errors of the past are forgotten and the prediction errors are white when
the model is right. Slip and creep force stay the model's own.
Source: L. Ljung, System Identification, 2nd ed. 1999, section 7.2 (prediction-error methods).
"""

import math
from collections.abc import Mapping

import numpy as np

from workbench.diagnosis.samples import Samples
from workbench.fmu import FMU, Matrix
from workbench.kernel import (
    checked,
    compiled,
    evaluate,
    linearise,
    place,
    plant,
    read,
    set_states,
)

INPUTS = ("pB", "tauR", "dmuWR", "dmuDC")
READINGS = ("omegaWReading", "omegaRReading", "FxReading")

_LONGEST = 0.006  # [s] of a step: all but the speeds is stepped explicitly, some in 10 ms
_KEPT = 8  # steps with one Jacobian: 50 ms, in which the speed of a stop falls by 0.2 m/s
_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


@compiled
def _stiff(plant, wheel, roller, a):  # type: ignore[no-untyped-def]
    """Fill a (n, 2) with the columns of the Jacobian by both speeds; a status."""
    n = plant.x.size
    if plant.fmi == 0:
        if linearise(plant, n):
            return 1
    else:
        for j in (wheel, roller):
            known, out = (
                plant.knowns_at + 4 * j,
                plant.jacobian_at + 8 * plant.jacobian.shape[1] * j,
            )
            if plant.fmi == 2:
                status = plant.directional_2(
                    plant.instance, plant.unknowns_at, n, known, 1, plant.seed_at, out
                )
            else:
                status = plant.directional_3(
                    plant.instance, plant.unknowns_at, n, known, 1, plant.seed_at, 1, out, n
                )
            if status > 1:
                return 1
    for i in range(n):
        a[i, 0] = plant.jacobian[wheel, i]
        a[i, 1] = plant.jacobian[roller, i]
    return 0


@compiled
def _solve(a, h, wheel, roller, k):  # type: ignore[no-untyped-def]
    """Solve (I - gamma h A) x = k in place; A has the columns a by both speeds, else zeros."""
    f = -_GAMMA * h
    p, q = 1.0 + f * a[wheel, 0], f * a[wheel, 1]
    r, s = f * a[roller, 0], 1.0 + f * a[roller, 1]
    determinant = p * s - q * r
    if not abs(determinant) > 0.0:
        return 2
    kW = (s * k[wheel] - q * k[roller]) / determinant
    kR = (p * k[roller] - r * k[wheel]) / determinant
    for i in range(k.size):
        k[i] -= f * (a[i, 0] * kW + a[i, 1] * kR)
    k[wheel], k[roller] = kW, kR
    return 0


@compiled
def _step(plant, u, h, wheel, roller, x, a, renew, k1, k2):  # type: ignore[no-untyped-def]
    """Advance plant.x by h [s] while the inputs go from plant.u to u; returns a status.

    Rosenbrock method of two stages, L-stable, with inputs linear in time: a sampled pressure ramp
    is met without lag, which linearly implicit Euler would show as half a sample of delay. It is
    of order 2 whatever matrix stands for the Jacobian, so that one serves several steps; both
    speeds are stiff, through the slip, and only they are treated so. What drives them, inputs and
    all other states, enters by its change over the step.
    Source: J. G. Verwer et al. (1999), SIAM J. Sci. Comput. 20, 1456-1480.
    """
    n = x.size
    if evaluate(plant):
        return 1
    for i in range(n):
        x[i] = plant.x[i]
        k1[i] = plant.dx[i]
    if renew and _stiff(plant, wheel, roller, a):
        return 1
    for j in range(u.size):
        plant.u[j] = u[j]
    for i in range(n):
        if i != wheel and i != roller:
            plant.x[i] += h * k1[i]
    if place(plant) or evaluate(plant):
        return 1
    for i in range(n):
        k2[i] = _GAMMA * (plant.dx[i] - k1[i])
        k1[i] += k2[i]
    if _solve(a, h, wheel, roller, k1):
        return 2
    for i in range(n):
        plant.x[i] = x[i] + h * k1[i]
    if set_states(plant) or evaluate(plant):
        return 1
    for i in range(n):
        k2[i] = plant.dx[i] - 2.0 * k1[i] - k2[i]
    if _solve(a, h, wheel, roller, k2):
        return 2
    for i in range(n):
        plant.x[i] = x[i] + h * (1.5 * k1[i] + 0.5 * k2[i])
    return set_states(plant)


@compiled
def _predict(plant, time, u, y, gain, x0, wheel, roller, errors, between, x, a, k1, k2):  # type: ignore[no-untyped-def]
    """Fill `errors` (n, m), measured minus predicted; returns a status.

    A correction of the roller's speed scales both speeds: creepage and force stay as they are, so
    that the noise of one sample does not come back as force in the next.
    """
    for i in range(x0.size):
        plant.x[i] = x0[i]
    for j in range(u.shape[1]):
        plant.u[j] = u[0, j]
    if place(plant):
        return 1
    taken = 0
    for k in range(time.size):
        if k > 0:
            correction = gain[k - 1] * errors[k - 1, 1]
            if abs(plant.x[roller]) > 2.0 * abs(correction):
                plant.x[wheel] *= 1.0 + correction / plant.x[roller]
                plant.x[roller] += correction
            if set_states(plant):
                return 1
            interval = time[k] - time[k - 1]
            steps = max(1, math.ceil(interval / _LONGEST - 1e-6))
            for i in range(1, steps + 1):
                for j in range(u.shape[1]):
                    between[j] = u[k - 1, j] + (u[k, j] - u[k - 1, j]) * i / steps
                renew = taken % _KEPT == 0
                status = _step(plant, between, interval / steps, wheel, roller, x, a, renew, k1, k2)
                taken += 1
                if status:
                    return status
        if read(plant):
            return 1
        for i in range(y.shape[1]):
            errors[k, i] = y[k, i] - plant.y[i]
    return 0


class Predictor:
    """One model, ready for many runs.

    Parameters
    ----------
    fmu : model with states omegaW, omegaR, the inputs INPUTS and the outputs READINGS; it must
        outlive the predictor.
    """

    def __init__(self, fmu: FMU) -> None:
        self._fmu = fmu
        self._plant = plant(fmu, INPUTS, READINGS)
        self._speeds = fmu.states.index("omegaW"), fmu.states.index("omegaR")
        self._ratio = fmu.defaults["rR"] / fmu.defaults["rW"]

    def errors(self, samples: Samples, parameters: Mapping[str, float]) -> Matrix:
        """Prediction errors along one stop.

        Parameters
        ----------
        parameters : values by name of the FMU's variables, SI; others keep their defaults.

        Returns
        -------
        errors : (n, m) measured minus predicted: omegaW, omegaR [rad/s] and Fx [N] if measured.

        Raises
        ------
        FMUError
            If the model cannot be evaluated along the stop.
        """
        fmu, n = self._fmu, len(self._fmu.states)
        begin = {"omegaW": samples.omegaR * self._ratio, "omegaR": samples.omegaR}
        fmu.start(begin, parameters)
        errors = np.zeros_like(samples.y)
        work = (np.zeros(len(INPUTS)), np.zeros(n), np.zeros((n, 2)), np.zeros(n), np.zeros(n))
        status = _predict(
            self._plant,
            samples.time,
            samples.u,
            samples.y,
            samples.gain,
            fmu.get_states(),
            *self._speeds,
            errors,
            *work,
        )
        checked(status, fmu)
        return errors
