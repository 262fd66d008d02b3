"""`workbench prepare`: recordings that somebody published, as case folders."""

import argparse
from dataclasses import asdict
from pathlib import Path

from workbench.cli.arguments import Commands, add_out, nearby
from workbench.cli.output import CommandResult, Output


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "prepare",
        help=text,
        description="Say where to get the published recordings of a system, and what they are. "
        "With --from, turn a folder of them into case folders. Files are checked by "
        "their "
        "checksums; the workbench comes with none of them.",
        epilog="examples:\n"
        "  workbench prepare cascaded_tanks\n"
        "  workbench prepare cascaded_tanks --from DOWNLOADED --out tanks",
    )
    parser.add_argument("system", metavar="SYSTEM", help="an installed system, or a system file")
    parser.add_argument(
        "--from", dest="source", type=Path, metavar="FOLDER", help="where the published files are"
    )
    add_out(parser, "prepared")
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Say where recordings are to be had, or make cases of them."""
    from workbench.recordings.datasets import PREPARED, published, write_cases

    if options.source is None:
        description = str(published(options.system))
        output.result(description)
        output.result(f"\nnext: workbench prepare {options.system} --from FOLDER --out CASES")
        return CommandResult({"published": description})
    recordings = write_cases(options.system, options.source, options.out)
    output.result(f"{len(recordings)} recordings in {nearby(options.out)}, see {PREPARED} there")
    machines = list(dict.fromkeys(recording.machine for recording in recordings))
    for machine in machines:
        own = [recording for recording in recordings if recording.machine == machine]
        folders = [str(nearby(options.out / recording.name)) for recording in own]
        if len(machines) == 1:
            folders = [str(nearby(options.out))]
        held_out = [recording.name for recording in own if recording.held_out]
        words = ["workbench diagnose --system", options.system, *folders]
        output.result(" ".join(["next:", *words, *["--held-out"] * bool(held_out), *held_out]))
    return CommandResult(
        {"out": options.out, "recordings": [asdict(recording) for recording in recordings]}
    )
