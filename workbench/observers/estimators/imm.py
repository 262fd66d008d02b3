"""A bank of Kalman filters over the conditions that a system declares, which weigh each other.

What a condition means for the model, such as another law of friction, is one hypothesis of
several. Each has an extended Kalman filter; samples tell which of them holds, and when it changes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any, NamedTuple

import numpy as np

from workbench.arrays import Matrix, Tensor, Vector, zeros
from workbench.models.fmu import FMU
from workbench.models.native import compiled, solve
from workbench.observers.estimators.kalman import (
    ExtendedKalmanFilter,
    FilterSettings,
    FilterState,
    begin,
    finish,
    forecast,
    reset,
    update,
)
from workbench.observers.estimators.step import Step
from workbench.observers.gains import Gains
from workbench.system.system import System


@dataclass(frozen=True)
class Hypothesis:
    """A choice of each condition that means something to the model."""

    choices: Mapping[str, str]  # by condition
    parameters: Mapping[str, float]  # of the model, that they set

    @property
    def name(self) -> str:
        """In columns and figures."""
        return "_".join(f"{condition}_{choice}" for condition, choice in self.choices.items())


def hypotheses(system: System) -> tuple[Hypothesis, ...]:
    """All combinations of choices that set parameters; one without any where none does."""
    telling = [
        condition for condition in system.conditions if condition.parameters and not condition.count
    ]
    return tuple(
        Hypothesis(
            {condition.name: choice for condition, choice in zip(telling, chosen, strict=True)},
            {
                name: value
                for condition, choice in zip(telling, chosen, strict=True)
                for name, value in condition.parameters[choice].items()
            },
        )
        for chosen in product(*(condition.parameters for condition in telling))
    )


def changes(system: System) -> Matrix:
    """Rates at which one hypothesis follows another, (k, k) from row to column [1/s].

    A choice lasts for a mean time, then each of the others is as likely.
    """
    rates = np.zeros((1, 1))
    for condition in system.conditions:
        if condition.parameters and not condition.count:
            k = len(condition.parameters)
            # Nothing to change to: a lone choice lasts.
            rate = 1.0 / (condition.lasts * (k - 1)) if k > 1 else 0.0
            own = rate * (np.ones((k, k)) - k * np.eye(k))
            rates = np.kron(rates, np.eye(k)) + np.kron(np.eye(len(rates)), own)
    return rates


class BankSettings(NamedTuple):
    """Settings of the filters, and rates of change between them, (k, k) [1/s]."""

    members: tuple[FilterSettings, ...]
    rates: Matrix


class BankState(NamedTuple):
    """What the bank remembers: its filters and their probability; work space."""

    members: tuple[FilterState, ...]
    probability: Annotated[Vector, "k"]
    expected: Annotated[Vector, "k"]  # probability before the sample
    # on the right transition within a step, on the left shares of mixing
    change: Annotated[Matrix, "k, 2*k"]
    z: Annotated[Matrix, "k, s"]
    errors: Annotated[Matrix, "k, s"]  # of steps
    P: Annotated[Tensor, "k, s, s"]
    estimates: Annotated[Matrix, "k, w"]  # estimates of the members
    evidence: Annotated[Vector, "k"]  # logarithm of the likelihood of a sample


@compiled
def _mix(settings, state, h):  # type: ignore[no-untyped-def]
    """Begin each filter at the mixture of where its hypothesis may come from; a status.

    Source: Blom and Bar-Shalom (1988), IEEE Trans. Autom. Control 33, 780-783, equations (3) to
    (6). The transition is an implicit step, which is stochastic at any h.
    """
    change, members = state.change, state.members
    count, size = state.z.shape
    for i in range(count):
        for a in range(size):
            state.z[i, a] = members[i].z[a]
            state.errors[i, a] = members[i].step.error[a]
            for b in range(size):
                state.P[i, a, b] = members[i].P[a, b]
        for j in range(count):
            change[i, j] = -h * settings.rates[i, j]
            change[i, count + j] = 0.0
        change[i, i] += 1.0
        change[i, count + i] = 1.0
    status = solve(change)
    for j in range(count):
        z, P = members[j].z, members[j].P
        total = 0.0
        for i in range(count):
            total += change[i, count + j] * state.probability[i]
        state.expected[j] = total
        if not total > 0.0:
            continue  # a hypothesis that is out of the question goes on by itself
        for i in range(count):
            change[i, j] = change[i, count + j] * state.probability[i] / total
        for a in range(size):
            z[a] = members[j].step.error[a] = 0.0
            for i in range(count):
                z[a] += change[i, j] * state.z[i, a]
                members[j].step.error[a] += change[i, j] * state.errors[i, a]
        for a in range(size):
            for b in range(size):
                P[a, b] = 0.0
                for i in range(count):
                    product = (state.z[i, a] - z[a]) * (state.z[i, b] - z[b])
                    P[a, b] += change[i, j] * (state.P[i, a, b] + product)
    return status


@compiled
def _weigh(state):  # type: ignore[no-untyped-def]
    """Probability of the hypotheses after a sample, by Bayes' rule."""
    best, total = state.evidence[0], 0.0
    for j in range(state.probability.size):
        best = max(best, state.evidence[j])
    for j in range(state.probability.size):
        # The likeliest one has weight 1, so that not all of them vanish.
        state.probability[j] = state.expected[j] * np.exp(state.evidence[j] - best)
        total += state.probability[j]
    for j in range(state.probability.size):
        state.probability[j] /= total


