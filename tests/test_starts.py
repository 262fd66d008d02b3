"""What is known of states at the start: by samples, by the system file, or by their size alone."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from workbench import case_from_frame
from workbench.observers import choose
from workbench.observers.run import Run
from workbench.observers.simulation import CaseResult, prepare

from .built import declare, machine

BODY, WATER = 60.0, 35.0  # K, where the recordings begin


def ran(folder: Path, name: str, step: float, more: str = "") -> tuple[CaseResult, Run, np.ndarray]:
    """A filter on the kettle, which begins elsewhere than its model; and the truth of the body."""
    system = declare(folder, *machine("kettle", step=step, more=more))
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
    result = prepare(system, choose(system, [name])).run(case)
    return result, result.runs[name], body


@pytest.mark.parametrize("step", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_a_hidden_state_is_found_from_wherever_it_is(tmp_path, name, step):
    _, run, body = ran(tmp_path / "kettle", name, step)
    error, sigma = run.signal("body") - body, run.deviation("body")
    # Its nominal value is what is not known of it, until outputs show it.
    assert sigma[0] == pytest.approx(50.0, rel=1e-6)
    # Five deviations: chance makes that once in two million.
    assert (np.abs(error) < 5.0 * sigma).all()
    assert np.abs(error[-1]) < 1.0


def test_what_is_said_of_a_start_is_what_is_not_known_of_it(tmp_path):
    _, run, _ = ran(tmp_path / "kettle", "ekf", 1.0, '[states.body]\nspread = "3 K"\n')
    assert run.deviation("body")[0] == pytest.approx(3.0, rel=1e-6)


def test_an_output_starts_the_state_that_it_shows_under_another_name(tmp_path):
    _, run, _ = ran(tmp_path / "kettle", "open_loop", 1.0)
    # What is read is the water's temperature with another zero.
    assert run.signal("water")[0] == pytest.approx(WATER, abs=0.5)
    assert run.signal("body")[0] == 0.0  # of this, nothing is known


def test_a_start_of_which_the_system_says_how_sure_it_is_stays(tmp_path):
    _, run, _ = ran(tmp_path / "kettle", "open_loop", 1.0, '[states.water]\nspread = "1 K"\n')
    assert run.signal("water")[0] == 10.0


ROOM, ROOM_FILE = machine("room")


def recorded_room(step: float = 10.0, **factors: float) -> pd.DataFrame:
    """A room at work, with a column in another unit: T in degrees Celsius, others by a factor."""
    rng, time = np.random.default_rng(6), np.arange(0.0, 3600.0, 10.0)
    power = np.where(time % 1200.0 < 600.0, 2000.0, 200.0)
    T = [293.15]
    for P in np.repeat(power[:-1], 10):
        T.append(T[-1] + 1e-5 * (P - 50.0 * (T[-1] - 273.15)))
    values = {"P": power, "T": np.array(T[::10]), "p": 101325.0 * np.array(T[::10]) / 293.15}
    noise = {"P": 5.0, "T": 0.05, "p": 50.0}
    columns = {"time [s]": time * step / 10.0}
    for name, unit in {"P": "W", "T": "K", "p": "Pa"}.items():
        scattered = values[name] + noise[name] * rng.standard_normal(time.size)
        columns[f"{name} [{unit}]"] = scattered * factors.get(name, 1.0) - factors.get(
            f"{name}0", 0
        )
    return pd.DataFrame(columns)


@pytest.mark.parametrize(
    ("factors", "message"),
    [
        ({"T0": 273.15}, "273.15 K below that of the model"),
        ({"T": 1e3}, "1000 times that of the model"),
        ({"p": 1e-3}, "as 'scale' of p says"),
        ({"p": 1e-5}, "as 'scale' of p says"),
        ({"P": 1e3}, "as 'scale' of P says"),
        ({"P": 1e-3}, "as 'scale' of P says"),
        ({"T": -1.0}, "what the model allows, from 200 K"),
    ],
)
def test_another_unit_of_a_column_is_asked_about(tmp_path, factors, message):
    system = declare(tmp_path / "room", ROOM, ROOM_FILE)
    with pytest.warns(UserWarning, match=re.escape(message)):
        case = case_from_frame(system, recorded_room(**factors))
    assert all("check the unit of the column" in doubt for doubt in case.doubts if message in doubt)


def test_nothing_is_asked_of_a_recording_in_its_units(tmp_path):
    system = declare(tmp_path / "room", ROOM, ROOM_FILE)
    assert not case_from_frame(system, recorded_room()).doubts
    assert (
        not prepare(system, choose(system, ["ekf"]))
        .run(case_from_frame(system, recorded_room()))
        .warnings()
    )


def test_an_input_without_a_start_says_nothing_of_the_unit_of_its_column(tmp_path):
    """The FMU begins it at 0 K, which no model means."""
    outside = '    input Real Ta(unit="K") "Outside";\n    input Real dG'
    model = ROOM.replace("    input Real dG", outside).replace("T - 273.15)", "T - Ta)")
    signal = 'inputs.Ta = { unit = "K", noise = "0.1 K", scale = "300 K" }\noutputs.T'
    system = declare(tmp_path / "room", model, ROOM_FILE.replace("outputs.T", signal))
    recorded = recorded_room()
    recorded["Ta [K]"] = 273.15 + 0.1 * np.random.default_rng(7).standard_normal(len(recorded))
    assert not case_from_frame(system, recorded).doubts


@pytest.mark.parametrize("factor", [1e3, 1e-6])
def test_times_in_another_unit_are_asked_about_by_the_models_time_constants(tmp_path, factor):
    """Though `sample_time` is wrong with them: the room forgets in 2000 s."""
    text = ROOM_FILE.replace('"10 s"', f'"{10.0 * factor:g} s"')
    system = declare(tmp_path / "room", ROOM, text)
    case = case_from_frame(system, recorded_room(step=10.0 * factor))
    result = prepare(system, choose(system, ["ekf"])).run(case)
    assert any("motion of the model" in text for text in result.warnings())


@pytest.mark.parametrize(
    ("nominal", "more", "count"),
    [
        ("", "", True),
        (", nominal=3.0", "", False),
        ("", '[states.v]\nspread = "3 m/s"\n', False),
    ],
)
def test_what_filters_assume_of_a_hidden_start_is_said(tmp_path, nominal, more, count):
    package, text = machine("swing", step=0.05)
    package = package.replace(", nominal=3.0", nominal)
    system = declare(tmp_path / "swing", package, f"{text}\n{more}")
    time = 0.05 * np.arange(100)
    place = 0.5 * np.cos(2.0 * np.pi * time)
    columns = {"time [s]": time, "f [m/s2]": 0.0 * time, "s [m]": place}
    case = case_from_frame(system, pd.DataFrame(columns), name="swing")
    warnings = prepare(system, choose(system, ["ekf"])).warnings(case)
    assumed = [text for text in warnings if "filters assume v by 1 m/s" in text]
    assert len(assumed) == count
    assert not prepare(system, choose(system, ["open_loop"])).warnings(case)


def test_a_first_sample_that_contradicts_the_start_is_told_first(tmp_path):
    """The kettle's water is 35 K above the room, its model says 10 K, and how sure that is."""
    result, _, _ = ran(tmp_path / "kettle", "ekf", 1.0, '[states.water]\nspread = "1 K"\n')
    assert result.warnings()[0].startswith("the first sample of reading is 7")
    # 25 of its deviations off, which later samples correct.
    narrow = [test for test in result.contradictions["ekf"] if test.narrow]
    assert all("the start" in test.reason for test in narrow)
