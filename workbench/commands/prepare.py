"""`workbench prepare`: recordings that somebody published, as case folders."""

import argparse
from pathlib import Path

from workbench.commands.arguments import Commands, nearby
from workbench.prepare import PREPARED, published, write_cases


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "prepare",
        description="Say where the published recordings of a system are to be had and what they "
        "are; with --from, turn a folder of them into case folders. Files are checked by their "
        "checksums; the workbench comes with none of them.",
        epilog="examples:\n"
        "  python -m workbench prepare cascaded_tanks\n"
        "  python -m workbench prepare cascaded_tanks --from DOWNLOADED --out tanks",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("system", metavar="SYSTEM", help="an installed system, or a system file")
    parser.add_argument(
        "--from", dest="source", type=Path, metavar="FOLDER", help="where the published files are"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("prepared"),
        metavar="CASES",
        help="where to write (default: %(default)s)",
    )
    parser.set_defaults(run=_prepare)


def _prepare(options: argparse.Namespace) -> int:
    if options.source is None:
        print(published(options.system))
        print(f"\nnext: workbench prepare {options.system} --from FOLDER --out CASES")
        return 0
    recordings = write_cases(options.system, options.source, options.out)
    print(f"{len(recordings)} recordings in {nearby(options.out)}, see {PREPARED} there")
    machines = list(dict.fromkeys(one.machine for one in recordings))
    for machine in machines:
        own = [one for one in recordings if one.machine == machine]
        folders = [str(nearby(options.out / one.name)) for one in own]
        if len(machines) == 1:
            folders = [str(nearby(options.out))]
        held_out = [one.name for one in own if one.held_out]
        words = ["workbench diagnose --system", options.system, *folders]
        print("next:", *words, *["--held-out"] * bool(held_out), *held_out)
    return 0
