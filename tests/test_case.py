"""Stage 1: what is read, in which units and dialects, and what is refused with which words."""

import math
import os
import pickle
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from workbench.errors import InputError
from workbench.recordings.case import read_cases, sign

from .case_folders import (
    LINES,
    ROUNDING,
    ROWS,
    SI_OF_UNITS,
    TOML,
    UNITS,
    assert_refused,
    assert_same,
    german,
    in_unit,
    read,
    signal,
    with_field,
    with_line,
    write,
)
from .edits import replaced

STANDARD = Path(__file__).parents[1] / "cases"

# What is read


def test_all_fourteen_standard_cases_are_read_in_order(system):
    cases = read_cases([STANDARD], system)
    assert [case.name[:2] for case in cases] == [f"{n:02d}" for n in range(1, 15)]
    for case in cases:
        assert case.title
        assert "Fx" in case
        assert case.y.shape == case.u.shape == (case.time.size, 2)
        # Coasting comes first; sensors are good to 0.03 %, the set speed to about 1 %.
        rolling = abs(np.median(case["omegaR"][:100])) * 0.7
        assert rolling == pytest.approx(case.conditions["initial_speed"], rel=0.02)
        assert np.sign(case["omegaR"][0]) == case.conditions["direction"] == sign(case, system)
        # The plateau: valve and noise may take it some per cent above what was demanded.
        assert case["pB"].max() == pytest.approx(case.conditions["brake_pressure"], rel=0.05)


def test_a_case_is_in_si_units(tmp_path):
    case = read(write(tmp_path / "01_a"))
    assert case.name == "01_a"
    assert case.title == "80 km/h, 1.5 bar"
    assert case.source == tmp_path / "01_a" / "measured.csv"
    assert case.conditions["initial_speed"] == pytest.approx(80 / 3.6, rel=ROUNDING)
    assert case.conditions["brake_pressure"] == pytest.approx(1.5e5, rel=ROUNDING)
    assert case.conditions["wheel_rail"] == "dry"
    assert case.conditions["discs"] == ("dry", "wet", "dry")
    assert case.conditions["direction"] == -1
    for column, (name, unit) in enumerate(UNITS.items()):
        written = [float(line.split(",")[column]) for line in LINES[1:]]
        si = np.array(written) * SI_OF_UNITS.get(unit, 1.0)
        assert_allclose(signal(case, name), si, rtol=ROUNDING)


def test_inputs_and_outputs_are_stacked_in_the_order_of_the_paper(tmp_path):
    case = read(write(tmp_path))
    assert_array_equal(case.u, np.column_stack([case["pB"], case["tauR"]]))
    assert_array_equal(case.y, np.column_stack([case["omegaW"], case["omegaR"]]))


@pytest.mark.parametrize("name", [*UNITS, "u", "y"])
def test_arrays_are_read_only_floats(tmp_path, name):
    case = read(write(tmp_path))
    array = getattr(case, name) if name in ("time", "u", "y") else case[name]
    assert array.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1.0


def test_a_recording_without_force_has_none(tmp_path):
    assert "Fx" not in read(write(tmp_path, [line.rpartition(",")[0] for line in LINES]))


def test_extra_columns_are_ignored_whatever_they_hold(tmp_path):
    lines = [f'{LINES[0]},remark,remark,""', *(f'{line},"a, b",n.a.,' for line in LINES[1:])]
    assert_same(read(write(tmp_path / "a", lines)), read(write(tmp_path / "b")))


def test_columns_may_stand_in_any_order_and_have_other_names(tmp_path):
    lines = [",".join(reversed(line.split(","))) for line in LINES]
    lines[0] = lines[0].replace("pB", "p_cyl").replace("Fx", "force left")
    toml = TOML + '[measurement.columns]\npB = "p_cyl"\nFx = "force left"\n'
    assert_same(read(write(tmp_path / "a", lines, toml)), read(write(tmp_path / "b")))


def test_names_may_have_brackets_as_those_of_models_do(tmp_path):
    header = LINES[0].replace("pB", "cylinder[1].p").replace("Fx", "F[2]")
    toml = TOML + '[measurement.columns]\npB = "cylinder[1].p"\nFx = "F[2]"\n'
    case = read(write(tmp_path / "a", [header, *LINES[1:]], toml))
    assert_same(case, read(write(tmp_path / "b")))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_separators_line_ends_and_blank_last_lines_do_not_matter(tmp_path, separator, end):
    lines = [line.replace(",", separator) for line in LINES]
    csv = end.join([*lines, "", ""])
    assert_same(read(write(tmp_path / "a", csv)), read(write(tmp_path / "b")))


