"""Chances that a campaign of recordings shows effects, before a recording is made."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chndtrinc

from workbench.arrays import Matrix
from workbench.diagnosis import Diagnosis, Effect
from workbench.diagnosis.effects.catalogue import variant
from workbench.diagnosis.inference.quadratic import Joint, beside
from workbench.diagnosis.inference.score_test import shapes
from workbench.diagnosis.inference.thresholds import Thresholds, of_system
from workbench.errors import InputError
from workbench.recordings.case import Case
from workbench.studies.power.planting import Plantable, Planting, Repertoire, Scale
from workbench.studies.power.run import PowerStudy, Setup, diagnose_set, information_of_set

SURE = 0.95  # chance from which on a size is called found
_ALIKE = 1e-9  # share of a signature that is rounding: the other has the same
_LACKING = "lacking"  # in place of a parameter, of an effect that the catalogue lacks


@dataclass(frozen=True)
class EffectChance:
    """What a campaign would show of one effect."""

    # effect, unit: of the library, and of its sizes, SI
    effect: str
    unit: str
    matters: float  # least size that is worth a finding [unit]
    # standard deviation of its estimate [unit]; None where the campaign cannot show it
    sigma: float | None
    chances: tuple[tuple[float, float], ...]  # (size, chance that it is named) [unit, 1]
    # size from which on it is named with the chance `SURE` [unit]; None as `sigma`
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
    """
    with study.setup() as setup:
        clean = Planting("clean", seed, 0.0, {}, ())
        cases = setup.record(clean, study.rig.simulate(seed, {}))
        diagnosis = diagnose_set(setup.problem_of(cases), setup.everything)
    decides = of_system(study.system.comparison, len(study.effects))
    known = {effect.name: effect for effect in study.effects}
    return [
        _effect_chance(known[plantable.effect], plantable, diagnosis, sizes, decides)
        for plantable in wanted
        if plantable.effect in known
    ]


@dataclass(frozen=True)
class EffectLimit:
    """The least that recordings can show of one effect, whatever the diagnosis."""

    # effect, unit: of the library, or of the rig where the library lacks it; of its sizes, SI
    effect: str
    unit: str
    # standard deviation of its size by the exact model, which knows that nothing else is missing
    # [unit]; None where recordings cannot show it
    sigma: float | None
    # size from which on it is significant with the chance `SURE` [unit]; None as `sigma`
    found: float | None
    like: str  # the effect whose signature is most like its own; empty as `sigma`
    # size from which on it is told from that one as surely [unit]; None where none is
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
    """
    names = {effect.name for effect in study.effects}
    repertoire = study.repertoire
    with study.setup() as setup:
        clean = Planting("clean", seed, 0.0, {}, ())
        cases = setup.record(clean, study.rig.simulate(seed, {}))
        others = {
            (plantable.name, _LACKING): _changed(setup, plantable.name, size, seed)
            for plantable in wanted
            if plantable.effect not in names and np.isfinite(size := repertoire.size(plantable))
        }
        joint, effects = information_of_set(setup.problem_of(cases), setup.everything, others)
    at = _columns_of_effects(effects, joint)
    at |= {name: [[joint.shared.index((name, _LACKING))]] for name, _ in others}
    left = beside(joint.total().N, range(len(joint.known)))
    multiple = clear(1, of_system(study.system.comparison, len(study.effects)))
    return [_limit(plantable, at, left, effects, multiple) for plantable in wanted]


def _changed(setup: Setup, name: str, size: float, seed: int) -> tuple[float, list[Case]]:
    """Size of one effect of the rig, and recordings with it."""
    planting = Planting("outside", seed, 1.0, {name: size}, ("",))
    return size, setup.record(planting, setup.rig.simulate(seed, planting.gains))


def _limit(
    plantable: Plantable,
    at: Mapping[str, list[list[int]]],
    left: Matrix,
    effects: Sequence[Effect],
    multiple: float,
) -> EffectLimit:
    name = plantable.effect if plantable.effect in at else plantable.name
    if name not in at:
        return EffectLimit(plantable.effect or name, plantable.unit, None, None, "", None)
    own = _of_shape(at[name], plantable, effects)
    information = float(np.trace(left[np.ix_(own, own)]))
    if not information > 0.0:
        return EffectLimit(name, plantable.unit, None, None, "", None)
    sigma = float(np.sqrt(len(own) / information))
    differences = {
        other: min(_unlike(left, own, columns) for columns in variants)
        for other, variants in at.items()
        if other != name
    }
    like = min(differences, key=lambda other: differences[other], default="")
    discriminated = None
    if like and differences[like] > _ALIKE:
        discriminated = multiple * sigma / float(np.sqrt(differences[like]))
    return EffectLimit(name, plantable.unit, sigma, multiple * sigma, like, discriminated)


ORACLE = "an oracle's standard deviation"


def by_oracle(
    study: PowerStudy, wanted: Sequence[Plantable], sizes: Sequence[float], seed: int
) -> Repertoire:
    """What can be planted, with sizes in standard deviations of what an oracle knows of them.

    What recordings cannot show is left out. A finding is expected from the size on that an oracle
    finds with the chance `SURE`.

    Parameters
    ----------
    sizes : that will be planted [standard deviations].
    """
    limits = limits_of_effects(study, wanted, seed)
    planted = tuple(
        replace(plantable, unit_size=limit.sigma)
        for plantable, limit in zip(wanted, limits, strict=True)
        if limit.sigma is not None
    )
    if not planted:
        raise InputError(
            where="command line, --sigmas",
            found="recordings that can show none of these effects",
            expected="one effect or more with a finite standard deviation",
            remedy="name others by --effects, or other recordings by --case",
        )
    decides = of_system(study.system.comparison, len(study.effects))
    chances = {f"{size:g}": chance(size, 1, decides) for size in sizes}
    scale = Scale(ORACLE, clear(1, decides), chances)
    return replace(study.repertoire, plantables=planted, scale=scale)


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
    if len(variants) == 1:
        return variants[0]
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
    score = planted.score_of(diagnosis)
    if score is None:
        return EffectChance(effect.name, planted.unit, effect.matters, None, (), None)
    unknowns = 1 + len(score.phases) * effect.order_locked
    return EffectChance(
        effect=effect.name,
        unit=planted.unit,
        matters=effect.matters,
        sigma=score.sigma,
        chances=tuple((s, chance(s / score.sigma, unknowns, decides)) for s in absolute),
        least=max(effect.matters, score.sigma * clear(unknowns, decides)),
    )


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
    from scipy.stats import ncx2  # takes its time, and little else needs it

    return float(ncx2.sf(decides.fall_of(unknowns), unknowns, distance**2))


def clear(unknowns: int, decides: Thresholds) -> float:
    """Size from which on an effect is found with the chance `SURE` [standard deviations]."""
    return float(np.sqrt(chndtrinc(decides.fall_of(unknowns), unknowns, 1.0 - SURE)))
