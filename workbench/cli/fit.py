"""`workbench fit`: parameters of an FMU and starts of its states, from recordings."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from workbench.cli.arguments import (
    Commands,
    add_model,
    add_number,
    add_recordings,
    add_repeated,
    add_run,
    add_seed,
    add_system,
    count,
    positive,
)
from workbench.cli.output import CommandResult, Output, read_result, warn
from workbench.errors import InputError
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder

if TYPE_CHECKING:
    from workbench.system.parts import FittedParameter
    from workbench.system.system import System

WORKERS_NEED = ("workbench.studies.fit", "workbench.models.loops_ready")


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "fit",
        help=text,
        description="Fit parameters of an FMU, and starts of its states, to recordings. Report "
        "values with intervals, what is not identifiable, tests of residuals, and "
        "errors on held-out recordings. Writes a page (index.html), summary.json, "
        "parameters.ssv, parameters.toml and "
        "an FMU with the fitted values. Status 1 where the values may not be relied on.",
        epilog="examples:\n"
        "  workbench fit --system my_plant\n"
        "  workbench fit --system my_plant --parameter 'motor.*' --parameter J\n"
        "  workbench fit day1 day2 --system my_plant --parameter R "
        "--range 'R=0.1 Ohm to 5 Ohm'\n"
        "  workbench fit day1 day2 --system my_plant --held-out day2 --loss soft_l1",
    )
    add_recordings(parser, out="results/fit")
    add_system(parser)
    add_model(parser)
    repeated = {
        "--parameter NAME": "parameter to fit, or state whose start is, or a pattern such as "
        "'motor.*'; may be repeated (default: [fit] of the system file)",
        "--range NAME=LOW to HIGH": "bounds of a parameter, such as 'R=0.1 Ohm to 5 Ohm'; may "
        "be repeated (default: [fit], else min and max of the model)",
        "--prior NAME=VALUE +- SPREAD": "what is known of a parameter, such as 'R=2 Ohm +- "
        "0.1 Ohm'; may be repeated",
        "--by-recording NAME": "a parameter of which each recording has a value of its own; "
        "may be repeated",
    }
    for usage, text in repeated.items():
        add_repeated(parser, usage, text)
    parser.add_argument(
        "--held-out",
        nargs="+",
        default=[],
        metavar="CASE",
        help="recordings by name (* is any letters), on which only errors are measured",
    )
    parser.add_argument(
        "--loss",
        choices=("linear", "soft_l1"),
        default="linear",
        help="sum of squares, or soft_l1, which outliers move little (default: %(default)s)",
    )
    starts = "local fits, the first from the model's own values"
    add_number(parser, "--starts N", positive, 3, starts)
    evolved = "of differential evolution, where starts disagree (default: %(default)s; 0: none)"
    add_number(parser, "--generations N", count, 20, evolved)
    parser.add_argument(
        "--intervals",
        choices=("auto", "profile", "covariance"),
        default="auto",
        help="by profile likelihood, or by covariance (default: profiles where they take a minute)",
    )
    add_seed(parser, "all that is drawn")
    add_run(parser)
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Fit the parameters, and write what was found."""
    from workbench.cli.inputs import given_cases, modelled_system, split_held_out
    from workbench.pages.provenance import models, run_of, software, sources
    from workbench.studies.fit import FitSettings, fit
    from workbench.studies.fit.report import format_fit, write_fit
    from workbench.system.system import OBSERVER

    system = modelled_system(options)
    parameters = _parameters(options, system)
    cases, held_out = split_held_out(given_cases(options, system), options.held_out)
    if not cases:
        raise InputError(
            where="command line, --held-out",
            found="all recordings",
            expected="one to fit to, at least",
            remedy="hold out fewer, or name further recordings",
        )
    profiles = {"auto": None, "profile": True, "covariance": False}[options.intervals]
    settings = FitSettings(
        starts=options.starts,
        loss=options.loss,
        generations=options.generations,
        seed=options.seed,
        profiles=profiles,
    )
    with locked_folder(options.out):
        engine = Engine(options.workers, output.stage, options.out)
        outcome = fit(system, cases, parameters, engine, held_out=held_out, settings=settings)
        provenance = {
            "run": run_of("fit", system, sources([*cases, *held_out])),
            **software(["fmpy", "numpy", "scipy"]),
            "system": system.name,
            "fmu": models(system, [OBSERVER])[OBSERVER],
            "seed": options.seed,
        }
        page, notes = write_fit(outcome, system, provenance, options.out)
    output.stage("done")
    output.result(format_fit(outcome))
    for note in notes:
        warn(note)
    output.result(f"to read: {page}; parameters.ssv, parameters.toml and the FMU beside it")
    if outcome.is_contradicted and not outcome.interrupted:
        output.result(
            f"next: workbench diagnose --system {options.system}, on the same recordings: it seeks "
            "what the model lacks"
        )
    units = {"seconds": "s", **{value.label: value.unit for value in outcome.values}}
    status = 130 if outcome.interrupted else 0 if outcome.reliable else 1
    return CommandResult(read_result(options.out / "summary.json"), units, status, page)


def _parameters(options: argparse.Namespace, system: System) -> list[FittedParameter]:
    from workbench.models.description import read_description
    from workbench.studies.fit import resolve_parameters
    from workbench.system.registry import model_path
    from workbench.system.system import OBSERVER

    description = read_description(model_path(system, OBSERVER)).renamed(system.names)
    units = {v.name: v.unit or "1" for v in description.variables}
    ranges = dict(_pair(entry, "--range", " to ", units) for entry in options.range)
    priors = dict(_pair(entry, "--prior", "+-", units) for entry in options.prior)
    named = options.parameter or [entry.name for entry in system.fitted]
    further = [n for n in (*ranges, *priors, *options.by_recording) if n not in named]
    return [
        replace(
            entry,
            range=ranges.get(entry.name, entry.range),
            prior=priors.get(entry.name, entry.prior),
            by_recording=True if entry.name in options.by_recording else entry.by_recording,
        )
        for entry in resolve_parameters(system, description, [*named, *further])
    ]


def _pair(
    entry: str, option: str, between: str, units: dict[str, str]
) -> tuple[str, tuple[float, float]]:
    """Name and two quantities of an entry such as 'R=0.1 Ohm to 5 Ohm'."""
    from workbench.system.units import quantity

    name, equals, text = (part.strip() for part in entry.partition("="))
    first, middle, second = text.partition(between)
    where = f"command line, {option} '{entry}'"
    if not (equals and middle and name in units):
        raise InputError(
            where=where,
            found="no variable of the model" if equals and middle else "no two quantities",
            expected=f"NAME=QUANTITY {between.strip()} QUANTITY",
            remedy="write for instance 'R=0.1 Ohm to 5 Ohm', or 'R=2 Ohm +- 0.1 Ohm'",
        )
    unit = units[name]
    try:
        low, high = (
            float(part) if unit == "1" else quantity(part.strip(), unit, where)
            for part in (first, second)
        )
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            where=where,
            found=repr(text),
            expected="two numbers",
            remedy="write for instance 'gain=0.5 to 2'",
        ) from None
    return name, (low, high)
