"""`workbench new`: a system of one's own to begin with."""

import argparse
from pathlib import Path

from workbench.commands.arguments import Commands, nearby
from workbench.template import write_system


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "new",
        description="Write a commented system file, a small Modelica library with one slot and one "
        "effect, and recordings: a tank that simulate, tune and diagnose work on as it is, to be "
        "changed into a machine of one's own.",
        epilog="examples:\n"
        "  python -m workbench new my_machine\n"
        "  python -m workbench simulate --system my_machine\n"
        "  python -m workbench diagnose --system my_machine",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="where to write; made as needed")
    parser.set_defaults(run=_new)


def _new(options: argparse.Namespace) -> int:
    for path in write_system(options.folder):
        print(nearby(path))
    print(f"next: python -m workbench simulate --system {options.folder}")
    return 0
