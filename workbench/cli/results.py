"""`workbench results`: what a folder holds, and two runs side by side."""

import argparse
import sys
from pathlib import Path
from typing import Any

from workbench.cli.output import CommandResult, Output
from workbench.errors import InputError
from workbench.pages.runs import (
    RunRecord,
    compare_runs,
    differences,
    format_changes,
    format_runs,
    read_runs,
)


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """List the runs of a folder, or compare them with those of another."""
    found = read_runs(options.folder, _warn)
    if options.other is None:
        output.result(format_runs(found))
        return CommandResult({"runs": [one.to_dict() for one in found]})
    told: list[dict[str, Any]] = []
    for before, after in _pairs(found, read_runs(options.other, _warn), options.other):
        changes = compare_runs(before, after)
        output.result(f"{chr(10) * bool(told)}{format_changes(before, after, changes)}")
        told.append(
            {
                "before": before.to_dict(),
                "after": after.to_dict(),
                "not_the_same": differences(before, after),
                "changes": [change.to_dict() for change in changes],
            }
        )
    return CommandResult({"comparisons": told})


def _warn(error: InputError) -> None:
    print(f"warning: {error}", file=sys.stderr, flush=True)


def _pairs(
    before: list[RunRecord], after: list[RunRecord], other: Path
) -> list[tuple[RunRecord, RunRecord]]:
    """Runs of the same place; a single one of each, wherever they are."""
    if len(before) == len(after) == 1:
        return [(before[0], after[0])]
    places = {(one.place, one.summary): one for one in after}
    pairs = [
        (one, places[one.place, one.summary])
        for one in before
        if (one.place, one.summary) in places
    ]
    if not pairs:
        raise InputError(
            where=str(other),
            found=f"results in {', '.join(one.place for one in after)}",
            expected=f"results in one of {', '.join(one.place for one in before)}, as in the first",
            remedy="name the folders of two runs of the same command",
        )
    return pairs
