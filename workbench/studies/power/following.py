"""Whether the recording that is proposed next discriminates what a set leaves together."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, TypedDict

import numpy as np

from workbench.diagnosis import Diagnosis
from workbench.diagnosis.inference.rivals import Rivals
from workbench.errors import InputError, WorkerError
from workbench.recordings.case import Case
from workbench.runtime.engine import ALONE, Engine, StepReporter
from workbench.studies.design import RankedExperiment, next_stop, predict_experiments, with_sensor
from workbench.studies.design.candidates import draw_experiment
from workbench.studies.power.planting import Group, Planting
from workbench.studies.power.run import (
    PowerStudy,
    Setup,
    distance,
    distances_in_set,
    rivals_of_set,
    work_off,
)
from workbench.studies.power.statistics import share
from workbench.studies.power.virtual_rig import FollowingRig

_DRAWN = 2  # experiments that are drawn for each set, to compare with
_NEAR = 0.2  # share of a separation
_NOISE = 2.0  # deviations by which noise moves it, in 95 %

SHARES = {
    "proposed": "groups that the recording which is proposed first parts",
    "drawn": "recordings that are drawn which part their group",
    "sensed": "groups that it parts with a sensor that is named, of those where one is",
    "answered": "groups that it parts, with that sensor where one is named",
    "foreseen": "groups that it parts, of those that it is foreseen to part",
    "never": "groups that it parts, of those that no experiment is foreseen to part",
    "separations": "separations of these recordings shown as predicted, within a fifth or noise",
}
"""Shares of `summarise_following`, by what they count."""


Separation = TypedDict("Separation", {"from": str, "predicted": float, "shown": float | None})
"""Separation of a candidate from the injected effect, predicted and shown by recordings [sigma]."""


class FollowingRecording(TypedDict):
    """An experiment that was made, and the verdict on all recordings with it."""

    experiment: str
    foreseen: bool  # whether it was predicted to leave the planted effect alone
    verdict: str
    named: list[str]  # causes, with those that are as good
    parts: bool  # whether the planted effect alone is named
    separations: list[Separation]


class SensedRecording(FollowingRecording):
    """The same with a further sensor."""

    sensor: str


@dataclass
class FollowingRow:
    """A set and the recordings that follow it, as followed.json has them."""

    rig: str  # options that make the set
    planted: str
    multiple: float
    # verdict, group: on the set: causes, with those that are as good
    verdict: str = "failed"
    group: list[str] = field(default_factory=list)
    # sentence, sensors: of the proposal: its answer, and sensors that it names
    sentence: str = ""
    sensors: list[str] = field(default_factory=list)
    # proposed, drawn, sensed: recordings as proposed, at random, with a sensor that is named
    proposed: FollowingRecording | None = None
    drawn: list[FollowingRecording] = field(default_factory=list)
    sensed: SensedRecording | None = None
    error: str = ""  # why it failed


def follow_proposals(
    groups: Sequence[Group], study: PowerStudy, engine: Engine
) -> tuple[list[dict[str, Any]], bool]:
    """Make sets with one cause each, make what is proposed next, and diagnose all of it.

    Parameters
    ----------
    groups : as planned; of them, sets with one cause of the catalogue.

    Returns
    -------
    rows : one for each set, see `FollowingRow`; sets whose cause is named alone have no proposal.
    interrupted : whether Ctrl-C ended the run; what was finished is in the rows.

    Raises
    ------
    InputError
        If the rig cannot make what is proposed.
    """
    if not isinstance(study.rig, FollowingRig):
        raise InputError(
            where=f"{study.system.source}, the plugin's 'virtual_rig'",
            found="a simulated rig that makes no experiments",
            expected="one with the method 'following'",
            remedy="write it as workbench.studies.power.virtual_rig.FollowingRig says",
        )
    sets = [planting for group in groups for planting in group if planting.kind == "single"]
    rows: dict[int, FollowingRow] = {}
    progress = StepReporter(engine.report, len(sets))

    def collect(planting: Planting, row: FollowingRow | WorkerError) -> None:
        if isinstance(row, WorkerError):
            row = _row_of(planting, repr(row))
        rows[sets.index(planting)] = row
        text = " or ".join(row.group) or row.verdict
        if (proposed := row.proposed) is not None:
            text += f" -> {' or '.join(proposed['named']) or proposed['verdict']}"
        progress.step(f"{row.planted}: {text}{row.error}")

    with study.setup() as setup:
        interrupted = work_off(setup, engine, partial(_row, _DRAWN), sets, collect)
    return [asdict(rows[k]) for k in sorted(rows)], interrupted


def summarise_following(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Count shares, see `SHARES`, of groups that hold the planted effect."""
    groups = [row for row in rows if row["proposed"] is not None]
    proposed = [group["proposed"] for group in groups]
    drawn = [recording for group in groups for recording in group["drawn"]]
    sensed = [group["sensed"] for group in groups if group["sensed"] is not None]
    separations = [s for recording in (*proposed, *drawn) for s in recording["separations"]]
    return {
        "proposed": share(recording["parts"] for recording in proposed),
        "drawn": share(recording["parts"] for recording in drawn),
        "sensed": share(recording["parts"] for recording in sensed),
        "answered": share((group["sensed"] or group["proposed"])["parts"] for group in groups),
        "foreseen": share(recording["parts"] for recording in proposed if recording["foreseen"]),
        "never": share(recording["parts"] for recording in proposed if not recording["foreseen"]),
        "separations": share(map(_agrees, separations)),
    }


