"""What measured outputs can tell about states and estimated quantities, a stage after the runs.

Information is counted against the noise of the sensors and against what is known beforehand, so
that "observable" has a meaning on a machine: a window of samples says more than the prior did.

The linear test takes a second at an operating point, as Schwarz et al. (2018) do before they choose
the model of an observer. The nonlinear test linearises along a recording, which gives the local
observability Gramian of every window; estimated quantities join the states as unknown constants.
Sources: Krener and Ide (2009), Measures of unobservability, 48th IEEE CDC; Van Trees (1968),
Detection, Estimation, and Modulation Theory I, section 2.4 (Cramer-Rao bound with a prior).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.fmu import FMU
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.observers.operating import settle, start_spreads
from workbench.observers.replay import quantities_with_rules, replay
from workbench.observers.run import Ending, Run
from workbench.observers.score import judged_window
from workbench.observers.trajectory import driving_names, states_that_follow, trajectory
from workbench.recordings.case import Case
from workbench.system.parts import OperatingPoint
from workbench.system.registry import open_model
from workbench.system.system import OBSERVER, System


@dataclass(frozen=True)
class SampledModel:
    """A linearised model: x[i+1] = Phi[i] x[i] + Gamma[i] v[i], y[i] = C[i] x[i]."""

    # (k,) states, then corrections of the estimated quantities, which are constant
    names: tuple[str, ...]
    Phi: Matrix  # (n, k, k) from one sample to the next
    Gamma: Matrix  # (n, k, m) effect of one standard deviation of the noise of each input
    C: Matrix  # (n, l, k) of the measured outputs
    R: Matrix  # (n, l) variance of the outputs [their unit squared]


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
STRIDE = 0.1  # [s] from one window to the next
_SECOND = 200  # samples of the linear test at least, which are a second at 200 Hz
_NOTHING = 1e-6  # of a state's size: what rounding and differences leave where nothing moves it
_PART = 0.1  # share of a direction that counts as part of it
_TOGETHER = 0.3  # correlation of what acts together; of four of which one sum is known, a third
_LEFT = 0.5  # share of what was unknown of a direction, of which nothing to speak of was learnt


def tested_span(system: System) -> float:
    """Length of the linear test [s]: a second, and more where samples are far apart."""
    return max(1.0, _SECOND * system.sample_time)


def prior(system: System) -> Vector:
    """Standard deviation of the estimated quantities before a measurement, (q,).

    Any value of its range is as likely.
    """
    ranges = np.array([quantity.prior for quantity in system.estimated]).reshape(-1, 2)
    deviation: Vector = np.diff(ranges)[:, 0] / np.sqrt(12.0)
    return deviation


@dataclass(frozen=True)
class LinearTest:
    """Observability at an operating point from samples of a second, see `tested_span`."""

    model: str  # name of the model, without its library
    states: tuple[str, ...]  # (k,) names
    x: Vector  # (k,) operating point
    # (k,) largest deviation that a quantity off by its prior causes within the second, or what is
    # not known of the state at the start, where no quantity moves it or that is declared
    scale: Vector
    # (k,) eigenvalues of the Gramian in units of `scale`, ascending [1]: squared ratio of signal to
    # noise. Above 1 the samples say more than `scale` does.
    information: Vector
    directions: Matrix  # (k, k) unit vectors in units of `scale`, one column per eigenvalue
    # (k,) standard deviation left of each state after the second, over `scale` [1]
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
    """Observability along a recording, window by window."""

    model: str  # name of the model, without its library
    states: tuple[str, ...]  # (k,) names
    time: Vector  # (m,) end of the window [s]
    span: float  # length of a window [s]
    # (m, k) standard deviation left of each state at the window's begin, over its scale, with all
    # estimated quantities unknown [1]
    remaining: Matrix
    bound: Matrix  # (m, q) Cramer-Rao bound of the estimated quantities [their unit]
    serving: Vector  # (q,) bounds from which on an estimate serves [its unit]

    def states_observable(self) -> NDArray[np.bool_]:
        """(m, k) whether a window says more about a state than its scale does."""
        # Equal information of prior and window halves the variance.
        return self.remaining**2 < 0.5

    def useful(self) -> NDArray[np.bool_]:
        """(m, q) whether the bounds are such that estimates serve."""
        return self.bound < self.serving


@dataclass(frozen=True)
class Information:
    """What a whole recording tells of constant quantities, and of the states at its end."""

    # states, quantities: (n,) and (q,) names
    states: tuple[str, ...]
    quantities: tuple[str, ...]
    # (n + q, n + q) covariance that no estimator falls below, in units of what is known before:
    # standard deviations of states at the start, see `start_spreads`, and of quantities, see
    # `prior`
    left: Matrix
    ruled: frozenset[str] = frozenset()  # quantities of which the machine says where they are told

    @property
    def inseparable(self) -> dict[tuple[str, ...], float]:
        """What cannot be told apart, an estimated quantity among it, and the largest correlation.

        Of a direction of several, half of what was unknown before is left.
        """
        names, groups = (*self.states, *self.quantities), {}
        correlation = self._correlation
        partners = (np.abs(correlation) > _TOGETHER) & self._unknown & self._unknown[:, None]
        for i in range(len(self.states), len(names)):
            members = {i}
            while True:
                reached = partners[sorted(members)].any(axis=0)
                if more := {int(j) for j in np.flatnonzero(reached)} - members:
                    members |= more
                else:
                    break
            if self._unknown[i] and len(members) > 1:
                within = sorted(members)
                pairs = correlation[np.ix_(within, within)][np.triu_indices(len(within), 1)]
                groups[tuple(names[j] for j in within)] = float(pairs[np.abs(pairs).argmax()])
        return groups

    @property
    def untold(self) -> tuple[str, ...]:
        """Estimated quantities of which a recording tells less than half, whatever others are."""
        grouped = {*self.ruled, *(name for names in self.inseparable for name in names)}
        unknown = self._unknown[len(self.states) :]
        return tuple(
            name
            for name, left in zip(self.quantities, unknown, strict=True)
            if left and name not in grouped
        )

    @property
    def _correlation(self) -> Matrix:
        deviations = np.sqrt(np.maximum(self.left.diagonal(), np.finfo(float).tiny))
        correlation: Matrix = self.left / np.outer(deviations, deviations)
        return correlation

    @property
    def _unknown(self) -> NDArray[np.bool_]:
        """What takes part in a direction of which half is left, (n + q,)."""
        variances, directions = np.linalg.eigh(self.left)
        part: NDArray[np.bool_] = (directions[:, variances > _LEFT**2] ** 2).sum(axis=1) > _PART
        return part


@dataclass(frozen=True)
class CaseObservability:
    """Tests of several models along one recording."""

    # system, case: the recording, and what it is of
    system: System
    case: Case
    run: Run  # the estimate that makes the trajectory
    judged: NDArray[np.bool_]  # (m,) windows that end in the time that is judged
    tests: tuple[WindowTest, ...]  # one per model, with the same windows
    # of the whole recording, by the observer's model; None where there is none
    information: Information | None


def case_observability(
    system: System, scales: Mapping[str, Vector], case: Case
) -> CaseObservability:
    """Test models along one recording, where the disturbance observer takes it to be.

    Where outputs do not show all that it needs, at nominal quantities and measured outputs.

    Parameters
    ----------
    scales : by role of the model, see LinearTest.
    """
    with open_model(system, OBSERVER) as fmu:
        whole = information(fmu, system, case)
        try:
            run = replay(case, DisturbanceObserver.untuned(fmu, system))
        except InputError:
            run = replay(case, OpenLoop.untuned(fmu, system))
            run = replace(run, estimate=_estimate_of_outputs(case, system, run))
    if run.ending is not Ending.OK:
        raise FMUError(f"{case.name}: {run.ending.value} {run.message}".strip())
    tests, unknowns = [], max(map(len, scales.values())) + len(system.estimated)
    for role, scale in scales.items():
        with open_model(system, role) as fmu:
            tests.append(window_test(fmu, system, case, run, scale, unknowns))
    counted = np.isin(tests[0].time, case.time[judged_window(case, system)])
    return CaseObservability(system, case, run, counted, tuple(tests), whole)


def _estimate_of_outputs(case: Case, system: System, run: Run) -> Matrix:
    """An open loop's estimate, (n, w), with outputs as measured; samples that are missing hold."""
    columns = {name: run.signal(name) for name in run.columns}
    for output in system.outputs:
        known = np.isfinite(case[output.name])
        columns[output.name] = np.interp(case.time, case.time[known], case[output.name][known])
    return np.column_stack(list(columns.values()))


