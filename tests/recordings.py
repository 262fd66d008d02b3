"""Recordings of the virtual rig, each made once for each state of the rig and kept between runs.

A worker of the suite finds what another one has made, and so does the next run. Without the folder
nothing is different but the time.
"""

import contextlib
import hashlib
import os
import shutil
import tempfile
from pathlib import Path

import numpy as np
import platformdirs

from workbench.machines.wheelset import rig
from workbench.machines.wheelset.rig import Effects, Scenario, simulate, write_recording
from workbench.models import fmu

REFERENCE = Path(__file__).parent.parent / "fmus" / "fmi2" / "Reference.fmu"
RATE = 200  # [Hz]
_MOST = 256  # of 0.5 MB; a run of all tests makes some 150
_SOURCES = [
    *sorted(Path(rig.__file__).parent.glob("*.py")),
    *(Path(module.__file__) for module in (fmu,)),
    REFERENCE,
    Path(__file__),
]
_RIG = hashlib.sha256(b"".join(source.read_bytes() for source in _SOURCES)).hexdigest()


def record(scenario: Scenario, seed: int, effects: Effects, folder: Path, every: int = 100) -> None:
    """Write the recording of a stop, with the truth of every so many samples, to a new folder."""
    asked = repr((_RIG, np.__version__, scenario, seed, effects, every))
    shelf = Path(platformdirs.user_cache_dir("wheelset-workbench")) / "recordings"
    kept = shelf / hashlib.sha256(asked.encode()).hexdigest()
    with contextlib.suppress(OSError):
        shutil.copytree(kept, folder)
        os.utime(kept)  # of use, which decides what is dropped
        return
    write_recording(simulate(scenario, seed, effects, REFERENCE), effects, RATE, folder, every)
    # Another worker may keep the same at the same time: it appears whole or not.
    with contextlib.suppress(OSError):
        shelf.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(dir=shelf))
        shutil.copytree(folder, part, dirs_exist_ok=True)
        part.replace(kept)
        for old in sorted(shelf.iterdir(), key=lambda path: -path.stat().st_mtime)[_MOST:]:
            shutil.rmtree(old, ignore_errors=True)
