"""Changes that no effect of the catalogue is, and that explain as much as causes do, or more."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from workbench.diagnosis.data.clocks import INPUT_DELAY
from workbench.diagnosis.effects.candidates import INPUT_LAG
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.crossvalidation import CrossValidation
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.nearest import NEAREST, NearestCandidate, below_what_matters
from workbench.diagnosis.inference.score_test import CandidateScore, score_test
from workbench.diagnosis.inference.search import (
    FittedModel,
    beyond,
    differentiable,
    examine,
    is_clean,
    rival_fits,
    starts_of,
)
from workbench.diagnosis.inference.selection import Selection, anew
from workbench.diagnosis.inference.sets import Sets
from workbench.runtime.engine import Reporter
from workbench.system.parts import Signal
from workbench.system.units import BAND, with_interval

_ONE = ("it is no effect of the catalogue",)  # why such a change is no cause
_SOME = ("not all of them are effects of the catalogue",)
_TOGETHER = 2  # changes that are sought together where causes are no answer


def outside_changes(
    fit: Fit, chosen: Selection, report: Reporter, *, explained: bool
) -> NearestCandidate | None:
    """Changes that no effect is, see `Fit.changes`, alone or beside effects.

    They are fewer than the causes and explain as much; or they are as many, two where causes are no
    answer, explain significantly more, and leave noise alone.

    Parameters
    ----------
    explained : whether causes are an answer, if only to a part.
    """
    changes = fit.changes()
    if not changes:
        return None
    other, causes = fit.beside(changes), len(chosen.best.active)
    most = max(causes, 0 if explained else _TOGETHER)
    model = _fewest(other, chosen, changes, most, report)
    if model is None:
        return None
    validation = CrossValidation(other)
    fast = validation.fast(chosen.base, model)
    removed = validation.explained(chosen.base, model, fast=fast)[0]
    text = " and ".join(_sizes_in_words(other, model))
    reasons = _ONE if len(model.active) == 1 else _SOME
    return NearestCandidate(model.names, removed, reasons, change=text)


def _fewest(
    fit: Fit, chosen: Selection, changes: Sequence[Effect], most: int, report: Reporter
) -> FittedModel | None:
    """Changes, or changes and effects, in place of all causes: as few as explain what more do.

    Parameters
    ----------
    most : of them, unless more explain significantly more.
    """
    causes, fewest = len(chosen.best.active), None
    if causes < 2:
        models = _singles(fit, chosen, changes, report)
        fewest = next((model for model in models if _explains(fit, chosen, model)), None)
    best, trial = examine(fit, chosen.best, [*fit.unknowns.effects.values()], report)
    sets = Sets(best, trial, changes)
    for count in range(1 if causes > 1 else 2, max(most, _TOGETHER) + 1):
        if fewest is None and count > most:
            break
        models = sets.fits(fit, count)
        if fewest is None:
            able = [model for model in models if _explains(fit, chosen, model)]
        elif not (able := [m for m in models if beyond(fewest, m) > fit.decides.needed]):
            break
        fewest = min(able, key=lambda model: model.misfit, default=None)
    return fewest


def _singles(
    fit: Fit, chosen: Selection, changes: Sequence[Effect], report: Reporter
) -> list[FittedModel]:
    """Single changes in place of one cause or none, which some laws' forms and starts need."""
    about, trial = examine(fit, chosen.base, changes, report)
    scores: dict[str, CandidateScore] = {}
    for score in sorted(trial.scores(), key=lambda score: -score.gain):
        scores.setdefault(score.effect.name, score)
    tried = [starts_of([score]) for score in list(scores.values())[:NEAREST] if score.size]
    return rival_fits(fit, about, tried) if tried else []


def _explains(fit: Fit, chosen: Selection, model: FittedModel) -> bool:
    """Whether a fit needs less than the causes and explains as much, or explains what is left."""
    best = chosen.best
    if below_what_matters(model):
        return False
    if len(model.active) < len(best.active) and beyond(model, best) < fit.decides.form:
        return True
    more = beyond(best, model) > fit.decides.needed
    return more and _noise_alone(fit, chosen, model)


def _noise_alone(fit: Fit, chosen: Selection, model: FittedModel) -> bool:
    """Whether a fit leaves noise alone, of what it was fitted to and of what was held out."""
    validation = CrossValidation(fit)
    fast = validation.fast(chosen.base, model)
    return is_clean(fit, model) and validation.noise_alone(model, fast=fast)


def _sizes_in_words(fit: Fit, model: FittedModel) -> list[str]:
    """Each member of a fit with its size and the 95 % interval of that."""
    trial = score_test(fit, fit.linearise(model.linearised, model.active), ())
    reaches = BAND * np.sqrt(np.diag(trial.covariance()))
    texts = []
    for effect in model.active:
        size = model.point.sizes[effect.name, effect.label]
        size += fit.unknowns.nominal(effect, effect.size)
        reach = float(reaches[trial.joint.known.index((effect.name, effect.label))])
        unit = fit.unknowns.unit(effect, effect.size)
        text = with_interval(size, size - reach, size + reach, unit)
        texts.append(f"{effect.text}: {text}")
    return texts


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
                    (f"held = {key}",), removed, _ONE, change=text, corrected="the system file"
                )
    return None


def _nominal_as_held(fit: Fit, chosen: Selection, signal: Signal) -> FittedModel:
    """The nominal model, fitted where an input is held as this one is."""
    with fit.held(signal.name, signal.held) as as_held:
        return anew(as_held, chosen.base.point, ())
