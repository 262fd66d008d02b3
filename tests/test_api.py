"""The workbench in a script or notebook: each step is a value, and nothing guards the script."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import workbench as wb
from workbench.system.template import write_system

from .processes import python

SCRIPT = """
import workbench as wb

system = wb.load_system("tank")
cases = wb.read_cases("tank/recordings", system)
run = wb.observe(system, cases[0], "ekf"); run.to_frame(); run.plot()
tuned = wb.tune(system, "disturbance_observer", cases, generations=1, population=3, workers=2)
again = wb.observe(system, cases[0], "disturbance_observer", tuned.gains); again.summary()
found = wb.diagnose(system, cases, workers=2)
print(found.summary()); found.plot()
try:
    wb.propose(found, workers=2)
except wb.InputError as error:
    print(f"no law: {error}")
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("api")
    write_system(folder / "tank")
    return folder


@pytest.fixture(scope="module")
def system(folder) -> wb.System:
    return wb.load_system(folder / "tank")


@pytest.fixture(scope="module")
def case(folder, system) -> wb.Case:
    return wb.read_cases(folder / "tank" / "recordings" / "01_steps", system)[0]


def test_a_script_needs_no_guard_from_file_to_diagnosis(root, folder):
    """Workers import neither the script nor start it again: it prints each line once."""
    script = folder / "script.py"
    script.write_text(SCRIPT)
    run = python("-W", "error", script, cwd=folder, MPLBACKEND="agg")
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("[1/2] z ") == 1
    sentence = "The model lacks a wall that seeps in proportion to the level: Seepage, k 0.0004"
    assert run.stdout.count(sentence) == 1
    assert "no law: the diagnosis: found the verdict 'found'" in run.stdout


def test_a_table_is_the_recording_that_a_file_holds(system, case):
    again = wb.case_from_frame(system, pd.read_csv(case.source))
    assert_array_equal(again.time, case.time)
    assert_allclose(again.u, case.u, rtol=1e-15)
    assert_allclose(again.y, case.y, rtol=1e-15)
    runs = [wb.observe(system, recording, "ekf").signal("c") for recording in (case, again)]
    assert_allclose(runs[0], runs[1], rtol=1e-12)


def test_a_table_without_a_signal_or_its_unit_is_refused(system, case):
    frame = pd.read_csv(case.source)
    with pytest.raises(wb.InputError, match=r"found no column 'h' .* expected a column 'h \[m\]'"):
        wb.case_from_frame(system, frame.drop(columns="h [mm]"))
    with pytest.raises(wb.InputError, match=r"column 'h': found unknown unit \[\]"):
        wb.case_from_frame(system, frame.rename(columns={"h [mm]": "h"}))
    with pytest.raises(wb.InputError, match=r"column 'h \[bar\]': found \[bar\], a unit of anot"):
        wb.case_from_frame(system, frame.rename(columns={"h [mm]": "h [bar]"}))


def test_tuned_gains_are_what_an_estimator_then_runs_with(system, case):
    lines: list[str] = []
    tuned = wb.tune(
        *(system, "disturbance_observer", [case]),
        generations=1,
        population=3,
        workers=1,
        report=lines.append,
    )
    assert len([line for line in lines if " z " in line]) == 2
    usual = wb.observe(system, case, "disturbance_observer")
    better = wb.observe(system, case, "disturbance_observer", tuned.gains)
    assert not np.array_equal(usual.signal("c"), better.signal("c"))


def test_an_estimator_that_there_is_none_of_is_refused(system, case):
    with pytest.raises(wb.InputError, match=r"'ekff': .* \(closest: 'ekf'\)"):
        wb.observe(system, case, "ekff")
