"""Parameters of an FMU are fitted to recordings, by data of a closed form and known parameters."""

import json
import re
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.optimize import curve_fit

import workbench as wb
from workbench.__main__ import main
from workbench.errors import FMUError, InputError
from workbench.models.description import read_description
from workbench.models.fmu import FMU
from workbench.models.simulation import Drive, Simulation
from workbench.recordings.case import Case
from workbench.studies.fit import resolve_parameters
from workbench.studies.fit.report import write_fmu
from workbench.system.system import System

from .built import build_text, machine_file, write_case
from .edits import replaced
from .schemas import check

SYSTEM = machine_file("heated_block/system.toml")
C, G, NOISE, STEP = 100.0, 2.0, 0.05, 4.0  # J/K, W/K, K, s
TIME = STEP * np.arange(24)


def power(seed: int) -> np.ndarray:
    """Heating power [W], set anew every four samples."""
    return np.repeat(np.random.default_rng(seed).uniform(5.0, 60.0, 6), 4)


def exact(P: np.ndarray, C: float, G: float, T: float) -> np.ndarray:
    """Temperatures by the closed form of each step."""
    values = []
    for p in P:
        values.append(T)
        T = p / G + (T - p / G) * np.exp(-G * STEP / C)
    return np.array(values)


def measured(seed: int, T: float = 4.0) -> np.ndarray:
    noise = NOISE * np.random.default_rng(100 + seed).standard_normal(TIME.size)
    return exact(power(seed), C, G, T) + noise


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("block")
    build_text(folder, machine_file("heated_block/Block.mo"))
    (folder / "system.toml").write_text(SYSTEM)
    for seed in (1, 3):
        columns = {"time [s]": TIME, "P [W]": power(seed), "T [K]": measured(seed)}
        write_case(folder / "cases" / f"day{seed}", columns, f"Day {seed}")
    return folder


@pytest.fixture(scope="module")
def system(folder: Path) -> System:
    return wb.load_system(folder)


@pytest.fixture(scope="module")
def cases(folder: Path, system: System) -> list[Case]:
    return wb.read_cases(folder / "cases", system)


def fitted(
    system: System,
    cases: Sequence[Case],
    *parameters: str | wb.FittedParameter,
    starts: int = 1,
    profiles: bool = False,
) -> wb.FitOutcome:
    settings = wb.FitSettings(starts=starts, profiles=profiles)
    return wb.fit(system, cases, parameters, settings=settings, workers=1, report=lambda line: None)


def test_values_and_deviations_are_those_of_curve_fit_on_the_closed_form(system, cases):
    """Both minimise the same sum of squares; the simulation is right to 1e-8 of 60 K."""
    outcome = fitted(system, cases[:1], "C", "G")

    def model(_: np.ndarray, C: float, G: float, T: float) -> np.ndarray:
        return exact(power(1), C, G, T)

    best, covariance = curve_fit(
        model, TIME, measured(1), (80.0, 1.5, 4.0), np.full(TIME.size, NOISE), absolute_sigma=True
    )
    for value, other, deviation in zip(
        outcome.values, best, np.sqrt(np.diag(covariance)), strict=True
    ):
        assert value.value == pytest.approx(other, abs=0.01 * deviation)
        assert value.deviation == pytest.approx(deviation, rel=0.01)  # as differences are right
    assert outcome.correlation[0, 1] == pytest.approx(
        covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]), abs=0.01
    )


@pytest.mark.parametrize(("unit", "size", "bad"), [("mK", 1e-3, False), ("GK", 1e9, True)])
def test_a_state_that_an_output_shows_under_another_name_starts_there(unit, size, bad, tmp_path):
    """In mK and without a nominal value: from the model's 0 the start would be 4000 sizes away.

    Walks of filters are far off by either unit, tolerances of a fit too coarse in GK.
    """
    block = machine_file("heated_block/Block.mo")
    hidden = block.replace("output Real T(", "Real x(").replace(", nominal=20.0", "")
    hidden = hidden.replace('unit="K", start', f'unit="{unit}", start').replace(
        "der(T)", f"{size}*der(x)"
    )
    hidden = hidden.replace("equation", f'output Real T(unit="K") = {size}*x;\nequation')
    build_text(tmp_path, hidden)
    (tmp_path / "system.toml").write_text(machine_file("heated_block/system.toml"))
    columns = {"time [s]": TIME, "P [W]": power(1), "T [K]": measured(1)}
    write_case(tmp_path / "cases" / "day1", columns, "Day 1")
    system = wb.load_system(tmp_path)
    cases = wb.read_cases(tmp_path / "cases", system)
    doubt = r"size states are: x is up to \S+ .K, taken for 1\."
    assert re.search(doubt, wb.observe(system, cases[0], "open_loop").message)
    outcome = fitted(system, cases, "C", "G")
    assert [bool(re.search(doubt, text)) for text in outcome.doubts] == [True] * bad
    (start,) = (value for value in outcome.values if value.name == "x")
    assert start.value == pytest.approx(4.0 / size, abs=4.0 * NOISE / size)
    assert outcome["C"].value == pytest.approx(C, abs=4.0 * (outcome["C"].deviation or 0.0))


