"""What `workbench simulate` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import (
    Commands,
    add_isolated,
    add_models,
    add_pdf,
    add_recordings,
    add_system,
    add_workers,
    example_case,
)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    own = example_case()
    parser = commands.add_parser(
        "simulate",
        help=text,
        description="Run all estimators on recordings; write a page to read (index.html), and "
        "beside it scores (summary.json), data (CSV) and figures (PNG, SVG).",
        epilog="examples:\n"
        "  python -m workbench simulate\n"
        f"  python -m workbench simulate {own} --out /tmp/one\n"
        "  python -m workbench simulate my_cases --system my/system.toml\n"
        "  python -m workbench simulate my_cases --fmu my_model.fmu --out results/mine\n"
        f"  python -m workbench simulate {own} --live\n"
        "  python -m workbench simulate --estimator disturbance_observer --estimator ekf",
    )
    add_recordings(parser, out="results/simulate")
    add_system(parser)
    add_models(parser)
    parser.add_argument(
        "--gains",
        type=Path,
        metavar="FILE",
        help="gains.toml of 'workbench tune', for the estimator that it names (default: gains "
        "tuned for the system's models, else gains reasoned from the linearised models)",
    )
    parser.add_argument(
        "--untuned",
        action="store_true",
        help="gains reasoned from the linearised models, to compare tuned ones with",
    )
    parser.add_argument(
        "--estimator",
        action="append",
        default=[],
        metavar="NAME",
        help="run this one, may be repeated (default: the standard ones of the system)",
    )
    add_workers(parser)
    parser.add_argument(
        "--live",
        action="store_true",
        help="show each run in a window as it goes, one after the other",
    )
    add_pdf(parser)
    add_isolated(parser)
    return parser
