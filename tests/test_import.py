"""Files of recorders are opened as they are: no number is wrong, nothing is invented."""

import builtins
import json
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
from asammdf import MDF
from asammdf import Signal as Logged
from nptdms import ChannelObject, TdmsWriter
from numpy.testing import assert_allclose
from openpyxl.chart import LineChart

import workbench as wb
from workbench.__main__ import main
from workbench.errors import InputError
from workbench.recordings.case import Case, read_cases
from workbench.recordings.channels import RecordingOptions, propose, propose_recordings
from workbench.recordings.formats import read_recorded_file
from workbench.recordings.plausibility import Origin, doubts
from workbench.system.system import System

from .files_of_stops import FORMATS_OF_STOPS, Stops, add_sheet, workbook, workbook_of_stamps
from .recorder_files import (
    DIGITS,
    FORMATS,
    Columns,
    csv_of_a_german_rig,
    german,
    mdf_4,
    recorded,
)
from .systems import TRAIN
from .train_stops import write_stop

UNITS = {"pB": 1e5, "tauR": 1e3, "omegaW": 1 / 3.6 / 0.4, "omegaR": 1 / 3.6 / 0.6, "Fx": 1e3}


@pytest.fixture(scope="module")
def stop(root, system) -> Case:
    """24 s of a stop, every fourth sample of it."""
    (case,) = wb.read_cases(root / "cases" / "01_dry_80_1.5", system)
    return case.part(slice(None, 4800, 4))


@pytest.fixture(autouse=True)
def nobody_answers(monkeypatch) -> None:
    monkeypatch.setattr(builtins, "input", lambda: pytest.fail("a question"))


def rounding(signal: str) -> float:
    """Half of the last digit that a text has, in SI; and roundings of doubles."""
    return 0.51 * UNITS[signal] * 10.0**-DIGITS


def imported(out: Path, name: str, system: System) -> Case:
    (case,) = wb.read_cases(out / name, system)
    return case


# --- formats ---


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_is_imported_without_a_wrong_number(tmp_path, stop, system, name):
    path = tmp_path / name
    FORMATS[name](path, recorded(stop, system))
    before = path.read_bytes()
    assert main(["import", str(path), "--out", str(tmp_path / "cases"), "--yes"]) == 0
    case = imported(tmp_path / "cases", name.partition(".")[0], system)
    assert_allclose(case.time, stop.time - stop.time[0], atol=1e-9)
    for signal in ("tauR", "omegaW", "omegaR", "Fx"):
        assert_allclose(case[signal], stop[signal], rtol=1e-12, atol=rounding(signal))
    exact = slice(None, None, 5)  # where the logger of two rates has samples, too
    assert_allclose(case["pB"][exact], stop["pB"][exact], rtol=1e-12, atol=rounding("pB"))
    assert path.read_bytes() == before


def test_what_was_done_to_a_file_is_written_down(tmp_path, stop, system):
    csv_of_a_german_rig(tmp_path / "a.csv", recorded(stop, system))
    main(["import", str(tmp_path / "a.csv"), "--out", str(tmp_path / "out"), "--yes"])
    (entry,) = json.loads((tmp_path / "out" / "import.json").read_text())["imports"]
    (file,) = entry["files"]
    assert file["format"].startswith("CSV, semicolons, decimal commas, Windows-1252")
    assert file["notes"][0].startswith("1 lines that are no samples were left out, the first in")
    assert entry["dropped"] == ["Temperatur [degC]"]
    assert entry["channels"]["omegaR"]["converted"] == {
        "to": "rad/s",
        "factor": pytest.approx(1 / 3.6 / system.values["rR"], rel=1e-12),
        "zero": 0.0,
        "recorded_as": "rR * omegaR",
    }
    conditions = entry["cases"]["a"]["conditions"]
    assert conditions["initial_speed"]["from"] == "shown by the record"
    assert conditions["wheel_rail"] == {"value": "unknown", "from": "unknown"}


def test_a_file_that_ends_the_process_of_its_library_is_refused(tmp_path, stop, system):
    """Its channels lie far beyond what it holds, where asammdf's compiled code looks for them."""
    path = tmp_path / "stop.mf4"
    mdf_4(path, recorded(stop, system))
    damaged = bytearray(path.read_bytes())
    block = -1
    while (block := damaged.find(b"##CN", block + 1)) >= 0:
        (links,) = struct.unpack_from("<Q", damaged, block + 16)
        struct.pack_into("<I", damaged, block + 24 + 8 * links + 4, 1 << 28)  # of the first byte
    path.write_bytes(damaged)
    with pytest.raises(InputError, match=r"an MDF file that cannot be read .*SIGSEGV"):
        read_recorded_file(path)


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_a_formula_that_the_library_cannot_compute_is_told(tmp_path, tank, version):
    """Its channel was taken as recorded: counts in place of millimetres."""
    with MDF(version=version) as file:
        counts, times = np.arange(9000, 9060), np.arange(60.0)
        flow = Logged(np.full(60, 4.0), times, name="inflow", unit="l/s")
        level = Logged(counts, times, name="h", unit="mm", conversion={"formula": "pow(X,2)/1e5"})
        file.append([flow, level])
        path = file.save(tmp_path / "a", overwrite=True)
    (problem,) = propose([read_recorded_file(path)], tank, {}).problems
    assert problem.startswith("h: 'h' has a formula that is not understood, 'pow(X")


