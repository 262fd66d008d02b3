"""Published recordings become cases, and what they show is named where no tutorial names it.

What the others say is in their tutorials.
"""

import importlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import savemat
from scipy.linalg import expm
from scipy.optimize import least_squares

import workbench as wb
from workbench.__main__ import main
from workbench.arrays import Vector
from workbench.diagnosis import Outcome
from workbench.errors import InputError
from workbench.machines.published import (
    checksums,
    electronic_oscillator,
    heated_house,
    leaking_chamber,
    positioning_stage,
    seal_friction,
)
from workbench.recordings.case import Case, read_case, read_cases
from workbench.recordings.datasets import PREPARED, PublishedRecording, PublishedSet, write_cases
from workbench.system.registry import load_system

from .built import diagnosed


def by_name(folder: Path, system: str) -> dict[str, Case]:
    return {case.name: case for case in read_cases([folder], load_system(system))}


@pytest.mark.parametrize(
    ("system", "name", "parts", "signals", "tolerance"),
    [
        ("air_supply", "metro_air_supply", ["20200201"], ("COMP", "reservoir"), (1e-12, 0.0)),
        # Five digits of values below 10 V.
        (
            "cascaded_tanks",
            "cascaded_tanks",
            ["estimation", "test"],
            ("pump", "level2"),
            (0, 5.1e-5),
        ),
    ],
)
def test_both_layouts_hold_the_same_recordings(
    system, name, parts, signals, tolerance, published_cases, published, tmp_path
):
    for part in parts:
        shutil.copytree(published(name) / part, tmp_path / "set" / part)
    write_cases(system, tmp_path / "set", tmp_path / "cases")
    theirs, digits = (
        by_name(published_cases(system, name), system),
        by_name(tmp_path / "cases", system),
    )
    assert theirs.keys() == digits.keys()
    for recording, case in theirs.items():
        assert_allclose(case.time, digits[recording].time)
        for signal in signals:
            rtol, atol = tolerance
            assert_allclose(case[signal], digits[recording][signal], rtol=rtol, atol=atol)


def same_recordings(
    of: PublishedSet, theirs: Path, ours: Path, atol: float = 0.0
) -> list[PublishedRecording]:
    """What the publisher's layout gives, which is what the other one does."""
    first, second = of.layouts[0].read(theirs), of.layouts[1].read(ours)
    assert [recording.name for recording in first] == [recording.name for recording in second]
    for recording, other in zip(first, second, strict=True):
        assert recording.rows == other.rows
        for column, values in recording.columns.items():
            assert_allclose(values, other.columns[column], atol=atol, err_msg=column)
    return first


# --- an air supply ---


def test_each_cycle_begins_with_the_compressor_off_and_has_one_start(published_cases):
    cases = by_name(published_cases("air_supply", "metro_air_supply"), "air_supply")
    assert sum(case.time.size for case in cases.values()) == 1000
    for case in cases.values():
        assert case["COMP"][0] == 1.0
        assert np.sum(np.diff(case["COMP"]) < 0.0) == 1


# --- two tanks ---


def test_records_of_tanks_are_whole_and_end_at_the_limit_of_the_sensor(published_cases):
    cases = by_name(published_cases("cascaded_tanks", "cascaded_tanks"), "cascaded_tanks")
    assert cases.keys() == {"estimation", "test"}
    for case in cases.values():
        assert case.time.size == 1024
        assert_allclose(np.diff(case.time), 4.0)
    level = cases["estimation"]["level2"]
    high = load_system("cascaded_tanks").signals["level2"].limits[1]
    assert level.max() == high
    assert (level == high).sum() > 20


# --- an oscillating circuit ---


def test_lines_between_sharpened_samples_swing_as_the_signal_does():
    """Closed form: of the lines the first harmonic is the signal, at 9 samples a period."""
    n, cycles, fine = 900, 100, 64
    samples = electronic_oscillator.sharpened(np.sin(2.0 * np.pi * cycles * np.arange(n) / n))
    samples = np.append(samples, samples[0])
    at = np.arange(n * fine) / fine
    lines = np.interp(at, np.arange(n + 1), samples)
    wave = np.exp(-2j * np.pi * cycles * at / n)
    # Sampled lines instead of lines: of order (cycles/(n fine))^2.
    assert_allclose(2.0 * np.mean(lines * wave), -1j, atol=1e-4)


