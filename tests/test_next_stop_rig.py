"""The next stop on the virtual rig: it parts what stops that are all alike did not."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from workbench.case import Case, read_case
from workbench.diagnosis import Outcome
from workbench.experiments import NextStop, RankedExperiment
from workbench.system import System
from workbench.wheelset.rig import CONSTANT_PADS, SCENARIOS, Effects, plant, proposed_stop

from .distances import parted
from .recordings import record

EFFECTS = ["PressureDependentPadFriction", "BeddingIn"]
PLANTED = plant(CONSTANT_PADS, ["pressure_exponent=0.04"])


@pytest.fixture(scope="module")
def one_speed(system: System) -> System:
    """The rig where only the pressure may be varied."""
    assert system.experiments is not None
    settings = {name: values[:1] for name, values in system.experiments.settings.items()}
    return replace(system, experiments=replace(system.experiments, settings=settings))


def two_stops(system: System, effects: Effects, folder: Path) -> list[Case]:
    """Two stops from 80 km/h at 2.7 bar."""
    for seed, name in enumerate(("24_alike_80_2.7", "25_alike_80_2.7")):
        record(SCENARIOS[name], seed, effects, folder / name)
    return [read_case(one, system) for one in sorted(folder.iterdir())]


@pytest.fixture(scope="module")
def alike(system: System, tmp_path_factory: pytest.TempPathFactory) -> list[Case]:
    pytest.importorskip("rumoca", reason="no Modelica compiler")
    return two_stops(system, PLANTED, tmp_path_factory.mktemp("alike"))


@pytest.fixture(scope="module")
def undecided(
    one_speed: System, alike: list[Case], tmp_path_factory: pytest.TempPathFactory
) -> Outcome:
    out = tmp_path_factory.mktemp("undecided")
    return wb.diagnose(one_speed, alike, effects=EFFECTS, out=out, workers=1, report=lambda _: None)


@pytest.fixture(scope="module")
def proposed(undecided: Outcome) -> NextStop:
    return wb.next_stop(undecided, workers=1, report=lambda _: None)


def made(one: RankedExperiment, system: System, folder: Path) -> Case:
    """The stop as the rig makes it."""
    (folder / "next.json").write_text(json.dumps({"tried": [one.to_dict()]}))
    stop = proposed_stop(folder, system)
    record(stop, 30, PLANTED, folder / stop.name)
    return read_case(folder / stop.name, system)


def test_the_proposed_stop_parts_what_stops_alike_did_not(
    one_speed: System, alike: list[Case], undecided: Outcome, proposed: NextStop, tmp_path: Path
) -> None:
    (cause,) = undecided.diagnosis.causes
    assert {cause.effect.name, *cause.confusable_with} == set(EFFECTS)
    cases = [*alike, made(proposed.tried[0], one_speed, tmp_path)]
    then = wb.diagnose(
        one_speed, cases, effects=EFFECTS, out=tmp_path, workers=1, report=lambda _: None
    )
    (cause,) = then.diagnosis.causes
    assert (cause.effect.name, cause.confusable_with) == (EFFECTS[0], ())


@pytest.mark.parametrize("rank", [0, -1])
def test_the_separation_is_what_the_stop_then_shows(
    rank: int, one_speed: System, alike: list[Case], proposed: NextStop, tmp_path: Path
) -> None:
    """Of the best stop and of the last, within 20 %; noise moves it by one standard deviation."""
    one = proposed.tried[rank]
    true, other = (proposed.names.index(name) for name in EFFECTS)
    expected = np.sqrt(one.prediction.apart[true, other])
    shown = parted(one_speed, [*alike, made(one, one_speed, tmp_path)], *EFFECTS)
    assert shown == pytest.approx(expected, rel=0.2, abs=2.0)
    assert (one.prediction.right > 0.5) == (rank == 0)


@pytest.mark.long
def test_what_no_stop_parts_is_said_and_the_sensor_that_would(
    one_speed: System, tmp_path: Path
) -> None:
    """A load cell and a torque that read too much are told apart by neither pressure nor time."""
    pytest.importorskip("rumoca", reason="no Modelica compiler")
    asked = one_speed.experiments
    assert asked is not None
    steps = tuple(replace(one, profiles=("step",)) for one in asked.varied)
    rig = replace(one_speed, experiments=replace(asked, varied=steps))
    cases = two_stops(rig, plant(CONSTANT_PADS, ["fx_gain=0.02"]), tmp_path / "stops")
    names = ["FxGain", "DriveTorqueGain"]
    found = wb.diagnose(rig, cases, effects=names, out=tmp_path, workers=1, report=lambda _: None)
    (cause,) = found.diagnosis.causes
    assert {cause.effect.name, *cause.confusable_with} == set(names)
    proposed = wb.next_stop(found, workers=1, report=lambda _: None)
    assert not proposed.parts
    assert proposed.sentence.startswith(
        "No experiment here likely parts FxGain and DriveTorqueGain"
    )
    assert list(proposed.sensors) == ["force in the guidance arms"]
