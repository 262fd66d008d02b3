"""Recordings that contradict themselves: refused where impossible, warned of where unlikely."""

import dataclasses
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import workbench as wb
from workbench.__main__ import main
from workbench.diagnosis import problem_of
from workbench.errors import InputError
from workbench.machines.wheelset.planting import PLANTABLE, PlantedStops
from workbench.machines.wheelset.rig import SCENARIOS, Effects
from workbench.recordings.case import read_case, read_cases
from workbench.recordings.datasets import read_recorded
from workbench.recordings.plausibility import Origin, doubts
from workbench.studies.power import Repertoire
from workbench.system.registry import load_system

from .scenarios import REFERENCE
from .systems import TRAIN, WHEELSET

RECORDINGS = Path(__file__).parent.parent.parent / "shared" / "recordings"
NAME = "03_dry_120_3.6"
SPEEDS = ("omegaW [rad/s]", "omegaR [rad/s]")

Table = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def stop(root) -> tuple[str, Table]:
    """A recorded stop: its case.toml, and its columns by header."""
    folder = root / "cases" / NAME
    header, *rows = (folder / "measured.csv").read_text().splitlines()
    columns = np.array([[float(cell) for cell in row.split(",")] for row in rows]).T
    return (folder / "case.toml").read_text(), dict(zip(header.split(","), columns, strict=True))


def write(folder: Path, toml: str, table: Table) -> Path:
    folder.mkdir()
    (folder / "case.toml").write_text(toml)
    pd.DataFrame(table).to_csv(folder / "measured.csv", index=False, na_rep="nan")
    return folder


def changed(table: Table, **columns: np.ndarray) -> Table:
    """Some columns replaced, by the name before the unit."""
    return {header: columns.get(header.split()[0], values) for header, values in table.items()}


def cell(table: Table, row: int, name: str, value: float) -> Table:
    values = table[name].copy()
    values[row] = value
    return {**table, name: values}


def renamed(table: Table, **headers: str) -> Table:
    return {headers.get(header.split()[0], header): values for header, values in table.items()}


def three_stops(table: Table) -> Table:
    last = table["time [s]"][-1]
    return {
        header: np.concatenate([v + k * (last + 30.0) if "time" in header else v for k in range(3)])
        for header, v in table.items()
    }


RPM = 60.0 / (2.0 * np.pi)
IMPOSSIBLE: dict[str, tuple[Callable[[Table], Table], str]] = {
    "rpm of one wheel declared as rad/s": (
        lambda t: {**t, SPEEDS[0]: t[SPEEDS[0]] * RPM},
        r"line 2, column 'omegaW': found 69\d\.\d+ rad/s at 0 s, and \d+ more such samples; "
        "expected what is possible, from -360 rad/s",
    ),
    "rpm of a slow wheel": (
        # Below a speed of 17 km/h even revolutions per minute are possible speeds.
        lambda t: {**t, SPEEDS[0]: t[SPEEDS[0]] * RPM * 0.2, SPEEDS[1]: t[SPEEDS[1]] * 0.2},
        "apart in half of .*: wheel and roller roll along while nothing brakes",
    ),
    "one cell of 1e50": (
        lambda t: cell(t, 1000, "Fx [N]", 1e50),
        r"line 1002, column 'Fx': found 1e\+47 kN at 5 s; expected what is possible",
    ),
    "swapped columns of speed": (
        lambda t: {**t, SPEEDS[0]: t[SPEEDS[1]], SPEEDS[1]: t[SPEEDS[0]]},
        "line 2, column 'omegaR': found rW.omegaW = .* beside rR.omegaR = .* by 57% apart",
    ),
    "constant speed": (
        lambda t: {**t, SPEEDS[1]: np.full_like(t[SPEEDS[1]], 47.6)},
        "column 'omegaR': found 47.6 rad/s in all .* samples; expected readings that scatter",
    ),
    "torque times 1e90": (
        lambda t: changed(t, tauR=t["tauR [N.m]"] * 1e90),
        r"column 'tauR': found .* kN.m at 0 s",
    ),
    "three stops in one file": (
        three_stops,
        r"column 'time': found a gap of 30 s after .* s; expected samples of one recording",
    ),
    "reversed roller": (lambda t: changed(t, omegaR=-t[SPEEDS[1]]), "by 200% apart in half of"),
    "bar labelled kPa": (
        lambda t: renamed(t, pB="pB [kPa]"),
        "brake_pressure: found 360000 Pa where the record has pB = 36.*its largest",
    ),
}


