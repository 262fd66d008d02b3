"""One sample of the moving horizon estimator beside the same problem in CasADi and IPOPT."""

import statistics
import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from workbench.arrays import Vector
from workbench.models.compiler.explicit import StateSpace, make_explicit
from workbench.models.compiler.flat import flatten
from workbench.models.fmu import FMU
from workbench.observers.estimators.moving_horizon.estimator import MovingHorizonEstimator
from workbench.observers.estimators.moving_horizon.window import Window
from workbench.observers.estimators.moving_horizon.window_cost import cost
from workbench.recordings.case import Case
from workbench.system.registry import open_model
from workbench.system.system import OBSERVER, System

_SAMPLES = 400  # timed, from the middle of the recording on
_REPEATS = 7
_CONVERGED = 50  # iterations
# IPOPT ends where its conditions hold to 1e-8; costs are sums of about a hundred squares.
_AGREEMENT = 1e-5


@dataclass(frozen=True)
class HorizonTimes:
    """Medians over repeats [s]."""

    unknowns: int  # states and quantities
    samples: int  # of the horizon
    ours: float  # of one sample, one iteration
    ipopt: float  # of the same problem from its solution on, with exact derivatives of the model

    def ratios(self) -> dict[str, float]:
        """How many times as long IPOPT takes."""
        return {"ipopt": self.ipopt / self.ours}


def time_horizon(case: Case, system: System) -> HorizonTimes:
    """Time a window in the middle of a recording, where all bounds are far.

    Raises
    ------
    ArithmeticError
        If IPOPT finds another minimum, because then it solves another problem.
    """
    half = case.time.size // 2
    steps = np.diff(case.time, prepend=case.time[0])
    with open_model(system) as fmu:
        estimator = MovingHorizonEstimator.untuned(fmu, system)
        spent = []
        part = slice(half, half + _SAMPLES)
        for _ in range(_REPEATS):
            estimator.start(case.u[0], case.y[0])
            estimator.advance(steps[:half], case.u[:half], case.y[:half])
            begin = time.perf_counter()
            estimator.advance(steps[part], case.u[part], case.y[part])
            spent.append((time.perf_counter() - begin) / steps[part].size)
        window = _converged(fmu, system, case)
        data = window.data
        ipopt, value = _solve(window, fmu, system)
        if not abs(value - cost(window)) <= _AGREEMENT * value:
            raise ArithmeticError(
                f"the cost is {cost(window)} by the estimator and {value} by IPOPT, so that their "
                "times are not those of the same problem"
            )
    return HorizonTimes(
        data.mean.size, int(data.filled[0]), statistics.median(spent), statistics.median(ipopt)
    )


def format_horizon(times: HorizonTimes) -> str:
    """The measurements in a line."""
    return (
        f"moving horizon, {times.samples} samples of {times.unknowns} unknowns: "
        f"{1e6 * times.ours:.1f} us for a sample; the same problem in CasADi and IPOPT "
        f"{1e3 * times.ipopt:.1f} ms, {times.ratios()['ipopt']:.0f} times as long"
    )


def _converged(fmu: FMU, system: System, case: Case) -> Window:
    """The window over the first half of a recording, whose last problem is solved to the end."""
    gains = MovingHorizonEstimator.default_gains(fmu, system)
    design = {**gains.design, "iterations": np.array([float(_CONVERGED)])}
    half = case.time.size // 2
    estimator = MovingHorizonEstimator(
        fmu, system, type(gains)(gains.estimator, gains.names, gains.values, design, "")
    )
    estimator.run(case.time[:half], case.u[:half], case.y[:half])
    return estimator.window


def _step(space: StateSpace, fmu: FMU, system: System) -> ca.Function:
    """The linearly implicit step: node, measured inputs and h to where it leads and outputs."""
    measured, corrections = [signal.name for signal in system.inputs], list(system.corrections)
    z = ca.SX.sym("z", len(space.states) + len(corrections))
    given, h = ca.SX.sym("u", len(measured)), ca.SX.sym("h")
    n = len(space.states)
    x, known = z[:n], dict(zip(measured, ca.vertsplit(given), strict=True))
    known |= dict(zip(corrections, ca.vertsplit(z[n:]), strict=True))
    u = ca.vertcat(*(known.get(_ours(fmu, v.name), v.start) for v in space.inputs))
    p = ca.vertcat(*(fmu.defaults.get(_ours(fmu, v.name), v.start) for v in space.parameters))
    model = ca.Function("model", [space.t, space.x, space.u, space.p], [space.f, space.w])
    rates, _ = model(0.0, x, u, p)
    after = x + ca.solve(ca.SX.eye(n) - h * ca.jacobian(rates, x), h * rates)
    end = ca.vertcat(after, z[n:])
    _, shown = model(0.0, after, u, p)
    outputs = {_ours(fmu, v.name): shown[i] for i, v in enumerate(space.outputs)}
    outputs |= {_ours(fmu, v.name): after[i] for i, v in enumerate(space.states)}
    seen = ca.vertcat(*(outputs[output.name] for output in system.outputs))
    return ca.Function("step", [z, given, h], [end, seen])


def _ours(fmu: FMU, name: str) -> str:
    ours = {theirs: our for our, theirs in fmu.names.items()}
    return ours.get(name, name)


def _solve(window: Window, fmu: FMU, system: System) -> tuple[list[float], float]:
    """Times of IPOPT, from the solution on, and the cost that it finds."""
    data = window.data
    model = system.model(OBSERVER)
    name = f"{system.library.parent.name}.{model.name}"
    step = _step(make_explicit(flatten(system.library, name)), fmu, system)
    N, s = int(data.filled[0]), data.mean.size
    nodes = ca.SX.sym("s", s, N)
    spread = data.covariance + np.diag(data.noise[0] * data.wider[0])
    root = np.linalg.cholesky(np.linalg.inv(spread))
    terms = [root.T @ (nodes[:, 0] - data.mean)]
    for k in range(N):
        before, after = data.inputs[k, :-1], data.reached[k, :-1]
        end, seen = step(nodes[:, k], np.where(system.holds > 0.0, before, after), data.steps[k])
        terms.append((data.samples[k] - seen) / np.sqrt(data.levels[k]))
        if k + 1 < N:
            noise = np.sqrt(data.noise[k + 1] * data.wider[k + 1])
            terms.append((nodes[:, k + 1] - end) / noise)
    problem = {"x": ca.vec(nodes), "f": ca.sumsqr(ca.vertcat(*terms))}
    quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
    solver = ca.nlpsol("solver", "ipopt", problem, quiet)
    low, high = np.tile(data.low, N), np.tile(data.high, N)
    spent: list[float] = []
    start: Vector = data.nodes[:N].ravel()
    for _ in range(_REPEATS):
        begin = time.perf_counter()
        solution = solver(x0=start, lbx=low, ubx=high)
        spent.append(time.perf_counter() - begin)
    return spent, float(solution["f"])
