"""Published pressures of closed chambers: read from each layout, and the leaking ones leak."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.api import diagnose
from workbench.diagnosis import Outcome
from workbench.machines.published.leaking_chamber import PUBLISHED
from workbench.recordings.case import read_cases
from workbench.recordings.datasets import PublishedRecording
from workbench.system.registry import load_system

CHAMBERS = ("Aluminium", "Formlabs", "Prusa", "Ultimaker_015", "Ultimaker_020")


def chamber(number: int, time: np.ndarray) -> np.ndarray:
    """Pressure [bar]: of the first three chambers it stays, of the others it falls from 5 s on."""
    leak = 0.0 if number < 3 else 0.1 * number
    return np.round(7.5 * np.exp(-leak * np.maximum(0.0, time - 4.95)), 3)


def folders(folder: Path, time: np.ndarray) -> None:
    for number, name in enumerate(CHAMBERS):
        (folder / "chamber" / name).mkdir(parents=True)
        rows = [f"{t},{p}\n" for t, p in zip(time, chamber(number, time), strict=True)]
        file = folder / "chamber" / name / "measured.csv"
        file.write_text("".join(["time [s],pressure [bar]\n", *rows]))


def their_files(folder: Path, time: np.ndarray) -> None:
    """Milliseconds with points between thousands: 3.066.000 are 3066.000 ms."""
    data = folder / "appendix_compressed-air_chamber" / "data"
    data.mkdir(parents=True)
    for number, name in enumerate(CHAMBERS):
        lines = []
        for t, p in zip(time, chamber(number, time), strict=True):
            thousands, rest = divmod(round(1e3 * t), 1000)
            mark = f"{thousands}.{rest:03d}.000" if thousands else f"{rest}.000"
            lines.append(f"{mark};{p / 2:.3f};{p}\r\n")
        (data / f"{name}.csv").write_text("".join(lines))


def test_both_layouts_give_the_same_recordings(tmp_path):
    time = np.round(0.1 * np.arange(300), 3)
    their_files(tmp_path / "theirs", time)
    folders(tmp_path / "ours", time)
    first = PUBLISHED.layouts[0].read(tmp_path / "theirs")
    second = PUBLISHED.layouts[1].read(tmp_path / "ours")
    assert [one.name for one in first] == [one.name for one in second]
    for one, other in zip(first, second, strict=True):
        assert one.rows == other.rows
        for column, values in one.columns.items():
            assert_allclose(values, other.columns[column], atol=1e-9, err_msg=column)


def test_a_chamber_is_cut_where_it_is_closed_and_at_2_bar(tmp_path):
    time = np.round(0.1 * np.arange(300), 3)
    folders(tmp_path, time)
    read = {one.name: one for one in PUBLISHED.layouts[1].read(tmp_path)}
    held_out = [name for name, one in read.items() if one.held_out]
    assert held_out == ["Ultimaker_015_below", "Ultimaker_020_below"]
    assert read["Aluminium_above"].rows == (0, 299)
    above, below = read["Ultimaker_020_above"], read["Ultimaker_020_below"]
    assert above.rows[0] == below.rows[0] == 50  # whence what is above leads to what is below
    assert below.rows[1] == 299
    assert above.counts_from is None
    assert below.counts_from is not None
    counts = below.columns["time [s]"] >= below.counts_from
    assert pressure(above).min() >= 2.0 > pressure(below)[counts].max()
    assert counts.sum() == below.columns["time [s]"].size - above.columns["time [s]"].size
    assert above.columns["time [s]"][0] == 0.0


def pressure(recording: PublishedRecording) -> np.ndarray:
    return recording.columns["p [bar]"]


# --- far from the truth ---

RATE = 287.05 * 293.15 / 1e-4  # R T/V of the model: pressure decays by this times conductance
MATTERS = 3e-14  # [kg/(s.Pa)] of a laminar leak


@pytest.mark.parametrize("times", [100.0, 1000.0, 10_000.0])
def test_a_leak_is_found_however_far_it_leads_from_the_tight_chamber(tmp_path, times):
    """Reference: the exact solution, p = p0 exp(-R T/V conductance t), of an ideal gas.

    Linearised about a tight chamber the pressure falls evenly, which tells nothing of a decay.
    """
    system = load_system("leaking_chamber")
    conductance, time = times * MATTERS, 0.1 * np.arange(600)
    for number, pressure in enumerate((5e5, 7e5)):
        noise = 300.0 * np.random.default_rng(number).standard_normal(time.size)
        rows = pressure * np.exp(-RATE * conductance * time) + noise
        folder = tmp_path / "recordings" / f"{number}"
        folder.mkdir(parents=True)
        lines = [f"{t:.1f},{p:.1f}\n" for t, p in zip(time, rows, strict=True)]
        (folder / "measured.csv").write_text("".join(["time [s],p [Pa]\n", *lines]))
        (folder / "case.toml").write_text(
            'title = "A chamber that is closed"\nmeasurement.file = "measured.csv"\n'
        )
    cases = read_cases([tmp_path / "recordings"], system)
    outcome = diagnose(system, cases, out=tmp_path, workers=1, report=lambda line: None)
    assert outcome.diagnosis.verdict == "found"
    cause = outcome.diagnosis.causes[0]
    assert cause.effect.name == "LaminarLeak"
    size = cause.parameters["conductance"]
    assert size.low <= conductance <= size.high


# --- on the recordings, where they are at hand ---


@pytest.fixture(scope="module")
def cases(published_cases) -> Path:
    return published_cases("leaking_chamber", "pneumatic_cylinder")


def diagnosed(cases: Path, name: str, out: Path) -> Outcome:
    system = load_system("leaking_chamber")
    above = read_cases([cases / f"{name}_above"], system)
    return diagnose(system, above, out=out, workers=1, report=lambda line: None)


# `Ultimaker_020`, and `Aluminium`, which is tight, are diagnosed by a tutorial.
@pytest.mark.parametrize("name", ["Prusa", "Ultimaker_015"])
def test_a_chamber_that_leaks_does_so_laminarly(cases, tmp_path, name):
    diagnosis = diagnosed(cases, name, tmp_path).diagnosis
    assert diagnosis.verdict == "found"
    assert diagnosis.causes[0].effect.name == "LaminarLeak"


def test_both_parts_of_a_chamber_that_empties_are_explained_by_its_leak(cases, tmp_path):
    """The nominal chamber is thousands of times the noise off, where derivatives tell nothing."""
    system = load_system("leaking_chamber")
    both = read_cases([cases / f"Ultimaker_020_{part}" for part in ("above", "below")], system)
    outcome = diagnose(system, both, out=tmp_path, workers=1, report=lambda line: None)
    assert outcome.diagnosis.causes[0].effect.name == "LaminarLeak"
    gain = outcome.diagnosis.gain
    assert gain is not None
    assert gain.after < 0.01 * gain.before
