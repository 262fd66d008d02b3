"""The creep force that the built FMU computes, against Polach's law and published points of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from workbench.models.fmu import FMU

RW, RR, LOAD, K = 0.46, 0.70, 80e3, 9.68e6

DRY_55 = {"polach.kA": 1.0, "polach.kS": 0.4, "polach.A": 0.4, "polach.B": 0.6, "muWR": 0.55}
DRY_40 = DRY_55 | {"muWR": 0.40}
WET_30 = {"polach.kA": 0.3, "polach.kS": 0.1, "polach.A": 0.4, "polach.B": 0.2, "muWR": 0.30}
NOMINAL = DRY_55 | {"muWR": 0.15}


def creep_force(fmu: FMU, contact: dict[str, float], v: float, slip: np.ndarray) -> np.ndarray:
    """Force of both wheels [N] at rolling velocity v [m/s] for slip velocities [m/s]."""
    fmu.start({}, contact)
    force = fmu.variables(["Fx"])
    forces = []
    for w in slip:
        fmu.set_states(np.array([(v - w) / RW, v / RR]))
        forces.append(fmu.get(force)[0])
    return np.array(forces)


@pytest.mark.parametrize("v", [10.0, 44.4])
def test_slope_at_zero_slip_is_kalkers_for_unreduced_stiffness(minimal, v):
    """Reference: F -> K*s (Kalker) for kA = kS = 1; Polach (2000)."""
    w = 1e-6
    (force,) = creep_force(minimal, DRY_40 | {"polach.kS": 1.0}, v, np.array([w]))
    # v_ref = sqrt(v^2 + 0.1^2) costs 5e-5 at 10 m/s; the law's own curvature is below 1e-8 here,
    # and the slip is the difference of two speeds of 40 m/s known to 1e-14: 1e-8 of 1e-6 m/s.
    assert_allclose(force, 2 * K * w / v, rtol=1e-4)


def test_stiffness_grows_with_load_to_the_power_two_thirds(minimal):
    """Reference: Kalker stiffness 9.02 and 10.32 MN at 72 and 88 kN, from Hertz and Table E.3."""
    for load, stiffness in ((72e3, 9.02e6), (88e3, 10.32e6)):
        contact = DRY_40 | {"polach.kS": 1.0, "Fz": load}
        (force,) = creep_force(minimal, contact, 40.0, np.array([1e-6]))
        # The references have three digits.
        assert_allclose(force, 2 * stiffness * 1e-6 / 40.0, rtol=1e-3)


@settings(max_examples=60, deadline=None)
@given(
    w=st.floats(0.0, 40.0),
    v=st.floats(-45.0, 45.0),
    mu0=st.floats(0.05, 0.55),
)
def test_force_is_odd_in_slip_and_bounded_by_friction(minimal_path, w, v, mu0):
    contact = DRY_55 | {"muWR": mu0}
    with FMU(minimal_path) as fmu:
        plus, minus = creep_force(fmu, contact, v, np.array([w, -w]))
    friction = mu0 * (0.6 * np.exp(-0.6 * w) + 0.4)
    # Speeds near 40 m/s are known to 1e-14, the force per slip is at most 2*K*0.7/0.1 N/(m/s).
    assert_allclose(plus, -minus, atol=1e-5, rtol=1e-12)
    assert plus + 1e-5 >= 0.0
    assert plus <= 2 * LOAD * friction * (1 + 1e-9) + 1e-5


@pytest.mark.parametrize(
    ("contact", "v", "peak", "at", "sliding"),
    [
        (DRY_55, 44.4, 0.338, 0.82, 0.220),
        (DRY_55, 22.2, 0.381, 0.60, 0.220),
        (DRY_55, 10.0, 0.424, 0.41, 0.220),
        (DRY_55, 1.0, 0.504, 0.13, 0.400),
        (DRY_40, 40.0, 0.265, 0.68, 0.160),
        (WET_30, 44.4, 0.191, 2.34, 0.119),
        (WET_30, 22.2, 0.214, 1.67, 0.121),
        (WET_30, 10.0, 0.237, 1.12, 0.143),
        (NOMINAL, 40.0, 0.115, 0.43, 0.060),
    ],
)
def test_falling_branch_starts_where_published_parameters_put_it(
    minimal, contact, v, peak, at, sliding
):
    """Reference: peak of F/Q, its slip velocity and F/Q at full sliding, computed independently."""
    slip = np.arange(0.005, v, 0.005)
    adhesion = creep_force(minimal, contact, v, np.append(slip, v)) / (2 * LOAD)
    top = int(np.argmax(adhesion))
    # Half a digit of the reference, which has two or three; v_ref adds 0.5 % at 1 m/s only.
    assert_allclose(adhesion[top], peak, atol=6e-4)
    assert_allclose(slip[top], at, atol=0.011)
    assert_allclose(adhesion[-1], sliding, atol=1.1e-3)
    # Far beyond the peak the law creeps up again, as friction has reached its floor.
    falling = adhesion[:-1][top : top + 200]
    assert np.all(np.diff(falling) < 0.0)
