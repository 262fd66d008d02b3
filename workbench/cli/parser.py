"""What each command may be told, one module each; none of them imports what a command works with.

A command's module of the same name, one package up, runs it: `run(options, output)`.
"""

import argparse
from importlib import import_module

import workbench.cli
from workbench.system.installed import companion_part, companions


def command_line(release: str, *asked: str) -> argparse.ArgumentParser:
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
    parts = [companion_part(name, "commands") for name in companions()]
    for package in (workbench.cli, *(part for part in parts if part)):
        for name, text in package.COMMANDS.items():
            if asked and name not in asked:
                commands.add_parser(name, help=text)
                continue
            own = import_module(f"{package.__name__}.options.{name}").add(commands, text)
            own.set_defaults(work=f"{package.__name__}.{name}")
    for one in parsers(parser):
        one.formatter_class = argparse.RawDescriptionHelpFormatter  # examples keep their lines
        _add_output(one)
    return parser


def parsers(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    """A parser, those of its commands, and theirs."""
    found = [parser]
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for choice in action.choices.values():
                found += parsers(choice)
    return found


def _add_output(parser: argparse.ArgumentParser) -> None:
    """Add what every command may be told, before its name or after it."""
    for option, text in (
        ("--json", "print the result as one JSON document, with units, and nothing else"),
        ("--quiet", "say nothing of progress, which goes to standard error"),
    ):
        parser.add_argument(option, action="store_true", default=argparse.SUPPRESS, help=text)
