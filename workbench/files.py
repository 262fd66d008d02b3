"""Results on the disk: a file is as before or complete, whatever happens while it is written."""

import hashlib
import json
import os
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
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
def claimed(folder: Path) -> Iterator[None]:
    """A folder for results that no other run writes to, proven before the work begins.

    It is made as needed. What a killed run, or a worker that is ended, left of a half-written file
    is removed.

    Raises
    ------
    InputError
        If files cannot be made there, there is no room, or another run writes there.
    """
    with _told(folder):
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(0, "a file, and no folder")
        folder.mkdir(parents=True, exist_ok=True)
    with _locked(folder):
        with _told(folder):
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
    with _told(folder):
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


def prove_writable(path: Path) -> None:
    """Refuse a file that could not be written, before the work that leads to it.

    Raises
    ------
    InputError
        If it is a folder, files cannot be made beside it, or there is no room.
    """
    with _told(path):
        if path.is_dir():
            raise IsADirectoryError(0, "a folder, and no file")
        path.parent.mkdir(parents=True, exist_ok=True)
        _prove_room(path.parent)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A stream whose content takes the place of a file when all of it is on the disk.

    Folders are made as needed. If anything fails the file stays as it was.

    Raises
    ------
    InputError
        If the file cannot be written there.
    """
    # Named after the process: two that write the same file do not write into each other's. Names
    # may have 255 bytes, and a character up to four.
    part = path.with_name(f"{path.name[:60]}.{os.getpid()}.part")
    with _told(path):
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
    """Add a line to a file; it is on the disk when this returns.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    with _told(path), path.open("ab") as stream:
        stream.write(f"{line}\n".encode())
        stream.flush()
        os.fsync(stream.fileno())


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Say in words why a place takes no files."""
    try:
        yield
    except OSError as error:
        raise InputError(
            where=_cut(path),
            found=f"that it cannot be written ({error.strerror or error})",
            expected="a folder where files can be made, and room on the disk",
            remedy="choose another place, or make room; what was there before is kept",
        ) from None


def _cut(path: Path) -> str:
    """A path as far as people read it."""
    text = str(path)
    return text if len(text) <= 300 else f"{text[:300]}..."


@contextmanager
def spared() -> Iterator[None]:
    """Let a file that cannot be written cost nothing but itself; the reason is printed."""
    try:
        yield
    except InputError as error:
        print(f"warning: {error}", file=sys.stderr, flush=True)


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8; see `replacing`."""
    with replacing(path) as stream:
        stream.write(content.encode() if isinstance(content, str) else content)


def sealed(content: Mapping[str, Any]) -> str:
    """One line of JSON with a checksum of all that it says; `unsealed` reads it."""
    return json.dumps({**content, _SEAL: _checksum(content)})


def unsealed(text: str) -> dict[str, Any]:
    """What `sealed` has written.

    Raises
    ------
    ValueError
        If it says anything else than what was written.
    """
    content = json.loads(text)
    if not isinstance(content, dict):
        raise ValueError("no table")
    if content.pop(_SEAL, None) != _checksum(content):
        raise ValueError("its checksum is another one")
    return content


def _checksum(content: Mapping[str, Any]) -> str:
    # JSON writes the shortest digits that read back to the same bits, so this survives reading.
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def before_last(path: Path) -> Path:
    """Where the file before the last of this name is kept."""
    return path.with_name(f"{path.stem}.before{path.suffix}")


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a file of JSON for people and programs; see `replacing`."""
    write_whole(path, json.dumps(content, indent=2) + "\n")
