"""Names and units as recorders write them above samples, and cells that are no numbers."""

import datetime
import json
import struct
import tomllib
import zipfile
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xlwt
from nptdms import ChannelObject, TdmsWriter
from numpy.testing import assert_allclose
from pyarrow import feather

from workbench.errors import InputError
from workbench.recordings.channels import NamedChannel, merge, propose
from workbench.recordings.formats import read_recorded_file
from workbench.recordings.formats.numbers import is_missing
from workbench.recordings.formats.spelling import name_and_unit
from workbench.recordings.formats.stamps import iso


def table(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines))
    return path


def channels(path: Path) -> list[tuple[str, str]]:
    (group,) = read_recorded_file(path).groups
    return [(channel.name, channel.unit) for channel in group.channels]


# What recorders write above samples, a row of these, and names and units of the channels.
HEADERS = tomllib.loads(Path(__file__).with_name("recorders").joinpath("headers.toml").read_text())


@pytest.mark.parametrize("recorder", HEADERS.values(), ids=HEADERS)
def test_names_and_units_stand_in_rows_of_their_own(tmp_path, recorder):
    rows = [recorder["row"].format(k) for k in range(60)]
    path = table(tmp_path / "a.csv", [*recorder["head"].split("\n"), *rows])
    assert channels(path) == [(name, unit) for name, unit in recorder["channels"]]


@pytest.mark.parametrize(
    ("header", "row", "unit", "first"),
    [
        ("time [s];h [cm];inflow [l/s]", "{t};{c};4.5", "cm", 95.0),  # goes on in other columns
        ("time [s];T [degC];p [bar]", "{k};21.5;1.5", "bar", 1.5),  # of other signals
        ("time [s];h [mm]", "{k};{c}", "mm", 95.0),
        ("time [s];inflow [l/s];h [mm]", "{k};4.5;{c}", "mm", 95.0),  # of another run
    ],
)
@pytest.mark.parametrize("between", [[], ["", "Test 2", ""]])
def test_a_table_below_another_has_its_own_columns(tmp_path, header, row, unit, first, between):
    above = [f"{k};4.{k % 9};95{k % 7}.1" for k in range(60)]
    below = [row.format(t=k + 60, k=k, c=95 + k % 7) for k in range(40)]
    lines = ["time [s];inflow [l/s];h [mm]", *above, *between, header, *below]
    first_table, second_table = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    assert [channel.values.size for channel in first_table.channels] == [60] * 3
    own = next(channel for channel in second_table.channels if channel.unit == unit)
    assert own.values.size == 40
    assert own.values[0] == first


def test_numbers_of_channels_above_an_empty_line_are_no_sample(tmp_path):
    rows = [f'"{0.5 * k}","4.{k % 9}","95{k % 7}.1"' for k in range(60)]
    lines = ['"Time","inflow","h"', '"s","l/s","mm"', '"1","2","3"', "", *rows]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    assert_allclose(group.channels[0].values, 0.5 * np.arange(60))


def test_a_header_that_comes_again_on_each_page_is_no_table(tmp_path):
    header = "time [s];inflow [l/s];h [mm]"
    rows = [f"{k};4.{k % 9};95{k % 7}.1" for k in range(60)]
    lines = [header, *rows[:20], header, *rows[20:40], "INFO;pump;started", *rows[40:]]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    assert_allclose(group.channels[0].values, np.arange(60))


@pytest.mark.parametrize(("unit", "sizes"), [("mm", [60]), ("cm", [40, 20])])
def test_a_row_of_other_units_below_a_header_that_comes_again_begins_a_table(tmp_path, unit, sizes):
    rows = [f"{k};4.{k % 9};95{k % 7}.1" for k in range(60)]
    names, units = "time;inflow;h", f"s;l/s;{unit}"
    lines = [names, "s;l/s;mm", *rows[:40], names, units, *rows[40:]]
    groups = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    assert [group.channels[2].values.size for group in groups] == sizes
    assert groups[-1].channels[2].unit == unit


def test_samples_that_are_marked_as_comments_are_none(tmp_path):
    rows = [f"{k};4.{k % 9};95{k % 7}.1" for k in range(60)]
    rows[50:52] = [f"#{row}" for row in rows[50:52]]
    lines = ["# time [s];inflow [l/s];h [mm]", *rows]
    recorded = read_recorded_file(table(tmp_path / "a.csv", lines))
    (group,) = recorded.groups
    assert_allclose(group.channels[0].values, [*range(50), *range(52, 60)])
    assert recorded.notes == ("2 lines that are no samples were left out, the first in line 52",)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("t1 [s];inflow [ml/s];t2 [s];h [mm]", "{k};4.{k:03d};{m};95{d}.1"),
        ("time [s];tag;value;unit", "{k};inflow;4.{k:03d};ml/s\n{k};h;95{d}.1;mm"),
    ],
)
def test_numbers_of_one_file_are_written_in_one_way(tmp_path, header, row):
    """4.001 alone may be four thousand; 950.1 beside it tells that it is none."""
    rows = [row.format(k=k, m=2 * k, d=k % 7) for k in range(60)]
    groups = read_recorded_file(table(tmp_path / "a.csv", [header, *rows])).groups
    values = {channel.name: channel.values for group in groups for channel in group.channels}
    assert_allclose(values["inflow"], 4.0 + np.arange(60) / 1e3)
    assert_allclose(values["h"], [950.1 + k % 7 for k in range(60)])


def test_other_units_among_samples_are_refused(tmp_path):
    rows = [f"{k};4.{k % 9};95{k % 7}.1" for k in range(60)]
    lines = ["time;inflow;h", "s;l/s;mm", *rows[:40], "s;l/s;cm", *rows[40:]]
    with pytest.raises(InputError, match=r"line 43: found .*\[cm\] below \[mm\].*part the file"):
        read_recorded_file(table(tmp_path / "a.csv", lines))


@pytest.mark.parametrize("tags", [0, 2])
def test_samples_of_texts_are_no_header(tmp_path, tags):
    """Historians begin with a word: Pt Created."""
    stamps = [f"2024-03-05 10:00:{k:02d}" for k in range(60)]
    head, rows = "time;inflow;h", [f"{stamp};4.5;950.5" for stamp in stamps]
    if tags:
        head = "time;tag;value"
        rows = [f"{stamp};{tag};950.5" for stamp in stamps for tag in ("inflow", "h")]
    words = [row.replace("950.5", "Pt Created").replace("4.5", "") for row in rows[: tags or 1]]
    lines = [head, *words, *rows[tags or 1 :]]
    groups = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    names = {channel.name for group in groups for channel in group.channels}
    assert names == {"time", "inflow", "h"}


