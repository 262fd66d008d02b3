"""What the measured speeds can tell: formulas of linear systems, physics of the models."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_continuous_lyapunov, solve_discrete_lyapunov

from workbench.__main__ import main
from workbench.arrays import Vector
from workbench.models.fmu import FMU
from workbench.observers import operating
from workbench.observers.observability import (
    SampledModel,
    bounds,
    exponentials,
    gramians,
    linear_test,
    linearise_along,
    prior,
)
from workbench.system.expression import Expression
from workbench.system.parts import OperatingPoint

from .page_rules import check_page
from .schemas import check
from .systems import WHEELSET as SYSTEM

ROOT = Path(__file__).parents[1]
FULL = ROOT / "fmus/fmi2/FullObserver.fmu"
CASE = ROOT / "cases/02_dry_100_2.7"
FRICTION_PRIOR = prior(SYSTEM)
FIRST = np.zeros(1, int)
HALF_A_SECOND = 100


@pytest.fixture
def full():
    with FMU(FULL) as fmu:
        yield fmu


def braking(speed=22.0, pressure=2.7e5, muWR=0.225) -> OperatingPoint:
    """Braked at constant speed [m/s] by a pressure [Pa]; by default the system's own test point."""
    held = {"omegaR": Expression(f"{speed!r}/rR", "test")}
    return OperatingPoint({"pB": pressure}, held, {"muWR": muWR})


def settle(fmu, point):
    return operating.settle(fmu, SYSTEM, point)


def constant_model(Phi, C, R, length, Gamma=None):
    """A time-invariant SampledModel, for formulas of linear systems."""
    k = len(Phi)
    return SampledModel(
        names=tuple(f"x{i}" for i in range(k)),
        Phi=np.tile(Phi, (length, 1, 1)),
        Gamma=np.tile(np.zeros((k, 1)) if Gamma is None else Gamma, (length, 1, 1)),
        C=np.tile(C, (length, 1, 1)),
        R=np.tile(R, (length, 1)),
    )


def held(fmu, x, u):
    """A model linearised at a point that is held for half a second."""
    time = 0.005 * np.arange(HALF_A_SECOND)
    return linearise_along(
        fmu, SYSTEM, time, np.tile(x, (time.size, 1)), np.tile(u, (time.size, 1))
    )


def friction_bounds(fmu, x, u, prior=FRICTION_PRIOR):
    """Bounds of dmuWR and dmuDC after half a second; a prior of 10 rad/s leaves the speeds open."""
    return bounds(held(fmu, x, u), FIRST, HALF_A_SECOND, np.array([10.0, 10.0, *prior]))[0, 2:]


# --- linear algebra ---


def test_bound_of_a_slope_is_that_of_linear_regression():
    """Reference: var(slope) = 12 sigma^2 / (h^2 N (N^2 - 1)), ordinary least squares."""
    sigma, h, n = 0.003, 0.005, 100
    model = constant_model(np.array([[1.0, h], [0.0, 1.0]]), np.eye(1, 2), np.array([sigma**2]), n)
    slope = bounds(model, FIRST, n, np.array([1e3, 1e3]))[0, 1]
    # Priors of 1e3 against bounds of 1e-2 leave 1e-10, rounding in the recursion about 1e-8.
    assert_allclose(slope, sigma / h * np.sqrt(12.0 / (n * (n**2 - 1))), rtol=1e-6)


def test_noise_of_inputs_bounds_the_mean_of_a_random_walk():
    """Reference: with exact outputs a drift is known from n - 1 increments, sigma / sqrt(n - 1)."""
    h, sigma, n = 0.005, 0.03, 50
    model = constant_model(
        np.array([[1.0, h], [0.0, 1.0]]),
        np.eye(1, 2),
        np.array([1e-20]),
        n,
        Gamma=np.array([[h * sigma], [0.0]]),
    )
    drift = bounds(model, FIRST, n, np.array([1.0, 1.0]))[0, 1]
    # The prior of 1 adds (0.0043)^2 / 2 = 1e-5.
    assert_allclose(drift, sigma / np.sqrt(n - 1), rtol=2e-5)


