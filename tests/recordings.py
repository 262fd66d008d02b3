"""Recordings of the virtual rig, each made once for each state of the rig and kept between runs.

A worker of the suite finds what another one has made, and so does the next run. Without the folder
nothing is different but the time.
"""

import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import platformdirs

from workbench.machines.wheelset import rig
from workbench.machines.wheelset.rig import Effects, Scenario, simulate, write_recording
from workbench.models import fmu

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "fmus" / "fmi2" / "Reference.fmu"
TWO_STOPS = ("03_dry_120_3.6", "08_wet_120_3.6")
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
    shelf = Path(platformdirs.user_cache_dir("observer-workbench")) / "recordings"
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


def write_beginnings(folder: Path, names: Sequence[str] = TWO_STOPS) -> Path:
    """Write 6 s each of two standard stops, first pressure and what follows, under these names."""
    for name, of in zip(names, TWO_STOPS, strict=True):
        (folder / name).mkdir(parents=True)
        shutil.copy(ROOT / "cases" / of / "case.toml", folder / name)
        table = pd.read_csv(ROOT / "cases" / of / "measured.csv").iloc[700:1900]
        table.to_csv(folder / name / "measured.csv", index=False)
    return folder
