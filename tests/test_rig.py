"""The virtual rig: physics of its stops, and the repository's own recordings, made by it."""

import json
import os
import platform
import re
import signal
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.machines.wheelset.rig import (
    CONSTANT_PADS,
    ORDINARY_PADS,
    SCENARIOS,
    STANDARD,
    StopTruth,
    check_files,
    proposed_stop,
    sample,
    select,
    simulate,
    stop_of,
)
from workbench.machines.wheelset.rig.drive import Drive, Losses
from workbench.recordings.case import read_case, read_cases
from workbench.studies.design import with_sensor

from .processes import LONGEST, ROOT, running
from .scenarios import BRAKE_RADIUS, REFERENCE, ROLLER_RADIUS, SEED, normal_force
from .systems import WHEELSET as SYSTEM

CASES = ROOT / "cases"  # of the rig with this seed, which is asked below
TRAIN_INERTIA, ROLLER_INERTIA, WHEELSET_INERTIA = 7840.0, 1500.0, 110.0  # kg.m2, data sheet


@cache
def make(name: str) -> StopTruth:
    return simulate(SCENARIOS[name], SEED, ORDINARY_PADS, REFERENCE)


def braking_time(stop: StopTruth) -> float:
    return stop.standstill - stop.drawn.coasting


def friction_power(stop: StopTruth, disc: int) -> np.ndarray:
    """Of one disc [W], from the law of the data sheet."""
    force = stop.truth[f"muDC{disc}"] * normal_force(stop)
    return force * BRAKE_RADIUS * abs(stop.truth["omegaW"])


# --- stops ---


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        ("01_dry_80_1.5", 40.0),
        ("02_dry_100_2.7", 27.6),
        ("03_dry_120_3.6", 25.5),
        ("04_dry_160_4.2", 30.9),
        ("05_dry_120_2.7_rev", 33.9),
        ("06_dry_160_3.6_rev", 35.9),
        ("07_wet_80_1.5", 48.2),
        ("08_wet_120_3.6", 27.3),
        ("09_wet_160_4.2_wsp", 32.5),
        ("10_wet_100_2.7_rev", 30.8),
        ("11_brakewet_120_2.7_rev", 36.4),
        ("12_brakewet_160_4.2", 31.9),
        ("13_onedisc_100_2.7", 28.7),
        ("14_twodiscs_160_3.6_rev", 36.7),
    ],
)
def test_standard_stop_takes_the_time_of_a_two_mass_calculation(name, seconds):
    """Reference: independent calculation with the same laws of brake and pads, no tolerances.

    The pads' level is drawn for each stop (2 %); time after filling (1.1 s) goes with its inverse.
    5 % is what the multibody model may differ by.
    """
    made = json.loads((CASES / name / "truth.json").read_text())
    braking = made["standstill"] - made["drawn"]["coasting"]
    nominal = 1.1 + (braking - 1.1) * made["drawn"]["muDC"]
    assert nominal == pytest.approx(seconds, rel=0.05)


@pytest.mark.parametrize("name", ["04_dry_160_4.2", "07_wet_80_1.5", "09_wet_160_4.2_wsp"])
def test_kinetic_energy_of_the_train_becomes_heat(name):
    """Discs, contact and bearings take all; the drive gives back what the roller loses."""
    stop = make(name)
    stopping = (stop.time >= 0.0) & (stop.time <= stop.standstill)
    truth = {signal: values[stopping] for signal, values in stop.truth.items()}
    discs = sum(friction_power(stop, disc)[stopping] for disc in (1, 2, 3))
    contact = truth["Fx"] * truth["slip"]
    omega = abs(truth["omegaW"])
    bearings = (25.0 + 0.6 * omega + 0.004 * omega**2) * omega
    heat = np.trapezoid(discs + contact + bearings, dx=1e-3)
    # The drive takes the roller for nominal: what its inertia has more, the train has more.
    train = TRAIN_INERTIA + ROLLER_INERTIA * (stop.drawn.JR - 1.0)
    wheelset = WHEELSET_INERTIA * stop.drawn.JW
    kinetic = 0.5 * (train * truth["omegaR"][0] ** 2 + wheelset * omega[0] ** 2)
    # The drive's lag of 8 ms costs the train 30 kJ of 16 MJ while the force builds up, 2e-3;
    # dampers and the motion of the pads take less than 1e-3.
    assert heat == pytest.approx(kinetic, rel=3e-3)


