"""What `workbench prepare` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import Commands, add_out


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "prepare",
        help=text,
        description="Say where the published recordings of a system are to be had and what they "
        "are; with --from, turn a folder of them into case folders. Files are checked by their "
        "checksums; the workbench comes with none of them.",
        epilog="examples:\n"
        "  python -m workbench prepare cascaded_tanks\n"
        "  python -m workbench prepare cascaded_tanks --from DOWNLOADED --out tanks",
    )
    parser.add_argument("system", metavar="SYSTEM", help="an installed system, or a system file")
    parser.add_argument(
        "--from", dest="source", type=Path, metavar="FOLDER", help="where the published files are"
    )
    add_out(parser, "prepared")
    return parser
