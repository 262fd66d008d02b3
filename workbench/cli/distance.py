"""`workbench distance`: how far a stop goes that was not made, from stops that were."""

import argparse

from workbench.cli.inputs import given_cases
from workbench.cli.output import CommandResult, Output, read_result
from workbench.errors import InputError
from workbench.pages.provenance import models, run_of, software, sources
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder
from workbench.studies.distance import Effort, distance_of_stop
from workbench.studies.distance.report import write_distance
from workbench.system.reader import with_model
from workbench.system.registry import load_system
from workbench.system.system import OBSERVER

_UNITS = {"distance": "m", "deceleration": "m/s2", "response": "s", "asked": "SI"}


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Predict one stop, and each past one from the others."""
    system = load_system(options.system)
    if options.fmu is not None:
        system = with_model(system, OBSERVER, options.fmu)
    said = dict(_said(one) for one in options.ask)
    cases = given_cases(options, system)
    effort = Effort(options.samples, options.safety, options.seed, options.plain)
    with locked_folder(options.out):
        engine = Engine(options.workers, output.stage)
        found = distance_of_stop(system, cases, said, effort, engine)
        provenance = {
            "run": run_of("distance", system, sources(cases)),
            **software(["numpy", "scipy"]),
            "system": system.name,
            "models": models(system, [OBSERVER]),
            "seed": options.seed,
        }
        page = write_distance(found, provenance, options.out)
    output.stage("done")
    output.result(found.summary())
    output.result(f"to read: {page}, data and figure beside it")
    result = read_result(options.out / "distance.json")
    return CommandResult(result, _UNITS, 130 if found.interrupted else 0, page)


def _said(text: str) -> tuple[str, str | float]:
    """What is asked for, NAME=VALUE; a plain number where there is no unit."""
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
