"""`workbench tune`: gains that minimise the worst case over recordings."""

import argparse
import json
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from workbench.case import Case
from workbench.commands.arguments import (
    Commands,
    add_isolated,
    add_map,
    add_system,
    add_workers,
    given_cases,
    installing,
    model_names,
    positive,
)
from workbench.errors import InputError
from workbench.files import claimed, write_whole
from workbench.pool import Pool
from workbench.report.tuning import format_tuned, write_tuning_page
from workbench.system_file import with_model
from workbench.systems import load_system
from workbench.tuning import (
    LIMIT,
    Evaluator,
    Generation,
    Job,
    NoWorkersError,
    Plan,
    Problem,
    Progress,
    Tuned,
    draw_cases,
    draw_convergence,
    evaluators,
    pose,
    summarise_tuning,
    tunable,
    tune,
    tuned_gains,
)

if TYPE_CHECKING:
    from workbench.tuning.cluster import DaskPool

_LIVE_PERIOD = 5.0  # [s] between two drawings of the convergence


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "tune",
        description="Find gains that minimise z, the worst of the objectives z_k of all cases "
        "(Schwarz et al. 2018, equations 11 and 12), by differential evolution. Writes gains.toml, "
        "summary.json, figures and a page. Ctrl-C keeps the best so far; --resume goes on from "
        "there, to the same result.",
        epilog="examples:\n"
        "  python -m workbench tune disturbance_observer\n"
        "  python -m workbench tune parameter_estimator --budget 20 --out /tmp/quick\n"
        "  python -m workbench tune disturbance_observer --folds 5\n"
        "  python -m workbench tune disturbance_observer --cluster tcp://10.0.0.1:8786",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "estimator", metavar="ESTIMATOR", help="one with gains, such as disturbance_observer or ekf"
    )
    add_system(parser)
    parser.add_argument(
        "--cases",
        nargs="+",
        type=Path,
        default=[],
        metavar="CASE",
        help="case folders, or folders of case folders (default: those of the system)",
    )
    parser.add_argument(
        "--fmu",
        type=Path,
        metavar="FILE",
        help="observer model (default: that of the estimator)",
    )
    add_map(parser)
    _add_search(parser)
    _add_work(parser)
    add_isolated(parser)
    parser.set_defaults(run=_tune)


def _add_search(parser: argparse.ArgumentParser) -> None:
    """Add what decides about the gains."""
    parser.add_argument(
        "--budget",
        type=positive,
        default=100,
        metavar="GENERATIONS",
        help="most generations to search (default: %(default)s)",
    )
    parser.add_argument(
        "--population",
        type=positive,
        default=15,
        metavar="N",
        help="candidates per gain (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=positive, default=1, help="of the search (default: %(default)s)"
    )
    parser.add_argument(
        "--scale-error",
        "--radius-error",
        type=float,
        metavar="PERCENT",
        help="judge each case again with an output's scale off by this much, alternately to both "
        "sides, so that gains do not rely on what nobody knows as well; 0: only as recorded "
        "(default: as the system says)",
    )
    parser.add_argument(
        "--folds",
        type=int,
        default=0,
        metavar="K",
        help="also tune K times without a K-th of the cases, and judge on these",
    )
    parser.add_argument(
        "--full-evaluation",
        action="store_true",
        help="do not drop candidates that have lost; the result is the same",
    )


def _add_work(parser: argparse.ArgumentParser) -> None:
    """Add who does the work, and what is shown and kept of it."""
    add_workers(parser)
    parser.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster to work on instead; needs the extra [cluster]",
    )
    parser.add_argument(
        "--timeout",
        type=positive,
        default=int(LIMIT),
        metavar="SECONDS",
        help="a candidate that takes longer ends its worker (default: %(default)s)",
    )
    parser.add_argument("--resume", action="store_true", help="go on from the last checkpoint")
    parser.add_argument(
        "--live", action="store_true", help="draw convergence.png anew every 5 s while searching"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="where to write (default: results/tune/ESTIMATOR)",
    )