def test_drive_imitates_the_inertia_of_the_train():
    """Momentum that the contact takes from the roller, from coasting to 1 m/s."""
    stop = make("14_twodiscs_160_3.6_rev")
    omega = stop.truth["omegaR"]
    begin = int(np.searchsorted(stop.time, 0.0))
    end = int(np.flatnonzero(abs(omega) * ROLLER_RADIUS > 1.0)[-1])
    impulse = ROLLER_RADIUS * np.trapezoid(stop.truth["Fx"][begin:end], dx=1e-3)
    # The drive's lag of 8 ms holds back 1.2e-3 of the impulse, and three sigma of the roller's
    # inertia are 1.1e-3 of the train's.
    assert -impulse / (omega[end] - omega[begin]) == pytest.approx(TRAIN_INERTIA, rel=2.5e-3)


def test_patch_of_low_adhesion_makes_the_wheel_slide_and_recover():
    stop = make("09_wet_160_4.2_wsp")
    t = stop.time - stop.drawn.coasting
    slip = stop.truth["slip"] / (ROLLER_RADIUS * abs(stop.truth["omegaR"]))
    force, pressure = stop.truth["Fx"], stop.truth["pB"]
    before = float(np.interp(7.9, t, force))
    assert slip[t < 8.0].max() < 0.02  # Polach's wet contact carries the stop at 1 .. 1.5 % slip
    assert slip[(t > 8.0) & (t < 9.6)].max() >= 0.08
    assert force[(t > 8.0) & (t < 9.5)].min() < 0.5 * before  # 20 -> 9 kN in the paper's case
    assert pressure[(t > 8.0) & (t < 10.0)].min() < 0.5 * pressure[t < 8.0].max()
    assert slip[(t > 10.0) & (t < 12.0)].max() < 0.02
    assert float(np.interp(12.0, t, force)) > before


def test_load_cell_rings_with_the_structure_when_the_patch_begins():
    """Between contact force and load cell lies the longitudinal mode of 21.6 Hz."""
    stop = make("09_wet_160_4.2_wsp")
    begin = int(np.searchsorted(stop.time, stop.drawn.coasting + 8.0))
    ringing = (stop.truth["Fcell"] - stop.truth["Fx"])[begin : begin + 500]
    spectrum = abs(np.fft.rfft(ringing * np.hanning(500), 8192))
    frequency = np.fft.rfftfreq(8192, 1e-3)[spectrum.argmax()]
    # Half a second resolves 2 Hz; the braked wheelset shifts the mode by as much.
    assert frequency == pytest.approx(21.6, abs=4.0)
    assert np.ptp(ringing) > 1e3


@pytest.mark.parametrize("name", [name for name in STANDARD if not name.endswith("wsp")])
def test_protection_leaves_a_wheel_alone_that_does_not_slide(name):
    """Without intervention the pressure only rises until standstill."""
    made = json.loads((CASES / name / "truth.json").read_text())
    truth = pd.read_csv(CASES / name / "truth.csv")
    pressure = truth["pB [Pa]"][truth["time [s]"] < made["standstill"]]
    assert pressure.max() > 1e5
    assert pressure.is_monotonic_increasing


def test_wheel_locks_and_stays_locked_without_protection():
    stop = make("15_locked_wheel")
    t = stop.time - stop.drawn.coasting
    locked = (t > 3.0) & (abs(stop.truth["omegaR"]) * ROLLER_RADIUS > 1.0)
    # 0.05 rad/s is where the model smooths the friction of a standing disc.
    assert abs(stop.truth["omegaW"][locked]).max() < 0.05
    assert stop.truth["omegaR"][locked].max() * ROLLER_RADIUS > 20.0
    assert braking_time(stop) > 40.0  # a full brake with grip takes 19 s


def test_wet_disc_dries_with_energy_not_with_time():
    low, high = make("07_wet_80_1.5"), make("08_wet_120_3.6")
    grid = np.linspace(0.05e6, 1.0e6, 50)  # J on disc 2
    films = []
    for stop in (low, high):
        energy = np.cumsum(friction_power(stop, 2)) * 1e-3
        films.append(np.interp(grid, energy, stop.truth["film2"]))
    # The model's pads move with the frame, this calculation's do not: some 1e-3 of the energy.
    assert films[0] == pytest.approx(films[1], abs=2e-3)
    assert films[0] == pytest.approx(np.exp(-grid / 0.45e6), abs=2e-3)
    later = [
        float(np.interp(s.drawn.coasting + 6.0, s.time, s.truth["film2"])) for s in (low, high)
    ]
    assert later[0] > 2.0 * later[1]


