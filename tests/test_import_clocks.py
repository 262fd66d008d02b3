"""Times as recorders write them: the right seconds, or a question."""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import openpyxl
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
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

from .edits import edit

QUARTER = 900.0  # s, between samples


@pytest.fixture(scope="module")
def tank(tmp_path_factory) -> System:
    """A tank with an inflow and a level, sampled each quarter of an hour."""
    folder = tmp_path_factory.mktemp("systems") / "tank"
    write_system(folder)
    path = folder / "system.toml"
    edit(path, ('sample_time = "0.5 s"', 'sample_time = "900 s"'))
    return load_system(folder)


def table(path: Path, stamps: Sequence[str], name: str = "Time") -> Path:
    rows = [f"{stamp};1.{i % 7};2{i % 10}" for i, stamp in enumerate(stamps)]
    path.write_text("\n".join([f"{name};inflow [l/s];h [mm]", *rows]))
    return path


def clock(path: Path, system: System, time: str = "") -> Clock:
    columns = dict([parse_named(f"time={time}", "", system.signals)]) if time else {}
    (read_clock,) = propose([read_recorded_file(path)], system, columns).clocks.values()
    return read_clock


def local(begin: datetime, count: int, form: str, step: float = QUARTER) -> list[str]:
    """Times of a clock on a wall, evenly spaced in truth."""
    first = begin.astimezone(UTC)
    moments = (first + timedelta(seconds=step * k) for k in range(count))
    return [moment.astimezone(begin.tzinfo).strftime(form) for moment in moments]


BERLIN_NIGHT = datetime(2024, 3, 1, 23, tzinfo=ZoneInfo("Europe/Berlin"))
BERLIN, NEW_YORK = ZoneInfo("Europe/Berlin"), ZoneInfo("America/New_York")
SYDNEY, LORD_HOWE = ZoneInfo("Australia/Sydney"), ZoneInfo("Australia/Lord_Howe")


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
        (datetime(2024, 10, 24, tzinfo=BERLIN), "%Y-%m-%d %H:%M", 7200.0),
        (datetime(2024, 3, 28, tzinfo=BERLIN), "%Y-%m-%d %H:%M", 7200.0),
        (datetime(2024, 4, 6, tzinfo=LORD_HOWE), "%Y-%m-%d %H:%M", 900.0),
        (datetime(2024, 10, 5, tzinfo=LORD_HOWE), "%d/%m/%Y %H:%M", 900.0),
        (datetime(2024, 4, 4, tzinfo=LORD_HOWE), "%Y-%m-%d %H:%M", 3600.0),
        (datetime(2024, 10, 3, tzinfo=LORD_HOWE), "%Y-%m-%d %H:%M", 3600.0),
        (datetime(2024, 4, 6, tzinfo=LORD_HOWE), "%H:%M:%S", 600.0),
        (datetime(2024, 4, 25, tzinfo=ZoneInfo("Africa/Cairo")), "%Y-%m-%d %H:%M", 900.0),
        (datetime(2024, 3, 30, tzinfo=ZoneInfo("Asia/Beirut")), "%Y-%m-%d %H:%M", 900.0),
    ],
)
def test_local_times_go_on_through_changes_of_the_clock(tmp_path, tank, begin, form, step):
    path = table(tmp_path / "a.csv", local(begin, 160, form, step))
    assert_allclose(clock(path, tank).times, step * np.arange(160))


def test_a_mended_clock_is_told(tmp_path, tank):
    begin = datetime(2024, 10, 26, tzinfo=BERLIN)
    recorded = read_recorded_file(table(tmp_path / "a.csv", local(begin, 160, "%Y-%m-%d %H:%M")))
    (doubt,) = merge([recorded], propose([recorded], tank, {}), tank).doubts
    assert "the hour after 2024-10-27 02:45:00 comes twice" in doubt


@pytest.mark.parametrize(
    ("zone", "begin", "missing"),
    [
        ("Antarctica/Troll", datetime(2024, 3, 30, 12), "120 min are missing after 2024-03-31 00"),
        ("America/Caracas", datetime(2016, 4, 30, 12), "30 min are missing after 2016-05-01 02"),
        ("Asia/Kathmandu", datetime(1985, 12, 31, 12), "15 min are missing after 1985-12-31 23"),
        ("Pacific/Apia", datetime(2011, 12, 29, 12), "1440 min are missing after 2011-12-29 23"),
    ],
)
def test_one_gap_that_a_clock_may_have_made_is_told(tmp_path, tank, zone, begin, missing):
    """Where no summer time begins; the zone, where it is said, closes it."""
    path = table(
        tmp_path / "a.csv", local(begin.replace(tzinfo=ZoneInfo(zone)), 160, "%Y-%m-%d %H:%M")
    )
    (correction,) = clock(path, tank).corrections
    assert missing in correction
    known = clock(path, tank, f"Time [{zone}]")
    assert_allclose(known.times, QUARTER * np.arange(160))
    assert not known.corrections


@pytest.mark.parametrize(
    ("rate", "every", "day"), [(25, 1, ""), (30, 3, ""), (24, 6, "2024-03-05 "), (0, 50, "")]
)
def test_frames_behind_the_last_colon_are_parts_of_a_second(tmp_path, tank, rate, every, day):
    """SMPTE time codes; 0: hundredths, as 00 and 50 are."""
    seconds = [divmod(every * k, rate or 100) for k in range(160)]
    stamps = [f"{day}00:{s // 60:02d}:{s % 60:02d}:{part:02d}" for s, part in seconds]
    read = clock(table(tmp_path / "a.csv", stamps), tank)
    assert_allclose(read.times, every / (rate or 100) * np.arange(160), atol=1e-9)
    assert [f"{rate} in a second" in text for text in read.corrections] == [True] * bool(rate)


@pytest.mark.parametrize("count", [30, 150])
def test_seconds_behind_days_hours_and_minutes_are_no_frames_in_silence(tmp_path, tank, count):
    """0:00:15:59 may be a second before 0:00:16:00, or a sixtieth of one."""
    stamps = [f"0:00:{15 + k // 60}:{k % 60:02d}" for k in range(count)]
    with pytest.raises(InputError, match=r"'0:00:15:00', whose last part may be of a second"):
        clock(table(tmp_path / "a.csv", stamps), tank)


def test_hours_that_count_to_24_end_a_day(tmp_path):
    """As weather services write them, with days in figures."""
    write_system(tmp_path / "tank")
    tank = load_system(tmp_path / "tank")
    moments = [datetime(2024, 3, 1) + timedelta(hours=k) for k in range(80)]
    stamps = [f"{moment:%Y%m%d};{moment.hour + 1}" for moment in moments]
    read_clock = clock(table(tmp_path / "a.csv", stamps, "YYYYMMDD;HH"), tank)
    assert_allclose(read_clock.times, 3600.0 * np.arange(80))


