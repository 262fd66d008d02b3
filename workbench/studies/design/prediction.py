"""What rivals predict of an experiment, and what that would tell them apart by.

A worker opens the model with all effects once (`open_predictor`), and predicts every experiment
with it: the recording, as sensors would make it, and what the other rivals leave of it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.counting import CountedSamples, count
from workbench.diagnosis.data.motion import ModelSource, OpenModel, opened
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.effects.extension import variables
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint, Point
from workbench.diagnosis.inference.quadratic import (
    Joint,
    Key,
    Quadratic,
    RecordingSystem,
    add,
    covariance,
    minimum,
)
from workbench.diagnosis.inference.rivals import Rival, Rivals
from workbench.diagnosis.inference.thresholds import SOUND, Thresholds
from workbench.diagnosis.inference.unknowns import ALL
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.errors import InputError
from workbench.models.fmu import CoSimulation
from workbench.models.native import (
    OK,
    REFUSED,
    co_simulation_instance,
    compiled,
    do_step,
    raise_on_failure,
    read,
    set_inputs,
)
from workbench.recordings.case import Case, Value, make_case
from workbench.studies.design.candidates import Experiment
from workbench.system.comparison import Channel
from workbench.system.expression import Expression
from workbench.system.parts import LARGEST, Condition, Signal
from workbench.system.system import System


def predict_recording(
    model: CoSimulation,
    system: System,
    candidate: Experiment,
    values: Mapping[str, float],
    references: tuple[str, ...],
    number: int,
) -> Case:
    """Simulate what the sensors would record of an experiment if the model were true.

    Inputs that a controller makes follow from the model's variables, anew in each of the blocks
    whose means are compared; those that a profile makes go from sample to sample in a line, of
    which a step of the model has the middle, unless they are `held`.

    Parameters
    ----------
    values : of the model's parameters, SI.
    references : names of the validation sensors that are recorded.
    number : of the recording; seeds the noise of the sensors.
    """
    u, y = _simulate(model, system, candidate, values, references)
    time, rng = system.sample_time * np.arange(float(len(y))), np.random.default_rng(number)
    names = [*(signal.name for signal in (*system.inputs, *system.outputs)), *references]
    clean = dict(zip(names, (*u.T, *y.T), strict=True))
    signals = {
        key: column + system.signals[key].deviation(column) * rng.standard_normal(time.size)
        for key, column in clean.items()
    }
    conditions = _conditions(system, candidate, clean)
    case = make_case(f"{number:03}", (time, signals), conditions, system)
    return replace(case, title=candidate.text(system), aids=())


def start_of(system: System, candidate: Experiment) -> dict[str, float]:
    """States at the start of an experiment, SI."""
    assert system.experiments is not None
    known = {**system.values, **candidate.numbers}
    return {state: float(formula(known)) for state, formula in system.experiments.start.items()}


def _simulate(
    model: CoSimulation,
    system: System,
    candidate: Experiment,
    values: Mapping[str, float],
    references: tuple[str, ...],
) -> tuple[Matrix, Matrix]:
    """Inputs (n, m) and readings (n, c) without noise, until the recording ends."""
    assert system.experiments is not None
    experiments, h = system.experiments, system.sample_time
    time: Vector = h * np.arange(round(experiments.lasts / h) + 1.0)
    known: dict[str, Any] = {**system.values, **candidate.numbers}
    model.start(
        start_of(system, candidate),
        {key: value for key, value in values.items() if key in model.defaults},
    )
    names = [signal.name for signal in system.inputs]
    outputs = [output.name for output in system.outputs]
    readings = [system.signals[key].reading for key in (*outputs, *references)]
    formulas = [*experiments.driven.values()]
    formulas += [experiments.ends.formula] if experiments.ends else []
    variables = {v.name for v in model.description.variables}
    felt = model.variables(
        sorted({key for formula in formulas for key in formula.names} & variables)
    )
    u, y = np.zeros((time.size, len(names))), np.zeros((time.size, len(readings)))
    for profile in candidate.profiles:
        u[:, names.index(profile.input.name)] = profile.signal(time)
    size = max(1, round(system.comparison.block / h))
    model.set(model.variables(names), u[0])
    running = co_simulation_instance(model, names, readings)
    for k in range(0, time.size, size):
        block = slice(k, k + size + 1)
        feels = {**known, **dict(zip(felt.names, model.get(felt).tolist(), strict=True))}
        for key, formula in experiments.driven.items():
            u[block, names.index(key)] = formula(feels)
        ends = experiments.ends
        if ends is not None and abs(float(ends.formula(feels))) < ends.below:
            return u[:k], y[:k]
        raise_on_failure(step_block(running, h, system.holds, u[block], y[block]), model)
    return u, y


@compiled
def step_block(model, h, holds, u, y):  # type: ignore[no-untyped-def]
    """Write readings y (n, c) for inputs u (n, m), samples h [s] apart; returns a status.

    A step from sample k - 1 to k is driven by (u_{k-1} + u_k) / 2 where holds, (m,), is 0, by
    u_{k-1} where it is 1, by u_k where it is -1.
    """
    m = u.shape[1]
    for k in range(len(u)):
        if k > 0:
            for j in range(m):
                model.u[j] = 0.5 * ((1.0 + holds[j]) * u[k - 1, j] + (1.0 - holds[j]) * u[k, j])
            if set_inputs(model, 0, m) or do_step(model, h):
                return REFUSED
        for j in range(m):
            model.u[j] = u[k, j]
        if set_inputs(model, 0, m) or read(model):
            return REFUSED
        for i in range(y.shape[1]):
            y[k, i] = model.y[i]
    return OK


def _conditions(
    system: System, candidate: Experiment, clean: Mapping[str, Vector]
) -> dict[str, Value]:
    """Conditions as they are set; others as the recording says, or the usual ones."""
    conditions: dict[str, Value] = {}
    for condition in system.conditions:
        if condition.name in candidate.settings:
            conditions[condition.name] = candidate.settings[condition.name].value
        elif condition.choices:
            conditions[condition.name] = (
                (condition.choices[0],) * condition.count
                if condition.count
                else condition.choices[0]
            )
        elif not condition.sets:
            conditions[condition.name] = _condition_value(system, condition, clean)
    return conditions


def _condition_value(system: System, condition: Condition, clean: Mapping[str, Vector]) -> float:
    """A quantity, by the formula that recordings must agree with."""
    if condition.agrees is None:
        raise InputError(
            where=f"{system.source}, [next.conditions]",
            found=f"no '{condition.name}', of which no recording tells",
            expected="its values",
            remedy=f"add {condition.name} = [...], or agrees = {{ is = ... }} to the condition",
        )
    values = system.evaluate(condition.agrees.formula, clean)
    return float(values.max() if condition.agrees.place == LARGEST else values[0])


# --- how far apart rivals stay ---


def refitted(new: Quadratic, information: Matrix) -> tuple[float, Vector]:
    """Chi-squared that a rival leaves where another model is true, when all is fitted again.

    Parameters
    ----------
    new : chi-squared of the new recording over the rival's unknowns, with the difference of both
        responses as errors and without noise; what belongs to that recording alone is eliminated.
    information : (p, p) of the rival's unknowns in the recordings so far.

    Returns
    -------
    left : chi-squared.
    z : (p,) by what the rival's unknowns change.

    Notes
    -----
    W. G. Hunter, A. M. Reiner (1965), Technometrics 7, 307-323, maximise the squared difference
    d'd of the responses of two models. Here the rival is fitted again, as by A. C. Atkinson,
    V. V. Fedorov (1975), Biometrika 62, 57-70 (T-optimality), and its unknowns are held by what is
    known of them. In white noise of variance 1, the least of |d + J z|^2 + z' N z over the steps z
    of its unknowns is d' (I + J N^-1 J')^-1 d: the criterion of G. Buzzi-Ferraris, P. Forzatti
    (1983), Chem. Eng. Sci. 38, 225-232, with the covariance of noise and of the rival's prediction;
    the true model is assumed, so that its own is none.

    Examples
    --------
    A rival that differs by 3 everywhere and has nothing to fit, in four samples:

    >>> rival = Quadratic(np.zeros((0, 0)), np.zeros(0), 4 * 3.0**2, 4)
    >>> refitted(rival, np.zeros((0, 0)))[0]
    36.0
    """
    total = add([new, Quadratic(information, np.zeros(len(information)), 0.0, 0)])
    z = minimum(total)
    return total.at(z), z


def discrimination_chance(chi_squared: float, explained: float, decides: Thresholds) -> float:
    """Probability that a diagnosis tells a rival from the true cause.

    It says that they cannot be told apart while the rival leaves less chi-squared beyond the best
    than laws may owe to their form. What the true cause takes away, put beside the rival, follows a
    non-central chi-squared of one degree of freedom, with `chi_squared` as non-centrality.

    Parameters
    ----------
    chi_squared : see `refitted`; of all recordings.
    explained : chi-squared that the true cause explains in all recordings.
    """
    form = max(decides.form, decides.form_share * explained)
    from scipy.stats import ncx2  # takes its time, and little else needs it

    return float(ncx2.sf(form, 1, max(chi_squared, 0.0)))


def precision(new: Matrix, information: Matrix, at: Sequence[int]) -> tuple[float, float]:
    """How sure some unknowns are, before and after a new recording.

    Parameters
    ----------
    new, information : (p, p) of all unknowns in the new recording, and in those so far.
    at : of the p unknowns.

    Returns
    -------
    before, after : geometric mean of the standard deviations along the axes of their ellipsoid;
        Ds-optimality makes it least, whatever their units. Of one unknown it is its standard
        deviation. Source: A. C. Atkinson, A. N. Donev, R. D. Tobias (2007), Optimum Experimental
        Designs, with SAS, section 10.3.
    """
    before, after = (
        float(np.exp(0.5 * np.linalg.slogdet(covariance(known)[np.ix_(at, at)])[1] / len(at)))
        for known in (information, information + new)
    )
    return before, after


# --- predictions ---


LIKELY = 0.5  # a chance that is more likely than not


@dataclass(frozen=True, eq=False)
class Prediction:
    """What one experiment would tell."""

    # candidate, case: the experiment, and a recording of it as the first rival predicts it
    candidate: Experiment
    case: Case
    # (r, r) chi-squared that the second rival leaves beyond the first where the first is true, in
    # all recordings with this one
    pairwise: Matrix
    chance: Matrix  # (r, r) that a diagnosis then tells them apart
    # mean deviation of the sizes of the first rival, before and after
    precision: tuple[float, float]
    block_time: Vector  # (b,) [s]
    # (r, b, c) what each leaves of the first one's response, by block and channel, in units of its
    # noise
    left: NDArray[np.float64]

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Rivals that it likely leaves together, by number."""
        together = np.minimum(self.chance, self.chance.T) <= LIKELY
        np.fill_diagonal(together, True)
        _, of = connected_components(together)
        return tuple(tuple(np.flatnonzero(of == g).tolist()) for g in dict.fromkeys(of))

    @property
    def _parted_pairs(self) -> NDArray[np.bool_]:
        """(r, r) pairs that it parts; all of them where it parts none."""
        count = len(self.pairwise)
        pairs = ~np.eye(count, dtype=bool)
        if len(self.groups) > 1:
            for group in self.groups:
                pairs[np.ix_(group, group)] = False
        return pairs

    @property
    def separation(self) -> float:
        """Least distance of two rivals that it parts [standard deviations]; of any, if none."""
        least = self.pairwise[self._parted_pairs].min(initial=np.inf)
        return float(np.sqrt(max(0.0, least))) if np.isfinite(least) else 0.0

    @property
    def right(self) -> float:
        """Chance that the true rival, or the group that it leaves it in, is then named alone.

        At least that, each rival being as likely: chances of being mistaken for another add up
        (Bonferroni).
        """
        missed = np.where(self._parted_pairs, 1.0 - self.chance, 0.0).sum(axis=1)
        return float(np.maximum(0.0, 1.0 - missed).mean())


