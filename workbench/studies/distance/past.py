"""What past stops say of the next: nuisance parameters of the machine, and how sure they are.

The fit is that of the diagnosis without effects; nothing is estimated a second time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Joint, Key, Quadratic, add, covariance, minimum
from workbench.diagnosis.inference.search import ROUNDS
from workbench.diagnosis.inference.thresholds import of_system
from workbench.diagnosis.inference.unknowns import choice_of
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.errors import InputError
from workbench.recordings.case import Case, Value
from workbench.runtime.engine import Engine
from workbench.system.system import OBSERVER, System


@dataclass(frozen=True, eq=False)
class MachineLevels:
    """Levels of a machine, as past stops know them."""

    keys: tuple[Key, ...]  # parameter, and choice of a condition
    mean: Vector  # (p,) SI
    covariance: Matrix  # (p, p)

    def root(self) -> Matrix:
        """(p, p) whose square is the covariance, of unknowns in any unit."""
        scale = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))  # none of what is known
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        root: Matrix = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        return root


@dataclass(frozen=True, eq=False)
class PastFit:
    """A fit to past stops."""

    names: tuple[str, ...]  # of the recordings
    joint: Joint  # of the fit, about its best point
    mean: Vector  # (p,) levels there
    own: tuple[Mapping[str, float], ...]  # by recording, tolerances as fitted, by parameter, SI

    def known(self, without: int | None = None) -> MachineLevels:
        """Levels by all recordings, or by all but one, by one step from the fit to all."""
        stops = self.joint.stops()
        kept = [stop for k, stop in enumerate(stops) if k != without]
        total = add([*kept, self.joint.prior])
        step = minimum(Quadratic(total.N, total.g, total.c, 0))
        return MachineLevels(self.joint.shared, self.mean + step, covariance(total.N))


def fit_past_stops(system: System, cases: Sequence[Case], engine: Engine) -> PastFit:
    """Fit levels, and what differs between recordings, to past stops."""
    path = system.model(OBSERVER).path
    assert path is not None
    source = ModelSource(path, system, system.given)
    with ResidualModel(source, cases, engine, restarting=False) as simulations:
        # Of effects none is tried; the thresholds bound steps alone.
        fit = Fit(simulations, [], of_system(system.comparison, 1))
        best = fit.refine(fit.at(fit.unknowns.start()), [], ROUNDS)
        joint = fit.quadratics(fit.linearise(best, []))
        values = fit.unknowns.values(best.point)
    tolerances = system.comparison.tolerances
    return PastFit(
        names=tuple(case.name for case in cases),
        joint=joint,
        mean=np.array([best.point.levels[key] for key in joint.shared]),
        own=tuple({name: float(value[name]) for name in tolerances} for value in values),
    )


def places(keys: Sequence[Key], system: System, conditions: Mapping[str, Value]) -> dict[str, int]:
    """Which of the levels each parameter has under some conditions."""
    columns = {}
    for name, level in system.comparison.levels.items():
        key = name, choice_of(system, name, conditions)
        if key not in keys:
            raise InputError(
                where=f"{level.by} = {key[1]}",
                found="no past stop under this condition",
                expected=f"one, by which '{name}' is known",
                remedy="give recordings under this condition too",
            )
        columns[name] = list(keys).index(key)
    return columns