def test_a_byte_order_mark_does_not_matter(tmp_path):
    mark = b"\xef\xbb\xbf"
    marked = read(write(tmp_path / "a", mark + "\n".join(LINES).encode(), mark + TOML.encode()))
    assert_same(marked, read(write(tmp_path / "b")))


# Units: factor is the value in SI units of one of the unit.
ACCEPTED = [
    ("time", "ms", 1e-3),
    ("time", "µs", 1e-6),
    ("time", "min", 60.0),
    ("pB", "Pa", 1.0),
    ("pB", "kPa", 1e3),
    ("pB", "mbar", 1e2),
    ("pB", "MPa", 1e6),
    ("tauR", "Nm", 1.0),
    ("tauR", "N*m", 1.0),
    ("tauR", "N·m", 1.0),
    ("tauR", "kN.m", 1e3),
    ("tauR", "kNm", 1e3),
    ("omegaW", "deg/s", math.pi / 180),
    ("omegaW", "°/s", math.pi / 180),
    ("omegaW", "rpm", math.pi / 30),
    ("omegaR", "1/min", math.pi / 30),
    ("omegaR", "min-1", math.pi / 30),
    ("omegaR", "U/min", math.pi / 30),
    ("omegaR", "rev/min", math.pi / 30),
    ("Fx", "kN", 1e3),
]


@pytest.mark.parametrize(("name", "unit", "factor"), ACCEPTED)
def test_a_recording_in_other_units_gives_the_same_case(tmp_path, name, unit, factor):
    column = list(UNITS).index(name)
    old_factor = SI_OF_UNITS.get(UNITS[name], 1.0)
    rows = [line.split(",") for line in LINES[1:]]
    for row in rows:
        row[column] = repr(float(row[column]) * old_factor / factor)
    lines = [in_unit(name, unit)[0], *(",".join(row) for row in rows)]
    assert_same(read(write(tmp_path / "a", lines)), read(write(tmp_path / "b")))


# Everything a recording may look like


@st.composite
def recordings(draw):
    """Draw units, a dialect and numbers as a file states them."""
    choices = {name: [(unit, SI_OF_UNITS.get(unit, 1.0))] for name, unit in UNITS.items()}
    for name, unit, factor in ACCEPTED:
        if name != "time":
            choices[name].append((unit, factor))
    units = {name: draw(st.sampled_from(choices[name])) for name in UNITS}
    number = st.floats(-1e6, 1e6, allow_subnormal=False)
    values = {
        name: np.array(draw(st.lists(number, min_size=ROWS, max_size=ROWS))) for name in UNITS
    }
    steps = draw(st.lists(st.floats(0.1, 10.0), min_size=ROWS, max_size=ROWS))
    values["time"] = np.cumsum(steps)
    separator, mark = draw(st.sampled_from([",.", ";.", ";,", "\t.", "\t,"]))
    return units, values, separator, mark, draw(st.permutations(list(UNITS)))


# Some 20 ms a case; a deadline would only measure how busy the machine is.
@settings(max_examples=60, deadline=None, derandomize=True)
@given(recordings())
def test_any_unit_and_dialect_reads_back_to_the_same_si_values(tmp_path_factory, recording):
    units, values, separator, mark, names = recording
    table = zip(*(values[name] for name in names), strict=True)
    lines = [separator.join(f"{name} [{units[name][0]}]" for name in names)]
    lines += [separator.join(repr(float(x)).replace(".", mark) for x in row) for row in table]
    folder = tmp_path_factory.mktemp("case")
    try:
        case = read(write(folder, lines))
        for name, (_, factor) in units.items():
            assert_allclose(signal(case, name), values[name] * factor, rtol=ROUNDING)
    finally:
        shutil.rmtree(folder)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    field=st.text(st.sampled_from("0123456789.,-+eE _naif\t\u00a0\u0663"), max_size=7)
    | st.floats(allow_nan=True).map(repr),
    separator=st.sampled_from([",", ";"]),
)
def test_a_field_is_read_as_the_number_it_shows_or_refused_at_its_line(
    tmp_path_factory, field, separator
):
    lines = [line.replace(",", separator) for line in LINES]
    lines[6] = lines[6].replace("-48.25", f'"{field}"')
    numeral = re.fullmatch(r" *[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)? *", field)
    folder = write(tmp_path_factory.mktemp("case"), lines)
    try:
        if numeral and abs(float(field)) < 1e100:  # beyond any measurement
            assert read(folder)["omegaW"][5] == float(field)
        else:
            assert_refused("line 7, column 'omegaW'", lambda: read(folder))
    finally:
        shutil.rmtree(folder)


