"""The command line: `python -m workbench --help`."""

import argparse
import sys
from collections.abc import Sequence
from importlib.metadata import version

from workbench.commands import (
    add_accuracy,
    add_bench,
    add_diagnose,
    add_export,
    add_fmu,
    add_observability,
    add_power,
    add_rig,
    add_simulate,
    add_tune,
)
from workbench.errors import InputError
from workbench.fmu import FMUError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns 0 done, 1 failed, 2 wrong input, 130 interrupted."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except FMUError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="workbench",
        description="Observers for the longitudinal dynamics of a wheelset, on FMUs.",
    )
    parser.add_argument("--version", action="version", version=version("wheelset-workbench"))
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    add_simulate(commands)
    add_accuracy(commands)
    add_tune(commands)
    add_diagnose(commands)
    add_power(commands)
    add_observability(commands)
    add_rig(commands)
    add_export(commands)
    add_fmu(commands)
    add_bench(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
