"""The observers as one writes them with FMPy's own methods and numpy, sample by sample.

What the compiled laws are measured against, in speed and in result: the same methods, written a
second time from their equations, without square roots of covariances and hand-made eliminations.
"""

import shutil
from ctypes import POINTER, c_double
from pathlib import Path
from typing import Self

import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description

from workbench.arrays import Matrix, Vector
from workbench.observers import Estimate, Gains
from workbench.observers.estimators.unscented import POINT_DISTANCE, TANGENT_SHARE
from workbench.system.system import System

FADING_SPEED = 0.5  # [m/s] at which half of the feedback is left


class FMPyModel:
    """An FMI 2.0 Model Exchange FMU in FMPy's hands.

    Parameters
    ----------
    path : model with states omegaW, omegaR, inputs pB, tauR, dmuWR, dmuDC, outputs Fx, slip.
    system : the wheelset.
    """

    def __init__(self, path: Path, system: System) -> None:
        description = read_model_description(str(path))
        variables = {v.name: v for v in description.modelVariables}
        rates = [unknown.variable for unknown in description.derivatives]
        states = [rate.derivative for rate in rates]
        names = [state.name for state in states]

        def references(*names: str) -> list[int]:
            return [variables[name].valueReference for name in names]

        self.n = len(states)
        self.speeds = [names.index("omegaW"), names.index("omegaR")]
        self.radius = float(variables["rR"].start)
        self.ratio = self.radius / float(variables["rW"].start)
        self.nominal = np.array([float(variables[name].start) for name in ("muWR", "muDC")])
        self.low = np.array([quantity.low for quantity in system.estimated]) - self.nominal
        self.high = np.array([quantity.high for quantity in system.estimated]) - self.nominal
        self.spread = np.array([quantity.spread for quantity in system.estimated])
        # What a good model leaves out of a state in a second, a share of its nominal value.
        self.walk = 2e-4 * np.array([abs(float(state.nominal or 1.0)) for state in states])
        self.measured = references("pB", "tauR")
        self.corrections = references("dmuWR", "dmuDC")
        self.outputs = references("Fx", "slip")
        self._start = references("omegaW", "omegaR")
        self._rates = [rate.valueReference for rate in rates]
        self._knowns = [*(state.valueReference for state in states), *self.corrections]
        self._x, self._dx = np.zeros(self.n), np.zeros(self.n)
        self._px = self._x.ctypes.data_as(POINTER(c_double))
        self._pdx = self._dx.ctypes.data_as(POINTER(c_double))
        self._folder = extract(str(path))
        self.fmu = instantiate_fmu(self._folder, description, "ModelExchange")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)

    def start(self, u: Vector, y: Vector) -> Vector:
        """Initialise at the first sample; returns the states, (n,)."""
        self.fmu.reset()
        self.fmu.setupExperiment()
        self.fmu.setReal(self._start, y)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.fmu.newDiscreteStates()
        self.fmu.enterContinuousTimeMode()
        self.fmu.setReal(self.measured, u)
        self.fmu.getContinuousStates(self._px, self.n)
        return self._x.copy()

    def place(self, x: Vector, correction: Vector) -> None:
        """Set states, (n,), and friction deviations, (2,)."""
        self._x[:] = x
        self.fmu.setReal(self.corrections, correction)
        self.fmu.setContinuousStates(self._px, self.n)

    def derivatives(self) -> Vector:
        """Derivatives of the states, (n,)."""
        self.fmu.getDerivatives(self._pdx, self.n)
        return self._dx.copy()

    def jacobian(self, unknowns: list[int] | None = None) -> Matrix:
        """Derivatives of unknowns (the states' derivatives) by [x, dmuWR, dmuDC], (k, n + 2)."""
        rows = unknowns or self._rates
        columns = [self.fmu.getDirectionalDerivative(rows, [j], [1.0]) for j in self._knowns]
        return np.array(columns).T

    def estimate(self, x: Vector, correction: Vector) -> Vector:
        """Place the model and read the columns of an estimate, (8,)."""
        self.place(x, correction)
        friction = self.nominal + correction
        return np.array([*x[self.speeds], *correction, *friction, *self.fmu.getReal(self.outputs)])