def test_the_arrow_is_held_out_and_realisations_follow_it(tmp_path):
    rng = np.random.default_rng(1)
    rows = [f"{u:.6f},{y:.6f}," for u, y in 0.1 * rng.standard_normal((70000, 2))]
    (tmp_path / "SNLS80mV.csv").write_text("\n".join(['"V1","V2",', *rows]) + "\n")
    read = electronic_oscillator.PUBLISHED.layouts[0].read(tmp_path)
    assert [recording.name for recording in read if recording.held_out] == ["arrow"]
    whole = [(40420, 49119), (49120, 57819), (57820, 66519), (0, 40399)]
    assert [recording.rows for recording in read] == whole


def test_the_stiffening_spring_alone_is_named(published_cases, tmp_path):
    """Of 7.3 mV it leaves the 0.3 mV of cards and circuit."""
    cases = published_cases("electronic_oscillator", "electronic_oscillator")
    system = load_system("electronic_oscillator")
    fitted = read_cases([cases / f"multisine_{number}" for number in (1, 2, 3)], system)
    outcome = diagnosed(system, fitted, tmp_path)
    assert [cause.effect.name for cause in outcome.diagnosis.causes] == ["CubicSpring"]
    before, after = np.sqrt(np.mean([np.square(error.rms) for error in outcome.errors], axis=0))
    assert before > 7e-3
    assert after < 3.5e-4


# --- a house ---

SETTLED, FITTED = 144, 1152  # samples, 12 and 96 hours
# Ci, Ce, Ch, Cs [kWh/K], Rie, Rea, Rih, Ris [K/kW], Aw, Ae [m2] of model TiTeThTsAe, as published.
PARAMETERS = (0.0928, 3.32, 0.889, 0.0549, 0.897, 4.38, 0.146, 1.89, 5.75, 3.87)


def published_model(parameters: Vector) -> tuple[Vector, Vector]:
    """Derivatives of its states - air, walls, heaters, sensor - by states and inputs, per hour."""
    Ci, Ce, Ch, Cs, Rie, Rea, Rih, Ris, Aw, Ae = parameters
    air = [-(1 / Rie + 1 / Rih + 1 / Ris), 1 / Rie, 1 / Rih, 1 / Ris]
    walls = [1 / Rie, -(1 / Rie + 1 / Rea), 0, 0]
    flows = [air, walls, [1 / Rih, 0, -1 / Rih, 0], [1 / Ris, 0, 0, -1 / Ris]]
    inputs = [[0, Aw, 0], [1 / Rea, Ae, 0], [0, 0, 1], [0, 0, 0]]
    capacities = np.array([Ci, Ce, Ch, Cs])[:, None]
    return np.array(flows) / capacities, np.array(inputs) / capacities


def free_run(parameters: Vector, case: Case) -> Vector:
    """Errors of the published model over a whole record [K], led by nothing but the inputs.

    The states at the start are those that fit the first of them best. Inputs are held.
    """
    A, B = published_model(parameters)
    step = expm(np.block([[A, B], [np.zeros((3, 7))]]) / 12.0)
    inputs = np.column_stack([case["Ta"], 1e-3 * case["sun"], 1e-3 * case["heating"]])
    x, read = np.eye(4, 5, 1), np.empty((case.time.size, 5))  # forced; by each state at the start
    for k, u in enumerate(inputs):
        read[k] = x[3]
        x = step[:4, :4] @ x
        x[:, 0] += step[:4, 4:] @ u
    forced, free = case["T"] - read[:, 0], read[:, 1:]
    rows = slice(SETTLED, FITTED)
    errors: Vector = forced - free @ np.linalg.lstsq(free[rows], forced[rows], rcond=1e-9)[0]
    return errors