@pytest.mark.parametrize("day", ["14/3/2569", "1404/12/23"])
def test_a_year_of_another_calendar_is_no_date(tmp_path, tank, day):
    """Of Bangkok, and of Tehran."""
    begin = datetime(2024, 3, 5, tzinfo=UTC)
    stamps = [f"{day} {stamp}" for stamp in local(begin, 60, "%H:%M:%S")]
    read_clock = clock(table(tmp_path / "a.csv", stamps), tank)
    assert_allclose(read_clock.times, QUARTER * np.arange(60))
    assert np.isnan(read_clock.start)
    assert "a year of another calendar" in read_clock.corrections[0]


def test_a_date_that_stands_once_is_that_of_the_rows_below(tmp_path, tank):
    begin = datetime(2024, 3, 5, tzinfo=UTC)
    moments = zip(*(local(begin, 200, form) for form in ("%d.%m.%y", "%H:%M")), strict=True)
    stamps = [f"{day if time == '00:00' else ''};{time}" for day, time in moments]
    read_clock = clock(table(tmp_path / "a.csv", stamps, "Datum;Zeit"), tank)
    assert_allclose(read_clock.times, QUARTER * np.arange(200))
    assert iso(read_clock.start)[:10] == "2024-03-05"


def test_an_hour_without_samples_on_another_day_stays_a_gap(tmp_path, tank):
    stamps = local(datetime(2024, 6, 1, tzinfo=UTC), 60, "%Y-%m-%d %H:%M")
    del stamps[30:34]
    times = clock(table(tmp_path / "a.csv", stamps), tank).times
    assert times[30] - times[29] == 5 * QUARTER


@pytest.mark.parametrize(
    ("header", "zone"), [("Time", "Time [DMY Europe/Berlin]"), ("Time [Europe/Berlin]", "")]
)
def test_a_zone_that_is_said_tells_the_hours_of_a_changing_clock(tmp_path, tank, header, zone):
    begin = datetime(2024, 10, 26, 22, tzinfo=BERLIN)
    path = table(tmp_path / "a.csv", local(begin, 100, "%d.%m.%Y %H:%M"), header)
    read_clock = clock(path, tank, zone)
    assert_allclose(read_clock.times, QUARTER * np.arange(100))
    assert iso(read_clock.start) == "2024-10-26T20:00:00.000000"
    assert read_clock.zoned


@pytest.mark.parametrize(
    "header",
    ["Time [UTC+2]", "Time (UTC+2)", "Zeit (GMT+02:00)", "Time (Europe/Berlin)", "Time [UTC+02]"],
)
def test_a_zone_in_brackets_tells_when_a_recording_began(tmp_path, tank, header):
    stamps = local(datetime(2024, 6, 1, 22, tzinfo=BERLIN), 60, "%Y-%m-%d %H:%M")
    read_clock = clock(table(tmp_path / "a.csv", stamps, header), tank)
    assert iso(read_clock.start) == "2024-06-01T20:00:00.000000"
    assert read_clock.zoned


FORMS = [
    *("%y/%m/%d %H:%M", "%y-%m-%d %H:%M", "%y.%m.%d %H:%M", "%d.%m.%y %H:%M", "%d/%m/%Y %H:%M"),
    *("%m/%d/%y %I:%M:%S %p", "%b %d, %Y %H:%M:%S", "%a %b %d %H:%M:%S %Y", "%d-%b-%y %H:%M:%S"),
    *("%Y%m%dT%H%M%S", "%Y%m%d%H%M%S", "%y%m%d %H%M%S", "%Y %m %d %H:%M:%S", "%Y:%m:%d %H:%M:%S"),
    *("%Y/%m/%d-%H:%M:%S", "%Y-%m-%d_%H-%M-%S", "%d.%m.%Y %H.%M.%S", "%d.%m.%Y, %H:%M:%S Uhr"),
    *("%d/%b/%Y:%H:%M:%S", "%m/%d/%Y %p %I:%M:%S", "%a %d.%m.%Y %H:%M", "%Y-%jT%H:%M:%S"),
    *("%a, %d %b %Y %H:%M:%S GMT", "%Y-%m-%dT%H:%M:%S+00:00[Europe/London]"),
    *("%Y-%m-%d %H:%M:%S IST", "DT#%Y-%m-%d-%H:%M:%S"),
    *("%Y%m%d%H%M%S000", "%a %b %d %H:%M:%S UTC %Y", "%m/%d/%y %I:%M:%S{half}"),
    *("%d/%m/%Y %I:%M:%S {half}. m.", "%d de %B de %Y %H:%M:%S", "%d. %B %Y um %H:%M:%S"),
    *("%Y年%m月%d日 %H:%M:%S", "%Y年%m月%d日 {half_of_day}午%I:%M:%S", "%Y年%m月%d日%H时%M分%S秒"),
    *("%Y. %m. %d. %H:%M:%S", "%Y/%m/%d %I:%M:%S {half_of_day}午", "%H:%M:%S.000 %d/%m/%Y"),
    *("%a %b %d %Y %H:%M:%S GMT+0000 (Coordinated Universal Time)",),
]


