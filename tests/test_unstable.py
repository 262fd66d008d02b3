"""A level that grows by itself, faster the more it is heated, and is held by a controller."""

from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from workbench.errors import FMUError, InputError
from workbench.system.registry import load_system

from .built import build_text, diagnosed, write_case

MODEL = """model Growth "What grows by itself"
  parameter Real k(unit="1/s", min=0.0) = 20.0 "Growth when it is heated";
  input Real heat(unit="1") "Heating";
  input Real w(unit="m/s") "Taken away";
  output Real x(unit="m", start=0.0, fixed=true, nominal=1.0) "Level";
equation
  der(x) = k*heat*x - w;
end Growth;
"""
SYSTEM = """title = "What grows by itself"
sample_time = "10 ms"
[models]
observer = { fmu = "Growth.fmu" }
[inputs]
heat = { unit = "1", noise = 0.0, scale = 1.0, held = true }
w = { unit = "m/s", noise = "0.01 m/s", scale = "20 m/s", held = true }
[outputs]
x = { unit = "m", noise = "0.001 m", scale = "1 m" }
"""
WORKS = """[points.design]
inputs = { heat = 1.0 }
"""


def recorded(folder: Path, design: str) -> Path:
    """Steps of the level that a controller takes, by the closed form of each sample."""
    build_text(folder, MODEL)
    (folder / "system.toml").write_text(SYSTEM + design)
    k, h, rng = 20.0, 0.01, np.random.default_rng(1)
    for number in range(3):
        x, rows = 0.0, []
        for asked in np.repeat(rng.uniform(-0.5, 0.5, 8), 50):
            w = 20.0 * x + 10.0 * (x - asked)
            noise = rng.standard_normal(2) * (0.01, 0.001)
            rows.append((1.0, w + noise[0], x + noise[1]))
            x = w / k + (x - w / k) * np.exp(k * h)
        heat, w_read, x_read = np.transpose(rows)
        time = h * np.arange(len(rows))
        columns = {"time [s]": time, "heat [1]": heat, "w [m/s]": w_read, "x [m]": x_read}
        write_case(folder / "recordings" / f"{number}", columns, f"Steps {number}", "%.8g")
    return folder


def test_an_error_of_an_unstable_model_says_to_state_where_it_works(tmp_path):
    folder = recorded(tmp_path, "")
    with pytest.raises(FMUError, match=r"say in \[points.design\] of the system file"):
        diagnosed(load_system(folder), folder / "recordings", tmp_path / "out")


def test_outputs_correct_an_unstable_model_where_it_works(tmp_path):
    folder = recorded(tmp_path, WORKS)
    outcome = diagnosed(load_system(folder), folder / "recordings", tmp_path / "out")
    assert outcome.diagnosis.verdict == "nothing"


def test_a_fit_of_an_unstable_model_says_that_a_diagnosis_is_led_by_outputs(tmp_path):
    """The level grows e-fold in 50 ms, and a recording lasts 4 s."""
    folder = recorded(tmp_path, "")
    system = load_system(folder)
    cases = wb.read_cases(folder / "recordings", system)
    settings = wb.FitSettings(starts=1, generations=0, profiles=False)
    outcome = wb.fit(system, cases, ["k"], settings=settings, workers=1, report=lambda _: None)
    (doubt,) = (text for text in outcome.doubts if "unstable" in text)
    assert (
        "a state grows e-fold in 0.05 s by itself, and is simulated from inputs alone for" in doubt
    )
    assert r"[points.design]" in doubt
    assert "workbench diagnose" in doubt


LEVITATION = """model Levitation "A ball below a magnet"
  parameter Real c(unit="N.m2/A2", min=1e-6) = 5e-5;
  input Real i(unit="A", start=1);
  output Real x(unit="m", start=0.01, fixed=true);
  output Real v(unit="m/s", start=0, fixed=true);
equation
  der(x) = v;
  der(v) = 9.81 - c/0.05*(i/x)^2;
end Levitation;
"""


@pytest.mark.parametrize(
    ("current", "found"), [(1.0, "no simulation with the model's own"), (0.99, "no fit from any")]
)
def test_a_fit_that_no_simulation_bears_is_refused_with_what_helps(current, found, tmp_path):
    """The ball meets the magnet, where its force is infinite, or would with a slightly larger c.

    It floats at 0.9905 A. No search of the ranges helps.
    """
    build_text(tmp_path, LEVITATION)
    (tmp_path / "system.toml").write_text(
        'title = "Ball"\nsample_time = "2 ms"\n[models]\nobserver = { fmu = "Levitation.fmu" }\n'
        '[inputs]\ni = { unit = "A", noise = "0 A", scale = "1 A" }\n'
        '[outputs]\nx = { unit = "m", noise = "5e-6 m", scale = "0.01 m" }\n'
    )
    time = np.arange(0.0, 1.0, 0.002)
    columns = {
        "time [s]": time,
        "i [A]": np.full(500, current),
        "x [m]": np.random.default_rng(1).normal(0.01, 5e-6, 500),
    }
    write_case(tmp_path / "recordings" / "1", columns, "Held", "%.8g")
    system = load_system(tmp_path)
    cases = wb.read_cases(tmp_path / "recordings", system)
    lines: list[str] = []
    message = rf"{found}.*unstable where 1 begins.*\[points.design\].*workbench diagnose"
    with pytest.raises(InputError, match=message):
        wb.fit(system, cases, ["c"], settings=wb.FitSettings(), workers=1, report=lines.append)
    assert not any("differential evolution" in line for line in lines)
