"""A diagnosis of an FMU without a library: a parameter or a sensor that is wrong is named.

Recordings are made by SciPy from equations of their own; the FMU is used as one of another tool.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from workbench.__main__ import main
from workbench.api import diagnose, read_cases
from workbench.diagnosis import Outcome, Problem, catalogue, choose
from workbench.diagnosis.laws import propose
from workbench.errors import InputError
from workbench.runtime.engine import Engine
from workbench.system.registry import load_system
from workbench.system.system import System

from .built import build_text, write_case

# The level has another name than the output, so that no output's name tells where it begins.
MODEL = """
model Tank "A tank that empties through an outlet"
  parameter Real A(unit="m2", min=0.01) = 0.5 "area of the tank";
  parameter Real c(unit="m2", min=1e-5) = 1e-3 "effective area of the outlet";
  parameter Real g(unit="m/s2") = 9.81 "gravity";
  parameter Real leak(unit="m3/s") = 0.0 "steady leak";
  input Real inflow(unit="m3/s");
  Real x(unit="m", start=1.0, fixed=true, min=0.0, max=3.0) "level";
  output Real h(unit="m") = x;
equation
  A*der(x) = inflow - c*sqrt(2.0*g*sqrt(x^2 + 1e-6)) - leak;
end Tank;
"""
SYSTEM = """
title = "A tank as an FMU alone"
sample_time = "0.5 s"

[models]
observer = { fmu = "Tank.fmu" }

[inputs.inflow]
unit = "m3/s"
label = "inflow"
noise = "5e-5 m3/s"
scale = "5e-3 m3/s"
held = true

[outputs.level]
variable = "h"
unit = "m"
label = "level"
noise = "2 mm"
scale = "1 m"

[points]
settles = "1000 s"

[points.design]
inputs = { inflow = "5e-3 m3/s" }

[objective]
judged = "level"
"""


def record(folder: Path, seed: int, area=0.5, outlet=1e-3, gain=0.0, zero=0.0) -> Path:
    """Four recordings of 200 s, of which each starts at another level."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 200.25, 0.5)
    for number in range(4):
        inflow = np.repeat(rng.uniform(2e-3, 7e-3, 5), 80)[: time.size - 1]
        level = [rng.uniform(0.5, 1.5)]
        for flow in inflow:

            def rate(_t, x, flow=flow):
                return [(flow - outlet * np.sqrt(2.0 * 9.81 * x[0])) / area]

            level.append(solve_ivp(rate, (0.0, 0.5), [level[-1]], rtol=1e-8, atol=1e-10).y[0, -1])
        flows = np.append(inflow, inflow[-1])
        columns = {
            "time [s]": time,
            "inflow [m3/s]": (1.0 + gain) * flows + 5e-5 * rng.standard_normal(time.size),
            "level [m]": np.array(level) + zero + 2e-3 * rng.standard_normal(time.size),
        }
        write_case(folder / f"{number}", columns, "Steps of the pump")
    return folder


@pytest.fixture(scope="module")
def tank(tmp_path_factory) -> System:
    folder = tmp_path_factory.mktemp("tank")
    build_text(folder, MODEL)
    (folder / "system.toml").write_text(SYSTEM)
    return load_system(folder)


def diagnosed(system: System, folder: Path, **truth: float) -> Outcome:
    cases = read_cases(record(folder / "recordings", **truth), system)
    return diagnose(system, cases, out=folder / "out", workers=1, report=lambda line: None)


def test_nothing_is_missing_where_only_unknown_starts_differ(tank, tmp_path):
    assert diagnosed(tank, tmp_path, seed=1).diagnosis.verdict == "nothing"


@pytest.mark.parametrize(
    ("truth", "effect", "size", "value"),
    [
        ({"seed": 2, "area": 0.55}, "A", "change", 0.05),
        ({"seed": 3, "gain": 0.05}, "SensorGain[inflow]", "gain", 0.05),
        ({"seed": 4, "zero": 0.05}, "SensorOffset[level]", "offset", 0.05),
    ],
)
def test_what_is_wrong_is_named_with_its_size(tank, tmp_path, truth, effect, size, value):
    outcome = diagnosed(tank, tmp_path, **truth)
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == effect
    assert cause.parameters[size].low < value < cause.parameters[size].high
    assert outcome.extension is None


def test_parameters_that_act_alike_are_named_together(tank, tmp_path):
    """The outlet's area and the root of gravity are one factor: nothing can tell them apart."""
    outcome = diagnosed(tank, tmp_path, seed=5, outlet=1.1e-3)
    (cause,) = outcome.diagnosis.causes
    assert {cause.effect.name, *cause.confusable_with} == {"c", "g"}
    assert "another value of" in outcome.summary()


def test_candidates_are_parameters_and_sensors_of_a_stated_size(tank):
    names = [effect.name for effect in catalogue(tank, None)]
    # A leak of zero without bounds or nominal value has no size that a change can be small to.
    assert names[:3] == ["A", "c", "g"]
    assert names[3:] == [
        f"Sensor{size}[{signal}]" for signal in ("inflow", "level") for size in ("Gain", "Offset")
    ]


def test_candidates_are_chosen_in_the_system_file(tank, tmp_path, capsys):
    text = SYSTEM.replace("Tank.fmu", str(tank.source.parent / "Tank.fmu"))
    chosen = '[candidates]\nonly = ["c", "Sensor*"]\nwithout = ["*[level]"]\nmatters = 0.05\n'
    (tmp_path / "system.toml").write_text(text + chosen)
    effects = catalogue(load_system(tmp_path), None)
    assert [effect.name for effect in effects] == [
        "c",
        "SensorGain[inflow]",
        "SensorOffset[inflow]",
    ]
    assert effects[0].matters == pytest.approx(5e-5)
    (tmp_path / "system.toml").write_text(text + '[candidates]\nonly = ["cc"]\n')
    assert main(["diagnose", "--system", str(tmp_path), "--list"]) == 2
    message = "found 'cc' (closest: 'c'); expected a parameter of the FMU that may differ"
    assert message in capsys.readouterr().err


def test_a_stated_range_bounds_the_change(tank, tmp_path):
    """Of 10 % only 4 are allowed: the size is told to be at its bound."""
    text = SYSTEM.replace("Tank.fmu", str(tank.source.parent / "Tank.fmu"))
    (tmp_path / "system.toml").write_text(f'{text}[fit.A]\nrange = ["0.4 m2", "0.52 m2"]\n')
    system = load_system(tmp_path)
    cases = read_cases(record(tmp_path / "recordings", seed=2, area=0.55), system)
    outcome = diagnose(
        system, cases, effects=["A"], out=tmp_path, workers=1, report=lambda line: None
    )
    nearest = [candidate.text for candidate in outcome.diagnosis.nearest]
    limited = [text for text in [*outcome.warnings, *nearest] if "0.02 m2" in text]
    assert limited, outcome.summary()


def test_what_needs_the_equations_says_so(tank, tmp_path):
    cases = read_cases(record(tmp_path / "recordings", seed=6, area=0.55), tank)
    effects = choose(["SensorOffset[level]"], catalogue(tank, None))
    problem = Problem(tank, cases, None, effects)
    outcome = diagnose(
        tank,
        cases,
        effects=["SensorOffset[level]"],
        out=tmp_path,
        workers=1,
        report=lambda line: None,
    )
    assert outcome.diagnosis.verdict != "found"
    assert "put the Modelica library" in outcome.next_steps[-1]
    with pytest.raises(InputError, match=re.escape("no Modelica library package.mo")):
        propose(outcome, problem, Engine(out=tmp_path))