@pytest.mark.parametrize("form", FORMS)
def test_dates_of_any_order_are_read_as_times_go_on(tmp_path, tank, form):
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 300, form)
    stamps = [
        stamp.format(half="ap"[k // 48 % 2], half_of_day="上下"[k // 48 % 2])
        for k, stamp in enumerate(stamps)
    ]
    read_clock = clock(table(tmp_path / "a.csv", stamps), tank)
    assert_allclose(read_clock.times, QUARTER * np.arange(300))
    assert iso(read_clock.start).startswith("2024-03-01")


@pytest.mark.parametrize(
    ("form", "utc"),
    [
        ("%a %b %d %Y %H:%M:%S GMT+0100 (CET)", "2026-11-29T23:00:00"),
        ("%Y-%m-%d %H:%M:%S UTC+05:30", "2026-11-29T18:30:00"),
        ("%Y-%m-%d %H:%M:%S (UTC-03:30)", "2026-11-30T03:30:00"),
    ],
)
def test_an_offset_behind_each_date_tells_when_a_recording_began(tmp_path, tank, form, utc):
    stamps = local(datetime(2026, 11, 30, tzinfo=UTC), 60, form)
    read_clock = clock(table(tmp_path / "a.csv", stamps), tank)
    assert_allclose(read_clock.times, QUARTER * np.arange(60))
    assert iso(read_clock.start).startswith(utc)
    assert read_clock.zoned


@pytest.mark.parametrize("encoding", ["gb18030", "shift_jis", "utf-8", "big5"])
def test_dates_of_china_are_read_in_its_encodings(tmp_path, tank, encoding):
    stamps = local(datetime(2026, 11, 30, tzinfo=UTC), 60, "%Y年%m月%d日 %H:%M:%S")
    path = table(tmp_path / "a.csv", stamps)
    path.write_bytes(path.read_text().encode(encoding))
    assert iso(clock(path, tank).start).startswith("2026-11-30T00:00:00")


@pytest.mark.parametrize("name", ["year", "decimal_year", "Date", "Time"])
def test_years_with_decimals_are_asked_about(tmp_path, tank, name):
    """Of hours; as days or hours they would be 365 or 8766 times as far apart as they were."""
    stamps = [f"{2026.912 + k / 8766:.8f}" for k in range(60)]
    with pytest.raises(InputError, match=rf"'{name}' from 2026.912000 on, .*years.*export dates"):
        clock(table(tmp_path / "a.csv", stamps, name), tank)


@pytest.mark.parametrize(
    ("names", "unit"),
    [("Time - h;Amplitude - h", 1.0), ("Time_h;h", 1.0), ("Time_h;level", 3600.0)],
)
def test_the_name_of_a_signal_behind_that_of_its_times_is_no_unit(tmp_path, names, unit):
    """Seconds beside a signal h were taken for hours."""
    write_system(tmp_path / "tank")
    tank = load_system(tmp_path / "tank")
    rows = [f"{0.5 * k / unit:.9f};9{k % 10};1.{k % 7}" for k in range(60)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"{names};inflow [l/s]", *rows]))
    level = names.partition(";")[2]
    (read_clock,) = propose(
        [read_recorded_file(path)], tank, dict([parse_named(f"h={level} [cm]", "", tank.signals)])
    ).clocks.values()
    assert_allclose(read_clock.times, 0.5 * np.arange(60), atol=1e-4)


@pytest.mark.parametrize(
    ("names", "form"),
    [
        ("Year;Month;Day;Hour;Minute;Second", "%Y;%m;%d;%H;%M;%S"),
        ("YY;MM;DD;hh;mm;ss", "%Y;%m;%d;%H;%M;%S"),
        ("Datum;Sekunde", "%d.%m.%Y %H:%M;%S"),
        ("Year;DOY;HHMM", "%Y;%j;%H%M"),
        ("Date;Time", "%Y%m%d;%H%M%S"),
        ("Date;Time", "%m/%d/%Y;%I:%M:%S %p"),
        ("Time;Date", "%H:%M;%d/%m/%y"),
    ],
)
def test_dates_and_times_stand_in_columns_of_their_own(tmp_path, tank, names, form):
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 300, form)
    read_clock = clock(table(tmp_path / "a.csv", stamps, names), tank)
    assert_allclose(read_clock.times, QUARTER * np.arange(300))
    assert iso(read_clock.start).startswith("2024-03-01")


@pytest.mark.parametrize("form", ["%G-W%V-%uT%H:%M", "%GW%V%uT%H%M00", "%G-W%V-%u %H:%M:%S"])
def test_days_may_be_those_of_weeks(tmp_path, tank, form):
    moments = [datetime(2026, 11, 28, 20) + timedelta(seconds=QUARTER * k) for k in range(40)]
    week = [moment.strftime(form) for moment in moments]
    read = clock(table(tmp_path / "a.csv", week), tank)
    assert_allclose(read.times, QUARTER * np.arange(40))
    assert iso(read.start) == "2026-11-28T20:00:00.000000"


