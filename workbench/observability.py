"""What the measured speeds can tell about states and frictions, stage 5.

Information is counted against the noise of the sensors and against what is known beforehand, so
that "observable" has a meaning on a rig: a window of samples says more than the prior did.

The linear test takes a second at an operating point, as Schwarz et al. (2018) do before they choose
the model of an observer. The nonlinear test linearises along a recorded stop, which gives the local
observability Gramian of every window; the frictions join the states as unknown constants.
Sources: Krener and Ide (2009), Measures of unobservability, 48th IEEE CDC; Van Trees (1968),
Detection, Estimation, and Modulation Theory I, section 2.4 (Cramer-Rao bound with a prior).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.case import Case
from workbench.cosim import Run
from workbench.fmu import FMU, Matrix, Vector

MEASURED = ("omegaW", "omegaR")
FRICTIONS = ("dmuWR", "dmuDC")
_INPUTS = ("pB", "tauR", *FRICTIONS)

# Ranges of wheel-rail and disc-pad friction, Schwarz et al. (2018), Table 1. Before a measurement
# any value in them is as likely: standard deviations of 0.10 each.
FRICTION_RANGE = np.array([[0.05, 0.40], [0.10, 0.45]])
FRICTION_PRIOR: Vector = np.diff(FRICTION_RANGE)[:, 0] / np.sqrt(12.0)
# Bounds that serve: two sigma of 0.05 tell a dry rail (0.40) from a wet one (0.30); 0.01 is 3 % of
# the nominal disc-pad friction, little more than its scatter from stop to stop (2 %).
USEFUL = {"dmuWR": 0.05, "dmuDC": 0.01}
WINDOW = 0.5  # [s] the time within which a brake control has to react
STRIDE = 0.1  # [s] from one window to the next
SECOND = 200  # samples of one second at the rate of the recordings


@dataclass(frozen=True)
class BrakingPoint:
    """Operating point of the linear test: the middle of what brake stops cover.

    Attributes
    ----------
    speed : rolling velocity [m/s], half of 160 km/h.
    pressure : brake cylinder pressure [Pa], the most common of the cases.
    muWR : friction wheel-rail, the middle of FRICTION_RANGE.
    """

    speed: float = 22.0
    pressure: float = 2.7e5
    muWR: float = 0.225


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviation of one sample, typical of the rig's sensors.

    Attributes
    ----------
    pB : [Pa].
    tauR : [N.m].
    omegaW : [rad/s], to which `omegaW_relative` times the speed is added.
    omegaR : [rad/s].
    """

    pB: float = 500.0
    tauR: float = 40.0
    omegaW: float = 0.002
    omegaW_relative: float = 3.0e-4
    omegaR: float = 0.003

    def outputs(self, speeds: Matrix) -> Matrix:
        """Return standard deviations of omegaW, omegaR, (n, 2), at speeds (n, 2) [rad/s]."""
        wheelset = self.omegaW + self.omegaW_relative * np.abs(speeds[:, 0])
        return np.column_stack([wheelset, np.full(len(speeds), self.omegaR)])


@dataclass(frozen=True)
class SampledModel:
    """A model linearised along a trajectory: x[k+1] = Phi[k] x[k] + Gamma[k] v[k], y[k] = C x[k].

    Attributes
    ----------
    names : (k,) states, then dmuWR and dmuDC, which are constant.
    Phi : (n, k, k) from one sample to the next.
    Gamma : (n, k, 2) effect of one standard deviation of the noise of pB and tauR.
    C : (2, k) outputs omegaW, omegaR.
    R : (n, 2) variance of the outputs [rad2/s2].
    """

    names: tuple[str, ...]
    Phi: Matrix
    Gamma: Matrix
    C: Matrix
    R: Matrix


