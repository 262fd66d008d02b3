"""What many instances and many calls of an FMU cost, and whether it survives them."""

import gc
import os
import timeit
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench.models.checks.excitation import excite, real_variables
from workbench.models.checks.result import (
    INSTANCES,
    LOADS,
    MEMORY,
    SAMPLE,
    TIME_DERIVATIVES,
    TIME_GET,
    TIME_SET,
    TIME_STEP,
    CheckResult,
)
from workbench.models.fmu import FMU

# A tenth of these leaks 0.05 MB at the limit, some pages of memory.
_MEMORY_SHOWS = 500


def endure(path: Path, instantiations: int) -> Iterator[int | CheckResult]:
    """Make instances one after the other, of one loaded library and each of its own."""
    growth = []
    batch = max(instantiations // 10, 1)
    with FMU(path) as fmu:
        for question, reload in ((INSTANCES, False), (LOADS, True)):
            memory = []
            for n in range(1, instantiations + 1):
                fmu.renew(reload=reload)
                fmu.start({})
                fmu.derivatives()
                yield n
                if n % batch == 0:
                    memory.append(_resident_memory())
            # A leak grows in every batch, while allocators take a megabyte once in a while.
            growth += (
                [float(np.median(np.diff(memory[-7:]))) * 1000 / batch] if len(memory) > 1 else []
            )
            yield replace(question, passed=True, value=instantiations, limit=instantiations)
    if instantiations < _MEMORY_SHOWS:
        yield replace(MEMORY, reason=f"not tried: shows from {_MEMORY_SHOWS} instantiations on")
        return
    if np.isnan(growth).any():
        yield replace(MEMORY, reason="not tried: this system does not tell a process's memory")
        return
    passed = max(growth) <= (MEMORY.limit or 0.0)
    reason = "freed instances leave memory behind; reset one instance instead of making new ones"
    yield replace(MEMORY, passed=passed, value=max(growth), reason="" if passed else reason)


def _resident_memory() -> float:
    """Resident memory of this process [MB]; NaN where the system has no /proc."""
    gc.collect()
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except FileNotFoundError:
        return float("nan")
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def time_calls(path: Path, instantiations: int) -> Iterator[CheckResult]:
    """Time what an observer calls at every sample."""
    with FMU(path) as fmu:
        excitation = excite(fmu)
        outputs = real_variables(fmu, fmu.outputs)
        # New values at each call, because FMUs keep the results of the last ones.
        points = (excitation.states, excitation.states + 1e-6 * excitation.nominal)
        levels = (excitation.first, excitation.second)

        def at_points(read: Callable[[], object]) -> None:
            for point in points:
                fmu.set_states(point)
                read()

        def at_levels() -> None:
            for level in levels:
                fmu.set(excitation.inputs, level)

        tasks: tuple[tuple[CheckResult, Callable[[], None]], ...] = (
            (TIME_GET, lambda: at_points(lambda: fmu.get(outputs))),
            (TIME_SET, at_levels),
            (TIME_DERIVATIVES, lambda: at_points(fmu.derivatives)),
            (TIME_STEP, lambda: at_points(lambda: fmu.step(1e-9))),
        )
        for question, task in tasks:
            timer = timeit.Timer(task)
            number = 1 + int(0.02 / max(timer.timeit(3) / 3, 1e-6))  # 20 ms
            # The least of several: other load on the machine only adds.
            time = min(timer.repeat(5, number)) / number / len(points) * 1e6
            passed = time <= SAMPLE
            reason = "" if passed else "slower than samples come in at 200 Hz; simplify the model"
            yield replace(question, passed=passed, value=time, reason=reason)
