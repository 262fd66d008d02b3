"""Published recordings become case folders: checked, described, and the same from each layout."""

import json
from pathlib import Path

import pytest

import workbench as wb
from workbench.__main__ import main
from workbench.errors import InputError
from workbench.prepare import PREPARED, write_cases

TANKS = ("estimation/measured.csv", "test/measured.csv")


def test_a_set_says_where_it_is_to_be_had(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prepare", "cascaded_tanks"]) == 0
    told = capsys.readouterr().out
    for part in ("https://doi.org/10.4121/12960104", "CC BY-SA 4.0", "dataBenchmark.mat"):
        assert part in told


def test_a_system_whose_recordings_nobody_published_says_so() -> None:
    with pytest.raises(InputError, match="no companion that knows of published recordings"):
        write_cases("wheelset", Path(), Path())


def test_a_file_with_another_checksum_is_refused(tmp_path: Path) -> None:
    for name in TANKS:
        (tmp_path / "set" / name).parent.mkdir(parents=True)
        (tmp_path / "set" / name).write_text("time [s],pump [V],level2 [V]\n0,1,2\n")
    with pytest.raises(InputError, match=r"estimation/measured.csv: found another file \(SHA-256"):
        write_cases("cascaded_tanks", tmp_path / "set", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_set_that_is_not_complete_is_refused(tmp_path: Path) -> None:
    (tmp_path / "test").mkdir()
    (tmp_path / TANKS[1]).write_text("")
    with pytest.raises(InputError, match=r"estimation/measured\.csv: found no such file"):
        write_cases("cascaded_tanks", tmp_path, tmp_path / "out")


def test_a_folder_without_the_set_says_what_it_lacks(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a folder with dataBenchmark\.mat or estimation"):
        write_cases("cascaded_tanks", tmp_path, tmp_path / "out")


def test_a_folder_with_other_files_is_left_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="a folder with other files"):
        write_cases("cascaded_tanks", tmp_path / "set", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_what_was_read_and_cut_is_told_to_machines(tmp_path: Path, root: Path) -> None:
    tanks = root.parent / "shared" / "recordings" / "real" / "cascaded_tanks"
    if not tanks.exists():
        pytest.skip("the recordings are not at hand")
    for _ in range(2):  # over its own files it writes again
        write_cases("cascaded_tanks", tanks, tmp_path)
    told = json.loads((tmp_path / PREPARED).read_text())
    assert told["licence"] == "CC BY-SA 4.0"
    assert list(told["read"]) == ["dataBenchmark.mat"]
    assert told["cases"].keys() == {"estimation", "test"}
    assert told["held_out"] == ["test"]
    assert told["cases"]["test"]["rows"] == [0, 1023]


def test_a_script_gets_recordings_to_fit_and_those_held_out(tmp_path: Path, root: Path) -> None:
    tanks = root.parent / "shared" / "recordings" / "real" / "cascaded_tanks"
    if not tanks.exists():
        pytest.skip("the recordings are not at hand")
    fitted, held_out = wb.prepare_cases("cascaded_tanks", tanks, tmp_path)
    assert [case.name for case in fitted] == ["estimation"]
    assert [case.name for case in held_out] == ["test"]
