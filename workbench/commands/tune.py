"""`workbench tune`: gains that minimise the worst case over recorded brake stops."""

import argparse
import json
import os
import platform
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from workbench.case import Case, read_cases
from workbench.commands.arguments import (
    FULL_OBSERVER,
    MINIMAL_OBSERVER,
    Commands,
    add_map,
    model_names,
    positive,
)
from workbench.errors import FMUError, InputError
from workbench.fmu import FMU, Vector
from workbench.objective import Weights
from workbench.report.tuning import write_tuning_page
from workbench.tuning import (
    TUNABLE,
    Fold,
    Generation,
    Job,
    Plan,
    Pool,
    ProcessPool,
    Search,
    SearchSpace,
    Sensitivity,
    cross_validate,
    draw_cases,
    draw_convergence,
    format_gains,
    from_vector,
    gain_names,
    judge_gains,
    reasoned_gains,
    recordings,
    search,
    search_space,
    sensitivities,
    to_vector,
    untuned_filter,
    write_whole,
)

TIMEOUT = 60  # [s] for one candidate, which takes about 0.1 s
RADIUS_ERROR = 0.05  # [%] a wheel measured to a quarter of a millimetre
_LIVE_PERIOD = 5.0  # [s] between two drawings of the convergence


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    tune = commands.add_parser(
        "tune",
        description="Find gains that minimise z, the worst of the objectives z_k of all cases "
        "(Schwarz et al. 2018, equations 11 and 12), by differential evolution. Writes gains.toml, "
        "summary.json, figures and a page. Ctrl-C keeps the best so far; --resume goes on from "
        "there, to the same result.",
        epilog="examples:\n"
        "  python -m workbench tune disturbance_observer\n"
        "  python -m workbench tune parameter_estimator --budget 20 --out /tmp/quick\n"
        "  python -m workbench tune disturbance_observer --folds 5\n"
        "  python -m workbench tune disturbance_observer --cluster tcp://10.0.0.1:8786",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    tune.add_argument("estimator", choices=TUNABLE, metavar="ESTIMATOR", help=", ".join(TUNABLE))
    tune.add_argument(
        "--cases",
        nargs="+",
        type=Path,
        default=[Path("cases")],
        metavar="CASE",
        help="case folders, or folders of case folders (default: cases)",
    )
    tune.add_argument(
        "--fmu",
        type=Path,
        metavar="FILE",
        help="observer model (default: that of the estimator in fmus/fmi2)",
    )
    add_map(tune)
    tune.add_argument(
        "--budget",
        type=positive,
        default=100,
        metavar="GENERATIONS",
        help="most generations to search (default: %(default)s)",
    )
    tune.add_argument(
        "--population",
        type=positive,
        default=15,
        metavar="N",
        help="candidates per gain (default: %(default)s)",
    )
    tune.add_argument(
        "--seed", type=positive, default=1, help="of the search (default: %(default)s)"
    )
    tune.add_argument(
        "--workers",
        type=positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one per processor, %(default)s)",
    )
    tune.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster to work on instead; needs the extra [cluster]",
    )
    tune.add_argument(
        "--radius-error",
        type=float,
        default=RADIUS_ERROR,
        metavar="PERCENT",
        help="judge each case a second time with the wheel's radius off by this much, alternately "
        "to both sides, so that gains do not rely on radii that nobody knows as well; 0: only as "
        "recorded (default: %(default)s)",
    )
    tune.add_argument(
        "--timeout",
        type=positive,
        default=TIMEOUT,
        metavar="SECONDS",
        help="a candidate that takes longer ends its worker (default: %(default)s)",
    )
    tune.add_argument(
        "--folds",
        type=int,
        default=0,
        metavar="K",
        help="also tune K times without a K-th of the cases, and judge on these",
    )
    tune.add_argument("--resume", action="store_true", help="go on from the last checkpoint")
    tune.add_argument(
        "--full-evaluation",
        action="store_true",
        help="do not drop candidates that have lost; the result is the same",
    )
    tune.add_argument(
        "--live", action="store_true", help="draw convergence.png anew every 5 s while searching"
    )
    tune.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="where to write (default: results/tune/ESTIMATOR)",
    )
    tune.set_defaults(run=_tune)


