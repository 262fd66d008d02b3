"""The train: what its computer writes becomes cases; faults of one axle are named with the axle."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import workbench as wb
from workbench.diagnosis import read_effects
from workbench.diagnosis.effects.extension import ExtendedModel
from workbench.errors import InputError
from workbench.models.modelica import read_library
from workbench.recordings.case import Case, read_cases
from workbench.recordings.datasets import write_cases
from workbench.system.system import OBSERVER, System

from .edits import edit

RECORDINGS = Path(__file__).parent.parent.parent / "shared" / "recordings" / "train"
TIME = np.arange(0.0, 20.0, 0.02)
CASE = """
title = "80 km/h"

[conditions]
rail = "dry"
pressure_full_load = "2.7 bar"
mass1 = "45 t"
mass2 = "50 t"

[measurement]
file = "measured.csv"

[track]
file = "track.csv"
"""


def cases_of(name: str, train: System, out: Path) -> tuple[list[Case], dict[str, Any]]:
    """Cases of a set of the independent simulator, and what it planted."""
    if not RECORDINGS.exists():
        pytest.skip("the recordings are not at hand")
    write_cases("train", RECORDINGS / name, out)
    return read_cases([out], train), json.loads((RECORDINGS / name / "truth.json").read_text())


# --- what the computer writes ---


def stop(folder: Path, change: tuple[str, str] = ("", "")) -> Path:
    """A run at 20 m/s over a gradient that grows by 1 permille in 100 m, into a curve at 1200 m."""
    own = folder / "set" / "01"
    own.mkdir(parents=True)
    (own / "case.toml").write_text(CASE.replace(*change))
    names = [*(f"pB{j} [bar]" for j in range(1, 5)), *(f"omega{i} [rad/s]" for i in range(1, 9))]
    header = ["time [s]", *names, "a [m/s2]", "s [m]"]
    rows = [[t, *[0.1 * t] * 4, *[43.5 - 0.1 * t] * 8, -0.01 * t, 1000.0 + 20.0 * t] for t in TIME]
    lines = [",".join(header), *(",".join(f"{value:.6f}" for value in row) for row in rows)]
    (own / "measured.csv").write_text("\n".join(lines))
    track = "position [m],gradient [permille],radius [m]\n0,0,0\n1200,12,600\n2000,20,0\n"
    (own / "track.csv").write_text(track)
    return folder / "set"


def test_gradients_and_curves_are_those_under_the_vehicles(tmp_path, train):
    write_cases("train", stop(tmp_path), tmp_path / "cases")
    (case,) = read_cases([tmp_path / "cases"], train)
    assert_allclose(case.time, TIME.reshape(-1, 5).mean(axis=1), atol=1e-12)
    assert_allclose(case["pB2"], 1e4 * case.time, rtol=1e-9)  # a mean of a line is on it
    position = 1000.0 + 20.0 * case.time
    assert_allclose(case["slope1"], 1e-5 * (position - 10.75), rtol=1e-9)
    assert_allclose(case["slope2"], 1e-5 * (position - 37.15), rtol=1e-9)
    # 600/R permille, of the share of the weight that is in the curve.
    weight = 45.0 * (position >= 1210.75) + 50.0 * (position >= 1237.15)
    assert_allclose(case["curve"], 1e-3 * weight / 95.0, atol=1e-15)
    assert set(case["mass1"]) == {45e3}
    assert case.conditions == {"rail": "dry", "pressure_full_load": 2.7e5}


@pytest.mark.parametrize(
    ("pressure", "doubted"), [('"2.3 bar"', False), ('"2.5 bar"', True), ('"4.2 bar"', None)]
)
def test_a_pressure_that_the_brake_never_reached_is_doubted(pressure, doubted, tmp_path, train):
    """Readings rise to 2 bar in vehicles of 45 t and 50 t: that is 2.3 bar in full ones of 56 t."""
    write_cases("train", stop(tmp_path, ('"2.7 bar"', pressure)), tmp_path / "cases")
    if doubted is None:
        with pytest.raises(InputError, match="pressure_full_load: found 420000 Pa"):
            read_cases([tmp_path / "cases"], train)
        return
    (case,) = read_cases([tmp_path / "cases"], train)
    assert any("pressure_full_load" in doubt for doubt in case.doubts) == doubted


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('mass2 = "50 t"', "", "mass2"),
        ('mass2 = "50 t"', 'mass2 = "50 m"', "a unit of another dimension"),
        ('rail = "dry"', "", "rail"),
        ('"2.7 bar"', '"2.7 m"', "a unit of another dimension"),
        ('"track.csv"', '"way.csv"', r"way\.csv"),
    ],
)
def test_a_stop_that_lacks_something_is_refused(old, new, message, tmp_path):
    with pytest.raises(InputError, match=message):
        write_cases("train", stop(tmp_path, (old, new)), tmp_path / "cases")


def test_a_folder_without_stops_is_refused(tmp_path):
    (tmp_path / "set" / "01").mkdir(parents=True)
    (tmp_path / "set" / "01" / "notes.txt").write_text("nothing")
    with pytest.raises(InputError, match=r"no folder with a case\.toml"):
        write_cases("train", tmp_path / "set", tmp_path / "cases")


def test_an_axle_that_turns_unlike_the_others_is_refused(tmp_path, train):
    """Its speed is in rad/s, and said to be in rpm."""
    recorded = stop(tmp_path) / "01" / "measured.csv"
    edit(recorded, ("omega3 [rad/s]", "omega3 [rpm]"))
    write_cases("train", tmp_path / "set", tmp_path / "cases")
    with pytest.raises(InputError, match="all axles of a train roll along"):
        read_cases([tmp_path / "cases"], train)


# --- effects ---


def test_what_an_axle_may_have_is_sought_on_each(train):
    names = [
        effect.name
        for effect in read_effects(read_library(train.library), train.model(OBSERVER).name)
    ]
    for effect in ("WeakPads", "IsolatedUnit", "DraggingBrake", "WheelRadius", "LateSpeed"):
        assert [name for name in names if name.startswith(effect)] == [
            f"{effect}[{axle}]" for axle in range(1, 9)
        ]
    assert {"CylinderLag[4]", "PressureSensorGain[4]", "WrongMass[2]"} <= set(names)
    # Of a bogie, of a vehicle, and of the train.
    assert not {"CylinderLag[5]", "WrongMass[3]", "Glazing[1]"} & set(names)


def test_an_extended_model_keeps_what_is_known_of_each_axle(train):
    known = {f"muDC[{axle}]": axle / 16 for axle in (2, 1, 3, 4, 5, 6, 7, 8)}
    text = ExtendedModel(
        read_library(train.library),
        train.models[OBSERVER].name,
        "Extended",
        effects=[],
        about="as known",
        parameters={"pads": 0.9, **known},
    ).source()
    assert "pads=0.9,\n    muDC={0.0625, 0.125, 0.1875, 0.25, 0.3125, 0.375, 0.4375, 0.5}" in text


# --- recordings of an independent simulator ---

LABELLED = {  # set: what is planted, as it is called here
    "pads_axle": ("WeakPads[3]", "loss", 0.15),
    "isolated_unit": ("IsolatedUnit[6]", "lost", 1.0),
    "dragging": ("DraggingBrake[5]", "torque", 1500.0),
    "cylinder_lag_bogie": ("CylinderLag[3]", "lag", 0.4),
    "radius_axle": ("WheelRadius[2]", "deviation", -2.5e-3),
    "glazing": ("Glazing", "loss", 0.15),
}


@pytest.mark.long
@pytest.mark.parametrize("name", LABELLED)
def test_a_labelled_fault_is_named_with_its_place(name, train, tmp_path):
    """Pads by what they have beside the other axles': a tolerance of theirs is no other loss."""
    cases, truth = cases_of(f"labelled/{name}", train, tmp_path / "cases")
    diagnosis = wb.diagnose(train, cases, out=tmp_path / "out", workers=2).diagnosis
    effect, size, planted = LABELLED[name]
    if name == "pads_axle":
        levels = np.array([truth["cases"][case.name]["pad_level"] for case in cases])
        planted = 1.0 - float(np.mean(levels[:, 2] / np.delete(levels, 2, axis=1).mean(axis=1)))
        assert planted == pytest.approx(0.19, abs=0.005)  # of which 0.15 were planted
    (cause,) = diagnosis.causes
    assert effect in (cause.effect.name, *cause.confusable_with)
    if cause.effect.name == effect:
        assert cause.parameters[size].low < planted < cause.parameters[size].high


