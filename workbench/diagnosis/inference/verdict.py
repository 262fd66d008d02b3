"""From fitted effects to a verdict: what was found, how sure, and what cannot be told apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.effects.candidates import LAG, SHARES
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.between_recordings import (
    DifferingParameter,
    DifferingStarts,
    what_differs,
)
from workbench.diagnosis.inference.crossvalidation import CrossValidation
from workbench.diagnosis.inference.discrepancy import (
    WRONG,
    correlated_deviations,
    hidden_by_noise,
    share_by_form,
)
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import Point
from workbench.diagnosis.inference.nuisance import (
    ShiftedLevel,
    hidden_by_starts,
    hidden_effects,
    shifted_levels,
)
from workbench.diagnosis.inference.quadratic import Key
from workbench.diagnosis.inference.score_test import CandidateScore
from workbench.diagnosis.inference.search import (
    BEGUN,
    FittedModel,
    Step,
    beyond,
    differentiable,
    examine,
    extended,
    fitted,
    forward_selection,
    misfits,
    rival_fits,
    starts_of,
    without,
)
from workbench.diagnosis.inference.selection import (
    ForwardSelection,
    Selection,
    search,
    select,
)
from workbench.diagnosis.inference.timing import LateSignals, by_themselves
from workbench.errors import InputError
from workbench.runtime.engine import Reporter
from workbench.system.units import BAND, with_interval, with_unit

Verdict = Literal["nothing", "found", "partly explained", "unexplained"]

_FORM, _COMPANY = 0.005, 0.1  # shares of a value, and of the size that matters
_DRAWS = 2000  # of the bootstrap over stops
# Share from which on a part has the right place, if not the right form: of squares, an offset in
# place of a ramp takes 75 %, a line in place of a parabola 94 %.
_MOST = 0.9
_HALF = 0.5  # share of squares from which on a cause explains more than it leaves
_NEAREST = 3  # candidates that are told where none is accepted


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval, in `unit`."""

    value: float
    # low, high: ends; infinite to the side of a bound at which the fit stopped, but for a bound
    # that nature sets
    low: float
    high: float
    unit: str
    limit: str = ""  # that bound, "least" or "greatest": then the value is no estimate
    # where a fit ends that may pass the bound and leaves clearly less; NaN if none does
    beyond: float = np.nan
    alone: bool = False  # whether that fit needs no other cause
    plain: bool = False  # whether it is a number in a unit that nobody states, and no share

    @property
    def text(self) -> str:
        """For people."""
        if not self.limit:
            return with_interval(self.value, self.low, self.high, self._spoken)
        value = with_unit(self.value, self._spoken)
        return f"at its limit of {value}, which is no estimate: {self.better}"

    @property
    def better(self) -> str:
        """What is known of values beyond the limit."""
        if np.isfinite(self.beyond):
            alone = ", alone" * self.alone
            return f"{with_unit(self.beyond, self._spoken)}, beyond it, fits better{alone}"
        more = "smaller" if self.limit == "least" else "larger"
        return f"{more} may fit better" if self.open else f"nothing is {more}"

    @property
    def _spoken(self) -> str:
        return "" if self.plain else self.unit

    @property
    def holds_zero(self) -> bool:
        """Whether it may be nothing at all.

        >>> Interval(2.03, 0.0, 9.83, "1/s").holds_zero, Interval(0.4, 0.2, 0.6, "N").holds_zero
        (True, False)
        """
        return self.low <= 0.0 <= self.high

    @property
    def open(self) -> bool:
        """Whether there may be values beyond the limit."""
        return not (np.isfinite(self.low) and np.isfinite(self.high))

    def to_dict(self) -> dict[str, float | str | None]:
        """As plain numbers and texts; None of an end that is open."""
        ends = {"value": self.value, "low": self.low, "high": self.high, "beyond": self.beyond}
        numbers = {name: end if np.isfinite(end) else None for name, end in ends.items()}
        return {**numbers, "unit": self.unit, "limit": self.limit, "text": self.text}


