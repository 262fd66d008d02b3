"""What comes nearest to what is missing, where none of it is the answer, and why not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from workbench.diagnosis.data.clocks import INPUT_DELAY
from workbench.diagnosis.effects.candidates import INPUT_LAG
from workbench.diagnosis.inference.causes import binding_bound, size_text
from workbench.diagnosis.inference.crossvalidation import CrossValidation
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.score_test import CandidateScore, score_test
from workbench.diagnosis.inference.search import (
    FittedModel,
    beyond,
    differentiable,
    examine,
    extended,
    is_clean,
    rival_fits,
    starts_of,
)
from workbench.diagnosis.inference.selection import Selection, anew
from workbench.runtime.engine import Reporter
from workbench.system.parts import Signal
from workbench.system.units import BAND, with_interval, with_unit

NEAREST = 3  # candidates that are named where none is accepted
_OUTSIDE = ("it is no effect of the catalogue",)  # why a single change is no cause


@dataclass(frozen=True)
class NearestCandidate:
    """Effects that come nearest to what is missing, and why they are not accepted."""

    effects: tuple[str, ...]  # their names
    removed: float  # share of the explainable that they remove on held-out recordings
    reasons: tuple[str, ...]  # why they are no answer, in words
    slight: bool = False  # whether they leave noise alone, at a size less than what matters
    change: str = ""  # what it is where no effect of the catalogue is, size and 95 % interval
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
            slight = _below_what_matters(model) and validation.noise_alone(model, fast=fast)
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
    small = {names for names, model in fits.items() if _below_what_matters(model)}
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
    if _below_what_matters(fitted):
        least = with_unit(effect.matters, fit.unknowns.unit(effect, effect.size))
        size = size_text(fit, fitted, effect)
        reasons.append(f"its size, {size}, is less than what matters, {least}")
    worse = validation.worsened(chosen.base, fitted, fast=fast)
    reasons += [f"{' and '.join(worse)} would be predicted worse"] * bool(worse)
    left = np.sqrt(validation.squares(fitted, fast=fast))
    worst = fit.tests[int(np.argmax(left))]
    return [*reasons, f"it leaves {left.max():.1f} times the noise in {worst}"]


def _below_what_matters(model: FittedModel) -> bool:
    sizes = model.point.sizes
    return all(abs(sizes[effect.name, effect.label]) < effect.matters for effect in model.active)


def single_change(fit: Fit, chosen: Selection, report: Reporter) -> NearestCandidate | None:
    """A single change that no effect is, see `Fit.changes`, and that explains as much as several.

    Beside one cause or none, it must explain significantly more, and leave noise alone.
    """
    base, best, changes = chosen.base, chosen.best, fit.changes()
    if not changes:
        return None
    other = fit.beside(changes)
    about, trial = examine(other, base, changes, report)
    scores: dict[str, CandidateScore] = {}
    for score in sorted(trial.scores(), key=lambda score: -score.gain):
        scores.setdefault(score.effect.name, score)
    tried = [starts_of([score]) for score in list(scores.values())[:NEAREST] if score.size]
    for model in rival_fits(other, about, tried) if tried else ():
        validation = CrossValidation(other)
        fast = validation.fast(about, model)
        if len(best.active) > 1:
            able = beyond(model, best) < fit.decides.form
        else:
            able = beyond(best, model) > fit.decides.needed
            able = able and is_clean(fit, model) and validation.noise_alone(model, fast=fast)
        if able and not _below_what_matters(model):
            (effect,) = model.active
            size = model.point.sizes[effect.name, effect.size]
            size += other.unknowns.nominal(effect, effect.size)
            trial = score_test(other, other.linearise(model.linearised, model.active), ())
            at = trial.joint.known.index((effect.name, effect.size))
            reach = BAND * float(np.sqrt(trial.covariance()[at, at]))
            unit = other.unknowns.unit(effect, effect.size)
            text = with_interval(size, size - reach, size + reach, unit)
            removed = validation.explained(about, model, fast=fast)[0]
            return NearestCandidate(model.names, removed, _OUTSIDE, change=f"{effect.text}: {text}")
    return None


def otherwise_held(fit: Fit, chosen: Selection) -> NearestCandidate | None:
    """An input that is held otherwise between samples than is said, which alone explains more.

    It then acts up to a sample earlier or later, which its own delay or lag is most like: inputs
    for which one of these was fitted are tried.
    """
    late = {name for step in chosen.steps for rival in step.rivals for name in rival.names}
    for signal in fit.inputs:
        if not {f"{INPUT_DELAY}[{signal.name}]", f"{INPUT_LAG}[{signal.name}]"} & late:
            continue
        for key, other in signal.otherwise_held.items():
            model = differentiable(partial(_nominal_as_held, fit, chosen, other))
            if model is None:
                continue
            was, left = (float(m.linearised.squares.max()) for m in (chosen.base, model))
            if left > 1.0 + fit.decides.excess or not is_clean(fit, model):
                continue
            if beyond(chosen.best, model) > fit.decides.needed:
                removed = 1.0 - max(left - 1.0, 0.0) / (was - 1.0)
                text = f"{signal.label} with held = {key} in [inputs.{signal.name}]"
                return NearestCandidate(
                    (f"held = {key}",), removed, _OUTSIDE, change=text, corrected="the system file"
                )
    return None


def _nominal_as_held(fit: Fit, chosen: Selection, signal: Signal) -> FittedModel:
    """The nominal model, fitted where an input is held as this one is."""
    with fit.held(signal.name, signal.held) as as_held:
        return anew(as_held, chosen.base.point, ())


def single_effect(
    fit: Fit, chosen: Selection, fits: Mapping[tuple[str, ...], FittedModel]
) -> FittedModel | None:
    """A single effect that leaves noise alone, where the search did not get.

    Of what switches, derivatives hold over so little that they say nothing of it.
    """
    able = [
        model
        for model in fits.values()
        if len(model.active) == 1
        and model is not chosen.best
        and beyond(chosen.best, model) > fit.decides.needed
        and is_clean(fit, model)
        and chosen.validation.noise_alone(model, fast=chosen.validation.fast(chosen.base, model))
    ]
    return min(able, key=lambda model: model.misfit, default=None)