def _tune(options: argparse.Namespace) -> int:
    cases = read_cases(options.cases)
    if options.folds and not 2 <= options.folds <= len(cases):
        raise InputError(
            where="command line, --folds",
            found=f"{options.folds} with {len(cases)} cases",
            expected="2 or more, and no more than there are cases",
            remedy="choose another number, or more cases with --cases",
        )
    if not 0.0 <= options.radius_error < 10.0:
        raise InputError(
            where="command line, --radius-error",
            found=f"{options.radius_error:g}",
            expected="a share of the radius in percent, from 0 to 10",
            remedy=f"choose another, or leave it out for {RADIUS_ERROR:g} %",
        )
    out = options.out or Path("results/tune") / options.estimator
    out.mkdir(parents=True, exist_ok=True)
    job, space, provenance = _prepare(options, cases)
    plan = Plan(options.budget, options.population, options.seed, not options.full_evaluation)
    print(
        f"{options.estimator}: {space.start.size} gains, {len(cases)} cases, at most "
        f"{plan.generations} generations of {plan.population * space.start.size} candidates",
        flush=True,
    )

    def tune(name: str, on: Sequence[int]) -> Search | None:
        return search(
            pool,
            job,
            space,
            on,
            plan,
            out / f"{name}.json",
            resume=options.resume,
            report=_reporter(plan, out / "convergence.png" if options.live else None),
            warn=lambda message: print(f"warning: {message}", file=sys.stderr, flush=True),
        )

    with _one_interruption(), closing(_pool(options, job)) as pool:
        reasoned = to_vector(job.gains)
        before = judge_gains(pool, job, [reasoned])[0]
        if not np.isfinite(before).all():
            raise FMUError(
                f"{provenance['fmu']['file']}: the FMU fails, hangs or diverges with the untuned "
                "gains, so there is nothing to start from; see 'python -m workbench simulate'"
            )
        found = tune("checkpoint", range(len(job.recordings)))
        if found is None:
            print("interrupted before the first generation was judged; nothing is written")
            return 130
        z_k = dict(zip((r.name for r in job.recordings), found.z_k.tolist(), strict=True))
        gains = format_gains(
            options.estimator,
            from_vector(job.gains, found.best),
            {
                **provenance,
                "z": found.z,
                "z_k": z_k,
                "generations": len(found.history) - 1,
                "interrupted": found.interrupted,
                "at_bound": _at_bound(job, space, found),
            },
        )
        # First of all the gains, so that nothing after them can lose them.
        if not _written(out / "gains.toml", gains):
            return 1
        folds: list[Fold] = []
        effects: list[Sensitivity] = []
        beside: dict[str, Vector] = {}
        if not found.interrupted:
            effects = sensitivities(pool, job, space, found)
            if options.estimator not in ("ekf", "ukf"):
                beside["ekf"] = untuned_filter(job)
            if options.folds:

                def without(number: int, on: Sequence[int]) -> Search | None:
                    print(f"fold {number + 1} of {options.folds}", flush=True)
                    return tune(f"checkpoint_fold{number + 1}", on)

                folds = cross_validate(pool, job, cases, reasoned, options.folds, without)
    z_k_before = dict(zip(z_k, before.tolist(), strict=True))
    summary = _summary(
        found, reasoned, z_k_before, z_k, folds, effects, beside, job, space, provenance
    )
    summary["work"]["folds"] = options.folds
    if not _written(out / "summary.json", json.dumps(summary, indent=2) + "\n"):
        return 1
    draw_convergence(found.history, out / "convergence.png")
    draw_cases(z_k_before, z_k, out / "cases.png")
    print(_format(found, z_k_before, z_k, folds, effects, summary))
    page = write_tuning_page(summary, out)
    print(f"written: {page}, gains.toml, summary and figures beside it")
    interrupted = found.interrupted or len(folds) < options.folds
    return 130 if interrupted else 0