def test_bound_without_noise_of_inputs_is_the_inverse_of_gramian_and_prior():
    """Two recursions of one quantity, information and covariance; random stable systems."""
    rng = np.random.default_rng(1)
    for _ in range(5):
        A = rng.normal(size=(3, 3)) - 3.0 * np.eye(3)
        Phi, C, R = expm(0.1 * A), rng.normal(size=(2, 3)), np.array([0.1, 0.3])
        model = constant_model(Phi, C, R, 20)
        prior = np.array([1.0, 2.0, 0.5])
        information = gramians(model, FIRST, 20)[0] + np.diag(prior**-2)
        through = np.linalg.matrix_power(Phi, 19)
        covariance = through @ np.linalg.inv(information) @ through.T
        deviation = bounds(model, FIRST, 20, prior)[0]
        # Double precision; conditions stay below 1e6.
        assert_allclose(deviation, np.sqrt(np.diag(covariance)), rtol=1e-8)


def test_gramian_of_a_stable_system_solves_lyapunov_equations():
    A, C = np.array([[-1.0, 2.0], [-3.0, -2.0]]), np.array([[1.0, 0.5]])
    h, n = 0.01, 2000
    gramian = gramians(constant_model(expm(A * h), C, np.ones(1), n), FIRST, n)[0]
    # 20 s are 30 time constants: the rest is exp(-60).
    assert_allclose(gramian, solve_discrete_lyapunov(expm(A * h).T, C.T @ C), rtol=1e-9)
    # The sum is a rectangle rule for the integral: off by h/2 of its first value, h/2 * C'C.
    continuous = solve_continuous_lyapunov(A.T, -C.T @ C)
    assert_allclose(h * gramian - 0.5 * h * C.T @ C, continuous, atol=1e-4)


@pytest.mark.parametrize("stiffness", [1e-3, 1.0, 1500.0])
def test_exponentials_are_those_of_scipy(stiffness):
    """From a slow mode to the slip mode at walking pace, whose rate times the step is 1500."""
    rng = np.random.default_rng(2)
    slow, basis = np.diag([0.0, -0.1, -1.0]), rng.normal(size=(3, 3))
    stack = np.array([basis @ (stiffness * slow) @ np.linalg.inv(basis), slow])
    # Each of up to 15 squarings may double the rounding error: 2^15 * 2e-16, relative to entries of
    # order one.
    assert_allclose(exponentials(stack), [expm(m) for m in stack], atol=1e-10)


# --- models ---


def test_only_the_minimal_model_is_observable(minimal, full):
    """The finding of Schwarz et al. (2018), section "Theoretical background"."""
    assert linear_test(minimal, SYSTEM).observable
    test = linear_test(full, SYSTEM)
    assert not test.observable
    assert test.invisible == ("betaB", "omegaBeta")
    assert set(test.invisible) <= set(test.unobservable)


@pytest.mark.parametrize("muWR", [0.15, 0.225, 0.40])
def test_pitch_of_brake_units_hides_whatever_the_rail(full, muWR):
    """Pads that slide at 14 m/s push with a force that does not depend on their velocity."""
    assert linear_test(full, SYSTEM, braking(muWR=muWR)).invisible == ("betaB", "omegaBeta")


def test_bounce_of_the_frame_is_seen_weakly_through_the_wheel_load(full):
    information = linear_test(full, SYSTEM).information
    # By direction: pitch (2), bounce (2), speeds (2). Bounce is far above rounding (1e-8) and three
    # orders below the speeds: whether it counts depends on noise, hence on the threshold.
    assert (information[:2] < 1e-8).all()
    assert (information[2:4] > 1e-2).all()
    assert (information[2:4] < 1e-3 * information[4]).all()


def test_pitch_of_brake_units_shows_when_the_pads_nearly_stop_sliding(full):
    # 0.02 m/s on the rim are 0.043 rad/s, within the 0.05 rad/s in which pad friction is smoothed.
    test = linear_test(full, SYSTEM, braking(speed=0.02))
    assert not set(test.invisible) & {"betaB", "omegaBeta"}


def test_operating_point_carries_the_brake_torque(full):
    x, u = settle(full, braking())
    force, Fz = full.get(full.variables(["Fx", "Fz"]))
    state = dict(zip(full.states, x, strict=True))
    # Steady state by hand: rW Fx = 3 rB muDC kappa (pB - p0) + losses; kF zF = 3 F; Fz = Fz0.
    pads = 3 * 0.30 * 0.1086 * (u[0] - 0.25e5)
    loss = 25.0 + 0.6 * state["omegaW"] + 0.004 * state["omegaW"] ** 2
    assert_allclose(0.46 * force, 0.30 * pads + loss, rtol=1e-5)
    assert_allclose(2.44e6 * state["zF"], pads, rtol=1e-5)
    assert_allclose(Fz, 80e3, rtol=1e-5)


