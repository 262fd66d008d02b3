"""What every rival predicts of every experiment, and what that would tell them apart by."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from workbench.case import Case
from workbench.diagnosis.catalogue import Effect
from workbench.diagnosis.evidence import Simulations
from workbench.diagnosis.extension import variables
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.linearised import Linearised, Point
from workbench.diagnosis.quadratic import (
    Joint,
    Quadratic,
    RecordingSystem,
    add,
    minimum,
)
from workbench.diagnosis.rivals import Rival, Rivals
from workbench.diagnosis.unknowns import ALL
from workbench.experiments.candidates import Experiment
from workbench.experiments.claims import left_claims
from workbench.experiments.recorded import recorded, start_of
from workbench.experiments.refit import Refit
from workbench.experiments.separation import precision, refitted, told_apart
from workbench.fmu import CoSimulation, Matrix, Vector
from workbench.pool import Pool
from workbench.system import System
from workbench.system_experiments import Experiments

LIKELY = 0.5  # a chance that is more likely than not


@dataclass(frozen=True, eq=False)
class Prediction:
    """What one experiment would tell.

    Attributes
    ----------
    candidate, case : the experiment, and a recording of it as the first rival predicts it.
    apart : (r, r) chi-squared that the second leaves beyond the first where the first is true, in
        all recordings with this one.
    chance : (r, r) that a diagnosis then tells them apart.
    precision : mean deviation of the sizes of the first rival, before and after.
    block_time : (b,) [s].
    left : (r, b, c) what each leaves of the first one's response, by block and channel, in units of
        its noise.
    """

    candidate: Experiment
    case: Case
    apart: Matrix
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
        count = len(self.apart)
        pairs = ~np.eye(count, dtype=bool)
        if len(self.groups) > 1:
            for group in self.groups:
                pairs[np.ix_(group, group)] = False
        return pairs

    @property
    def separation(self) -> float:
        """Least distance of two rivals that it parts [standard deviations]; of any, if none."""
        least = self.apart[self._between].min(initial=np.inf)
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
class Outlook:
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


@contextmanager
def _modelled(path: Path) -> Iterator[CoSimulation]:
    with CoSimulation(path) as model:
        yield model


def predicted_cases(
    asked: Outlook, plan: Sequence[Experiment], rival: Rival, workers: int
) -> list[Case]:
    """Recordings of experiments as a rival predicts them."""
    system, experiments = asked.system, asked.experiments
    added = {one.name for one in experiments.sensors}
    judged = tuple(one.name for one in system.judged if one.name in {*asked.rivals.signals, *added})
    with Pool(min(workers, len(plan)), _modelled, asked.everything) as pool:
        under_way = [
            pool.submit(
                recorded,
                *(system, experiments, one, _values(asked, one, rival)),
                *(f"{number:03}", judged, number),
            )
            for number, one in enumerate(plan, 1)
        ]
        return [one.result() for one in under_way]


def claimed_alike(
    asked: Outlook, planned: Sequence[tuple[Experiment, Case]], workers: int
) -> list[bool]:
    """Whether all rivals stay within what the system claims, or leave it for the same reasons.

    What one of them alone takes out of them is foreseen by none.
    """
    plan = [candidate for candidate, _ in planned]
    first = [left_claims(case, asked.system) for _, case in planned]
    alike = [reasons is not None for reasons in first]
    for rival in asked.rivals.models[1:]:
        others = predicted_cases(asked, plan, rival, workers)
        for k, case in enumerate(others):
            alike[k] = alike[k] and left_claims(case, asked.system) == first[k]
    return alike


def _values(asked: Outlook, candidate: Experiment, rival: Rival) -> dict[str, float]:
    """Parameters of a rival in an experiment."""
    system, rivals, effects = asked.system, asked.rivals, asked.effects
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
    """What the level of a parameter may be called in an experiment."""
    by = system.comparison.levels[level].by
    if not by:
        return {ALL}
    setting = candidate.settings.get(by)
    if setting is None:
        return {str(system.condition(by).choices[0])}
    said = setting.value if isinstance(setting.value, tuple) else (setting.value,)
    return set(map(str, said))


def predictions(
    asked: Outlook,
    planned: Sequence[tuple[Experiment, Case]],
    workers: int,
) -> list[Prediction]:
    """What each experiment would tell, in their order, of rivals linearised where they are."""
    with _fitted(asked, planned, workers) as (simulations, fit, rows):
        return [
            _prediction(simulations, fit, asked.rivals, rows, k, candidate, _once)
            for k, (candidate, _) in enumerate(planned)
        ]


def refitted_predictions(
    asked: Outlook,
    planned: Sequence[tuple[Experiment, Case]],
    workers: int,
) -> list[Prediction]:
    """As `predictions`, of rivals that are fitted again in full: each experiment by itself."""
    with Pool(min(workers, len(planned)), nullcontext, asked) as pool:
        under_way = [pool.submit(_refitted, candidate, case) for candidate, case in planned]
        return [one.result() for one in under_way]


def _refitted(asked: Outlook, candidate: Experiment, case: Case) -> Prediction:
    with _fitted(asked, [(candidate, case)], 1) as (simulations, fit, rows):

        def again(true: _Row, other: _Row, _: int) -> tuple[float, Matrix]:
            refit = Refit(fit, other.lin, true.joint.systems[0].r, other.so_far)
            return refit.left(other.active)

        return _prediction(simulations, fit, asked.rivals, rows, 0, candidate, again)


@dataclass(frozen=True, eq=False)
class _Row:
    """A rival about its point, along all experiments.

    Attributes
    ----------
    active : its causes.
    lin : errors and derivatives there.
    joint : over its common unknowns.
    so_far : the recordings so far over these.
    bare : its responses without its causes, beside the derivatives of `joint`.
    """

    active: tuple[Effect, ...]
    lin: Linearised
    joint: Joint
    so_far: RecordingSystem
    bare: Joint

    @property
    def information(self) -> Matrix:
        """Of the common unknowns in the recordings so far, (p, p)."""
        return add([self.so_far.eliminated(), self.joint.prior]).N


@contextmanager
def _fitted(
    asked: Outlook, planned: Sequence[tuple[Experiment, Case]], workers: int
) -> Iterator[tuple[Simulations, Fit, list[_Row]]]:
    """All rivals about their points, along experiments."""
    cases = [case for _, case in planned]
    with Simulations(
        asked.everything, asked.system, asked.rivals.given, cases, workers
    ) as simulations:
        fit = Fit(simulations, list(asked.effects.values()), beside=cases[:1])
        starts = [start_of(asked.system, asked.experiments, one) for one, _ in planned]
        begun = _begun(fit, starts)
        yield simulations, fit, [_linearised(fit, asked, one, begun) for one in asked.rivals.models]


def _begun(fit: Fit, starts: Sequence[Mapping[str, float]]) -> Matrix:
    """Deviations of experiments whose states start as they are set, in standard deviations."""
    point = fit.unknowns.start()
    deviations = point.deviations.copy()
    usual = fit.unknowns.starts(point)
    for k, (name, start) in enumerate(zip(fit.unknowns.names, starts, strict=True)):
        for j, (state, spread) in enumerate(fit.unknowns.local.items()):
            if state in start:
                away = start[state] - usual[name][state]
                deviations[k, j] = away / fit.unknowns.spread(point, state, k, spread)
    return deviations


def _linearised(fit: Fit, asked: Outlook, rival: Rival, begun: Matrix) -> _Row:
    rivals, effects = asked.rivals, asked.effects
    start = fit.unknowns.start()
    levels = {key: rival.levels.get(key, usual) for key, usual in start.levels.items()}
    turning = {name for name, parameter in rival.sizes if parameter == "amplitude"}
    phases = {name: np.zeros(fit.unknowns.count) for name in turning}
    point = Point(rival.sizes, levels, begun, phases)
    active = tuple(effects[name] for name in rival.effects)
    lin = fit.linearise(fit.at(point), active)
    # A further sensor has noise alone.
    inflation = np.ones(lin.inflation.size)
    inflation[: rivals.inflation.size] = rivals.inflation
    lin = replace(lin, inflation=inflation)
    nominal = fit.at(Point({}, levels, begun, {})).evidence
    bare = [
        replace(one, errors=without.errors, rest=without.rest)
        for one, without in zip(lin.evidence, nominal, strict=True)
    ]
    joint = fit.quadratics(lin)
    unexplained = fit.quadratics(replace(lin, evidence=tuple(bare)))
    so_far = rival.so_far(joint.shared, fit.decides.furthest_level)
    return _Row(active, lin, joint, so_far, unexplained)


def _once(true: _Row, other: _Row, k: int) -> tuple[float, Matrix]:
    """Chi-squared that a rival leaves, and errors by block and channel, linearised."""
    away = _away(other.joint, true.joint, k)
    left, z = refitted(away.eliminated(), other.information)
    return left, away.errors(z)


def _prediction(
    simulations: Simulations,
    fit: Fit,
    rivals: Rivals,
    rows: Sequence[_Row],
    k: int,
    candidate: Experiment,
    leaves: Callable[[_Row, _Row, int], tuple[float, Matrix]],
) -> Prediction:
    count_, first = len(rows), rows[0]
    apart, chance = np.zeros((count_, count_)), np.ones((count_, count_))
    own = first.joint.systems[k]
    left = [np.zeros_like(own.errors(np.zeros(len(first.joint.shared))))]
    for i, (true, model) in enumerate(zip(rows, rivals.models, strict=True)):
        explained = model.explained + _explained(true, k)
        for j, (other, rival) in enumerate(zip(rows, rivals.models, strict=True)):
            if i == j:
                continue
            total, errors = leaves(true, other, k)
            apart[i, j] = total + rival.chi_squared - model.chi_squared
            chance[i, j] = told_apart(apart[i, j], explained, fit.decides)
            if i == 0:
                left.append(errors)
    at = [first.joint.shared.index(key) for key in rivals.models[0].sizes]
    samples, case = simulations.recordings[k], simulations.cases[k]
    return Prediction(
        candidate=candidate,
        case=case,
        apart=apart,
        chance=chance,
        precision=precision(own.eliminated().N, first.information, at),
        block_time=samples.time[samples.blocks.mean(axis=1).astype(int)],
        left=np.array(left),
    )


def _explained(true: _Row, k: int) -> float:
    """Chi-squared that the causes explain in one experiment, beyond what levels do."""
    away = _away(true.bare, true.joint, k).eliminated()
    at = [j for j, key in enumerate(true.joint.shared) if key in true.joint.levels]
    levels = Quadratic(away.N[np.ix_(at, at)], away.g[at], away.c, away.rows)
    return levels.at(minimum(levels))


def _away(rival: Joint, true: Joint, k: int) -> RecordingSystem:
    """A rival in one experiment where another is true, noise left out."""
    one = rival.systems[k]
    zero = np.zeros(one.deviations.size)
    return replace(one, r=one.r - true.systems[k].r, deviations=zero)
