"""A level that grows by itself, faster the more it is heated, and is held by a controller."""

from pathlib import Path

import numpy as np
import pytest

from workbench.errors import FMUError
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
