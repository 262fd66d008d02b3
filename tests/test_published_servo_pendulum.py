"""The servo's published records become cases, from each layout, and its system fits them."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from workbench.case import read_case
from workbench.diagnosis import diagnose, read_effects
from workbench.modelica import read_library
from workbench.prepare import PREPARED
from workbench.systems import load_system

SYSTEM = load_system("servo_pendulum")


@pytest.fixture(scope="module")
def cases(published_cases: Callable[[str, str], Path]) -> Path:
    return published_cases("servo_pendulum", "servo_pendulum")


def test_records_of_one_gain_are_held_out(cases: Path) -> None:
    told = json.loads((cases / PREPARED).read_text())
    assert len(told["cases"]) == 16
    assert sorted(told["held_out"]) == [name for name in sorted(told["cases"]) if "kp200" in name]
    assert len(told["held_out"]) == 4


def test_a_record_has_its_gain_and_its_signals(cases: Path) -> None:
    case = read_case(cases / "kp400_lift_and_drop", SYSTEM)
    assert case.conditions == {"kp": 400}
    assert case.inputs == ("goal", "volts", "enabled")
    # The motor is let go after 2 s, and the arm falls from where it was.
    assert np.all(case["enabled"] == (case.time <= 2.0))
    assert case["position"][400] < -0.6
    assert case["position"].max() > 0.4


def test_friction_that_grows_with_the_load_is_found_and_a_stribeck_curve_is_not(
    cases: Path, root: Path, tmp_path: Path
) -> None:
    pytest.importorskip("rumoca")
    library = read_library(root / "modelica" / "ServoPendulum" / "package.mo")
    fitted = sorted(path for path in cases.glob("kp*") if not path.name.startswith("kp200"))
    recordings = [read_case(path, SYSTEM) for path in fitted]
    effects = read_effects(library, "Servo")
    found = diagnose(SYSTEM, recordings, library, effects, tmp_path, 2, lambda line: None)
    names = {cause.effect.name for cause in found.diagnosis.causes}
    # Published, fitted to the same records: 128 mrad without friction, 59 with dry and viscous
    # friction and 59 with a Stribeck curve beside, 47 where it grows with the load.
    assert found.diagnosis.steps[0].rivals[0].active[0].name in ("DryFriction", "ViscousFriction")
    assert names & {"DryFriction", "ViscousFriction"}
    assert names & {"LoadFriction", "DriveFriction", "LoadStribeck"}
    assert "Stribeck" not in names
    before, after = np.mean([one.mean_absolute for one in found.errors], axis=0)
    assert 0.11 < before < 0.15
    assert after < 0.035