# Folders


def test_folders_of_cases_and_cases_are_read_together(tmp_path, system):
    for name in ("all/02_b", "all/01_a", "all/named", "00_c"):
        write(tmp_path / name)
    (tmp_path / "all" / "plots").mkdir()
    (tmp_path / "all" / "truth.json").touch()
    cases = read_cases([tmp_path / "all", tmp_path / "00_c"], system)
    assert [case.name for case in cases] == ["01_a", "02_b", "named", "00_c"]


def test_a_case_is_named_by_its_folder_however_the_path_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(write(tmp_path / "01_a"))
    assert read(Path()).name == "01_a"


# Recordings that are refused


@pytest.mark.parametrize(
    ("name", "unit", "match"),
    [
        ("omegaW", "N", r"column 'omegaW': found \[N\], a unit of another dimension"),
        ("omegaW", "km/h", "another dimension.*rad/s"),
        ("omegaW", "Hz", r"\[Hz\], which leaves open whether it counts revolutions or radians"),
        ("omegaR", "1/s", "leaves open whether it counts revolutions or radians"),
        ("Fx", "1/min", "another dimension"),
        ("time", "m", "another dimension.*s or ms"),
        ("tauR", "nm", r"\[nm\], a unit of another dimension.*case matters"),
        ("pB", "kpa", r"unknown unit \[kpa\].*Pa, kPa or bar"),
        ("pB", "2 Pa", r"unknown unit \[2 Pa\]"),
        ("pB", "Pa)", r"unknown unit \[Pa\)\]"),
        ("pB", "nan", r"unknown unit \[nan\]"),
        ("pB", "", r"line 1, column 'pB': found no unit in 'pB \[\]'"),
    ],
)
def test_units_that_do_not_fit_are_refused(tmp_path, name, unit, match):
    assert_refused(match, lambda: read(write(tmp_path, in_unit(name, unit))))


@pytest.mark.parametrize(
    ("field", "match"),
    [
        ("", "line 7, column 'pB': found an empty field; expected a finite number"),
        ("  ", "found an empty field"),
        ("nan", "line 7, column 'pB': found 'nan'"),
        ("-inf", "found '-inf'"),
        ("1e999", "found '1e999'; expected a finite number"),
        ("error", "found 'error'"),
        ("1_000", "found '1_000'"),
        ("1 000", "found '1 000'"),
        ("0x10", "found '0x10'"),
        ("1.234.567", "found '1.234.567', which is ambiguous.*no thousands separators"),
        ('"1,234"', "found '1,234', which is ambiguous"),
    ],
)
def test_a_field_that_is_no_finite_number_is_refused(tmp_path, field, match):
    assert_refused(match, lambda: read(write(tmp_path, with_field(7, "pB", field))))


def test_the_first_of_several_bad_fields_is_named(tmp_path):
    lines = with_field(9, "time", "x")
    lines[4] = lines[4].replace("-48.25", "y")
    assert_refused("line 5, column 'omegaW'", lambda: read(write(tmp_path, lines)))


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("-120,5", "1.234,5", "line 4, column 'Fx': found '1.234,5', which is ambiguous"),
        ("-120,5", "1.234", "line 4, column 'Fx': found '1.234' after '0,0' .*line 2.*ambiguous"),
        ("-120,5", "-120.5", "found '-120.5' after '0,0'"),
        ("-120,5", "n.a.", "found 'n.a.'; expected a finite number"),
    ],
)
def test_points_among_decimal_commas_are_refused(tmp_path, old, new, match):
    lines = german(LINES)
    lines[3] = lines[3].replace(old, new)
    assert_refused(match, lambda: read(write(tmp_path, lines)))


def test_quoted_decimal_commas_between_commas_are_refused(tmp_path):
    quoted = ['"' + line.replace(";", '","') + '"' for line in german(LINES)]
    match = "line 2, column 'time': found '0,0', which is ambiguous"
    assert_refused(match, lambda: read(write(tmp_path, quoted)))


@pytest.mark.parametrize("mark", [",", "."])
def test_numbers_that_may_all_have_thousands_separators_are_refused(tmp_path, mark):
    rows = [f"{k};0;1{mark}234;-48;-32;-120" for k in range(ROWS)]
    lines = [LINES[0].replace(",", ";"), *rows]
    match = "line 2, column 'tauR': found '1.234' and no number that tells"
    assert_refused(match, lambda: read(write(tmp_path / "a", lines)))
    lines[5] = lines[5].replace("-48", f"-48{mark}25")  # this number can only have decimals
    assert_array_equal(read(write(tmp_path / "b", lines))["tauR"], 1.234)


