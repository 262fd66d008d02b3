"""What `workbench rig` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import (
    Commands,
    add_out,
    add_reference,
    add_seed,
    add_system,
    add_workers,
    positive,
)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    rig = commands.add_parser(
        "rig",
        help=text,
        description="Make recordings by co-simulation of the multibody model with drive, brake, "
        "wheel-slide protection, pads and sensors. Each case folder also holds truth.csv and "
        "truth.json, which no estimator reads. The same seed gives the same bytes. Of another "
        "--system, its own virtual rig makes a set, with truth.json beside it.",
        epilog="examples:\n"
        "  python -m workbench rig --out /tmp/rig\n"
        "  python -m workbench rig --list\n"
        "  python -m workbench rig --case 15_locked_wheel --out /tmp/rig\n"
        "  python -m workbench rig --pads constant --effect fx_gain=0.015 --seed 7 --out /tmp/rig\n"
        "  python -m workbench rig --next results/next --out /tmp/rig\n"
        "  python -m workbench rig --system train --effect 'pads[3]=0.15' --out /tmp/stops",
    )
    add_out(rig, "results/rig")
    rig.add_argument("--list", action="store_true", help="list scenarios and effects, and end")
    rig.add_argument(
        "--case",
        action="append",
        default=[],
        metavar="NAME",
        help="scenario, may be repeated (default: the fourteen standard ones)",
    )
    rig.add_argument(
        "--next",
        type=Path,
        metavar="RESULT",
        help="make the best experiment of a result of 'workbench next' in place of scenarios",
    )
    add_seed(rig, "tolerances and noise")
    rig.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="plant an effect, or change one of the pads; may be repeated",
    )
    rig.add_argument(
        "--pads",
        choices=("ordinary", "constant"),
        default="ordinary",
        help="friction of dry pads: with speed, temperature and force, or constant as in the "
        "nominal model (default: %(default)s)",
    )
    _add_making(rig)
    return rig


def _add_making(rig: argparse.ArgumentParser) -> None:
    """Add what says how recordings are made and written."""
    rig.add_argument(
        "--rate",
        type=positive,
        default=200,
        metavar="HZ",
        help="of the recording, a divisor of 1000 (default: %(default)s)",
    )
    rig.add_argument(
        "--truth-every",
        type=positive,
        default=1,
        metavar="N",
        help="write the truth of every Nth sample only (default: %(default)s)",
    )
    add_reference(rig, "that makes the recordings")
    add_system(rig)
    add_workers(rig)
