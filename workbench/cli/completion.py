"""`workbench completion`: what a shell needs to complete the command line."""

import argparse
import sys

from workbench.cli.arguments import Commands
from workbench.cli.extras import require
from workbench.cli.output import CommandResult, Output
from workbench.cli.parser import command_line


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "completion",
        help=text,
        description="Print a script by which a shell completes commands and options. Needs the "
        "extra [completion]; the script does not.",
        epilog="examples:\n"
        "  workbench completion bash > ~/.local/share/bash-completion/completions/workbench\n"
        "  workbench completion zsh > ~/.zfunc/_workbench     # a folder of $fpath",
    )
    parser.add_argument("shell", choices=("bash", "zsh", "fish", "tcsh"), help="of the user")
    return parser


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
