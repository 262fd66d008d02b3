"""Friction wheel-rail is claimed where the creep force shows it, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.machines.wheelset.validity import PeakForce
from workbench.models.fmu import FMU
from workbench.observers import Estimator, choose
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.replay import replay
from workbench.observers.run import Run
from workbench.recordings.case import Case, read_case
from workbench.system.system import System

from .systems import WHEELSET

COLUMNS = list(WHEELSET.columns)
RR, NOMINAL = 0.70, 0.15
Slide = tuple[Case, Run]


@pytest.fixture(scope="module")
def peak_force(fmu, system) -> PeakForce:
    return PeakForce(fmu, system)


def estimates(
    muWR: list[float], force: list[float], *, speed: float = 40.0, slip: float = 0.01
) -> np.ndarray:
    """Rows of an estimate; force of one wheel [N], speed and slip [m/s]."""
    rows = np.zeros((len(muWR), len(COLUMNS)))
    for name, values in {
        "omegaR": speed / RR,
        "muWR": muWR,
        "dmuWR": np.subtract(muWR, NOMINAL),
        "Fx": np.multiply(2.0, force),
        "slip": slip,
    }.items():
        rows[:, COLUMNS.index(name)] = values
    return rows


@pytest.mark.parametrize(
    ("muWR", "used"), [(0.55, [0.15, 0.29, 0.45]), (0.40, [0.19, 0.38, 0.59]), (0.15, [0.44, 0.87])]
)
def test_utilisation_is_that_of_polachs_law(peak_force, muWR, used):
    """Reference: peaks of the law found apart from the FMU, 40 m/s, 4, 8 and 12.5 kN a wheel."""
    force = [4e3, 8e3, 12.5e3][: len(used)]
    utilised = peak_force.utilisation(estimates([muWR] * len(used), force))
    # Half of the last digit of the reference, as much again for interpolation.
    assert_allclose(utilised, used, atol=0.01)


def test_peak_agrees_with_a_fine_scan_of_the_written_law(peak_force):
    """Reference: data sheet of the rig, F = 2 Q mu/pi (kA eps/(1+(kA eps)^2) + atan(kS eps))."""
    Q, K, kA, kS, A, B = 80e3, 9.68e6, 1.0, 0.4, 0.4, 0.6
    w = np.linspace(1e-3, 5.0, 50_000)
    for speed in (1.0, 5.0, 17.0, 44.4):
        for mu0 in (0.05, 0.12, 0.33):
            mu = mu0 * ((1 - A) * np.exp(-B * w) + A)
            eps = np.pi * K * w / (4 * Q * mu * np.hypot(speed, 0.1))
            peak = (
                2 * Q * mu / np.pi * (kA * eps / (1 + (kA * eps) ** 2) + np.arctan(kS * eps))
            ).max()
            utilised = peak_force.utilisation(estimates([mu0], [peak / 2], speed=speed))
            # Linear interpolation between 14 speeds and 10 frictions.
            assert utilised == pytest.approx(0.5, rel=0.02)


def test_a_sliding_wheel_uses_all_adhesion_though_its_force_has_fallen(peak_force):
    """A locked wheel at 44 m/s has 0.65 of the peak force; what it shows is the friction."""
    locked = estimates([0.55], [0.220 * 80e3], speed=44.4, slip=44.4)
    assert peak_force.utilisation(locked) == 1.0
    assert peak_force.valid(locked)


def test_direction_does_not_matter(peak_force):
    forward = estimates([0.2, 0.3], [10e3, 10e3], slip=0.1)
    signs = np.ones(len(COLUMNS))
    signs[[COLUMNS.index(name) for name in ("omegaR", "Fx", "slip")]] = -1.0
    assert_array_equal(peak_force.utilisation(forward), peak_force.utilisation(signs * forward))


def test_claims_begin_above_six_tenths(peak_force):
    """8 kN of 13.4 (0.60), at muWR 0.25, where 0.01 in muWR is worth some 100 N."""
    force = np.linspace(2e3, 14e3, 121)
    rows = estimates([0.25] * force.size, list(force))
    used, claimed = peak_force.utilisation(rows), peak_force.valid(rows)
    assert_array_equal(claimed, used > 0.6)
    assert 0 < claimed.sum() < claimed.size


def test_what_was_not_learned_is_not_claimed(peak_force):
    assert peak_force.valid(estimates([NOMINAL + 0.001], [8e3]))
    assert not peak_force.valid(estimates([NOMINAL], [8e3]))
    assert not peak_force.valid(estimates([float("nan")], [8e3]))


def test_nothing_is_claimed_at_walking_pace(peak_force):
    assert not peak_force.valid(estimates([0.2], [20e3], speed=0.4))


def made(fmu: FMU, system: System, name: str) -> Estimator:
    """An estimator with reasoned gains."""
    return choose(system, [name])[name].untuned(fmu, system)


@pytest.fixture(scope="module")
def slide(root, fmu, system) -> Slide:
    case = read_case(root / "cases" / "09_wet_160_4.2_wsp", system)
    return case, replay(case, made(fmu, system, DisturbanceObserver.name))


def test_a_dry_stop_claims_nothing(fmu, system, dry_case):
    """An ordinary dry stop uses half of the adhesion at most: muWR is not observable in it."""
    for name in ("open_loop", "direct_inversion", "disturbance_observer", "ekf"):
        assert not replay(dry_case, made(fmu, system, name)).claimed["muWR"].any(), name


def test_a_slide_uses_all_adhesion_throughout(peak_force, slide):
    """Slip beyond 2 m/s is beyond the peak of any contact (at most 1 m/s with this law)."""
    case, run = slide
    sliding = RR * case["omegaR"] - 0.46 * case["omegaW"] > 2.0
    claimed = peak_force.valid(run.estimate)
    assert sliding.sum() > 50  # a quarter of a second of the recording
    assert claimed[sliding].all()
    assert not claimed[case.time < 2.0].any()  # coasting


def test_on_a_wet_rail_a_model_of_the_dry_contact_claims_nothing(slide):
    assert not slide[1].claimed["muWR"].any()


def called_dry(case: Case) -> Case:
    return replace(case, conditions={**case.conditions, "wheel_rail": "dry"})


def test_the_same_recording_from_a_dry_rail_would_be_claimed(slide, fmu, system):
    observer = made(fmu, system, DisturbanceObserver.name)
    assert replay(called_dry(slide[0]), observer).claimed["muWR"].any()


@pytest.mark.parametrize("name", ["open_loop", "direct_inversion"])
def test_methods_that_estimate_no_friction_claim_none(fmu, system, slide, name):
    assert not replay(called_dry(slide[0]), made(fmu, system, name)).claimed["muWR"].any()
