"""The diagnosis as its power is measured: all effects of the library in one FMU, set by set."""

from collections.abc import Sequence
from pathlib import Path

from workbench import diagnosis
from workbench.case import Case
from workbench.diagnosis import Diagnosis, Effect, catalogue
from workbench.diagnosis.evidence import Simulations
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.verdict import conclude
from workbench.modelica import read_library
from workbench.system import System


def library_effects(system: System) -> tuple[Effect, ...]:
    """Effects of a system's library, which a diagnosis may find.

    Raises
    ------
    InputError
        If the library cannot be read.
    """
    return catalogue(system, read_library(system.library))


def build_everything(system: System, effects: Sequence[Effect], path: Path) -> None:
    """Build the FMU of the observer model with every effect, at zero.

    Raises
    ------
    InputError
        If the library has errors.
    """
    diagnosis.build_everything(system, read_library(system.library), effects, path)


def diagnose_set(
    system: System, effects: Sequence[Effect], everything: Path, cases: Sequence[Case]
) -> Diagnosis:
    """Diagnose one set of recordings, in this process alone."""
    with Simulations(everything, system, system.given, cases, 1) as simulations:
        return conclude(Fit(simulations, effects), effects, lambda _: None)
