"""`workbench import`: files of recorders as case folders."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from typing import Any

from workbench.cli.arguments import nearby
from workbench.cli.confirming import confirmed
from workbench.cli.import_figure import draw_cuts
from workbench.cli.inputs import recording_options
from workbench.cli.output import CommandResult, Output
from workbench.errors import InputError
from workbench.recordings.case import UNKNOWN
from workbench.recordings.channels import RecordingOptions, stored_columns
from workbench.recordings.formats import read_recorded_file
from workbench.recordings.importing import (
    IMPORTED,
    Import,
    case_name,
    describe,
    import_recording,
    imported,
    store,
    write,
    write_record,
)
from workbench.runtime.files import locked_folder
from workbench.system.registry import load_system
from workbench.system.system import System


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Import files, each by itself; what is refused leaves the others."""
    system = load_system(options.system)
    known = recording_options(options, system)
    if options.together or options.apart:
        known = replace(known, apart=options.apart)
    together = [options.files] if options.together else [[path] for path in options.files]
    refused: list[str] = []
    with locked_folder(options.out):
        record = before = imported(options.out)
        for paths in together:
            try:
                record, errors = _files(paths, record, system, known, options, output)
            except InputError as error:
                errors = [error]
            for one in errors:
                print(f"error: {one}", file=sys.stderr, flush=True)
                refused.append(str(one))
    if record is not before:
        output.result(f"see {IMPORTED} in {nearby(options.out)}")
        output.result(f"next: workbench simulate --system {options.system} {nearby(options.out)}")
    told_all = {"out": options.out, "imports": record, "refused": refused}
    return CommandResult(
        told_all, {"begins": "s", "ends": "s", "seconds": "s"}, 2 if refused else 0
    )


def _files(
    paths: Sequence[Path],
    record: list[dict[str, Any]],
    system: System,
    known: RecordingOptions,
    options: argparse.Namespace,
    output: Output,
) -> tuple[list[dict[str, Any]], list[InputError]]:
    """Import the recordings of some files; returns what is imported by now, and what is not."""
    files = [read_recorded_file(path) for path in paths]
    stored = stored_columns(options.out, system)
    found, conditions = confirmed(files, system, stored, known, output, options.yes)
    hashes = [file.sha256 for file in files]
    names = {one.name or None for one in found.held}
    by_now = [
        one
        for one in record
        if [file["sha256"] for file in one["files"]] != hashes or one.get("recording") not in names
    ]
    refused = list(found.refused)
    warned: set[str] = set()
    for recording in found.held:
        name = _free_name(paths[0], recording.name, by_now)
        try:
            one = import_recording(name, recording, system, conditions, whole=options.whole)
        except InputError as error:
            refused.append(error)
            continue
        write(one, options.out, system)
        store(options.out, {**stored, **found.named})
        if len(one.parts) > 1:
            draw_cuts(one, name, system, options.out)
        _tell(one, output, warned)
        by_now = [*by_now, describe(one, system)]
        record = by_now
        write_record(options.out, system, record)
    return record, refused


def _free_name(path: Path, part: str, others: Sequence[Mapping[str, Any]]) -> str:
    """Name of a case that no other recording has taken, on no file system."""
    taken = {case.casefold() for other in others for case in other["cases"]}
    taken |= {case[3:] for case in taken}  # without the number of a part
    name = case_name(path, part)
    second = f"{name}_{path.suffix[1:] or 'file'}"
    further = (f"{second}_{number}" for number in count(2))
    return next(one for one in chain((name, second), further) if one.casefold() not in taken)


def _tell(one: Import, output: Output, warned: set[str]) -> None:
    """Say what was written, what nobody knows, and what is unlikely and was not said by now."""
    doubts = list(one.measured.doubts)
    for piece in one.pieces:
        unknown = [key for key, source in piece.sources.items() if source == UNKNOWN]
        known = [f"{key} {value}" for key, value in piece.conditions.items() if key not in unknown]
        words = [f"{piece.time.size} samples, {piece.time[-1]:.4g} s", *known]
        words += [f"unknown: {', '.join(unknown)} (--condition says it)"] * bool(unknown)
        output.result(f"  {piece.name}: {'; '.join(words)}")
        doubts += piece.doubts
    for doubt in doubts:
        if doubt not in warned:
            print(f"warning: {doubt}", file=sys.stderr, flush=True)
            warned.add(doubt)