def test_marks_of_order_within_a_file_are_no_part_of_a_number(tmp_path):
    parts = [f"{k};4.{k % 9};95{k % 7}.1\n" for k in range(60)]
    text = "\ufefftime [s];inflow [l/s];h [mm]\n" + "\ufeff".join(
        parts
    )  # of parts that were joined
    (group,) = read_recorded_file(table(tmp_path / "a.csv", [text])).groups
    assert_allclose(group.channels[0].values, np.arange(60))


def test_nodes_of_a_circuit_are_no_units(tmp_path):
    rows = [f"{k}e-3\t4.{k % 9}\t95{k % 7}.1\t0.1" for k in range(60)]
    path = table(tmp_path / "a.txt", ["time\tV(in)\tV(h)\tI(R1)", *rows])
    assert channels(path) == [("time", ""), ("V(in)", ""), ("V(h)", ""), ("I(R1)", "")]
    assert [name_and_unit(name)[1] for name in ("V(mV)", "v(m/s)", "I(A)")] == ["mV", "m/s", "A"]


@pytest.mark.parametrize(
    "below",
    [
        ["Mean;4.3;901", "Max;4.6;951"],
        ["", "29.75;4.3;901"],
        ["", "Statistics", "Min;4.0;850", "60;258;54000"],
    ],
)
def test_statistics_below_samples_are_left_out_and_told(tmp_path, below):
    rows = [f"{k};4.{k % 9};95{k % 7}.1" for k in range(60)]
    path = table(tmp_path / "a.csv", ["time [s];inflow [l/s];h [mm]", *rows, *below])
    recorded = read_recorded_file(path)
    for channel in recorded.groups[0].channels:
        assert channel.values.size == 60
    assert "lines that are no samples were left out, the first in line" in recorded.notes[-1]


def test_statistics_above_samples_are_no_samples(tmp_path):
    head = ["Statistics", "Min;0;4.0;850", "Max;60;4.6;951", "Mean;30;4.3;901", ""]
    rows = [f"{k};{0.5 * k};4.{k % 9};95{k % 7}.1" for k in range(60)]
    path = table(tmp_path / "a.csv", [*head, "Nr;Time [s];inflow [l/s];h [mm]", *rows])
    assert channels(path)[1:] == [("Time", "s"), ("inflow", "l/s"), ("h", "mm")]


@pytest.mark.parametrize(
    "row",
    ["Scale;1;10;1", "Gain;1,0;1,5;1", "Offset;0;2;0", "Faktor;1;1;1", "x1;x10;x1;1"],
)
def test_factors_above_samples_are_refused_unless_they_change_nothing(tmp_path, row):
    rows = [f"{k};4,{k % 9};95{k % 7},1" for k in range(60)]
    path = table(tmp_path / "a.csv", ["time [s];inflow [l/s];h [mm]", row[:-2], *rows])
    with (
        nullcontext()
        if row.startswith("Faktor")
        else pytest.raises(InputError, match=r"line 2: found '\w+' of columns, .*apply it to the")
    ):
        assert read_recorded_file(path).groups[0].channels[0].values.size == 60


STATISTICS = ["Min", "Max:", "Mean", "Std. Dev."]


@pytest.mark.parametrize("first", [True, False], ids=["above", "below"])
@pytest.mark.parametrize("place", [0, 3], ids=["label before", "label behind"])
def test_rows_of_statistics_are_no_samples_though_their_times_go_on(tmp_path, first, place):
    def row(label: str, *cells: object) -> str:
        listed = [str(cell) for cell in cells]
        return ";".join([*listed[:place], label, *listed[place:]])

    rows = [row("", k, 4.5, 950.0 + k) for k in range(60)]
    begin = -4 if first else 60
    sums = [row(label, begin + k, 3.5, 850.0) for k, label in enumerate(STATISTICS)]
    lines = [row("note", "time [s]", "inflow [l/s]", "h [mm]"), *sums * first, *rows]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", lines + sums * (not first))).groups
    (level,) = (channel for channel in group.channels if channel.name == "h")
    assert_allclose(level.values, 950.0 + np.arange(60))


def test_a_table_of_statistics_below_samples_is_none_of_samples(tmp_path):
    rows = [f"{k};4.5;950.{k}" for k in range(60)]
    below = ["", "Statistic;inflow;h", *(f"{label};3.5;850" for label in STATISTICS)]
    lines = ["time [s];inflow [l/s];h [mm]", *rows, *below]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    assert [channel.values.size for channel in group.channels] == [60, 60, 60]


@pytest.mark.parametrize(
    "remark",
    [
        *("# scale: h 0.1 mm/count", "# all values x 10", "# h is multiplied by 10"),
        *("Gain h: 10", "# h in cm", "# h: raw 1/10"),
    ],
)
def test_words_above_samples_that_say_a_factor_are_asked_about(tmp_path, tank, remark):
    rows = [f"{k};4.5;950.{k}" for k in range(60)]
    path = table(tmp_path / "a.csv", [remark, "time [s];inflow [l/s];h [mm]", *rows])
    proposal = propose([read_recorded_file(path)], tank, {})
    words = remark.strip("# ")
    assert any(f"h: the file says '{words}'" in doubt for doubt in proposal.doubts)
    assert not proposal.certain
    named = {"h": NamedChannel("h", "mm"), "inflow": NamedChannel("inflow", "l/s")}
    assert propose([read_recorded_file(path)], tank, named).certain


@pytest.mark.parametrize(
    "remark",
    [
        *("# scale: h 1 mm/count", "# offset of h: 0", "# h in mm", "# gain of the amplifier 10"),
        *("# Vertical scale of h: 0.5", "# decimation of all values: factor 10"),
    ],
)
def test_words_above_samples_that_change_nothing_are_not_asked_about(tmp_path, tank, remark):
    rows = [f"{k};4.5;950.{k}" for k in range(60)]
    path = table(tmp_path / "a.csv", [remark, "time [s];inflow [l/s];h [mm]", *rows])
    assert propose([read_recorded_file(path)], tank, {}).certain


@pytest.mark.parametrize(
    "label", ["# units: s, l/s, cm", "# Unit = s; l/s; cm", "Einheiten: s l/s cm"]
)
@pytest.mark.parametrize("mark", [";", ","])
def test_units_in_words_above_samples_are_those_of_the_columns(tmp_path, label, mark):
    rows = [mark.join((str(k), "4.5", f"95.{k}")) for k in range(60)]
    lines = [label, mark.join(("time", "inflow", "h")), *rows]
    assert channels(table(tmp_path / "a.csv", lines)) == [
        ("time", "s"),
        ("inflow", "l/s"),
        ("h", "cm"),
    ]