@pytest.mark.parametrize(
    ("line", "text", "match"),
    [
        (8, "0.6,1,2,3,4", "line 8: found 5 fields .*expected 6 as in the header"),
        (8, "0.6,1,1,234,3,4,5", "line 8: found 7 fields .*decimal commas .*semicolons"),
        (8, "", "line 8: found 0 fields"),
        (8, '0.6,1,"2,3,4,5', "line 8: found a quotation that does not end"),
        (8, '0.6,1,x"2,"3,4,5', "line 8: found a quotation that does not end"),
        (8, '0.6,1,"2"3,4,5', "line 8: found a quotation that does not end"),
        (
            4,
            "0.1,0,-1,-48,-31,-120",
            "line 4, column 'time': found 0.1 s after 0.1 s.*strictly increasing",
        ),
        (4, "0.05,0,-1,-48,-31,-120", "line 4, column 'time': found 0.05 s after 0.1 s"),
        (1, "", "line 1: found an empty file or an empty first line"),
        (1, "time [s] pB [bar]", "line 1: found no separator in 'time "),
        (1, LINES[0].replace(",", ";", 1), "line 1: found commas and semicolons; expected .*one"),
        (1, LINES[0].replace("pB", "PB"), r"column 'pB': found no such .*\(closest: 'PB'\)"),
        (1, LINES[0].replace("Fx", "pB"), "line 1, column 'pB': found 2 columns of this name"),
        (1, LINES[0].replace(" [rad/s]", "", 1), "'omegaW': found no unit in 'omegaW'"),
    ],
)
def test_a_line_that_breaks_the_format_is_refused(tmp_path, line, text, match):
    assert_refused(match, lambda: read(write(tmp_path, with_line(line, text))))


@pytest.mark.parametrize(
    ("csv", "match"),
    [
        ("", "line 1: found an empty file"),
        (LINES[0], "line 2: found the end of the file after the header"),
        ("\n".join(LINES).encode("utf-16"), "found UTF-16 or binary data.*expected UTF-8"),
        ("\n".join(LINES).encode("utf-16-le"), "found UTF-16 or binary data"),
        (
            "\n".join([*LINES[:2], "0.1 °"]).encode("latin-1"),
            "line 3: found byte 0xB0, as in Latin-1.*To do: save the file as UTF-8",
        ),
        ("\n".join(LINES[:20]), "found 19 samples over 1.8 s; expected at least 20 .*noise"),
        ("\n".join(LINES[:21]), "found 20 samples over 1.9 s; expected .*noise, over 2 s"),
        ("\n".join([*LINES[:5], *LINES[24:]]), "found 6 samples over 2.4 s"),
        ("\n".join(LINES)[:-1], "line 26: found '-120.' at the end, shorter than the numbers"),
    ],
)
def test_a_file_without_a_usable_recording_is_refused(tmp_path, csv, match):
    assert_refused(match, lambda: read(write(tmp_path, csv)))


# case.toml


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ('"dry"\n', "dry\n", "case.toml, line 5: found text that is no TOML"),
        ("[measurement]", "[measurement", "line 8: found text that is no TOML"),
        ('title = "80 km/h, 1.5 bar"', "", "case.toml: found no 'title'"),
        ('title = "80 km/h, 1.5 bar"', 'title = ""', "title: found ''; expected a text"),
        ("title", "titel", r"found unknown key 'titel' \(closest: 'title'\)"),
        ("direction = -1", "direktion = -1", r"\[conditions\]: .*'direktion' \(closest: 'dir"),
        ("file", "fil", r"\[measurement\]: found unknown key 'fil' \(closest: 'file'\)"),
        ("direction = -1", "", r"\[conditions\]: found no 'direction'"),
        ("direction = -1", "direction = 0", "direction: found 0; expected 1 or -1"),
        ("direction = -1", "direction = true", "direction: found True; expected a whole number"),
        ("direction = -1", 'direction = "1"', "direction: found '1'; expected a whole number"),
        ('"80 km/h"', "80", "initial_speed: found 80; expected a text"),
        ('"80 km/h"', '"80"', "initial_speed: found '80', a number without a unit"),
        ('"80 km/h"', '"80,5 km/h"', "found '80,5 km/h'; expected a number with a decimal point"),
        ('"80 km/h"', '"80 bar"', r"initial_speed: found \[bar\], a unit of another dimension"),
        ('"80 km/h"', '"80 kmx"', r"found unknown unit \[kmx\].*m/s or km/h"),
        ('"80 km/h"', '"-80 km/h"', "expected above 0 m/s.*'direction' holds the sign"),
        ('"1.5 bar"', '"-1.5 bar"', "brake_pressure: found '-1.5 bar'; expected no less than 0 Pa"),
        ('= "dry"', '= "damp"', "wheel_rail: found 'damp'; expected 'dry' or 'wet'"),
        ('"dry", "wet"', '"dry", "Wet"', r"discs\[1\]: found 'Wet'; expected 'dry' or 'wet'"),
        ('"dry", "wet"', '"dry", 1', r"discs\[1\]: found 1;"),
        ('"dry", "wet", "dry"', '"dry"', "discs: found 1 entries; expected 3"),
        ('["dry", "wet", "dry"]', '"dry"', "discs: found 'dry'; expected a list"),
        ('"measured.csv"', "1", "file: found 1; expected a text"),
        ('"measured.csv"', '"other.csv"', "other.csv: found no such file.*'file' in the table"),
        ('"measured.csv"', '"."', r"found a file that cannot be read \(Is a directory\)"),
    ],
)
def test_a_wrong_entry_of_the_conditions_is_refused(tmp_path, old, new, match):
    folder = write(tmp_path, toml=replaced(TOML, (old, new)))
    assert_refused(match, lambda: read(folder))


