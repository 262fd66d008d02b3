"""An FMU and log files are enough: `workbench new` writes a system file that commands run on."""

import builtins
import json
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from workbench.__main__ import main
from workbench.cli import inputs
from workbench.errors import InputError
from workbench.observers import choose
from workbench.recordings import formats
from workbench.recordings.case import read_cases
from workbench.runtime.files import read_bytes
from workbench.system.registry import load_system, open_model
from workbench.system.template import SEEPAGE, write_system

pytest.importorskip("casadi", reason="needs the extra [compiler]")
pytest.importorskip("rumoca", reason="needs the extra [compiler]")
pytest.importorskip("ziglang", reason="needs the extra [compiler]")

from .built import build_text, diagnosed, machine_file
from .linear import exact_step

NOISE = 0.05  # K


@pytest.fixture(scope="module")
def fmu(tmp_path_factory) -> Path:
    return build_text(tmp_path_factory.mktemp("oven"), machine_file("oven/Oven.mo"))


def write_log(
    path: Path, seed: int, header: str = "Zeit [ms];Heating power [kW];T [°C];p [mbar]"
) -> Path:
    """A German log of an oven of another capacity, in closed form."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 600.0, 2.0)
    power = np.repeat(rng.uniform(5.0, 60.0, 4), time.size // 4).round()
    A = [[-2.6 / 100.0, 2.6 / 100.0], [2.6 / 200.0, -3.3 / 200.0]]
    Phi, G, _ = exact_step(A, [[1.0 / 100.0, 0.0], [0.0, 0.7 / 200.0]], 2.0)
    x, rows = np.array([295.0, 294.0]), []
    for t, u in zip(time, power, strict=True):
        measured = x[0] - 273.15 + NOISE * rng.standard_normal()
        rows.append(f"{1e3 * t:.0f};{1e-3 * u:.3f};{measured:.3f};1013".replace(".", ","))
        x = Phi @ x + G @ [u, 293.15]
    path.write_text("\n".join([header, *rows]))
    return path


@pytest.fixture
def answer(monkeypatch) -> Callable[[str], list[str]]:
    """Answers each question with a text; returns the questions."""

    def answers(text: str) -> list[str]:
        asked: list[str] = []
        monkeypatch.setattr(builtins, "input", lambda: asked.append(text) or text)
        return asked

    return answers


def test_each_log_is_read_once_and_a_large_one_is_told_before(tmp_path, fmu, monkeypatch, capsys):
    """A million samples were read twice, for minutes without a word."""
    read = []
    monkeypatch.setattr(formats, "read_bytes", lambda p, r: read.append(p) or read_bytes(p, r))
    monkeypatch.setattr(inputs, "_LARGE", 5000)
    log = write_log(tmp_path / "day.csv", 1)
    folder = tmp_path / "oven"
    assert main(["new", str(folder), "--fmu", str(fmu), "--recordings", str(log), "--yes"]) == 0
    assert read == [log]
    assert "reading day.csv, 0 MB" in capsys.readouterr().err


def test_two_commands_lead_from_an_fmu_and_logs_to_an_open_loop(tmp_path, fmu, answer):
    asked = answer("")
    logs = [str(write_log(tmp_path / f"day{k}.csv", k)) for k in (1, 2)]
    folder = tmp_path / "oven"
    assert main(["new", str(folder), "--fmu", str(fmu), "--recordings", *logs]) == 0
    assert not asked  # names and units tell all
    content = tomllib.loads((folder / "system.toml").read_text())
    assert content["sample_time"] == "2 s"
    assert content["outputs"]["T"]["possible"] == ["250 K", "500 K"]
    noise = float(content["outputs"]["T"]["noise"].removesuffix(" K"))
    assert noise == pytest.approx(NOISE, rel=0.15)  # 600 samples tell it to 4 %; values are rounded
    assert content["inputs"]["P"]["held"] is True
    assert content["fit"]["C"]["range"] == ["10 J/K", "1000 J/K"]
    assert content["fit"]["K"]["range"] == ["0.4 W/K", "10 W/K"]
    assert "offset" not in content["fit"]  # zero, and no range: nobody knows its size
    cases = read_cases([folder / "recordings"], load_system(folder))
    assert [case.name for case in cases] == ["day1", "day2"]
    assert 294.0 < cases[0]["T"][0] < 296.0
    out = str(tmp_path / "out")
    command = ["simulate", "--system", str(folder), "--estimator", "open_loop", "--out", out]
    assert main([*command, "--workers", "1"]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert set(summary["cases"]) == {"day1", "day2"}


@pytest.mark.parametrize(("samples", "held"), [(1, True), (10, False)])
def test_a_command_is_held_where_it_jumps_and_not_where_it_ramps(tmp_path, fmu, samples, held):
    """A power that rises for 20 s and then stays was held: half a sample late, for a cause."""
    time = np.arange(0.0, 600.0, 2.0)
    power = 5.0 + 10.0 * np.clip((time % 150.0) / (2.0 * samples), 0.0, 1.0)
    rows = [
        f"{t:g},{p:.6f},{300 + 0.1 * (k % 7)}"
        for k, (t, p) in enumerate(zip(time, power, strict=True))
    ]
    log = tmp_path / "log.csv"
    log.write_text("\n".join(["time [s],P [W],T [K]", *rows]))
    assert ("held = true" in drafted(fmu, log)) is held


def test_an_estimator_that_acts_by_quantities_alone_is_left_out_without_any(tmp_path, fmu):
    log = write_log(tmp_path / "log.csv", 3)
    drafted(fmu, log)
    system = load_system(log.with_name("system"))
    assert "parameter_estimator" not in choose(system, [])
    (estimator,) = choose(system, ["parameter_estimator"]).values()
    with open_model(system) as model:
        gains = estimator.default_gains(model, system)
        with pytest.raises(InputError, match=r"no table \[estimated.NAME\]"):
            estimator(model, system, gains)


def drafted(fmu: Path, log: Path) -> str:
    """The system file that is written for an FMU and a log, unasked."""
    folder = log.with_name("system")
    main(["new", str(folder), "--fmu", str(fmu), "--recordings", str(log), "--yes"])
    return (folder / "system.toml").read_text()


def test_what_was_concluded_or_is_missing_is_said_in_the_file(tmp_path, fmu):
    text = drafted(fmu, write_log(tmp_path / "log.csv", 3))
    assert "# QUESTION: draught drives the model, and no channel has its name; it stays at" in text
    assert "# [fit.offset] is 0, and the model states no range: add it with a range" in text
    assert "0.5 W/K in the model; a fifth to five times its value" in text
    assert "# channels that are not used: p [mbar]" in text
    assert "Tc at 293.15 [K]" in text


def test_a_heater_that_is_on_or_off_is_held_and_its_chatter_is_no_noise(tmp_path, fmu):
    """It switches at most samples, and is read with 50 W of noise."""
    rng, log = np.random.default_rng(2), write_log(tmp_path / "log.csv", 1)
    lines = log.read_text().splitlines()
    for k, line in enumerate(lines[1:], start=1):
        time, _, *others = line.split(";")
        power = 30.0 * rng.integers(2) + 0.05 * rng.standard_normal()
        lines[k] = ";".join([time, f"{power:.4f}".replace(".", ","), *others])
    log.write_text("\n".join(lines))
    power = tomllib.loads(drafted(fmu, log))["inputs"]["P"]
    assert power["held"]
    assert float(power["noise"].split()[0]) == pytest.approx(50.0, rel=0.15)


def test_a_channel_that_only_its_unit_speaks_for_is_asked_about_once(tmp_path, fmu, answer):
    asked = answer("n")
    log = write_log(tmp_path / "log.csv", 3, "Zeit [ms];Leistung [kW];Sonde 3 [°C];p [mbar]")
    command = ["new", str(tmp_path / "oven"), "--fmu", str(fmu), "--recordings", str(log)]
    assert main(command) == 2
    assert not (tmp_path / "oven").exists()
    assert asked == ["n"]
    asked = answer("")
    assert main(command) == 0
    assert asked == [""]
    (case,) = read_cases([tmp_path / "oven" / "recordings"], load_system(tmp_path / "oven"))
    assert 294.0 < case["T"][0] < 296.0


def test_a_channel_that_is_named_alone_has_the_unit_of_its_file(tmp_path, fmu, capsys):
    """Its size was taken for W and K, and each gave a question that the file answers."""
    log = write_log(tmp_path / "log.csv", 3, "Zeit [ms];Leistung [W];Sonde 3 [°C];p [mbar]")
    log.write_text(log.read_text("utf-8").replace("[W]", "[mW]"), "utf-8")
    columns = ["--column", "T=Sonde 3", "--column", "P=Leistung"]
    command = ["new", str(tmp_path / "oven"), "--fmu", str(fmu), "--recordings", str(log)]
    assert main([*command, *columns, "--yes"]) == 0
    assert "[1]" not in capsys.readouterr().out
    text = (tmp_path / "oven" / "system.toml").read_text()
    assert not [
        line for line in text.splitlines() if "QUESTION: " in line and "draught" not in line
    ]


def test_an_output_that_no_channel_can_be_is_asked_for_by_name(tmp_path, fmu, capsys):
    log = write_log(tmp_path / "log.csv", 3, "Zeit [ms];Leistung [kW];Sonde 3 [V];p [mbar]")
    command = ["new", str(tmp_path / "oven"), "--fmu", str(fmu), "--recordings", str(log)]
    assert main(command) == 2
    assert "found no channel that is an output of the model" in capsys.readouterr().err
    assert main([*command, "--column", "T=Sonde 3 [degC]", "--column", "P=Leistung", "--yes"]) == 0


# --- units with a zero of their own ---


@pytest.fixture(scope="module")
def ice(tmp_path_factory) -> Path:
    return build_text(tmp_path_factory.mktemp("ice"), machine_file("ice/Ice.mo"))


def ice_log(path: Path, header: str, zero: float = 0.0) -> Path:
    rows = [
        f"{t},{zero + 20.0:.2f},{zero + 20.0 - 16.0 * np.exp(-0.01 * t):.3f}" for t in range(99)
    ]
    path.write_text("\n".join([header, *rows]))
    return path


def test_kelvin_is_no_reading_of_a_variable_in_degrees_celsius(tmp_path, ice, capsys):
    log = ice_log(tmp_path / "log.csv", "time [s],room [K],box [K]", 273.15)
    command = ["new", str(tmp_path / "box"), "--fmu", str(ice), "--recordings", str(log)]
    assert main([*command, "--yes"]) == 2
    assert "box: 'box' is in [K], the model's variable in [degC]" in capsys.readouterr().err
    assert main([*command, "--column", "box=box [K]", "--yes"]) == 2
    assert "[degC], which the workbench does not convert" in capsys.readouterr().err


def test_a_unit_that_nobody_states_is_asked_about_where_it_has_a_zero_of_its_own(
    tmp_path, ice, capsys
):
    text = drafted(ice, ice_log(tmp_path / "log.csv", "time [s],room [degC],box"))
    assert "# QUESTION: box: no unit in the file, [degC] of the model is taken" in text
    assert "# QUESTION: room" not in text
    assert "warning" not in capsys.readouterr().err  # [degC] as it is contradicts no file


def test_a_signal_a_thousand_times_its_start_is_asked_about(tmp_path, ice):
    text = drafted(ice, ice_log(tmp_path / "log.csv", "time [s],room [degC],box [degC]", 2e4))
    question = "# QUESTION: box: its largest sample, 2.001e+04, is 5e+03 times the model's start"
    assert question in text


def test_the_noise_of_what_never_moves_is_asked_for(tmp_path, ice):
    log = tmp_path / "log.csv"
    log.write_text(
        "\n".join(["time [s],room [degC],box [degC]", *(f"{t},20,0" for t in range(99))])
    )
    text = drafted(ice, log)
    assert "# QUESTION: it stays where it is in all recordings: what is the noise of its" in text
    assert tomllib.loads(text)["outputs"]["box"]["noise"] == 1e-4


def test_the_whole_name_and_outputs_go_before_parts_of_names(tmp_path):
    """Libraries of mechanics have many variables whose last part is v."""
    pendulum = build_text(
        tmp_path,
        "model Swing connector Flange output Real v; end Flange; Flange left; Flange right; "
        'output Real v(unit="m/s", start=1.0, fixed=true); parameter Real d(unit="1/s") = 0.3; '
        "equation der(v) = -d*v; left.v = 2.0*v; right.v = 3.0*v; end Swing;",
    )
    rows = [f"{1709290800000 + 100 * k},{1e2 * np.exp(-0.03 * k):.3f}" for k in range(90)]
    log = tmp_path / "log.csv"
    log.write_text("\n".join(["timestamp,v [cm/s]", *rows]))
    content = tomllib.loads(drafted(pendulum, log))
    assert list(content["outputs"]) == ["v"]
    assert content["sample_time"] == "0.1 s"  # in ms since 1970; it was 100 s
    assert content["diagnosis"]["block"] == "0.2 s"  # 90 samples have 45 of two, not 18 of five
    assert "QUESTION" not in (tmp_path / "system" / "system.toml").read_text()


# --- a tank to begin with ---


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("new") / "tank"
    assert main(["new", str(folder)]) == 0
    return folder


def test_a_folder_with_a_system_is_left_as_it_is(folder):
    with pytest.raises(InputError, match="expected a folder without a system"):
        write_system(folder)


def ran(command: str, folder: Path, out: Path, *options: str) -> dict[str, object]:
    """Run a command on the new system; returns its summary."""
    name, *arguments = command.split()
    assert main([name, *arguments, "--system", str(folder), "--out", str(out), *options]) == 0
    summary: dict[str, object] = json.loads((out / "summary.json").read_text())
    return summary


def test_it_is_simulated_on_its_recordings(folder, tmp_path):
    cases = ran("simulate", folder, tmp_path, "--workers", "1")["cases"]
    assert isinstance(cases, dict)
    assert len(cases) == 4
    for case in cases.values():
        errors = {name: estimator["h_nrmse"] for name, estimator in case["estimators"].items()}
        # What seeps is a sixth of what leaves: without feedback the level is wrong by as much.
        alone = errors.pop("open_loop")
        assert alone > 0.1
        assert max(errors.values()) < 0.2 * alone


def test_the_wall_that_seeps_is_named(folder, tmp_path):
    diagnosis = diagnosed(load_system(folder), folder / "recordings", tmp_path).diagnosis
    assert diagnosis.verdict == "found"
    (cause,) = diagnosis.causes
    assert cause.effect.name == "Seepage"
    assert cause.parameters["k"].low < SEEPAGE < cause.parameters["k"].high