@pytest.mark.parametrize("remark", ["# Unit of h changed to cm", "# range: h x 10"])
def test_words_among_samples_that_change_their_unit_are_refused(tmp_path, remark):
    rows = [f"{k};4.5;950.{k}" for k in range(60)]
    lines = ["time [s];inflow [l/s];h [mm]", *rows[:30], remark, *rows[30:]]
    with pytest.raises(
        InputError, match=r"line 32: found .* among samples, which says what 'h' is"
    ):
        read_recorded_file(table(tmp_path / "a.csv", lines))


def test_a_unit_that_nobody_measures_in_is_a_misspelt_one(tmp_path, tank):
    rows = [f"{k};4.5;950.{k}" for k in range(60)]
    lines = ["time [s];inflow [l/s];h [Mm]", *rows]
    (problem,) = propose([read_recorded_file(table(tmp_path / "a.csv", lines))], tank, {}).problems
    assert "'h' is in [Mm], a unit that is not known" in problem
    lines = ["time [Ms];inflow [l/s];h [mm]", *rows]
    with pytest.raises(InputError, match=r"'time' in \[Ms\], no unit of time"):
        propose([read_recorded_file(table(tmp_path / "b.csv", lines))], tank, {})


def test_columns_of_fixed_places_may_be_empty(tmp_path):
    """An event, once in three lines, between two signals."""
    rows = [f"{k:8.1f} {7.5 if k % 3 == 0 else '':>8} {4.0:8.2f} {900 + k:8.3f}" for k in range(60)]
    head = ["    Time    event   inflow        h", "       s       mm      l/s       mm"]
    (group,) = read_recorded_file(table(tmp_path / "a.txt", [*head, *rows])).groups
    assert [(c.name, c.unit) for c in group.channels] == [
        *(("Time", "s"), ("event", "mm"), ("inflow", "l/s"), ("h", "mm"))
    ]
    assert_allclose(group.channels[3].values, 900.0 + np.arange(60.0))
    assert np.isnan(group.channels[1].values).sum() == 40


@pytest.mark.parametrize("every", [2, 58])
def test_rows_may_end_before_empty_cells_where_that_is_a_habit(tmp_path, every):
    """Rows without a level, and a last one that is cut; one of 60 alone is an accident."""
    rows = [f"{k}.0,4.{k % 9}" + (f",{900 + k}.5" if (k + 1) % every else "") for k in range(60)]
    recorded = read_recorded_file(
        table(tmp_path / "a.csv", ["time [s],inflow [l/s],h [mm]", *rows[:-1], "59.0,4"])
    )
    (group,) = recorded.groups
    assert [c.name for c in group.channels] == ["time", "inflow", "h"]
    short = [k for k in range(59) if not (k + 1) % every]
    habit = len(short) > 1
    times = np.array([k for k in range(59) if habit or k not in short])
    assert_allclose(group.channels[0].values, times)
    gaps = np.isnan(group.channels[2].values)
    assert_allclose(times[gaps], short if habit else [])
    note = recorded.doubts[0] if habit else recorded.notes[0]
    assert note.startswith("line 61 was left out" if habit else "2 lines that are no samples were")


def test_channels_may_be_rows(tmp_path):
    signals = {"time [s]": range(60), "inflow [l/s]": range(60, 120), "h [mm]": range(900, 960)}
    lines = [";".join([name, *map(str, values)]) for name, values in signals.items()]
    assert channels(table(tmp_path / "a.csv", lines)) == [
        ("time", "s"),
        ("inflow", "l/s"),
        ("h", "mm"),
    ]


@pytest.mark.parametrize("names", ["Tag;Time;Value;Unit", "entity_id;last_changed;state;unit"])
def test_a_row_for_each_value_is_read_by_tags(tmp_path, names):
    """As historians of plants export; each tag keeps its own times."""
    rows = [f"h;2024-03-05 10:00:{k:02d};95{k % 7}.5;mm" for k in range(60)]
    rows[1::2] = [row.replace("h;", "inflow;").replace(";mm", ";l/s") for row in rows[1::2]]
    path = table(tmp_path / "a.csv", [names, *rows])
    channels = {c.name: c for held in read_recorded_file(path).groups for c in held.channels[1:]}
    assert {name: channel.unit for name, channel in channels.items()} == {
        "h": "mm",
        "inflow": "l/s",
    }
    assert channels["h"].values.size == 30


@pytest.mark.parametrize("form", ["json", "parquet"])
def test_rows_of_one_value_in_other_formats_are_read_by_tags(tmp_path, form):
    rows = [
        {"time": f"2024-03-05 10:00:{k:02d}", "tag": tag, "value": size + k, "unit": unit}
        for k in range(60)
        for tag, size, unit in (("h", 950.5, "mm"), ("inflow", 4.5, "l/s"))[k % 2 :]
    ]
    path = tmp_path / f"a.{form}"
    if form == "json":
        path.write_text(json.dumps(rows))
    else:
        pq.write_table(pa.Table.from_pylist(rows), path)
    groups = read_recorded_file(path).groups
    held = {c.name: c for group in groups for c in group.channels if not c.stamp}
    assert {name: c.unit for name, c in held.items()} == {"h": "mm", "inflow": "l/s"}
    assert_allclose(held["h"].values, 950.5 + np.arange(0, 60, 2))
    assert_allclose(groups[0].channels[0].values, np.arange(0, 60, 2))


def test_slow_channels_have_empty_cells_between_their_samples(tmp_path):
    """Rows of the fastest rate have a time alone where no other channel has a sample."""
    rows = [
        f"{k / 10};" + ("4.5;950.5" if k % 5 == 0 else "4.5;" * (k % 5 == 2) or ";")
        for k in range(60)
    ]
    path = table(tmp_path / "a.csv", ["timestamps;inflow;h", "s;l/s;mm", *rows])
    (group,) = read_recorded_file(path).groups
    assert [(c.name, c.unit) for c in group.channels][1:] == [("inflow", "l/s"), ("h", "mm")]
    assert [int(np.isfinite(c.values).sum()) for c in group.channels] == [24, 24, 12]


def test_an_empty_column_without_a_name_is_none_beside_days_and_times(tmp_path):
    """As days and times become one, it was called by the name beside it."""
    rows = [f"2024-03-05;10:00:{k:02d};;4.{k:02d}" for k in range(60)]
    file = read_recorded_file(table(tmp_path / "a.csv", ["Date;Time;;inflow [l/s]", *rows]))
    assert [channel.name for channel in file.groups[0].channels] == ["Date Time", "inflow"]
    assert not file.groups[0].left
    assert not file.notes


