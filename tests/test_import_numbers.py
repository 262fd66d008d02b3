"""Recorders' files that can be read in two ways: no number of them is taken in silence."""

import datetime
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from nptdms import ChannelObject, GroupObject, TdmsWriter
from numpy.testing import assert_allclose
from scipy.io import savemat

import workbench as wb
from workbench.__main__ import main
from workbench.errors import InputError
from workbench.recordings.channels import NamedChannel, ProposedMapping, merge, parse_named, propose
from workbench.recordings.channels.clock import Clock
from workbench.recordings.formats import read_recorded_file
from workbench.recordings.formats.numbers import markers
from workbench.recordings.formats.spelling import conversion, is_unit, spell_unit
from workbench.recordings.formats.stamps import iso
from workbench.system.registry import load_system
from workbench.system.system import System
from workbench.system.template import write_system

from .edits import edit

# --- names above samples ---


def table(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize(
    ("header", "row", "match"),
    [
        ("time [s]\tinflow [l/s]\th [mm]", "{0}\t{0}.5\t3.{0}\t950.2", "3 names over 4 columns"),
        ("time [s]\tinflow [l/s]\th [mm]\t", "{0}\t{0}.5\t3.{0}\t950.2", "3 names over 4 columns"),
        ("time [s],inflow [l/s],h [mm]", "{0},3,5,95,2", "3 names over 5 columns"),
        ("Nr;time;h\ns;mm", "{0};{0}.5;950.2", "2 units below 3 names"),
    ],
    ids=["R without a name of rows", "the same by way of a spreadsheet", "commas", "units"],
)
def test_a_header_that_is_narrower_than_its_samples_is_refused(tmp_path, header, row, match):
    path = table(tmp_path / "a.csv", [header, *(row.format(i) for i in range(1, 60))])
    with pytest.raises(InputError, match=rf"above line \d: found {match}.*name every column"):
        read_recorded_file(path)


def test_columns_beyond_the_header_may_be_empty(tmp_path):
    rows = [f"{i};{i}.5;;" for i in range(60)]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", ["time [s];h [mm]", *rows])).groups
    assert [channel.name for channel in group.channels] == ["time", "h"]


@pytest.mark.parametrize("zero", "\u0660\u06f0\u0966\uff10")
def test_digits_of_other_scripts_are_numbers(tmp_path, zero):
    """Arabic, Persian, Devanagari, and those as wide as Chinese characters."""
    digits = {ord("0") + k: chr(ord(zero) + k) for k in range(10)}
    rows = [f"{0.5 * k};{900 + k}.25".translate(digits) for k in range(60)]
    if zero < "\u0900":
        rows = [row.replace(".", "\u066b") for row in rows]
    (group,) = read_recorded_file(table(tmp_path / "a.csv", ["time [s];h [mm]", *rows])).groups
    assert_allclose(group.channels[0].values, 0.5 * np.arange(60.0))
    assert_allclose(group.channels[1].values, 900.25 + np.arange(60.0))


@pytest.mark.parametrize("mark", [".", ","])
def test_three_decimals_throughout_say_what_would_tell(tmp_path, mark):
    rows = [f"{k};4{mark}071" for k in range(60)]
    path = table(tmp_path / "a.csv", ["time [s];inflow [l/s]", *rows])
    with pytest.raises(InputError, match=f"write this number as '4{mark}0710', if its mark is"):
        read_recorded_file(path)
    table(path, ["time [s];inflow [l/s]", f"0;4{mark}0710", *rows[1:]])
    (group,) = read_recorded_file(path).groups
    assert_allclose(group.channels[1].values, 4.071)


# --- times ---


def clock(path: Path, system: System, **columns: NamedChannel) -> Clock:
    """The one clock of a file."""
    (read_clock,) = propose([read_recorded_file(path)], system, columns).clocks.values()
    return read_clock


MINUTE = np.arange(0.0, 60.0, 0.5)  # s


def test_times_beside_data_are_in_the_unit_that_stands_there(tmp_path, tank):
    content = {"unit": "mm", "data": MINUTE, "time": 1e3 * MINUTE, "time_unit": "ms"}
    savemat(tmp_path / "a.mat", {"h": content})
    assert_allclose(clock(tmp_path / "a.mat", tank).times, MINUTE, rtol=1e-12)


def test_times_beside_data_that_state_no_unit_are_asked_about(tmp_path, tank):
    savemat(tmp_path / "a.mat", {"h": {"unit": "mm", "data": MINUTE, "time": 1e3 * MINUTE}})
    read_clock = clock(tmp_path / "a.mat", tank)
    assert (read_clock.unit, read_clock.certain) == ("ms", False)
    stated = clock(tmp_path / "a.mat", tank, time=NamedChannel("time", "ms"))
    assert_allclose(stated.times, MINUTE, rtol=1e-12)


@pytest.mark.parametrize(("unit", "step"), [("ms", 500.0), ("s", 0.5), ("", 0.5)])
def test_steps_of_a_waveform_are_in_its_own_unit(tmp_path, tank, unit, step):
    stated = {"unit_string": "mm", "wf_increment": step, "wf_start_offset": 2 * step}
    with TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment([ChannelObject("G", "h", MINUTE, {**stated, "wf_xunit_string": unit})])
    assert_allclose(clock(tmp_path / "a.tdms", tank).times, 1.0 + MINUTE, rtol=1e-12)


@pytest.mark.parametrize(
    ("first", "second", "match"),
    [
        ({"wf_start_time": np.datetime64("2024-03-05T10:00")}, {}, ""),
        (
            {"wf_start_time": np.datetime64("2024-03-05T10:00")},
            {"wf_start_time": np.datetime64("2024-03-05T11:00")},
            "each has its own 'wf_start_time'",
        ),
        ({}, {"wf_increment": 1.0}, "each has its own 'wf_increment'"),
    ],
)
def test_segments_of_a_waveform_are_one_only_if_they_go_on(tmp_path, tank, first, second, match):
    """The library joins them, at the step and from the begin of the last one."""
    stated = {"unit_string": "mm", "wf_increment": 0.5}
    with TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment([ChannelObject("G", "h", MINUTE[:60], {**stated, **first})])
        file.write_segment([ChannelObject("G", "h", MINUTE[60:], {**stated, **second})])
    with pytest.raises(InputError, match=match) if match else nullcontext():
        assert_allclose(clock(tmp_path / "a.tdms", tank).times, MINUTE, rtol=1e-12)


@pytest.mark.parametrize("scale", ["Linear", "Reciprocal"])
def test_a_scale_that_the_library_does_not_know_is_told(tmp_path, tank, scale):
    """Its channel was taken as recorded: volts in place of millimetres."""
    slope = {"NI_Scale[0]_Linear_Slope": 10.0, "NI_Scale[0]_Linear_Y_Intercept": 0.0}
    stated = {
        **{"unit_string": "mm", "wf_increment": 0.5, "NI_Number_Of_Scales": 1},
        **{"NI_Scale[0]_Scale_Type": scale, "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF, **slope},
    }
    with TdmsWriter(tmp_path / "a.tdms") as file:
        own = {"unit_string": "l/s", "wf_increment": 0.5}
        file.write_segment(
            [ChannelObject("G", "inflow", MINUTE, own), ChannelObject("G", "h", MINUTE, stated)]
        )
    proposed = propose([read_recorded_file(tmp_path / "a.tdms")], tank, {})
    if scale == "Linear":
        assert_allclose(proposed.assigned["h"].values, 1e-2 * MINUTE, atol=1e-12)
    else:
        (problem,) = proposed.problems
        assert problem == "h: 'h' has a scale that is not understood, 'Reciprocal'"


def test_a_channel_of_times_that_contradicts_the_file_is_told(tmp_path, tank):
    """LabVIEW writes a step of 1 where nobody set one."""
    with TdmsWriter(tmp_path / "a.tdms") as file:
        columns = {"Time": "s", "h": "mm"}.items()
        file.write_segment(
            [
                ChannelObject("G", name, MINUTE, {"unit_string": unit, "wf_increment": 1.0})
                for name, unit in columns
            ]
        )
    with pytest.raises(
        InputError, match=r"times of the file in \[s\] over .* and 'Time'.* 2 times"
    ):
        clock(tmp_path / "a.tdms", tank)
    named = clock(tmp_path / "a.tdms", tank, time=NamedChannel("Time"))
    assert_allclose(named.times, MINUTE)


@pytest.mark.parametrize(
    "beside", [{"dt": 0.5}, {"Sampling rate [Hz]": 2.0}, {"SampleRate": "2"}, {"dt [ms]": 500}]
)
def test_a_step_of_a_waveform_that_another_statement_contradicts_is_refused(tmp_path, tank, beside):
    """LabVIEW writes an increment of 1 where nobody set one."""
    for step in (1.0, 0.5):
        with TdmsWriter(tmp_path / "a.tdms") as file:
            stated = {"unit_string": "mm", "wf_increment": step}
            file.write_segment(
                [GroupObject("G", properties=beside), ChannelObject("G", "h", MINUTE, stated)]
            )
        contradicted = pytest.raises(InputError, match="1 s, and beside them one of 0")
        with contradicted if step == 1.0 else nullcontext():
            assert_allclose(clock(tmp_path / "a.tdms", tank).times, MINUTE)


def test_a_waveform_over_no_time_has_no_times(tmp_path, tank):
    stated = {"unit_string": "mm", "wf_increment": 0.5, "wf_xunit_string": "Hz"}
    with TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment([ChannelObject("G", "h", MINUTE, stated)])
    with pytest.raises(InputError, match="found no time"):
        clock(tmp_path / "a.tdms", tank)


def test_durations_of_a_workbook_count_in_no_unit_of_their_column(tmp_path, tank):
    book = openpyxl.Workbook()
    book.active.append(["Zeit [min]", "h [mm]"])
    for t in MINUTE:
        book.active.append([datetime.timedelta(hours=23.995, seconds=t), t])
    book.save(tmp_path / "a.xlsx")
    for named in ({}, {"time": NamedChannel("Zeit", "min")}):
        assert_allclose(clock(tmp_path / "a.xlsx", tank, **named).times, MINUTE, atol=1e-9)


@pytest.mark.parametrize(
    ("head", "rate"),
    [
        (["Filterfrequenz: 50 Hz", "Abtastrate: 2 Hz"], 2.0),
        (["Abtastrate: 2 Hz; Grenzfrequenz: 50 Hz"], 2.0),
        (["Carrier frequency: 4.8 kHz", "dt = 5e-1 s"], 2.0),
        (["Sampling interval: 500 ms", "Messrate: 2 Hz"], 2.0),
    ],
)
def test_a_rate_of_something_else_is_none_of_the_samples(tmp_path, tank, head, rate):
    path = table(tmp_path / "a.csv", [*head, "Nr;h [mm]", *(f"{i};{i}" for i in range(60))])
    assert_allclose(clock(path, tank).times, np.arange(60) / rate)


@pytest.mark.parametrize(
    ("head", "match"),
    [
        (["Filterfrequenz: 50 Hz"], "no time among"),
        (["Messzeit: 30 s"], "no time among"),
        (["Sample rate: 1,000 Hz"], "'1,000', which can be read with decimal commas or with"),
        (["Sample rate: 2.000 Hz"], "'2.000', which can be read with decimal points or with"),
        (["Abtastrate: 1 000 Hz"], "a preamble with '1 000', which may be one number or two"),
        (["Abtastrate: 2 Hz", "Messrate: 5 Hz"], "'Abtastrate: 2 Hz' and 'Messrate: 5 Hz'"),
    ],
)
def test_a_rate_in_doubt_is_refused_until_it_is_said(tmp_path, tank, head, match):
    path = table(tmp_path / "a.csv", [*head, "Nr;h [mm]", *(f"{i};{i}" for i in range(60))])
    with pytest.raises(InputError, match=f"{match}.*--sample-rate '200 Hz'"):
        clock(path, tank)
    (stated,) = propose([read_recorded_file(path)], tank, {}, step=0.5).clocks.values()
    assert_allclose(stated.times, MINUTE[:60])


@pytest.mark.parametrize("step", [None, 0.5])
def test_one_rate_is_not_that_of_vectors_of_two_lengths(tmp_path, tank, step):
    savemat(tmp_path / "a.mat", {"fs": 2.0, "h_mm": MINUTE, "inflow": MINUTE[::4], "gains": [1, 2]})
    columns = {"inflow": NamedChannel("inflow", "l/s")}
    with pytest.raises(InputError, match="one rate for channels of 30 and 120 samples"):
        propose([read_recorded_file(tmp_path / "a.mat")], tank, columns, step)
    assert_allclose(clock(tmp_path / "a.mat", tank).times, MINUTE)


def test_a_rate_that_is_stated_goes_before_a_unit_that_is_concluded(tmp_path, tank):
    """In ms the count would be sampled as is usual."""
    rows = [f"{500 * i};{i}" for i in range(60)]
    path = table(tmp_path / "a.csv", ["Abtastrate: 2 Hz", "Zeit;h [mm]", *rows])
    assert_allclose(clock(path, tank).times, MINUTE[:60])


@pytest.mark.parametrize("named", [{}, {"time": NamedChannel("Zeit")}], ids=["found", "named"])
def test_times_that_may_be_seconds_or_minutes_are_asked_for(tmp_path, tank, named):
    rows = [f"{i * 2 / 60:.6f};{i}" for i in range(60)]
    path = table(tmp_path / "a.csv", ["Zeit;h [mm]", *rows])
    with pytest.raises(InputError, match=r"without a unit.*--column 'time=\w+ \[UNIT\]'"):
        clock(path, tank, **named)
    stated = clock(path, tank, time=NamedChannel("Zeit", "min"))
    assert_allclose(stated.times, 2.0 * np.arange(60), atol=1e-4)


@pytest.mark.parametrize(
    "day",
    [
        "01-Mar-2024",
        "1 March 2024",
        "01-MAR-2024",
        "1. März 2024",
        "01.03.2024",
        "1. 3. 2024",
        "01.03.2024.",
        *("1 marca 2024", "za 1 mrt. 2024", "pt., 1 mar 2024", "lör 1 mars 2024 kl."),
        *("1 březen 2024", "1 maaliskuuta 2024", "1 de março de 2024", "1 мар 2024"),
    ],
)
def test_months_may_be_written_by_their_names(tmp_path, tank, day):
    """The first as MATLAB writes it."""
    rows = [f"{day} 08:15:{t:06.3f};{t}" for t in MINUTE]
    read_clock = clock(table(tmp_path / "a.csv", ["Time;h [mm]", *rows]), tank)
    assert_allclose(read_clock.times, MINUTE, atol=1e-9)
    assert iso(read_clock.start) == "2024-03-01T08:15:00.000000"


@pytest.mark.parametrize(
    ("day", "month"),
    [
        *(
            ("14 stycznia 2024", 1),
            ("14 paź 2024", 10),
            ("14 grudnia 2024", 12),
            ("14 lipca 2024", 7),
        ),
        *(("14 července 2024", 7), ("14 června 2024", 6), ("14 marraskuuta 2024", 11)),
        *(("14 lipnja 2024", 6), ("14 srpnja 2024", 7), ("14 Ekim 2024", 10), ("14 out 2024", 10)),
        *(("14 lis 2024", 0), ("14 listopada 2024", 0), ("14 lip 2024", 0)),  # or of Zagreb
    ],
)
def test_months_of_other_languages_are_not_those_of_their_first_letters(tmp_path, tank, day, month):
    rows = [f"{day} 08:15:{t:06.3f};{t}" for t in MINUTE]
    read_clock = clock(table(tmp_path / "a.csv", ["Time;h [mm]", *rows]), tank)
    assert_allclose(read_clock.times, MINUTE, atol=1e-9)
    assert iso(read_clock.start)[5:7] == (f"{month:02d}" if month else "")
    assert month or "another one in Croatian" in read_clock.corrections[0]


@pytest.mark.parametrize("day", ["01-Mon-2024", "31-Feb-2024", "Mar-2024", "01-Mar-24 x"])
def test_what_is_no_day_of_a_month_is_no_time(tmp_path, tank, day):
    rows = [f"{day} 08:15:{t:06.3f};{t};{t}" for t in MINUTE]
    with pytest.raises(InputError, match="found no time"):
        clock(table(tmp_path / "a.csv", ["Time;h [mm];v", *rows]), tank)


# --- names, units ---


@pytest.mark.parametrize("named", [{}, {"inflow": NamedChannel("inflow")}], ids=["found", "named"])
def test_a_unit_that_nobody_says_is_to_be_confirmed(tmp_path, tank, named):
    path = table(tmp_path / "a.csv", ["t [s];inflow;h [m]", *(f"{i};5;1" for i in range(60))])
    proposal = propose([read_recorded_file(path)], tank, named)
    assert not proposal.certain
    (doubt,) = proposal.doubts
    assert doubt.endswith("--column 'inflow=inflow [l/s]' confirms [l/s]")
    confirmed = {"inflow": NamedChannel("inflow", "l/s")}
    assert propose([read_recorded_file(path)], tank, confirmed).certain


@pytest.mark.parametrize(
    "name",
    [
        *("Füllstandsollwert", "Sollfüllstand", "Füllstand-Soll", "FüllstandVorgabe"),
        *("h_Anforderung", "h_sp", "h_req", "h dmd", "level_setpoint", "levelDemand"),
    ],
)
def test_a_value_that_is_asked_for_is_no_measurement(tmp_path, tank, name):
    rows = [f"{i};1.5;{i}" for i in range(60)]
    path = table(tmp_path / "a.csv", [f"t [s];inflow [l/s];{name} [mm]", *rows])
    assert set(propose([read_recorded_file(path)], tank, {}).assigned) == {"inflow"}


@pytest.mark.parametrize("name", ["Rollenmessung h", "Radsatz-Rolle h", "h console"])
def test_letters_of_other_words_ask_for_nothing(tmp_path, tank, name):
    rows = [f"{i};1.5;{i}" for i in range(60)]
    path = table(tmp_path / "a.csv", [f"t [s];inflow [l/s];{name} [mm]", *rows])
    assert set(propose([read_recorded_file(path)], tank, {}).assigned) == {"inflow", "h"}


ROWS = [f"{i};5;{i}" for i in range(60)]


@pytest.mark.parametrize(
    ("unit", "si", "factor"),  # NIST SP 811, appendix B.8
    [
        *(("lps", "m3/s", 1e-3), ("US gpm", "m3/s", 6.30902e-5), ("cfs", "m3/s", 2.831685e-2)),
        *(
            ("L/MIN", "m3/s", 1e-3 / 60),
            ("M3/HR", "m3/s", 1 / 3600),
            ("ltr/min", "m3/s", 1e-3 / 60),
        ),
        *(("kpa", "Pa", 1e3), ("Mpa", "Pa", 1e6), ("MPA", "Pa", 1e6), ("HPa", "Pa", 100.0)),
        *(("psig", "Pa", 6894.757), ("PSIA", "Pa", 6894.757), ("kg/cm2(g)", "Pa", 98066.5)),
        *(("inH2O", "Pa", 249.0889), ("in. H20", "Pa", 249.0889), ("ftH2O", "Pa", 2989.067)),
        *(("KW", "W", 1e3), ("Kwh", "J", 3.6e6), ("kVA", "W", 1e3), ("HZ", "1/s", 1.0)),
        *(("Vrms", "V", 1.0), ("mVDC", "V", 1e-3), ("V AC", "V", 1.0), ("KG", "kg", 1.0)),
        *(("cSt", "m2/s", 1e-6), ("cP", "Pa.s", 1e-3), ("m^3 s^-1", "m3/s", 1.0)),
    ],
)
def test_units_are_read_as_loggers_spell_them(unit, si, factor):
    scale = conversion(spell_unit(unit), si)
    assert scale is not None
    assert scale.factor == pytest.approx(factor, rel=1e-6)


@pytest.mark.parametrize("unit", ["mpa", "mhz", "mt", "Min", "°dH", "NL/min", "slpm"])
def test_a_unit_that_may_be_two_or_is_none_is_not_read(unit):
    assert all(conversion(spell_unit(unit), si) is None for si in ("Pa", "1/s", "kg", "s", "m3/s"))


def test_in_place_of_a_unit_that_is_not_known_none_is_proposed(tmp_path, tank):
    path = table(tmp_path / "a.csv", ["t [s];inflow [l/s];h [Zoll]", *ROWS])
    (problem,) = propose([read_recorded_file(path)], tank, {}).problems
    assert problem == "h: 'h' is in [Zoll], a unit that is not known"
    match = r"\[Zoll\], a unit that is not known.*convert the values, or name one .*'h=h \[UNIT\]'"
    with pytest.raises(InputError, match=match):
        propose([read_recorded_file(path)], tank, {"h": NamedChannel("h")})


def test_a_unit_that_contradicts_the_one_in_the_file_is_told(tmp_path, tank, capsys):
    command = [
        "import",
        str(table(tmp_path / "a.csv", ["t [ms];inflow [l/s];h [Zoll]", *ROWS])),
        "--system",
        str(tank.source.parent),
        "--out",
        str(tmp_path / "o"),
    ]
    columns = ("time=t [s]", "h=h [mm]", "inflow=inflow [l/s]")
    assert main([*command, *(part for column in columns for part in ("--column", column))]) == 0
    printed = [line for line in capsys.readouterr().err.splitlines() if "as named" in line]
    assert [line.partition("channel ")[2] for line in printed] == [
        "'h': taken in [mm], as named, and the file states [Zoll]",
        "'t': taken in [s], as named, and the file states [ms]",
    ]


def test_a_channel_that_judges_is_named_and_not_dropped_in_silence(tmp_path, system):
    """A recording may be without the creep force, but its channel is seen."""
    names = "t [s];Bremsdruck [bar];Antriebsmoment [kNm];v_Rad [m/s];v_Rolle [m/s]"
    rows = [f"{0.01 * i:.2f};1.5;1.5;20.5;20.5;1.5" for i in range(60)]
    unmatched = {}
    for force in ("F_long [kN]", "Längskraft [kq]", "Temperatur [degC]"):
        path = table(tmp_path / "a.csv", [f"{names};{force}", *rows])
        proposal = propose([read_recorded_file(path)], system, {})
        assert not proposal.problems
        assert "Fx" not in proposal.assigned
        unmatched[force] = proposal.unmatched
    assert unmatched == {
        "F_long [kN]": (
            "Fx: it may be 'F_long'; nothing but its unit speaks for it, "
            "--column 'Fx=F_long' confirms it",
        ),
        "Längskraft [kq]": ("Fx: 'Längskraft' is in [kq], a unit that is not known",),
        "Temperatur [degC]": (),
    }


@pytest.mark.parametrize(
    ("unit", "si", "factor"),
    [
        ("cm", "m", 0.01),
        ("dm", "m", 0.1),
        ("daN", "N", 10.0),
        ("daNm", "N.m", 10.0),
        ("kgf", "N", 9.80665),
        ("kp", "N", 9.80665),  # as it was called in German
        ("kgf/cm²", "Pa", 98066.5),  # 1 at, the technical atmosphere
        ("kp/cm^2", "Pa", 98066.5),
        ("lbf.ft", "N.m", 1.3558179483314004),  # NIST SP 811, appendix B.8
        ("ft·lb", "N.m", 1.3558179483314004),
        ("ft-lbf", "N.m", 1.3558179483314004),
        ("IN-LBS", "N.m", 1.3558179483314004 / 12),
        ("N-m", "N.m", 1.0),
        ("Ncm", "N.m", 0.01),
        ("gal/min", "m3/s", 6.30901964e-5),
        ("GPM", "m3/s", 6.30901964e-5),
        ("ft³/min", "m3/s", 4.719474432e-4),
        ("cfm", "m3/s", 4.719474432e-4),
        ("PSIG", "Pa", 6894.757293168361),
        ("in Hg", "Pa", 3386.388640341),
        ("mmH2O", "Pa", 9.80665),
        ("kn", "m/s", 1852 / 3600),
        ("MPH", "m/s", 0.44704),
        ("ft/sec", "m/s", 0.3048),
        ("lb/hr", "kg/s", 0.45359237 / 3600),
        ("lbs", "N", 4.4482216152605),  # of a mass it is none
        ("g", "m/s2", 9.80665),
        ("deg/sec", "rad/s", np.pi / 180),
        ("mAh", "A.s", 3.6),
        ("mPas", "Pa.s", 1e-3),  # and no plural of mPa
    ],
)
def test_units_of_workshops_are_known(unit, si, factor):
    converted = conversion(spell_unit(f"[{unit}]"), si)
    assert converted.factor == pytest.approx(factor, rel=1e-9)
    assert converted.zero == 0.0


def test_words_and_other_quantities_are_no_units():
    """Min is no million inches, GPS no horse power; a minimum in a name is none of a level."""
    assert not any(map(is_unit, ("Min", "GPS", "Uhr", "hh")))
    assert conversion("Pas", "Pa") is conversion("g", "N") is conversion("Nl/min", "m3/s") is None


def test_names_that_end_in_words_state_no_unit(tmp_path, tank):
    path = table(tmp_path / "a.csv", ["t [s];inflow [l/s];h_in", *ROWS])
    assert (
        "no unit in the file" in propose([read_recorded_file(path)], tank, {}).assigned["h"].doubt
    )


def test_a_gallon_is_asked_about(tmp_path, tank):
    path = table(tmp_path / "a.csv", ["t [s];inflow [gal/min];h [mm]", *ROWS])
    inflow = propose([read_recorded_file(path)], tank, {}).assigned["inflow"]
    assert inflow.factor == pytest.approx(6.30901964e-5)
    assert "[gal/min]' confirms it, [igal/min] takes the other" in inflow.doubt
    named = {"inflow": NamedChannel("inflow", "igal/min")}
    inflow = propose([read_recorded_file(path)], tank, named).assigned["inflow"]
    assert inflow.factor == pytest.approx(4.54609e-3 / 60)


@pytest.mark.parametrize(
    ("name", "asked"),
    [
        ("inflow x10", "x10"),
        ("inflow/1000", "/1000"),
        ("inflow (*10)", "*10"),
        ("inflow Aux10", ""),
    ],
)
def test_a_factor_in_a_name_is_asked_about(tmp_path, tank, name, asked):
    path = table(tmp_path / "a.csv", [f"t [s];{name} [l/s];h [mm]", *ROWS])
    doubt = propose([read_recorded_file(path)], tank, {}).assigned["inflow"].doubt
    assert (f"its name has '{asked}'" in doubt) if asked else not doubt
    named = {"inflow": NamedChannel(name, "0.1 l/s")}
    inflow = propose([read_recorded_file(path)], tank, named).assigned["inflow"]
    assert inflow.factor == pytest.approx(1e-4)


def test_a_torque_without_a_unit_may_be_in_that_of_another_country(tmp_path, system):
    names = "t [s],BCP [psi],Torque,Wheel speed [mph],Roller speed [mph]"
    rows = [f"{0.01 * i:.2f},20.5,3000.5,45.5,45.5" for i in range(60)]
    (problem,) = propose(
        [read_recorded_file(table(tmp_path / "a.csv", [names, *rows]))], system, {}
    ).problems
    assert problem == "tauR: 'Torque' has no unit and is plausible as N.m or lbf.ft"


def test_channels_that_are_left_out_have_the_names_by_which_they_are_taken(tmp_path, tank):
    """Two recordings on two sheets: one of them is named."""
    book = openpyxl.Workbook()
    for sheet in (book.active, book.create_sheet("two")):
        sheet.append(["t [s]", "inflow [l/s]", "h [mm]"])
        for t in MINUTE:
            sheet.append([t, 5.0, t])
    book.save(tmp_path / "a.xlsx")
    held = read_recorded_file(tmp_path / "a.xlsx")
    assert "two/h [mm]" in propose([held], tank, {}).left
    named = {name: NamedChannel(f"two/{name}") for name in ("inflow", "h")}
    assert propose([held], tank, named).certain


# --- values that are no samples, or in another unit than they say ---


TIME = 0.5 * np.arange(200)  # s
LEVEL = 900.0 + 50.0 * np.sin(0.1 * TIME)  # mm


def system_with(folder: Path, name: str, unit: str, label: str, scale: str) -> System:
    """The tank, with a signal that judges; its noise is a hundredth of its scale."""
    write_system(folder)
    path = folder / "system.toml"
    text, size = path.read_text(), float(scale.split()[0])
    judged = f'\n[judged.{name}]\nunit = "{unit}"\nlabel = "{label}"\n'
    judged += f'noise = "{size / 100:g} {unit}"\nscale = "{scale}"\n'
    path.write_text(text + judged)
    return load_system(folder)


def write(
    path: Path, levels: np.ndarray, unit: str = "mm", extra: str = "", more: str = ""
) -> Path:
    rows = [
        f"{t};{4 + k % 7 / 10};{h:.3f}{more}"
        for k, (t, h) in enumerate(zip(TIME, levels, strict=True))
    ]
    path.write_text("\n".join([f"time [s];inflow [l/s];h [{unit}]{extra}", *rows]))
    return path


def proposed(path: Path, system: System, *columns: str) -> ProposedMapping:
    named = dict(parse_named(column, "", system.signals) for column in columns)
    return propose([read_recorded_file(path)], system, named)


@pytest.mark.parametrize("marker", [-9999.0, -7999.0, 9.9e37, 32767.0, 3276.7])
def test_a_marker_of_a_recorder_is_no_sample(tmp_path, tank, marker):
    path = write(tmp_path / "a.csv", np.where(np.arange(200) % 50 == 20, marker, LEVEL))
    proposal = proposed(path, tank)
    assert proposal.assigned["h"].missing == (marker,)
    assert f"{marker:g}, 4 times, is no sample" in proposal.assigned["h"].reason
    assert merge([read_recorded_file(path)], proposal, tank).signals["h"].max() < 1.0


def test_a_last_line_that_is_cut_within_a_number_is_no_sample(tmp_path, tank):
    path = write(tmp_path / "a.csv", LEVEL)
    path.write_text(path.read_text()[:-2])
    recorded = read_recorded_file(path)
    assert "line 201 was left out: the file ends there within a line" in recorded.doubts[-1]
    assert recorded.groups[0].channels[0].values.size == 199
    path.write_text(path.read_text() + "\n")
    assert not read_recorded_file(path).doubts


def test_a_value_that_may_be_a_marker_is_asked_about_and_declared(tmp_path, tank):
    path = write(tmp_path / "a.csv", np.where(np.arange(200) % 80 == 20, 12345.0, LEVEL))
    (doubt,) = proposed(path, tank).doubts
    assert "'h' is 12345 in 3 samples, far outside" in doubt
    assert "--column 'h=h missing 12345'" in doubt
    declared = proposed(path, tank, "h=h missing 12345, -9999")
    assert not declared.doubts
    assert declared.assigned["h"].missing == (12345.0, -9999.0)
    assert np.isnan(declared.assigned["h"].values).sum() == 3
    assert declared.named["h"].to_dict()["missing"] == [12345.0, -9999.0]
    kept = proposed(path, tank, "h=h missing none")
    assert not kept.doubts
    assert np.nanmax(kept.assigned["h"].values) == pytest.approx(12.345)


@pytest.mark.parametrize("value", [0.0, -1.0, -99.99, 888888.0, 9999.999])
def test_samples_that_go_out_and_back_at_once_are_asked_about(tmp_path, tank, value):
    """As no tank moves; the proposal leaves them out, be they possible or not."""
    path = write(tmp_path / "a.csv", np.where(np.arange(200) % 60 == 20, value, LEVEL))
    proposal = proposed(path, tank)
    (doubt,) = proposal.doubts
    assert f"'h' is {value:.15g} in 3 samples, far outside of all others" in doubt
    assert f"missing {value:.15g}' confirms it" in doubt
    assert np.isnan(proposal.assigned["h"].values).sum() == 3


def test_one_value_that_comes_again_and_again_is_asked_about(tmp_path, tank):
    """Nearer than three widths of all others: a sensor that fails for a sample shows zero."""
    level = 950.0 + 200.0 * np.sin(np.arange(200.0) / 31.0)
    path = write(tmp_path / "a.csv", np.where(np.arange(200) % 60 == 20, 0.0, level))
    (doubt,) = proposed(path, tank).doubts
    assert "'h' is 0 in 3 samples, far outside of all others" in doubt
    path = write(tmp_path / "b.csv", np.where(np.arange(200) == 20, 0.0, level))
    assert not proposed(path, tank).doubts


@pytest.mark.parametrize("cell", ["950m", "9.5.0"])
def test_cells_that_look_like_numbers_are_asked_about(tmp_path, tank, cell):
    path = write(tmp_path / "a.csv", LEVEL)
    edit(path, (f"{LEVEL[50]:.3f}", cell), count=1)
    (doubt,) = proposed(path, tank).doubts
    assert f"'h' has 1 cells such as '{cell}', which are no numbers" in doubt
    left_out = proposed(path, tank, "h=h missing none")
    assert not left_out.doubts
    assert np.isnan(left_out.assigned["h"].values).sum() == 1


def test_two_markers_beside_each_other_are_no_samples(tmp_path, tank):
    counts = np.arange(200) % 50
    path = write(
        tmp_path / "a.csv", np.where(counts == 3, -9999.0, np.where(counts == 30, -7999.0, LEVEL))
    )
    assert set(proposed(path, tank).assigned["h"].missing) == {-9999.0, -7999.0}


def test_a_level_that_rests_at_zero_is_one(tmp_path, tank):
    path = write(tmp_path / "a.csv", np.where(np.arange(200) < 4, 0.0, LEVEL))
    assert proposed(path, tank).assigned["h"].missing == ()


def test_a_signal_that_holds_texts_says_which(tmp_path, tank):
    path = write(tmp_path / "a.csv", LEVEL)
    path.write_text(path.read_text().replace("\n", " high\n").replace("h [mm] high", "h [mm]"))
    (problem,) = proposed(path, tank).problems
    assert "'h' holds texts such as '900.000 high', no numbers" in problem
    with pytest.raises(InputError, match=r"'h' holds texts .*To do: export it as numbers"):
        proposed(path, tank, "h=h")


def test_two_columns_of_one_name_can_be_told(tmp_path, tank):
    path = write(tmp_path / "a.csv", LEVEL, extra=";h [mm]", more=";7.1")
    (problem,) = proposed(path, tank).problems
    assert "it may be 'h#1' or 'h#2'" in problem
    assert_allclose(proposed(path, tank, "h=h#1").assigned["h"].values, 1e-3 * LEVEL, atol=1e-6)


def test_steps_between_a_few_values_are_samples():
    valve = np.where(np.arange(200) % 20 == 0, 9999.0, 0.0)
    noisy = 0.5 + 0.3 * np.sin(np.arange(200.0))
    assert markers(valve) == ({}, {})
    assert markers(noisy) == ({}, {})


def test_a_marker_in_a_recording_of_the_workbench_is_refused(tmp_path, tank):
    (tmp_path / "case.toml").write_text('title = "a"\n[measurement]\nfile = "measured.csv"\n')
    path = write(tmp_path / "measured.csv", np.where(np.arange(200) == 20, -9999.0, LEVEL))
    edit(path, (";", ","))
    with pytest.raises(InputError, match=r"line 22, column 'h': found -9999 in 1 samples"):
        wb.read_cases(tmp_path, tank)


def test_an_impossible_value_that_stands_alone_may_be_declared_a_marker(tmp_path, tank):
    path = write(
        tmp_path / "a.csv", np.where(np.arange(200) % 50 == 20, -250.0, 10.0 * LEVEL - 8100.0)
    )
    (problem,) = proposed(path, tank).problems
    assert "if -250 is no sample, say --column 'h=h missing -250'" in problem
    assert not proposed(path, tank, "h=h missing -250").problems


def test_a_unit_that_is_wrong_by_a_thousand_is_asked_about(tmp_path, tank):
    path = write(tmp_path / "a.csv", LEVEL, "um")
    (doubt,) = proposed(path, tank).doubts
    assert "its largest value, 0.00095 m, is 0.00095 times the typical 1 m" in doubt
    assert "--column 'h=h [um]' confirms" in doubt
    assert not proposed(path, tank, "h=h [um]").doubts
    (problem,) = proposed(write(tmp_path / "b.csv", LEVEL, "m"), tank).problems
    assert "goes beyond what is possible, -0.1 to 20 m: 900 m in sample 1" in problem
    assert "a thousandth of it would be usual" in problem


def test_a_thousandth_in_the_own_unit_is_asked_about(tmp_path, tank):
    """An inflow in m3/s that is declared in l/s: it moves by less than its noise."""
    path = write(tmp_path / "a.csv", LEVEL)
    lines = path.read_text().split("\n")
    rows = [line.split(";") for line in lines[1:]]
    small = [f"{t};{float(inflow) / 1000:.6f};{h}" for t, inflow, h in rows]
    path.write_text("\n".join([lines[0], *small]))
    (doubt,) = proposed(path, tank).doubts
    assert "inflow: its largest value" in doubt
    resting = [f"{t};0;{h}" for t, _, h in rows]
    path.write_text("\n".join([lines[0], *resting]))
    assert not proposed(path, tank).doubts


@pytest.mark.parametrize(
    ("scale", "label", "values", "unit", "first"),
    [
        ("10 K", "temperature difference", 6.0, "degC", 6.0),
        ("300 K", "water", 20.0, "degC", 293.15),
        ("10 K", "water", 20.0, "degC", "a temperature, or a difference of two"),
        ("300 K", "water", 20.0, "K", r"as if it were in [degC]"),
        ("300 K", "water", 293.0, "degC", r"as if it were in [K]"),
    ],
)
def test_a_temperature_has_the_zero_of_its_signal(tmp_path, scale, label, values, unit, first):
    system = system_with(tmp_path / "system", "T", "K", label, scale)
    path = write(tmp_path / "a.csv", LEVEL, extra=f";T [{unit}]", more=f";{values}")
    proposal = proposed(path, system)
    if isinstance(first, str):
        assert any(first in doubt for doubt in proposal.doubts)
    else:
        assert not proposal.doubts
        assert_allclose(proposal.assigned["T"].values[0], first)


@pytest.mark.parametrize(
    ("signal", "header", "doubt", "column", "first"),
    [
        ("pressure", "p [barg]", "is a pressure above that of the air", "p=p [bar]", 2e5),
        ("pressure", "p rel [bar]", "is a pressure above that of the air", "p=p rel [bar]", 2e5),
        ("pressure", "p (kPa abs)", "is a pressure above a vacuum", "p=p [kPa]", 2e3),
        ("gauge pressure", "p [bar(g)]", "", "", 2e5),
        ("gauge pressure", "p [psia]", "is a pressure above a vacuum, and p is gauge", "", None),
        ("pressure", "p [0.1 bar]", "may be a unit of 1e+04 Pa", "p=p [0.1 bar]", 2e4),
        ("pressure", "p [x10 kPa]", "may be a unit of 1e+04 Pa", "p=p [kPa]", 2e3),
    ],
)
def test_a_pressure_has_the_zero_and_the_size_of_its_signal(
    tmp_path, signal, header, doubt, column, first
):
    """Values of 2; what name and unit leave open is asked, and taken as it is said to be."""
    system = system_with(tmp_path / "system", "p", "Pa", signal, "100000 Pa")
    path = write(tmp_path / "a.csv", LEVEL, extra=f";{header}", more=";2")
    proposal = proposed(path, system)
    assert any(doubt in text for text in proposal.doubts) == bool(doubt)
    if first is not None:
        proposal = proposed(path, system, *filter(None, [column]))
        assert not any(text.startswith(f"p: {doubt}") for text in proposal.doubts if doubt)
        assert_allclose(proposal.assigned["p"].values[0], first)


def test_a_pressure_in_mpa_that_is_usual_in_megapascal_is_asked_about(tmp_path):
    system = system_with(tmp_path / "system", "p", "Pa", "pressure", "100000 Pa")
    for unit, asked in (("mPa", True), ("MPa", False)):
        path = write(tmp_path / "a.csv", LEVEL, extra=f";p [{unit}]", more=";0.2")
        doubts = [doubt for doubt in proposed(path, system).doubts if doubt.startswith("p: ")]
        assert ["its largest value, 0.0002 Pa" in doubt for doubt in doubts] == [True] * asked
        assert not proposed(path, system, f"p=p [{unit}]").doubts


def test_an_angle_that_goes_round_is_asked_about(tmp_path):
    """Seven degrees a sample, within a turn; as it is, or with its turns counted."""
    system = system_with(tmp_path / "system", "phi", "rad", "angle", "6 rad")
    angles = 7.0 * np.arange(TIME.size)
    for values, rounds in (
        (angles % 360.0, True),
        (angles, False),
        ((angles + 180.0) % 360.0, True),
    ):
        path = write(tmp_path / "a.csv", LEVEL, extra=";phi [deg]")
        head, *rows = path.read_text().splitlines()
        more = [f"{row};{value}" for row, value in zip(rows, values, strict=True)]
        path.write_text("\n".join([head, *more]))
        assert any("go round" in doubt for doubt in proposed(path, system).doubts) == rounds
        assert not proposed(path, system, "phi=phi [deg]").doubts


def test_milliseconds_declared_as_seconds_are_refused(tmp_path, tank):
    (tmp_path / "case.toml").write_text('title = "a"\n[measurement]\nfile = "measured.csv"\n')
    rows = [
        f"{1000 * t},{4 + k % 7 / 10},{h:.3f}"
        for k, (t, h) in enumerate(zip(TIME, LEVEL, strict=True))
    ]
    (tmp_path / "measured.csv").write_text("\n".join(["time [s],inflow [l/s],h [mm]", *rows]))
    match = r"a sample every 500 s, 1000 times as far apart.*the unit of the time"
    with pytest.raises(InputError, match=match):
        wb.read_cases(tmp_path, tank)


@pytest.mark.parametrize("begin", [1013.25, 2013.25, 2900.0])
def test_numbers_with_three_decimals_are_no_days_of_a_year(tmp_path, begin):
    rows = [f"{k};{begin + 0.001 * k:.3f}" for k in range(60)]
    (held,) = read_recorded_file(table(tmp_path / "a.csv", ["time [s];p [mbar]", *rows])).groups
    assert_allclose(held.channels[1].values, begin + 0.001 * np.arange(60))
    assert held.channels[1].unit == "mbar"
