"""The repository's own recordings: made by its rig, repeatable, with a truth nobody else reads."""

import json
import platform
import re
import sys
from pathlib import Path

import pytest

from workbench.__main__ import main
from workbench.machines.wheelset.rig import STANDARD
from workbench.recordings.case import read_cases
from workbench.system.registry import load_system

ROOT = Path(__file__).parents[1]
CASES = ROOT / "cases"
COMMAND = [
    "rig",
    "--seed",
    "1",
    "--truth-every",
    "4",
    "--reference",
    str(ROOT / "fmus" / "fmi2" / "Reference.fmu"),
]


def test_cases_are_the_standard_stops_of_the_rig():
    assert tuple(case.name for case in read_cases([CASES], load_system("wheelset"))) == STANDARD
    for name in STANDARD:
        made = json.loads((CASES / name / "truth.json").read_text())
        assert (made["seed"], made["rate"]) == (1, 200)


def test_makefile_and_this_file_make_the_same_cases():
    """`make cases` needs the command that is tried below."""
    recipe = re.search(r"^cases:.*\n\t(.+)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert recipe[1] == "$(RUN) -m workbench rig --seed 1 --truth-every 4 --out cases"


@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64",
    reason="another mathematical library rounds otherwise",
)
def test_a_case_made_anew_has_the_same_bytes(tmp_path):
    """The case with the slide, where the smallest difference grows.

    truth.json also holds the hash of the FMU, which any change of its files moves.
    """
    name = "09_wet_160_4.2_wsp"
    assert main([*COMMAND, "--case", name, "--out", str(tmp_path)]) == 0
    for file in ("case.toml", "measured.csv", "truth.csv"):
        assert (tmp_path / name / file).read_bytes() == (CASES / name / file).read_bytes(), file
    old, new = (
        json.loads((folder / name / "truth.json").read_text()) for folder in (CASES, tmp_path)
    )
    assert old | {"fmu_sha256": None} == new | {"fmu_sha256": None}


def test_nothing_but_accuracy_reads_the_truth_of_the_rig():
    """What estimates, tunes or diagnoses cannot import it either: its layer is above."""
    package = ROOT / "workbench"
    readers = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if re.search(r"truth\.(csv|json)", path.read_text())
    }
    files = {"rig/files.py", "commands/rig.py", "truth.py", "commands/accuracy.py"}
    # Recorded sets that say what is wrong in them are scored, with what was found.
    scored = {"machines/train/recorded.py", "cli/power.py"}
    assert readers <= {f"machines/wheelset/{name}" for name in files} | scored
