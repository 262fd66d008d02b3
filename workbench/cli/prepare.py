"""`workbench prepare`: recordings that somebody published, as case folders."""

import argparse
from dataclasses import asdict

from workbench.cli.arguments import nearby
from workbench.cli.output import CommandResult, Output
from workbench.recordings.datasets import PREPARED, published, write_cases


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Say where recordings are to be had, or make cases of them."""
    if options.source is None:
        told = str(published(options.system))
        output.result(told)
        output.result(f"\nnext: workbench prepare {options.system} --from FOLDER --out CASES")
        return CommandResult({"published": told})
    recordings = write_cases(options.system, options.source, options.out)
    output.result(f"{len(recordings)} recordings in {nearby(options.out)}, see {PREPARED} there")
    machines = list(dict.fromkeys(recording.machine for recording in recordings))
    for machine in machines:
        own = [recording for recording in recordings if recording.machine == machine]
        folders = [str(nearby(options.out / one.name)) for one in own]
        if len(machines) == 1:
            folders = [str(nearby(options.out))]
        held_out = [one.name for one in own if one.held_out]
        words = ["workbench diagnose --system", options.system, *folders]
        output.result(" ".join(["next:", *words, *["--held-out"] * bool(held_out), *held_out]))
    return CommandResult(
        {"out": options.out, "recordings": [asdict(recording) for recording in recordings]}
    )
