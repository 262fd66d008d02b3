"""Systems without states, without inputs, and with few samples go the way of all others."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.diagnosis import Outcome
from workbench.diagnosis.data.cleaning import (
    deviation_beside_switching,
    deviation_of,
    levels_of,
    outliers,
)
from workbench.diagnosis.data.motion import led_by, motion
from workbench.diagnosis.inference.best_estimate import bands, best_estimate
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.errors import InputError
from workbench.models.checks import check, is_fit
from workbench.models.fmu import FMU, CoSimulation
from workbench.observers.operating import corrected_states
from workbench.pages.columns import read_estimates
from workbench.recordings.case import check_recording, read_cases
from workbench.system.registry import load_system, open_model
from workbench.system.units import quantity

from . import built
from .built import build_here, machine, write_case

BALANCE, BALANCE_FILE = machine("balance")
STIFFNESS, FRICTION, LEAK = 103.0, 0.4, 0.01
MATTERS = 0.05  # N, of friction, as the library says


def written(folder: Path, library: str, file: str) -> Path:
    folder.mkdir()
    (folder / "package.mo").write_text(library)
    (folder / "system.toml").write_text(file)
    return folder


def recorded(folder: Path, name: str, columns: dict[str, np.ndarray]) -> None:
    write_case(folder / "recordings" / name, columns, name, "%.8g")


def pulls(folder: Path, friction: float) -> Path:
    """Three pulls of a balance, sampled unevenly, with a pivot that rubs by a force [N]."""
    folder = written(folder, BALANCE, BALANCE_FILE)
    rng = np.random.default_rng(1)
    for k in range(3):
        t = np.cumsum(rng.uniform(0.009, 0.011, 3000))
        omega = 2.0 * np.pi / (4.0 + k)
        s, v = 0.05 * (1.0 - np.cos(omega * t)), 0.05 * omega * np.sin(omega * t)
        F = STIFFNESS * s + friction * np.tanh(v / 1e-3)
        noise = rng.standard_normal((3, t.size))
        columns = {"time [s]": t, "s [m]": s + 1e-5 * noise[0], "v [m/s]": v + 1e-4 * noise[1]}
        recorded(folder, f"{k:02d}_pull", {**columns, "F [N]": F + 0.01 * noise[2]})
    return folder


@pytest.fixture(scope="module")
def balance(tmp_path_factory) -> Path:
    return pulls(tmp_path_factory.mktemp("small") / "balance", FRICTION)


@pytest.fixture(scope="module")
def bottle(tmp_path_factory) -> Path:
    """Three bottles that leak."""
    folder = written(tmp_path_factory.mktemp("small") / "bottle", *machine("bottle"))
    rng = np.random.default_rng(2)
    for k in range(3):
        t = np.arange(200.0)
        p = (5.0 + 0.3 * k) * np.exp(-LEAK * t) + 0.002 * rng.standard_normal(t.size)
        recorded(folder, f"{k:02d}_leak", {"time [s]": t, "p [bar]": p})
    return folder


def status_of(command: str, folder: Path, out: Path, name: str = "") -> int:
    """Exit status of a command on a recording of a machine, or on all of them."""
    given = [str(folder / "recordings" / name), "--system", str(folder), "--out", str(out)]
    return main([command, *given, "--workers", "1"])


def diagnosed(folder: Path, out: Path, *effects: str) -> Outcome:
    return built.diagnosed(load_system(folder), folder / "recordings", out, *effects)


def test_a_unit_may_begin_with_one_over():
    assert quantity("0.3 1/s", "1/s", "here") == 0.3


# --- without states ---


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_without_states_is_built_and_fit(balance, tmp_path, fmi):
    file = tmp_path / "Balance.fmu"
    build_here(balance / "package.mo", "Balance.Observer", file, fmi)
    findings = check(file, instantiations=10)
    assert is_fit(findings)
    (integrated,) = [
        finding for finding in findings if "not tried: the FMU has no" in finding.reason
    ]
    assert integrated.name == "Co-Simulation against Model Exchange"
    for cls in (FMU, CoSimulation):
        with cls(file) as fmu:
            fmu.start({})
            fmu.set(fmu.variables(["s", "dc"]), np.array([0.2, 3.0]))
            assert fmu.states == ()
            assert fmu.step(0.01).size == 0
            assert_allclose(fmu.get(fmu.variables(["F"])), 20.6)


def test_estimators_find_the_stiffness_without_a_state(balance, tmp_path):
    # The pivot rubs, which the model lacks: bands cannot hold, and the status says so.
    assert status_of("simulate", balance, tmp_path, "00_pull") == 1
    estimates = read_estimates(tmp_path / "00_pull.npz")
    # The smoother is the reference: nothing there is only to judge by.
    for name in ("disturbance_observer", "parameter_estimator", "ekf", "ukf", "smoother"):
        # Friction is 5 % of the spring's force there at most, and changes its sign.
        pulled = estimates["measured.F [N]"] > 8.0
        assert estimates[f"{name}.c [N/m]"][pulled].mean() == pytest.approx(STIFFNESS, rel=0.02)


def test_noise_of_an_input_that_the_output_shows_at_once_counts(balance):
    """Closed form: a deviation of 0.1 mm is one of 10 mN, by a stiffness of 100 N/m."""
    system = load_system(balance)
    with open_model(system) as fmu:
        linearised = motion(fmu, system)
    lead = led_by(linearised, np.array([1e-4, 1e-4]), np.array([0.01]), 0.01)
    assert linearised.states == ()
    assert lead.gain.shape == (0, 1)
    assert_allclose(lead.ahead, [[1e-4]])


def test_what_was_built_unasked_has_the_name_of_the_model(balance, tmp_path):
    """In errors and files, and not that of the kept file, a hash that nobody knows."""
    with open_model(load_system(balance)) as fmu:
        assert str(fmu.event_error()).startswith("model Balance.Observer: an event of the model")
    recording = str(balance / "recordings" / "00_pull")
    main(["fit", recording, "--system", str(balance), "--parameter", "c", "--out", str(tmp_path)])
    assert [path.name for path in tmp_path.glob("*.fmu")] == ["Balance.Observer_fitted.fmu"]


def test_the_pivot_that_rubs_is_named(balance, tmp_path):
    """Beside an effect that brings a state to a model that has none."""
    outcome = diagnosed(balance, tmp_path)
    assert outcome.diagnosis.verdict == "found"
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "DryFriction"
    assert cause.parameters["fc"].low < FRICTION < cause.parameters["fc"].high
    with FMU(outcome.extension.fmu) as extended:
        assert extended.states == ()
    assert set(bands(best_estimate(outcome, "00_pull"))["extended_model"]) == {"c"}


@pytest.mark.parametrize("share", [0.997, 1.06])
def test_what_is_at_the_least_that_matters_is_named(share, tmp_path):
    """Something is missing for sure, and its noise does not say that it is too small to matter."""
    friction = share * MATTERS
    outcome = diagnosed(pulls(tmp_path / "balance", friction), tmp_path / "out")
    assert outcome.diagnosis.verdict == "found"
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "DryFriction"
    assert cause.parameters["fc"].low < friction < cause.parameters["fc"].high


def test_what_explains_everything_by_less_than_what_matters_is_said(tmp_path):
    outcome = diagnosed(pulls(tmp_path / "balance", 0.4 * MATTERS), tmp_path / "out")
    assert outcome.diagnosis.verdict == "unexplained"
    assert outcome.sentence.startswith("Something is missing that DryFriction would explain, at a")
    nearest = outcome.diagnosis.nearest[0]
    assert nearest.effects == ("DryFriction",)
    assert nearest.removed > 0.9
    assert "is less than what matters, 0.05 N" in nearest.reasons[0]


def test_states_of_an_extension_are_not_corrected(balance, tmp_path):
    """They follow from the model alone, also where it has none of its own."""
    library = BALANCE.replace("replaceable Pivot pivot(v=v)", "replaceable Grease pivot(v=v)")
    extended = written(tmp_path / "Balance", library, BALANCE_FILE)
    file = tmp_path / "Grease.fmu"
    build_here(extended / "package.mo", "Balance.Observer", file)
    with FMU(file) as fmu:
        assert fmu.states == ("pivot.late",)
        assert corrected_states(fmu, load_system(balance)) == ()
        assert corrected_states(fmu, load_system(extended)) == ("pivot.late",)


def test_observability_of_a_quantity_without_a_state(balance, tmp_path):
    assert status_of("observability", balance, tmp_path, "00_pull") == 0
    assert pd.read_csv(tmp_path / "00_pull.csv")["Observer.bound_dc [N/m]"].median() < 0.5


def test_a_model_without_anything_to_estimate_is_refused(balance, capsys, tmp_path):
    """By estimators; the diagnosis asks for none."""
    known = BALANCE_FILE[: BALANCE_FILE.index("[estimated.c]")] + "[diagnosis.levels]\nc = {}\n"
    folder = written(tmp_path / "known", BALANCE, known)
    shutil.copytree(balance / "recordings", folder / "recordings")
    assert status_of("simulate", folder, tmp_path / "out") == 2
    assert "expected something to estimate" in capsys.readouterr().err
    outcome = diagnosed(folder, tmp_path, "DryFriction")
    assert outcome.diagnosis.verdict == "found"
    assert best_estimate(outcome, "00_pull") is None


def test_a_correction_has_the_sign_by_which_the_output_shows_it(balance, tmp_path):
    """Pressed instead of pulled, a stiffer spring gives less force and not more."""
    folder = written(tmp_path / "pressed", BALANCE, BALANCE_FILE)
    table = pd.read_csv(balance / "recordings" / "00_pull" / "measured.csv")
    recorded(
        folder,
        "00_press",
        {name: table[name] for name in ("time [s]",)}
        | {name: -table[name] for name in ("s [m]", "v [m/s]", "F [N]")},
    )
    assert status_of("simulate", folder, tmp_path) == 1  # as above
    estimates = read_estimates(tmp_path / "00_press.npz")
    pressed = estimates["measured.F [N]"] < -8.0
    for name in ("disturbance_observer", "parameter_estimator"):
        assert estimates[f"{name}.c [N/m]"][pressed].mean() == pytest.approx(STIFFNESS, rel=0.02)


# --- without inputs, and few samples ---


def test_estimators_follow_a_leak_without_an_input(bottle, tmp_path):
    assert status_of("simulate", bottle, tmp_path, "00_leak") == 0
    estimates = read_estimates(tmp_path / "00_leak.npz")
    for name in ("disturbance_observer", "ekf", "ukf"):
        assert estimates[f"{name}.k [1/s]"].iloc[100:].mean() == pytest.approx(LEAK, rel=0.05)


def test_the_pore_is_named_and_not_the_wall(bottle, tmp_path):
    diagnosis = diagnosed(bottle, tmp_path).diagnosis
    assert diagnosis.verdict == "found"
    (cause,) = diagnosis.causes
    assert cause.effect.name == "Pore"
    assert cause.parameters["k"].low < LEAK < cause.parameters["k"].high


def test_a_single_recording_will_do(bottle, tmp_path):
    recording = bottle / "recordings" / "01_leak"
    (cause,) = built.diagnosed(load_system(bottle), recording, tmp_path).diagnosis.causes
    assert cause.effect.name == "Pore"
    assert cause.parameters["k"].value == pytest.approx(LEAK, rel=2e-3)


def test_a_system_says_how_few_samples_will_do(bottle):
    system = load_system(bottle)
    case = read_cases([bottle / "recordings" / "00_leak"], system)[0].part(slice(12))
    check_recording(case.time, replace(system, fewest=12), "here, column 'time'")
    with pytest.raises(InputError, match="12 samples over 11 s; expected at least 20 samples"):
        check_recording(case.time, system, "here, column 'time'")


def test_what_is_before_only_leads_to_what_counts(bottle, tmp_path):
    case = tmp_path / "02_leak"
    shutil.copytree(bottle / "recordings" / "02_leak", case)
    toml = (case / "case.toml").read_text()
    (case / "case.toml").write_text(f'{toml}counts_from = "150 s"\n')
    system = load_system(bottle)
    held_out, fitted = read_cases([case], system), bottle / "recordings" / "00_leak"
    outcome = built.diagnosed(system, fitted, tmp_path / "out", "Pore", held_out=held_out)
    (error,) = [error for error in outcome.errors if error.held_out]
    assert error.samples == 50
    # From the start on: a tight bottle would then stand at 5.6 bar, this one is below 1.3.
    assert error.rms[0] > 4e5
    assert error.rms[1] < 300.0
    (case / "case.toml").write_text(f'{toml}counts_from = "10 min"\n')
    with pytest.raises(InputError, match=r"counts_from: found '10 min'; expected a time before"):
        read_cases([case], system)


def test_curvature_of_a_signal_sampled_slowly_is_no_noise():
    """A decay of a seventh from sample to sample bends by more than the noise of 3 mbar."""
    rng = np.random.default_rng(3)
    noise = 3e2 * rng.standard_normal(40)
    decay = 7e5 * np.exp(-np.arange(40.0) / 7.0)
    assert deviation_of(decay + noise) == pytest.approx(3e2, rel=0.4)
    assert deviation_of(noise) == pytest.approx(3e2, rel=0.4)


def test_what_a_relay_switches_is_no_noise():
    """Noise is 0.02 K and 3 W; by the swings of a relay at each sample it was 0.86 K and 4.9 W."""
    rng = np.random.default_rng(31)
    set_point = np.repeat([60.0, 100.0, 40.0, 80.0], 200)
    T, power, read = 20.0, np.empty(800), np.empty(800)
    for k, above in enumerate(set_point):
        read[k] = T + 0.02 * rng.standard_normal()
        power[k] = 300.0 if read[k] < above else 0.0
        T += (1.0 - np.exp(-0.01)) * (20.0 + power[k] / 2.0 - T)  # 2 W/K, 100 s, in closed form
    measured = power + 3.0 * rng.standard_normal(800)
    assert deviation_beside_switching(measured) == pytest.approx(3.0, rel=0.15)
    for driving in (power, measured):
        assert deviation_beside_switching(read, [driving]) == pytest.approx(0.02, rel=0.3)
    # A controller in proportion hands the noise on: the output does not follow from that.
    noise = 0.02 * rng.standard_normal(800)
    assert deviation_beside_switching(noise, [-50.0 * noise]) == pytest.approx(0.02, rel=0.15)


def test_pulses_of_a_relay_are_no_wrong_samples():
    """One sample of eight is on, or up to twelve of 19; a lone pulse in what rests is wrong."""
    rng = np.random.default_rng(5)
    signal = load_system("cascaded_tanks").outputs[0]
    pulses = np.where(np.arange(800) % 8 == 0, 5.0, 2.0) + 0.02 * rng.standard_normal(800)
    assert not outliers(pulses, signal, SOUND).any()
    on = np.concatenate([np.arange(19) < length for length in rng.integers(1, 13, 42)])
    noise = 0.02 * rng.standard_normal(on.size)
    assert not outliers(np.where(on, 5.0, 2.0) + noise, signal, SOUND).any()
    lone = np.where(np.arange(800) == 400, 5.0, 2.0) + 0.02 * rng.standard_normal(800)
    assert np.flatnonzero(outliers(lone, signal, SOUND)).tolist() == [400]
    set_to = np.repeat([2.0, 5.0, 2.0, 5.0], 200)
    set_to[300] = 2.0  # a sample that is lost, though it reads as much as others
    assert outliers(set_to + 0.02 * rng.standard_normal(800), signal, SOUND)[300]


def test_a_pump_that_is_set_to_many_values_has_no_levels():
    """It reads nothing in half of its range, but is no relay; a heater of three stages is."""
    rng = np.random.default_rng(8)
    noise = 0.01 * rng.standard_normal(800)
    assert not levels_of(np.repeat([1.8, 4.1, 2.9, 6.6, 1.9, 3.0, 6.5, 4.0], 100) + noise)
    assert len(levels_of(rng.integers(3, size=800) + noise)) == 3
