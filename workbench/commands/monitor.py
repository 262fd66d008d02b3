"""`workbench monitor`: what has changed on a machine, over many recordings."""

import argparse
import time
from functools import partial

from workbench.commands.output import Done, Output, read_result
from workbench.files import claimed
from workbench.monitoring import monitor
from workbench.prepare import read_recorded
from workbench.provenance import models, software
from workbench.report.monitoring import write_monitored
from workbench.system import OBSERVER
from workbench.systems import load_system


def run(options: argparse.Namespace, output: Output) -> Done:
    """Estimate what is new, and watch all."""
    system = load_system(options.system)
    with claimed(options.out):
        begin = time.perf_counter()
        found = monitor(
            system,
            options.history,
            options.out,
            rate=options.false_alarms,
            workers=options.workers,
            read=read_recorded,
            step=partial(output.step, begin=begin),
        )
        provenance = {
            **software(("fmpy", "numpy", "scipy", "numba")),
            "system": system.name,
            "fmu": models(system, [OBSERVER])[OBSERVER],
        }
        figure = write_monitored(found, provenance, options.out)
    output.result(found.summary())
    output.result(f"to see: {figure}, data beside it")
    if found.interrupted:
        output.progress("interrupted: what was estimated is kept; run it again to go on")
    units = {"work": "J"}
    return Done(read_result(options.out / "summary.json"), units, 130 * found.interrupted)