@pytest.mark.parametrize(
    "form", ["{d} days {h:02d}:{m:02d}:00", "{d}.{h:02d}:{m:02d}:00", "P{d}DT{h}H{m}M"]
)
def test_durations_of_days_go_on(tmp_path, tank, form):
    stamps = [form.format(d=k // 96, h=k // 4 % 24, m=15 * (k % 4)) for k in range(300)]
    assert_allclose(clock(table(tmp_path / "a.csv", stamps), tank).times, QUARTER * np.arange(300))


def test_two_figures_are_minutes_and_seconds_if_that_is_nearer_to_usual_steps(tmp_path):
    """5 s apart as minutes and seconds, 300 s as hours and minutes; asked, and kept."""
    write_system(tmp_path / "tank")
    tank = load_system(tmp_path / "tank")  # a sample each 0.5 s
    stamps = [f"{k // 12 % 60:02d}:{5 * (k % 12):02d}" for k in range(1000)]
    path = table(tmp_path / "a.csv", stamps)
    read_clock = clock(path, tank)
    assert_allclose(read_clock.times, 5.0 * np.arange(1000))
    assert not read_clock.certain
    stated = clock(path, tank, "Time [min:s]")
    assert_allclose(stated.times, read_clock.times)
    assert (stated.certain, stated.stated) == (True, "min:s")


def test_hours_to_12_go_on_from_12_to_1(tmp_path, tank):
    """As times of day they are told; beside dates half days are not known, and asked for."""
    begin = datetime(2024, 3, 5, tzinfo=UTC)
    read_clock = clock(table(tmp_path / "a.csv", local(begin, 200, "%I:%M:%S")), tank)
    assert_allclose(read_clock.times, QUARTER * np.arange(200))
    assert "hours count to 12" in read_clock.reason
    dated = table(tmp_path / "b.csv", local(begin, 200, "%Y-%m-%d %I:%M:%S"))
    with pytest.raises(InputError, match=r"12 without AM or PM.*export them to 24"):
        clock(dated, tank)


@pytest.mark.parametrize(
    ("count", "words", "padded"),
    [
        (lambda k: 50 * k % 1000, "milliseconds", False),  # .50 beside .100
        (lambda k: 7 + 4 * k, "milliseconds", False),  # a loop that is late by 4 ms each time
        (lambda k: 125 * k % 1000, "", True),  # without zeros behind them
        (lambda k: 250 + 37 * k % 500, "", True),
    ],
)
def test_parts_of_a_second_may_be_counts(tmp_path, tank, count, words, padded):
    parts = [
        f".{count(k):03d}".rstrip("0").rstrip(".") if padded else f".{count(k)}" for k in range(200)
    ]
    begin = datetime(2024, 3, 5, tzinfo=UTC)
    stamps = map("".join, zip(local(begin, 200, "%H:%M:%S"), parts, strict=True))
    read_clock = clock(table(tmp_path / "a.csv", list(stamps)), tank)
    expected = QUARTER * np.arange(200) + [count(k) / 1e3 for k in range(200)]
    assert_allclose(read_clock.times, expected - expected[0], atol=1e-6)
    assert words in read_clock.reason


def jitter(seed: int, count: int) -> list[int]:
    """Milliseconds of a clock that is late by chance."""
    return np.random.default_rng(seed).integers(0, 1000, count).tolist()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [60, 200])
@pytest.mark.parametrize("form", ["counts", "decimals"])
def test_parts_of_a_second_of_an_uneven_clock_are_what_their_zeros_tell(
    tmp_path, tank, seed, count, form
):
    parts = jitter(seed, count)
    texts = [f".{k}" if form == "counts" else f".{k:03d}".rstrip("0").rstrip(".") for k in parts]
    begin = datetime(2024, 3, 5, tzinfo=UTC)
    stamps = map("".join, zip(local(begin, count, "%Y-%m-%d %H:%M:%S"), texts, strict=True))
    path = table(tmp_path / "a.csv", list(stamps))
    expected = QUARTER * np.arange(count) + np.array(parts) / 1e3
    read_clock = clock(path, tank)
    assert_allclose(read_clock.times, expected - expected[0], atol=1e-6)


def test_parts_of_a_second_that_nothing_tells_are_decimals_where_that_is_said(tmp_path, tank):
    begin = datetime(2024, 3, 5, tzinfo=UTC)
    parts = [5, 71, 123, 9, 212, 34, 611, 3]
    stamps = [f"{stamp}.{k}" for stamp, k in zip(local(begin, 8, "%H:%M:%S"), parts, strict=True)]
    path = table(tmp_path / "a.csv", stamps)
    with pytest.raises(InputError, match=r"parts of a second such as \.5 and \.123"):
        clock(path, tank)
    times = clock(path, tank, "Time [%H:%M:%S.%f]").times
    assert_allclose(times[:2], [0.0, QUARTER + 0.21], atol=1e-6)


@pytest.mark.parametrize(
    ("unit", "digits", "step"),
    [("min", 2, 1.0), ("min", 2, 2.5), ("h", 4, 1.0), ("s", 1, 0.75), ("s", 0, 1.4)],
)
def test_even_times_in_few_digits_are_even(tmp_path, unit, digits, step):
    """0.00, 0.02, 0.03, 0.05 min are seconds."""
    write_system(tmp_path / "tank")
    tank = load_system(tmp_path / "tank")
    size = {"min": 60.0, "h": 3600.0, "s": 1.0}[unit]
    stamps = [f"{k * step / size:.{digits}f}" for k in range(200)]
    read_clock = clock(table(tmp_path / "a.csv", stamps, f"Time [{unit}]"), tank)
    assert_allclose(read_clock.times - read_clock.times[0], step * np.arange(200.0), atol=1e-9)
    assert f"taken as even, every {step:g} s" in read_clock.corrections[0]


def test_samples_that_were_lost_are_no_digits_of_times(tmp_path):
    write_system(tmp_path / "tank")
    tank = load_system(tmp_path / "tank")
    places = [k for k in range(200) if k not in (50, 90, 91)]
    read_clock = clock(table(tmp_path / "a.csv", [f"{k}" for k in places], "Time [s]"), tank)
    assert_allclose(read_clock.times, places)
    assert not read_clock.corrections


def test_seconds_since_1900_are_of_ntp_where_those_of_labview_were_of_tomorrow(tmp_path):
    write_system(tmp_path / "tank")
    tank = load_system(tmp_path / "tank")
    now = datetime.now(UTC).replace(microsecond=0) - timedelta(days=2)
    seconds = [(now - datetime(1900, 1, 1, tzinfo=UTC)).total_seconds() + k for k in range(60)]
    path = table(tmp_path / "a.csv", [f"{second:.1f}" for second in seconds], "timestamp")
    assert iso(clock(path, tank).start)[:10] == f"{now:%Y-%m-%d}"
    past = [second - 1460 * 86400.0 for second in seconds]  # of NTP, or of LabVIEW now
    path = table(tmp_path / "b.csv", [f"{second:.1f}" for second in past], "timestamp")
    assert iso(clock(path, tank).start)[:10] == f"{now:%Y-%m-%d}"
    other = f"{now - timedelta(days=1460):%Y-%m-%d}"
    assert f"NTP, from 1900, means {other}" in clock(path, tank).corrections[0]
    path = table(tmp_path / "c.csv", [f"{second:.1f}" for second in past], "ntp time")
    assert iso(clock(path, tank).start)[:10] == other


def test_parts_of_a_second_before_the_year_count(tmp_path, tank):
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 60, "%a %b %d %H:%M:%S.250 %Y")
    stamps[1::2] = [stamp.replace(".250", ".750") for stamp in stamps[1::2]]
    read_clock = clock(table(tmp_path / "a.csv", stamps), tank)
    assert_allclose(read_clock.times, QUARTER * np.arange(60) + 0.5 * (np.arange(60) % 2))


def test_times_go_on_behind_a_leap_second(tmp_path, tank):
    """That of 2016, in UTC: the minute has 61 seconds."""
    stamps = [f"2016-12-31T23:59:{k:02d}Z" for k in range(61)]
    stamps += [f"2017-01-01T00:00:{k:02d}Z" for k in range(60)]
    read_clock = clock(table(tmp_path / "a.csv", stamps), tank)
    assert_allclose(read_clock.times, np.arange(121))
    assert "a leap second" in read_clock.corrections[0]
    rounded = [f"2024-03-01 10:{k:02d}:60" for k in range(59)]  # by a logger that rounds
    assert_allclose(clock(table(tmp_path / "b.csv", rounded), tank).times, 60.0 * np.arange(59))


def test_two_digits_of_a_year_go_on_from_99_to_00(tmp_path, tank):
    stamps = local(datetime(1999, 12, 31, 20, tzinfo=UTC), 60, "%d.%m.%y %H:%M")
    assert_allclose(clock(table(tmp_path / "a.csv", stamps), tank).times, QUARTER * np.arange(60))


@pytest.mark.parametrize("form", ["{}00:{:02d}:{:02d}.5", "{}{:02d}:{:02d}.5"])
def test_times_before_a_trigger_are_below_zero(tmp_path, tank, form):
    seconds = [30.0 * (k - 20) for k in range(60)]
    parts = [("-" if s < 0 else "", *divmod(int(abs(s)), 60)) for s in seconds]
    read = clock(table(tmp_path / "a.csv", [form.format(*part) for part in parts]), tank)
    expected = [s + np.copysign(0.5, s) for s in seconds]
    assert_allclose(read.times, np.array(expected) - expected[0])
    assert read.corrections == ()


@pytest.mark.parametrize("lost", ["n/a", "10:0x:00", ""])
@pytest.mark.parametrize("first", [0, 20])
def test_samples_without_a_time_are_told(tmp_path, tank, lost, first):
    """They were left out without a word: a third of a recording, if its clock starts late."""
    stamps = local(datetime(2024, 3, 5, 10, tzinfo=UTC), 60, "%d.%m.%Y %H:%M")
    stamps[first : first + 20] = [lost] * 20
    read = clock(table(tmp_path / "a.csv", stamps), tank)
    note = f"20 samples without a time are left out, the first is sample {first + 1}"
    assert read.corrections[-1] == note