def test_pad_friction_is_unknown_without_pressure(minimal):
    x, u = settle(minimal, braking(pressure=0.0))
    assert_allclose(friction_bounds(minimal, x, u)[1], FRICTION_PRIOR[1], rtol=1e-9)


def test_adhesion_is_unknown_at_zero_slip(minimal):
    u = np.array([2.7e5, 0.0, 0.0, 0.0])
    x = np.array([22.0 / {"omegaW": 0.46, "omegaR": 0.70}[name] for name in minimal.states])
    assert_allclose(friction_bounds(minimal, x, u)[0], FRICTION_PRIOR[0], rtol=1e-9)


def test_both_frictions_are_known_near_the_limit_of_adhesion(minimal):
    x, u = settle(minimal, braking(muWR=0.15))
    adhesion, pads = friction_bounds(minimal, x, u)
    # 2.7 bar use 0.099 of the 0.12 that muWR 0.15 offers here: the limits of usefulness hold.
    assert adhesion < 0.05
    assert pads < 0.01


def test_direction_of_rotation_does_not_matter(minimal):
    x, u = settle(minimal, braking())
    forward, backward = friction_bounds(minimal, x, u), friction_bounds(minimal, -x, u)
    # Equal but for the order of rounding.
    assert_allclose(backward, forward, rtol=1e-6)


def test_bound_of_pad_friction_is_that_of_the_rollers_slope(minimal):
    """Reference: in quasi-steady braking the pads' force is read off the roller's deceleration."""
    x, u = settle(minimal, braking())
    bound = friction_bounds(minimal, x, u)[1]
    n, h, rB, rW, rR = HALF_A_SECOND, 0.005, 0.30, 0.46, 0.70
    # Mass of the wheelset counts with the roller: both decelerate together.
    inertia = 1500.0 + 110.0 * (rR / rW) ** 2
    torque_per_friction = 3 * rB * 0.1086 * (u[0] - 0.25e5) * rR / rW
    slope = 0.003 / h * np.sqrt(12.0 / (n * (n**2 - 1)))
    torque = 40.0 / np.sqrt(n - 1)
    simple = np.hypot(inertia * slope, torque) / torque_per_friction
    # Sensor and drive noise do not add exactly (an optimal filter weighs them): 15 %.
    assert_allclose(bound, simple, rtol=0.15)


def test_knowledge_of_adhesion_rises_steeply_with_utilisation(minimal):
    """Reference: Polach's law by hand at 40 m/s, 80 kN, mu0 0.40: +0.01 in mu0 changes the force
    of a wheel by 2.8, 24 and 95 N at 4, 8 and 12.5 kN."""
    sensitivity, slope, bound = [], [], []
    for force in (4e3, 8e3, 12.5e3):
        speed = 40.0
        loss = 25.0 + 0.6 * speed / 0.46 + 0.004 * (speed / 0.46) ** 2
        pressure = 0.25e5 + (0.46 * 2 * force - loss) / (3 * 0.30 * 0.30 * 0.1086)
        x, u = settle(minimal, braking(speed, pressure, muWR=0.40))
        sensitivity.append(force_change(minimal, x, u, 0.01))
        wheelset = minimal.states.index("omegaW")
        minimal.set(minimal.variables(["dmuWR"]), u[2:3])
        # One wheel: JW d(der(omegaW))/d(omegaW) = -2 rW^2 dF/dw [N.s/m].
        slope.append(-110.0 * minimal.state_jacobian()[wheelset, wheelset] / (2 * 0.46**2))
        bound.append(friction_bounds(minimal, x, u, prior=(1e3, 1e3))[0])
    # The reference is rounded to two digits, and is the mean slope over the step of 0.01.
    assert_allclose(sensitivity, [2.8, 24.0, 95.0], rtol=0.04)
    # What is measured is slip: its mean error times the slope of the force, over the sensitivity.
    noise = np.hypot(0.46 * (0.002 + 3e-4 * 40.0 / 0.46), 0.70 * 0.003) / np.sqrt(HALF_A_SECOND)
    expected = noise * np.array(slope) / (np.array(sensitivity) / 0.01)
    # Sensitivities belong to a step of 0.01, bounds to the tangent: 5 %.
    assert_allclose(bound, expected, rtol=0.05)
    assert bound[0] / bound[1] > 8.0


def force_change(fmu, x, u, step):
    """Change of the force of one wheel with muWR at constant slip [N]."""
    force, friction = fmu.variables(["Fx"]), fmu.variables(["dmuWR"])
    fmu.set_states(x)
    values = []
    for value in (u[2], u[2] + step):
        fmu.set(friction, np.array([value]))
        values.append(fmu.get(force)[0])
    return 0.5 * (values[1] - values[0])


