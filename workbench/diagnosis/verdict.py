"""From fitted effects to a verdict: what was found, how sure, and what cannot be told apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from scipy.stats import bootstrap

from workbench.diagnosis.catalogue import Effect, variant
from workbench.diagnosis.crossvalidation import CrossValidation
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.search import (
    Fitted,
    Reporter,
    Step,
    beyond,
    examine,
    extended,
    fitted,
    pruned,
    seek,
)
from workbench.diagnosis.trial import Prospect, Trial, shapes
from workbench.fmu import Matrix, Vector

Verdict = Literal["nothing", "found", "unexplained"]

_QUANTILE = 1.96  # of a normal distribution, 95 %
_FORM, _COMPANY = 0.005, 0.1  # shares of a value, and of the size that matters
_DRAWS = 2000  # of the bootstrap over stops


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval, in `unit`."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True, eq=False)
class Cause:
    """One effect that was found.

    Attributes
    ----------
    parameters : by name.
    confusable_with : names of effects that explain these data as well.
    explained : share of the explainable that this effect explains on held-out stops.
    phases : (K,) [rad] in each stop, of an order-locked effect, else None.
    """

    effect: Effect
    parameters: Mapping[str, Interval]
    confusable_with: tuple[str, ...]
    explained: float
    phases: Vector | None


@dataclass(frozen=True)
class Gain:
    """Prediction error on held-out stops; 1 is noise alone.

    Root mean square of means over a lasting time, or over a block where a cause turns with a shaft,
    in units of the noise of such a mean.

    Attributes
    ----------
    before, after : of the nominal and of the extended model, with levels calibrated alike.
    low, high : 95 % interval of `after`, from drawing stops with replacement.
    recordings : (before, after) by name.
    """

    before: float
    after: float
    low: float
    high: float
    recordings: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was found out.

    Attributes
    ----------
    verdict : see `Verdict`.
    interrupted : whether the search was ended before its end, so that there may be more causes.
    causes : strongest first; empty unless something was found.
    gain : None when nothing was extended.
    partial : effects that explain a part of what remains unexplained.
    base, best : the nominal model and the last one, fitted.
    steps : how the causes were found.
    scores : of the candidates about the nominal model, best first.
    names, cosines : effects, and the similarity of their signatures in these data, (e, e).
    not_visible : why these stops cannot show an effect, by its name.
    """

    verdict: Verdict
    interrupted: bool
    causes: tuple[Cause, ...]
    gain: Gain | None
    partial: tuple[str, ...]
    base: Fitted
    best: Fitted
    steps: tuple[Step, ...]
    scores: tuple[Prospect, ...]
    names: tuple[str, ...]
    cosines: Matrix
    not_visible: Mapping[str, str]


def conclude(fit: Fit, catalogue: Sequence[Effect], report: Reporter) -> Diagnosis:
    """Diagnose a set of stops."""
    report("nominal model, levels calibrated")
    nominal = fitted(fit, fit.at(fit.unknowns.start()), ())
    best, steps, trial, interrupted = seek(fit, catalogue, nominal, report)
    base = steps[0].before if steps else best
    known = {frozenset(one.active): one for one in (base, *(step.before for step in steps))}
    best, trial, less = pruned(fit, catalogue, best, known, trial, report)
    validation = CrossValidation(fit)
    while (idle := _idle(fit, validation, best, less)) is not None:
        report(f"dropping {idle.name}")
        # Beside fewer others, one that mattered may do so no longer.
        best, trial = examine(fit, less[idle], catalogue, report)
        best, trial, less = pruned(fit, catalogue, best, known, trial, report)
    clean = float(best.linearised.inflation.max()) < fit.decides.wrong
    verdict: Verdict = "found" if best.active else "nothing"
    explained = _share(base, best) > 1.0 - fit.decides.left
    if not clean and not (best.active and (interrupted or explained)):
        verdict = "unexplained"
    names, cosines = _confusability(trial, catalogue)
    causes: list[Cause] = []
    gain = None
    if verdict == "found":
        report("held-out recordings")
        fast = any(effect.order_locked for effect in best.active)
        before, after = (validation.squares(one, fast=fast) for one in (base, best))
        gain = _gain(fit.tests, before, after)
        causes = _causes(fit, validation, best, less, steps, trial, names, cosines)
    return Diagnosis(
        verdict=verdict,
        interrupted=interrupted,
        causes=tuple(causes),
        gain=gain,
        partial=tuple(effect.name for effect in best.active) if not causes else (),
        base=base,
        best=best,
        steps=tuple(steps),
        scores=steps[0].scores if steps else tuple(trial.scores()),
        names=names,
        cosines=cosines,
        not_visible={
            one.name: reason for one in catalogue if (reason := fit.unknowns.presence.unseen(one))
        },
    )


def _idle(
    fit: Fit, validation: CrossValidation, best: Fitted, less: Mapping[Effect, Fitted]
) -> Effect | None:
    """A cause that beside others explains next to nothing on held-out stops, if there is one."""
    if len(best.active) < 2:
        return None
    shares = {
        effect: validation.explained(one, best, fast=effect.order_locked)[0]
        for effect, one in less.items()
    }
    weakest = min(shares, key=lambda effect: shares[effect])
    return weakest if shares[weakest] < fit.decides.idle else None


