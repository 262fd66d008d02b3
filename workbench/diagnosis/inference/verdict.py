"""From fitted effects to a verdict: what was found, how sure, and what cannot be told apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from scipy.stats import bootstrap

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.score_test import CandidateScore
from workbench.diagnosis.inference.search import BEGUN, FittedModel, Step, extended, misfits
from workbench.diagnosis.inference.selection import Selection, search, select
from workbench.diagnosis.inference.timing import LateSignals, by_themselves
from workbench.errors import InputError
from workbench.runtime.engine import Reporter
from workbench.system.units import BAND, with_interval, with_unit

Verdict = Literal["nothing", "found", "unexplained"]

_FORM, _COMPANY = 0.005, 0.1  # shares of a value, and of the size that matters
_DRAWS = 2000  # of the bootstrap over stops


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval, in `unit`.

    Attributes
    ----------
    limit : the bound at which a fit stopped, "least" or "greatest": then it is no estimate, and
        what is beyond may fit better.
    """

    value: float
    low: float
    high: float
    unit: str
    limit: str = ""

    @property
    def text(self) -> str:
        """For people."""
        if not self.limit:
            return with_interval(self.value, self.low, self.high, self.unit)
        beyond = "smaller" if self.limit == "least" else "larger"
        value = with_unit(self.value, self.unit)
        return f"at its limit of {value}, which is no estimate: {beyond} may fit better"


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
    causes : that which alone explains most first, of equals the usual one; empty unless found.
    gain : None when nothing was extended.
    partial : effects that explain a part of what remains unexplained.
    late : signals that are late by themselves, as the system file does not say of any logger, and
        that explain clearly more; it is then unexplained.
    base, best : the nominal model and the last one, fitted.
    rivals : `best`, and fits that these data do not tell from it; empty unless found.
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
    late: LateSignals | None
    base: FittedModel
    best: FittedModel
    rivals: tuple[FittedModel, ...]
    steps: tuple[Step, ...]
    scores: tuple[CandidateScore, ...]
    names: tuple[str, ...]
    cosines: Matrix
    not_visible: Mapping[str, str]


def conclude(fit: Fit, catalogue: Sequence[Effect], report: Reporter) -> Diagnosis:
    """Diagnose a set of recordings."""
    chosen, astray = _selected(fit, catalogue, report)
    base, best = chosen.base, chosen.best
    clean = float(best.linearised.variance_factors.max()) < fit.decides.wrong
    verdict: Verdict = "found" if best.active else "nothing"
    explained = _share(base, best) > 1.0 - fit.decides.left
    if astray or (not clean and not (best.active and (chosen.interrupted or explained))):
        verdict = "unexplained"
    late = None
    if verdict != "nothing" and not astray and not chosen.interrupted:
        report("clocks of signals by themselves")
        late = by_themselves(fit, base, best, clean=clean)
        verdict = verdict if late is None else "unexplained"
    causes: list[Cause] = []
    rivals: tuple[FittedModel, ...] = ()
    gain = None
    if verdict == "found":
        report("held-out recordings")
        fast = any(effect.order_locked for effect in best.active)
        before, after = (chosen.validation.squares(model, fast=fast) for model in (base, best))
        gain = _gain(fit.tests, before, after)
        causes = [
            _cause(fit, chosen, effect) for effect in _strongest_first(fit, chosen, catalogue)
        ]
        twins = [fits.values() for fits in chosen.twins.values()]
        rivals = (best, *(fit for fits in twins for fit in fits))
    presence = fit.unknowns.presence
    return Diagnosis(
        verdict=verdict,
        interrupted=chosen.interrupted,
        causes=tuple(causes),
        gain=gain,
        partial=tuple(effect.name for effect in best.active) if not causes else (),
        late=late,
        base=base,
        best=best,
        rivals=rivals,
        steps=chosen.steps,
        scores=chosen.steps[0].scores if chosen.steps else tuple(chosen.trial.scores()),
        names=chosen.names,
        cosines=chosen.cosines,
        not_visible={effect.name: why for effect in catalogue if (why := presence.unseen(effect))},
    )