def rms(errors: Vector) -> float:
    return float(np.sqrt(np.mean(errors**2)))


@pytest.fixture(scope="module")
def house(published_cases) -> dict[str, Case]:
    return by_name(published_cases("heated_house", "heated_house"), "heated_house")


@pytest.fixture(scope="module")
def outcome(house, once) -> Outcome:
    system, fitted, later = load_system("heated_house"), [house["four_days"]], [house["rest"]]
    return once("diagnosis of a house", lambda out: diagnosed(system, fitted, out, held_out=later))


def test_what_follows_the_fitted_hours_is_held_out(tmp_path):
    rows = [f'{k / 12:.12f},1.5,0.2,5.1,21.0,"2009"' for k in range(1300)]
    (tmp_path / "inputPRBS1.csv").write_text("\n".join(['"t","Ta","Ps","Ph","yTi"', *rows]))
    fitted, later = heated_house.PUBLISHED.layouts[0].read(tmp_path)
    assert (fitted.held_out, later.held_out) == (False, True)
    assert fitted.columns["time [s]"][-1] + 300.0 == later.counts_from == 96 * 3600.0
    assert later.columns["time [s]"].size == 1300
    first = {"time [s]": 0.0, "Ta [K]": 274.65, "sun [W/m2]": 200.0}
    first |= {"heating [W]": 5100.0, "T [K]": 294.15}
    assert {n: values[0] for n, values in fitted.columns.items()} == pytest.approx(first)


def test_walls_that_store_heat_are_named(outcome):
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "ShellStore"
    assert set(cause.confusable_with) == {"InteriorStore"}


def test_held_out_hours_are_foreseen_as_by_the_published_structure(house, outcome):
    """Fitted to the same hours; its published parameters were fitted to the held-out ones, too."""
    later = house["rest"]
    fit = least_squares(
        lambda logarithms: free_run(np.exp(logarithms), later)[SETTLED:FITTED],
        np.log(PARAMETERS),
        max_nfev=25,
    )
    assert_allclose(rms(fit.fun), 0.317, atol=0.002)  # as the protocol has it
    nominal, extended = next(error.rms for error in outcome.errors if error.held_out)
    assert extended < 0.6 * nominal
    assert extended < 1.1 * rms(free_run(np.exp(fit.x), later)[FITTED:])
    assert extended < 1.15 * rms(free_run(np.array(PARAMETERS), later)[FITTED:])


def test_with_all_hours_fitted_it_errs_less_than_the_published_model(house, tmp_path):
    """The protocol of its figure: parameters from all 141 h, theirs of one-step predictions."""
    outcome = diagnosed(load_system("heated_house"), list(house.values()), tmp_path)
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "ShellStore"
    errors = {error.recording: error for error in outcome.errors}
    squares = sum(error.samples * error.rms[1] ** 2 for error in errors.values())
    samples = sum(error.samples for error in errors.values())
    published = free_run(np.array(PARAMETERS), house["rest"])
    assert (squares / samples) ** 0.5 < 0.65 * rms(published[SETTLED:])
    assert errors["rest"].rms[1] < 0.6 * rms(published[FITTED:])


# --- closed chambers ---

CHAMBERS = ("Aluminium", "Formlabs", "Prusa", "Ultimaker_015", "Ultimaker_020")


def chamber(number: int, time: np.ndarray) -> np.ndarray:
    """Pressure [bar]: of the first three chambers it stays, of the others it falls from 5 s on."""
    leak = 0.0 if number < 3 else 0.1 * number
    return np.round(7.5 * np.exp(-leak * np.maximum(0.0, time - 4.95)), 3)


def folders(folder: Path, time: np.ndarray) -> None:
    for number, name in enumerate(CHAMBERS):
        (folder / "chamber" / name).mkdir(parents=True)
        rows = [f"{t},{p}\n" for t, p in zip(time, chamber(number, time), strict=True)]
        file = folder / "chamber" / name / "measured.csv"
        file.write_text("".join(["time [s],pressure [bar]\n", *rows]))