def test_the_end_that_a_tdms_file_lacks_is_told(tmp_path, stop, system, capsys):
    path = tmp_path / "stop.tdms"
    FORMATS["labview.tdms"](path, recorded(stop, system))
    command = ["import", str(path), "--out", str(tmp_path / "cases"), "--yes"]
    assert main(command) == 0
    assert "warning" not in capsys.readouterr().err
    path.write_bytes(path.read_bytes()[:-100])
    assert main(command) == 0
    warning = f"warning: {path}: [nptdms.reader WARNING] Last segment of file has less data"
    assert capsys.readouterr().err.count(warning) == 1
    written = json.loads((tmp_path / "cases" / "import.json").read_text())
    assert any("less data" in doubt for doubt in written["imports"][-1]["files"][0]["doubts"])
    # The same without an import.
    (tmp_path / "columns.toml").write_bytes((tmp_path / "cases" / "columns.toml").read_bytes())
    with pytest.warns(UserWarning, match=r"stop\.tdms: \[nptdms"):
        wb.read_cases(path, system, conditions={"wheel_rail": "dry", "discs": ["dry"] * 3})


def test_what_a_library_warns_of_is_noted(tmp_path, stop, system):
    """A variable that a MAT file holds twice: scipy says so by a warning, which nobody saw."""
    path = tmp_path / "stop.mat"
    FORMATS["structures.mat"](path, recorded(stop, system))
    whole = path.read_bytes()
    path.write_bytes(whole + whole[128:])  # without the header
    assert any("Duplicate variable name" in note for note in read_recorded_file(path).notes)


@pytest.mark.parametrize(
    ("package", "begins"),
    [
        ("openpyxl", b"PK\x03\x04"),
        ("xlrd", b"\xd0\xcf\x11\xe0"),
        ("pyarrow", b"PAR1"),
        ("h5py", b"MATLAB 7.3 MAT-file"),
        ("asammdf", b"MDF     "),
        ("nptdms", b"TDSm"),
        ("python_calamine", b"PK\x03\x04mimetypeapplication/vnd.oasis.opendocument.spreadsheet"),
    ],
)
def test_a_missing_reader_names_the_extra(tmp_path, monkeypatch, package, begins):
    (tmp_path / "a").write_bytes(begins)
    monkeypatch.setitem(sys.modules, package, None)
    match = rf"package '{package}' reads.*extra \[files\].*pip install"
    with pytest.raises(InputError, match=match):
        read_recorded_file(tmp_path / "a")


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "found an empty file"),
        (b"PK\x03\x04" + b"x" * 99, "an Excel workbook that cannot be read"),
        (b"PAR1" + b"x" * 99, "a Parquet or Arrow file that cannot be read"),
        (b"MDF     4.10" + b"x" * 99, "an MDF file that cannot be read"),
        (b"MATLAB 7.3 MAT-file" + b"x" * 999, "a MAT 7.3 or HDF5 file that cannot be read"),
        (b"MATLAB 5.0 MAT-file" + b"x" * 999, "a MAT file that cannot be read"),
        (b"\x1f\x8b" + b"x" * 99, "damaged gzip"),
        (b"\xd0\xcf\x11\xe0", r"a workbook of Excel 97 to 2003 \(\.xls\) that cannot"),
        (b'[{"t": 0, "p": 1},\n{"t": 1, "p": ]', "line 2: found text that is no JSON"),
        (b'{"title": "no samples"}', "JSON without a channel of numbers"),
        (b"\0\1\2", "zero bytes, which no text has"),
        (b"hello\nworld\n", "found no columns"),
        (b"t;p;v\n0;1.234;5\n1;1.234;5\n2;1.234;6\n", "'1.234', which can be read with"),
    ],
)
def test_what_is_no_recording_is_refused_in_words(tmp_path, content, match):
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(InputError, match=match):
        read_recorded_file(tmp_path / "a")


# --- the same reader elsewhere ---


