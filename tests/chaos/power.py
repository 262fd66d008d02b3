"""`python -m tests.chaos.power FOLDER`: see `sets`, which is imported as every command is."""

import sys
from importlib import import_module
from pathlib import Path

from workbench.errors import InputError
from workbench.runtime.supervision import supervised


def _work() -> int:
    try:
        status: int = import_module("tests.chaos.sets").main(Path(sys.argv[1]))
    except InputError as error:  # such as a full disk
        print(error, file=sys.stderr)
        return 2
    return status


if __name__ == "__main__":
    sys.exit(supervised(_work))
