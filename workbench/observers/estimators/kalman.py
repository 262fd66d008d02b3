"""Kalman filters for states and quantities at once, named as open work by Schwarz et al. (2018).

The deviations of the estimated quantities are random walks beside the states of any model that has
them as inputs. Both filters predict with the linearly implicit step of the model. Where feedback
fades, the measurement noise grows and the model noise fades.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.special import chdtri

from workbench.arrays import Matrix, Vector, zeros
from workbench.errors import FMUError
from workbench.models.fmu import FMU
from workbench.models.instance import EventError
from workbench.models.native import (
    assign,
    compiled,
    evaluate,
    inlined,
    linearise,
    raise_on_failure,
    read,
    set_inputs,
)
from workbench.observers.contract import Estimator
from workbench.observers.estimators.step import (
    Step,
    advance,
    begin_interval,
    follow_error,
    judge_sample,
    model_step,
    restart,
)
from workbench.observers.estimators.through_events import EventMap
from workbench.observers.gains import Gains, SearchSpace, noise_space
from workbench.observers.layout import Layout, clip, fading, measure, put, report
from workbench.observers.operating import start_spreads, walks
from workbench.system.system import System

_OUTLYING = 9.0  # three standard deviations, squared: what is larger counts as this
_LEVEL_RANGE = 1e4  # of levels, in variance
_RATE = 0.3  # change of a level within the filter's memory by its own evidence [1]


class Learning(NamedTuple):
    """How levels are learnt."""

    within: float  # time in which the noise of samples is learnt [s], infinite: no level is
    surprise: float  # normalised innovation squared that chance makes once an hour


class Levels(NamedTuple):
    """Variances over those of the settings, and the evidence for them."""

    walk: Annotated[Vector, "s"]  # of random walks, at most 1: what the settings say is the fastest
    sample: Annotated[Vector, "l"]  # of samples
    # moved, expected: corrections within the filter's memory, added up, and their variance
    moved: Annotated[Vector, "s"]
    expected: Annotated[Vector, "s"]
    noise: Annotated[Vector, "l"]  # variance of the last sample that the settings say
    scatter: Annotated[Vector, "l"]  # variance that the last sample speaks for
    before: Annotated[Matrix, "s, s"]  # covariance before the last sample
    surprised: Annotated[Vector, "1"]  # 1 where the last sample was left out
    age: Annotated[Vector, "1"]  # time for which levels were learnt [s]


def learning(system: System) -> Learning:
    """How filters of a system learn."""
    once = system.sample_time / 3600.0
    return Learning(system.learns, float(chdtri(len(system.outputs), once)))


def levels(size: int, outputs: int) -> Levels:
    """Levels of so many states and quantities; see `reset`."""
    return zeros(Levels, {"s": size, "l": outputs})


@compiled
def reset(levels):  # type: ignore[no-untyped-def]
    """Levels of the settings, without evidence."""
    trust(levels)
    levels.surprised[0] = levels.age[0] = 0.0
    for j in range(levels.sample.size):
        levels.sample[j] = 1.0


@compiled
def trust(levels):  # type: ignore[no-untyped-def]
    """Let everything move as fast as the settings say, as after a jump."""
    for i in range(levels.walk.size):
        levels.walk[i] = 1.0
        levels.moved[i] = levels.expected[i] = 0.0


@compiled
def note(levels, j, innovation, explained, noise):  # type: ignore[no-untyped-def]
    """Note what a sample of output j speaks for; returns the variance of its noise.

    Parameters
    ----------
    innovation : [its unit]; explained: variance of it that is not noise.
    noise : variance that the settings say.
    """
    learnt = levels.sample[j] * noise
    square = min(innovation * innovation, _OUTLYING * (explained + learnt))
    levels.scatter[j] = (square - explained) / noise
    return learnt


@compiled
def learn(settings, state, fade, h):  # type: ignore[no-untyped-def]
    """Change the levels by a sample; corrections are in `state.change`.

    White innovations make corrections whose sum has the variance that they take from P.
    """
    levels, P, walk = state.levels, state.P, settings.walk
    levels.age[0] += h
    part = min(fade * h / settings.learning.within, 1.0)
    for j in range(levels.sample.size):
        level = levels.sample[j] + part * (levels.scatter[j] - levels.sample[j])
        levels.sample[j] = min(max(level, 1.0 / _LEVEL_RANGE), _LEVEL_RANGE)
    for i in range(walk.size):
        moves = h * levels.walk[i] * (fade * walk[i]) ** 2
        if not (moves > 0.0 and P[i, i] > 0.0):
            continue
        part = moves / (P[i, i] + moves)  # of the filter's memory
        levels.moved[i] = (1.0 - part) * levels.moved[i] + state.change[i]
        lessened = max(levels.before[i, i] - P[i, i], 0.0)
        levels.expected[i] = (1.0 - part) ** 2 * levels.expected[i] + lessened
        if levels.expected[i] > 0.0:
            ratio = min(levels.moved[i] ** 2 / levels.expected[i], _OUTLYING)
            level = levels.walk[i] * np.exp(_RATE * part * (ratio - 1.0))
            levels.walk[i] = min(max(level, 1.0 / _LEVEL_RANGE), 1.0)


@compiled
def surprises(settings, levels, nis):  # type: ignore[no-untyped-def]
    """Whether a sample is out of the question, once levels are learnt."""
    learns = settings.learning
    return levels.age[0] > learns.within and nis > learns.surprise


@compiled
def loosen(state, F, q, jump):  # type: ignore[no-untyped-def]
    """Covariance before the sample, with a jump of a quantity within the last two steps.

    Parameters
    ----------
    F : (n, s) derivatives of the step, rows of states.
    q : column of the quantity.
    jump : its variance.
    """
    P, before, way = state.P, state.levels.before, state.change
    n, size = F.shape
    for i in range(n):
        # On average it has acted on one step and a half: on the last, and on half of the first.
        way[i] = F[i, q]
        for k in range(n):
            way[i] += 0.5 * F[i, k] * F[k, q]
    for i in range(n, size):
        way[i] = 1.0 * (i == q)
    for i in range(size):
        for k in range(size):
            P[i, k] = before[i, k] + jump * way[i] * way[k]


_GROWTH = 4.0  # from one jump that is tried to the next, in variance


@compiled
def measurement_update(model, settings, state, y, estimate):  # type: ignore[no-untyped-def]
    """Covariance after a sample, and the change of the mean, one output after the other.

    The noise of outputs is independent, so that their order does not matter and no matrix is
    inverted. The innovations are those of one linearisation.
    Source: D. Simon, Optimal State Estimation, Wiley 2006, section 6.1.

    Returns the logarithm of the determinant of the innovations' covariance.
    """
    z, P, layout, v, error = state.z, state.P, settings.layout, state.column, state.step.error
    size, n, volume = z.size, model.x.size, 0.0
    state.step.seen[0] = state.step.seen[1] = 0.0
    estimate[estimate.size - 1] = 0.0
    for i in range(size):
        state.change[i] = 0.0
        error[i] = state.step.predicted[i]
    for j in range(y.size):
        if np.isnan(y[j]):  # not measured: its level stays
            state.levels.scatter[j] = state.levels.sample[j]
            continue
        at = layout.seen[j]
        if at >= 0:
            innovation = y[j] - z[at] - state.change[at]
            for i in range(size):
                v[i] = P[i, at]
            total, off = v[at], error[at]
        else:
            innovation = y[j] - model.y[-1 - at]
            total = off = 0.0
            for i in range(size):
                v[i] = 0.0
                for k in range(size):
                    v[i] += P[i, k] * model.jacobian[k, n - 1 - at]
            for i in range(size):
                total += model.jacobian[i, n - 1 - at] * v[i]
                innovation -= model.jacobian[i, n - 1 - at] * state.change[i]
                off += model.jacobian[i, n - 1 - at] * error[i]
        total += note(state.levels, j, innovation, total, state.levels.noise[j])
        volume += np.log(total)
        inverse = 1.0 / total
        estimate[estimate.size - 1] += innovation * innovation * inverse
        state.step.seen[0] += off * off * inverse
        state.step.seen[1] += 1.0
        # (I - K C) P (I - K C)' + K R K', with the best gain K = v / total
        for i in range(size):
            gain = v[i] * inverse
            state.change[i] += gain * innovation
            error[i] -= gain * off
            for k in range(i + 1):
                P[i, k] -= gain * v[k]
                P[k, i] = P[i, k]
    return volume


@compiled
def update(model, settings, state, h, y, estimate):  # type: ignore[no-untyped-def]
    """Correct mean and covariance by a sample; returns the logarithm of its likelihood."""
    z, levels, surprise = state.z, state.levels, settings.learning.surprise
    fade = fading(settings.layout, y)
    for i in range(z.size):
        for k in range(z.size):
            levels.before[i, k] = state.P[i, k]
    volume = measurement_update(model, settings, state, y, estimate)
    nis = estimate[estimate.size - 1]
    judge_sample(state.step, state.P, fade, state.step.seen[0], state.step.seen[1], nis)
    if settings.learning.within == np.inf:
        for i in range(z.size):
            z[i] += state.change[i]
        return -0.5 * (nis + volume)
    if not surprises(settings, levels, nis):
        levels.surprised[0] = 0.0
        learn(settings, state, fade, h)
    elif levels.surprised[0] == 0.0:
        levels.surprised[0] = 1.0
        loosen(state, state.step.F, z.size - 1, 0.0)
        assign(state.step.error, state.step.predicted)
        return -0.5 * (surprise + volume)
    else:
        levels.surprised[0] = 0.0
        trust(levels)
        volume = follow_jump(model, settings, state, h, y, estimate)
    for i in range(z.size):
        z[i] += state.change[i]
    likelihood = -0.5 * (min(estimate[estimate.size - 1], surprise) + volume)
    estimate[estimate.size - 1] = nis
    return likelihood


@compiled
def follow_jump(model, settings, state, h, y, estimate):  # type: ignore[no-untyped-def]
    """Correct by a sample under the least jump of one quantity that lets it happen.

    At most as far as it may be at the start. Of several quantities, of that under which it is
    likeliest. Source: A. S. Willsky, H. L. Jones (1976), IEEE Trans. Autom. Control 21, 108-112,
    with a jump of unknown size.

    Returns the logarithm of the determinant of the innovations' covariance.
    """
    n, last, surprise = model.x.size, estimate.size - 1, settings.learning.surprise
    F, best, chosen, size = state.step.F, np.inf, state.z.size - 1, 0.0
    for q in range(n, state.z.size):
        if settings.walk[q] == 0.0:
            continue  # nothing to begin with, and it does not move
        jump, farthest = h * settings.walk[q] ** 2, settings.spread[q] ** 2
        estimate[last] = np.inf
        while estimate[last] > surprise and jump < farthest:
            jump = min(_GROWTH * jump, farthest)
            loosen(state, F, q, jump)
            volume = measurement_update(model, settings, state, y, estimate)
        if estimate[last] + volume < best:
            best, chosen, size = estimate[last] + volume, q, jump
    loosen(state, F, chosen, size)
    return measurement_update(model, settings, state, y, estimate)


@inlined
def room(settings, P, i):  # type: ignore[no-untyped-def]
    """Share of a random walk that is left, where levels are learnt.

    Nothing is known less of a quantity than at the start: a walk within a range. States have none.
    """
    if settings.learning.within == np.inf or i < P.shape[0] - settings.layout.nominal.size:
        return 1.0
    return max(1.0 - P[i, i] / settings.spread[i] ** 2, 0.0)


@compiled
def drive(model, settings, state, z, u, h):  # type: ignore[no-untyped-def]
    """Variances by which noise of the inputs moves the states in a step from z; returns a status.

    What is measured drives the model with its sensor's noise, (h df/du sigma)^2, in `state.least`.
    Walks that are learnt hold that too, as far as outputs show it; where two bodies are pressed
    together, the force between them answers it and no speed does. So states move by what was learnt
    of them, or by what inputs make of them if that is more; the sum would count it twice.
    Source: S. Thrun, W. Burgard, D. Fox (2005), Probabilistic Robotics, table 7.2 (noise of inputs
    as noise of the step).
    """
    n, least, low = model.x.size, state.least, state.change
    for i in range(n):
        least[i] = 0.0
    status = measure(model, u) or put(model, z)
    for j in range(settings.driven.size):
        deviation = settings.driven[j] + settings.driven_relative[j] * abs(u[j])
        if deviation == 0.0:
            continue
        model.u[j] = u[j] - deviation
        status = status or set_inputs(model, j, 1) or evaluate(model)
        for i in range(n):
            low[i] = model.dx[i]
        model.u[j] = u[j] + deviation
        status = status or set_inputs(model, j, 1) or evaluate(model)
        for i in range(n):
            least[i] += (0.5 * h * (model.dx[i] - low[i])) ** 2
        model.u[j] = u[j]
        status = status or set_inputs(model, j, 1)
    return status


@inlined
def process_noise(settings, state, fade, h, i):  # type: ignore[no-untyped-def]
    """Variance by which state or quantity i moves in a step, after `drive`.

    Walks fade with feedback; the noise of a sensor does not.
    """
    share = room(settings, state.P, i) * state.levels.walk[i]
    moves = h * share * (fade * settings.walk[i]) ** 2
    return max(moves, state.least[i]) if i < state.least.size else moves


_FAINTEST = 1e-3  # share of feedback that the noise of measurements is raised for
_REACH = 100.0  # a level this far from the sensors' noise means: trust it wholly, or not at all


class FilterSettings(NamedTuple):
    """What the laws of the filters are given."""

    layout: Layout  # see Layout
    # relative, floor: (l,) standard deviation of a sample: share of its size, and [its unit]
    relative: Vector
    floor: Vector
    walk: Vector  # (n + q,) random walks of states and quantities [unit/sqrt(s)]
    spread: Vector  # (n + q,) standard deviations at the start
    learning: Learning
    # driven, driven_relative: (m,) standard deviation of a sample of each input: [its unit], and
    # share of its size; 0 where levels are held, which then say it all
    driven: Vector
    driven_relative: Vector


class FilterState(NamedTuple):
    """What the laws remember: z states and deviations, P their covariance; work space."""

    z: Annotated[Vector, "s"]
    P: Annotated[Matrix, "s, s"]
    step: Step
    product: Annotated[Matrix, "n, s"]  # see `carry`
    least: Annotated[Vector, "n"]  # variances of a step of the states, see `drive`
    change: Annotated[Vector, "s"]
    column: Annotated[Vector, "k"]
    levels: Levels


@compiled
def carry(F, P, work):  # type: ignore[no-untyped-def]
    """P <- F P F' of states and quantities, (s, s), which stays symmetric; work, (n, s).

    Parameters
    ----------
    F : (n, s) derivatives of a step, rows of states.
    """
    n, size = F.shape
    for i in range(n):
        for j in range(size):
            work[i, j] = 0.0
        for k in range(size):
            factor = F[i, k]
            for j in range(size):
                work[i, j] += factor * P[k, j]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(size):
                total += work[i, k] * F[j, k]
            P[i, j] = P[j, i] = total
        for j in range(n, size):
            P[i, j] = P[j, i] = work[i, j]


@inlined
def variance(settings, fade, y, j):  # type: ignore[no-untyped-def]
    """Variance of output j [its unit squared], raised where feedback fades."""
    deviation = settings.floor[j] + settings.relative[j] * abs(y[j])
    return (deviation / max(fade, _FAINTEST)) ** 2


@compiled
def finish(model, settings, state, estimate):  # type: ignore[no-untyped-def]
    """Limit the quantities, report the estimate and its standard deviations; returns a status."""
    z, P, layout, n = state.z, state.P, settings.layout, model.x.size
    q, outputs = layout.nominal.size, layout.seen.size
    for i in range(q):
        z[n + i] = clip(z[n + i], layout.low[i], layout.high[i])
    status = put(model, z) or linearise(model, n + model.y.size)
    status = status or report(model, layout, estimate)
    first = outputs + 2 * q + layout.reported  # of the standard deviations
    for j in range(outputs):
        at = layout.seen[j]
        estimate[first + j] = np.sqrt(P[at, at]) if at >= 0 else deviation(model, P, -1 - at)
    for i in range(q):
        doubt = layout.doubt[i] * (layout.nominal[i] + z[n + i])
        known = np.sqrt(P[n + i, n + i] + doubt * doubt)
        estimate[first + outputs + i] = estimate[first + outputs + q + i] = known
    for i in range(layout.reported):
        estimate[first + outputs + 2 * q + i] = deviation(model, P, i)
    return status


@inlined
def deviation(model, P, i):  # type: ignore[no-untyped-def]
    """Standard deviation of the model's output i, to first order."""
    n, total = model.x.size, 0.0
    for j in range(P.shape[0]):
        for k in range(P.shape[0]):
            total += model.jacobian[j, n + i] * P[j, k] * model.jacobian[k, n + i]
    return np.sqrt(max(total, 0.0))