def _fading(speed: float) -> float:
    return speed**2 / (speed**2 + FADING_SPEED**2)


def _stick(model: FMPyModel, before: Vector, x: Vector) -> None:
    """Let the wheelset roll where a step would reverse its slip close to standstill."""
    wheelset, roller = model.speeds
    slips = [model.ratio * states[roller] - states[wheelset] for states in (before, x)]
    if abs(model.radius * x[roller]) < FADING_SPEED and slips[0] * slips[1] < 0.0:
        x[wheelset] = model.ratio * x[roller]


def _without_sigma(values: list[Vector]) -> Estimate:
    rows = np.array(values)
    return Estimate(
        rows, np.full_like(rows, np.nan), np.full(len(rows), np.nan), np.empty((len(rows), 0))
    )


def disturbance_observer(
    model: FMPyModel, gains: Gains, time: Vector, u: Matrix, y: Matrix
) -> Estimate:
    """Equations (8) to (10) of Schwarz et al. (2018), linearly implicit; minimal model.

    Parameters
    ----------
    time : (n,) [s].
    u, y : (n, 2) measured inputs and outputs.
    """
    model.start(u[0], y[0])
    gain, decay, effect = gains.values[:-2].reshape(4, 4), gains.values[-2:], gains.design["effect"]
    z, integral = np.array([*y[0], 0.0, 0.0]), np.zeros(2)
    assert model.speeds == [0, 1]
    rows = [model.estimate(z[:2], z[2:])]
    for k in range(1, len(time)):
        h = time[k] - time[k - 1]
        model.fmu.setReal(model.measured, u[k])
        rates = np.concatenate([model.derivatives(), decay * z[2:]])
        A = np.zeros((4, 4))
        A[:2] = model.jacobian()
        A[2, 2], A[3, 3] = decay
        authority = np.clip(A[0, 2:] / effect, -1.0, 1.0)
        share = _fading(model.radius * y[k, 1]) * np.array([1.0, 1.0, *authority])
        L = share[:, None] * gain
        feedback = L[:, :2] + h * L[:, 2:]
        system = np.eye(4) - h * A
        system[:, :2] += h * feedback
        rates += feedback @ (y[k] - z[:2]) + L[:, 2:] @ integral
        before, z = z, z + np.linalg.solve(system, h * rates)
        integral = integral + h * (y[k] - z[:2])
        _stick(model, before, z)
        z[2:] = np.clip(z[2:], model.low, model.high)
        rows.append(model.estimate(z[:2], z[2:]))
    return _without_sigma(rows)


def parameter_estimator(
    model: FMPyModel, gains: Gains, time: Vector, u: Matrix, y: Matrix
) -> Estimate:
    """Equation (7) of Schwarz et al. (2018), linearly implicit; see `disturbance_observer`."""
    n, speeds = model.n, model.speeds
    gain, effect = gains.values.reshape(2, 4), gains.design["effect"]
    x = model.start(u[0], y[0])
    integral, friction = np.zeros(2), np.zeros(2)
    rows = [model.estimate(x, friction)]
    for k in range(1, len(time)):
        h = time[k] - time[k - 1]
        model.fmu.setReal(model.measured, u[k])
        rates, J = model.derivatives(), model.jacobian()
        A, B = J[:, :n], J[:, n:]
        authority = np.clip(B[speeds[0]] / effect, -1.0, 1.0)
        L = (_fading(model.radius * y[k, 1]) * authority)[:, None] * gain
        feedback = L[:, :2] + h * L[:, 2:]
        system = np.eye(n) - h * A
        system[:, speeds] += h * B @ feedback
        rates += B @ (integral - friction + feedback @ (y[k] - x[speeds]))
        x = x + np.linalg.solve(system, h * rates)
        innovation = y[k] - x[speeds]
        integral = np.clip(integral + h * L[:, 2:] @ innovation, model.low, model.high)
        friction = np.clip(integral + L[:, :2] @ innovation, model.low, model.high)
        rows.append(model.estimate(x, friction))
    return _without_sigma(rows)