def test_a_case_folder_may_hold_the_recorders_file(tmp_path, stop, system):
    columns = recorded(stop, system)
    unit, force = columns["Längskraft"]
    mdf_4(tmp_path / "stop.mf4", {**columns, "Längskraft": (unit, -force)})
    (tmp_path / "case.toml").write_text(
        """title = "as it was recorded"
[conditions]
initial_speed = "80 km/h"
brake_pressure = "1.5 bar"
wheel_rail = "dry"
discs = ["dry", "dry", "dry"]
direction = 1
[measurement]
file = "stop.mf4"
[measurement.columns]
pB = "Bremsdruck"
tauR = "Antriebsmoment"
omegaW = "v_Rad"
omegaR = { channel = "v_Rolle" }
Fx = { channel = "Längskraft", reversed = true }
"""
    )
    (case,) = wb.read_cases(tmp_path, system)
    assert_allclose(case["omegaR"], stop["omegaR"], rtol=1e-12, atol=1e-12)
    assert_allclose(case["Fx"], stop["Fx"], rtol=1e-12, atol=1e-9)


def test_a_bare_file_is_a_case_with_its_conditions_as_options(tmp_path, stop, system):
    columns = {"time [s]": stop.time, "pB [bar]": stop["pB"] / 1e5}
    columns |= {"tauR [kN.m]": stop["tauR"] / 1e3, "omegaW [rad/s]": stop["omegaW"]}
    columns["omegaR [1/min]"] = stop["omegaR"] * 30 / np.pi
    pd.DataFrame(columns).to_csv(tmp_path / "stop.csv", index=False)
    conditions = {"wheel_rail": "dry", "discs": "unknown"}
    (case,) = wb.read_cases(tmp_path / "stop.csv", system, conditions=conditions)
    assert case.name == "stop"
    assert case.conditions["wheel_rail"] == "dry"
    assert case.conditions["initial_speed"] == pytest.approx(80 / 3.6, rel=0.01)
    assert_allclose(case["omegaR"], stop["omegaR"], rtol=1e-12)
    with pytest.raises(InputError, match="no 'wheel_rail'"):
        wb.read_cases(tmp_path / "stop.csv", system)


def test_nothing_is_claimed_of_a_condition_that_nobody_knows(root, tmp_path, system):
    """A slide shows the friction of the rail, if the law of the contact is known."""
    source = root / "cases" / "09_wet_160_4.2_wsp"
    text = (source / "case.toml").read_text()
    runs = {}
    for rail_state in ("dry", "unknown"):
        (tmp_path / rail_state).mkdir()
        toml = text.replace('wheel_rail = "wet"', f'wheel_rail = "{rail_state}"')
        (tmp_path / rail_state / "case.toml").write_text(toml)
        (tmp_path / rail_state / "measured.csv").write_bytes((source / "measured.csv").read_bytes())
        (case,) = wb.read_cases(tmp_path / rail_state, system)
        runs[rail_state] = wb.observe(system, case, "ekf")
    np.testing.assert_array_equal(runs["dry"].estimate, runs["unknown"].estimate)
    (rail,) = [quantity.name for quantity in system.estimated if "wheel_rail" in quantity.claimed]
    assert runs["dry"].claimed[rail].any()
    assert not runs["unknown"].claimed[rail].any()


def test_the_sign_of_the_signals_must_be_known(tmp_path, root, system):
    source = root / "cases" / "01_dry_80_1.5"
    text = (source / "case.toml").read_text()
    (tmp_path / "case.toml").write_text(text.replace("direction = 1", 'direction = "unknown"'))
    (tmp_path / "measured.csv").write_bytes((source / "measured.csv").read_bytes())
    with pytest.raises(InputError, match="direction: found 'unknown'; expected a whole number"):
        wb.read_cases(tmp_path, system)


def test_names_that_nobody_confirmed_are_not_taken_in_silence(tmp_path, stop, system):
    csv_of_a_german_rig(tmp_path / "a.csv", recorded(stop, system))
    with pytest.raises(InputError, match=r"nobody confirmed: perhaps pB = Bremsdruck \[bar\]"):
        wb.read_cases(tmp_path / "a.csv", system)


def test_channels_confirmed_for_a_folder_hold_for_its_files(tmp_path, stop, system):
    out = tmp_path / "out"
    for name in ("a.csv", "b.csv"):
        csv_of_a_german_rig(tmp_path / name, recorded(stop, system))
    assert main(["import", str(tmp_path / "a.csv"), "--out", str(out), "--yes"]) == 0
    assert main(["import", str(tmp_path / "b.csv"), "--out", str(out)]) == 0  # nobody answers
    assert [read_case.name for read_case in wb.read_cases(out, system)] == ["a", "b"]
    (tmp_path / "columns.toml").write_bytes((out / "columns.toml").read_bytes())
    unknown = {"wheel_rail": "unknown", "discs": "unknown"}
    (case,) = wb.read_cases(tmp_path / "b.csv", system, conditions=unknown)
    assert_allclose(case["pB"], stop["pB"], atol=rounding("pB"))


