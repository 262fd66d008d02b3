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
    """Of one channel along one recording, by the nominal and by the last model."""

    recording: str
    channel: str
    unit: str
    held_out: bool  # whether nothing common to the recordings was fitted to this one
    samples: int  # whose errors are told
    # rms, mean_absolute: of these, (before, after) [unit]
    rms: tuple[float, float]
    mean_absolute: tuple[float, float]
    # what corrects the simulation that they are of: measured outputs, where inputs have noise that
    # a motion integrates, or restarts; empty for a free run
    corrected: str
    # root mean square of a free run, which nothing corrects, (before, after) [unit]; None where the
    # model cannot be simulated so far
    free_run: tuple[float | None, float | None]


def errors_of(
    simulations: ResidualModel,
    fit: Fit,
    before: LinearizedPoint,
    after: LinearizedPoint,
    *,
    held_out: bool,
) -> list[Errors]:
    """Errors of all recordings by two models, as they are compared and in free runs."""
    rows, same = [], before.point is after.point
    if any(recording.corrected for recording in simulations.recordings):
        first = simulations.free_runs(fit.unknowns.values(before.point))
        last = first if same else simulations.free_runs(fit.unknowns.values(after.point))
    else:
        first, last = ([residuals.sizes for residuals in lin.residuals] for lin in (before, after))
    for k, recording in enumerate(simulations.recordings):
        sizes = [lin.residuals[k].sizes for lin in (before, after)]
        samples = recording.measured[recording.reported].sum(axis=0)
        for c, channel in enumerate(channels(simulations.system, recording.signals)):
            if recording.silent[c]:
                continue
            rms, mean = ((float(sizes[0][i, c]), float(sizes[1][i, c])) for i in (0, 1))
            free = [float(runs[k][0, c]) for runs in (first, last)]
            known = [error if np.isfinite(error) else None for error in free]
            rows.append(
                Errors(
                    recording=recording.name,
                    channel=channel.name,
                    unit=channel.unit,
                    held_out=held_out,
                    samples=int(samples[c]),
                    rms=rms,
                    mean_absolute=mean,
                    corrected=recording.corrected,
                    free_run=(known[0], known[1]),
                )
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
    source = fitted.source._replace(free=fitted.free)
    with ResidualModel(source, cases, Engine(workers), restarting=False) as simulations:
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
        return errors_of(simulations, fit, before, after, held_out=True), starts