@dataclass(frozen=True)
class DesignProblem:
    """What experiments are predicted with."""

    everything: Path  # FMU with all effects
    system: System
    rivals: Rivals  # that they are to tell apart
    effects: Mapping[str, Effect]  # of the FMU, by name

    @property
    def source(self) -> ModelSource:
        """The FMU, with what the diagnosed model has."""
        return ModelSource(self.everything, self.system, self.rivals.given)


def predict(
    problem: DesignProblem, model: OpenModel, candidate: Experiment, case: Case, *, in_full: bool
) -> Prediction:
    """What an experiment would tell.

    Parameters
    ----------
    model : with all effects.
    case : a recording of it as the first rival predicts it.
    in_full : whether rivals are fitted again, or taken as they are linearised where they are.
    """
    with ResidualModel(problem.source, [case], model=model) as simulations:
        fit = Fit(simulations, list(problem.effects.values()), beside=[case])
        deviations = _initial_deviations(fit, start_of(problem.system, candidate))
        points = [_linearize(fit, problem, rival, deviations) for rival in problem.rivals.models]

        def refit(true: _RivalPoint, other: _RivalPoint) -> tuple[float, Matrix]:
            return Refit(fit, other.lin, true.own.r, other.so_far).left(other.active)

        pairwise, chance, left = _compare(
            problem.rivals, points, fit.decides, refit if in_full else _linear_fit
        )
        first = points[0]
        sizes = [first.joint.shared.index(key) for key in problem.rivals.models[0].sizes]
        (samples,), (counted,) = simulations.recordings, simulations.cases
        return Prediction(
            candidate=candidate,
            case=counted,
            pairwise=pairwise,
            chance=chance,
            precision=precision(first.own.eliminated().N, first.information, sizes),
            block_time=samples.time[samples.blocks.mean(axis=1).astype(int)],
            left=left,
        )


