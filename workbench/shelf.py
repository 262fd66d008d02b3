"""Built FMUs, kept between runs in the user's cache folder.

The name of a kept file is the hash of all that goes into it, so that it needs no renewal and any
process may use it. Nothing depends on the folder: where it cannot be written, FMUs are built anew.
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

from workbench.modelica import files, packages

_COMPILER = Path(__file__).parent / "compiler"
_CODE = (".py", ".c", ".h")
_TOOLS = ("wheelset-workbench", "rumoca", "casadi", "ziglang", "fmpy")
_MOST = 128  # files, of 0.1 to 0.5 MB: the claims of all libraries, and some months' recordings


def folder() -> Path:
    """Where built FMUs are kept."""
    return Path(platformdirs.user_cache_dir("wheelset-workbench")) / "fmus"


def key(library: Path, *parts: str) -> str:
    """Hash of a Modelica library, of the compiler and of what else an FMU is made from.

    Parameters
    ----------
    library : its file; the libraries that it uses count, too.
    parts : such as the name and the source of a model that extends it.
    """
    digest = hashlib.sha256()
    found = [(package.parent, files(package)) for package in packages(library)]
    found.append((_COMPILER, tuple(p for p in sorted(_COMPILER.rglob("*")) if p.suffix in _CODE)))
    for root, inside in found:
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
    if kept.is_file():
        with contextlib.suppress(OSError):
            os.utime(kept)
        return kept
    part = Path(_scratch().name) / f"{name}.fmu"
    if not part.is_file():
        fetch(name, part, make)
    return kept if kept.is_file() else part


@cache
def _scratch() -> "tempfile.TemporaryDirectory[str]":
    return tempfile.TemporaryDirectory(prefix="fmus-", ignore_cleanup_errors=True)


def fetch(name: str, path: Path, make: Callable[[Path], object]) -> None:
    """Write an FMU to `path`: the one that is kept under a name, else what `make` writes.

    Parameters
    ----------
    name : of `key`.
    make : builds the FMU at the path that it is given.
    """
    kept = folder() / f"{name}.fmu"
    with contextlib.suppress(OSError):
        shutil.copyfile(kept, path)
        os.utime(kept)  # of use, which decides what is dropped
        return
    make(path)
    # Another process may keep the same file, or drop it, at any time: it appears whole or not.
    with contextlib.suppress(OSError):
        kept.parent.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=kept.parent, suffix=".part")
        os.close(handle)
        shutil.copyfile(path, part)
        Path(part).replace(kept)
        every = sorted(kept.parent.iterdir(), key=lambda file: -file.stat().st_mtime)
        for old in every[_MOST:]:
            old.unlink()
