"""What `workbench systems` may be told."""

import argparse

from workbench.cli.arguments import Commands


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "systems", help=text, description="List the systems that are installed: name, title, file."
    )
    return parser
