"""The tuning's section of `workbench bench`."""

from dataclasses import asdict
from typing import Any

from workbench.case import read_case, read_cases
from workbench.commands.arguments import FULL_OBSERVER, MINIMAL_OBSERVER
from workbench.commands.bench_observers import CASE, CASES


def bench_tuning() -> dict[str, Any]:
    """Measure, print the table, and return the same as numbers; times in seconds."""
    from workbench.benchmark.tuning import (
        format_tuning,
        measure_evaluations,
        measure_memory,
        measure_workers,
    )

    evaluations = measure_evaluations(read_case(CASES / CASE), MINIMAL_OBSERVER, FULL_OBSERVER)
    workers = measure_workers(read_cases([CASES]), MINIMAL_OBSERVER)
    memory = measure_memory([CASES], MINIMAL_OBSERVER)
    print(f"\n{format_tuning(evaluations, workers, memory)}")
    return {
        "case": CASE,
        "evaluations": [{**asdict(row), "ratios": dict(row.ratios())} for row in evaluations],
        "workers": {**asdict(workers), "ratios": dict(workers.ratios())},
        "memory": asdict(memory),
    }
