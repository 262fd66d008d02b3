"""MAT and JSON files as people of identification, Simulink and Modelica tools write them."""

import io
import json
import time
from collections.abc import Mapping
from pathlib import Path
from struct import pack
from typing import Any, Literal

import h5py
import numpy as np
import pandas as pd
import pytest
from matio import save_to_mat
from numpy.testing import assert_allclose
from scipy.io import netcdf_file, savemat

from workbench.errors import InputError
from workbench.recordings.channels import propose
from workbench.recordings.formats import Group, read_recorded_file
from workbench.recordings.formats.stamps import iso

TIME = np.arange(0.0, 60.0, 0.5)  # s
FLOW, LEVEL = 4.0 + np.sin(TIME), 900.0 + np.cos(TIME)


def column(values: np.ndarray) -> np.ndarray:
    return values.reshape(-1, 1)


def simulink(labels: tuple[str, str], times: np.ndarray = TIME) -> Mapping[str, Any]:
    signals = np.zeros(2, dtype=[("values", "O"), ("dimensions", "O"), ("label", "O")])
    for k, (label, values) in enumerate(zip(labels, (FLOW, LEVEL), strict=True)):
        signals[k] = (column(values), 1, label)
    return {"out": {"time": column(times), "signals": signals, "blockName": "m/Scope"}}


def group(path: Path, content: Mapping[str, Any], form: Literal["4", "5"] = "5") -> Group:
    savemat(path, dict(content), format=form)
    (held,) = read_recorded_file(path).groups
    return held


T, U, Y = column(TIME), column(FLOW), column(LEVEL)


@pytest.mark.parametrize(
    ("content", "names", "form"),
    [
        ({"data": {"t": T, "u": U, "y": Y}}, ["t", "u", "y"], "5"),
        ({"est": {"u": U, "y": Y, "Ts": 0.5}}, ["u", "y"], "5"),
        ({"time": TIME, "u": FLOW, "y": LEVEL}, ["time", "u", "y"], "4"),
        (simulink(("u", "y")), ["time", "u", "y"], "5"),
        (simulink(("", "")), ["time", "(1)", "(2)"], "5"),
        (simulink(("u", "y"), np.empty(0)), ["u", "y"], "5"),
    ],
    ids=["t, u, y", "u, y, Ts", "MAT 4", "Simulink", "without names", "without time"],
)
def test_all_signals_of_a_structure_are_channels(tmp_path, content, names, form):
    recorded = group(tmp_path / "a.mat", content, form)
    assert [channel.name for channel in recorded.channels] == names
    u, y = recorded.channels[-2:]
    assert_allclose(u.values, FLOW)
    assert_allclose(y.values, LEVEL)
    assert np.isfinite(recorded.step) == ("est" in content)


def struct(**fields: Any) -> Mapping[str, Any]:
    return fields


def array(*entries: Mapping[str, Any]) -> np.ndarray:
    """A structure array of MATLAB."""
    held = np.zeros(len(entries), dtype=[(name, "O") for name in entries[0]])
    for k, entry in enumerate(entries):
        held[k] = tuple(entry.values())
    return held


NAMES = struct(InputName="inflow", OutputName="h", InputUnit="l/s", OutputUnit="mm")


@pytest.mark.parametrize(
    "content",
    [
        NAMES | struct(u=U, y=Y, Ts=500.0, TimeUnit="ms"),
        NAMES | struct(InputData=U, OutputData=Y, Ts=0.5),
    ],
)
def test_data_of_system_identification_has_its_names_units_and_steps(tmp_path, content):
    recorded = group(tmp_path / "a.mat", {"data": content})
    assert [(c.name, c.unit) for c in recorded.channels] == [("inflow", "l/s"), ("h", "mm")]
    assert recorded.step == 0.5


