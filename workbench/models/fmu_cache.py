"""Built FMUs, and what is known of others, kept between runs in the user's cache folder.

The name of a kept file is the hash of all that goes into it, so that it needs no renewal and any
process may use it. What is known are hashes of FMUs that were built here, or tried and found sound:
a kept file that is not among them was damaged, and is built anew. Nothing depends on the folder:
where it cannot be written, FMUs are built and tried anew.
"""

import contextlib
import hashlib
import os
import platform
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import platformdirs

from workbench.models.modelica import files, packages
from workbench.runtime.files import TemporaryFolder

_COMPILER = Path(__file__).parent / "compiler"
_CODE = (".py", ".c", ".h")
_TOOLS = ("wheelset-workbench", "rumoca", "casadi", "ziglang", "fmpy")
_MOST_KNOWN = 4096  # empty files; a diagnosis builds some, a user has some
# Files, of 0.1 MB: more than a run of all tests asks for, which is some hundreds. As the least used
# are dropped, of a round that is longer than the cache nothing would ever be found again.
_MOST = 1024


def cache_folder() -> Path:
    """Folder of what is kept between runs and can be made anew; it may be out of reach."""
    try:
        return Path(platformdirs.user_cache_dir("wheelset-workbench"))
    except RuntimeError:  # a user without a home, as in some containers: nothing is kept
        return Path(os.devnull) / "cache"


def folder() -> Path:
    """Where built FMUs are kept."""
    return cache_folder() / "fmus"


def is_known(*names: str) -> bool:
    """Whether one of the names was remembered, by any process."""
    return any(name in _remembered() or (_known() / name).is_file() for name in names)


def remember(name: str) -> None:
    """Remember that an FMU is sound, by its hash."""
    _remembered().add(name)
    with contextlib.suppress(OSError):
        _known().mkdir(parents=True, exist_ok=True)
        (_known() / name).touch()
        _drop(_known(), _MOST_KNOWN)


def _known() -> Path:
    return cache_folder() / "known"


@cache
def _remembered() -> set[str]:
    """What this process knows, where nothing can be kept."""
    return set()


def _drop(place: Path, most: int) -> None:
    """Drop the files that were not used for the longest time."""
    every = sorted(place.iterdir(), key=lambda file: -file.stat().st_mtime)
    for old in every[most:]:
        old.unlink()


def _is_whole(kept: Path) -> bool:
    """Whether a kept file is there, and as it was built."""
    try:
        return is_known(hashlib.sha256(kept.read_bytes()).hexdigest())
    except OSError:
        return False


def key(library: Path, *parts: str) -> str:
    """Hash of a Modelica library, of the compiler and of what else an FMU is made from.

    Parameters
    ----------
    library : its file; the libraries that it uses count, too.
    parts : such as the name and the source of a model that extends it.
    """
    digest = hashlib.sha256()
    sources = [(package.parent, files(package)) for package in packages(library)]
    sources.append((_COMPILER, tuple(p for p in sorted(_COMPILER.rglob("*")) if p.suffix in _CODE)))
    for root, inside in sources:
        for file in inside:
            for part in (file.relative_to(root).as_posix().encode(), file.read_bytes()):
                digest.update(len(part).to_bytes(8, "little") + part)
    for text in (*parts, platform.system(), platform.machine(), *map(_version, _TOOLS)):
        digest.update(len(text.encode()).to_bytes(8, "little") + text.encode())
    return digest.hexdigest()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def keep(name: str, make: Callable[[Path], object]) -> Path:
    """Path of the FMU that is kept under a name, written by `make` if there is none yet.

    Where the folder cannot be written, it is in a temporary one, for as long as this process runs.
    """
    kept = folder() / f"{name}.fmu"
    if _is_whole(kept):
        with contextlib.suppress(OSError):
            os.utime(kept)
        return kept
    part = _scratch().path / f"{name}.fmu"
    if not part.is_file():
        fetch(name, part, make)
    return kept if _is_whole(kept) else part


@cache
def _scratch() -> TemporaryFolder:
    return TemporaryFolder()


def fetch(name: str, path: Path, make: Callable[[Path], object]) -> None:
    """Write an FMU to `path`: the one that is kept under a name, else what `make` writes.

    Parameters
    ----------
    name : of `key`.
    make : builds the FMU at the path that it is given.
    """
    kept = folder() / f"{name}.fmu"
    if _is_whole(kept):
        with contextlib.suppress(OSError):
            shutil.copyfile(kept, path)
            os.utime(kept)  # of use, which decides what is dropped
            return
    make(path)
    remember(hashlib.sha256(path.read_bytes()).hexdigest())
    # Another process may keep the same file, or drop it, at any time: it appears whole or not.
    with contextlib.suppress(OSError):
        kept.parent.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=kept.parent, suffix=".part")
        os.close(handle)
        try:
            shutil.copyfile(path, part)
            Path(part).replace(kept)
        finally:
            Path(part).unlink(missing_ok=True)
        _drop(kept.parent, _MOST)
