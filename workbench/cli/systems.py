"""`workbench systems`: what is installed."""

import argparse

from workbench.cli.arguments import nearby
from workbench.cli.output import CommandResult, Output
from workbench.system.installed import system_files
from workbench.system.tables import read_table


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """List the systems."""
    found = {}
    files = system_files()
    width = max(map(len, files))
    for name, path in files.items():
        title = read_table(path, "install the workbench again", 'title = "..."').take("title", str)
        output.result(f"{name:<{width}} {title}\n{'':<{width}} {nearby(path)}")
        found[name] = {"title": title, "file": path}
    return CommandResult({"systems": found})