def test_channels_of_catman_have_the_names_of_their_headers(tmp_path):
    heads = {"inflow": ("l/s", U), "h": ("mm", Y)}
    content: dict[str, Any] = {"File_Header": struct(SampleFrequency="2", Comment="x")}
    for k, (name, (unit, values)) in enumerate(heads.items(), 1):
        content[f"Channel_{k}_Header"] = struct(SignalName=name, Unit=unit, NoOfSamples=values.size)
        content[f"Channel_{k}_Data"] = values
    recorded = group(tmp_path / "a.mat", content)
    assert [(c.name, c.unit) for c in recorded.channels] == [("inflow", "l/s"), ("h", "mm")]
    assert_allclose(recorded.channels[1].values, LEVEL)
    assert recorded.step == 0.5


INFLOW = struct(Name="inflow", Values=struct(Time=TIME, Data=U, Units="l/s"))
H = struct(Name="h", Values=struct(Time=TIME, Data=Y, Units="mm"))


@pytest.mark.parametrize(
    "logged",
    [
        {"element1": INFLOW, "element2": H},
        array(INFLOW, H),
        {
            "inflow": struct(Time=TIME, Data=FLOW.reshape(1, 1, -1), DataInfo=struct(Units="l/s")),
            "h": struct(Time=TIME, Data=LEVEL.reshape(1, 1, -1), DataInfo=struct(Units="mm")),
        },
        {"inflow": struct(v=FLOW, t=TIME, unit="l/s"), "h": struct(v=LEVEL, t=TIME, unit="mm")},
    ],
    ids=["Dataset", "array of signals", "time series", "values, times and units"],
)
def test_signals_with_times_of_their_own_have_their_names(tmp_path, logged):
    savemat(tmp_path / "a.mat", {"logsout": logged})
    groups = read_recorded_file(tmp_path / "a.mat").groups
    channels = {c.name: c for held in groups for c in held.channels}
    assert (channels["inflow"].unit, channels["h"].unit) == ("l/s", "mm")
    assert_allclose(channels["inflow"].values, FLOW)
    assert_allclose(channels["h"].values, LEVEL)


def test_signals_over_common_times_are_those_of_a_test_stand(tmp_path):
    signals = array(
        struct(Name="inflow", Data=FLOW, Unit="l/s"), struct(Name="h", Data=LEVEL, Unit="mm")
    )
    recorded = group(tmp_path / "a.mat", {"exp": {"X": struct(Data=TIME, Unit="s"), "Y": signals}})
    assert [(c.name, c.unit) for c in recorded.channels] == [
        *(("time", "s"), ("inflow", "l/s"), ("h", "mm"))
    ]


def test_signals_of_a_test_stand_keep_the_times_of_their_raster(tmp_path):
    clocks = array(struct(Data=TIME[::4], Unit="s"), struct(Data=TIME, Unit="s"))
    signals = array(
        struct(Name="inflow", Data=FLOW, Unit="l/s", XIndex=2),
        struct(Name="h", Data=LEVEL[::4], Unit="mm", XIndex=1),
    )
    savemat(tmp_path / "a.mat", {"exp": {"X": clocks, "Y": signals}})
    slow, fast = (held.channels for held in read_recorded_file(tmp_path / "a.mat").groups)
    assert [channel.name for channel in (*slow, *fast)] == ["time", "h", "time", "inflow"]
    assert_allclose(slow[0].values, TIME[::4])
    assert_allclose(fast[0].values, TIME)


def test_a_table_of_inputs_beside_an_output_is_not_lost(tmp_path):
    inputs = np.column_stack([FLOW, 2.0 * FLOW])
    recorded = group(tmp_path / "a.mat", {"z": {"u": inputs, "y": column(LEVEL), "Ts": 0.5}})
    assert [channel.name for channel in recorded.channels] == ["u(1)", "u(2)", "y"]


