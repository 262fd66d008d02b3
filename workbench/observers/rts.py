"""The smoother: estimates that know the whole recording."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.fmu import Matrix, Vector
from workbench.kernel import REFUSED, compiled
from workbench.observers.adaptive import reset
from workbench.observers.contract import Estimate
from workbench.observers.kalman import (
    ExtendedKalmanFilter,
    FilterMemory,
    begin,
    carry,
    ekf_law,
    finish,
)
from workbench.observers.layout import measure
from workbench.observers.mhe import append, expand, relinearise
from workbench.observers.window import Window, assign, assign_rows, end, solve_free, window

_ITERATIONS = 10  # of Gauss and Newton, after that about the filter


class SmootherMemory(NamedTuple):
    """That of the filter, and the window over a whole recording.

    Attributes
    ----------
    held : (l,) last samples.
    information : (s, s) what later samples tell; product : (s, s) work space.
    covariances : (N, s, s) of the smoothed states after each step; first : (s, s) before them.
    """

    filter: FilterMemory
    held: Vector
    window: Window
    information: Matrix
    product: Matrix
    covariances: NDArray[np.float64]
    first: Matrix


@compiled
def _gather(information, v, c, at, total, work):  # type: ignore[no-untyped-def]
    """Add a sample of unknown `at`, or with slopes c, to the information.

    (I - c v'/total) information (I - v c'/total) + c c'/total, v = P c.
    """
    s, square = v.size, 0.0
    for i in range(s):
        work[i] = 0.0
        for j in range(s):
            work[i] += information[i, j] * v[j]
        square += v[i] * work[i]
    both = (1.0 + square / total) / total
    for i in range(s):
        own = c[i] if at < 0 else (1.0 if i == at else 0.0)
        for j in range(i + 1):
            other = c[j] if at < 0 else (1.0 if j == at else 0.0)
            information[i, j] += both * own * other - (own * work[j] + work[i] * other) / total
            information[j, i] = information[i, j]


@compiled
def _back(F, information, product):  # type: ignore[no-untyped-def]
    """Information <- F' information F of a step, see `carry`."""
    n, s = F.shape
    for i in range(s):
        for j in range(s):
            product[i, j] = information[i, j] if j >= n else 0.0
            for k in range(n):
                product[i, j] += information[i, k] * F[k, j]
    # Only half of it is computed: what rounding makes of the difference would grow.
    for i in range(s):
        for j in range(i + 1):
            information[i, j] = product[i, j] if i >= n else 0.0
            for k in range(n):
                information[i, j] += F[k, i] * product[k, j]
            information[j, i] = information[i, j]


@compiled
def _reduce(P, information, product, smoothed):  # type: ignore[no-untyped-def]
    """Covariance with what later samples tell: P - P information P."""
    s = P.shape[0]
    for i in range(s):
        for j in range(s):
            product[i, j] = 0.0
            for k in range(s):
                product[i, j] += P[i, k] * information[k, j]
    for i in range(s):
        for j in range(i + 1):
            smoothed[i, j] = P[i, j]
            for k in range(s):
                smoothed[i, j] -= product[i, k] * P[k, j]
            smoothed[j, i] = smoothed[i, j]


@compiled
def _smooth(settings, memory):  # type: ignore[no-untyped-def]
    """Covariances of the smoothed states, from the last one back."""
    window, seen = memory.window, settings.layout.seen
    information, product = memory.information, memory.product
    for i in range(information.shape[0]):
        for j in range(information.shape[0]):
            information[i, j] = 0.0
    for k in range(window.filled[0] - 1, -1, -1):
        for j in range(seen.size - 1, -1, -1):
            if window.total[k, j] > 0.0:
                _gather(
                    *(information, window.gain[k, j], window.slopes[k, j], seen[j]),
                    *(window.total[k, j], window.work),
                )
        _back(window.F[k], information, product)
        _reduce(window.spread[k], information, product, memory.covariances[k])
        carry(window.F[k], memory.covariances[k], window.work)
    _reduce(window.covariance, information, product, memory.first)


@compiled
def _report(model, settings, memory, u, rows):  # type: ignore[no-untyped-def]
    """Write the smoothed estimates over those of the filter; returns a status."""
    window, z, P = memory.window, memory.filter.z, memory.filter.P
    status, skipped = 0, rows.shape[0] - window.filled[0]
    if skipped > 0:
        for i in range(z.size):
            z[i] = window.mean[i]
            for j in range(z.size):
                z[i] -= window.covariance[i, j] * window.costates[0, j]
        assign_rows(P, memory.first)
        status = measure(model, u[0]) or finish(model, settings, memory.filter, rows[0])
    for k in range(window.filled[0]):
        for i in range(z.size):
            z[i] = end(window, k, i)
        assign_rows(P, memory.covariances[k])
        status = status or measure(model, u[skipped + k])
        status = status or finish(model, settings, memory.filter, rows[skipped + k])
    return status


@compiled
def _loop(model, settings, memory, steps, u, y, rows):  # type: ignore[no-untyped-def]
    status = 0
    window, filtered = memory.window, memory.filter
    if steps[0] == 0.0:
        reset(filtered.levels)
        status = begin(model, settings, filtered, u[0], y[0])
        rows[0, rows.shape[1] - 1] = np.nan
    assign(window.mean, filtered.z)
    assign_rows(window.covariance, filtered.P)
    for k in range(steps.size):
        if steps[k] > 0.0:
            append(settings, memory, steps[k], u[k], y[k])
            status = status or expand(model, settings, memory, window.filled[0] - 1)
            status = status or ekf_law(model, settings, filtered, steps[k], u[k], y[k], rows[k])
    if status:
        return status
    solve_free(window, settings.layout.seen)
    for _ in range(_ITERATIONS):
        if relinearise(model, settings, memory):
            return REFUSED
        solve_free(window, settings.layout.seen)
    _smooth(settings, memory)
    return _report(model, settings, memory, u, rows)


class Smoother(ExtendedKalmanFilter):
    """Rauch-Tung-Striebel smoother over a run of the extended filter, with its noise levels.

    The recursion of the moving horizon estimator over the whole recording, linearised where the
    filter was and then where it is itself; its way back inverts no covariance. Sample by sample
    (`step`) nothing is later, and the estimate is that of the filter. NIS is the filter's.
    Sources: H. Rauch, F. Tung, C. Striebel (1965), AIAA J. 3, 1445-1450; G. Bierman (1973),
    Automatica 9, 503-508.

    Parameters
    ----------
    fmu : any model with the inputs and outputs of the system.
    gains : see ExtendedKalmanFilter.
    """

    name = "rts"
    label = "smoother, knows the whole recording"
    rank = 90
    standard = False
    tunable = False
    tuned_as = ExtendedKalmanFilter.name
    _loop = staticmethod(_loop)

    def advance(self, steps: Vector, u: Matrix, y: Matrix) -> Estimate:
        """Smooth a piece of a recording; see Estimator."""
        filtered, n, s = self._memory, len(self.fmu.states), self._settings.walk.size
        unbounded = np.full(s, np.inf)
        self._memory = SmootherMemory(
            filter=filtered,
            held=y[0].copy(),
            window=window(steps.size, n, u.shape[1], y.shape[1], -unbounded, unbounded),
            information=np.zeros((s, s)),
            product=np.zeros((s, s)),
            covariances=np.zeros((steps.size, s, s)),
            first=np.zeros((s, s)),
        )
        try:
            return super().advance(steps, u, y)
        finally:
            self._memory = filtered
