"""A recording on each sheet, or in each group, of one file: each is a case, as if it were alone."""

import builtins
import datetime
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from nptdms import ChannelObject, TdmsWriter
from numpy.testing import assert_allclose
from openpyxl.chart import LineChart

import workbench as wb
from workbench.__main__ import main
from workbench.errors import InputError
from workbench.recordings.case import Case
from workbench.recordings.channels import RecordingOptions, propose_recordings
from workbench.recordings.formats import read_recorded_file

from .files_of_stops import FORMATS, Stops, add_sheet, workbook, workbook_of_stamps
from .recorder_files import BEGAN, Columns, recorded

NAMES = "Stop 1", "Stop 2"
SIGNALS = "pB", "tauR", "omegaW", "omegaR", "Fx"


@pytest.fixture(scope="module")
def cases(root, system) -> list[Case]:
    """Two stops, every fourth sample of them."""
    names = "01_dry_80_1.5", "02_dry_100_2.7"
    read = wb.read_cases([root / "cases" / name for name in names], system)
    return [one.part(slice(None, None, 4)) for one in read]


@pytest.fixture(scope="module")
def stops(cases, system) -> dict[str, Columns]:
    return {name: recorded(case, system) for name, case in zip(NAMES, cases, strict=True)}


@pytest.fixture(autouse=True)
def nobody_answers(monkeypatch) -> None:
    monkeypatch.setattr(builtins, "input", lambda: pytest.fail("a question"))


@pytest.fixture
def take(tmp_path) -> Callable[..., int]:
    """Imports a file of the folder into `out`."""
    return lambda name, *said: main(
        ["import", str(tmp_path / name), "--out", str(tmp_path / "out"), "--yes", *said]
    )


def assert_same(got: Case, truth: Case, rtol: float = 1e-9) -> None:
    assert_allclose(got.time, truth.time - truth.time[0], atol=1e-6)
    for signal in SIGNALS:
        assert_allclose(got[signal], truth[signal], rtol=rtol, atol=1e-9)


def record(folder: Path) -> list[dict]:
    return json.loads((folder / "out" / "import.json").read_text())["imports"]


# --- each is a case ---


@pytest.mark.parametrize("name", FORMATS)
def test_each_recording_of_a_file_is_a_case_without_a_wrong_number(
    tmp_path, take, cases, stops, system, name
):
    write, called = FORMATS[name]
    write(tmp_path / name, stops)
    assert take(name) == 0
    told = record(tmp_path)
    assert [one["recording"] for one in told] == list(called)
    for one, truth in zip(told, cases, strict=True):
        (folder,) = one["cases"]
        (got,) = wb.read_cases(tmp_path / "out" / folder, system)
        assert_same(got, truth)
        assert set(one["channels"]) == set(SIGNALS)
        assert one["channels"]["omegaR"]["converted"]["recorded_as"] == "rR * omegaR"
        assert one["dropped"] == ["Temperatur [degC]"]
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
        (got,) = wb.read_cases(tmp_path / "out" / name, system)
        assert_same(got, cases[0])
    assert got.conditions["wheel_rail"] == "unknown"  # it was said of the first file


@pytest.mark.filterwarnings("ignore:.*a sample every 0.04 s")
def test_sheets_may_differ_in_order_rate_and_stated_units(tmp_path, take, cases, stops, system):
    other = {name: (unit, v[::2]) for name, (unit, v) in reversed(stops["Stop 2"].items())}
    _, pressure = other["Bremsdruck"]
    other["Bremsdruck"] = "kPa", 100.0 * pressure
    workbook(tmp_path / "a.xlsx", {"Stop 1": stops["Stop 1"], "Stop 2": other})
    assert take("a.xlsx") == 0
    for name, truth in (("a_Stop_1", cases[0]), ("a_Stop_2", cases[1].part(slice(None, None, 2)))):
        (got,) = wb.read_cases(tmp_path / "out" / name, system)
        assert_same(got, truth)
    assert [one["channels"]["pB"]["unit"] for one in record(tmp_path)] == ["bar", "kPa"]


def test_a_unit_that_one_sheet_alone_states_is_not_taken_for_the_others(
    tmp_path, take, stops, capsys
):
    third = {name: (unit, 0.9 * values) for name, (unit, values) in stops["Stop 1"].items()}
    third["Bremsdruck"] = "", 0.9 * stops["Stop 1"]["Bremsdruck"][1]
    workbook(tmp_path / "a.xlsx", {**stops, "third": third})
    assert take("a.xlsx") == 2
    error = capsys.readouterr().err
    assert "'third': found pB: 'Bremsdruck' [bar], in 'Stop 1' 'Bremsdruck'" in error
    assert [one["recording"] for one in record(tmp_path)] == list(NAMES)


def test_a_sheet_that_lacks_a_channel_is_refused_and_leaves_the_others(
    tmp_path, take, stops, capsys
):
    third = {name: one for name, one in stops["Stop 1"].items() if name != "Bremsdruck"}
    workbook(tmp_path / "a.xlsx", {**stops, "third": third})
    assert take("a.xlsx") == 2
    assert "a.xlsx, 'third': found pB: no channel whose name" in capsys.readouterr().err
    for one in record(tmp_path):
        assert any("'third' is no such recording: pB" in note for note in one["files"][0]["notes"])


