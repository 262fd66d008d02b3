"""What `workbench monitor` may be told."""

import argparse

from workbench.cli.arguments import Commands, add_out, add_run, add_system, share


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "monitor",
        help=text,
        description="Estimate the quantities of the system file from each recording of one "
        "machine, in the order of their dates, and say which has changed, since when, and by how "
        "much. What the folder of results knows is not estimated again: run it after each new "
        "recording, or after many. Writes estimates.csv, alarms.csv, work.csv, summary.json, a "
        "figure (PNG, SVG), the page (index.html), and its state (state.sqlite). Exit status 0 "
        "with or without alarms.",
        epilog="examples:\n"
        "  python -m workbench monitor my_recordings --system my_machine --out results/mine\n"
        "  python -m workbench monitor stops --system train --false-alarms 0.001\n"
        "  python -m workbench monitor trains --system train --fleet",
    )
    parser.add_argument(
        "history",
        metavar="HISTORY",
        help="folder that holds a folder for each recording of one machine: cases, or as the "
        "machine wrote them, where 'workbench prepare' reads that; with --fleet, a folder or a URL "
        "with such a folder for each machine",
    )
    add_system(parser)
    parser.add_argument(
        "--false-alarms",
        type=share,
        default=0.01,
        metavar="X",
        help="alarms that a sound machine may raise by recording, all quantities together "
        "(default: %(default)s, one in a hundred recordings)",
    )
    parser.add_argument(
        "--diagnose",
        action="store_true",
        help="name the cause of what has changed, too: a diagnosis of the last recordings, of a "
        "machine that those before the change have told; into OUT/cause, takes minutes, needs the "
        "extra [compiler]",
    )
    parser.add_argument(
        "--fleet",
        action="store_true",
        help="watch many machines, one task for each; HISTORY may be a URL of an object storage, "
        "such as s3://bucket/fleet, which fsspec reads (extra [cluster])",
    )
    parser.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="with --fleet: scheduler of a Dask cluster to work on instead; needs the extra "
        "[cluster]",
    )
    add_out(parser, "results/monitor")
    add_run(parser)
    return parser