def _tune(options: argparse.Namespace) -> int:
    system = load_system(options.system)
    kind = tunable(system, options.estimator)
    cases = given_cases(options.cases, system)
    _check(options, cases)
    system = system.with_names(model_names(options.map, system, cases))
    if options.fmu is not None:
        system = with_model(system, kind.role, options.fmu)
    out = options.out or Path("results/tune") / options.estimator
    errors = None
    if options.scale_error is not None:
        share = options.scale_error / 100.0
        errors = {one.name: share for one in system.outputs if one.scale_error and share}
    problem = pose(system, options.estimator, cases, errors)
    with claimed(out):
        return _run(options, problem, len(cases), out)


def _run(options: argparse.Namespace, problem: Problem, cases: int, out: Path) -> int:
    plan = Plan(options.budget, options.population, options.seed, not options.full_evaluation)
    size = problem.space.start.size
    print(
        f"{options.estimator}: {size} gains, {cases} cases, at most {plan.generations} "
        f"generations of {plan.population * size} candidates",
        flush=True,
    )
    progress = _Printed(plan, options.folds, out, live=options.live)
    try:
        with _one_interruption(), closing(_pool(options, problem.job)) as pool:
            tuned = tune(
                *(pool, problem, plan, out),
                folds=options.folds,
                resume=options.resume,
                progress=progress,
            )
    except NoWorkersError as error:
        print(f"error: {error}; nothing was evaluated", file=sys.stderr)
        return 1
    if tuned is None:
        print("interrupted before the first generation was evaluated; nothing is written")
        return 130
    summary = summarise_tuning(tuned, options.folds)
    if not (progress.kept and _written(out / "summary.json", json.dumps(summary, indent=2) + "\n")):
        return 1
    draw_convergence(tuned.search.history, out / "convergence.png")
    draw_cases(summary["cases"], out / "cases.png")
    print(format_tuned(summary))
    page = write_tuning_page(summary, out)
    print(f"written: {page}, gains.toml, summary and figures beside it")
    return 130 if tuned.interrupted else 0


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
    if find_spec("distributed") is None:
        raise InputError(
            where="command line, --cluster",
            found="no package 'distributed'",
            expected="the extra [cluster], which works with a Dask cluster",
            remedy=installing("cluster"),
        )
    from workbench.tuning.cluster import DaskPool

    try:
        companion = [job.system.companion] if job.system.companion else []
        return DaskPool(
            *(options.cluster, Evaluator, job, options.timeout), modules=companion, warn=_warn
        )
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(
            where=f"command line, --cluster {options.cluster}",
            found=f"no scheduler ({error})",
            expected="the address of a running one, such as tcp://10.0.0.1:8786",
            remedy="start one with 'dask scheduler', and workers with 'dask worker ADDRESS'",
        ) from None


def _warn(message: str) -> None:
    print(f"warning: {message}", file=sys.stderr, flush=True)


class _Printed(Progress):
    """Prints one line per generation, draws now and then if asked to, and keeps the gains.

    Attributes
    ----------
    kept : whether the gains could be written.
    """

    def __init__(self, plan: Plan, folds: int, out: Path, *, live: bool) -> None:
        self._plan, self._folds, self._out, self._live = plan, folds, out, live
        self._drawn = -np.inf
        self.kept = False

    def begins(self, fold: int) -> None:
        """See Progress."""
        self._begin = time.perf_counter()
        self._done: list[Generation] = []
        if fold:
            print(f"fold {fold} of {self._folds}", flush=True)

    def evolved(self, history: Sequence[Generation]) -> None:
        """See Progress."""
        last, now = history[-1], time.perf_counter()
        self._done.append(last)
        most = self._plan.generations
        left = (now - self._begin) / len(self._done) * (most + 1 - len(history))
        saved = 1.0 - sum(g.samples for g in self._done) / sum(g.of for g in self._done)
        print(
            f"[{len(history) - 1:>3}/{most}] z {last.z:.5f}, worst {last.worst} by "
            f"{last.margin:.1%} over {last.second}; {last.candidates / last.seconds:.0f} "
            f"evaluations/s, {saved:.0%} of work saved, {sum(last.unstable.values())} unstable, at "
            f"most {left:.0f} s left",
            flush=True,
        )
        if self._live and now - self._drawn > _LIVE_PERIOD:
            draw_convergence(history, self._out / "convergence.png")
            self._drawn = now

    def found(self, tuned: Tuned) -> None:
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
        print(text)
        print(f"error: {error} The content is above.", file=sys.stderr)
        return False
    return True
