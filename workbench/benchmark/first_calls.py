"""Seconds of the first call of every observer, as a program: in a fresh cache, with compilation."""

import json
import sys
import time
from pathlib import Path

import numpy as np

from workbench.fmu import FMU
from workbench.observers import Estimator, all_estimators, reasoned_settings


def first_call(estimator: Estimator) -> float:
    """Seconds of a run over two samples at 20 m/s."""
    time_, u, y = np.array([0.0, 0.001]), np.zeros((2, 2)), np.tile([43.5, 28.6], (2, 1))
    begin = time.perf_counter()
    estimator.run(time_, u, y)
    return time.perf_counter() - begin


if __name__ == "__main__":
    with FMU(Path(sys.argv[1])) as minimal, FMU(Path(sys.argv[2])) as full:
        estimators = all_estimators(minimal, full, reasoned_settings(minimal, full))
        print(json.dumps({e.name: first_call(e) for e in estimators}))
