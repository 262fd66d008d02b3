"""Seconds of the first call of every observer, as a program: in a fresh cache, with compilation."""

import json
import sys
import time
from pathlib import Path

from workbench.benchmark.observers import opened
from workbench.observers import Estimator
from workbench.recordings.case import Case, read_case
from workbench.system.registry import load_system


def first_call(estimator: Estimator, case: Case) -> float:
    """Seconds of a run over the first two samples of a recording."""
    begin = time.perf_counter()
    estimator.run(case.time[:2], case.u[:2], case.y[:2])
    return time.perf_counter() - begin


if __name__ == "__main__":
    machine = load_system(sys.argv[1])
    recording = read_case(Path(sys.argv[2]), machine)
    with opened(machine, []) as estimators:
        print(json.dumps({e.name: first_call(e, recording) for e in estimators}))