@contextmanager
def _one_interruption() -> Iterator[None]:
    """Let the first Ctrl-C stop the search, and none after it the writing of its result."""

    def interrupt(number: int, frame: object) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _prepare(
    options: argparse.Namespace, cases: Sequence[Case]
) -> tuple[Job, SearchSpace, dict[str, Any]]:
    """What is tuned, where it is searched, and what it is made from."""
    default = FULL_OBSERVER if options.estimator == "parameter_estimator" else MINIMAL_OBSERVER
    path = options.fmu or default
    names = model_names(options.map, cases)
    weights = Weights()
    # A recording shows nothing slower than itself, and its samples carry nothing faster.
    slowest = 1.0 / max(case.time[-1] - case.time[0] for case in cases)
    fastest = 1.0 / max(float(np.median(np.diff(case.time))) for case in cases)
    with FMU(path, names) as fmu:
        gains = reasoned_gains(options.estimator, fmu)
        space = search_space(fmu, gains, slowest, fastest)
        provenance = {
            "workbench": version("wheelset-workbench"),
            "python": platform.python_version(),
            "packages": {p: version(p) for p in ("fmpy", "numpy", "scipy", "numba")},
            "fmu": {"file": fmu.path.name, "model": fmu.name, "sha256": fmu.sha256},
            "cases": [case.name for case in cases],
            "seed": options.seed,
            "population": options.population,
            "radius_error": options.radius_error / 100.0,
            "weights": asdict(weights),
        }
    judged = recordings(cases, options.radius_error / 100.0)
    job = Job(options.estimator, path.read_bytes(), names, gains, judged, weights)
    return job, space, provenance


def _pool(options: argparse.Namespace, job: Job) -> Pool:
    if options.cluster is None:
        return ProcessPool(job, options.workers, options.timeout)
    if find_spec("distributed") is None:
        raise InputError(
            where="command line, --cluster",
            found="no package 'distributed'",
            expected="the extra [cluster], which works with a Dask cluster",
            remedy="pip install -e '.[cluster]' -c constraints.txt",
        )
    from workbench.tuning.cluster import DaskPool

    try:
        return DaskPool(job, options.cluster, options.timeout)
    except (OSError, ValueError) as error:
        raise InputError(
            where=f"command line, --cluster {options.cluster}",
            found=f"no scheduler ({error})",
            expected="the address of a running one, such as tcp://10.0.0.1:8786",
            remedy="start one with 'dask scheduler', and workers with 'dask worker ADDRESS'",
        ) from None


def _reporter(plan: Plan, figure: Path | None) -> Callable[[Sequence[Generation]], None]:
    """Prints one line per generation; draws the convergence now and then if asked to."""
    begin = time.perf_counter()
    done: list[Generation] = []
    drawn = -np.inf

    def report(history: Sequence[Generation]) -> None:
        nonlocal drawn
        last, now = history[-1], time.perf_counter()
        done.append(last)
        rate = last.candidates / last.seconds
        left = (now - begin) / len(done) * (plan.generations + 1 - len(history))
        saved = 1.0 - sum(g.samples for g in done) / sum(g.of for g in done)
        failures = sum(last.unstable.values())
        print(
            f"[{len(history) - 1:>3}/{plan.generations}] z {last.z:.5f}, worst {last.worst} by "
            f"{last.margin:.1%} over {last.second}; {rate:.0f} evaluations/s, {saved:.0%} of work "
            f"saved, {failures} unstable, at most {left:.0f} s left",
            flush=True,
        )
        if figure is not None and now - drawn > _LIVE_PERIOD:
            draw_convergence(history, figure)
            drawn = now

    return report


def _at_bound(job: Job, space: SearchSpace, found: Search) -> list[str]:
    flags = space.at_bound(found.coordinates)
    return [name for name, flag in zip(gain_names(job.gains), flags, strict=True) if flag]


def _written(path: Path, text: str) -> bool:
    """Write a result; if that fails show it instead, so that it is not lost."""
    try:
        write_whole(path, text.encode())
    except OSError as error:
        print(text)
        print(f"error: {path} not written: {error.strerror}; its content is above", file=sys.stderr)
        return False
    return True


