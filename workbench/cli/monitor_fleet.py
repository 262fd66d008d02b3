"""`workbench monitor --fleet`: many machines, one task for each, here or on a cluster."""

import argparse
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli.cluster import open_cluster
from workbench.cli.extras import require
from workbench.cli.output import CommandResult, Output
from workbench.errors import InputError
from workbench.pages.answer import Answer, Measure, with_answer
from workbench.pages.provenance import models, run_of, software
from workbench.recordings.csv import csv_text
from workbench.recordings.datasets import read_recorded
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder, write_json, write_whole
from workbench.runtime.pool import Pool
from workbench.studies.monitoring import MonitoringResult
from workbench.studies.monitoring.fleet import Fleet, MachineResult, open_fleet, watch_fleet
from workbench.studies.monitoring.report import write_monitoring
from workbench.system.registry import load_system
from workbench.system.system import OBSERVER, System

if TYPE_CHECKING:
    from workbench.runtime.cluster import DaskPool

_LIMIT = 3600.0  # [s] for one machine, whose recordings take hundredths of a second each


def provenance_of(system: System, history: Path) -> dict[str, Any]:
    """What was run, as every summary says it."""
    return {
        "run": run_of("monitor", system, {"history": history}),
        **software(("fmpy", "numpy", "scipy", "numba")),
        "system": system.name,
        "fmu": models(system, [OBSERVER])[OBSERVER],
    }


def run_fleet(options: argparse.Namespace, output: Output) -> CommandResult:
    """Watch all machines."""
    import pandas as pd

    if options.diagnose:
        raise InputError(
            where="command line, --diagnose",
            found="a fleet",
            expected="one machine, whose cause takes minutes",
            remedy="leave it out, and give it for the machine that raised an alarm",
        )
    system = load_system(options.system)
    if "://" in options.history:
        require("fsspec", "cluster", "which reads URLs", f"command line, {options.history}")
    provenance = provenance_of(system, Path(options.history))
    write = partial(_write_machine, provenance)
    fleet = Fleet(system, options.history, options.false_alarms, read_recorded, write)
    count = len(fleet.machines())  # wrong places are refused before workers start
    with locked_folder(options.out):
        begin = time.perf_counter()
        pool: Pool[Fleet] | DaskPool[Fleet]
        if options.cluster is None:
            pool = Pool(min(options.workers, count), open_fleet, fleet)
        else:
            pool = open_cluster(options.cluster, open_fleet, fleet, _LIMIT, system)
        try:
            engine = Engine(options.workers, output.progress, options.out)
            machines, interrupted = watch_fleet(fleet, engine, pool)
        finally:
            pool.close()
        summary = _summary(machines, provenance, time.perf_counter() - begin, interrupted)
        write_json(options.out / "fleet.json", summary)
        table = pd.DataFrame(summary["machines"])
        write_whole(options.out / "fleet.csv", csv_text(table, None))
    output.result(summary["answer"]["sentence"])
    for machine in machines:
        if machine.refusal:
            output.result(f"  {machine.machine}: no result: {machine.refusal}")
        elif machine.alarms:
            output.result(f"  {machine.machine}: {machine.alarms} alarms")
    output.result(f"to read: {options.out / 'fleet.csv'}, a folder for each machine beside it")
    return CommandResult(summary, {"seconds": "s"}, 130 * interrupted)


def _write_machine(provenance: dict[str, Any], result: MonitoringResult, out: Path) -> None:
    write_monitoring(result, provenance, out)  # in a worker


def _summary(
    machines: list[MachineResult], provenance: dict[str, Any], seconds: float, interrupted: bool
) -> dict[str, Any]:
    raised = [machine for machine in machines if machine.alarms]
    refused = [machine for machine in machines if machine.refusal]
    recordings = sum(machine.recordings for machine in machines)
    sentence = (
        f"{len(machines)} machines, {recordings} recordings: alarms of {len(raised)} machines"
    )
    sentence += f", no result of {len(refused)}" * bool(refused)
    headline = {
        "machines with alarms": Measure(len(raised), "1", "lower"),
        "machines without a result": Measure(len(refused), "1", "lower"),
    }
    entries = {
        "provenance": provenance,
        "recordings": recordings,
        "seconds": seconds,
        "machines": [
            {name: value for name, value in vars(machine).items() if name != "files"}
            for machine in machines
        ],
        "interrupted": interrupted,
    }
    return with_answer(Answer(f"{sentence}.", headline), entries)
