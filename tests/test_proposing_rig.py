"""A law that begins with an input, on the virtual rig: pads that grip less in the first seconds."""

from pathlib import Path

import pytest

import workbench as wb
from workbench.diagnosis import choose, read_effects
from workbench.diagnosis.problem import Problem
from workbench.machines.wheelset.rig import CONSTANT_PADS, SCENARIOS, plant
from workbench.models.modelica import read_library
from workbench.recordings.case import Case, read_case
from workbench.studies.power.left_out import function_error
from workbench.system.system import OBSERVER, System

from .recordings import record


def stops(system: System, seed: int, folder: Path) -> list[Case]:
    """Three dry stops with pads that have lost 8 % of their friction at first contact."""
    planted = plant(CONSTANT_PADS, ["bedding_in=0.08"])
    for name in ("02_dry_100_2.7", "03_dry_120_3.6", "05_dry_120_2.7_rev"):
        record(SCENARIOS[name], seed, planted, folder / name)
    return [read_case(path, system) for path in sorted(folder.iterdir())]


@pytest.mark.long
def test_pads_that_bed_in_are_told_by_the_time_since_they_touch(system, tmp_path):
    """The catalogue knows the wheel's load alone. No inertia may mimic it, by seven times its size.

    What the law makes of the friction is within 15 % of the range of what the cause does, on stops
    that neither was fitted to.
    """
    cases = stops(system, 1, tmp_path / "stops")
    quiet = {"workers": 2, "report": lambda _: None}
    before = wb.diagnose(system, cases, effects=["WheelLoad"], out=tmp_path / "a", **quiet)
    assert before.diagnosis.verdict == "unexplained"
    found = wb.propose(before, out=tmp_path / "b", **quiet)
    (law,) = found.laws
    form = found.forms[law.effect.name]
    assert form.law.influence is not None
    assert (form.law.influence.kind, form.form.name) == ("since", "Saturation")
    slots = {form.law.place.slot.name for form in found.forms.values()}
    assert "padFriction" in slots
    assert slots <= {
        "padFriction",
        "actuation",
        "cylinder",
    }  # what presses is as good as what grips
    known = wb.diagnose(system, cases, effects=["BeddingIn"], out=tmp_path / "c", **quiet)
    library = read_library(system.library)
    effects = read_effects(library, system.models[OBSERVER].name)
    (bedding,) = choose(["BeddingIn"], effects)
    fresh = stops(system, 2, tmp_path / "fresh")
    problem = Problem(system, fresh, library, effects)
    error = function_error(problem, known, found, bedding)
    if form.law.place.slot.name == "padFriction":
        assert error is not None
        assert error < 0.15
    else:
        assert error is None


@pytest.mark.long
def test_friction_that_falls_with_deceleration_is_no_sum_of_known_causes(
    system: System, tmp_path: Path
) -> None:
    """No catalogue has it; bedding in, a return spring and a film bend to it down to 1.26."""
    planted = plant(CONSTANT_PADS, ["friction_deceleration=-0.04"])
    for name in list(SCENARIOS)[:6]:
        record(SCENARIOS[name], 1, planted, tmp_path / "stops" / name)
    cases = [read_case(path, system) for path in sorted((tmp_path / "stops").iterdir())]
    quiet = {"workers": 2, "report": lambda _: None}
    found = wb.diagnose(system, cases, out=tmp_path / "out", **quiet)
    assert found.diagnosis.verdict == "unexplained"
    assert any("is at its bound" in why for near in found.diagnosis.nearest for why in near.reasons)
