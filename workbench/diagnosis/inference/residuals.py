"""Where and when a simulation is wrong: what its errors go with, and balances of the machine.

These are for people. Balances are formed from smoothed measurements and show an effect where it
acts; a system's plugin knows them. The search does not use them, because noise that a balance
shares with its explanation fakes causes; it uses prediction errors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.samples import Samples, channels
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.recordings.case import Case, sign
from workbench.system.comparison import Channel
from workbench.system.plugins import find_plugin, load
from workbench.system.system import System

BEGINNING, DIRECTION = "time since the beginning", "direction"
_APPLIED = 0.05  # share of its greatest value from which on an input is applied
_RUNNING = 50  # sample times of a mean, before an input is differentiated
_BINS = 12


@dataclass(frozen=True, eq=False)
class Balance:
    """What a measurement has beyond the model in one equation of the machine."""

    name: str  # in files
    title: str  # for people
    # unit, shown: SI, and the one of figures
    unit: str
    shown: str
    values: Vector  # (n,) NaN where the recording does not count


class Balances(Protocol):
    """What a plugin knows of its machine."""

    def __call__(
        self, system: System, case: Case, recorded: Samples, values: Mapping[str, float]
    ) -> Sequence[Balance]:
        """Balances of one recording, with these parameters of the model."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Balances of one recording, and the prediction errors of two models."""

    name: str  # of the recording
    time: Vector  # (n,) [s] of the balances
    balances: tuple[Balance, ...]  # that the system's plugin knows
    channels: tuple[Channel, ...]  # that are compared, and that it has
    block_time: Vector  # (b,) [s]
    # before, after: (b, c) prediction errors of the nominal and of the last model, by channel, NaN
    # where a channel has no sample
    before: Matrix
    after: Matrix
    sigma: Matrix  # (b, c) their standard deviation by noise


@dataclass(frozen=True)
class Dependence:
    """Share of the variance of a channel's errors that follows an influence, beyond chance."""

    channel: str
    influence: str
    before: float
    after: float


def residuals(
    simulations: ResidualModel, fit: Fit, before: LinearizedPoint, after: LinearizedPoint
) -> list[Residuals]:
    """Residuals of all recordings, with the levels of the nominal model as fitted."""
    values = fit.unknowns.values(before.point)
    system = simulations.system
    known: Balances | None = load(find_plugin(system.plugin).balances)
    table = []
    for k, (case, recording) in enumerate(
        zip(simulations.cases, simulations.recordings, strict=True)
    ):
        measured = np.flatnonzero(~recording.silent)
        inverse = np.linalg.inv(recording.whitening[:, measured[:, None], measured])
        compared = np.where(recording.compared[:, measured], 1.0, np.nan)
        unwhitened: list[Matrix] = [
            compared * np.einsum("bij,bj->bi", inverse, lin.residuals[k].errors[:, measured])
            for lin in (before, after)
        ]
        formed = channels(system, recording.signals)
        fitted = {**simulations.nominal, **values[k]}
        table.append(
            Residuals(
                name=case.name,
                time=case.time,
                balances=tuple(known(system, case, recording, fitted)) if known else (),
                channels=tuple(formed[c] for c in measured),
                block_time=case.time[recording.blocks.mean(axis=1).astype(int)],
                before=unwhitened[0],
                after=unwhitened[1],
                sigma=compared * np.sqrt(np.einsum("bij,bij->bi", inverse, inverse)),
            )
        )
    return table


def dependences(simulations: ResidualModel, residuals: Sequence[Residuals]) -> list[Dependence]:
    """What prediction errors go with, strongest before first."""
    system = simulations.system
    influences = [_influences(simulations, k) for k in range(len(residuals))]
    turning = {
        influence.name for influence in system.comparison.influences if influence.way == "turn"
    }
    # What changes sign with the direction is wrong by its size, whatever the direction.
    signs = [sign(case, system) for case in simulations.cases]
    pairs = list(zip(signs, residuals, strict=True))
    table = []
    for channel in dict.fromkeys(
        channel for residual in residuals for channel in residual.channels
    ):
        before, after, along = [], [], []
        for (mark, residual), own in zip(pairs, influences, strict=True):
            if channel in residual.channels:
                c = residual.channels.index(channel)
                sigma = residual.sigma[:, c]
                known = np.isfinite(sigma)
                before.append((mark * residual.before[:, c] / sigma)[known])
                after.append((mark * residual.after[:, c] / sigma)[known])
                along.append({name: values[known] for name, values in own.items()})
        for name in (name for name in influences[0] if all(name in own for own in along)):
            shares = (
                _explained(errors, along, name, apart=name in turning) for errors in (before, after)
            )
            table.append(Dependence(channel.name, name, *shares))
    return sorted(table, key=lambda row: -row.before)


def _influences(simulations: ResidualModel, k: int) -> dict[str, Vector]:
    case, recording, system = simulations.cases[k], simulations.recordings[k], simulations.system
    time, h = case.time, np.gradient(case.time)
    measured = dict(zip(recording.inputs, recording.u.T, strict=True))
    measured |= dict(zip(recording.signals, recording.y.T, strict=True))
    signals = {BEGINNING: time - time[0]}
    if (begins := system.comparison.begins) is not None:
        size = np.abs(system.signal(begins.signal, measured))
        applied = size > _APPLIED * size.max()
        start = time[np.argmax(applied)] if applied.any() else time[0]
        signals[BEGINNING] = np.maximum(0.0, time - start)
    if not system.comparison.influences:
        signals |= {name: values for name, values in measured.items() if name in case}
    for influence in system.comparison.influences:
        values = system.evaluate(influence.formula, measured, simulations.nominal)
        match influence.way:
            case "size":
                values = np.abs(values)
            case "rate":
                values = np.gradient(_running(values, h, system), time)
            case "integral":
                values = np.cumsum(values * h)
            case "turn":
                values = np.cumsum(values * h) % (2.0 * np.pi)
        signals[influence.name] = values
    if any(condition.sign for condition in system.conditions):
        signals[DIRECTION] = np.full(time.size, sign(case, system))
    middle = recording.blocks.mean(axis=1).astype(int)
    return {name: values[middle] for name, values in signals.items()}


def _running(values: Vector, h: Vector, system: System) -> Vector:
    width = max(1, round(_RUNNING * system.sample_time / float(np.median(h))))
    width = min(width, values.size)
    result: Vector = np.convolve(values, np.ones(width) / width, "same")
    return result


def _explained(
    errors: Sequence[Vector], influences: Sequence[dict[str, Vector]], name: str, *, apart: bool
) -> float:
    """Correlation ratio of errors on an influence in bins, corrected for chance (Kelley 1935).

    Parameters
    ----------
    apart : whether each recording has a phase of its own.
    """
    groups, values = [], []
    everything = np.concatenate([influence[name] for influence in influences])
    edges = np.unique(np.quantile(everything, np.linspace(0.0, 1.0, _BINS + 1)[1:-1]))
    for k, (error, influence) in enumerate(zip(errors, influences, strict=True)):
        groups.append(np.digitize(influence[name], edges) + (100 * k if apart else 0))
        values.append(error - error.mean() if apart else error)
    group, value = np.unique(np.concatenate(groups), return_inverse=True)[1], np.concatenate(values)
    counts = np.bincount(group)
    means = np.bincount(group, value) / counts
    total = float(np.sum((value - value.mean()) ** 2))
    within = float(np.sum((value - means[group]) ** 2))
    if total <= 0.0:
        return 0.0
    chance: float = (len(value) - 1) / max(1, len(value) - len(counts))
    return max(0.0, float(1.0 - chance * within / total))
