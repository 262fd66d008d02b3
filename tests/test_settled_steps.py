"""Steps are as fine as a machine swings: sampled nine times a period, it is not damped by them."""

import numpy as np
import pytest

from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.recordings.case import read_cases
from workbench.system.registry import load_system

from .built import build_here, write_case

H, NOISE, FADES = 2e-3, 1e-2, 3.0  # [s], [m], [1/s]
LIBRARY = """package Swing "A mass on a spring"
  model Mass "Mass, spring and damper"
    parameter Real w(unit="rad/s") = 1.0;
    parameter Real a(unit="1/s") = 1.0;
    input Real f(unit="m/s2");
    output Real y(unit="m", start=1.0, fixed=true);
    Real v(unit="m/s", start=0.0, fixed=true);
  equation
    der(y) = v;
    der(v) = f - w^2*y - 2.0*a*v;
  end Mass;
end Swing;
"""
SYSTEM = f"""title = "A mass on a spring"
sample_time = "{H} s"
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
    damped = 2.0 * np.pi / (samples * H)
    (tmp_path / "package.mo").write_text(LIBRARY)
    omega = float(np.hypot(damped, FADES))
    (tmp_path / "system.toml").write_text(SYSTEM.replace("OMEGA", repr(omega)))
    time = H * np.arange(1000)
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
