"""The next experiment: which recording would tell apart what a diagnosis left undecided.

rivals of a diagnosis, what may be varied -> recordings that the first rival predicts
    -> what the others leave of them -> separation, chance, cost
"""

import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path

from workbench.diagnosis import build_everything, catalogue, choose
from workbench.diagnosis.data.samples import channels
from workbench.diagnosis.inference.rivals import Rivals
from workbench.errors import InputError
from workbench.models.modelica import read_library
from workbench.runtime.engine import Engine
from workbench.runtime.pool import Pool
from workbench.studies.design.candidates import (
    Experiment,
    every_setting,
    other_profiles,
    other_settings,
    some_settings,
)
from workbench.studies.design.outcome import PROPOSED, NextStop, RankedExperiment, chosen
from workbench.studies.design.prediction import DesignProblem, Prediction
from workbench.studies.design.predictor import ExperimentPredictor, open_predictor, with_sensor
from workbench.system.experiments import Experiments
from workbench.system.parts import Signal
from workbench.system.system import System

__all__ = ["NextStop", "RankedExperiment", "foreseen", "next_stop", "with_sensor"]

_Task = Future[Prediction | None]

_SETTINGS = 3  # of which all profiles are tried
_TOGETHER = 6  # experiments of which models are fitted again at a time
_CONFIRMED = 24  # at most: a quarter of what is tried
_SENSED = 3  # experiments that are tried with further sensors


def next_stop(system: System, rivals: Rivals, engine: Engine) -> NextStop:
    """Rank the experiments that a system allows by what they would tell.

    Settings are exchanged first and profiles then, once each, as coordinates of a design (R. K.
    Meyer, C. J. Nachtsheim, 1995, Technometrics 37, 60-69): of a grid of both most tell nothing.

    Of several rivals, by how many pairs a diagnosis would tell apart, then by the least distance
    that is left between two; of a single one, by how sure its sizes would be.

    Parameters
    ----------
    system : that was diagnosed.
    rivals : what its recordings leave undecided.

    Raises
    ------
    InputError
        If the system does not say what may be varied, or no recording of it would count.
    """
    with _open(system, rivals, engine) as (experiments, pool):
        every, plan = every_setting(experiments), some_settings(experiments)
        named = " with ".join(rivals.models[0].effects)
        engine.report(f"{len(plan)} of {len(every)} settings, as {named} predicts")
        ranked = chosen(_predict_all(system, pool, plan))
        near = [
            other_setting
            for best in ranked[:_SETTINGS]
            for other_setting in other_settings(experiments, best.candidate)
        ]
        beside = [
            experiment for experiment in every if experiment in near and experiment not in plan
        ]
        if beside:
            engine.report(
                f"{len(beside)} others that differ from the best {_SETTINGS} in one setting"
            )
            ranked = chosen([*ranked, *_predict_all(system, pool, beside)])
        best = [prediction.candidate for prediction in ranked[:_SETTINGS]]
        more = [
            other_profile
            for setting in best
            for other_profile in other_profiles(experiments, setting)
        ]
        if more:
            engine.report(f"{len(more)} profiles with the best {len(best)}")
            ranked = chosen([*ranked, *_predict_all(system, pool, more)])
        if len(rivals.models) > 1:
            engine.report("the best, with the models fitted again in full")
            ranked = _confirmed(pool, ranked)
        sensors = {}
        first = ranked[0]
        if len(first.groups) < len(rivals.models) and experiments.sensors:
            engine.report("the same with further sensors")
            best = [prediction.candidate for prediction in ranked[:_SENSED]]
            for sensor, found in _sensed(pool, best, experiments.sensors, len(first.groups)):
                sensed = with_sensor(system, sensor)
                sensors[sensor.label] = _proposal(sensed, experiments, found)
    return NextStop(
        system=system,
        rivals=rivals,
        channels=channels(system, rivals.signals),
        tried=tuple(_proposal(system, experiments, prediction) for prediction in ranked),
        sensors=sensors,
    )


def predict_experiments(
    system: System, rivals: Rivals, plan: Sequence[Experiment], workers: int
) -> list[RankedExperiment]:
    """What experiments of one's own choice would tell, best first; those that would count.

    Raises
    ------
    InputError
        As `next_stop`.
    """
    with _open(system, rivals, Engine(workers)) as (experiments, pool):
        ranked = chosen(_predict_all(system, pool, plan, in_full=True))
        return [_proposal(system, experiments, prediction) for prediction in ranked]


