"""The package works anywhere: import at no cost, and a wheel that holds all it needs."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import workbench
from workbench.__main__ import main
from workbench.cli import COMMANDS
from workbench.system.installed import built_models

OWN = ("modelica", "fmus", "cases")  # at the top level of a checkout, in the wheel as data


def run(*command: str, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *command], capture_output=True, text=True, **options)


def test_what_takes_long_to_load_is_loaded_only_where_it_is_needed(root):
    """Figures by Matplotlib, tables of pandas, distributions of SciPy."""
    code = "import sys, workbench.api, workbench.diagnosis.report; print(*sys.modules)"
    imported = {*run("-c", code, cwd=root).stdout.split()}
    assert "workbench.observers.simulation" in imported
    assert imported.isdisjoint({"matplotlib", "pandas", "scipy.stats"})


def test_the_help_lists_each_command_and_each_has_its_own(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    listed = capsys.readouterr().out
    for name, text in COMMANDS.items():
        assert re.search(rf"^    {name}\s+{text[:40]}", listed, re.MULTILINE)
        with pytest.raises(SystemExit, match="0"):
            main([name, "--help"])
        assert capsys.readouterr().out.startswith(f"usage: workbench {name} ")


def test_each_public_name_is_what_its_module_defines():
    assert dir(workbench) == sorted(workbench.__all__)
    for name in workbench.__all__:
        assert getattr(workbench, name).__name__ == name


@pytest.mark.parametrize(
    ("old", "new"), [("Monitored", "MonitoringResult"), ("Tuned", "TuningResult")]
)
def test_a_former_name_works_and_says_what_it_is_called_now(old, new):
    with pytest.warns(DeprecationWarning, match=f"workbench.{old} is now workbench.{new}"):
        assert getattr(workbench, old) is getattr(workbench, new)


def test_a_name_that_is_not_public_is_refused():
    with pytest.raises(AttributeError, match="'workbench' has no attribute 'read_case_s'"):
        _ = workbench.read_case_s


# --- what comes along ---


def test_the_fmus_that_come_along_are_those_that_system_files_name(root):
    listed = json.loads((root / "fmus" / "manifest.json").read_text())["fmus"]
    named = [name for names in built_models().values() for name in names]
    assert {path: entry["model"] for path, entry in listed.items()} == {
        f"fmi{fmi}/{name.rpartition('.')[2]}.fmu": name for fmi in (2, 3) for name in named
    }


# --- the wheel ---


@pytest.fixture(scope="module")
def installed(root, once) -> Path:
    """What pip installs of the wheel that is built from the source distribution."""

    def install(folder: Path) -> Path:
        run("-m", "hatchling", "build", "-t", "sdist", "-d", str(folder), cwd=root, check=True)
        (archive,) = folder.glob("*.tar.gz")
        alone, installed = ("--no-deps", "--no-index", "--no-build-isolation"), folder / "installed"
        run("-m", "pip", "install", *alone, "--target", str(installed), str(archive), check=True)
        return installed

    return once("package", install)


@pytest.fixture
def anywhere(installed, tmp_path):
    """Runs the installed `workbench` in a folder with nothing in it."""

    def call(*arguments: str) -> subprocess.CompletedProcess[str]:
        script = str(installed / "bin" / "workbench")
        environment = os.environ | {"PYTHONPATH": str(installed)}
        return run(script, *arguments, cwd=tmp_path, env=environment)

    return call


def files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


@pytest.mark.parametrize("name", OWN)
def test_the_wheel_holds_models_fmus_and_cases(root, installed, name):
    assert files(installed / "workbench" / "data" / name) == files(root / name)


def test_the_wheel_holds_the_whole_package_and_nothing_else(root, installed):
    held = files(installed / "workbench")
    assert {k: v for k, v in held.items() if not k.startswith("data/")} == files(root / "workbench")
    others = {path.name for path in installed.iterdir()} - {"workbench", "bin"}
    assert all(name.endswith(".dist-info") for name in others)


def test_the_wheel_simulates_its_own_cases_in_an_empty_folder(anywhere, tmp_path):
    done = anywhere("simulate", "--estimator", "open_loop")
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["results"]
    summary = json.loads((tmp_path / "results" / "simulate" / "summary.json").read_text())
    assert len(summary["cases"]) == 14
    assert summary["provenance"]["commit"] is None
    # The README's table.
    scores = summary["cases"]["03_dry_120_3.6"]["estimators"]["open_loop"]
    assert round(100 * scores["Fx_nrmse"], 2) == 55.22


def test_a_folder_of_the_same_name_does_not_shadow_the_cases_of_the_wheel(
    anywhere, installed, tmp_path
):
    (tmp_path / "cases").mkdir()
    own = installed / "workbench" / "data" / "cases"
    assert f"simulate {min(own.iterdir())} " in anywhere("simulate", "--help").stdout


def test_messages_of_the_wheel_name_only_what_it_has(anywhere, root):
    missing = anywhere("simulate", str(root / "cases" / "01_dry_80_1.5"), "--fmu", "missing.fmu")
    assert missing.returncode == 2
    assert "To do: give the path of one with --fmu." in missing.stderr
    refused = anywhere("fmu", "build", "--all")
    assert refused.returncode == 2
    assert "found a package that was installed from a wheel" in refused.stderr