@dataclass(frozen=True, eq=False)
class Cause:
    """One effect that was found."""

    effect: Effect
    parameters: Mapping[str, Interval]  # by name
    confusable_with: tuple[str, ...]  # names of effects that explain these data as well
    explained: float  # share of the explainable that this effect explains on held-out stops
    phases: Vector | None  # (K,) [rad] in each stop, of an order-locked effect, else None

    @property
    def may_be_zero(self) -> bool:
        """Whether its size may be none, by the interval."""
        return self.parameters[self.effect.label].holds_zero


@dataclass(frozen=True)
class Gain:
    """Prediction error on held-out stops; 1 is noise alone.

    Root mean square of means over a lasting time, or over a block where that shows what causes
    explain, in units of the noise of such a mean.
    """

    # before, after: of the nominal and of the extended model, with levels calibrated alike
    before: float
    after: float
    # low, high: 95 % interval of `after`, from drawing stops with replacement
    low: float
    high: float
    recordings: Mapping[str, tuple[float, float]]  # (before, after) by name
    fast: bool = False  # whether it is of blocks: causes turn with a shaft, or errors swing

    @property
    def text(self) -> str:
        """What the error does, in words; a fit with tolerances may err as little without.

        >>> Gain(before=1.04, after=1.0, low=1.0, high=1.0, recordings={}).text
        'its error falls from 1.04 to 1.00 times the noise'
        >>> Gain(before=1.0, after=1.0, low=1.0, high=1.0, recordings={}).text.partition(",")[0]
        'its error is 1.00 times the noise with and without'
        """
        for digits in (1, 2):
            before, after = (f"{error:.{digits}f}" for error in (self.before, self.after))
            if before != after:
                way = "falls" if self.after < self.before else "rises"
                return f"its error {way} from {before} to {after} times the noise"
        return (
            f"its error is {after} times the noise with and without, as tolerances that are less "
            "likely make up for it"
        )