@dataclass(frozen=True, eq=False)
class _RivalPoint:
    """A rival about its point, along an experiment."""

    active: tuple[Effect, ...]  # its causes
    lin: LinearizedPoint  # errors and derivatives there
    joint: Joint  # over its common unknowns
    so_far: RecordingSystem  # the recordings so far over these
    bare: RecordingSystem  # its responses without its causes, beside the derivatives of `joint`

    @property
    def own(self) -> RecordingSystem:
        """Of the experiment alone."""
        (system,) = self.joint.systems
        return system

    @property
    def information(self) -> Matrix:
        """Of the common unknowns in the recordings so far, (p, p)."""
        return add([self.so_far.eliminated(), self.joint.prior]).N


def _initial_deviations(fit: Fit, start: Mapping[str, float]) -> Matrix:
    """Deviations of an experiment whose states start as they are set, in standard deviations."""
    point = fit.unknowns.start()
    deviations = point.deviations.copy()
    (usual,) = fit.unknowns.starts(point).values()
    for j, (state, spread) in enumerate(fit.unknowns.local.items()):
        if state in start:
            away = start[state] - usual[state]
            deviations[0, j] = away / fit.unknowns.spread(point, state, 0, spread)
    return deviations


def _linearize(fit: Fit, problem: DesignProblem, rival: Rival, deviations: Matrix) -> _RivalPoint:
    rivals, effects = problem.rivals, problem.effects
    start = fit.unknowns.start()
    levels = {key: rival.levels.get(key, usual) for key, usual in start.levels.items()}
    turning = {name for name, parameter in rival.sizes if parameter == "amplitude"}
    phases = {name: np.zeros(fit.unknowns.count) for name in turning}
    point = Point(rival.sizes, levels, deviations, phases)
    active = tuple(effects[name] for name in rival.effects)
    lin = fit.linearise(fit.at(point), active)
    # A further sensor has noise alone.
    variance_factors = np.ones(lin.variance_factors.size)
    variance_factors[: rivals.variance_factors.size] = rivals.variance_factors
    lin = replace(lin, variance_factors=variance_factors)
    (whole,), (without,) = lin.residuals, fit.at(Point({}, levels, deviations, {})).residuals
    bare = replace(whole, errors=without.errors, rest=without.rest)
    joint = fit.quadratics(lin)
    (unexplained,) = fit.quadratics(replace(lin, residuals=(bare,))).systems
    so_far = rival.so_far(joint.shared, fit.decides.furthest_level)
    return _RivalPoint(active, lin, joint, so_far, unexplained)