def test_local_gramian_is_the_empirical_gramian_of_the_nonlinear_model(minimal):
    """Reference: Lall, Marsden, Glavaski (1999): simulations from states moved to and fro."""
    n, h = 20, 0.005
    x0, u0 = settle(minimal, braking())
    time = h * np.arange(n)
    u = np.tile(u0, (n, 1))
    u[:, 0] += 4e5 * time  # 4 bar/s, as fast as brakes fill
    inputs = minimal.variables(["pB", "tauR", "dmuWR", "dmuDC"])

    def simulate(x: Vector, friction: Vector) -> np.ndarray:
        path = [x]
        for k in range(n - 1):
            minimal.set(inputs, u[k] + np.array([0.0, 0.0, *friction]))

            def rates(_: float, state: Vector) -> Vector:
                minimal.set_states(state)
                return minimal.derivatives()

            path.append(solve_ivp(rates, (0, h), path[-1], "Radau", rtol=1e-9, atol=1e-9).y[:, -1])
        return np.array(path)

    path = simulate(x0, np.zeros(2))
    measured = [minimal.states.index(name) for name in ("omegaW", "omegaR")]
    noise = np.column_stack(
        [output.deviation(path[:, at]) for output, at in zip(SYSTEM.outputs, measured, strict=True)]
    )
    steps = np.array([1e-3, 1e-3, 1e-3, 1e-3])
    sensitivity = []
    for j, step in enumerate(steps):
        sides = []
        for side in (step, -step):
            move = side * np.eye(4)[j]
            sides.append(simulate(x0 + move[:2], move[2:])[:, measured])
        sensitivity.append((sides[0] - sides[1]) / (2 * step) / noise)
    S = np.array(sensitivity).reshape(4, -1)
    model = linearise_along(minimal, SYSTEM, time, path, u)
    unit = np.sqrt(np.diag(S @ S.T))
    local = gramians(model, FIRST, n)[0] / np.outer(unit, unit)
    # Jacobians of a step's begin lag 2.5 ms: 0.01 bar of 2.7, in its sixth power (sensitivity to
    # adhesion is cubic, the Gramian its square) 2.2 %.
    assert_allclose(local, S @ S.T / np.outer(unit, unit), atol=0.03)


# --- the command ---


@pytest.fixture
def start_of_a_stop(tmp_path):
    """The first twelve seconds of a recorded dry stop, as a case folder."""
    folder = tmp_path / "dry"
    folder.mkdir()
    (folder / "case.toml").write_text((CASE / "case.toml").read_text())
    lines = (CASE / "measured.csv").read_text().splitlines()
    (folder / "measured.csv").write_text("\n".join(lines[:2401]) + "\n")
    return folder


def test_command_tells_when_frictions_are_known(start_of_a_stop, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    out = tmp_path / "out"
    assert main(["observability", str(start_of_a_stop), "--out", str(out), "--workers", "1"]) == 0
    assert "FullObserver: rank" in capsys.readouterr().out
    assert (out / "dry.png").stat().st_size > 0
    summary = json.loads((out / "observability.json").read_text())
    check("observability", summary)
    page = check_page(out / "index.html", summary)
    (row,) = page.get_element_by_id("case-table").xpath("tbody/tr")
    useful = summary["cases"]["dry"]["models"]["MinimalObserver"]["useful"]
    assert f"{100 * useful['dmuDC']:.0f}" in [cell.text_content() for cell in row]
    assert page.get_element_by_id("linear-FullObserver").xpath("tbody/tr")
    assert summary["linear"]["MinimalObserver"]["observable"]
    stop = summary["cases"]["dry"]["models"]
    # Pads touch within the first two of some 75 windows: 97 %.
    assert stop["MinimalObserver"]["useful"]["dmuDC"] > 0.95
    assert stop["FullObserver"]["states_observable"]["betaB"] == 0.0
    table = np.genfromtxt(out / "dry.csv", delimiter=",", names=True)
    coasting = table["time_s"] < 3.0
    # Three seconds of coasting come first in every recording: nothing is known but the prior.
    bound = table["MinimalObserverbound_dmuDC_1"][coasting]
    assert_allclose(bound, FRICTION_PRIOR[1], rtol=0.01)


def test_command_refuses_a_missing_full_model(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    assert main(["observability", str(CASE), "--out", str(tmp_path), "--full-fmu", "none.fmu"]) == 2
    assert "none.fmu: found no such file" in capsys.readouterr().err
