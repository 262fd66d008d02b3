"""The next experiment: which recording would tell apart what a diagnosis left undecided.

rivals of a diagnosis, what may be varied -> recordings that the first rival predicts
    -> what the others leave of them -> separation, chance, cost
"""

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from workbench.case import Case
from workbench.diagnosis import build_everything, catalogue, choose
from workbench.diagnosis.rivals import Rivals
from workbench.diagnosis.samples import channels
from workbench.diagnosis.search import Reporter
from workbench.errors import InputError
from workbench.experiments.candidates import (
    Experiment,
    every_setting,
    other_profiles,
    other_settings,
    some_settings,
)
from workbench.experiments.claims import counts
from workbench.experiments.outcome import PROPOSED, NextStop, RankedExperiment, chosen
from workbench.experiments.prediction import (
    Outlook,
    Prediction,
    claimed_alike,
    predicted_cases,
    predictions,
    refitted_predictions,
)
from workbench.expression import Expression
from workbench.modelica import read_library
from workbench.system import Channel, System
from workbench.system_experiments import Experiments
from workbench.system_parts import Signal

__all__ = ["NextStop", "RankedExperiment", "foreseen", "next_stop", "with_sensor"]

_SETTINGS = 3  # of which all profiles are tried
_TOGETHER = 6  # experiments of which models are fitted again at a time
_CONFIRMED = 24  # at most: a quarter of what is tried
_SENSED = 3  # experiments that are tried with further sensors


def next_stop(system: System, rivals: Rivals, workers: int, report: Reporter) -> NextStop:
    """Rank the experiments that a system allows by what they would tell.

    Settings are exchanged first and profiles then, once each, as coordinates of a design (R. K.
    Meyer, C. J. Nachtsheim, 1995, Technometrics 37, 60-69): of a grid of both most tell nothing.

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
    with _open(system, rivals, report) as asked:
        experiments = asked.experiments
        every, plan = every_setting(experiments), some_settings(experiments)
        named = " with ".join(rivals.models[0].effects)
        report(f"{len(plan)} of {len(every)} settings, as {named} predicts")
        ranked = chosen(predictions(asked, _cases(asked, plan, workers), workers))
        near = [
            one
            for best in ranked[:_SETTINGS]
            for one in other_settings(experiments, best.candidate)
        ]
        beside = [one for one in every if one in near and one not in plan]
        if beside:
            report(f"{len(beside)} others that differ from the best {_SETTINGS} in one setting")
            ranked = chosen([*ranked, *predictions(asked, _cases(asked, beside, workers), workers)])
        best = [one.candidate for one in ranked[:_SETTINGS]]
        more = [one for setting in best for one in other_profiles(experiments, setting)]
        if more:
            report(f"{len(more)} profiles with the best {len(best)}")
            ranked = chosen([*ranked, *predictions(asked, _cases(asked, more, workers), workers)])
        if len(rivals.models) > 1:
            report("the best, with the models fitted again in full")
            ranked = _confirmed(asked, ranked, workers)
        sensors = {}
        first = ranked[0]
        if len(first.groups) < len(rivals.models):
            for sensor in experiments.sensors:
                report(f"the same with a sensor of {sensor.label}")
                sensed = replace(asked, system=with_sensor(system, sensor))
                tried = [one.candidate for one in ranked[:_SENSED]]
                cases = _cases(sensed, tried, workers)
                found = chosen(refitted_predictions(sensed, cases, workers))[0]
                if len(found.groups) > len(first.groups):
                    sensors[sensor.label] = _proposal(sensed.system, experiments, found)
    return NextStop(
        system=system,
        rivals=rivals,
        channels=channels(system, rivals.signals),
        tried=tuple(_proposal(system, experiments, one) for one in ranked),
        sensors=sensors,
    )


def foreseen(
    system: System, rivals: Rivals, plan: Sequence[Experiment], workers: int
) -> list[RankedExperiment]:
    """What experiments of one's own choice would tell, best first; those that would count.

    Raises
    ------
    InputError
        As `next_stop`.
    """
    with _open(system, rivals, lambda _: None) as asked:
        ranked = chosen(refitted_predictions(asked, _cases(asked, plan, workers), workers))
        return [_proposal(system, asked.experiments, one) for one in ranked]


@contextmanager
def _open(system: System, rivals: Rivals, report: Reporter) -> Iterator[Outlook]:
    """The machine as its models predict it."""
    experiments = system.experiments
    if experiments is None:
        raise InputError(
            where=str(system.source),
            found="no table [next]",
            expected="what may be varied in the next recording",
            remedy="write it, see docs/next-stop.md",
        )
    library = read_library(system.library)
    effects = {one.name: one for one in choose(rivals.effects, catalogue(system, library))}
    with tempfile.TemporaryDirectory() as scratch:
        everything = Path(scratch) / "AllEffects.fmu"
        report(f"compiling {len(effects)} effects")
        build_everything(system, library, list(effects.values()), everything)
        yield Outlook(everything, system, experiments, rivals, effects)


def _confirmed(asked: Outlook, ranked: Sequence[Prediction], workers: int) -> list[Prediction]:
    """The best first: rivals that bend far are known by full fits alone, which cost more.

    They are made of the best as linearised, until what is proposed is better than all others
    promise. What not all rivals claim comes last.
    """
    confirmed: list[Prediction] = []
    doubtful: list[Prediction] = []
    left = list(ranked)
    while left and len(confirmed) < _CONFIRMED:
        some, left = left[:_TOGETHER], left[_TOGETHER:]
        alike = claimed_alike(asked, [(one.candidate, one.case) for one in some], workers)
        doubtful += [one for one, well in zip(some, alike, strict=True) if not well]
        planned = [(o.candidate, o.case) for o, well in zip(some, alike, strict=True) if well]
        if not planned:
            continue
        confirmed = chosen([*confirmed, *refitted_predictions(asked, planned, workers)])
        last = confirmed[min(PROPOSED, len(confirmed)) - 1]
        if left and chosen([last, left[0]])[0] is last:
            break
    return [*confirmed, *left, *doubtful]


def _cases(
    asked: Outlook, plan: Sequence[Experiment], workers: int
) -> list[tuple[Experiment, Case]]:
    """Recordings of experiments, those that would count."""
    cases = predicted_cases(asked, plan, asked.rivals.models[0], workers)
    planned = [pair for pair in zip(plan, cases, strict=True) if counts(pair[1], asked.system)]
    if not planned:
        raise InputError(
            where=f"{asked.system.source}, [next]",
            found="no experiment with enough samples that count",
            expected="one that a diagnosis can use",
            remedy="let recordings last longer, or widen the ranges",
        )
    return planned


def with_sensor(system: System, sensor: Signal) -> System:
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
