"""Observer workbench: what a machine does that its model does not, found in its recordings.

The flow: system, case -> FMU -> observer -> run -> score -> tuning, diagnosis -> report.
"""

import ast
import warnings
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # The public names. Each is imported from here when it is first used.
    from workbench.api import TuningWork as TuningWork
    from workbench.api import Work as Work
    from workbench.api import WrittenWork as WrittenWork
    from workbench.api import case_from_frame as case_from_frame
    from workbench.api import diagnose as diagnose
    from workbench.api import distance as distance
    from workbench.api import fit as fit
    from workbench.api import monitor as monitor
    from workbench.api import next_stop as next_stop
    from workbench.api import observe as observe
    from workbench.api import prepare_cases as prepare_cases
    from workbench.api import propose as propose
    from workbench.api import read_cases as read_cases
    from workbench.api import tune as tune
    from workbench.diagnosis import Outcome as Outcome
    from workbench.diagnosis.laws import Proposal as Proposal
    from workbench.errors import FMUError as FMUError
    from workbench.errors import InputError as InputError
    from workbench.models.fmu import FMU as FMU
    from workbench.observers import Gains as Gains
    from workbench.observers.run import Run as Run
    from workbench.pages.columns import read_estimates as read_estimates
    from workbench.recordings.case import Case as Case
    from workbench.studies.design import NextStop as NextStop
    from workbench.studies.distance import Distance as Distance
    from workbench.studies.distance import Effort as Effort
    from workbench.studies.fit import FitSettings as FitSettings
    from workbench.studies.fit.outcome import FitOutcome as FitOutcome
    from workbench.studies.monitoring import MonitoringResult as MonitoringResult
    from workbench.system.parts import FittedParameter as FittedParameter
    from workbench.system.plugins import Plugin as Plugin
    from workbench.system.registry import load_system as load_system
    from workbench.system.system import System as System
    from workbench.tuning import TuningResult as TuningResult

_MODULES = {
    name.name: node.module
    for node in ast.walk(ast.parse(Path(__file__).read_text(encoding="utf-8")))
    if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("workbench.")
    for name in node.names
}
__all__ = list(_MODULES)
_RENAMED = {"Monitored": "MonitoringResult", "Tuned": "TuningResult"}  # until the next version

if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        if name in _RENAMED:
            message = f"workbench.{name} is now workbench.{_RENAMED[name]}"
            warnings.warn(message, DeprecationWarning, stacklevel=2)
            return getattr(import_module(__name__), _RENAMED[name])
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = getattr(import_module(_MODULES[name]), name)
        return globals()[name]

    def __dir__() -> list[str]:
        return __all__
