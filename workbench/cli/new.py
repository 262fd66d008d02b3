"""`workbench new`: a system of one's own to begin with."""

import argparse
from pathlib import Path

from workbench.cli.arguments import Commands, nearby
from workbench.cli.output import CommandResult, Output


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "new",
        help=text,
        description="Write a commented system file, a small Modelica library with one slot and one "
        "effect, and recordings: a tank that simulate, tune and diagnose work on as it is, to be "
        "changed into a machine of one's own.",
        epilog="examples:\n"
        "  python -m workbench new my_machine\n"
        "  python -m workbench simulate --system my_machine\n"
        "  python -m workbench diagnose --system my_machine",
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="where to write; made as needed")
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Write the system."""
    from workbench.system.template import write_system

    written = [nearby(path) for path in write_system(options.folder)]
    output.result("\n".join(map(str, written)))
    output.result(f"next: python -m workbench simulate --system {options.folder}")
    return CommandResult({"written": written})
