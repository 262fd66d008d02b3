"""Where there is no fork, no lock of files and no limit of processes, commands do their work."""

import shutil

import pytest

from workbench.system.template import write_system

from .processes import ELSEWHERE, ROOT, python


@pytest.fixture
def machine(tmp_path):
    """The system of the template, with a log file beside it."""
    write_system(tmp_path / "tank")
    shutil.copy(
        tmp_path / "tank" / "recordings" / "01_steps" / "measured.csv", tmp_path / "log.csv"
    )
    return tmp_path


@pytest.mark.parametrize(
    ("command", "result"),
    [
        ("import log.csv --system tank --out cases --yes", "cases/log/case.toml"),
        ("simulate --system tank --out out", "out/index.html"),
        pytest.param("diagnose --system tank --out out", "out/index.html", marks=pytest.mark.long),
        pytest.param(
            f"fmu check {ROOT / 'fmus' / 'fmi2' / 'MinimalObserver.fmu'} --instantiations 9",
            "",
            marks=pytest.mark.long,
        ),
    ],
    ids=lambda value: value.partition(" ")[0],
)
def test_a_command_does_its_work_without_fork_locks_and_limits(machine, command, result):
    process = python("-m", "workbench", *command.split(), cwd=machine, PYTHONPATH=ELSEWHERE)
    assert process.returncode == 0, process.stderr
    assert (machine / result).exists()
