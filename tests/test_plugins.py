"""A machine comes as a plugin of a distribution of its own: system, command, estimator, gains."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.recordings.datasets import published
from workbench.system.plugins import Plugin, find_plugin

from .built import machine_file
from .processes import python

PLUGIN = """
from pathlib import Path
from workbench import Plugin

PLUGIN = Plugin(
    system=Path(__file__).with_name("system.toml"),
    commands={"spin": (f"{__name__}.spin", "say how long a roller spins")},
    estimators=f"{__name__}.estimators",
)
"""
COMMAND = """
from workbench.cli.arguments import add_system
from workbench.cli.output import CommandResult

def add(commands, text):
    parser = commands.add_parser("spin", help=text)
    add_system(parser)
    return parser

def run(options, output):
    output.result("it spins for 7 s")
    return CommandResult({"system": options.system, "spins": 7.0}, {"spins": "s"})
"""
ESTIMATOR = """
from workbench.observers.estimators.open_loop import OpenLoop

class Coasting(OpenLoop):
    name, label = "coasting", "Coasting"
"""


@pytest.fixture(scope="module")
def installed(minimal_path, once) -> Path:
    """Where pip has installed the distribution."""
    files = {
        "pyproject.toml": machine_file("spinning/pyproject.toml"),
        "spinning/__init__.py": PLUGIN,
        "spinning/system.toml": machine_file("spinning/system.toml", fmu=minimal_path),
        "spinning/spin.py": COMMAND,
        "spinning/estimators/__init__.py": "",
        "spinning/estimators/coasting.py": ESTIMATOR,
    }

    def install(folder: Path) -> Path:
        sources, target = folder / "sources", folder / "installed"
        for name, text in files.items():
            (sources / name).parent.mkdir(parents=True, exist_ok=True)
            (sources / name).write_text(text)
        alone = ("--no-deps", "--no-index", "--no-build-isolation", "--quiet")
        pip = [sys.executable, "-m", "pip", "install", *alone, "--target", target, sources]
        subprocess.run(pip, check=True, capture_output=True)
        return target

    return once("plugin", install)


def output_of(*command: str, beside: Path) -> str:
    """What Python prints, with a folder of distributions beside those that are installed."""
    run = python(*command, PYTHONPATH=str(beside))
    assert run.returncode == 0, run.stderr
    return run.stdout + run.stderr


def test_its_system_is_listed_and_its_command_runs(installed):
    systems = json.loads(output_of("-m", "workbench", "systems", "--json", beside=installed))[
        "result"
    ]
    assert systems["systems"]["spinning"]["title"] == "A roller that spins down"
    assert "say how long a roller spins" in output_of("-m", "workbench", "--help", beside=installed)
    command = ("-m", "workbench", "spin", "--system", "spinning", "--json")
    assert json.loads(output_of(*command, beside=installed))["result"] == {
        "system": "spinning",
        "spins": 7.0,
    }


def test_its_estimator_is_one_of_its_system_and_of_no_other(installed):
    listing = "; ".join(
        [
            "import workbench as wb",
            "from workbench.observers import estimators_of",
            "known = [estimators_of(wb.load_system(n)) for n in ('spinning', 'wheelset')]",
            "print(['coasting' in names for names in known])",
        ]
    )
    assert output_of("-c", listing, beside=installed) == "[True, False]\n"


def test_one_that_is_broken_costs_a_warning_and_no_command(installed, tmp_path):
    broken = tmp_path / "broken-1.0.dist-info"
    broken.mkdir()
    (broken / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (broken / "entry_points.txt").write_text("[workbench.machines]\nbroken = nowhere.at_all:X\n")
    printed = output_of("-m", "workbench", "systems", beside=tmp_path)
    assert "wheelset" in printed
    assert "plugin 'nowhere.at_all:X': found ModuleNotFoundError" in printed


def test_a_plugin_that_is_not_there_is_refused(system):
    assert find_plugin(system.plugin).commands
    with pytest.raises(InputError, match=r"plugin 'not\.there:PLUGIN': found ModuleNotFoundError"):
        find_plugin("not.there:PLUGIN")
    with pytest.raises(InputError, match=r"found AttributeError: .*'NONE'"):
        find_plugin("workbench.machines.train:NONE")


def test_a_package_that_declares_none_is_read_by_module_names_with_a_warning(tmp_path, monkeypatch):
    package = tmp_path / "old_companion"
    (package / "gains").mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "planting.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.warns(FutureWarning, match=r"old_companion declares no workbench\.Plugin"):
        plugin = find_plugin("old_companion")
    assert plugin == Plugin(
        virtual_rig="old_companion.planting:virtual_rig", gains=package / "gains"
    )


def test_a_companion_is_a_plugin_with_a_warning(root, tmp_path):
    file = tmp_path / "system.toml"
    file.write_text('title = "Tanks"\ncompanion = "workbench.machines.published:CASCADED_TANKS"\n')
    with pytest.warns(FutureWarning, match=r"'companion' is called 'plugin' now"):
        assert "tanks" in published(str(file)).title
