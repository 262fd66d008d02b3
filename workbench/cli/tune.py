"""`workbench tune`: gains that minimise the worst case over recordings."""

from __future__ import annotations

import argparse
import json
import signal
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli import arguments
from workbench.cli.output import CommandResult, Output, warn
from workbench.errors import InputError, WorkerError
from workbench.runtime.files import locked_folder
from workbench.runtime.pool import Pool

if TYPE_CHECKING:
    from workbench.recordings.case import Case
    from workbench.runtime.cluster import DaskPool
    from workbench.tuning import Evaluator, Problem

WORKERS_NEED = ("workbench.tuning", "workbench.models.loops_ready")


def add(commands: arguments.Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "tune",
        help=text,
        description="Find gains that minimise z, the worst of the objectives z_k of all cases "
        "(Schwarz et al. 2018, equations 11 and 12), by differential evolution. Writes gains.toml, "
        "summary.json, figures and a page. Ctrl-C keeps the best so far; --resume goes on from "
        "there, to the same result.",
        epilog="examples:\n"
        "  workbench tune disturbance_observer\n"
        "  workbench tune parameter_estimator --budget 20 --out /tmp/quick\n"
        "  workbench tune disturbance_observer --folds 5\n"
        "  workbench tune disturbance_observer --judge-by smoother\n"
        "  workbench tune disturbance_observer --cluster tcp://10.0.0.1:8786",
    )
    parser.add_argument(
        "estimator", metavar="ESTIMATOR", help="one with gains, such as disturbance_observer or ekf"
    )
    arguments.add_system(parser)
    parser.add_argument(
        "--cases",
        nargs="+",
        type=Path,
        default=[],
        metavar="CASE",
        help="case folders, or folders of case folders (default: those of the system)",
    )
    arguments.add_recording_options(parser)
    parser.add_argument(
        "--fmu",
        type=Path,
        metavar="FILE",
        help="observer model (default: that of the estimator)",
    )
    arguments.add_map(parser)
    _add_search(parser)
    _add_work(parser)
    arguments.add_pdf(parser)
    arguments.add_isolated(parser)
    return parser


def _add_search(parser: argparse.ArgumentParser) -> None:
    budget = "most generations to search"
    arguments.add_number(parser, "--budget GENERATIONS", arguments.positive, 100, budget)
    arguments.add_number(parser, "--population N", arguments.positive, 15, "candidates per gain")
    arguments.add_seed(parser, "the search")
    parser.add_argument(
        "--scale-error",
        "--radius-error",
        type=float,
        metavar="PERCENT",
        help="score each case again with an output's scale off by this much, to both sides in "
        "turn; 0: as recorded (default: of the system)",
    )
    parser.add_argument(
        "--folds",
        type=int,
        default=0,
        metavar="K",
        help="also tune K times without a K-th of the cases, and score on these",
    )
    parser.add_argument(
        "--judge-by",
        metavar="ESTIMATOR",
        help="score by an estimator of whole recordings, such as smoother, what no sensor measures "
        "(default: by what is measured)",
    )
    every = "do not drop candidates that have lost; the result is the same"
    arguments.add_flags(parser, {"--full-evaluation": every})


