"""The diagnosis as its power is measured: all effects of the library in one FMU, set by set."""

from collections.abc import Sequence
from pathlib import Path

from workbench.case import Case
from workbench.diagnosis import Diagnosis, Effect, read_effects
from workbench.diagnosis.evidence import Court
from workbench.diagnosis.extension import build, source
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.verdict import judge
from workbench.modelica import read_library
from workbench.system import OBSERVER, System

_NAME = "AllEffects"


def library_effects(system: System) -> tuple[Effect, ...]:
    """Effects of a system's library, which a diagnosis may find.

    Raises
    ------
    InputError
        If the library cannot be read.
    """
    return read_effects(read_library(system.library), system.model(OBSERVER).name)


def build_everything(system: System, effects: Sequence[Effect], path: Path) -> None:
    """Build the FMU of the observer model with every effect, at zero.

    Raises
    ------
    InputError
        If the library has errors.
    """
    library, base = read_library(system.library), system.model(OBSERVER).name
    text = source(
        library, base, _NAME, effects, {}, {}, "Observer model with every effect, at zero"
    )
    build(library, _NAME, text, path, every_platform=False)


def diagnose_set(
    system: System, effects: Sequence[Effect], everything: Path, cases: Sequence[Case]
) -> Diagnosis:
    """Diagnose one set of recordings, in this process alone."""
    with Court(everything, {}, cases, 1) as court:
        return judge(Fit(court, effects), effects, lambda _: None)
