"""The next stop on recordings of an independent simulator: what was proposed is among them."""

from pathlib import Path

import pytest

from workbench.recordings.case import read_cases
from workbench.runtime.engine import ALONE
from workbench.studies.design import next_stop
from workbench.studies.power.diagnosing import (
    build_everything,
    diagnose_set,
    library_effects,
    rivals_of_set,
)

ROOT = Path(__file__).parents[1]
RADIUS = ROOT.parent / "shared" / "recordings" / "labelled" / "radius"


@pytest.mark.long
def test_a_faster_stop_is_proposed_and_parts_the_radii(system, tmp_path):
    """By the lightest stop alone, a wheel of 1.5 mm less and a roller of 2.3 mm more look alike."""
    if not RADIUS.is_dir():
        pytest.skip("needs the independent recordings, which have licences of their own")
    effects, all_effects = library_effects(system), tmp_path / "AllEffects.fmu"
    build_everything(system, effects, all_effects)
    light = read_cases([RADIUS / "01_dry_80_1.5"], system)
    _, rivals = rivals_of_set(system, effects, all_effects, light)
    assert {model.effects for model in rivals.models} == {("WheelRadius",), ("RollerRadius",)}
    asked = next_stop(system, rivals, ALONE)
    assert "initial speed 160 km/h" in asked.tried[0].text
    both = [*light, *read_cases([RADIUS / "06_dry_160_3.6_rev"], system)]
    (cause,) = diagnose_set(system, effects, all_effects, both).causes
    assert (cause.effect.name, cause.confusable_with) == ("WheelRadius", ())
