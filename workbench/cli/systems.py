"""`workbench systems`: what is installed."""

import argparse

from workbench.cli.arguments import Commands, nearby
from workbench.cli.output import CommandResult, Output
from workbench.system.installed import system_files


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "systems", help=text, description="List the systems that are installed: name, title, file."
    )
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """List the systems."""
    from workbench.system.tables import read_table

    systems = {}
    files = system_files()
    width = max(map(len, files))
    for name, path in files.items():
        title = read_table(path, "install the workbench again", 'title = "..."').take("title", str)
        output.result(f"{name:<{width}} {title}\n{'':<{width}} {nearby(path)}")
        systems[name] = {"title": title, "file": path}
    return CommandResult({"systems": systems})
