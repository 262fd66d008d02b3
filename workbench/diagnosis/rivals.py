"""What recordings do not tell apart, as a value: fitted models, and how sure their unknowns are.

With it, what further recordings would tell can be computed without those that were diagnosed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench.diagnosis.evidence import Simulations
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.quadratic import Key
from workbench.diagnosis.search import Fitted, beyond
from workbench.fmu import Matrix, Vector


@dataclass(frozen=True, eq=False)
class Rival:
    """A model that explains the recordings as well as any.

    Attributes
    ----------
    effects : names of its causes.
    sizes, levels : common unknowns as fitted, by key, SI.
    information : (p, p) inverse covariance of sizes and levels, in this order.
    behind : chi-squared that it leaves beyond the best.
    explained : chi-squared that it explains beyond the nominal model.
    """

    effects: tuple[str, ...]
    sizes: Mapping[Key, float]
    levels: Mapping[Key, float]
    information: Matrix
    behind: float
    explained: float

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts."""
        return {
            "effects": list(self.effects),
            "sizes": [[*key, value] for key, value in self.sizes.items()],
            "levels": [[*key, value] for key, value in self.levels.items()],
            "information": self.information.tolist(),
            "behind": self.behind,
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
    inflation: Vector

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts; `read_rivals` reads it again."""
        return {
            "models": [one.to_dict() for one in self.models],
            "effects": list(self.effects),
            "given": dict(self.given),
            "signals": list(self.signals),
            "inflation": self.inflation.tolist(),
        }


def gathered(simulations: Simulations, fit: Fit, base: Fitted, fits: Sequence[Fitted]) -> Rivals:
    """What fits leave undecided.

    Parameters
    ----------
    base : the nominal model, fitted.
    fits : of the models; the first is the one that was named.
    """
    best = fits[0]
    inflation = best.linearised.inflation
    return Rivals(
        models=tuple(_rival(fit, base, best, one) for one in fits),
        effects=tuple(fit.unknowns.effects),
        given=simulations.given,
        signals=tuple(simulations.recordings[0].signals),
        inflation=inflation,
    )


def _rival(fit: Fit, base: Fitted, best: Fitted, one: Fitted) -> Rival:
    lin = replace(fit.linearise(one.linearised, one.active), inflation=best.linearised.inflation)
    return Rival(
        effects=tuple(effect.name for effect in one.active),
        sizes=dict(one.point.sizes),
        levels=dict(one.point.levels),
        information=fit.quadratics(lin).total().N,
        behind=beyond(one, best),
        explained=beyond(base, one),
    )


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
                effects=tuple(map(str, one["effects"])),
                sizes=keyed(one["sizes"]),
                levels=keyed(one["levels"]),
                information=np.array(one["information"], float),
                behind=float(one["behind"]),
                explained=float(one["explained"]),
            )
            for one in said["models"]
        ),
        effects=tuple(map(str, said["effects"])),
        given={str(name): float(value) for name, value in said["given"].items()},
        signals=tuple(map(str, said["signals"])),
        inflation=np.array(said["inflation"], float),
    )
