"""`workbench monitor`: what has changed on a machine, over many recordings."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli.arguments import Commands, add_flags, add_out, add_run, add_system, share
from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output, read_result
from workbench.errors import InputError
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder

if TYPE_CHECKING:
    from workbench.studies.monitoring import MonitoringResult

WORKERS_NEED = ("workbench.studies.monitoring", "workbench.models.loops_ready")


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "monitor",
        help=text,
        description="Estimate the quantities of the system file from each recording of one "
        "machine, by date. Report which quantity has changed, since when, and by how "
        "much. What the folder of results knows is not estimated again: run it after "
        "each new "
        "recording, or after many. Writes estimates.csv, alarms.csv, work.csv, summary.json, a "
        "figure (PNG, SVG), the page (index.html), and its state (state.sqlite). Exit status 0 "
        "with or without alarms.",
        epilog="examples:\n"
        "  workbench monitor my_recordings --system my_machine --out results/mine\n"
        "  workbench monitor stops --system train --false-alarms 0.001\n"
        "  workbench monitor trains --system train --fleet",
    )
    parser.add_argument(
        "history",
        metavar="HISTORY",
        help="folder with a folder for each recording of one machine: cases, or files that "
        "'workbench prepare' reads. With --fleet, a folder or URL with such a folder for "
        "each machine",
    )
    add_system(parser)
    parser.add_argument(
        "--false-alarms",
        type=share,
        default=0.01,
        metavar="X",
        help="false alarms of a healthy machine per recording, all quantities together "
        "(default: %(default)s, one in a hundred recordings)",
    )
    flags = {
        "--diagnose": "also diagnose the last recordings, with a machine calibrated on those "
        "before the change (into OUT/cause). Takes minutes, needs the extra [compiler]",
        "--fleet": "watch many machines, one task for each. HISTORY may be a URL that fsspec "
        "reads, such as s3://bucket/fleet (extra [cluster])",
    }
    add_flags(parser, flags)
    parser.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="with --fleet: scheduler of a Dask cluster to work on instead; needs the extra "
        "[cluster]",
    )
    add_out(parser, "results/monitor")
    add_run(parser)
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Estimate what is new, and watch all."""
    from workbench.cli.monitor_fleet import provenance_of, run_fleet
    from workbench.recordings.datasets import read_recorded
    from workbench.studies.monitoring import monitor
    from workbench.studies.monitoring.report import write_monitoring
    from workbench.system.registry import load_system

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
        engine = Engine(options.workers, output.progress, options.out)
        result = monitor(system, history, engine, rate=options.false_alarms, read=read_recorded)
        provenance = provenance_of(system, history)
        page = write_monitoring(result, provenance, options.out)
        output.result(result.summary())
        output.result(f"to read: {page}, data and figure beside it")
        if result.interrupted:
            output.progress("interrupted: what was estimated is kept; run it again to go on")
        summary = read_result(options.out / "summary.json")
        if options.diagnose and result.changes and not result.interrupted:
            summary["cause"] = _diagnose_change(options, output, result, provenance)
    return CommandResult(summary, {"work": "J"}, 130 * result.interrupted, page)


def _diagnose_change(
    options: argparse.Namespace,
    output: Output,
    result: MonitoringResult,
    provenance: dict[str, Any],
) -> dict[str, Any]:
    from workbench.diagnosis import diagnose, problem_of
    from workbench.diagnosis.report import write_diagnosis
    from workbench.recordings.datasets import read_recorded
    from workbench.studies.monitoring import known_from_before, recordings_after

    system, out = known_from_before(result), options.out / "cause"
    names = recordings_after(result)
    output.stage(f"cause of the change, from {', '.join(names)}")
    cases = [read_recorded(Path(options.history) / name, system) for name in names]
    engine = Engine(options.workers, output.stage, out)
    outcome = diagnose(problem_of(system, cases), engine)
    page = write_diagnosis(outcome, provenance, out)
    output.result(outcome.summary())
    output.result(f"to read: {page}")
    return read_result(out / "summary.json")
