"""Runs the calls, and keeps what comes of them without what differs from run to run."""

import hashlib
import os
import shlex
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from tests.results.calls import PARTS, Call
from tests.results.rules import RESULTS, applied

ROOT = Path(__file__).parents[2]
_ARCHIVES = (".fmu", ".ssp")
_TEXTS = (
    *(".csv", ".json", ".jsonl", ".toml", ".mo", ".order", ".html"),
    *(".xml", ".ssd", ".ssv", ".c", ".h", ".txt"),
)
# Terminals wrap help where they end; threads of BLAS add up in another order.
_OWN = {"PYTHONPATH": str(ROOT), "COLUMNS": "80", "OMP_NUM_THREADS": "1", "MPLBACKEND": "agg"}


def write(out: Path, names: Sequence[str], recordings: Path | None, jobs: int) -> None:
    """Run the calls of some parts, and keep what comes of each part in a folder of its own.

    Parameters
    ----------
    names : of parts.
    recordings : that are not part of the repository; parts of these are left out without it.
    jobs : parts that run at a time, each in one process.
    """
    at_hand = [
        name for name in names if recordings or not any(map(_asks_for_more, PARTS[name].values()))
    ]
    for name in names:
        if name not in at_hand:
            print(f"{name}: skipped, its recordings are not at hand", flush=True)
    with (
        tempfile.TemporaryDirectory(prefix="results-") as scratch,
        ThreadPoolExecutor(jobs) as pool,
    ):
        parts = [_Part(name, Path(scratch, name), out / name, recordings) for name in at_hand]
        for task in as_completed([pool.submit(part.run) for part in parts]):
            print(task.result(), flush=True)


@dataclass(frozen=True)
class _Part:
    """A part: its calls work in a folder, of which what counts is kept in another one."""

    name: str
    folder: Path
    kept: Path
    recordings: Path | None

    def run(self) -> str:
        """Run all calls, and keep what they say and write; returns a line for people."""
        begin = time.monotonic()
        self.folder.mkdir()
        shutil.rmtree(self.kept, ignore_errors=True)
        statuses = [
            self._call(f"{number:02}_{name}", call)
            for number, (name, call) in enumerate(PARTS[self.name].items(), 1)
        ]
        self._keep(self.folder, self.kept / "files")
        return f"{self.name}: {time.monotonic() - begin:.0f} s, status {' '.join(statuses)}"

    def _call(self, name: str, call: Call) -> str:
        """Make a call, and keep what it says; returns its exit status."""
        if callable(call):
            call(self.folder)
            return "-"
        places = {place: ROOT / place for place in ("cases", "modelica", "fmus")}
        words = [word.format(**places, recordings=self.recordings) for word in shlex.split(call)]
        run = subprocess.run(
            [sys.executable, "-m", "workbench", *words],
            cwd=self.folder,
            env={**os.environ, **_OWN},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        status = str(run.returncode)
        for stream, text in (("status", status), ("stdout", run.stdout), ("stderr", run.stderr)):
            self._write(self.kept / "said" / name / stream, text)
        return status

    def _keep(self, source: Path, target: Path) -> None:
        """Keep all files: texts, members of archives, rows of databases, of others the hash."""
        for path in sorted(path for path in source.rglob("*") if path.is_file()):
            kept = target / path.relative_to(source)
            if path.suffix in _ARCHIVES:
                with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(path) as archive:
                    archive.extractall(folder)
                    self._keep(Path(folder), kept)
            elif path.suffix in _TEXTS:
                self._write(kept, path.read_text(encoding="utf-8"))
            elif path.suffix == ".sqlite":
                with closing(sqlite3.connect(path)) as database:
                    self._write(kept, "\n".join(database.iterdump()))
            elif path.suffix == ".svg":
                self._write(kept, _hash(applied(RESULTS, path.name, path.read_text()).encode()))
            else:
                self._write(kept, _hash(path.read_bytes()))

    def _write(self, path: Path, text: str) -> None:
        """Write a text without what differs from run to run."""
        for place, instead in ((self.folder, "<here>"), (ROOT, "<root>")):
            text = text.replace(str(place), instead)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(applied(RESULTS, path.name, text), encoding="utf-8")


def _hash(content: bytes) -> str:
    return f"{len(content)} bytes, SHA-256 {hashlib.sha256(content).hexdigest()}"


def _asks_for_more(call: Call) -> bool:
    return isinstance(call, str) and "{recordings}" in call