@pytest.mark.parametrize("version", ["v7", "v7.3"])
@pytest.mark.filterwarnings("ignore:duration_to_mat")
def test_timetables_and_dates_of_matlab_are_read(tmp_path, version):
    dates = np.datetime64("2024-03-05T10:00:00") + (TIME * 1e3).astype("timedelta64[ms]")
    frame = pd.DataFrame({"inflow": FLOW, "h": LEVEL}, index=pd.Index(dates, name="Time"))
    save_to_mat(tmp_path / "a.mat", {"rig": {"T": frame, "note": "first"}}, version=version)
    save_to_mat(tmp_path / "b.mat", {"t": dates, "h": column(LEVEL)}, version=version)
    for name in ("a.mat", "b.mat"):
        (held,) = read_recorded_file(tmp_path / name).groups
        channels = {channel.name: channel for channel in held.channels}
        assert_allclose(channels["h"].values, LEVEL)
        clock = channels["Time" if name == "a.mat" else "t"]
        assert_allclose(clock.values, TIME)
        assert iso(clock.start) == "2024-03-05T10:00:00.000000"


def test_a_damaged_length_that_means_a_minute_of_work_is_refused_in_seconds(tmp_path):
    """An array of 200 million structures without a field, of 700 bytes."""
    stream = io.BytesIO()
    savemat(stream, {"t": TIME[:50], "s": np.array([[(1.0,)]], dtype=[("a", object)])})
    content = bytearray(stream.getvalue())
    names = content.rfind(pack("<HHi", 5, 4, 2))  # length of names of fields
    size = content.rfind(pack("<II2i", 5, 8, 1, 1), 0, names)
    content[size + 8 : size + 16] = pack("<2i", 200_000_000, 1)
    content[names + 4 : names + 8] = pack("<i", 1000)
    (tmp_path / "a.mat").write_bytes(content)
    begin = time.monotonic()
    with pytest.raises(InputError, match=r"cannot be read \((WorkerError: .* than 10|MemoryError)"):
        read_recorded_file(tmp_path / "a.mat")
    assert time.monotonic() - begin < 60.0  # with what a busy machine takes to load scipy


def test_a_signal_without_a_label_has_the_name_of_its_structure(tmp_path):
    logged = struct(time=TIME, signals=struct(values=column(FLOW), unit="l/s"))
    recorded = group(tmp_path / "a.mat", {"inflow": logged})
    assert [c.name for c in recorded.channels] == ["time", "inflow"]


STAMPS = [f"2024-03-05T10:00:{t:06.3f}Z" for t in TIME]


LEVELS = LEVEL.tolist()
SAMPLES = list(zip(STAMPS, LEVELS, strict=True))
BY_UNIT = {"time": STAMPS, "h": LEVELS, "units": {"h": "mm"}}
CHANNELS = ("h", "mm"), ("b", "")
DOCUMENTS: dict[str, Any] = {
    "records": [{"time": s, "h [mm]": h} for s, h in SAMPLES],
    "nested": {"values": [{"time": s, "h": h} for s, h in SAMPLES], "units": {"h": "mm"}},
    "values with units": [{"time": s, "h": {"value": h, "unit": "mm"}} for s, h in SAMPLES],
    "columns": BY_UNIT,
    "split": {"columns": ["h [mm]"], "index": STAMPS, "data": [[h] for h in LEVELS]},
    "by column": {"h [mm]": dict(SAMPLES), "b": dict.fromkeys(STAMPS, 1.0)},
    "by row": {s: {"h [mm]": h, "b": 1.0} for s, h in SAMPLES},
    "deep": {"result": {"rig": "A", "series": [{"t": s, "h [mm]": h} for s, h in SAMPLES]}},
    "described": {"signals": {n: {"unit": u, "gain": 1, "zero": 0} for n, u in CHANNELS}} | BY_UNIT,
    "pairs": {"series": [{"name": "h", "unit": "mm", "data": SAMPLES}]},
    "metrics": {"data": {"result": [{"metric": {"__name__": "h [mm]"}, "values": SAMPLES}]}},
    "pairs turned": [{"target": "h [mm]", "datapoints": [(h, s) for s, h in SAMPLES]}] * 2,
    "values of columns": {
        "results": [{"series": [{"name": "tank", "columns": ["t", "h [mm]"], "values": SAMPLES}]}]
    },
    "states": [
        [{"entity_id": name, "attributes": {"unit_of_measurement": "mm"}, **state[0]}, *state[1:]]
        for state in [[{"last_changed": s, "state": str(h)} for s, h in SAMPLES]]
        for name in ("h", "b")
    ],
    "x, y": {"channels": [{"name": "h", "unit": "mm", "time": STAMPS, "values": LEVELS}]},
}


