"""A positioning stage's published records are read, and its friction is named, both ways."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.io import savemat

from workbench.api import diagnose
from workbench.machines.published.positioning_stage import PUBLISHED
from workbench.recordings.case import read_cases
from workbench.system.registry import load_system


def test_the_record_with_pulses_is_held_out(tmp_path):
    goal = np.linspace(0.0, 0.2, 40)[:, None]
    content = {"qg": goal, "qm": goal - 1e-3, "vir": 2.0 * goal, "t": goal}
    savemat(tmp_path / "DATA_EMPS.mat", content)
    pulses = (np.arange(40) % 7)[:, None]
    savemat(tmp_path / "DATA_EMPS_PULSES.mat", {**content, "pulses_N": pulses})
    fitted, held_out = PUBLISHED.layouts[0].read(tmp_path)
    assert [one.held_out for one in (fitted, held_out)] == [False, True]
    assert not fitted.columns["pulse [V]"].any()
    assert_array_equal(held_out.columns["pulse [V]"], pulses.ravel())
    assert_array_equal(fitted.columns["command [V]"], 2.0 * goal.ravel())
    assert fitted.columns["time [s]"][-1] == pytest.approx(0.039)


def test_friction_and_its_slant_are_named(published_cases, tmp_path):
    """Published: 20.4 N and 203.5 N.s/m, or 166.7 one way and 240.4 the other."""
    cases = published_cases("positioning_stage", "positioning_stage")
    system = load_system("positioning_stage")
    fitted = read_cases([cases / "motion"], system)
    outcome = diagnose(system, fitted, out=tmp_path, workers=1, report=lambda line: None)
    causes = {cause.effect.name: cause for cause in outcome.diagnosis.causes}
    assert set(causes) == {"DryFriction", "ViscousFriction", "SlantedDamping"}
    assert outcome.diagnosis.causes[0].effect.name == "DryFriction"