@compiled
def begin(model, settings, state, u, y):  # type: ignore[no-untyped-def]
    """Covariance of the first sample; returns a status."""
    layout, fade = settings.layout, fading(settings.layout, y)
    for j in range(y.size):
        at = layout.seen[j]
        if at >= 0 and not np.isnan(y[j]):
            state.P[at, at] = variance(settings, fade, y, j)
    restart(state.step, u)
    return measure(model, u)


@compiled
def forecast(model, settings, state, h, u, y):  # type: ignore[no-untyped-def]
    """Predict mean and covariance of a sample, with what `update` reads; returns a status."""
    layout, P, size, step = settings.layout, state.P, state.z.size, state.step
    status = put(model, state.z) or begin_interval(model, layout, step, state.z, u, h)
    status = status or drive(model, settings, state, state.z, step.end, h)
    status = status or advance(model, layout, step, state.z, h, True)
    # Model noise enters before the step, whose implicit form damps it as it damps the state.
    fade = fading(layout, y)
    for i in range(size):
        P[i, i] += process_noise(settings, state, fade, h, i)
    for j in range(y.size):
        state.levels.noise[j] = variance(settings, fade, y, j)
    follow_error(step)
    carry(step.F, P, state.product)
    assign(step.inputs, u)
    status = status or measure(model, u)
    if layout.columns > model.x.size:
        # Differences leave other outputs behind, which are read after them.
        status = status or put(model, state.z)
        status = status or linearise(model, layout.columns) or read(model)
    return status


