"""Times as recorders write them: the right seconds, or a question."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.errors import InputError
from workbench.recordings.case import read_cases
from workbench.recordings.channels import (
    NamedChannel,
    ProposedRecording,
    merge,
    parse_named,
    propose,
)
from workbench.recordings.channels.clock import Clock
from workbench.recordings.formats import read_recorded_file
from workbench.recordings.formats.stamps import iso
from workbench.recordings.importing import import_recording, write
from workbench.system.registry import load_system
from workbench.system.system import System
from workbench.system.template import write_system

QUARTER = 900.0  # s, between samples


@pytest.fixture(scope="module")
def tank(tmp_path_factory: pytest.TempPathFactory) -> System:
    """A tank with an inflow and a level, sampled each quarter of an hour."""
    folder = tmp_path_factory.mktemp("systems") / "tank"
    write_system(folder)
    path = folder / "system.toml"
    text = path.read_text().replace('sample_time = "0.5 s"', 'sample_time = "900 s"')
    path.write_text(text)
    return load_system(folder)


def table(path: Path, stamps: Sequence[str], name: str = "Time") -> Path:
    rows = [f"{stamp};1.{i % 7};2{i % 10}" for i, stamp in enumerate(stamps)]
    path.write_text("\n".join([f"{name};inflow [l/s];h [mm]", *rows]))
    return path


def clock(path: Path, system: System, time: str = "") -> Clock:
    columns = dict([parse_named(f"time={time}", "", system)]) if time else {}
    (found,) = propose([read_recorded_file(path)], system, columns).clocks.values()
    return found


def local(begin: datetime, count: int, form: str, step: float = QUARTER) -> list[str]:
    """Times of a clock on a wall, evenly spaced in truth."""
    first = begin.astimezone(UTC)
    moments = (first + timedelta(seconds=step * k) for k in range(count))
    return [moment.astimezone(begin.tzinfo).strftime(form) for moment in moments]


BERLIN, NEW_YORK = ZoneInfo("Europe/Berlin"), ZoneInfo("America/New_York")
SYDNEY = ZoneInfo("Australia/Sydney")


@pytest.mark.parametrize(
    ("begin", "form", "step"),
    [
        (datetime(2024, 10, 26, tzinfo=BERLIN), "%Y-%m-%d %H:%M:%S", 900.0),
        (datetime(2024, 3, 30, tzinfo=BERLIN), "%Y-%m-%d %H:%M:%S", 900.0),
        (datetime(2024, 3, 28, tzinfo=BERLIN), "%d.%m.%Y %H:%M", 3600.0),
        (datetime(2024, 11, 2, tzinfo=NEW_YORK), "%m/%d/%Y %I:%M %p", 900.0),
        (datetime(2024, 3, 9, tzinfo=NEW_YORK), "%m/%d/%Y %H:%M", 900.0),
        (datetime(2024, 4, 6, tzinfo=SYDNEY), "%d/%m/%Y %H:%M", 900.0),
        (datetime(2024, 10, 26, tzinfo=BERLIN), "%Y-%m-%dT%H:%M:%S%z", 900.0),
        (datetime(2024, 3, 30, tzinfo=BERLIN), "%Y-%m-%d %H:%M:%S %Z", 900.0),
        (datetime(2024, 11, 2, tzinfo=NEW_YORK), "%Y-%m-%d %H:%M:%S %Z", 900.0),
        (datetime(2024, 10, 26, tzinfo=BERLIN), "%H:%M:%S", 900.0),
    ],
)
def test_local_times_go_on_through_changes_of_the_clock(
    tmp_path: Path, tank: System, begin: datetime, form: str, step: float
) -> None:
    path = table(tmp_path / "a.csv", local(begin, 160, form, step))
    assert_allclose(clock(path, tank).times, step * np.arange(160))


def test_a_mended_clock_is_told(tmp_path: Path, tank: System) -> None:
    begin = datetime(2024, 10, 26, tzinfo=BERLIN)
    recorded = read_recorded_file(table(tmp_path / "a.csv", local(begin, 160, "%Y-%m-%d %H:%M")))
    (doubt,) = merge([recorded], propose([recorded], tank, {}), tank).doubts
    assert "the hour after 2024-10-27 02:45:00 comes twice" in doubt


def test_an_hour_without_samples_on_another_day_stays_a_gap(tmp_path: Path, tank: System) -> None:
    stamps = local(datetime(2024, 6, 1, tzinfo=UTC), 60, "%Y-%m-%d %H:%M")
    del stamps[30:34]
    times = clock(table(tmp_path / "a.csv", stamps), tank).times
    assert times[30] - times[29] == 5 * QUARTER


def test_a_zone_that_is_said_tells_the_hours_of_a_changing_clock(
    tmp_path: Path, tank: System
) -> None:
    begin = datetime(2024, 10, 26, 22, tzinfo=BERLIN)
    path = table(tmp_path / "a.csv", local(begin, 100, "%d.%m.%Y %H:%M"))
    found = clock(path, tank, "Time [DMY Europe/Berlin]")
    assert_allclose(found.times, QUARTER * np.arange(100))
    assert iso(found.start) == "2024-10-26T20:00:00.000000"
    assert found.zoned


@pytest.mark.parametrize(
    ("form", "start"),
    [
        ("%y/%m/%d %H:%M", "2024-03-01"),
        ("%y-%m-%d %H:%M", "2024-03-01"),
        ("%y.%m.%d %H:%M", "2024-03-01"),
        ("%d.%m.%y %H:%M", "2024-03-01"),
        ("%m/%d/%y %I:%M:%S %p", "2024-03-01"),
        ("%d/%m/%Y %H:%M", "2024-03-01"),
        ("%b %d, %Y %H:%M:%S", "2024-03-01"),
        ("%a %b %d %H:%M:%S %Y", "2024-03-01"),
        ("%d-%b-%y %H:%M:%S", "2024-03-01"),
        ("%Y%m%dT%H%M%S", "2024-03-01"),
        ("%Y%m%d%H%M%S", "2024-03-01"),
    ],
)
def test_dates_of_any_order_are_read_as_times_go_on(
    tmp_path: Path, tank: System, form: str, start: str
) -> None:
    path = table(tmp_path / "a.csv", local(datetime(2024, 3, 1, tzinfo=UTC), 300, form))
    found = clock(path, tank)
    assert_allclose(found.times, QUARTER * np.arange(300))
    assert iso(found.start).startswith(start)


def test_days_that_follow_are_not_those_of_several_years(tmp_path: Path, tank: System) -> None:
    """Eight hours a day: no order is even."""
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 300, "%y/%m/%d %H:%M")
    worked = [stamp for stamp in stamps if "08:00" <= stamp[-5:] < "16:00"]
    times = clock(table(tmp_path / "a.csv", worked), tank).times
    assert times[-1] < 4 * 86400.0


def test_dates_that_go_on_in_two_ways_are_asked_for(tmp_path: Path, tank: System) -> None:
    """Twelve firsts of a month, or twelve days in January."""
    path = table(tmp_path / "a.csv", [f"{k:02d}/01/2024" for k in range(1, 13)])
    with pytest.raises(InputError, match=r"in two ways, .*DMY.*MDY.*--column 'time=Time \[YMD\]'"):
        clock(path, tank)
    said = clock(path, tank, "Time [DMY]")
    assert_allclose(said.times, 86400.0 * np.arange(12))
    assert said.stated == "DMY"


def test_how_dates_are_written_is_kept_for_further_files(tmp_path: Path, tank: System) -> None:
    path = table(tmp_path / "a.csv", [f"{k:02d}/01/2024" for k in range(1, 13)])
    proposal = propose([read_recorded_file(path)], tank, {"time": NamedChannel("Time", "MDY")})
    assert proposal.named["time"] == NamedChannel("Time", "MDY")


def test_a_format_that_is_said_reads_what_is_no_date_elsewhere(
    tmp_path: Path, tank: System
) -> None:
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 100, "day %j of %Y, %Hh%M")
    path = table(tmp_path / "a.csv", stamps)
    with pytest.raises(InputError, match=r"texts such as 'day 061 of 2024, 00h00'.*say how they"):
        clock(path, tank)
    found = clock(path, tank, "Time [day %j of %Y, %Hh%M]")
    assert_allclose(found.times, QUARTER * np.arange(100))


@pytest.mark.parametrize(
    ("name", "values", "start"),
    [
        ("Time", [f"{45352 + k / 96:.9f}" for k in range(300)], "2024-03-01T00:00:00"),
        ("timestamp", [f"{1709281000 + 900 * k}" for k in range(300)], "2024-03-01T08:16:40"),
        ("timestamp", [f"{(1709281000 + 900 * k) * 10**3}" for k in range(300)], "2024-03-01"),
        ("timestamp", [f"{(1709281000 + 900 * k) * 10**6}" for k in range(300)], "2024-03-01"),
        ("timestamp", [f"{(1709281000 + 900 * k) * 10**9}" for k in range(300)], "2024-03-01"),
        ("timestamp [ms]", [f"{(1709281000 + 900 * k) * 10**3}" for k in range(300)], "2024-03-01"),
        ("tick [ms]", [f"{(4294000000 + 900000 * k) % 2**32}" for k in range(300)], ""),
        (
            "tick [ms]",
            [f"{(2147000000 + 900000 * k + 2**31) % 2**32 - 2**31}" for k in range(300)],
            "",
        ),
        ("t [s]", [f"{(80000 + 900 * k) % 86400}" for k in range(300)], ""),
    ],
)
def test_counts_are_seconds_from_their_first(
    tmp_path: Path, tank: System, name: str, values: list[str], start: str
) -> None:
    found = clock(table(tmp_path / "a.csv", values, name), tank)
    assert_allclose(found.times - found.times[0], QUARTER * np.arange(300), atol=1e-3)
    assert found.certain
    assert iso(found.start).startswith(start)
    assert bool(start) == bool(iso(found.start))


def test_clocks_that_contradict_each_other_are_refused_with_both(
    tmp_path: Path, tank: System
) -> None:
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 60, "%Y-%m-%d %H:%M")
    rows = [f"{stamp};{900000 * k};1.{k % 7};2{k % 9}" for k, stamp in enumerate(stamps)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Date;Time [s];inflow [l/s];h [mm]", *rows]))
    with pytest.raises(InputError, match=r"'Time' in \[s\] over .*'Date'.* 1000 times apart"):
        clock(path, tank)
    for time in ("Date", "Time [ms]"):
        assert_allclose(clock(path, tank, time).times, QUARTER * np.arange(60))


def test_parts_of_a_second_beside_a_date_are_of_its_time(tmp_path: Path, tank: System) -> None:
    """Every 2.5 s: in whole seconds, steps were 2 s and 3 s."""
    moments = [datetime(2024, 3, 1) + timedelta(seconds=2.5 * k) for k in range(60)]
    rows = [
        f"{k};{m:%Y/%m/%d %H:%M:%S};{m.microsecond // 1000};1.{k % 7};2{k % 9}"
        for k, m in enumerate(moments)
    ]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Number;Date&Time;ms;inflow;h", "NO.;Time;ms;l/s;mm", *rows]))
    assert_allclose(clock(path, tank).times, 2.5 * np.arange(60), atol=1e-9)


def test_nothing_goes_across_a_censored_sample(tmp_path: Path, tank: System) -> None:
    """Neither the inflow before it, which is held, nor a line between its neighbours."""
    path = table(tmp_path / "a.csv", [str(900 * k) for k in range(60)], "time [s]")
    path.write_text(path.read_text().replace("\n27000;1.2;", "\n27000;<0.01;"))
    recorded = read_recorded_file(path)
    measured = merge([recorded], propose([recorded], tank, {}), tank)
    assert measured.time.size == 59
    assert 27000.0 not in measured.time


@pytest.mark.parametrize(
    ("form", "date"),
    [
        ("%Y-%m-%d %H:%M", "2024-06-01T00:00:00.000000"),
        ("%Y-%m-%d %H:%M%z", "2024-05-31T22:00:00.000000Z"),
        ("%H:%M", ""),
    ],
)
def test_a_recording_has_the_date_of_its_first_sample(
    tmp_path: Path, tank: System, form: str, date: str
) -> None:
    path = table(tmp_path / "a.csv", local(datetime(2024, 6, 1, tzinfo=BERLIN), 60, form))
    recorded = read_recorded_file(path)
    proposal = propose([recorded], tank, {})
    assert merge([recorded], proposal, tank).date(0) == date
    found = import_recording("a", ProposedRecording("", (recorded,), proposal), tank, {})
    write(found, tmp_path / "cases", tank)
    (case,) = read_cases([tmp_path / "cases"], tank)
    assert case.date.startswith(date[:19] if not date.endswith("T00:00:00.000000") else date[:10])
    assert bool(case.date) == bool(date)