@pytest.mark.parametrize("change", IMPOSSIBLE)
def test_a_recording_that_cannot_be_is_refused_with_its_place(tmp_path, system, stop, change):
    toml, table = stop
    apply, match = IMPOSSIBLE[change]
    with pytest.raises(InputError, match=match):
        read_case(write(tmp_path / "a", toml, apply(table)), system)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("direction = 1", "direction = -1", "direction: found -1 where the record has .* = 1"),
        ('"120 km/h"', '"1e99 km/h"', r"initial_speed: found 2.77778e\+98 m/s where the record"),
        ('"120 km/h"', '"12 km/h"', "initial_speed: found 3.33333 m/s where the record has"),
    ],
)
def test_a_condition_that_the_record_belies_is_refused(tmp_path, system, stop, old, new, match):
    toml, table = stop
    with pytest.raises(InputError, match=match):
        read_case(write(tmp_path / "a", toml.replace(old, new), table), system)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda t: {h: v[::20] for h, v in t.items()}, "line 3, .*found a sample every 0.1 s"),
        (lambda t: {h: v[::200] for h, v in t.items()}, "line 3, .*found a sample every 1 s"),
        (
            lambda t: {h: np.delete(v, slice(1000, 1100)) for h, v in t.items()},
            "line 1002, column 'time': found a gap of 0.505 s after 4.995 s",
        ),
        (
            lambda t: cell(t, 500, "pB [bar]", 7.0),
            "line 502, column 'pB': found 7 bar at 2.5 s; expected what is likely",
        ),
        (
            lambda t: changed(t, omegaR=t[SPEEDS[1]] * 1.1),
            "column 'omegaR': found .* by 9% apart in half of",
        ),
        (
            lambda t: changed(t, tauR=t["tauR [N.m]"] / 1e3),  # kN.m
            r"line 603, column 'tauR': found tauR = 1.0\d* N.m beside rR\*Fx .* by 100% apart",
        ),
        (
            lambda t: {
                h: v / 1e3 if h.startswith("tauR") else v
                for h, v in t.items()
                if not h.startswith("Fx")
            },
            r"line \d+, column 'tauR': found tauR = .* beside sign.*pB.* by 100% apart",
        ),
        (
            lambda t: changed(t, Fx=t["Fx [N]"] / 1e3),
            r"column 'tauR': found tauR = .* beside rR\*Fx .* apart",
        ),
    ],
    ids=[
        *("10 Hz", "1 Hz", "gap", "one cell", "wrong radius"),
        *("kN.m as N.m", "kN.m as N.m, no force", "kN as N"),
    ],
)
def test_a_recording_that_is_unlikely_is_read_with_a_doubt(tmp_path, system, stop, change, match):
    toml, table = stop
    (doubt,) = read_case(write(tmp_path / "a", toml, change(table)), system).doubts
    assert re.search(match, doubt), doubt


def test_a_torque_that_rests_is_doubted_by_its_noise_and_by_the_balance(tmp_path, system, stop):
    toml, table = stop
    rests = changed(table, tauR=np.zeros_like(table["tauR [N.m]"]))
    noise, balance = read_case(write(tmp_path / "a", toml, rests), system).doubts
    assert "column 'tauR': found 0 kN.m in all" in noise
    assert "what the drive gives turns the roller" in balance


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_sensor_of_torque_that_is_off_by_a_tenth_raises_no_doubt(tmp_path, system, stop, share):
    toml, table = stop
    off = changed(table, tauR=share * table["tauR [N.m]"])
    assert read_case(write(tmp_path / "a", toml, off), system).doubts == ()


def test_a_recording_without_forces_raises_no_doubt(system, root):
    for case in read_cases([root / "cases"], system):
        origin = Origin("a.csv", 2, {}, "")
        signals = case.without(["Fx"]).signals
        assert doubts(case.time, signals, case.conditions, system, origin) == ()


@pytest.mark.long
def test_no_effect_of_the_virtual_rig_makes_a_recording_doubtful(tmp_path, system):
    """Each as large as sixteen times what matters, to either side, where it can be so large."""
    known = Repertoire(PLANTABLE, problem_of(system).effects)
    usual = SCENARIOS["03_dry_120_3.6"]
    slower = dataclasses.replace(usual.conditions, initial_speed=60 / 3.6)
    rig = PlantedStops((dataclasses.replace(usual, conditions=slower),), REFERENCE)
    least = {field.name: field.metadata["least"] for field in dataclasses.fields(Effects)}
    tried = 0
    for plantable in PLANTABLE:
        for size in (16.0, -16.0) if plantable.signed else (16.0,):
            gains = {plantable.name: size * known.size(plantable)}
            if gains[plantable.name] < least[plantable.name]:
                continue
            folder = tmp_path / f"{plantable.name} {size:g}"
            rig.write(rig.simulate(1, gains), gains, folder)
            (case,) = read_cases([folder], system)
            assert case.doubts == (), plantable.name
            tried += 1
    assert tried > len(PLANTABLE)


