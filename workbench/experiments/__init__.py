"""The next experiment: which recording would tell apart what a diagnosis left undecided.

rivals of a diagnosis, what may be varied -> recordings that the first rival predicts
    -> what the others leave of them -> separation, chance, cost
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from workbench.case import Case
from workbench.diagnosis import Effect, build_everything, catalogue, choose
from workbench.diagnosis.rivals import Rivals
from workbench.diagnosis.samples import channels
from workbench.diagnosis.search import Reporter
from workbench.errors import InputError
from workbench.experiments.candidates import Experiment, candidates
from workbench.experiments.outcome import NextStop, RankedExperiment, chosen
from workbench.experiments.prediction import Prediction, predicted_cases, predictions
from workbench.expression import Expression
from workbench.modelica import read_library
from workbench.system import Channel, System
from workbench.system_experiments import Experiments
from workbench.system_parts import Signal

__all__ = ["NextStop", "RankedExperiment", "next_stop"]

_SENSED = 3  # experiments that are tried with further sensors


def next_stop(system: System, rivals: Rivals, workers: int, report: Reporter) -> NextStop:
    """Rank the experiments that a system allows by what they would tell.

    Of several rivals, by how many pairs a diagnosis would tell apart, then by the least distance
    that is left between two; of a single one, by how sure its sizes would be.

    Parameters
    ----------
    system : that was diagnosed.
    rivals : what its recordings leave undecided.
    report : takes a line on what is being done.

    Raises
    ------
    InputError
        If the system does not say what may be varied, or no recording of it would count.
    """
    experiments = system.experiments
    if experiments is None:
        raise InputError(
            where=str(system.source),
            found="no table [next]",
            expected="what may be varied in the next recording",
            remedy="write it, see docs/next-stop.md",
        )
    library = read_library(system.library)
    every = catalogue(system, library)
    effects = {one.name: one for one in choose(rivals.effects, every)}
    with tempfile.TemporaryDirectory() as scratch:
        everything = Path(scratch) / "AllEffects.fmu"
        report(f"compiling {len(effects)} effects")
        build_everything(system, library, list(effects.values()), everything)
        rig = _Rig(everything, experiments, rivals, effects, workers)
        plan = candidates(experiments)
        report(f"{len(plan)} experiments, as {' with '.join(rivals.models[0].effects)} predicts")
        cases = rig.cases(system, plan)
        report(f"what {len(rivals.models)} models leave of {len(cases)} recordings")
        ranked = chosen(rig.predictions(system, cases))
        sensors = {}
        best = ranked[0]
        if len(best.groups) < len(rivals.models):
            for sensor in experiments.sensors:
                report(f"the same with a sensor of {sensor.label}")
                sensed = _with_sensor(system, sensor)
                tried = rig.cases(sensed, [one.candidate for one in ranked[:_SENSED]])
                more = chosen(rig.predictions(sensed, tried))[0]
                if len(more.groups) > len(best.groups):
                    sensors[sensor.label] = _proposal(sensed, experiments, more)
    return NextStop(
        system=system,
        rivals=rivals,
        channels=channels(system, rivals.signals),
        tried=tuple(_proposal(system, experiments, one) for one in ranked),
        sensors=sensors,
    )


class _Rig:
    """Experiments on a machine as its models predict them.

    Parameters
    ----------
    everything : FMU with all effects.
    """

    def __init__(
        self,
        everything: Path,
        experiments: Experiments,
        rivals: Rivals,
        effects: Mapping[str, Effect],
        workers: int,
    ) -> None:
        self._everything, self._experiments = everything, experiments
        self._rivals, self._effects, self._workers = rivals, effects, workers

    def cases(self, system: System, plan: Sequence[Experiment]) -> list[tuple[Experiment, Case]]:
        """Recordings that would count."""
        found = predicted_cases(
            *(self._everything, system, self._experiments, self._rivals, self._effects),
            *(plan, self._workers),
        )
        if not found:
            raise InputError(
                where=f"{system.source}, [next]",
                found="no experiment with enough samples that count",
                expected="one that a diagnosis can use",
                remedy="let recordings last longer, or widen the ranges",
            )
        return found

    def predictions(
        self, system: System, planned: Sequence[tuple[Experiment, Case]]
    ) -> list[Prediction]:
        """What they would tell."""
        return predictions(
            *(self._everything, system, self._experiments, self._rivals, self._effects),
            *(planned, self._workers),
        )


def _with_sensor(system: System, sensor: Signal) -> System:
    """The system with a further signal that is compared."""
    channel = Channel(
        sensor.name,
        sensor.unit,
        sensor.label,
        sensor.shown,
        Expression(sensor.name, f"{system.source}, [next.sensors.{sensor.name}]"),
    )
    compared = replace(system.comparison, channels=(*system.comparison.channels, channel))
    return replace(system, judged=(*system.judged, sensor), comparison=compared)


def _proposal(system: System, experiments: Experiments, one: Prediction) -> RankedExperiment:
    duration = float(one.case.time[-1] - one.case.time[0])
    cost = float(experiments.cost.formula({**one.candidate.numbers, "duration": duration}))
    return RankedExperiment(one.candidate.text(system), cost, experiments.cost.unit, one)