@dataclass(frozen=True)
class LinearTest:
    """Observability at an operating point from one second of samples.

    Attributes
    ----------
    model : name of the model, without its library.
    states : (k,) names.
    x : (k,) operating point.
    scale : (k,) deviation that a pad friction off by its prior causes within the second.
    information : (k,) eigenvalues of the Gramian in units of `scale`, ascending [1]: squared ratio
        of signal to noise. Above 1 the samples say more than `scale` does.
    directions : (k, k) unit vectors in units of `scale`, one column per eigenvalue.
    remaining : (k,) standard deviation left of each state after the second, over `scale` [1].
    """

    model: str
    states: tuple[str, ...]
    x: Vector
    scale: Vector
    information: Vector
    directions: Matrix
    remaining: Vector

    @property
    def rank(self) -> int:
        """Number of directions that the samples tell more about than the prior."""
        return int(np.count_nonzero(self.information > 1.0))

    @property
    def observable(self) -> bool:
        """Whether the rank is full."""
        return self.rank == len(self.states)

    @property
    def unobservable(self) -> tuple[str, ...]:
        """States that lie mostly in directions below the threshold, in the model's order."""
        return self._mostly_below(1.0)

    @property
    def invisible(self) -> tuple[str, ...]:
        """Those of `unobservable` that leave no trace in double precision."""
        return self._mostly_below(len(self.states) * np.finfo(float).eps * self.information[-1])

    def _mostly_below(self, threshold: float) -> tuple[str, ...]:
        share = np.sum(self.directions[:, self.information <= threshold] ** 2, axis=1)
        return tuple(name for name, s in zip(self.states, share, strict=True) if s > 0.5)


@dataclass(frozen=True)
class WindowTest:
    """Observability along a recorded stop, window by window.

    Attributes
    ----------
    model : name of the model, without its library.
    states : (k,) names.
    time : (m,) end of the window [s].
    remaining : (m, k) standard deviation left of each state at the window's begin, over its scale,
        with both frictions unknown [1].
    bound : (m, 2) Cramer-Rao bound of dmuWR and dmuDC [1].
    """

    model: str
    states: tuple[str, ...]
    time: Vector
    remaining: Matrix
    bound: Matrix

    def states_observable(self) -> NDArray[np.bool_]:
        """(m, k) whether a window says more about a state than its scale does."""
        # Equal information of prior and window halves the variance.
        return self.remaining**2 < 0.5

    def frictions_useful(self) -> NDArray[np.bool_]:
        """(m, 2) whether the bounds of dmuWR and dmuDC are below USEFUL."""
        return self.bound < np.array([USEFUL[name] for name in FRICTIONS])


def linear_test(
    fmu: FMU, point: BrakingPoint | None = None, noise: SensorNoise | None = None
) -> LinearTest:
    """Test a model where the creep force carries the brake torque at constant speed.

    The rank of an observability matrix depends on units and on a tolerance. Here units are the
    deviations that matter, the tolerance is the noise of the sensors: the eigenvalues of the
    Gramian are squared ratios of signal to noise.
    """
    point, noise = point or BrakingPoint(), noise or SensorNoise()
    x, u = settle(fmu, point)
    count = len(fmu.states)
    repeated = (SECOND + 1, 1)
    time = np.arange(SECOND + 1) / SECOND
    model = linearise_along(fmu, time, np.tile(x, repeated), np.tile(u, repeated), noise)
    response = np.zeros(len(model.names))
    response[-1] = FRICTION_PRIOR[1]
    scale = np.zeros(count)
    for Phi in model.Phi[:-1]:
        response = Phi @ response
        scale = np.maximum(scale, np.abs(response[:count]))
    gramian = gramians(model, np.zeros(1, int), SECOND)[0, :count, :count]
    scaled = gramian * np.outer(scale, scale)
    information, directions = np.linalg.eigh(scaled)
    return LinearTest(
        model=fmu.name.rpartition(".")[2],
        states=fmu.states,
        x=x,
        scale=scale,
        information=np.maximum(information, 0.0),
        directions=directions,
        remaining=_remaining(scaled),
    )


