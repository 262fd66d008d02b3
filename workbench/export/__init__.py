"""Tuned observers as FMUs and SSP packages: they run in any tool, without Python.

This package needs the extra `[compiler]`.
"""

from workbench.export.observer import OBSERVERS, ObserverModel, build_observer
from workbench.export.package import write_package

__all__ = ["OBSERVERS", "ObserverModel", "build_observer", "write_package"]
