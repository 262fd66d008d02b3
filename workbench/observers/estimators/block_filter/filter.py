"""A Kalman filter of like blocks, at a cost that grows with their number and not with its cube.

The Jacobian of a machine that is made of many like parts is an arrow: each part depends on its own
unknowns and on some that all share, such as the axles of a train on its speed. The covariance of
the extended Kalman filter is none, as past values of what is shared, known only so well, tie the
parts to each other. After each step it is replaced by one in which

- the shared unknowns, and each block together with them, have the covariance that the step gives;
- what two blocks have in common beyond the shared unknowns is the same for all pairs, in units of
  a root of their own covariances: the mean over the pairs. It is that of a common factor.

Given the shared unknowns and the factor, blocks are independent: a sample is taken exactly, and a
step is exact but for the mean over pairs; where blocks are alike, that is exact, too. Without the
factor, the nearest density (Kullback and Leibler) in which blocks are independent given the shared
unknowns, each step would forget that the same error stands in all blocks, such as one of the speed
in all radii, and the filter would count the same information again with each sample.

Sources: S. L. Lauritzen, Graphical Models, Oxford 1996 (blocks that are independent given what they
share); P. S. Maybeck, Stochastic Models, Estimation and Control 2, Academic Press 1982, chapter 12
(densities of an assumed form).
"""

from itertools import pairwise
from typing import Annotated, NamedTuple

import numpy as np

from workbench.arrays import Matrix, Tensor, Vector, zeros
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.native import assign, compiled, read
from workbench.observers.estimators.block_filter.block_sample import (
    fed_deviation,
    measurement_update,
    reported_deviation,
    scatter,
)
from workbench.observers.estimators.block_filter.block_slopes import slope, slopes_of_fed
from workbench.observers.estimators.block_filter.block_step import predict
from workbench.observers.estimators.block_filter.blocks import Blocks, blocks, widths
from workbench.observers.estimators.kalman import ExtendedKalmanFilter, FilterSettings, variance
from workbench.observers.estimators.step import Step
from workbench.observers.gains import Gains
from workbench.observers.layout import Layout, act, clip, fading, measure, put, report
from workbench.system.system import System


class ArrowSettings(NamedTuple):
    """Settings of the extended Kalman filter, and how its unknowns fall into blocks."""

    filter: FilterSettings
    blocks: Blocks


class ArrowState(NamedTuple):
    """What the law remembers, and its work space.

    With b unknowns in blocks of at most m, of which k are states, s shared ones, n states in all;
    w = s + m are the shared unknowns and the factor, by each unknown of a block; l outputs, r that
    are reported, i inputs and time.
    """

    z: Annotated[Vector, "b + s"]  # states and deviations of quantities
    # covariance of the shared unknowns, and of the factor, of which no variance need be positive:
    # what blocks have in common whose sum is known is negative
    P: Annotated[Matrix, "w, w"]
    # regression of a block's unknowns on the shared ones and the factor
    G: Annotated[Matrix, "b, w"]
    C: Annotated[Matrix, "b, m"]  # covariance of a block given these, in rows of its unknowns
    # derivatives of the rates of a block and of the shared ones, by its unknowns
    slopes: Annotated[Matrix, "b, k + s"]
    common: Annotated[Matrix, "s, n"]  # of all rates, by the shared unknowns
    # of a block's part of an implicit step, in rows of its states
    inverse: Annotated[Matrix, "b, m"]
    # passed, tied: what the shared unknowns take from a block in a step, and how its unknowns vary
    # with them
    passed: Annotated[Matrix, "b, s"]
    tied: Annotated[Matrix, "b, s"]
    # of the step of the shared unknowns, with right-hand sides
    system: Annotated[Matrix, "s, 2*s + 1"]
    step: Annotated[Matrix, "s, s"]  # that step without them
    kept: Annotated[Matrix, "s, w"]  # what a step leaves of the shared unknowns
    moved: Annotated[Matrix, "s, w"]  # times their covariance
    # covariance of what a step makes the shared unknowns of, then its inverse
    known: Annotated[Matrix, "s, s"]
    after: Annotated[Matrix, "s, s"]  # covariance after the step
    # along, against, between: sums over blocks, see `liken`
    along: Annotated[Tensor, "2, m, w"]
    against: Annotated[Tensor, "2, m, s"]
    between: Annotated[Matrix, "m, m"]
    # block, left, weighed: work space of a block
    block: Annotated[Matrix, "m + k, m"]
    left: Annotated[Matrix, "m, w"]
    weighed: Annotated[Matrix, "m, w"]
    solved: Annotated[Matrix, "k, k + m"]  # step of a block with its right-hand sides
    change: Annotated[Vector, "b + s + m"]  # of the mean, in the order of blocks, and of the factor
    # column, row, told: work space of an output
    column: Annotated[Vector, "m"]
    row: Annotated[Vector, "w"]
    told: Annotated[Vector, "w"]
    measured: Annotated[Matrix, "l, m + s"]  # derivatives of the outputs that are no states
    # derivatives of reported outputs, in the order of blocks
    reported: Annotated[Matrix, "b + s, r"]
    inputs: Annotated[Vector, "i"]  # the sample before
    acting: Annotated[Vector, "i"]  # what acts in the step, see `act`


