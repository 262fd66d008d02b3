"""The diagnosis as its power is measured: all effects in one FMU, set by set."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis import Diagnosis, Effect, Problem
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Joint, Key
from workbench.diagnosis.inference.rivals import Rivals, gathered
from workbench.diagnosis.inference.score_test import shapes, signatures
from workbench.diagnosis.inference.search import FittedModel, examine, extended
from workbench.diagnosis.inference.verdict import conclude
from workbench.diagnosis.laws import one_law
from workbench.diagnosis.run import Result, ask_fit
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.simulator import WhitenedResiduals
from workbench.recordings.case import Case
from workbench.runtime.engine import ALONE, silent

_NONE: Mapping[Key, tuple[float, Sequence[Case]]] = {}


def diagnose_set(problem: Problem, everything: Path) -> Diagnosis:
    """Diagnose one set of recordings, in this process alone.

    Parameters
    ----------
    everything : FMU with all effects of the problem, at zero.
    """

    def concluded(shown: Problem, _: ResidualModel, fit: Fit) -> Diagnosis:
        return conclude(fit, shown.effects, silent)

    result = _ask(problem, everything, concluded)
    if result.verdict != "found":
        return result
    law = one_law(result, problem, ALONE)
    return result.outdone(law) if law else result


def information_of_set(
    problem: Problem,
    everything: Path,
    others: Mapping[Key, tuple[float, Sequence[Case]]] = _NONE,
) -> tuple[Joint, Sequence[Effect]]:
    """Linearise one set about the nominal model: what it says of each effect and each level.

    Errors have the variance of the sensors' noise; levels and what differs between recordings have
    the tolerances of the system file.

    Parameters
    ----------
    others : by the name of an effect that the catalogue lacks, its size and the same recordings
        with it; its signature is the difference of their errors, over that size.

    Returns
    -------
    joint : of the set.
    effects : that it can show, with their shapes.
    """

    def informed(
        shown: Problem, _: ResidualModel, fit: Fit
    ) -> tuple[Joint, list[WhitenedResiduals], Sequence[Effect]]:
        candidates = [
            (effect, shape)
            for effect in shown.effects
            if not fit.unknowns.presence.unseen(effect)
            for shape in shapes(effect)
        ]
        lin = fit.linearise(fit.at(fit.unknowns.start()), (), candidates)
        lin = replace(lin, variance_factors=np.ones(lin.variance_factors.size))
        joint = fit.quadratics(lin, signatures(candidates))
        return joint, list(lin.residuals), shown.effects

    def begun(_: Problem, __: ResidualModel, fit: Fit) -> Sequence[WhitenedResiduals]:
        return fit.at(fit.unknowns.start()).residuals

    joint, usual, effects = _ask(problem, everything, informed)
    for key, (size, changed) in others.items():
        errors = _ask(replace(problem, cases=changed), everything, begun)
        joint = joint.joined(key, [column / size for column in map(_accounted, errors, usual)])
    return joint, effects


def _accounted(changed: WhitenedResiduals, usual: WhitenedResiduals) -> Vector:
    """What a model with the effect takes from errors and rest, (b*c + q,), as long as both last."""
    blocks = min(len(changed.errors), len(usual.errors))
    errors = np.zeros_like(usual.errors)
    errors[:blocks] = usual.errors[:blocks] - changed.errors[:blocks]
    return np.append(errors.ravel(), usual.rest - changed.rest)


def rivals_of_set(problem: Problem, everything: Path) -> tuple[Diagnosis, Rivals | None]:
    """Diagnose one set, and keep its remaining candidates; None where no cause is found."""

    def concluded(
        shown: Problem, simulations: ResidualModel, fit: Fit
    ) -> tuple[Diagnosis, Rivals | None]:
        result = conclude(fit, shown.effects, silent)
        rivals = result.rivals
        return result, gathered(simulations, fit, result.base, rivals) if rivals else None

    return _ask(problem, everything, concluded)


def distances_in_set(
    problem: Problem, everything: Path, true: str, others: Sequence[str]
) -> tuple[Diagnosis, dict[str, float]]:
    """Diagnose one set, and measure how far effects stay from the true one, each fitted alone.

    What an experiment promises is the least chi-squared of a wrong model, in units of what the
    right one leaves wrong in each channel. The fit of a diagnosis is another one, which lets a
    channel go that is wrong. So each is fitted again, in these units.

    Returns
    -------
    distances : by name [standard deviations], negative if it is nearer than the true one; of those
        that could be fitted.
    """

    def measured(shown: Problem, __: ResidualModel, fit: Fit) -> tuple[Diagnosis, dict[str, float]]:
        result = conclude(fit, shown.effects, silent)
        base, trial = examine(fit, result.base, shown.effects, silent)
        fits: dict[str, FittedModel | None] = {}
        for score in trial.scores():
            name = score.effect.name
            if name in (true, *others) and name not in fits:
                fits[name] = extended(fit, base, score)
        if (right := fits.get(true)) is None:
            return result, {}
        _, settled = fit.least(right.linearised, right.active, right.linearised.variance_factors)
        units = fit.at(settled.point).variance_factors
        least = {
            name: fit.least(fitted.linearised, fitted.active, units)[0]
            for name, fitted in fits.items()
            if fitted is not None
        }
        return result, {
            name: distance(c - least[true]) for name, c in least.items() if name != true
        }

    return _ask(problem, everything, measured)


def distance(chi_squared: float) -> float:
    """Standard deviations of a difference of chi-squared, with its sign."""
    return float(np.sign(chi_squared) * np.sqrt(abs(chi_squared)))


def _ask(
    problem: Problem,
    everything: Path,
    ask: Callable[[Problem, ResidualModel, Fit], Result],
) -> Result:
    """Ask a fit, in this process alone; see `ask_fit`."""
    source = ModelSource(everything, problem.system, problem.system.given)
    return ask_fit(problem, source, ALONE, ask)
