"""What `workbench new` writes is simulated, tuned and diagnosed as it is."""

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from workbench.__main__ import main
from workbench.api import diagnose
from workbench.diagnosis import Outcome
from workbench.errors import InputError
from workbench.recordings.case import read_cases
from workbench.system.registry import load_system
from workbench.system.template import SEEPAGE, write_system


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("new") / "tank"
    assert main(["new", str(folder)]) == 0
    return folder


def test_a_folder_with_a_system_is_left_as_it_is(folder):
    with pytest.raises(InputError, match="expected a folder without a system"):
        write_system(folder)


def ran(command: str, folder: Path, out: Path, *options: str) -> dict[str, object]:
    """Run a command on the new system; returns its summary."""
    name, *rest = command.split()
    assert main([name, *rest, "--system", str(folder), "--out", str(out), *options]) == 0
    summary: dict[str, object] = json.loads((out / "summary.json").read_text())
    return summary


def test_it_is_simulated_on_its_recordings(folder, tmp_path):
    summary = ran("simulate", folder, tmp_path, "--workers", "1")
    cases = summary["cases"]
    assert isinstance(cases, dict)
    assert len(cases) == 4
    for case in cases.values():
        errors = {name: estimator["h_nrmse"] for name, estimator in case["estimators"].items()}
        # What seeps is a sixth of what leaves: without feedback the level is wrong by as much.
        alone = errors.pop("open_loop")
        assert alone > 0.1
        assert max(errors.values()) < 0.2 * alone


def test_it_is_tuned(folder, tmp_path):
    quick = ("--budget", "2", "--population", "3", "--workers", "1")
    summary = ran("tune disturbance_observer", folder, tmp_path, *quick)
    assert isinstance(summary["z"], float)
    assert isinstance(summary["z_reasoned"], float)
    assert summary["z"] <= summary["z_reasoned"]


def diagnosed(folder: Path, out: Path, effects: Sequence[str] = ()) -> Outcome:
    system = load_system(folder)
    cases = read_cases([folder / "recordings"], system)
    return diagnose(system, cases, effects=effects, out=out, workers=1, report=lambda line: None)


def test_the_wall_that_seeps_is_named(folder, tmp_path):
    found = diagnosed(folder, tmp_path).diagnosis
    assert found.verdict == "found"
    (cause,) = found.causes
    assert cause.effect.name == "Seepage"
    assert cause.parameters["k"].low < SEEPAGE < cause.parameters["k"].high


def test_a_tight_wall_is_not(tmp_path):
    write_system(tmp_path / "tight", 0.0)
    assert diagnosed(tmp_path / "tight", tmp_path).diagnosis.verdict == "nothing"
