"""Built FMUs are kept between runs, and those of the repository are what its sources give."""

import hashlib
import json
from pathlib import Path

import pytest

from workbench.__main__ import main
from workbench.models import fmu_cache
from workbench.models.compiler import source_hash
from workbench.runtime.resources import fmus
from workbench.system.installed import built_models


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setattr(fmu_cache.platformdirs, "user_cache_dir", lambda name: str(tmp_path / name))
    return fmu_cache.folder()


@pytest.fixture
def library(tmp_path) -> Path:
    folder = tmp_path / "Library"
    folder.mkdir()
    (folder / "package.mo").write_text("package Library end Library;")
    return folder


def test_what_was_built_before_is_not_built_again(cache, tmp_path):
    built = []

    def make(path: Path) -> None:
        built.append(path)
        path.write_bytes(b"an FMU")

    for target in (tmp_path / "one.fmu", tmp_path / "two.fmu"):
        fmu_cache.fetch("name", target, make)
        assert target.read_bytes() == b"an FMU"
    assert built == [tmp_path / "one.fmu"]
    assert [file.name for file in cache.iterdir()] == ["name.fmu"]


@pytest.mark.parametrize("content", [b"", b"an FM", b"AN FMU"])
def test_what_was_damaged_is_built_again(cache, tmp_path, content):
    def make(path: Path) -> None:
        path.write_bytes(b"an FMU")

    fmu_cache.fetch("name", tmp_path / "one.fmu", make)
    (cache / "name.fmu").write_bytes(content)
    fmu_cache.fetch("name", tmp_path / "two.fmu", make)
    assert (tmp_path / "two.fmu").read_bytes() == b"an FMU"
    assert fmu_cache.keep("name", make).read_bytes() == b"an FMU"
    (cache / "name.fmu").write_bytes(content)
    assert fmu_cache.keep("name", make).read_bytes() == b"an FMU"


def test_a_change_of_library_or_model_is_another_fmu(library):
    package = library / "package.mo"
    before = fmu_cache.key(package, "Model", "model Model end Model;")
    assert before == fmu_cache.key(package, "Model", "model Model end Model;")
    assert before != fmu_cache.key(package, "Model", "model Model Real x; end Model;")
    package.write_text("package Library constant Real c = 1; end Library;")
    assert before != fmu_cache.key(package, "Model", "model Model end Model;")


def test_a_cache_that_cannot_be_written_costs_only_time(cache, tmp_path):
    cache.parent.rmdir()
    cache.parent.write_text("a file where the folder should be")
    fmu_cache.fetch("name", tmp_path / "one.fmu", lambda path: path.write_bytes(b"an FMU"))
    assert (tmp_path / "one.fmu").read_bytes() == b"an FMU"


def test_the_least_used_are_dropped(cache, tmp_path, monkeypatch):
    monkeypatch.setattr(fmu_cache, "_MOST", 8)
    for number in range(12):
        fmu_cache.fetch(f"{number}", tmp_path / "a.fmu", lambda path: path.write_bytes(b"an FMU"))
    assert len(list(cache.iterdir())) == 8
    assert (cache / "11.fmu").exists()


def test_a_build_that_fails_keeps_nothing(cache, tmp_path):
    def fail(path: Path) -> None:
        raise ValueError("no such class")

    with pytest.raises(ValueError, match="no such class"):
        fmu_cache.fetch("name", tmp_path / "one.fmu", fail)
    assert not cache.exists()


def test_fmus_are_those_of_their_manifest_and_it_is_of_these_sources():
    """Libraries and the compiler, whose code is among the sources; nothing is built."""
    manifest = json.loads((fmus() / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["source_sha256"] == source_hash(*built_models())
    held = {
        path.relative_to(fmus()).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in fmus().rglob("*.fmu")
    }
    assert held == {name: one["sha256"] for name, one in manifest["fmus"].items()}


@pytest.mark.long
def test_fmus_match_their_sources():
    """Builds all of them for all platforms, unless this machine has built these sources before."""
    assert main(["fmu", "build", "--all", "--check"]) == 0
