"""The sensors of the virtual rig: their noise, what can be planted in them, corrupted samples."""

import dataclasses
from functools import cache

import numpy as np
import pandas as pd
import pytest

from workbench.machines.wheelset.rig import (
    CONSTANT_PADS,
    SCENARIOS,
    StopTruth,
    plant,
    sample,
    simulate,
    write_recording,
)
from workbench.machines.wheelset.rig.sensors import FURTHER
from workbench.recordings.case import read_case

from .scenarios import REFERENCE, ROLLER_RADIUS, SEED, WHEEL_RADIUS, short
from .systems import WHEELSET

CHANNELS = ("pB", "tauR", "omegaW", "omegaR", "Fx")


@cache
def make(speed: float = 40.0, direction: int = 1, load: float = 80e3) -> StopTruth:
    """A stop from a speed [km/h] on constant pads, of ten seconds unless said otherwise."""
    scenario = short("03_dry_120_3.6", speed, direction=direction, wheel_load=load)
    return simulate(scenario, SEED, CONSTANT_PADS, REFERENCE)


def recorded(stop: StopTruth) -> np.ndarray:
    """Times [s] of the samples at 200 Hz."""
    return stop.time[stop.time >= 0.0][::5]


def added(planted: str, stop: StopTruth) -> dict[str, np.ndarray]:
    """What an effect of the sensors adds to each channel."""
    time = recorded(stop)
    without = sample(stop, CONSTANT_PADS, time)
    changed = sample(stop, plant(CONSTANT_PADS, [planted]), time)
    return {name: changed[name] - without[name] for name in CHANNELS}


# --- noise ---


def test_noise_of_every_sensor_grows_by_the_same_factor():
    stop = make()
    time = recorded(stop)
    silent, usual, loud = (
        sample(stop, plant(CONSTANT_PADS, [f"noise={gain}"]), time) for gain in (-1.0, 0.0, 2.0)
    )
    for name in CHANNELS:
        # Of the same random numbers; rounding to the resolution adds at most 4 % to the lesser.
        ratio = np.std(loud[name] - silent[name]) / np.std(usual[name] - silent[name])
        assert ratio == pytest.approx(3.0, rel=0.04), name


@pytest.mark.parametrize(
    ("name", "signal", "noise", "relative", "resolution"),
    [
        ("pB", "pB", 500.0, 0.0, 240.0),
        ("tauR", "tauR", 40.0, 0.0, 5.0),
        ("omegaW", "omegaW", 0.002, 3e-4, 1e-4),
        ("omegaR", "omegaR", 0.003, 0.0, 1e-3),
        ("Fx", "Fcell", 80.0, 0.0, 10.0),
    ],
)
def test_sensor_has_the_white_noise_of_the_data_sheet(name, signal, noise, relative, resolution):
    stop = make(speed=160.0)
    time = stop.time[stop.time >= 0.0][::5]
    truth = stop.at(time, signal)
    error = sample(stop, CONSTANT_PADS, time)[name] - truth
    # Rounding adds a variance of resolution^2/12.
    scaled = error / np.hypot(noise + relative * abs(truth), resolution / np.sqrt(12.0))
    n = scaled.size
    # Four sigma of the estimates, by the law of large numbers: 1 in 16000 draws falls outside.
    assert scaled.mean() == pytest.approx(0.0, abs=4.0 / np.sqrt(n))
    assert scaled.std() == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * n))
    assert scaled[1:] @ scaled[:-1] / n == pytest.approx(0.0, abs=4.0 / np.sqrt(n))


