"""Compiled code is kept whole or made again, whatever happened to the folder it is kept in."""

import hashlib
import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from workbench.__main__ import main
from workbench.models import fmu_cache, jit
from workbench.models.compiler import source_hash
from workbench.runtime.resources import fmus
from workbench.system.installed import built_models

from .processes import ELSEWHERE, LONGEST, ROOT, python, running

PROGRAM = """
import numba
import numpy as np
before = {key: getattr(numba.config, key) for key in dir(numba.config) if key.isupper()}
from workbench.models import native
a = np.array([[2.0, 0.0, 2.0], [0.0, 4.0, 2.0]])
assert native.solve(a) == 0 and a[:, 2].tolist() == [1.0, 0.5]
hits, misses = (sum(counted.values()) for counted in native.solve.entry.stats[1:])
assert hits + misses == 1
assert before == {key: getattr(numba.config, key) for key in before}  # the user's own
print(hits, "kept")
"""

# One that does not end what it compiles, while a test may wait.
DYING = (
    """
import time
from numba.core.dispatcher import _FunctionCompiler
def compile(*given):
    print("compiling", flush=True)
    time.sleep(60)
_FunctionCompiler.compile = compile
"""
    + PROGRAM
)


@pytest.fixture
def home() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="w-") as folder:
        yield Path(folder)


def started(
    home: str | Path | None, program: str = PROGRAM, **more: str
) -> AbstractContextManager[subprocess.Popen[str]]:
    """A program that solves by compiled code."""
    at = {"HOME": None if home is None else str(home), "XDG_CACHE_HOME": None}
    return running("-c", program, cwd="/", **{**at, **more})


def solved(home: str | Path | None, program: str = PROGRAM, **more: str) -> str:
    with started(home, program, **more) as process:
        out, errors = process.communicate(timeout=LONGEST)
    assert (process.returncode, errors) == (0, "")
    return out.strip()


def files(home: Path) -> list[Path]:
    return sorted(home.rglob("native.solve*.code"))


def test_kept_code_is_used_and_damaged_code_is_made_again(home):
    assert solved(home) == "0 kept"
    assert solved(home) == "1 kept"
    (file,) = files(home)
    folder = next(path for path in file.parents if path.name == "observer-workbench")
    assert [*folder.parent.iterdir()] == [folder]
    whole = file.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 1
    for damaged in (whole[:-100], b"", bytes(flipped)):
        file.write_bytes(damaged)
        assert solved(home) == "0 kept"
        assert file.read_bytes() != damaged
    assert solved(home) == "1 kept"


class Malice:
    """Makes a file when it is unpickled."""

    def __init__(self, place: Path) -> None:
        self.place = place

    def __reduce__(self) -> tuple[object, ...]:
        return Path.touch, (self.place,)


@pytest.mark.skipif(os.name != "posix", reason="modes of files are those of POSIX")
def test_code_that_another_wrote_is_not_unpickled(home):
    """With a checksum that anybody can make; nor is a folder used that others may write."""
    assert solved(home) == "0 kept"
    (file,) = files(home)
    content = pickle.dumps(Malice(home / "harmed"))
    folder = next(path for path in file.parents if path.name == "observer-workbench")
    for mode in (0o700, 0o777, 0o730):
        file.write_bytes(hashlib.sha256(content).digest() + content)
        folder.chmod(mode)
        with started(home) as process:
            out, errors = process.communicate(timeout=LONGEST)
        assert out == "0 kept\n"
        assert (f"the cache folder {folder} is not used" in errors) == (mode != 0o700)
        assert not (home / "harmed").exists()


@pytest.mark.parametrize(
    "name", ["observers/estimators/kalman.py", "models/native.py", "models/jit.py"]
)
def test_code_is_made_again_when_what_makes_it_changes(name, tmp_path, monkeypatch):
    """A law, what all laws call, and what compiles them."""
    package = tmp_path / "workbench"
    shutil.copytree(ROOT / "workbench", package)
    monkeypatch.setattr(jit, "_PACKAGE", package)
    before = jit._folder.__wrapped__()
    assert jit._folder.__wrapped__() == before
    with (package / name).open("a") as source:
        source.write("# changed\n")
    assert jit._folder.__wrapped__() != before


