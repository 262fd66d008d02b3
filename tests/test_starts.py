"""What is known of states at the start: by samples, by the system file, or by their size alone."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from workbench import case_from_frame
from workbench.observers import choose
from workbench.observers.run import Run
from workbench.observers.simulation import prepare
from workbench.system.registry import load_system

pytest.importorskip("rumoca", reason="needs the extra [compiler]")
pytest.importorskip("ziglang", reason="needs the extra [compiler]")

KETTLE = """
package Kettle "Water that a body heats"
  model Observer "Heat of a body and of the water about it"
    parameter Real loss(unit="W/K") = 5.0 "Of the water to the room";
    input Real P(unit="W") "Heating";
    input Real dloss(unit="W/K") "Correction of loss";
    output Real reading(unit="K") = water + 40.0 "What the sensor says";
    Real body(unit="K", start=0.0, fixed=true, nominal=50.0) "Over the room";
    Real water(unit="K", start=10.0, fixed=true, nominal=50.0) "Over the room";
  equation
    200.0*der(body) = P - 20.0*(body - water);
    2000.0*der(water) = 20.0*(body - water) - (loss + dloss)*water;
  end Observer;
end Kettle;
"""
SYSTEM = """
title = "A kettle"
sample_time = "{step} s"
reported = ["body", "water"]

[models]
observer = {{ class = "Observer" }}

[inputs.P]
unit = "W"
noise = "1 W"
scale = "1000 W"

[outputs.reading]
unit = "K"
noise = "0.1 K"
scale = "50 K"

[estimated.loss]
correction = "dloss"
unit = "W/K"
range = ["1 W/K", "20 W/K"]
walk = "1e-3 W/K"
spread = "2 W/K"
{more}
"""
BODY, WATER = 60.0, 35.0  # K, where the recordings begin


def ran(folder: Path, name: str, step: float, more: str = "") -> tuple[Run, np.ndarray]:
    """A filter on the kettle, which begins elsewhere than its model; and the truth of the body."""
    folder.mkdir()
    (folder / "package.mo").write_text(KETTLE)
    (folder / "system.toml").write_text(SYSTEM.format(step=step, more=more))
    system = load_system(folder)
    time, rng, fine = np.arange(0.0, 200.0, step), np.random.default_rng(5), 100
    truth = [np.array([BODY, WATER])]
    for _ in range(fine * (time.size - 1)):  # the truth, by steps that err by less than the noise
        body, water = truth[-1]
        flow = 20.0 * (body - water)
        rates = np.array([(500.0 - flow) / 200.0, (flow - 5.0 * water) / 2000.0])
        truth.append(truth[-1] + step / fine * rates)
    body, water = np.array(truth[::fine]).T
    reading = water + 40.0 + 0.1 * rng.standard_normal(time.size)
    power = np.full(time.size, 500.0) + rng.standard_normal(time.size)
    columns = {"time [s]": time, "P [W]": power, "reading [K]": reading}
    case = case_from_frame(system, pd.DataFrame(columns), name="run")
    return prepare(system, choose(system, [name])).run(case).runs[name], body


@pytest.mark.parametrize("step", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_a_hidden_state_is_found_from_wherever_it_is(
    tmp_path: Path, name: str, step: float
) -> None:
    run, body = ran(tmp_path / "kettle", name, step)
    error, sigma = run.signal("body") - body, run.deviation("body")
    # Its nominal value is what is not known of it, until outputs show it.
    assert sigma[0] == pytest.approx(50.0, rel=1e-6)
    # Five deviations: chance makes that once in two million.
    assert (np.abs(error) < 5.0 * sigma).all()
    assert np.abs(error[-1]) < 1.0


def test_what_is_said_of_a_start_is_what_is_not_known_of_it(tmp_path: Path) -> None:
    run, _ = ran(tmp_path / "kettle", "ekf", 1.0, '[states.body]\nspread = "3 K"\n')
    assert run.deviation("body")[0] == pytest.approx(3.0, rel=1e-6)


def test_an_output_starts_the_state_that_it_shows_under_another_name(tmp_path: Path) -> None:
    run, _ = ran(tmp_path / "kettle", "open_loop", 1.0)
    # What is read is the water's temperature with another zero.
    assert run.signal("water")[0] == pytest.approx(WATER, abs=0.5)
    assert run.signal("body")[0] == 0.0  # of this, nothing is known


def test_a_start_of_which_the_system_says_how_sure_it_is_stays(tmp_path: Path) -> None:
    run, _ = ran(tmp_path / "kettle", "open_loop", 1.0, '[states.water]\nspread = "1 K"\n')
    assert run.signal("water")[0] == 10.0