def _summary(
    found: Search,
    reasoned: Vector,
    before: dict[str, float],
    after: dict[str, float],
    folds: Sequence[Fold],
    effects: Sequence[Sensitivity],
    beside: Mapping[str, Vector],
    job: Job,
    space: SearchSpace,
    provenance: dict[str, Any],
) -> dict[str, Any]:
    history = found.history
    names = gain_names(job.gains)
    unstable = {name: sum(g.unstable.get(name, 0) for g in history) for name in after}
    bounds = space.gains(np.array([np.zeros(len(names)), np.ones(len(names))]))
    return {
        "estimator": job.estimator,
        "z": found.z,
        "z_reasoned": max(before.values()),
        "cases": {
            name: {
                "z_k": after[name],
                "z_k_reasoned": before[name],
                "unstable": unstable[name],
            }
            for name in after
        },
        "gains": {
            name: {
                "value": float(found.best[i]),
                "reasoned": float(reasoned[i]),
                "lower": float(bounds[0, i]),
                "upper": float(bounds[1, i]),
                "at_bound": bool(space.at_bound(found.coordinates)[i]),
            }
            for i, name in enumerate(names)
        },
        "sensitivity": {
            e.gain: {
                "less": _finite(e.less),
                "more": _finite(e.more),
                "without": _finite(e.without),
                "matters": e.matters,
            }
            for e in effects
        },
        "folds": [
            {name: _finite(v) if isinstance(v, float) else v for name, v in asdict(fold).items()}
            for fold in folds
        ],
        "beside": {
            name: {"z": _finite(float(z_k.max())), "worst": list(after)[int(z_k.argmax())]}
            for name, z_k in beside.items()
        },
        "work": {
            "generations": len(history) - 1,
            "candidates": sum(g.candidates for g in history),
            "seconds": sum(g.seconds for g in history),
            "saved": 1.0 - sum(g.samples for g in history) / sum(g.of for g in history),
            "crashed": sum(g.crashed for g in history),
            "interrupted": found.interrupted,
        },
        "convergence": [g.z for g in history],
        "provenance": provenance,
    }


def _finite(value: float) -> float | None:
    """JSON has no infinity."""
    return value if np.isfinite(value) else None


def _format(
    found: Search,
    before: dict[str, float],
    after: dict[str, float],
    folds: Sequence[Fold],
    effects: Sequence[Sensitivity],
    summary: dict[str, Any],
) -> str:
    width = max(map(len, after))
    lines = [f"{'case':<{width}} {'reasoned':>9} {'tuned':>9}  z_k, worst first"]
    for name in sorted(after, key=after.__getitem__, reverse=True):
        lines.append(f"{name:<{width}} {before[name]:>9.4f} {after[name]:>9.4f}")
    work = summary["work"]
    lines.append(
        f"z = {found.z:.5f} after {work['generations']} generations, {work['candidates']} "
        f"candidates, {work['saved']:.0%} of the work saved, {work['seconds']:.0f} s"
    )
    if bound := [name for name, gain in summary["gains"].items() if gain["at_bound"]]:
        lines.append(f"at a bound of the search: {', '.join(bound)}")
    if effects:
        idle = [effect.gain for effect in effects if not effect.matters]
        lines.append(f"gains that do not matter (z within 1 %): {', '.join(idle) or 'none'}")
    for name, one in summary["beside"].items():
        z = "diverges" if one["z"] is None else f"z = {one['z']:.5f}"
        lines.append(f"{name}, not tuned: {z}, worst {one['worst']}")
    for fold in folds:
        verdict = "better" if fold.tuned < fold.reasoned else "not better"
        lines.append(
            f"not seen: {', '.join(fold.cases)}: z {fold.tuned:.4f}, {verdict} than reasoned "
            f"{fold.reasoned:.4f}; seen: {fold.z:.4f}; error of Fx {fold.force:.2%}, reasoned "
            f"{fold.force_reasoned:.2%}"
        )
    return "\n".join(lines)
