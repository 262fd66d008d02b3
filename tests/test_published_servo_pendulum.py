"""The servo's published records become cases; what they say is in its tutorial."""

import json
from pathlib import Path

import numpy as np
import pytest

from workbench.recordings.case import read_case
from workbench.recordings.datasets import PREPARED
from workbench.system.registry import load_system

SYSTEM = load_system("servo_pendulum")


@pytest.fixture(scope="module")
def cases(published_cases) -> Path:
    return published_cases("servo_pendulum", "servo_pendulum")


def test_records_of_one_gain_are_held_out(cases):
    told = json.loads((cases / PREPARED).read_text())
    assert len(told["cases"]) == 16
    assert sorted(told["held_out"]) == [name for name in sorted(told["cases"]) if "kp200" in name]
    assert len(told["held_out"]) == 4


def test_a_record_has_its_gain_and_its_signals(cases):
    case = read_case(cases / "kp400_lift_and_drop", SYSTEM)
    assert case.conditions == {"kp": 400}
    assert case.inputs == ("goal", "volts", "enabled")
    # The motor is let go after 2 s, and the arm falls from where it was.
    assert np.all(case["enabled"] == (case.time <= 2.0))
    assert case["position"][400] < -0.6
    assert case["position"].max() > 0.4
