"""Accuracy of the estimators as they come: against the truth of the virtual rig, and on recordings
made by an independent simulator."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from workbench.machines.wheelset.accuracy import (
    COVERED,
    KnownStop,
    contact_errors,
    fall_delay,
    force_error,
    friction_error,
    held_by_bands,
    minimum_error,
    observe_stop,
    rise_delay,
    slide_error,
)
from workbench.machines.wheelset.rig import ORDINARY_PADS, Effects, select
from workbench.machines.wheelset.truth import read_truth
from workbench.machines.wheelset.validity import PeakForce
from workbench.observers import Estimator
from workbench.observers import estimators_of as all_estimators
from workbench.observers.gains_file import usual_gains
from workbench.observers.replay import replay
from workbench.observers.score import score
from workbench.recordings.case import Case, read_cases
from workbench.recordings.csv import read_columns
from workbench.system.registry import load_system, open_model

from .recordings import record

ROOT = Path(__file__).parent.parent
RECORDINGS = ROOT.parent / "shared" / "recordings"
SYSTEM = load_system("wheelset")
# Of a wheelset, which has no like parts, the block filter is the extended one.
KINDS = {name: kind for name, kind in all_estimators(SYSTEM).items() if name != "arrow"}
OBSERVERS = tuple(KINDS)[2:]  # the others are baselines
PLANTS = ("clean", "cylinder_lag", "fade", "pole_ring", "radius", "speed_friction")

STOPS = tuple(sorted(folder.name for folder in (ROOT / "cases").iterdir()))
DRY = tuple(name for name in STOPS if "_dry_" in name)
WET = tuple(name for name in STOPS if name not in DRY)
SLIDE = "09_wet_160_4.2_wsp"


@pytest.fixture(scope="module")
def estimators() -> Iterator[dict[str, Estimator]]:
    with open_model(SYSTEM) as minimal, open_model(SYSTEM, "full") as full:
        models = {"observer": minimal, "full": full}
        yield {
            name: kind(fmu, SYSTEM, usual_gains(kind, fmu, SYSTEM))
            for name, kind in KINDS.items()
            if (fmu := models[kind.role])
        }


# --- against the truth of the virtual rig ---


@pytest.fixture(scope="module")
def stops(estimators) -> dict[str, KnownStop]:
    made = list(estimators.values())
    return {
        case.name: observe_stop(case, read_truth(case, SYSTEM), made, SYSTEM)
        for case in read_cases([ROOT / "cases"], SYSTEM)
    }


@pytest.mark.parametrize("observer", OBSERVERS)
@pytest.mark.parametrize(
    ("names", "limit"),
    [(DRY, 0.006), ([name for name in WET if name != SLIDE], 0.015), ([SLIDE], 0.025)],
    ids=["dry", "wet", "slide"],
)
def test_force_error_is_small(stops, observer, names, limit):
    """Error of the contact force itself, which no sensor reads: rms over mean, below 5 Hz."""
    for name in names:
        assert force_error(stops[name], observer) < limit, name


@pytest.mark.parametrize("observer", OBSERVERS)
@pytest.mark.parametrize(("names", "limit"), [(DRY, 0.01), (WET, 0.02)], ids=["dry", "wet"])
def test_friction_of_the_pads_is_recovered(stops, observer, names, limit):
    """From 1 s after the first contact to 1 m/s, below 5 Hz, at every time."""
    for name in names:
        assert friction_error(stops[name], observer) < limit, name


@pytest.mark.parametrize("filter_", ["ekf", "ukf", "mhe", "imm", "smoother"])
def test_the_band_of_a_filter_holds_what_it_says(stops, filter_):
    """Stops of seeds 8 to 14 say how wide they are; these are of seed 1."""
    shares = [held_by_bands(stop, filter_) for stop in stops.values()]
    for quantity in COVERED:
        known = [share[quantity].share for share in shares if quantity in share]
        if quantity != "muWR":  # which is claimed in the few stops that use much of the adhesion
            # Of single seeds the slip asks for bands 9 % narrower to 9 % wider, 2 % more or less.
            assert 0.93 < np.mean(known) < 0.97, quantity
    # Noise of the pressure sensor moves the force and no speed: without it one held 58 %. A
    # roller's inertia three tolerances off, which no band holds, takes one of other seeds to 82 %.
    for name, share in zip(stops, shares, strict=True):
        assert share["Fx"].share > 0.85, name


@pytest.mark.parametrize("observer", OBSERVERS)
def test_force_is_followed_within_half_a_second(stops, observer):
    """Nine tenths of what is reached 2 s after the first contact, and of the fall in the slide.

    The answer to a step proper is in `test_observers`.
    """
    for name, stop in stops.items():
        assert rise_delay(stop, observer) < 0.5, name
    assert fall_delay(stops[SLIDE], observer) < 0.5


# Stops in which an observer oscillates at the first contact of the pads, all of them with wet
# discs: the parameter estimator is a PI controller and swings through, the disturbance observer a
# little where the brake is light. Filters begin with friction that is free within its range.
OSCILLATING = {
    "parameter_estimator": set(WET) - {"13_onedisc_100_2.7"},
    "disturbance_observer": {"07_wet_80_1.5"},
    "disturbance_observer_disc": {"07_wet_80_1.5"},
}


@pytest.mark.parametrize("observer", OBSERVERS)
def test_no_oscillation_at_the_first_contact_of_the_pads(stops, observer):
    """The error swings to both sides by less than 3 % of the force that is being built up.

    3 % is twice what noise of the sensors makes of an estimate below 5 Hz. An error to one side
    is no oscillation: of wet discs an observer learns only as they are pressed.
    """
    oscillating = {
        name for name, stop in stops.items() if min(contact_errors(stop, observer)) > 0.03
    }
    assert oscillating == OSCILLATING.get(observer, set())


@pytest.mark.parametrize("observer", OBSERVERS)
def test_dry_pads_are_followed_from_the_first_contact_on(stops, observer):
    for name in DRY:
        assert max(contact_errors(stops[name], observer)) < 0.03, name  # 3 % as above


@pytest.mark.parametrize("observer", OBSERVERS)
def test_the_slide_is_followed_to_its_minimum(stops, observer):
    """The paper's disturbance observer misses the minimum."""
    stop = stops[SLIDE]
    # 15 % is what is asked inside a slide.
    assert slide_error(stop, observer) < 0.15
    # A tenth of the 15 %: the minimum is a matter of a quarter of a second.
    assert abs(minimum_error(stop, observer)) < 0.015