def test_intervals_hold_the_truth_and_nothing_speaks_against_a_right_model(system, cases):
    outcome = fitted(system, cases[:1], "C", "G", profiles=True)
    assert outcome.reliable, outcome.doubts
    for name, truth in (("C", C), ("G", G)):
        value = outcome[name]
        assert value.low is not None
        assert value.high is not None
        assert value.low < truth < value.high
        assert value.method == "profile"
        # Far from bounds the likelihood is nearly a normal one: both intervals agree.
        assert value.high - value.low == pytest.approx(3.92 * (value.deviation or 0.0), rel=0.05)
    for recording in outcome.recordings:
        assert recording.error(recording.nominal) > 10.0
        # Of 16 samples the root mean square scatters by 18 %.
        assert 0.4 < recording.error(recording.fitted) < 1.5


def test_values_that_leave_noise_alone_need_no_search_of_the_ranges(cases, tmp_path):
    """From a negative heat capacity, block and fit run away: no sign that there are better ones.

    Once an evolution was begun, of which each simulation failed slowly: 10 min in place of 10 s.
    """
    build_text(tmp_path, machine_file("heated_block/Block.mo").replace(", min=1.0, max=1000.0", ""))
    (tmp_path / "system.toml").write_text(SYSTEM)
    anywhere = wb.FittedParameter("C", (-1000.0, 1000.0), (), by_recording=None)
    settings = wb.FitSettings(seed=2, profiles=False)
    outcome = wb.fit(
        wb.load_system(tmp_path),
        cases,
        [anywhere, "G"],
        settings=settings,
        workers=1,
        report=lambda line: None,
    )
    assert max(outcome.costs) > 100.0 * min(outcome.costs)
    assert not outcome.evolved
    assert outcome.reliable, outcome.doubts


STORES = """model Stores "Two stores that one output adds up"
  parameter Real R(min=0.0) = 0.2;
  input Real i;
  output Real y;
  Real a(start=0.0, fixed=true, nominal=1.0);
  Real b(start=1.0, fixed=true, nominal=1.0);
equation
  der(a) = i - a/20.0;
  der(b) = -b/200.0;
  y = a + b + R*i;
end Stores;
"""


def stored(folder: Path, name: str, begin: float, R: float) -> None:
    """A recording of the stores by the closed form of each step; `b` begins elsewhere."""
    rng, time = np.random.default_rng(int(name)), 2.0 * np.arange(100)
    i, fades, a = np.repeat(rng.uniform(-0.1, 0.1, 10), 10), np.exp(-0.1), 0.0
    y = []
    for now, at in zip(i, time, strict=True):
        y.append(a + begin * np.exp(-at / 200.0) + R * now)
        a = a * fades + 20.0 * now * (1.0 - fades)
    y = np.array(y) + rng.normal(0.0, 0.01, time.size)
    write_case(folder / "cases" / name, {"time [s]": time, "i [1]": i, "y [1]": y}, name, "%.8g")


def test_a_start_that_differs_by_recording_is_named_and_its_table_helps(tmp_path):
    """A cell that is not full at the start made resistance and capacity wrong, without a hint."""
    build_text(tmp_path, STORES)
    text = (
        'title = "Stores"\nsample_time = "2 s"\n[models]\nobserver = { fmu = "Stores.fmu" }\n'
        '[inputs]\ni = { unit = "1", noise = 0.0, scale = 0.1, held = true }\n'
        '[outputs]\ny = { unit = "1", noise = 0.01, scale = 2.0 }\n[fit.R]\n'
    )
    (tmp_path / "system.toml").write_text(text)
    for number, begin in enumerate((0.7, 1.0, 1.4)):
        stored(tmp_path, str(number), begin, R=0.3)

    def outcome(names: str) -> wb.FitOutcome:
        system = wb.load_system(tmp_path)
        cases = wb.read_cases(tmp_path / "cases", system)
        return fitted(system, [case for case in cases if case.name in names])

    first = outcome("012")
    assert re.match(r"another start of b in each recording would explain 100%", first.doubts[0])
    assert "write a table [fit.b]" in first.doubts[0]
    (tmp_path / "system.toml").write_text(text + "[fit.b]\n")
    second = outcome("012")
    assert second.reliable, second.doubts
    assert (second["R"].low or 1.0) < 0.3 < (second["R"].high or 0.0)
    # With right starts and a wrong form, no start is named.
    for number in (3, 4, 5):
        stored(tmp_path, str(number), 1.0, R=0.3)
    wrong = text.replace('"Stores.fmu" }\n', '"Stores.fmu" }\n[parameters]\nR = 0.2\n')
    (tmp_path / "system.toml").write_text(wrong.replace("[fit.R]", "[fit.a]"))
    third = outcome("345")
    assert not third.reliable
    assert not any("another start" in doubt for doubt in third.doubts)


