"""What lies in a folder of recordings, by content: whether it is new, whole, or there twice."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from workbench.errors import InputError


@dataclass(frozen=True)
class RecordingFolder:
    """One recording as it lies in a folder.

    Attributes
    ----------
    name : of its folder.
    content : SHA-256 of all its files and their names.
    """

    name: str
    content: str
    path: Path


def recording_folders(folder: Path) -> list[RecordingFolder]:
    """All recordings in a folder, by name: each sub-folder is one, whole or not.

    Raises
    ------
    InputError
        If there is no such folder, or no recording in it.
    """
    try:
        found = sorted(
            (path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")),
            key=lambda path: path.name,
        )
        if found:
            return [RecordingFolder(path.name, _content(path), path) for path in found]
        reason = "a folder without folders"
    except OSError as error:
        reason = f"what cannot be read ({error.strerror or error})"
    raise InputError(
        where=str(folder),
        found=reason,
        expected="a folder that holds a folder for each recording",
        remedy="correct the path",
    )


def _content(folder: Path) -> str:
    """SHA-256 of the files in a folder."""
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        own = hashlib.sha256(path.read_bytes()).hexdigest()
        digest.update(f"{path.relative_to(folder).as_posix()}\0{own}\n".encode())
    return digest.hexdigest()