@pytest.fixture(scope="module")
def train_stop(tmp_path_factory) -> Case:
    """A stop of a train on the level, without faults."""
    folder = tmp_path_factory.mktemp("train") / "01_stop"
    write_stop(folder, 1, {})
    (case,) = read_cases([folder], TRAIN)
    return case


GERMAN = ("Bremsdruck {} [bar]", "Masse Wagen {} [t]", "Neigung {} [1]", "v_Achse{} [km/h]")
ENGLISH = ("BCP {} [bar]", "vehicle mass {} [t]", "slope {} [1]", "axle speed {} [km/h]")


@pytest.mark.parametrize(
    ("names", "curve", "acceleration"),
    [
        (GERMAN, "Bogenwiderstand [1]", "Beschleunigung [m/s2]"),
        (ENGLISH, "curve resistance [1]", "longitudinal acceleration [m/s2]"),
    ],
    ids=["German", "English"],
)
def test_channels_of_a_train_are_known_by_the_names_of_a_laboratory(
    tmp_path, train_stop, names, curve, acceleration
):
    kinds = zip(("pB", "mass", "slope", "omega"), names, (1e-5, 1e-3, 1.0, 3.6 * 0.46), strict=True)
    columns = {"Zeit [s]": train_stop.time}
    for signal, name, factor in kinds:
        for i in range(1, 9):
            if f"{signal}{i}" in train_stop:
                columns[name.format(i)] = factor * train_stop[f"{signal}{i}"]
    columns |= {curve: train_stop["curve"], acceleration: train_stop["a"]}
    assert len(columns) == 1 + len(train_stop.signals)
    pd.DataFrame(columns).to_csv(tmp_path / "stop.csv", index=False)
    out = tmp_path / "cases"
    command = ["import", str(tmp_path / "stop.csv"), "--system", "train", "--out", str(out)]
    assert main([*command, "--condition", "rail=dry", "--yes"]) == 0
    (case,) = read_cases([out], TRAIN)
    for name, values in train_stop.signals.items():
        assert_allclose(case[name], values, rtol=1e-12, atol=1e-12)


def test_speeds_of_all_axles_in_another_unit_contradict_the_acceleration(train_stop):
    """In km/h declared as rad/s they agree with each other."""
    wrong = {f"omega{i}": 3.6 * 0.46 * train_stop[f"omega{i}"] for i in range(1, 9)}
    origin = Origin("stop.csv", 2, {}, "")
    signals = {**train_stop.signals, **wrong}
    right, scaled = (
        doubts(train_stop.time, recorded, train_stop.conditions, TRAIN, origin)
        for recorded in (train_stop.signals, signals)
    )
    (doubt,) = set(scaled) - set(right)
    assert "what a train accelerates by turns its axles faster" in doubt


# --- what is proposed, and what is asked ---


@pytest.fixture
def table(tmp_path, stop, system) -> Callable[..., Path]:
    """Writes a CSV of a stop with other headers, by the usual name of a column."""

    def write(name: str = "a.csv", **headers: str) -> Path:
        columns = recorded(stop, system)
        shown = [headers.get(key, f"{key} [{unit}]") for key, (unit, _) in columns.items()]
        values = zip(*(values for _, values in columns.values()), strict=True)
        lines = [";".join(shown), *(";".join(map(german, row)) for row in values)]
        (tmp_path / name).write_text("\n".join(lines))
        return tmp_path / name

    return write


def test_an_answer_confirms_and_corrects_at_once(table, tmp_path, system, monkeypatch):
    questions = []

    def answer() -> str:
        questions.append(1)
        return "pB = Kanal 7 [bar]; wheel_rail=dry; discs=dry,dry,wet"

    monkeypatch.setattr(builtins, "input", answer)
    path = table(Bremsdruck="Kanal 7", Temperatur="Kanal 8")
    assert main(["import", str(path), "--out", str(tmp_path / "out")]) == 0
    assert len(questions) == 1
    case = imported(tmp_path / "out", "a", system)
    assert case.conditions["discs"] == ("dry", "dry", "wet")
    assert case.conditions["wheel_rail"] == "dry"