def _linear_fit(true: _RivalPoint, other: _RivalPoint) -> tuple[float, Matrix]:
    """Chi-squared that a rival leaves, and errors by block and channel, linearised."""
    away = _away(other.own, true.own)
    left, z = refitted(away.eliminated(), other.information)
    return left, away.errors(z)


def _compare(
    rivals: Rivals,
    points: Sequence[_RivalPoint],
    decides: Thresholds,
    leaves: Callable[[_RivalPoint, _RivalPoint], tuple[float, Matrix]],
) -> tuple[Matrix, Matrix, NDArray[np.float64]]:
    """`pairwise`, `chance` and `left` of a `Prediction`."""
    number, first = len(points), points[0]
    pairwise, chance = np.zeros((number, number)), np.ones((number, number))
    left = [np.zeros_like(first.own.errors(np.zeros(len(first.joint.shared))))]
    for i, (true, model) in enumerate(zip(points, rivals.models, strict=True)):
        explained = model.explained + _chi_squared_explained(true)
        for j, (other, rival) in enumerate(zip(points, rivals.models, strict=True)):
            if i == j:
                continue
            total, errors = leaves(true, other)
            pairwise[i, j] = total + rival.chi_squared - model.chi_squared
            chance[i, j] = discrimination_chance(pairwise[i, j], explained, decides)
            if i == 0:
                left.append(errors)
    return pairwise, chance, np.array(left)


