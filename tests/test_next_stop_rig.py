"""The next stop on the virtual rig: it parts what stops that are all alike did not."""

import json
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from workbench.diagnosis import Outcome, problem_of
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.rivals import Rivals
from workbench.diagnosis.run import with_effects
from workbench.machines.wheelset.rig import (
    CONSTANT_PADS,
    SCENARIOS,
    Effects,
    plant,
    proposed_stop,
    stop_of,
)
from workbench.recordings.case import Case, read_case, read_cases
from workbench.runtime.engine import ALONE, silent
from workbench.studies.design import NextStop, RankedExperiment, next_stop, predict_experiments
from workbench.studies.design.candidates import Experiment, all_settings
from workbench.studies.power.run import (
    diagnose_set,
    rivals_of_set,
)
from workbench.system.experiments import Setting
from workbench.system.system import System

from .distances import parted
from .recordings import record

EFFECTS = ["PressureDependentPadFriction", "BeddingIn"]
PLANTED = plant(CONSTANT_PADS, ["pressure_exponent=0.04"])


@pytest.fixture(scope="module")
def one_speed(system) -> System:
    """The rig where only the pressure may be varied."""
    asked = system.experiments
    first = {name: values[:1] for name, values in asked.conditions.items()}
    further = tuple(replace(setting, values=setting.values[:1]) for setting in asked.further)
    return replace(system, experiments=replace(asked, conditions=first, further=further))


def two_stops(system: System, effects: Effects, folder: Path) -> list[Case]:
    """Two stops from 80 km/h at 2.7 bar."""
    for seed, name in enumerate(("24_alike_80_2.7", "25_alike_80_2.7")):
        record(SCENARIOS[name], seed, effects, folder / name)
    return [read_case(path, system) for path in sorted(folder.iterdir())]


@pytest.fixture(scope="module")
def alike(system, tmp_path_factory) -> list[Case]:
    return two_stops(system, PLANTED, tmp_path_factory.mktemp("alike"))


QUIET = {"workers": 1, "report": lambda _: None}


@pytest.fixture(scope="module")
def undecided(one_speed, alike, once) -> Outcome:
    return once(
        "undecided stops",
        lambda out: wb.diagnose(one_speed, alike, effects=EFFECTS, out=out, **QUIET),
    )


@pytest.fixture(scope="module")
def proposed(undecided, once) -> NextStop:
    return once("next stop", lambda _: wb.next_stop(undecided, **QUIET))


def made(experiment: RankedExperiment, system: System, folder: Path) -> Case:
    """The stop as the rig makes it."""
    (folder / "next.json").write_text(json.dumps({"tried": [experiment.to_dict()]}))
    stop = proposed_stop(folder, system)
    record(stop, 30, PLANTED, folder / stop.name)
    return read_case(folder / stop.name, system)


def test_the_proposed_stop_parts_what_stops_alike_did_not(
    one_speed, alike, undecided, proposed, tmp_path
):
    (cause,) = undecided.diagnosis.causes
    assert {cause.effect.name, *cause.confusable_with} == set(EFFECTS)
    cases = [*alike, made(proposed.tried[0], one_speed, tmp_path)]
    outcome = wb.diagnose(one_speed, cases, effects=EFFECTS, out=tmp_path, **QUIET)
    (cause,) = outcome.diagnosis.causes
    assert (cause.effect.name, cause.confusable_with) == (EFFECTS[0], ())


@pytest.mark.parametrize("rank", [0, -1])
def test_the_separation_is_what_the_stop_then_shows(rank, one_speed, alike, proposed, tmp_path):
    """Of the best stop and of the last, within 20 %; noise moves it by one standard deviation."""
    row = proposed.tried[rank]
    true, other = (proposed.names.index(name) for name in EFFECTS)
    expected = np.sqrt(row.prediction.pairwise[true, other])
    shown = parted(one_speed, [*alike, made(row, one_speed, tmp_path)], *EFFECTS)
    assert shown == pytest.approx(expected, rel=0.2, abs=2.0)
    assert (row.prediction.right > 0.5) == (rank == 0)


def test_full_fits_end_within_half_a_deviation_of_where_more_rounds_lead(
    one_speed, undecided, proposed, monkeypatch
):
    """Of some stops: what is left moves by half of what noise moves it by, at most."""
    rivals = undecided.rivals
    plan = [row.prediction.candidate for row in proposed.tried[1::2]]
    ended = predict_experiments(one_speed, rivals, plan, workers=1)
    least = Fit.least
    monkeypatch.setattr(Fit, "least", lambda *given: least(*given[:4]))
    further = predict_experiments(one_speed, rivals, plan, workers=1)
    at, then = (
        {row.text: np.sqrt(np.abs(row.prediction.pairwise)) for row in some}
        for some in (ended, further)
    )
    assert at.keys() == then.keys()
    for text, separation in at.items():
        np.testing.assert_allclose(separation, then[text], rtol=0.0, atol=0.5)


@pytest.mark.long
def test_what_no_stop_parts_is_said_and_the_sensor_that_would(one_speed, tmp_path):
    """A load cell and a torque that read too much are told apart by neither pressure nor time."""
    asked = one_speed.experiments
    steps = tuple(
        replace(given, profiles=("step",)) if given in asked.varied else given
        for given in asked.inputs
    )
    rig = replace(one_speed, experiments=replace(asked, inputs=steps))
    cases = two_stops(rig, plant(CONSTANT_PADS, ["fx_gain=0.02"]), tmp_path / "stops")
    names = ["FxGain", "DriveTorqueGain"]
    outcome = wb.diagnose(rig, cases, effects=names, out=tmp_path, **QUIET)
    (cause,) = outcome.diagnosis.causes
    assert {cause.effect.name, *cause.confusable_with} == set(names)
    proposed = wb.next_stop(outcome, **QUIET)
    assert not proposed.parts
    assert proposed.sentence.startswith(
        "No experiment here likely discriminates FxGain and DriveTorqueGain"
    )
    # The force itself, and that of a disc: three of them are what slows the wheelset.
    of_a_disc = "friction force of the disc that brakes least, at its caliper"
    assert list(proposed.sensors) == ["force in the guidance arms", of_a_disc]