def _add_work(parser: argparse.ArgumentParser) -> None:
    arguments.add_workers(parser)
    parser.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster to work on instead; needs the extra [cluster]",
    )
    limit = "a candidate that takes longer ends its worker"
    arguments.add_number(parser, "--timeout SECONDS", arguments.positive, 60, limit)
    flags = {
        "--resume": "go on from the last checkpoint",
        "--live": "draw convergence.png anew every 5 s while searching",
    }
    arguments.add_flags(parser, flags)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="where to write (default: results/tune/ESTIMATOR)",
    )


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Search the gains."""
    from workbench.cli.inputs import given_cases, model_names
    from workbench.system.reader import with_model
    from workbench.system.registry import load_system
    from workbench.tuning import pose, tunable

    system = load_system(options.system)
    estimator = tunable(system, options.estimator)
    cases = given_cases(options, system)
    _check(options, cases)
    system = system.with_names(model_names(options.map, system, cases))
    if options.fmu is not None:
        system = with_model(system, estimator.role, options.fmu)
    out = options.out or Path("results/tune") / options.estimator
    errors = None
    if options.scale_error is not None:
        share = options.scale_error / 100.0
        errors = {output.name: share for output in system.outputs if output.scale_error and share}
    problem = pose(system, options.estimator, cases, errors, options.judge_by)
    with locked_folder(out):
        return _run(options, output, problem, len(cases), out)


def _run(
    options: argparse.Namespace, output: Output, problem: Problem, cases: int, out: Path
) -> CommandResult:
    from workbench.cli.cluster import open_cluster
    from workbench.cli.tune_progress import PrintedProgress, write_or_print
    from workbench.pages.answer import with_answer
    from workbench.pages.provenance import run_of, sources
    from workbench.tuning import (
        Evaluator,
        NoWorkersError,
        Plan,
        evaluators,
        summarise_tuning,
        tune,
    )
    from workbench.tuning.report import (
        draw_cases,
        draw_convergence,
        format_tuned,
        headline,
        tuning_answer,
        write_tuning_page,
    )

    plan = Plan(
        generations=options.budget,
        population=options.population,
        seed=options.seed,
        economy=not options.full_evaluation,
        folds=options.folds,
    )
    size = problem.space.start.size
    output.stage(
        f"{options.estimator}: {size} gains, {cases} cases, at most {plan.generations} "
        f"generations of {plan.population * size} candidates"
    )
    progress = PrintedProgress(output, plan, out, live=options.live)
    job = problem.job
    pool: Pool[Evaluator] | DaskPool[Evaluator]
    if options.cluster is None:
        pool = evaluators(job, options.workers, options.timeout)
    else:
        pool = open_cluster(options.cluster, Evaluator, job, options.timeout, job.system, warn)
    try:
        with _one_interruption(), closing(pool):
            tuned = tune(pool, problem, plan, out, resume=options.resume, progress=progress)
    except NoWorkersError as error:
        raise WorkerError(f"{error}; nothing was evaluated") from None
    if tuned is None:
        output.progress("interrupted before the first generation was evaluated; nothing is written")
        return CommandResult(status=130)
    content = summarise_tuning(tuned)
    content["provenance"] |= {"run": run_of("tune", job.system, sources(problem.cases))}
    summary = with_answer(tuning_answer(headline(content), content), content)
    text = json.dumps(summary, indent=2) + "\n"
    if not (progress.kept and write_or_print(out / "summary.json", text)):
        return CommandResult(status=1)
    draw_convergence(tuned.search.history, out / "convergence.png")
    draw_cases(summary["cases"], out / "cases.png")
    output.result(format_tuned(summary))
    page = write_tuning_page(summary, out)
    output.result(f"written: {page}, gains.toml, summary and figures beside it")
    status = 130 if tuned.interrupted else 0
    return CommandResult(summary, {"seconds": "s", "bandwidth": "Hz"}, status, page)


def _check(options: argparse.Namespace, cases: Sequence[Case]) -> None:
    if options.folds and not 2 <= options.folds <= len(cases):
        raise InputError(
            where="command line, --folds",
            found=f"{options.folds} with {len(cases)} cases",
            expected="2 or more, and no more than there are cases",
            remedy="choose another number, or more cases with --cases",
        )
    if options.scale_error is not None and not 0.0 <= options.scale_error < 10.0:
        raise InputError(
            where="command line, --scale-error",
            found=f"{options.scale_error:g}",
            expected="a share of the scale in percent, from 0 to 10",
            remedy="choose another, or leave it out for what the system says",
        )


@contextmanager
def _one_interruption() -> Iterator[None]:
    """Let the first Ctrl-C stop the search, and none after it the writing of its result.

    What was started in the background to ignore Ctrl-C goes on ignoring it.
    """

    def interrupt(number: int, frame: object) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        raise KeyboardInterrupt

    before = signal.getsignal(signal.SIGINT)
    if before is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