def test_a_product_that_alone_is_told_is_named_with_its_direction(system, cases):
    given = wb.FittedParameter(name="C", range=(99.0, 101.0), prior=(C, 1.0), by_recording=None)
    outcome = fitted(system, cases[:1], "a", "b", given)
    assert not outcome.reliable
    (direction,) = outcome.directions
    assert set(direction.parts) == {"a", "b"}
    assert sorted(direction.parts.values()) == pytest.approx([-1.0, 1.0], abs=0.05)
    first, second = direction.parts
    assert str(direction).endswith(f"only their product {first}*{second} is identifiable")
    assert not outcome["a"].identified
    assert outcome["a"].low is None
    assert outcome["C"].identified
    # What the recordings do not show of the product's parts is no uncertainty of anything else.
    alone = fitted(system, cases[:1], "a", given)
    for value in (v for v in alone.values if v.name != "a"):
        (beside,) = (v for v in outcome.values if v.label == value.label)
        assert beside.deviation == pytest.approx(value.deviation, rel=0.05)


def test_a_parameter_that_no_output_shows_is_named(system, cases):
    outcome = fitted(system, cases[:1], "C", "G", "idle")
    assert [str(direction) for direction in outcome.directions] == ["idle: no output shows it"]
    assert outcome["C"].identified


def test_a_start_that_errors_hide_is_not_called_one_that_no_output_shows(system, cases):
    """The block swings by 60 times the noise, which no C and G explain; its start is measured."""
    (day, *_) = cases
    swing = 60.0 * NOISE * np.sin(2.0 * np.pi * TIME / (3.0 * STEP))
    outcome = fitted(system, [day.with_signals({"T": day["T"] + swing})], "C", "G")
    (direction,) = outcome.directions
    assert str(direction).startswith("start of T in ")
    assert str(direction).endswith("outputs show it less than the errors that remain")


def test_parameters_that_no_output_shows_are_named_apart_and_keep_their_values(tmp_path):
    # They move the temperature by 1e-12 of itself, as rounding does.
    model = replaced(
        machine_file("heated_block/Block.mo"),
        ("parameter Real idle", "parameter Real spare = 3.0;\n  parameter Real idle"),
        ("- G*T", "- G*T + 1e-11*(idle + spare)"),
    )
    build_text(tmp_path, model)
    (tmp_path / "system.toml").write_text(SYSTEM)
    columns = {"time [s]": TIME, "P [W]": power(1), "T [K]": measured(1)}
    write_case(tmp_path / "cases" / "day1", columns, "Day 1")
    system = wb.load_system(tmp_path)
    day = wb.read_cases(tmp_path / "cases", system)
    outcome = fitted(system, day, "C", "G", "idle", "spare", starts=4)
    said = {"idle: no output shows it", "spare: no output shows it"}
    assert {str(direction) for direction in outcome.directions} == said
    assert outcome["spare"].value == 3.0
    assert outcome["idle"].value == outcome["idle"].nominal


def test_residuals_that_a_wrong_model_leaves_are_told(system, cases):
    """With the heat capacity alone, the loss stays wrong by a quarter."""
    outcome = fitted(system, cases[:1], "C")
    assert not outcome.reliable
    assert any("residuals" in doubt and "times the variance" in doubt for doubt in outcome.doubts)


@pytest.mark.parametrize("name", ["C", "G"])
def test_values_at_which_a_model_runs_away_are_refused_without_a_warning_of_numpy(folder, name):
    """A fit tries such; scipy's warnings named files of its own."""
    drive = Drive(TIME, power(1)[:, None])
    refused = r"is not finite|cannot be integrated"
    with FMU(folder / "Block.fmu") as fmu, pytest.raises(FMUError, match=refused):
        Simulation(fmu, ["P"], ["T"], [True]).run(drive, {name: -1e-3 if name == "C" else -1e6})