@pytest.mark.long
def test_a_wrong_radius_is_named_with_its_axle(train, tmp_path):
    """Among three causes on every axle, in two stops of the four."""
    cases, truth = cases_of("labelled/radius_axle", train, tmp_path / "cases")
    (planted,) = truth["effects"].values()
    kinds = ("WheelRadius", "WeakPads", "DraggingBrake")
    out = wb.diagnose(train, cases[2:], effects=kinds, out=tmp_path / "out", workers=1)
    (cause,) = out.diagnosis.causes
    assert cause.effect.name == f"WheelRadius[{planted['at']}]"
    size = cause.parameters["deviation"]
    assert size.low < 1e-3 * planted["size"] < size.high


def test_friction_and_radius_of_each_axle_are_estimated(train, tmp_path):
    """Pads of axle 3 have lost 15 %; profiles and loads of a sound train blur axles by 2 %."""
    cases, truth = cases_of("labelled/pads_axle", train, tmp_path / "cases")
    case = next(case for case in cases if case.name == "01_120_service_dry")
    truth_of_case, run = truth["cases"][case.name], wb.observe(train, case, "ekf").to_frame()
    at = int(np.searchsorted(case.time, truth_of_case["standstill"] - 15.0))  # at about 15 m/s
    friction = np.array([run[f"muDC[{i}] [1]"].iloc[at] for i in range(1, 9)])
    # Three deviations of profile, load and law, of 3 % in all, of the worst of eight axles.
    assert_allclose(friction, truth_of_case["pad_level"], atol=0.09 * 0.30)
    assert friction.argmin() == 2
    radius = np.array([run[f"r[{i}] [m]"].iloc[at] for i in range(1, 9)])
    assert_allclose(radius, 1e-3 * np.array(truth_of_case["radius_mm"]), atol=4e-5)


