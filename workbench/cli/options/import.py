"""What `workbench import` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import Commands, add_out, add_system, add_told


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "import",
        help=text,
        description="Turn files of recorders into case folders: CSV of any locale, Excel, MDF, "
        "TDMS, MAT, Parquet. Channels are proposed by name, unit and plausible values; you confirm "
        "them once, and columns.toml keeps that for further files. import.json says what was read, "
        "converted, left out and cut. Originals are only read.",
        epilog="examples:\n"
        "  python -m workbench import monday/*.mf4 --out cases\n"
        "  python -m workbench import stop7.csv --out cases --condition load='2 kN'\n"
        "  python -m workbench import stop7.csv --out cases --column 'time=Zeit [ms]' --yes",
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="of a recorder")
    add_out(parser, "imported")
    add_system(parser)
    add_told(parser)
    parser.add_argument(
        "--yes",
        action="store_true",
        help="take what is proposed by name without asking, but not what only a unit speaks for",
    )
    parts = parser.add_mutually_exclusive_group()
    parts.add_argument(
        "--together",
        action="store_true",
        help="the files, with all sheets and groups, are of one recording, by several recorders",
    )
    parts.add_argument(
        "--apart",
        action="store_true",
        help="sheets or groups with the same channels are recordings of their own, even if their "
        "times overlap",
    )
    parser.add_argument(
        "--whole", action="store_true", help="do not cut a long recording into several"
    )
    return parser
