"""The diagnosis as its power is measured: all effects of the library in one FMU, set by set."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench import diagnosis
from workbench.arrays import Vector
from workbench.diagnosis import Diagnosis, Effect, Problem, catalogue, library_of
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Joint, Key
from workbench.diagnosis.inference.rivals import Rivals, gathered
from workbench.diagnosis.inference.score_test import shapes, signatures
from workbench.diagnosis.inference.search import FittedModel, examine, extended
from workbench.diagnosis.inference.verdict import conclude
from workbench.diagnosis.laws import one_law
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.simulator import WhitenedResiduals
from workbench.errors import InputError
from workbench.models.modelica import read_library
from workbench.recordings.case import Case
from workbench.runtime.engine import ALONE, silent
from workbench.system.system import System

_NONE: Mapping[Key, tuple[float, Sequence[Case]]] = {}


def library_effects(system: System) -> tuple[Effect, ...]:
    """Effects of a system's library, which a diagnosis may find."""
    if not system.library.is_file():
        raise InputError(
            where=str(system.source),
            found=f"no Modelica library {system.library.name} beside it",
            expected="a library, whose effects are injected into its own model",
            remedy="put package.mo beside the system file, or give it with --library. The power of "
            "a diagnosis of an FMU alone is not measured",
        )
    return catalogue(system, read_library(system.library))


def build_everything(system: System, effects: Sequence[Effect], path: Path) -> None:
    """Build the FMU of the observer model with every effect, at zero."""
    diagnosis.build_everything(system, read_library(system.library), effects, path)


def diagnose_set(
    system: System, effects: Sequence[Effect], everything: Path, cases: Sequence[Case]
) -> Diagnosis:
    """Diagnose one set of recordings, in this process alone."""
    with _fit(system, effects, everything, cases) as (_, fit):
        result = conclude(fit, effects, silent)
    if result.verdict != "found":
        return result
    law = one_law(result, Problem(system, cases, library_of(system), effects), ALONE)
    return result.outdone(law) if law else result


def information_of_set(
    system: System,
    effects: Sequence[Effect],
    everything: Path,
    cases: Sequence[Case],
    others: Mapping[Key, tuple[float, Sequence[Case]]] = _NONE,
) -> Joint:
    """Linearise one set about the nominal model: what it says of each effect and each level.

    Errors have the variance of the sensors' noise; levels and what differs between recordings have
    the tolerances of the system file.

    Parameters
    ----------
    others : by the name of an effect that the catalogue lacks, its size and the same recordings
        with it; its signature is the difference of their errors, over that size.
    """
    with _fit(system, effects, everything, cases) as (_, fit):
        candidates = [
            (effect, shape)
            for effect in effects
            if not fit.unknowns.presence.unseen(effect)
            for shape in shapes(effect)
        ]
        lin = fit.linearise(fit.at(fit.unknowns.start()), (), candidates)
        lin = replace(lin, variance_factors=np.ones(lin.variance_factors.size))
        joint = fit.quadratics(lin, signatures(candidates))
        for key, (size, changed) in others.items():
            with _fit(system, effects, everything, changed) as (_, other):
                errors = other.at(other.unknowns.start()).residuals
            moved = map(_accounted, errors, lin.residuals)
            joint = joint.joined(key, [column / size for column in moved])
        return joint


def _accounted(changed: WhitenedResiduals, usual: WhitenedResiduals) -> Vector:
    """What a model with the effect takes from errors and rest, (b*c + q,), as long as both last."""
    blocks = min(len(changed.errors), len(usual.errors))
    errors = np.zeros_like(usual.errors)
    errors[:blocks] = usual.errors[:blocks] - changed.errors[:blocks]
    return np.append(errors.ravel(), usual.rest - changed.rest)


def rivals_of_set(
    system: System, effects: Sequence[Effect], everything: Path, cases: Sequence[Case]
) -> tuple[Diagnosis, Rivals | None]:
    """Diagnose one set, and keep its remaining candidates; None where no cause is found."""
    with _fit(system, effects, everything, cases) as (model, fit):
        result = conclude(fit, effects, silent)
        return result, gathered(model, fit, result.base, result.rivals) if result.rivals else None


def distances_in_set(
    system: System,
    effects: Sequence[Effect],
    everything: Path,
    cases: Sequence[Case],
    true: str,
    others: Sequence[str],
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
    with _fit(system, effects, everything, cases) as (_, fit):
        result = conclude(fit, effects, silent)
        base, trial = examine(fit, result.base, effects, silent)
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


def distance(chi_squared: float) -> float:
    """Standard deviations of a difference of chi-squared, with its sign."""
    return float(np.sign(chi_squared) * np.sqrt(abs(chi_squared)))


@contextmanager
def _fit(
    system: System, effects: Sequence[Effect], everything: Path, cases: Sequence[Case]
) -> Iterator[tuple[ResidualModel, Fit]]:
    with ResidualModel(ModelSource(everything, system, system.given), cases) as simulations:
        yield simulations, Fit(simulations, effects)