def test_rows_that_were_mixed_are_to_be_sorted(tmp_path, tank):
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 60, "%Y-%m-%d %H:%M")
    stamps[30:32] = stamps[31:29:-1]
    with pytest.raises(InputError, match=r"-?\d+ s after \d+ s in sample 32.*sort the rows"):
        clock(table(tmp_path / "a.csv", stamps), tank)


def test_an_hour_that_may_be_missing_is_told(tmp_path, tank):
    """Without a date, and where samples are not even."""
    begin = datetime(2024, 3, 30, tzinfo=BERLIN)
    (word,) = clock(table(tmp_path / "a.csv", local(begin, 160, "%H:%M:%S")), tank).corrections
    assert "an hour is missing after 01:45:00: a gap, or summer time begins" in word
    dated = local(begin, 160, "%Y-%m-%d %H:%M")
    seconds = [f"{stamp}:{13 * k % 37:02d}" for k, stamp in enumerate(dated)]
    del seconds[103]  # beside the change at 02:00
    (word,) = clock(table(tmp_path / "b.csv", seconds), tank).corrections
    assert "an hour may be missing after 2024-03-31 01:" in word


def test_days_that_follow_are_not_those_of_several_years(tmp_path, tank):
    """Eight hours a day: no order is even."""
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 300, "%y/%m/%d %H:%M")
    worked = [stamp for stamp in stamps if "08:00" <= stamp[-5:] < "16:00"]
    assert clock(table(tmp_path / "a.csv", worked), tank).times[-1] < 4 * 86400.0


def test_dates_that_go_on_in_two_ways_are_asked_for(tmp_path, tank):
    """Twelve firsts of a month, or twelve days in January."""
    path = table(tmp_path / "a.csv", [f"{k:02d}/01/2024" for k in range(1, 13)])
    with pytest.raises(InputError, match=r"in two ways, .*DMY.*MDY.*--column 'time=Time \[YMD\]'"):
        clock(path, tank)
    stated = clock(path, tank, "Time [DMY]")
    assert_allclose(stated.times, 86400.0 * np.arange(12))
    assert stated.stated == "DMY"
    # And how they are written is kept for further files.
    proposal = propose([read_recorded_file(path)], tank, {"time": NamedChannel("Time", "MDY")})
    assert proposal.named["time"] == NamedChannel("Time", "MDY")


def test_a_format_that_is_said_reads_what_is_no_date_elsewhere(tmp_path, tank):
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 100, "day %j of %Y, %Hh%M")
    path = table(tmp_path / "a.csv", stamps)
    with pytest.raises(InputError, match=r"texts such as 'day 061 of 2024, 00h00'.*say how they"):
        clock(path, tank)
    read_clock = clock(path, tank, "Time [day %j of %Y, %Hh%M]")
    assert_allclose(read_clock.times, QUARTER * np.arange(100))


def every(form: Callable[[int], object]) -> list[str]:
    """Counts of a clock, one each quarter of an hour, as texts."""
    return [f"{form(k)}" for k in range(300)]


UNIX = 1709281000  # s, of 2024-03-01T08:16:40


@pytest.mark.parametrize(
    ("name", "values", "start"),
    [
        ("Time", every(lambda k: f"{45352 + k / 96:.9f}"), "2024-03-01T00:00:00"),
        ("timestamp", every(lambda k: UNIX + 900 * k), "2024-03-01T08:16:40"),
        ("timestamp", every(lambda k: (UNIX + 900 * k) * 10**3), "2024-03-01"),
        ("timestamp", every(lambda k: (UNIX + 900 * k) * 10**6), "2024-03-01"),
        ("timestamp", every(lambda k: (UNIX + 900 * k) * 10**9), "2024-03-01"),
        ("timestamp [ms]", every(lambda k: (UNIX + 900 * k) * 10**3), "2024-03-01"),
        ("tick [ms]", every(lambda k: (4294000000 + 900000 * k) % 2**32), ""),
        ("tick [ms]", every(lambda k: (2147000000 + 900000 * k + 2**31) % 2**32 - 2**31), ""),
        ("t [s]", every(lambda k: (80000 + 900 * k) % 86400), ""),
        ("elapsed_ms", every(lambda k: 900000 * k), ""),
        ("t [h]", every(lambda k: (80000 + 900 * k) % 86400 / 3600), ""),
        ("t [min]", every(lambda k: 900 * k % 3600 / 60), ""),
        ("t [1/10 s]", every(lambda k: 9000 * k), ""),
        ("t (0.1 s)", every(lambda k: 9000 * k), ""),
        ("t (10 ms)", every(lambda k: 90000 * k), ""),
        ("t [100us]", every(lambda k: 9000000 * k), ""),
        ("t [10^-3 s]", every(lambda k: 900000 * k), ""),
        ("tick [ms]", every(lambda k: (900000 * k) % 2**24), ""),
        ("Time [d]", every(lambda k: f"{45352 + k / 96:.9f}"), "2024-03-01"),
        ("Julian date", every(lambda k: f"{2460370.5 + k / 96:.8f}"), "2024-03-01"),
        ("MJD", every(lambda k: f"{60370 + k / 96:.8f}"), "2024-03-01"),
        ("datenum", every(lambda k: f"{739312 + k / 96:.8f}"), "2024-03-01"),
        ("DOY", every(lambda k: f"{61 + k / 96:.8f}"), ""),
        ("Time", every(lambda k: 3792125800 + 900 * k), "2024-03-01T08:16:40"),
        ("Time", every(lambda k: 133537546000000000 + 9 * 10**9 * k), "2024-03-01"),
        ("ticks", every(lambda k: 638448778000000000 + 9 * 10**9 * k), "2024-03-01"),
        ("Time_ms", every(lambda k: f"{45352e6 + k / 96e-6:.3f}"), "2024-03-01"),  # of WinCC
        ("GPS time", every(lambda k: 1393316218 + 900 * k), "2024-03-01T08:16:40"),
        ("gps_time_us", every(lambda k: (1393316218 + 900 * k) * 10**6), "2024-03-01T08:16:40"),
        ("Time", local(datetime(2024, 3, 1, tzinfo=UTC), 300, "%H%M"), ""),
        ("Time", local(datetime(2024, 3, 1, tzinfo=UTC), 300, "%H%M%S"), ""),
        ("Time", local(datetime(2024, 3, 1, tzinfo=UTC), 300, "%y%m%d%H%M%S"), "2024-03-01"),
        ("Time", local(datetime(2024, 3, 1, tzinfo=UTC), 300, "%Y%m%d%H%M"), "2024-03-01"),
    ],
)
def test_counts_are_seconds_from_their_first(tmp_path, tank, name, values, start):
    read_clock = clock(table(tmp_path / "a.csv", values, name), tank)
    assert_allclose(read_clock.times - read_clock.times[0], QUARTER * np.arange(300), atol=1e-3)
    assert read_clock.certain
    assert iso(read_clock.start).startswith(start)
    assert bool(start) == bool(iso(read_clock.start))


