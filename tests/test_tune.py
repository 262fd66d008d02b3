"""`tune` as a user runs it: what it writes, what it reads back, and what it survives."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.observers import Gains
from workbench.observers.gains_file import format_gains, read_gains
from workbench.observers.simulation import prepare
from workbench.runtime.files import write_whole
from workbench.system.registry import open_model
from workbench.system.system import System
from workbench.tuning import tunable

from .processes import comes_true, living, running
from .recordings import write_beginnings

# --- gains.toml ---


def default_gains(system: System, name: str) -> Gains:
    cls = tunable(system, name)
    with open_model(system, cls.role) as fmu:
        return cls.default_gains(fmu, system)


@pytest.mark.parametrize("name", ["disturbance_observer", "parameter_estimator", "ekf", "ukf"])
def test_gains_read_back_to_the_bit(system, tmp_path, name):
    gains = default_gains(system, name)
    provenance = {"z": 0.1, "cases": ['a "b"'], "z_k": {"a.b": 1}}
    path = tmp_path / "gains.toml"
    path.write_text(format_gains(gains, tunable(system, name).meaning, provenance))
    # Values to read into are not those that were written.
    read = read_gains(path, {name: gains.with_values(np.zeros(gains.values.size))})
    assert read.estimator == name
    assert read.names == gains.names
    assert_array_equal(read.values, gains.values)
    assert set(read.design) == set(gains.design)
    for constant, values in gains.design.items():
        assert_array_equal(read.design[constant], values)


@pytest.mark.parametrize(
    "name", ['a "quoted" one', "back\\slash", "two\nlines", "a'b", 'x"""', "é"]
)
def test_gains_tuned_on_cases_of_any_name_can_be_read_back(tmp_path, name):
    gains = Gains("ekf", ("a", "b"), np.array([0.1, 1e-300]), {}, "")
    came_from = {"cases": [name], "z_k": {name: 0.1}, "fmu": {"file": name}}
    path = tmp_path / "gains.toml"
    write_whole(path, format_gains(gains, name, came_from))
    assert_array_equal(read_gains(path, {"ekf": gains}).values, gains.values)
    assert tomllib.loads(path.read_text())["provenance"] == came_from


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("gains = ", "text that is no TOML"),
        ("[gains]", "estimator = None"),
        ('estimator = "ekf"\n[gains]\nmodel = 1', r"no omegaW in \[gains\]"),
        (
            'estimator = "parameter_estimator"\n[gains]\n'
            + "".join(f"L{i}{j} = 1\n" for i in (1, 2) for j in (1, 2, 3, 4)),
            "effect = None",
        ),
    ],
)
def test_a_wrong_file_of_gains_is_refused(system, tmp_path, text, match):
    path = tmp_path / "gains.toml"
    path.write_text(text)
    known = {name: default_gains(system, name) for name in ("ekf", "parameter_estimator")}
    with pytest.raises(InputError, match=match):
        read_gains(path, known)


# --- as a user runs it ---


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root) -> Path:
    """Two short recordings."""
    return write_beginnings(tmp_path_factory.mktemp("cases"))


def command(folder: Path, out: Path, *options: str) -> list[str]:
    search = ["--cases", str(folder), "--budget", "15", "--population", "4", "--workers", "1"]
    return ["tune", "parameter_estimator", *search, "--out", str(out), *options]


def test_a_run_that_is_killed_resumes_to_the_result_of_one_that_is_not(
    root, folder, tmp_path, monkeypatch
):
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    checkpoint = killed / "checkpoint.json"
    with running("-m", "workbench", *command(folder, killed)) as master:
        assert comes_true(checkpoint.exists)
        assert len(living(master.pid)) > 1
        master.kill()
    assert comes_true(lambda: not living(master.pid))
    # As if it had been killed inside a checkpoint, which is written beside and then renamed.
    half = checkpoint.read_bytes()[:1000]
    checkpoint.with_name("checkpoint.json.part").write_bytes(half)
    assert len(json.loads(checkpoint.read_text())["history"]) < 16
    monkeypatch.chdir(root)
    assert main(command(folder, killed, "--resume")) == 0
    assert main(command(folder, whole)) == 0
    assert (killed / "gains.toml").read_bytes() == (whole / "gains.toml").read_bytes()


def test_results_keep_their_contract(root, system, folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(root)
    arguments = command(folder, tmp_path, "--folds", "2", "--budget", "2", "--live")
    assert main(arguments) == 0
    printed, told = capsys.readouterr()
    assert "evaluations/s" in told
    assert "of work saved" in told
    assert "not seen: 03_dry_120_3.6" in printed
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert set(summary["gains"]) == {f"L{i}{j}" for i in (1, 2) for j in (1, 2, 3, 4)}
    assert summary["z"] == max(case["z_k"] for case in summary["cases"].values())
    assert summary["z"] <= summary["z_reasoned"]
    assert len(summary["folds"]) == 2
    assert len(summary["provenance"]["fmu"]["sha256"]) == 64
    path = tmp_path / "gains.toml"
    gains = read_gains(path, {"parameter_estimator": default_gains(system, "parameter_estimator")})
    assert_array_equal(gains.values, [g["value"] for g in summary["gains"].values()])
    for name in ("convergence.png", "cases.png"):
        assert (tmp_path / name).stat().st_size > 10_000
    assert not list(tmp_path.glob("*.part"))
    cls = tunable(system, "parameter_estimator")
    simulation = prepare(system, {cls.name: cls}, path)
    assert_array_equal(simulation.gains[cls.name].values, gains.values)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (["--folds", "3"], "3 with 2 cases"),
        (["--fmu", "README.md"], "no FMU"),
        (["--cluster", "tcp://127.0.0.1:1"], "--cluster"),
    ],
)
def test_a_users_mistake_gives_status_2_and_a_message(
    root, folder, tmp_path, monkeypatch, capsys, options, match
):
    monkeypatch.chdir(root)
    assert main(command(folder, tmp_path, *options)) == 2
    captured = capsys.readouterr().err
    assert match in captured
    assert "Traceback" not in captured
