"""`workbench diagnose`: what a simulation gets wrong, the cause, and a better model."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from workbench.cli import arguments
from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output, read_result
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder
from workbench.runtime.resources import own_version

if TYPE_CHECKING:
    from workbench.diagnosis import Outcome, Problem

WORKERS_NEED = (
    *("workbench.diagnosis", "workbench.diagnosis.laws"),
    *("workbench.models.loops_ready", "scipy.signal"),
)


def add(commands: arguments.Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "diagnose",
        help=text,
        description="Compare recordings with the observer model and name the missing effects. "
        "Show where the simulation is wrong, list indistinguishable effects, extend "
        "the model, and measure the gain in cross-validation. Writes a page to read "
        "(index.html), summary.json, data (CSV) and the extended model. Needs the extra "
        "[compiler]. Ctrl-C ends the search for more causes and keeps those that were found. "
        "Exit status 0 for any verdict.",
        epilog="examples:\n"
        "  workbench diagnose my_recordings --out results/mine\n"
        "  workbench diagnose --system my_machine --effects Seepage\n"
        "  workbench diagnose my_recordings --held-out 'cold_*'\n"
        "  workbench diagnose new_recordings --fmu results/mine/model/Extended.fmu\n"
        "  workbench diagnose my_recordings --system my_machine/system.toml\n"
        "  workbench diagnose my_recordings --propose\n"
        "  workbench diagnose --list",
    )
    arguments.add_recordings(parser, out="results/diagnose")
    arguments.add_system(parser)
    parser.add_argument(
        "--held-out",
        nargs="+",
        default=[],
        metavar="CASE",
        help="recordings by name (* is any letters), on which only errors of both models are "
        "measured",
    )
    arguments.add_model(parser)
    arguments.add_effects(parser, "consider")
    arguments.add_flags(parser, {"--list": "list the effects of the library, and end"})
    arguments.add_platforms(parser, "the extended FMU", "native")
    flags = {
        "--certainty": "also fit profile intervals of the sizes, correlations of their errors, and "
        "a multi-start",
        "--figures": "write figures of the page as NAME.png and NAME.svg",
        "--propose": "if something is missing that no effect explains, infer a law for it: where "
        "it acts, on what it depends, its form (into OUT/proposed)",
    }
    arguments.add_flags(parser, flags)
    arguments.add_run(parser)
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Diagnose the recordings, or list the effects."""
    from workbench.cli.inputs import given_cases, modelled_system, split_held_out
    from workbench.diagnosis import Problem, catalogue, choose, library_of
    from workbench.diagnosis.effects.candidates import COEFFICIENT
    from workbench.models.modelica import read_library

    system = modelled_system(options)
    if options.library is not None:
        system = replace(system, library=options.library)
    library = library_of(system) if options.library is None else read_library(options.library)
    effects = choose(options.effects, catalogue(system, library))
    if options.list:
        output.result("\n".join(f"{effect.name:<29} {effect.text}" for effect in effects))
        return CommandResult(
            {"effects": [{"name": effect.name, "text": effect.text} for effect in effects]}
        )
    if library is not None or any(effect.size == COEFFICIENT for effect in effects):
        require_compiler()
    cases, held_out = split_held_out(given_cases(options, system), options.held_out)
    with locked_folder(options.out):
        return _run(options, output, Problem(system, cases, library, effects, held_out).in_parts())


def _propose(
    options: argparse.Namespace,
    output: Output,
    outcome: Outcome,
    problem: Problem,
    provenance: Mapping[str, Any],
) -> None:
    from workbench.diagnosis.laws import needs_law, propose
    from workbench.diagnosis.laws.report import PROPOSED, write_proposal

    if not needs_law(outcome):
        output.result("\nNo law is proposed: nothing is missing, or one effect explains it.")
        return
    engine = Engine(options.workers, output.stage, options.out / PROPOSED)
    proposal = propose(outcome, problem, engine)
    page = write_proposal(proposal, outcome, provenance, options.out)
    output.result(f"\n{proposal.summary()}")
    output.result(f"to read: {page}, data beside it")


def _run(options: argparse.Namespace, output: Output, problem: Problem) -> CommandResult:
    from workbench.diagnosis import diagnose
    from workbench.diagnosis.laws import compared_with_one_law
    from workbench.diagnosis.report import write_diagnosis
    from workbench.pages.provenance import run_of, sources
    from workbench.system.registry import open_model

    system, cases, held_out = problem.system, problem.cases, problem.held_out
    output.stage(f"{len(cases)} recordings" + f", {len(held_out)} held out" * bool(held_out))
    engine = Engine(options.workers, output.stage, options.out)
    outcome = diagnose(
        problem,
        engine,
        every_platform=options.platforms == "all",
        certainty=options.certainty,
    )
    outcome = compared_with_one_law(outcome, problem, engine)
    with open_model(system) as model:
        provenance = {
            "run": run_of("diagnose", system, sources([*cases, *held_out])),
            "workbench": own_version(),
            "system": system.name,
            "model": {"file": model.path.name, "model": model.name, "sha256": model.sha256},
            "effects": [effect.name for effect in problem.effects],
        }
    output.result(outcome.summary())
    page = write_diagnosis(outcome, provenance, options.out, pictures=options.figures)
    if options.propose:
        _propose(options, output, outcome, problem, provenance)
    output.stage("done")
    output.result(f"to read: {page}, data beside it")
    status = 130 if outcome.diagnosis.interrupted else 0
    return CommandResult(read_result(options.out / "summary.json"), {}, status, page)