def linear_test(fmu: FMU, system: System, point: OperatingPoint | None = None) -> LinearTest:
    """Test a model at an operating point, that of the system unless another is given.

    The rank of an observability matrix depends on units and on a tolerance. Here units are the
    deviations that matter, the tolerance is the noise of the sensors: the eigenvalues of the
    Gramian are squared ratios of signal to noise.
    """
    x, u = settle(fmu, system, point or system.tested)
    count, second = len(fmu.states), max(round(tested_span(system) / system.sample_time), 1)
    repeated = (second + 1, 1)
    time = tested_span(system) * np.arange(second + 1) / second
    model = linearise_along(fmu, system, time, np.tile(x, repeated), np.tile(u, repeated))
    response = np.vstack([np.zeros((count, len(system.estimated))), np.diag(prior(system))])
    scale = np.zeros(count)
    for Phi in model.Phi[:-1]:
        response = Phi @ response
        scale = np.maximum(scale, np.abs(response[:count]).max(axis=1, initial=0.0))
    spreads = start_spreads(fmu, system)
    still = scale <= _NOTHING * spreads
    declared = np.array([name in system.spreads for name in fmu.states], bool)
    scale = np.where(still | declared, np.maximum(scale, spreads), scale)
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


def window_test(
    fmu: FMU, system: System, case: Case, run: Run, scale: Vector, unknowns: int
) -> WindowTest:
    """Test a model along a recording, in windows of WINDOW seconds.

    Of more where few samples are in them: k samples can show k unknowns, and twice as many leave
    some to average.

    Parameters
    ----------
    run : an estimate that follows the recording; its outputs and quantities make the trajectory.
        The tests hold there, and an estimate that errs may be at a place where more is known.
    scale : (k,) of the model's states, see LinearTest.
    unknowns : states and quantities of the largest model that is tested beside it.
    """
    count = len(fmu.states)
    x, u = follow(fmu, system, case, run)
    model = linearise_along(fmu, system, case.time, x, u)
    step = (case.time[-1] - case.time[0]) / (case.time.size - 1)
    length = min(max(round(WINDOW / step), 2 * unknowns), case.time.size)
    stride = max(round(STRIDE / step), 1)
    starts = np.arange(0, case.time.size - length + 1, stride)
    before = np.concatenate([scale, prior(system)])
    scaled = gramians(model, starts, length) * np.outer(before, before)
    return WindowTest(
        model=fmu.name.rpartition(".")[2],
        states=fmu.states,
        time=case.time[starts + length - 1],
        span=round(length * step, 9),
        remaining=remaining(scaled)[:, :count],
        bound=bounds(model, starts, length, before)[:, count:],
        serving=np.array([quantity.useful for quantity in system.estimated]),
    )


