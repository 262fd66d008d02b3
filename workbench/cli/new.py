"""`workbench new`: a system of one's own to begin with."""

import argparse

from workbench.cli.arguments import nearby
from workbench.cli.output import CommandResult, Output
from workbench.system.template import write_system


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Write the system."""
    written = [nearby(path) for path in write_system(options.folder)]
    output.result("\n".join(map(str, written)))
    output.result(f"next: python -m workbench simulate --system {options.folder}")
    return CommandResult({"written": written})
