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
    files = system_files()
    width = max(map(len, files))
    for name, path in files.items():
        title = read_table(path, "install the workbench again", 'title = "..."').take("title", str)
        print(f"{name:<{width}} {title}\n{'':<{width}} {nearby(path)}")
    return 0