def test_sensors_that_are_fitted_besides_read_the_truth_with_their_noise():
    stop = make(speed=160.0)
    fitted = dataclasses.replace(
        stop, scenario=dataclasses.replace(stop.scenario, sensors=tuple(FURTHER))
    )
    time, wrong = recorded(stop), plant(CONSTANT_PADS, ["roller_radius=0.002", "wheel_load=0.05"])
    without, readings = (sample(rig, wrong, time) for rig in (stop, fitted))
    assert set(readings) - set(without) == set(FURTHER)
    assert all(np.array_equal(readings[name], without[name]) for name in CHANNELS)
    # What the sensors feel: the contact's force, the load on it, the rim of the roller, and one of
    # three discs that are all alike.
    way = np.sign(stop.at(time, "omegaW"))
    truth = {
        "arms": (stop.at(time, "Fx"), 200.0),
        "load": (np.full(time.size, 80e3 * stop.drawn.Fz * 1.05), 400.0),
        "surface": (0.702 * stop.at(time, "omegaR"), 0.02),
        "disc": (stop.at(time, "muDC1") * stop.at(time, "Fperp") * way, 100.0),
    }
    assert set(truth) == set(FURTHER)
    for name, (felt, noise) in truth.items():
        error = (readings[name] - felt) / noise
        # Four sigma of the estimates, as above.
        assert error.mean() == pytest.approx(0.0, abs=4.0 / np.sqrt(error.size)), name
        assert error.std() == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * error.size)), name


def test_the_disc_that_brakes_least_is_the_wet_one():
    """Also where it is wet no more, and its friction differs from that of others by noise alone."""
    scenario = dataclasses.replace(SCENARIOS["03_dry_120_3.6"], sensors=("disc",))
    wet = plant(CONSTANT_PADS, ["single_disc_film=0.5"])
    stop = simulate(scenario, SEED, wet, REFERENCE)
    time = recorded(stop)
    time = time[time < stop.standstill]
    felt = sample(stop, plant(wet, ["noise=-1"]), time)["disc"]
    expected = stop.at(time, "muDC2") * stop.at(time, "Fperp")
    np.testing.assert_allclose(felt, expected, atol=5.0)  # half the resolution
    first = np.argmax(stop.at(time, "Fperp") > 0.0)
    assert stop.at(time[first:], "muDC2")[0] < 0.8 * stop.at(time[first:], "muDC1")[0]


# --- effects ---


@pytest.mark.parametrize(
    ("effect", "gain", "channels"),
    [
        ("torque_gain", 0.02, {"tauR"}),
        ("drive_beat", 0.02, {"tauR"}),
        ("fx_gain", 0.015, {"Fx"}),
        ("fx_offset", 120.0, {"Fx"}),
        ("fx_limit", 15e3, {"Fx"}),
        ("apex_offset", 1e-3, {"Fx"}),
        ("force_drift", 2.0, {"Fx"}),
        ("speed_delay", 0.008, {"omegaW"}),
        ("pole_ring", 0.002, {"omegaW"}),
        ("time_skew", 0.020, {"omegaW", "omegaR"}),
        ("late_pB", 0.020, {"pB"}),
        ("late_tauR", 0.020, {"tauR"}),
        ("late_omegaR", 0.020, {"omegaR"}),
        ("late_Fx", 0.020, {"Fx"}),
        ("pressure_offset", 2000.0, {"pB"}),
        ("spikes", 1.0, set(CHANNELS)),
    ],
)
def test_effect_of_a_sensor_shows_in_its_channels_alone(effect, gain, channels):
    differences = added(f"{effect}={gain}", make())
    assert {name for name, difference in differences.items() if difference.any()} == channels


def test_pole_ring_ripples_with_the_phase_of_its_stop():
    stop = make()
    time = recorded(stop)
    reading = sample(stop, plant(CONSTANT_PADS, ["pole_ring=0.01"]), time)["omegaW"]
    t = (time > 0.5) & (time < stop.drawn.coasting)
    ripple = (reading / stop.at(time, "omegaW"))[t]
    angle = stop.at(time, "phiW")[t] + stop.phases.pole_ring
    columns = np.column_stack([np.cos(angle), np.sin(angle), np.ones(angle.size)])
    cosine, sine, _ = np.linalg.lstsq(columns, ripple)[0]
    # Four sigma of a noise of 4e-4 in 700 samples.
    assert cosine == pytest.approx(0.01, abs=9e-5)
    assert sine == pytest.approx(0.0, abs=9e-5)