@pytest.mark.parametrize("times", [1, 2])
def test_a_count_that_begins_anew_is_of_another_recording(tmp_path, tank, times):
    """An hour of samples may follow itself; a counter of an hour seldom begins at its zero."""
    path = table(tmp_path / "a.csv", [f"{900 * k % 3600}" for k in range(4 + 4 * times)], "t [s]")
    with pytest.raises(InputError, match=r"in sample 5.*times begin anew"):
        clock(path, tank)


def test_days_that_may_count_from_1904_are_told(tmp_path, tank):
    (correction,) = clock(
        table(tmp_path / "a.csv", every(lambda k: f"{43890 + k / 96:.9f}")), tank
    ).corrections
    assert "2020-02-29; a workbook that counts from 1904 means 2024-03-01" in correction


def test_clocks_that_contradict_each_other_are_refused_with_both(tmp_path, tank):
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 60, "%Y-%m-%d %H:%M")
    rows = [f"{stamp};{900000 * k};1.{k % 7};2{k % 9}" for k, stamp in enumerate(stamps)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Date;Time [s];inflow [l/s];h [mm]", *rows]))
    with pytest.raises(InputError, match=r"'Time' in \[s\] over .*'Date'.* 1000 times apart"):
        clock(path, tank)
    for time in ("Date", "Time [ms]"):
        assert_allclose(clock(path, tank, time).times, QUARTER * np.arange(60))


@pytest.mark.parametrize(("faster", "told"), [(1.2, True), (1.002, False)])
def test_clocks_that_differ_by_more_than_a_drift_are_told(tmp_path, tank, faster, told):
    """Seconds beside stamps that say the same recording is a fifth shorter."""
    stamps = local(datetime(2024, 3, 1, tzinfo=UTC), 60, "%Y-%m-%d %H:%M")
    rows = [f"{stamp};{900 * faster * k:.0f};1.{k % 7};2{k % 9}" for k, stamp in enumerate(stamps)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Date;Time [s];inflow [l/s];h [mm]", *rows]))
    words = "'Time' in [s] over 63720 s, and 'Date' in [s] over 53100 s; 'Time' is taken, "
    words += "--column 'time=Date' takes the other"
    assert list(clock(path, tank).corrections) == [words] * told
    assert not clock(path, tank, "Date").corrections


def test_a_stated_rate_that_times_contradict_is_told(tmp_path, tank):
    """Times in ms that count as s are refused; a recorder may scan more often than it writes."""
    plain = table(tmp_path / "a.csv", [str(900 * k) for k in range(60)], "Time [s]").read_text()
    path = tmp_path / "b.csv"
    path.write_text(f"Sample rate: 1.111111 Hz\n{plain}")
    with pytest.raises(InputError, match=r"times every 900 s, and the file states .* 0.9 s, 1000"):
        clock(path, tank)
    assert_allclose(clock(path, tank, "Time [ms]").times[1], 0.9)
    path.write_text(f"Sample rate: 10 Hz\n{plain}")
    correction = clock(path, tank).corrections[0]
    assert "every 900 s, and the file states a sample every 0.1 s" in correction


def test_stamps_coarser_than_samples_tell_the_rate(tmp_path, tank):
    path = table(tmp_path / "a.csv", local(datetime(2024, 3, 5, tzinfo=UTC), 300, "%H:%M", 10.0))
    with pytest.raises(InputError, match=r"coarser than samples.*--sample-rate '0.1 Hz'"):
        clock(path, tank)


def rows_at_events(path: Path, rows: Sequence[tuple[float, float | str, float | str]]) -> Path:
    lines = [f"{time},{inflow},{level}" for time, inflow, level in rows]
    path.write_text("\n".join(["time [s],inflow [l/s],h [mm]", *lines]))
    return path


def test_of_rows_of_one_time_the_last_values_are_kept(tmp_path, tank):
    """As simulations write events: the level, which moves elsewhere, is the same in both rows."""
    steps = [(QUARTER * k, 1.0 + (k > 30), 20.0 + 0.01 * k**2) for k in range(60)]
    event = [(27450.0, 1.0, 29.3), (27450.0, 2.0, 29.3)]
    recorded = read_recorded_file(rows_at_events(tmp_path / "a.csv", sorted([*steps, *event])))
    proposed = propose([recorded], tank, {})
    (own,) = proposed.clocks.values()
    assert "1 rows have the time of the row before" in own.reason
    held = merge([recorded], proposed, tank)
    assert held.time.size == 61
    assert held.signals["inflow"][held.time == 27450.0] == pytest.approx(2e-3)
    assert not held.doubts  # the inflow stays as it is set; a line to its jump would be told
    write_system(tmp_path / "tank")
    other = ('sample_time = "0.5 s"', 'sample_time = "900 s"'), ("held = true", "held = false")
    edit(tmp_path / "tank" / "system.toml", *other)
    line = load_system(tmp_path / "tank")
    (told,) = merge([recorded], propose([recorded], line, {}), line).doubts
    assert "inflow: it jumps between rows of one time" in told


def test_rows_of_one_time_that_hold_other_channels_are_all_read(tmp_path, tank):
    often = [(QUARTER * k, 1.0 + k % 3, "") for k in range(60)]
    seldom = [(QUARTER * k, "", 20.0 + k) for k in range(0, 60, 2)]
    rows = sorted([*often, *seldom], key=lambda row: row[0])
    recorded = read_recorded_file(rows_at_events(tmp_path / "a.csv", rows))
    held = merge([recorded], propose([recorded], tank, {}), tank)
    assert_allclose(held.signals["inflow"], 1e-3 * (1.0 + np.arange(0, 60, 2) % 3))
    assert_allclose(held.signals["h"], 1e-3 * (20.0 + np.arange(0, 60, 2)))


def test_channels_of_one_time_may_each_have_a_row(tmp_path, tank, capsys):
    lines = [
        line
        for k in range(60)
        for line in (f"{900 * k};1.{k % 7};;", f"{900 * k};;{20 + k};", f"{900 * k};;;21.5")
    ]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["time [s];inflow [l/s];h [mm];T [degC]", *lines]))
    recorded = read_recorded_file(path)
    held = merge([recorded], propose([recorded], tank, {}), tank)
    assert_allclose(held.time, QUARTER * np.arange(60))
    assert_allclose(held.signals["h"], 1e-3 * (20.0 + np.arange(60)))
    taken = ["--system", str(tank.source), "--out", str(tmp_path / "out"), "--yes"]
    assert main(["import", str(path), *taken]) == 0
    assert "180 samples, every 900 s" in capsys.readouterr().out


