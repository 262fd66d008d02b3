"""Estimators, stage 3: each turns measured inputs and outputs into an estimate, step by step.

One file each in `estimators`; a new one is found by itself. A system's plugin may have more.
"""

import pkgutil
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from types import ModuleType

from workbench.errors import require_known
from workbench.observers.contract import Estimate, Estimator
from workbench.observers.gains import Gains, SearchSpace
from workbench.system.plugins import find_plugin
from workbench.system.system import System

__all__ = ["Estimate", "Estimator", "Gains", "SearchSpace", "choose", "estimators_of", "label"]

_UNKNOWN = "no estimator of this name"


def estimators_of(system: System) -> dict[str, type[Estimator]]:
    """All estimators that run on a system, by name, in the order of tables."""
    packages = (f"{__name__}.estimators", find_plugin(system.plugin).estimators)
    kinds = [estimator for package in packages if package for estimator in _estimators(package)]
    known = {
        estimator.name: estimator
        for estimator in sorted(kinds, key=lambda estimator: estimator.rank)
    }
    require_known(
        system.bands,
        known,
        where=lambda name: f"{system.source}, [bands.{name}]",
        found=_UNKNOWN,
    )
    return known


def choose(system: System, names: Sequence[str]) -> dict[str, type[Estimator]]:
    """Estimators by name, in the order of tables; the standard ones if none is named.

    Of these, such as correct a model by its quantities alone are left out if there are none.
    """
    known = estimators_of(system)
    idle = {name for name, estimator in known.items() if estimator.by_quantities}
    idle = set() if system.estimated else idle
    require_known(names, known, where="estimator '{}'".format, found=_UNKNOWN)
    return {
        name: estimator
        for name, estimator in known.items()
        if (name in names if names else estimator.standard and name not in idle)
    }


def label(name: str, system: System) -> str:
    """Name of an estimator for people."""
    known = estimators_of(system)
    return known[name].label if name in known else name.replace("_", " ")


@cache
def _estimators(package: str) -> tuple[type[Estimator], ...]:
    """Estimators that the modules of a package define."""
    parent = import_module(package)
    modules = [
        import_module(module.name)
        for module in pkgutil.walk_packages(parent.__path__, f"{package}.")
    ]
    return tuple(estimator for module in modules for estimator in _classes_of(module))


def _classes_of(module: ModuleType) -> list[type[Estimator]]:
    return [
        var
        for var in vars(module).values()
        if isinstance(var, type)
        and issubclass(var, Estimator)
        and var.__module__ == module.__name__
        and hasattr(var, "name")
    ]
