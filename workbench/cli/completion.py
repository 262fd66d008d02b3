"""`workbench completion`: what a shell needs to complete the command line."""

import argparse
import sys

from workbench.cli.extras import require
from workbench.cli.output import CommandResult, Output
from workbench.cli.parser import command_line


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Print the script of a shell.

    By shtab: it writes all options into a script, so that a key press starts no Python.
    """
    require("shtab", "completion", "which writes scripts for shells", "workbench completion")
    import shtab  # an extra, of this command alone

    script = shtab.complete(command_line(""), options.shell)
    output.result(script)
    if sys.stdout.isatty():
        output.progress("put it where the shell looks for it, see --help")
    return CommandResult({"shell": options.shell, "script": script})