def test_minutes_of_samples_each_second_are_too_coarse(tmp_path, tank):
    """Two stamps show no rate of a signal: it is no clock, and its samples are not one."""
    path = table(tmp_path / "a.csv", [f"10:{15 + k // 40}" for k in range(80)])
    with pytest.raises(InputError, match="stamps are coarser than samples"):
        clock(path, tank)


def test_a_row_of_the_time_before_in_which_all_moves_is_refused(tmp_path, tank):
    rows = [(QUARTER * min(k, 40), 1.0 + k % 7, 20.0 + k) for k in range(42)]
    with pytest.raises(InputError, match="36000 s after 36000 s in sample 42"):
        clock(rows_at_events(tmp_path / "a.csv", rows), tank)


COUNTED = [str(900 * k) for k in range(60)]


@pytest.mark.parametrize(
    ("head", "name", "stamps", "date"),
    [
        ("Start time: 2024-03-05 10:00:00", "t [s]", COUNTED, "2024-03-05T10:00:00"),
        ("Startzeit;05.03.2024 10:00:00", "t [s]", COUNTED, "2024-03-05T10:00:00"),
        ("Date;2024/03/05\nTime;10:00:00", "t [s]", COUNTED, "2024-03-05T10:00:00"),
        ("Date: 05.03.2024\nTime: 10:00:00", "t [s]", COUNTED, "2024-03-05T10:00:00"),
        ("Date: 05.03.2024", "t", [f"10:{k:02d}:00" for k in range(60)], "2024-03-05T10:00:00"),
        ("Calibrated: 05.03.2024 10:00:00", "t [s]", COUNTED, ""),
        (f"Date;2024/03/05\nTime;10:00:00.{0:019d}", "t [s]", COUNTED, "2024-03-05T10:00:00"),
    ],
)
def test_a_preamble_tells_the_date_of_a_recording(tmp_path, tank, head, name, stamps, date):
    path = table(tmp_path / "a.csv", stamps, name)
    path.write_text(f"{head}\n\n" + path.read_text())
    recorded = read_recorded_file(path)
    assert merge([recorded], propose([recorded], tank, {}), tank).date(0)[:19] == date


@pytest.mark.parametrize(
    ("names", "form", "part"),
    [
        ("Date&Time;ms", "%Y/%m/%d %H:%M:%S", 1e3),
        ("Date;Time;ms", "%d.%m.%Y;%H:%M:%S", 1e3),
        ("Time;Time ms", "%m/%d/%Y %I:%M:%S %p", 1e3),
        ("Time;[ms]", "%Y-%m-%d %H:%M:%S", 1e3),
        ("Timestamp;Time [ms]", "%Y-%m-%d %H:%M:%S", 1e3),
        ("Time;fraction [s]", "%Y-%m-%d %H:%M:%S", 1.0),
        ("sec;nanosec", "%s", 1e9),
        ("header.stamp.secs;header.stamp.nsecs", "%s", 1e9),
        ("tv_sec;tv_usec", "%s", 1e6),
    ],
)
def test_parts_of_a_second_beside_a_time_are_of_it(tmp_path, tank, names, form, part):
    """Every 2.5 s: in whole seconds, steps were 2 s and 3 s."""
    moments = [datetime(2024, 3, 1) + timedelta(seconds=2.5 * k) for k in range(60)]
    stamps = [
        f"{m.strftime(form.replace('%s', str(1709251200 + 5 * k // 2)))}"
        f";{m.microsecond * 1e-6 * part:.10g}"
        for k, m in enumerate(moments)
    ]
    read = clock(table(tmp_path / "a.csv", stamps, names), tank)
    assert_allclose(read.times, 2.5 * np.arange(60), atol=1e-6)


def test_a_fraction_of_something_else_is_none_of_a_second(tmp_path, tank):
    stamps = [f"2024-03-01 10:00:{k:02d};0.{k % 9}" for k in range(60)]
    recorded = read_recorded_file(table(tmp_path / "a.csv", stamps, "Time;fraction"))
    assert "fraction" in [channel.name for channel in recorded.groups[0].channels]


def test_a_date_at_midnight_goes_with_the_time_beside_it(tmp_path, tank):
    """As databases and workbooks keep days; a gap of three days is one."""
    moments = [datetime(2024, 3, 1) + timedelta(seconds=QUARTER * k) for k in range(60)]
    moments[30:] = [moment + timedelta(days=3) for moment in moments[30:]]
    stamps = [f"{m:%d.%m.%Y} 00:00:00;{m:%H:%M:%S}" for m in moments]
    read = clock(table(tmp_path / "a.csv", stamps, "Date;Time"), tank)
    assert read.times[-1] == 59 * QUARTER + 3 * 86400
    book = openpyxl.Workbook()
    book.active.append(["Date", "Time", "inflow [l/s]", "h [mm]"])
    for k, moment in enumerate(moments):
        book.active.append([moment.date(), moment.time(), 1.5, 20 + k])
    book.save(tmp_path / "a.xlsx")
    read = clock(tmp_path / "a.xlsx", tank)
    assert read.times[-1] == 59 * QUARTER + 3 * 86400
    assert iso(read.start)[:19] == "2024-03-01T00:00:00"


def test_a_recording_has_the_date_of_a_column_that_is_not_its_time(tmp_path, tank):
    stamps = [
        f"{QUARTER * k:.0f};{local(BERLIN_NIGHT, 60, '%d %b %Y %H:%M')[k]}" for k in range(60)
    ]
    recorded = read_recorded_file(table(tmp_path / "a.csv", stamps, "Elapsed [s];Date"))
    proposal = propose([recorded], tank, {})
    assert merge([recorded], proposal, tank).date(0)[:19] == "2024-03-01T23:00:00"


def test_a_clock_that_was_set_is_refused_or_told(tmp_path, tank):
    """Recorders begin in 1970 until they know the time."""
    rows = [*local(datetime(1970, 1, 1, tzinfo=UTC), 4, "%Y-%m-%d %H:%M:%S")]
    for days, refused in ((365, False), (19000, True)):
        later = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=days)
        path = table(tmp_path / "a.csv", [*rows, *local(later, 60, "%Y-%m-%d %H:%M:%S")])
        recorded = read_recorded_file(path)
        proposal = propose([recorded], tank, {})
        recording = ProposedRecording("", (recorded,), proposal)
        if refused:
            with pytest.raises(InputError, match="more than 100 times all other steps"):
                import_recording("a", recording, tank, {})
        else:
            (piece,) = import_recording("a", recording, tank, {}).pieces
            assert "more than 100 times all other steps together" in " ".join(piece.doubts)