@pytest.mark.parametrize(
    ("headers", "match"),
    [
        (
            {"Bremsdruck": "Bremsdruck 1 [bar]", "Temperatur": "Bremsdruck 2 [kPa]"},
            "pB: it may be 'Bremsdruck 1' or 'Bremsdruck 2'",
        ),
        ({"Bremsdruck": "Bremsdruck Soll [bar]"}, "'Bremsdruck Soll' is asked for, not measured"),
        ({"Bremsdruck": "Kanal 7 [bar]"}, "speaks for it, --column 'pB=Kanal 7' confirms"),
        ({"Bremsdruck": "Bremsdruck [N]"}, r"'Bremsdruck' is in \[N\]"),
        ({"Antriebsmoment": "Antriebsmoment [km/h]"}, r"'Antriebsmoment' is in \[km/h\]"),
        ({"Temperatur": "Bremsdruck [°C]", "Bremsdruck": "x"}, r"'Bremsdruck' is in \[degC\]"),
        ({"v_Rad": "v_Rad [m/s]"}, "wheel and roller roll along"),
        ({"v_Rad": "v_Rad"}, "'v_Rad' has no unit and is plausible as"),
        ({"Zeit": "Messwert"}, "no time among"),
        (
            {"Bremsdruck": "Bremsdruck"},
            "pB: no unit in the file, --column 'pB=Bremsdruck [bar]' confirms",
        ),
        ({"Zeit": "Zeit"}, "time: no unit in the file, --column 'time=Zeit [s]' confirms"),
    ],
)
def test_what_is_not_certain_is_not_taken_by_yes(table, tmp_path, capsys, headers, match):
    assert main(["import", str(table(**headers)), "--out", str(tmp_path / "out"), "--yes"]) == 2
    error = capsys.readouterr().err
    assert match.replace("\\", "") in error
    assert not list((tmp_path / "out").glob("*/case.toml"))


def test_one_channel_is_not_taken_for_two_signals(table, tmp_path, capsys):
    command = ["import", str(table()), "--out", str(tmp_path / "out"), "--yes"]
    assert main([*command, "--column", "omegaW=v_Rolle", "--column", "omegaR=V_ROLLE"]) == 2
    error = capsys.readouterr().err
    assert "'v_Rolle'" in error
    assert "stands for omegaW and for omegaR" in error


def test_a_unit_that_alone_is_plausible_is_asked_about_and_said(
    table, tmp_path, stop, system, monkeypatch
):
    monkeypatch.setattr(builtins, "input", lambda: "")
    path = table(Bremsdruck="Bremsdruck")
    assert main(["import", str(path), "--out", str(tmp_path / "out")]) == 0
    (entry,) = json.loads((tmp_path / "out" / "import.json").read_text())["imports"]
    assert entry["channels"]["pB"]["unit"] == "bar"
    assert not entry["channels"]["pB"]["unit_stated"]
    assert_allclose(imported(tmp_path / "out", "a", system)["pB"], stop["pB"], atol=rounding("pB"))


def test_a_unit_that_a_further_file_states_is_not_overruled(table, tmp_path, capsys):
    """The first file has no unit, and bar is confirmed; the second says kPa and is asked about."""
    out = str(tmp_path / "out")
    first = ["import", str(table(Bremsdruck="Bremsdruck")), "--out", out, "--yes"]
    assert main([*first, "--column", "pB=Bremsdruck [bar]"]) == 0
    other = table("b.csv", Bremsdruck="Bremsdruck [kPa]")
    assert main(["import", str(other), "--out", out, "--yes"]) == 0
    assert "Bremsdruck [kPa]" in capsys.readouterr().out


def test_of_several_files_one_that_is_refused_leaves_the_others(table, tmp_path, system):
    bad = table("bad.csv", Zeit="Messwert")
    good = table("good.csv")
    assert main(["import", str(bad), str(good), "--out", str(tmp_path / "out"), "--yes"]) == 2
    assert [read_case.name for read_case in wb.read_cases(tmp_path / "out", system)] == ["good"]


def test_a_folder_with_other_files_is_left_as_it_is(table, tmp_path, capsys):
    assert main(["import", str(table()), "--out", str(tmp_path), "--yes"]) == 2
    assert "a folder with other files" in capsys.readouterr().err


NAMES = "Stop 1", "Stop 2"
SIGNALS = "pB", "tauR", "omegaW", "omegaR", "Fx"


@pytest.fixture(scope="module")
def cases(root, system) -> list[Case]:
    """24 s of two stops, every fourth sample of them."""
    names = "01_dry_80_1.5", "02_dry_100_2.7"
    read = wb.read_cases([root / "cases" / name for name in names], system)
    return [recording.part(slice(None, 4800, 4)) for recording in read]


@pytest.fixture(scope="module")
def stops(cases, system) -> dict[str, Columns]:
    return {name: recorded(case, system) for name, case in zip(NAMES, cases, strict=True)}


@pytest.fixture
def take(tmp_path) -> Callable[..., int]:
    """Imports a file of the folder into `out`."""
    return lambda name, *options: main(
        ["import", str(tmp_path / name), "--out", str(tmp_path / "out"), "--yes", *options]
    )


