"""What comes nearest to what is missing, where none of it is the answer, and why not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from workbench.diagnosis.inference.causes import binding_bound, size_text
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.score_test import CandidateScore
from workbench.diagnosis.inference.search import (
    FittedModel,
    beyond,
    extended,
    is_clean,
)
from workbench.diagnosis.inference.selection import Selection
from workbench.diagnosis.inference.sets import Sets
from workbench.system.units import with_unit

NEAREST = 3  # candidates that are named where none is accepted


@dataclass(frozen=True)
class NearestCandidate:
    """Effects that come nearest to what is missing, and why they are not accepted."""

    effects: tuple[str, ...]  # their names
    removed: float  # share of the explainable that they remove on held-out recordings
    reasons: tuple[str, ...]  # why they are no answer, in words
    slight: bool = False  # whether they leave noise alone, at a size less than what matters
    change: str = ""  # what it is where it is no effect of the catalogue, sizes and 95 % intervals
    corrected: str = "the model"  # what is corrected for that

    @property
    def text(self) -> str:
        """For people."""
        names = " and ".join(self.effects)
        return f"{names} would remove {self.removed:.0%}, but {'; '.join(self.reasons)}"


def nearest_fits(fit: Fit, chosen: Selection) -> dict[tuple[str, ...], FittedModel]:
    """Fits that may come near to what is missing, by the names of their effects."""
    base, best = chosen.base, chosen.best
    fits = {
        rival.names: rival
        for step in chosen.steps
        for rival in step.rivals
        if len(rival.active) == 1
    }
    scores = chosen.steps[0].scores if chosen.steps else chosen.trial.scores()
    if not best.active or chosen.steps:
        others = dict[str, CandidateScore]()
        for score in sorted(scores, key=lambda score: -score.gain):
            if (score.effect.name,) not in fits and score.size:
                others.setdefault(score.effect.name, score)
        tried = list(others.values())[:NEAREST]
        fits |= {
            single.names: single
            for single in fit.together(partial(extended, fit, base), tried)
            if single is not None
        }
    if best.active:
        fits[best.names] = best
    return fits


def nearest_candidates(
    fit: Fit,
    chosen: Selection,
    fits: Mapping[tuple[str, ...], FittedModel],
    objections: Sequence[str],
) -> tuple[NearestCandidate, ...]:
    """What would remove most of what is missing on held-out recordings, and why it is no answer."""
    base, best, validation = chosen.base, chosen.best, chosen.validation
    nearest = []
    for names, model in fits.items():
        fast = validation.fast(base, model)
        removed = validation.explained(base, model, fast=fast)[0]
        if removed > 0.0:
            reasons = objections if model is best else _reasons(fit, chosen, model, fast=fast)
            slight = below_what_matters(model) and validation.noise_alone(model, fast=fast)
            nearest.append(NearestCandidate(names, removed, tuple(reasons), slight))
    return tuple(sorted(nearest, key=lambda candidate: -candidate.removed)[:NEAREST])


def undecided(fit: Fit, chosen: Selection) -> tuple[NearestCandidate, ...]:
    """Candidates that explain errors beyond noise, of which nobody knows whether they matter.

    One would matter, but another explains as well at a size that does not: a signal late by a fifth
    of a sample looks like a larger inductance. Empty where all that explains is too small.
    """
    shown: dict[str, CandidateScore] = {}
    for score in chosen.trial.scores():
        if score.held_out.sum() > fit.decides.needed and not score.like_levels:
            shown.setdefault(score.effect.name, score)
    if all(abs(score.alone) < score.effect.matters for score in shown.values()):
        return ()
    tried = [extended(fit, chosen.base, score) for score in list(shown.values())[:NEAREST]]
    fits = {model.names: model for model in tried if model is not None}
    small = {names for names, model in fits.items() if below_what_matters(model)}
    if len(small) == len(fits):
        return ()
    reasons = ("changes too small to matter explain as much",)
    return tuple(
        replace(candidate, slight=True)
        if candidate.effects in small
        else replace(candidate, reasons=reasons)
        for candidate in nearest_candidates(fit, chosen, fits, ())
    )


def _reasons(fit: Fit, chosen: Selection, fitted: FittedModel, *, fast: bool) -> list[str]:
    validation = chosen.validation
    (effect,) = fitted.active
    reasons = [
        f"{parameter} is at its bound"
        for _, parameter in fitted.point.sizes
        if binding_bound(fit, fitted, effect, parameter)
    ]
    if below_what_matters(fitted):
        least = with_unit(effect.matters, fit.unknowns.unit(effect, effect.size))
        size = size_text(fit, fitted, effect)
        reasons.append(f"its size, {size}, is less than what matters, {least}")
    worse = validation.worsened(chosen.base, fitted, fast=fast)
    reasons += [f"{' and '.join(worse)} would be predicted worse"] * bool(worse)
    left = np.sqrt(validation.squares(fitted, fast=fast))
    worst = fit.tests[int(np.argmax(left))]
    return [*reasons, f"it leaves {left.max():.1f} times the noise in {worst}"]


def below_what_matters(model: FittedModel) -> bool:
    """Whether all effects of a fit are smaller than what matters."""
    sizes = model.point.sizes
    return all(abs(sizes[effect.name, effect.label]) < effect.matters for effect in model.active)


def passed_over(
    fit: Fit, chosen: Selection, fits: Mapping[tuple[str, ...], FittedModel]
) -> FittedModel | None:
    """A single effect that leaves noise alone, or else two, where the search did not get.

    Of what switches, derivatives hold over so little that they say nothing of it. Of two effects
    that each explain a part, neither may be significant while the other is not there.
    """
    singles = [model for model in fits.values() if len(model.active) == 1]
    return _whole(fit, chosen, singles) or _whole(
        fit, chosen, Sets(chosen.best, chosen.trial).fits(fit, count=2)
    )


def fewer_causes(fit: Fit, chosen: Selection) -> FittedModel | None:
    """As few effects as explain what more causes do, to which one after another did not lead.

    A valve and a vessel that both are larger are a sensor, another valve and a vessel that err.
    """
    sets = Sets(chosen.best, chosen.trial)
    for count in range(1, len(chosen.best.active)):
        able = [
            model
            for model in sets.fits(fit, count)
            if beyond(model, chosen.best) < fit.decides.form and not below_what_matters(model)
        ]
        if able:
            return min(able, key=lambda model: model.misfit)
    return None


def _whole(fit: Fit, chosen: Selection, models: Sequence[FittedModel]) -> FittedModel | None:
    """The best of fits that leave noise alone and clearly less than what was found."""
    able = [
        model
        for model in models
        if model is not chosen.best
        and beyond(chosen.best, model) > fit.decides.needed
        and is_clean(fit, model)
        and chosen.validation.noise_alone(model, fast=chosen.validation.fast(chosen.base, model))
    ]
    return min(able, key=lambda model: model.misfit, default=None)
