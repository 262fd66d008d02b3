"""`workbench observability`: what the measured speeds can tell about states and frictions."""

import argparse
import os
import platform
import time
from contextlib import nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from workbench.case import Case, read_cases
from workbench.commands.arguments import (
    Commands,
    add_observer_models,
    add_recordings,
    nearby,
    positive,
)
from workbench.cosim import Outcome, observe
from workbench.errors import FMUError
from workbench.fmu import FMU
from workbench.objective import braking_window
from workbench.observability import LinearTest, linear_test, window_test
from workbench.observers import DisturbanceGains, DisturbanceObserver, stationary_gains
from workbench.pool import Pool
from workbench.report.observability import (
    StopObservability,
    draw_observability,
    format_observability,
    write_observability,
    write_windows,
)
from workbench.resources import cases


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    own = nearby(cases())
    observability = commands.add_parser(
        "observability",
        description="Show what the measured speeds can tell: a linear test of both observer "
        "models, and for each recorded stop how well half a second of samples can know the "
        "frictions dmuWR and dmuDC (Cramer-Rao bound). Writes windows (CSV), observability.json "
        "and figures.",
        epilog="examples:\n"
        "  python -m workbench observability\n"
        f"  python -m workbench observability {own}/09_wet_160_4.2_wsp --out /tmp/slide\n"
        "  python -m workbench observability my_cases --full-fmu my_full_model.fmu",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_recordings(observability, out="results/observability")
    add_observer_models(observability)
    observability.add_argument(
        "--workers",
        type=positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one per processor, %(default)s)",
    )
    observability.set_defaults(run=_observability)


def _observability(options: argparse.Namespace) -> int:
    cases = read_cases(options.cases)
    options.out.mkdir(parents=True, exist_ok=True)
    models = (options.fmu, options.full_fmu)
    linear: list[LinearTest] = []
    files = []
    for path in models:
        with FMU(path) as fmu:
            linear.append(linear_test(fmu))
            files.append({"file": fmu.path.name, "model": fmu.name, "sha256": fmu.sha256})
    with FMU(options.fmu) as fmu:
        gains = stationary_gains(fmu)
    provenance = {
        "workbench": version("wheelset-workbench"),
        "python": platform.python_version(),
        "packages": {p: version(p) for p in ("fmpy", "numpy", "scipy")},
        "fmus": files,
    }
    stops: list[StopObservability] = []
    begin = time.perf_counter()
    interrupted = False
    setup = _Setup(models, tuple(linear), gains, options.out)
    with Pool(min(options.workers, len(cases)), nullcontext, setup) as pool:
        try:
            for _, stop in pool.completed(_run_case, cases):
                stops.append(stop)
                elapsed = time.perf_counter() - begin
                left = elapsed / len(stops) * (len(cases) - len(stops))
                print(
                    f"[{len(stops):>3}/{len(cases)}] {stops[-1].case.name:<28} {elapsed:5.1f} s, "
                    f"about {left:.0f} s left",
                    flush=True,
                )
        except KeyboardInterrupt:
            interrupted = True
            pool.finish()
    stops.sort(key=lambda stop: stop.case.name)
    if stops:
        write_observability(linear, stops, provenance, options.out / "observability.json")
        print(format_observability(linear, stops))
        print(f"{len(stops)} of {len(cases)} cases; figures, CSV and JSON in {options.out}")
    return 130 if interrupted else 0


@dataclass(frozen=True)
class _Setup:
    """What runs on every case.

    Attributes
    ----------
    models : FMUs; the first is that of the disturbance observer.
    linear : test of each model.
    """

    models: tuple[Path, ...]
    linear: tuple[LinearTest, ...]
    gains: DisturbanceGains
    out: Path


def _run_case(setup: _Setup, case: Case) -> StopObservability:
    """Test all models on one case; writes its CSV and figure.

    The trajectory is the estimate of the disturbance observer on the first model.
    """
    with FMU(setup.models[0]) as fmu:
        run = observe(case, DisturbanceObserver(fmu, setup.gains))
        roller_radius = float(fmu.get(fmu.variables(["rR"]))[0])
    if run.outcome is not Outcome.OK:
        raise FMUError(f"{case.name}: {run.outcome.value} {run.message}".strip())
    tests = []
    for path, test in zip(setup.models, setup.linear, strict=True):
        with FMU(path) as fmu:
            tests.append(window_test(fmu, case, run, test.scale))
    window = braking_window(case, roller_radius)
    braking = np.isin(tests[0].time, case.time[window])
    stop = StopObservability(case, run, braking, tuple(tests))
    write_windows(stop, setup.out / f"{case.name}.csv")
    draw_observability(stop, setup.out / f"{case.name}.png")
    return stop
