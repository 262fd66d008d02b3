"""How sure the sizes of causes are, asked of chi-squared itself and not of its derivatives.

A size is held beside its best value while all else is fitted anew: where chi-squared rises less to
one side, an interval reaches further there. And the model is fitted from elsewhere: where that ends
otherwise, there is more than one minimum. Sources: D. J. Venzon, S. H. Moolgavkar (1988), Appl.
Statist. 37, 87-94 (profile likelihood); A. Raue et al. (2013), PLoS ONE 8, e74335 (many starts).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint, Point
from workbench.diagnosis.inference.quadratic import Key
from workbench.diagnosis.inference.search import ROUNDS, FittedModel, differentiable, fitted
from workbench.runtime.engine import Reporter
from workbench.system.units import BAND

_STARTS = 4  # of fits from elsewhere, each of which costs as much as a step of the search
_TIMES = (-1.0, 3.0)  # what was found, of a size at such a start: as far as twice itself away
_SHAPES = (0.5, 2.0)  # likewise of a shape, which keeps its sign
OWN = "by recording"  # what differs from one to the other
_LITTLE = 1.0  # rise of chi-squared from which the end of an interval would be a guess

Ends = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Certainty:
    """What fits beside the best one say of it."""

    # that all recordings share: sizes of causes, levels; then what differs between them, which they
    # share in the mean
    unknowns: tuple[Key, ...]
    correlations: Matrix  # (p, p) of their errors, as noise makes them
    # of each size, where chi-squared has risen by what chance exceeds in 5 of 100, to both sides
    # [SI]; None where it does not, within the bounds of the size
    ends: Mapping[Key, Ends]
    # chi-squared that each fit from elsewhere leaves beyond the best; None of one that could not be
    # begun, or led to no derivative
    behind: tuple[float | None, ...]
    tolerance: float  # of `behind`, within which fits end at the same minimum

    @property
    def same(self) -> int:
        """Fits from elsewhere that ended where the best one did."""
        return sum(
            distance is not None and abs(distance) <= self.tolerance for distance in self.behind
        )

    @property
    def lower(self) -> float:
        """By how much the lowest of them is below the best fit, 0 if none is."""
        least = min((distance for distance in self.behind if distance is not None), default=0.0)
        return max(0.0, -least) if least < -self.tolerance else 0.0

    @property
    def sentence(self) -> str:
        """What the starts say, for people.

        >>> nothing = ((), np.zeros((0, 0)), {})
        >>> Certainty(*nothing, behind=(0.1, 0.0), tolerance=1.0).sentence
        'Multi-start: 2 of 2 fits reached the same optimum.'
        >>> Certainty(*nothing, behind=(0.1, 812.0, None), tolerance=1.0).sentence
        'Multi-start: 1 of 3 fits reached the same optimum, none lower.'
        >>> Certainty(*nothing, behind=(0.1, -40.0), tolerance=1.0).sentence
        'Multi-start: 1 of 2 fits reached the same optimum, one lower by 40: sizes may be others.'
        """
        all_the_same = self.same == len(self.behind)
        lower = f", one lower by {self.lower:.0f}: sizes may be others"
        more = "" if all_the_same else lower if self.lower else ", none lower"
        return (
            f"Multi-start: {self.same} of {len(self.behind)} fits reached the same optimum{more}."
        )

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts."""
        return {
            "unknowns": [" ".join(key) for key in self.unknowns],
            "correlations": self.correlations.tolist(),
            "likelihood": {
                " ".join(key): {"low": low, "high": high} for key, (low, high) in self.ends.items()
            },
            "starts": {
                "behind": list(self.behind),
                "same": self.same,
                "lower": self.lower,
                "sentence": self.sentence,
            },
        }


def assess(fit: Fit, best: FittedModel, report: Reporter) -> Certainty:
    """Ask how sure the sizes of a fit are."""
    report("sizes held, and fits from elsewhere")
    # A fit ends where a step is not worth one: the last of it would be missing in every rise.
    lin = fit.linearise(fit.refine(best.linearised, best.active, 1), best.active)
    joint = fit.quadratics(replace(lin, variance_factors=lin.spread))
    spread = joint.covariance()
    sigma = np.sqrt(np.diag(spread))
    reach = {key: BAND * float(sigma[joint.shared.index(key)]) for key in lin.point.sizes}
    sides = [(key, sign * far) for key, far in reach.items() for sign in (-1.0, 1.0)]
    starts = _elsewhere(fit, lin.point)
    ends = fit.together(partial(_end, fit, best, lin), sides)
    behind = fit.together(partial(_behind, fit, best, lin), starts)
    return Certainty(
        unknowns=(*joint.shared, *((name, OWN) for name in fit.unknowns.local)),
        correlations=spread / np.outer(sigma, sigma),
        ends=dict(zip(lin.point.sizes, zip(ends[::2], ends[1::2], strict=True), strict=True)),
        behind=tuple(behind),
        # Either may be short of the minimum by a step that is not worth one.
        tolerance=2.0 * fit.decides.worse,
    )


def _bounds(fit: Fit, key: Key) -> tuple[float, float]:
    """Least and greatest value of a size or shape, SI."""
    effect = fit.unknowns.effects[key[0]]
    return fit.unknowns.bounds(effect, effect.size if key[1] == effect.label else key[1])


def _end(
    fit: Fit, best: FittedModel, lin: LinearizedPoint, side: tuple[Key, float]
) -> float | None:
    """Where chi-squared has risen as far as 95 % allow; held there as the derivatives have it."""
    (key, step), value = side, lin.point.sizes[side[0]]
    low, high = _bounds(fit, key)
    tried = float(np.clip(value + step, low, high))
    held = {key: tried}
    start = fit.tried(fit.stepped(lin, lin.spread, held).point)
    if start is None or tried == value:
        return None
    # Begun where the derivatives have the least, one step more is enough.
    refined = differentiable(partial(fit.refine, start, best.active, 1, held=held))
    if refined is None or (rise := refined.deviance - lin.deviance) < _LITTLE:
        return None
    end = value + (tried - value) * BAND / float(np.sqrt(rise))
    return end if low <= end <= high else None


def _elsewhere(fit: Fit, point: Point) -> Sequence[Point]:
    """Points that know nothing but the causes: levels as usual, sizes and phases by chance."""
    rng = np.random.default_rng(0)
    starts = []
    for _ in range(_STARTS):
        sizes = {}
        for key, value in point.sizes.items():
            effect = fit.unknowns.effects[key[0]]
            of_size = key[1] in (effect.label, *effect.sizes)
            times = rng.uniform(*_TIMES) if of_size else np.exp(rng.uniform(*np.log(_SHAPES)))
            sizes[key] = float(np.clip(value * times, *_bounds(fit, key)))
        phases = {
            name: rng.uniform(-np.pi, np.pi, size=phase.shape)
            for name, phase in point.phases.items()
        }
        starts.append(replace(fit.unknowns.start(), sizes=sizes, phases=phases))
    return starts


def _behind(fit: Fit, best: FittedModel, lin: LinearizedPoint, point: Point) -> float | None:
    """Chi-squared that a fit from a point leaves beyond the best."""
    start = fit.tried(point)
    if start is None:
        return None
    refitted = differentiable(partial(fitted, fit, start, best.active, rounds=ROUNDS))
    return None if refitted is None else refitted.linearised.deviance - lin.deviance
