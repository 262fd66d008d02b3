"""Temporary folders that are provably ours: each is held by a lock for as long as it is used.

The system drops the lock with the process, however that ends, so that a folder without a holder
is one that nobody can miss. The next process to make one removes it.
"""

import os
import shutil
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from functools import cache
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: folders go with their users, but not after a kill
    fcntl = None  # type: ignore[assignment]

_PREFIX = "workbench-"
_MARK = ".scratch"  # in every folder that is ours: a name alone is no proof
# Longer paths leave no room for sockets of processes that start others, PLACE/workbench-12345678/
# pymp-12345678/listener-12345678, which the system limits to 104 bytes.
_LONGEST = 104 - 52
_SHORT = "/tmp"


class Scratch:
    """A temporary folder, removed by `close` or with the process.

    Parameters
    ----------
    place : folder that it is made in; the usual one unless another is given.

    Attributes
    ----------
    path : of the folder.
    """

    def __init__(self, place: str | None = None) -> None:
        place = place or tempfile.gettempdir()
        sweep(place)
        lock = None
        while lock is None:
            self.path = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=place))
            if fcntl is None:
                break
            (self.path / _MARK).touch()
            # One who sweeps may have been faster; then it is gone.
            lock = _held(self.path, wait=True)
        self._close = weakref.finalize(self, _remove, self.path, lock, os.getpid())

    def close(self) -> None:
        """Remove the folder."""
        self._close()


@contextmanager
def scratch_folder() -> Iterator[str]:
    """Path of a temporary folder of ours, for as long as the context lasts."""
    with closing(Scratch()) as scratch:
        yield str(scratch.path)


@contextmanager
def own_temporary_files() -> Iterator[Path]:
    """Have all temporary files of this process and its children in a folder of ours."""
    before = tempfile.tempdir, os.environ.get("TMPDIR")
    place = tempfile.gettempdir()
    short = len(place) > _LONGEST and os.path.isdir(_SHORT)
    with closing(Scratch(_SHORT if short else place)) as scratch:
        tempfile.tempdir = os.environ["TMPDIR"] = str(scratch.path)
        try:
            yield scratch.path
        finally:
            tempfile.tempdir = before[0]
            if before[1] is None:
                del os.environ["TMPDIR"]
            else:
                os.environ["TMPDIR"] = before[1]


@cache
def sweep(place: str) -> None:
    """Remove folders of ours that nobody holds, once in the life of a process."""
    if fcntl is None:
        return
    for folder in (mark.parent for mark in Path(place).glob(f"{_PREFIX}*/{_MARK}")):
        with suppress(OSError):
            lock = _held(folder, wait=False)
            if lock is not None:
                _remove(folder, lock, os.getpid())


def _held(folder: Path, *, wait: bool) -> int | None:
    """Descriptor that holds the lock of a folder; None if the folder is not there or not ours.

    Raises
    ------
    OSError
        If another holds it and we do not wait.
    """
    try:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        found = os.fstat(lock)
        if found.st_uid == os.getuid() and os.path.samestat(found, folder.lstat()):
            return lock
    except FileNotFoundError:
        pass
    except OSError:
        os.close(lock)
        raise
    os.close(lock)
    return None


def _remove(folder: Path, lock: int | None, owner: int) -> None:
    if os.getpid() != owner:
        return  # a fork has a copy of what holds the folder, but does not own it
    shutil.rmtree(folder, ignore_errors=True)
    if lock is not None:
        os.close(lock)
