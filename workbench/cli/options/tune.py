"""What `workbench tune` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import (
    Commands,
    add_isolated,
    add_map,
    add_pdf,
    add_seed,
    add_system,
    add_told,
    add_workers,
    positive,
)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "tune",
        help=text,
        description="Find gains that minimise z, the worst of the objectives z_k of all cases "
        "(Schwarz et al. 2018, equations 11 and 12), by differential evolution. Writes gains.toml, "
        "summary.json, figures and a page. Ctrl-C keeps the best so far; --resume goes on from "
        "there, to the same result.",
        epilog="examples:\n"
        "  python -m workbench tune disturbance_observer\n"
        "  python -m workbench tune parameter_estimator --budget 20 --out /tmp/quick\n"
        "  python -m workbench tune disturbance_observer --folds 5\n"
        "  python -m workbench tune disturbance_observer --judge-by smoother\n"
        "  python -m workbench tune disturbance_observer --cluster tcp://10.0.0.1:8786",
    )
    parser.add_argument(
        "estimator", metavar="ESTIMATOR", help="one with gains, such as disturbance_observer or ekf"
    )
    add_system(parser)
    parser.add_argument(
        "--cases",
        nargs="+",
        type=Path,
        default=[],
        metavar="CASE",
        help="case folders, or folders of case folders (default: those of the system)",
    )
    add_told(parser)
    parser.add_argument(
        "--fmu",
        type=Path,
        metavar="FILE",
        help="observer model (default: that of the estimator)",
    )
    add_map(parser)
    _add_search(parser)
    _add_work(parser)
    add_pdf(parser)
    add_isolated(parser)
    return parser


def _add_search(parser: argparse.ArgumentParser) -> None:
    """Add what decides about the gains."""
    parser.add_argument(
        "--budget",
        type=positive,
        default=100,
        metavar="GENERATIONS",
        help="most generations to search (default: %(default)s)",
    )
    parser.add_argument(
        "--population",
        type=positive,
        default=15,
        metavar="N",
        help="candidates per gain (default: %(default)s)",
    )
    add_seed(parser, "the search")
    parser.add_argument(
        "--scale-error",
        "--radius-error",
        type=float,
        metavar="PERCENT",
        help="judge each case again with an output's scale off by this much, alternately to both "
        "sides, so that gains do not rely on what nobody knows as well; 0: only as recorded "
        "(default: as the system says)",
    )
    parser.add_argument(
        "--folds",
        type=int,
        default=0,
        metavar="K",
        help="also tune K times without a K-th of the cases, and judge on these",
    )
    parser.add_argument(
        "--judge-by",
        metavar="ESTIMATOR",
        help="judge by one that knows whole recordings, such as smoother, what no sensor measures "
        "(default: by what is measured)",
    )
    parser.add_argument(
        "--full-evaluation",
        action="store_true",
        help="do not drop candidates that have lost; the result is the same",
    )


def _add_work(parser: argparse.ArgumentParser) -> None:
    """Add who does the work, and what is shown and kept of it."""
    add_workers(parser)
    parser.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster to work on instead; needs the extra [cluster]",
    )
    parser.add_argument(
        "--timeout",
        type=positive,
        default=60,
        metavar="SECONDS",
        help="a candidate that takes longer ends its worker (default: %(default)s)",
    )
    parser.add_argument("--resume", action="store_true", help="go on from the last checkpoint")
    parser.add_argument(
        "--live", action="store_true", help="draw convergence.png anew every 5 s while searching"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="where to write (default: results/tune/ESTIMATOR)",
    )
