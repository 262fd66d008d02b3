"""Quantities that a recording cannot tell apart are named, and estimates marked as guesses."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from workbench import case_from_frame
from workbench.__main__ import main
from workbench.observers import choose
from workbench.observers.observability import linear_test
from workbench.observers.report import format_table
from workbench.observers.simulation import CaseResult, prepare
from workbench.system.registry import open_model

from .built import declare, machine
from .schemas import check

QUANTITIES = {
    "m": 'correction = "dm"\nunit = "kg"\nrange = ["20000 kg", "70000 kg"]\n'
    'walk = "1 kg"\nspread = "8000 kg"\n',
    "e": 'correction = "de"\nunit = "1"\nrange = [0.5, 1.0]\nwalk = 1e-5\nspread = 0.15\n',
    "A": 'correction = "dA"\nunit = "m/s2"\nrange = ["0.005 m/s2", "0.05 m/s2"]\n'
    'walk = "1e-6 m/s2"\nspread = "0.01 m/s2"\n',
}


def ran(folder: Path, *estimated: str, power: float = 1.6e5) -> CaseResult:
    """The filter on a tram that accelerates and rolls in turns."""
    folder.mkdir()
    tables = "".join(f'[estimated.{n}]\n{QUANTITIES[n]}acts_on = "v"\n' for n in estimated)
    library, file = machine("tram")
    system = declare(folder, library, file + tables)
    time, rng = np.arange(600.0), np.random.default_rng(3)
    powers = np.where((time // 60.0) % 3.0 < 2.0, power, 0.125 * power)
    speed = [5.0]
    for P in np.repeat(powers[:-1], 20):
        v = speed[-1]
        speed.append(v + 0.05 * (0.9 * P / (42e3 * np.sqrt(v * v + 1.0)) - 0.02 * v))
    measured = np.array(speed[::20]) + 0.05 * rng.standard_normal(time.size)
    columns = {"time [s]": time, "P [W]": powers, "v [m/s]": measured}
    pd.DataFrame(columns).to_csv(folder / "run.csv", index=False)
    case = case_from_frame(system, pd.DataFrame(columns), name="run")
    return prepare(system, choose(system, ["ekf"])).run(case)


def test_a_mass_and_an_efficiency_that_act_as_their_quotient_are_guesses(tmp_path):
    result = ran(tmp_path / "pair", "m", "e")
    assert list(result.inseparable) == [("m", "e")]
    assert result.inseparable["m", "e"] > 0.999
    assert not result.runs["ekf"].claimed["m"].any()
    assert not result.runs["ekf"].claimed["e"].any()
    doubt = "m and e are indistinguishable in this recording"
    assert doubt in format_table(result.system, [result]).splitlines()[2]
    assert result.to_dict()["doubts"][-1].startswith(doubt)


def test_a_mass_and_a_resistance_are_told_apart_as_the_power_changes(tmp_path):
    result = ran(tmp_path / "apart", "m", "A")
    assert not result.inseparable
    assert "m" not in result.runs["ekf"].claimed


@pytest.mark.filterwarnings("ignore:.*found values up to 1 W")  # as it is meant here
def test_a_quantity_that_nothing_moves_is_a_guess_by_itself(tmp_path):
    """While a tram rolls with next to no power, the efficiency acts on nothing."""
    result = ran(tmp_path / "rolls", "e", power=1.0)
    assert result.untold == ("e",)
    assert not result.runs["ekf"].claimed["e"].any()
    assert "e is not shown by this recording" in result.summary()


def test_observability_names_what_cannot_be_told_apart(tmp_path, capsys):
    """The disturbance observer, which it follows elsewhere, has no gain for such a pair."""
    ran(tmp_path / "pair", "m", "e")
    options = ["--system", str(tmp_path / "pair"), "--out", str(tmp_path / "out"), "--workers", "1"]
    assert main(["observability", str(tmp_path / "pair" / "run.csv"), *options]) == 0
    sentence = "m and e are indistinguishable in this recording"
    assert sentence in capsys.readouterr().out.splitlines()[0]
    summary = json.loads((tmp_path / "out" / "observability.json").read_text())
    assert summary["answer"]["sentence"].startswith(sentence)
    assert sentence in (tmp_path / "out" / "index.html").read_text()


def test_estimates_that_no_recording_tells_end_with_a_status(tmp_path, capsys):
    ran(tmp_path / "pair", "m", "e")
    options = ["--system", str(tmp_path / "pair"), "--out", str(tmp_path / "out"), "--workers", "1"]
    command = ["simulate", str(tmp_path / "pair" / "run.csv"), *options]
    assert main([*command, "--estimator", "smoother"]) == 1
    assert "error: no recording tells m; its estimates are guesses" in capsys.readouterr().err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    check("simulate", summary)
    (case,) = summary["cases"].values()
    assert case["guesses"] == ["m", "e"]
    assert case["inseparable"][0]["names"] == ["m", "e"]
    assert case["warnings"][0] in case["doubts"]
    # What has no gain at all names them, and a way that leads on.
    assert main([*command, "--estimator", "disturbance_observer"]) == 2
    assert "found m and e, which the outputs do not show" in capsys.readouterr().err


@pytest.mark.parametrize("step", [0.1, 1.0, 10.0])
def test_states_that_no_quantity_moves_are_observable_where_outputs_show_them(tmp_path, step):
    point = 'points.design.inputs = { I = "2 A" }\n'
    system = declare(tmp_path / "cell", *machine("cell", step=step, point=point))
    with open_model(system) as fmu:
        test = linear_test(fmu, system)
    assert test.rank == 2
    # Nothing is known of the charge but its size; two millivolts tell it, beside what fades.
    assert test.remaining[list(test.states).index("charge")] < 0.01