def other_surface(system: System, rail: str, imitated: float) -> Experiment:
    """A stop from 160 km/h with a staircase, on a rail, with an inertia that the drive imitates."""
    fixed: dict[str, object] = {"initial_speed": 160.0 / 3.6, "direction": 1}
    fixed |= {"wheel_rail": rail, "wheel_load": 80e3, "imitated": imitated}
    fixed |= {"disc_temperature": 333.15}
    (chosen,) = (
        experiment
        for experiment in all_settings(system.experiments)
        if all(experiment.settings[name].value == value for name, value in fixed.items())
    )
    return chosen


def of_two(
    system: System, planted: str, names: list[str], folder: Path
) -> tuple[list[Case], Rivals, Effects]:
    """Two stops alike with something planted, what they leave undecided, and what was planted."""
    effects = plant(CONSTANT_PADS, [planted])
    cases = two_stops(system, effects, folder / "stops")
    outcome = wb.diagnose(system, cases, effects=names, out=folder, **QUIET)
    assert [model.effects for model in outcome.rivals.models] in (
        [(a,), (b,)] for a, b in permutations(names)
    )
    return cases, outcome.rivals, effects


@pytest.mark.long
@pytest.mark.parametrize(
    ("planted", "names", "rail", "imitated"),
    [
        ("creep_stiffness=0.16", ["CreepStiffness", "WheelLoad"], "wet", 7840.0),
        ("fx_gain=0.016", ["FxGain", "DriveTorqueGain"], "dry", 0.0),
    ],
)
def test_rivals_that_bend_far_are_fitted_again_in_full(
    planted, names, rail, imitated, system, tmp_path
):
    """Where friction is calibrated anew, both fit; what derivatives promise is not shown then.

    The decision is that of the diagnosis, which tells apart beyond 40 of chi-squared.
    """
    cases, rivals, effects = of_two(system, planted, names, tmp_path)
    (experiment,) = predict_experiments(system, rivals, [other_surface(system, rail, imitated)], 1)
    true, other = ([model.effects for model in rivals.models].index((name,)) for name in names)
    expected = np.sqrt(max(0.0, experiment.prediction.pairwise[true, other]))
    stop = stop_of(experiment.to_dict(), system)
    record(stop, 30, effects, tmp_path / stop.name)
    shown = parted(system, [*cases, read_case(tmp_path / stop.name, system)], *names)
    assert (shown**2 > 40.0) == (expected**2 > 40.0) == (imitated < 7840.0)
    assert shown == pytest.approx(expected, rel=0.4, abs=4.0)


@pytest.mark.long
def test_what_derivatives_alone_promise_is_not_proposed(system, tmp_path):
    """On wet rails, derivatives part stiffness from load by ten deviations; full fits do not."""
    _, rivals, _ = of_two(system, "creep_stiffness=0.16", ["CreepStiffness", "WheelLoad"], tmp_path)
    proposed = next_stop(system, rivals, ALONE)
    assert not proposed.parts
    assert proposed.tried[0].prediction.separation < 4.0
    assert max(experiment.prediction.separation for experiment in proposed.tried) < 6.4


@pytest.mark.long
def test_what_one_rival_alone_takes_beyond_the_claims_is_proposed_last(system, tmp_path):
    """On a light axle and a wet rail less load lets the wheel slide, a softer contact does not."""
    asked = system.experiments
    light = {**asked.conditions, "wheel_load": (Setting(60e3, "60 kN"),)}
    rig = replace(system, experiments=replace(asked, conditions=light))
    _, rivals, _ = of_two(rig, "creep_stiffness=-0.16", ["CreepStiffness", "WheelLoad"], tmp_path)
    proposed = next_stop(rig, rivals, ALONE)
    assert not proposed.parts
    assert proposed.tried[0].prediction.separation < 4.0
    # Of the last, which both do not claim: what a wheel that slides would show.
    assert proposed.tried[-1].prediction.separation > 10.0


ROOT = Path(__file__).parents[1]
RADIUS = ROOT.parent / "shared" / "recordings" / "labelled" / "radius"


@pytest.mark.long
def test_a_faster_stop_is_proposed_and_parts_the_radii(system, tmp_path):
    """By the lightest stop alone, a wheel of 1.5 mm less and a roller of 2.3 mm more look alike."""
    if not RADIUS.is_dir():
        pytest.skip("needs the independent recordings, which have licences of their own")
    asked, all_effects = with_effects(problem_of(system), tmp_path, silent)
    light = read_cases([RADIUS / "01_dry_80_1.5"], system)
    _, rivals = rivals_of_set(replace(asked, cases=light), all_effects)
    assert {model.effects for model in rivals.models} == {("WheelRadius",), ("RollerRadius",)}
    assert "initial speed 160 km/h" in next_stop(system, rivals, ALONE).tried[0].text
    both = [*light, *read_cases([RADIUS / "06_dry_160_3.6_rev"], system)]
    (cause,) = diagnose_set(replace(asked, cases=both), all_effects).causes
    assert (cause.effect.name, cause.confusable_with) == ("WheelRadius", ())
