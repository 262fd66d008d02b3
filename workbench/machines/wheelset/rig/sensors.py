"""What the sensors of the rig make of the truth."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Vector
from workbench.machines.wheelset.rig.effects import Effects
from workbench.machines.wheelset.rig.run import StopTruth


@dataclass(frozen=True)
class Sensor:
    """One measured channel."""

    noise: float  # standard deviation per sample, in SI units
    relative: float  # the same as a share of the value, added to `noise`
    resolution: float  # smallest step, in SI units


MEASURED = {
    "pB": Sensor(500.0, 0.0, 240.0),
    "tauR": Sensor(40.0, 0.0, 5.0),
    "omegaW": Sensor(0.002, 3e-4, 1e-4),
    "omegaR": Sensor(0.003, 0.0, 1e-3),
    "Fx": Sensor(80.0, 0.0, 10.0),
}
FURTHER = {
    "arms": Sensor(200.0, 0.0, 10.0),
    "load": Sensor(400.0, 0.0, 10.0),
    "surface": Sensor(0.02, 0.0, 1e-3),
    "disc": Sensor(100.0, 0.0, 10.0),
}
"""What may be fitted besides: force in the guidance arms, wheel load, speed of the roller, friction
force of the disc that brakes least."""

_CREST = 2.0 / 1.16  # [1/m] of both wheels over rW + rR: slope of the contact off the crest
_ROLLER = 0.70  # [m] radius
_DISCS = ("muDC1", "muDC2", "muDC3")
_BEAT = 2.0 * np.pi * 0.2  # [rad/s] of drive_beat

# Streams of random numbers: 0 tolerances, 1 to 5 noise, 6 phases, 7 to 11 spikes.
_NOISE, _SPIKES, _DROPOUTS, _FURTHER = 1, 7, 12, 13


def sample(stop: StopTruth, effects: Effects, time: Vector) -> Mapping[str, Vector]:
    """Take samples of all channels.

    Channels have noise of their own, so that what happens to one leaves the others alone. The
    noise is that of a sample at any rate. There is no filter: structure modes lie below 200 Hz
    and are wanted. Spikes come last, on the way to the logger.

    Parameters
    ----------
    time : (n,) [s] when samples are taken.

    Returns
    -------
    channels : pB, tauR, omegaW, omegaR, Fx, and what is fitted besides, each (n,) in SI units.
    """
    e, drawn = effects, stop.drawn
    wheel = time - e.speed_delay - e.time_skew
    ring = 1.0 + e.pole_ring * np.cos(stop.at(wheel, "phiW") + stop.phases.pole_ring)
    beat = 1.0 + e.drive_beat * np.sin(_BEAT * time)
    # The wheel load presses against the slope: in the same direction, wherever the wheel turns.
    load = stop.scenario.conditions.wheel_load * drawn.Fz * (1.0 + e.wheel_load)
    crest = _CREST * load * e.apex_offset
    ideal = {
        "pB": stop.at(time - e.late_pB, "pB") + e.pressure_offset,
        "tauR": stop.at(time - e.late_tauR, "tauR") * (1.0 + e.torque_gain) * beat,
        "omegaW": stop.at(wheel, "omegaW") * ring,
        "omegaR": stop.at(time - e.time_skew - e.late_omegaR, "omegaR"),
        "Fx": (stop.at(time - e.late_Fx, "Fcell") + crest) * (1.0 + e.fx_gain)
        + (e.fx_offset + e.force_drift * time),
    }
    readings = {
        name: _read(ideal[name], sensor, 1.0 + e.noise, _rng(stop, _NOISE + i))
        for i, (name, sensor) in enumerate(MEASURED.items())
    }
    if e.fx_limit:
        readings["Fx"] = np.clip(readings["Fx"], -e.fx_limit, e.fx_limit)
    if e.spikes:
        for i, name in enumerate(MEASURED):
            readings[name] = _spiked(readings[name], e.spikes, time, _rng(stop, _SPIKES + i))
    besides = {
        "arms": stop.at(time, "Fx"),
        "load": np.full(time.size, load),
        "surface": (_ROLLER + e.roller_radius) * stop.at(time, "omegaR"),
        "disc": _least_disc(stop, time),
    }
    for i, (name, sensor) in enumerate(FURTHER.items()):
        if name in stop.scenario.sensors:
            readings[name] = _read(besides[name], sensor, 1.0 + e.noise, _rng(stop, _FURTHER + i))
    return readings


def _least_disc(stop: StopTruth, time: Vector) -> Vector:
    """Friction force [N] of the disc that has braked least in the whole stop, (n,)."""
    pressed = stop.truth["Fperp"]
    least = min(_DISCS, key=lambda disc: float(stop.truth[disc] @ pressed))
    way = np.sign(stop.at(time, "omegaW"))
    force: Vector = stop.at(time, least) * stop.at(time, "Fperp") * way
    return force


def received(stop: StopTruth, effects: Effects, time: Vector) -> NDArray[np.bool_]:
    """Which samples reach the file, (n,)."""
    return ~_struck(effects.dropouts, time, _rng(stop, _DROPOUTS))


def _rng(stop: StopTruth, stream: int) -> np.random.Generator:
    return np.random.default_rng([stop.seed, stop.scenario.number, stream])


def _struck(rate: float, time: Vector, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Samples that something strikes at a mean `rate` [1/s], (n,)."""
    period = (time[-1] - time[0]) / (time.size - 1)
    struck: NDArray[np.bool_] = rng.random(time.size) < rate * period
    return struck


def _spiked(reading: Vector, rate: float, time: Vector, rng: np.random.Generator) -> Vector:
    """Move single samples by 0.5 to 1.5 times the largest reading, up or down."""
    struck = _struck(rate, time, rng)
    struck[1:] &= ~struck[:-1]  # isolated
    size = rng.uniform(0.5, 1.5, time.size) * rng.choice([-1.0, 1.0], time.size)
    corrupted: Vector = reading + struck * size * np.abs(reading).max()
    return corrupted


def _read(ideal: Vector, sensor: Sensor, times: float, rng: np.random.Generator) -> Vector:
    deviation = times * (sensor.noise + sensor.relative * np.abs(ideal))
    noisy = ideal + deviation * rng.standard_normal(ideal.size)
    reading: Vector = np.round(noisy / sensor.resolution) * sensor.resolution
    return reading