@dataclass(frozen=True)
class NearestCandidate:
    """Effects that come nearest to what is missing, and why they are not accepted."""

    effects: tuple[str, ...]  # their names
    removed: float  # share of the explainable that they remove on held-out recordings
    reasons: tuple[str, ...]  # why they are no answer, in words
    slight: bool = False  # whether they leave noise alone, at a size less than what matters
    change: str = ""  # what it is where no effect of the catalogue is, with its size

    @property
    def text(self) -> str:
        """For people."""
        names = " and ".join(self.effects)
        return f"{names} would remove {self.removed:.0%}, but {'; '.join(self.reasons)}"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was found out."""

    verdict: Verdict  # see `Verdict`
    # whether the search was ended before its end, so that there may be more causes
    interrupted: bool
    # that which alone explains most first, of equals the usual one; empty unless found, in full or
    # in part
    causes: tuple[Cause, ...]
    gain: Gain | None  # None when nothing was extended
    # effects that explain a part; empty unless something remains unexplained
    partial: tuple[str, ...]
    # candidates that come nearest where none is accepted, the nearest first
    nearest: tuple[NearestCandidate, ...]
    # whether causes leave no more than noise on held-out recordings; if not, what they leave widens
    # their intervals
    noise_alone: bool
    # parameter or starts that explain most of what remains if each recording has its own; None:
    # none does, or nothing remains
    differing: DifferingParameter | DifferingStarts | None
    # signals that are late by themselves, as the system file does not say of any logger, and that
    # explain clearly more; it is then unexplained
    late: LateSignals | None
    # base, best: the nominal model and the last one, fitted
    base: FittedModel
    best: FittedModel
    # `best`, and fits that these data do not tell from it; empty without causes
    rivals: tuple[FittedModel, ...]
    steps: tuple[Step, ...]  # how the causes were found
    scores: tuple[CandidateScore, ...]  # of the candidates about the nominal model, best first
    # names, cosines: effects, and the similarity of their signatures in these data, (e, e)
    names: tuple[str, ...]
    cosines: Matrix
    not_visible: Mapping[str, str]  # why these stops cannot show an effect, by its name
    # by a nuisance parameter, effects that these data cannot tell from it
    hidden: Mapping[str, tuple[str, ...]]
    # the same by a state, whose start each recording has of its own
    hidden_by_starts: Mapping[str, tuple[str, ...]]
    shifted: tuple[ShiftedLevel, ...]  # nuisance parameters that are far from their sheet

    def outdone(self, law: str) -> "Diagnosis":
        """The diagnosis where one free law explains as much as several causes with less.

        Several effects bend to much that is neither of them: then they are no answer.
        """
        assert self.gain is not None
        before, after = self.gain.before**2 - 1.0, self.gain.after**2 - 1.0
        removed = float(np.clip((before - after) / max(before, 1e-9), 0.0, 1.0))
        reason = f"one law explains as much with less: {law}"
        return replace(
            self,
            verdict="unexplained",
            causes=(),
            gain=None,
            partial=self.best.names,
            nearest=(NearestCandidate(self.best.names, removed, (reason,)),),
            rivals=(),
        )


def conclude(fit: Fit, catalogue: Sequence[Effect], report: Reporter) -> Diagnosis:
    """Diagnose a set of recordings, in steps that what is found needs."""
    diagnosis = _concluded(fit, catalogue, report)
    best = diagnosis.best
    reaches = {
        (cause.effect.name, parameter): 0.5 * (interval.high - interval.low)
        for cause in diagnosis.causes
        for parameter, interval in cause.parameters.items()
    }
    settling = best.active and not diagnosis.interrupted
    if settling and fit.settle(best.linearised, best.active, reaches):
        report("again, in the finer steps that what was found needs")
        return conclude(fit, catalogue, report)
    return diagnosis


def _concluded(fit: Fit, catalogue: Sequence[Effect], report: Reporter) -> Diagnosis:
    chosen, astray = _selected(fit, catalogue, report)
    unlikely = fit.unlikely_levels(chosen.best.point, clean=_clean(fit, chosen.best))
    if unlikely and not chosen.interrupted:
        report(f"further from the data sheet: {', '.join(sorted(name for name, _ in unlikely))}")
        chosen, astray = _beyond_sheet(fit, catalogue, (chosen, astray), unlikely, report)
    return _judged(fit, catalogue, chosen, astray, report)


def _judged(
    fit: Fit,
    catalogue: Sequence[Effect],
    chosen: Selection,
    astray: Sequence[int],
    report: Reporter,
) -> Diagnosis:
    """What the outcome of a search amounts to; begun again from a cause that it passed over."""
    chosen, outside = _within_bounds(fit, catalogue, chosen, report)
    verdict: Verdict = "unexplained" if astray or outside else _verdict(fit, chosen)
    late = None
    if verdict != "nothing" and not astray and not outside and not chosen.interrupted:
        report("clocks of signals by themselves")
        late = by_themselves(fit, chosen.base, chosen.best, clean=_clean(fit, chosen.best))
        if late is not None and (begun := _with_clock(fit, catalogue, chosen, late)) is not None:
            report(f"with {begun.active[0].name}, where the fits above did not get")
            timed = _selected_with(fit, catalogue, chosen, begun, report)
            if begun.active[0] in timed.best.active:
                chosen, late = timed, None
        verdict = _verdict(fit, chosen) if late is None else "unexplained"
    base, best = chosen.base, chosen.best
    gain, objections, noise_alone, removed = None, list[str](), True, 1.0
    if best.active and late is None and not outside:
        report("held-out recordings")
        gain = _gain(fit, chosen)
        if not chosen.interrupted:
            worse, left = _objections(fit, chosen, gain, whole=verdict == "found")
            objections = [*worse, *left]
            before, after = gain.before**2 - 1.0, gain.after**2 - 1.0
            removed = (before - after) / max(before, 1e-9)
            if objections:
                part = not worse and not astray and removed > _MOST
                verdict = "partly explained" if part else "unexplained"
    causes: list[Cause] = []
    rivals: tuple[FittedModel, ...] = ()
    if verdict in ("found", "partly explained"):
        fast = chosen.validation.fast(base, best)
        noise_alone = chosen.validation.noise_alone(best, fast=fast)
        causes = [
            _cause(fit, chosen, effect, noise_alone=noise_alone, whole=verdict == "found")
            for effect in _strongest_first(fit, chosen, catalogue)
        ]
        unsure = [f"the size of {c.effect.name} may be zero" for c in causes if c.may_be_zero]
        if verdict == "found" and unsure:
            objections += unsure
            most = min(_MOST, 1.0 - fit.decides.left)
            verdict = "partly explained" if removed > most else "unexplained"
        # Beside others, a part that bends as far as its effect allows stands for another law.
        if verdict == "partly explained" and len(causes) > 1 and (bent := _at_bounds(causes)):
            objections += bent
            verdict = "unexplained"
    change = None
    if verdict != "nothing" and not (late or astray or outside or chosen.interrupted):
        report("changes that no effect is")
        change = _change(fit, chosen, report)
    if change is not None:
        if len(best.active) > 1:
            objections.append(f"{change.effects[0]} alone explains as much")
        verdict = "unexplained"
    if verdict == "unexplained":
        causes = []
    if causes:
        twins = [fits.values() for fits in chosen.twins.values()]
        rivals = (best, *(fit for fits in twins for fit in fits))
    else:
        gain = None
    presence = fit.unknowns.presence
    hidden = hidden_effects(fit, chosen.trial, catalogue)
    nearest: tuple[NearestCandidate, ...] = ()
    if verdict == "unexplained" and late is None:
        report("candidates that come nearest")
        fits = {} if outside else _nearest_fits(fit, chosen)
        whole = None
        if not (astray or change or chosen.interrupted):
            whole = _passed_over(fit, chosen, fits)
        if whole is not None:
            report(f"with {whole.active[0].name}, where the fits above did not get")
            other = _selected_with(fit, catalogue, chosen, whole, report)
            if other.best.active and other.best.misfit < best.misfit:
                return _judged(fit, catalogue, other, astray, report)
        others = () if outside else _nearest(fit, chosen, fits, objections)
        nearest = (*filter(None, (outside, change)), *others)[:_NEAREST]
    remains = not noise_alone or (verdict == "unexplained" and late is None)
    part_of = verdict == "partly explained" or best.names in [
        candidate.effects for candidate in nearest
    ]
    return Diagnosis(
        verdict=verdict,
        interrupted=chosen.interrupted,
        causes=tuple(causes),
        gain=gain,
        partial=best.names if part_of else (),
        nearest=nearest,
        noise_alone=noise_alone,
        differing=what_differs(fit, best, chosen.trial.joint) if remains else None,
        late=late,
        base=base,
        best=best,
        rivals=rivals,
        steps=chosen.steps,
        scores=chosen.steps[0].scores if chosen.steps else tuple(chosen.trial.scores()),
        names=chosen.names,
        cosines=chosen.cosines,
        not_visible={
            effect.name: f"{why}; what would show it: {effect.separation}"
            for effect in catalogue
            if (why := presence.unseen(effect))
        },
        hidden={level: tuple(effects) for level, effects in hidden.items()},
        hidden_by_starts=hidden_by_starts(fit, chosen.trial, catalogue),
        shifted=shifted_levels(fit, best, chosen.trial, catalogue, hidden),
    )


def _clean(fit: Fit, model: FittedModel) -> bool:
    return float(model.linearised.variance_factors.max()) < fit.decides.wrong


def _verdict(fit: Fit, chosen: Selection) -> Verdict:
    best = chosen.best
    explained = _share(chosen.base, best) > 1.0 - fit.decides.left
    # What swings about zero may have no mean that lasts; noise is not so large.
    was, left = (model.linearised.squares.max() - 1.0 for model in (chosen.base, best))
    most = max(1.0 - _HALF, fit.decides.left) * was
    if left > fit.decides.wrong - 1.0 and (not best.active or left > most):
        return "unexplained"
    if not _clean(fit, chosen.best) and not (best.active and (chosen.interrupted or explained)):
        return "unexplained"
    return "found" if best.active else "nothing"


def _with_clock(
    fit: Fit, catalogue: Sequence[Effect], chosen: Selection, late: LateSignals
) -> FittedModel | None:
    """The nominal model with the clock of the declared logger whose signals are late, if any is.

    By more than a machine's shortest time, no derivative about the nominal model points there.
    """
    for clock in (effect for effect in catalogue if effect.late and late.skew):
        skew = late.skew_of(clock.late, fit.recorded)
        if skew and clock not in chosen.best.active:
            point = replace(chosen.base.point, sizes={(clock.name, clock.size): skew})
            return fitted(fit, fit.at(point), (clock,))
    return None


def _selected_with(
    fit: Fit, catalogue: Sequence[Effect], chosen: Selection, begun: FittedModel, report: Reporter
) -> Selection:
    """What recordings need beside what a search begins with."""
    scores = tuple(chosen.trial.scores())
    steps = [Step(chosen.base, scores, (begun,))]
    best, trial, interrupted = forward_selection(fit, catalogue, begun, steps, (), report)
    sought = ForwardSelection(best, steps, trial, interrupted, None)
    return select(fit, catalogue, sought, report)


def _within_bounds(
    fit: Fit, catalogue: Sequence[Effect], chosen: Selection, report: Reporter
) -> tuple[Selection, NearestCandidate | None]:
    """What is left of causes where others only stand for what one has beyond its bound.

    Returns
    -------
    chosen : that cause alone, if it needs no other beyond its bound; else as it was.
    outside : all causes that recordings need if it may pass its bound, within which sizes of others
        are wrong.
    """
    best = chosen.best
    held = {
        effect: limit
        for effect in best.active
        if (limit := binding_bound(fit, best, effect, effect.label))
        and not _set_by_nature(
            best.point.sizes[effect.name, effect.label], fit.unknowns.unit(effect, effect.size)
        )
    }
    if len(best.active) < 2 or chosen.interrupted or not held:
        return chosen, None
    other = fit
    for effect, limit in held.items():
        other = other.opened(effect, effect.size, limit)
    start = replace(best.linearised, settled=False)
    wide = differentiable(partial(fitted, other, start, best.active))
    if wide is None or beyond(best, wide) < fit.decides.needed:
        return chosen, None
    report(f"bounds opened, of {', '.join(effect.name for effect in held)}")
    needed = select(other, catalogue, search(other, catalogue, report), report)
    kept = needed.best.active
    outside = [e for e in kept if e in held and binding_bound(fit, needed.best, e, e.label)]
    if not outside or needed.interrupted:
        return chosen, None
    if beyond(needed.best, best) > fit.decides.form:
        return chosen, None
    if len(kept) > 1:
        fast = needed.validation.fast(needed.base, needed.best)
        removed = needed.validation.explained(needed.base, needed.best, fast=fast)[0]
        reasons = [
            f"{effect.label} of {effect.name} is at its bound; "
            f"{_size_text(fit, needed.best, effect)}, beyond it, fits better"
            for effect in outside
        ]
        return chosen, NearestCandidate(needed.best.names, removed, tuple(reasons))
    (effect,) = kept
    begun = fit.tried(_only(best, effect))
    if begun is None:
        return chosen, None
    alone, trial = examine(fit, fitted(fit, begun, (effect,)), catalogue, report)
    selection = ForwardSelection(alone, list(chosen.steps), trial, interrupted=True, begun=None)
    return replace(select(fit, catalogue, selection, report), interrupted=False), None


def _size_text(fit: Fit, model: FittedModel, effect: Effect) -> str:
    """The size that an effect has in a fit, in words."""
    size = model.point.sizes[effect.name, effect.label]
    return with_unit(size, fit.unknowns.unit(effect, effect.size))


def _only(best: FittedModel, effect: Effect) -> Point:
    point = best.point
    for other in best.active:
        point = point if other is effect else without(point, other)
    return point


def _at_bounds(causes: Sequence[Cause]) -> list[str]:
    """Parameters of causes beyond whose bounds there may be values, in words."""
    return [
        f"{name} of {cause.effect.name} is at its bound"
        for cause in causes
        for name, interval in cause.parameters.items()
        if interval.limit and interval.open
    ]


def _objections(
    fit: Fit, chosen: Selection, gain: Gain, *, whole: bool
) -> tuple[list[str], list[str]]:
    """Why effects are no whole answer: recordings that they make worse, and what they leave.

    Parameters
    ----------
    whole : whether they leave no more than a cause may, of what they were fitted to.
    """
    base, best, validation = chosen.base, chosen.best, chosen.validation
    fast = validation.fast(base, best)
    worse = [
        f"{name} is predicted worse ({gain.recordings[name][0]:.1f} to "
        f"{gain.recordings[name][1]:.1f} times the noise)"
        for name in validation.worsened(base, best, fast=fast)
    ]
    left = []
    # Several causes bend to much that is neither of them: what they leave must be noise, or each
    # must explain, beside the others, what a right cause does of what it is to explain. One alone
    # must explain more than it leaves, of what the other recordings are sure of.
    noise = validation.noise_alone(best, fast=fast)
    most = 1.0 - fit.decides.left
    if len(best.active) == 1:
        enough = validation.removed(base, best, fast=fast) >= min(_HALF, most)
    else:
        shares = [
            validation.explained(less, best, fast=validation.fast(less, best))[0]
            for less in chosen.less.values()
        ]
        enough = min(shares, default=0.0) >= most
    if not whole or not (noise or enough):
        left.append(f"{gain.after:.1f} times the noise remains in cross-validation")
    if others := _lacking(fit, chosen):
        left.append(others)
    return worse, left


def _lacking(fit: Fit, chosen: Selection) -> str:
    """Whether what remains goes with other effects, of any sign, as no chance does; empty: not.

    None of them is a cause, but together they are many shapes that another law may have. A right
    law may be wrong by `WRONG` of its effect; and a model that is not quite its machine leaves
    less than a right law explains. Derivatives of a run that nothing corrects tell little of it.
    """
    fall, unknowns = chosen.trial.lack_of_fit()
    explained = chosen.trial.explained(chosen.best.point.sizes)
    by_form = max(WRONG**2, fit.decides.left) * explained
    chance = fit.decides.chance(unknowns) if unknowns else np.inf
    if fit.free or fall <= max(by_form + chance, explained + unknowns):
        return ""
    return "what remains goes with other effects of the catalogue, but none explains it"


def _nearest_fits(fit: Fit, chosen: Selection) -> dict[tuple[str, ...], FittedModel]:
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
        tried = list(others.values())[:_NEAREST]
        fits |= {
            single.names: single
            for single in fit.together(partial(extended, fit, base), tried)
            if single is not None
        }
    if best.active:
        fits[best.names] = best
    return fits


def _change(fit: Fit, chosen: Selection, report: Reporter) -> NearestCandidate | None:
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
    tried = [starts_of([score]) for score in list(scores.values())[:_NEAREST] if score.size]
    known = best.linearised.deviance + fit.decides.form if _clean(fit, best) else np.inf
    for model in rival_fits(other, about, tried, known) if tried else ():
        validation = CrossValidation(other)
        fast = validation.fast(about, model)
        if len(best.active) > 1:
            able = beyond(model, best) < fit.decides.form
        else:
            able = beyond(best, model) > fit.decides.needed
            able = able and _clean(fit, model) and validation.noise_alone(model, fast=fast)
        if able and not _below_what_matters(model):
            (effect,) = model.active
            size = model.point.sizes[effect.name, effect.size]
            size += other.unknowns.nominal(effect, effect.size)
            text = with_unit(size, other.unknowns.unit(effect, effect.size))
            removed = validation.explained(about, model, fast=fast)[0]
            reason = "it is no effect of the catalogue"
            return NearestCandidate(
                model.names, removed, (reason,), change=f"{effect.text}: {text}"
            )
    return None


def _passed_over(
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
        and _clean(fit, model)
        and chosen.validation.noise_alone(model, fast=chosen.validation.fast(chosen.base, model))
    ]
    return min(able, key=lambda model: model.misfit, default=None)


def _nearest(
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
    return tuple(sorted(nearest, key=lambda candidate: -candidate.removed)[:_NEAREST])


def _below_what_matters(model: FittedModel) -> bool:
    sizes = model.point.sizes
    return all(abs(sizes[effect.name, effect.label]) < effect.matters for effect in model.active)


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
        size = _size_text(fit, fitted, effect)
        reasons.append(f"its size, {size}, is less than what matters, {least}")
    worse = validation.worsened(chosen.base, fitted, fast=fast)
    reasons += [f"{' and '.join(worse)} would be predicted worse"] * bool(worse)
    left = np.sqrt(validation.squares(fitted, fast=fast))
    worst = fit.tests[int(np.argmax(left))]
    return [*reasons, f"it leaves {left.max():.1f} times the noise in {worst}"]


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


def _beyond_sheet(
    fit: Fit,
    catalogue: Sequence[Effect],
    likely: tuple[Selection, Sequence[int]],
    unlikely: frozenset[Key],
    report: Reporter,
) -> tuple[Selection, Sequence[int]]:
    """What recordings need if levels may be further from their sheets than is likely.

    A sheet may be wrong. Then effects bend to what a level does not reach, or nothing explains it.
    Levels are freed where that leaves nothing wrong: if nothing was before, by significantly more
    without another effect, else with no more effects. What no effect explains may move any level.
    """
    before, fit.freed = fit.freed, fit.freed | unlikely
    chosen, astray = _selected(fit, catalogue, report)
    was, now = likely[0].best, chosen.best
    clean = _clean(fit, likely[0].best)
    fewer = {*now.active} <= {*was.active} if clean else len(now.active) <= len(was.active)
    if _clean(fit, chosen.best) and fewer and beyond(was, now) > fit.decides.fall:
        return chosen, astray
    fit.freed = before
    return likely


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
    while waiting := [effect for effect in causes if effect not in ordered]:
        least = min(left.get(effect, np.inf) for effect in waiting)
        equals = [other for other in waiting if left.get(other, np.inf) <= least + fit.decides.tied]
        ordered.append(min(equals, key=catalogue.index))
    return ordered


def _share(before: FittedModel, after: FittedModel) -> float:
    """Share of lasting errors, over noise, that is gone; of the channel that fares worst."""
    was, left = before.linearised.variance_factors - 1.0, after.linearised.variance_factors - 1.0
    return float(1.0 - left.max() / max(was.max(), 1e-9))


def _gain(fit: Fit, chosen: Selection) -> Gain:
    from scipy.stats import bootstrap  # takes its time to load

    fast = chosen.validation.fast(chosen.base, chosen.best)
    before, after = (
        chosen.validation.squares(fitted_model, fast=fast)
        for fitted_model in (chosen.base, chosen.best)
    )
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
            for name, b, a in zip(fit.tests, before, after, strict=True)
        },
        fast=fast,
    )


def binding_bound(fit: Fit, best: FittedModel, effect: Effect, label: str) -> str:
    """The bound at which a fit stopped, "least" or "greatest"; empty within them."""
    value = best.point.sizes[effect.name, label]
    low, high = fit.unknowns.bounds(effect, effect.size if label == effect.label else label)
    return "least" if value <= low else "greatest" if value >= high else ""


def _passed(
    fit: Fit, best: FittedModel, effect: Effect, label: str, limit: str
) -> tuple[float, bool]:
    """Where a fit ends that may pass a bound, and whether it needs no other cause; NaN: no better.

    Beside a cause that is held at its bound, others stand for the rest of it.
    """
    key = (effect.name, label)
    other = fit.opened(effect, effect.size if label == effect.label else label, limit)
    start = replace(best.linearised, settled=False)
    wide = differentiable(partial(fitted, other, start, best.active))
    if wide is None or beyond(best, wide) < fit.decides.fall:
        return np.nan, False
    if len(best.active) > 1 and (begun := other.tried(_only(best, effect))) is not None:
        alone = differentiable(partial(fitted, other, begun, (effect,)))
        if alone is not None and beyond(alone, wide) < fit.decides.form:
            return float(alone.point.sizes[key]), True
    return float(wide.point.sizes[key]), False


def _set_by_nature(value: float, unit: str) -> bool:
    """Whether a bound is a sign, or the whole of a share, beyond which there is nothing."""
    return value == 0.0 or (unit == "1" and abs(value) == 1.0)


def _apart_by_starts(fit: Fit, effect: Effect) -> list[str]:
    """Lags that differ in how a recording begins alone: of the one input, and the one output.

    A linear model behind a lag is a lag behind that model. A recording that begins in motion does
    not say where either lag begins.
    """
    if not effect.sensor or effect.size != LAG or len(fit.recorded) != 2:
        return []
    others = fit.unknowns.effects.values()
    return [e.name for e in others if e.sensor and e.size == LAG and e.model != effect.model]


def _cause(fit: Fit, chosen: Selection, effect: Effect, *, noise_alone: bool, whole: bool) -> Cause:
    """A cause with intervals, which what is left widens, or the form that noise may hide."""
    best, trial, unknowns = chosen.best, chosen.trial, fit.unknowns
    moved = trial.moved(chosen.twins[effect])
    sigma = np.hypot(np.sqrt(np.diag(trial.covariance())), moved)
    fast, form_share = chosen.validation.fast(chosen.less[effect], best), _FORM
    if noise_alone:
        more = hidden_by_noise(fit, best, effect)
    else:
        left, explained = chosen.validation.where_acting(
            chosen.less[effect], best, fast=fast, whole=whole
        )
        form_share = max(_FORM, share_by_form(left, explained))
        more = correlated_deviations(fit, best)
    parameters = {}
    for key, value in best.point.sizes.items():
        if key[0] != effect.name:
            continue
        parameter = effect.size if key[1] == effect.label else key[1]
        low, high = unknowns.bounds(effect, parameter)
        # Beside the noise: forms of laws that differ in detail, and immaterial companions.
        of_size = key[1] == effect.label
        share = form_share if of_size else _FORM
        form = np.hypot(share * value, _COMPANY * effect.matters * of_size)
        noise = np.hypot(sigma[trial.joint.known.index(key)], more.get(key, 0.0))
        reach = float(BAND * np.hypot(noise, form))
        limit = binding_bound(fit, best, effect, key[1])
        unit = unknowns.unit(effect, parameter)
        # A parameter or a zero without a unit may be of any size: 2 is not 200 % of anything.
        own = bool(effect.parameter or effect.sensor) and key[1] not in SHARES
        plain = own and unit in ("", "1")
        least, greatest = max(value - reach, low), min(value + reach, high)
        further = (np.nan, False)
        # A value at a bound says nothing of the side beyond.
        if limit and not _set_by_nature(value, "" if plain else unit):
            least = -np.inf if limit == "least" else least
            greatest = np.inf if limit == "greatest" else greatest
            further = _passed(fit, best, effect, key[1], limit)
        ends = float(least), float(greatest)
        parameters[key[1]] = Interval(value, *ends, unit, limit, *further, plain=plain)
    return Cause(
        effect=effect,
        parameters=parameters,
        confusable_with=tuple(
            dict.fromkeys([*chosen.twins[effect], *_apart_by_starts(fit, effect)])
        ),
        explained=chosen.validation.explained(chosen.less[effect], best, fast=fast)[0],
        phases=best.point.phases.get(effect.name),
    )
