"""Parameters that differ between recordings, where the system file holds them equal.

A resistance is warm on one day, a valve is set anew. Held equal, such a parameter leaves errors
that no effect explains, and causes bend to them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.effects.candidates import CHANGE
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint, slowness
from workbench.diagnosis.inference.quadratic import Joint, add, minimum
from workbench.diagnosis.inference.search import FittedModel
from workbench.diagnosis.inference.unknowns import SENSOR

_FEWEST = 3  # recordings: whatever sets two of them apart, any parameter may stand for
_MOST = 0.5  # share of what remains from which on a parameter is told: no other explains as much


@dataclass(frozen=True)
class DifferingParameter:
    """A parameter of which own values in each recording explain most of what remains."""

    name: str
    deviation: float  # standard deviation of the values, relative to the common one
    removed: float  # share of the systematic squared error

    @property
    def text(self) -> str:
        """What it would explain, and what to do, for people."""
        return (
            f"If {self.name} differed between recordings, by {self.deviation:.2g} of its value "
            f"(standard deviation), that would explain {self.removed:.0%} of what remains. If it "
            f"may, write {self.name} = {self.deviation:.2g} in [diagnosis.tolerances], and "
            "diagnose again."
        )


def differing_parameter(fit: Fit, best: FittedModel, joint: Joint) -> DifferingParameter | None:
    """Find the parameter whose own values in each recording explain most of what a fit leaves.

    Each parameter that is held equal gets a change of its own in each recording, beside all that is
    fitted. Linearised, so that it may not change by more than itself.
    Source: N. M. Laird, J. H. Ware (1982), Random-effects models for longitudinal data, Biometrics
    38, 963-974.

    Parameters
    ----------
    joint : all recordings about the fit, with candidates.

    Returns
    -------
    That parameter; None if none explains more than half.
    """
    if fit.unknowns.count < _FEWEST:
        return None
    lin, still = best.linearised, [np.zeros(len(joint.shared))] * fit.unknowns.count
    before = _systematic(fit, lin, joint, still)
    told = []
    for name, (value, columns) in _held_equal(fit, best, joint).items():
        changes, steps = _own_changes(joint, columns, abs(value))
        removed = 1.0 - _systematic(fit, lin, joint, steps) / max(before, 1e-9)
        if removed > _MOST and np.abs(changes).max() < abs(value):
            deviation = float(changes.std(ddof=1) / abs(value + changes.mean()))
            told.append(DifferingParameter(name, deviation, removed))
    return max(told, key=lambda parameter: parameter.removed, default=None)


def _held_equal(fit: Fit, best: FittedModel, joint: Joint) -> dict[str, tuple[float, list[int]]]:
    """Value and columns, of which each recording has one, of parameters, by name."""
    held: dict[str, tuple[float, list[int]]] = {}
    for j, key in enumerate(joint.shared):
        if key in best.point.levels:
            if key[1] != SENSOR:
                value = best.point.levels[key]
                held.setdefault(key[0], (value, []))[1].append(j)
            continue
        effect = fit.unknowns.effects.get(key[0])
        if effect is not None and effect.parameter and effect.size == CHANGE:
            value = fit.unknowns.nominal(effect, CHANGE) + best.point.sizes.get(key, 0.0)
            held[effect.parameter] = value, [j]
    return {name: own for name, own in held.items() if name not in fit.unknowns.local}


def _own_changes(joint: Joint, columns: Sequence[int], scale: float) -> tuple[Vector, list[Vector]]:
    """Best changes of a parameter, (K,), and steps of all unknowns, (p,), in each recording."""
    count, known = len(joint.systems), len(joint.known)
    common = np.eye(len(joint.shared))[:, :known]
    transforms = []
    for k in range(count):
        own = np.zeros((len(joint.shared), count))
        own[columns, k] = 1.0
        transforms.append(np.hstack([common, own]))
    parts = zip(joint.stops(), transforms, strict=True)
    prior = joint.prior.columns(np.hstack([common, np.zeros((len(joint.shared), count))]))
    N = prior.N + np.diag(np.repeat([0.0, scale**-2], [known, count]))
    best = minimum(add([*(stop.columns(own) for stop, own in parts), replace(prior, N=N)]))
    return best[known:], [transform @ best for transform in transforms]


def _systematic(fit: Fit, lin: LinearizedPoint, joint: Joint, steps: Sequence[Vector]) -> float:
    """Squared errors that last, over those of noise, after a step (p,) in each recording."""
    weights = np.sqrt(lin.variance_factors)
    moved = [
        replace(recording, errors=system.errors(step) * weights)
        for recording, system, step in zip(lin.residuals, joint.systems, steps, strict=True)
    ]
    return float((slowness(moved, fit.lasting) - 1.0).sum())
