"""Hidden effects: what the diagnosis says of recordings that it knows nothing about.

The recordings come from the multibody model on the virtual rig, or from an independent simulator;
never from the model that diagnoses them.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from workbench.diagnosis import Diagnosis, Outcome, catalogue, diagnose
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.selection import anew
from workbench.diagnosis.inference.verdict import conclude
from workbench.diagnosis.problem import Problem
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.machines.wheelset.rig import CONSTANT_PADS, SCENARIOS, Effects, plant, select
from workbench.models.modelica import read_library
from workbench.recordings.case import Case, read_cases
from workbench.runtime.engine import Engine
from workbench.system.reader import with_model
from workbench.system.system import OBSERVER, System

from .recordings import record
from .systems import WHEELSET as SYSTEM

ROOT = Path(__file__).parent.parent
LIBRARY = read_library(ROOT / "modelica" / "WheelsetRig" / "package.mo")
EFFECTS = catalogue(SYSTEM, LIBRARY)
LABELLED = ROOT.parent / "shared" / "recordings" / "labelled"

# Three stops: two directions, two pressures, three speeds of order one.
STOPS = ("dry_80_1.5", "dry_120_3.6", "dry_120_2.7_rev")

# What the rig plants, the class that must be named, and a size that an engineer calls small.
PLANTED = {
    "speed_friction": ("SpeedDependentPadFriction", "slope", 0.08),
    "pressure_exponent": ("PressureDependentPadFriction", "exponent", 0.03),
    "fade": ("BrakeFade", "fade", 3e-4),
    "water_film": ("WaterFilm", "film", 0.25),
    "single_disc_film": ("SingleDiscWaterFilm", "film", 0.45),
    "bedding_in": ("BeddingIn", "loss", 0.08),
    "disc_thickness": ("DiscThicknessVariation", "amplitude", 0.012),
    "cylinder_lag": ("CylinderLag", "lag", 0.04),
    "return_spring": ("ReturnSpringPressure", "increase", 7000.0),
    "pressure_offset": ("PressureSensorOffset", "offset", 5000.0),
    "wheel_radius": ("WheelRadius", "delta", -5e-4),
    "out_of_round": ("OutOfRoundWheel", "amplitude", 2e-4),
    "wheel_load": ("WheelLoad", "gain", 0.12),
    "creep_stiffness": ("CreepStiffness", "gain", -0.12),
    "roller_inertia": ("RollerInertia", "gain", 0.024),
    "torque_gain": ("DriveTorqueGain", "gain", 0.015),
    "wheelset_losses": ("WheelsetLosses", "gain", 1.0),
    "roller_losses": ("RollerLosses", "gain", 1.0),
    "fx_gain": ("FxGain", "gain", 0.02),
    "fx_offset": ("FxOffset", "offset", 120.0),
    "apex_offset": ("ApexOffset", "offset", 1e-3),
    "speed_delay": ("SpeedSignalDelay", "delay", 0.008),
    "pole_ring": ("PoleRingEccentricity", "amplitude", 1e-3),
    "time_skew": ("LoggerTimeSkew[speeds]", "skew", 0.025),
    "roller_radius": ("RollerRadius", "delta", -5e-4),
}
# Others of cylinders, sensors and what turns are found below.
SHORT = {"fade"}
# Dry stops in which pressure only rises and no wheel slides do not show these.
HIDDEN = {"caliper_hysteresis", "adhesion_recovery", "wheel_inertia"}
OUTSIDE = {"friction_step": 0.05, "friction_ripple": 0.02, "drive_beat": 0.03}


def mostly_long(names: Iterable[str], short: Collection[str]) -> list[Any]:
    """Parameters of a test, marked `long` but for the short ones."""
    marks = {name: () if name in short else (pytest.mark.long,) for name in names}
    return [pytest.param(name, marks=marked) for name, marked in marks.items()]


@pytest.fixture
def diagnosed(everything) -> Callable[..., Diagnosis]:
    """Diagnoses recordings, by all effects or by those of some slots alone."""

    def run(
        cases: Sequence[Case], system: System = SYSTEM, slots: Collection[str] = ()
    ) -> Diagnosis:
        effects = catalogue(system, LIBRARY)
        effects = [e for e in effects if not slots or not set(slots).isdisjoint(e.slots)]
        # Alone: the tests themselves run side by side.
        with ResidualModel(ModelSource(everything, system, {}), cases) as simulations:
            return conclude(Fit(simulations, effects), effects, lambda _: None)

    return run


def recorded(folder: Path, effects: Effects, seed: int, names: Sequence[str] = STOPS) -> list[Case]:
    """Stops on the rig, with pads of constant friction but for what is planted."""
    for scenario in select(names):
        record(scenario, seed, effects, folder / scenario.name)
    return read_cases([folder], SYSTEM)


@pytest.fixture(scope="session")
def clean(tmp_path_factory) -> list[Case]:
    return recorded(tmp_path_factory.mktemp("clean"), Effects(), 31)


def test_every_effect_of_the_catalogue_is_planted_or_known_to_be_hidden():
    named = {name for name, _, _ in PLANTED.values()}
    hidden = {"CaliperHysteresis", "AdhesionRecovery", "FallingFriction", "WheelInertia"}
    assert named | hidden == {effect.name for effect in EFFECTS}


def test_a_wheel_load_that_is_said_is_no_finding_and_one_that_is_not_said_is(tmp_path, diagnosed):
    for scenario in select(STOPS):
        light = replace(scenario, conditions=replace(scenario.conditions, wheel_load=60e3))
        record(light, 38, CONSTANT_PADS, tmp_path / scenario.name)
    cases = read_cases([tmp_path], SYSTEM)
    assert diagnosed(cases).verdict == "nothing"
    unsaid = [
        replace(case, conditions={n: c for n, c in case.conditions.items() if n != "wheel_load"})
        for case in cases
    ]
    (cause,) = diagnosed(unsaid).causes
    assert {cause.effect.name, *cause.confusable_with} == {"WheelLoad", "CreepStiffness"}


def test_a_force_that_one_recording_has_not_tells_in_the_others(tmp_path, diagnosed):
    """By what the force sensor may do wrong, which is what its recordings tell most of."""
    cases = recorded(tmp_path, plant(CONSTANT_PADS, ["fx_gain=0.02"]), 39)
    some = [cases[0].without(["Fx"]), *cases[1:]]
    widths = []
    for which in (cases, some, some[1:]):
        (cause,) = diagnosed(which, slots=["forceSensor"]).causes
        assert "FxGain" in {cause.effect.name, *cause.confusable_with}
        (size,) = cause.parameters.values()
        widths.append(size.high - size.low)
        assert size.low < 0.02 < size.high
    # Less is known than of all forces, and no less than of the recordings that have one.
    assert widths[0] < widths[1] < 1.02 * widths[2]


@pytest.mark.parametrize("planted", mostly_long(PLANTED, SHORT))
def test_a_planted_effect_is_named_with_its_size(planted, tmp_path, diagnosed):
    name, parameter, small = PLANTED[planted]
    seed = 500 + list(PLANTED).index(planted)
    size = small * np.random.default_rng(seed).uniform(1.0, 2.0)
    diagnosis = diagnosed(recorded(tmp_path, Effects(**{planted: size}), seed))
    assert diagnosis.verdict == "found"
    first = diagnosis.causes[0]
    assert name in (first.effect.name, *first.confusable_with)
    assert len(diagnosis.causes) == 1
    assert diagnosis.gain.after < diagnosis.gain.before
    if first.effect.name == name:
        # Bounds of 95 %, and a tenth of the size for what the multibody model has besides.
        found_size = first.parameters[parameter]
        assert found_size.low - 0.1 * abs(size) <= size <= found_size.high + 0.1 * abs(size)


@pytest.mark.long
def test_nothing_is_missing_in_the_model_that_a_diagnosis_extended(tmp_path):
    """As by `--model Extended.fmu`: what was found of the pads acts in every simulation."""
    cases = recorded(tmp_path / "stops", Effects(cylinder_lag=0.06), 511)

    def outcome_of(system: System, out: Path) -> Outcome:
        return diagnose(Problem(system, cases, LIBRARY, EFFECTS), Engine(out=out))

    first = outcome_of(SYSTEM, tmp_path / "first")
    assert [cause.effect.name for cause in first.diagnosis.causes] == ["CylinderLag"]
    again = outcome_of(with_model(SYSTEM, OBSERVER, first.extension.fmu), tmp_path / "again")
    assert (again.diagnosis.verdict, again.extension) == ("nothing", None)


@pytest.mark.long
@pytest.mark.parametrize("planted", sorted(HIDDEN))
def test_an_effect_that_the_stops_do_not_show_is_not_invented(planted, tmp_path, diagnosed):
    sizes = {"caliper_hysteresis": 0.03, "adhesion_recovery": 0.3, "wheel_inertia": 0.2}
    diagnosis = diagnosed(recorded(tmp_path, Effects(**{planted: sizes[planted]}), 77))
    assert diagnosis.verdict == "nothing"
    # Of adhesion that recovers they could show more.
    assert set(diagnosis.not_visible) == {"CaliperHysteresis", "FallingFriction", "WheelInertia"}


@pytest.mark.long
def test_hysteresis_of_the_calipers_shows_where_pressure_falls(tmp_path, diagnosed):
    stairs = ("staircase_160", "staircase_120_rev", "dry_120_3.6")
    diagnosis = diagnosed(recorded(tmp_path, Effects(caliper_hysteresis=0.05), 78, stairs))
    assert [cause.effect.name for cause in diagnosis.causes] == ["CaliperHysteresis"]
    share = diagnosis.causes[0].parameters["share"]
    assert share.low <= 0.05 <= share.high
    assert set(diagnosis.not_visible) == {"FallingFriction", "WheelInertia"}


def test_nothing_is_found_where_nothing_is_missing(clean, diagnosed):
    diagnosis = diagnosed(clean)
    assert (diagnosis.verdict, diagnosis.causes, diagnosis.gain) == ("nothing", (), None)


def test_nothing_is_found_without_a_measured_force(clean, diagnosed):
    assert diagnosed([case.without(["Fx"]) for case in clean]).verdict == "nothing"


@pytest.mark.long
def test_stops_by_one_clock_show_none_that_is_late(clean, everything, tmp_path):
    """Three sets: chance has no side, and a bias that one set hides shows in their mean."""
    clock = next(effect for effect in catalogue(SYSTEM, LIBRARY) if "omegaW" in effect.late)
    ratios = []
    for cases in (clean, *(recorded(tmp_path / str(seed), Effects(), seed) for seed in (32, 33))):
        with ResidualModel(ModelSource(everything, SYSTEM, {}), cases) as simulations:
            fit = Fit(simulations, [clock])
            nominal = anew(fit, fit.unknowns.start(), ())
            lin = fit.linearise(nominal.linearised, (), [(clock, {})])
            late = fit.quadratics(lin, [(clock.name, "skew")]).total()
        deviation = np.sqrt(np.diag(np.linalg.inv(late.N)))[-1]
        ratios.append(-np.linalg.solve(late.N, late.g)[-1] / deviation)
    assert abs(np.mean(ratios)) < 4.0 / np.sqrt(len(ratios))


@pytest.mark.long
def test_fade_is_found_without_a_measured_force(tmp_path, diagnosed):
    cases = recorded(tmp_path, Effects(fade=5e-4), 12)
    diagnosis = diagnosed([case.without(["Fx"]) for case in cases])
    assert [cause.effect.name for cause in diagnosis.causes] == ["BrakeFade"]


# Signals that the rig's loggers may have late, by the name that the rig gives that.
LATE = {"pB": "late_pB", "tauR": "late_tauR", "omegaR": "late_omegaR", "Fx": "late_Fx"}


@pytest.mark.long
@pytest.mark.parametrize("signals", [("pB", "Fx"), ("pB",)], ids="-".join)
def test_a_late_logger_is_named_whatever_it_records(signals, tmp_path, diagnosed):
    cases = recorded(tmp_path, Effects(**{LATE[name]: 0.025 for name in signals}), 700)
    diagnosis = diagnosed(cases, replace(SYSTEM, loggers={"second": signals}))
    assert [cause.effect.name for cause in diagnosis.causes] == ["LoggerTimeSkew[second]"]
    skew = diagnosis.causes[0].parameters["skew"]
    assert skew.low <= 0.025 <= skew.high


@pytest.mark.long
@pytest.mark.parametrize("signals", [("pB", "Fx"), *((name,) for name in LATE)], ids="-".join)
def test_a_late_logger_that_nobody_declared_is_no_other_cause(signals, tmp_path, diagnosed):
    """The clock of the speeds that the system file has would be 49 ms early, and explains less."""
    cases = recorded(tmp_path, Effects(**{LATE[name]: 0.012 for name in signals}), 700)
    diagnosis = diagnosed(cases)
    assert (diagnosis.verdict, diagnosis.causes) == ("unexplained", ())
    assert diagnosis.late.signals == signals
    # What the multibody model has besides is as large as a half of what matters, 1 ms.
    assert abs(diagnosis.late.skew - 0.012) < 1.96 * diagnosis.late.sigma + 5e-4


@pytest.mark.parametrize("outside", mostly_long(OUTSIDE, {"drive_beat"}))
def test_a_cause_outside_the_catalogue_is_not_given_a_name(outside, tmp_path, diagnosed):
    diagnosis = diagnosed(recorded(tmp_path, Effects(**{outside: OUTSIDE[outside]}), 55))
    assert (diagnosis.verdict, diagnosis.causes, diagnosis.gain) == ("unexplained", (), None)


@pytest.mark.long
@pytest.mark.parametrize(
    ("first", "other"),
    [
        ("fade", "wheel_radius"),
        ("speed_friction", "fx_offset"),
        ("cylinder_lag", "roller_losses"),
        ("pressure_offset", "cylinder_lag"),
    ],
)
def test_two_effects_are_found_one_after_the_other(first, other, tmp_path, diagnosed):
    effects = Effects(**{name: 1.5 * PLANTED[name][2] for name in (first, other)})
    diagnosis = diagnosed(recorded(tmp_path, effects, 91))
    groups = [{cause.effect.name, *cause.confusable_with} for cause in diagnosis.causes]
    assert len(groups) == 2
    for planted in (first, other):
        assert any(PLANTED[planted][0] in group for group in groups)


@pytest.mark.long
def test_two_effects_that_hide_each_other_are_found_in_six_stops(tmp_path, diagnosed):
    """Either alone leaves some channel worse than without it; three stops say "unexplained"."""
    six = ("01_", "02_", "03_", "04_", "05_", "06_")
    names = [name for name in SCENARIOS if name.startswith(six)]
    effects = Effects(torque_gain=1.5 * 0.015, apex_offset=1.5e-3)
    diagnosis = diagnosed(recorded(tmp_path, effects, 91, names))
    groups = [{cause.effect.name, *cause.confusable_with} for cause in diagnosis.causes]
    assert len(groups) == 2
    for planted in ("DriveTorqueGain", "ApexOffset"):
        assert any(planted in group for group in groups)


def test_wrong_samples_are_set_aside_and_never_fitted(tmp_path, diagnosed):
    assert diagnosed(recorded(tmp_path, Effects(spikes=0.2, dropouts=0.2), 64)).verdict == "nothing"


# What the independent simulator planted, by the folder of its recordings.
SEEN = {
    "speed_friction": ("SpeedDependentPadFriction", "slope", 0.22),
    "fade": ("BrakeFade", "fade", 7e-4),
    "cylinder_lag": ("CylinderLag", "lag", 0.08),
    "radius": ("WheelRadius", "delta", -1.5e-3),
    "pole_ring": ("PoleRingEccentricity", "amplitude", 2e-3),
}


@pytest.mark.skipif(not LABELLED.exists(), reason="no recordings of the independent simulator")
@pytest.mark.parametrize("folder", mostly_long(SEEN, {"speed_friction"}))
def test_an_independent_simulator_is_seen_through(folder, diagnosed):
    name, parameter, size = SEEN[folder]
    diagnosis = diagnosed(read_cases([LABELLED / folder], SYSTEM))
    assert [cause.effect.name for cause in diagnosis.causes] == [name]
    found_size = diagnosis.causes[0].parameters[parameter]
    # Its discs cool and its cylinders lag by formulas of its own: 2 % beside the interval.
    assert found_size.low - 0.02 * abs(size) <= size <= found_size.high + 0.02 * abs(size)
    assert diagnosis.gain.after < 0.25 * diagnosis.gain.before


def two_stops(folder: str) -> list[Case]:
    """One in each direction, of different pressures."""
    cases = read_cases([LABELLED / folder], SYSTEM)
    return [case for case in cases if case.name[:2] in ("04", "05")]


def slow(case: Case) -> Case:
    """At 50 Hz."""
    return case.part(slice(None, None, 4))


def uneven(case: Case) -> Case:
    """Three samples in ten are missing."""
    kept = np.random.default_rng(1).random(case.time.size) > 0.3
    signals = {name: values[kept] for name, values in case.signals.items()}
    return replace(case, time=case.time[kept], signals=signals)


@pytest.mark.skipif(not LABELLED.exists(), reason="no recordings of the independent simulator")
@pytest.mark.parametrize(
    "sampled",
    [
        pytest.param(lambda case: case, id="every sample"),
        pytest.param(slow, marks=pytest.mark.long),
        uneven,
    ],
)
def test_clean_recordings_of_an_independent_simulator_stay_clean(sampled, diagnosed):
    cases = [sampled(case) for case in read_cases([LABELLED / "clean"], SYSTEM)]
    assert diagnosed(cases).verdict == "nothing"


@pytest.mark.skipif(not LABELLED.exists(), reason="no recordings of the independent simulator")
def test_a_pole_ring_is_named_from_uneven_samples(diagnosed):
    (cause,) = diagnosed([uneven(case) for case in two_stops("pole_ring")]).causes
    assert cause.effect.name == "PoleRingEccentricity"
    assert cause.parameters["amplitude"].low <= 2e-3 <= cause.parameters["amplitude"].high


@pytest.mark.skipif(not LABELLED.exists(), reason="no recordings of the independent simulator")
@pytest.mark.parametrize("folder", mostly_long(SEEN, {"radius"}))
def test_two_stops_of_an_independent_simulator_are_enough(folder, diagnosed):
    name, parameter, size = SEEN[folder]
    (cause,) = diagnosed(two_stops(folder)).causes
    assert cause.effect.name == name
    assert cause.parameters[parameter].low <= size <= cause.parameters[parameter].high


def late(values: np.ndarray) -> np.ndarray:
    """One sample of 5 ms late."""
    return np.concatenate([values[:1], values[:-1]])


# What a wrong sensor makes of recordings is known exactly, whoever made them.
WRONG_SENSORS: dict[str, tuple[Callable[[Case], Case], str, str, float]] = {
    "gain of the load cells": (
        lambda c: c.with_signals({"Fx": 0.99 * c["Fx"]}),
        "FxGain",
        "gain",
        -0.01,
    ),
    "late wheel speed": (
        lambda c: c.with_signals({"omegaW": late(c["omegaW"])}),
        "SpeedSignalDelay",
        "delay",
        5e-3,
    ),
    "wheel radius": (
        lambda c: c.with_signals({"omegaW": c["omegaW"] * 0.46 / (0.46 - 5e-4)}),
        "WheelRadius",
        "delta",
        -5e-4,
    ),
}


@pytest.mark.skipif(not LABELLED.exists(), reason="no recordings of the independent simulator")
@pytest.mark.parametrize("sensor", mostly_long(WRONG_SENSORS, {"late wheel speed"}))
def test_a_wrong_sensor_on_an_independent_simulator_is_named(sensor, diagnosed):
    wrong, name, parameter, size = WRONG_SENSORS[sensor]
    diagnosis = diagnosed([wrong(case) for case in read_cases([LABELLED / "clean"], SYSTEM)])
    assert diagnosis.verdict == "found"
    (cause,) = diagnosis.causes
    assert name in (cause.effect.name, *cause.confusable_with)
    if cause.effect.name == name:
        assert cause.parameters[parameter].low <= size <= cause.parameters[parameter].high


@pytest.mark.long
@pytest.mark.skipif(not LABELLED.exists(), reason="no recordings of the independent simulator")
def test_load_cells_that_drift_on_an_independent_simulator_are_unexplained(diagnosed):
    """300 N over a stop, a hundredth of the force, which no effect of the catalogue does."""
    cases = read_cases([LABELLED / "clean"], SYSTEM)
    drifting = [
        c.with_signals({"Fx": c["Fx"] + np.linspace(0.0, 300.0, c.time.size)}) for c in cases
    ]
    assert diagnosed(drifting).verdict == "unexplained"


@pytest.mark.long
@pytest.mark.skipif(not LABELLED.exists(), reason="no recordings of the independent simulator")
def test_a_wrong_sensor_beside_wrong_physics_is_found_too(diagnosed):
    wrong, _, _, _ = WRONG_SENSORS["wheel radius"]
    diagnosis = diagnosed([wrong(case) for case in read_cases([LABELLED / "fade"], SYSTEM)])
    assert {cause.effect.name for cause in diagnosis.causes} == {"BrakeFade", "WheelRadius"}


@pytest.mark.long
@pytest.mark.skipif(not LABELLED.exists(), reason="no recordings of the independent simulator")
def test_two_wrong_sensors_are_found_though_either_hides_the_other(diagnosed):
    cases = read_cases([LABELLED / "clean"], SYSTEM)
    diagnosis = diagnosed(
        [c.with_signals({"tauR": 1.015 * c["tauR"], "Fx": c["Fx"] - 100.0}) for c in cases]
    )
    groups = [{cause.effect.name, *cause.confusable_with} for cause in diagnosis.causes]
    assert len(groups) == 2
    for name in ("DriveTorqueGain", "FxOffset"):
        assert any(name in group for group in groups)


@pytest.mark.long
@pytest.mark.skipif(not LABELLED.exists(), reason="no recordings of the independent simulator")
def test_an_effect_that_turns_is_found_beside_one_that_dwarfs_it(diagnosed):
    """The law of the pads leaves 350 times the noise, the pole ring 2 times."""

    def eccentric(case: Case) -> Case:
        omegaW = case["omegaW"]
        angle = np.cumsum(omegaW * np.diff(case.time, prepend=case.time[0]))
        return case.with_signals({"omegaW": omegaW * (1.0 + 1e-3 * np.cos(angle))})

    law, ring = diagnosed(
        [eccentric(case) for case in read_cases([LABELLED / "speed_friction"], SYSTEM)]
    ).causes
    assert law.effect.name == "SpeedDependentPadFriction"
    assert law.parameters["slope"].low <= 0.22 <= law.parameters["slope"].high
    assert ring.effect.name == "PoleRingEccentricity"
    assert ring.parameters["amplitude"].low <= 1e-3 <= ring.parameters["amplitude"].high