def test_nothing_goes_across_a_censored_sample(tmp_path, tank):
    """Neither the inflow before it, which is held, nor a line between its neighbours."""
    path = table(tmp_path / "a.csv", [str(900 * k) for k in range(60)], "time [s]")
    edit(path, ("\n27000;1.2;", "\n27000;<0.01;"))
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
def test_a_recording_has_the_date_of_its_first_sample(tmp_path, tank, form, date):
    path = table(tmp_path / "a.csv", local(datetime(2024, 6, 1, tzinfo=BERLIN), 60, form))
    recorded = read_recorded_file(path)
    proposal = propose([recorded], tank, {})
    assert merge([recorded], proposal, tank).date(0) == date
    imported = import_recording("a", ProposedRecording("", (recorded,), proposal), tank, {})
    write(imported, tmp_path / "cases", tank)
    (case,) = read_cases([tmp_path / "cases"], tank)
    assert case.date.startswith(date[:19] if not date.endswith("T00:00:00.000000") else date[:10])
    assert bool(case.date) == bool(date)


@pytest.mark.parametrize(
    ("names", "factor", "date"),
    [
        ("GPS week;TOW [s]", 1.0, "2024-03-02T23:49:42"),
        ("GPSWeek;GPSMilliseconds", 1e3, "2024-03-02T23:49:42"),
        ("GWk;GMS", 1e3, "2024-03-02T23:49:42"),
        ("GPS_Week;GPS_Time_s", 1.0, "2024-03-02T23:49:42"),
    ],
)
def test_weeks_of_satellites_go_on_with_what_has_gone_of_them(tmp_path, tank, names, factor, date):
    """From ten minutes before the end of week 2303, a Saturday."""
    seconds = 604200 + QUARTER * np.arange(300)
    rows = [
        f"{2303 + int(t // 604800)};{factor * (t % 604800):.0f};1.{k % 7};2{k % 10}"
        for k, t in enumerate(seconds)
    ]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"{names};inflow [l/s];h [mm]", *rows]))
    read_clock = clock(path, tank)
    assert_allclose(np.diff(read_clock.times), QUARTER)
    assert iso(read_clock.start + read_clock.times[0]).startswith(date)


def test_the_time_of_a_week_goes_round_with_it(tmp_path, tank):
    stamps = [f"{(604200000 + 900000 * k) % 604800000}" for k in range(60)]
    read = clock(table(tmp_path / "a.csv", stamps, "iTOW [ms]"), tank)
    assert_allclose(read.times - read.times[0], QUARTER * np.arange(60))


def test_figures_of_a_time_of_day_may_end_with_milliseconds(tmp_path, tank):
    """Taken as a count of milliseconds, they were 40 s late at each full minute."""
    stamps = local(datetime(2024, 3, 1, 10, tzinfo=UTC), 60, "%H%M%S250")
    assert_allclose(clock(table(tmp_path / "a.csv", stamps), tank).times, QUARTER * np.arange(60))


def test_short_durations_have_seconds_alone(tmp_path, tank):
    stamps = [f"{k // 2}m{30 * (k % 2)}s" if k > 1 else f"{30 * k}.0s" for k in range(60)]
    stamps[7] = ""
    read = clock(table(tmp_path / "a.csv", stamps), tank)
    expected = np.where(np.arange(60) == 7, np.nan, 30.0 * np.arange(60))
    assert_allclose(read.times, expected)


def test_a_recording_begins_as_its_preamble_says_where_its_times_begin_at_zero(tmp_path, tank):
    stamps = [f"{k // 4:02d}:{15 * (k % 4):02d}:00" for k in range(60)]
    path = table(tmp_path / "a.csv", stamps)
    path.write_text("Start time: 2024-03-01 10:15:30\n" + path.read_text())
    assert iso(clock(path, tank).dated)[:19] == "2024-03-01T10:15:30"


@pytest.mark.parametrize(
    ("order", "message"),
    [
        (range(299, -1, -1), r"the newest sample stands first.*sort the rows"),
        ([*range(150), *range(150)], r"times begin anew.*part the file before sample 151"),
        ([*range(150), *range(100, 250)], r"in sample 151.*delete rows that stand there twice"),
    ],
)
def test_times_that_go_back_say_what_to_do(tmp_path, tank, order, message):
    """A stated rate would take both for one recording that goes on."""
    with pytest.raises(InputError, match=message):
        clock(table(tmp_path / "a.csv", [f"{900 * k}" for k in order], "t [s]"), tank)


@pytest.mark.parametrize(
    ("begin", "form"),
    [
        (datetime(2024, 2, 27, tzinfo=UTC), "%d.%m.%Y %H:%M"),
        (datetime(2024, 2, 27, tzinfo=UTC), "%y-%m-%d %I:%M %p"),
        (datetime(2024, 10, 26, tzinfo=BERLIN), "%Y-%m-%d %H:%M:%S"),
    ],
)
def test_rows_with_the_newest_first_are_turned_and_told(tmp_path, tank, begin, form):
    path = table(tmp_path / "a.csv", local(begin, 300, form))
    head, *rows = path.read_text().split("\n")
    path.write_text("\n".join([head, *rows[::-1]]))
    recorded = read_recorded_file(path)
    assert any("newest first" in note for note in recorded.notes)
    assert_allclose(clock(path, tank).times, QUARTER * np.arange(300))
    assert recorded.groups[0].channels[-1].values[0] == 20.0  # of the earliest row


def test_segments_are_not_joined_by_a_stated_rate(tmp_path, tank):
    """Nobody knows what lies between them; samples were counted through."""
    rows = [f"{k % 30};4.5;95{k % 7}" for k in range(60)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Sample rate: 1 Hz", "time [s];inflow [l/s];h [mm]", *rows]))
    with pytest.raises(InputError, match=r"times begin anew.*part the file before sample 31"):
        clock(path, tank)


@pytest.mark.parametrize(
    ("steps", "segments", "match"),
    [("0.5\t1.0", 1, "states 'dt 0.5 s' and 'dt 1.0 s'"), ("0.5\t0.5", 2, "2 segments without")],
)
def test_steps_that_only_headers_say_hold_for_one_segment(tmp_path, tank, steps, segments, match):
    end = "***End_of_Header***"
    rows = "\n".join(f"\t4.{k}\t95{k % 7}" for k in range(30))
    head = f"Channels\t2\nY_Unit_Label\tl/s\tmm\nDelta_X\t{steps}\n{end}\nX_Value\tinflow\th\n"
    path = tmp_path / "a.lvm"
    path.write_text("\n".join([f"LabVIEW Measurement\n{end}", *[head + rows] * segments]))
    with pytest.raises(InputError, match=match):
        clock(path, tank)
