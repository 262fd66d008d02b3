"""What `workbench distance` may be told."""

import argparse

from workbench.cli.arguments import (
    Commands,
    add_model,
    add_recordings,
    add_run,
    add_seed,
    add_system,
    count,
    positive,
)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "distance",
        help=text,
        description="Predict the distance of a stop that was not made from past stops: levels of "
        "the machine as the diagnosis calibrates them, how it differs from stop to stop, and what "
        "its model left, drawn together. Every past stop is predicted from the others and stands "
        "beside what was measured, also corrected to nominal conditions. The safety level is the "
        "deceleration, over the nominal one, that is reached but for one stop in 10, 100, ..., by "
        "subset simulation. Writes distance.json, stops.csv, quantiles.csv, safety.csv, a "
        "figure and the page (index.html). Ctrl-C keeps the runs of the safety level that are "
        "done.",
        epilog="examples:\n"
        "  python -m workbench distance --system my_machine my_stops\n"
        "  python -m workbench distance --system my_machine my_stops --ask speed='160 km/h'\n"
        "  python -m workbench distance --system my_machine my_stops --safety 0\n"
        "  python -m workbench distance --system my_machine my_stops --plain 100000",
    )
    add_recordings(parser, out="results/distance")
    add_system(parser)
    parser.add_argument(
        "--ask",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="what the stop is asked for, or a condition, by the names of the system file; the "
        "rest is usual; may be repeated",
    )
    _add_counts(parser)
    add_model(parser)
    add_seed(parser, "all that is drawn")
    add_run(parser)
    return parser


def _add_counts(parser: argparse.ArgumentParser) -> None:
    """How many stops are drawn, for what."""
    parser.add_argument(
        "--safety",
        type=count,
        default=9,
        metavar="K",
        help="safety level down to one stop in 10^K; 0: none (default: %(default)s)",
    )
    parser.add_argument(
        "--samples",
        type=positive,
        default=4000,
        metavar="N",
        help="stops of the distribution (default: %(default)s)",
    )
    parser.add_argument(
        "--plain",
        type=count,
        default=0,
        metavar="N",
        help="check the safety level by so many stops, each drawn by itself; 1e5 take minutes, 1e7 "
        "hours, and Ctrl-C keeps those that are drawn (default: %(default)s)",
    )
