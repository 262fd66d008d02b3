"""A small run of `power` in a folder: three sets of two short stops; again goes on where it was."""

from collections.abc import Callable
from pathlib import Path

from tests.scenarios import short
from workbench.diagnosis import problem_of
from workbench.machines.wheelset.planting import PlantedStops
from workbench.runtime import resources
from workbench.runtime.engine import Engine
from workbench.studies.power import Planting, SetVerdict, diagnose_sets
from workbench.studies.power.run import PowerStudy
from workbench.system.registry import load_system

GROUPS = [
    (Planting("clean", 11, 0.0, {}, ()),),
    tuple(Planting("single", 12, x, {"fx_gain": 0.002 * x}, ("FxGain",)) for x in (8.0, 0.25)),
]


def study() -> PowerStudy:
    system = load_system("wheelset")
    stops = (short("01_dry_80_1.5", 30.0), short("03_dry_120_3.6", 40.0))
    rig = PlantedStops(stops, resources.fmus() / "fmi2" / "Reference.fmu")
    return PowerStudy(problem_of(system), rig)


def run(
    out: Path, report: Callable[[str], None], workers: int = 1
) -> tuple[list[SetVerdict], bool]:
    return diagnose_sets(GROUPS, study(), Engine(workers, report, out), seed=1, resume=True)


def main(out: Path) -> int:
    """Run, or go on; returns 130 after Ctrl-C, as the command does."""
    _, interrupted = run(out, print, 2)
    return 130 if interrupted else 0
