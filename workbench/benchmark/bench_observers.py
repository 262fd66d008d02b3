"""The observers' section of `workbench bench`."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from workbench.cli.output import Output
from workbench.recordings.case import Case
from workbench.system.system import System


def bench_observers(
    system: System, cases: Sequence[Case], case: Case, output: Output
) -> dict[str, Any]:
    """Measure, print the table, and return the same as numbers; times in seconds.

    Parameters
    ----------
    case : of these, on which single observers are timed.
    """
    from workbench.benchmark.horizon import format_horizon, time_horizon
    from workbench.benchmark.observers import (
        format_observers,
        time_compilation,
        time_observers,
        time_processes,
    )

    observers = time_observers(case, system)
    processes = time_processes(cases, system)
    compilation = time_compilation(system, case)
    horizon = time_horizon(case, system)
    output.result(
        f"\n{format_observers(observers, processes, compilation)}\n{format_horizon(horizon)}"
    )
    return {
        "case": case.name,
        "steps": [asdict(row) for row in observers],
        "processes": asdict(processes),
        "compilation": compilation,
        "horizon": {**asdict(horizon), "ratios": horizon.ratios()},
    }
