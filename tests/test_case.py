"""Stage 1: what is read, in which units and dialects."""

import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

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
    write,
)

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
    lines = [line.rpartition(",")[0] for line in LINES]
    assert "Fx" not in read(write(tmp_path, lines))


def test_extra_columns_are_ignored_whatever_they_hold(tmp_path):
    lines = [f'{LINES[0]},remark,remark,""', *(f'{line},"a, b",n.a.,' for line in LINES[1:])]
    assert_same(read(write(tmp_path / "a", lines)), read(write(tmp_path / "b")))


def test_columns_may_stand_in_any_order_and_have_other_names(tmp_path):
    lines = [",".join(reversed(line.split(","))) for line in LINES]
    lines[0] = lines[0].replace("pB", "p_cyl").replace("Fx", "force left")
    toml = TOML + '[measurement.columns]\npB = "p_cyl"\nFx = "force left"\n'
    assert_same(read(write(tmp_path / "a", lines, toml)), read(write(tmp_path / "b")))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_separators_line_ends_and_blank_last_lines_do_not_matter(tmp_path, separator, end):
    lines = [line.replace(",", separator) for line in LINES]
    csv = end.join([*lines, "", ""])
    assert_same(read(write(tmp_path / "a", csv)), read(write(tmp_path / "b")))


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_give_the_same_case(tmp_path, separator):
    lines = [line.replace(";", separator) for line in german(LINES)]
    assert_same(read(write(tmp_path / "a", lines)), read(write(tmp_path / "b")))


def test_a_byte_order_mark_does_not_matter(tmp_path):
    mark = b"\xef\xbb\xbf"
    csv = mark + "\n".join(LINES).encode()
    marked = read(write(tmp_path / "a", csv, mark + TOML.encode()))
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
    names = draw(st.permutations(list(UNITS)))
    return units, values, separator, mark, names


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
