"""`workbench simulate`: all estimators on recordings."""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli import arguments
from workbench.cli.output import CommandResult, Output, warn
from workbench.errors import InputError
from workbench.runtime.files import locked_folder, write_json
from workbench.runtime.pool import preload
from workbench.runtime.supervision import STARTUP, memory_limit

if TYPE_CHECKING:
    from workbench.observers.live import LiveWindow
    from workbench.observers.simulation import CaseResult, Simulation
    from workbench.recordings.case import Case
    from workbench.system.system import System

# That a run holds at its peak for each number of the recording: measured, EKF of the wheelset.
_NUMBERS = 22
# Numbers of all estimates that are written as CSV unasked: 20 MB, of ten characters each. What is
# larger opens slowly in the programs that people read CSV with.
_SMALL = 2_000_000


def add(commands: arguments.Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    own = arguments.example_case()
    parser = commands.add_parser(
        "simulate",
        help=text,
        description="Run all estimators on recordings. Write a page to read (index.html), and "
        "beside it scores (summary.json) and data (NAME.npz). Small data are written as NAME.csv, "
        "too; of large data, the command 'workbench results FOLDER --csv' does that.",
        epilog="examples:\n"
        "  workbench simulate\n"
        f"  workbench simulate {own} --out /tmp/one\n"
        "  workbench simulate my_cases --system my/system.toml\n"
        "  workbench simulate my_cases --fmu my_model.fmu --out results/mine\n"
        f"  workbench simulate {own} --live\n"
        "  workbench simulate --estimator disturbance_observer --estimator ekf",
    )
    arguments.add_recordings(parser, out="results/simulate")
    arguments.add_system(parser)
    arguments.add_models(parser)
    parser.add_argument(
        "--gains",
        type=Path,
        metavar="FILE",
        help="gains.toml of 'workbench tune', for the estimator that it names (default: gains "
        "tuned for the system's models, else model-based gains)",
    )
    untuned = (
        "use model-based gains, from the linearised models, for comparison with tuned ones with"
    )
    arguments.add_flags(parser, {"--untuned": untuned})
    arguments.add_repeated(
        parser,
        "--estimator NAME",
        "run this one, may be repeated (default: the standard ones of the system)",
    )
    arguments.add_workers(parser)
    flags = {
        "--live": "show each run in a window as it goes, one after the other",
        "--csv": "write data as NAME.csv, too, however large (otherwise up to about 20 MB in all)",
        "--figures": "write figures of the page as NAME.png and NAME.svg",
    }
    arguments.add_flags(parser, flags)
    arguments.add_pdf(parser)
    arguments.add_isolated(parser)
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Run all estimators on the recordings."""
    from workbench.cli.inputs import chosen_system

    system, cases = chosen_system(options)
    if min(options.workers, len(cases)) > 1:  # one recording is for this process
        preload("workbench.observers.simulation", "workbench.observers.report")
    _require_memory(cases)
    window = None
    if options.live:
        from workbench.observers.live import LiveWindow  # draws, which takes long to load

        window = LiveWindow(system)
    with locked_folder(options.out):
        return _run(options, output, system, cases, window)


def _require_memory(cases: Sequence[Case]) -> None:
    """Refuse recordings whose runs do not fit into the memory of a process, before the work."""
    limit = memory_limit()
    if limit is None:
        return
    for case in cases:
        needed = _NUMBERS * 8 * case.time.size * (1 + len(case.signals))
        if needed + STARTUP > limit:
            raise InputError(
                where=str(case.source),
                found=f"{case.time.size} samples, whose run takes about {needed >> 20} MB",
                expected=f"what fits into {limit >> 20} MB of memory beside the program's "
                f"{STARTUP >> 20} MB",
                remedy="cut the recording into parts",
            )


def _warn_of_findings(system: System) -> None:
    """Say what 'fmu check' found of the models that run, where it was made."""
    from workbench.models.checks import remembered_findings

    for model in system.models.values():
        if model.path is None:
            continue
        digest = hashlib.sha256(model.path.read_bytes()).hexdigest()
        for name, reason in remembered_findings(digest).items():
            warn(f"{model.path.name}: 'fmu check' found {name} failed: {reason}")


def _run(
    options: argparse.Namespace,
    output: Output,
    system: System,
    cases: Sequence[Case],
    window: LiveWindow | None,
) -> CommandResult:
    from workbench.observers import choose
    from workbench.observers.report import format_table, summarise_runs, write_page
    from workbench.observers.run import Ending
    from workbench.observers.simulation import case_figure, prepare, simulate
    from workbench.pages.provenance import run_of, sources

    _warn_of_findings(system)
    chosen = choose(system, options.estimator)
    # Who asks for all wants those that can be had.
    leave_out = None if options.estimator else lambda name, error: warn(f"without {name}: {error}")
    simulation = prepare(
        system, chosen, options.gains, tuned=not options.untuned, leave_out=leave_out
    )
    output.stage("preparing the observers' loops (compiled once, up to a minute)")
    run = run_of("simulate", system, sources(cases))
    settings = _settings(simulation)
    provenance = {"run": run, **_models(simulation), **settings}
    provenance["meanings"] = {
        name: {gain: {"text": text, "unit": unit} for gain, (text, unit) in meaning.items()}
        for name, meaning in simulation.meanings().items()
        if name in settings
    }
    # Each estimate has a band.
    width = len(cases[0].signals) + 2 * len(simulation.kinds) * len(system.columns)
    small = width * sum(case.time.size for case in cases) <= _SMALL
    with_csv = options.csv or small
    suffixes = ("npz", *["csv"] * with_csv, *["png", "svg"] * options.figures)
    write = partial(_write, options.out, suffixes)
    if window is None:
        runs = simulate(simulation, cases, options.workers, write)
    else:
        runs = _run_live(simulation, cases, window, write)
    results: list[CaseResult] = []
    begin = time.perf_counter()
    interrupted = False
    failure: InputError | None = None
    try:
        for result in runs:
            results.append(result)
            output.step(len(results), len(cases), result.case.name, begin)
    except KeyboardInterrupt:
        interrupted = True
        output.progress("interrupted")
    except InputError as error:  # such as a full disk: results until then are shown all the same
        failure = error
    summary: dict[str, Any] = {}
    page: Path | None = None
    if results:
        results.sort(key=lambda result: result.case.name)
        output.result(format_table(system, results))
        summary = summarise_runs(system, results, provenance)
        write_json(options.out / "summary.json", summary)
        page = options.out / "index.html"
        figures = [case_figure(result) for result in results]
        write_page(system, summary, figures, len(cases), page, suffixes)
        line = f"{len(results)} of {len(cases)} cases; to read: {page}, data beside it"
        if not with_csv:
            line += f" (as CSV: workbench results {arguments.nearby(options.out)} --csv)"
        output.result(line)
    if window is not None and not interrupted:
        window.wait()
    if failure is not None:
        raise failure
    reference = system.signals[system.objective.signal]
    units = {f"{reference.name}_rms_{reference.unit}": reference.unit, "seconds": "s"}
    if interrupted:
        return CommandResult(summary, units, 130, page)
    failed = [
        name
        for name in results[0].runs
        if all(result.runs[name].ending is not Ending.OK for result in results)
    ]
    for name in failed:
        print(
            f"error: {name} estimated nothing in any case; the reasons are above", file=sys.stderr
        )
    unsure = _unsure(results)
    for text in unsure:
        print(f"error: {text}", file=sys.stderr)
    return CommandResult(summary, units, 1 if failed or unsure else 0, page)


def _unsure(results: Sequence[CaseResult]) -> list[str]:
    """Why estimates cannot be relied on: quantities nowhere told, useless bands, coarse steps."""
    from workbench.observers.trust import MOSTLY

    guessed = set.intersection(*(set(result.guessed) for result in results))
    texts = [
        f"no recording tells {name}; its estimates are guesses, see above"
        for name in sorted(guessed)
    ]
    useless = {
        name: [result.case.name for result in results if result.useless(name)]
        for name in results[0].runs
    }
    texts += [
        f"bands of {name} miss more often than they hold in {', '.join(cases)}; the reason is above"
        for name, cases in useless.items()
        if cases
    ]
    damped = [result.case.name for result in results if result.step_share > MOSTLY]
    if damped:
        texts.append(f"coarse steps, not the model, make errors in {', '.join(damped)}; see above")
    return texts


def _run_live(
    simulation: Simulation,
    cases: Sequence[Case],
    window: LiveWindow,
    write: Callable[[CaseResult], None],
) -> Iterator[CaseResult]:
    from workbench.observers.simulation import simulate

    for case in cases:
        with simulation.estimators() as running:
            window.show(case, list(running.values()), simulation.warnings(case))
        yield from simulate(simulation, [case], 1, write)


def _models(simulation: Simulation) -> dict[str, Any]:
    from workbench.pages.provenance import models, software
    from workbench.system.system import OBSERVER

    roles = dict.fromkeys([OBSERVER, *(estimator.role for estimator in simulation.kinds.values())])
    named = models(simulation.system, [role for role in roles if role in simulation.system.models])
    return {
        **software(("fmpy", "numpy", "scipy", "numba")),
        **{
            "fmu" if role == OBSERVER else f"{role}_fmu": identity
            for role, identity in named.items()
        },
    }


def _settings(simulation: Simulation) -> dict[str, Any]:
    with simulation.estimators() as estimators:
        settings = {name: estimator.settings() for name, estimator in estimators.items()}
    return {name: setting for name, setting in settings.items() if setting}


def _write(out: Path, suffixes: Sequence[str], result: CaseResult) -> None:
    """Write data and figures of a case; those of an earlier run that are not asked for now go."""
    from workbench.observers.report import write_estimates
    from workbench.observers.simulation import case_figure
    from workbench.pages.figures import draw_case

    paths = {s: out / f"{result.case.name}.{s}" for s in ("npz", "csv", "png", "svg")}
    for suffix, path in paths.items():
        if suffix in suffixes and suffix in ("npz", "csv"):
            write_estimates(result, path)
        elif suffix not in suffixes and path.is_file():
            path.unlink()
    if "svg" in suffixes:
        draw_case(case_figure(result), [paths["png"], paths["svg"]])
