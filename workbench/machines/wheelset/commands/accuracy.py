"""`workbench accuracy`: estimators against the truth of the virtual rig."""

from __future__ import annotations

import argparse
import time
from contextlib import ExitStack
from dataclasses import replace
from importlib.metadata import version
from typing import TYPE_CHECKING

from workbench.cli.arguments import Commands, add_pdf, add_recordings, add_system, example_case
from workbench.cli.output import CommandResult, Output, read_result
from workbench.errors import InputError
from workbench.runtime.files import locked_folder
from workbench.runtime.resources import own_version

if TYPE_CHECKING:
    from workbench.machines.wheelset.accuracy import StopAccuracy
    from workbench.recordings.case import Case
    from workbench.system.system import System


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    own = example_case()
    accuracy = commands.add_parser(
        "accuracy",
        help=text,
        description="Score estimators against the truth that 'workbench rig' writes beside each "
        "recording (truth.csv): force in the contact, slides, friction of the pads. "
        "No estimator reads it. Prints the worst stops (dry discs, wet discs, stops "
        "with a slide). Writes every stop (accuracy.csv), and with the worst ones "
        "accuracy.json. There, 'bands' has the factors with which 95 % bands contain "
        "95 % of the truth.",
        epilog="examples:\n"
        "  workbench accuracy\n"
        "  workbench rig --seed 1 --out /tmp/rig\n"
        "  workbench accuracy /tmp/rig --out /tmp/accuracy\n"
        "  workbench accuracy /tmp/rig1 /tmp/rig2  # of two seeds, distinguished by folder\n"
        f"  workbench accuracy {own} --estimator ekf --estimator ukf",
    )
    add_recordings(accuracy, out="results/accuracy")
    accuracy.add_argument(
        "--estimator",
        action="append",
        default=[],
        metavar="NAME",
        help="estimator to score, may be repeated (default: all)",
    )
    add_system(accuracy)
    add_pdf(accuracy)
    return accuracy


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Judge the estimators."""
    from workbench.machines.wheelset.accuracy import observe_stop, stop_accuracy
    from workbench.machines.wheelset.accuracy_report import (
        format_accuracy,
        write_accuracies,
        write_accuracy,
        write_accuracy_page,
    )
    from workbench.machines.wheelset.truth import read_truth
    from workbench.observers import choose, estimators_of
    from workbench.observers.estimators.block_filter.filter import BlockKalmanFilter
    from workbench.observers.gains import usual_gains
    from workbench.pages.provenance import run_of, sources
    from workbench.system.registry import load_system, open_model

    system = load_system(options.system)
    # Of a wheelset, which has no like parts, the block filter is the extended one.
    usual = [name for name in estimators_of(system) if name != BlockKalmanFilter.name]
    chosen = choose(system, options.estimator or usual)
    cases = _stops(options, system)
    # All of them before the first run, so that a missing one is refused at once.
    truths = [read_truth(case, system) for case in cases]
    stops: list[StopAccuracy] = []
    begin = time.perf_counter()
    with locked_folder(options.out), ExitStack() as stack:
        roles = dict.fromkeys(estimator.role for estimator in chosen.values())
        models = {role: stack.enter_context(open_model(system, role)) for role in roles}
        gains, estimators = {}, []
        for name, estimator in chosen.items():
            fmu = models[estimator.role]
            gains[name] = usual_gains(estimator, fmu, system)
            estimators.append(estimator(fmu, system, gains[name]))
        provenance = {
            "run": run_of("accuracy", system, sources(cases)),
            "workbench": own_version(),
            "packages": {p: version(p) for p in ("fmpy", "numpy", "scipy", "numba")},
            "fmus": [
                {"file": fmu.path.name, "model": fmu.name, "sha256": fmu.sha256}
                for fmu in models.values()
            ],
            "gains": {name: gain.source for name, gain in gains.items() if gain.names},
        }
        output.stage("preparing the observers' loops (compiled once, up to a minute)")
        for case, truth in zip(cases, truths, strict=True):
            stops.append(stop_accuracy(observe_stop(case, truth, estimators, system)))
            output.step(len(stops), len(cases), case.name, begin)
        output.result(format_accuracy(stops))
        write_accuracies(stops, options.out / "accuracy.csv")
        write_accuracy(system, stops, provenance, options.out / "accuracy.json")
        summary = read_result(options.out / "accuracy.json")
        page = write_accuracy_page(system, summary, stops, options.out)
    output.result(f"to read: {page}; every stop: accuracy.csv, accuracy.json beside it")
    units = {name: quantity["unit"] for name, quantity in summary["quantities"].items()}
    return CommandResult(summary, units, page=page)


def _stops(options: argparse.Namespace, system: System) -> list[Case]:
    """The stops that are asked for; where folders hold several, each with its folder's name.

    A rig calls its stops the same whatever its seed.
    """
    from workbench.cli.inputs import given_cases

    if len(options.cases) < 2:
        return given_cases(options, system)
    stops: dict[str, Case] = {}
    for folder in options.cases:
        alone = argparse.Namespace(**{**vars(options), "cases": [folder]})
        before = "" if (folder / "case.toml").exists() else f"{folder.resolve().name}/"
        for case in given_cases(alone, system):
            name = before + case.name
            if name in stops:
                raise InputError(
                    where=str(case.source),
                    found=f"a second stop '{name}' beside {stops[name].source}",
                    expected="a different name for each stop, because results are kept by name",
                    remedy="rename one of the folders, or give it once",
                )
            stops[name] = replace(case, name=name)
    return list(stops.values())
