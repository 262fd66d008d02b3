"""Tuned observers as FMUs and SSP packages: they run in any tool, without Python.

This package needs the extra `[compiler]`.
"""

from workbench.observers.export.laws import build_observer, model_name
from workbench.observers.export.package import write_package

__all__ = ["build_observer", "model_name", "write_package"]
