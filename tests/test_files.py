"""Files are as before or complete."""

import json
import os

import pytest

from workbench.errors import InputError
from workbench.runtime.files import replacing, write_json, write_whole


def test_text_bytes_and_json_are_written_in_folders_made_as_needed(tmp_path):
    folder = tmp_path / "a" / "b"
    write_whole(folder / "text", "µ\n")
    write_whole(folder / "bytes", b"\x00\n")
    write_json(folder / "json", {"µ": [1.5, None]})
    assert (folder / "text").read_bytes() == "µ\n".encode()
    assert (folder / "bytes").read_bytes() == b"\x00\n"
    assert json.loads((folder / "json").read_text()) == {"µ": [1.5, None]}
    assert sorted(file.name for file in folder.iterdir()) == ["bytes", "json", "text"]


def test_what_fails_half_way_leaves_the_file_as_it_was(tmp_path):
    path = tmp_path / "result"
    write_whole(path, "before")

    def half() -> None:
        with replacing(path) as stream:
            stream.write(b"aft")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        half()
    assert path.read_text() == "before"
    assert [file.name for file in tmp_path.iterdir()] == ["result"]


def test_a_full_disk_is_told_and_keeps_the_file_before(tmp_path, monkeypatch):
    path = tmp_path / "result"
    write_whole(path, "before")

    def refuse(number: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(InputError, match=r"result: found .*No space left on device"):
        write_whole(path, "after")
    assert path.read_text() == "before"
    assert [file.name for file in tmp_path.iterdir()] == ["result"]


def test_a_place_that_is_no_folder_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_whole(tmp_path / "file" / "result", "content")
