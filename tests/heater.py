"""A system for tests: a heated block in a casing, whose temperature is not measured."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from workbench import case_from_frame
from workbench.diagnosis import Outcome, diagnose, read_effects
from workbench.diagnosis.problem import Problem
from workbench.models.modelica import read_library
from workbench.recordings.case import Case
from workbench.runtime.engine import Engine
from workbench.system.system import System

from .built import declare, machine

NOISE = 0.05  # [K]


def system(folder: Path, sensor: str = "", effect: str = "") -> System:
    """The heater, with more keys of its sensor, or with one more effect in Modelica."""
    library, file = machine("heater", sensor=sensor)
    return declare(folder, library.replace("  model Draught", effect + "  model Draught"), file)


def cases(of: System, frames: Sequence[pd.DataFrame]) -> list[Case]:
    return [case_from_frame(of, frame, name=f"{k:02}") for k, frame in enumerate(frames)]


def diagnosed(
    of: System, fitted: Sequence[Case], out: Path, held_out: Sequence[Case] = ()
) -> Outcome:
    library = read_library(of.library)
    effects = read_effects(library, "Observer")
    return diagnose(Problem(of, fitted, library, effects, held_out), Engine(out=out))
