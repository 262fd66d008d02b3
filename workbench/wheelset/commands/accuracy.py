"""`workbench accuracy`: estimators against the truth of the virtual rig."""

import argparse
import time
from importlib.metadata import version

from workbench.wheelset.accuracy import StopAccuracy, judge, read_truth, stop_accuracy
from workbench.case import read_cases
from workbench.commands.arguments import FULL_OBSERVER, MINIMAL_OBSERVER, Commands, add_recordings
from workbench.fmu import FMU
from workbench.observers import ESTIMATORS, make_estimators
from workbench.wheelset.accuracy_report import format_accuracy, write_accuracies, write_accuracy
from workbench.tuning import default_settings


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    accuracy = commands.add_parser(
        "accuracy",
        description="Judge estimators against the truth (truth.csv) that 'workbench rig' writes "
        "beside each recording and no estimator reads: force in the contact, a slide, friction of "
        "the pads. Prints the worst stops (dry discs, wet discs, stops whose truth has a slide); "
        "writes every stop (accuracy.csv) and the same with the worst (accuracy.json).",
        epilog="examples:\n"
        "  python -m workbench accuracy\n"
        "  python -m workbench rig --seed 1 --out /tmp/rig\n"
        "  python -m workbench accuracy /tmp/rig --out /tmp/accuracy\n"
        "  python -m workbench accuracy cases/09_wet_160_4.2_wsp --estimator ekf --estimator ukf",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_recordings(accuracy, out="results/accuracy")
    accuracy.add_argument(
        "--estimator",
        action="append",
        default=[],
        choices=ESTIMATORS,
        metavar="NAME",
        help=f"judge this one, may be repeated (default: all): {', '.join(ESTIMATORS)}",
    )
    accuracy.set_defaults(run=_accuracy)


def _accuracy(options: argparse.Namespace) -> int:
    cases = read_cases(options.cases)
    chosen = [name for name in ESTIMATORS if name in (options.estimator or ESTIMATORS)]
    stops: list[StopAccuracy] = []
    begin = time.perf_counter()
    with FMU(MINIMAL_OBSERVER) as minimal, FMU(FULL_OBSERVER) as full:
        roller_radius = minimal.defaults["rR"]
        # All of them before the first run, so that one that is missing is told at once.
        truths = [read_truth(case, roller_radius) for case in cases]
        settings, tuned = default_settings(minimal, full)
        estimators = make_estimators(chosen, minimal, full, settings)
        provenance = {
            "workbench": version("wheelset-workbench"),
            "packages": {p: version(p) for p in ("fmpy", "numpy", "scipy", "numba")},
            "fmus": [
                {"file": fmu.path.name, "model": fmu.name, "sha256": fmu.sha256}
                for fmu in (minimal, full)
            ],
            "tuned": {name: file for name, file in tuned.items() if name in chosen},
        }
        print("preparing the observers' loops (compiled once, up to a minute)", flush=True)
        for case, truth in zip(cases, truths, strict=True):
            stops.append(stop_accuracy(judge(case, truth, estimators, roller_radius)))
            print(
                f"[{len(stops):>3}/{len(cases)}] {case.name:<28} "
                f"{time.perf_counter() - begin:5.1f} s",
                flush=True,
            )
    options.out.mkdir(parents=True, exist_ok=True)
    write_accuracies(stops, options.out / "accuracy.csv")
    write_accuracy(stops, provenance, options.out / "accuracy.json")
    print(format_accuracy(stops))
    print(f"every stop: {options.out / 'accuracy.csv'}, accuracy.json beside it")
    return 0
