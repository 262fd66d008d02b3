"""Files of recorders become case folders; what was done to them is written down.

A file is read (`formats`), its channels are proposed for the signals of a system and confirmed
(`channels`), and it is cut where it holds several recordings. Originals are only read.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.recordings.case import UNKNOWN, check_recording, conditions_shown, read_conditions
from workbench.recordings.channels import (
    COLUMNS,
    MergedRecording,
    NamedChannel,
    ProposedRecording,
    merge,
)
from workbench.recordings.csv import table_text
from workbench.recordings.plausibility import Origin, doubts
from workbench.runtime.files import parse_table, read_text, write_json, write_whole
from workbench.runtime.resources import commit
from workbench.system.parts import RecordingSplit
from workbench.system.system import System
from workbench.system.tables import Table


@dataclass(frozen=True)
class Cut:
    """Samples that are kept as one recording, or left out."""

    # first, end: sample, and the one after the last
    first: int
    end: int
    reason: str = ""  # why they are left out; empty: they are kept


def cut(time: Vector, signals: Mapping[str, Vector], system: System) -> list[Cut]:
    """Cut a recording into those that it holds, in their order; all samples are in one part.

    It is cut where no recording may have a gap, and, if the system says how (`cutting`) and there
    is more than one part, from the rise of one signal to the fall of another. A recording without
    anything to cut is one part.

    Parameters
    ----------
    time : (n,) s.
    signals : (n,) each, SI.
    """
    gaps = np.flatnonzero(np.diff(time) > system.sampling.largest_gap) + 1
    bounds = [0, *gaps.tolist(), time.size]
    pieces = list(pairwise(bounds))
    parts = _parts(time, signals, system.cutting, pieces, system) if system.cutting else []
    if sum(not part.reason for part in parts) < 2:
        parts = [Cut(first, end) for first, end in pieces]
    short = "it is shorter than a recording must be"
    for k, part in enumerate(parts):
        lasts = time[part.end - 1] - time[part.first]
        enough = part.end - part.first >= system.fewest and lasts >= system.shortest
        if not (part.reason or enough):
            parts[k] = Cut(part.first, part.end, short)
    return list(_with_rest(parts, time.size))


def _parts(
    time: Vector,
    signals: Mapping[str, Vector],
    rule: RecordingSplit,
    pieces: list[tuple[int, int]],
    system: System,
) -> list[Cut]:
    """Parts between a rise and a fall, with what is kept around them."""
    applied = np.abs(system.signal(rule.begins.signal, signals)) > rule.begins.level
    moving = np.abs(system.signal(rule.ends.signal, signals)) > rule.ends.level
    cuts: list[Cut] = []
    for low, high in pieces:
        last = low
        for begin, end, reason in _runs(time, applied, moving, rule.released, low, high):
            first = max(last, int(np.searchsorted(time, time[begin] - rule.before)))
            stop = min(high, int(np.searchsorted(time, time[end - 1] + rule.after, "right")))
            cuts.append(Cut(first, stop, reason))
            last = stop
    return cuts


def _runs(
    time: Vector, applied: np.ndarray, moving: np.ndarray, released: float, low: int, high: int
) -> Iterator[tuple[int, int, str]]:
    """First sample, the one after the last, and why a run is no recording."""
    k = low
    while k < high:
        if not (applied[k] and moving[k]) or (k > low and applied[k - 1]):
            k += 1
            continue
        end, on = k, k
        while end < high and moving[end] and time[end] - time[on] <= released:
            on = end if applied[end] else on
            end += 1
        if end == high:
            yield k, end, "it does not end in this recording"
        elif moving[end]:
            yield k, end, "it was released before its end"
        elif k == low:
            yield k, end, "it had begun before this recording"
        else:
            yield k, end, ""
        k = end


def _with_rest(parts: list[Cut], size: int) -> Iterator[Cut]:
    """The parts and what is between them."""
    last = 0
    for part in parts:
        if part.first > last:
            yield Cut(last, part.first, "between recordings")
        yield part
        last = part.end
    if last < size:
        yield Cut(last, size, "between recordings")


IMPORTED = "import.json"


@dataclass(frozen=True, eq=False)
class Piece:
    """One recording of an import."""

    name: str  # of its case folder
    samples: tuple[int, int]  # first, and the one after the last, of those that were read
    time: Vector  # (n,) s from its first sample
    signals: Mapping[str, Vector]  # (n,) each, SI
    conditions: Mapping[str, Any]  # as `case.toml` has them
    sources: Mapping[str, str]  # where each condition is from: given, shown by the record, unknown
    doubts: tuple[str, ...]  # what is unlikely in it, in words


@dataclass(frozen=True, eq=False)
class Import:
    """What becomes of one recording, or one long one."""

    recording: ProposedRecording  # files that hold it, and its channels
    measured: MergedRecording  # all of it, in SI units
    parts: tuple[Cut, ...]  # in which it was cut
    pieces: tuple[Piece, ...] = field(default_factory=tuple)  # those that become cases


def import_recording(
    name: str,
    recording: ProposedRecording,
    system: System,
    conditions: Mapping[str, Any],
    *,
    whole: bool = False,
) -> Import:
    """Make cases of a recording whose channels are known.

    Parameters
    ----------
    name : of the case, or of all that a long recording is cut into, with numbers.
    recording : with channels of all signals that are needed, confirmed.
    conditions : of all these recordings, as `case.toml` has them.
    whole : leave a long recording as it is.

    Raises
    ------
    InputError
        If signals have no samples in common, a condition is none of the system's, or a recording
        cannot be what it says it is.
    """
    where = recording.where
    measured = merge(recording.files, recording.proposal, system)
    check_recording(measured.time, system, f"{where}, time", None)
    parts = [Cut(0, measured.time.size)] if whole else cut(measured.time, measured.signals, system)
    kept = [part for part in parts if not part.reason]
    if not kept:
        raise InputError(
            where=where,
            found=f"no recording: {'; '.join(dict.fromkeys(part.reason for part in parts))}",
            expected=f"at least {system.fewest} samples over {system.shortest:g} s",
            remedy="import it as one recording, --whole",
        )
    many = len(kept) > 1
    names = [f"{k:02d}_{name}" if many else name for k in range(1, len(kept) + 1)]
    pieces = [
        _piece(own, recording, measured, system, conditions, where)
        for own, recording in zip(names, kept, strict=True)
    ]
    return Import(recording, measured, tuple(parts), tuple(pieces))


def case_name(path: Path, part: str = "") -> str:
    """Name of a case: letters, figures and signs that every file system takes.

    Examples
    --------
    >>> case_name(Path("monday.xlsx")), case_name(Path("monday.xlsx"), "120 % load, warm")
    ('monday', 'monday_120_load_warm')
    """
    stem = re.sub(r"(\.[A-Za-z]\w{1,6})?(\.gz)?$", "", path.name)
    names = (re.sub(r"[^\w.+-]+", "_", name).strip("._") for name in (stem, part))
    return "_".join(filter(None, names)) or "recording"


def _piece(
    name: str,
    cut: Cut,
    measured: MergedRecording,
    system: System,
    given: Mapping[str, Any],
    where: str,
) -> Piece:
    part = slice(cut.first, cut.end)
    time = measured.time[part] - measured.time[cut.first]
    signals = {signal: values[part] for signal, values in measured.signals.items()}
    shown = conditions_shown(signals, system)
    unknown = {
        condition.name: UNKNOWN
        for condition in system.conditions
        if condition.name not in {**given, **shown} and not (condition.sign or condition.sets)
    }
    conditions = {**unknown, **shown, **given}
    table = Table(conditions, f"{where}, conditions")
    read = read_conditions(table, system)
    sources = {
        key: "given" if key in given else "shown by the record" if key in shown else UNKNOWN
        for key in read
    }
    origin = Origin(f"{where}, {name}", None, {}, "command line, --condition")
    return Piece(
        name=name,
        samples=(cut.first, cut.end),
        time=time,
        signals=signals,
        conditions={key: conditions[key] for key in read},
        sources=sources,
        doubts=doubts(time, signals, read, system, origin),
    )


def store(out: Path, named: Mapping[str, NamedChannel]) -> None:
    """Keep confirmed channels for all files of a folder; those of earlier files stay."""
    tables = {signal: channel.to_dict() for signal, channel in named.items()}
    write_whole(out / COLUMNS, tomli_w.dumps({"columns": tables}))


def write(imported: Import, out: Path, system: System) -> None:
    """Write case folders of an import."""
    written: dict[str, str] = {}
    for piece in imported.pieces:
        names = ", ".join(file.path.name for file in imported.recording.files)
        names += f", '{imported.recording.name}'" if imported.recording.name else ""
        date = imported.measured.date(piece.samples[0])
        dated = {"date": date} if date else {}
        case = {"title": f"{piece.name}, imported from {names}", **dated}
        conditions = {"conditions": dict(piece.conditions)} if piece.conditions else {}
        measurement = {"measurement": {"file": "measured.csv"}}
        written[f"{piece.name}/case.toml"] = tomli_w.dumps({**case, **conditions, **measurement})
        signals = {f"{n} [{system.signals[n].unit}]": v for n, v in piece.signals.items()}
        written[f"{piece.name}/measured.csv"] = table_text({"time [s]": piece.time, **signals})
    for path, text in written.items():
        write_whole(out / path, text)


def describe(imported: Import, system: System) -> dict[str, Any]:
    """What was read, converted, dropped and cut, for programs."""
    time, measured = imported.measured.time, imported.measured
    return {
        "files": [
            {
                "file": str(file.path),
                "sha256": file.sha256,
                "format": file.format,
                "notes": list(file.notes),
                "doubts": list(file.doubts),
            }
            for file in imported.recording.files
        ],
        "recording": imported.recording.name or None,
        "began": measured.date(0) or None,
        "time": _described_clocks(imported),
        "channels": _described_channels(imported, system),
        "dropped": list(imported.recording.proposal.left),
        "notes": list(measured.notes),
        "cut": [
            {
                "begins": float(time[part.first]),
                "ends": float(time[part.end - 1]),
                "samples": part.end - part.first,
                "case": next((p.name for p in imported.pieces if p.samples[0] == part.first), None),
                "left_out": part.reason or None,
            }
            for part in imported.parts
        ],
        "cases": {
            piece.name: {
                "samples": piece.time.size,
                "seconds": float(piece.time[-1]),
                "conditions": {
                    key: {"value": value, "from": piece.sources[key]}
                    for key, value in piece.conditions.items()
                },
                "doubts": list(piece.doubts),
            }
            for piece in imported.pieces
        },
    }


def _described_clocks(imported: Import) -> list[dict[str, Any]]:
    files = imported.recording.files
    return [
        {
            "file": files[file].path.name,
            "group": files[file].groups[group].name,
            "channel": clock.channel or None,
            "unit": clock.unit,
            "reason": clock.reason,
        }
        for (file, group), clock in imported.recording.proposal.clocks.items()
    ]


def _described_channels(imported: Import, system: System) -> dict[str, dict[str, Any]]:
    files = imported.recording.files
    return {
        name: {
            "file": files[assignment.file].path.name,
            "group": files[assignment.file].groups[assignment.group].name,
            "channel": assignment.channel.name,
            "unit": assignment.unit,
            "unit_stated": not assignment.concluded,
            "converted": {
                "to": system.signals[name].unit,
                "factor": assignment.factor,
                "zero": assignment.zero,
                "recorded_as": assignment.formula or None,
            },
            "missing": list(assignment.missing),
            "reason": assignment.reason,
        }
        for name, assignment in imported.recording.proposal.assigned.items()
    }


def imported(out: Path) -> list[dict[str, Any]]:
    """What was imported into a folder before; empty if nothing was."""
    path = out / IMPORTED
    if path.is_file():
        remedy = f"import into another folder, or restore {IMPORTED}"
        text = read_text(path, remedy)
        try:
            imports: list[dict[str, Any]] = parse_table(text)["imports"]
            if all(isinstance(entry, dict) for entry in imports):
                return imports
        except (ValueError, KeyError, TypeError, RecursionError):
            pass
        raise InputError(
            where=str(path),
            found="no list of imports",
            expected="what 'workbench import' writes",
            remedy=remedy,
        )
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(
            where=str(out),
            found="a folder with other files" if out.is_dir() else "a file",
            expected="a new or an empty folder, or one with imported recordings",
            remedy="choose another folder",
        )
    return []


def write_record(out: Path, system: System, imports: Sequence[Mapping[str, Any]]) -> None:
    """Write what was read, converted, dropped and cut, as `import.json`."""
    content = {"system": system.name, "workbench": commit(), "imports": list(imports)}
    write_json(out / IMPORTED, content)