def test_only_the_wet_disc_has_less_friction_and_stays_cooler():
    stop = make("13_onedisc_100_2.7")
    early = np.searchsorted(stop.time, stop.drawn.coasting + 1.5)
    assert stop.truth["muDC2"][early] < 0.6 * stop.truth["muDC1"][early]
    assert stop.truth["temperature2"][-1] < stop.truth["temperature1"][-1] - 5.0


PROPOSED = {
    "conditions": {
        "initial_speed": 40.0,
        "direction": -1,
        "wheel_rail": "dry",
        "discs": ["dry"] * 3,
    },
    "settings": {"imitated": 1500.0},
    "inputs": {"pB": {"profile": "staircase", "levels": [3e5, 1.2e5], "every": 5.0}},
}


def test_a_stop_that_is_proposed_follows_its_profile(tmp_path):
    (tmp_path / "next.json").write_text(json.dumps({"tried": [PROPOSED]}))
    stop = proposed_stop(tmp_path, SYSTEM)
    assert (stop.conditions.initial_speed, stop.conditions.direction) == (40.0, -1)
    assert stop.imitated == 1500.0
    demanded = [stop.demand(time) for time in (0.0, 4.9, 5.1, 9.9, 10.1)]
    assert demanded == [3e5, 3e5, 1.2e5, 1.2e5, 3e5]


def test_a_stop_that_is_proposed_has_the_load_and_the_sensors_that_it_asks_for():
    asked = PROPOSED | {"conditions": {**PROPOSED["conditions"], "wheel_load": 60e3}}
    (surface,) = (sensor for sensor in SYSTEM.experiments.sensors if sensor.name == "surface")
    usual, light = stop_of(PROPOSED, SYSTEM), stop_of(asked, with_sensor(SYSTEM, surface))
    assert (usual.conditions.wheel_load, usual.sensors) == (80e3, ())
    assert (light.conditions.wheel_load, light.sensors) == (60e3, ("surface",))


def test_protection_is_off_where_the_roller_stops_faster_than_a_train():
    """It would take that for a slide, and vent."""
    held = {"pB": {"profile": "step", "levels": [2.7e5], "every": 5.0}}
    light = stop_of(PROPOSED | {"inputs": held}, SYSTEM)
    assert stop_of(PROPOSED | {"settings": {"imitated": TRAIN_INERTIA}}, SYSTEM).protected
    made = simulate(light, SEED, CONSTANT_PADS, REFERENCE)
    braking = (made.time > made.drawn.coasting) & (made.time < made.standstill)
    assert np.all(np.diff(made.truth["pB"][braking]) >= 0.0)
    # Three discs at a radius of 0.30 m stop roller and wheelset, once pressure is there: 1.1 s late
    # by its lags. Tolerances of the stop are 2 % of friction and 1 % of inertia; losses help.
    inertia = 1500.0 + 110.0 * (0.70 / 0.46) ** 2
    torque = 3 * 0.30 * made.truth["Fperp"].max() * 0.30 * 0.70 / 0.46
    expected = 1.1 + 40.0 / 0.70 * inertia / torque
    assert made.standstill - made.drawn.coasting == pytest.approx(expected, rel=0.06)


def test_a_drive_that_imitates_the_roller_alone_gives_back_its_losses():
    """As heavy as it is: nothing of what brakes it is carried, and it stops five times as fast."""
    losses = Losses(20.0, 1.5, 0.02)
    drive = Drive(1500.0, 1500.0, losses, 60.0, 0.001)
    torques = [drive.step(60.0 - 0.01 * k, stopped=False) for k in range(2000)]
    # It follows by 3 ms, in which losses fall by 0.03 rad/s of theirs, and ripples by 0.5 %.
    assert torques[-1] == pytest.approx(losses.torque(60.0 - 0.01 * 1999), rel=0.006)
    usual = Drive(1500.0, TRAIN_INERTIA, losses, 60.0, 0.001)
    carried = [usual.step(60.0 - 0.01 * k, stopped=False) for k in range(2000)][-1]
    # 10 rad/s2 of 1500 kg.m2, what brakes it beside its own torque: the drive carries 81 % of all.
    share = 1.0 - 1500.0 / TRAIN_INERTIA
    assert carried == pytest.approx(share / (1.0 - share) * 15e3, rel=0.02)


