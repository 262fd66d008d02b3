"""`workbench accuracy`: estimators against the truth of the virtual rig."""

import argparse
import time
from contextlib import ExitStack
from importlib.metadata import version

from workbench.commands.arguments import (
    Commands,
    add_recordings,
    add_system,
    example_case,
    given_cases,
)
from workbench.files import claimed
from workbench.observers import choose, estimators
from workbench.observers.gains_file import usual_gains
from workbench.systems import load_system, open_model
from workbench.wheelset.accuracy import StopAccuracy, observe_stop, stop_accuracy
from workbench.wheelset.accuracy_report import format_accuracy, write_accuracies, write_accuracy
from workbench.wheelset.truth import read_truth


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    own = example_case()
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
        f"  python -m workbench accuracy {own} --estimator ekf --estimator ukf",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_recordings(accuracy, out="results/accuracy")
    accuracy.add_argument(
        "--estimator",
        action="append",
        default=[],
        metavar="NAME",
        help="judge this one, may be repeated (default: all)",
    )
    add_system(accuracy)
    accuracy.set_defaults(run=_accuracy)


def _accuracy(options: argparse.Namespace) -> int:
    system = load_system(options.system)
    chosen = choose(system, options.estimator or list(estimators(system)))
    cases = given_cases(options.cases, system)
    # All of them before the first run, so that one that is missing is told at once.
    truths = [read_truth(case, system) for case in cases]
    stops: list[StopAccuracy] = []
    begin = time.perf_counter()
    with claimed(options.out), ExitStack() as stack:
        roles = dict.fromkeys(kind.role for kind in chosen.values())
        models = {role: stack.enter_context(open_model(system, role)) for role in roles}
        gains = {name: usual_gains(one, models[one.role], system) for name, one in chosen.items()}
        ready = [kind(models[kind.role], system, gains[name]) for name, kind in chosen.items()]
        provenance = {
            "workbench": version("wheelset-workbench"),
            "packages": {p: version(p) for p in ("fmpy", "numpy", "scipy", "numba")},
            "fmus": [
                {"file": fmu.path.name, "model": fmu.name, "sha256": fmu.sha256}
                for fmu in models.values()
            ],
            "gains": {name: one.source for name, one in gains.items() if one.names},
        }
        print("preparing the observers' loops (compiled once, up to a minute)", flush=True)
        for case, truth in zip(cases, truths, strict=True):
            stops.append(stop_accuracy(observe_stop(case, truth, ready, system)))
            print(
                f"[{len(stops):>3}/{len(cases)}] {case.name:<28} "
                f"{time.perf_counter() - begin:5.1f} s",
                flush=True,
            )
        print(format_accuracy(stops))
        write_accuracies(stops, options.out / "accuracy.csv")
        write_accuracy(stops, provenance, options.out / "accuracy.json")
    print(f"every stop: {options.out / 'accuracy.csv'}, accuracy.json beside it")
    return 0
