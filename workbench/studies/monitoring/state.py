"""Estimates of a machine's recordings, in a file that a killed run leaves whole.

Each recording is one transaction. Conclusions are no state: they follow from all recordings in the
order of their dates, whichever came first.
"""

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.studies.monitoring.estimate import RecordingEstimate


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
        paths = sorted(
            (path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")),
            key=lambda path: path.name,
        )
        if paths:
            return [RecordingFolder(path.name, _hash_of_files(path), path) for path in paths]
        reason = "a folder without folders"
    except OSError as error:
        reason = f"what cannot be read ({error.strerror or error})"
    raise InputError(
        where=str(folder),
        found=reason,
        expected="a folder that holds a folder for each recording",
        remedy="correct the path",
    )


def _hash_of_files(folder: Path) -> str:
    """SHA-256 of the files in a folder and their names."""
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        own = hashlib.sha256(path.read_bytes()).hexdigest()
        digest.update(f"{path.relative_to(folder).as_posix()}\0{own}\n".encode())
    return digest.hexdigest()


_TABLES = """
CREATE TABLE IF NOT EXISTS identity (said TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS deliveries (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL, content TEXT NOT NULL, date TEXT NOT NULL,
    estimate TEXT, refusal TEXT, UNIQUE (name, content)
);
"""


@dataclass(frozen=True, eq=False)
class RecordingResult:
    """What came of one recording: an estimate, or why there is none."""

    name: str
    content: str
    date: str
    estimate: RecordingEstimate | None
    refusal: str


class State:
    """The file of one machine; see `open_state`."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def missing(self, folders: list[RecordingFolder]) -> list[RecordingFolder]:
        """Those that are not known by name and content."""
        known = set(self._connection.execute("SELECT name, content FROM deliveries"))
        return [folder for folder in folders if (folder.name, folder.content) not in known]

    def add(self, result: RecordingResult) -> None:
        """Keep the result of a recording; it is on the disk when this returns."""
        estimate = None
        if result.estimate is not None:
            estimate = json.dumps(vars(result.estimate), default=np.ndarray.tolist)
        with self._connection:
            self._connection.execute(
                "INSERT OR IGNORE INTO deliveries (name, content, date, estimate, refusal) "
                "VALUES (?, ?, ?, ?, ?)",
                (result.name, result.content, result.date, estimate, result.refusal),
            )

    def all(self) -> list[RecordingResult]:
        """Results of all recordings, as they came."""
        rows = self._connection.execute(
            "SELECT name, content, date, estimate, refusal FROM deliveries ORDER BY number"
        )
        results = []
        for name, sha256, date, text, refusal in rows:
            estimate = None
            if text:
                content = json.loads(text)
                q = len(content["values"])
                estimate = RecordingEstimate(
                    values=np.array(content["values"]),
                    covariance=np.reshape(content["covariance"], (q, q)),
                    work=np.array(content["work"]),
                    counted=content["counted"],
                )
            results.append(RecordingResult(name, sha256, date, estimate, refusal))
        return results


@contextmanager
def open_state(path: Path, identity: Mapping[str, Any]) -> Iterator[State]:
    """Open the file of a machine, or make it.

    Parameters
    ----------
    identity : what estimates depend on beside the recordings; others do not stand beside them.

    Raises
    ------
    InputError
        If it cannot be read or written, or holds estimates of another identity.
    """
    asked = json.dumps(identity, sort_keys=True)
    try:
        with closing(sqlite3.connect(path)) as connection:
            with connection:
                connection.executescript(_TABLES)
            with connection:
                known = [text for (text,) in connection.execute("SELECT said FROM identity")]
                if not known:
                    connection.execute("INSERT INTO identity VALUES (?)", (asked,))
            if known not in ([], [asked]):
                raise InputError(
                    where=str(path),
                    found="estimates by another model, system file or version",
                    expected="those of this one, because levels are compared",
                    remedy="give another --out, into which all recordings are estimated anew",
                )
            yield State(connection)
    except sqlite3.Error as error:
        raise InputError(
            where=str(path),
            found=f"a state that cannot be read or written ({error})",
            expected="what an earlier run left, or room for a new one",
            remedy="make room; or remove it, and all recordings are estimated anew",
        ) from None
