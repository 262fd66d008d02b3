"""The parser of the command line, made of those of its commands."""

import argparse
from importlib import import_module

from workbench.cli import COMMANDS
from workbench.system.installed import installed_plugins

# The one command of a room above this one.
_BENCH = ("workbench.benchmark.bench", "time calls into the FMUs, the observers, and the tuning")
_OUTPUT = {  # of all commands, before their names or after them
    "--json": "print the result as one JSON document, with units, and nothing else",
    "--quiet": "say nothing of progress, which goes to standard error",
}


def command_line(release: str, *selected: str) -> argparse.ArgumentParser:
    """The parser of the command line.

    Parameters
    ----------
    release : that --version prints.
    asked : commands of which it knows the options, all of them if there are none; of the others it
        knows the name, so that a command does not wait for all.
    """
    parser = argparse.ArgumentParser(
        prog="workbench",
        description="Observers, their tuning, and a diagnosis of models, on FMUs.",
    )
    parser.add_argument("--version", action="version", version=release)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    known = {name: (f"workbench.cli.{name}", text) for name, text in COMMANDS.items()}
    known["bench"] = _BENCH
    if not all(name in known for name in selected or [""]):  # else plugins have nothing to add
        for plugin in installed_plugins():
            known |= plugin.commands
    for name, (module, text) in known.items():
        if selected and name not in selected:
            commands.add_parser(name, help=text)
        else:
            import_module(module).add(commands, text).set_defaults(module=module)
    for command in parsers(parser):
        command.formatter_class = argparse.RawDescriptionHelpFormatter  # examples keep their lines
        for option, text in _OUTPUT.items():
            command.add_argument(option, action="store_true", default=argparse.SUPPRESS, help=text)
    return parser


def parsers(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    """A parser, those of its commands, and theirs."""
    nested = [parser]
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for choice in action.choices.values():
                nested += parsers(choice)
    return nested
