"""`workbench bench`: how long calls into the FMUs, observers and tuning take."""

import argparse
import platform
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.benchmark.bench_observers import bench_observers
from workbench.benchmark.bench_tuning import bench_tuning
from workbench.benchmark.calls import points
from workbench.cli.extras import require_compiler
from workbench.cli.inputs import given_cases
from workbench.cli.output import CommandResult, Output
from workbench.pages.answer import Answer, Measure
from workbench.pages.provenance import run_of, sources
from workbench.recordings.case import Case
from workbench.runtime.files import locked_folder, write_json
from workbench.system.registry import load_system, open_model
from workbench.system.system import System

if TYPE_CHECKING:
    from workbench.models.compiler.benchmark import CallTimes


_SEED = 1
_CASE = 2  # of the recordings, on which single observers are timed
# What is not named here is a time in s, of one call, step, or run.
_UNITS = {"steps_per_second": "1/s"}


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Time all of it."""
    require_compiler()
    system = load_system(options.system)
    cases = given_cases(options, system)
    with locked_folder(options.out):
        return _run(output, system, cases, options.out / "bench.json")


def _run(output: Output, system: System, cases: Sequence[Case], path: Path) -> CommandResult:
    case = cases[min(_CASE, len(cases) - 1)]
    calls = _time_models(system)
    output.result(_format_calls(calls, system.sample_time))
    observers = bench_observers(system, cases, case, output)
    tuning = bench_tuning(system, cases, case, output)
    content: dict[str, Any] = {
        "answer": _answer(calls).to_dict(),
        "provenance": {"run": run_of("bench", system, sources(cases))},
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
    write_json(path, content)
    output.result(f"written: {path}")
    return CommandResult(content, _UNITS)


def _time_models(system: System) -> "dict[str, CallTimes]":
    """Time calls into the models of all roles."""
    from workbench.models.compiler.benchmark import time_sources

    calls = {}
    for role, model in system.models.items():
        with open_model(system, role) as fmu:
            at = points(fmu, system, np.random.default_rng(_SEED))
            calls[model.name] = time_sources(fmu.description, at, system.sample_time)
    return calls


def _answer(calls: "dict[str, CallTimes]") -> Answer:
    """Times of calls, which are those of this machine."""
    headline, told = {}, []
    for name, times in calls.items():
        headline[f"{name}: derivatives through FMI"] = Measure(times.derivatives_fmi, "s", "lower")
        headline[f"{name}: Jacobian through FMI"] = Measure(times.jacobian_fmi, "s", "lower")
        headline[f"{name}: Co-Simulation steps"] = Measure(1.0 / times.step, "1/s", "higher")
        told.append(f"{times.derivatives_fmi / times.derivatives:.1f} times for {name}")
    return Answer(f"Derivatives through FMI take, over a plain call: {', '.join(told)}.", headline)


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
