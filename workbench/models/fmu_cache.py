"""Built FMUs, and what is known of others, kept between runs in the user's cache folder.

A folder that others may write is not used, and what is kept bears a code that takes a key of this
user's, which lies elsewhere: none but this user's processes can have written it.

The name of a kept file is the hash of all that goes into it, so that it needs no renewal and any
process may use it. What is known are hashes of FMUs that were built here, or tried and found sound:
a kept file that is not among them was damaged, and is built anew. Nothing depends on the folder:
where it cannot be written, FMUs are built and tried anew.
"""

import contextlib
import hashlib
import hmac
import multiprocessing
import os
import platform
import secrets
import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import platformdirs

from workbench.errors import InputError
from workbench.models.modelica import files, packages
from workbench.runtime.files import TemporaryFolder, write_whole
from workbench.runtime.resources import DISTRIBUTION

_KEY_SIZE = 32  # [byte], of SHA-256
_COMPILER = Path(__file__).parent / "compiler"
_CODE = (".py", ".c", ".h")
_TOOLS = (DISTRIBUTION, "rumoca", "casadi", "ziglang", "fmpy")
_MOST_KNOWN = 4096  # files of 32 bytes; a diagnosis builds some, a user has some
# Files, of 0.1 MB: more than a run of all tests asks for, which is some hundreds. As the least used
# are dropped, of a round that is longer than the cache nothing would ever be found again.
_MOST = 1024


def cache_folder() -> Path:
    """Folder of what is kept between runs and can be made anew; it may be out of reach."""
    nowhere = Path(os.devnull) / "cache"
    try:
        place = Path(platformdirs.user_cache_dir(DISTRIBUTION))
    except RuntimeError:  # a user without a home, as in some containers: nothing is kept
        return nowhere
    return place if _is_own(place) else nowhere


@cache
def _is_own(place: Path) -> bool:
    """Whether a folder is this user's, and nobody else may write there; made if it is not there."""
    if not hasattr(os, "getuid"):  # Windows: folders of users are theirs
        return True
    with contextlib.suppress(OSError):
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
    try:
        status = place.stat()
    except OSError:
        return True  # there is none
    if status.st_uid == os.getuid() and not status.st_mode & 0o022:
        return True
    if multiprocessing.parent_process() is None:
        print(
            f"warning: the cache folder {place} is not used, because others may write there; "
            f"chmod go-w {place}, or remove it",
            file=sys.stderr,
        )
    return False


def seal(*content: bytes) -> bytes:
    """Code of a content, (32) bytes, that only processes of this user can tell."""
    return hmac.digest(_key(), b"\0".join(content), "sha256")


@cache
def _key() -> bytes:
    """Key of this user, made as needed; one of this process alone where it cannot be kept."""
    made = secrets.token_bytes(_KEY_SIZE)
    with contextlib.suppress(OSError, RuntimeError):
        path = Path(platformdirs.user_data_dir(DISTRIBUTION)) / "key"
        if not path.exists():
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            handle, part = tempfile.mkstemp(dir=path.parent, suffix=".part")  # of mode 600
            try:
                with os.fdopen(handle, "wb") as stream:
                    stream.write(made)
                with contextlib.suppress(FileExistsError):  # another process was faster
                    os.link(part, path)
            finally:
                os.unlink(part)
        with path.open("rb") as stream:
            status, kept = os.fstat(stream.fileno()), stream.read()
        own = not hasattr(os, "getuid") or (
            status.st_uid == os.getuid() and not status.st_mode & 0o077
        )
        if own and len(kept) == _KEY_SIZE:
            return kept
    return made


def folder() -> Path:
    """Where built FMUs are kept."""
    return cache_folder() / "fmus"


def is_cached(path: Path) -> bool:
    """Whether a file was built to be kept here, under a name that says nothing to people."""
    return path.is_relative_to(folder())


def is_known(*names: str) -> bool:
    """Whether one of the names was remembered, by any process."""
    return any(name in _remembered() or _is_kept(name) for name in names)


def _is_kept(name: str) -> bool:
    try:
        return (_known() / name).read_bytes() == seal(name.encode())
    except OSError:
        return False


def remember(name: str) -> None:
    """Remember that an FMU is sound, by its hash."""
    _remembered().add(name)
    with contextlib.suppress(OSError, InputError):
        _known().mkdir(parents=True, exist_ok=True)
        write_whole(_known() / name, seal(name.encode()))
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
