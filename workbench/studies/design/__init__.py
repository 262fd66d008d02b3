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
from workbench.diagnosis.effects.extension import variables
from workbench.diagnosis.inference.rivals import Rivals
from workbench.diagnosis.problem import library_of
from workbench.errors import InputError
from workbench.runtime.engine import Engine
from workbench.runtime.pool import Pool
from workbench.studies.design.candidates import (
    Experiment,
    all_settings,
    other_profiles,
    other_settings,
    settings_fraction,
)
from workbench.studies.design.outcome import PROPOSED, NextStop, RankedExperiment, rank
from workbench.studies.design.prediction import (
    DesignProblem,
    ExperimentPredictor,
    Prediction,
    open_predictor,
    with_sensor,
)
from workbench.system.experiments import Experiments
from workbench.system.parts import Signal
from workbench.system.system import System

__all__ = ["NextStop", "RankedExperiment", "next_stop", "predict_experiments", "with_sensor"]

_Task = Future[Prediction | None]

_SETTINGS = 3  # of which all profiles are predicted
_TOGETHER = 6  # experiments of which models are fitted again at a time
_CONFIRMED = 24  # at most: a quarter of those that are predicted
_SENSED = 3  # experiments that are predicted with further sensors


def next_stop(system: System, rivals: Rivals, engine: Engine) -> NextStop:
    """Rank the experiments that a system allows by what they would tell.

    Settings are exchanged first and profiles then, once each, as coordinates of a design (R. K.
    Meyer, C. J. Nachtsheim, 1995, Technometrics 37, 60-69): of a grid of both most tell nothing.

    Of several rivals, by how many pairs a diagnosis would tell apart, then by the least distance
    that is left between two; of a single one, by how sure its sizes would be.
    """
    with _open(system, rivals, engine) as (experiments, pool):
        grid, plan = all_settings(experiments), settings_fraction(experiments)
        named = " with ".join(rivals.models[0].effects)
        engine.report(f"{len(plan)} of {len(grid)} settings, as {named} predicts")
        ranked = rank(_predict_all(system, pool, plan))
        best = [prediction.candidate for prediction in ranked[:_SETTINGS]]
        near = [other for setting in best for other in other_settings(experiments, setting)]
        beside = [setting for setting in grid if setting in near and setting not in plan]
        if beside:
            engine.report(
                f"{len(beside)} others that differ from the best {_SETTINGS} in one setting"
            )
            ranked = rank([*ranked, *_predict_all(system, pool, beside)])
        best = [prediction.candidate for prediction in ranked[:_SETTINGS]]
        more = [other for setting in best for other in other_profiles(experiments, setting)]
        if more:
            engine.report(f"{len(more)} profiles with the best {len(best)}")
            ranked = rank([*ranked, *_predict_all(system, pool, more)])
        if len(rivals.models) > 1:
            engine.report("the best, with the models fitted again in full")
            ranked = _rank_by_full_fits(pool, ranked)
        sensors = {}
        groups = len(ranked[0].groups)
        if groups < len(rivals.models) and experiments.sensors:
            engine.report("the same with further sensors")
            best = [prediction.candidate for prediction in ranked[:_SENSED]]
            for sensor, prediction in _best_with_sensors(pool, best, experiments.sensors, groups):
                sensors[sensor.label] = _proposal(with_sensor(system, sensor), prediction)
    return NextStop(
        system=system,
        rivals=rivals,
        channels=channels(system, rivals.signals),
        tried=tuple(_proposal(system, prediction) for prediction in ranked),
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
    with _open(system, rivals, Engine(workers)) as (_, pool):
        ranked = rank(_predict_all(system, pool, plan, in_full=True))
        return [_proposal(system, prediction) for prediction in ranked]


@contextmanager
def _open(
    system: System, rivals: Rivals, engine: Engine
) -> Iterator[tuple[Experiments, Pool[ExperimentPredictor]]]:
    """What the system allows, and workers with its model."""
    experiments, library = system.experiments, library_of(system)
    if library is None:
        raise InputError(
            where=str(system.source),
            found=f"an FMU alone, without {system.library.name}",
            expected="the Modelica library of the model, in which candidates are simulated",
            remedy="put it beside the system file, and name the class of the model in [models]. "
            "Without it, the diagnosis says beside each effect what would discriminate it",
        )
    if experiments is None:
        raise InputError(
            where=str(system.source),
            found="no table [next]",
            expected="what may be varied in the next recording",
            remedy="write it, see docs/next-stop.md",
        )
    effects = {effect.name: effect for effect in choose(rivals.effects, catalogue(system, library))}
    for model in rivals.models:
        for effect, parameter in model.sizes:
            part = "cosine" if parameter == "amplitude" else parameter
            if not effects[effect].late and not variables(effects[effect], part):
                raise InputError(
                    where=f"the diagnosis, candidates, {effect}",
                    found=f"a size '{parameter}'",
                    expected="one that the effect has",
                    remedy="give the summary that 'workbench diagnose' wrote, as it wrote it",
                )
    with tempfile.TemporaryDirectory() as folder:
        everything = Path(folder) / "AllEffects.fmu"
        engine.report(f"compiling {len(effects)} effects")
        build_everything(system, library, list(effects.values()), everything)
        problem = DesignProblem(everything, system, rivals, effects)
        with Pool(engine.workers, open_predictor, problem) as pool:
            yield experiments, pool


def _predict_all(
    system: System,
    pool: Pool[ExperimentPredictor],
    plan: Sequence[Experiment],
    *,
    in_full: bool = False,
) -> list[Prediction]:
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


def _best_with_sensors(
    pool: Pool[ExperimentPredictor],
    plan: Sequence[Experiment],
    sensors: Sequence[Signal],
    groups: int,
) -> Iterator[tuple[Signal, Prediction]]:
    """Each further sensor by which an experiment of the plan leaves more groups, with the best.

    Models are fitted again in full in the best of those that discriminate as linearised.
    """

    def submit(sensor: Signal, experiments: Sequence[Experiment], in_full: bool) -> list[_Task]:
        return [
            pool.submit(ExperimentPredictor.predict_experiment, experiment, number, sensor, in_full)
            for number, experiment in enumerate(experiments, 1)
        ]

    def discriminating(tasks: Sequence[_Task]) -> list[Prediction]:
        predictions = (task.result() for task in tasks)
        return rank([p for p in predictions if p is not None and len(p.groups) > groups])

    linear = [(sensor, submit(sensor, plan, False)) for sensor in sensors]
    full = []
    for sensor, tasks in linear:
        best = [prediction.candidate for prediction in discriminating(tasks)[:1]]
        full.append((sensor, submit(sensor, best, True)))
    for sensor, tasks in full:
        if better := discriminating(tasks):
            yield sensor, better[0]


def _rank_by_full_fits(
    pool: Pool[ExperimentPredictor], ranked: Sequence[Prediction]
) -> list[Prediction]:
    """Rank again: of rivals that bend far only full fits are right, which cost more.

    They are made of the best as linearised, until what is proposed is better than all others
    promise. Experiments outside the validity range of a rival come last.
    """
    confirmed: list[Prediction] = []
    doubtful: list[Prediction] = []
    left = list(ranked)
    tasks: list[_Task] = []
    while left and len(confirmed) < _CONFIRMED:
        # A few ahead: no processor waits for the last one of a part.
        wanted = min(_TOGETHER + pool.workers - 1, _CONFIRMED - len(confirmed))
        tasks += [
            pool.submit(ExperimentPredictor.confirm, prediction, number)
            for number, prediction in enumerate(left[len(tasks) : wanted], len(tasks) + 1)
        ]
        refits, tasks = [task.result() for task in tasks[:_TOGETHER]], tasks[_TOGETHER:]
        linear, left = left[: len(refits)], left[len(refits) :]
        doubtful += [p for p, refit in zip(linear, refits, strict=True) if refit is None]
        sure = [refit for refit in refits if refit is not None]
        if not sure:
            continue
        confirmed = rank([*confirmed, *sure])
        last = confirmed[min(PROPOSED, len(confirmed)) - 1]
        if left and rank([last, left[0]])[0] is last:
            break
    for task in tasks:
        task.cancel()
    return [*confirmed, *left, *doubtful]


def _proposal(system: System, prediction: Prediction) -> RankedExperiment:
    assert system.experiments is not None
    cost, candidate = system.experiments.cost, prediction.candidate
    duration = float(prediction.case.time[-1] - prediction.case.time[0])
    value = float(cost.formula({**candidate.numbers, "duration": duration}))
    return RankedExperiment(candidate.text(system), value, cost.unit, prediction)
