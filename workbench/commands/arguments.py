"""What the commands share."""

import argparse
from pathlib import Path
from typing import TypeAlias

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"

MINIMAL_OBSERVER = Path("fmus/fmi2/MinimalObserver.fmu")


def positive(text: str) -> int:
    """Type of an argument that is a whole number of 1 or more."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not 1 or more")
    return value
