"""What `workbench completion` may be told."""

import argparse

from workbench.cli.arguments import Commands


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
