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
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.runtime.files import check_checksum, with_checksum
from workbench.studies.monitoring.estimate import RecordingEstimate


@dataclass(frozen=True)
class RecordingFolder:
    """One recording as it lies in a folder."""

    name: str  # of its folder
    content: str  # SHA-256 of all its files and their names
    path: Path


def recording_folders(folder: Path) -> list[RecordingFolder]:
    """All recordings in a folder, by name: each sub-folder is one, whole or not."""
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


# A result is JSON with a checksum.
_TABLES = """
CREATE TABLE IF NOT EXISTS identity (said TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS results (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL, content TEXT NOT NULL, result TEXT NOT NULL,
    UNIQUE (name, content)
);
"""


# Of correlations: a filter loses half of the sixteen digits at most, and estimates show three.
_ROUNDING = 1e-4


@dataclass(frozen=True, eq=False)
class RecordingResult:
    """What came of one recording: an estimate, or why there is none; what the FMU warned of."""

    name: str
    content: str
    date: str
    estimate: RecordingEstimate | None
    refusal: str
    warned: str = ""


class State:
    """The file of one machine; see `open_state`."""

    def __init__(self, connection: sqlite3.Connection, sizes: tuple[int, int]) -> None:
        self._connection, self._sizes = connection, sizes

    def missing(self, folders: list[RecordingFolder]) -> list[RecordingFolder]:
        """Those whose result is not known by name and content, or damaged."""
        known = {(result.name, result.content) for result in self.all()}
        return [folder for folder in folders if (folder.name, folder.content) not in known]

    def add(self, result: RecordingResult) -> None:
        """Keep the result of a recording; it is on the disk when this returns."""
        content = {**vars(result), "estimate": result.estimate and vars(result.estimate)}
        plain = json.loads(json.dumps(content, default=np.ndarray.tolist))
        with self._connection:
            self._connection.execute(
                "INSERT OR REPLACE INTO results (name, content, result) VALUES (?, ?, ?)",
                (result.name, result.content, with_checksum(plain)),
            )

    def all(self) -> list[RecordingResult]:
        """Results of all recordings, as they came; of one that is damaged, a refusal."""
        rows = self._connection.execute("SELECT name, content, result FROM results ORDER BY number")
        results = []
        for name, content, text in rows:
            try:
                result = _read_result(str(text), self._sizes)
                if (result.name, result.content) != (name, content):
                    raise ValueError("the result of another recording")
            except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
                refusal = (
                    f"its result in the state is damaged ({error}); it is estimated anew when its "
                    "recording is there"
                )
                result = RecordingResult(str(name), "", "", None, refusal)
            results.append(result)
        return results


def _read_result(text: str, sizes: tuple[int, int]) -> RecordingResult:
    content = check_checksum(text)
    entries = content.pop("estimate")
    if not all(isinstance(value, str) for value in content.values()):
        raise ValueError("other than texts")
    if content["date"]:
        datetime.fromisoformat(content["date"])
    if entries is None and not content["refusal"]:
        raise ValueError("neither an estimate nor a refusal")
    if entries is None:
        return RecordingResult(estimate=None, **content)
    estimate = RecordingEstimate(
        values=np.array(entries["values"], float),
        covariance=np.array(entries["covariance"], float),
        work=np.array(entries["work"], float).reshape(-1),
        counted=float(entries["counted"]),
    )
    q, w = sizes
    finite = all(np.isfinite(value).all() for value in vars(estimate).values())
    shapes = estimate.values.shape, estimate.covariance.shape, estimate.work.shape
    if not finite or shapes != ((q,), (q, q), (w,)):
        raise ValueError("estimates that are not finite, or of another shape")
    # Rounding leaves a covariance some digits less than symmetric and positive.
    variances = np.diag(estimate.covariance)
    if not (variances > 0.0).all():
        raise ValueError("variances that cannot be")
    deviations = np.sqrt(variances)
    with np.errstate(over="ignore"):
        correlations = estimate.covariance / deviations / deviations[:, None]
    if (
        (np.abs(correlations) > 1.0 + _ROUNDING).any()
        or not np.allclose(correlations, correlations.T, atol=_ROUNDING)
        or np.linalg.eigvalsh(correlations).min() < -_ROUNDING
    ):
        raise ValueError("covariances that cannot be")
    if estimate.counted <= 0.0:
        raise ValueError("a time that cannot be")
    return RecordingResult(estimate=estimate, **content)


@contextmanager
def open_state(path: Path, identity: Mapping[str, Any], sizes: tuple[int, int]) -> Iterator[State]:
    """Open the file of a machine, or make it.

    Parameters
    ----------
    identity : what estimates depend on beside the recordings; others do not stand beside them.
    sizes : numbers of values, and of works, that an estimate has.

    Raises
    ------
    InputError
        If it cannot be read or written, or holds estimates of another identity.
    """
    asked = json.dumps(identity, sort_keys=True)
    try:
        with closing(sqlite3.connect(path)) as connection:
            connection.text_factory = partial(str, encoding="utf-8", errors="replace")
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
            yield State(connection, sizes)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise InputError(
            where=str(path),
            found=f"a state that cannot be read or written ({error})",
            expected="what an earlier run left, or room for a new one",
            remedy="make room; or remove it, and all recordings are estimated anew",
        ) from None