def information(fmu: FMU, system: System, case: Case) -> Information | None:
    """Fisher information of a whole recording on states and quantities; None where none is told.

    At nominal quantities: a filter that linearises where its estimate is gains information that is
    none. Source: S. Huang, G. Dissanayake (2007), IEEE Trans. Robotics 23, 1036-1049.
    """
    path = trajectory(fmu, system, case) if case.time.size > 2 else None
    if path is None or not system.estimated:
        return None
    model = linearise_along(fmu, system, case.time[path.samples], path.x, path.u)
    before = np.array([*start_spreads(fmu, system), *prior(system)])
    # In units of what is known before: an information of starts, summed over the recording, would
    # grow beyond all numbers where a model is unstable, as a wheel near standstill is.
    size = np.where(before > 0.0, before, 1.0)
    Phi, C = model.Phi * size / size[:, None], model.C * size
    R = model.R * path.samples.size / case.time.size  # each point stands for so many samples
    P, identity = np.diag(np.sign(before)), np.eye(before.size)
    for k in range(path.samples.size):
        gain = np.linalg.solve(C[k] @ P @ C[k].T + np.diag(R[k]), C[k] @ P).T
        kept = identity - gain @ C[k]
        P = kept @ P @ kept.T + gain * R[k] @ gain.T
        if k + 1 < path.samples.size:
            P = Phi[k] @ P @ Phi[k].T
    if not np.isfinite(P).all():
        return None
    quantities = tuple(quantity.name for quantity in system.estimated)
    ruled = frozenset(quantities_with_rules(system))
    return Information(fmu.states, quantities, P, ruled)


def guesses(inseparable: Mapping[tuple[str, ...], float], untold: Sequence[str]) -> list[str]:
    """What is said of quantities that a recording does not tell, see `Information`."""
    together = [
        f"{' and '.join(names)} are indistinguishable in this recording (correlation "
        f"{correlation:.4f}): their estimates are guesses, and others fit as well. Estimate "
        "one of them, or record what moves one of them alone"
        for names, correlation in inseparable.items()
    ]
    alone = [
        f"{name} is not shown by this recording, which tells less than half of what is not known "
        "of it: its estimate is a guess. Record what moves it, or give it a known value"
        for name in untold
    ]
    return together + alone


def follow(fmu: FMU, system: System, case: Case, run: Run) -> tuple[Matrix, Matrix]:
    """Run a model along an estimate: outputs that are states, and quantities, are the estimate's.

    States that the estimate does not hold follow from the model, driven by the estimate.

    Returns
    -------
    x : (n, k) states.
    u : (n, m + q) measured inputs, corrections.
    """
    held = [output.name for output in system.outputs if output.name in fmu.states]
    values = np.column_stack([run.signal(name) for name in held]) if held else case.y[:, :0]
    corrections = [
        run.signal(quantity.name) - fmu.defaults[quantity.name] for quantity in system.estimated
    ]
    u = np.column_stack([case.u, *corrections])
    fmu.begin_at(case.model_time)
    return states_that_follow(fmu, system, case.time, held, values, u), u


def linearise_along(fmu: FMU, system: System, time: Vector, x: Matrix, u: Matrix) -> SampledModel:
    """Linearise a model at every sample of a trajectory, estimated quantities as constant states.

    Parameters
    ----------
    time : (n,) [s].
    x : (n, k) states.
    u : (n, m + q) measured inputs, corrections.
    """
    fmu.start({})
    inputs = fmu.variables(driving_names(system))
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
        if not all(np.isfinite(part[k]).all() for part in (x, generator, slopes, y)):
            raise FMUError(
                f"{fmu.called}: its states, outputs or derivatives are no finite numbers at "
                f"{fmu.time[0]:.6g} s of its time"
            )
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
