"""`workbench simulate`: all estimators on recorded brake stops."""

import argparse
import os
import platform
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.metadata import version
from pathlib import Path

from workbench.case import Case, read_cases
from workbench.commands.arguments import MINIMAL_OBSERVER, Commands, positive
from workbench.cosim import observe
from workbench.fmu import FMU
from workbench.objective import Weights, score
from workbench.observers import (
    DirectInversion,
    DisturbanceGains,
    DisturbanceObserver,
    OpenLoop,
    stationary_gains,
)
from workbench.report import (
    CaseResult,
    draw_case,
    format_table,
    write_estimates,
    write_summary,
)


def add_simulate(commands: Commands) -> None:
    """Add the command to the parser."""
    simulate = commands.add_parser(
        "simulate",
        help="run all estimators on recorded brake stops",
        description="Run all estimators on recorded brake stops; write estimates (CSV), scores "
        "(summary.json) and figures.",
        epilog="examples:\n"
        "  python -m workbench simulate\n"
        "  python -m workbench simulate cases/09_wet_160_4.2_wsp --out /tmp/slide\n"
        "  python -m workbench simulate my_cases --fmu my_model.fmu --out results/mine",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    simulate.add_argument(
        "cases",
        nargs="*",
        type=Path,
        default=[Path("cases")],
        metavar="CASE",
        help="case folder, or folder of case folders (default: cases)",
    )
    simulate.add_argument(
        "--out",
        type=Path,
        default=Path("results/simulate"),
        metavar="DIR",
        help="where to write (default: %(default)s)",
    )
    simulate.add_argument(
        "--fmu",
        type=Path,
        default=MINIMAL_OBSERVER,
        metavar="FILE",
        help="minimal observer model (default: %(default)s)",
    )
    simulate.add_argument(
        "--workers",
        type=positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one per processor, %(default)s)",
    )
    simulate.set_defaults(run=_simulate)


def _simulate(options: argparse.Namespace) -> int:
    cases = read_cases(options.cases)
    options.out.mkdir(parents=True, exist_ok=True)
    with FMU(options.fmu) as fmu:
        gains = stationary_gains(fmu)
        provenance = {
            "workbench": version("wheelset-workbench"),
            "python": platform.python_version(),
            "packages": {p: version(p) for p in ("fmpy", "numpy", "scipy")},
            "fmu": {"file": fmu.path.name, "model": fmu.name, "sha256": fmu.sha256},
            "disturbance_observer": {
                "L": gains.L.tolist(),
                "T_WR": gains.T_WR,
                "T_DC": gains.T_DC,
                "effect": gains.effect.tolist(),
                "source": "stationary Kalman gain of the linearised model",
            },
        }
    weights = Weights()
    results: list[CaseResult] = []
    begin = time.perf_counter()
    interrupted = False
    with ProcessPoolExecutor(min(options.workers, len(cases))) as pool:
        tasks = [pool.submit(_run_case, c, options.fmu, gains, weights, options.out) for c in cases]
        try:
            for task in as_completed(tasks):
                results.append(task.result())
                _show_progress(len(results), len(cases), results[-1].case.name, begin)
        except KeyboardInterrupt:
            interrupted = True
            pool.shutdown(cancel_futures=True)
    results.sort(key=lambda result: result.case.name)
    if results:
        write_summary(results, weights, provenance, options.out / "summary.json")
        print(format_table(results))
        print(
            f"{len(results)} of {len(cases)} cases; figures, CSV and summary.json in {options.out}"
        )
    return 130 if interrupted else 0


def _run_case(
    case: Case, fmu_path: Path, gains: DisturbanceGains, weights: Weights, out: Path
) -> CaseResult:
    """All estimators on one case, in a process of its own; writes its CSV and figure."""
    with FMU(fmu_path) as fmu:
        roller_radius = fmu.defaults["rR"]
        estimators = (OpenLoop(fmu), DirectInversion(fmu), DisturbanceObserver(fmu, gains))
        runs = {e.name: observe(case, e) for e in estimators}
    scores = {name: score(case, run, roller_radius, weights) for name, run in runs.items()}
    result = CaseResult(case, runs, scores)
    write_estimates(result, out / f"{case.name}.csv")
    draw_case(result, roller_radius, out / f"{case.name}.png")
    return result


def _show_progress(done: int, total: int, name: str, begin: float) -> None:
    """One line per finished case, with the time left."""
    elapsed = time.perf_counter() - begin
    left = elapsed / done * (total - done)
    print(f"[{done:>3}/{total}] {name:<28} {elapsed:5.1f} s, about {left:.0f} s left", flush=True)
