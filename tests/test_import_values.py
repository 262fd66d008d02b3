"""Values of recorders that are no samples, or in another unit than they say."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import workbench as wb
from workbench.errors import InputError
from workbench.recordings.channels import ProposedMapping, merge, parse_named, propose
from workbench.recordings.formats import read_recorded_file
from workbench.recordings.formats.numbers import markers
from workbench.system.registry import load_system
from workbench.system.system import System
from workbench.system.template import write_system

TIME = 0.5 * np.arange(200)  # s
LEVEL = 900.0 + 50.0 * np.sin(0.1 * TIME)  # mm


@pytest.fixture(scope="module")
def tank(tmp_path_factory) -> System:
    """A tank with an inflow and a level of about 1 m, sampled each 0.5 s."""
    folder = tmp_path_factory.mktemp("systems") / "tank"
    write_system(folder)
    return load_system(folder)


def system_with_temperature(folder: Path, scale: str, label: str) -> System:
    write_system(folder)
    path = folder / "system.toml"
    text = path.read_text()
    judged = f'\n[judged.T]\nunit = "K"\nlabel = "{label}"\nnoise = "0.1 K"\nscale = "{scale}"\n'
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
    levels = np.where(np.arange(200) % 50 == 20, marker, LEVEL)
    path = write(tmp_path / "a.csv", levels)
    proposal = proposed(path, tank)
    assert proposal.assigned["h"].missing == (marker,)
    assert f"{marker:g}, 4 times, is no sample" in proposal.assigned["h"].reason
    measured = merge([read_recorded_file(path)], proposal, tank)
    assert measured.signals["h"].max() < 1.0


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
    levels = np.where(np.arange(200) == 20, -9999.0, LEVEL)
    path = write(tmp_path / "measured.csv", levels)
    path.write_text(path.read_text().replace(";", ","))
    with pytest.raises(InputError, match=r"line 22, column 'h': found -9999 in 1 samples"):
        wb.read_cases(tmp_path, tank)


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
    system = system_with_temperature(tmp_path / "system", scale, label)
    path = write(tmp_path / "a.csv", LEVEL, extra=f";T [{unit}]", more=f";{values}")
    proposal = proposed(path, system)
    if isinstance(first, str):
        assert any(first in doubt for doubt in proposal.doubts)
    else:
        assert not proposal.doubts
        assert_allclose(proposal.assigned["T"].values[0], first)


def test_milliseconds_declared_as_seconds_are_refused(tmp_path, tank):
    (tmp_path / "case.toml").write_text('title = "a"\n[measurement]\nfile = "measured.csv"\n')
    rows = [
        f"{1000 * t},{4 + k % 7 / 10},{h:.3f}"
        for k, (t, h) in enumerate(zip(TIME, LEVEL, strict=True))
    ]
    names = "time [s],inflow [l/s],h [mm]"
    (tmp_path / "measured.csv").write_text("\n".join([names, *rows]))
    match = r"a sample every 500 s, 1000 times as far apart.*the unit of the time"
    with pytest.raises(InputError, match=match):
        wb.read_cases(tmp_path, tank)
