"""What every rival predicts of every experiment, and what that would tell them apart by."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.motion import ModelSource, OpenModel
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint, Point
from workbench.diagnosis.inference.quadratic import Joint, Quadratic, RecordingSystem, add, minimum
from workbench.diagnosis.inference.rivals import Rival, Rivals
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.recordings.case import Case
from workbench.studies.design.candidates import Experiment
from workbench.studies.design.recorded import start_of
from workbench.studies.design.refit import Refit
from workbench.studies.design.separation import discrimination_chance, precision, refitted
from workbench.system.experiments import Experiments
from workbench.system.system import System

LIKELY = 0.5  # a chance that is more likely than not


@dataclass(frozen=True, eq=False)
class Prediction:
    """What one experiment would tell.

    Attributes
    ----------
    candidate, case : the experiment, and a recording of it as the first rival predicts it.
    pairwise : (r, r) chi-squared that the second rival leaves beyond the first where the first is
        true, in all recordings with this one.
    chance : (r, r) that a diagnosis then tells them apart.
    precision : mean deviation of the sizes of the first rival, before and after.
    block_time : (b,) [s].
    left : (r, b, c) what each leaves of the first one's response, by block and channel, in units of
        its noise.
    """

    candidate: Experiment
    case: Case
    pairwise: Matrix
    chance: Matrix
    precision: tuple[float, float]
    block_time: Vector
    left: NDArray[np.float64]

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Rivals that it likely leaves together, by number."""
        together = np.minimum(self.chance, self.chance.T) <= LIKELY
        np.fill_diagonal(together, True)
        _, of = connected_components(together)
        return tuple(tuple(np.flatnonzero(of == g).tolist()) for g in dict.fromkeys(of))

    @property
    def _between(self) -> NDArray[np.bool_]:
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
        least = self.pairwise[self._between].min(initial=np.inf)
        return float(np.sqrt(max(0.0, least))) if np.isfinite(least) else 0.0

    @property
    def right(self) -> float:
        """Chance that the true rival, or the group that it leaves it in, is then named alone.

        At least that, each rival being as likely: chances of being mistaken for another add up
        (Bonferroni).
        """
        missed = np.where(self._between, 1.0 - self.chance, 0.0).sum(axis=1)
        return float(np.maximum(0.0, 1.0 - missed).mean())


@dataclass(frozen=True)
class DesignProblem:
    """What experiments are predicted with.

    Attributes
    ----------
    everything : FMU with all effects.
    experiments : that the system allows.
    rivals : that they are to tell apart.
    effects : of the FMU, by name.
    """

    everything: Path
    system: System
    experiments: Experiments
    rivals: Rivals
    effects: Mapping[str, Effect]

    @property
    def source(self) -> ModelSource:
        """The FMU, with what the diagnosed model has."""
        return ModelSource(self.everything, self.system, self.rivals.given)


def predicted(
    asked: DesignProblem, model: OpenModel, candidate: Experiment, case: Case, *, in_full: bool
) -> Prediction:
    """What an experiment would tell.

    Parameters
    ----------
    model : with all effects.
    case : a recording of it as the first rival predicts it.
    in_full : whether rivals are fitted again, or taken as they are linearised where they are.
    """
    with ResidualModel(asked.source, [case], model=model) as simulations:
        fit = Fit(simulations, list(asked.effects.values()), beside=[case])
        begun = _begun(fit, start_of(asked.system, asked.experiments, candidate))
        rows = [_linearised(fit, asked, model, begun) for model in asked.rivals.models]

        def again(true: _Row, other: _Row) -> tuple[float, Matrix]:
            refit = Refit(fit, other.lin, true.own.r, other.so_far)
            return refit.left(other.active)

        return _prediction(
            simulations, fit, asked.rivals, rows, candidate, again if in_full else _once
        )


@dataclass(frozen=True, eq=False)
class _Row:
    """A rival about its point, along an experiment.

    Attributes
    ----------
    active : its causes.
    lin : errors and derivatives there.
    joint : over its common unknowns.
    so_far : the recordings so far over these.
    bare : its responses without its causes, beside the derivatives of `joint`.
    """

    active: tuple[Effect, ...]
    lin: LinearizedPoint
    joint: Joint
    so_far: RecordingSystem
    bare: RecordingSystem

    @property
    def own(self) -> RecordingSystem:
        """Of the experiment alone."""
        (one,) = self.joint.systems
        return one

    @property
    def information(self) -> Matrix:
        """Of the common unknowns in the recordings so far, (p, p)."""
        return add([self.so_far.eliminated(), self.joint.prior]).N


