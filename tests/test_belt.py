"""A drive over an elastic belt: errors that swing, readings that are alike, starts in motion."""

from pathlib import Path

import numpy as np
import pytest

from workbench.diagnosis import Outcome
from workbench.system.system import System

from .built import declare, diagnosed, machine, write_case

H, COUNT, PARTS = 2e-3, 1500, 4
JM, JL, STIFFNESS, DAMPING, FRICTION = 2e-3, 1e-2, 20.0, 0.04, 5e-3


def run(
    folder: Path,
    *,
    softer: float = 0.0,
    delay: float = 0.0,
    offset: float = 0.0,
    moving: float = 0.0,
) -> Outcome:
    """Diagnose three recordings by Runge and Kutta, in changes of the model's quantities [SI]."""
    system = declared(folder)
    rng = np.random.default_rng(1)
    c, time = STIFFNESS + softer, H * np.arange(COUNT)

    def rates(x: np.ndarray, torque: float) -> np.ndarray:
        vm, vl, twist = x
        m = c * twist + DAMPING * (vm - vl)
        return np.array([(torque - m) / JM, (m - FRICTION * vl) / JL, vm - vl])

    for k in range(3):
        steps = np.repeat(rng.uniform(-0.6, 0.8, COUNT // 100), 100)
        begin = moving * (1.0 + 0.2 * k)
        x, states = np.array([begin, begin, 0.0]), []
        for torque in steps:
            states.append(x)
            for _ in range(PARTS):
                h = H / PARTS
                k1 = rates(x, torque)
                k2 = rates(x + 0.5 * h * k1, torque)
                k3 = rates(x + 0.5 * h * k2, torque)
                k4 = rates(x + h * k3, torque)
                x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        vm, vl, _ = np.transpose(states)
        noise = rng.standard_normal((3, COUNT))
        columns = {
            "time [s]": time,
            "torque [N.m]": steps + 1e-3 * noise[0],
            "wm [rad/s]": vm + offset + 0.3 * noise[1],
            "wl [rad/s]": np.interp(time - delay, time, vl) + 0.2 * noise[2],
        }
        write_case(folder / "recordings" / f"{k}", columns, f"Run {k}", "%.8g")
    return diagnosed(system, folder / "recordings", folder / "out")


def declared(folder: Path) -> System:
    return declare(folder, *machine("belt"))


def test_a_gain_is_told_where_errors_swing(tmp_path):
    """At 17 Hz, of which means over 0.2 s say nothing: there, both models leave noise alone."""
    outcome = run(tmp_path, softer=-4.0)
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "SofterBelt"
    assert cause.parameters["k"].low < -4.0 < cause.parameters["k"].high
    assert outcome.diagnosis.gain.fast
    assert outcome.diagnosis.gain.before > 2.0
    assert "its error falls from" in outcome.sentence
    assert outcome.to_dict()["gain"]["measure"].count("10 ms") == 1


@pytest.mark.parametrize("softer", [-0.6, -1.0])
def test_a_cause_by_which_errors_swing_is_named_beside_one_that_lasts(softer, tmp_path):
    """In steps that do not turn the phase of what swings by more than its interval."""
    outcome = run(tmp_path, softer=softer, offset=1.0)
    causes = {cause.effect.name: cause.parameters for cause in outcome.diagnosis.causes}
    assert causes.keys() == {"SofterBelt", "MotorOffset"}
    assert causes["SofterBelt"]["k"].low < softer < causes["SofterBelt"]["k"].high
    assert not outcome.diagnosis.gain.fast


def test_an_effect_that_may_stand_in_place_of_a_cause_takes_no_part_of_its_size(tmp_path):
    outcome = run(tmp_path, delay=6e-3)
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "LoadDelay"
    assert cause.confusable_with == ("LoadLag",)
    delay = cause.parameters["delay"]
    assert 5e-3 < delay.low < 6e-3 < delay.high < 7e-3


def test_starts_that_a_library_holds_are_named_where_recordings_begin_in_motion(tmp_path):
    outcome = run(tmp_path, moving=40.0)
    assert outcome.diagnosis.verdict == "unexplained"
    speeds = [40.0, 48.0, 56.0]
    doubt = outcome.warnings[0]
    assert f'spread = "{np.sqrt(np.mean(np.square(speeds))):.3g} rad/s" in [states.vl]' in doubt
