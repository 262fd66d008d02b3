"""What measured outputs can tell about states and estimated quantities, a stage after the runs.

Information is counted against the noise of the sensors and against what is known beforehand, so
that "observable" has a meaning on a machine: a window of samples says more than the prior did.

The linear test takes a second at an operating point, as Schwarz et al. (2018) do before they choose
the model of an observer. The nonlinear test linearises along a recording, which gives the local
observability Gramian of every window; estimated quantities join the states as unknown constants.
Sources: Krener and Ide (2009), Measures of unobservability, 48th IEEE CDC; Van Trees (1968),
Detection, Estimation, and Modulation Theory I, section 2.4 (Cramer-Rao bound with a prior).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError
from workbench.models.fmu import FMU
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.operating import settle
from workbench.observers.replay import replay
from workbench.observers.run import Ending, Run
from workbench.observers.score import judged_window
from workbench.recordings.case import Case
from workbench.system.parts import OperatingPoint
from workbench.system.registry import open_model
from workbench.system.system import OBSERVER, System


@dataclass(frozen=True)
class SampledModel:
    """A linearised model: x[i+1] = Phi[i] x[i] + Gamma[i] v[i], y[i] = C[i] x[i].

    Attributes
    ----------
    names : (k,) states, then corrections of the estimated quantities, which are constant.
    Phi : (n, k, k) from one sample to the next.
    Gamma : (n, k, m) effect of one standard deviation of the noise of each input.
    C : (n, l, k) of the measured outputs.
    R : (n, l) variance of the outputs [their unit squared].
    """

    names: tuple[str, ...]
    Phi: Matrix
    Gamma: Matrix
    C: Matrix
    R: Matrix


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
        seen = model.C[starts + j] @ sensitivity
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
    P = np.tile(np.diag(prior**2), (starts.size, 1, 1))
    for j in range(length):
        C = model.C[starts + j]
        PC = P @ C.transpose(0, 2, 1)
        innovation = C @ PC + model.R[starts + j][:, :, None] * np.eye(C.shape[1])
        P = P - PC @ np.linalg.solve(innovation, PC.transpose(0, 2, 1))
        P = 0.5 * (P + P.transpose(0, 2, 1))
        if j + 1 < length:
            Phi, Gamma = model.Phi[starts + j], model.Gamma[starts + j]
            P = Phi @ P @ Phi.transpose(0, 2, 1) + Gamma @ Gamma.transpose(0, 2, 1)
    deviation: Matrix = np.sqrt(np.einsum("mii->mi", P))
    return deviation


def remaining(scaled: Matrix) -> Matrix:
    """Return standard deviations left over the prior's, (..., k); Gramian in units of the prior."""
    posterior = np.linalg.inv(np.eye(scaled.shape[-1]) + scaled)
    left: Matrix = np.sqrt(np.einsum("...ii->...i", posterior))
    return left


WINDOW = 0.5  # [s] the time within which a control has to react


_POINTS = 200  # of a recording at which it is linearised to tell quantities apart
_PART = 0.1  # share of a direction that counts as part of it
_LEFT = 0.5  # share of what was unknown of a direction, of which nothing to speak of was learnt


STRIDE = 0.1  # [s] from one window to the next


def prior(system: System) -> Vector:
    """Standard deviation of the estimated quantities before a measurement, (q,).

    Any value of its range is as likely.
    """
    ranges = np.array([quantity.prior for quantity in system.estimated]).reshape(-1, 2)
    deviation: Vector = np.diff(ranges)[:, 0] / np.sqrt(12.0)
    return deviation


