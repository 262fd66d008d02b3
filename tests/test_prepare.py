"""Published recordings become case folders: checked, described, and the same from each layout."""

import importlib
import json
from collections.abc import Callable
from pathlib import Path

import pytest

import workbench as wb
from workbench.__main__ import main
from workbench.errors import InputError
from workbench.recordings.datasets import PREPARED, write_cases

TANKS = ("estimation/measured.csv", "test/measured.csv")
PUMPS = """
import hashlib
from pathlib import Path
import numpy as np
from workbench import Plugin
from workbench.recordings.datasets import FolderLayout, PublishedSet, PublishedRecording

def read(folder):
    names = (folder / "pumps.txt").read_text().split()
    columns = {"time [s]": np.arange(3.0), "p [bar]": np.ones(3)}
    made = lambda name: PublishedRecording(
        name, name, columns, "pumps.txt", (0, 2), held_out="test" in name, machine=name[0]
    )
    return [made(name) for name in names]

def layout(names):
    checksum = hashlib.sha256(" ".join(names).encode()).hexdigest()
    return FolderLayout("a list", {"pumps.txt": checksum}, read)

PLUGIN = Plugin(published=f"{__name__}:PUBLISHED")
PUBLISHED = PublishedSet("Pumps", "a shop", "none", "Pumps.", (layout(NAMES),))
"""


@pytest.fixture
def pumps(tmp_path, monkeypatch) -> Callable[..., Path]:
    """Publishes recordings of pumps by names; returns the system file."""
    monkeypatch.syspath_prepend(str(tmp_path / "modules"))
    (tmp_path / "modules").mkdir()
    (tmp_path / "set").mkdir()

    def publish(*names: str) -> Path:
        number = len(list((tmp_path / "modules").glob("*.py")))
        module = tmp_path / "modules" / f"{tmp_path.name}_{number}.py"
        module.write_text(PUMPS.replace("NAMES", repr(names)))
        (tmp_path / "set" / "pumps.txt").write_text(" ".join(names))
        (tmp_path / "system.toml").write_text(f'title = "Pumps"\nplugin = "{module.stem}:PLUGIN"\n')
        importlib.invalidate_caches()
        return tmp_path / "system.toml"

    return publish


def test_each_machine_of_a_set_has_its_own_next_command(pumps, tmp_path, capsys):
    system = str(pumps("a_1", "a_test", "b_1"))
    out = tmp_path / "cases"
    assert main(["prepare", system, "--from", str(tmp_path / "set"), "--out", str(out)]) == 0
    _, *commands = capsys.readouterr().out.splitlines()
    diagnose = f"next: workbench diagnose --system {system}"
    assert commands == [
        f"{diagnose} {out}/a_1 {out}/a_test --held-out a_test",
        f"{diagnose} {out}/b_1",
    ]


def test_a_single_machine_has_one_command_with_the_whole_folder(pumps, tmp_path, capsys):
    system = str(pumps("a_1", "a_test"))
    out = tmp_path / "cases"
    assert main(["prepare", system, "--from", str(tmp_path / "set"), "--out", str(out)]) == 0
    (command,) = capsys.readouterr().out.splitlines()[1:]
    assert command == f"next: workbench diagnose --system {system} {out} --held-out a_test"


def test_cases_of_an_earlier_run_go_unless_somebody_changed_them(pumps, tmp_path):
    out = tmp_path / "cases"
    write_cases(str(pumps("a_1", "a_2", "a_3", "a_4")), tmp_path / "set", out)
    (out / "a_2" / "measured.csv").write_text("mine")
    (out / "a_3" / "notes.txt").write_text("mine")
    (out / "mine").mkdir()
    write_cases(str(pumps("a_1")), tmp_path / "set", out)
    left = {str(path.relative_to(out)) for path in out.rglob("*")}
    assert left == {
        *("prepared.json", "mine", "a_1", "a_1/case.toml", "a_1/measured.csv"),
        *("a_2", "a_2/measured.csv", "a_3", "a_3/notes.txt"),
    }


def test_a_set_says_where_it_is_to_be_had(capsys):
    assert main(["prepare", "cascaded_tanks"]) == 0
    printed = capsys.readouterr().out
    for part in ("https://doi.org/10.4121/12960104", "CC BY-SA 4.0", "dataBenchmark.mat"):
        assert part in printed


def test_a_system_whose_recordings_nobody_published_says_so():
    with pytest.raises(InputError, match="no plugin that knows of published recordings"):
        write_cases("wheelset", Path(), Path())


def test_a_file_with_another_checksum_is_refused(tmp_path):
    for name in TANKS:
        (tmp_path / "set" / name).parent.mkdir(parents=True)
        (tmp_path / "set" / name).write_text("time [s],pump [V],level2 [V]\n0,1,2\n")
    with pytest.raises(InputError, match=r"estimation/measured.csv: found another file \(SHA-256"):
        write_cases("cascaded_tanks", tmp_path / "set", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_set_that_is_not_complete_is_refused(tmp_path):
    (tmp_path / "test").mkdir()
    (tmp_path / TANKS[1]).write_text("")
    with pytest.raises(InputError, match=r"estimation/measured\.csv: found no such file"):
        write_cases("cascaded_tanks", tmp_path, tmp_path / "out")


def test_a_folder_without_the_set_says_what_it_lacks(tmp_path):
    with pytest.raises(InputError, match=r"a folder with dataBenchmark\.mat or estimation"):
        write_cases("cascaded_tanks", tmp_path, tmp_path / "out")


def test_a_folder_with_other_files_is_left_as_it_is(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="a folder with other files"):
        write_cases("cascaded_tanks", tmp_path / "set", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_what_was_read_and_cut_is_told_to_machines(tmp_path, published):
    for _ in range(2):  # over its own files it writes again
        write_cases("cascaded_tanks", published("cascaded_tanks"), tmp_path)
    written = json.loads((tmp_path / PREPARED).read_text())
    assert written["licence"] == "CC BY-SA 4.0"
    assert list(written["read"]) == ["dataBenchmark.mat"]
    assert written["cases"].keys() == {"estimation", "test"}
    assert written["held_out"] == ["test"]
    assert written["cases"]["test"]["rows"] == [0, 1023]


def test_a_script_gets_recordings_to_fit_and_those_held_out(tmp_path, published):
    fitted, held_out = wb.prepare_cases("cascaded_tanks", published("cascaded_tanks"), tmp_path)
    assert [case.name for case in fitted] == ["estimation"]
    assert [case.name for case in held_out] == ["test"]
