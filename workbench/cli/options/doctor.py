"""What `workbench doctor` may be told."""

import argparse

from workbench.cli.arguments import Commands


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    return commands.add_parser(
        "doctor",
        help=text,
        description="Say what is installed, what is missing and what each extra is for; compare "
        "the FMUs that come along with their manifest; compile a small model, and run the result; "
        "look at the folder of what is kept between runs; say what to do. Exit status: 0 sound, "
        "1 something does not work as it is.",
        epilog="examples:\n  python -m workbench doctor\n  python -m workbench doctor --json",
    )
