"""Which effects recordings need: found one by one, dropped, exchanged, until nothing changes.

Source: A. J. Miller (2002), Subset Selection in Regression, 2nd ed., chapter 3 (forward selection,
elimination, replacement).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis.effects.catalogue import Effect, variant
from workbench.diagnosis.inference.crossvalidation import CrossValidation
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import Point
from workbench.diagnosis.inference.quadratic import beside
from workbench.diagnosis.inference.score_test import CandidateScore, ScoreTest, shapes
from workbench.diagnosis.inference.search import (
    FittedModel,
    Step,
    beyond,
    examine,
    extended,
    fitted,
    forward_selection,
    pruned,
)
from workbench.runtime.engine import Reporter


@dataclass(frozen=True, eq=False)
class Selection:
    """The effects that are needed, and how they were found."""

    # base, best: the nominal model and the last one, fitted
    base: FittedModel
    best: FittedModel
    less: Mapping[Effect, FittedModel]  # the best fit without each of the effects
    steps: tuple[Step, ...]  # how they were found
    trial: ScoreTest  # of all other effects about the best point
    # fits of effects that explain the data as well as each of them, by name, best first
    twins: Mapping[Effect, Mapping[str, FittedModel]]
    # names, cosines: effects, and the similarity of their signatures in these data, (e, e)
    names: tuple[str, ...]
    cosines: Matrix
    interrupted: bool  # whether the search was ended before its end
    validation: CrossValidation  # of the fits


@dataclass(frozen=True, eq=False)
class ForwardSelection:
    """What a search has come to, before anything is dropped or exchanged."""

    # best, steps, trial, interrupted: as of `Selection`
    best: FittedModel
    steps: list[Step]
    trial: ScoreTest
    interrupted: bool
    begun: Selection | None  # where it went on, when other samples counted


def search(
    fit: Fit, catalogue: Sequence[Effect], report: Reporter, begun: Selection | None = None
) -> ForwardSelection:
    """Find what is missing, or what is missing beside what was when other samples counted."""
    if begun is None:
        report("nominal model, levels calibrated")
        best, steps = anew(fit, fit.unknowns.start(), ()), list[Step]()
    else:
        best, steps = anew(fit, begun.best.point, begun.best.active), list(begun.steps)
    best, trial, interrupted = forward_selection(fit, catalogue, best, steps, (), report)
    return ForwardSelection(best, steps, trial, interrupted, begun)


def select(
    fit: Fit, catalogue: Sequence[Effect], sought: ForwardSelection, report: Reporter
) -> Selection:
    """Find what a set of recordings needs.

    An effect that was dropped beside others is not taken up again; one that explains clearly more
    in place of another replaces it. So each round has less to choose from, or fits better.
    """
    best, trial, interrupted = sought.best, sought.trial, sought.interrupted
    steps, begun = sought.steps, sought.begun
    if begun is None:
        base = steps[0].before if steps else best
    else:
        base = anew(fit, begun.base.point, ())
    earlier = 0 if begun is None else len(begun.steps)
    validation, dropped = CrossValidation(fit), set[Effect]()
    exchanged = set[frozenset[Effect]]()
    while True:
        met = (base, *(step.before for step in steps[earlier:]))
        known = {frozenset(model.active): model for model in met}
        before = set(best.active)
        best, trial, less = pruned(fit, catalogue, best, known, trial, report)
        while (idle := _idle(fit, validation, best, less)) is not None:
            report(f"dropping {idle.name}")
            # Beside fewer others, one that mattered may do so no longer.
            best, trial = examine(fit, less[idle], catalogue, report)
            best, trial, less = pruned(fit, catalogue, best, known, trial, report)
        if (gone := before - set(best.active)) and not interrupted:
            dropped |= gone
            best, trial, interrupted = forward_selection(
                fit, catalogue, best, steps, dropped, report
            )
            continue
        names, cosines = _confusability(trial, catalogue)
        similar = {
            effect: {names[j] for j in np.flatnonzero(row > 1.0 - fit.decides.twin)}
            for effect, row in ((e, cosines[names.index(e.name)]) for e in less)
        }
        alike = {e: _alike(fit, e, best, less[e], steps, similar[e]) for e in less}
        # What was taken in exchange and dropped since would be dropped again.
        replaced = [
            fit
            for fits in alike.values()
            for fit in fits.values()
            if frozenset(fit.active) not in exchanged
        ]
        better = min(replaced, key=lambda model: beyond(model, best), default=best)
        fewer = [model for model in replaced if _needs_fewer(fit, best, model)]
        if interrupted or (beyond(best, better) < fit.decides.needed and not fewer):
            break
        better = min(fewer, key=lambda model: beyond(model, best), default=better)
        exchanged.add(frozenset(better.active))
        report(f"{better.active[-1].name} explains more, or needs less, than what it replaces")
        best, trial, interrupted = forward_selection(fit, catalogue, better, steps, dropped, report)
    twins = {
        effect: dict(
            sorted(
                (pair for pair in fits.items() if _close(fit, less[effect], pair[1], best)),
                key=lambda pair: beyond(pair[1], best),
            )
        )
        for effect, fits in alike.items()
    }
    return Selection(
        base=base,
        best=best,
        less=less,
        steps=tuple(steps),
        trial=trial,
        twins=twins,
        names=names,
        cosines=cosines,
        interrupted=interrupted,
        validation=validation,
    )


def anew(fit: Fit, point: Point, active: tuple[Effect, ...]) -> FittedModel:
    """A fit that begins at a point, with all derivatives."""
    # A point of its own, by which it is told from a fit to other samples.
    model = fitted(fit, fit.at(replace(point)), active)
    return replace(model, linearised=fit.linearise(model.linearised, active))


def _needs_fewer(fit: Fit, best: FittedModel, model: FittedModel) -> bool:
    """Whether a fit explains as much, with another effect beside which one of the causes is none.

    An effect may do what two others do together, as of a supply that gives less: speed and current
    that both are read as less.
    """
    *others, _ = model.active
    sizes = ((abs(model.point.sizes[e.name, e.label]), e.matters) for e in others)
    return beyond(model, best) < fit.decides.form and any(size < least for size, least in sizes)


def _idle(
    fit: Fit, validation: CrossValidation, best: FittedModel, less: Mapping[Effect, FittedModel]
) -> Effect | None:
    """A cause that beside others explains next to nothing on held-out stops, if there is one."""
    if len(best.active) < 2:
        return None
    shares = {
        effect: validation.explained(reduced, best, fast=validation.fast(reduced, best))[0]
        for effect, reduced in less.items()
    }
    weakest = min(shares, key=lambda effect: shares[effect])
    return weakest if shares[weakest] < fit.decides.idle else None


def _alike(
    fit: Fit,
    effect: Effect,
    best: FittedModel,
    less: FittedModel,
    steps: Sequence[Step],
    similar: Collection[str],
) -> dict[str, FittedModel]:
    """Fits of effects in place of one, beside the other causes, by name.

    Of those with a like signature, and of rivals that it met in a step; where it was named and they
    were no match for it, they are none now.

    Parameters
    ----------
    less : the best fit without the effect.
    similar : names of effects with a like signature.
    """
    alike = set(similar)
    models: dict[str, FittedModel] = {}
    for step in steps:
        winner = step.rivals[0]
        rivals = {rival.active[-1].name: rival for rival in step.rivals}
        if effect.name not in rivals:
            continue
        close = {name for name, rival in rivals.items() if _close(fit, step.before, rival, winner)}
        named = winner.active[-1] is effect
        alike |= close if named else set(rivals)
        if named and winner.point is best.point:
            models |= {name: rivals[name] for name in close}
            alike -= set(rivals)
    active = {effect.name for effect in best.active}
    models = {name: model for name, model in models.items() if name not in active}
    alike -= active | set(models)
    others: dict[str, CandidateScore] = {}
    for score in (score for step in steps for score in step.scores):
        if score.effect.name in alike:
            others.setdefault(score.effect.name, score)
    fits = fit.together(partial(extended, fit, less), list(others.values()))
    tried = zip(others, fits, strict=True)
    return models | {name: model for name, model in tried if model is not None}


def _close(fit: Fit, before: FittedModel, fitted: FittedModel, best: FittedModel) -> bool:
    """Whether chi-squared does not tell two effects apart, either of which explains."""
    form = max(fit.decides.form, fit.decides.form_share * beyond(before, best))
    return beyond(fitted, best) < form


def _confusability(trial: ScoreTest, catalogue: Sequence[Effect]) -> tuple[tuple[str, ...], Matrix]:
    """Cosines of the signatures of all effects, beside levels and tolerances; 1 is a twin."""
    joint = trial.joint
    total = joint.total().N
    levels = [j for j, key in enumerate(joint.shared) if key in trial.levels]
    own: dict[str, list[int]] = {}
    for effect in catalogue:
        middle = variant(effect, shapes(effect)[len(shapes(effect)) // 2])
        keys = [(effect.name, effect.label), *((middle, name) for name in effect.sizes)]
        at = [joint.shared.index(key) for key in keys if key in joint.shared]
        if at:
            own[effect.name] = at
    information = beside(total, levels)
    roots = {name: _inverse_root(information[np.ix_(at, at)]) for name, at in own.items()}
    cosines = np.eye(len(own))
    for i, (a, at_a) in enumerate(own.items()):
        for j, (b, at_b) in enumerate(own.items()):
            coupling = roots[a] @ information[np.ix_(at_a, at_b)] @ roots[b]
            cosines[i, j] = np.linalg.norm(coupling, 2)
    return tuple(own), np.clip(cosines, 0.0, 1.0)


def _inverse_root(matrix: Matrix) -> Matrix:
    values, vectors = np.linalg.eigh(matrix)
    kept = values > 1e-9 * max(values[-1], 1e-300)
    root: Matrix = (vectors[:, kept] / np.sqrt(values[kept])) @ vectors[:, kept].T
    return root