def their_files(folder: Path, time: np.ndarray) -> None:
    """Milliseconds with points between thousands: 3.066.000 are 3066.000 ms."""
    data = folder / "appendix_compressed-air_chamber" / "data"
    data.mkdir(parents=True)
    for number, name in enumerate(CHAMBERS):
        lines = []
        for t, p in zip(time, chamber(number, time), strict=True):
            thousands, below = divmod(round(1e3 * t), 1000)
            mark = f"{thousands}.{below:03d}.000" if thousands else f"{below}.000"
            lines.append(f"{mark};{p / 2:.3f};{p}\r\n")
        (data / f"{name}.csv").write_text("".join(lines))


def test_both_layouts_of_chambers_give_the_same_recordings(tmp_path):
    time = np.round(0.1 * np.arange(300), 3)
    their_files(tmp_path / "theirs", time)
    folders(tmp_path / "ours", time)
    same_recordings(leaking_chamber.PUBLISHED, tmp_path / "theirs", tmp_path / "ours", 1e-9)


def test_a_chamber_is_cut_where_it_is_closed_and_at_2_bar(tmp_path):
    folders(tmp_path, np.round(0.1 * np.arange(300), 3))
    read = {
        recording.name: recording
        for recording in leaking_chamber.PUBLISHED.layouts[1].read(tmp_path)
    }
    held_out = [name for name, recording in read.items() if recording.held_out]
    assert held_out == ["Ultimaker_015_below", "Ultimaker_020_below"]
    assert read["Aluminium_above"].rows == (0, 299)
    above, below = read["Ultimaker_020_above"], read["Ultimaker_020_below"]
    assert above.rows[0] == below.rows[0] == 50  # whence what is above leads to what is below
    assert below.rows[1] == 299
    assert above.counts_from is None
    counts = below.columns["time [s]"] >= below.counts_from
    assert pressure(above).min() >= 2.0 > pressure(below)[counts].max()
    assert counts.sum() == below.columns["time [s]"].size - above.columns["time [s]"].size
    assert above.columns["time [s]"][0] == 0.0


def pressure(recording: PublishedRecording) -> np.ndarray:
    return recording.columns["p [bar]"]


RATE = 287.05 * 293.15 / 1e-4  # R T/V of the model: pressure decays by this times conductance
MATTERS = 3e-14  # [kg/(s.Pa)] of a laminar leak


@pytest.mark.parametrize("times", [100.0, 1000.0, 10_000.0])
def test_a_leak_is_found_however_far_it_leads_from_the_tight_chamber(tmp_path, times):
    """Reference: the exact solution, p = p0 exp(-R T/V conductance t), of an ideal gas.

    Linearised about a tight chamber the pressure falls evenly, which tells nothing of a decay.
    """
    system = load_system("leaking_chamber")
    conductance, time = times * MATTERS, 0.1 * np.arange(600)
    for number, pressure in enumerate((5e5, 7e5)):
        noise = 300.0 * np.random.default_rng(number).standard_normal(time.size)
        rows = pressure * np.exp(-RATE * conductance * time) + noise
        folder = tmp_path / "recordings" / f"{number}"
        folder.mkdir(parents=True)
        lines = [f"{t:.1f},{p:.1f}\n" for t, p in zip(time, rows, strict=True)]
        (folder / "measured.csv").write_text("".join(["time [s],p [Pa]\n", *lines]))
        (folder / "case.toml").write_text(
            'title = "A chamber that is closed"\nmeasurement.file = "measured.csv"\n'
        )
    outcome = diagnosed(system, read_cases([tmp_path / "recordings"], system), tmp_path)
    assert outcome.diagnosis.verdict == "found"
    cause = outcome.diagnosis.causes[0]
    assert cause.effect.name == "LaminarLeak"
    size = cause.parameters["conductance"]
    assert size.low <= conductance <= size.high


@pytest.fixture(scope="module")
def chambers(published_cases) -> Path:
    return published_cases("leaking_chamber", "pneumatic_cylinder")


