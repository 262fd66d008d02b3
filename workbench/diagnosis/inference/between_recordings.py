"""What differs between recordings by more than the system file says: parameters, and starts.

A resistance is warm on one day, a valve is set anew, a tank begins half full. Held too equal, such
a parameter or start leaves errors that no effect explains, and causes bend to them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.effects.candidates import CHANGE
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint, slowness
from workbench.diagnosis.inference.quadratic import Joint, add, minimum
from workbench.diagnosis.inference.search import FittedModel
from workbench.diagnosis.inference.unknowns import ALL, SENSOR
from workbench.system.units import with_unit

_FEWEST = 3  # recordings: whatever sets two of them apart, any parameter may stand for
_FREE = 1000.0  # spreads, of a start that may be anywhere: as far as mm are taken for m
_MOST = 0.5  # share of what remains from which on a parameter is named: no other explains as much


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


@dataclass(frozen=True)
class DifferingStarts:
    """States of which other values at the start explain most of what remains."""

    spreads: Mapping[str, str]  # that they would need, with units, by state
    removed: float  # share of the systematic squared error

    @property
    def text(self) -> str:
        """What they would explain, and what to do, for people."""
        entries = " and ".join(
            f'spread = "{spread}" in [states.{name}]' for name, spread in self.spreads.items()
        )
        return (
            f"If recordings began with {' and '.join(self.spreads)} further from what is expected "
            f"than the system file says, that would explain {self.removed:.0%} of what remains. If "
            f"they may, write {entries}, and diagnose again."
        )


def what_differs(
    fit: Fit, best: FittedModel, joint: Joint
) -> DifferingParameter | DifferingStarts | None:
    """Find what explains most of what a fit leaves, if each recording has its own value of it.

    Each parameter gets a change of its own in each recording, beside all that is fitted, and each
    state that no output shows, or all of these, another start. Linearised, so that a parameter may
    not change by more than itself.
    Source: N. M. Laird, J. H. Ware (1982), Random-effects models for longitudinal data, Biometrics
    38, 963-974.

    Parameters
    ----------
    joint : all recordings about the fit, with candidates.

    Returns
    -------
    That parameter, or these states; None if nothing explains more than half.
    """
    if fit.unknowns.count < _FEWEST:
        return None
    lin, still = best.linearised, [np.zeros(len(joint.shared))] * fit.unknowns.count
    before = max(_systematic(fit, lin, joint, still), 1e-9)
    explaining: list[DifferingParameter | DifferingStarts] = []
    for name, (value, columns) in _held_equal(fit, best, joint).items():
        (changes,), steps = _own_changes(joint, [columns], abs(value))
        removed = 1.0 - _systematic(fit, lin, joint, steps) / before
        if removed > _MOST and np.abs(changes).max() < abs(value):
            deviation = float(changes.std(ddof=1) / abs(value + changes.mean()))
            explaining.append(DifferingParameter(name, deviation, removed))
    local = fit.unknowns.local
    held = fit.by_held_starts(lin)
    slopes = {
        name: [system.P[:, j] for system in joint.systems] for j, name in enumerate(local)
    } | held
    scales = {**local, **dict.fromkeys(held, 1.0)}
    states = [name for name in fit.unknowns.starting if name not in fit.recorded] + [*held]
    tolerances = [name for name in local if name not in fit.unknowns.starting]
    together = [states] if len(states) > 1 else []
    for names in [*([name] for name in (*tolerances, *states)), *together]:
        free = joint
        for name in names:
            free = free.joined(("", f"own {name}"), slopes[name])
        own = [[len(joint.shared) + k] for k in range(len(names))]
        changes, steps = _own_changes(free, own, _FREE)
        removed = 1.0 - _systematic(fit, lin, free, steps) / before
        known = [[*local].index(name) for name in names if name in local]
        moved = [
            np.pad(
                system.deviations[known] + system.local(step)[known], (0, len(names) - len(known))
            )
            + change
            for system, step, change in zip(free.systems, steps, changes.T, strict=True)
        ]
        deviations = np.sqrt(np.square(moved).mean(axis=0)) * [scales[name] for name in names]
        # Several, where they explain most of what one of them leaves.
        least = 1.0 - _MOST * min([1.0, *(1.0 - own.removed for own in explaining)])
        needed = _MOST if len(names) == 1 else least
        if removed > needed and names[0] in states:
            units = [fit.unknowns.level_unit((name, ALL)) for name in names]
            spreads = map(with_unit, map(float, deviations), units)
            explaining.append(DifferingStarts(dict(zip(names, spreads, strict=True)), removed))
        elif removed > needed and deviations[0] < 1.0:
            explaining.append(DifferingParameter(names[0], float(deviations[0]), removed))
    return max(explaining, key=lambda differing: differing.removed, default=None)


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


def _own_changes(
    joint: Joint, groups: Sequence[Sequence[int]], scale: float
) -> tuple[Matrix, list[Vector]]:
    """Best changes of what has its own, (g, K), and steps of all unknowns, (p,), per recording.

    Parameters
    ----------
    groups : columns of each of them.
    """
    count, known = len(joint.systems), len(joint.known)
    common = np.eye(len(joint.shared))[:, :known]
    transforms = []
    for k in range(count):
        own = np.zeros((len(joint.shared), len(groups) * count))
        for g, columns in enumerate(groups):
            own[columns, g * count + k] = 1.0
        transforms.append(np.hstack([common, own]))
    parts = zip(joint.stops(), transforms, strict=True)
    prior = joint.prior.columns(np.hstack([common, np.zeros_like(own)]))
    N = prior.N + np.diag(np.repeat([0.0, scale**-2], [known, own.shape[1]]))
    best = minimum(add([*(stop.columns(own) for stop, own in parts), replace(prior, N=N)]))
    return best[known:].reshape(-1, count), [transform @ best for transform in transforms]


def _systematic(fit: Fit, lin: LinearizedPoint, joint: Joint, steps: Sequence[Vector]) -> float:
    """Squared errors that last, over those of noise, after a step (p,) in each recording."""
    weights = np.sqrt(lin.variance_factors)
    moved = [
        replace(recording, errors=system.errors(step) * weights)
        for recording, system, step in zip(lin.residuals, joint.systems, steps, strict=True)
    ]
    return float((slowness(moved, fit.lasting) - 1.0).sum())