def test_doubts_are_told_by_commands_and_warned_of_in_notebooks(tmp_path, system, stop, capsys):
    toml, table = stop
    folder = write(tmp_path / "a", toml, {h: v[:4000:20] for h, v in table.items()})
    with pytest.warns(UserWarning, match="a sample every 0.1 s"):
        wb.read_cases(folder, system)
    arguments = ["simulate", str(folder), "--estimator", "open_loop", "--workers", "1"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    assert "warning: " in capsys.readouterr().err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "a sample every 0.1 s" in summary["cases"]["a"]["doubts"][0]
    assert "a sample every 0.1 s" in (tmp_path / "out" / "index.html").read_text()


def test_a_table_that_cannot_be_is_refused_by_its_column(system, stop):
    _, table = stop
    frame = pd.DataFrame(cell(table, 10, "pB [bar]", -30.0))
    conditions = {
        **{"initial_speed": "120 km/h", "brake_pressure": "3.6 bar", "wheel_rail": "dry"},
        **{"discs": ["dry"] * 3, "direction": 1},
    }
    with pytest.raises(InputError, match=r"table 'frame', column 'pB': found -30 bar at 0.05 s"):
        wb.case_from_frame(system, frame, conditions)


FOLDERS = [RECORDINGS / "standard", *sorted((RECORDINGS / "labelled").glob("*"))]


@pytest.mark.parametrize("folder", [Path("cases"), *FOLDERS], ids=lambda path: path.name)
def test_recordings_that_are_right_raise_no_doubt(root, system, folder):
    if not (root / folder).is_dir():
        pytest.skip("recordings that are not at hand")
    for case in read_cases([root / folder], system):
        assert case.doubts == ()


@pytest.mark.long
@pytest.mark.parametrize("set_", ["healthy", "labelled", "history"])
def test_recordings_of_a_train_that_are_right_raise_no_doubt(set_):
    cases = sorted((RECORDINGS / "train" / set_).rglob("case.toml"))
    if not cases:
        pytest.skip("recordings that are not at hand")
    train = TRAIN
    for path in cases:
        assert read_recorded(path.parent, train).doubts == (), path


def test_a_film_of_water_that_lets_the_wheel_slide_raises_no_doubt(system, root):
    """Pressure is let off while the wheel is far from rolling along; half of all samples agree."""
    case = read_case(root / "cases" / "09_wet_160_4.2_wsp", system)
    slip = system.signal("speed", case.signals) - system.values["rW"] * case["omegaW"]
    assert slip.max() > 2.0  # [m/s]
    assert case.doubts == ()


# --- one sample ---


def held(table: Table, name: str, value: float, first: int, end: int) -> Table:
    values = table[name].copy()
    values[first:end] = value
    return {**table, name: values}


SAMPLES: dict[str, tuple[Callable[[Table], Table], str]] = {
    "a wheel speed of one sample": (
        lambda t: held(t, SPEEDS[0], 57.7, 2000, 2001),
        r"line 2002, column 'omegaW': found 57\.7 rad/s at 10 s, beside .* and 0 more such",
    ),
    "a wheel speed of three samples": (
        lambda t: {
            **t,
            SPEEDS[0]: t[SPEEDS[0]] + 5.0 * (np.abs(np.arange(len(t[SPEEDS[0]])) - 1500) < 2),
        },
        r"line 1501, column 'omegaW': found .* at 7\.495 s, beside .* and 2 more such",
    ),
    "a first speed of another time": (
        lambda t: held(t, SPEEDS[1], 3.0, 0, 1),
        r"line 2, column 'omegaR': found 3 rad/s at 0 s, beside .* and 0 more such",
    ),
    "a pressure that drops out": (
        lambda t: held(t, "pB [bar]", 0.0, 1500, 1503),
        r"line 1502, column 'pB': found .* bar at 7\.5 s, beside .* and \d more such samples",
    ),
    "a torque that is stuck": (
        lambda t: held(t, "tauR [N.m]", 9999.0, 1000, 1462),
        r"line 1002, column 'tauR': found 9\.999 kN\.m at 5 s, beside .* and 461 more such",
    ),
}


@pytest.mark.parametrize("name", SAMPLES)
def test_what_goes_out_and_back_at_once_is_told_with_its_line(name, stop, tmp_path):
    change, message = SAMPLES[name]
    system = WHEELSET
    toml, table = stop
    assert read_case(write(tmp_path / "whole", toml, table), system).doubts == ()
    doubts = read_case(write(tmp_path / "changed", toml, change(table)), system).doubts
    assert any(re.search(message, doubt) for doubt in doubts), doubts


def test_a_machine_that_turns_within_a_sample_raises_no_doubt(tmp_path):
    """A compressor fills a reservoir until it is switched off, and air is lost from then on.

    The highest sample stands out on both sides by tens of deviations, as a wrong one does.
    """
    system = load_system("air_supply")
    time = 10.0 * np.arange(150.0)
    filled = np.minimum(time, 300.0)
    pressure = 7e5 + 900.0 * filled - 500.0 * (time - filled)
    pressure += 200.0 * np.random.default_rng(1).standard_normal(time.size)
    flag = np.where(time < 300.0, 0.0, 1.0)
    table = {"time [s]": time, "COMP [1]": flag, "reservoir [Pa]": pressure}
    toml = 'title = "Cycle"\n[measurement]\nfile = "measured.csv"\n'
    assert read_case(write(tmp_path / "turning", toml, table), system).doubts == ()
    table = cell(table, 50, "reservoir [Pa]", 9.4e5)
    wrong = read_case(write(tmp_path / "wrong", toml, table), system)
    assert any("line 52, column 'reservoir': found 9.4 bar" in doubt for doubt in wrong.doubts)