@pytest.mark.parametrize("document", DOCUMENTS.values(), ids=DOCUMENTS)
def test_json_has_channels_units_and_dates(tmp_path, document):
    (tmp_path / "a.json").write_text(json.dumps(document))
    held = read_recorded_file(tmp_path / "a.json").groups[0]
    clock = next(channel for channel in held.channels if channel.stamp)
    level = next(channel for channel in held.channels if channel.name == "h")
    assert (level.unit, iso(clock.start)) == ("mm", "2024-03-05T10:00:00.000000")
    assert_allclose(level.values, LEVEL)
    assert_allclose(clock.values, TIME)


def test_json_of_lines_is_read_and_a_cut_line_is_named(tmp_path):
    lines = [json.dumps({"t": t, "h": None if t == TIME[3] else t}) for t in TIME.tolist()]
    (tmp_path / "a.json").write_text("\n".join(lines))
    (held,) = read_recorded_file(tmp_path / "a.json").groups
    assert np.isnan(held.channels[1].values[3])
    (tmp_path / "a.json").write_text("\n".join([*lines[:7], lines[7][:9], *lines[8:]]))
    with pytest.raises(InputError, match="line 8: found text that is no JSON"):
        read_recorded_file(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ('tank,site=a\\,b h={},note="ok, 1",n=5i {}000000000', "h"),
        ("level value={} {}000", "level"),
    ],
)
def test_lines_of_influx_are_read(tmp_path, line, name):
    text = "".join(line.format(h, 1709630000 + k) + "\n" for k, h in enumerate(LEVELS))
    (tmp_path / "a.txt").write_text(f"# exported\n{text}")
    recorded = read_recorded_file(tmp_path / "a.txt")
    channels = {channel.name: channel.values for channel in recorded.groups[0].channels}
    assert_allclose(channels[name], LEVEL)
    assert_allclose(np.diff(channels["time"]) / channels["time"][0], 1.0 / 1709630000, rtol=1e-6)
    (tmp_path / "a.txt").write_text(text + "tank h=\n")
    with pytest.raises(InputError, match=rf"line {LEVEL.size + 1}: found 'tank h='"):
        read_recorded_file(tmp_path / "a.txt")


@pytest.mark.parametrize("pack", [np.savez, np.savez_compressed])
def test_arrays_of_numpy_are_channels(tmp_path, pack):
    pack(tmp_path / "a.npz", t=TIME, h=LEVEL, h_unit="mm", old=np.array([{}, None]))
    recorded = read_recorded_file(tmp_path / "a.npz")
    (held,) = recorded.groups
    assert [(c.name, c.unit) for c in held.channels] == [("t", ""), ("h", "mm")]
    assert_allclose(held.channels[1].values, LEVEL)
    assert any("'old' is an array of objects of Python" in note for note in recorded.notes)


def test_netcdf_of_the_classic_format_is_read_with_its_attributes(tmp_path):
    with netcdf_file(tmp_path / "a.nc", "w") as file:
        file.createDimension("time", TIME.size)
        for name, code, values, unit, scale in (
            ("time", "d", TIME, "seconds since 2024-03-05 10:00:00", 1.0),
            ("h", "i", np.round(10.0 * LEVEL), "mm", 0.1),
        ):
            variable = file.createVariable(name, code, ("time",))
            variable[:], variable.units, variable.scale_factor = values, unit, scale
    clock, level = read_recorded_file(tmp_path / "a.nc").groups[0].channels
    assert (iso(clock.start), level.unit) == ("2024-03-05T10:00:00.000000", "mm")
    assert_allclose(level.values, LEVEL, atol=0.051)