def _selected(
    fit: Fit, catalogue: Sequence[Effect], report: Reporter
) -> tuple[Selection, Sequence[int]]:
    """What recordings need, and those of which parts that cannot be left out follow no law.

    Where states are restarted, errors depend sharply on everything: what shows elsewhere is found
    first. Then they count too, but where errors last whatever is found: another law holds there.
    """
    restarted = fit.restarted
    try:
        fit.count_restarted(restarted, counting=False)
    except InputError:  # nearly all of a recording is such
        chosen = select(fit, catalogue, search(fit, catalogue, report), report)
        return chosen, fit.astray(chosen.best.linearised)
    chosen = select(fit, catalogue, search(fit, catalogue, report), report)
    while restarted and not chosen.interrupted:
        report(f"what is restarted too, in {len(restarted)} recordings")
        fit.count_restarted(restarted, counting=True)
        more = search(fit, catalogue, report, chosen)
        astray = [] if more.interrupted else fit.astray(more.best.linearised)
        if not astray:
            return select(fit, catalogue, more, report), ()
        report(f"without what follows no law, in {len(astray)} recordings")
        fit.count_restarted(astray, counting=False)
        restarted = [k for k in restarted if k not in astray]
    return chosen, ()


def _strongest_first(fit: Fit, chosen: Selection, catalogue: Sequence[Effect]) -> Sequence[Effect]:
    """Causes by what each leaves when it alone is fitted, roughly; of equals the usual one."""
    causes = chosen.best.active
    if len(causes) < 2:
        return causes
    first = chosen.steps[0]
    alone = {rival.active[-1]: rival for rival in first.rivals if first.before is chosen.base}
    scores = [score for step in chosen.steps for score in step.scores]
    best = {score.effect: score for score in reversed(scores)}  # of its shapes
    begun = [best[effect] for effect in causes if effect in best and effect not in alone]
    fits = fit.together(partial(extended, fit, chosen.base, rounds=BEGUN), begun)
    alone |= {fit.active[-1]: fit for fit in fits if fit is not None}
    left = dict(zip(alone, misfits(list(alone.values())), strict=True))
    ordered = list[Effect]()
    while rest := [effect for effect in causes if effect not in ordered]:
        least = min(left.get(effect, np.inf) for effect in rest)
        equals = [other for other in rest if left.get(other, np.inf) <= least + fit.decides.tied]
        ordered.append(min(equals, key=catalogue.index))
    return ordered


def _share(before: FittedModel, after: FittedModel) -> float:
    """Share of lasting errors, over noise, that is gone; of the channel that fares worst."""
    was, left = before.linearised.variance_factors - 1.0, after.linearised.variance_factors - 1.0
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


def _cause(fit: Fit, chosen: Selection, effect: Effect) -> Cause:
    best, trial, unknowns = chosen.best, chosen.trial, fit.unknowns
    sigma = np.sqrt(np.diag(trial.covariance()))
    parameters = {}
    for key, value in best.point.sizes.items():
        if key[0] != effect.name:
            continue
        parameter = effect.size if key[1] == effect.label else key[1]
        low, high = unknowns.bounds(effect, parameter)
        # Beside the noise: forms of laws that differ in detail, and immaterial companions.
        form = np.hypot(_FORM * value, _COMPANY * effect.matters * (key[1] == effect.label))
        reach = float(BAND * np.hypot(sigma[trial.joint.known.index(key)], form))
        ends = max(value - reach, low), min(value + reach, high)
        limit = "least" if value <= low else "greatest" if value >= high else ""
        parameters[key[1]] = Interval(value, *ends, unknowns.unit(effect, parameter), limit)
    fast = effect.order_locked
    return Cause(
        effect=effect,
        parameters=parameters,
        confusable_with=tuple(chosen.twins[effect]),
        explained=chosen.validation.explained(chosen.less[effect], best, fast=fast)[0],
        phases=best.point.phases.get(effect.name),
    )
