"""The tuning's section of `workbench bench`."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from workbench.cli.output import Output
from workbench.recordings.case import Case
from workbench.system.system import System


def bench_tuning(
    system: System, cases: Sequence[Case], case: Case, output: Output
) -> dict[str, Any]:
    """Measure, print the table, and return the same as numbers; times in seconds.

    Parameters
    ----------
    case : of these, on which single evaluations are timed.
    """
    from workbench.benchmark.tuning import (
        format_tuning,
        observe_memory,
        time_evaluations,
        time_workers,
    )

    evaluations = time_evaluations(case, system)
    workers = time_workers(cases, system)
    memory = observe_memory([case.source.parent for case in cases], system)
    output.result(f"\n{format_tuning(evaluations, workers, memory)}")
    return {
        "case": case.name,
        "evaluations": [{**asdict(row), "ratios": dict(row.ratios())} for row in evaluations],
        "workers": {**asdict(workers), "ratios": dict(workers.ratios())},
        "memory": asdict(memory),
    }
