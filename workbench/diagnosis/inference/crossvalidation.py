"""How well a model predicts what it was not fitted to.

Each recording is left out in turn; of a single recording, each of its parts. Source: M. Stone
(1974), J. R. Stat. Soc. B 36, 111-147.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.special import chdtri

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.cleaning import Mask
from workbench.diagnosis.inference.discrepancy import WRONG
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import lasting
from workbench.diagnosis.inference.quadratic import Quadratic, add, covariance, minimum
from workbench.diagnosis.inference.search import FittedModel

_ROUNDS = 3  # of a fit without one part, which begins where all parts were fitted


class CrossValidation:
    """Of fits to one set of recordings."""

    def __init__(self, fit: Fit) -> None:
        self._fit = fit
        self._known: dict[int, tuple[FittedModel, list[Matrix]]] = {}

    def fast(self, before: FittedModel, after: FittedModel) -> bool:
        """Whether blocks, and not means over a lasting time, show what two fits differ by.

        What turns with a shaft does, and what swings so fast that its means are less than itself.
        """
        if any(effect.order_locked for effect in after.active):
            return True
        blocks, means = (
            np.mean([own.mean() for own in self._of_means(after, fast=fast, beside=before)])
            for fast in (True, False)
        )
        return bool(means < blocks)

    def squares(self, fitted: FittedModel, *, fast: bool) -> Vector:
        """Mean square of errors of each recording, fitted to the others, (K,); noise leaves 1.

        Parameters
        ----------
        fast : of blocks instead of means over a lasting time.
        """
        return np.array([squares.mean() for squares in self._of_means(fitted, fast=fast)])

    def where_acting(
        self, less: FittedModel, best: FittedModel, *, fast: bool, whole: bool
    ) -> tuple[float, float]:
        """Mean squares beyond noise that two fits leave, each by how far they differ there.

        What remains where an effect does nothing says nothing of its form, and no more does an
        error of a held-out recording that a fit to the others leaves open, as where it alone shows
        the effect. At least, the form leaves what a fit to all recordings does. A law is wrong by
        `WRONG` at most, unless more remains than noise leaves of that in 95 of 100 sets.

        Parameters
        ----------
        whole : whether the best fit explains all; beside a part of it, all that remains counts.
        """
        before, after = (self._of_means(model, fast=fast) for model in (less, best))
        weights = self._of_means(best, fast=fast, beside=less)
        total = max(sum(weight.sum() for weight in weights), 1e-9)

        def mean(squares: Sequence[Matrix]) -> float:
            pairs = zip(weights, squares, strict=True)
            return float(sum((weight * own).sum() for weight, own in pairs) / total)

        remains, explained = mean(after), mean(before) - 1.0
        if not whole:
            return remains - 1.0, explained
        unsure = mean(self.left_open(best, fast=fast))
        fitted = mean(self._of_means(best, fast=fast, errors=self._fitted(best)))
        left = max(remains - unsure, fitted) - 1.0
        by_form = WRONG**2 * explained
        count = total / max(mean(weights), 1e-9)  # of means that have a weight
        if remains <= (1.0 + unsure + by_form) * float(chdtri(count, 0.05)) / count:
            left = min(left, by_form)
        return left, explained

    def _fitted(self, fitted: FittedModel) -> list[Matrix]:
        """Whitened errors of each recording, or part, as fitted to all of them."""
        errors = [residuals.errors for residuals in fitted.linearised.residuals]
        if self._fit.unknowns.count > 1:
            return errors
        return [errors[0][self._fit.blocks_of(part)] for part in range(self._fit.parts)]

    def left_open(self, fitted: FittedModel, *, fast: bool) -> list[Matrix]:
        """Variance of the means of each recording by what a fit to the others is unsure of.

        Of a single recording, each part is fitted anew, and nothing is known of that.
        """
        span = 1 if fast else fitted.linearised.lasting
        if self._fit.unknowns.count == 1:
            return [np.zeros_like(own) for own in self._of_means(fitted, fast=fast)]
        joint = self._fit.quadratics(self._fit.linearise(fitted.linearised, fitted.active))
        stops, shown = joint.stops(), self._shown(fitted)
        total, variances = add([*stops, joint.prior]), []
        for stop, system, own in zip(stops, joint.systems, shown, strict=True):
            slopes = system.slopes.reshape(-1, system.channels, len(joint.shared))[:, own]
            count = len(slopes) // span * span
            means = slopes[:count].reshape(-1, span, *slopes.shape[1:]).mean(axis=1)
            spread = covariance(total.N - stop.N)
            factors = fitted.linearised.variance_factors[own]
            variances.append(span * factors * np.einsum("gcp,pq,gcq->gc", means, spread, means))
        return variances

    def _of_means(
        self,
        fitted: FittedModel,
        *,
        fast: bool,
        beside: FittedModel | None = None,
        errors: list[Matrix] | None = None,
    ) -> list[Matrix]:
        """Squares of means of each recording; of the difference to another fit, if there is one.

        Parameters
        ----------
        errors : in place of those of recordings that are held out.
        """
        span = 1 if fast else fitted.linearised.lasting
        every = self._held_out(fitted) if errors is None else errors
        if beside is not None:
            pairs = zip(every, self._held_out(beside), strict=True)
            every = [own - other for own, other in pairs]
        return [
            lasting(errors[:, shown], span)
            for errors, shown in zip(every, self._shown(fitted), strict=True)
        ]

    def _held_out(self, fitted: FittedModel) -> list[Matrix]:
        """Whitened errors of each recording, fitted to the others."""
        if id(fitted) not in self._known:
            self._known[id(fitted)] = fitted, self._errors(fitted)
        return self._known[id(fitted)][1]

    def chance(self, fitted: FittedModel, *, fast: bool) -> Vector:
        """Mean square of each recording that noise exceeds as seldom as it raises an alarm, (K,).

        Estimates of noise may be wrong by what `excess` says.
        """
        decides = self._fit.decides
        most = [decides.fall_of(n) / n for n in self._counts(fitted, fast=fast)]
        return (1.0 + decides.excess) * np.array(most)

    def noise_alone(self, fitted: FittedModel, *, fast: bool) -> bool:
        """Whether a fit leaves no more than noise does in 95 of 100 sets."""
        count = sum(self._counts(fitted, fast=fast))
        most = (1.0 + self._fit.decides.excess) * float(chdtri(count, 0.05)) / count
        return float(self.squares(fitted, fast=fast).mean()) <= most

    def _counts(self, fitted: FittedModel, *, fast: bool) -> list[int]:
        """Number of means of which `squares` are, of each recording or part."""
        span = 1 if fast else fitted.linearised.lasting
        shown, parts = self._shown(fitted), self._fit.parts if self._fit.unknowns.count == 1 else 1
        counts = [
            len(recording.errors) // parts // span
            for recording in fitted.linearised.residuals
            for _ in range(parts)
        ]
        return [max(1, n) * int(own.sum()) for n, own in zip(counts, shown, strict=True)]

    def worsened(self, before: FittedModel, after: FittedModel, *, fast: bool) -> list[str]:
        """Recordings that a fit predicts worse than another one does, and not to their noise.

        What the others leave open of a recording is no failure. Parts of a single one are none.
        One effect alone may be a little wrong in form: of errors whose size nobody knows it must
        fail by odds that chance does not turn, (now/was)^(n/2) of n means. Of several, which bend
        to much, each recording must agree.
        """
        if self._fit.unknowns.count == 1:
            return []
        was, now = self.squares(before, fast=fast), self._sure(after, fast=fast)
        if len(after.active) == 1:
            was *= np.exp(self._fit.decides.tied / np.array(self._counts(after, fast=fast)))
        worse = now > np.maximum(was, self.chance(after, fast=fast))
        return [name for name, rises in zip(self._fit.tests, worse, strict=True) if rises]

    def explained(self, less: FittedModel, best: FittedModel, *, fast: bool) -> tuple[float, float]:
        """Share of the explainable by which two fits differ; mean square error of the first."""
        before, after = (float(self.squares(model, fast=fast).mean()) for model in (less, best))
        return float(np.clip((before - after) / max(before - 1.0, 1e-9), 0.0, 1.0)), before

    def removed(self, before: FittedModel, after: FittedModel, *, fast: bool) -> float:
        """Share of the explainable that is gone, but for what a fit to the others leaves open."""
        was, now = self.squares(before, fast=fast).mean(), self._sure(after, fast=fast)
        return float((was - np.maximum(now, 0.0).mean()) / max(was - 1.0, 1e-9))

    def _sure(self, fitted: FittedModel, *, fast: bool) -> Vector:
        """Mean square of each recording, less what a fit to the others leaves open of it, (K,)."""
        unsure = [own.mean() for own in self.left_open(fitted, fast=fast)]
        sure: Vector = self.squares(fitted, fast=fast) - np.array(unsure)
        return sure

    def _shown(self, fitted: FittedModel) -> list[Mask]:
        """Channels that are told, of each recording or part."""
        counted = [residuals.blocks > 0 for residuals in fitted.linearised.residuals]
        return counted * self._fit.parts if self._fit.unknowns.count == 1 else counted

    def _errors(self, fitted: FittedModel) -> list[Matrix]:
        if self._fit.unknowns.count == 1:
            return self._fit.together(partial(self._refitted, fitted), range(self._fit.parts))
        return self._extrapolated(fitted)

    def _refitted(self, fitted: FittedModel, part: int) -> Matrix:
        """Whitened errors of one part, after a fit without it: laws may bend much within one.

        The first part begins as the fit to all parts does: later parts may not tell how, and it
        would be predicted from a start that nobody has seen.
        """
        hidden = self._fit.without(part)
        lin = hidden.refine(hidden.hide(fitted.linearised), fitted.active, _ROUNDS)
        point, unknowns = lin.point, self._fit.unknowns
        if part == 0:
            starts = [name in unknowns.starting for name in unknowns.local]
            seen = np.where(starts, fitted.point.deviations, point.deviations)
            point = replace(point, deviations=seen)
        return self._fit.at(point).residuals[0].errors[self._fit.blocks_of(part)]

    def _extrapolated(self, fitted: FittedModel) -> list[Matrix]:
        """Whitened errors of each recording, by one step from the fit to all of them."""
        joint = self._fit.quadratics(self._fit.linearise(fitted.linearised, fitted.active))
        stops = joint.stops()
        total = add([*stops, joint.prior])
        errors = []
        for stop, system in zip(stops, joint.systems, strict=True):
            z = minimum(Quadratic(total.N - stop.N, total.g - stop.g, total.c - stop.c, 0))
            errors.append(system.errors(z) * np.sqrt(fitted.linearised.variance_factors))
        return errors