@pytest.mark.parametrize(
    ("head", "clocks"),
    [
        (["t1 [s];inflow [l/s];t2 [s];h [mm]"], ["t1", "t2"]),
        (["Time [s];inflow [l/s];Time [s];h [mm]"], ["Time", "Time"]),
        (["inflow X;inflow Y;h X;h Y", "s;l/s;s;mm"], ["inflow X", "h X"]),
        (["Zeit normal [s];inflow [l/s];Zeit langsam [s];h [mm]"], ["Zeit normal", "Zeit langsam"]),
        (  # as scopes of controllers write them
            ["Name;inflow;Name;h", "SampleTime[s];1;SampleTime[s];2", "Unit;l/s;Unit;mm"],
            ["inflow time", "h time"],
        ),
    ],
)
@pytest.mark.parametrize("between", [";", ", "])
def test_columns_with_times_of_their_own_keep_them(tmp_path, head, clocks, between):
    """All had the times of the first; a column at half the rate was twice as fast."""
    rows = [f"{k};4.{k:02d};" + (f"{2 * k};{900 + 2 * k}.5" if k < 30 else ";") for k in range(60)]
    lines = [line.replace(";", between) for line in [*head, *rows]]
    groups = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    assert [group.channels[0].name for group in groups] == clocks
    assert [group.channels[1].unit for group in groups] == ["l/s", "mm"]
    assert_allclose(groups[1].channels[0].values, np.arange(0.0, 60.0, 2.0))
    assert_allclose(groups[1].channels[1].values, np.arange(900.5, 960.5, 2.0))


def test_a_time_of_something_else_is_none_of_the_columns_behind_it(tmp_path):
    rows = [f"{k};4.5;{k % 7};950.5" for k in range(60)]
    head = "Time [s];inflow [l/s];Lap time [s];h [mm]"
    (group,) = read_recorded_file(table(tmp_path / "a.csv", [head, *rows])).groups
    assert len(group.channels) == 4


@pytest.mark.parametrize(
    ("names", "good", "bad"),
    [
        ("inflow [l/s];inflow_Q;h [mm];h_Q", "192", "0"),
        ("inflow [l/s];Quality;h [mm];Quality", "Good", "Bad"),
        ("inflow [l/s];x;h [mm];Validity", "1", "2"),
        ("inflow [l/s];x;h [mm];h quality", "0", "3"),
        ("inflow [l/s];Status;h [mm];Status", "Good", "Bad - Comm Failure"),
    ],
)
def test_samples_that_a_column_calls_bad_are_gaps(tmp_path, names, good, bad):
    """Three in a row are taken for no marker."""
    gone = (30, 31, 32)
    rows = [
        f"{k};4.5;{good};{0 if k in gone else 950}.5;{bad if k in gone else good}"
        for k in range(60)
    ]
    recorded = read_recorded_file(table(tmp_path / "a.csv", [f"time [s];{names}", *rows]))
    channels = {channel.name: channel.values for channel in recorded.groups[0].channels}
    assert np.flatnonzero(np.isnan(channels["h"])).tolist() == list(gone)
    assert np.isfinite(channels["time"]).all()
    assert any("'h': 3 samples that" in note for note in recorded.notes)


def test_samples_that_are_good_in_several_ways_are_samples(tmp_path):
    states = ["Good", "Good, Local Override", "Good_Clamped"]
    rows = [f"{k};4.5;950.{k};{'Bad' if k == 30 else states[k % 3]}" for k in range(60)]
    lines = ["time [s];inflow [l/s];h [mm];h Quality", *rows]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    assert np.flatnonzero(np.isnan(group.channels[2].values)).tolist() == [30]


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        *(("quality_code", "192", "24"), ("h IsValid", "True", "False"), ("h quality", "0", "1")),
        *(("h.Status", "Good", "NoData"), ("h Quality Code", "0", "2147483648")),
        *(("h_quality", "65472", "24"), ("is_valid", "1", "0")),
    ],
)
def test_plausible_samples_that_a_column_of_codes_calls_bad_are_gaps(tmp_path, name, good, bad):
    rows = [f"{k};4.5;950.{k};{bad if k % 20 == 3 else good}" for k in range(60)]
    lines = [f"time [s];inflow [l/s];h [mm];{name}", *rows]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    (level,) = (channel for channel in group.channels if channel.name == "h")
    assert np.flatnonzero(np.isnan(level.values)).tolist() == [3, 23, 43]


@pytest.mark.parametrize(
    ("name", "codes"), [("h_flag", "01"), ("h StatusCode", ["0", "2147483648"])]
)
def test_codes_of_one_channel_that_may_call_it_bad_are_asked_about(tmp_path, tank, name, codes):
    rows = [f"{k};4.5;950.{k};{codes[k % 20 == 3]}" for k in range(60)]
    lines = [f"time [s];inflow [l/s];h [mm];{name}", *rows]
    (doubt,) = propose([read_recorded_file(table(tmp_path / "a.csv", lines))], tank, {}).doubts
    assert f"'{name}' beside it with {codes[0]}, {codes[1]}" in doubt


@pytest.mark.parametrize(("name", "states"), [("Status", ["OK", "Running"]), ("Quality", [""])])
def test_a_status_of_a_machine_is_no_verdict_on_samples(tmp_path, name, states):
    """Nor is a column of quality that nobody fills, as of ThingSpeak."""
    rows = [f"{k};4.5;950.{k};{states[k % len(states)]}" for k in range(60)]
    lines = [f"time [s];inflow [l/s];h [mm];{name}", *rows]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    assert np.isfinite([channel.values for channel in group.channels]).all()


