"""`workbench tune`: gains that minimise the worst case over recordings."""

import argparse
import json
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from workbench.cli.cluster import open_cluster
from workbench.cli.inputs import given_cases, model_names
from workbench.cli.output import CommandResult, Output
from workbench.errors import InputError, WorkerError
from workbench.pages.answer import with_answer
from workbench.pages.provenance import run_of, sources
from workbench.recordings.case import Case
from workbench.runtime.files import locked_folder, write_whole
from workbench.runtime.pool import Pool
from workbench.system.reader import with_model
from workbench.system.registry import load_system
from workbench.tuning import (
    Evaluator,
    Generation,
    Job,
    NoWorkersError,
    Plan,
    Problem,
    Progress,
    TuningResult,
    draw_cases,
    draw_convergence,
    evaluators,
    pose,
    summarise_tuning,
    tunable,
    tune,
    tuned_gains,
)
from workbench.tuning.report import format_tuned, headline, tuning_answer, write_tuning_page

if TYPE_CHECKING:
    from workbench.runtime.cluster import DaskPool


_LIVE_PERIOD = 5.0  # [s] between two drawings of the convergence


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Search the gains."""
    system = load_system(options.system)
    kind = tunable(system, options.estimator)
    cases = given_cases(options, system)
    _check(options, cases)
    system = system.with_names(model_names(options.map, system, cases))
    if options.fmu is not None:
        system = with_model(system, kind.role, options.fmu)
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
    plan = Plan(options.budget, options.population, options.seed, not options.full_evaluation)
    size = problem.space.start.size
    output.stage(
        f"{options.estimator}: {size} gains, {cases} cases, at most {plan.generations} "
        f"generations of {plan.population * size} candidates"
    )
    progress = _Printed(output, plan, options.folds, out, live=options.live)
    try:
        with _one_interruption(), closing(_pool(options, problem.job)) as pool:
            tuned = tune(
                *(pool, problem, plan, out),
                folds=options.folds,
                resume=options.resume,
                progress=progress,
            )
    except NoWorkersError as error:
        raise WorkerError(f"{error}; nothing was evaluated") from None
    if tuned is None:
        output.progress("interrupted before the first generation was evaluated; nothing is written")
        return CommandResult(status=130)
    content = summarise_tuning(tuned, options.folds)
    content["provenance"] |= {"run": run_of("tune", problem.job.system, sources(problem.cases))}
    summary = with_answer(tuning_answer(headline(content), content), content)
    if not (progress.kept and _written(out / "summary.json", json.dumps(summary, indent=2) + "\n")):
        return CommandResult(status=1)
    draw_convergence(tuned.search.history, out / "convergence.png")
    draw_cases(summary["cases"], out / "cases.png")
    output.result(format_tuned(summary))
    page = write_tuning_page(summary, out)
    output.result(f"written: {page}, gains.toml, summary and figures beside it")
    status = 130 if tuned.interrupted else 0
    return CommandResult(summary, {"seconds": "s", "bandwidth": "Hz"}, status, page)


def _check(options: argparse.Namespace, cases: Sequence[Case]) -> None:
    """Refuse numbers that make no sense."""
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


def _pool(options: argparse.Namespace, job: Job) -> "Pool[Evaluator] | DaskPool[Evaluator]":
    if options.cluster is None:
        return evaluators(job, options.workers, options.timeout)
    return open_cluster(options.cluster, Evaluator, job, options.timeout, job.system, _warn)


def _warn(message: str) -> None:
    print(f"warning: {message}", file=sys.stderr, flush=True)


class _Printed(Progress):
    """Prints one line per generation, draws now and then if asked to, and keeps the gains.

    Attributes
    ----------
    kept : whether the gains could be written.
    """

    def __init__(self, output: Output, plan: Plan, folds: int, out: Path, *, live: bool) -> None:
        self._output, self._plan, self._folds = output, plan, folds
        self._out, self._live = out, live
        self._drawn = -np.inf
        self.kept = False

    def begins(self, fold: int) -> None:
        """See Progress."""
        self._begin = time.perf_counter()
        self._done: list[Generation] = []
        if fold:
            self._output.progress(f"fold {fold} of {self._folds}")

    def evolved(self, history: Sequence[Generation]) -> None:
        """See Progress."""
        last, now = history[-1], time.perf_counter()
        self._done.append(last)
        most = self._plan.generations
        left = (now - self._begin) / len(self._done) * (most + 1 - len(history))
        saved = 1.0 - sum(g.samples for g in self._done) / sum(g.of for g in self._done)
        self._output.progress(
            f"[{len(history) - 1:>3}/{most}] z {last.z:.5f}, worst {last.worst} by "
            f"{last.margin:.1%} over {last.second}; {last.candidates / last.seconds:.0f} "
            f"evaluations/s, {saved:.0%} of work saved, {sum(last.unstable.values())} unstable, at "
            f"most {left:.0f} s left"
        )
        if self._live and now - self._drawn > _LIVE_PERIOD:
            draw_convergence(history, self._out / "convergence.png")
            self._drawn = now

    def found(self, tuned: TuningResult) -> None:
        """Write the gains, first of all, so that nothing after them can lose them."""
        self.kept = _written(self._out / "gains.toml", tuned_gains(tuned))

    def warn(self, message: str) -> None:
        """See Progress."""
        _warn(message)


def _written(path: Path, text: str) -> bool:
    """Write a result; if that fails show it instead, so that it is not lost."""
    try:
        write_whole(path, text)
    except InputError as error:
        print(f"{text}\nerror: {error} The content is above.", file=sys.stderr)
        return False
    return True
