"""A long command that is ended at a random moment goes on to the results of one that is not.

`make chaos` does so two hundred times, with other commands and kills, and asks for more: no words
of Python's, and no file that stays.
"""

from pathlib import Path
from random import Random

import pytest

from tests.chaos import harness
from tests.chaos.commands import commands
from tests.chaos.harness import Command, Undisturbed, can_starve, disturb, undisturbed
from tests.processes import comes_true


@pytest.fixture(scope="module")
def tune(tmp_path_factory) -> Undisturbed:
    folder = tmp_path_factory.mktemp("tune")
    command, *_ = commands(folder / "cases")
    return undisturbed(command, folder)


# `test_tune` kills.
@pytest.mark.long
@pytest.mark.parametrize("disturbance", ["interrupt", "full disk"])
def test_a_tuning_that_is_ended_goes_on_to_the_same_gains_and_leaves_no_process(
    disturbance, tune, tmp_path
):
    if disturbance == "full disk" and not can_starve():
        pytest.skip("this machine lets users mount no disk of their own")
    failures = disturb(tune, disturbance, Random(disturbance), tmp_path)
    assert [
        str(failure) for failure in failures if failure.event in ("end", "process", "results")
    ] == []


# --- what the harness itself must not miss ---

TOY = """\
import pathlib, signal, subprocess, sys, tempfile, time
signal.signal(signal.SIGINT, signal.default_int_handler)
out = pathlib.Path(sys.argv[1])
again = out.exists()
out.mkdir(exist_ok=True)
{begins}
try:
    (out / "r").write_text(f"{{{wrote}}}")
    time.sleep(0.1 if again else 60.0)
except KeyboardInterrupt:
    {ends}
"""
STAYS = "subprocess.Popen(['sh', '-c', 'trap : INT; sleep 5; sleep 5'])"


@pytest.mark.parametrize(
    ("begins", "wrote", "ends", "what"),
    [
        ("", "1", "sys.exit(130)", set()),
        ("tempfile.mkdtemp()", "1", "sys.exit(130)", {"files"}),
        ("again or " + STAYS, "1", "sys.exit(130)", {"process"}),
        ("", "1", "raise", {"words"}),
        ("", "again", "sys.exit(130)", {"results"}),
    ],
    ids=["nothing", "leaves a file", "leaves a process", "traceback", "other results"],
)
def test_what_an_ended_command_must_not_do_is_named(
    begins, wrote, ends, what, tmp_path, monkeypatch
):
    monkeypatch.setattr(harness, "comes_true", lambda condition: condition())  # waits for none
    (tmp_path / "toy.py").write_text(TOY.format(begins=begins, wrote=wrote, ends=ends))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    command = Command("toy", ("toy",), (), lambda out: (out / "r").read_text())
    usual = Undisturbed(command, "False" if wrote == "again" else "1", 1.0)
    failures = disturb(usual, "interrupt", _Moment(tmp_path / "out" / "r"), tmp_path)
    assert {failure.event for failure in failures} == what


class _Moment(Random):
    """Draws a moment soon after a file is there."""

    def __init__(self, file: Path) -> None:
        super().__init__(1)
        self._file = file

    def uniform(self, a: float, b: float) -> float:
        assert comes_true(self._file.exists)
        return 0.1 * (b - a)
