"""What `workbench results` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import Commands


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
        "  python -m workbench results results\n"
        "  python -m workbench results results/before results/after\n"
        "  python -m workbench results results/before results/after --json",
    )
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER", help="of results, or before a change"
    )
    parser.add_argument(
        "other", type=Path, nargs="?", metavar="OTHER", help="to compare with, after the change"
    )
    return parser
