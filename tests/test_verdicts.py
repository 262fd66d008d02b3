"""A verdict names causes that are sure, and no set of causes in place of one change.

Plants are simulated by SciPy, never by the model's own FMU.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from workbench.diagnosis import Outcome
from workbench.system.registry import load_system
from workbench.system.system import System

from .built import build_text, declare, diagnosed, machine, write_case

COIL = """model Coil "A coil"
  parameter Real R(unit="Ohm") = 2.0 "Resistance";
  parameter Real L(unit="H") = 0.02 "Inductance";
  input Real u(unit="V") "Voltage";
  output Real i(unit="A", start=0.0, fixed=true, nominal=5.0) "Current";
equation
  L*der(i) = u - R*i;
end Coil;
"""
COIL_SYSTEM = """title = "A coil"
sample_time = "2 ms"
cases = "recordings"

[models]
observer = { fmu = "Coil.fmu" }

[inputs.u]
unit = "V"
noise = "0.01 V"
scale = "10 V"

[outputs.i]
unit = "A"
noise = "0.02 A"
scale = "5 A"
"""
# kg.m2, N.m/rad, N.m.s/rad of the model of tests/machines/bearings
JM, JL, STIFFNESS, DAMPING, FRICTION = 2e-3, 1e-2, 20.0, 0.04, 5e-3


def test_a_cause_whose_size_may_be_zero_is_not_found(tmp_path):
    """A coil warms by a law of time, which nothing of an FMU alone is: R was 'found', -1 to 9 %."""
    build_text(tmp_path, COIL)
    (tmp_path / "system.toml").write_text(COIL_SYSTEM)
    rng, time = np.random.default_rng(33), 2e-3 * np.arange(2001)
    for k in range(4):
        size, frequency, phase = rng.uniform(3, 10), rng.uniform(0.5, 8), rng.uniform(0, 6)

        def u(t, size=size, frequency=frequency, phase=phase):
            return size * np.sin(2.0 * np.pi * frequency * t + phase)

        def rate(t, i, u=u):
            return (u(t) - 2.0 * (1.05 - 0.05 * np.exp(-t)) * i) / 0.02

        run = solve_ivp(rate, (0.0, time[-1]), [0.0], t_eval=time, rtol=1e-9, max_step=2e-3)
        columns = {
            "time [s]": time,
            "u [V]": u(time) + 0.01 * rng.standard_normal(time.size),
            "i [A]": run.y[0] + 0.02 * rng.standard_normal(time.size),
        }
        write_case(tmp_path / "recordings" / f"{k}", columns, f"Run {k}")
    outcome = diagnosed(load_system(str(tmp_path)), tmp_path / "recordings", tmp_path / "out")
    assert outcome.diagnosis.verdict in ("partly explained", "unexplained")
    assert outcome.diagnosis.best.names == ("R",)
    doubts = [*outcome.warnings, *(n.text for n in outcome.diagnosis.nearest)]
    assert any("holds zero" in doubt or "may be zero" in doubt for doubt in doubts)


def drive(folder: Path, seed: int, *, heavier: float = 0.0, rubbing: float = 0.0) -> Outcome:
    """Diagnose three recordings of a flywheel on two bearings.

    Parameters
    ----------
    heavier : share by which the flywheel has more inertia than the model says.
    rubbing : more friction in the bearing of the flywheel alone [N.m.s/rad].
    """
    system: System = declare(folder, *machine("bearings"))
    rng, time = np.random.default_rng(seed), 2e-3 * np.arange(1500)
    for k in range(3):
        torques, x = np.repeat(rng.uniform(-0.4, 0.6, 15), 100), np.zeros(3)
        states = [x]
        for first in range(0, 1499, 100):

            def rates(_t, x, torque=torques[first]):
                wm, wl, twist = x
                m = STIFFNESS * twist + DAMPING * (wm - wl)
                lost = (FRICTION + rubbing) * wl
                return (
                    (torque - m - FRICTION * wm) / JM,
                    (m - lost) / (JL * (1.0 + heavier)),
                    wm - wl,
                )

            at = time[first + 1 : first + 101]
            run = solve_ivp(rates, (time[first], at[-1]), x, t_eval=at, rtol=1e-8, atol=1e-10)
            states += list(run.y.T)
            x = states[-1]
        wm, wl, _ = np.transpose(states) + 0.2 * rng.standard_normal((3, 1500))
        columns = {"time [s]": time, "torque [N.m]": torques, "wm [rad/s]": wm, "wl [rad/s]": wl}
        write_case(folder / "recordings" / f"{k}", columns, f"Run {k}", "%.7g")
    return diagnosed(system, folder / "recordings", folder / "out")


def test_causes_that_imitate_a_parameter_together_are_no_answer(tmp_path):
    """An inertia 10 % larger was 'found' as a drive, bearings and a shaft that each are wrong."""
    outcome = drive(tmp_path, 104, heavier=0.1)
    assert outcome.diagnosis.verdict == "unexplained"
    assert not outcome.diagnosis.causes
    text = "another value of Jl (Inertia of the flywheel) than 0.01 kg.m2: 0.011 kg.m2"
    assert text in outcome.sentence
    assert outcome.diagnosis.nearest[0].effects == ("Jl",)
    assert "Jl alone explains as much" in outcome.diagnosis.nearest[1].text


@pytest.mark.long
def test_causes_that_imitate_an_effect_in_one_place_together_are_no_answer(tmp_path):
    """One bearing rubs; the library lets both rub alike. A shaft that damps less stood beside."""
    outcome = drive(tmp_path, 103, rubbing=0.015)
    assert outcome.diagnosis.verdict == "unexplained"
    assert "loadBearing alone: 0.015 N.m.s/rad" in outcome.sentence


@pytest.mark.long
def test_a_cause_of_the_catalogue_is_found_beside_parameters_that_imitate_it(tmp_path):
    """A healthy drive lacks nothing; what both bearings do alike is theirs."""
    assert drive(tmp_path / "sound", 100).diagnosis.verdict == "nothing"
