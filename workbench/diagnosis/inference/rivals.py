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
    """A model that explains the recordings as well as any."""

    effects: tuple[str, ...]  # names of its causes
    # sizes, levels: common unknowns as fitted, by key, SI
    sizes: Mapping[Key, float]
    levels: Mapping[Key, float]
    # errors and derivatives there, each in as few rows as tell the same; common unknowns in this
    # order
    recordings: tuple[RecordingSystem, ...]
    prior: Quadratic  # what is known of these beforehand
    explained: float  # chi-squared that it explains beyond the nominal model

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
            "recordings": [_as_dict(recording) for recording in self.recordings],
            "prior": {
                "matrix": self.prior.N.tolist(),
                "gradient": self.prior.g.tolist(),
                "constant": self.prior.c,
            },
            "explained": self.explained,
        }


@dataclass(frozen=True, eq=False)
class Rivals:
    """Models between which recordings do not decide; the first is the one that was named."""

    models: tuple[Rival, ...]
    effects: tuple[str, ...]  # names of all that were considered
    # parameters of the diagnosed model that differ from the library's defaults, SI
    given: Mapping[str, float]
    signals: tuple[str, ...]  # that were compared
    variance_factors: Vector  # (m,) variance of slow errors over that of white noise, by channel

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


def _as_dict(system: RecordingSystem) -> dict[str, Any]:
    return {
        "errors": system.r.tolist(),
        "common": system.J.tolist(),
        "own": system.P.tolist(),
        "deviations": system.deviations.tolist(),
        "furthest": system.furthest.tolist(),
    }


def _numbers(entry: Any, *shape: int | None, endless: bool = False) -> Vector | Matrix:
    """Numbers of a shape, whose None is any length."""
    flat = np.array(entry, object)
    if not all(isinstance(value, int | float) and value is not True for value in flat.flat):
        raise ValueError("no numbers")
    values = np.array(entry, float)
    if not values.size:
        values = values.reshape([0 if length is None else length for length in shape])
    same = len(shape) == values.ndim and all(
        wanted in (None, length) for wanted, length in zip(shape, values.shape, strict=True)
    )
    if not same or np.isnan(values).any() or (np.isinf(values).any() and not endless):
        raise ValueError("another shape, or numbers that are not finite")
    return values


def _system(content: Mapping[str, Any], unknowns: int) -> RecordingSystem:
    """What `_as_dict` wrote, of a number of common unknowns."""
    errors = _numbers(content["errors"], None)
    furthest = _numbers(content["furthest"], None, endless=True)
    deviations = _numbers(content["deviations"], None)
    if deviations.size > furthest.size or (furthest < 0.0).any():
        raise ValueError("deviations that no unknown has")
    return RecordingSystem(
        r=errors,
        J=_numbers(content["common"], errors.size, unknowns),
        P=_numbers(content["own"], errors.size, furthest.size),
        deviations=deviations,
        furthest=furthest,
        channels=1,
    )


def _prior(content: Mapping[str, Any], unknowns: int) -> Quadratic:
    matrix = _numbers(content["matrix"], unknowns, unknowns)
    if (np.diag(matrix) < 0.0).any() or not np.allclose(matrix, matrix.T):
        raise ValueError("no matrix of information")
    gradient, constant = _numbers(content["gradient"], unknowns), _number(content["constant"])
    return Quadratic(matrix, gradient, constant, 0)


def _number(entry: Any) -> float:
    return float(_numbers([entry], 1)[0])


def _rival_of(content: Mapping[str, Any]) -> Rival:
    def keyed(rows: Sequence[Sequence[Any]]) -> dict[Key, float]:
        return {(_text(owner), _text(name)): _number(value) for owner, name, value in rows}

    sizes, levels = keyed(content["sizes"]), keyed(content["levels"])
    unknowns = len(sizes) + len(levels)
    effects = tuple(map(_text, content["effects"]))
    if not effects or not content["recordings"] or {effect for effect, _ in sizes} - set(effects):
        raise ValueError("no cause, no recording, or sizes of another cause")
    return Rival(
        effects=effects,
        sizes=sizes,
        levels=levels,
        recordings=tuple(_system(recording, unknowns) for recording in content["recordings"]),
        prior=_prior(content["prior"], unknowns),
        explained=_number(content["explained"]),
    )


def _text(entry: Any) -> str:
    if not isinstance(entry, str):
        raise ValueError("no name")
    return entry


def read_rivals(content: Mapping[str, Any]) -> Rivals:
    """Read what `Rivals.to_dict` wrote.

    Raises
    ------
    AttributeError, KeyError, TypeError, ValueError, OverflowError
        If it is something else, or holds what cannot be.
    """
    models = tuple(map(_rival_of, content["models"]))
    factors = _numbers(content["inflation"], None)
    effects, signals = (tuple(map(_text, content[name])) for name in ("effects", "signals"))
    if not models or not signals or (factors <= 0.0).any():
        raise ValueError("no model, no signal, or no variance")
    if {effect for model in models for effect in model.effects} - set(effects):
        raise ValueError("a cause that was not considered")
    return Rivals(
        models=models,
        effects=effects,
        given={name: _number(value) for name, value in content["given"].items()},
        signals=signals,
        variance_factors=factors,
    )
