"""A small run of `power` in a folder: three sets of two short stops; again goes on where it was."""

from dataclasses import replace
from pathlib import Path

from workbench.machines.wheelset.planting import PlantedStops
from workbench.machines.wheelset.rig import SCENARIOS, Scenario
from workbench.runtime import resources
from workbench.runtime.engine import Engine
from workbench.studies.power import Planting, diagnose_sets
from workbench.studies.power.diagnosing import library_effects
from workbench.studies.power.run import PowerStudy
from workbench.system.registry import load_system

GROUPS = [
    (Planting("clean", 11, 0.0, {}, ()),),
    tuple(Planting("single", 12, x, {"fx_gain": 0.002 * x}, ("FxGain",)) for x in (8.0, 0.25)),
]


def _short(name: str, speed: float) -> Scenario:
    """A standard stop from a lower speed [km/h]."""
    usual = SCENARIOS[name]
    return replace(usual, conditions=replace(usual.conditions, initial_speed=speed / 3.6))


def main(out: Path) -> int:
    """Run, or go on; returns 130 after Ctrl-C, as the command does."""
    system = load_system("wheelset")
    stops = (_short("01_dry_80_1.5", 30.0), _short("03_dry_120_3.6", 40.0))
    rig = PlantedStops(stops, resources.fmus() / "fmi2" / "Reference.fmu")
    _, interrupted = diagnose_sets(
        GROUPS,
        PowerStudy(system, rig, library_effects(system)),
        Engine(2, print, out),
        seed=1,
        resume=True,
    )
    return 130 if interrupted else 0
