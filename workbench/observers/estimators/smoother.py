"""The smoother: the best trajectory through a whole recording, which knows what comes later."""

from typing import NoReturn

import numpy as np
from scipy.fft import next_fast_len

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.native import assign, compiled, raise_on_failure
from workbench.observers.contract import Estimate
from workbench.observers.estimators.kalman import carry, finish
from workbench.observers.estimators.moving_horizon.estimator import (
    ROUNDING,
    HorizonState,
    MovingHorizonEstimator,
    expand,
    horizon_step,
    move,
)
from workbench.observers.estimators.moving_horizon.window import (
    Data,
    end,
    measurement_update,
    solve_damped,
    solve_free,
    window,
)
from workbench.observers.estimators.moving_horizon.window_bounds import push
from workbench.observers.estimators.moving_horizon.window_cost import cost
from workbench.observers.estimators.moving_horizon.window_spread import gather_spread, spread
from workbench.observers.layout import assign_rows, clip, measure

# Share of its noise below which a step follows the model: where feedback has faded to a thousandth.
_FAINTEST = 1e-6
# Damping, as a share of what the filter knows: first, from one trial to the next, last.
_FIRST, _FACTOR, _LEAST, _MOST = 1e-2, 10.0, 1e-6, 1e6
_ITERATIONS = 30  # of Gauss and Newton
_SETTLED = 1e-4  # share of the cost by which an iteration that is the last one lowers it
_ROUNDS = 10  # of bounds, in each iteration
_TOLERANCE = 1e-9  # standard deviations by which a bound may be missed, see `bound`


@compiled
def _keep(settings, whole, part, k):  # type: ignore[no-untyped-def]
    """Take node k of the moving horizon over, with the noise that was decided there."""
    at = whole.filled[0]
    whole.filled[0] = at + 1
    whole.steps[at] = part.steps[k]
    assign(whole.inputs[at], part.inputs[k])
    assign(whole.reached[at], part.reached[k])
    assign(whole.samples[at], part.samples[k])
    assign(whole.levels[at], part.levels[k])
    assign(whole.weight[at], part.weight[k])
    assign(whole.wider[at], part.wider[k])
    for i in range(settings.walk.size):
        least = _FAINTEST * part.steps[k] * settings.walk[i] ** 2
        whole.noise[at, i] = part.noise[k, i] if part.noise[k, i] > least else 0.0


@compiled
def _go_forward(model, settings, horizon, state, steps, u, y, estimates):  # type: ignore[no-untyped-def]
    """Run the moving horizon, which learns noise levels, outliers and jumps; returns a status.

    Parameters
    ----------
    state : with the window of the whole recording, which is filled.
    """
    whole, part = state.window.data, horizon.window.data
    whole.filled[0] = 0
    for k in range(steps.size):
        if steps[k] > 0.0 and part.filled[0] == part.steps.size:
            _keep(settings, whole, part, 0)
        status = horizon_step(model, settings, horizon, steps[k], u[k], y[k], estimates[k])
        if status:
            return status
        if k == 0:
            assign(whole.mean, state.filter.z)
            assign_rows(whole.covariance, state.filter.P)
    for k in range(part.filled[0]):
        _keep(settings, whole, part, k)
    return 0


@compiled
def _filter_again(model, settings, state):  # type: ignore[no-untyped-def]
    """Lay the nodes along an extended Kalman filter with the noise of the window; a status."""
    window, seen, z, status = state.window, settings.layout.seen, state.filter.z, 0
    data, solution, scratch = window.data, window.solution, window.scratch
    P, error = solution.P, solution.error
    assign(z, data.mean)
    assign_rows(P, data.covariance)
    for k in range(data.filled[0]):
        for i in range(z.size):
            data.nodes[k, i] = z[i]
            error[i] = 0.0
        for i in range(z.size):
            P[i, i] += data.noise[k, i] * data.wider[k, i]
        status = status or expand(model, settings, state, k)
        carry(data.F[k], P, scratch.product)
        for j in range(seen.size):
            if not np.isnan(data.errors[k, j]):
                variance = data.levels[k, j] / data.weight[k, j]
                measurement_update(
                    solution,
                    solution.gain[k, j],
                    data.slopes[k, j],
                    seen[j],
                    data.errors[k, j],
                    variance,
                )
        for i in range(z.size):
            z[i] = clip(data.arrived[k, i] + error[i], data.low[i], data.high[i])
    return status