# `Ultimaker_020`, and `Aluminium`, which is tight, are diagnosed by a tutorial.
@pytest.mark.parametrize("name", ["Prusa", "Ultimaker_015"])
def test_a_chamber_that_leaks_does_so_laminarly(chambers, tmp_path, name):
    above = read_cases([chambers / f"{name}_above"], load_system("leaking_chamber"))
    diagnosis = diagnosed(load_system("leaking_chamber"), above, tmp_path).diagnosis
    assert diagnosis.verdict == "found"
    assert diagnosis.causes[0].effect.name == "LaminarLeak"


def test_both_parts_of_a_chamber_that_empties_are_explained_by_its_leak(chambers, tmp_path):
    """The nominal chamber is thousands of times the noise off, where derivatives tell nothing."""
    system = load_system("leaking_chamber")
    both = read_cases([chambers / f"Ultimaker_020_{part}" for part in ("above", "below")], system)
    outcome = diagnosed(system, both, tmp_path)
    assert outcome.diagnosis.causes[0].effect.name == "LaminarLeak"
    gain = outcome.diagnosis.gain
    assert gain.after < 0.01 * gain.before


# --- a positioning stage ---


def test_the_record_with_pulses_is_held_out(tmp_path):
    goal = np.linspace(0.0, 0.2, 40)[:, None]
    content = {"qg": goal, "qm": goal - 1e-3, "vir": 2.0 * goal, "t": goal}
    savemat(tmp_path / "DATA_EMPS.mat", content)
    pulses = (np.arange(40) % 7)[:, None]
    savemat(tmp_path / "DATA_EMPS_PULSES.mat", {**content, "pulses_N": pulses})
    fitted, held_out = positioning_stage.PUBLISHED.layouts[0].read(tmp_path)
    assert [recording.held_out for recording in (fitted, held_out)] == [False, True]
    assert not fitted.columns["pulse [V]"].any()
    assert_array_equal(held_out.columns["pulse [V]"], pulses.ravel())
    assert_array_equal(fitted.columns["command [V]"], 2.0 * goal.ravel())
    assert fitted.columns["time [s]"][-1] == pytest.approx(0.039)


def test_friction_and_its_slant_are_named(published_cases, tmp_path):
    """Published: 20.4 N and 203.5 N.s/m, or 166.7 one way and 240.4 the other."""
    cases = published_cases("positioning_stage", "positioning_stage")
    system = load_system("positioning_stage")
    outcome = diagnosed(system, read_cases([cases / "motion"], system), tmp_path)
    causes = {cause.effect.name: cause for cause in outcome.diagnosis.causes}
    assert set(causes) == {"DryFriction", "ViscousFriction", "SlantedDamping"}
    assert outcome.diagnosis.causes[0].effect.name == "DryFriction"


# --- two seals ---


def test_rate_of_a_steady_stroke_is_exact_between_uneven_samples():
    time = np.cumsum(np.random.default_rng(1).choice([0.01, 0.011, 0.3], 200, p=[0.6, 0.38, 0.02]))
    assert_allclose(seal_friction.rate(time, 3.0 - 12.5 * time), -12.5)


def test_rate_has_a_tenth_of_the_noise_of_differences():
    """Closed form: of n samples h apart, s/h*sqrt(12/(n^3 - n)), as of any line."""
    time = 0.01 * np.arange(5000)
    noise = 0.01 * np.random.default_rng(2).standard_normal(time.size)
    deviation = np.std(seal_friction.rate(time, noise)[5:-5])
    assert deviation == pytest.approx(0.01 / 0.01 * np.sqrt(12.0 / (11**3 - 11)), rel=0.05)
    assert deviation < 0.15 * np.std(np.diff(noise) / 0.01)