@pytest.mark.parametrize(
    "text",
    [
        "no JSON",
        "[]",
        '{"tried": []}',
        json.dumps({"tried": [PROPOSED | {"inputs": {}}]}),
        json.dumps(
            {"tried": [{**PROPOSED, "conditions": {**PROPOSED["conditions"], "discs": ["wet"]}}]}
        ),
    ],
)
def test_what_the_rig_cannot_make_is_refused(text, tmp_path):
    (tmp_path / "next.json").write_text(text)
    with pytest.raises(InputError, match="no experiment that says speed, direction, surfaces"):
        proposed_stop(tmp_path, SYSTEM)


def test_a_folder_without_a_proposal_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"next\.json"):
        proposed_stop(tmp_path, SYSTEM)


# --- files and command line ---


@pytest.fixture(scope="module")
def recordings(once) -> Path:
    def make(out: Path) -> Path:
        assert main(arguments(out, "--workers", "2")) == 0
        return out

    return once("rig", make)


def arguments(out: Path, *more: str) -> list[str]:
    """As `make cases` does; the first has the slide, where the smallest difference grows."""
    cases = ["--case", "09_wet_160_4.2_wsp", "--case", "10_wet_100_2.7_rev"]
    as_made = ["--seed", "1", "--truth-every", "4", "--reference", str(REFERENCE)]
    return ["rig", *cases, *as_made, "--out", str(out), *more]


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_same_seed_gives_the_same_bytes_with_any_number_of_workers(recordings, tmp_path):
    assert main(arguments(tmp_path, "--workers", "1")) == 0
    assert len(files(tmp_path)) == 8
    assert files(tmp_path) == files(recordings)


def test_a_case_does_not_depend_on_which_others_are_made(recordings, tmp_path):
    alone = ["rig", "--case", "10_wet_100_2.7_rev", "--reference", str(REFERENCE)]
    assert main([*alone, "--out", str(tmp_path)]) == 0
    name = "10_wet_100_2.7_rev/measured.csv"
    assert files(tmp_path)[name] == files(recordings)[name]


@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64",
    reason="another mathematical library rounds otherwise",
)
def test_the_recordings_of_the_repository_are_what_the_rig_makes(recordings):
    """truth.json also holds the hash of the FMU, which any change of its files moves."""
    made, kept = files(recordings), files(CASES)
    assert len(made) == 8
    for name, content in made.items():
        if not name.endswith("truth.json"):
            assert content == kept[name], name
            continue
        new, old = json.loads(content), json.loads(kept[name])
        assert old | {"fmu_sha256": None} == new | {"fmu_sha256": None}


def test_another_seed_gives_another_stop():
    name = "03_dry_120_3.6"
    stops = [make(name), simulate(SCENARIOS[name], SEED + 1, ORDINARY_PADS, REFERENCE)]
    assert stops[0].drawn.muDC != stops[1].drawn.muDC
    noise = [sample(s, ORDINARY_PADS, s.time[1000:1100])["pB"] for s in stops]
    assert not np.array_equal(noise[0], noise[1])


def test_recordings_are_cases_with_their_conditions(recordings):
    for case in read_cases([recordings], SYSTEM):
        wanted = SCENARIOS[case.name].conditions
        assert case.title == SCENARIOS[case.name].title
        # Speed and pressure are written in km/h and bar; rounding is 1e-16.
        assert case.conditions["initial_speed"] == pytest.approx(wanted.initial_speed, rel=1e-12)
        assert case.conditions["brake_pressure"] == pytest.approx(wanted.brake_pressure, rel=1e-12)
        assert case.conditions["wheel_rail"] == wanted.wheel_rail
        assert case.conditions["discs"] == wanted.discs
        made = json.loads((recordings / case.name / "truth.json").read_text())
        assert np.diff(case.time) == pytest.approx(0.005)
        assert 3.0 <= made["demand"] <= 5.0
        # Two seconds of standstill, to a sample.
        assert case.time[-1] - made["standstill"] == pytest.approx(2.0, abs=0.006)
        # Five sigma of the relative noise, and what drag takes in coasting and running in.
        speed = abs(case["omegaR"][0]) * ROLLER_RADIUS
        assert speed == pytest.approx(case.conditions["initial_speed"], rel=2e-3)
        assert np.sign(case["omegaW"][0]) == case.conditions["direction"] == wanted.direction
        assert "Fx" in case