@pytest.mark.parametrize("form", ["fixed", "table"])
def test_frames_of_pandas_have_the_names_of_their_columns(tmp_path, form):
    """As pandas 2.2 and PyTables 3.10 write them; lists of names are pickled, and only read."""
    counts = 1709632800 * 10**9 + np.round(1e9 * TIME).astype("i8")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        log = file.create_group("log")
        if form == "fixed":
            log.attrs.update(pandas_type=np.bytes_(b"frame"), nblocks=1)
            log["axis1"], log["axis0"] = counts, [b"h", b"n"]
            log["axis1"].attrs["kind"] = np.bytes_(b"datetime64[ns]")
            log["block0_items"] = [b"h", b"n"]
            log["block0_values"] = np.column_stack([LEVEL, TIME])
        else:
            log.attrs["pandas_type"] = np.bytes_(b"frame_table")
            fields = [("index", "i8"), ("values_block_0", "f8", (1,)), ("n", "f8")]
            rows = zip(counts, LEVEL[:, None], TIME, strict=True)
            log["table"] = np.array(list(rows), dtype=fields)
            log["table"].attrs["index_kind"] = np.bytes_(b"datetime64[ns]")
            log["table"].attrs["values_block_0_kind"] = np.bytes_(b"(lp0\nVh\np1\na.")
            log.create_group("_i_table")["bounds"] = TIME
    channels = {c.name: c for c in read_recorded_file(tmp_path / "a.h5").groups[0].channels}
    assert list(channels) == ["time", "h", "n"]
    assert (channels["time"].unit, channels["time"].values[0]) == ("ns", counts[0])
    assert_allclose(channels["h"].values, LEVEL)


def test_times_may_be_texts(tmp_path):
    stamps = np.array([f"2024-03-05 10:00:{t:06.3f}" for t in TIME], dtype=object)
    recorded = group(tmp_path / "a.mat", {"t": stamps, "h": column(LEVEL)})
    assert_allclose(recorded.channels[0].values, TIME)


def test_arrays_of_another_length_than_times_say_so(tmp_path):
    savemat(tmp_path / "a.mat", {"t": TIME[:-1], "u": FLOW, "y": LEVEL})
    doubts = [held.step_doubt for held in read_recorded_file(tmp_path / "a.mat").groups]
    assert "no times for 120 samples of u, y: 't' has 119" in doubts


@pytest.mark.parametrize(
    ("stated", "match"),
    [
        ({"scale_factor": 0.1, "add_offset": 850.0, "_FillValue": 77}, ""),
        ({"gain": 0.1}, "gain = 0.1"),
    ],
)
def test_counts_of_hdf5_are_scaled_as_is_usual_or_told(tmp_path, tank, stated, match):
    """As files of weather and climate are packed; they were taken as counts."""
    counts = np.round(10.0 * (LEVEL - 850.0)).astype(np.int16)
    counts[3] = 77
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values, unit in (
            ("time", TIME, "s"),
            ("inflow", FLOW, "l/s"),
            ("h", counts, "mm"),
        ):
            file[name] = values
            file[name].attrs["UNITS"] = [unit.encode()]
        file["h"].attrs.update(stated)
    proposed = propose([read_recorded_file(tmp_path / "a.h5")], tank, {})
    if match:
        assert match in proposed.problems[0]
    else:
        known = np.arange(TIME.size) != 3
        assert_allclose(proposed.assigned["h"].values[known], 1e-3 * LEVEL[known], atol=5e-5)
        assert np.isnan(proposed.assigned["h"].values[3])


