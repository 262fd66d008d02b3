"""The observers written other ways, which the compiled laws are measured against."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from workbench.machines.wheelset.benchmark import fmpy_loops
from workbench.models.fmu import FMU
from workbench.observers import Estimate, Gains
from workbench.system.system import System

LOOPS = {
    "disturbance_observer": fmpy_loops.disturbance_observer,
    "parameter_estimator": fmpy_loops.parameter_estimator,
    "ekf": fmpy_loops.extended_kalman_filter,
    "ukf": fmpy_loops.unscented_kalman_filter,
}


@contextmanager
def by_fmpy(
    estimator: str, fmu: FMU, system: System, gains: Gains
) -> Iterator[Callable[..., Estimate]]:
    """The loop of an estimator with FMPy's methods; it is called with time, u and y."""
    with fmpy_loops.FMPyModel(fmu.path, system) as model:
        yield partial(LOOPS[estimator], model, gains)


def by_c(estimator: str, fmu: FMU, system: System, gains: Gains) -> Callable[..., object] | None:
    """The loop of an estimator in plain C, where there is one; it needs the extra [compiler]."""
    if estimator != "disturbance_observer":
        return None
    from workbench.machines.wheelset.benchmark.c_loop import CLoop

    return CLoop(fmu, system, gains).run