@dataclass(frozen=True)
class LinearTest:
    """Observability at an operating point from one second of samples.

    Attributes
    ----------
    model : name of the model, without its library.
    states : (k,) names.
    x : (k,) operating point.
    scale : (k,) largest deviation that a quantity off by its prior causes within the second.
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
        largest = float(self.information.max(initial=0.0))
        return self._mostly_below(len(self.states) * np.finfo(float).eps * largest)

    def _mostly_below(self, threshold: float) -> tuple[str, ...]:
        share = np.sum(self.directions[:, self.information <= threshold] ** 2, axis=1)
        return tuple(name for name, s in zip(self.states, share, strict=True) if s > 0.5)


@dataclass(frozen=True)
class WindowTest:
    """Observability along a recording, window by window.

    Attributes
    ----------
    model : name of the model, without its library.
    states : (k,) names.
    time : (m,) end of the window [s].
    remaining : (m, k) standard deviation left of each state at the window's begin, over its scale,
        with all estimated quantities unknown [1].
    bound : (m, q) Cramer-Rao bound of the estimated quantities [their unit].
    serving : (q,) bounds from which on an estimate serves [its unit].
    """

    model: str
    states: tuple[str, ...]
    time: Vector
    remaining: Matrix
    bound: Matrix
    serving: Vector

    def states_observable(self) -> NDArray[np.bool_]:
        """(m, k) whether a window says more about a state than its scale does."""
        # Equal information of prior and window halves the variance.
        return self.remaining**2 < 0.5

    def useful(self) -> NDArray[np.bool_]:
        """(m, q) whether the bounds are such that estimates serve."""
        return self.bound < self.serving


@dataclass(frozen=True)
class CaseObservability:
    """Tests of several models along one recording.

    Attributes
    ----------
    system, case : the recording, and what it is of.
    run : the estimate that makes the trajectory.
    judged : (m,) windows that end in the time that is judged.
    tests : one per model, with the same windows.
    """

    system: System
    case: Case
    run: Run
    judged: NDArray[np.bool_]
    tests: tuple[WindowTest, ...]


def case_observability(
    system: System, scales: Mapping[str, Vector], case: Case
) -> CaseObservability:
    """Test models along one recording, where the disturbance observer takes it to be.

    Parameters
    ----------
    scales : by role of the model, see LinearTest.

    Raises
    ------
    FMUError
        If the observer fails.
    """
    with open_model(system, OBSERVER) as fmu:
        gains = DisturbanceObserver.default_gains(fmu, system)
        run = replay(case, DisturbanceObserver(fmu, system, gains))
    if run.ending is not Ending.OK:
        raise FMUError(f"{case.name}: {run.ending.value} {run.message}".strip())
    tests = []
    for role, scale in scales.items():
        with open_model(system, role) as fmu:
            tests.append(window_test(fmu, system, case, run, scale))
    counted = np.isin(tests[0].time, case.time[judged_window(case, system)])
    return CaseObservability(system, case, run, counted, tuple(tests))


def linear_test(fmu: FMU, system: System, point: OperatingPoint | None = None) -> LinearTest:
    """Test a model at an operating point, that of the system unless another is given.

    The rank of an observability matrix depends on units and on a tolerance. Here units are the
    deviations that matter, the tolerance is the noise of the sensors: the eigenvalues of the
    Gramian are squared ratios of signal to noise.
    """
    x, u = settle(fmu, system, point or system.tested)
    count, second = len(fmu.states), max(round(1.0 / system.sample_time), 1)
    repeated = (second + 1, 1)
    time = np.arange(second + 1) / second
    model = linearise_along(fmu, system, time, np.tile(x, repeated), np.tile(u, repeated))
    response = np.vstack([np.zeros((count, len(system.estimated))), np.diag(prior(system))])
    scale = np.zeros(count)
    for Phi in model.Phi[:-1]:
        response = Phi @ response
        scale = np.maximum(scale, np.abs(response[:count]).max(axis=1))
    gramian = gramians(model, np.zeros(1, int), second)[0, :count, :count]
    scaled = gramian * np.outer(scale, scale)
    information, directions = np.linalg.eigh(scaled)
    return LinearTest(
        model=fmu.name.rpartition(".")[2],
        states=fmu.states,
        x=x,
        scale=scale,
        information=np.maximum(information, 0.0),
        directions=directions,
        remaining=remaining(scaled),
    )


def window_test(fmu: FMU, system: System, case: Case, run: Run, scale: Vector) -> WindowTest:
    """Test a model along a recording, in windows of WINDOW seconds.

    Parameters
    ----------
    run : an estimate that follows the recording; its outputs and quantities make the trajectory.
        The tests hold there, and an estimate that errs may be at a place where more is known.
    scale : (k,) of the model's states, see LinearTest.
    """
    count = len(fmu.states)
    x, u = follow(fmu, system, case, run)
    model = linearise_along(fmu, system, case.time, x, u)
    step = (case.time[-1] - case.time[0]) / (case.time.size - 1)
    length = min(max(round(WINDOW / step), 2), case.time.size)
    starts = np.arange(0, case.time.size - length + 1, max(round(STRIDE / step), 1))
    before = np.concatenate([scale, prior(system)])
    scaled = gramians(model, starts, length) * np.outer(before, before)
    return WindowTest(
        model=fmu.name.rpartition(".")[2],
        states=fmu.states,
        time=case.time[starts + length - 1],
        remaining=remaining(scaled)[:, :count],
        bound=bounds(model, starts, length, before)[:, count:],
        serving=np.array([quantity.useful for quantity in system.estimated]),
    )


def inseparable(fmu: FMU, system: System, case: Case) -> dict[tuple[str, ...], float]:
    """Estimated quantities that a recording cannot tell apart, and their correlation.

    By the Fisher information of the whole recording on starts and constant quantities, at nominal
    quantities: a filter that linearises where its estimate is gains information that is none. Of
    a direction of several quantities half of what was unknown before is left.
    Source: S. Huang, G. Dissanayake (2007), IEEE Trans. Robotics 23, 1036-1049 (estimates of
    filters that are too sure as they linearise at changing points).
    """
    q = len(system.estimated)
    if q < 2 or case.time.size < 3:
        return {}
    kept = np.unique(np.linspace(0, case.time.size - 1, _POINTS).astype(int))
    held = [output.name for output in system.outputs if output.name in fmu.states]
    values = np.column_stack([case[name][kept] for name in held]) if held else None
    if values is not None and not np.isfinite(values).all():
        return {}
    places = [fmu.states.index(name) for name in held]
    fmu.begin_at(case.model_time)
    fmu.start({} if values is None else dict(zip(held, values[0], strict=True)))
    u = np.column_stack([case.u[kept], np.zeros((kept.size, q))])
    inputs = fmu.variables(_inputs(system))
    x = np.tile(fmu.get_states(), (kept.size, 1))
    if values is not None:
        x[:, places] = values
    if len(fmu.states) > len(held):
        for k, h in enumerate(np.diff(case.time[kept])):
            fmu.set_time(fmu.start_time + case.time[kept[k]] - case.time[0])
            fmu.set_states(x[k])
            fmu.set(inputs, u[k])
            free = fmu.step(h)
            if values is not None:
                free[places] = values[k + 1]
            x[k + 1] = free
    model = linearise_along(fmu, system, case.time[kept], x, u)
    n = len(fmu.states)
    sizes = {v.name: abs(v.nominal or 1.0) for v in fmu.description.variables}
    states = [max(system.spreads.get(name, 0.0), sizes[name]) for name in fmu.states]
    before = np.array([*states, *prior(system)])
    share = case.time.size / kept.size  # each point stands for so many samples
    gramian = share * gramians(model, np.zeros(1, int), kept.size)[0]
    left = np.linalg.inv(np.eye(n + q) + gramian * np.outer(before, before))[n:, n:]
    if not np.isfinite(left).all():
        return {}
    known_of = {}
    variances, directions = np.linalg.eigh(left)
    for variance, direction in zip(variances, directions.T, strict=True):
        of = np.flatnonzero(direction**2 > _PART)
        if variance > _LEFT**2 and of.size > 1:
            known = left[of[0], of[1]] / np.sqrt(left[of[0], of[0]] * left[of[1], of[1]])
            known_of[tuple(system.estimated[i].name for i in of)] = float(known)
    return known_of


def follow(fmu: FMU, system: System, case: Case, run: Run) -> tuple[Matrix, Matrix]:
    """Run a model along an estimate: outputs that are states, and quantities, are the estimate's.

    States that the estimate does not hold follow from the model, driven by the estimate.

    Returns
    -------
    x : (n, k) states.
    u : (n, m + q) measured inputs, corrections.
    """
    held = [output.name for output in system.outputs if output.name in fmu.states]
    places = [fmu.states.index(name) for name in held]
    values = np.column_stack([run.signal(name) for name in held]) if held else case.y[:, :0]
    fmu.begin_at(case.model_time)
    fmu.start(dict(zip(held, values[0], strict=True)))
    corrections = [
        run.signal(quantity.name) - fmu.defaults[quantity.name] for quantity in system.estimated
    ]
    u = np.column_stack([case.u, *corrections])
    inputs = fmu.variables(_inputs(system))
    x = np.tile(fmu.get_states(), (case.time.size, 1))
    x[:, places] = values
    if len(fmu.states) > len(held):
        for k, h in enumerate(np.diff(case.time)):
            fmu.set_time(fmu.start_time + case.time[k] - case.time[0])
            fmu.set_states(x[k])
            fmu.set(inputs, u[k])
            x[k + 1] = fmu.step(h)
            x[k + 1, places] = values[k + 1]
    return x, u


def linearise_along(fmu: FMU, system: System, time: Vector, x: Matrix, u: Matrix) -> SampledModel:
    """Linearise a model at every sample of a trajectory, estimated quantities as constant states.

    Parameters
    ----------
    time : (n,) [s].
    x : (n, k) states.
    u : (n, m + q) measured inputs, corrections.
    """
    fmu.start({})
    inputs = fmu.variables(_inputs(system))
    names = [output.name for output in system.outputs]
    unseen = fmu.variables([name for name in names if name not in fmu.states])
    n, count = x.shape
    m, q = len(system.inputs), len(system.estimated)
    generator = np.zeros((n, count + m + q, count + m + q))
    # Of the outputs by states, inputs and corrections; a state is an output by itself.
    slopes = np.zeros((n, len(names), count + m + q))
    y = np.zeros((n, len(names)))
    seen = [(j, fmu.states.index(name)) for j, name in enumerate(names) if name in fmu.states]
    others = [j for j, name in enumerate(names) if name not in fmu.states]
    for j, state in seen:
        slopes[:, j, state], y[:, j] = 1.0, x[:, state]
    for k in range(n):
        fmu.set_time(fmu.start_time + time[k] - time[0])
        fmu.set_states(x[k])
        fmu.set(inputs, u[k])
        fmu.check_event()
        if others:
            linear = fmu.linearise(inputs, unseen)
            generator[k, :count] = np.hstack([linear.A, linear.B])
            slopes[k, others] = np.hstack([linear.C, linear.D])
            y[k, others] = fmu.get(unseen)
        else:
            generator[k, :count, :count] = fmu.state_jacobian()
            generator[k, :count, count:] = fmu.input_jacobian(inputs)
    steps = np.append(np.diff(time), time[-1] - time[-2])
    # Exact for inputs held over the step; Van Loan (1978), IEEE Trans. Autom. Control 23, 395.
    transition = exponentials(generator * steps[:, None, None])
    kept = [*range(count), *range(count + m, count + m + q)]
    driven = slice(count, count + m)
    noise = np.array([signal.noise_at_scale for signal in system.inputs])
    sensors = np.column_stack(
        [output.deviation(values) for output, values in zip(system.outputs, y.T, strict=True)]
    )
    return SampledModel(
        names=(*fmu.states, *system.corrections),
        Phi=transition[:, kept][:, :, kept],
        Gamma=transition[:, kept, driven] * noise,
        C=slopes[:, :, kept],
        R=sensors**2 + ((slopes[:, :, driven] * noise) ** 2).sum(axis=2),
    )


def _inputs(system: System) -> list[str]:
    return [*(signal.name for signal in system.inputs), *system.corrections]