@pytest.fixture(scope="module")
def slippery(tmp_path_factory) -> list[Case]:
    """Stops near the limit of adhesion of a contact that has the law of a dry one."""
    folder = tmp_path_factory.mktemp("slippery")
    for name in ("03_dry_120_3.6", "04_dry_160_4.2", "06_dry_160_3.6_rev"):
        for muWR in (0.19, 0.22, 0.25):
            (scenario,) = select([name])
            record(replace(scenario, muWR=muWR), 1, Effects(), folder / f"{name}_{muWR}", every=1)
    return read_cases([folder], SYSTEM)


@pytest.mark.long
@pytest.mark.parametrize("observer", OBSERVERS)
def test_friction_of_the_rail_is_recovered_near_the_limit_of_adhesion(
    estimators, slippery, observer
):
    """Within a tenth from 70 % of the adhesion on, where the law of the contact is right.

    Braking presses the wheels of the multibody model down by 4 to 5 %, in reverse it lifts them;
    the observers' models hold the wheel load, and take that for 6 to 7 % of muWR.
    """
    estimator, near = estimators[observer], []
    for case in slippery:
        run = replay(case, estimator)
        used = PeakForce(estimator.fmu, SYSTEM).utilisation(run.estimate)
        error = run.signal("muWR") / read_truth(case, SYSTEM).muWR - 1.0
        near.append(error[run.claimed["muWR"] & (used > 0.7)])
    errors = np.abs(np.concatenate(near))
    assert errors.size > 10_000
    # What is measured, with a margin: 99.8 % of the Kalman filters, 91.5 to 96 % of the others.
    assert np.mean(errors < 0.1) > (0.99 if observer in ("ekf", "ukf") else 0.90)