def test_ctrl_c_keeps_the_best_values(system, cases):
    def interrupt(line: str) -> None:
        if "start 1" in line:
            raise KeyboardInterrupt

    outcome = wb.fit(system, cases[:1], ["C", "G"], workers=1, report=interrupt)
    assert outcome.interrupted
    assert not outcome.reliable
    assert outcome["C"].value == pytest.approx(C, rel=0.05)
    assert outcome["C"].low is None
    assert outcome.recordings[0].error(outcome.recordings[0].fitted) < 2.0


def test_a_name_that_cannot_be_fitted_is_refused(system, cases):
    with pytest.raises(InputError, match="expected names or patterns"):
        fitted(system, cases[:1], "K")


def test_a_whole_number_is_refused_with_another_way(system):
    """Teeth of a gear: it was called no parameter, and its owner was to correct the name."""
    read = read_description(next(iter(system.models.values())).path)
    variables = [replace(v, type="Integer") if v.name == "idle" else v for v in read.variables]
    entries = replace(read, variables=tuple(variables))
    with pytest.raises(InputError, match=r"'idle', which is a whole number.*in \[parameters\]"):
        resolve_parameters(system, entries, ["idle"])


def test_a_table_of_no_parameter_is_refused(folder):
    path = folder / "wrong.toml"
    path.write_text(SYSTEM.replace("fit.G", "fit.g"))
    with pytest.raises(InputError, match=r"'g' \(closest: 'G'\)"):
        wb.load_system(path)


def test_the_command_writes_what_other_tools_read(folder, tmp_path):
    days = [str(folder / "cases" / f"day{k}") for k in (1, 3)]
    command = ["fit", *days, "--system", str(folder), "--held-out", "day3"]
    command += ["--starts", "1", "--intervals", "covariance", "--workers", "1"]
    assert main([*command, "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    check("fit", summary)
    held_out = summary["recordings"]["day3"]
    assert held_out["held_out"]
    assert held_out["over_noise"]["nominal"] > 10.0
    assert held_out["over_noise"]["fitted"] < 2.0
    values = {name: summary["values"][name]["value"] for name in ("C", "G")}
    ssv = ElementTree.parse(tmp_path / "parameters.ssv").getroot()
    name = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
    parameters = {
        parameter.get("name"): float(parameter.find(f"{name}Real").get("value"))  # type: ignore[union-attr,arg-type]
        for parameter in ssv.iter(f"{name}Parameter")
    }
    assert parameters == values
    fmu = tmp_path / "Block_fitted.fmu"
    starts = {v.name: v.start for v in read_description(fmu).variables}
    assert float(starts["C"] or 0.0) == values["C"]
    assert starts["a"] == "1.0"
    assert any("parameters.ssv" in note for note in summary["notes"])  # compiled-in defaults
    assert "Fitted values" in (tmp_path / "index.html").read_text()


@pytest.mark.parametrize(("parameters", "status"), [(["C"], 1), (["C", "G"], 0)])
def test_a_wrong_model_leads_to_a_diagnosis(parameters, status, folder, tmp_path, capsys):
    """The loss stays wrong by a quarter if the heat capacity alone is fitted."""
    named = [word for name in parameters for word in ("--parameter", name)]
    command = ["fit", str(folder / "cases" / "day1"), "--system", str(folder), *named]
    command += ["--starts", "1", "--intervals", "covariance", "--workers", "1"]
    assert main([*command, "--out", str(tmp_path)]) == status
    advised = f"next: workbench diagnose --system {folder}, on the same recordings"
    assert (advised in capsys.readouterr().out) == bool(status)


def test_a_fitted_fmu_differs_in_start_values_alone(folder, tmp_path):
    write_fmu(folder / "Block.fmu", {"C": 123.0}, tmp_path / "new.fmu")
    with zipfile.ZipFile(folder / "Block.fmu") as old, zipfile.ZipFile(tmp_path / "new.fmu") as new:
        assert old.namelist() == new.namelist()
        changed = [name for name in old.namelist() if old.read(name) != new.read(name)]
        assert changed == ["modelDescription.xml"]
        before, after = (zip_.read(changed[0]).decode() for zip_ in (old, new))
    lines = zip(before.splitlines(), after.splitlines(), strict=True)
    (pair,) = [pair for pair in lines if pair[0] != pair[1]]
    assert 'start="123.0"' in pair[1]
