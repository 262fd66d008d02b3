"""Published recordings become case folders: the publisher's own files, checked by their checksums.

The workbench holds none of them. What it knows of a set is a `PublishedSet`, which a system's
plugin has as `published`.
"""

import hashlib
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import tomli_w

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.recordings.case import KEYS, Case, read_case
from workbench.recordings.csv import table_text
from workbench.runtime.files import (
    locked_folder,
    parse_table,
    read_text,
    write_json,
    write_whole,
)
from workbench.runtime.resources import commit
from workbench.system.installed import system_path
from workbench.system.plugins import find_plugin, load, plugin_of
from workbench.system.system import System
from workbench.system.tables import read_table

PREPARED = "prepared.json"
_CASE = "case.toml"


@dataclass(frozen=True, eq=False)
class PublishedRecording:
    """One recording of a published set, or a piece of one."""

    name: str  # of the case folder
    title: str  # one line for reports
    # (n,) each, by `name [unit]` as the case's CSV has it; the first is `time [s]`
    columns: Mapping[str, Vector]
    file: str  # that it was read from, of those of the layout
    rows: tuple[int, int]  # first and last row of that file's samples, from 0
    changed: tuple[str, ...] = ()  # what was converted, chosen or cut, for people
    # of the case, as `case.toml` has them
    conditions: Mapping[str, Any] = field(default_factory=dict)
    held_out: bool = False  # it is there to judge a fit to the others by
    # that it was recorded on, where a set has several; each is diagnosed for itself
    machine: str = ""
    date: str = ""  # when it was recorded, ISO 8601; empty: unknown
    # time before which samples only lead to those that count [s]; None: all count
    counts_from: float | None = None


@dataclass(frozen=True)
class FolderLayout:
    """A way in which the set lies in a folder."""

    name: str  # for people, such as "the publisher's own files"
    files: Mapping[str, str]  # SHA-256 of each, by its path in the folder; all must be there
    # the recordings in a folder with these files
    read: Callable[[Path], Sequence[PublishedRecording]]
    # of files that anybody may have recorded in this format, in place of `files`; their checksums
    # are noted
    pattern: str = ""
    # reads a single recording from its own folder, where it has one with a case.toml; or None
    read_one: Callable[[Path], PublishedRecording] | None = None

    def hashes_in(self, source: Path) -> dict[str, str]:
        """SHA-256 of the files of the layout that are in a folder, by their path there."""
        paths = source.glob(self.pattern) if self.pattern else map(source.joinpath, self.files)
        return {
            path.relative_to(source).as_posix(): _sha256(path.read_bytes())
            for path in sorted(paths)
            if path.is_file()
        }


@dataclass(frozen=True)
class PublishedSet:
    """A set of recordings that somebody published."""

    title: str  # what was measured on which machine
    source: str  # authors, year, where it is to be had
    licence: str  # under which it was published
    recordings: str  # what they are, which are fitted and which are held out
    layouts: tuple[FolderLayout, ...]  # in which it is read, the publisher's own first

    def __str__(self) -> str:
        parts = [f"{self.title}\n\n{self.recordings}\n", f"source:  {self.source}"]
        parts += [f"licence: {self.licence}"]
        for layout in self.layouts:
            parts += [f"\n{layout.name}:"]
            parts += [f"  {sha256}  {path}" for path, sha256 in layout.files.items()]
        return "\n".join(parts)


def published(which: str) -> PublishedSet:
    """What a system's plugin knows of its published recordings.

    Parameters
    ----------
    which : name of a system, its file, or the folder that holds its file.
    """
    path = system_path(which)
    table = read_table(path, "name a system", 'title = "..."')
    known: PublishedSet | None = load(find_plugin(plugin_of(table)).published)
    if known is None:
        raise InputError(
            where=str(path),
            found="no plugin that knows of published recordings",
            expected="a plugin with a 'published'",
            remedy="choose another system; write case folders for your own recordings",
        )
    return known


def write_cases(which: str, source: Path, out: Path) -> list[PublishedRecording]:
    """Write case folders of a published set, and what was done as `prepared.json`.

    Parameters
    ----------
    which : see `published`.
    source : folder that holds the set in one of its layouts.
    out : a new folder, an empty one, or one that was written so before. What was written then and
        is no case now is removed, if it is as it was written.

    Raises
    ------
    InputError
        If the set is not in `source`, a file of it is another one, or `out` holds other files.
    """
    known = published(which)
    _refuse_other_files(out)
    layout = _layout(known, source)
    recordings = list(layout.read(source))
    with locked_folder(out):
        before = _hashes_before(out)
        written: dict[str, str] = {}
        for recording in recordings:
            written |= {
                f"{recording.name}/{file}": text for file, text in _texts(recording).items()
            }
        _remove(out, {path: sha256 for path, sha256 in before.items() if path not in written})
        for path, text in written.items():
            write_whole(out / path, text)
        write_json(
            out / PREPARED,
            {
                "system": which,
                "title": known.title,
                "source": known.source,
                "licence": known.licence,
                "workbench": commit(),
                "layout": layout.name,
                "read": layout.hashes_in(source),
                "held_out": [recording.name for recording in recordings if recording.held_out],
                "written": {path: _sha256(text.encode()) for path, text in written.items()},
                "cases": {recording.name: _description(recording) for recording in recordings},
            },
        )
    return recordings


