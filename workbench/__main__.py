"""The command line: `python -m workbench --help`."""

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import workbench.commands
from workbench.companion import companion_part
from workbench.confinement import confine
from workbench.errors import FMUError, InputError, WorkerError
from workbench.installed import companions
from workbench.supervision import run_program, supervised

_CONFINED = "import sys; from workbench.__main__ import run_confined; sys.exit(run_confined())"


def run() -> int:
    """Run the command line of this process, with one beside it that cleans up; see `main`."""
    return supervised(main)


def run_confined() -> int:
    """Run a command line that may write to some folders only, which stand before it, as JSON."""

    def work() -> int:
        folders = [Path(one) for one in json.loads(sys.argv[1])]
        for folder in folders:
            folder.mkdir(parents=True, exist_ok=True)
        # Before anything starts a thread, which would stay as free as it was.
        print(f"isolated: {confine([Path(tempfile.gettempdir()), *folders])}", file=sys.stderr)
        return main(sys.argv[2:], confined=True)

    return supervised(work)


def main(arguments: Sequence[str] | None = None, *, confined: bool = False) -> int:
    """Run the command line; returns 0 done, 1 failed, 2 wrong input, 130 interrupted.

    Parameters
    ----------
    confined : whether what --isolated asks for is so already.
    """
    given = sys.argv[1:] if arguments is None else arguments
    options = _parser(given[0] if given else "").parse_args(given)
    try:
        if getattr(options, "isolated", False) and not confined:
            folders = json.dumps([str(folder) for folder in _written(options)])
            return run_program([sys.executable, "-c", _CONFINED, folders, *given])
        return int(options.run(options))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except (FMUError, WorkerError, OSError) as error:
        # OSError: of the machine, such as a full temporary folder.
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


def _written(options: argparse.Namespace) -> list[Path]:
    """Folders that a command writes to."""
    chosen = vars(options)
    out = [chosen["out"] or Path("results")] if "out" in chosen else []
    return [*out, *([chosen["json"].parent] if chosen.get("json") else [])]


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
    sys.exit(run())
