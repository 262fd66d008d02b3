"""The multibody reference model against closed forms, FASTSIM and the minimal model."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from workbench.errors import FMUError
from workbench.models.compiler.explicit import StateSpace, make_explicit
from workbench.models.compiler.flat import flatten
from workbench.models.fmu import FMU

LIBRARY = Path(__file__).parents[1] / "modelica" / "WheelsetRig" / "package.mo"
RADIUS_WHEEL, RADIUS_ROLLER = 0.46, 0.70  # m
INERTIA_TRAIN = 7840.0  # kg.m2 at the roller: 16 t
INERTIA_ROLLER = 1500.0  # kg.m2


@dataclass(frozen=True)
class Stop:
    """A simulated stop: times t (n,) [s], roller speed v (n,) [m/s], creep force Fx (n,) [N]."""

    t: np.ndarray
    v: np.ndarray
    Fx: np.ndarray
    outputs: Mapping[str, np.ndarray]

    def time_at(self, speed: float) -> float:
        """Time at which |v| falls below `speed` [m/s]."""
        return float(np.interp(-speed, -abs(self.v), self.t))

    def force_at(self, time: float) -> float:
        return float(np.interp(time, self.t, abs(self.Fx)))


@pytest.fixture(scope="module")
def reference() -> StateSpace:
    return make_explicit(flatten(LIBRARY, "WheelsetRig.Reference"))


@pytest.fixture(scope="module")
def small_model() -> StateSpace:
    return make_explicit(flatten(LIBRARY, "WheelsetRig.MinimalObserver"))


def values(model: StateSpace, group: str, given: Mapping[str, float]) -> list[float]:
    """Start or default values of the model's states or parameters, with those given."""
    variables = getattr(model, group)
    assert set(given) <= {v.name for v in variables}
    return [given.get(v.name, v.start) for v in variables]


def simulate_stop(
    model: StateSpace,
    speed: float,
    pressure: float,
    parameters: Mapping[str, float],
    duration: float,
    *,
    truth: bool,
) -> Stop:
    """Brake from `speed` [m/s, signed] at `pressure` [Pa] with the inertia-simulating drive.

    The pressure comes 0.2 s late with a lag of 0.9 s. With `truth`, friction follows speed,
    disc temperature (from 60 degC, 75 kg, 500 J/kgK, 93 % of the heat) and normal force;
    without, it is constant.
    """
    x, t = model.x, model.t
    by_name = {v.name: x[i] for i, v in enumerate(model.states)}
    by_name |= {v.name: model.w[i] for i, v in enumerate(model.outputs)}
    p = {v.name: model.p[i] for i, v in enumerate(model.parameters)}
    omegaW, omegaR = by_name["omegaW"], by_name["omegaR"]
    pB = pressure * (1.0 - ca.exp(-ca.fmax(0.0, t - 0.2) / 0.9))
    loss = (40.0 + ca.fabs(omegaR) + 0.02 * omegaR**2) * ca.tanh(omegaR / 0.05)
    temperature = ca.SX.sym("T")
    force = ca.fmax(100.0, p["actuation.kappa"] * (pB - p["actuation.p0"]))
    mu = ca.SX(0.30)
    if truth:
        fade = (1.0 - 4e-4 * (temperature - 100.0)) * (force / 35e3) ** -0.04
        mu = 0.30 * (1.0 + 0.20 * (1.0 - ca.fabs(RADIUS_ROLLER * omegaR) / 22.0)) * fade
    heat = 0.93 * mu * force * 0.30 * ca.fabs(omegaW)
    drive = (1.0 - p["JR"] / INERTIA_TRAIN) * (RADIUS_ROLLER * by_name["Fx"] + loss)
    inputs: dict[str, ca.SX] = {"pB": pB, "dmuDC": mu - 0.30, "tauR": drive}

    def close(expression: ca.SX) -> ca.SX:
        # The drive reads Fx, which does not depend on tauR: no loop.
        for name in ("tauR", "pB", "dmuDC"):
            u = model.u[[v.name for v in model.inputs].index(name)]
            expression = ca.substitute(expression, u, inputs[name])
        return ca.substitute(expression, model.u, ca.SX.zeros(model.u.shape))

    state = ca.vertcat(x, temperature)
    rate = ca.vertcat(close(model.f), heat / (75.0 * 500.0))
    grid = np.linspace(0.0, duration, int(duration * 20) + 1)
    dae = {"x": state, "p": model.p, "t": t, "ode": rate}
    options = {"abstol": 1e-9, "reltol": 1e-7, "max_num_steps": 200_000}
    integrator = ca.integrator("stop", "cvodes", dae, 0.0, list(grid), options)
    start = {"omegaW": speed / RADIUS_WHEEL, "omegaR": speed / RADIUS_ROLLER}
    default = values(model, "parameters", parameters)
    path = integrator(x0=[*values(model, "states", start), 60.0], p=default)["xf"]
    read = ca.Function("read", [state, model.p, t], [close(model.w), omegaR])
    w, rotation = read.map(grid.size)(path, ca.DM(default), ca.DM(grid).T)
    outputs = {v.name: np.array(w)[i] for i, v in enumerate(model.outputs)}
    return Stop(grid, RADIUS_ROLLER * np.array(rotation)[0], outputs["Fx"], outputs)


