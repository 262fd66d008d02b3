"""The command line: `python -m workbench --help`."""

import argparse
import json
import os
import re
import sys
import tempfile
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from workbench.cli.output import Output
from workbench.cli.parser import command_line
from workbench.cli.pdf import browser, print_page
from workbench.errors import FMUError, InputError, WorkerError
from workbench.runtime.pool import preload
from workbench.runtime.resources import own_version
from workbench.runtime.supervision import confine, run_program, short_memory, supervised

_CONFINED = "import sys; from workbench.__main__ import run_confined; sys.exit(run_confined())"


def run() -> int:
    """Run the command line of this process, with one beside it that cleans up; see `main`."""
    return supervised(main, _tell)


def run_confined() -> int:
    """Run a command line that may write to some folders only, which stand before it, as JSON."""

    def work() -> int:
        folders = [Path(folder) for folder in json.loads(sys.argv.pop(1))]
        for folder in folders:
            folder.mkdir(parents=True, exist_ok=True)
        # Before anything starts a thread, which would stay as free as it was.
        print(f"isolated: {confine([Path(tempfile.gettempdir()), *folders])}", file=sys.stderr)
        return main(sys.argv[1:], confined=True)

    return supervised(work, _tell)


def _tell(message: str) -> None:
    """Say why a command did not come to its end."""
    given = sys.argv[1:]
    command = next((word for word in given if not word.startswith("-")), "")
    Output("--json" in given, quiet=False).fail(command, 1, message)


def main(arguments: Sequence[str] | None = None, *, confined: bool = False) -> int:
    """Run the command line; returns 0 done, 1 failed, 2 wrong input, 130 interrupted.

    Parameters
    ----------
    confined : whether what --isolated asks for is so already.
    """
    given = sys.argv[1:] if arguments is None else arguments
    command = next((word for word in given if not word.startswith("-")), "")
    parser = command_line(own_version(), command)
    if empty := next((word for word in given if re.fullmatch("--.*=--", word)), ""):
        parser.error(f"{empty}: expected a value")  # argparse takes it for none, and reads no type
    options = parser.parse_args(given)
    output = Output(getattr(options, "json", False), getattr(options, "quiet", False))
    isolated = getattr(options, "isolated", False) and not confined
    if short := short_memory():
        return output.fail(command, 1, f"error: {short}")
    try:
        if odd := next((word for word in given if re.search("[\ud800-\udfff]", word)), ""):
            raise InputError(
                where="command line",
                found=f"{odd}, a name that is no UTF-8",
                expected="one that files and pages can hold",
                remedy="rename the file or folder",
            )
        if isolated:
            folders = json.dumps([str(folder) for folder in _written(options)])
            return run_program([sys.executable, "-c", _CONFINED, folders, *given])
        printing = getattr(options, "pdf", False)
        if printing:
            browser()  # one that is missing is told before the work
        module = import_module(options.module)
        if getattr(options, "workers", 1) > 1:
            preload(*getattr(module, "WORKERS_NEED", ()))  # workers import while this process does
        here = os.getcwd()
        result = module.run(options, output)
        if os.getcwd() != here or (result.page is not None and not result.page.exists()):
            raise FMUError(
                "the results do not stand where they were asked for: a model's own code went to "
                f"another folder, {os.getcwd()}, or removed them"
            )
        if printing and result.page is not None:
            output.result(f"printed: {print_page(result.page)}")
        return output.close(command, result)
    except InputError as error:
        return output.fail(command, 2, error)
    except (FMUError, WorkerError, OSError) as error:
        # OSError: of the machine, such as a full temporary folder.
        return output.fail(command, 1, error)
    except (MemoryError, ImportError) as error:
        # The linker's words for a library that memory is too short for.
        if isinstance(error, ImportError) and "failed to map segment" not in str(error):
            raise
        return output.fail(
            command,
            1,
            "error: out of memory: a model and its recordings need more than this machine has, or "
            "more than a model may take, 2048 MB unless others are given by "
            'WORKBENCH_TRIAL="memory=8000"; shorter recordings or less --workers need less',
        )
    except KeyboardInterrupt:
        return output.fail(command, 130, "interrupted")
    except SystemExit as asked:  # by SIGTERM or SIGHUP; an isolated command says so itself
        if isolated or not isinstance(asked.code, int):
            raise
        return output.fail(command, asked.code, "terminated")


def _written(options: argparse.Namespace) -> list[Path]:
    """Folders that a command writes to."""
    chosen = vars(options)
    return [chosen["out"] or Path("results")] if "out" in chosen else []


if __name__ == "__main__":
    sys.exit(run())
