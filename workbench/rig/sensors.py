"""What the sensors of the rig make of the truth."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.fmu import Vector
from workbench.rig.effects import Effects
from workbench.rig.run import Stop


@dataclass(frozen=True)
class Sensor:
    """One measured channel.

    Attributes
    ----------
    noise : standard deviation per sample, in SI units.
    relative : the same as a share of the value, added to `noise`.
    resolution : smallest step, in SI units.
    """

    noise: float
    relative: float
    resolution: float


MEASURED = {
    "pB": Sensor(500.0, 0.0, 240.0),
    "tauR": Sensor(40.0, 0.0, 5.0),
    "omegaW": Sensor(0.002, 3e-4, 1e-4),
    "omegaR": Sensor(0.003, 0.0, 1e-3),
    "Fx": Sensor(80.0, 0.0, 10.0),
}


def measure(stop: Stop, effects: Effects, time: Vector) -> Mapping[str, Vector]:
    """Sample all channels.

    Channels have noise of their own, so that what happens to one leaves the others alone. The
    noise is that of a sample at any rate. There is no filter: structure modes lie below 200 Hz
    and are wanted.

    Parameters
    ----------
    time : (n,) [s] when samples are taken.

    Returns
    -------
    channels : pB, tauR, omegaW, omegaR, Fx, each (n,) in SI units.
    """
    e, number = effects, stop.scenario.number
    wheel = time - e.speed_delay - e.time_skew
    ring = 1.0 + e.pole_ring * np.cos(stop.at(wheel, "phiW"))
    ideal = {
        "pB": stop.at(time, "pB") + e.pressure_offset,
        "tauR": stop.at(time, "tauR") * (1.0 + e.torque_gain),
        "omegaW": stop.at(wheel, "omegaW") * ring,
        "omegaR": stop.at(time - e.time_skew, "omegaR"),
        "Fx": stop.at(time, "Fcell") * (1.0 + e.fx_gain) + e.fx_offset,
    }
    # Stream 0 has drawn the tolerances.
    return {
        name: _read(ideal[name], sensor, np.random.default_rng([stop.seed, number, stream]))
        for stream, (name, sensor) in enumerate(MEASURED.items(), start=1)
    }


def _read(ideal: Vector, sensor: Sensor, rng: np.random.Generator) -> Vector:
    deviation = sensor.noise + sensor.relative * np.abs(ideal)
    noisy = ideal + deviation * rng.standard_normal(ideal.size)
    reading: Vector = np.round(noisy / sensor.resolution) * sensor.resolution
    return reading
