"""What `workbench power` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import (
    Commands,
    above_zero,
    add_effects,
    add_isolated,
    add_out,
    add_pdf,
    add_reference,
    add_seed,
    add_system,
    add_workers,
    count,
)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "power",
        help=text,
        description="Plant effects in the virtual rig, diagnose the recordings without telling, "
        "and count: false alarms on clean sets, right names against the size of the effect, pairs, "
        "causes that are not in the catalogue, coverage of the intervals. Writes power.json, "
        "figures (PNG, SVG) and the verdict on each set (sets.jsonl). Takes hours; Ctrl-C keeps "
        "what there is and reports it, --resume goes on. Needs the extra [compiler].",
        epilog="examples:\n"
        "  python -m workbench power\n"
        "  python -m workbench power --clean 5 --sizes 4 --repeats 1 --pairs 5 --out /tmp/quick\n"
        "  python -m workbench power --effects NAME --sizes 4 --repeats 1 --clean 0\n"
        "  python -m workbench power --clean 200 --resume\n"
        "  python -m workbench power --thresholds --sets 8\n"
        "  python -m workbench power --plan --case 01_dry_80_1.5 --case 04_dry_160_4.2\n"
        "  python -m workbench power --follow --case 24_alike_80_2.7 --case 25_alike_80_2.7\n"
        "  python -m workbench power --leave-out-effect --sizes 8 --repeats 1 --clean 0\n"
        "  python -m workbench power --sheet-error --repeats 2\n"
        "  python -m workbench power --system train --recorded labelled healthy",
    )
    _add_sets(parser)
    add_workers(parser)
    _add_checks(parser)
    parser.add_argument("--resume", action="store_true", help="go on from the verdicts in --out")
    add_system(parser)
    add_reference(parser, "that makes the recordings")
    add_out(parser, "results/power")
    add_pdf(parser)
    add_isolated(parser)
    return parser


def _add_sets(parser: argparse.ArgumentParser) -> None:
    """Add which sets of recordings are made."""
    add_effects(parser, "plant, also those that the catalogue lacks, by the rig's names")
    for option, default, text in (
        ("--clean", 50, "sets without an effect"),
        ("--repeats", 3, "sets of each effect at each size"),
        ("--pairs", 30, "sets with two of the effects, at the largest size"),
        ("--sets", 8, "sets of --thresholds, of all kinds alike"),
    ):
        parser.add_argument(
            option,
            type=count,
            default=default,
            metavar="N",
            help=f"{text} (default: %(default)s)",
        )
    parser.add_argument(
        "--sizes",
        type=above_zero,
        nargs="+",
        default=[0.5, 1.0, 2.0, 4.0],
        metavar="X",
        help="multiples of the least size that is worth a finding (default: 0.5 1 2 4)",
    )
    add_seed(parser, "all sets")
    parser.add_argument(
        "--recorded",
        nargs="+",
        type=Path,
        default=[],
        metavar="FOLDER",
        help="sets that were recorded, each with a truth.json of what is wrong in them, in place "
        "of sets that the virtual rig makes",
    )
    parser.add_argument(
        "--case",
        action="append",
        default=[],
        metavar="NAME",
        help="recording of a set, may be repeated (default: those that are usual for the system)",
    )


def _add_checks(parser: argparse.ArgumentParser) -> None:
    """Add what is asked instead of how often the diagnosis is right."""
    checks = parser.add_mutually_exclusive_group()
    for option, text in (
        (
            "--thresholds",
            "halve and double each threshold of the diagnosis on the same recordings, "
            "and tell what changes (into OUT/thresholds)",
        ),
        (
            "--leave-out-effect",
            "leave the planted effect out of the catalogue, and tell which law is proposed in its "
            "place, on --repeats sets of each at the largest size (into OUT/left_out)",
        ),
        (
            "--plan",
            "before a recording is made: the chance that the recordings named by --case show each "
            "effect at --sizes, from one set without any (into OUT/plan)",
        ),
        (
            "--follow",
            "where a set leaves the planted effect with others, make the recording that is "
            "proposed next and some that are drawn, and tell which part them (into OUT/followed)",
        ),
        (
            "--sheet-error",
            "make recordings of a rig that differs from its data sheet in --repeats "
            "sets of each error, and tell what is said (into OUT/sheet_error)",
        ),
    ):
        checks.add_argument(
            option,
            action="store_const",
            const=option[2:].replace("-", "_"),
            dest="check",
            help=text,
        )