def test_both_layouts_of_seals_give_the_same_recordings(tmp_path):
    """The publisher's are without a header, in ms, with voltages of the sensors in between."""
    theirs, ours = tmp_path / "theirs", tmp_path / "ours"
    (theirs / "results_pneumatic-actuator" / "data" / "friction").mkdir(parents=True)
    t = np.cumsum(np.random.default_rng(3).integers(9, 12, 60))
    for number, name in enumerate(checksums("seal_friction")):
        s, p, F = 0.1 * np.arange(60.0), np.full(60, 1.0 + number), 50.0 + np.arange(60.0)
        lines = [
            f"{a:.3f}\t3.476\t0.5\t1.07\t{b}\t{c}\t{d}\r\n"
            for a, b, c, d in zip(t, s, p, F, strict=True)
        ]
        (theirs / f"results_pneumatic-actuator/data/friction/{name}.csv").write_text("".join(lines))
        (ours / "friction" / name).mkdir(parents=True)
        rows = [f"{a / 1e3},{b},{c},{d}\n" for a, b, c, d in zip(t, s, p, F, strict=True)]
        header = "time [s],stroke [mm],pressure [bar],force [N]\n"
        (ours / "friction" / name / "measured.csv").write_text("".join([header, *rows]))
    read = same_recordings(seal_friction.PUBLISHED, theirs, ours)
    assert [recording.name for recording in read if recording.held_out] == [
        "NAPN_5bar",
        "O-ring_5bar",
    ]
    assert {recording.rows for recording in read} == {(15, 59)}


# --- a servo ---


@pytest.fixture(scope="module")
def servo(published_cases) -> Path:
    return published_cases("servo_pendulum", "servo_pendulum")


def test_records_of_one_gain_are_held_out(servo):
    written = json.loads((servo / PREPARED).read_text())
    assert len(written["cases"]) == 16
    assert sorted(written["held_out"]) == [
        name for name in sorted(written["cases"]) if "kp200" in name
    ]
    assert len(written["held_out"]) == 4


def test_a_record_has_its_gain_and_its_signals(servo):
    case = read_case(servo / "kp400_lift_and_drop", load_system("servo_pendulum"))
    assert case.conditions == {"kp": 400}
    assert case.inputs == ("goal", "volts", "enabled")
    # The motor is let go after 2 s, and the arm falls from where it was.
    assert np.all(case["enabled"] == (case.time <= 2.0))
    assert case["position"][400] < -0.6
    assert case["position"].max() > 0.4


# --- case folders from what was published ---


TANKS = ("estimation/measured.csv", "test/measured.csv")
PUMPS = """
import hashlib
from pathlib import Path
import numpy as np
from workbench import Plugin
from workbench.recordings.datasets import FolderLayout, PublishedSet, PublishedRecording

def read(folder):
    names = (folder / "pumps.txt").read_text().split()
    columns = {"time [s]": np.arange(3.0), "p [bar]": np.ones(3)}
    made = lambda name: PublishedRecording(
        name, name, columns, "pumps.txt", (0, 2), held_out="test" in name, machine=name[0]
    )
    return [made(name) for name in names]

def layout(names):
    checksum = hashlib.sha256(" ".join(names).encode()).hexdigest()
    return FolderLayout("a list", {"pumps.txt": checksum}, read)

PLUGIN = Plugin(published=f"{__name__}:PUBLISHED")
PUBLISHED = PublishedSet("Pumps", "a shop", "none", "Pumps.", (layout(NAMES),))
"""


@pytest.fixture
def pumps(tmp_path, monkeypatch) -> Callable[..., Path]:
    """Publishes recordings of pumps by names; returns the system file."""
    monkeypatch.syspath_prepend(str(tmp_path / "modules"))
    (tmp_path / "modules").mkdir()
    (tmp_path / "set").mkdir()

    def publish(*names: str) -> Path:
        number = len(list((tmp_path / "modules").glob("*.py")))
        module = tmp_path / "modules" / f"{tmp_path.name}_{number}.py"
        module.write_text(PUMPS.replace("NAMES", repr(names)))
        (tmp_path / "set" / "pumps.txt").write_text(" ".join(names))
        (tmp_path / "system.toml").write_text(f'title = "Pumps"\nplugin = "{module.stem}:PLUGIN"\n')
        importlib.invalidate_caches()
        return tmp_path / "system.toml"

    return publish