def _chi_squared_explained(true: _RivalPoint) -> float:
    """Chi-squared that the causes explain in an experiment, beyond what levels do."""
    away = _away(true.bare, true.own).eliminated()
    at = [j for j, key in enumerate(true.joint.shared) if key in true.joint.levels]
    levels = Quadratic(away.N[np.ix_(at, at)], away.g[at], away.c, away.rows)
    return levels.at(minimum(levels))


def _away(rival: RecordingSystem, true: RecordingSystem) -> RecordingSystem:
    """A rival in an experiment where another is true, noise left out."""
    return replace(rival, r=rival.r - true.r, deviations=np.zeros(rival.deviations.size))


class Refit(Fit):
    """Least squares of a rival against the response of a true model, without noise.

    Recordings so far go on counting, as their derivatives have them.

    Parameters
    ----------
    fit : of the one recording.
    start : the rival as it was fitted, about the experiment's own start.
    true : whitened errors of the true model, (n,).
    so_far : the recordings so far, over the rival's common unknowns.
    """

    def __init__(
        self, fit: Fit, start: LinearizedPoint, true: Vector, so_far: RecordingSystem
    ) -> None:
        self.__dict__.update(vars(fit))
        self._start, self._true, self._so_far = start, true, so_far

    def quadratics(self, lin: LinearizedPoint, extra: Sequence[Key] = ()) -> Joint:
        """As `Fit.quadratics`: errors from the true model, deviations from the rival's start."""
        joint = super().quadratics(lin, extra)
        (system,), start = joint.systems, self._start.point
        deviations = system.deviations - start.deviations[0]
        away = replace(system, r=system.r - self._true, deviations=deviations)
        now, then = ({**point.sizes, **point.levels} for point in (lin.point, start))
        z = np.array([now[key] - then[key] for key in joint.shared])
        return replace(joint, systems=(away, self._so_far.moved(z)))

    def left(self, active: Sequence[Effect]) -> tuple[float, Matrix]:
        """Chi-squared that the rival leaves beyond what it began with.

        Returns
        -------
        left : chi-squared.
        errors : whitened, of the experiment by block and channel, (b, c).
        """
        right = self._so_far.chi_squared + self.quadratics(self._start).prior.c
        value, lin = self.least(self._start, active, self._start.variance_factors, right)
        system = self.quadratics(lin.derived_as(self._start)).systems[0]
        return value - right, system.r[: system.blocks].reshape(-1, system.channels)