@pytest.mark.parametrize(
    ("columns", "match"),
    [
        ('pb = "p"', r"columns\]: found unknown key 'pb' \(closest: 'pB'\)"),
        ("pB = 2", r"columns\] pB: found 2; expected a text"),
        ('pB = "p_cyl"', "column 'p_cyl': found no such column among time, pB, "),
        ('Fx = "force"', "column 'force': found no such column"),
        ('omegaR = "omegaW"', r"columns\] omegaR: found column 'omegaW', .* already omegaW"),
    ],
)
def test_a_wrong_name_of_a_column_is_refused(tmp_path, columns, match):
    folder = write(tmp_path, toml=f"{TOML}[measurement.columns]\n{columns}\n")
    assert_refused(match, lambda: read(folder))


@pytest.mark.parametrize("table", ["conditions", "measurement"])
def test_a_table_that_is_missing_or_no_table_is_refused(tmp_path, table):
    lines = TOML.splitlines()
    begin = lines.index(f"[{table}]")
    end = next((i for i in range(begin + 1, len(lines)) if lines[i][0] == "["), len(lines))
    others = "\n".join(lines[:begin] + lines[end:])
    missing = write(tmp_path / "a", toml=others)
    assert_refused(f"found no '{table}'", lambda: read(missing))
    number = write(tmp_path / "b", toml=f"{table} = 1\n{others}")
    assert_refused(f"{table}: found 1; expected a table", lambda: read(number))


def test_a_toml_file_in_another_encoding_is_refused(tmp_path):
    toml = TOML.replace("title = ", "title = 'ä' #").encode("latin-1")
    assert_refused("case.toml, line 1: found byte 0xE4", lambda: read(write(tmp_path, toml=toml)))


# Folders


def test_two_cases_of_one_name_are_refused(tmp_path, system):
    first, second = write(tmp_path / "x" / "01_a"), write(tmp_path / "y" / "01_a")
    match = "y/01_a: found a second case '01_a' beside .*x/01_a"
    assert_refused(match, lambda: read_cases([first, second], system))


def test_a_case_whose_name_is_no_text_is_refused(tmp_path, system):
    folder = write(Path(os.fsdecode(os.fsencode(tmp_path) + b"/01_\xff")))
    assert_refused(
        r"01_\\udcff: found a name that is no UTF-8", lambda: read_cases([folder], system)
    )


def test_a_numbered_folder_without_case_toml_is_refused_not_skipped(tmp_path, system):
    write(tmp_path / "01_a")
    (tmp_path / "02_b").mkdir()
    assert_refused("02_b/case.toml: found no such file", lambda: read_cases([tmp_path], system))


def test_a_path_without_a_case_is_refused(tmp_path, system):
    file = tmp_path / "file"
    file.touch()
    assert_refused("found no case.toml", lambda: read_cases([tmp_path], system))
    assert_refused("file: found an empty file;", lambda: read_cases([file], system))
    assert_refused("none: found no such folder", lambda: read_cases([tmp_path / "none"], system))
    assert_refused("none/case.toml: found no such file", lambda: read(tmp_path / "none"))


def test_input_errors_survive_the_way_between_processes():
    error = InputError(where="a", found="b", expected="c", remedy="d")
    copy = pickle.loads(pickle.dumps(error))
    assert (str(copy), copy.remedy) == (str(error), "d")
