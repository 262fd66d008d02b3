"""What a diagnosis of recordings finds between two effects, for tests of predictions of it."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from workbench.diagnosis import problem_of
from workbench.diagnosis.run import with_effects
from workbench.recordings.case import Case
from workbench.runtime.engine import silent
from workbench.studies.power.run import distances_in_set
from workbench.system.system import System


def parted(of: System, recordings: Sequence[Case], true: str, other: str) -> float:
    """Distance of two effects [standard deviations]; 0: the other is nearer."""
    with tempfile.TemporaryDirectory() as scratch:
        asked = with_effects(problem_of(of, recordings, [true, other]), Path(scratch), silent)
        _, shown = distances_in_set(*asked, true, [other])
    return max(0.0, shown[other])
