"""The archive of an FMU: what is taken out of it, where to, and how much at most.

An FMU is a file from anywhere. Only what runs here is unpacked: this machine's binary, the model
description and resources.
"""

import re
import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from workbench.errors import InputError

DESCRIPTION = "modelDescription.xml"

_MOST_FILES = 10_000  # of an FMU; those of a large tool with its documentation have hundreds
_MOST_BYTES = 1 << 30  # unpacked, in each process that loads the FMU
_MOST_OF_DESCRIPTION = 64 << 20  # 0.4 kB a variable: 150 000 variables
# Deflate packs zeros 1000 to 1, binaries 2 to 1, tables of numbers up to 20 to 1. Little files may
# be anything.
_HIGHEST_RATIO, _LITTLE = 100, 16 << 20
_FORBIDDEN = re.compile(r"[\x00-\x1f\\]|^/|^[A-Za-z]:|(^|/)\.{1,2}(/|$)|//")
_UNREAD = ("documentation/", "extra/", "sources/")  # folders that nothing is taken from
_PIECE = 1 << 20
# The last one is of a compression that zipfile does not know, or of a password.
_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError)


@contextmanager
def opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """The archive of an FMU, whose list of contents has been checked."""
    try:
        archive = zipfile.ZipFile(path)
    except (OSError, ValueError, *_DAMAGE) as error:
        raise damaged(path, error) from None
    with archive:
        _check(path, archive.infolist())
        try:
            yield archive
        except _DAMAGE as error:
            raise damaged(path, error) from None


def damaged(path: Path, reason: object) -> InputError:
    """The refusal of a file that cannot be read as an FMU."""
    return InputError(
        where=str(path),
        found=f"a file that is no FMU ({reason})",
        expected="an FMU of FMI 2.0 or 3.0",
        remedy="export the model again",
    )


def _check(path: Path, entries: list[zipfile.ZipInfo]) -> None:
    """Refuse names that lead elsewhere, links, names that stand twice, and bombs."""
    if len(entries) > _MOST_FILES:
        raise _refusal(path, f"{len(entries)} files", f"{_MOST_FILES} at most")
    seen: set[str] = set()
    for entry in entries:
        name = entry.filename
        shown = repr(name if len(name) <= 80 else f"{name[:80]}...")
        if _FORBIDDEN.search(entry.orig_filename):
            raise _refusal(path, f"the name {shown}", "names inside the FMU's folder, with '/'")
        file_type = stat.S_IFMT(entry.external_attr >> 16)
        if file_type not in (0, stat.S_IFREG, stat.S_IFDIR):
            raise _refusal(path, f"{shown}, which is a link or a device", "files and folders")
        if entry.header_offset < 0:
            raise _refusal(path, f"{shown}, which begins before it", "files inside the archive")
        if entry.flag_bits & 1:
            raise _refusal(path, f"{shown}, which is encrypted", "files that can be read")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise _refusal(path, f"{shown}, packed another way", "files packed by deflate")
        if name.rstrip("/") in seen and not entry.is_dir() and not name.startswith(_UNREAD):
            raise _refusal(path, f"the name {shown} twice", "each name once")
        seen.add(name.rstrip("/"))
        if entry.file_size > max(_LITTLE, _HIGHEST_RATIO * entry.compress_size):
            share = entry.file_size // max(entry.compress_size, 1)
            found = f"{shown}, which unpacks to {share} times its size"
            raise _refusal(path, found, f"{_HIGHEST_RATIO} times at most")
        if name == DESCRIPTION and entry.file_size > _MOST_OF_DESCRIPTION:
            found = f"a model description of {entry.file_size >> 20} MB"
            raise _refusal(path, found, f"{_MOST_OF_DESCRIPTION >> 20} MB at most")
    # Entries that share their bytes say more, all together, than the file has.
    size, packed = sum(entry.file_size for entry in entries), path.stat().st_size
    if size > max(_LITTLE, _HIGHEST_RATIO * packed):
        found = f"{size >> 20} MB, which is {size // max(packed, 1)} times its size"
        raise _refusal(path, found, f"{_HIGHEST_RATIO} times at most")
    files = {entry.filename for entry in entries if not entry.is_dir()}
    for name in seen:
        if inside := next((str(p) for p in PurePosixPath(name).parents if str(p) in files), None):
            raise _refusal(path, f"{inside!r} as a file and as a folder", "one of the two")


def _refusal(path: Path, found: str, expected: str) -> InputError:
    return InputError(
        where=str(path),
        found=f"an archive with {found}",
        expected=expected,
        remedy="do not use this file, or export the model again",
    )


def unpack(path: Path, folder: Path, binaries: str) -> None:
    """Unpack what runs here.

    Parameters
    ----------
    folder : to unpack into.
    binaries : folder of this machine's binary in the FMU.
    """
    with opened(path) as archive:
        wanted = [
            entry
            for entry in archive.infolist()
            if entry.filename == DESCRIPTION
            or entry.filename.startswith(("resources/", f"{binaries}/"))
        ]
        size = sum(entry.file_size for entry in wanted)
        if size > _MOST_BYTES:
            found = f"{size >> 20} MB of binaries and resources"
            raise _refusal(path, found, f"{_MOST_BYTES >> 20} MB at most")
        try:
            for entry in wanted:
                _write(archive, entry, folder / entry.filename)
        except OSError as error:
            raise InputError(
                where=str(path),
                found=f"no way to unpack it for this run ({error.strerror or error})",
                expected=f"a folder for temporary files with room for {(size >> 20) + 1} MB",
                remedy="make room, or set TMPDIR to another folder",
            ) from None


def _write(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, target: Path) -> None:
    if entry.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with archive.open(entry) as packed, target.open("xb") as file:
        while piece := packed.read(_PIECE):
            file.write(piece)
