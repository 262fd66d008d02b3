"""The observers' section of `workbench bench`."""

from dataclasses import asdict
from typing import Any

from workbench.case import read_case, read_cases
from workbench.commands.arguments import FULL_OBSERVER, MINIMAL_OBSERVER
from workbench.resources import cases

CASES = cases()
CASE = "03_dry_120_3.6"


def bench_observers() -> dict[str, Any]:
    """Measure, print the table, and return the same as numbers; times in seconds."""
    from workbench.benchmark.observers import (
        format_observers,
        measure_compilation,
        measure_observers,
        measure_processes,
    )

    models = (MINIMAL_OBSERVER, FULL_OBSERVER)
    observers = measure_observers(read_case(CASES / CASE), *models)
    processes = measure_processes(read_cases([CASES]), *models)
    compilation = measure_compilation(*models)
    print(f"\n{format_observers(observers, processes, compilation)}")
    return {
        "case": CASE,
        "steps": [asdict(row) for row in observers],
        "processes": asdict(processes),
        "compilation": compilation,
    }
