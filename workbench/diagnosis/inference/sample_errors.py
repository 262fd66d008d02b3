"""Errors of both models sample by sample, in units of the sensors, on recordings fitted or not."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.diagnosis.data.samples import channels
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint
from workbench.diagnosis.inference.search import ROUNDS, FittedModel
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.recordings.case import Case
from workbench.runtime.engine import Engine


@dataclass(frozen=True)
class Errors:
    """Of one channel along one recording, by the nominal and by the last model.

    Attributes
    ----------
    held_out : whether nothing common to the recordings was fitted to this one.
    samples : whose errors are told.
    rms, mean_absolute : of these, (before, after) [unit].
    """

    recording: str
    channel: str
    unit: str
    held_out: bool
    samples: int
    rms: tuple[float, float]
    mean_absolute: tuple[float, float]


def errors_of(
    simulations: ResidualModel, before: LinearizedPoint, after: LinearizedPoint, *, held_out: bool
) -> list[Errors]:
    """Errors of all recordings by two models."""
    rows = []
    for k, recording in enumerate(simulations.recordings):
        sizes = [lin.residuals[k].sizes for lin in (before, after)]
        samples = int(recording.told.sum())
        for c, channel in enumerate(channels(simulations.system, recording.signals)):
            if recording.silent[c]:
                continue
            rms, mean = ((float(sizes[0][i, c]), float(sizes[1][i, c])) for i in (0, 1))
            rows.append(
                Errors(recording.name, channel.name, channel.unit, held_out, samples, rms, mean)
            )
    return rows


def held_out_errors(
    fitted: ResidualModel,
    effects: Sequence[Effect],
    ends: tuple[FittedModel, FittedModel],
    cases: Sequence[Case],
    workers: int,
) -> tuple[list[Errors], dict[str, dict[str, float]]]:
    """Errors on recordings that no common unknown was fitted to.

    Of these recordings, only what differs from one to the other by nature is fitted: states at the
    start, and deviations within tolerances.

    Parameters
    ----------
    fitted : the other recordings.
    ends : the nominal and the last model, as fitted to those.

    Returns
    -------
    errors : of both models.
    starts : of the last model, by recording, see `Unknowns.starts`.
    """
    with ResidualModel(fitted.source, cases, Engine(workers), restarting=False) as simulations:
        fit = Fit(simulations, effects, beside=fitted.cases)

        def apart(model: FittedModel) -> LinearizedPoint:
            start, known = fit.unknowns.start(), model.point
            levels = {key: known.levels.get(key, usual) for key, usual in start.levels.items()}
            phases = {name: np.zeros(len(cases)) for name in known.phases}
            point = replace(start, sizes=known.sizes, levels=levels, phases=phases)
            common = {**point.sizes, **point.levels}
            return fit.refine(fit.at(point), model.active, ROUNDS, held=common)

        before, after = map(apart, ends)
        starts = fit.unknowns.starts(after.point)
        return errors_of(simulations, before, after, held_out=True), starts