@pytest.mark.parametrize("path", [str(ROOT), ELSEWHERE], ids=["posix", "elsewhere"])
def test_what_two_processes_need_at_once_is_compiled_by_one(home, path):
    with started(home, PYTHONPATH=path) as first, started(home, PYTHONPATH=path) as other:
        outputs = [process.communicate(timeout=LONGEST) for process in (first, other)]
    assert sorted(outputs) == [("0 kept\n", ""), ("1 kept\n", "")]
    names = {file.name for file in home.rglob("*") if file.is_file()}
    assert {Path(name).suffix for name in names - {"turns", "key"}} == {".code"}


def test_the_lock_of_one_that_died_is_of_no_effect_once_it_is_old(tmp_path, monkeypatch):
    monkeypatch.setattr(jit, "fcntl", None)
    left, lock = tmp_path / "function.lock", jit._CompileLock(tmp_path / "function.code")
    left.touch()
    os.utime(left, times=(0.0, 0.0))
    begin = time.monotonic()
    lock.acquire()
    assert time.monotonic() - begin < jit._PATIENCE / 2.0  # it did not wait for the other
    assert left.exists()  # now its own
    lock.release()
    assert not left.exists()


@pytest.mark.skipif(os.name != "posix", reason="where a lock is a file, it has to become old")
def test_who_dies_while_it_compiles_leaves_the_turn_to_the_next(home):
    with started(home, program=DYING) as first:
        assert first.stdout.readline() == "compiling\n"
        with started(home) as second:
            with pytest.raises(subprocess.TimeoutExpired):
                second.wait(timeout=5)
            first.kill()
            assert second.communicate(timeout=LONGEST) == ("0 kept\n", "")


@pytest.mark.parametrize("home", ["/dev/null", "/proc", "", None])
def test_without_a_place_to_keep_it_code_is_compiled_in_each_process(home):
    """A file, a folder that nothing can be made in, none at all."""
    given = {"XDG_CACHE_HOME": "/dev/null/cache"} if not home else {}
    assert solved(home, **given) == "0 kept"


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="takes another user's part")
def test_a_user_without_a_home_keeps_nothing():
    program = (
        "import os, platformdirs, workbench.models.fmu_cache\n"
        "os.setuid(54321)\n"  # of nobody
        "cache = workbench.models.fmu_cache\n"
        "print(cache.is_known('name'), cache.cache_folder().is_dir())"
    )
    run = python("-c", program, cwd="/", HOME=None, XDG_CACHE_HOME=None)
    assert (run.stdout, run.stderr) == ("False False\n", "")


@pytest.mark.skipif(sys.platform != "linux", reason="confines itself to reading by Landlock")
def test_a_folder_that_can_only_be_read_is_used(home):
    reading = f"from workbench.runtime.supervision import confine; confine([]); exec({PROGRAM!r})"
    assert solved(home, reading) == "0 kept"
    assert solved(home) == "0 kept"
    assert solved(home, reading) == "1 kept"


# --- built FMUs ---


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
    assert {
        path.relative_to(fmus()).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in fmus().rglob("*.fmu")
    } == {name: entry["sha256"] for name, entry in manifest["fmus"].items()}


@pytest.mark.long
def test_fmus_match_their_sources():
    """Builds all of them for all platforms, unless this machine has built these sources before."""
    assert main(["fmu", "build", "--all", "--check"]) == 0


def test_code_of_the_states_that_were_used_last_is_kept(tmp_path, monkeypatch):
    package = tmp_path / "package"
    package.mkdir()
    monkeypatch.setattr(jit, "_PACKAGE", package)
    monkeypatch.setattr(jit, "cache_folder", lambda: tmp_path / "cache")
    states = []
    for number in range(jit._STATES + 2):
        (package / "law.py").write_text(f"import numba  # {number}")
        states.append(jit._folder.__wrapped__())
        os.utime(states[-1], (number, number))  # as used so long ago
        if number == jit._STATES:  # the first is dropped, the second is used again
            (package / "law.py").write_text("import numba  # 1")
            assert jit._folder.__wrapped__() == states[1]
    kept = {path for path in states if path.exists()}
    assert kept == {*states} - {states[0], states[2]}
