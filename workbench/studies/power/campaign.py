"""Chances that a campaign of recordings shows effects, before a recording is made."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chndtrinc
from scipy.stats import ncx2

from workbench.arrays import Matrix
from workbench.diagnosis import Diagnosis, Effect
from workbench.diagnosis.effects.catalogue import variant
from workbench.diagnosis.inference.quadratic import Joint, beside
from workbench.diagnosis.inference.score_test import shapes
from workbench.diagnosis.inference.thresholds import Thresholds, of_system
from workbench.studies.power.diagnosing import diagnose_set, information_of_set
from workbench.studies.power.planting import Plantable, Planting
from workbench.studies.power.run import PowerStudy

SURE = 0.95  # chance from which on a size is called found
_ALIKE = 1e-9  # share of a signature that is rounding: the other has the same


@dataclass(frozen=True)
class EffectChance:
    """What a campaign would show of one effect.

    Attributes
    ----------
    effect, unit : of the library, and of its sizes, SI.
    matters : least size that is worth a finding [unit].
    sigma : standard deviation of its estimate [unit]; None where the campaign cannot show it.
    chances : (size, chance that it is named) [unit, 1].
    least : size from which on it is named with the chance `SURE` [unit]; None as `sigma`.
    """

    effect: str
    unit: str
    matters: float
    sigma: float | None
    chances: tuple[tuple[float, float], ...]
    least: float | None


def predict_campaign(
    study: PowerStudy, wanted: Sequence[Plantable], sizes: Sequence[float], seed: int
) -> list[EffectChance]:
    """Chances that effects are named, from one set of recordings without any.

    Parameters
    ----------
    study : whose rig makes the recordings of the campaign.
    wanted : those that the campaign is asked for.
    sizes : multiples of what matters.
    seed : of the machine's tolerances and the sensors' noise.

    Raises
    ------
    InputError
        If a model or the library is not what it should be.
    """
    with study.setup() as setup:
        clean = Planting("clean", seed, 0.0, {}, ())
        cases = setup.record(clean, study.rig.simulate(seed, {}))
        diagnosis = diagnose_set(setup.system, setup.effects, setup.everything, cases)
    decides = of_system(study.system.comparison, len(study.effects))
    known = {effect.name: effect for effect in study.effects}
    return [
        _effect_chance(known[plantable.effect], plantable, diagnosis, sizes, decides)
        for plantable in wanted
        if plantable.effect in known
    ]


@dataclass(frozen=True)
class EffectLimit:
    """The least that recordings can show of one effect, whatever the diagnosis.

    Attributes
    ----------
    effect, unit : of the library, and of its sizes, SI.
    sigma : standard deviation of its size by the exact model, which knows that nothing else is
        missing [unit]; None where recordings cannot show it.
    found : size from which on it is significant with the chance `SURE` [unit]; None as `sigma`.
    like : the effect whose signature is most like its own; empty as `sigma`.
    told : size from which on it is told from that one as surely [unit]; None where none is.
    """

    effect: str
    unit: str
    sigma: float | None
    found: float | None
    like: str
    told: float | None


def limits_of_effects(
    study: PowerStudy, wanted: Sequence[Plantable], seed: int
) -> list[EffectLimit]:
    """What an oracle could tell: the information of a set in one effect beside all tolerances.

    By Cramer and Rao no unbiased estimate has less variance than the inverse of the information
    (H. Cramer 1946, Mathematical Methods of Statistics, section 32.3). Of what one effect does, all
    but 1 - c^2 is done by another whose signature has the cosine c with its own, beside tolerances.

    Parameters
    ----------
    study : whose rig makes the recordings.
    wanted : effects that are asked for.
    seed : of the machine's tolerances and the sensors' noise.

    Raises
    ------
    InputError
        If a model or the library is not what it should be.
    """
    with study.setup() as setup:
        clean = Planting("clean", seed, 0.0, {}, ())
        cases = setup.record(clean, study.rig.simulate(seed, {}))
        joint = information_of_set(setup.system, setup.effects, setup.everything, cases)
    at = _columns_of_effects(study.effects, joint)
    left = beside(joint.total().N, range(len(joint.known)))
    decides = of_system(study.system.comparison, len(study.effects))
    multiple = clear(1, decides)
    limits = []
    for plantable in wanted:
        if plantable.effect not in at:
            if any(effect.name == plantable.effect for effect in study.effects):
                limits.append(EffectLimit(plantable.effect, plantable.unit, None, None, "", None))
            continue
        own = _of_shape(at[plantable.effect], plantable, study.effects)
        sigma = len(own) / float(np.trace(left[np.ix_(own, own)]))
        sigma = float(np.sqrt(sigma))
        differences = {
            name: min(_unlike(left, own, other) for other in variants)
            for name, variants in at.items()
            if name != plantable.effect
        }
        like = min(differences, key=lambda name: differences[name], default="")
        least = (
            multiple * sigma / np.sqrt(differences[like])
            if like and differences[like] > _ALIKE
            else None
        )
        limits.append(
            EffectLimit(plantable.effect, plantable.unit, sigma, multiple * sigma, like, least)
        )
    return limits


def _columns_of_effects(effects: Sequence[Effect], joint: Joint) -> dict[str, list[list[int]]]:
    """Columns of each effect that recordings show, of each of its shapes."""
    places = {key: j for j, key in enumerate(joint.shared)}
    at: dict[str, list[list[int]]] = {}
    for effect in effects:
        for shape in shapes(effect):
            own = [places.get((variant(effect, shape), name), -1) for name in effect.sizes]
            if min(own) >= 0:
                at.setdefault(effect.name, []).append(own)
    return at


def _of_shape(
    variants: Sequence[list[int]], planted: Plantable, effects: Sequence[Effect]
) -> list[int]:
    """Columns of an effect in the shape that the rig has, or else in its middle one."""
    effect = next(effect for effect in effects if effect.name == planted.effect)
    forms = shapes(effect)
    index = forms.index(dict(planted.shapes)) if dict(planted.shapes) in forms else len(forms) // 2
    return variants[index]


def _unlike(N: Matrix, own: Sequence[int], other: Sequence[int]) -> float:
    """Share of what recordings say of an effect that another one does not take."""
    taken = np.linalg.lstsq(N[np.ix_(other, other)], N[np.ix_(other, own)], rcond=None)[0]
    whole = float(np.trace(N[np.ix_(own, own)]))
    return float(1.0 - np.trace(N[np.ix_(own, other)] @ taken) / max(whole, 1e-300))


def _effect_chance(
    effect: Effect,
    planted: Plantable,
    diagnosis: Diagnosis,
    sizes: Sequence[float],
    decides: Thresholds,
) -> EffectChance:
    absolute = [factor * effect.matters for factor in sizes]
    for score in diagnosis.scores:
        if score.effect.name == effect.name and dict(score.shape) == dict(planted.shapes):
            unknowns = 1 + len(score.phases) * effect.order_locked
            return EffectChance(
                effect=effect.name,
                unit=planted.unit,
                matters=effect.matters,
                sigma=score.sigma,
                chances=tuple((s, chance(s / score.sigma, unknowns, decides)) for s in absolute),
                least=max(effect.matters, score.sigma * clear(unknowns, decides)),
            )
    return EffectChance(effect.name, planted.unit, effect.matters, None, (), None)


def chance(distance: float, unknowns: int, decides: Thresholds) -> float:
    """Chance that an effect is significant.

    By what it lowers chi-squared is non-central chi-squared, of as many degrees of freedom as it
    has unknowns (S. S. Wilks, 1938; A. Wald, 1943, Trans. Amer. Math. Soc. 54, 426-482).

    Parameters
    ----------
    distance : size over the standard deviation of its estimate.
    unknowns : size, and phases of an effect that turns.

    Examples
    --------
    What stands at the threshold itself is found in every other set:

    >>> from workbench.diagnosis.inference.thresholds import thresholds
    >>> decides = thresholds(28)
    >>> round(chance(decides.significant, 1, decides), 3), round(chance(0.0, 1, decides), 6)
    (0.5, 7.1e-05)
    """
    return float(ncx2.sf(decides.fall_of(unknowns), unknowns, distance**2))


def clear(unknowns: int, decides: Thresholds) -> float:
    """Size from which on an effect is found with the chance `SURE` [standard deviations]."""
    return float(np.sqrt(chndtrinc(decides.fall_of(unknowns), unknowns, 1.0 - SURE)))