def _predict(model: FMPyModel, z: Vector, h: float) -> tuple[Vector, Matrix]:
    """One linearly implicit step of z = [x, dmuWR, dmuDC]; returns z and the step's matrix."""
    n = model.n
    model.place(z[:n], z[n:])
    rates = np.concatenate([model.derivatives(), np.zeros(2)])
    system = np.eye(n + 2)
    system[:n] -= h * model.jacobian()
    after = z + np.linalg.solve(system, h * rates)
    _stick(model, z, after)
    return after, system


def _correct(
    model: FMPyModel, z: Vector, P: Matrix, R: Matrix, y: Vector
) -> tuple[Vector, Matrix, float]:
    """Correct by measured speeds, in Joseph form; returns z, P and the NIS."""
    H = np.zeros((2, z.size))
    H[[0, 1], model.speeds] = 1.0
    inverse = np.linalg.inv(H @ P @ H.T + R)
    K = P @ H.T @ inverse
    innovation = y - H @ z
    uncorrected = np.eye(z.size) - K @ H
    return (
        z + K @ innovation,
        uncorrected @ P @ uncorrected.T + K @ R @ K.T,
        float(innovation @ inverse @ innovation),
    )


def _sigma(model: FMPyModel, P: Matrix) -> Vector:
    C = model.jacobian(model.outputs)
    variance = np.diag(P)
    friction = variance[model.n :]
    force = np.maximum(np.diag(C @ P @ C.T), 0.0)
    sigma: Vector = np.sqrt(np.concatenate([variance[model.speeds], friction, friction, force]))
    return sigma


def _filter(
    model: FMPyModel, noise: Gains, time: Vector, u: Matrix, y: Matrix, *, points: bool
) -> Estimate:
    n = model.n
    z = np.concatenate([model.start(u[0], y[0]), np.zeros(2)])
    of_states = noise["model"] * model.walk
    walk = np.array([*of_states, noise["muWR"], noise["muDC"]])
    spread = POINT_DISTANCE * np.sqrt(n + 2)

    def measurement(sample: Vector) -> Matrix:
        wheelset = noise["omegaW"] + noise["omegaW_relative"] * abs(sample[0])
        levels = [wheelset, noise["omegaR"]]
        fade = max(_fading(model.radius * sample[1]), 1e-3)
        return np.diag((np.array(levels) / fade) ** 2)

    P = np.diag(np.array([*of_states, *(noise["initial"] * model.spread)]) ** 2)
    P[np.ix_(model.speeds, model.speeds)] = measurement(y[0])
    values, sigmas, nis = [model.estimate(z[:n], z[n:])], [_sigma(model, P)], [np.nan]
    for k in range(1, len(time)):
        h = time[k] - time[k - 1]
        model.fmu.setReal(model.measured, u[k])
        fade = _fading(model.radius * y[k, 1])
        P = P + np.diag(h * (fade * walk) ** 2)
        if points and fade >= TANGENT_SHARE:
            offsets = spread * np.linalg.cholesky(P).T
            advanced = []
            for point in np.vstack([z + offsets, z - offsets]):
                point[n:] = np.clip(point[n:], model.low, model.high)
                advanced.append(_predict(model, point, h)[0])
            z = np.mean(advanced, axis=0)
            deviations = np.array(advanced) - z
            P = 0.5 / spread**2 * deviations.T @ deviations
        else:
            z, system = _predict(model, z, h)
            transition = np.linalg.inv(system)
            P = transition @ P @ transition.T
        z, P, square = _correct(model, z, P, measurement(y[k]), y[k])
        z[n:] = np.clip(z[n:], model.low, model.high)
        values.append(model.estimate(z[:n], z[n:]))
        sigmas.append(_sigma(model, P))
        nis.append(square)
    return Estimate(np.array(values), np.array(sigmas), np.array(nis), np.empty((len(nis), 0)))


def extended_kalman_filter(
    model: FMPyModel, noise: Gains, time: Vector, u: Matrix, y: Matrix
) -> Estimate:
    """Extended Kalman filter; see `disturbance_observer`."""
    return _filter(model, noise, time, u, y, points=False)


def unscented_kalman_filter(
    model: FMPyModel, noise: Gains, time: Vector, u: Matrix, y: Matrix
) -> Estimate:
    """Unscented Kalman filter with its covariance in full; see `disturbance_observer`."""
    return _filter(model, noise, time, u, y, points=True)
