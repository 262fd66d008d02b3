"""Signals come to common times; long recordings are cut; nothing is invented."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import workbench as wb
from workbench.__main__ import main
from workbench.errors import InputError
from workbench.recordings.case import Case
from workbench.recordings.channels import NamedChannel, merge, propose
from workbench.recordings.formats import FileChannel, Group, RecordedFile
from workbench.recordings.importing import cut
from workbench.system.system import System

RATE = 100.0  # Hz


def group(name: str, time: np.ndarray, start: float = math.nan, **signals: np.ndarray) -> Group:
    units = {"pB": "Pa", "tauR": "N.m", "omegaW": "rad/s", "omegaR": "rad/s", "Fx": "N"}
    channels = tuple(FileChannel(key, units[key], values) for key, values in signals.items())
    return Group(name, channels, time=FileChannel("time", "s", time, start=start))


def file(*groups: Group) -> RecordedFile:
    return RecordedFile(Path("recorder.mf4"), "made up", groups, (), "")


def rolling(system: System, time: np.ndarray, speed: np.ndarray) -> dict[str, np.ndarray]:
    """Speeds of a wheel and a roller that roll along, and a torque."""
    return {
        "omegaW": speed / system.values["rW"],
        "omegaR": speed / system.values["rR"],
        "tauR": 100.0 * np.sin(time),
    }


# --- common times ---


def test_a_straight_line_is_met_exactly_between_samples(system):
    fast, slow = np.arange(0.0, 5.0, 0.01), np.arange(0.0, 5.0, 0.05)
    signals = rolling(system, fast, np.full(fast.size, 20.0))
    held = file(group("fast", fast, **signals), group("slow", slow, pB=1e5 * slow))
    measured = merge([held], propose([held], system, {}), system)
    assert_allclose(measured.signals["pB"], 1e5 * measured.time, rtol=1e-12)
    assert measured.time[-1] == pytest.approx(slow[-1])  # nothing is continued
    assert any("pB: interpolated from samples every 0.05 s" in note for note in measured.notes)


def test_the_slowest_output_sets_the_times(system):
    fast, slow = np.arange(0.0, 5.0, 0.01), np.arange(0.002, 5.0, 0.02)
    signals = rolling(system, fast, 20.0 + fast)
    signals["omegaR"] = (20.0 + slow) / system.values["rR"]
    held = file(
        group("roller", slow, omegaR=signals.pop("omegaR")),
        group("others", fast, pB=fast, **signals),
    )
    measured = merge([held], propose([held], system, {}), system)
    inside = slow <= fast[-1]
    assert_array_equal(measured.time, slow[inside])
    expected = (20.0 + slow[inside]) / system.values["rW"]
    assert_allclose(measured.signals["omegaW"], expected, rtol=1e-12)


def test_no_sample_is_invented_in_a_gap(system):
    """Pressure is missing from 2 to 2.05 s, where it may be, and from 3 to 4 s, where not."""
    time = np.arange(0.0, 6.0, 0.01)
    pressure = 1e4 * time
    pressure[(time > 2.0) & (time < 2.05)] = np.nan
    pressure[(time > 3.0) & (time < 4.0)] = np.nan
    held = file(group("", time, pB=pressure, **rolling(system, time, np.full(time.size, 20.0))))
    measured = merge([held], propose([held], system, {}), system)
    missing = (time > 3.0 + 1e-9) & (time < 4.0 - 1e-9)
    assert_allclose(measured.time, time[~missing], rtol=1e-12)
    assert_allclose(measured.signals["pB"], 1e4 * measured.time, rtol=1e-9, atol=1e-9)
    assert any("samples in gaps of more than 0.1 s were left out" in n for n in measured.notes)


def test_an_input_that_is_held_stays_until_its_next_sample(system):
    inputs = tuple(replace(variable, held=variable.name == "pB") for variable in system.inputs)
    changed = replace(system, inputs=inputs)
    fast, slow = np.arange(0.0, 5.0, 0.01), np.arange(0.0, 5.0, 0.05)
    held = file(
        group("fast", fast, **rolling(system, fast, np.full(fast.size, 20.0))),
        group("slow", slow, pB=1e5 * slow),
    )
    measured = merge([held], propose([held], changed, {}), changed)
    before = slow[np.searchsorted(slow, measured.time, side="right") - 1]
    assert_array_equal(measured.signals["pB"], 1e5 * before)


def test_means_of_the_time_before_keep_what_they_add_up_to(system):
    inputs = tuple(replace(variable, held="before") for variable in system.inputs)
    changed = replace(system, inputs=inputs)
    fast, slow = np.arange(0.0, 5.0, 0.01), np.arange(0.0, 5.0, 0.04)
    pulses = np.where(np.arange(fast.size) % 4 == 1, 1e5, 0.0)  # a quarter of each slow interval
    held = file(
        group("slow", slow, **rolling(system, slow, np.full(slow.size, 20.0))),
        group("fast", fast, pB=pulses),
    )
    measured = merge([held], propose([held], changed, {}), changed)
    assert_allclose(measured.signals["pB"][1:], 0.25e5)
    assert any("pB: averaged from samples" in note for note in measured.notes) or (
        measured.time.size == slow.size
    )


def test_loggers_are_brought_together_by_their_time_stamps(system):
    time = np.arange(0.0, 5.0, 0.01)
    first = group("", time, 1000.0, **rolling(system, time, 20.0 + time))
    other = group("", time, 998.5, pB=1e4 * time)  # began 1.5 s before
    files = [file(first), file(other)]
    measured = merge(files, propose(files, system, {}), system)
    assert measured.start == 998.5
    assert measured.time[0] == pytest.approx(1.5)
    assert_allclose(measured.signals["pB"], 1e4 * measured.time, rtol=1e-9)
    expected = (20.0 + measured.time - 1.5) / system.values["rW"]
    assert_allclose(measured.signals["omegaW"], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("begin", "match"),
    [
        (math.nan, "times without a date beside others that have one"),
        (2000.0, "0 samples at common times"),
    ],
)
def test_recordings_of_no_common_clock_or_time_are_refused(system, begin, match):
    time = np.arange(0.0, 5.0, 0.01)
    first = group("", time, 1000.0, **rolling(system, time, 20.0 + time))
    files = [file(first), file(group("", time, begin, pB=1e4 * time))]
    with pytest.raises(InputError, match=match):
        merge(files, propose(files, system, {}), system)


@pytest.mark.parametrize(
    ("times", "rate", "match"),
    [
        (np.repeat(np.arange(250.0), 2), None, r"0 s after 0 s in sample 2, and 249 more"),
        (np.concatenate([np.arange(250.0), np.arange(250.0)]), None, "0 s after 249 s"),
        (np.full(500, np.nan), None, "no times"),
    ],
)
def test_times_that_do_not_go_on_are_refused(system, times, rate, match):
    time = np.arange(0.0, 5.0, 0.01)
    held = file(group("", times, pB=1e5 * time, **rolling(system, time, np.full(time.size, 20.0))))
    with pytest.raises(InputError, match=match):
        propose([held], system, {}, rate)
    assert propose([held], system, {}, 0.01).certain  # a given rate wins


@pytest.mark.parametrize(("unit", "factor"), [("ns", 1e9), ("us", 1e6), ("ms", 1e3), ("s", 1.0)])
def test_a_time_without_a_unit_is_read_as_recordings_are_usually_sampled(system, unit, factor):
    time = np.arange(0.0, 5.0, 0.01)
    plain = group("", time, pB=time, **rolling(system, time, np.full(time.size, 20.0)))
    channels = (FileChannel("Zeit", "", time * factor), *plain.channels)
    proposal = propose([file(Group("", channels))], system, {})
    (clock,) = proposal.clocks.values()
    assert clock.unit == unit
    assert not proposal.certain  # somebody must look
    named = propose([file(Group("", channels))], system, {"time": NamedChannel("Zeit", "s")})
    assert_allclose(next(iter(named.clocks.values())).times, time * factor)


def test_a_counted_time_goes_before_stamps_that_are_coarser(system):
    time = np.arange(0.0, 5.0, 0.01)
    plain = group("", time, pB=time, **rolling(system, time, np.full(time.size, 20.0)))
    stamps = FileChannel("Datum", "s", np.ceil(100 * time) / 100 + 1e-3 * time, stamp=True)
    channels = (stamps, FileChannel("Zeit", "s", time), *plain.channels)
    (clock,) = propose([file(Group("", channels))], system, {}).clocks.values()
    assert clock.channel == "Zeit"


def test_one_channel_of_two_groups_is_not_taken_for_the_other(system):
    time = np.arange(0.0, 5.0, 0.01)
    first = group("run 1", time, pB=time, **rolling(system, time, 20.0 + time))
    held = file(first, group("run 2", time, pB=2 * time))
    assert propose([held], system, {}).problems == ("pB: it may be 'run 1/pB' or 'run 2/pB'",)
    named = propose([held], system, {"pB": NamedChannel("run 2/pB")})
    assert_allclose(named.assigned["pB"].values, 2 * time)


# --- cuts ---


def drive(stops: list[tuple[float, float]], system: System) -> tuple[np.ndarray, dict]:
    """Stops from 20 m/s after 10 s each, by pressure for so many seconds, of a rate [m/s2]."""
    speed, pressure = [], []
    for lasts, rate in stops:
        v = 20.0
        speed += [v] * round(10 * RATE)
        pressure += [0.0] * round(10 * RATE)
        for _ in range(round(lasts * RATE)):
            v = max(0.0, v - rate / RATE)
            speed.append(v)
            pressure.append(2e5)
        speed += [v] * round(4 * RATE)  # brakes off
        pressure += [0.0] * round(4 * RATE)
        speed += list(np.linspace(v, 20.0, round(10 * RATE)))
        pressure += [0.0] * round(10 * RATE)
    time = np.arange(len(speed)) / RATE
    return time, {"pB": np.array(pressure), **rolling(system, time, np.array(speed))}


def test_each_stop_of_a_day_is_a_recording(system):
    time, signals = drive([(25.0, 1.0), (15.0, 2.0), (5.0, 1.0), (25.0, 1.0)], system)
    parts = cut(time, signals, system)
    kept = [(time[part.first], time[part.end - 1]) for part in parts if not part.reason]
    rule = system.cutting
    # A stop begins with its pressure and ends at standstill, by the speed over the rate.
    begins = [10.0, 59.0, 127.0]
    lasts = [(20.0 - 0.1) / 1.0, (20.0 - 0.1) / 2.0, (20.0 - 0.1) / 1.0]
    expected = [(b - rule.before, b + d + rule.after) for b, d in zip(begins, lasts, strict=True)]
    assert_allclose(kept, expected, atol=2.5 / RATE)  # samples at both ends
    assert [part.reason for part in parts if part.reason and "between" not in part.reason] == [
        "it was released before its end"
    ]
    assert_array_equal([part.first for part in parts[1:]], [part.end for part in parts[:-1]])
    assert (parts[0].first, parts[-1].end) == (0, time.size)


def test_a_recording_of_one_stop_is_left_whole(system):
    time, signals = drive([(25.0, 1.0)], system)
    assert [(part.first, part.end, part.reason) for part in cut(time, signals, system)] == [
        (0, time.size, "")
    ]


def test_a_part_without_its_beginning_or_its_end_is_left_out(system):
    time, signals = drive([(25.0, 1.0)] * 4, system)
    piece = slice(round(15 * RATE), round(162 * RATE))  # within the first, within the last
    cuts = cut(time[piece], {name: v[piece] for name, v in signals.items()}, system)
    assert [cut.reason for cut in cuts if "between" not in cut.reason] == [
        "it had begun before this recording",
        "",
        "",
        "it does not end in this recording",
    ]


def test_a_gap_parts_recordings_without_any_rule(system):
    time = np.concatenate([np.arange(0.0, 5.0, 0.01), 100.0 + np.arange(0.0, 5.0, 0.01)])
    signals = {"pB": np.zeros(time.size), **rolling(system, time, np.full(time.size, 20.0))}
    parts = cut(time, signals, replace(system, cutting=None))
    assert [(part.first, part.end) for part in parts] == [(0, 500), (500, 1000)]


def test_a_long_file_becomes_cases_and_a_figure(tmp_path, system, root):
    (stop,) = wb.read_cases(root / "cases" / "01_dry_80_1.5", system)
    twice = [stop.part(slice(None, None, 4))] * 2
    write(tmp_path / "day.csv", twice)
    out = tmp_path / "out"
    assert main(["import", str(tmp_path / "day.csv"), "--out", str(out), "--yes"]) == 0
    assert [read_case.name for read_case in wb.read_cases(out, system)] == ["01_day", "02_day"]
    assert (out / "day_cuts.png").stat().st_size > 10_000
    (entry,) = json.loads((out / "import.json").read_text())["imports"]
    assert [part["case"] for part in entry["cut"] if part["case"]] == ["01_day", "02_day"]
    assert sum(part["samples"] for part in entry["cut"]) == 2 * twice[0].time.size
    again = ["import", str(tmp_path / "day.csv"), "--out", str(tmp_path / "w"), "--yes", "--whole"]
    assert main(again) == 0
    assert [read_case.name for read_case in wb.read_cases(tmp_path / "w", system)] == ["day"]


def write(path: Path, cases: list[Case]) -> None:
    """Write recordings one after the other into a file, without a gap."""
    lines = ["time [s],pB [Pa],tauR [N.m],omegaW [rad/s],omegaR [rad/s]"]
    begin = 0.0
    for case in cases:
        time = case.time - case.time[0] + begin
        columns = (time, *(case[name] for name in ("pB", "tauR", "omegaW", "omegaR")))
        rows = zip(*(values.tolist() for values in columns), strict=True)
        lines += [",".join(map(repr, row)) for row in rows]
        begin = float(time[-1]) + 0.02
    path.write_text("\n".join(lines))