def window_test(
    fmu: FMU, case: Case, run: Run, scale: Vector, noise: SensorNoise | None = None
) -> WindowTest:
    """Test a model along a recorded stop, in windows of WINDOW seconds.

    Parameters
    ----------
    run : an estimate that follows the recording; its speeds and frictions make the trajectory.
        The tests hold there: an estimate that takes the rail for more slippery than it is comes
        closer to the limit of adhesion, where dmuWR is better known than on the real rail.
    scale : (k,) of the model's states, see LinearTest.
    """
    noise = noise or SensorNoise()
    count = len(fmu.states)
    x, u = follow(fmu, case, run)
    model = linearise_along(fmu, case.time, x, u, noise)
    step = (case.time[-1] - case.time[0]) / (case.time.size - 1)
    length = min(max(round(WINDOW / step), 2), case.time.size)
    starts = np.arange(0, case.time.size - length + 1, max(round(STRIDE / step), 1))
    prior = np.concatenate([scale, FRICTION_PRIOR])
    scaled = gramians(model, starts, length) * np.outer(prior, prior)
    return WindowTest(
        model=fmu.name.rpartition(".")[2],
        states=fmu.states,
        time=case.time[starts + length - 1],
        remaining=_remaining(scaled)[:, :count],
        bound=bounds(model, starts, length, prior)[:, count:],
    )


def settle(fmu: FMU, point: BrakingPoint) -> tuple[Vector, Vector]:
    """Brake at constant speed until the model rests in its operating point.

    Returns
    -------
    x : (k,) states.
    u : (4,) pB [Pa], tauR [N.m], dmuWR, dmuDC.
    """
    fmu.start({})
    rW, rR, muWR = fmu.get(fmu.variables(["rW", "rR", "muWR"]))
    u = np.array([point.pressure, 0.0, point.muWR - muWR, 0.0])
    fmu.start({"omegaW": point.speed / rW, "omegaR": point.speed / rR})
    fmu.set(fmu.variables(_INPUTS), u)
    x = fmu.get_states()
    free = [i for i, name in enumerate(fmu.states) if name != "omegaR"]
    h = 0.01
    # Four seconds of implicit Euler: the slowest motion besides the roller's decays in 0.3 s.
    for _ in range(400):
        A = fmu.state_jacobian()[np.ix_(free, free)]
        x[free] += np.linalg.solve(np.eye(len(free)) / h - A, fmu.derivatives()[free])
        fmu.set_states(x)
    return x, u


def follow(fmu: FMU, case: Case, run: Run) -> tuple[Matrix, Matrix]:
    """Run a model along an estimate: speeds and frictions are the estimate's.

    States that the estimate does not hold follow from the model, driven by the estimate.

    Returns
    -------
    x : (n, k) states.
    u : (n, 4) pB [Pa], tauR [N.m], dmuWR, dmuDC.
    """
    speeds = np.column_stack([run.signal(name) for name in MEASURED])
    fmu.start(dict(zip(MEASURED, speeds[0], strict=True)))
    nominal = fmu.get(fmu.variables(["muWR", "muDC"])).copy()
    u = np.column_stack([case.u, run.signal("muWR") - nominal[0], run.signal("muDC") - nominal[1]])
    inputs, measured = fmu.variables(_INPUTS), _indices(fmu)
    x = np.tile(fmu.get_states(), (case.time.size, 1))
    x[:, measured] = speeds
    if len(fmu.states) > len(MEASURED):
        for k, h in enumerate(np.diff(case.time)):
            fmu.set_states(x[k])
            fmu.set(inputs, u[k])
            x[k + 1] = fmu.step(h)
            x[k + 1, measured] = speeds[k + 1]
    return x, u


def linearise_along(
    fmu: FMU, time: Vector, x: Matrix, u: Matrix, noise: SensorNoise
) -> SampledModel:
    """Linearise a model at every sample of a trajectory, frictions as constant states.

    Parameters
    ----------
    time : (n,) [s].
    x : (n, k) states.
    u : (n, 4) pB [Pa], tauR [N.m], dmuWR, dmuDC.
    """
    fmu.start({})
    inputs = fmu.variables(_INPUTS)
    n, count = x.shape
    generator = np.zeros((n, count + 4, count + 4))
    for k in range(n):
        fmu.set_states(x[k])
        fmu.set(inputs, u[k])
        generator[k, :count, :count] = fmu.state_jacobian()
        generator[k, :count, count:] = fmu.input_jacobian(inputs)
    steps = np.append(np.diff(time), time[-1] - time[-2])
    # Exact for inputs held over the step; Van Loan (1978), IEEE Trans. Autom. Control 23, 395.
    transition = exponentials(generator * steps[:, None, None])
    kept = [*range(count), count + 2, count + 3]
    measured = _indices(fmu)
    return SampledModel(
        names=(*fmu.states, *FRICTIONS),
        Phi=transition[:, kept][:, :, kept],
        Gamma=transition[:, kept, count : count + 2] * np.array([noise.pB, noise.tauR]),
        C=np.eye(len(kept))[measured],
        R=noise.outputs(x[:, measured]) ** 2,
    )


