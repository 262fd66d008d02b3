"""Loops that a system's plugin has written another way, to measure the compiled laws against."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from workbench.benchmark.fmpy_loop import open_loop
from workbench.models.fmu import FMU
from workbench.observers import Gains
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.system.plugins import find_plugin, load
from workbench.system.system import System

Loop = Callable[..., object]  # of time, u and y, as Estimator.run


@contextmanager
def by_fmpy(
    estimator: str, fmu: FMU, system: System, gains: Gains
) -> Iterator[Callable[..., Any] | None]:
    """The loop of an estimator with FMPy's methods and numpy; None where there is none.

    That of the model alone is there for any system.
    """
    if estimator == OpenLoop.name:
        with open_loop(fmu, system) as alone:
            yield alone
        return
    module = _loops(system)
    if module is None or estimator not in module.LOOPS:
        yield None
        return
    with module.by_fmpy(estimator, fmu, system, gains) as loop:
        yield loop


def by_c(estimator: str, fmu: FMU, system: System, gains: Gains) -> Loop | None:
    """The loop of an estimator in C without FMI; None where there is none."""
    module = _loops(system)
    return module.by_c(estimator, fmu, system, gains) if module else None


def _loops(system: System) -> ModuleType | None:
    module: ModuleType | None = load(find_plugin(system.plugin).loops)
    return module
