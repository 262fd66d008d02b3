"""`workbench bench`: how long calls into the FMUs, observers and tuning take."""

import argparse
import platform
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.commands.arguments import Commands, require_compiler, write_json
from workbench.commands.bench_observers import bench_observers
from workbench.commands.bench_tuning import bench_tuning
from workbench.description import read_description

if TYPE_CHECKING:
    from workbench.compiler.benchmark import CallTimes

_MODELS = ("MinimalObserver", "FullObserver", "Reference")
_SEED = 1


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
    bench.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    require_compiler()
    from workbench.compiler.benchmark import measure_calls

    calls = {}
    for model in _MODELS:
        description = read_description(Path(f"fmus/fmi2/{model}.fmu"))
        calls[model] = measure_calls(description, _SEED)
    print(_format_calls(calls))
    observers = bench_observers()
    tuning = bench_tuning()
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
        write_json(content, options.json)
    return 0


def _format_calls(calls: "dict[str, CallTimes]") -> str:
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
        lines.append(f"{name:<16} {1.0 / times.step:>9.0f} Co-Simulation steps of 5 ms per second")
    return "\n".join(lines)