def _share(before: Fitted, after: Fitted) -> float:
    """Share of lasting errors, over noise, that is gone; of the channel that fares worst."""
    was, left = before.linearised.inflation - 1.0, after.linearised.inflation - 1.0
    return float(1.0 - left.max() / max(was.max(), 1e-9))


def _gain(names: Sequence[str], before: Vector, after: Vector) -> Gain:
    low, high = bootstrap(
        (after,),
        lambda squares, axis: np.sqrt(squares.mean(axis=axis)),
        n_resamples=_DRAWS,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return Gain(
        before=float(np.sqrt(before.mean())),
        after=float(np.sqrt(after.mean())),
        low=float(low),
        high=float(high),
        recordings={
            name: (float(np.sqrt(b)), float(np.sqrt(a)))
            for name, b, a in zip(names, before, after, strict=True)
        },
    )


def _causes(
    fit: Fit,
    validation: CrossValidation,
    best: Fitted,
    less: Mapping[Effect, Fitted],
    steps: Sequence[Step],
    trial: Trial,
    names: Sequence[str],
    cosines: Matrix,
) -> list[Cause]:
    sigma = np.sqrt(np.diag(trial.covariance()))
    causes, lacking = [], {}
    for effect in best.active:
        fast = effect.order_locked
        explained, lacking[effect.name] = validation.explained(less[effect], best, fast=fast)
        parameters = {}
        for key, value in best.point.sizes.items():
            if key[0] != effect.name:
                continue
            parameter = effect.size if key[1] == effect.label else key[1]
            low, high = fit.unknowns.bounds(effect, parameter)
            # Beside the noise: forms of laws that differ in detail, and immaterial companions.
            form = np.hypot(_FORM * value, _COMPANY * effect.matters * (key[1] == effect.label))
            reach = float(_QUANTILE * np.hypot(sigma[trial.joint.known.index(key)], form))
            parameters[key[1]] = Interval(
                value,
                max(value - reach, low),
                min(value + reach, high),
                fit.unknowns.unit(effect, parameter),
            )
        causes.append(
            Cause(
                effect=effect,
                parameters=parameters,
                confusable_with=_twins(fit, effect, best, less[effect], steps, names, cosines),
                explained=explained,
                phases=best.point.phases.get(effect.name),
            )
        )
    # The strongest is the one without which most would go unexplained.
    return sorted(causes, key=lambda cause: -lacking[cause.effect.name])


def _twins(
    fit: Fit,
    effect: Effect,
    best: Fitted,
    less: Fitted,
    steps: Sequence[Step],
    names: Sequence[str],
    cosines: Matrix,
) -> tuple[str, ...]:
    """Effects that, fitted in full in place of this one, explain the data as well.

    Rivals of the step that named it are judged as they were then. Effects of a like signature, and
    rivals that it met where another was named which it has replaced since, beside the other causes.

    Parameters
    ----------
    less : the best fit without the effect.
    """
    row = dict(zip(names, cosines[names.index(effect.name)], strict=True))
    alike = {name for name in names if row[name] > 1.0 - fit.decides.twin}
    found: list[str] = []
    judged = {one.name for one in best.active}
    for step in steps:
        winner = step.rivals[0]
        rivals = {rival.active[-1].name: rival for rival in step.rivals}
        if winner.active[-1] is effect:
            found += [name for name, one in rivals.items() if _close(fit, step.before, one, winner)]
            judged |= set(rivals)
        elif effect.name in rivals:
            alike |= set(rivals)
    others: dict[str, Prospect] = {}
    for score in (score for step in steps for score in step.scores):
        if score.effect.name in alike - judged:
            others.setdefault(score.effect.name, score)
    fits = fit.together(partial(extended, fit, less), list(others.values()))
    found += [name for name, one in zip(others, fits, strict=True) if _close(fit, less, one, best)]
    active = {one.name for one in best.active}
    return tuple(name for name in dict.fromkeys(found) if name not in active)


def _close(fit: Fit, before: Fitted, one: Fitted, best: Fitted) -> bool:
    """Whether chi-squared does not tell two effects apart, either of which explains."""
    form = max(fit.decides.form, fit.decides.form_share * beyond(before, best))
    return beyond(one, best) < form


def _confusability(trial: Trial, catalogue: Sequence[Effect]) -> tuple[tuple[str, ...], Matrix]:
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
    solved = np.linalg.lstsq(total[np.ix_(levels, levels)], total[levels], rcond=None)[0]
    rest = total - total[:, levels] @ solved
    roots = {name: _inverse_root(rest[np.ix_(at, at)]) for name, at in own.items()}
    cosines = np.eye(len(own))
    for i, (a, at_a) in enumerate(own.items()):
        for j, (b, at_b) in enumerate(own.items()):
            coupling = roots[a] @ rest[np.ix_(at_a, at_b)] @ roots[b]
            cosines[i, j] = np.linalg.norm(coupling, 2)
    return tuple(own), np.clip(cosines, 0.0, 1.0)


def _inverse_root(matrix: Matrix) -> Matrix:
    values, vectors = np.linalg.eigh(matrix)
    kept = values > 1e-9 * max(values[-1], 1e-300)
    root: Matrix = (vectors[:, kept] / np.sqrt(values[kept])) @ vectors[:, kept].T
    return root
