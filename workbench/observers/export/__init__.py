"""Tuned observers as FMUs and SSP packages: they run in any tool, without Python.

This package needs the extra `[compiler]`.
"""

from workbench.observers.export.laws import EstimatorLaw, build_law
from workbench.observers.export.observer import ObserverModel, build_observer
from workbench.observers.export.package import write_package

__all__ = ["EstimatorLaw", "ObserverModel", "build_law", "build_observer", "write_package"]