def test_reference_has_two_states_for_each_of_21_degrees_of_freedom(reference):
    assert len(reference.states) == 42
    assert reference.state_outputs == ["omegaW", "omegaR"]


@pytest.mark.parametrize(
    "change", [{}, {"Fz": 88e3}, {"side[2]": -1.0}, {"lG": -0.4}, {"rW": 0.425}, {"lC": 0.1}]
)
def test_nothing_moves_at_rest(reference, change):
    """Gravity, contact and preloads balance; these follow from masses, levers and wheel load."""
    rates = ca.Function("f", [reference.x, reference.u, reference.p], [reference.f])(
        values(reference, "states", {}), 0, values(reference, "parameters", change)
    )
    # The greatest single force, 80 kN, on 110 kg would be 700 m/s2; rounding leaves 1e-13 of it,
    # 1e-9 is slack.
    assert abs(np.array(rates)).max() < 1e-9 * 700.0


@pytest.mark.parametrize("name", ["Reference", "FullObserver", "MinimalObserver"])
def test_no_parameter_within_its_bounds_divides_by_zero(name):
    """Each parameter in turn at its lower bound, or at zero where that is within bounds.

    A value that the model's own assertions refuse is out of bounds.
    """
    model = make_explicit(flatten(LIBRARY, f"WheelsetRig.{name}"))
    arguments = [model.t, model.x, model.u, model.p]
    evaluate = ca.Function("f", arguments, [model.f, model.w, model.assertions])
    # Braking: every state moves, every force acts.
    state = dict.fromkeys((v.name for v in model.states), 1e-3) | {"omegaW": 60.0, "omegaR": 39.5}
    x = values(model, "states", state)
    u = [2e5 if v.name == "pB" else 0.0 for v in model.inputs]
    broken = []
    for parameter in model.parameters:
        p = values(model, "parameters", {parameter.name: max(parameter.minimum or 0.0, 0.0)})
        f, w, holds = evaluate(0.0, x, u, p)
        if np.array(holds).all() and not np.isfinite(np.array(ca.vertcat(f, w))).all():
            broken.append(parameter.name)
    assert broken == []


@pytest.mark.parametrize(
    ("change", "match"), [({"lG": 0.0}, "guidance arms"), ({"Fz": 30e3}, "less than the weight")]
)
def test_a_rig_that_cannot_stand_is_refused_with_a_reason(reference_path, change, match):
    with FMU(reference_path) as fmu, pytest.raises(FMUError, match=match):
        fmu.start({}, change)