@pytest.mark.parametrize(
    ("names", "cases"),
    [
        (("a_1", "a_test", "b_1"), ["{0}/a_1 {0}/a_test --held-out a_test", "{0}/b_1"]),
        (("a_1", "a_test"), ["{0} --held-out a_test"]),  # of a single machine the whole folder
    ],
)
def test_each_machine_of_a_set_has_its_own_next_command(names, cases, pumps, tmp_path, capsys):
    system, out = str(pumps(*names)), tmp_path / "cases"
    assert main(["prepare", system, "--from", str(tmp_path / "set"), "--out", str(out)]) == 0
    _, *commands = capsys.readouterr().out.splitlines()
    diagnose = f"next: workbench diagnose --system {system}"
    assert commands == [f"{diagnose} {given.format(out)}" for given in cases]


def test_cases_of_an_earlier_run_go_unless_somebody_changed_them(pumps, tmp_path):
    out = tmp_path / "cases"
    write_cases(str(pumps("a_1", "a_2", "a_3", "a_4")), tmp_path / "set", out)
    (out / "a_2" / "measured.csv").write_text("mine")
    (out / "a_3" / "notes.txt").write_text("mine")
    (out / "mine").mkdir()
    write_cases(str(pumps("a_1")), tmp_path / "set", out)
    assert {str(path.relative_to(out)) for path in out.rglob("*")} == {
        *("prepared.json", "mine", "a_1", "a_1/case.toml", "a_1/measured.csv"),
        *("a_2", "a_2/measured.csv", "a_3", "a_3/notes.txt"),
    }


def test_a_set_says_where_it_is_to_be_had(capsys):
    assert main(["prepare", "cascaded_tanks"]) == 0
    printed = capsys.readouterr().out
    for part in ("https://doi.org/10.4121/12960104", "CC BY-SA 4.0", "dataBenchmark.mat"):
        assert part in printed


def test_a_system_whose_recordings_nobody_published_says_so():
    with pytest.raises(InputError, match="no plugin that knows of published recordings"):
        write_cases("wheelset", Path(), Path())


def test_a_file_with_another_checksum_is_refused(tmp_path):
    for name in TANKS:
        (tmp_path / "set" / name).parent.mkdir(parents=True)
        (tmp_path / "set" / name).write_text("time [s],pump [V],level2 [V]\n0,1,2\n")
    with pytest.raises(InputError, match=r"estimation/measured.csv: found another file \(SHA-256"):
        write_cases("cascaded_tanks", tmp_path / "set", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_set_that_is_not_complete_is_refused(tmp_path):
    (tmp_path / "test").mkdir()
    (tmp_path / TANKS[1]).write_text("")
    with pytest.raises(InputError, match=r"estimation/measured\.csv: found no such file"):
        write_cases("cascaded_tanks", tmp_path, tmp_path / "out")


def test_a_folder_without_the_set_says_what_it_lacks(tmp_path):
    with pytest.raises(InputError, match=r"a folder with dataBenchmark\.mat or estimation"):
        write_cases("cascaded_tanks", tmp_path, tmp_path / "out")


def test_a_folder_with_other_files_is_left_as_it_is(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="a folder with other files"):
        write_cases("cascaded_tanks", tmp_path / "set", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_what_was_read_and_cut_is_told_to_machines(tmp_path, published):
    for _ in range(2):  # over its own files it writes again
        write_cases("cascaded_tanks", published("cascaded_tanks"), tmp_path)
    written = json.loads((tmp_path / PREPARED).read_text())
    assert written["licence"] == "CC BY-SA 4.0"
    assert list(written["read"]) == ["dataBenchmark.mat"]
    assert written["cases"].keys() == {"estimation", "test"}
    assert written["held_out"] == ["test"]
    assert written["cases"]["test"]["rows"] == [0, 1023]


def test_a_script_gets_recordings_to_fit_and_those_held_out(tmp_path, published):
    fitted, held_out = wb.prepare_cases("cascaded_tanks", published("cascaded_tanks"), tmp_path)
    assert [case.name for case in fitted] == ["estimation"]
    assert [case.name for case in held_out] == ["test"]
