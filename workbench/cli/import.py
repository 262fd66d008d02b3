"""`workbench import`: files of recorders as case folders."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli.arguments import Commands, add_out, add_recording_options, add_system, nearby
from workbench.cli.output import CommandResult, Output, warn
from workbench.errors import InputError
from workbench.runtime.files import locked_folder

if TYPE_CHECKING:
    from workbench.recordings.channels import RecordingOptions
    from workbench.recordings.formats import RecordedFile
    from workbench.recordings.importing import Import
    from workbench.system.system import System


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "import",
        help=text,
        description="Turn log files into case folders: CSV of any locale, Excel, MDF, "
        "TDMS, MAT, Parquet. Channels are proposed by name, unit and plausible values. You confirm "
        "them once; columns.toml keeps the answer for further files. import.json says what was "
        "read, converted, left out and split. Originals are only read.",
        epilog="examples:\n"
        "  workbench import monday/*.mf4 --out cases\n"
        "  workbench import stop7.csv --out cases --condition load='2 kN'\n"
        "  workbench import stop7.csv --out cases --column 'time=Zeit [ms]' --yes",
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="log file")
    add_out(parser, "imported")
    add_system(parser)
    add_recording_options(parser)
    parser.add_argument(
        "--yes",
        action="store_true",
        help="take what is proposed by name without asking, but not what only a unit speaks for",
    )
    parts = parser.add_mutually_exclusive_group()
    flags = {
        "--together": "the files, with all sheets and groups, are of one recording, by several "
        "loggers",
        "--apart": "sheets or groups with the same channels are recordings of their own, even if "
        "their times overlap",
    }
    for option, text in flags.items():
        parts.add_argument(option, action="store_true", help=text)
    parser.add_argument(
        "--whole", action="store_true", help="do not cut a long recording into several"
    )
    return parser


def run(
    options: argparse.Namespace, output: Output, read: Mapping[Path, RecordedFile] | None = None
) -> CommandResult:
    """Import files, each by itself; what is refused leaves the others.

    Parameters
    ----------
    read : files that were read before.
    """
    from workbench.cli.inputs import read_files, recording_options
    from workbench.recordings.importing import IMPORTED, imported
    from workbench.system.registry import load_system

    read = dict(read or {})
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
                files = read_files([path for path in paths if path not in read], output) | read
                own = [files[path] for path in paths]
                record, errors = _import(own, record, system, known, options, output)
            except InputError as error:
                errors = [error]
            for refusal in errors:
                print(f"error: {refusal}", file=sys.stderr, flush=True)
                refused.append(str(refusal))
    if record is not before:
        output.result(f"see {IMPORTED} in {nearby(options.out)}")
        if read is None:  # else the command that read the files says what comes next
            again = shlex.join(["--system", options.system, str(nearby(options.out))])
            output.result(f"next: workbench simulate {again}")
    result = {"out": options.out, "imports": record, "refused": refused}
    return CommandResult(result, {"begins": "s", "ends": "s", "seconds": "s"}, 2 if refused else 0)


def _import(
    files: Sequence[RecordedFile],
    record: list[dict[str, Any]],
    system: System,
    known: RecordingOptions,
    options: argparse.Namespace,
    output: Output,
) -> tuple[list[dict[str, Any]], list[InputError]]:
    """Import the recordings of files; returns the record of all imports, and refusals."""
    from workbench.cli.import_confirmation import confirm
    from workbench.cli.import_figure import draw_cuts
    from workbench.recordings.channels import stored_columns
    from workbench.recordings.importing import (
        describe,
        import_recording,
        store,
        write,
        write_record,
    )

    stored = stored_columns(options.out, system)
    proposed, conditions = confirm(files, system, stored, known, output, options.yes)
    hashes = [file.sha256 for file in files]
    names = {recording.name or None for recording in proposed.held}
    kept = [
        entry
        for entry in record
        if [file["sha256"] for file in entry["files"]] != hashes
        or entry.get("recording") not in names
    ]
    refused = list(proposed.refused)
    warned: set[str] = set()
    for recording in proposed.held:
        name = _free_name(files[0].path, recording.name, kept)
        try:
            imported = import_recording(name, recording, system, conditions, whole=options.whole)
        except InputError as error:
            refused.append(error)
            continue
        write(imported, options.out, system)
        store(options.out, {**stored, **proposed.named})
        if len(imported.parts) > 1:
            draw_cuts(imported, name, system, options.out)
        _report(imported, output, warned)
        kept = [*kept, describe(imported, system)]
        record = kept
        write_record(options.out, system, record)
    return record, refused


def _free_name(path: Path, part: str, others: Sequence[Mapping[str, Any]]) -> str:
    """Name of a case that no other recording has taken, on no file system."""
    from workbench.recordings.importing import case_name

    taken = {case.casefold() for other in others for case in other["cases"]}
    taken |= {case[3:] for case in taken}  # without the number of a part
    name = case_name(path, part)
    second = f"{name}_{path.suffix[1:] or 'file'}"
    further = (f"{second}_{number}" for number in count(2))
    return next(free for free in chain((name, second), further) if free.casefold() not in taken)


def _report(imported: Import, output: Output, warned: set[str]) -> None:
    """Print the cases that were written, unknown conditions, and doubts that were not told yet."""
    from workbench.recordings.case import UNKNOWN

    doubts = list(imported.measured.doubts)
    for piece in imported.pieces:
        unknown = [key for key, source in piece.sources.items() if source == UNKNOWN]
        known = [f"{key} {value}" for key, value in piece.conditions.items() if key not in unknown]
        words = [f"{piece.time.size} samples, {piece.time[-1]:.4g} s", *known]
        words += [f"unknown: {', '.join(unknown)} (--condition says it)"] * bool(unknown)
        output.result(f"  {piece.name}: {'; '.join(words)}")
        doubts += piece.doubts
    for doubt in doubts:
        if doubt not in warned:
            warn(doubt)
            warned.add(doubt)