def exponentials(matrices: Matrix) -> Matrix:
    """Return matrix exponentials, (n, k, k), of a stack: Taylor series, scaling and squaring.

    Scipy's function hands small matrices one by one to the threads of its linear algebra, which
    takes a hundred times as long where processes share the processors.
    Source: Moler and Van Loan (2003), SIAM Review 45, 3, method 3.
    """
    norm = float(np.abs(matrices).sum(axis=2).max())
    halvings = max(0, int(np.ceil(np.log2(max(norm, 0.5) / 0.5))))
    scaled = matrices / 2.0**halvings
    identity = np.eye(matrices.shape[-1])
    result: Matrix = np.broadcast_to(identity, matrices.shape)
    # Thirteen terms at a norm of 0.5 leave 0.5^14/14!, below double precision.
    for order in range(13, 0, -1):
        result = identity + scaled @ result / order
    for _ in range(halvings):
        result = result @ result
    return result


def gramians(model: SampledModel, starts: NDArray[np.int_], length: int) -> Matrix:
    """Local observability Gramian of windows, weighted with the noise of the outputs.

    It is the Fisher information on the state at the window's begin; noise of inputs is left out.

    Parameters
    ----------
    starts : (m,) first sample of each window.
    length : samples of a window.

    Returns
    -------
    (m, k, k), in the inverse units of the states, squared.
    """
    sensitivity = np.tile(np.eye(len(model.names)), (starts.size, 1, 1))
    gramian = np.zeros_like(sensitivity)
    for j in range(length):
        seen = model.C @ sensitivity
        gramian += seen.transpose(0, 2, 1) @ (seen / model.R[starts + j][:, :, None])
        sensitivity = model.Phi[starts + j] @ sensitivity
    return gramian


def bounds(model: SampledModel, starts: NDArray[np.int_], length: int, prior: Vector) -> Matrix:
    """Cramer-Rao bound of the states at the end of windows, noise of inputs included.

    The covariance of the Kalman filter along the trajectory is the inverse of the window's Fisher
    information and that of the prior; so no bound is above the prior.

    Parameters
    ----------
    starts : (m,) first sample of each window.
    length : samples of a window.
    prior : (k,) standard deviations before the window.

    Returns
    -------
    (m, k) standard deviations, in the units of the states.
    """
    C = model.C
    P = np.tile(np.diag(prior**2), (starts.size, 1, 1))
    for j in range(length):
        PC = P @ C.T
        innovation = C @ PC + model.R[starts + j][:, :, None] * np.eye(len(C))
        P = P - PC @ np.linalg.solve(innovation, PC.transpose(0, 2, 1))
        P = 0.5 * (P + P.transpose(0, 2, 1))
        if j + 1 < length:
            Phi, Gamma = model.Phi[starts + j], model.Gamma[starts + j]
            P = Phi @ P @ Phi.transpose(0, 2, 1) + Gamma @ Gamma.transpose(0, 2, 1)
    deviation: Matrix = np.sqrt(np.einsum("mii->mi", P))
    return deviation


def _indices(fmu: FMU) -> list[int]:
    return [fmu.states.index(name) for name in MEASURED]


def _remaining(scaled: Matrix) -> Matrix:
    """Return standard deviations left over the prior's, (..., k); Gramian in units of the prior."""
    posterior = np.linalg.inv(np.eye(scaled.shape[-1]) + scaled)
    remaining: Matrix = np.sqrt(np.einsum("...ii->...i", posterior))
    return remaining
