"""`workbench systems`: what is installed."""

import argparse

from workbench.commands.arguments import Commands, nearby
from workbench.installed import system_files
from workbench.tables import read_table


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "systems", description="List the systems that are installed: name, title, file."
    )
    parser.set_defaults(run=_systems)


def _systems(options: argparse.Namespace) -> int:
    for name, path in system_files().items():
        title = read_table(path, "install the workbench again", 'title = "..."').take("title", str)
        print(f"{name:<16} {title}\n{'':<16} {nearby(path)}")
    return 0
