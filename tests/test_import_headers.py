"""Names and units as recorders write them above samples, and cells that are no numbers."""

from pathlib import Path

import numpy as np
import openpyxl
import pytest
from numpy.testing import assert_allclose

from workbench.recordings.formats import read_recorded_file
from workbench.recordings.formats.numbers import is_missing
from workbench.recordings.formats.spelling import named


def table(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines))
    return path


def channels(path: Path) -> list[tuple[str, str]]:
    (group,) = read_recorded_file(path).groups
    return [(channel.name, channel.unit) for channel in group.channels]


TOA5 = ['"TOA5","Station","CR6","1234","CR6.Std.09","CPU:prog.CR6","5678","Fast"']


@pytest.mark.parametrize(
    ("head", "row", "expected"),
    [
        (
            [
                *TOA5,
                '"TIMESTAMP","RECORD","inflow","h"',
                '"TS","RN","l/s","mm"',
                '"","","Avg","Smp"',
            ],
            '"2025-06-06 08:00:{0:02d}",{0},4.1,950.{0}',
            [("TIMESTAMP", "s"), ("RECORD", ""), ("inflow", "l/s"), ("h", "mm")],
        ),
        (
            ["Vendor,X", "Number,Date&Time,ms,CH1,CH2", "NO.,Time,ms,l/s,mm"],
            "{0},2025/06/06 08:00:{0:02d},500,+ 4.1,+ 950.{0}",
            [("Date&Time ms", "s"), ("Number", ""), ("CH1", "l/s"), ("CH2", "mm")],
        ),
        (
            ["time [s];flow (1);flow (2)", ";l/s;mm"],
            "{0};1.{0};2.{0}",
            [("time", "s"), ("flow (1)", "l/s"), ("flow (2)", "mm")],
        ),
        (
            ["t;Zulauf;;Pegel;", ";roh;gefiltert;roh;gefiltert", "s;l/s;l/s;mm;mm"],
            "{0};1.{0};2.{0};3.{0};4.{0}",
            [
                ("t", "s"),
                ("Zulauf roh", "l/s"),
                ("Zulauf gefiltert", "l/s"),
                ("Pegel roh", "mm"),
                ("Pegel gefiltert", "mm"),
            ],
        ),
        (
            ["Title;of;the file", "# recorded by hand", "Zeit;Druck", "ch 1;ch 2", "s;bar"],
            "{0};1.{0}",
            [("ch 1", "s"), ("ch 2", "bar")],
        ),
    ],
    ids=["TOA5", "parts of a second", "numbered", "two rows of names", "channel numbers"],
)
def test_names_and_units_stand_in_rows_of_their_own(
    tmp_path: Path, head: list[str], row: str, expected: list[tuple[str, str]]
) -> None:
    path = table(tmp_path / "a.csv", [*head, *(row.format(k) for k in range(60))])
    assert channels(path) == expected


def test_merged_cells_of_a_workbook_name_all_columns_below(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["Zeit", "Zulauf", None, "Pegel", None])
    sheet.append([None, "roh", "gefiltert", "roh", "gefiltert"])
    sheet.append(["s", "l/s", "l/s", "mm", "mm"])
    sheet.merge_cells("B1:C1")
    sheet.merge_cells("D1:E1")
    for k in range(60):
        sheet.append([float(k), 1.5, 2.5, k, 3.5])
    book.save(tmp_path / "a.xlsx")
    names = [name for name, _ in channels(tmp_path / "a.xlsx")]
    assert names == ["Zeit", "Zulauf roh", "Zulauf gefiltert", "Pegel roh", "Pegel gefiltert"]


def test_a_number_in_brackets_is_that_of_a_channel() -> None:
    assert named("log(1)") == ("log(1)", "")
    assert named("log(1)[s]") == ("log(1)", "s")
    assert named("slip [1]") == ("slip", "1")
    assert named("x [3]") == ("x [3]", "")


@pytest.mark.parametrize(
    "cell", ["OL", "-OL", "----", "#N/A", "#VALUE!", "Over", "****", " ", "nan"]
)
def test_an_overload_is_no_number(cell: str) -> None:
    assert is_missing(cell)


def test_a_sign_may_stand_apart_from_its_number(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", ["time [s];h [mm]", *(f"{k};- {k}.5" for k in range(60))])
    (group,) = read_recorded_file(path).groups
    assert_allclose(group.channels[1].values, -(np.arange(60.0) + 0.5))


def test_a_censored_cell_is_no_sample_and_is_told(tmp_path: Path) -> None:
    rows = [f"{k};{'<0.01' if k == 30 else f'{k}.5'}" for k in range(60)]
    recorded = read_recorded_file(table(tmp_path / "a.csv", ["time [s];h [mm]", *rows]))
    assert recorded.groups[0].channels[1].censored == (30,)
    assert "below or above another, the first '<0.01' in line 32" in recorded.notes[0]