def test_what_else_a_workbook_holds_is_written_down(tmp_path, take, stops, capsys):
    """A sheet of notes, an empty one, a hidden one, a climate record and a sheet of a diagram."""
    book = openpyxl.Workbook()
    book.active.append(["Prüfer", "Müller"])
    add_sheet(book, "Stop 1", stops["Stop 1"])
    book.create_sheet("empty")
    book.create_chartsheet("diagram").add_chart(LineChart())
    climate = {"Zeit": ("s", np.arange(60.0)), "Feuchte": ("%", np.arange(60.0))}
    add_sheet(book, "climate", climate)
    add_sheet(book, "Stop 2", stops["Stop 2"])
    book["Stop 2"].sheet_state = "hidden"
    book.save(tmp_path / "a.xlsx")
    assert take("a.xlsx") == 0
    assert "'climate' holds other channels: Feuchte, Zeit" in capsys.readouterr().out
    for one in record(tmp_path):
        notes = " ".join(one["files"][0]["notes"])
        for note in ("'Sheet' was left out", "'Stop 2' is hidden", "'climate' holds other"):
            assert note in notes
    assert [one["recording"] for one in record(tmp_path)] == list(NAMES)


def test_names_of_sheets_become_names_that_differ(tmp_path, take, stops, system, cases):
    """Two that differ in signs alone, which no file system takes."""
    FORMATS["labview.tdms"][0](
        tmp_path / "a.tdms", dict(zip(("80 km/h wet", "80 km:h wet"), stops.values(), strict=True))
    )
    assert take("a.tdms") == 0
    assert take("a.tdms") == 0  # and again: in the same folders
    for name, truth in zip(("a_80_km_h_wet", "a_80_km_h_wet_tdms"), cases, strict=True):
        (got,) = wb.read_cases(tmp_path / "out" / name, system)
        assert_same(got, truth)
    assert len(record(tmp_path)) == 2
    text = (tmp_path / "out" / "a_80_km_h_wet" / "case.toml").read_text()
    assert "a.tdms, '80 km/h wet'" in text


# --- what cannot be told ---


def at_once(path: Path, stops: Stops) -> None:
    """Sheets with dates of one time."""
    workbook_of_stamps(path, {"one": next(iter(stops.values()))})
    book = openpyxl.load_workbook(path)
    second = book.create_sheet("two")
    columns = list(stops.values())[1]
    others = {name: column for name, column in columns.items() if name != "Zeit"}
    second.append(["Zeitstempel", *(f"{name} [{unit}]" for name, (unit, _) in others.items())])
    for k, t in enumerate(columns["Zeit"][1]):
        moment = BEGAN.replace(tzinfo=None) + datetime.timedelta(seconds=round(float(t), 3))
        second.append([moment, *(float(values[k]) for _, values in others.values())])
    book.save(path)


def clocks_of_day(path: Path, stops: Stops) -> None:
    """Sheets with times of day and no date, of one time."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, columns in stops.items():
        sheet = book.create_sheet(title)
        others = {name: column for name, column in columns.items() if name != "Zeit"}
        sheet.append(["Uhrzeit", *(f"{name} [{unit}]" for name, (unit, _) in others.items())])
        for k, t in enumerate(columns["Zeit"][1]):
            moment = BEGAN.replace(tzinfo=None) + datetime.timedelta(seconds=round(float(t), 3))
            sheet.append([moment.time(), *(float(values[k]) for _, values in others.values())])
    book.save(path)


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
    said = [part for key, name in channels.items() for part in ("--column", f"{key}=two/{name}")]
    assert take("a.xlsx", *said) == 0
    (one,) = record(tmp_path)
    assert not one.get("recording")
    (got,) = wb.read_cases(tmp_path / "out" / "a", system)
    assert_same(got, cases[1])


def test_signals_of_two_sheets_that_may_be_two_recordings_are_told(tmp_path, take, stops, capsys):
    """What the second lacks is in the first alone, and would be taken from it in silence."""
    second = {name: one for name, one in stops["Stop 2"].items() if name != "v_Rad"}
    workbook(tmp_path / "a.xlsx", {"Stop 1": stops["Stop 1"], "Stop 2": second})
    channels = {"pB": "Bremsdruck", "tauR": "Antriebsmoment", "omegaR": "v_Rolle"}
    said = [part for key, name in channels.items() for part in ("--column", f"{key}=Stop 2/{name}")]
    take("a.xlsx", *said)
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
    assert [one["recording"] for one in record(tmp_path)] == list(NAMES)


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
    (got,) = wb.read_cases(tmp_path / "out" / "a", system)
    assert_same(got, cases[0])
    (one,) = record(tmp_path)
    assert not one.get("recording")


def test_a_sheet_whose_names_are_less_alike_is_left_out(tmp_path, take, stops, system, cases):
    other = {f"{name} gefiltert": column for name, column in stops["Stop 2"].items()}
    workbook(tmp_path / "a.xlsx", {"raw": stops["Stop 1"], "filtered": other})
    assert take("a.xlsx") == 0
    (got,) = wb.read_cases(tmp_path / "out" / "a", system)
    assert_same(got, cases[0])
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
    found = propose_recordings(
        [read_recorded_file(tmp_path / "a.tdms")], system, {}, RecordingOptions()
    )
    (one,) = found.held
    assert one.name == ""
    assert "pB: it may be 'Stop 1/Bremsdruck' or 'Stop 2/Bremsdruck'" in found.problems
