"""Quantities that a recording cannot tell apart are named, and estimates marked as guesses."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from workbench import case_from_frame
from workbench.observers import choose
from workbench.observers.report import format_table
from workbench.observers.simulation import CaseResult, prepare

from .built import declare

pytest.importorskip("rumoca", reason="needs the extra [compiler]")
pytest.importorskip("ziglang", reason="needs the extra [compiler]")

TRAM = """
package Tram "A tram of which power and speed are measured"
  model Observer "Its speed"
    parameter Real m(unit="kg") = 35e3 "Mass";
    parameter Real e(unit="1") = 0.8 "Efficiency";
    parameter Real A(unit="m/s2") = 0.02 "Resistance";
    input Real P(unit="W") "Electric power";
    input Real dm(unit="kg") "Correction of m";
    input Real de(unit="1") "Correction of e";
    input Real dA(unit="m/s2") "Correction of A";
    output Real v(unit="m/s", start=5.0, fixed=true, nominal=10.0) "Speed";
  equation
    der(v) = (e + de)*P/((m + dm)*sqrt(v^2 + 1.0)) - (A + dA)*v;
  end Observer;
end Tram;
"""
SYSTEM = """
title = "A tram"
sample_time = "1 s"

[models]
observer = { class = "Observer" }

[inputs.P]
unit = "W"
noise = "500 W"
scale = "2e5 W"

[outputs.v]
unit = "m/s"
noise = "0.05 m/s"
scale = "10 m/s"
"""
QUANTITIES = {
    "m": 'correction = "dm"\nunit = "kg"\nrange = ["20000 kg", "70000 kg"]\n'
    'walk = "1 kg"\nspread = "8000 kg"\n',
    "e": 'correction = "de"\nunit = "1"\nrange = [0.5, 1.0]\nwalk = 1e-5\nspread = 0.15\n',
    "A": 'correction = "dA"\nunit = "m/s2"\nrange = ["0.005 m/s2", "0.05 m/s2"]\n'
    'walk = "1e-6 m/s2"\nspread = "0.01 m/s2"\n',
}


def ran(folder: Path, *estimated: str) -> CaseResult:
    """The filter on a tram that accelerates and rolls in turns."""
    folder.mkdir()
    tables = "".join(f'[estimated.{n}]\n{QUANTITIES[n]}acts_on = "v"\n' for n in estimated)
    system = declare(folder, TRAM, SYSTEM + tables)
    time, rng = np.arange(600.0), np.random.default_rng(3)
    power = np.where((time // 60.0) % 3.0 < 2.0, 1.6e5, 2e4)
    speed = [5.0]
    for P in np.repeat(power[:-1], 20):
        v = speed[-1]
        speed.append(v + 0.05 * (0.9 * P / (42e3 * np.sqrt(v * v + 1.0)) - 0.02 * v))
    measured = np.array(speed[::20]) + 0.05 * rng.standard_normal(time.size)
    columns = {"time [s]": time, "P [W]": power, "v [m/s]": measured}
    case = case_from_frame(system, pd.DataFrame(columns), name="run")
    return prepare(system, choose(system, ["ekf"])).run(case)


def test_a_mass_and_an_efficiency_that_act_as_their_quotient_are_guesses(tmp_path: Path) -> None:
    result = ran(tmp_path / "pair", "m", "e")
    assert list(result.inseparable) == [("m", "e")]
    assert result.inseparable["m", "e"] > 0.999
    assert not result.runs["ekf"].claimed["m"].any()
    assert not result.runs["ekf"].claimed["e"].any()
    said = "m and e cannot be told apart by this recording"
    assert said in format_table(result.system, [result]).splitlines()[1]
    assert result.to_dict()["doubts"][-1].startswith(said)


def test_a_mass_and_a_resistance_are_told_apart_as_the_power_changes(tmp_path: Path) -> None:
    result = ran(tmp_path / "apart", "m", "A")
    assert not result.inseparable
    assert "m" not in result.runs["ekf"].claimed