@pytest.mark.parametrize(
    ("header", "small", "large"),
    [
        ("time [s];inflow [l/s];h", "{k};4.5;9{k}.5 mm", "{k};4.5;0.9{k}5 m"),
        ("time [s];inflow [l/s];h;Unit", "{k};4.5;9{k}.5;mm", "{k};4.5;0.9{k}5;m"),
        ("time [s];inflow [l/s];h unit;h", "{k};4.5;mm;9{k}.5", "{k};4.5;m;0.9{k}5"),
        ("time [s];unit;value;tag", "{k};mm;9{k}.5;h", "{k};m;0.9{k}5;h"),
    ],
)
def test_meters_that_choose_a_range_write_several_units(tmp_path, header, small, large):
    rows = [(small if k % 3 else large).format(k=k) for k in range(10, 70)]
    if "tag" in header:
        rows += [f"{k};l/s;4.5;inflow" for k in range(10, 70)]
    recorded = read_recorded_file(table(tmp_path / "a.csv", [header, *rows]))
    channels = {c.name: c for group in recorded.groups for c in group.channels}
    assert channels["h"].unit == "mm"
    assert_allclose(channels["h"].values, 900.5 + np.arange(10, 70))
    assert "'h': 20 samples in other units were taken to [mm]" in recorded.notes


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("time [s];sign;h [mm];inflow [l/s]", "{k};{sign};{size};4.5"),
        ("time [s];inflow [l/s];h [mm];Vorzeichen", "{k};4.5;{size};{sign}1"),
        ("time [s];h [mm];inflow [l/s];h sign", "{k};{size};4.5;{sign}"),
        ("time [s];sign of h;inflow [l/s];h [mm]", "{k};{word};4.5;{size}"),
    ],
)
def test_a_column_of_signs_is_that_of_numbers_beside_it(tmp_path, tank, header, row):
    level = np.array([k - 30.5 for k in range(60)])
    rows = [
        row.format(k=k, sign="+-"[int(h < 0)], word=("pos", "neg")[int(h < 0)], size=abs(h))
        for k, h in enumerate(level)
    ]
    recorded = read_recorded_file(table(tmp_path / "a.csv", [header, *rows]))
    (own,) = (c for c in recorded.groups[0].channels if c.name == "h")
    assert_allclose(own.values, level)
    assert "its sign is taken from" in own.corrections[0]


@pytest.mark.parametrize(
    ("name", "signs"),
    [("sign", "01"), ("sign", "+-"), ("trend", "+-"), ("polarity", ["", "-"])],
)
def test_a_column_that_may_hold_signs_is_asked_about(tmp_path, tank, name, signs):
    rows = [f"{k};4.5;{signs[k % 2]};950.{k}" for k in range(60)]
    lines = [f"time [s];inflow [l/s];{name};h [mm]", *rows]
    proposal = propose([read_recorded_file(table(tmp_path / "a.csv", lines))], tank, {})
    for signal in ("inflow", "h"):
        assert any(f"{signal}: the file says \"'{name}' beside it" in d for d in proposal.doubts)


def test_dashes_in_a_column_of_remarks_are_no_signs(tmp_path, tank):
    rows = [f"{k};4.5;-;950.{k}" for k in range(60)]
    lines = ["time [s];inflow [l/s];remark;h [mm]", *rows]
    assert propose([read_recorded_file(table(tmp_path / "a.csv", lines))], tank, {}).certain


@pytest.mark.parametrize(
    ("header", "row", "words"),
    [
        ("h [mm];h Status", "{k}.5;{good}", "20 samples that 'h Status' calls 'Bad' are gaps"),
        ("h;Unit", "{k}.5;{unit}", "20 samples in other units were taken to [mm]"),
        ("h [mm]", "{cell}", "20 cells say only that a value is below"),
    ],
)
def test_what_was_changed_of_samples_is_said_on_the_terminal(tmp_path, tank, header, row, words):
    rows = [
        f"{k};4.5;"
        + row.format(
            k=k,
            good="Bad" if k % 3 == 0 else "Good",
            unit="cm" if k % 3 == 0 else "mm",
            cell="<1.5" if k % 3 == 0 else f"{k}.5",
        )
        for k in range(60)
    ]
    path = table(tmp_path / "a.csv", [f"time [s];inflow [l/s];{header}", *rows])
    recorded = read_recorded_file(path)
    merged = merge([recorded], propose([recorded], tank, {}), tank)
    (doubt,) = merged.doubts
    assert doubt.startswith(f"{path}, 'h': {words}")


@pytest.mark.parametrize("names", ["t;x1;x2", "t;x1;y"])
def test_names_of_states_are_no_factors(tmp_path, names):
    rows = [f"{k};4.{k % 9};95{k % 7}.1" for k in range(60)]
    path = table(tmp_path / "a.csv", [names, *rows])
    assert [name for name, _ in channels(path)] == names.split(";")


def test_units_of_a_plant_are_none_of_samples(tmp_path):
    rows = [f"{k};9{k}.5;Pump {k % 2}" for k in range(10, 70)]
    assert channels(table(tmp_path / "a.csv", ["time [s];h;Unit", *rows]))[1] == ("h", "")


def test_values_in_units_of_other_dimensions_are_no_channel(tmp_path):
    rows = [f"{k};4.5;9{k}.5;{'mm' if k % 3 else 'degC'}" for k in range(10, 70)]
    lines = ["time [s];inflow [l/s];h;h unit", *rows]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", lines)).groups
    assert [channel.name for channel in group.channels] == ["time", "inflow"]
    assert group.left[0].texts[:2] == ("910.5 mm", "911.5 mm")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"<html><table></table></html>", "text of HTML or XML"),
        (b"\x93NUMPY\x01\0v\0", r"an array of NumPy \(.npy\)"),
        (b"SQLite format 3\0", "a database of SQLite"),
        (b'<?xml version="1.0"?><usi:tdm version="1.0"/>', r"a header of DIAdem \(.tdm\)"),
        (b"DIAEXTENDED  {@:ENGLISH\n1,WINDOWS 32Bit\n", r"a header of DIAdem \(.dat\)"),
        (b"date Tue Mar 5\nbase hex\ninternal events logged\n", "a trace of bus messages"),
        (b"\x80\x05\x95\0", r"an object of Python \(pickle\)"),
        (b"RIFF\0\0\0\0WAVEfmt ", r"sound \(.wav\)"),
        (b"LOGG\x90\0\0\0", r"a trace of bus messages \(.blf\)"),
        (b"(1709287200.000001) can0 123#0011\n", r"a trace of bus messages \(candump\)"),
        (b"    -1\r\n    58\r\nh\r\n", r"a universal file \(.uff\)"),
        (b"CREATE TABLE log(t REAL, h REAL);\n", r"a dump of a database \(SQL\)"),
        (b"0       ".ljust(168) + b"01.03.24", "a file of EDF"),
        (b"a.csv".ljust(257, b"\0") + b"ustar", r"an archive \(.tar\)"),
        (b"", "an archive"),
    ],
)
def test_a_format_that_nobody_reads_is_called_by_its_name(tmp_path, content, words):
    path = tmp_path / "a.dat"
    path.write_bytes(content)
    if words == "an archive":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("x.csv", "time;h")
    with pytest.raises(
        InputError, match=rf"found {words}.*expected a recording as CSV, JSON, .xlsx"
    ):
        read_recorded_file(path)