def modes(model: StateSpace, parameters: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Natural frequencies |lambda|/(2 pi) [Hz] of the modes at rest, and participation.

    participation[i, k] is the share of state i in mode k; it does not depend on units
    (Perez-Arriaga, Verghese, Schweppe 1982).
    """
    jacobian = ca.Function("A", [model.x, model.u, model.p], [ca.jacobian(model.f, model.x)])(
        values(model, "states", {}), 0, values(model, "parameters", parameters)
    )
    eigenvalues, right = np.linalg.eig(np.array(jacobian))
    participation = abs(right * np.linalg.pinv(right).T)
    oscillates = eigenvalues.imag > 0.0
    return abs(eigenvalues[oscillates]) / (2.0 * np.pi), participation[:, oscillates]


def frequency_of(model: StateSpace, state: str, parameters: Mapping[str, float]) -> float:
    """Lowest frequency among the modes of which the named state is a main part.

    Main: at least a quarter of the part that it has in any mode.
    """
    frequencies, participation = modes(model, parameters)
    part = participation[[v.name for v in model.states].index(state)]
    return float(frequencies[part >= 0.25 * part.max()].min())


@pytest.mark.parametrize(
    ("state", "frequency", "tolerance"),
    [
        # 3.9 Hz is the frame alone on its primary springs; brake units (+8 % mass) and the
        # vertical cylinders (+25 % stiffness) shift it by 5 %.
        ("frameMotion.v[3]", 3.93, 0.07),
        # Cylinders and axle boxes are set for this mode, to 1 MN/m in 78.
        ("frameMotion.v[1]", 21.6, 0.01),
        # Uncoupled: 179 Hz on Hertz springs; bushings and arms in parallel add 2 %.
        ("wheelset.v[3]", 178.9, 0.03),
        # Uncoupled on a fixed frame; the frame of 4 t moves along, mB/mF = 3 %.
        ("unit[2].bounce.v", 48.0, 0.03),
        ("unit[2].pitch.w", 39.8, 0.03),
    ],
)
def test_mode_has_the_frequency_of_its_mass_and_spring(reference, state, frequency, tolerance):
    assert frequency_of(reference, state, {}) == pytest.approx(frequency, rel=tolerance)


def test_rigid_rig_on_its_longitudinal_cylinders_is_one_mass_on_one_spring(reference):
    """With stiff bushings and guides, 6.53 t and the rolling inertia move on two cylinders."""
    stiff = {f"axleBox[{j}].c[1]": 60e10 for j in (1, 2)} | {"guide.cRot[2]": 2e13}
    # At rest the wheels do not slip: wheelset and roller turn along, in series.
    wheel = 110.0 / RADIUS_WHEEL**2
    roller = INERTIA_ROLLER / RADIUS_ROLLER**2
    mass = 6530.0 + wheel * roller / (wheel + roller)
    expected = np.sqrt(2.0 * 78e6 / mass) / (2.0 * np.pi)
    frequency = frequency_of(reference, "frameMotion.v[1]", stiff)
    # The units' calliper modes at 40 and 48 Hz couple in through pitch; 1 % is slack.
    assert frequency == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("speed", "pressure", "direction", "stop", "early", "late"),
    [
        (80.0, 1.5e5, 1.0, 40.0, 8.2e3, 9.7e3),
        (100.0, 2.7e5, 1.0, 27.6, 15.0e3, 18.3e3),
        (120.0, 3.6e5, 1.0, 25.5, 19.3e3, 24.4e3),
        (160.0, 4.2e5, 1.0, 30.9, 20.2e3, 27.9e3),
        (120.0, 2.7e5, -1.0, 33.9, 14.2e3, 18.1e3),
        (160.0, 3.6e5, -1.0, 35.9, 17.2e3, 23.9e3),
    ],
)
def test_dry_stop_takes_the_time_and_force_of_its_case(
    reference, speed, pressure, direction, stop, early, late
):
    """Six dry cases under the same friction law, against numbers of a two-mass calculation.

    Forces are those at 5 s and just before the stop.
    """
    run = simulate_stop(reference, direction * speed / 3.6, pressure, {}, 1.08 * stop, truth=True)
    # The numbers are rounded to 0.5 %, and neglect the callipers' motion and the wheel load.
    assert run.time_at(0.1) == pytest.approx(stop, rel=0.05)
    assert run.force_at(5.0) == pytest.approx(early, rel=0.05)
    assert run.force_at(run.time_at(1.0)) == pytest.approx(late, rel=0.05)
    # Energy: each disc takes a third of the train's energy less what bearings take, 1..4 %.
    energy = 0.5 * (INERTIA_TRAIN / RADIUS_ROLLER**2 + 110.0 / RADIUS_WHEEL**2) * (speed / 3.6) ** 2
    heat = [np.trapezoid(run.outputs[f"discPower[{i}]"], run.t) for i in (1, 2, 3)]
    assert 0.94 * energy < sum(heat) < energy
    assert np.ptp(heat) < 1e-3 * energy  # three units alike


def test_minimal_model_stops_as_the_reference_does(reference, small_model):
    """Constant friction, 160 km/h, 4.2 bar: the frame's motion costs little of either."""
    full = simulate_stop(reference, 160.0 / 3.6, 4.2e5, {}, 34.0, truth=False)
    small = simulate_stop(small_model, 160.0 / 3.6, 4.2e5, {"muWR": 0.40}, 34.0, truth=False)
    # Speeds differ by less than the slip of 0.1 m/s changes with wheel load, 2 mm/s at 1.5 m/s2.
    assert full.time_at(0.5) == pytest.approx(small.time_at(0.5), abs=0.002)
    settled = (full.t > 4.0) & (full.v > 0.5)
    # 1e-3 of 25 kN: vibration has decayed, and the wheel load acts on slip alone.
    assert abs(full.Fx - small.Fx)[settled].max() < 25.0
    assert abs(full.Fx).max() > 24e3


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_braking_shifts_the_wheel_load(reference, direction):
    """Pads push the frame down on primary springs and vertical cylinders; these give it back."""
    run = simulate_stop(reference, direction * 40.0, 4.2e5, {}, 8.0, truth=False)
    shift = run.outputs["FzL"][-1] - 80e3
    on_the_pads = run.Fx[-1] * RADIUS_WHEEL / 0.30
    of_the_cylinders = 0.3 / (0.3 + 1.22)
    # 2 % of Fx for bearings and rotation, and the elasticity of arms and axle boxes.
    assert shift == pytest.approx(0.5 * of_the_cylinders * on_the_pads, rel=0.08)
    assert 0.04 < abs(shift) / 80e3 < 0.055


def test_one_wet_unit_takes_its_share_of_the_force(reference):
    dry = simulate_stop(reference, 30.0, 2.7e5, {}, 8.0, truth=False)
    wet = simulate_stop(reference, 30.0, 2.7e5, {"muDCunit[2]": 0.4}, 8.0, truth=False)
    # Bearing friction and rotation of the wheelset take 2 % of Fx unchanged.
    assert wet.force_at(6.0) / dry.force_at(6.0) == pytest.approx(2.4 / 3.0, abs=0.01)
    power = [wet.outputs[f"discPower[{i}]"][120] for i in (1, 2)]
    assert power[1] / power[0] == pytest.approx(0.4, rel=1e-3)  # same speed; creep in tanh


def creep_by_strips(creepage: float, load: float, friction: float, *, ellipsoid: bool) -> float:
    """Longitudinal creep force [N] in pure longitudinal creepage: FASTSIM (Kalker 1982).

    The ellipse is cut into strips along the rolling direction. Along a strip the traction grows
    with distance from the leading edge and is cut off at friction times pressure. The
    flexibility is the one that gives Kalker's linear coefficient. Kalker's pressure is a
    paraboloid; with `ellipsoid` it is that of Hertz, as Polach assumes.

    J. J. Kalker (1982), A fast algorithm for the simplified theory of rolling contact, Vehicle
    System Dynamics 11, 1-13.
    """
    a, b, shear, c11 = 5.23e-3, 5.51e-3, 80.5e9, 4.17  # load 80 kN, roller of 0.70 m
    flexibility = 8.0 * a / (3.0 * c11 * shear)
    strips, elements = 401, 800
    y = b * ((np.arange(strips) + 0.5) / strips * 2.0 - 1.0)
    length = a * np.sqrt(1.0 - (y / b) ** 2)
    dx = 2.0 * length / elements
    traction = np.zeros(strips)
    force = 0.0
    for k in range(elements):
        x = length - (k + 1.0) * dx
        height = np.maximum(0.0, 1.0 - (x / a) ** 2 - (y / b) ** 2)
        shape = 1.5 * np.sqrt(height) if ellipsoid else 2.0 * height
        limit = friction * shape * load / (np.pi * a * b)
        traction = np.minimum(traction + creepage / flexibility * dx, limit)
        force += float(np.sum(traction * dx) * 2.0 * b / strips)
    return force


def test_strips_start_with_kalkers_slope_and_end_at_friction():
    """The independent solution itself, at both ends where it is known."""
    stiffness = 80.5e9 * 5.23e-3 * 5.51e-3 * 4.17
    for ellipsoid in (True, False):
        # Elements of 1/800 and strips of 1/401: errors of first order, with a factor of 4.
        small = creep_by_strips(1e-7, 80e3, 0.4, ellipsoid=ellipsoid)
        assert small == pytest.approx(stiffness * 1e-7, rel=5e-3)
        large = creep_by_strips(10.0, 80e3, 0.4, ellipsoid=ellipsoid)
        assert large == pytest.approx(0.4 * 80e3, rel=5e-3)


@pytest.mark.parametrize(
    ("ellipsoid", "tolerance"),
    [
        # Polach's closed form is the integral over the same strips: what differs are the
        # elements (1/800) and K, rounded to 9.68 MN.
        (True, 0.005),
        # Kalker's paraboloid gives no friction at the edges, so slip begins earlier: up to
        # 8 % less force half way to saturation, none at either end.
        (False, 0.09),
    ],
)
@pytest.mark.parametrize("creepage", [1e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3, 1e-2, 2e-2])
def test_creep_force_agrees_with_fastsim_at_constant_friction(
    small_model, creepage, ellipsoid, tolerance
):
    speed = 20.0
    constant = {"polach.kA": 1.0, "polach.kS": 1.0, "polach.A": 1.0, "muWR": 0.40}
    state = {"omegaR": speed / RADIUS_ROLLER, "omegaW": speed * (1.0 - creepage) / RADIUS_WHEEL}
    read = ca.Function("w", [small_model.x, small_model.u, small_model.p], [small_model.w])
    w = read(values(small_model, "states", state), 0, values(small_model, "parameters", constant))
    force = 0.5 * float(w[[v.name for v in small_model.outputs].index("Fx")])
    expected = creep_by_strips(creepage, 80e3, 0.40, ellipsoid=ellipsoid)
    assert force == pytest.approx(expected, rel=tolerance)


# --- creep force, against Polach's law and published points of it ---


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
@given(w=st.floats(0.0, 40.0), v=st.floats(-45.0, 45.0), mu0=st.floats(0.05, 0.55))
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
