"""Stage 1: what is refused, and with which words."""

import os
import pickle
from pathlib import Path

import pytest
from numpy.testing import assert_array_equal

from workbench.errors import InputError
from workbench.recordings.case import read_cases

from .case_folders import (
    LINES,
    ROWS,
    TOML,
    assert_refused,
    german,
    in_unit,
    read,
    with_field,
    with_line,
    write,
)

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
        ("tauR", "nm", r"unknown unit \[nm\].*case matters"),
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
        ('"80 km/h"', '"80"', "initial_speed: found '80'; expected a number .* and a unit"),
        ('"80 km/h"', '"80,5 km/h"', "found '80,5 km/h'; expected a number with a decimal point"),
        ('"80 km/h"', '"80 bar"', r"initial_speed: found \[bar\], a unit of another dimension"),
        ('"80 km/h"', '"80 kmh"', r"found unknown unit \[kmh\].*m/s or km/h"),
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
    assert old in TOML
    folder = write(tmp_path, toml=TOML.replace(old, new, 1))
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
    rest = "\n".join(lines[:begin] + lines[end:])
    missing = write(tmp_path / "a", toml=rest)
    assert_refused(f"found no '{table}'", lambda: read(missing))
    number = write(tmp_path / "b", toml=f"{table} = 1\n{rest}")
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
