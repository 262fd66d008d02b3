"""Steps: a body that slides, sticks and breaks away; swings that sampled steps do not damp."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.steps import step, steps
from workbench.diagnosis.simulation.tangent import advance, renew, tangent, tell
from workbench.models.fmu import FMU
from workbench.models.native import instance
from workbench.recordings.case import read_cases
from workbench.system.registry import load_system

from .built import build_here, build_text, machine_file, write_case

H = 0.005


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> Iterator[FMU]:
    with FMU(build_text(tmp_path_factory.mktemp("block"), machine_file("block/Block.mo"))) as fmu:
        yield fmu


def moved(block: FMU, force: Callable[[float], float], start: float, end: float) -> Matrix:
    """Positions and velocities in steps of 5 ms, (n, 2), from a velocity at the start."""
    block.start({"v": start})
    model, work = instance(block, ["F"], [], []), steps(block, np.array([0, 1]), 1)
    model.x[:], model.u[0] = block.get_states(), force(0.0)
    block.set(block.variables(["F"]), model.u)
    course = [model.x.copy()]
    for k in range(round(end / H)):
        work.to[0] = force((k + 1) * H)
        assert step(model, work, H) == 0
        course.append(model.x.copy())
    return np.array(course)


def test_a_block_comes_to_rest_where_its_energy_is_spent(block):
    x, v = moved(block, lambda t: 0.0, 1.0, 3.0).T
    # m v^2/(2 coulomb), after m v/coulomb; half a step of deceleration over a step is 2e-5 m.
    assert x[-1] == pytest.approx(1.0 / 3.0, abs=4e-5)
    assert np.abs(v[round(0.68 / H) :]).max() < 1e-9
    assert x[60] == pytest.approx(0.3 - 0.75 * 0.3**2, abs=1e-6)


def test_a_block_sticks_without_chatter_until_it_breaks_away(block):
    x, v = moved(block, lambda t: 2.0 * t, 0.0, 2.5).T
    stuck = slice(0, round(1.45 / H))
    # Below 0.97 of the friction it creeps at less than 2.1 v0.
    assert np.abs(v[stuck]).max() < 2.1e-5
    assert np.abs(x[stuck]).max() < 3e-5
    # Then the force grows by 2 N/s above the friction: m v = t^2, for a second.
    assert v[-1] == pytest.approx(0.5, abs=2e-3)
    assert x[-1] == pytest.approx(1.0 / 6.0, abs=2e-3)


@pytest.mark.parametrize("amplitude", [3.3, 4.0, 8.0])
def test_stick_and_slip_agree_with_an_error_controlled_integrator(amplitude, block):
    def force(t: float) -> float:
        return amplitude * float(np.sin(2.0 * np.pi * t))

    def rates(t: float, state: Vector) -> list[float]:
        v = state[1]
        return [v, (force(t) - 3.0 * float(np.tanh(v / 1e-5))) / 2.0]

    result = moved(block, force, 0.0, 2.0)
    reference = solve_ivp(
        rates, (0.0, 2.0), [0.0, 0.0], "Radau", np.arange(len(result)) * H, rtol=1e-7, atol=1e-10
    ).y.T
    # Which way a step that meets a kink goes there, is known to some thousandths of the motion.
    assert np.abs(result - reference)[:, 0].max() < 5e-3 * np.abs(reference[:, 0]).max()


SAMPLE, NOISE, FADES = 2e-3, 1e-2, 3.0  # [s], [m], [1/s]
SYSTEM = f"""title = "A mass on a spring"
sample_time = "{SAMPLE} s"
[models]
observer = {{ class = "Mass" }}
[parameters]
w = "OMEGA rad/s"
a = "{FADES} 1/s"
[inputs.f]
unit = "m/s2"
noise = "0 m/s2"
scale = "1 m/s2"
[outputs.y]
unit = "m"
noise = "{NOISE} m"
scale = "1 m"
"""


@pytest.mark.parametrize(("samples", "fine"), [(9, True), (400, False)])
def test_a_fading_swing_leaves_noise_alone(samples, fine, tmp_path):
    damped = 2.0 * np.pi / (samples * SAMPLE)
    (tmp_path / "package.mo").write_text(machine_file("fading_swing/package.mo"))
    omega = float(np.hypot(damped, FADES))
    (tmp_path / "system.toml").write_text(SYSTEM.replace("OMEGA", repr(omega)))
    time = SAMPLE * np.arange(1000)
    swing = np.exp(-FADES * time) * (np.cos(damped * time) + FADES / damped * np.sin(damped * time))
    read = swing + NOISE * np.random.default_rng(1).standard_normal(time.size)
    read[0] = swing[0]
    columns = {"time [s]": time, "f [m/s2]": np.zeros(time.size), "y [m]": read}
    case = write_case(tmp_path / "swing", columns, "Swing")
    system = load_system(str(tmp_path))
    path = tmp_path / "Mass.fmu"
    build_here(tmp_path / "package.mo", "Swing.Mass", path)
    values = {"w": omega, "a": FADES, "y": 1.0, "v": 0.0}
    with ResidualModel(
        ModelSource(path, system, values), read_cases([case], system)
    ) as simulations:
        assert (simulations.simulated.parts > 1) == fine
        ((rms,), _) = simulations.at([values])[0].sizes
    # Noise of a thousand samples is known to 2.2 %; steps may add a thousandth of its square.
    assert rms == pytest.approx(NOISE, rel=0.06)


# --- derivatives by parameters, against closed forms ---


END = 2.0  # [s]


@pytest.fixture(scope="module", params=[2, 3])
def tank(request, tmp_path_factory) -> Iterator[FMU]:
    folder, model = tmp_path_factory.mktemp("tank"), machine_file("draining_tank/Tank.mo")
    with FMU(build_text(folder, model, request.param)) as fmu:
        yield fmu


def derivatives(tank: FMU, columns: list[tuple[str, ...]], inflow: float, count: int) -> Matrix:
    """Derivatives of what is read, by columns, at samples, (n, p)."""
    stiff, h = np.array([1]), END / count
    tank.start({})
    model, work = instance(tank, ["q"], [], ["y"]), steps(tank, stiff, 1)
    along = tangent(tank, model, columns, count + 1, stiff)
    model.x[:], model.u[0], work.to[0] = tank.get_states(), inflow, inflow
    tank.set(tank.variables(["q"]), model.u)
    assert renew(model, along) == 0
    tell(along, 0)
    for k in range(count):
        assert step(model, work, h) == 0
        assert advance(model, along, h) == 0
        tell(along, k + 1)
    return -along.errors[:, 0, :]  # an error is what was measured without what is predicted


def test_derivatives_are_those_of_the_closed_form(tank):
    inflow, k, c, count = 0.3, 0.8, 1.5, 200
    slopes = derivatives(tank, [("k",), ("c",), ("T",), ("h", "s")], inflow, count)
    t = np.linspace(0.0, END, count + 1)
    level = inflow / k + (2.0 - inflow / k) * np.exp(-k * t)
    by_k = -inflow / k**2 * (1.0 - np.exp(-k * t)) - (2.0 - inflow / k) * t * np.exp(-k * t)
    # The sensor lags by T = 1e-4 s, in which a level changes by less than 2e-4 m. Steps of order
    # two: (k h)^2 = 6e-5 of each, times the duration.
    np.testing.assert_allclose(slopes[:, 0], c * by_k, atol=5e-4)
    np.testing.assert_allclose(slopes[1:, 1], level[1:], atol=5e-4)
    # A sensor that is later shows what was before.
    np.testing.assert_allclose(slopes[5:, 2], -c * (inflow - k * level)[5:], atol=2e-2)
    np.testing.assert_allclose(slopes[:, 3], c * np.exp(-k * t), atol=5e-4)


def test_halving_the_step_quarters_the_error(tank):
    errors = []
    k, c, T = 0.8, 1.5, 1e-4
    for count in (20, 40):
        slopes = derivatives(tank, [("k",), ("c",)], 0.0, count)
        t = np.linspace(0.0, END, count + 1)
        # The tank drains as h0 exp(-k t), of which the sensor shows 1/(1 - k T).
        exact = 2.0 * c * np.exp(-k * t) * (T / (1.0 - k * T) ** 2 - t / (1.0 - k * T))
        errors.append(np.abs(slopes[2:, 0] - exact[2:]).max())
    # A fourth, and a little of the next order.
    assert 0.2 < errors[1] / errors[0] < 0.3


def test_variables_that_one_value_sets_add_up(tank):
    alone = derivatives(tank, [("k",), ("c",)], 0.3, 50)
    together = derivatives(tank, [("k", "c")], 0.3, 50)
    # Sums in another order.
    np.testing.assert_allclose(together[:, 0], alone[:, 0] + alone[:, 1], rtol=1e-9, atol=1e-12)