@pytest.mark.parametrize(
    ("preamble", "blank"),
    [
        (["Record Length,60,,", "Sample Interval,5e-1,,", "Source,CH1,,"], ",,,"),
        (["Record Length,60,Points,", ",,,", "Trigger Time,0.0,s,"], ",,,"),
    ],
)
def test_samples_beside_a_preamble_are_all_read(tmp_path, preamble, blank):
    """Those beside it were taken for names, and left out."""
    left = [*preamble, *[blank] * (60 - len(preamble))]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(f"{own}{0.5 * k:.4f},{900.5 + k},4.5" for k, own in enumerate(left)))
    channels = read_recorded_file(path).groups[0].channels
    assert [channel.name for channel in channels] == ["column 4", "column 5", "column 6"]
    assert_allclose(channels[0].values, 0.5 * np.arange(60.0))
    assert_allclose(channels[1].values, 900.5 + np.arange(60.0))


@pytest.mark.parametrize(
    "recorder", [name for name in HEADERS if name.startswith("an oscilloscope")]
)
def test_a_step_behind_names_is_that_of_all_samples(tmp_path, recorder):
    rows = [HEADERS[recorder]["row"].format(k) for k in range(60)]
    path = table(tmp_path / "a.csv", [*HEADERS[recorder]["head"].strip().split("\n"), *rows])
    recorded = read_recorded_file(path)
    assert recorded.groups[0].step == 1e-3
    assert recorded.groups[0].channels[-1].values.size == 60


@pytest.mark.parametrize("write", [pq.write_table, feather.write_feather])
def test_zeros_behind_the_end_of_a_table_are_none_of_it(tmp_path, write):
    write(pa.table({"time [s]": np.arange(60.0), "h [mm]": np.arange(60.0)}), tmp_path / "a")
    (tmp_path / "b").write_bytes((tmp_path / "a").read_bytes() + bytes(512))
    assert channels(tmp_path / "b") == [("time", "s"), ("h", "mm")]


@pytest.mark.parametrize("write", [pq.write_table, feather.write_feather])
def test_texts_of_parquet_and_arrow_are_dates_times_and_numbers(tmp_path, write):
    moments = [datetime.datetime(2024, 3, 5, 10) + datetime.timedelta(seconds=k) for k in range(60)]
    content = {
        "date": [moment.date() for moment in moments],
        "time": [moment.time() for moment in moments],
        "h [mm]": [f"{k},5" for k in range(60)],
    }
    write(pa.table(content), tmp_path / "a.parquet")
    clock, level = read_recorded_file(tmp_path / "a.parquet").groups[0].channels
    assert iso(clock.start) == "2024-03-05T10:00:00.000000"
    assert_allclose(clock.values, np.arange(60.0))
    assert_allclose(level.values, np.arange(60.0) + 0.5)


def test_a_stream_of_arrow_is_read_and_its_missing_end_is_told(tmp_path):
    held = pa.table({"time [s]": np.arange(60.0), "h [mm]": 900.0 + np.arange(60.0)})
    with pa.ipc.new_stream(tmp_path / "a.arrows", held.schema) as stream:
        stream.write_table(held)
    for left, doubts in ((0, ()), (8, ("the stream of Arrow has no end: batches may be missing",))):
        raw = (tmp_path / "a.arrows").read_bytes()
        (tmp_path / "b.arrows").write_bytes(raw[: len(raw) - left])
        recorded = read_recorded_file(tmp_path / "b.arrows")
        assert [(c.name, c.unit) for c in recorded.groups[0].channels] == [
            ("time", "s"),
            ("h", "mm"),
        ]
        assert_allclose(recorded.groups[0].channels[1].values, 900.0 + np.arange(60.0))
        assert recorded.doubts == doubts


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1"])
def test_encodings_are_found(tmp_path, encoding):
    text = "\n".join(["time [s];T [°C]", *(f"{k};2{k % 7}.5" for k in range(60))])
    (tmp_path / "a.csv").write_bytes(text.encode(encoding) + b"\0" * 512)
    assert channels(tmp_path / "a.csv") == [("time", "s"), ("T", "degC")]


@pytest.mark.parametrize(
    ("text", "first"), [("4,5{k:02d}6", 4.5106), ("4,5{k:02d}", None), ("4.5{k:02d}", None)]
)
def test_numbers_of_a_workbook_tell_nothing_of_texts_beside_them(tmp_path, text, first):
    """Texts are written as people do, who may part thousands; numbers have no mark at all."""
    book = openpyxl.Workbook()
    book.active.append(["time [s]", "inflow [ml/s]", "h [mm]"])
    for k in range(10, 70):
        book.active.append([k, text.format(k=k) if k % 3 else 4500.0 + k, 950.5 + k])
    book.save(tmp_path / "a.xlsx")
    refusal = pytest.raises(InputError, match="can be read with")
    with nullcontext() if first else refusal:
        (group,) = read_recorded_file(tmp_path / "a.xlsx").groups
        assert group.channels[1].values[0] == first
        assert_allclose(group.channels[2].values, 950.5 + np.arange(10, 70))


