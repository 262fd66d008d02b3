"""From fitted effects to a verdict: what was found, how sure, and what cannot be told apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.between_recordings import (
    DifferingParameter,
    DifferingStarts,
    what_differs,
)
from workbench.diagnosis.inference.causes import (
    Cause,
    at_bounds,
    binding_bound,
    cause_of,
    set_by_nature,
    size_text,
    strongest_first,
)
from workbench.diagnosis.inference.coupling import Coupling
from workbench.diagnosis.inference.discrepancy import WRONG
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.nearest import (
    NEAREST,
    NearestCandidate,
    fewer_causes,
    nearest_candidates,
    nearest_fits,
    passed_over,
    undecided,
)
from workbench.diagnosis.inference.nuisance import (
    ShiftedLevel,
    hidden_by_starts,
    hidden_effects,
    shifted_levels,
)
from workbench.diagnosis.inference.outside import otherwise_held, outside_changes
from workbench.diagnosis.inference.quadratic import Key
from workbench.diagnosis.inference.score_test import CandidateScore
from workbench.diagnosis.inference.search import (
    FittedModel,
    Step,
    beyond,
    differentiable,
    examine,
    fitted,
    forward_selection,
    is_clean,
    reduced_to,
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

Verdict = Literal["nothing", "found", "partly explained", "unexplained"]

_DRAWS = 2000  # of the bootstrap over stops
# Share from which on a part has the right place, if not the right form: of squares, an offset in
# place of a ramp takes 75 %, a line in place of a parabola 94 %.
_MOST = 0.9
_HALF = 0.5  # share of squares from which on a cause explains more than it leaves


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
    def removed(self) -> float:
        """Share of the squares beyond noise that causes remove."""
        before, after = self.before**2 - 1.0, self.after**2 - 1.0
        return (before - after) / max(before, 1e-9)

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
    # what a Co-Simulation makes of its inputs, where all that is wrong is no larger: unexplained
    coupling: Coupling | None = None

    def outdone(self, law: str) -> "Diagnosis":
        """The diagnosis where one free law explains as much as several causes with less.

        Several effects bend to much that is neither of them: then they are no answer.
        """
        return self._refuted(f"one law explains as much with less: {law}")

    def within(self, coupling: Coupling) -> "Diagnosis":
        """The diagnosis where all that is wrong is no more than what the FMU makes of inputs."""
        refuted = self if self.gain is None else self._refuted("the FMU's inputs make as much")
        return replace(refuted, coupling=coupling, differing=None)

    def _refuted(self, reason: str) -> "Diagnosis":
        assert self.gain is not None
        removed = float(np.clip(self.gain.removed, 0.0, 1.0))
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
    unlikely = fit.unlikely_levels(chosen.best.point, clean=is_clean(fit, chosen.best))
    if unlikely and not chosen.interrupted:
        report(f"further from the data sheet: {', '.join(sorted(name for name, _ in unlikely))}")
        chosen, astray = _beyond_sheet(fit, catalogue, (chosen, astray), unlikely, report)
    return _judged(fit, catalogue, chosen, astray, report)


@dataclass(frozen=True)
class _Answer:
    """What the causes of a selection answer, by recordings that were fitted and that were not."""

    verdict: Verdict
    gain: Gain | None  # None without causes, or where another verdict is sure before
    causes: Sequence[Cause]
    objections: Sequence[str]  # what is held against the causes
    noise_alone: bool  # see `Diagnosis`

    def outdone_by(self, change: NearestCandidate, best: FittedModel) -> "_Answer":
        """The answer where changes explain as much as the causes do, and not all are effects."""
        much = "as much" if len(change.effects) < len(best.active) else "more"
        does = "alone explains" if len(change.effects) == 1 else "explain"
        outdone = f"{' and '.join(change.effects)} {does} {much}"
        objections = [*self.objections, *([outdone] if best.active else [])]
        return replace(self, verdict="unexplained", objections=objections)


def _judged(
    fit: Fit,
    catalogue: Sequence[Effect],
    chosen: Selection,
    astray: Sequence[int],
    report: Reporter,
) -> Diagnosis:
    """What the outcome of a search amounts to; begun again from causes that it passed over."""
    chosen, outside = _within_bounds(fit, catalogue, chosen, report)
    late = None
    if not (astray or outside):
        chosen, late = _with_clocks(fit, catalogue, chosen, report)
    refused = bool(astray or outside or late)
    ended = refused or chosen.interrupted
    other = None if ended else _fewer(fit, catalogue, chosen, report)
    if other is not None:
        return _judged(fit, catalogue, other, astray, report)
    answer = _Answer("unexplained" if refused else _verdict(fit, chosen), None, (), (), True)
    if chosen.best.active and not (outside or late):
        report("held-out recordings")
        answer = _answered(fit, catalogue, chosen, astray, answer.verdict)
    fits: dict[tuple[str, ...], FittedModel] = {}
    if answer.verdict == "unexplained" and late is None:
        report("candidates that come nearest")
        fits = {} if outside else nearest_fits(fit, chosen)
    if answer.verdict in ("partly explained", "unexplained") and not ended:
        other = _passed_over(fit, catalogue, chosen, fits, report)
    if other is not None:
        return _judged(fit, catalogue, other, astray, report)
    change = None
    if answer.verdict != "nothing" and not ended:
        report("changes that no effect is")
        explained = answer.verdict != "unexplained"
        change = outside_changes(fit, chosen, report, explained=explained)
        change = change or otherwise_held(fit, chosen)
    if change is not None:
        fits = fits or nearest_fits(fit, chosen)
        answer = answer.outdone_by(change, chosen.best)
    nearest: tuple[NearestCandidate, ...] = ()
    if answer.verdict == "unexplained" and late is None:
        others = () if outside else nearest_candidates(fit, chosen, fits, answer.objections)
        nearest = (*filter(None, (outside, change)), *others)[:NEAREST]
    if answer.verdict == "nothing" and not chosen.interrupted:
        nearest = undecided(fit, chosen)
    return _diagnosis(fit, catalogue, chosen, answer, nearest, late)


def _answered(
    fit: Fit,
    catalogue: Sequence[Effect],
    chosen: Selection,
    astray: Sequence[int],
    verdict: Verdict,
) -> _Answer:
    """What causes answer, beside a verdict by the recordings that they were fitted to."""
    gain = _gain(fit, chosen)
    verdict, objections = _on_held_out(fit, chosen, gain, verdict, astray)
    if verdict not in ("found", "partly explained"):
        return _Answer(verdict, gain, (), objections, noise_alone=True)
    noise_alone = chosen.validation.noise_alone(chosen.best, fast=gain.fast)
    causes = [
        cause_of(fit, chosen, effect, noise_alone=noise_alone, whole=verdict == "found")
        for effect in strongest_first(fit, chosen, catalogue)
    ]
    verdict, doubts = _by_intervals(fit, chosen, gain, verdict, causes)
    return _Answer(verdict, gain, causes, [*objections, *doubts], noise_alone)


def _diagnosis(
    fit: Fit,
    catalogue: Sequence[Effect],
    chosen: Selection,
    answer: _Answer,
    nearest: tuple[NearestCandidate, ...],
    late: LateSignals | None,
) -> Diagnosis:
    """The answer with all that shows it, and what these recordings cannot show."""
    best, verdict = chosen.best, answer.verdict
    answered = bool(answer.causes) and verdict != "unexplained"
    twins = [model for fits in chosen.twins.values() for model in fits.values()]
    changed = any(candidate.change for candidate in nearest)
    remains = not answer.noise_alone or (verdict == "unexplained" and late is None)
    part_of = verdict == "partly explained" or best.names in [near.effects for near in nearest]
    hidden = hidden_effects(fit, chosen.trial, catalogue)
    return Diagnosis(
        verdict=verdict,
        interrupted=chosen.interrupted,
        causes=tuple(answer.causes) if answered else (),
        gain=answer.gain if answered else None,
        partial=best.names if part_of else (),
        nearest=nearest,
        noise_alone=answer.noise_alone,
        differing=(
            what_differs(fit, best, chosen.trial.joint) if remains and not changed else None
        ),
        late=late,
        base=chosen.base,
        best=best,
        rivals=(best, *twins) if answered else (),
        steps=chosen.steps,
        scores=chosen.steps[0].scores if chosen.steps else tuple(chosen.trial.scores()),
        names=chosen.names,
        cosines=chosen.cosines,
        not_visible={
            effect.name: f"{why}; what would show it: {effect.separation}"
            for effect in catalogue
            if (why := fit.unknowns.presence.unseen(effect))
        },
        hidden={level: tuple(effects) for level, effects in hidden.items()},
        hidden_by_starts=hidden_by_starts(fit, chosen.trial, catalogue),
        shifted=shifted_levels(fit, best, chosen.trial, catalogue, hidden),
    )


def _verdict(fit: Fit, chosen: Selection) -> Verdict:
    best = chosen.best
    explained = _share(chosen.base, best) > 1.0 - fit.decides.left
    # What swings about zero may have no mean that lasts; noise is not so large.
    was, left = (model.linearised.squares.max() - 1.0 for model in (chosen.base, best))
    most = max(1.0 - _HALF, fit.decides.left) * was
    if left > fit.decides.wrong - 1.0 and (not best.active or left > most):
        return "unexplained"
    if not is_clean(fit, chosen.best) and not (best.active and (chosen.interrupted or explained)):
        return "unexplained"
    return "found" if best.active else "nothing"


def _with_clocks(
    fit: Fit, catalogue: Sequence[Effect], chosen: Selection, report: Reporter
) -> tuple[Selection, LateSignals | None]:
    """What recordings need where a logger that the system declares is late, or what else is late.

    By more than a machine's shortest time, no derivative about the nominal model points there.
    """
    if chosen.interrupted or _verdict(fit, chosen) == "nothing":
        return chosen, None
    report("clocks of signals by themselves")
    late = by_themselves(fit, chosen.base, chosen.best, clean=is_clean(fit, chosen.best))
    if late is None:
        return chosen, None
    for clock in (effect for effect in catalogue if effect.late and late.skew):
        skew = late.skew_of(clock.late, fit.recorded)
        if not skew or clock in chosen.best.active:
            continue
        report(f"with {clock.name}, where the fits above did not get")
        point = replace(chosen.base.point, sizes={(clock.name, clock.size): skew})
        begun = fitted(fit, fit.at(point), (clock,))
        timed = _selected_with(fit, catalogue, chosen, begun, report)
        return (timed, None) if clock in timed.best.active else (chosen, late)
    return chosen, late


def _on_held_out(
    fit: Fit, chosen: Selection, gain: Gain, verdict: Verdict, astray: Sequence[int]
) -> tuple[Verdict, list[str]]:
    """The verdict by recordings that were not fitted, and what is held against the causes."""
    if chosen.interrupted:
        return verdict, []
    worse, left = _objections(fit, chosen, gain, whole=verdict == "found")
    if not (worse or left):
        return verdict, []
    part = not worse and not astray and gain.removed > _MOST
    return "partly explained" if part else "unexplained", [*worse, *left]


def _by_intervals(
    fit: Fit, chosen: Selection, gain: Gain, verdict: Verdict, causes: Sequence[Cause]
) -> tuple[Verdict, list[str]]:
    """The verdict by how sure the sizes of causes are, and what is held against them."""
    unsure = [f"the size of {c.effect.name} may be zero" for c in causes if c.may_be_zero]
    if verdict == "found":
        if not unsure:
            return verdict, []
        most = min(_MOST, 1.0 - fit.decides.left)
        part = chosen.interrupted or gain.removed > most
        verdict = "partly explained" if part else "unexplained"
    else:
        unsure = []
    # Beside others, a part that bends as far as its effect allows stands for another law.
    if verdict == "partly explained" and len(causes) > 1 and (bent := at_bounds(causes)):
        return "unexplained", [*unsure, *bent]
    return verdict, unsure


def _fewer(
    fit: Fit, catalogue: Sequence[Effect], chosen: Selection, report: Reporter
) -> Selection | None:
    """What recordings need where fewer effects explain as much as the causes."""
    if (fewer := fewer_causes(fit, chosen)) is None:
        return None
    report(f"with {' and '.join(fewer.names)} in place of more causes")
    other = _selected_with(fit, catalogue, chosen, fewer, report)
    return other if len(other.best.active) < len(chosen.best.active) else None


def _passed_over(
    fit: Fit,
    catalogue: Sequence[Effect],
    chosen: Selection,
    fits: Mapping[tuple[str, ...], FittedModel],
    report: Reporter,
) -> Selection | None:
    """What recordings need beside causes where the search did not get, if that leaves less."""
    if (whole := passed_over(fit, chosen, fits)) is None:
        return None
    report(f"with {' and '.join(whole.names)}, where the fits above did not get")
    other = _selected_with(fit, catalogue, chosen, whole, report)
    # Else a cause that only stands for another beyond its bound would be taken up again and again.
    within, outside = _within_bounds(fit, catalogue, other, report)
    more = beyond(chosen.best, within.best) > fit.decides.needed
    return within if more and outside is None else None


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
        and not set_by_nature(
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
            f"{size_text(fit, needed.best, effect)}, beyond it, fits better"
            for effect in outside
        ]
        return chosen, NearestCandidate(needed.best.names, removed, tuple(reasons))
    (effect,) = kept
    begun = fit.tried(reduced_to(best, effect))
    if begun is None:
        return chosen, None
    alone, trial = examine(fit, fitted(fit, begun, (effect,)), catalogue, report)
    selection = ForwardSelection(alone, list(chosen.steps), trial, interrupted=True, begun=None)
    return replace(select(fit, catalogue, selection, report), interrupted=False), None


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
    clean = is_clean(fit, likely[0].best)
    fewer = {*now.active} <= {*was.active} if clean else len(now.active) <= len(was.active)
    if is_clean(fit, chosen.best) and fewer and beyond(was, now) > fit.decides.fall:
        return chosen, astray
    fit.freed = before
    return likely


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
