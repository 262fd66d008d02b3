"""The command line: `python -m workbench --help`."""

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version

import workbench.commands
from workbench.companion import companion_part
from workbench.errors import FMUError, InputError
from workbench.installed import companions


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns 0 done, 1 failed, 2 wrong input, 130 interrupted."""
    given = sys.argv[1:] if arguments is None else arguments
    options = _parser(given[0] if given else "").parse_args(given)
    try:
        return int(options.run(options))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except (FMUError, OSError) as error:  # OSError: of the machine, such as a full temporary folder
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


def _parser(command: str) -> argparse.ArgumentParser:
    """Parser of the command line, which knows the arguments of one command only."""
    parser = argparse.ArgumentParser(
        prog="workbench",
        description="Observers, their tuning, and a diagnosis of models, on FMUs.",
    )
    parser.add_argument("--version", action="version", version=version("wheelset-workbench"))
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    parts = [companion_part(name, "commands") for name in companions()]
    for package in (workbench.commands, *(part for part in parts if part)):
        for name, text in package.COMMANDS.items():
            if name == command:
                import_module(f"{package.__name__}.{name}").add(commands)
            else:
                commands.add_parser(name, help=text)
    return parser


if __name__ == "__main__":
    sys.exit(main())