@compiled
def finish(model, settings, state, estimate):  # type: ignore[no-untyped-def]
    """Limit the quantities, report the estimate and its standard deviations; returns a status."""
    z, parts, layout, n = state.z, settings.blocks, settings.filter.layout, model.x.size
    q, outputs = layout.nominal.size, layout.seen.size
    for i in range(q):
        z[n + i] = clip(z[n + i], layout.low[i], layout.high[i])
    status = put(model, z) or slopes_of_fed(model, settings, state)
    for k in range(z.size):
        for r in range(layout.reported):
            status = status or slope(model, n + r, parts.order[k], state.reported[k, r:])
    status = status or report(model, layout, estimate)
    first = outputs + 2 * q + layout.reported  # of the standard deviations
    for j in range(outputs):
        estimate[first + j] = fed_deviation(settings, state, j)
    for i in range(parts.first.size - 1):
        for k in range(parts.first[i] + parts.states[i], parts.first[i + 1]):
            at = parts.order[k] - n
            doubt = layout.doubt[at] * (layout.nominal[at] + z[n + at])
            known_to = np.sqrt(scatter(state, parts.first[i], k) + doubt * doubt)
            estimate[first + outputs + at] = estimate[first + outputs + q + at] = known_to
    for r in range(layout.reported):
        estimate[first + outputs + 2 * q + r] = reported_deviation(settings, state, r)
    return status


@compiled
def begin(model, settings, state, u, y):  # type: ignore[no-untyped-def]
    """Covariance of the first sample; returns a status."""
    parts, fade = settings.blocks, fading(settings.filter.layout, y)
    count = parts.first.size - 2
    for j in range(y.size):
        place, i = parts.place[j], parts.home[j]
        if place >= 0 and not np.isnan(y[j]):
            known = variance(settings.filter, fade, y, j)
            own = place - parts.first[i]
            if i == count:
                state.P[own, own] = known
            else:
                state.C[place, own] = known
    assign(state.inputs, u)
    return measure(model, u)


@compiled
def arrow_step(model, settings, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """Predict by the linearised model, correct by the sample."""
    if h == 0.0:
        status = begin(model, settings, state, u, y)
        return status or finish(model, settings, state, estimate)
    layout = settings.filter.layout
    fade = fading(layout, y)
    act(layout, state.inputs, u, state.acting)
    status = measure(model, state.acting) or predict(model, settings, state, h, fade)
    assign(state.inputs, u)
    status = status or measure(model, u)
    if layout.columns > model.x.size:
        # Differences leave other outputs behind, which are read after them.
        status = status or put(model, state.z)
        status = status or slopes_of_fed(model, settings, state) or read(model)
    if status:
        return status
    measurement_update(model, settings, state, y, fade, estimate)
    return finish(model, settings, state, estimate)


class BlockKalmanFilter(ExtendedKalmanFilter):
    """Extended Kalman filter whose cost grows with the number of blocks that a model is made of.

    Blocks and what they share follow from the model structure of the FMU, see `blocks`. Step and
    correction are those of the extended Kalman filter, but for the covariance of two blocks. On a
    model without like blocks, or whose structure is not said, it is the extended Kalman filter.

    Raises
    ------
    InputError
        If levels are to be learnt of a model that has blocks.
    """

    name = "arrow"
    label = "block Kalman filter"
    coarse_steps = True
    rank = 42
    standard = False
    passes_events = False
    tunable = False
    tuned_as = ExtendedKalmanFilter.name

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        self._blocks = blocks(fmu, self.system, self._layout)
        if self._blocks.first.size > 3:
            self._divide()

    def _divide(self) -> None:
        """Take the law of blocks, and memory for it."""
        if np.isfinite(self.system.learns):
            raise InputError(
                where=f"estimator {self.name}, system {self.system.name}",
                found="noise levels that are to be learnt (`learns`), of a model of blocks",
                expected="levels that are held, as they are learnt of all unknowns at once",
                remedy="leave 'learns' out of the system file, or use the estimator ekf",
            )
        self._step = arrow_step
        self._settings = ArrowSettings(self._settings, self._blocks)
        self._state = _state(self._blocks, self._layout, len(self.fmu.states))

    @property
    def steps(self) -> tuple[Step, ...]:
        """See Estimator."""
        return () if isinstance(self._state, ArrowState) else super().steps

    def _begin(self, u: Vector, y: Vector) -> None:
        if not isinstance(self._state, ArrowState):
            super()._begin(u, y)
            return
        state, known = self._state, self._settings.filter.spread[self._blocks.order] ** 2
        state.z[:] = self._start_values()
        state.G[:] = state.C[:] = 0.0
        for begin, end in pairwise(self._blocks.first[:-1]):
            state.C[begin:end, : end - begin] = np.diag(known[begin:end])
        state.P[:] = 0.0
        shared = known[self._blocks.first[-2] :]
        state.P[: shared.size, : shared.size] = np.diag(shared)

    @property
    def covariance(self) -> Matrix:
        """See ExtendedKalmanFilter; of two blocks, by what they share."""
        if not isinstance(self._state, ArrowState):
            return super().covariance
        n = len(self.fmu.states)
        return self._joint()[n:, n:]

    def _joint(self) -> Matrix:
        """Covariance of states and quantities, (n + q, n + q)."""
        state, order = self._state, self._blocks.order
        gain = np.concatenate([state.G, np.eye(len(state.known), len(state.P))])
        known = np.zeros((order.size, order.size))
        known[np.ix_(order, order)] = gain @ state.P @ gain.T
        for begin, end in pairwise(self._blocks.first[:-1]):
            own = order[begin:end]
            known[np.ix_(own, own)] += state.C[begin:end, : end - begin]
        return known


def _state(parts: Blocks, layout: Layout, n: int) -> ArrowState:
    """Memory and work space of the law, in which everything is zero."""
    b, (m, k) = int(parts.first[-2]), widths(parts)
    s = parts.order.size - b
    sizes = {"b": b, "m": m, "k": k, "s": s, "w": s + m, "n": n}
    sizes |= {"l": layout.seen.size, "r": layout.reported, "i": layout.holds.size}
    return zeros(ArrowState, sizes)
