"""Results on the disk: a file is as before or complete, whatever happens while it is written."""

import hashlib
import json
import math
import os
import re
import shutil
import stat
import sys
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, BinaryIO

from workbench.errors import InputError

try:
    import fcntl
except ImportError:  # Windows locks no folders: there a second run is not refused
    fcntl = None  # type: ignore[assignment]

_ROOM = 5_000_000  # [byte] of a page with its curves, the largest of the usual results
_SEAL = "checksum"  # SHA-256, name of its entry
_PART = re.compile(r".*\.[0-9]+\.part")


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """A folder for results that no other run writes to, proven before the work begins.

    It is made as needed. What a killed run, or a worker that is ended, left of a half-written file
    is removed.
    """
    with _refusing_in_words(folder):
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(0, "a file, and no folder")
        folder.mkdir(parents=True, exist_ok=True)
    with _locked(folder):
        with _refusing_in_words(folder):
            _remove_parts(folder)
            _prove_room(folder)
        try:
            yield
        finally:
            with suppress(OSError):  # a folder that has gone
                _remove_parts(folder)


def _remove_parts(folder: Path) -> None:
    for left in folder.iterdir():
        if _PART.fullmatch(left.name):
            left.unlink()


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold a folder; the kernel lets go of it after any end of this process."""
    if fcntl is None:
        yield
        return
    with _refusing_in_words(folder):
        lock = [os.open(folder, os.O_RDONLY)]

    def release() -> None:
        while lock:
            os.close(lock.pop())

    # A forked child that outlives this process must not hold the folder for it.
    os.register_at_fork(after_in_child=release)
    try:
        _lock(lock[0], folder)
        yield
    finally:
        release()


def _lock(descriptor: int, folder: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(
            where=str(folder),
            found="another run that writes there",
            expected="a folder of its own for each run",
            remedy="choose another folder, or wait for that run to end",
        ) from None
    except OSError:  # some file systems of networks lock no folders
        return


def _prove_room(folder: Path) -> None:
    with TemporaryFile(dir=folder) as probe:
        probe.write(bytes(_ROOM))


def require_writable(path: Path) -> None:
    """Refuse a file that could not be written, before the work that leads to it."""
    with _refusing_in_words(path):
        with suppress(FileNotFoundError):
            # Path.is_dir() hides from Python 3.14 on why it cannot tell.
            if stat.S_ISDIR(path.stat().st_mode):
                raise IsADirectoryError(0, "a folder, and no file")
        path.parent.mkdir(parents=True, exist_ok=True)
        _prove_room(path.parent)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A stream whose content takes the place of a file when all of it is on the disk.

    Folders are made as needed. If anything fails the file stays as it was.
    """
    end_copy()
    # Named after the process: two that write the same file do not write into each other's. Names
    # may have 255 bytes, and a character up to four.
    part = path.with_name(f"{path.name[:60]}.{os.getpid()}.part")
    with _refusing_in_words(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with part.open("wb") as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
            part.replace(path)
        finally:
            with suppress(OSError, ValueError):
                part.unlink(missing_ok=True)


def append_line(path: Path, line: str) -> None:
    """Add a line to a file; it is on the disk when this returns."""
    with _refusing_in_words(path), path.open("ab") as stream:
        stream.write(f"{line}\n".encode())
        stream.flush()
        os.fsync(stream.fileno())


@contextmanager
def _refusing_in_words(path: Path) -> Iterator[None]:
    """Say in words why a place takes no files; modes are as the user has them."""
    before = os.umask(own_umask())
    try:
        yield
    except OSError as error:
        name = str(path)
        raise InputError(
            where=name if len(name) <= 300 else f"{name[:300]}...",
            found=f"that it cannot be written ({error.strerror or error})",
            expected="a folder where files can be made, and room on the disk",
            remedy="choose another place, or make room; what was there before is kept",
        ) from None
    finally:
        os.umask(before)


@cache
def own_umask() -> int:
    """Modes that files of this process do not get, as at the first call; a model may change it."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


@contextmanager
def warning_if_unwritable() -> Iterator[None]:
    """Let a file that cannot be written cost nothing but itself; the reason is printed."""
    try:
        yield
    except InputError as error:
        print(f"warning: {error}", file=sys.stderr, flush=True)


@cache
def _own_process() -> int:
    """Number of this process; one that foreign code makes of it, by C's fork, has another."""
    return os.getpid()


def _count_as_own() -> None:
    _own_process.cache_clear()
    _own_process()


if hasattr(os, "fork"):  # Python's own forks are processes of ours
    os.register_at_fork(after_in_child=_count_as_own)
_count_as_own()


def end_copy() -> None:
    """End this process if foreign code made it of another, which tells the same results."""
    if os.getpid() != _own_process():
        os._exit(1)


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8; see `replacing`."""
    with replacing(path) as stream:
        stream.write(content.encode() if isinstance(content, str) else content)


def with_checksum(content: Mapping[str, Any]) -> str:
    """One line of JSON with a checksum of all that it says; `check_checksum` reads it."""
    return json.dumps({**content, _SEAL: _checksum(content)})


def check_checksum(text: str) -> dict[str, Any]:
    """What `with_checksum` has written.

    Raises
    ------
    ValueError
        If it says anything else than what was written.
    """
    content = parse_table(text)
    if content.pop(_SEAL, None) != _checksum(content):
        raise ValueError("its checksum is another one")
    return content


def _checksum(content: Mapping[str, Any]) -> str:
    # JSON writes the shortest digits that read back to the same bits, so this survives reading.
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def previous_path(path: Path) -> Path:
    """Where the file before the last of this name is kept."""
    return path.with_name(f"{path.stem}.before{path.suffix}")


def parse_table(text: str) -> dict[str, Any]:
    """Parse a table of JSON that a program has left.

    Raises
    ------
    ValueError, RecursionError
        If it is none, or holds a text that no file can hold or an integer beyond all numbers.
    """

    def number(digits: str) -> int:
        if not math.isfinite(float(digits)):
            raise ValueError("an integer beyond all numbers")
        return int(digits)

    content = json.loads(text, parse_int=number)
    if not isinstance(content, dict):
        raise ValueError("no table")
    json.dumps(content, ensure_ascii=False).encode()  # halves of characters have no UTF-8
    return content


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a file of JSON for people and programs; see `replacing`."""
    write_whole(path, json.dumps(content, indent=2) + "\n")


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


class TemporaryFolder:
    """A temporary folder, removed by `close` or with the process.

    Parameters
    ----------
    place : folder that it is made in; the usual one unless another is given.
    """

    def __init__(self, place: str | None = None) -> None:
        place = place or tempfile.gettempdir()
        sweep(place)
        lock = None
        while lock is None:
            self.path = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=place))  # of the folder
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
def temporary_folder() -> Iterator[str]:
    """Path of a temporary folder of ours, for as long as the context lasts."""
    with closing(TemporaryFolder()) as scratch:
        yield str(scratch.path)


