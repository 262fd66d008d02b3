"""Which effects the data ask for, one after the other, judged on stops they were not fitted to."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, pairwise, product
from typing import TypeVar

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.effects.candidates import COEFFICIENT, LOSS, RECTIFIED
from workbench.diagnosis.effects.catalogue import Effect, variant
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint, Point
from workbench.diagnosis.inference.score_test import (
    Candidate,
    CandidateScore,
    ScoreTest,
    score_test,
    shapes,
)
from workbench.diagnosis.inference.thresholds import Thresholds
from workbench.errors import FMUError
from workbench.runtime.engine import Reporter
from workbench.system.units import BAND

Result = TypeVar("Result")

BEGUN = 3  # rounds after which a rival that is far behind is given up
_SIZES = tuple(10.0 ** (0.5 * k) for k in range(9))  # times what matters, where derivatives fail
_SHARES = (0.125, 0.25, 0.5, 1.0)  # of a recording, over which runs are compared
_VARIANTS, _HALVINGS = 4, 2  # of shapes, and of the size, that a fit begins with
ROUNDS = 12  # of Gauss-Newton, most


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A set of effects, fitted in full."""

    active: tuple[Effect, ...]
    point: Point
    linearised: LinearizedPoint
    misfit: float  # chi-squared of all stops at the point, in units of the noise

    @property
    def names(self) -> tuple[str, ...]:
        """Of its effects."""
        return tuple(effect.name for effect in self.active)


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the search: what was tried, and what came out."""

    before: FittedModel
    scores: tuple[CandidateScore, ...]  # of all candidates, linearised, best first
    rivals: tuple[FittedModel, ...]  # fitted in full; the first was taken, the others best first


def forward_selection(
    fit: Fit,
    catalogue: Sequence[Effect],
    best: FittedModel,
    steps: list[Step],
    dropped: Collection[Effect],
    report: Reporter,
) -> tuple[FittedModel, ScoreTest, bool]:
    """Find what is missing.

    Parameters
    ----------
    best : what was found before, fitted; at first the nominal model.
    steps : how that was found; more are added.
    dropped : effects that are not sought.

    Returns
    -------
    best : the effects that are needed, fitted.
    trial : all other effects about the best point.
    interrupted : whether Ctrl-C ended it; before anything was found it ends the diagnosis.
    """
    sought = [effect for effect in catalogue if effect not in dropped]
    straight: dict[str, float] = {}
    try:
        while True:
            best, trial = examine(fit, best, catalogue, report)
            step = _step(fit, sought, best, trial, straight, report)
            more = _terms_together(fit, sought, best, trial) if step is None else [step]
            if not more:
                return best, trial, False
            steps += more
            best = more[-1].rivals[0]
    except KeyboardInterrupt:
        if not steps:
            raise
        report("interrupted: no more causes are sought, what was found is finished")
        best, trial = examine(fit, best, catalogue, report)
        return best, trial, True


def _step(
    fit: Fit,
    catalogue: Sequence[Effect],
    best: FittedModel,
    trial: ScoreTest,
    straight: dict[str, float],
    report: Reporter,
) -> Step | None:
    """One more effect, or none if the data do not ask for it; of equals the usual one.

    Parameters
    ----------
    straight : sizes up to which derivatives held in a step before, by effect; more are added.
    """
    scores = tuple(score for score in trial.scores() if score.effect in catalogue)
    rivals: list[list[CandidateScore]] = []
    if len(best.active) < fit.decides.most:
        rivals = _rivals(scores, best, fit.decides, trial.wrong)
        if fit.free and not rivals:
            rivals = _predicting(scores, best, fit.decides)
        # Of a run that nothing corrects, sizes are far from where derivatives point.
        ranked = [variants[0].effect for variants in rivals]
        unjudged = [s for s in scores if fit.free or s.effect not in ranked]
        simulated = _misjudged(fit, best, unjudged, straight)
        rivals = [starts_of(variants) for variants in rivals]
        for start in simulated:
            if start.effect in ranked:
                rivals[ranked.index(start.effect)].insert(0, start)
            else:  # of a sensor, or a run that nothing corrects, it is a guess to begin with
                guess = fit.free or start.effect.sensor
                rivals.append(starts_of([start]) if guess else [start])
    if not rivals:
        return None
    report(f"fitting {', '.join(variants[0].effect.name for variants in rivals)}")
    fits = rival_fits(fit, best, rivals)
    if not fits:
        return None
    equals = [other for other in fits if beyond(other, fits[0]) < fit.decides.tied]
    first = min(equals, key=lambda equal: catalogue.index(equal.active[-1]))
    return Step(best, scores, (first, *(fit for fit in fits if fit is not first)))


def _terms_together(
    fit: Fit, catalogue: Sequence[Effect], best: FittedModel, trial: ScoreTest
) -> list[Step]:
    """One or two more terms beside the rate that lacks one, each set of them fitted in full.

    Friction of several parts needs it: what fades with speed and what rises with it look like a
    constant together, and either alone gains too little. Each term must pay for itself by what is
    significant. Tried while errors are far above the noise; none if no set gains.
    """
    rates = {_rate(effect) for effect in best.active if effect.size == COEFFICIENT}
    if best.linearised.variance_factors.max() <= fit.decides.wrong:
        return []
    scores = tuple(score for score in trial.scores() if score.effect in catalogue)
    terms: dict[str, list[CandidateScore]] = {}
    for score in scores:
        if score.effect.size == COEFFICIENT and _rate(score.effect) in rates:
            begin = replace(score, size=score.effect.matters)
            terms.setdefault(score.effect.name, []).append(begin)
    room = min(2, fit.decides.most - len(best.active))
    sets = [
        chosen
        for count in range(1, room + 1)
        for variants in combinations(terms.values(), count)
        for chosen in product(*variants)
    ]

    def model(chosen: Sequence[CandidateScore]) -> FittedModel | None:
        point = best.point
        for score in chosen:
            point = joined(point, score)
        if (start := fit.tried(point)) is None:
            return None
        active = (*best.active, *(score.effect for score in chosen))
        return differentiable(partial(fitted, fit, start, active, ROUNDS, best.linearised.spread))

    models = [end for end in fit.together(model, sets) if end is not None]
    gains = {
        end: best.linearised.deviance
        - end.linearised.deviance
        - fit.decides.fall * (len(end.active) - len(best.active))
        for end in models
    }
    first = max(models, key=gains.__getitem__, default=None)
    return [Step(best, scores, (first,))] if first is not None and gains[first] > 0.0 else []


def _rate(effect: Effect) -> str:
    """State whose rate a term is added to."""
    return effect.parameter.split(".", 2)[2]


def _misjudged(
    fit: Fit,
    best: FittedModel,
    scores: Sequence[CandidateScore],
    straight: dict[str, float],
) -> list[CandidateScore]:
    """Effects of which the linearised score says nothing, each where its fit should begin.

    While errors are large, derivatives at the point may hold nowhere near the size that is asked
    for. Each effect is simulated at the size that would change predictions as much as they are
    wrong: where errors are others there than linearised, only a fit tells.

    Parameters
    ----------
    straight : see `_step`.
    """
    if not _lacks(best, fit.decides):
        return []
    first: dict[str, CandidateScore] = {}
    for score in sorted(scores, key=lambda score: -score.gain):
        if not score.effect.order_locked:
            first.setdefault(score.effect.name, score)
    starts = fit.together(partial(_simulated_start, fit, best, straight), list(first.values()))
    return [start for start in starts if start is not None]


def _simulated_start(
    fit: Fit, best: FittedModel, straight: dict[str, float], score: CandidateScore
) -> CandidateScore | None:
    """The size at which errors are least of those that are tried; None where derivatives hold.

    Where they held for a larger size beside fewer effects, they do; not along runs that nothing
    corrects, of which each switches elsewhere.
    """
    lin, effect = best.linearised, score.effect
    low, high = fit.unknowns.bounds(effect, effect.size)
    at = lin.keys.index((variant(effect, score.shape), effect.size))
    weight = 1.0 / np.sqrt(lin.spread)

    def weighed(errors: Sequence[Matrix]) -> float:
        return float(np.sqrt(sum(np.square(own * weight).sum() for own in errors)))

    now = [recording.errors for recording in lin.residuals]
    slopes = [
        float(fit.unknowns.presence.at(effect, k))
        * recording.jacobian[: recording.errors.size, at].reshape(recording.errors.shape)
        for k, recording in enumerate(lin.residuals)
    ]
    slope = weighed(slopes)
    if slope == 0.0:
        return None
    ways = [way for way in (1.0, -1.0) if low < way * effect.matters < high]
    if len(ways) == 2 and score.size:
        ways = [float(np.sign(score.size))]
    held, longest = True, weighed(now) / slope
    for way in ways:
        size = float(np.clip(way * longest, low, high))
        if not fit.free and abs(size) <= straight.get(f"{effect.name} {way:+.0f}", 0.0):
            continue
        simulated = fit.tried(joined(best.point, replace(score, size=size)))
        linear = [own + size * change for own, change in zip(now, slopes, strict=True)]
        held = (
            held
            and simulated is not None
            and weighed(
                [
                    recording.errors - expected
                    for recording, expected in zip(simulated.residuals, linear, strict=True)
                ]
            )
            < fit.decides.near * abs(size) * slope
        )
        if held:
            straight[f"{effect.name} {way:+.0f}"] = abs(size)
    if held:
        return None
    if fit.free:
        return _grown_start(fit, best, score)
    if effect.sensor and effect.size in (LOSS, RECTIFIED):
        return replace(score, size=1.0)  # other starts fit what is cut off: only a fit tells
    tried = [
        float(np.clip(way * effect.matters * step, low, high)) for way in ways for step in _SIZES
    ]
    deviances = {
        size: point.deviance
        for size in dict.fromkeys([*tried, score.size])
        if (point := fit.tried(joined(best.point, replace(score, size=size)))) is not None
    }
    if not deviances:
        return None
    size = min(deviances, key=lambda size: deviances[size])
    return replace(score, size=size) if deviances[size] < lin.deviance else None


def _grown_start(fit: Fit, best: FittedModel, score: CandidateScore) -> CandidateScore | None:
    """The size at which runs are nearest to longer and longer parts of the recordings.

    What switches earlier each time is soon out of step, and errors of whole runs have many minima.
    Over a short part there is one; a part twice as long tells the size within a third of before.
    """
    low, high = fit.unknowns.bounds(score.effect, score.effect.size)
    weight = 1.0 / np.sqrt(best.linearised.spread)
    runs: dict[float, LinearizedPoint | None] = {0.0: best.linearised}

    def misfit(size: float, share: float) -> float:
        if size not in runs:
            runs[size] = fit.tried(joined(best.point, replace(score, size=size)))
        if (run := runs[size]) is None:
            return np.inf
        parts = [own.errors[: max(1, round(share * len(own.errors)))] for own in run.residuals]
        return float(sum(np.square(part * weight).sum() for part in parts))

    steps = score.effect.matters * np.array(_SIZES)
    sizes, size = np.unique(np.clip([0.0, *steps, *-steps], low, high)), 0.0
    shares = list(_SHARES)
    for share in shares:
        if sizes.size < 2:  # bounds that allow no change
            return None
        misfits = np.array([misfit(float(size), share) for size in sizes])
        at = int(np.argmin(misfits))
        size = float(sizes[at])
        able = misfits[np.isfinite(misfits)]
        if share < _SHARES[-1] and able.size and np.ptp(able) < fit.decides.fall:
            shares.append(_SHARES[-1])  # as before a ramp begins, where all sizes are the same
            continue
        around = pairwise(sizes[max(0, at - 1) : at + 2])
        sizes = np.unique(np.concatenate([np.linspace(*ends, 4) for ends in around]))
    run = runs[size]
    better = size != 0.0 and run is not None and run.deviance < best.linearised.deviance
    return replace(score, size=size) if better else None


def _gains(fit: Fit, before: FittedModel, after: FittedModel) -> bool:
    return before.linearised.deviance - after.linearised.deviance > fit.decides.fall


def beyond(fitted: FittedModel, other: FittedModel) -> float:
    """Chi-squared that one leaves and another does not.

    Each channel in units of the lesser of what they leave wrong there: where both leave much, that
    one leaves a little more means nothing.
    """
    variance_factors = np.minimum(
        fitted.linearised.variance_factors, other.linearised.variance_factors
    )
    return fitted.linearised.weighed(variance_factors) - other.linearised.weighed(variance_factors)


def rival_fits(
    fit: Fit, best: FittedModel, rivals: Sequence[Sequence[CandidateScore]]
) -> list[FittedModel]:
    """Fits with one more effect that gain by it, best first; one far behind is not finished."""
    likeliest = _begun(fit, best, np.inf, rivals[0])
    sought = np.inf if likeliest is None else _sought(fit, best, likeliest)
    others = fit.together(partial(_begun, fit, best, sought), rivals[1:])
    begun = [start for start in (likeliest, *others) if start is not None]
    if not begun:
        return []
    left = misfits(begun)
    near = left < fit.decides.behind * left.min()
    worth = [i for i, model in enumerate(begun) if near[i] and not model.linearised.settled]
    sought = min(_sought(fit, best, model) for model in begun)

    def finished(model: FittedModel) -> FittedModel | None:
        return differentiable(partial(fitted, fit, model.linearised, model.active, sought=sought))

    ends = dict(zip(worth, fit.together(finished, [begun[i] for i in worth]), strict=True))
    every = [end for i, model in enumerate(begun) if (end := ends.get(i, model)) is not None]
    order = np.argsort(misfits(every)) if every else ()
    return [every[i] for i in order if _gains(fit, best, every[i])]


def _sought(fit: Fit, before: FittedModel, rival: FittedModel) -> float:
    """Deviance of fits with one more effect that may explain as well as one of them does."""
    form = max(fit.decides.form, fit.decides.form_share * beyond(before, rival))
    return rival.linearised.deviance + form


def misfits(fits: Sequence[FittedModel]) -> Vector:
    """Chi-squared of each, channels in units of the least that any of them leaves wrong, (f,)."""
    variance_factors = np.min([fit.linearised.variance_factors for fit in fits], axis=0)
    return np.array([fit.linearised.weighed(variance_factors) for fit in fits])


def starts_of(variants: Sequence[CandidateScore]) -> list[CandidateScore]:
    """Where fits of an effect begin, one after the other where that before gained nothing.

    A law bends: half a stiffness is twice the deflection, and where it sets in shows only there.
    """
    first = variants[0]
    halves = [replace(first, size=0.5**k * first.size) for k in range(1, _HALVINGS + 1)]
    return [*variants[:_VARIANTS], *halves]


def _begun(
    fit: Fit, best: FittedModel, sought: float, starts: Sequence[CandidateScore]
) -> FittedModel | None:
    """First rounds of a fit with one more effect, from the first start that gains by it."""
    tried = []
    for start in starts:
        if (model := extended(fit, best, start, BEGUN, sought)) is None:
            continue
        if _gains(fit, best, model):
            return model
        tried.append(model)
    return min(tried, key=lambda model: model.linearised.deviance, default=None)


def extended(
    fit: Fit,
    before: FittedModel,
    rival: CandidateScore,
    rounds: int = ROUNDS,
    sought: float = np.inf,
) -> FittedModel | None:
    """Fit with one more effect, begun where it was fitted without; None: not even begun."""
    start, spread = fit.tried(joined(before.point, rival)), before.linearised.spread
    if start is None:
        return None
    active = (*before.active, rival.effect)
    return differentiable(partial(fitted, fit, start, active, rounds, spread, sought))


def differentiable(fitting: Callable[[], Result]) -> Result | None:
    """A fit; None where it leads to no derivative, as an inertia less than none does."""
    try:
        return fitting()
    except FMUError:
        return None


def examine(
    fit: Fit, best: FittedModel, catalogue: Sequence[Effect], report: Reporter
) -> tuple[FittedModel, ScoreTest]:
    """Try every effect that the data can show and the point does not have.

    Returns
    -------
    best : with the derivatives by all of them.
    trial : of all of them.
    """
    candidates: list[Candidate] = [
        (effect, shape)
        for effect in catalogue
        if effect not in best.active and not fit.unknowns.presence.unseen(effect)
        for shape in shapes(effect)
    ]
    report(f"signatures of {len(candidates)} candidates")
    lin = fit.linearise(best.linearised, best.active, candidates)
    return replace(best, linearised=lin), score_test(fit, lin, candidates)


def pruned(
    fit: Fit,
    catalogue: Sequence[Effect],
    best: FittedModel,
    known: Mapping[frozenset[Effect], FittedModel],
    trial: ScoreTest,
    report: Reporter,
) -> tuple[FittedModel, ScoreTest, dict[Effect, FittedModel]]:
    """Drop effects that, beside the others, do not matter or are not significant.

    What forms of laws fake must be exceeded beside others, and where states are restarted.

    Parameters
    ----------
    known : fits by their effects, with all derivatives.

    Returns
    -------
    best, trial : of the effects that are left.
    less : see `leave_one_out_fits`.
    """
    while less := leave_one_out_fits(fit, best, known):
        sigma = np.sqrt(np.diag(trial.covariance()))
        ratios = {}
        for effect in best.active:
            key = (effect.name, effect.label)
            size, own = abs(best.point.sizes[key]), sigma[trial.joint.known.index(key)]
            sure, alone = _lacks(less[effect], fit.decides), len(less) == 1
            clear = size / max(own, 1e-300) / fit.decides.significant
            material = _material(effect, size, own * _noise_share(best), sure=sure)
            needs = beyond(less[effect], best) / fit.decides.needed
            # Where something is missing for sure, its immaterial twins are no other answer; beside
            # others that holds where all together leave noise alone.
            if sure and (alone or is_clean(fit, best)):
                clear = max(clear, needs)
            # No sheet says what matters of a term: what errors need does, too; of a clock alone,
            # too, from the least time on.
            late = effect.late and alone and size > fit.least_skew
            if effect.size == COEFFICIENT or late:
                material = max(material, needs)
            ratios[effect] = min(clear, material)
        if len(less) > 1 or fit.restarted:
            for effect, reduced in less.items():
                ratios[effect] = min(ratios[effect], beyond(reduced, best) / fit.decides.needed)
        weakest = min(ratios, key=lambda effect: ratios[effect])
        if ratios[weakest] >= 1.0:
            break
        report(f"dropping {weakest.name}")
        best, trial = examine(fit, less[weakest], catalogue, report)
    return best, trial, less


def leave_one_out_fits(
    fit: Fit, best: FittedModel, known: Mapping[frozenset[Effect], FittedModel]
) -> dict[Effect, FittedModel]:
    """The best fit without each of the effects, with all derivatives.

    Parameters
    ----------
    known : fits by their effects, with all derivatives, which need not be made again.
    """

    def linear(effect: Effect) -> Point:
        """The best point without it, by derivatives; channels weighed by what is wrong there."""
        lin, none = best.linearised, {(effect.name, effect.label): 0.0}
        there = fit.stepped(lin, lin.spread, none)
        return without(fit.stepped(lin, there.spread, none).point, effect)

    def refitted(effect: Effect) -> FittedModel:
        kept = tuple(other for other in best.active if other is not effect)
        if frozenset(kept) in known:
            return known[frozenset(kept)]
        starts = [fit.tried(point) for point in (without(best.point, effect), linear(effect))]
        able = [start for start in starts if start is not None]
        if not able:  # without it, the others stand for more than the machine can do
            return known[frozenset()]
        start = min(able, key=lambda start: start.deviance)
        model = fitted(fit, start, kept)
        return replace(model, linearised=fit.linearise(model.linearised, kept))

    fits = fit.together(refitted, best.active)
    return dict(zip(best.active, fits, strict=True))


def without(point: Point, effect: Effect) -> Point:
    """The point without one effect."""
    return replace(
        point,
        sizes={key: value for key, value in point.sizes.items() if key[0] != effect.name},
        phases={name: value for name, value in point.phases.items() if name != effect.name},
    )


def reduced_to(best: FittedModel, effect: Effect) -> Point:
    """The point of a fit with one of its effects alone."""
    point = best.point
    for other in best.active:
        point = point if other is effect else without(point, other)
    return point


def is_clean(fit: Fit, model: FittedModel) -> bool:
    """Whether errors that last are noise alone beside a model."""
    return float(model.linearised.variance_factors.max()) < fit.decides.wrong


def fitted(
    fit: Fit,
    start: LinearizedPoint,
    active: tuple[Effect, ...],
    rounds: int = ROUNDS,
    spread: Vector | None = None,
    sought: float = np.inf,
) -> FittedModel:
    """Fit a set of effects, from a point that has them; see `Fit.refine`."""
    lin = fit.refine(start, active, rounds, spread, sought=sought)
    return FittedModel(active, lin.point, lin, lin.misfit)


def joined(point: Point, rival: CandidateScore) -> Point:
    """The point with one more effect."""
    placed = sized(point, rival.effect, rival.shape, rival.size)
    if rival.effect.order_locked:
        return replace(placed, phases={**point.phases, rival.effect.name: rival.phases})
    return placed


def sized(point: Point, effect: Effect, shape: Mapping[str, float], size: float) -> Point:
    """The point with an effect of some size and shape, which has no phases."""
    own = {(effect.name, parameter): value for parameter, value in shape.items()}
    own[effect.name, effect.label] = effect.told or size
    return replace(point, sizes={**point.sizes, **own})


def _lacks(model: FittedModel, decides: Thresholds) -> bool:
    """Whether something is missing beside a model: errors that last, or swing beyond the noise."""
    lin = model.linearised
    return float(max(lin.variance_factors.max(), lin.squares.max())) > decides.wrong


def _noise_share(model: FittedModel) -> float:
    """Standard deviation by noise alone, over that by all that is wrong with a model."""
    return float(model.linearised.variance_factors.max() ** -0.5)


def _material(effect: Effect, size: float, sigma: float, *, sure: bool) -> float:
    """Size of an effect over the least that matters.

    Parameters
    ----------
    sigma : standard deviation of the size by noise.
    sure : whether something is missing without it. Then the effect may be that unless its size is
        clearly less, beyond its noise in 95 of 100 sets.
    """
    return (abs(size) + BAND * sigma * sure) / effect.matters


def _predicting(
    scores: Sequence[CandidateScore], best: FittedModel, decides: Thresholds
) -> list[list[CandidateScore]]:
    """Effects that explain each recording from the others, while much is wrong, best first.

    Errors of runs that nothing corrects last as long as these: of all that is wrong few means are
    independent, beside which no size is significant. The fit decides.
    """
    if best.linearised.variance_factors.max() <= decides.wrong:
        return []
    first: dict[str, CandidateScore] = {}
    for score in scores:
        sigma = score.sigma * _noise_share(best)
        material = _material(score.effect, score.size, sigma, sure=True)
        if material >= 1.0 and score.held_out.min() > 0.0:
            first.setdefault(score.effect.name, score)
    return [[score] for score in first.values()][: decides.rivals]


def _rivals(
    scores: Sequence[CandidateScore], best: FittedModel, decides: Thresholds, wrong: float
) -> list[list[CandidateScore]]:
    """Variants, best first, of effects that are large, significant and nearly as good as the best.

    While much is wrong, all is weighed against that, and little is significant: then a hint makes
    a rival, and its fit decides. Phases of an effect that turns explain something of any noise.
    What levels could stand for must be there without any one of the stops, too. Stops held out have
    no unknown of their own but phases: what an effect predicts of them is told by its odds.

    Parameters
    ----------
    wrong : chi-squared of what is wrong. Where few means last, it is small, and so is what an
        effect explains of it: half of it is a hint, however few they are.
    """
    hinted = best.linearised.variance_factors.max() > decides.wrong
    sure = _lacks(best, decides)
    clear = min(decides.hint, np.sqrt(0.5 * wrong)) if hinted else decides.significant
    able: dict[str, list[CandidateScore]] = {}
    for score in scores:
        phases = len(score.phases) if score.effect.order_locked else 0
        needed = 0.0 if hinted else decides.fall_of(1 + phases)
        odds = needed if hinted or phases else decides.tied
        if score.like_levels:
            shown = score.gain > needed and score.least > min(needed, decides.immaterial**2)
        else:
            shown = score.gain > needed and score.held_out.sum() > odds
        significant = abs(score.size) > clear * score.sigma and shown
        sigma = score.sigma * _noise_share(best)
        material = _material(score.effect, score.size, sigma, sure=sure)
        if significant and material >= 1.0:
            able.setdefault(score.effect.name, []).append(score)
    ranked = list(able.values())[: decides.rivals]
    best_score = ranked[0][0].score if ranked else 0.0
    return [candidate for candidate in ranked if candidate[0].score > decides.near * best_score]
