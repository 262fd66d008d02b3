"""Sets of effects in place of all causes: which few explain most, by derivatives about these."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.effects.catalogue import Effect, variant
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import minima_of
from workbench.diagnosis.inference.score_test import ScoreTest
from workbench.diagnosis.inference.search import (
    FittedModel,
    differentiable,
    fitted,
    sized,
    without,
)

_FITTED = 3  # sets of each size, of the likeliest: it costs time only


class _Member(NamedTuple):
    """An effect or another change that may be one of several."""

    effect: Effect
    shape: Mapping[str, float]  # to begin a fit with; empty of a cause, which has its own
    at: int  # of its size among the unknowns


class Sets:
    """Sets of changes and effects in place of all causes, as derivatives about these have them.

    Parameters
    ----------
    best, trial : the causes, and all else about them.
    required : effects or changes of which each set has one or more; None: any will do.
    """

    def __init__(
        self, best: FittedModel, trial: ScoreTest, required: Sequence[Effect] | None = None
    ) -> None:
        keys = [key for key in trial.joint.shared if key not in trial.levels]
        causes = [_Member(e, {}, keys.index((e.name, e.label))) for e in best.active]
        others = [
            _Member(effect, shape, keys.index((variant(effect, shape), effect.size)))
            for effect, shape in trial.candidates
        ]
        self._able = [m for m in (*causes, *others) if not m.effect.order_locked]
        self._best = best
        self._required = None if required is None else {effect.name for effect in required}
        self._N, g = trial.joint.reduced(keys)
        removed = np.zeros(len(keys))
        for cause in causes:
            removed[cause.at] = -best.point.sizes[keys[cause.at]]
        self._slope = g + self._N @ removed
        self._explained = float((g + self._slope) @ removed)  # chi-squared, by the causes

    def fits(self, fit: Fit, count: int) -> list[FittedModel]:
        """Fits of the sets of so many that explain most."""
        begun = fit.together(
            partial(_begun, fit, self._best), self._likeliest(count, fit.decides.near)
        )
        return [model for model in begun if model is not None]

    def _likeliest(self, count: int, near: float) -> list[tuple[tuple[_Member, ...], Vector]]:
        """Sets of so many that explain most, a share of what causes do or more, and their sizes."""
        sets = [members for members in combinations(self._able, count) if self._allowed(members)]
        at = np.array([[member.at for member in members] for members in sets], np.intp)
        sizes, falls = minima_of(self._N, self._slope, at.reshape(-1, count))
        first = np.argsort(-falls)[:_FITTED]
        return [(sets[k], sizes[k]) for k in first if falls[k] > near * self._explained]

    def _allowed(self, members: Sequence[_Member]) -> bool:
        """Whether none stands twice, and some are of those that are required."""
        names = {member.effect.name for member in members}
        required = self._required is None or not names.isdisjoint(self._required)
        return required and len(names) == len(members)


def _begun(
    fit: Fit, best: FittedModel, item: tuple[Sequence[_Member], Vector]
) -> FittedModel | None:
    """Fit a set in place of all causes, begun where derivatives have it; None: no model has it."""
    members, sizes = item
    active, point = tuple(member.effect for member in members), best.point
    for effect in best.active:
        point = point if effect in active else without(point, effect)
    for member, size in zip(members, sizes, strict=True):
        low, high = fit.unknowns.bounds(member.effect, member.effect.size)
        point = sized(point, member.effect, member.shape, float(np.clip(size, low, high)))
    start = fit.tried(point)
    if start is None:
        return None
    spread, sought = best.linearised.spread, best.linearised.deviance + fit.decides.form
    return differentiable(partial(fitted, fit, start, active, spread=spread, sought=sought))
