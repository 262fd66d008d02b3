"""`workbench bench`: how long calls into the FMUs, observers and tuning take."""

from __future__ import annotations

import argparse
import platform
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli.arguments import (
    Commands,
    add_isolated,
    add_out,
    add_recording_options,
    add_system,
)
from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output
from workbench.runtime.files import locked_folder, write_json

if TYPE_CHECKING:
    from workbench.recordings.case import Case
    from workbench.system.system import System


_CASE = 2  # of the recordings, on which single observers are timed
# What is not named here is a time in s, of one call, step, or run.
_UNITS = {"steps_per_second": "1/s"}


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    bench = commands.add_parser(
        "bench",
        help=text,
        description="Time derivatives, Jacobians and Co-Simulation steps through FMI, beside "
        "plain C calls of the same sources. Then time the observers beside the same "
        "methods in FMPy and in plain C, and the tuning: one evaluation, workers, "
        "memory. Needs the extra [compiler], and for a Dask cluster [cluster].",
        epilog="example:\n  workbench bench --out /tmp/bench",
    )
    add_out(bench, "results/bench")
    add_system(bench)
    bench.add_argument(
        "--cases",
        nargs="+",
        type=Path,
        default=[],
        metavar="CASE",
        help="recordings that observers and tuning are timed on (default: those of the system)",
    )
    add_recording_options(bench)
    add_isolated(bench)
    return bench


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Time all of it."""
    require_compiler()
    from workbench.benchmark.calls import SEED, calls_answer, format_calls, time_models
    from workbench.cli.inputs import given_cases
    from workbench.pages.provenance import run_of, sources
    from workbench.system.registry import load_system

    system = load_system(options.system)
    cases = given_cases(options, system)
    with locked_folder(options.out):
        case = cases[min(_CASE, len(cases) - 1)]
        calls = time_models(system)
        output.result(format_calls(calls, system.sample_time))
        content: dict[str, Any] = {
            "answer": calls_answer(calls).to_dict(),
            "provenance": {"run": run_of("bench", system, sources(cases))},
            "machine": {"processor": platform.machine(), "system": platform.platform()},
            "seed": SEED,
            "calls": {
                name: {
                    "unit": "s",
                    **asdict(times),
                    "ratios": dict(times.ratios()),
                    "steps_per_second": 1.0 / times.step,
                }
                for name, times in calls.items()
            },
            "observers": _observers(system, cases, case, output),
            "tuning": _tuning(system, cases, case, output),
        }
        write_json(options.out / "bench.json", content)
    output.result(f"written: {options.out / 'bench.json'}")
    return CommandResult(content, _UNITS)


def _observers(system: System, cases: Sequence[Case], case: Case, output: Output) -> dict[str, Any]:
    from workbench.benchmark.horizon import format_horizon, time_horizon
    from workbench.benchmark.observers import (
        format_observers,
        time_compilation,
        time_observers,
        time_processes,
    )

    observers = time_observers(case, system)
    processes = time_processes(cases, system)
    compilation = time_compilation(system, case)
    horizon = time_horizon(case, system)
    output.result(
        f"\n{format_observers(observers, processes, compilation)}\n{format_horizon(horizon)}"
    )
    return {
        "case": case.name,
        "steps": [asdict(row) for row in observers],
        "processes": asdict(processes),
        "compilation": compilation,
        "horizon": {**asdict(horizon), "ratios": horizon.ratios()},
    }


def _tuning(system: System, cases: Sequence[Case], case: Case, output: Output) -> dict[str, Any]:
    from workbench.benchmark.tuning import (
        format_tuning,
        observe_memory,
        time_evaluations,
        time_workers,
    )

    evaluations = time_evaluations(case, system)
    workers = time_workers(cases, system)
    memory = observe_memory([case.source.parent for case in cases], system)
    output.result(f"\n{format_tuning(evaluations, workers, memory)}")
    return {
        "case": case.name,
        "evaluations": [{**asdict(row), "ratios": dict(row.ratios())} for row in evaluations],
        "workers": {**asdict(workers), "ratios": dict(workers.ratios())},
        "memory": asdict(memory),
    }
