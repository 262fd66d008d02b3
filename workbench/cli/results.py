"""`workbench results`: what a folder holds, and two runs side by side."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli.arguments import Commands
from workbench.cli.output import CommandResult, Output, warn
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.pages.runs import RunRecord


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "results",
        help=text,
        description="Say what a folder of results holds: command, date, version, system, the "
        "answer and its numbers, files. With a second folder, compare: what got better, what "
        "worse, what stayed, and what else is not the same (version, recordings, settings). Of two "
        "folders with several runs, those of the same place are compared.",
        epilog="examples:\n"
        "  workbench results results\n"
        "  workbench results results/simulate --csv\n"
        "  workbench results results/before results/after\n"
        "  workbench results results/before results/after --json",
    )
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER", help="of results, or before a change"
    )
    parser.add_argument(
        "other", type=Path, nargs="?", metavar="OTHER", help="to compare with, after the change"
    )
    parser.add_argument(
        "--csv",
        action="store_true",
        help="write NAME.csv for each NAME.npz of estimates in FOLDER, where there is none",
    )
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """List the runs of a folder, or compare them with those of another."""
    from workbench.pages.runs import (
        compare_runs,
        differences,
        format_changes,
        format_runs,
        read_runs,
    )

    runs = read_runs(options.folder, warn)
    if options.csv:
        _write_csv(options.folder, output)
    if options.other is None:
        output.result(format_runs(runs))
        return CommandResult({"runs": [run.to_dict() for run in runs]})
    comparisons: list[dict[str, Any]] = []
    for before, after in _pairs(runs, read_runs(options.other, warn), options.other):
        changes = compare_runs(before, after)
        output.result(f"{chr(10) * bool(comparisons)}{format_changes(before, after, changes)}")
        comparisons.append(
            {
                "before": before.to_dict(),
                "after": after.to_dict(),
                "not_the_same": differences(before, after),
                "changes": [change.to_dict() for change in changes],
            }
        )
    return CommandResult({"comparisons": comparisons})


def _write_csv(folder: Path, output: Output) -> None:
    from workbench.observers.report import write_numbers
    from workbench.pages.columns import read_estimates

    for packed in sorted(folder.rglob("*.npz")):
        path = packed.with_suffix(".csv")
        if not path.exists():
            columns = read_estimates(packed)
            write_numbers({str(name): columns[name].to_numpy() for name in columns}, path, 7)
            output.stage(f"wrote {path}")


def _pairs(
    before: list[RunRecord], after: list[RunRecord], other: Path
) -> list[tuple[RunRecord, RunRecord]]:
    """Runs of the same place; a single one of each, wherever they are."""
    if len(before) == len(after) == 1:
        return [(before[0], after[0])]
    places = {(run.place, run.summary): run for run in after}
    pairs = [
        (run, places[run.place, run.summary])
        for run in before
        if (run.place, run.summary) in places
    ]
    if not pairs:
        raise InputError(
            where=str(other),
            found=f"results in {', '.join(run.place for run in after)}",
            expected=f"results in one of {', '.join(run.place for run in before)}, as in the first",
            remedy="name the folders of two runs of the same command",
        )
    return pairs