def test_units_of_hdf5_may_be_in_the_encoding_of_windows(tmp_path):
    """A degree sign that is no UTF-8 made a whole file unreadable."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["T"] = TIME, LEVEL
        file["time"].attrs["units"] = "s"
        file["T"].attrs["units"] = np.bytes_("°C".encode("cp1252"))
    units = {c.name: c.unit for c in read_recorded_file(tmp_path / "a.h5").groups[0].channels}
    assert units == {"time": "s", "T": "degC"}


def test_hdf5_is_read_with_what_its_attributes_say(tmp_path):
    """A table with names, rows of a compound, a rate, times since a date; no object of MATLAB."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        table = file.create_group("a").create_dataset("data", data=np.column_stack([FLOW, LEVEL]))
        table.attrs["columns"], table.attrs["units"] = ["inflow", "h"], ["l/s", "mm"]
        table.attrs["sample_rate"] = 2.0
        rows = np.array(list(zip(TIME, LEVEL, strict=True)), dtype=[("time", float), ("h", float)])
        file.create_dataset("b", data=rows)
        c = file.create_group("c")
        c.create_dataset("h", data=LEVEL)
        c.create_dataset("time", data=TIME).attrs["units"] = "seconds since 2024-03-05 10:00:00"
        opaque = file.create_dataset("d", data=np.arange(6, dtype=np.uint32))
        opaque.attrs["MATLAB_class"] = b"timetable"
        opaque.attrs["MATLAB_object_decode"] = 3
    recorded = read_recorded_file(tmp_path / "a.h5")
    a, b, c = recorded.groups
    assert [(channel.name, channel.unit) for channel in a.channels] == [
        *(("inflow", "l/s"), ("h", "mm"))
    ]
    assert a.step == 0.5
    assert [channel.name for channel in b.channels] == ["time", "h"]
    assert iso(c.channels[1].start) == "2024-03-05T10:00:00.000000"
    assert "'d' is an object of MATLAB (timetable)" in recorded.notes[0]


def texts(rows: list[str], *, turned: bool) -> np.ndarray:
    width = max(map(len, rows))
    table = np.array([list(row.ljust(width)) for row in rows])
    return np.ascontiguousarray(table.T) if turned else table


@pytest.mark.parametrize("turned", [True, False], ids=["binTrans", "binNormal"])
def test_results_of_modelica_tools_are_recordings(tmp_path, *, turned):
    """Of two samples at an event the later one is kept; a parameter is no channel."""
    times = np.array([0.0, 1.0, 2.0, 2.0, 3.0])
    data = np.array([times, 10.0 * times, [0.0, 0.0, 0.0, 1.0, 1.0]])
    info = np.array([[0, 1, 0, -1], [2, 2, 0, -1], [2, -2, 0, -1], [1, 2, 0, 0], [2, 3, 0, -1]])
    matrix = "binTrans" if turned else "binNormal"
    names = ["time", "tank.h", "mirror", "A", "valve"]
    about = ["Time in [s]", "Level [m|cm]", "Level turned [m]", "Area [m2]", "open"]
    content = {
        "Aclass": texts(["Atrajectory", "1.1", "", matrix], turned=False),
        "name": texts(names, turned=turned),
        "description": texts(about, turned=turned),
        "dataInfo": (info.T if turned else info).astype(np.int32),
        "data_1": np.zeros((2, 2)),
        "data_2": data if turned else data.T,
    }
    savemat(tmp_path / "a.mat", content, format="4")
    recorded = read_recorded_file(tmp_path / "a.mat")
    (group,) = recorded.groups
    assert [(channel.name, channel.unit) for channel in group.channels] == [
        *(("time", "s"), ("tank.h", "m"), ("mirror", "m"), ("valve", ""))
    ]
    assert_allclose(group.channels[0].values, [0.0, 1.0, 2.0, 3.0])
    assert_allclose(group.channels[1].values, [0.0, 10.0, 20.0, 30.0])
    assert_allclose(group.channels[2].values, [0.0, -10.0, -20.0, -30.0])
    assert_allclose(group.channels[3].values, [0.0, 0.0, 1.0, 1.0])
    assert recorded.notes == (
        "1 samples before events were left out, of the times of those after",
        "1 parameters and constants were left out",
    )