@pytest.mark.parametrize(
    "name", ["healthy", *(f"labelled/{fault}" for fault in LABELLED if "radius" not in fault)]
)
def test_satellites_tell_radii_and_speed_when_brakes_are_told_to_act(name, train, tmp_path):
    """But of a train with a brake that drags, which slows while it coasts as another would not."""
    cases, truth = cases_of(name, train, tmp_path / "cases")
    radii, speeds = [], []
    for case in cases:
        truth_of_case, run = truth["cases"][case.name], wb.observe(train, case, "ekf")
        file = RECORDINGS / name / case.name / "case.toml"
        conditions = tomllib.loads(file.read_text())["conditions"]
        at = int(np.searchsorted(case.time, float(conditions["brake_command"].split()[0])))
        radius = np.array([run.signal(f"r[{i}]")[at] for i in range(1, 9)])
        radii.append(1e3 * radius - np.array(truth_of_case["radius_mm"]))
        speeds.append(3.6 * run.signal("vGNSS")[at] - truth_of_case["speed_at_command"])
    # Of 0.06 km/h in a reading at 10 Hz, averaged over 20 s and more, next to nothing is left but
    # half a step of 0.1 s, in which the train slows by 0.02 km/h.
    assert np.abs(speeds).max() < 0.04
    assert np.sqrt(np.mean(np.square(radii))) < (0.15 if "dragging" in name else 0.025)


def test_a_wet_rail_is_told_from_a_dry_one_by_the_slip_of_axles_that_brake(train, tmp_path):
    """`imm` weighs both, whatever the crew says; slides are on patches, which are neither."""
    probabilities = []
    for name in ("healthy", "labelled/pads_axle", "labelled/cylinder_lag_bogie"):
        cases, truth = cases_of(name, train, tmp_path / name)
        for case in cases:
            truth_of_case = truth["cases"][case.name]
            if truth_of_case["patch"] is None:
                probability = wb.observe(train, case, "imm").probability
                at = int(np.searchsorted(case.time, truth_of_case["standstill"] - 5.0))
                probabilities.append(probability[f"rail_{case.conditions['rail']}"][at])
    assert len(probabilities) == 14
    assert min(probabilities) > 0.95


def test_masses_of_a_sound_train_stay_as_weighed_where_no_axle_slides(train, tmp_path):
    """Weighed to 1.5 % of the train, 1.3 % of the stop; what a slide would say is none of it."""
    cases, truth = cases_of("healthy", train, tmp_path / "cases")
    rolled = [case for case in cases if not any(truth["cases"][case.name]["slide_seconds"])]
    assert len(rolled) >= 5
    for case in rolled:
        truth_of_case, run = truth["cases"][case.name], wb.observe(train, case, "ekf")
        at = int(np.searchsorted(case.time, truth_of_case["standstill"] - 4.0))
        values = np.array([run.signal(f"mass[{k}]")[at] * case[f"mass{k}"][0] for k in (1, 2)])
        assert_allclose(values, 1e3 * np.array(truth_of_case["mass"]), rtol=0.05)
