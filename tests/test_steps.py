"""Steps: a body that slides, sticks and breaks away; swings that sampled steps do not damp."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.steps import step, steps
from workbench.models.fmu import FMU
from workbench.models.native import instance
from workbench.recordings.case import read_cases
from workbench.system.registry import load_system

from .built import build_here, build_text, machine_file, write_case

MODEL = machine_file("block/Block.mo")
H = 0.005


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> Iterator[FMU]:
    with FMU(build_text(tmp_path_factory.mktemp("block"), MODEL)) as fmu:
        yield fmu


def moved(block: FMU, force: Callable[[float], float], start: float, end: float) -> Matrix:
    """Positions and velocities in steps of 5 ms, (n, 2), from a velocity at the start."""
    block.start({"v": start})
    model, work = instance(block, ["F"], [], []), steps(block, np.array([0, 1]), 1)
    model.x[:], model.u[0] = block.get_states(), force(0.0)
    block.set(block.variables(["F"]), model.u)
    found = [model.x.copy()]
    for k in range(round(end / H)):
        work.to[0] = force((k + 1) * H)
        assert step(model, work, H) == 0
        found.append(model.x.copy())
    return np.array(found)


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
LIBRARY = machine_file("fading_swing/package.mo")
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
    (tmp_path / "package.mo").write_text(LIBRARY)
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
