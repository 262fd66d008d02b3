"""`workbench observability`: what measured outputs can tell about states and quantities."""

import argparse
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path

from workbench.case import Case
from workbench.commands.arguments import (
    Commands,
    add_isolated,
    add_models,
    add_recordings,
    add_system,
    add_workers,
    chosen_system,
    example_case,
    show_progress,
)
from workbench.files import claimed
from workbench.fmu import Vector
from workbench.observability import CaseObservability, case_observability, linear_test
from workbench.pool import Pool
from workbench.provenance import models, software
from workbench.report.observability import (
    draw_observability,
    format_observability,
    write_observability,
    write_windows,
)
from workbench.system import FULL, OBSERVER, System
from workbench.systems import open_model


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    own = example_case()
    observability = commands.add_parser(
        "observability",
        description="Show what the measured outputs can tell: a linear test of the observer "
        "models, and for each recording how well half a second of samples can know the estimated "
        "quantities (Cramer-Rao bound). Writes windows (CSV), observability.json and figures.",
        epilog="examples:\n"
        "  python -m workbench observability\n"
        f"  python -m workbench observability {own} --out /tmp/one\n"
        "  python -m workbench observability my_cases --system my/system.toml",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_recordings(observability, out="results/observability")
    add_system(observability)
    add_models(observability)
    add_workers(observability)
    add_isolated(observability)
    observability.set_defaults(run=_observability)


def _observability(options: argparse.Namespace) -> int:
    system, cases = chosen_system(options)
    with claimed(options.out):
        return _run(options, system, cases)


def _run(options: argparse.Namespace, system: System, cases: Sequence[Case]) -> int:
    linear = {}
    for role in (role for role in (OBSERVER, FULL) if role in system.models):
        with open_model(system, role) as fmu:
            linear[role] = linear_test(fmu, system)
    provenance = {
        **software(("fmpy", "numpy", "scipy")),
        "fmus": list(models(system, list(linear)).values()),
    }
    scales = {role: test.scale for role, test in linear.items()}
    done: list[CaseObservability] = []
    begin = time.perf_counter()
    interrupted = False
    setup = (system, scales, options.out)
    with Pool(min(options.workers, len(cases)), nullcontext, setup) as pool:
        try:
            for _, one in pool.completed(_test_case, cases):
                done.append(one)
                show_progress(len(done), len(cases), one.case.name, begin)
        except KeyboardInterrupt:
            interrupted = True
            pool.finish()
    if done:
        done.sort(key=lambda one: one.case.name)
        tests = list(linear.values())
        print(format_observability(system, tests, done))
        write_observability(system, tests, done, provenance, options.out / "observability.json")
        print(f"{len(done)} of {len(cases)} cases; figures, CSV and JSON in {options.out}")
    return 130 if interrupted else 0


def _test_case(setup: tuple[System, Mapping[str, Vector], Path], case: Case) -> CaseObservability:
    """Test all models on one case; writes its CSV and figure."""
    system, scales, out = setup
    one = case_observability(system, scales, case)
    write_windows(one, out / f"{case.name}.csv")
    draw_observability(one, out / f"{case.name}.png")
    return one