def assert_same(case: Case, truth: Case, rtol: float = 1e-9) -> None:
    assert_allclose(case.time, truth.time - truth.time[0], atol=1e-6)
    for signal in SIGNALS:
        assert_allclose(case[signal], truth[signal], rtol=rtol, atol=1e-9)


def record(folder: Path) -> list[dict]:
    return json.loads((folder / "out" / "import.json").read_text())["imports"]


# --- each is a case ---


@pytest.mark.parametrize("name", FORMATS_OF_STOPS)
def test_each_recording_of_a_file_is_a_case_without_a_wrong_number(
    tmp_path, take, cases, stops, system, name
):
    write, called = FORMATS_OF_STOPS[name]
    write(tmp_path / name, stops)
    assert take(name) == 0
    recorded = record(tmp_path)
    assert [entry["recording"] for entry in recorded] == list(called)
    for entry, truth in zip(recorded, cases, strict=True):
        (folder,) = entry["cases"]
        (case,) = wb.read_cases(tmp_path / "out" / folder, system)
        assert_same(case, truth)
        assert set(entry["channels"]) == set(SIGNALS)
        assert entry["channels"]["omegaR"]["converted"]["recorded_as"] == "rR * omegaR"
        assert entry["dropped"] == ["Temperatur [degC]"]
    assert len(list((tmp_path / "out").glob("*/case.toml"))) == 2


def test_one_question_asks_for_all_recordings_and_what_it_says_is_kept(
    tmp_path, cases, stops, system, monkeypatch, capsys
):
    questions = []

    def answer() -> str:
        questions.append(1)
        return "pB = Kanal 7; wheel_rail=dry"

    monkeypatch.setattr(builtins, "input", answer)
    unnamed = {
        title: {name.replace("Bremsdruck", "Kanal 7"): column for name, column in stop.items()}
        for title, stop in stops.items()
    }
    for name in ("a.xlsx", "b.xlsx"):
        workbook(tmp_path / name, unnamed)
        assert main(["import", str(tmp_path / name), "--out", str(tmp_path / "out")]) == 0
    assert len(questions) == 1  # the second file has the same channels
    shown = capsys.readouterr().out
    assert "2 recordings, with the same channels: 'Stop 1', 'Stop 2'" in shown
    assert shown.count("  pB         Kanal 7 [bar]") == 1 + 1
    for name in ("a_Stop_1", "b_Stop_1"):
        (case,) = wb.read_cases(tmp_path / "out" / name, system)
        assert_same(case, cases[0])
    assert case.conditions["wheel_rail"] == "unknown"  # it was said of the first file


@pytest.mark.filterwarnings("ignore:.*a sample every 0.04 s")
def test_sheets_may_differ_in_order_rate_and_stated_units(tmp_path, take, cases, stops, system):
    other = {name: (unit, v[::2]) for name, (unit, v) in reversed(stops["Stop 2"].items())}
    _, pressure = other["Bremsdruck"]
    other["Bremsdruck"] = "kPa", 100.0 * pressure
    workbook(tmp_path / "a.xlsx", {"Stop 1": stops["Stop 1"], "Stop 2": other})
    assert take("a.xlsx") == 0
    for name, truth in (("a_Stop_1", cases[0]), ("a_Stop_2", cases[1].part(slice(None, None, 2)))):
        (case,) = wb.read_cases(tmp_path / "out" / name, system)
        assert_same(case, truth)
    assert [entry["channels"]["pB"]["unit"] for entry in record(tmp_path)] == ["bar", "kPa"]


def test_a_unit_that_one_sheet_alone_states_is_not_taken_for_the_others(
    tmp_path, take, stops, capsys
):
    third = {name: (unit, 0.9 * values) for name, (unit, values) in stops["Stop 1"].items()}
    third["Bremsdruck"] = "", 0.9 * stops["Stop 1"]["Bremsdruck"][1]
    workbook(tmp_path / "a.xlsx", {**stops, "third": third})
    assert take("a.xlsx") == 2
    error = capsys.readouterr().err
    assert "'third': found pB: 'Bremsdruck' [bar], in 'Stop 1' 'Bremsdruck'" in error
    assert [entry["recording"] for entry in record(tmp_path)] == list(NAMES)


def test_a_sheet_that_lacks_a_channel_is_refused_and_leaves_the_others(
    tmp_path, take, stops, capsys
):
    third = {name: column for name, column in stops["Stop 1"].items() if name != "Bremsdruck"}
    workbook(tmp_path / "a.xlsx", {**stops, "third": third})
    assert take("a.xlsx") == 2
    assert "a.xlsx, 'third': found pB: no channel whose name" in capsys.readouterr().err
    for entry in record(tmp_path):
        assert any(
            "'third' is no such recording: pB" in note for note in entry["files"][0]["notes"]
        )


