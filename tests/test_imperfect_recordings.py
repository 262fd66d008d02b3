"""Recordings as real machines give them: one alone, in coarse steps, cut off, from unknown states.

A heated block whose casing takes some of the heat; the casing's temperature is not measured. The
recordings are exact solutions of the linear equations, not of the compiled model.
"""

from dataclasses import replace

import fmpy
import lxml.html
import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from workbench.diagnosis import Outcome
from workbench.diagnosis.data.cleaning import outliers
from workbench.diagnosis.data.counting import BEYOND
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.diagnosis.report import write_diagnosis
from workbench.errors import InputError
from workbench.pages.provenance import run_of
from workbench.system.system import System

from .built import declare, machine
from .heater import NOISE, cases, diagnosed, system

ZERO = """  model Zero "a zero that is off"
    extends Effects.Signals.Offset(offset(unit="K", min=-20.0, max=20.0));
    annotation (__Workbench(effect(size="offset", matters=0.2, separation="a second sensor")));
  end Zero;

"""
SENSOR = """output Real read(unit="K") = sensor.y "As read";
    replaceable Effects.Signals.Unchanged sensor(u=T)
      constrainedby Effects.Interfaces.Signal(u=T) "Of the block";"""
LOSS, SECONDS = 0.2, 1200  # [W/K] planted; [s]


