"""`workbench simulate`: all estimators on recorded brake stops."""

import argparse
import os
import platform
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path

from workbench.case import Case, read_cases
from workbench.commands.arguments import (
    Commands,
    add_map,
    add_observer_models,
    add_recordings,
    model_names,
    nearby,
    positive,
)
from workbench.cosim import observe
from workbench.files import write_json
from workbench.fmu import FMU
from workbench.objective import Weights, score
from workbench.observers import (
    ESTIMATORS,
    STANDARD,
    Settings,
    make_estimators,
    reasoned_settings,
)
from workbench.pool import Pool
from workbench.report import (
    CaseFigure,
    CaseResult,
    LiveWindow,
    case_figure,
    draw_case,
    format_table,
    summarise,
    write_estimates,
    write_page,
)
from workbench.resources import CHECKOUT, cases
from workbench.tuning import default_settings, read_gains, with_tuned


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    own = nearby(cases())
    simulate = commands.add_parser(
        "simulate",
        description="Run all estimators on recorded brake stops; write a page to read "
        "(index.html), and beside it scores (summary.json), data (CSV) and figures (PNG, SVG).",
        epilog="examples:\n"
        "  python -m workbench simulate\n"
        f"  python -m workbench simulate {own}/09_wet_160_4.2_wsp --out /tmp/slide\n"
        "  python -m workbench simulate my_cases --fmu my_model.fmu --out results/mine\n"
        f"  python -m workbench simulate {own}/03_dry_120_3.6 --live\n"
        "  python -m workbench simulate --estimator disturbance_observer "
        "--estimator disturbance_observer_disc",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_recordings(simulate, out="results/simulate")
    add_observer_models(simulate)
    simulate.add_argument(
        "--gains",
        type=Path,
        metavar="FILE",
        help="gains.toml of 'workbench tune', for the estimator that it names (default: for the "
        "project's models gains tuned on the project's cases, else gains reasoned from the "
        "linearised models)",
    )
    simulate.add_argument(
        "--untuned",
        action="store_true",
        help="gains reasoned from the linearised models, to compare tuned ones with",
    )
    add_map(simulate)
    simulate.add_argument(
        "--estimator",
        action="append",
        default=[],
        choices=ESTIMATORS,
        metavar="NAME",
        help="run this one, may be repeated (default: the standard ones): "
        f"{', '.join(STANDARD)}; besides these disturbance_observer_disc, with a physical model "
        "of disc temperature",
    )
    simulate.add_argument(
        "--workers",
        type=positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one per processor, %(default)s)",
    )
    simulate.add_argument(
        "--live",
        action="store_true",
        help="show each run in a window as it goes, one after the other",
    )
    simulate.set_defaults(run=_simulate)


@dataclass(frozen=True)
class _Plan:
    """What runs on every case; travels to the processes.

    Attributes
    ----------
    minimal, full : files of the two observer models.
    names : our names of variables to those in the FMUs.
    estimators : names, in the order of the results.
    """

    minimal: Path
    full: Path
    names: Mapping[str, str]
    estimators: Sequence[str]
    settings: Settings
    weights: Weights
    out: Path


def _simulate(options: argparse.Namespace) -> int:
    cases = read_cases(options.cases)
    names = model_names(options.map, cases)
    chosen = [name for name in ESTIMATORS if name in (options.estimator or STANDARD)]
    window = LiveWindow() if options.live else None
    options.out.mkdir(parents=True, exist_ok=True)
    with FMU(options.fmu, names) as minimal, FMU(options.full_fmu, names) as full:
        settings, tuned = default_settings(minimal, full)
        if options.untuned:
            settings, tuned = reasoned_settings(minimal, full), {}
        if options.gains is not None:
            name, gains = read_gains(options.gains)
            settings, tuned[name] = with_tuned(settings, gains), options.gains.name
        sources = settings.summary()
        for key in sources:
            for name, file in tuned.items():
                if name in key:
                    sources[key]["source"] = f"tuned, {file}"
        print("preparing the observers' loops (compiled once, up to a minute)", flush=True)
        for estimator in make_estimators(chosen, minimal, full, settings):
            estimator.run(cases[0].time[:2], cases[0].u[:2], cases[0].y[:2])
        provenance = {
            "workbench": version("wheelset-workbench"),
            "commit": _commit(),
            "python": platform.python_version(),
            "packages": {p: version(p) for p in ("fmpy", "numpy", "scipy", "numba")},
            **{
                key: {"file": fmu.path.name, "model": fmu.name, "sha256": fmu.sha256}
                for key, fmu in (("fmu", minimal), ("full_fmu", full))
            },
            **{key: sources[key] for key in sources if set(key.split(", ")) & set(chosen)},
        }
    weights = Weights()
    plan = _Plan(options.fmu, options.full_fmu, names, chosen, settings, weights, options.out)
    done: list[tuple[CaseResult, CaseFigure]] = []
    begin = time.perf_counter()
    interrupted = False
    # A window shows one run after the other, in this process.
    workers = min(options.workers, len(cases)) if window is None else 1
    with Pool(workers, nullcontext, plan) as pool:
        try:
            for _, (result, figure) in pool.completed(partial(_run_case, window=window), cases):
                done.append((result, figure))
                _show_progress(len(done), len(cases), figure.name, begin)
        except KeyboardInterrupt:
            interrupted = True
            print("interrupted", flush=True)
            pool.finish()
    if done:
        done.sort(key=lambda pair: pair[1].name)
        results = [result for result, _ in done]
        summary = summarise(results, weights, provenance)
        write_json(options.out / "summary.json", summary)
        page = options.out / "index.html"
        write_page(summary, [figure for _, figure in done], len(cases), page)
        print(format_table(results))
        print(f"{len(done)} of {len(cases)} cases; to read: {page}, data and figures beside it")
    if window is not None and not interrupted:
        window.wait()
    return 130 if interrupted else 0


def _run_case(
    plan: _Plan, case: Case, window: LiveWindow | None = None
) -> tuple[CaseResult, CaseFigure]:
    """All estimators on one case; writes its CSV and figures."""
    with ExitStack() as stack:
        minimal, full = (
            stack.enter_context(FMU(path, plan.names)) for path in (plan.minimal, plan.full)
        )
        roller_radius = minimal.defaults["rR"]
        estimators = make_estimators(plan.estimators, minimal, full, plan.settings)
        if window is not None:
            window.show(case, estimators)
        runs = {e.name: observe(case, e) for e in estimators}
    scores = {name: score(case, run, roller_radius, plan.weights) for name, run in runs.items()}
    result = CaseResult(case, runs, scores)
    figure = case_figure(result, roller_radius)
    write_estimates(result, plan.out / f"{case.name}.csv")
    draw_case(figure, [plan.out / f"{case.name}.png", plan.out / f"{case.name}.svg"])
    return result, figure


def _commit() -> str | None:
    """Commit of the checkout that this package is run from, "-dirty" if changed; None if none."""
    if CHECKOUT is None or not (CHECKOUT / ".git").exists():
        return None
    git = ["git", "--no-optional-locks", "-C", str(CHECKOUT)]
    describe = ["describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        answer = subprocess.run([*git, *describe], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return answer.stdout.strip()


def _show_progress(done: int, total: int, name: str, begin: float) -> None:
    """One line per finished case, with the time left."""
    elapsed = time.perf_counter() - begin
    left = elapsed / done * (total - done)
    print(f"[{done:>3}/{total}] {name:<28} {elapsed:5.1f} s, about {left:.0f} s left", flush=True)