@contextmanager
def own_temporary_files() -> Iterator[Path]:
    """Have all temporary files of this process and its children in a folder of ours."""
    before = tempfile.tempdir, os.environ.get("TMPDIR")
    place = tempfile.gettempdir()
    short = len(place) > _LONGEST and os.path.isdir(_SHORT)
    with closing(TemporaryFolder(_SHORT if short else place)) as scratch:
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
    """Descriptor that holds the lock of a folder; None if the folder is not there or not ours."""
    try:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        status = os.fstat(lock)
        if status.st_uid == os.getuid() and os.path.samestat(status, folder.lstat()):
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


def read_bytes(path: Path, remedy: str) -> bytes:
    """Read a file that ends."""
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):  # a pipe or a device may never end
            raise OSError(0, "no regular file")
        return path.read_bytes()
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        raise InputError(
            where=str(path),
            found="no such file" if missing else f"a file that cannot be read ({error.strerror})",
            expected="a readable file",
            remedy=remedy,
        ) from None


def read_text(path: Path, remedy: str) -> str:
    """Read a UTF-8 file, with or without a byte-order mark; lines end in newlines.

    Raises
    ------
    InputError
        If the file cannot be read or is not UTF-8; `remedy` is for a file that cannot be read.
    """
    raw = read_bytes(path, remedy)
    save_as_utf8 = "save the file as UTF-8, or take it as it is: workbench import"
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in raw:
        raise InputError(
            where=str(path),
            found="UTF-16 or binary data (a UTF-16 mark or zero bytes)",
            expected="UTF-8 text",
            remedy=save_as_utf8,
        )
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # Counted in the text before the mark is cut off: the mark holds no newline.
        line = error.object.count(b"\n", 0, error.start) + 1
        raise InputError(
            where=f"{path}, line {line}",
            found=f"byte 0x{error.object[error.start]:02X}, as in Latin-1 or Windows-1252",
            expected="UTF-8 text",
            remedy=save_as_utf8,
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")
