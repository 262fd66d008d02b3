"""What `workbench bench` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import Commands, add_isolated, add_out, add_system, add_told


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    bench = commands.add_parser(
        "bench",
        help=text,
        description="Time derivatives and Jacobians through FMI beside plain C calls of the same "
        "sources in one program, and Co-Simulation steps; then the observers beside the same "
        "methods written with FMPy and in plain C; then the tuning: one evaluation beside FMPy, "
        "workers, memory. Needs the extra [compiler], and for a Dask cluster [cluster].",
        epilog="example:\n  python -m workbench bench --out /tmp/bench",
    )
    add_out(bench, "results/bench")
    add_system(bench)
    bench.add_argument(
        "--cases",
        nargs="+",
        type=Path,
        default=[],
        metavar="CASE",
        help="recordings that observers and tuning are timed on (default: those of the system)",
    )
    add_told(bench)
    add_isolated(bench)
    return bench
