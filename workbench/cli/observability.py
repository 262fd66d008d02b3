"""`workbench observability`: what measured outputs can tell about states and quantities."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli import arguments
from workbench.cli.output import CommandResult, Output, read_result
from workbench.runtime.files import locked_folder
from workbench.runtime.pool import Pool, preload

if TYPE_CHECKING:
    from workbench.arrays import Vector
    from workbench.observers.observability import CaseObservability
    from workbench.recordings.case import Case
    from workbench.system.system import System


def add(commands: arguments.Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    own = arguments.example_case()
    observability = commands.add_parser(
        "observability",
        help=text,
        description="Show what the measured outputs can identify: a linear test of the observer "
        "models, and the Cramer-Rao bound along each recording. Writes windows (CSV), "
        "observability.json and figures.",
        epilog="examples:\n"
        "  workbench observability\n"
        f"  workbench observability {own} --out /tmp/one\n"
        "  workbench observability my_cases --system my/system.toml",
    )
    arguments.add_recordings(observability, out="results/observability")
    arguments.add_system(observability)
    arguments.add_models(observability)
    arguments.add_run(observability)
    return observability


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Show what the outputs of the recordings tell."""
    from workbench.cli.inputs import chosen_system

    system, cases = chosen_system(options)
    if min(options.workers, len(cases)) > 1:
        preload("workbench.observers.observability_report")
    with locked_folder(options.out):
        return _run(options, output, system, cases)


def _run(
    options: argparse.Namespace, output: Output, system: System, cases: Sequence[Case]
) -> CommandResult:
    from workbench.observers.observability import linear_test
    from workbench.observers.observability_report import (
        format_observability,
        write_observability,
        write_observability_page,
    )
    from workbench.pages.provenance import models, run_of, software, sources
    from workbench.system.registry import open_model
    from workbench.system.system import FULL, OBSERVER

    linear = {}
    for role in (role for role in (OBSERVER, FULL) if role in system.models):
        with open_model(system, role) as fmu:
            linear[role] = linear_test(fmu, system)
    provenance = {
        "run": run_of("observability", system, sources(cases)),
        **software(("fmpy", "numpy", "scipy")),
        "fmus": list(models(system, list(linear)).values()),
    }
    scales = {role: test.scale for role, test in linear.items()}
    results: list[CaseObservability] = []
    begin = time.perf_counter()
    interrupted = False
    setup = (system, scales, options.out)
    with Pool(min(options.workers, len(cases)), nullcontext, setup) as pool:
        try:
            for _, result in pool.completed(_test_case, cases):
                results.append(result)
                output.step(len(results), len(cases), result.case.name, begin)
        except KeyboardInterrupt:
            interrupted = True
            pool.finish()
    summary: dict[str, Any] = {}
    page: Path | None = None
    if results:
        results.sort(key=lambda result: result.case.name)
        tests = list(linear.values())
        output.result(format_observability(system, tests, results))
        path = options.out / "observability.json"
        write_observability(system, tests, results, provenance, path)
        summary = read_result(path)
        page = write_observability_page(summary, results, len(cases), options.out)
        line = f"{len(results)} of {len(cases)} cases; to read: {page}, data and figures beside it"
        output.result(line)
    units = {"window_s": "s", "stride_s": "s"}
    units |= {signal.name: signal.unit for signal in (*system.inputs, *system.outputs)}
    for quantity in system.estimated:
        units |= dict.fromkeys((quantity.correction, f"median_{quantity.name}"), quantity.unit)
    return CommandResult(summary, units, 130 if interrupted else 0, page)


def _test_case(setup: tuple[System, Mapping[str, Vector], Path], case: Case) -> CaseObservability:
    from workbench.observers.observability import case_observability
    from workbench.observers.observability_report import draw_observability, write_windows

    system, scales, out = setup
    result = case_observability(system, scales, case)
    write_windows(result, out / f"{case.name}.csv")
    draw_observability(result, out / f"{case.name}.png")
    return result