def test_truth_stands_in_files_of_its_own(recordings):
    folder = recordings / "10_wet_100_2.7_rev"
    truth = pd.read_csv(folder / "truth.csv")
    assert np.array_equal(truth["time [s]"], read_case(folder, SYSTEM).time[::4])
    assert truth["film2 [1]"].iloc[0] == 1.0
    assert truth["film2 [1]"].iloc[-1] < 0.1
    made = json.loads((folder / "truth.json").read_text())
    assert made["seed"] == 1
    assert made["effects"] == {"speed_friction": 0.2, "fade": 4e-4, "pressure_exponent": 0.04}
    assert set(made["drawn"]) == {"JW", "JR", "Fz", "muDC", "muWR", "coasting"}


def test_scenarios_are_named_with_or_without_number():
    assert [s.name for s in select([])] == list(STANDARD)
    assert [s.name for s in select(["locked_wheel"])] == ["15_locked_wheel"]


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (["--case", "locked_weel"], r"closest: '15_locked_wheel'"),
        (["--effect", "fade_=1"], r"closest: 'fade'"),
        (["--effect", "fade"], r"found ''"),
        (["--effect", "fade=nan"], r"a number in \[1/K\]"),
        (["--effect", "cylinder_lag=-1"], r"0 or more"),
        (["--effect", "fade=1", "--effect", "fade=2"], r"second size"),
        (["--rate", "300"], r"divisor of 1000"),
        (["--reference", "missing.fmu"], r"missing\.fmu"),
        (["--reference", str(ROOT / "fmus" / "fmi2" / "MinimalObserver.fmu")], r"no variable"),
    ],
)
def test_a_users_mistake_gives_status_2_and_a_message(tmp_path, capsys, options, match):
    command = ["rig", "--reference", str(REFERENCE), "--out", str(tmp_path / "out"), *options]
    assert main(command) == 2
    message = capsys.readouterr().err
    assert re.search(match, message), message
    assert "expected" in message


def test_a_measured_recording_is_never_overwritten(tmp_path):
    folder = tmp_path / "01_dry_80_1.5"
    folder.mkdir()
    (folder / "measured.csv").write_text("measured")
    with pytest.raises(InputError, match="did not make"):
        check_files([folder], 200)


@pytest.mark.usefixtures("ctrl_c")
def test_interrupt_keeps_finished_cases(tmp_path):
    command = ("-m", "workbench", "rig", "--workers", "1", "--out", tmp_path)
    with running(*command) as process:
        first = process.stderr.readline()
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all processes of the group
        printed, errors = process.communicate(timeout=LONGEST)
    assert first.startswith("[  1/14]")
    assert process.returncode == 130
    assert "Traceback" not in errors
    kept = read_cases([tmp_path], SYSTEM)
    assert 1 <= len(kept) < 14
    assert f"{len(kept)} of 14 cases" in printed
    assert not list(tmp_path.rglob("*.part"))


def test_cases_are_the_standard_stops_of_the_rig():
    assert tuple(case.name for case in read_cases([CASES], SYSTEM)) == STANDARD
    for name in STANDARD:
        made = json.loads((CASES / name / "truth.json").read_text())
        assert (made["seed"], made["rate"]) == (1, 200)


def test_nothing_but_accuracy_reads_the_truth_of_the_rig():
    """What estimates, tunes or diagnoses cannot import it either: its layer is above."""
    package = ROOT / "workbench"
    readers = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if re.search(r"truth\.(csv|json)", path.read_text())
    }
    files = {"rig/files.py", "commands/rig.py", "truth.py", "commands/accuracy.py"}
    # Recorded sets that say what is wrong in them are scored, with what was found.
    scored = {"machines/train/recorded.py", "cli/power.py"}
    assert readers <= {f"machines/wheelset/{name}" for name in files} | scored