def _agrees(separation: Mapping[str, Any]) -> bool:
    """Whether a separation is within a fifth, or what noise moves its square by: twice itself."""
    predicted, shown = separation["predicted"], separation["shown"]
    if shown is None:
        return False
    near = ((1.0 + _NEAR) ** 2 - 1.0) * predicted**2
    noise = _NOISE * 2.0 * max(abs(predicted), 1.0)
    return bool(abs(shown * abs(shown) - predicted * abs(predicted)) <= max(near, noise))


def _row_of(planting: Planting, error: str = "") -> FollowingRow:
    return FollowingRow(planting.options, planting.effects[0], planting.multiple, error=error)


def _row(drawn: int, setup: Setup, planting: Planting) -> FollowingRow:
    """Diagnose a set, make the recording that is proposed, and diagnose all of it."""
    row = _row_of(planting)
    try:
        _follow(row, drawn, setup, planting)
    except Exception as error:  # one set must not end a run of hours; it is counted
        row.error = repr(error)
    return row


def _follow(row: FollowingRow, drawn: int, setup: Setup, planting: Planting) -> None:
    (planted,) = planting.effects
    cases = setup.record(planting, setup.rig.simulate(planting.seed, planting.gains))
    diagnosis, rivals = rivals_of_set(setup.problem_of(cases), setup.everything)
    row.verdict, row.group = diagnosis.verdict, _names(diagnosis)
    if rivals is None or len(rivals.models) == 1:
        return
    experiments = setup.system.experiments
    proposal = next_stop(setup.system, rivals, ALONE)
    row.sentence, row.sensors = proposal.sentence, list(proposal.sensors)
    if planted not in proposal.names:
        return
    assert experiments is not None  # or nothing were proposed
    rng = np.random.default_rng(planting.seed)
    plan = [draw_experiment(experiments, rng) for _ in range(drawn)]

    def make(experiment: RankedExperiment, fitted: Setup = setup) -> FollowingRecording:
        return _diagnose_with(experiment, fitted, planting, rivals, cases)

    row.proposed = proposed = make(proposal.tried[0])
    if not proposed["foreseen"]:
        at = proposal.names.index(planted)
        for sensor in experiments.sensors:
            sensed = proposal.sensors.get(sensor.label)
            if sensed is not None and (at,) in sensed.prediction.groups:
                asked = replace(setup.problem, system=with_sensor(setup.system, sensor))
                fitted = replace(setup, problem=asked)
                row.sensed = {"sensor": sensor.label, **make(sensed, fitted)}
                break
    row.drawn = list(map(make, predict_experiments(setup.system, rivals, plan, 1)))


def _diagnose_with(
    experiment: RankedExperiment,
    setup: Setup,
    planting: Planting,
    rivals: Rivals,
    cases: Sequence[Case],
) -> FollowingRecording:
    """Make an experiment, diagnose all recordings with it, and compare with its prediction."""
    assert isinstance(setup.rig, FollowingRig)
    (planted,) = planting.effects
    names = [" with ".join(model.effects) for model in rivals.models]
    at = names.index(planted)
    rig = setup.rig.following(experiment.to_dict(), setup.system)
    more = replace(setup, rig=rig).record(planting, rig.simulate(planting.seed, planting.gains))
    others = [name for name in names if name != planted]
    asked = setup.problem_of([*cases, *more])
    diagnosis, shown = distances_in_set(asked, setup.everything, planted, others)
    named = _names(diagnosis)
    return {
        "experiment": experiment.text,
        "foreseen": (at,) in experiment.prediction.groups,
        "verdict": diagnosis.verdict,
        "named": named,
        "parts": named == [planted],
        "separations": [
            {
                "from": name,
                "predicted": distance(float(experiment.prediction.pairwise[at, j])),
                "shown": shown.get(name),
            }
            for j, name in enumerate(names)
            if j != at
        ],
    }


def _names(diagnosis: Diagnosis) -> list[str]:
    """Causes, with those that are as good."""
    return [
        name for cause in diagnosis.causes for name in (cause.effect.name, *cause.confusable_with)
    ]