@pytest.mark.parametrize(("direction", "load"), [(1, 80e3), (-1, 80e3), (1, 60e3)])
def test_apex_offset_adds_a_share_of_the_load_in_both_directions(direction, load):
    stop = make(speed=20.0, direction=direction, load=load)
    slope = 2.0 * load * stop.drawn.Fz / (WHEEL_RADIUS + ROLLER_RADIUS)
    # Readings are rounded to 10 N: the mean of 1500 differences to 0.3 N.
    assert added("apex_offset=0.002", stop)["Fx"].mean() == pytest.approx(0.002 * slope, abs=0.5)
    assert slope == pytest.approx(138e3 * load / 80e3, rel=0.01)


def test_fx_gain_is_the_slope_between_load_cell_and_recording():
    stop = make()
    time = recorded(stop)
    measured = sample(stop, plant(CONSTANT_PADS, ["fx_gain=0.015"]), time)["Fx"]
    cell = stop.at(time, "Fcell")
    slope = cell @ measured / (cell @ cell)
    # Four sigma of the noise of 80 N over the record.
    assert slope == pytest.approx(1.015, abs=4.0 * 80.0 / np.sqrt(cell @ cell))


def test_beat_of_the_drive_multiplies_the_measured_torque():
    stop = make()
    time = recorded(stop)
    expected = 0.02 * stop.at(time, "tauR") * np.sin(2.0 * np.pi * 0.2 * time)
    # Both readings are rounded to 5 N.m.
    assert added("drive_beat=0.02", stop)["tauR"] == pytest.approx(expected, abs=5.0)


def test_load_cell_drifts_in_time_in_both_directions():
    for direction in (1, -1):
        stop = make(speed=20.0, direction=direction)
        # Both readings are rounded to 10 N.
        assert added("force_drift=20", stop)["Fx"] == pytest.approx(20.0 * recorded(stop), abs=10.0)


# --- corrupted samples ---


def test_spikes_are_rare_isolated_and_large():
    stop = make()
    time = recorded(stop)
    without = sample(stop, CONSTANT_PADS, time)
    spikes = added("spikes=3", stop)
    expected = 3.0 * (time[-1] - time[0])
    struck = {name: np.flatnonzero(spikes[name]) for name in CHANNELS}
    for name, where in struck.items():
        # Poisson: four sigma of the mean.
        assert where.size == pytest.approx(expected, abs=4.0 * np.sqrt(expected))
        assert np.diff(where).min() > 1
        assert abs(spikes[name][where]).min() > 0.49 * abs(without[name]).max()
    assert len({tuple(where) for where in struck.values()}) == len(CHANNELS)


def test_dropouts_leave_out_rows_and_nothing_else(tmp_path):
    stop = make()
    rate = 5.0
    lossy = plant(CONSTANT_PADS, [f"dropouts={rate}", "spikes=1"])
    write_recording(stop, lossy, 200, tmp_path / "lossy")
    write_recording(stop, plant(CONSTANT_PADS, ["spikes=1"]), 200, tmp_path / "spiky")
    full, kept = (
        (tmp_path / f / "measured.csv").read_text().splitlines() for f in ("spiky", "lossy")
    )
    assert set(kept) < set(full)
    expected = rate * stop.time[-1]
    assert len(full) - len(kept) == pytest.approx(expected, abs=4.0 * np.sqrt(expected))
    case = read_case(tmp_path / "lossy", WHEELSET)
    assert np.diff(case.time).max() > 0.009
    truth = pd.read_csv(tmp_path / "lossy" / "truth.csv")
    assert np.array_equal(truth["time [s]"], case.time)


@pytest.mark.parametrize("direction", [1, -1])
def test_load_cell_saturates_at_its_limit(direction):
    stop = make(direction=direction)
    time = recorded(stop)
    without = sample(stop, CONSTANT_PADS, time)["Fx"]
    limited = sample(stop, plant(CONSTANT_PADS, ["fx_limit=15000"]), time)["Fx"]
    within = abs(without) <= 15e3
    assert np.array_equal(limited[within], without[within])
    assert set(limited[~within]) == {15e3 * direction}
