"""What `workbench next` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import Commands, add_out, add_run


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "next",
        help=text,
        description="Say which recording to make next: of all experiments that the system file "
        "allows, those that part best the causes which a diagnosis could not tell apart; or, of a "
        "single cause, that make its size most sure. Three are proposed, with the separation that "
        "is left when every model is fitted again, the chance that the right cause is then named, "
        "and the cost. Writes next.json, experiments.csv (all that were tried) and a figure of "
        "the responses. Needs the extra [compiler].",
        epilog="examples:\n"
        "  python -m workbench diagnose my_recordings --out results/mine\n"
        "  python -m workbench next results/mine\n"
        "  python -m workbench next results/mine --system my_machine --out results/mine_next",
    )
    parser.add_argument(
        "result", type=Path, metavar="RESULT", help="folder of a diagnosis, with summary.json"
    )
    parser.add_argument(
        "--system",
        default="",
        metavar="NAME|FILE",
        help="an installed system, or a system file (default: that of the diagnosis, by its name)",
    )
    add_out(parser, "results/next")
    add_run(parser)
    return parser