def test_what_else_a_workbook_holds_is_written_down(tmp_path, take, stops, capsys):
    """A sheet of notes, an empty one, a hidden one, a climate record and a sheet of a diagram."""
    book = openpyxl.Workbook()
    book.active.append(["Prüfer", "Müller"])
    add_sheet(book, "Stop 1", stops["Stop 1"])
    book.create_sheet("empty")
    book.create_chartsheet("diagram").add_chart(LineChart())
    add_sheet(book, "climate", {"Zeit": ("s", np.arange(60.0)), "Feuchte": ("%", np.arange(60.0))})
    add_sheet(book, "Stop 2", stops["Stop 2"])
    book["Stop 2"].sheet_state = "hidden"
    book.save(tmp_path / "a.xlsx")
    assert take("a.xlsx") == 0
    assert "'climate' holds other channels: Feuchte, Zeit" in capsys.readouterr().out
    for entry in record(tmp_path):
        notes = " ".join(entry["files"][0]["notes"])
        for note in ("'Sheet' was left out", "'Stop 2' is hidden", "'climate' holds other"):
            assert note in notes
    assert [entry["recording"] for entry in record(tmp_path)] == list(NAMES)


def test_names_of_sheets_become_names_that_differ(tmp_path, take, stops, system, cases):
    """Two that differ in signs alone, which no file system takes."""
    FORMATS_OF_STOPS["labview.tdms"][0](
        tmp_path / "a.tdms", dict(zip(("80 km/h wet", "80 km:h wet"), stops.values(), strict=True))
    )
    assert take("a.tdms") == 0
    assert take("a.tdms") == 0  # and again: in the same folders
    for name, truth in zip(("a_80_km_h_wet", "a_80_km_h_wet_tdms"), cases, strict=True):
        (case,) = wb.read_cases(tmp_path / "out" / name, system)
        assert_same(case, truth)
    assert len(record(tmp_path)) == 2
    assert "a.tdms, '80 km/h wet'" in (tmp_path / "out" / "a_80_km_h_wet" / "case.toml").read_text()


# --- what cannot be told ---


def at_once(path: Path, stops: Stops) -> None:
    """Sheets with dates of one time."""
    workbook_of_stamps(path, dict(zip(("one", "two"), stops.values(), strict=True)), 0.0)


def clocks_of_day(path: Path, stops: Stops) -> None:
    """Sheets with times of day and no date, of one time."""
    workbook_of_stamps(path, stops, 0.0, of_day=True)


def running_clock(path: Path, stops: Stops) -> None:
    """Times that count from when the recorder was switched on."""
    late = {
        title: {**columns, "Zeit": ("s", columns["Zeit"][1] + 1532.4)}
        for title, columns in stops.items()
    }
    workbook(path, late)


def filtered(path: Path, stops: Stops) -> None:
    """One stop twice, one of them with a filtered speed."""
    columns = next(iter(stops.values()))
    unit, speed = columns["v_Rolle"]
    smooth = {
        **columns,
        "v_Rolle": (unit, np.convolve(np.pad(speed, 1, "edge"), [0.25, 0.5, 0.25], "valid")),
    }
    workbook(path, {"raw": columns, "filtered": smooth})


def extract(path: Path, stops: Stops) -> None:
    """A stop, and the middle of it from a zero of its own."""
    columns = next(iter(stops.values()))
    middle = slice(100, 600)
    part = {name: (unit, values[middle]) for name, (unit, values) in columns.items()}
    part["Zeit"] = "s", part["Zeit"][1] - part["Zeit"][1][0]
    workbook(path, {"whole": columns, "part": part})


@pytest.mark.parametrize("write", [at_once, clocks_of_day, running_clock, filtered, extract])
def test_what_may_be_one_recording_by_two_recorders_is_not_taken_for_two(
    tmp_path, take, stops, capsys, write
):
    write(tmp_path / "a.xlsx", stops)
    assert take("a.xlsx") == 2
    error = capsys.readouterr().err
    assert "they are two recordings, --apart, or one" in error
    assert not list((tmp_path / "out").glob("*/case.toml"))
    assert take("a.xlsx", "--apart") == 0
    assert len(list((tmp_path / "out").glob("*/case.toml"))) == 2


def test_channels_of_one_sheet_may_be_named(tmp_path, take, stops, system, cases):
    at_once(tmp_path / "a.xlsx", stops)
    channels = {"pB": "Bremsdruck", "tauR": "Antriebsmoment", "omegaW": "v_Rad", "Fx": "Längskraft"}
    channels["omegaR"] = "v_Rolle"
    options = [part for key, name in channels.items() for part in ("--column", f"{key}=two/{name}")]
    assert take("a.xlsx", *options) == 0
    (entry,) = record(tmp_path)
    assert not entry.get("recording")
    (case,) = wb.read_cases(tmp_path / "out" / "a", system)
    assert_same(case, cases[1])


