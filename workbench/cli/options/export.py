"""What `workbench export` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import (
    Commands,
    add_isolated,
    add_out,
    add_platforms,
    add_reference,
    add_system,
)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    export = commands.add_parser(
        "export",
        help=text,
        description="Write an estimator with its gains as a Co-Simulation FMU for all platforms, "
        "which runs in any FMI tool without Python, and, where the system has a reference model, "
        "an SSP 1.0 package in which it observes that. One communication step takes one sample. "
        "Needs the extra [compiler].",
        epilog="examples:\n"
        "  python -m workbench export\n"
        "  python -m workbench export --gains results/tune/disturbance_observer/gains.toml\n"
        "  python -m workbench export --estimator mhe --fmi 3 --out /tmp/export\n"
        "  python -m workbench export --estimator imm --gains results/tune/ekf/gains.toml",
    )
    export.add_argument(
        "--gains",
        type=Path,
        metavar="FILE",
        help="gains.toml of 'workbench tune', which names the estimator unless --estimator does "
        "(default: those that come tuned with the system, else those that follow from the model)",
    )
    export.add_argument(
        "--estimator",
        metavar="NAME",
        help="estimator (default: the first in [export.classes] of the system, else ekf)",
    )
    add_system(export)
    export.add_argument(
        "--fmi",
        type=int,
        choices=(2, 3),
        default=2,
        help="version of the FMU; SSP 1.0 packages hold FMI 2.0 (default: %(default)s)",
    )
    add_platforms(export, "the FMU", "all")
    add_reference(export, "(FMI 2.0) that the package connects the observer to")
    add_out(export, "results/export")
    add_isolated(export)
    return export