@compiled
def _solve(window, seen, damping):  # type: ignore[no-untyped-def]
    """Best damped change of the nodes within bounds, after `solve_free`.

    Bounds that are missed become active and those that pull are let go, all at once, in a few
    rounds: a recording has thousands of them. Source: M. Hintermüller, K. Ito, K. Kunisch (2003),
    SIAM J. Optim. 13, 865-888.
    """
    data, solution = window.data, window.solution
    outputs = seen.size
    for _ in range(_ROUNDS):
        solve_damped(window, seen, damping)
        changed = False
        for k in range(data.filled[0]):
            for i in range(data.mean.size):
                if data.low[i] == -np.inf and data.high[i] == np.inf:
                    continue
                if solution.active[k, i] != 0:
                    solution.multiplier[k, i] = push(window, outputs, k, i)
                    if solution.multiplier[k, i] < 0.0 or solution.total[k, outputs + i] == 0.0:
                        solution.active[k, i], changed = 0, True
                    continue
                value, slack = end(window, k, i), _TOLERANCE * np.sqrt(solution.scale[k, i])
                if value > data.high[i] + slack:
                    solution.active[k, i], changed = 1, True
                elif value < data.low[i] - slack:
                    solution.active[k, i], changed = -1, True
                solution.multiplier[k, i] = 0.0
        if not changed:
            break


@compiled
def _improve(model, settings, state, damping):  # type: ignore[no-untyped-def]
    """Move the nodes by a damped step that lowers the cost, damped as much as that takes.

    Returns a status, the damping (beyond the most where no step lowers it), and by which share the
    cost fell.
    """
    window, seen = state.window, settings.layout.seen
    solve_free(window, seen)
    while damping <= _MOST:
        _solve(window, seen, damping)
        before = cost(window)
        status = move(model, settings, state, 1.0)
        after = cost(window)
        if status or after <= before + ROUNDING * (1.0 + before):
            return status, damping, (before - after) / (1.0 + before)
        status = move(model, settings, state, -1.0)
        if status or damping == 0.0:
            break
        damping *= _FACTOR
    return status, 2.0 * _MOST, 0.0


@compiled
def _settle(model, settings, state):  # type: ignore[no-untyped-def]
    """Bring the nodes to the best trajectory; returns a status."""
    damping = _FIRST
    for _ in range(_ITERATIONS):
        status, damping, fell = _improve(model, settings, state, damping)
        if status:
            return status
        if damping > _MOST or (damping <= 1.0 and fell < _SETTLED):
            break
        damping = max(damping / _FACTOR, _LEAST)
    status, damping, fell = _improve(model, settings, state, 0.0)
    return status


@compiled
def _report(model, settings, state, known, u, estimates):  # type: ignore[no-untyped-def]
    """Write the smoothed estimates over those of the way forward; returns a status."""
    window, filter_ = state.window, state.filter
    data, solution = window.data, window.solution
    z, seen = filter_.z, settings.layout.seen
    solve_free(window, seen)
    gather_spread(window, seen, known)
    for i in range(z.size):
        z[i] = data.nodes[0, i]
        z[i] += data.noise[0, i] * data.wider[0, i] * solution.costates[0, i]
    assign_rows(filter_.P, known.first)
    status = measure(model, u[0]) or finish(model, settings, filter_, estimates[0])
    for k in range(data.filled[0]):
        assign(z, data.arrived[k])
        assign_rows(filter_.P, known.covariances[k])
        status = status or measure(model, u[k + 1])
        status = status or finish(model, settings, filter_, estimates[k + 1])
    return status


@compiled
def _go_back(model, settings, state):  # type: ignore[no-untyped-def]
    """Find the best trajectory from that of a filter; returns a status."""
    return _filter_again(model, settings, state) or _settle(model, settings, state)


@compiled
def _finish(model, settings, state, known, u, estimates):  # type: ignore[no-untyped-def]
    """Find the best trajectory from one that is near, and write it; returns a status."""
    status = _settle(model, settings, state)
    return status or _report(model, settings, state, known, u, estimates)


def excess(errors: Vector, lags: int) -> float:
    """Variance of sums of errors over that of white noise, at least 1: samples that count as one.

    1 + 2 sum (1 - l/(lags + 1)) autocorrelation(l). Source: W. Newey, K. West (1987),
    Econometrica 55, 703-708, equation (5).

    Parameters
    ----------
    errors : (n,), NaN of samples that are missing.

    Examples
    --------
    >>> round(excess(np.random.default_rng(1).standard_normal(20000), 10), 1)
    1.0
    >>> round(excess(np.ones(20000), 10), 1)  # a sensor that is off all the time
    11.0
    """
    e = np.nan_to_num(errors)
    lags = min(lags, e.size - 1)
    total = float(e @ e)
    if not total > 0.0:
        return 1.0
    shares = 1.0 - np.arange(1, lags + 1) / (lags + 1)
    # By Fourier transforms, over so many samples that the ends do not meet: of 12 000 samples and
    # 4 000 lags 0.4 ms, where products lag by lag took 0.4 s.
    spectrum = np.abs(np.fft.rfft(e, size := next_fast_len(e.size + lags, real=True))) ** 2
    products = np.fft.irfft(spectrum, size)[1 : lags + 1]
    return max(1.0 + 2.0 * float(shares @ products) / total, 1.0)


