"""`workbench monitor`: what has changed on a machine, over many recordings."""

import argparse
import time
from functools import partial
from pathlib import Path
from typing import Any

from workbench.cli.extras import require_compiler
from workbench.cli.monitor_fleet import provenance_of, run_fleet
from workbench.cli.output import CommandResult, Output, read_result
from workbench.diagnosis import Problem, catalogue, diagnose
from workbench.diagnosis.report import write_diagnosis
from workbench.errors import InputError
from workbench.models.modelica import read_library
from workbench.recordings.datasets import read_recorded
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder
from workbench.studies.monitoring import MonitoringResult, monitor
from workbench.studies.monitoring.cause import known_from_before, recordings_after
from workbench.studies.monitoring.report import write_monitoring
from workbench.system.registry import load_system


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Estimate what is new, and watch all."""
    if options.fleet:
        return run_fleet(options, output)
    if options.cluster is not None:
        raise InputError(
            where="command line, --cluster",
            found="one machine, whose recordings processes of this one estimate",
            expected="a fleet",
            remedy="add --fleet, or leave --cluster out",
        )
    system, history = load_system(options.system), Path(options.history)
    if options.diagnose:
        require_compiler()
    with locked_folder(options.out):
        begin = time.perf_counter()
        found = monitor(
            system,
            history,
            Engine(options.workers, out=options.out),
            rate=options.false_alarms,
            read=read_recorded,
            step=partial(output.step, begin=begin),
        )
        provenance = provenance_of(system, history)
        page = write_monitoring(found, provenance, options.out)
        output.result(found.summary())
        output.result(f"to read: {page}, data and figure beside it")
        if found.interrupted:
            output.progress("interrupted: what was estimated is kept; run it again to go on")
        result = read_result(options.out / "summary.json")
        if options.diagnose and found.changes and not found.interrupted:
            result["cause"] = _cause(options, output, found, provenance)
    return CommandResult(result, {"work": "J"}, 130 * found.interrupted, page)


def _cause(
    options: argparse.Namespace, output: Output, found: MonitoringResult, provenance: dict[str, Any]
) -> dict[str, Any]:
    """Diagnose what has changed; returns the summary of the diagnosis."""
    system, out = known_from_before(found), options.out / "cause"
    library = read_library(system.library)
    effects = catalogue(system, library)
    names = recordings_after(found)
    output.stage(f"cause of the change, from {', '.join(names)}")
    cases = [read_recorded(Path(options.history) / name, system) for name in names]
    engine = Engine(options.workers, output.stage, out)
    outcome = diagnose(Problem(system, cases, library, effects), engine)
    page = write_diagnosis(outcome, provenance, out, options.workers)
    output.result(outcome.summary())
    output.result(f"to read: {page}")
    return read_result(out / "summary.json")