@compiled
def ekf_step(model, settings, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """Predict by the linearised model, correct by the sample."""
    if h == 0.0:
        reset(state.levels)
        status = begin(model, settings, state, u, y)
        return status or finish(model, settings, state, estimate)
    status = forecast(model, settings, state, h, u, y)
    if status:
        return status
    update(model, settings, state, h, y, estimate)
    return finish(model, settings, state, estimate)


class ExtendedKalmanFilter(Estimator):
    """Continuous-discrete extended Kalman filter with quantities as random walks.

    Prediction by one linearly implicit step with the FMU's Jacobian, for mean and covariance;
    correction output by output. Source: D. Simon, Optimal State Estimation, Wiley 2006, chapter 13.

    Parameters
    ----------
    fmu : any model with the inputs and outputs of the system.
    gains : noise levels: standard deviation of a sample of each output, absolute and as a share of
        its size; random walks of states (`model`: over what the system says) and quantities;
        what is known of quantities at the start (`initial`: over what the system says).
    """

    name = "ekf"
    label = "extended Kalman filter"
    rank = 40
    adapts = True
    passes_events = True
    aided = True
    meaning = "standard deviations of samples, and random walks"
    _step = staticmethod(ekf_step)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        system = self.system
        n, q = len(fmu.states), len(system.estimated)
        of_states = gains["model"] * walks(fmu, system)
        initial = [gains["initial"] * quantity.spread for quantity in system.estimated]
        learns = learning(system)
        learnt = float(learns.within < np.inf)
        self._settings: Any = FilterSettings(
            layout=self._layout,
            relative=np.array([_share(gains, output.name) for output in system.outputs]),
            floor=np.array([gains[output.name] for output in system.outputs]),
            walk=np.array([*of_states, *(gains[quantity.name] for quantity in system.estimated)]),
            spread=np.array([*start_spreads(fmu, system), *initial]),
            learning=learns,
            driven=learnt * np.array([signal.noise for signal in system.inputs]),
            driven_relative=learnt * np.array([signal.relative_noise for signal in system.inputs]),
        )
        step = model_step(fmu, of_states, len(system.inputs), n + q)
        self._state: Any = filter_state(step, len(system.outputs), n + q)
        self._events: EventMap | None = None

    def _run(self, steps: Vector, u: Matrix, y: Matrix) -> Matrix:
        """Rows of estimates; from the first piece on in which the model has an event, by points."""
        fmu = self.fmu
        if not (self.passes_events and fmu.saves_state):
            return super()._run(steps, u, y)
        if self._events is None:
            state, begin = self._state, self._model_time
            z, P, first = state.z.copy(), state.P.copy(), state.step.inputs[: u.shape[1]].copy()
            # A model may tell of an event at the end of a step once.
            saved = fmu.save() if fmu.needs_completed_steps and steps[0] != 0.0 else None
            try:
                return super()._run(steps, u, y)
            except EventError as error:
                if saved is not None:
                    fmu.restore(saved)
                if np.isfinite(self.system.learns) or self.system.rolling is not None:
                    raise EventError(
                        f"{error}. {self.name} goes through events only without the keys 'learns' "
                        "and 'rolls' of the system file"
                    ) from None
            finally:
                if saved is not None:
                    fmu.release(saved)
            state.z[:], state.P[:], self._model_time = z, P, begin
            if steps[0] == 0.0:
                self.start(u[0], y[0])
                first = u[0]
            else:
                fmu.set_time(begin)
                fmu.set(fmu.variables([signal.name for signal in self.system.inputs]), first)
                raise_on_failure(put(self._model, z), fmu)
            self._events = EventMap(fmu, self.system, self._layout, self._outputs, first)
        rows = np.full((steps.size, self._width), np.nan)
        samples, y = self._samples(steps, u, y)
        try:
            for h, sample, measured, row in zip(steps, samples, y, rows, strict=True):
                self._step_through_events(float(h), sample, measured, row)
        except FMUError:
            # The instance may be replaced, and what it keeps is then none of the new one.
            self._forget_events()
            raise
        return rows

    def _forget_events(self) -> None:
        if self._events is not None:
            self._events.release()
            self._events = None

    def _step_through_events(self, h: float, u: Vector, y: Vector, row: Vector) -> None:
        """Predict and correct by points, each of which goes through the events on its way.

        Derivatives of the map are central differences over the standard deviations of the
        unknowns, so that a jump counts by its share; of second order, too, since a jump that some
        points pass and others do not bends the map. Source: M. Norgaard, N. K. Poulsen, O. Ravn
        (2000), New developments in state estimation for nonlinear systems, Automatica 36,
        1627-1638 (DD2).
        """
        settings, state, model = self._settings, self._state, self._model
        z, P, n, fade = state.z, state.P, model.x.size, fading(self._layout, y)
        if h == 0.0:
            reset(state.levels)
            raise_on_failure(begin(model, settings, state, u, y), self.fmu)
        else:
            assert self._events is not None
            state.least[:] = 0.0
            if settings.driven.any():
                raise_on_failure(drive(model, settings, state, z, u, h), self.fmu)
            P[np.diag_indices_from(P)] += [
                process_noise(settings, state, fade, h, i) for i in range(z.size)
            ]
            # Rows of the root, root' root = P, are the principal axes of the correlations.
            size = np.sqrt(np.diag(P))
            scaled = P / np.where(size > 0.0, size, 1.0) / np.where(size > 0.0, size, 1.0)[:, None]
            values, axes = np.linalg.eigh(scaled)
            root = (axes * np.sqrt(np.maximum(values, 0.0))).T * size
            distance = self._distance(z.size)
            points = np.vstack([z, z + distance * root, z - distance * root])
            points[:, n:] = np.clip(points[:, n:], self._layout.low, self._layout.high)
            ends, seen = self._events.ends(points, float(u[-1]), u[:-1])
            (x, dx), (g, dg) = (self._moments(values, distance) for values in (ends, seen))
            known = np.isfinite(y)
            R = np.diag([variance(settings, fade, y, j) for j in np.flatnonzero(known)])
            dg, innovation = dg[:, known], (y - g)[known]
            # x <- x + K (y - g), P <- (dx - dg K')' (dx - dg K') + K R K', K = dx' dg S^-1
            S = dg.T @ dg + R
            K = np.linalg.solve(S, dg.T @ dx).T
            left = dx - dg @ K.T
            z[:], P[:] = x + K @ innovation, left.T @ left + K @ R @ K.T
            row[-1] = innovation @ np.linalg.solve(S, innovation)
            state.step.inputs[:] = u
        raise_on_failure(finish(model, settings, state, row), self.fmu)

    @staticmethod
    def _distance(size: int) -> float:
        """Of points from the mean, in standard deviations: root of a Gaussian's kurtosis."""
        return float(np.sqrt(3.0))

    @staticmethod
    def _moments(values: Matrix, distance: float) -> tuple[Vector, Matrix]:
        """Mean, (k,), and rows of deviations, whose squares add up to the covariance, of points."""
        above, below = np.split(values[1:], 2)
        bend, square = above + below - 2.0 * values[0], distance * distance
        bent = np.sqrt(square - 1.0) / (2.0 * square) * bend
        mean = values[0] + bend.sum(axis=0) / (2.0 * square)
        return mean, np.vstack([(above - below) / (2.0 * distance), bent])

    @property
    def steps(self) -> tuple[Step, ...]:
        """See Estimator."""
        return (self._state.step,)

    @property
    def doubt(self) -> str:
        """That it loses the model's mode, where events part its points for long.

        An event that is surely between two samples parts them at one of the samples at most. Here
        each event on average parts them at one more.
        """
        events = self._events
        if events is None or events.unsure < max(events.passed, 1):
            return super().doubt
        return (
            f"{self.name} does not know at which sample the model passes its events: its points "
            f"part at {events.unsure} samples by {events.passed} events. Its 95 % bands are too "
            "narrow, and its estimates may follow a wrong mode. Use a sensor of less noise; or fit "
            "or diagnose, which simulate all events"
        )

    @property
    def covariance(self) -> Matrix:
        """Of the estimated quantities after the last sample, (q, q)."""
        n = len(self.fmu.states)
        known: Matrix = self._state.P[n:, n:].copy()
        return known

    def _begin(self, u: Vector, y: Vector) -> None:
        self._forget_events()
        self._state.z[:] = self._start_values()
        self._state.P[:] = np.diag(self._settings.spread**2)

    def _start_values(self) -> Vector:
        """States and deviations of the quantities at the start, (n + q,)."""
        starts = [
            self._known.get(quantity.name, quantity.start) for quantity in self.system.estimated
        ]
        begins = np.array(starts) - self._layout.nominal
        return np.concatenate([self.fmu.get_states(), np.nan_to_num(begins)])

    @classmethod
    def meanings(cls, fmu: FMU, system: System, gains: Gains) -> dict[str, tuple[str, str]]:
        """See Estimator."""
        meanings = {
            "model": ("random walk of every state, over what the system says", "1"),
            "initial": ("what is known of quantities at the start, over what it says", "1"),
        }
        for output in cls.fed(system).outputs:
            meanings[output.name] = f"scatter of {output.name}", output.unit
            meanings[f"{output.name}_relative"] = f"scatter of {output.name}, as a share of it", "1"
        for quantity in system.estimated:
            meanings[quantity.name] = f"random walk of {quantity.name}", f"{quantity.unit}/sqrt(s)"
        return {name: meanings[name] for name in gains.names}

    @classmethod
    def default_gains(cls, fmu: FMU, system: System) -> Gains:
        """The noise of the sensors and what the system says of states and quantities."""
        outputs = cls.fed(system).outputs
        levels = {output.name: output.noise for output in outputs}
        levels |= {
            f"{output.name}_relative": output.relative_error
            for output in outputs
            if output.relative_error > 0.0
        }
        levels |= {
            "model": 1.0,
            **{quantity.name: quantity.walk for quantity in system.estimated},
            "initial": 1.0,
        }
        return Gains(
            cls.name, tuple(levels), np.array(list(levels.values())), {}, "noise of the sensors"
        )

    @classmethod
    def space(
        cls, fmu: FMU, system: System, gains: Gains, slowest: float, fastest: float
    ) -> SearchSpace:
        """A factor of 100 to both sides of each level."""
        return noise_space(gains.values, _REACH)


def _share(gains: Gains, output: str) -> float:
    name = f"{output}_relative"
    return gains[name] if name in gains.names else 0.0


def filter_state(step: Step, outputs: int, column: int) -> FilterState:
    """State of a filter with so many outputs, in which everything is zero.

    Parameters
    ----------
    column : size of a work space.
    """
    n, size = step.F.shape
    sizes = {"n": n, "s": size, "k": column}
    return zeros(FilterState, sizes, step=step, levels=levels(size, outputs))