def read_recorded(folder: Path, system: System) -> Case:
    """Read a case folder, or a recording as its machine wrote it, whose format is known."""
    document = read_table(folder / _CASE, "repair the folder, or remove it", 'title = "..."')
    known: PublishedSet | None = load(find_plugin(system.plugin).published)
    layouts = known.layouts if known else ()
    readers = [layout.read_one for layout in layouts if layout.read_one is not None]
    if set(document.content) <= set(KEYS) or not readers:
        return read_case(folder, system)
    recording = readers[0](folder)
    with tempfile.TemporaryDirectory(prefix="recorded-") as scratch:
        for file, text in _texts(recording).items():
            write_whole(Path(scratch) / recording.name / file, text)
        try:
            case = read_case(Path(scratch) / recording.name, system)
        except InputError as error:  # of files that are not the user's
            where = error.where.replace(scratch, str(folder.parent))
            raise InputError(
                where=where, found=error.found, expected=error.expected, remedy=error.remedy
            ) from None
    return replace(case, source=folder.parent / recording.file)


def _description(recording: PublishedRecording) -> dict[str, Any]:
    time = next(iter(recording.columns.values()))
    return {
        "file": recording.file,
        "rows": list(recording.rows),
        "samples": time.size,
        "seconds": float(time[-1] - time[0]),
        "columns": list(recording.columns),
        "conditions": dict(recording.conditions),
        "machine": recording.machine,
        "changed": list(recording.changed),
    }


def _refuse_other_files(out: Path) -> None:
    if out.exists() and not (out / PREPARED).is_file() and any(out.iterdir()):
        raise InputError(
            where=str(out),
            found="a folder with other files",
            expected="a new or an empty folder, or one with prepared recordings",
            remedy="choose another folder",
        )


def _layout(known: PublishedSet, source: Path) -> FolderLayout:
    """The layout in which the set lies in a folder, of files with the right checksums."""
    for layout in known.layouts:
        if layout.hashes_in(source):
            for path, sha256 in layout.files.items():
                _check(source / path, sha256)
            return layout
    expected = [next(iter(layout.files), layout.pattern) for layout in known.layouts]
    raise InputError(
        where=str(source),
        found="none of the files" if source.is_dir() else "no such folder",
        expected=f"a folder with {' or '.join(expected)}",
        remedy=f"get them from {known.source}",
    )


def _check(path: Path, sha256: str) -> None:
    if not path.is_file():
        raise InputError(
            where=str(path),
            found="no such file",
            expected="all files of the set",
            remedy="complete the folder",
        )
    digest = _sha256(path.read_bytes())
    if digest != sha256:
        raise InputError(
            where=str(path),
            found=f"another file (SHA-256 {digest})",
            expected=f"the file as it was published (SHA-256 {sha256})",
            remedy="get it again; to use other recordings, write case folders for them",
        )


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _hashes_before(out: Path) -> dict[str, str]:
    """SHA-256 of the files that were written into a folder before, by their path there."""
    path = out / PREPARED
    if not path.is_file():
        return {}
    remedy = f"prepare into another folder, or restore {PREPARED}"
    text = read_text(path, remedy)
    try:
        written: dict[str, str] = parse_table(text).get("written", {})
        inside = [Path(name).parts for name in written]
        if not any(".." in parts or Path(*parts).is_absolute() for parts in inside):
            return {name: str(sha256) for name, sha256 in written.items()}
    except (ValueError, TypeError, AttributeError, RecursionError):
        pass
    raise InputError(
        where=str(path),
        found="no list of files in this folder",
        expected="what 'workbench prepare' writes",
        remedy=remedy,
    )


def _remove(out: Path, files: Mapping[str, str]) -> None:
    """Remove files that are as they were written, and the folders which that leaves empty."""
    for name, sha256 in files.items():
        path = out / name
        if path.is_file() and _sha256(path.read_bytes()) == sha256:
            path.unlink()
            if not any(path.parent.iterdir()):
                path.parent.rmdir()


def _texts(recording: PublishedRecording) -> dict[str, str]:
    """Files of a case folder, by name."""
    measurement = {"file": "measured.csv"}
    if recording.counts_from is not None:
        measurement["counts_from"] = f"{recording.counts_from!r} s"
    dated = {"date": recording.date} if recording.date else {}
    case = {"title": recording.title, **dated, "measurement": measurement}
    conditions = {"conditions": dict(recording.conditions)} if recording.conditions else {}
    return {_CASE: tomli_w.dumps(case | conditions), "measured.csv": table_text(recording.columns)}