class ExperimentPredictor:
    """The model with all effects, opened once for all experiments."""

    def __init__(self, problem: DesignProblem, model: CoSimulation, derived: OpenModel) -> None:
        self._problem, self._model, self._derived = problem, model, derived

    def predict_experiment(
        self, candidate: Experiment, number: int, sensor: Signal | None, in_full: bool
    ) -> Prediction | None:
        """Predict an experiment; None if too few samples of it would count.

        Parameters
        ----------
        number : of the recording.
        sensor : that it has besides.
        in_full : see `predict`.
        """
        problem = self._problem
        if sensor is not None:
            problem = replace(problem, system=with_sensor(problem.system, sensor))
        case = self._record(problem, candidate, problem.rivals.models[0], number)
        if not counts(case, problem.system):
            return None
        return predict(problem, self._derived, candidate, case, in_full=in_full)

    def confirm(self, prediction: Prediction, number: int) -> Prediction | None:
        """Predict it with models fitted again in full; None where validity differs by rival.

        It does not where all stay within the system's validity range, or leave it for the same
        reasons. Where only one of them leaves it, none predicts the recording.
        """
        problem = self._problem
        first = exclusion_reasons(prediction.case, problem.system)
        if first is None:
            return None
        for rival in problem.rivals.models[1:]:
            other = self._record(problem, prediction.candidate, rival, number)
            if exclusion_reasons(other, problem.system) != first:
                return None
        return predict(problem, self._derived, prediction.candidate, prediction.case, in_full=True)

    def _record(
        self, problem: DesignProblem, candidate: Experiment, rival: Rival, number: int
    ) -> Case:
        system, names = problem.system, set(problem.rivals.signals)
        if system.experiments:
            names |= {sensor.name for sensor in system.experiments.sensors}
        beside = (*system.reference_signals, *system.intermittent)
        references = tuple(signal.name for signal in beside if signal.name in names)
        values = _values(problem, candidate, rival)
        return predict_recording(self._model, system, candidate, values, references, number)


@contextmanager
def open_predictor(problem: DesignProblem) -> Iterator[ExperimentPredictor]:
    """Open the models of a worker."""
    with CoSimulation(problem.everything) as model, opened(problem.source) as derived:
        yield ExperimentPredictor(problem, model, derived)


def _values(problem: DesignProblem, candidate: Experiment, rival: Rival) -> dict[str, float]:
    system, rivals, effects = problem.system, problem.rivals, problem.effects
    values = dict(rivals.given)
    for condition in system.conditions:
        setting = candidate.settings.get(condition.name)
        usual = condition.choices[0] if condition.choices else ""
        values |= condition.means(setting.value if setting else usual)
    for (name, choice), level in rival.levels.items():
        if name in system.comparison.levels and choice in _choices(system, name, candidate):
            values[name] = level
    for (name, parameter), size in rival.sizes.items():
        part = "cosine" if parameter == "amplitude" else parameter
        if effects[name].late:
            continue  # a matter of its recording, not of the model
        for variable in variables(effects[name], part):
            start = rivals.given.get(variable, 0.0) if part in effects[name].sizes else 0.0
            values[variable] = start + size
    return values


def _choices(system: System, level: str, candidate: Experiment) -> set[str]:
    """Names that the level of a parameter may have in an experiment."""
    by = system.comparison.levels[level].by
    if not by:
        return {ALL}
    setting = candidate.settings.get(by)
    if setting is None:
        return {str(system.condition(by).choices[0])}
    values = setting.value if isinstance(setting.value, tuple) else (setting.value,)
    return set(map(str, values))


def with_sensor(system: System, sensor: Signal) -> System:
    """The system with a further signal that is compared."""
    channel = Channel(
        sensor.name,
        sensor.unit,
        sensor.label,
        sensor.shown,
        Expression.of(sensor.name, f"{system.source}, [next.sensors.{sensor.name}]"),
    )
    compared = replace(system.comparison, channels=(*system.comparison.channels, channel))
    return replace(
        system, reference_signals=(*system.reference_signals, sensor), comparison=compared
    )


def counts(case: Case, system: System) -> bool:
    """Whether a recording has enough that counts."""
    return _count_samples(case, system, restarting=True) is not None


def exclusion_reasons(case: Case, system: System) -> set[str] | None:
    """Reasons why samples are excluded, but for the end; None if too few samples count."""
    counted = _count_samples(case, system, restarting=False)
    if counted is None:
        return None
    reasons = [
        exclusion.reason for exclusion in system.comparison.exclusions if not exclusion.to_the_end
    ]
    return {reason for reason in reasons if counted.excluded[reason].any()}


def _count_samples(case: Case, system: System, *, restarting: bool) -> CountedSamples | None:
    try:
        return count(case, system, tuple(case.signals), SOUND, restarting=restarting)
    except InputError:
        return None
