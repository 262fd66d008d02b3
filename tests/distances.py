"""What a diagnosis of recordings finds between two effects, for tests of predictions of it."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from workbench.diagnosis import choose, read_effects
from workbench.models.modelica import read_library
from workbench.recordings.case import Case
from workbench.studies.power.diagnosing import build_everything, distances_in_set
from workbench.system.system import OBSERVER, System


def parted(of: System, recordings: Sequence[Case], true: str, other: str) -> float:
    """Distance of two effects [standard deviations]; 0: the other is nearer."""
    library = read_library(of.library)
    effects = choose([true, other], read_effects(library, of.models[OBSERVER].name))
    with tempfile.TemporaryDirectory() as scratch:
        everything = Path(scratch) / "AllEffects.fmu"
        build_everything(of, effects, everything)
        _, shown = distances_in_set(of, effects, everything, recordings, true, [other])
    return max(0.0, shown[other])