def test_signals_of_two_sheets_that_may_be_two_recordings_are_told(tmp_path, take, stops, capsys):
    """What the second lacks is in the first alone, and would be taken from it in silence."""
    second = {name: column for name, column in stops["Stop 2"].items() if name != "v_Rad"}
    workbook(tmp_path / "a.xlsx", {"Stop 1": stops["Stop 1"], "Stop 2": second})
    channels = {"pB": "Bremsdruck", "tauR": "Antriebsmoment", "omegaR": "v_Rolle"}
    named = [
        part for key, name in channels.items() for part in ("--column", f"{key}=Stop 2/{name}")
    ]
    take("a.xlsx", *named)
    error = capsys.readouterr().err
    assert "omegaW is taken from 'Stop 1', which holds 'Bremsdruck' as 'Stop 2' does" in error


def test_a_unit_named_for_all_sheets_is_not_taken_for_one_that_states_another(
    tmp_path, take, stops, capsys
):
    third = {name: (unit, 0.9 * values) for name, (unit, values) in stops["Stop 1"].items()}
    _, pressure = third["Bremsdruck"]
    silent = {
        title: {**columns, "Bremsdruck": ("", columns["Bremsdruck"][1])}
        for title, columns in stops.items()
    }
    third["Bremsdruck"] = "kPa", 100.0 * pressure
    workbook(tmp_path / "a.xlsx", {**silent, "third": third})
    assert take("a.xlsx", "--column", "pB=Bremsdruck [bar]") == 2
    error = capsys.readouterr().err
    assert "'third': found" in error
    assert "taken in [bar], as named, and the file states [kPa]" in error
    assert [entry["recording"] for entry in record(tmp_path)] == list(NAMES)


def test_files_together_are_one_recording_whatever_their_sheets(tmp_path, take, stops, capsys):
    workbook(tmp_path / "a.xlsx", stops)
    assert take("a.xlsx", "--together") == 2
    assert "it may be 'Stop 1/Bremsdruck' or 'Stop 2/Bremsdruck'" in capsys.readouterr().err


def test_a_file_of_several_recordings_is_no_case_by_itself(tmp_path, stops, system):
    workbook(tmp_path / "a.xlsx", stops)
    with pytest.raises(InputError, match=r"2 recordings, 'Stop 1', 'Stop 2'.*a case of each"):
        wb.read_cases(tmp_path / "a.xlsx", system)


# --- what is one recording, as before ---


def test_channels_of_two_loggers_on_two_sheets_are_one_recording(
    tmp_path, take, stops, system, cases
):
    columns = stops["Stop 1"]
    pressure = {name: columns[name] for name in ("Zeit", "Bremsdruck", "Temperatur")}
    others = {
        name: column for name, column in columns.items() if name not in ("Bremsdruck", "Temperatur")
    }
    workbook(tmp_path / "a.xlsx", {"hydraulics": pressure, "drive": others})
    assert take("a.xlsx") == 0
    (case,) = wb.read_cases(tmp_path / "out" / "a", system)
    assert_same(case, cases[0])
    (entry,) = record(tmp_path)
    assert not entry.get("recording")


def test_a_sheet_whose_names_are_less_alike_is_left_out(tmp_path, take, stops, system, cases):
    other = {f"{name} gefiltert": column for name, column in stops["Stop 2"].items()}
    workbook(tmp_path / "a.xlsx", {"raw": stops["Stop 1"], "filtered": other})
    assert take("a.xlsx") == 0
    (case,) = wb.read_cases(tmp_path / "out" / "a", system)
    assert_same(case, cases[0])
    assert "Bremsdruck gefiltert [bar]" in record(tmp_path)[0]["dropped"]


def test_vectors_without_a_time_of_their_own_are_no_recordings(tmp_path, stops, system):
    """TDMS without waveforms."""
    with TdmsWriter(tmp_path / "a.tdms") as file:
        for title, columns in stops.items():
            held = {name: column for name, column in columns.items() if name != "Zeit"}
            channels = [
                ChannelObject(title, name, values, {"unit_string": unit})
                for name, (unit, values) in held.items()
            ]
            file.write_segment(channels)
    proposal = propose_recordings(
        [read_recorded_file(tmp_path / "a.tdms")], system, {}, RecordingOptions()
    )
    (recording,) = proposal.held
    assert recording.name == ""
    assert "pB: it may be 'Stop 1/Bremsdruck' or 'Stop 2/Bremsdruck'" in proposal.problems
