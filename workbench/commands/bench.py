"""`workbench bench`: how long calls into the FMUs, observers and tuning take."""

import argparse
import platform
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.benchmark.calls import points
from workbench.commands.arguments import (
    Commands,
    add_isolated,
    add_system,
    given_cases,
    require_compiler,
)
from workbench.commands.bench_observers import bench_observers
from workbench.commands.bench_tuning import bench_tuning
from workbench.files import prove_writable, write_json
from workbench.system import System
from workbench.systems import load_system, open_model

if TYPE_CHECKING:
    from workbench.compiler.benchmark import CallTimes

_SEED = 1
_CASE = 2  # of the recordings, on which single observers are timed


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    bench = commands.add_parser(
        "bench",
        description="Time derivatives and Jacobians through FMI beside plain C calls of the same "
        "sources in one program, and Co-Simulation steps; then the observers beside the same "
        "methods written with FMPy and in plain C; then the tuning: one evaluation beside FMPy, "
        "workers, memory. Needs the extra [compiler], and for a Dask cluster [cluster].",
        epilog="example:\n  python -m workbench bench --json results/bench/bench.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    bench.add_argument("--json", type=Path, metavar="FILE", help="write the times to a JSON file")
    add_system(bench)
    bench.add_argument(
        "--cases",
        nargs="+",
        type=Path,
        default=[],
        metavar="CASE",
        help="recordings that observers and tuning are timed on (default: those of the system)",
    )
    add_isolated(bench)
    bench.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    require_compiler()
    system = load_system(options.system)
    cases = given_cases(options.cases, system)
    if options.json:
        prove_writable(options.json)
    case = cases[min(_CASE, len(cases) - 1)]
    calls = _time_models(system)
    print(_format_calls(calls, system.sample_time))
    observers = bench_observers(system, cases, case)
    tuning = bench_tuning(system, cases, case)
    if options.json:
        content: dict[str, Any] = {
            "machine": {"processor": platform.machine(), "system": platform.platform()},
            "seed": _SEED,
            "calls": {
                name: {
                    "unit": "s",
                    **asdict(times),
                    "ratios": dict(times.ratios()),
                    "steps_per_second": 1.0 / times.step,
                }
                for name, times in calls.items()
            },
            "observers": observers,
            "tuning": tuning,
        }
        write_json(options.json, content)
    return 0


def _time_models(system: System) -> "dict[str, CallTimes]":
    """Time calls into the models of all roles."""
    from workbench.compiler.benchmark import time_sources

    calls = {}
    for role, model in system.models.items():
        with open_model(system, role) as fmu:
            at = points(fmu, system, np.random.default_rng(_SEED))
            calls[model.name] = time_sources(fmu.description, at, system.sample_time)
    return calls


def _format_calls(calls: "dict[str, CallTimes]", step: float) -> str:
    lines = [
        "derivatives: one C call (plain); setting states and inputs, getting derivatives (FMI)",
        "jacobian: full matrix d[der(x), w]/d[x, u] from one C call for its nonzeros (plain);",
        "    setting states and inputs, one directional derivative for each column (FMI)",
        f"{'model':<16} {'evaluation':<12} {'plain':>9} {'FMI':>9}  {'ratio':>5}",
    ]
    for name, times in calls.items():
        ratios = times.ratios()
        for kind, plain, through in (
            ("derivatives", times.derivatives, times.derivatives_fmi),
            ("jacobian", times.jacobian, times.jacobian_fmi),
        ):
            spent = f"{1e9 * plain:>6.0f} ns {1e9 * through:>6.0f} ns"
            lines.append(f"{name:<16} {kind:<12} {spent}  {ratios[kind]:5.2f}")
    for name, times in calls.items():
        rate = f"Co-Simulation steps of {1e3 * step:g} ms per second"
        lines.append(f"{name:<16} {1.0 / times.step:>9.0f} {rate}")
    return "\n".join(lines)