@contextmanager
def _open(
    system: System, rivals: Rivals, engine: Engine
) -> Iterator[tuple[Experiments, Pool[ExperimentPredictor]]]:
    """What the system allows, and workers with its model."""
    experiments = system.experiments
    if experiments is None:
        raise InputError(
            where=str(system.source),
            found="no table [next]",
            expected="what may be varied in the next recording",
            remedy="write it, see docs/next-stop.md",
        )
    library = read_library(system.library)
    effects = {effect.name: effect for effect in choose(rivals.effects, catalogue(system, library))}
    with tempfile.TemporaryDirectory() as scratch:
        everything = Path(scratch) / "AllEffects.fmu"
        engine.report(f"compiling {len(effects)} effects")
        build_everything(system, library, list(effects.values()), everything)
        outlook = DesignProblem(everything, system, experiments, rivals, effects)
        with Pool(engine.workers, open_predictor, outlook) as pool:
            yield experiments, pool


def _predict_all(
    system: System,
    pool: Pool[ExperimentPredictor],
    plan: Sequence[Experiment],
    *,
    in_full: bool = False,
) -> list[Prediction]:
    """What experiments would tell, those that would count."""
    tasks = [
        pool.submit(ExperimentPredictor.predict_experiment, experiment, number, None, in_full)
        for number, experiment in enumerate(plan, 1)
    ]
    predictions = [prediction for task in tasks if (prediction := task.result()) is not None]
    if not predictions:
        raise InputError(
            where=f"{system.source}, [next]",
            found="no experiment with enough samples that count",
            expected="one that a diagnosis can use",
            remedy="let recordings last longer, or widen the ranges",
        )
    return predictions


def _sensed(
    pool: Pool[ExperimentPredictor],
    plan: Sequence[Experiment],
    sensors: Sequence[Signal],
    parted: int,
) -> Iterator[tuple[Signal, Prediction]]:
    """The best of some experiments with each sensor more that parts more groups by it.

    Models are fitted again in full in the best of those where they part as linearised.
    """

    def tried(sensor: Signal, some: Sequence[Experiment], in_full: bool) -> list[_Task]:
        return [
            pool.submit(ExperimentPredictor.predict_experiment, one, number, sensor, in_full)
            for number, one in enumerate(some, 1)
        ]

    def parting(tasks: Sequence[_Task]) -> list[Prediction]:
        predictions = [one for task in tasks if (one := task.result()) is not None]
        return [prediction for prediction in predictions if len(prediction.groups) > parted]

    once = [(sensor, tried(sensor, plan, False)) for sensor in sensors]
    again = []
    for sensor, tasks in once:
        best = [prediction.candidate for prediction in chosen(parting(tasks))[:1]]
        again.append((sensor, tried(sensor, best, True)))
    for sensor, tasks in again:
        if better := parting(tasks):
            yield sensor, chosen(better)[0]


def _confirmed(pool: Pool[ExperimentPredictor], ranked: Sequence[Prediction]) -> list[Prediction]:
    """The best first: rivals that bend far are known by full fits alone, which cost more.

    They are made of the best as linearised, until what is proposed is better than all others
    promise. What not all rivals claim comes last.
    """
    confirmed: list[Prediction] = []
    doubtful: list[Prediction] = []
    left = list(ranked)
    tasks: list[_Task] = []
    while left and len(confirmed) < _CONFIRMED:
        # A few ahead: no processor waits for the last one of a part.
        wanted = min(_TOGETHER + pool.workers - 1, _CONFIRMED - len(confirmed))
        some = enumerate(left[len(tasks) : wanted], len(tasks) + 1)
        tasks += [pool.submit(ExperimentPredictor.confirm, one, number) for number, one in some]
        results, tasks = [task.result() for task in tasks[:_TOGETHER]], tasks[_TOGETHER:]
        judged, left = left[: len(results)], left[len(results) :]
        doubtful += [signal for signal, well in zip(judged, results, strict=True) if well is None]
        sure = [prediction for prediction in results if prediction is not None]
        if not sure:
            continue
        confirmed = chosen([*confirmed, *sure])
        last = confirmed[min(PROPOSED, len(confirmed)) - 1]
        if left and chosen([last, left[0]])[0] is last:
            break
    for task in tasks:
        task.cancel()
    return [*confirmed, *left, *doubtful]


def _proposal(system: System, experiments: Experiments, prediction: Prediction) -> RankedExperiment:
    duration = float(prediction.case.time[-1] - prediction.case.time[0])
    cost = float(experiments.cost.formula({**prediction.candidate.numbers, "duration": duration}))
    return RankedExperiment(
        prediction.candidate.text(system), cost, experiments.cost.unit, prediction
    )