class Smoother(MovingHorizonEstimator):
    """Best trajectory through a whole recording, with standard deviations.

    The problem of the moving horizon estimator over all samples: with the noise levels, weights of
    outliers and jumps that it decides on the way forward, its bounds, steps and derivatives. An
    output whose errors are not white on that way has the noise that makes their sum as uncertain as
    it is: a wrong scale counts once, not with each sample (`excess`, over the time in which noise
    is learnt). From a filter with that noise, iterations of Gauss and Newton, damped where they
    would raise the cost, lead to the least squares. NIS is that of the way forward. A linear model
    has the smoother of Rauch, Tung and Striebel.
    Sources: B. Bell (1994), SIAM J. Optim. 4, 626-636; S. Särkkä, L. Svensson (2020),
    Levenberg-Marquardt and line-search extended Kalman smoothers, ICASSP.
    """

    name = "smoother"
    label = "smoother, knows the whole recording"
    rank = 48
    offline = True
    tunable = False
    tuned_as = MovingHorizonEstimator.name

    def init(self, t: float, u: Vector, y: Vector) -> NoReturn:
        """Refuse single samples."""
        self._refuse()

    def step(self, t: float, u: Vector, y: Vector) -> NoReturn:
        """Refuse single samples."""
        self._refuse()

    def advance(self, steps: Vector, u: Matrix, y: Matrix) -> NoReturn:
        """Refuse pieces."""
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise InputError(
            where=f"estimator {self.name}",
            found="a part of a recording",
            expected="a whole one: it estimates each sample from those before and after it",
            remedy=f"take `run`, or the estimator {MovingHorizonEstimator.name}",
        )

    def run(self, time: Vector, u: Matrix, y: Matrix) -> Estimate:
        """Smooth a recording; see Estimator."""
        self.start(u[0], y[0])
        estimates = np.full((time.size, self._width), np.nan)
        steps = np.diff(time, prepend=time[0])
        u, y = self._samples(steps, u, y)
        horizon, nodes, s = self._state, time.size - 1, self._settings.walk.size
        limits = horizon.window.data.low, horizon.window.data.high
        empty = window(nodes, len(self.fmu.states), u.shape[1], y.shape[1], *limits)
        whole, state = empty.data, HorizonState(horizon.filter, horizon.held, empty)
        model, settings = self._model, self._settings
        raise_on_failure(
            _go_forward(model, settings, horizon, state, steps, u, y, estimates), self.fmu
        )
        if time.size > 1:
            start, levels = whole.covariance.copy(), whole.levels.copy()
            step = float(np.median(steps))
            self._doubt(whole, start, levels, y[1:] - estimates[1:, : y.shape[1]], step)
            raise_on_failure(_go_back(model, settings, state), self.fmu)
            # A filter lags behind what drifts; what is left now is of sensors and model.
            self._doubt(whole, start, levels, whole.errors, step)
            raise_on_failure(
                _finish(model, settings, state, spread(nodes, s), u, estimates), self.fmu
            )
        return self._split(estimates)

    def _doubt(
        self, whole: Data, start: Matrix, levels: Matrix, errors: Matrix, step: float
    ) -> None:
        """Give outputs whose errors are not white the noise of their sum; see `excess`.

        Parameters
        ----------
        start, levels : covariance at the first sample and variances of samples, of white noise.
        """
        within = self._settings.learning.within
        if within == np.inf:
            return
        whole.covariance[:] = start
        relative = errors * np.sqrt(whole.weight / levels)
        faded = np.abs(np.nan_to_num(whole.samples) @ self._layout.pace) < self._layout.half
        relative[faded] = np.nan  # what is seen there is not judged
        for j, at in enumerate(self._layout.seen):
            more = excess(relative[:, j], round(within / step))
            whole.levels[:, j] = levels[:, j] * more
            if at >= 0:  # the state began at its first sample
                whole.covariance[at, at] = start[at, at] * more