def simulated(seed: int, loss: float, casing: float) -> pd.DataFrame:
    """Exact solution for a power that is held for a minute each time, with noise.

    Parameters
    ----------
    casing : temperature at the start [K], which nobody measured.
    """
    rng = np.random.default_rng(seed)
    power = np.repeat(rng.uniform(0.0, 60.0, SECONDS // 60), 60)
    A = np.array([[-2.0 - loss, 2.0], [2.0, -2.5]]) / np.array([[100.0], [200.0]])
    whole = expm(np.block([[A, np.array([[0.01], [0.0]])], [np.zeros((1, 3))]]))
    x, temperatures = np.array([5.0, casing]), []
    for watts in power:
        temperatures.append(x[0])
        x = whole[:2, :2] @ x + whole[:2, 2] * watts
    measured = np.array(temperatures) + NOISE * rng.standard_normal(SECONDS)
    return pd.DataFrame(
        {"time [s]": np.arange(SECONDS, dtype=float), "P [W]": power, "T [K]": measured}
    )


@pytest.fixture(scope="module")
def heater(tmp_path_factory) -> System:
    return system(tmp_path_factory.mktemp("systems") / "heater")


def test_parts_of_a_single_recording_are_held_out_and_its_cause_named(heater, tmp_path):
    outcome = diagnosed(heater, cases(heater, [simulated(1, LOSS, 12.0)]), tmp_path)
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "Draught"
    size = cause.parameters["G"]
    assert size.low <= LOSS <= size.high
    assert size.high - size.low < 0.1 * LOSS
    gain = outcome.diagnosis.gain
    assert list(gain.recordings) == [f"part {k} of 10" for k in range(1, 11)]
    # Parts that are held out are predicted nearly as well as those that were fitted.
    assert gain.before > 100.0
    assert gain.low < 1.0 < gain.high


def test_a_single_recording_without_a_cause_lacks_nothing(heater, tmp_path):
    outcome = diagnosed(heater, cases(heater, [simulated(2, 0.0, -8.0)]), tmp_path)
    assert outcome.diagnosis.verdict == "nothing"


def test_a_single_recording_is_refused_where_recordings_differ(tmp_path):
    differing = system(tmp_path / "heaters", "[diagnosis.tolerances]\nGc = 0.05")
    recordings = cases(differing, [simulated(k, LOSS, 0.0) for k in range(4)])
    with pytest.raises(
        InputError, match=r"two or more to fit, because differences .*tolerances.*Gc"
    ):
        diagnosed(differing, recordings[:1], tmp_path)
    with pytest.raises(InputError, match="1 to fit, beside 3 held out"):
        diagnosed(differing, recordings[:1], tmp_path, recordings[1:])


def test_a_single_recording_too_short_for_two_parts_is_refused(tmp_path):
    brief = system(tmp_path / "brief", '[diagnosis]\nlasting = "60 s"\nleast = "90 s"')
    with pytest.raises(InputError, match=r"one recording, 110 s that count.*120 s or more"):
        diagnosed(brief, cases(brief, [simulated(1, LOSS, 0.0)[:110]]), tmp_path)


def test_a_state_that_nobody_measured_starts_where_the_recording_says(heater, tmp_path):
    starts = [15.0, -10.0, 4.0]
    recordings = cases(heater, [simulated(k, 0.0, at) for k, at in enumerate(starts)])
    outcome = diagnosed(heater, recordings, tmp_path)
    assert outcome.diagnosis.verdict == "nothing"
    fitted = [30.0 * outcome.deviations[case.name]["Tc"] for case in recordings]
    # By noise alone a casing is known to some 0.1 K; its prior draws it to zero by less.
    assert fitted == pytest.approx(starts, abs=0.5)


def test_what_a_wrong_sensor_read_at_the_start_is_where_no_state_began(tmp_path):
    """Beside a draught, a zero is off by 60 times the noise; no effect stands for the start."""
    library, file = machine("heater", sensor='reading = "read"')
    library = library.replace("  model Draught", f"  import Effects;\n\n{ZERO}  model Draught")
    library = library.replace(
        "end Heater;", 'annotation (uses(Effects(version="1.0")));\nend Heater;'
    )
    library = library.replace("    replaceable", f"    {SENSOR}\n    replaceable")
    of = declare(tmp_path / "zero", library, file)
    frames = [simulated(k, LOSS, 10.0 * k) for k in range(3)]
    for frame in frames:
        frame["T [K]"] += 60.0 * NOISE
    outcome = diagnosed(of, cases(of, frames), tmp_path / "out")
    causes = outcome.diagnosis.causes
    sizes = {cause.effect.name: cause.parameters[cause.effect.size] for cause in causes}
    assert {*sizes} == {"Draught", "Zero"}
    assert sizes["Draught"].low <= LOSS <= sizes["Draught"].high
    assert sizes["Zero"].low <= 60.0 * NOISE <= sizes["Zero"].high
    # And so says what another tool has to start the extended model with.
    starts = [outcome.start_values(case.name)["T"] for case in outcome.cases]
    assert starts == pytest.approx([5.0] * 3, abs=4.0 * NOISE)


@pytest.fixture(scope="module")
def half(heater, tmp_path_factory) -> Outcome:
    """Of four recordings from unlike starts, two of them held out."""
    recordings = cases(heater, [simulated(k, LOSS, 10.0 * k) for k in range(4)])
    return diagnosed(heater, recordings[:2], tmp_path_factory.mktemp("half"), recordings[2:])


def test_errors_are_told_on_recordings_that_were_held_out(half):
    assert [error.recording for error in half.errors if error.held_out] == ["02", "03"]
    for error in half.errors:
        assert error.rms[0] > 10.0 * NOISE
        # Sampling scatter of a standard deviation over a thousand samples is 2 %.
        assert error.rms[1] == pytest.approx(NOISE, rel=0.1)
        # Of normal errors.
        assert error.mean_absolute[1] == pytest.approx(
            error.rms[1] * np.sqrt(2.0 / np.pi), rel=0.05
        )
    assert "2 recordings held out" in half.summary()
    # Cross-validation inside the fitted ones is never called so.
    assert "in cross-validation its error falls from" in half.sentence
    assert "and on 2 held-out recordings that of" in half.sentence
    assert half.sentence.count("held-out") == 1


def test_another_tool_starts_the_extended_model_as_a_recording_does(heater, half):
    for case in cases(heater, [simulated(k, LOSS, 10.0 * k) for k in range(4)]):
        start = half.start_values(case.name)
        assert start.keys() == {"T", "Tc"}
        result = fmpy.simulate_fmu(
            str(half.extension.fmu),
            fmi_type="CoSimulation",
            start_values=start,
            input=np.rec.fromarrays([case.time, case["P"], 0.0 * case.time], names="time, P, dGc"),
            stop_time=case.time[-1],
            output_interval=1.0,
            output=["T"],
        )
        # The model has what was planted: noise is left, of which a thousand samples are within 2 %.
        assert np.std(case["T"] - result["T"]) == pytest.approx(NOISE, rel=0.1)
    with pytest.raises(InputError, match=r"'04': found no recording of this name"):
        half.start_values("04")


def in_steps(values: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    return step * np.round(values / step)


def test_coarse_steps_of_a_reading_are_no_cause(tmp_path):
    step = 2.0
    coarse = system(tmp_path / "coarse", f'resolution = "{step} K"')
    frames = [simulated(k, 0.0, 0.0) for k in range(3)]
    for frame in frames:
        frame["T [K]"] = in_steps(frame["T [K]"].to_numpy(), step)
    outcome = diagnosed(coarse, cases(coarse, frames), tmp_path / "out")
    assert outcome.diagnosis.verdict == "nothing"
    # Nothing that repeats itself is taken for a stuck sensor.
    assert all(sum(counts.values()) == 0 for counts in outcome.set_aside.values())


def test_samples_at_the_limit_of_a_sensor_do_not_count(tmp_path):
    limit = 40.0
    cut_off = system(tmp_path / "cut_off", f'saturates = ["-50 K", "{limit} K"]')
    frames = [simulated(k, LOSS, 0.0) for k in range(3)]
    beyond = [int((frame["T [K]"] >= limit).sum()) for frame in frames]
    assert min(beyond) > 100
    for frame in frames:
        frame["T [K]"] = np.minimum(frame["T [K]"], limit)
    outcome = diagnosed(cut_off, cases(cut_off, frames), tmp_path / "out")
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "Draught"
    assert cause.parameters["G"].low <= LOSS <= cause.parameters["G"].high
    assert [counts[BEYOND] for counts in outcome.set_aside.values()] == beyond


@pytest.mark.parametrize(
    ("sensor", "match"),
    [
        ('saturates = ["20 K", "-50 K"]', "the lower limit before the upper one"),
        ('saturates = ["20 K"]', "2 numbers"),
        ('resolution = "1 bar"', "cannot be converted|bar"),
    ],
)
def test_mistakes_in_what_a_sensor_reads_are_refused(sensor, match, tmp_path):
    with pytest.raises(InputError, match=match):
        system(tmp_path / "wrong", sensor)


def test_page_tells_errors_of_fitted_and_of_held_out_recordings(half):
    provenance, folder = {"run": run_of("diagnose", half.system, {})}, half.extension.fmu.parents[1]
    page = lxml.html.fromstring(write_diagnosis(half, provenance, folder).read_bytes())
    rows = page.xpath("//table[@id='error-table']/tbody/tr")
    assert [row.xpath("string(td[1])") for row in rows] == ["yes", "yes", "held out", "held out"]
    table = pd.read_csv(folder / "errors.csv", dtype={"recording": str})
    assert list(table["recording"]) == ["00", "01", "02", "03"]
    shown = [float(cell) for cell in rows[2].xpath("td[@class='number']/@data-value")]
    names = ["rms_before", "mean_absolute_before", "rms_after", "mean_absolute_after"]
    names += ["free_run_before", "free_run_after"]
    assert shown == pytest.approx(table[names].iloc[2].to_list(), rel=1e-4)


def test_errors_of_a_sensor_at_its_limit_are_those_beyond_it(tmp_path):
    limit = 40.0
    cut_off = system(tmp_path / "cut_off", f'saturates = ["-50 K", "{limit} K"]')
    frames = [simulated(k, 0.0, 0.0) for k in range(3)]
    for frame in frames:
        frame["T [K]"] = np.minimum(frame["T [K]"], limit)
    outcome = diagnosed(cut_off, cases(cut_off, frames), tmp_path / "out")
    # A right model saturates where the sensor does: all samples are told, those errors are none.
    for error, frame in zip(outcome.errors, frames, strict=True):
        assert (
            error.samples > 0.99 * SECONDS
        )  # a sample between two at the limit may pass for wrong
        below = float((frame["T [K]"] < limit).mean())
        assert error.rms[0] == pytest.approx(NOISE * np.sqrt(below), rel=0.1)


def test_a_fast_rise_between_slow_falls_is_no_spike(heater):
    sensor = heater.signals["T"]
    rng = np.random.default_rng(3)
    # Ten samples up and two hundred down, as a compressor fills a reservoir that leaks.
    sawtooth = np.tile(np.append(np.linspace(0.0, 20.0, 10), np.linspace(20.0, 0.0, 200)), 4)
    values = sawtooth + NOISE * rng.standard_normal(sawtooth.size)
    assert not outliers(values, sensor, SOUND).any()
    values[[100, 300, 301, 731]] += [1.0, -2.0, -2.0, 1.5]
    assert list(np.flatnonzero(outliers(values, sensor, SOUND))) == [100, 300, 301, 731]


@pytest.mark.parametrize("step", [0.0, 0.4, 1.0])
def test_a_dropout_is_found_in_what_is_read_in_steps(heater, step):
    """Unless steps are coarser than the noise, which is then no reason to change."""
    sensor, rng = replace(heater.signals["T"], resolution=step * NOISE), np.random.default_rng(3)
    slow = 20.0 + np.sin(np.arange(300) / 30.0)
    for share in (1.0, 0.7):  # of the declared noise
        values = slow + share * NOISE * rng.standard_normal(slow.size)
        values = in_steps(values, sensor.resolution) if step else values
        assert not outliers(values, sensor, SOUND).any()
        values[100:120] = 0.0
        assert list(np.flatnonzero(outliers(values, sensor, SOUND))) == [*range(100, 120)]
    coarse = replace(sensor, resolution=2.0 * NOISE)
    assert not outliers(in_steps(slow, coarse.resolution), coarse, SOUND).any()


def test_the_ends_of_a_clear_swing_are_no_spikes(heater):
    sensor, time = heater.signals["T"], np.arange(3000)
    rng = np.random.default_rng(3)
    noise = rng.standard_normal(time.size)
    swing = np.sin(2.0 * np.pi / 24.3 * time)
    assert not outliers(NOISE * (200.0 * swing + noise), sensor, SOUND).any()
    # A road under a wheel: swings of all periods down to 11 samples, the shortest the least.
    rates = np.arange(0.3, 18.0, 0.35)
    phases = 2.0 * np.pi * (0.005 * np.outer(time, rates) + rng.uniform(size=rates.size))
    road = np.sin(phases) @ (1.0 / (1.0 + rates**1.3))
    assert not outliers(NOISE * (600.0 * road + noise), sensor, SOUND).any()
    values = NOISE * (20.0 * swing + noise)
    values[[100, 731, 1502]] += NOISE * np.array([60.0, -60.0, 60.0])
    assert list(np.flatnonzero(outliers(values, sensor, SOUND))) == [100, 731, 1502]


@pytest.mark.parametrize("decays", [4.0, 10.0])
def test_what_jumps_and_decays_as_the_output_of_a_controller_is_no_wrong_sample(decays, heater):
    """Of 500 times the noise, with time constants in samples; beside one that is wrong."""
    sensor = heater.signals["T"]
    values = NOISE * np.random.default_rng(1).standard_normal(2000)
    for first in range(100, 1900, 150):
        values[first:] += 500.0 * NOISE * np.exp(-np.arange(2000.0 - first) / decays)
    assert not outliers(values, sensor, SOUND).any()
    values[177] += 40.0 * NOISE
    assert list(np.flatnonzero(outliers(values, sensor, SOUND))) == [177]
