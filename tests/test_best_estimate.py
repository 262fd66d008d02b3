"""The best estimate of a recording, with the nominal and with the extended model."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from workbench.api import diagnose
from workbench.diagnosis import Outcome
from workbench.diagnosis.inference.best_estimate import bands, best_estimate
from workbench.machines.wheelset.rig import Effects, select
from workbench.observers.simulation import CaseResult
from workbench.recordings.case import read_cases

from .recordings import record

STOPS = ("dry_120_3.6", "dry_120_2.7_rev")
GAIN = 0.04  # of the measured torque, which is most of the balance that the force follows from


@pytest.fixture(scope="module")
def outcome(system, tmp_path_factory) -> Outcome:
    """Of two stops whose torque was measured too large."""
    folder = tmp_path_factory.mktemp("torque")
    for scenario in select(STOPS):
        record(scenario, 3, Effects(torque_gain=GAIN), folder / "stops" / scenario.name)
    cases = read_cases([folder / "stops"], system)
    effects = ("DriveTorqueGain", "WheelRadius")
    out = folder / "out"
    return diagnose(system, cases, effects=effects, out=out, workers=1, report=lambda _: None)


@pytest.fixture(scope="module")
def estimates(outcome) -> dict[str, CaseResult]:
    by_recording = {case.name: best_estimate(outcome, case.name) for case in outcome.cases}
    return {name: estimate for name, estimate in by_recording.items() if estimate is not None}


def test_the_band_holds_what_the_load_cells_say_once_the_model_is_extended(outcome, estimates):
    """The nominal model takes 4 % of torque for force, some forty standard deviations."""
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "DriveTorqueGain"
    inside: dict[str, list[float]] = {"nominal_model": [], "extended_model": []}
    assert len(estimates) == len(STOPS)
    for estimate in estimates.values():
        for model, numbers in bands(estimate).items():
            inside[model].append(numbers["Fx"]["inside"])
            assert numbers["Fx"]["low"] < numbers["Fx"]["value"] < numbers["Fx"]["high"]
    # Of 95 %; the cells ring, and stand 21.6 Hz behind the contact.
    assert np.mean(inside["extended_model"]) >= 0.93
    assert max(inside["nominal_model"]) < 0.1


def test_load_cells_feed_no_estimate(outcome, estimates):
    """Without them the numbers are the same, but for the share of them that is inside."""
    case = outcome.cases[0]
    signals = {name: values for name, values in case.signals.items() if name != "Fx"}
    blind = replace(outcome, cases=(replace(case, signals=signals),))
    best = best_estimate(blind, case.name)
    for model, run in estimates[case.name].runs.items():
        assert_array_equal(run.estimate, best.runs[model].estimate)
        assert_array_equal(run.sigma, best.runs[model].sigma)
        assert bands(best)[model]["Fx"]["inside"] is None


def test_where_errors_have_no_explanation_there_is_no_best_estimate(outcome):
    unexplained = replace(outcome.diagnosis, verdict="unexplained")
    name = outcome.cases[0].name
    assert best_estimate(replace(outcome, diagnosis=unexplained), name) is None
    # Of a model that lacks nothing there is one, without an extended model.
    nothing = replace(outcome, diagnosis=replace(outcome.diagnosis, verdict="nothing"))
    best = best_estimate(replace(nothing, extension=None), name)
    assert list(best.runs) == ["nominal_model"]
