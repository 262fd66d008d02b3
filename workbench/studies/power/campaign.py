"""Chances that a campaign of recordings shows effects, before a recording is made."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chndtrinc
from scipy.stats import ncx2

from workbench.diagnosis import Diagnosis, Effect
from workbench.diagnosis.inference.thresholds import Thresholds, of_system
from workbench.studies.power.diagnosing import diagnose_set
from workbench.studies.power.planting import Plantable, Planting
from workbench.studies.power.run import PowerStudy

SURE = 0.95  # chance from which on a size is called found


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