def _begun(fit: Fit, start: Mapping[str, float]) -> Matrix:
    """Deviations of an experiment whose states start as they are set, in standard deviations."""
    point = fit.unknowns.start()
    deviations = point.deviations.copy()
    (usual,) = fit.unknowns.starts(point).values()
    for j, (state, spread) in enumerate(fit.unknowns.local.items()):
        if state in start:
            away = start[state] - usual[state]
            deviations[0, j] = away / fit.unknowns.spread(point, state, 0, spread)
    return deviations


def _linearised(fit: Fit, asked: DesignProblem, rival: Rival, begun: Matrix) -> _Row:
    rivals, effects = asked.rivals, asked.effects
    start = fit.unknowns.start()
    levels = {key: rival.levels.get(key, usual) for key, usual in start.levels.items()}
    turning = {name for name, parameter in rival.sizes if parameter == "amplitude"}
    phases = {name: np.zeros(fit.unknowns.count) for name in turning}
    point = Point(rival.sizes, levels, begun, phases)
    active = tuple(effects[name] for name in rival.effects)
    lin = fit.linearise(fit.at(point), active)
    # A further sensor has noise alone.
    variance_factors = np.ones(lin.variance_factors.size)
    variance_factors[: rivals.variance_factors.size] = rivals.variance_factors
    lin = replace(lin, variance_factors=variance_factors)
    (one,), (without,) = lin.residuals, fit.at(Point({}, levels, begun, {})).residuals
    bare = replace(one, errors=without.errors, rest=without.rest)
    joint = fit.quadratics(lin)
    (unexplained,) = fit.quadratics(replace(lin, residuals=(bare,))).systems
    so_far = rival.so_far(joint.shared, fit.decides.furthest_level)
    return _Row(active, lin, joint, so_far, unexplained)


def _once(true: _Row, other: _Row) -> tuple[float, Matrix]:
    """Chi-squared that a rival leaves, and errors by block and channel, linearised."""
    away = _away(other.own, true.own)
    left, z = refitted(away.eliminated(), other.information)
    return left, away.errors(z)


def _prediction(
    simulations: ResidualModel,
    fit: Fit,
    rivals: Rivals,
    rows: Sequence[_Row],
    candidate: Experiment,
    leaves: Callable[[_Row, _Row], tuple[float, Matrix]],
) -> Prediction:
    count_, first = len(rows), rows[0]
    pairwise, chance = np.zeros((count_, count_)), np.ones((count_, count_))
    left = [np.zeros_like(first.own.errors(np.zeros(len(first.joint.shared))))]
    for i, (true, model) in enumerate(zip(rows, rivals.models, strict=True)):
        explained = model.explained + _explained(true)
        for j, (other, rival) in enumerate(zip(rows, rivals.models, strict=True)):
            if i == j:
                continue
            total, errors = leaves(true, other)
            pairwise[i, j] = total + rival.chi_squared - model.chi_squared
            chance[i, j] = discrimination_chance(pairwise[i, j], explained, fit.decides)
            if i == 0:
                left.append(errors)
    at = [first.joint.shared.index(key) for key in rivals.models[0].sizes]
    (samples,), (case,) = simulations.recordings, simulations.cases
    return Prediction(
        candidate=candidate,
        case=case,
        pairwise=pairwise,
        chance=chance,
        precision=precision(first.own.eliminated().N, first.information, at),
        block_time=samples.time[samples.blocks.mean(axis=1).astype(int)],
        left=np.array(left),
    )


def _explained(true: _Row) -> float:
    """Chi-squared that the causes explain in an experiment, beyond what levels do."""
    away = _away(true.bare, true.own).eliminated()
    at = [j for j, key in enumerate(true.joint.shared) if key in true.joint.levels]
    levels = Quadratic(away.N[np.ix_(at, at)], away.g[at], away.c, away.rows)
    return levels.at(minimum(levels))


def _away(rival: RecordingSystem, true: RecordingSystem) -> RecordingSystem:
    """A rival in an experiment where another is true, noise left out."""
    return replace(rival, r=rival.r - true.r, deviations=np.zeros(rival.deviations.size))
