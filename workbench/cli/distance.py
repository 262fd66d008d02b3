"""`workbench distance`: how far a stop goes that was not made, from stops that were."""

import argparse

from workbench.cli import arguments
from workbench.cli.output import CommandResult, Output, read_result
from workbench.errors import InputError
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder

_UNITS = {"distance": "m", "deceleration": "m/s2", "response": "s", "asked": "SI"}

WORKERS_NEED = ("workbench.studies.distance", "workbench.models.loops_ready")


def add(commands: arguments.Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "distance",
        help=text,
        description="Predict the distance of an untested stop from past stops. Nuisance "
        "parameters, recording-to-recording variation and model errors are drawn "
        "together. Every past stop is predicted from the others and stands "
        "beside what was measured, also corrected to nominal conditions. The safety level is the "
        "deceleration, over the nominal one, that is reached but for one stop in 10, 100, ..., by "
        "subset simulation. Writes distance.json, stops.csv, quantiles.csv, safety.csv, a "
        "figure and the page (index.html). Ctrl-C keeps the runs of the safety level that are "
        "done.",
        epilog="examples:\n"
        "  workbench distance --system my_machine my_stops\n"
        "  workbench distance --system my_machine my_stops --ask speed='160 km/h'\n"
        "  workbench distance --system my_machine my_stops --safety 0\n"
        "  workbench distance --system my_machine my_stops --plain 100000",
    )
    arguments.add_recordings(parser, out="results/distance")
    arguments.add_system(parser)
    arguments.add_repeated(
        parser,
        "--ask NAME=VALUE",
        "what the stop is asked for, or a condition, by the names of the system file; the "
        "rest is usual; may be repeated",
    )
    level = "safety level down to one stop in 10^K; 0: none"
    arguments.add_number(parser, "--safety K", arguments.count, 9, level)
    drawn = "stops of the distribution"
    arguments.add_number(parser, "--samples N", arguments.positive, 4000, drawn)
    plain = (
        "check the safety level by this many independent random stops. 1e5 take minutes, 1e7 "
        "hours; Ctrl-C keeps the finished ones"
    )
    arguments.add_number(parser, "--plain N", arguments.count, 0, plain)
    arguments.add_model(parser)
    arguments.add_seed(parser, "all that is drawn")
    arguments.add_run(parser)
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Predict one stop, and each past one from the others."""
    from workbench.cli.inputs import given_cases, modelled_system
    from workbench.pages.provenance import models, run_of, software, sources
    from workbench.studies.distance import Effort, distance_of_stop
    from workbench.studies.distance.report import write_distance
    from workbench.system.system import OBSERVER

    system = modelled_system(options)
    asked = dict(map(_read_quantity, options.ask))
    cases = given_cases(options, system)
    effort = Effort(options.samples, options.safety, options.seed, options.plain)
    with locked_folder(options.out):
        engine = Engine(options.workers, output.stage)
        prediction = distance_of_stop(system, cases, asked, effort, engine)
        provenance = {
            "run": run_of("distance", system, sources(cases)),
            **software(["numpy", "scipy"]),
            "system": system.name,
            "models": models(system, [OBSERVER]),
            "seed": options.seed,
        }
        page = write_distance(prediction, provenance, options.out)
    output.stage("done")
    output.result(prediction.summary())
    output.result(f"to read: {page}, data and figure beside it")
    result = read_result(options.out / "distance.json")
    return CommandResult(result, _UNITS, 130 if prediction.interrupted else 0, page)


def _read_quantity(text: str) -> tuple[str, str | float]:
    """Read NAME=VALUE of a stop that is asked for; a plain number where there is no unit."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        raise InputError(
            where=f"command line, --ask {text}",
            found="no '='",
            expected="NAME=VALUE",
            remedy="write for instance --ask speed='160 km/h'",
        )
    try:
        return name, float(value)
    except ValueError:
        return name, value