@pytest.mark.parametrize(("name", "low"), [("07", 0.79), ("08", 0.41), ("09", 0.14), ("10", 0.58)])
def test_a_model_of_the_dry_contact_finds_too_little_friction_on_wet_rails(estimators, name, low):
    """Median of the EKF where a dry contact would be claimed; the share is of the README."""
    (stop,) = (ROOT / "cases").glob(f"{name}_*")
    (case,) = read_cases([stop], SYSTEM)
    as_dry = replace(case, conditions={**case.conditions, "wheel_rail": "dry"})
    run = replay(as_dry, estimators["ekf"])
    truth = read_columns(stop / "truth.csv", ["time", "muWR"])
    true = np.interp(case.time, truth["time"].values, truth["muWR"].values)
    error = (run.signal("muWR") / true - 1.0)[run.claimed["muWR"]]
    assert np.median(error) == pytest.approx(-low, abs=0.02)


@pytest.mark.parametrize("observer", ["ekf", "ukf", "mhe"])
def test_friction_that_a_filter_passes_through_is_not_claimed(estimators, tmp_path, observer):
    """A dry rail, 0.40, that noise makes slippery for 0.04 to 0.2 s as the force builds up."""
    (scenario,) = select(["06_dry_160_3.6_rev"])
    record(scenario, 7, ORDINARY_PADS, tmp_path / scenario.name)
    (case,), estimator = read_cases([tmp_path], SYSTEM), estimators[observer]
    run = replay(case, estimator)
    passed = PeakForce(estimator.fmu, SYSTEM).valid(run.estimate)  # the rule alone claims it
    assert 0.03 < passed.sum() * 0.005 < 0.25
    assert run.signal("muWR")[passed].max() < 0.14
    assert not run.claimed["muWR"].any()


# --- on recordings of an independent simulator, whose truth is not known here ---


@cache
def recorded(folder: Path) -> list[Case]:
    """The cases of a folder, read once for all estimators."""
    return read_cases([folder], SYSTEM)


def worst(estimator: Estimator, folder: Path, pattern: str = "") -> float:
    """Largest error of Fx, rms over mean, over the cases whose name holds the pattern."""
    errors = []
    for case in recorded(folder):
        if pattern in case.name:
            error = score(case, replay(case, estimator), SYSTEM).nrmse
            assert error is not None, case.name
            errors.append(error)
    return max(errors)


# A wrong radius and an eccentric pole ring look like slip, which fast gains follow.
MISLED = {
    ("pole_ring", "parameter_estimator"): 0.03,
    ("radius", "parameter_estimator"): 0.035,
    ("radius", "disturbance_observer_disc"): 0.022,
}


@pytest.mark.parametrize(
    ("recordings", "name"),
    [
        # The smoother takes as long as all others together.
        pytest.param(
            recordings,
            name,
            marks=[pytest.mark.long] * (name == "smoother" and recordings != "fade"),
        )
        for recordings in PLANTS
        for name in OBSERVERS
    ],
)
def test_force_is_followed_whatever_is_wrong_with_the_plant(estimators, name, recordings):
    """Dry stops of a rig that lags, fades, or has a wrong radius or an eccentric pole ring."""
    folder = RECORDINGS / "labelled" / recordings
    if not folder.is_dir():
        pytest.skip("the recordings are not at hand")
    assert worst(estimators[name], folder) < MISLED.get((recordings, name), 0.02)


@pytest.mark.parametrize("name", OBSERVERS)
@pytest.mark.parametrize(("pattern", "limit"), [("_dry_", 0.02), ("wet", 0.04)])
def test_force_on_the_standard_recordings(estimators, name, pattern, limit):
    folder = RECORDINGS / "standard"
    if not folder.is_dir():
        pytest.skip("the recordings are not at hand")
    assert worst(estimators[name], folder, pattern) < limit
