"""Nuisance parameters that are far from their sheet, and effects that they hide.

A calibrated level takes whatever its signature takes: an effect with the same one is never found
beside it. That is said, and where a level stands for more of such an effect than matters.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from workbench.diagnosis.effects.catalogue import Effect, variant
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Joint, Quadratic, beside, minimum
from workbench.diagnosis.inference.score_test import ScoreTest, shapes
from workbench.diagnosis.inference.search import FittedModel
from workbench.diagnosis.inference.unknowns import SENSOR
from workbench.system.units import with_unit


@dataclass(frozen=True)
class ShiftedLevel:
    """A nuisance parameter that is further from its sheet than declared, or hides an effect."""

    # name, choice: of the parameter, and of the condition that it is calibrated by
    name: str
    choice: str
    # value, sheet: as calibrated, and as conditions or the model say, in `unit`
    value: float
    sheet: float
    unit: str
    # relative standard deviation by the system file; None where it declares none, or the sheet's
    # value is zero
    declared: float | None
    free: bool  # whether nothing is expected of it, as [diagnosis.levels] gives no spread
    hides: tuple[str, ...]  # effects that these recordings cannot tell from it

    @property
    def text(self) -> str:
        """What it is, how far from its sheet, and what follows, for people."""
        away = self.value - self.sheet
        way = "above" if away > 0.0 else "below"
        by = f"{abs(away / self.sheet):.0%}" if self.sheet else with_unit(abs(away), self.unit)
        declared = (
            "" if self.declared is None else f", declared as ±{with_unit(self.declared, '1')} of it"
        )
        level = (
            f"{self.name} ({self.choice})" if self.choice not in ("all", "sensor") else self.name
        )
        text = (
            f"{level} is {with_unit(self.value, self.unit)}, {by} {way} its data sheet of "
            f"{with_unit(self.sheet, self.unit)}{declared}"
        )
        if not self.hides:
            return (
                f"{text}. Check the data sheet: no effect explains it as this nuisance parameter "
                "does."
            )
        effects = " and ".join(self.hides)
        return f"{text}; {effects} is indistinguishable from it. To do: {remedy(free=self.free)}."


def remedy(*, free: bool) -> str:
    """What has an effect considered that a level hides, of which a spread is known or not."""
    if free:
        return "give its spread in [diagnosis.levels], or take it out there, and diagnose again"
    return "take it out of [diagnosis.levels], or measure it, and diagnose again"


def hidden_effects(
    fit: Fit, trial: ScoreTest, catalogue: Sequence[Effect]
) -> dict[str, dict[str, float]]:
    """Effects that a nuisance parameter hides: by it, how much of it one unit of their size is.

    Of what recordings say of a size, all but that share of `twin` is lost when the parameter is
    fitted beside all others; without it the size that matters would be significant. What is
    significant from less on than the spread of the parameter stands for is not hidden.
    """
    joint, N = trial.joint, trial.joint.total().N
    own: dict[str, list[int]] = {}
    for key in trial.levels:
        own.setdefault(key[0], []).append(joint.shared.index(key))
    every = [j for at in own.values() for j in at]
    sizes = [j for j, key in enumerate(joint.known) if key not in trial.levels]
    known = [*sizes, *every]
    left = np.diag(beside(N, known))
    without = {
        name: np.diag(beside(N, [j for j in known if j not in at])) for name, at in own.items()
    }
    hidden: dict[str, dict[str, float]] = {}
    for effect in (effect for effect in catalogue if not effect.order_locked):
        keys = [(variant(effect, shape), effect.size) for shape in shapes(effect)]
        columns = [joint.shared.index(key) for key in keys if key in joint.shared]
        if not columns or (effect.name, effect.label) in joint.known:
            continue
        for name, at in own.items():
            before = without[name][columns]
            shows = before.max() > (fit.decides.significant / effect.matters) ** 2
            if shows and (left[columns] < 2.0 * fit.decides.twin * before).all():
                column = columns[int(np.argmax(before))]
                taken = minimum(
                    Quadratic(N[np.ix_(known, known)], -N[known, column], 0.0, 0)
                )  # N_kk^-1 N_kj
                share = float(max((taken[known.index(j)] for j in at), key=abs))
                least = fit.decides.significant / np.sqrt(max(left[column], 1e-300))
                spreads = [fit.unknowns.expected(joint.shared[j])[1] for j in at] if name else []
                if not np.isfinite(spreads).all() or abs(share) * least > max(spreads, default=0.0):
                    hidden.setdefault(name, {})[effect.name] = share
    return hidden


def hidden_by_starts(
    fit: Fit, trial: ScoreTest, catalogue: Sequence[Effect]
) -> dict[str, tuple[str, ...]]:
    """Effects that the starts of a state hide, by that state: each recording has its own.

    As of `hidden_effects`; of those alone that would show by the size that matters if the start
    were known, and do not show now.
    """
    joint, known = trial.joint, list(range(len(trial.joint.known)))
    if fit.unknowns.count < 2:  # what one recording has of its own stands among the levels
        return {}
    spreads = fit.unknowns.stated_starts
    starts = {name: j for j, name in enumerate(fit.unknowns.local) if name in spreads}
    left = np.diag(beside(joint.total().N, known))
    without = {
        name: np.diag(beside(_without_own(joint, j).total().N, known)) for name, j in starts.items()
    }
    hidden: dict[str, tuple[str, ...]] = {}
    for effect in (effect for effect in catalogue if not effect.order_locked):
        keys = [(variant(effect, shape), effect.size) for shape in shapes(effect)]
        columns = [joint.shared.index(key) for key in keys if key in joint.shared[len(known) :]]
        needed = (fit.decides.significant / effect.matters) ** 2
        if not columns or left[columns].max() > needed:
            continue
        taken = {
            name: float(before[columns].max())
            for name, before in without.items()
            if effect.model != name  # another start in all recordings
            and before[columns].max() > needed
            and (left[columns] < 2.0 * fit.decides.twin * before[columns]).all()
        }
        if taken:
            name = max(taken, key=taken.__getitem__)
            hidden[name] = (*hidden.get(name, ()), effect.name)
    return hidden


def _without_own(joint: Joint, j: int) -> Joint:
    """Stops of which an unknown of their own, number j, is known."""
    systems = tuple(
        replace(
            system,
            P=np.delete(system.P, j, axis=1),
            deviations=np.delete(system.deviations, j),
            furthest=np.delete(system.furthest, j),
            held=None if system.held is None else np.delete(system.held, j),
        )
        for system in joint.systems
    )
    return replace(joint, systems=systems)


def shifted_levels(
    fit: Fit,
    best: FittedModel,
    trial: ScoreTest,
    catalogue: Sequence[Effect],
    hidden: dict[str, dict[str, float]],
) -> tuple[ShiftedLevel, ...]:
    """Nuisance parameters that are far from their sheet, beyond chance.

    By chi-squared at the rate of false alarms that the system allows, all of them together; or by
    more than matters of an effect that is hidden, and significantly.

    Parameters
    ----------
    hidden : see `hidden_effects`.
    """
    matters = {effect.name: effect.matters for effect in catalogue}
    sigmas = np.sqrt(np.diag(trial.covariance()))
    levels = {key: v for key, v in best.point.levels.items() if key[1] != SENSOR}
    limit = chdtri(1, fit.unknowns.false_alarms / max(1, len(levels)))
    shifted = []
    for key, value in levels.items():
        sheet, declared = fit.unknowns.sheet(key)
        sigma = float(sigmas[trial.joint.known.index(key)])
        away = float(value) - sheet
        hides = tuple(hidden.get(key[0], {}))
        far = np.isfinite(declared) and away**2 > limit * (sigma**2 + declared**2)
        stands = abs(away) > fit.decides.significant * sigma and any(
            abs(away) > abs(share) * matters[name] for name, share in hidden.get(key[0], {}).items()
        )
        if far or stands:
            unit = fit.unknowns.level_unit(key)
            known = declared / abs(sheet) if np.isfinite(declared) and sheet else None
            free = not np.isfinite(fit.unknowns.expected(key)[1])
            shifted.append(ShiftedLevel(*key, float(value), sheet, unit, known, free, hides))
    return tuple(shifted)
