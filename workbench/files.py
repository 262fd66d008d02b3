"""Results on the disk: a file is as before or complete, whatever happens while it is written."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from workbench.errors import InputError


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A stream whose content takes the place of a file when all of it is on the disk.

    Folders are made as needed. If anything fails the file stays as it was.

    Raises
    ------
    InputError
        If the file cannot be written there.
    """
    # Named after the process: two that write the same file do not write into each other's.
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        part.replace(path)
    except OSError as error:
        raise InputError(
            where=str(path),
            found=f"that it cannot be written ({error.strerror or error})",
            expected="a folder where files can be made, and room on the disk",
            remedy="choose another place, or make room; what was there before is kept",
        ) from None
    finally:
        if part.exists():
            part.unlink()


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8; see `replacing`."""
    with replacing(path) as stream:
        stream.write(content.encode() if isinstance(content, str) else content)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a file of JSON for people and programs; see `replacing`."""
    write_whole(path, json.dumps(content, indent=2) + "\n")
