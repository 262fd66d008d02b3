"""What recordings do not tell apart, as a value: fitted models, and how sure their unknowns are.

With it, what further recordings would tell can be computed without those that were diagnosed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Key, Quadratic, RecordingSystem, add
from workbench.diagnosis.inference.search import FittedModel, beyond
from workbench.diagnosis.simulation.residual_model import ResidualModel


@dataclass(frozen=True, eq=False)
class Rival:
    """A model that explains the recordings as well as any.

    Attributes
    ----------
    effects : names of its causes.
    sizes, levels : common unknowns as fitted, by key, SI.
    recordings : errors and derivatives there, each in as few rows as tell the same; common unknowns
        in this order.
    prior : what is known of these beforehand.
    explained : chi-squared that it explains beyond the nominal model.
    """

    effects: tuple[str, ...]
    sizes: Mapping[Key, float]
    levels: Mapping[Key, float]
    recordings: tuple[RecordingSystem, ...]
    prior: Quadratic
    explained: float

    @property
    def chi_squared(self) -> float:
        """That it leaves, tolerances and what was known beforehand included."""
        return sum(recording.chi_squared for recording in self.recordings) + self.prior.c

    @property
    def information(self) -> Matrix:
        """Inverse covariance of sizes and levels, (p, p)."""
        return add([*(recording.eliminated() for recording in self.recordings), self.prior]).N

    def so_far(self, shared: Sequence[Key], furthest: float) -> RecordingSystem:
        """All recordings as one, over the common unknowns of new ones.

        What these do not have may change as its prior lets it.

        Parameters
        ----------
        shared : common unknowns of new recordings.
        furthest : standard deviations that no level goes beyond.
        """
        old = [*self.sizes, *self.levels]
        J, N = np.vstack([recording.J for recording in self.recordings]), np.diag(self.prior.N)
        gone = [j for j, key in enumerate(old) if key not in shared]
        known = N[gone] > 0.0
        spread = 1.0 / np.sqrt(np.where(known, N[gone], 1.0))
        P = np.hstack(
            [block_diag(*(recording.P for recording in self.recordings)), J[:, gone] * spread]
        )
        counts = [
            np.arange(recording.P.shape[1]) < recording.deviations.size
            for recording in self.recordings
        ]
        first = np.argsort(~np.concatenate([*counts, known]), kind="stable")
        away = [
            *(recording.deviations for recording in self.recordings),
            (self.prior.g[gone] * spread)[known],
        ]
        bounds = [
            *(recording.furthest for recording in self.recordings),
            np.where(known, furthest, np.inf),
        ]
        columns = [J[:, old.index(key)] if key in old else np.zeros(len(J)) for key in shared]
        return RecordingSystem(
            r=np.concatenate([recording.r for recording in self.recordings]),
            J=np.column_stack(columns),
            P=P[:, first],
            deviations=np.concatenate(away),
            furthest=np.concatenate(bounds)[first],
            channels=1,
        )

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts."""
        return {
            "effects": list(self.effects),
            "sizes": [[*key, value] for key, value in self.sizes.items()],
            "levels": [[*key, value] for key, value in self.levels.items()],
            "recordings": [_told(recording) for recording in self.recordings],
            "prior": {
                "matrix": self.prior.N.tolist(),
                "gradient": self.prior.g.tolist(),
                "constant": self.prior.c,
            },
            "explained": self.explained,
        }


@dataclass(frozen=True, eq=False)
class Rivals:
    """Models between which recordings do not decide; the first is the one that was named.

    Attributes
    ----------
    effects : names of all that were considered.
    given : parameters of the diagnosed model that differ from the library's defaults, SI.
    signals : that were compared.
    inflation : (m,) variance of slow errors over that of white noise, by channel.
    """

    models: tuple[Rival, ...]
    effects: tuple[str, ...]
    given: Mapping[str, float]
    signals: tuple[str, ...]
    variance_factors: Vector

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts; `read_rivals` reads it again."""
        return {
            "models": [model.to_dict() for model in self.models],
            "effects": list(self.effects),
            "given": dict(self.given),
            "signals": list(self.signals),
            "inflation": self.variance_factors.tolist(),
        }


def gathered(
    simulations: ResidualModel, fit: Fit, base: FittedModel, fits: Sequence[FittedModel]
) -> Rivals:
    """What fits leave undecided.

    Parameters
    ----------
    base : the nominal model, fitted.
    fits : of the models; the first is the one that was named.
    """
    variance_factors = fits[0].linearised.variance_factors
    return Rivals(
        models=tuple(_rival(fit, base, model, variance_factors) for model in fits),
        effects=tuple(fit.unknowns.effects),
        given=simulations.given,
        signals=tuple(simulations.recordings[0].signals),
        variance_factors=variance_factors,
    )


def _rival(fit: Fit, base: FittedModel, fitted: FittedModel, variance_factors: Vector) -> Rival:
    lin = replace(
        fit.linearise(fitted.linearised, fitted.active), variance_factors=variance_factors
    )
    joint = fit.quadratics(lin)
    still = np.zeros(len(joint.shared))
    return Rival(
        effects=tuple(effect.name for effect in fitted.active),
        sizes=dict(fitted.point.sizes),
        levels=dict(fitted.point.levels),
        recordings=tuple(system.compressed().moved(still) for system in joint.systems),
        prior=joint.prior,
        explained=beyond(base, fitted),
    )


def _told(system: RecordingSystem) -> dict[str, Any]:
    """A recording's errors and derivatives as numbers."""
    return {
        "errors": system.r.tolist(),
        "common": system.J.tolist(),
        "own": system.P.tolist(),
        "deviations": system.deviations.tolist(),
        "furthest": system.furthest.tolist(),
    }


def _system(said: Mapping[str, Any]) -> RecordingSystem:
    """What `_told` told."""
    return RecordingSystem(
        r=np.array(said["errors"], float),
        J=np.array(said["common"], float),
        P=np.array(said["own"], float),
        deviations=np.array(said["deviations"], float),
        furthest=np.array(said["furthest"], float),
        channels=1,
    )


def _prior(said: Mapping[str, Any]) -> Quadratic:
    matrix, gradient = (np.array(said[name], float) for name in ("matrix", "gradient"))
    return Quadratic(matrix, gradient, float(said["constant"]), 0)


def read_rivals(said: Mapping[str, Any]) -> Rivals:
    """Read what `Rivals.to_dict` wrote.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it is something else.
    """

    def keyed(rows: Sequence[Sequence[Any]]) -> dict[Key, float]:
        return {(str(effect), str(name)): float(value) for effect, name, value in rows}

    return Rivals(
        models=tuple(
            Rival(
                effects=tuple(map(str, model["effects"])),
                sizes=keyed(model["sizes"]),
                levels=keyed(model["levels"]),
                recordings=tuple(_system(recording) for recording in model["recordings"]),
                prior=_prior(model["prior"]),
                explained=float(model["explained"]),
            )
            for model in said["models"]
        ),
        effects=tuple(map(str, said["effects"])),
        given={str(name): float(value) for name, value in said["given"].items()},
        signals=tuple(map(str, said["signals"])),
        variance_factors=np.array(said["inflation"], float),
    )