def test_texts_of_a_preamble_leave_seconds_of_a_workbook_as_they_are(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["Version", "1.2"])
    book.active.append(["Date", "Hour", "Minute", "Second", "h [mm]"])
    for k in range(60):
        minute, second = divmod(90.5 * k, 60.0)
        book.active.append([20240305, int(minute // 60), int(minute % 60), second, 950.5 + k])
    book.save(tmp_path / "a.xlsx")
    (group,) = read_recorded_file(tmp_path / "a.xlsx").groups
    assert_allclose(group.channels[0].values, 90.5 * np.arange(60))


def test_merged_cells_of_a_workbook_name_all_columns_below(tmp_path):
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


def test_a_number_in_brackets_is_that_of_a_channel():
    assert name_and_unit("log(1)") == ("log(1)", "")
    assert name_and_unit("log(1)[s]") == ("log(1)", "s")
    assert name_and_unit("slip [1]") == ("slip", "1")
    assert name_and_unit("x [3]") == ("x [3]", "")
    assert name_and_unit("flow {l/s}") == name_and_unit("flow <l/s>") == ("flow", "l/s")
    assert name_and_unit("flow [l/s] (raw)") == ("flow (raw)", "l/s")


@pytest.mark.parametrize(
    "cell", ["OL", "-OL", "----", "#N/A", "#VALUE!", "Over", "****", " ", "nan"]
)
def test_an_overload_is_no_number(cell):
    assert is_missing(cell)


def test_a_sign_may_stand_apart_from_its_number(tmp_path):
    path = table(tmp_path / "a.csv", ["time [s];h [mm]", *(f"{k};- {k}.5" for k in range(60))])
    (group,) = read_recorded_file(path).groups
    assert_allclose(group.channels[1].values, -(np.arange(60.0) + 0.5))


@pytest.mark.parametrize("form", ["{0}.5D+01", '="{0}5"', "'{0}5", "{0}5 mm", "{0}5mm"])
def test_numbers_are_read_as_people_and_programs_write_them(tmp_path, form):
    rows = [f"{k};{form.format(k)}" for k in range(10, 70)]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", ["time [s];h [mm]", *rows])).groups
    assert_allclose(group.channels[1].values, 10.0 * np.arange(10, 70) + 5.0)
    assert group.channels[1].unit == "mm"


@pytest.mark.parametrize("form", ["({0}5)", "{0}5-", "\u2212{0}5"])
def test_negative_numbers_are_read_as_bookkeepers_write_them(tmp_path, form):
    rows = [f"{k};{form.format(k) if k % 2 else k}" for k in range(10, 70)]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", ["time [s];h [mm]", *rows])).groups
    numbers = np.arange(10.0, 70.0)
    assert_allclose(group.channels[1].values, np.where(numbers % 2, -10 * numbers - 5, numbers))


def test_on_and_off_are_1_and_0_of_what_has_no_unit(tmp_path):
    rows = [f"{k};{'ON' if k % 20 < 5 else 'OFF'};{k}.5" for k in range(60)]
    (group,) = read_recorded_file(
        table(tmp_path / "a.csv", ["time [s];valve;h [mm]", *rows])
    ).groups
    assert_allclose(group.channels[1].values, np.arange(60) % 20 < 5)
    (other,) = read_recorded_file(
        table(tmp_path / "b.csv", ["time [s];inflow [l/s];h [mm]", *rows])
    ).groups
    assert [channel.name for channel in other.channels] == ["time", "h"]


def test_a_censored_cell_is_no_sample_and_is_told(tmp_path):
    rows = [f"{k};{'<0.01' if k == 30 else f'{k}.5'}" for k in range(60)]
    recorded = read_recorded_file(table(tmp_path / "a.csv", ["time [s];h [mm]", *rows]))
    assert recorded.groups[0].channels[1].censored == (30,)
    assert "below or above another, the first '<0.01' in line 32" in recorded.notes[0]


def test_channels_have_the_names_that_a_preamble_gives_their_numbers(tmp_path):
    """As portable recorders write them: CH1 above the samples, its name among the settings."""
    settings = ["CH,Signal name,Input,Range", "CH1,inflow,DC,10V", "CH2,level in,DC,2V"]
    head = [*settings, "Number,Date&Time,CH1,CH2", "NO.,Time,l/s,mm"]
    rows = [f"{k},2025/06/06 08:00:{k:02d},4.{k},90{k % 10}.5" for k in range(60)]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", [*head, *rows])).groups
    labels = {channel.name: channel.about for channel in group.channels}
    assert labels == {"Date&Time": "", "Number": "", "CH1": "inflow", "CH2": "level in"}


def test_formulas_that_were_never_computed_say_so(tmp_path, tank):
    book = openpyxl.Workbook()
    book.active.append(["time [s]", "inflow [l/s]", "h [mm]"])
    for k in range(40):
        book.active.append([k, 4 + k % 3, f"=B{k + 2}*200"])
    book.save(tmp_path / "a.xlsx")
    problems = propose([read_recorded_file(tmp_path / "a.xlsx")], tank, {}).problems
    assert any("'h' holds nothing; of formulas that were never computed" in p for p in problems)


def test_a_workbook_of_excel_97_has_sheets_dates_and_gaps(tmp_path):
    path = tmp_path / "a.xls"
    book = xlwt.Workbook()
    sheet = book.add_sheet("Rig")
    sheet.write_merge(0, 0, 1, 2, "tank")
    for j, cell in enumerate(["Time", "inflow [l/s]", "h [mm]"]):
        sheet.write(1, j, cell)
    dates = xlwt.easyxf(num_format_str="YYYY-MM-DD HH:MM:SS")
    for k in range(60):
        sheet.write(k + 2, 0, 45352.25 + k / 86400.0, dates)
        sheet.write(k + 2, 1, 4 + k)
        sheet.write(k + 2, 2, "OL" if k == 30 else 900.5 + k)
    book.save(str(path))
    (group,) = read_recorded_file(path).groups
    clock, flow, level = group.channels
    assert (group.name, flow.unit, level.unit) == ("Rig", "l/s", "mm")
    assert iso(clock.start) == "2024-03-01T06:00:00.000000"
    assert_allclose(clock.values, np.arange(60.0), atol=1e-6)
    assert_allclose(flow.values, 4.0 + np.arange(60))
    assert np.flatnonzero(np.isnan(level.values)).tolist() == [30]


def open_document(rows: Sequence[Sequence[float | str]], percent: int = -1) -> dict[str, bytes]:
    """Parts of a workbook of OpenDocument, with one sheet, and a column in percent."""
    cells = [
        [
            f'<table:table-cell office:value-type="{"percentage" if j == percent else "float"}" '
            f'office:value="{cell}"/>'
            if isinstance(cell, float)
            else f'<table:table-cell office:value-type="string"><text:p>{cell}</text:p>'
            "</table:table-cell>"
            for j, cell in enumerate(row)
        ]
        for row in rows
    ]
    urn = "urn:oasis:names:tc:opendocument:xmlns"
    lines = "".join(f"<table:table-row>{''.join(row)}</table:table-row>" for row in cells)
    content = (
        f'<office:document-content xmlns:office="{urn}:office:1.0" xmlns:text="{urn}:text:1.0" '
        f'xmlns:table="{urn}:table:1.0"><office:body><office:spreadsheet>'
        f'<table:table table:name="Rig">{lines}</table:table>'
        "</office:spreadsheet></office:body></office:document-content>"
    )
    mimetype = "application/vnd.oasis.opendocument.spreadsheet"
    manifest = f'<manifest:manifest xmlns:manifest="{urn}:manifest:1.0"/>'
    parts = {"mimetype": mimetype, "META-INF/manifest.xml": manifest, "content.xml": content}
    return {name: part.encode() for name, part in parts.items()}


def binary_excel(rows: Sequence[Sequence[float | str]], percent: int = -1) -> dict[str, bytes]:
    """Parts of a binary workbook of Excel, with one sheet ([MS-XLSB], section 2.1).

    Every other number of a column in percent is a short one, of whole hundredths.
    """

    def record(number: int, content: bytes = b"") -> bytes:
        parts = [number] if number < 128 else [number & 127 | 128, number >> 7]
        return bytes([*parts, len(content)]) + content

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value)) + value.encode("utf-16-le")

    sheet = record(129) + record(148, struct.pack("<4I", 0, len(rows) - 1, 0, 2)) + record(145)
    for i, row in enumerate(rows):
        sheet += record(0, struct.pack("<I", i) + bytes(21))
        for j, cell in enumerate(row):
            place = struct.pack("<2I", j, int(j == percent))
            if isinstance(cell, float) and j == percent and i % 2:
                sheet += record(2, place + struct.pack("<I", round(100 * cell) << 2 | 3))
                continue
            value = struct.pack("<d", cell) if isinstance(cell, float) else text(cell)
            sheet += record(5 if isinstance(cell, float) else 6, place + value)
    bundle = record(156, struct.pack("<2I", 0, 1) + text("r1") + text("Rig"))
    relation = "http://schemas.openxmlformats.org/officeDocument/2006/relationships/worksheet"
    listed = f'<Relationship Id="r1" Type="{relation}" Target="worksheets/sheet1.bin"/>'
    form = record(615, bytes([1, 0, 0, 0])) + record(44, b"\xb0\0" + text("0.0%")) + record(616)
    style = [record(47, struct.pack("<2H", 0, code) + bytes(12)) for code in (0, 0xB0)]
    return {
        "[Content_Types].xml": b"<Types/>",
        "xl/styles.bin": form + record(617, b"\2\0\0\0") + b"".join(style) + record(618),
        "xl/_rels/workbook.bin.rels": f"<Relationships>{listed}</Relationships>".encode(),
        "xl/workbook.bin": record(131) + record(143) + bundle + record(144) + record(132),
        "xl/worksheets/sheet1.bin": sheet + record(146) + record(130),
    }


def percent_of_excel_97(rows: Sequence[Sequence[Any]], path: Path) -> None:
    book = xlwt.Workbook()
    sheet, percent = book.add_sheet("one"), xlwt.easyxf(num_format_str="0.0%")
    for i, row in enumerate(rows):
        for j, cell in enumerate(row):
            sheet.write(i, j, cell, percent if i and j else xlwt.XFStyle())
    book.save(path)


def percent_of_excel(rows: Sequence[Sequence[Any]], path: Path, form: str = "0.0%") -> None:
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    for row in book.active.iter_rows(min_row=2, min_col=2):
        row[0].number_format = form
    book.save(path)


def percent_of_others(make: Callable[..., dict[str, bytes]]) -> Callable[..., None]:
    def write(rows: Sequence[Sequence[Any]], path: Path) -> None:
        with zipfile.ZipFile(path, "w") as archive:
            for name, content in make(rows, percent=1).items():
                archive.writestr(name, content)

    return write


@pytest.mark.parametrize("header", ["valve [%]", "valve"])
@pytest.mark.parametrize(
    "write",
    [
        percent_of_excel,
        percent_of_excel_97,
        percent_of_others(open_document),
        percent_of_others(binary_excel),
    ],
    ids=["xlsx", "xls", "ods", "xlsb"],
)
def test_cells_that_are_shown_in_percent_are_percent(tmp_path, header, write):
    """The number below 42 % is 0.42; under a header with % it was taken for 0.42 %."""
    write(
        [["time [s]", header], *([float(k), (40 + k % 9) / 100] for k in range(60))], tmp_path / "a"
    )
    valve = read_recorded_file(tmp_path / "a").groups[0].channels[1]
    assert valve.unit == "%"
    assert_allclose(valve.values, 40.0 + np.arange(60) % 9)


def test_a_sign_of_percent_behind_a_number_changes_nothing(tmp_path):
    """A format such as 0.0" %" shows 42 as 42 %."""
    percent_of_excel(
        [["time [s]", "valve"], *([k, 40.0 + k] for k in range(9))], tmp_path / "a", '0.0" %"'
    )
    valve = read_recorded_file(tmp_path / "a").groups[0].channels[1]
    assert valve.unit == "%"
    assert_allclose(valve.values, 40.0 + np.arange(9))


@pytest.mark.parametrize("made", [open_document, binary_excel])
def test_workbooks_of_other_programs_have_sheets_names_and_gaps(tmp_path, made):
    pytest.importorskip("python_calamine", reason="an extra of [files]")
    levels = [900.5 + k if k != 30 else "OL" for k in range(60)]
    samples = [[0.5 * k, 4.0 + k, level] for k, level in enumerate(levels)]
    with zipfile.ZipFile(tmp_path / "a", "w") as archive:
        parts = made([["made on the rig"], ["Time [s]", "inflow [l/s]", "h [mm]"], *samples])
        for name, content in parts.items():
            archive.writestr(name, content)
    (group,) = read_recorded_file(tmp_path / "a").groups
    clock, flow, level = group.channels
    assert (group.name, flow.unit, level.unit) == ("Rig", "l/s", "mm")
    assert clock.values.tolist() == [sample[0] for sample in samples]
    assert flow.values.tolist() == [sample[1] for sample in samples]
    assert np.flatnonzero(np.isnan(level.values)).tolist() == [30]


def test_a_panic_of_the_reader_of_workbooks_is_a_refusal(tmp_path, capfd):
    """Of a sheet that the workbook names and does not hold."""
    pytest.importorskip("python_calamine", reason="an extra of [files]")
    with zipfile.ZipFile(tmp_path / "a", "w") as archive:
        for name, content in binary_excel([["Time [s]", "h [mm]"], [0.0, 1.0]]).items():
            archive.writestr(name, content.replace(b'Id="r1"', b'Id="r2"'))
    with pytest.raises(InputError, match=r"a workbook \(.ods, .xlsb\) that cannot be read"):
        read_recorded_file(tmp_path / "a")
    assert capfd.readouterr().err == ""


def test_a_waveform_begins_with_those_beside_it(tmp_path):
    """Some recorders state only of the first one when it began."""
    began = {"wf_start_time": np.datetime64("2025-06-06T08:00:00")}
    with TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment(
            [
                ChannelObject("Rig", name, np.arange(50.0), {"wf_increment": 0.5, **stated})
                for name, stated in (("inflow", began), ("h", {}))
            ]
        )
    (group,) = read_recorded_file(tmp_path / "a.tdms").groups
    assert [channel.name for channel in group.channels] == ["inflow", "h"]