@compiled
def _combine(state, estimate):  # type: ignore[no-untyped-def]
    """Mean and standard deviation of the mixture, its innovation and the probabilities."""
    estimates, probability = state.estimates, state.probability
    count, last = estimates.shape[0], estimates.shape[1] - 1
    width = last // 2
    for i in range(width):
        mean, spread = 0.0, 0.0
        for j in range(count):
            mean += probability[j] * estimates[j, i]
        for j in range(count):
            distance = estimates[j, i] - mean
            spread += probability[j] * (estimates[j, width + i] ** 2 + distance * distance)
        estimate[i], estimate[width + i] = mean, np.sqrt(spread)
    estimate[estimate.size - 1] = 0.0
    for j in range(count):
        estimate[2 * width + j] = probability[j]
        estimate[estimate.size - 1] += probability[j] * estimates[j, last]


@compiled
def _step(models, settings, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """Mix, let each filter take the sample, weigh them."""
    estimates = state.estimates
    status = 0 if h == 0.0 else _mix(settings, state, h)
    for j in range(state.probability.size):
        model, own, filter_ = models[j], settings.members[j], state.members[j]
        if h == 0.0:
            reset(filter_.levels)
            status = status or begin(model, own, filter_, u, y)
            estimates[j, estimates.shape[1] - 1] = np.nan
        else:
            status = status or forecast(model, own, filter_, h, u, y)
            if status:
                return status
            filter_.step.weight[0] = state.expected[j]  # steps of what is not so matter as little
            state.evidence[j] = update(model, own, filter_, h, y, estimates[j])
        status = status or finish(model, own, filter_, estimates[j])
    if h > 0.0:
        _weigh(state)
    _combine(state, estimate)
    return status


class InteractingMultipleModel(ExtendedKalmanFilter):
    """Extended Kalman filters under one hypothesis each, mixed by their probabilities.

    Hypotheses are the choices of those conditions for which the system file has parameters. Each
    filter starts at the quantities of its choice. Estimates are those of the mixture, with
    standard deviations that hold what the filters disagree in.
    Source: Blom and Bar-Shalom (1988), The interacting multiple model algorithm for systems with
    Markovian switching coefficients, IEEE Trans. Autom. Control 33, 780-783.

    Parameters
    ----------
    fmu : any model with the inputs and outputs of the system, and the parameters of conditions.
    """

    passes_events = False
    name = "imm"
    label = "interacting multiple model"
    rank = 47
    standard = False
    tunable = False
    tuned_as = ExtendedKalmanFilter.name
    _step = staticmethod(_step)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        modes = hypotheses(system)
        self.modes = tuple(mode.name for mode in modes)
        self.finds = frozenset(name for mode in modes for name in mode.choices)
        super().__init__(fmu, system, gains)
        names = [quantity.name for quantity in system.estimated]
        filters = [
            ExtendedKalmanFilter(fmu.variant(_held(mode, fmu, names)), system, gains)
            for mode in modes
        ]
        self._filters = filters
        self._starts = [
            np.array([mode.parameters.get(name, np.nan) for name in names]) - self._layout.nominal
            for mode in modes
        ]
        self._model = tuple(member._model for member in filters)
        self._bank = BankSettings(tuple(member._settings for member in filters), changes(system))
        sizes = {"k": len(modes), "s": len(self._settings.walk)}
        sizes["w"] = 2 * len(self.system.columns) + 1
        members = tuple(member._state for member in filters)
        self._state = zeros(BankState, sizes, members=members)

    @property
    def steps(self) -> tuple[Step, ...]:
        """See Estimator."""
        return tuple(step for member in self._filters for step in member.steps)

    @property
    def models(self) -> tuple[FMU, ...]:
        """See Estimator."""
        return tuple(member.fmu for member in self._filters)

    def _arguments(self) -> tuple[Any, Any]:
        return self._bank, self._state

    def start(self, u: Vector, y: Vector) -> None:
        """See Estimator; each hypothesis is as likely."""
        for member, quantities in zip(self._filters, self._starts, strict=True):
            member.start(u, y)
            z, known = member._state.z[len(member.fmu.states) :], np.isfinite(quantities)
            z[known] = quantities[known]
        self._state.probability[:] = 1.0 / len(self._filters)


def _held(hypothesis: Hypothesis, fmu: FMU, estimated: Sequence[str]) -> dict[str, float]:
    """Parameters that a hypothesis sets for good; what is estimated only starts there."""
    return {
        name: value
        for name, value in hypothesis.parameters.items()
        if name in fmu.parameters and name not in estimated
    }
