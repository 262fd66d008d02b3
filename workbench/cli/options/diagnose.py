"""What `workbench diagnose` may be told."""

import argparse

from workbench.cli.arguments import (
    Commands,
    add_effects,
    add_model,
    add_platforms,
    add_recordings,
    add_run,
    add_system,
)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "diagnose",
        help=text,
        description="Compare recordings with the observer model: show where the simulation is "
        "wrong, name the physical cause, say what cannot be told apart, extend the Modelica "
        "model, and measure the gain on recordings that were held out. Writes a page to read "
        "(index.html), summary.json, data (CSV), figures (PNG, SVG) and the extended model. Needs "
        "the extra [compiler]. Ctrl-C ends the search for more causes and keeps those that were "
        "found. Exit status 0 for any verdict.",
        epilog="examples:\n"
        "  python -m workbench diagnose my_recordings --out results/mine\n"
        "  python -m workbench diagnose --system my_machine --effects Seepage\n"
        "  python -m workbench diagnose my_recordings --held-out 'cold_*'\n"
        "  python -m workbench diagnose new_recordings --fmu results/mine/model/Extended.fmu\n"
        "  python -m workbench diagnose my_recordings --system my_machine/system.toml\n"
        "  python -m workbench diagnose my_recordings --propose\n"
        "  python -m workbench diagnose --list",
    )
    add_recordings(parser, out="results/diagnose")
    add_system(parser)
    parser.add_argument(
        "--held-out",
        nargs="+",
        default=[],
        metavar="CASE",
        help="recordings by name (* is any letters), on which only errors of both models are "
        "measured",
    )
    add_model(parser)
    add_effects(parser, "consider")
    parser.add_argument(
        "--list", action="store_true", help="list the effects of the library, and end"
    )
    add_platforms(parser, "the extended FMU", "native")
    parser.add_argument(
        "--certainty",
        action="store_true",
        help="also ask how sure the sizes are, by further fits: what noise alone allows, which "
        "errors go together, and whether fits that begin elsewhere end the same",
    )
    parser.add_argument(
        "--propose",
        action="store_true",
        help="if something is missing that no effect explains, infer a law for it: where it acts, "
        "on what it depends, its form (into OUT/proposed)",
    )
    add_run(parser)
    return parser
