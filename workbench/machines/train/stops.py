"""Stops of the virtual train: tolerances that are drawn, and the files of its computer."""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.machines.train.rig import (
    AXLES,
    BOGIES,
    DISCS,
    STEP,
    VEHICLES,
    AskedStop,
    StopResult,
    Train,
    Way,
    points,
    simulate,
)
from workbench.runtime.files import write_whole

_RADIUS = 0.460  # of the sheet [m]
_POLACH = {"dry": (1.0, 0.4, 0.4, 0.6), "wet": (0.3, 0.1, 0.4, 0.2)}  # kA, kS, A, B
_START = 10_000.0  # kilometrage of the first axle at the start [m]
DRIES = 0.45e6  # of water [J], see `Faults.drying`
_PERIOD = 0.02  # of the computer's samples [s]
_SATELLITES = 5  # samples until their speed is new
_TUNNELS, _TUNNEL = 1 / 8, (200.0, 800.0)  # share of stops with one, and how long it is [m]

_no_axles, _no_bogies, _no_vehicles = (partial(np.zeros, n) for n in (AXLES, BOGIES, VEHICLES))

USUAL = (
    AskedStop("01_120_service_dry", 120 / 3.6, 2.7e5, "dry"),
    AskedStop("02_160_service_dry", 160 / 3.6, 2.7e5, "dry"),
    AskedStop("03_80_emergency_dry", 80 / 3.6, 4.2e5, "dry"),
    AskedStop("04_120_service_wet", 120 / 3.6, 2.7e5, "wet"),
)


@dataclass(frozen=True)
class Faults:
    """Faults of a train, SI."""

    # (8,) share of the friction of an axle's pads that is lost
    pads: Vector = field(default_factory=_no_axles)
    # (8,) brake units of an axle that are isolated
    units: Vector = field(default_factory=_no_axles)
    drag: Vector = field(default_factory=_no_axles)  # (8,) torque of a brake that does not release
    radius: Vector = field(default_factory=_no_axles)  # (8,) true minus sheet
    # (8,) relative error of a speed by the poles that are counted
    poles: Vector = field(default_factory=_no_axles)
    late: Vector = field(default_factory=_no_axles)  # (8,) delay of a speed sensor
    # (4,) time constant of a bogie's cylinders behind their valve
    lag: Vector = field(default_factory=_no_bogies)
    reading: Vector = field(default_factory=_no_bogies)  # (4,) relative error of a pressure sensor
    zero: Vector = field(default_factory=_no_bogies)  # (4,) offset of a pressure sensor
    # (2,) true mass of a vehicle over the reported one, less one
    mass: Vector = field(default_factory=_no_vehicles)
    gradient: float = 0.0  # true less that of the track file, everywhere [1]
    all_pads: float = 0.0  # share of the friction of all pads that is lost
    glazing: float = 0.0  # share of the friction that is lost on a disc far above 110 degrees C
    water: float = 0.0  # film on every disc at the start of each stop, 1 where it is wet
    # friction energy of a disc that leaves 1/e of a whole film [J]; 0 where there is none
    drying: float = 0.0
    adhesion: float = 0.0  # share of the friction wheel-rail that is lost
    # accelerometer_bias, accelerometer_gain: of its reading beyond the acceleration, [m/s2], [1]
    accelerometer_bias: float = 0.0
    accelerometer_gain: float = 0.0
    # noise, tolerances: of all sensors and draws, relative to the sheet's, less one
    noise: float = 0.0
    tolerances: float = 0.0


@dataclass(frozen=True, eq=False)
class TrainTolerances:
    """How a train differs from its sheet, relative where no unit stands."""

    radius: Vector  # (8,) true minus sheet [m]
    # pads, stiffness, share, inertia: (8,)
    pads: Vector
    stiffness: Vector
    share: Vector
    inertia: Vector
    regulation: Vector  # (4,)
    zero: Vector  # (4,) of the pressure sensors [Pa]
    weighed: Vector  # (2,)
    # A, C, fade: each alone
    A: float
    C: float
    fade: float
    # speed_law, exponent: added [1]
    speed_law: float
    exponent: float
    # gain, bias: of the accelerometer, bias [m/s2]
    gain: float
    bias: float


@dataclass(frozen=True, eq=False)
class SimulatedStop:
    """A stop of the virtual train."""

    stop: AskedStop
    result: StopResult
    command: float  # when the brake was commanded [s]
    # mass, weighed: (2,) of the vehicles, true and as reported [kg]
    mass: Vector
    weighed: Vector
    track: Matrix  # (k, 3) rows of the file: position [m], gradient [permille], radius [m]
    gradient: Vector  # (w,) true one, at the `points` of the way [1]
    tolerances: TrainTolerances  # of the train


def draw_train(seed: int, tolerances: float) -> TrainTolerances:
    """A train within the tolerances of its sheet, one sigma each where they are not limits."""
    rng, t = np.random.default_rng([seed, 0]), 1.0 + tolerances
    return TrainTolerances(
        radius=t * rng.uniform(-4e-4, 4e-4, AXLES),
        pads=t * rng.normal(0.0, 0.02, AXLES),
        stiffness=t * rng.normal(0.0, 0.02, AXLES),
        share=t * rng.normal(0.0, 0.01, AXLES),
        inertia=t * rng.normal(0.0, 0.01, AXLES),
        regulation=t * rng.normal(0.0, 0.01, BOGIES),
        zero=t * rng.normal(0.0, 300.0, BOGIES),
        weighed=t * np.clip(rng.normal(0.0, 0.015, 2), -0.03, 0.03),
        A=t * float(rng.normal(0.0, 0.10)),
        C=t * float(rng.normal(0.0, 0.05)),
        fade=t * float(rng.normal(0.0, 0.15)),
        speed_law=t * float(rng.normal(0.0, 0.02)),
        exponent=t * float(rng.normal(0.0, 0.003)),
        gain=t * float(rng.normal(0.0, 0.005)),
        bias=t * float(rng.uniform(-0.03, 0.03)),
    )


def simulate_stop(
    stop: AskedStop, seed: int, tolerances: TrainTolerances, faults: Faults
) -> SimulatedStop:
    """Make one stop.

    Parameters
    ----------
    seed : with the stop's number it fixes all that is drawn of the stop.
    """
    rng, t = np.random.default_rng([seed, stop.number, 1]), 1.0 + faults.tolerances
    mass = 44e3 + rng.uniform(0.0, 12e3, 2)
    weighed = (
        mass * (1.0 + tolerances.weighed + t * rng.normal(0.0, 0.013, 2)) / (1.0 + faults.mass)
    )
    track, gradient, curve = _line(rng, t)
    track[:, 1] -= 1e3 * faults.gradient
    mu0 = 0.40 * (1.0 + t * rng.normal(0.0, 0.02)) if stop.rail == "dry" else rng.uniform(0.25, 0.3)
    mu0 *= 1.0 - faults.adhesion
    way = Way(
        mu0 * (1.0 + t * 0.03 * _walk(rng, 80.0)), gradient, curve, t * 1e-5 * _walk(rng, 150.0)
    )
    wind = 1.0 + t * rng.normal(0.0, 0.03)
    level = 0.30 * (1.0 + t * rng.normal(0.0, 0.02)) * (1.0 + t * rng.normal(0.0, 0.007, AXLES))
    command = round(float(rng.uniform(20.0, 30.0)), 1)
    train = Train(
        friction=level * (1.0 + tolerances.pads) * (1.0 - faults.pads) * (1.0 - faults.all_pads),
        units=DISCS - faults.units,
        drag=faults.drag,
        radius=_RADIUS + tolerances.radius + faults.radius,
        stiffness=12.4e6 * (1.0 + tolerances.stiffness),
        share=1.0 + tolerances.share,
        inertia=110.0 * (1.0 + tolerances.inertia),
        target=(25e3 + (stop.pressure - 25e3) * np.repeat(weighed, 2) / 56e3)
        * (1.0 + tolerances.regulation),
        begin=np.array([0.2, 0.2, 0.3, 0.3]),
        lag=faults.lag,
        mass=mass,
        resistance=np.array(
            [1100.0 * (1.0 + tolerances.A) * wind, 12.0, 5.5 * (1.0 + tolerances.C) * wind]
        ),
        law=np.array([*_law(tolerances), faults.glazing, *_film(faults)]),
        polach=np.array(_POLACH[stop.rail]),
    )
    at_command = stop.speed * (1.0 + t * rng.normal(0.0, 0.01))
    slowing = (1100.0 + 5.5 * at_command**2 + 1500.0 + faults.drag.sum() / _RADIUS) / mass.sum()
    temperature = 50.0 + t * rng.normal(0.0, 8.0, (AXLES, DISCS))
    result = simulate(train, way, stop, at_command + slowing * command, command, temperature)
    return SimulatedStop(stop, result, command, mass, weighed, track, gradient, tolerances)


def _law(tolerances: TrainTolerances) -> tuple[float, float, float]:
    """Speed law, exponent and fade of the pads."""
    return 0.20 + tolerances.speed_law, 0.02 + tolerances.exponent, 3e-4 * (1.0 + tolerances.fade)


def _film(faults: Faults) -> tuple[float, float]:
    """Film of water at the start, and friction energy of a disc that leaves 1/e of it [J]."""
    return (1.0, faults.drying) if faults.drying else (faults.water, DRIES)


def _walk(rng: np.random.Generator, length: float) -> Vector:
    """What differs along the way by one, with a correlation length [m]."""
    way = points()
    kept = np.exp(-(way[1] - way[0]) / length)
    steps = rng.standard_normal(way.size)
    values = np.empty(way.size)
    values[0] = steps[0]
    for i in range(1, way.size):
        values[i] = kept * values[i - 1] + np.sqrt(1.0 - kept**2) * steps[i]
    return values


def _line(rng: np.random.Generator, t: float) -> tuple[Matrix, Vector, Vector]:
    """Rows of the track's file; true gradient and resistance of curves along the way [1]."""
    way = points()
    position = np.cumsum(rng.uniform(200.0, 450.0, 30)) + way[0] - 600.0
    gradient = np.clip(rng.normal(0.0, 3.0, position.size), -8.0, 8.0)  # permille
    radius = np.where(rng.random(position.size) < 0.3, rng.uniform(600.0, 2500.0, 30), 0.0)
    place = np.clip(np.searchsorted(position, way, "right") - 1, 0, None)
    curve = np.divide(0.6, radius, out=np.zeros_like(radius), where=radius > 0.0)[place]
    true = 1e-3 * np.interp(way, position, gradient)
    shown = position + _START + t * rng.uniform(-20.0, 20.0)
    wrong = gradient + t * rng.normal(0.0, 0.3, position.size)
    return np.column_stack([shown, wrong, radius]), true, curve


def write_stop(simulated: SimulatedStop, seed: int, faults: Faults, folder: Path) -> None:
    """Write what the train's computer records, and the file of the track, into a new folder."""
    rng, stop, n = (
        np.random.default_rng([seed, simulated.stop.number, 2]),
        simulated.stop,
        1.0 + faults.noise,
    )
    result, tolerances = simulated.result, simulated.tolerances
    time = np.arange(0.0, result.time[-1], _PERIOD)
    columns: dict[str, Vector] = {"time [s]": time}
    for j in range(BOGIES):
        pressure = np.interp(time, result.time, result.pressure[:, j]) * (1.0 + faults.reading[j])
        read = (
            pressure
            + tolerances.zero[j]
            + faults.zero[j]
            + n * 500.0 * rng.standard_normal(time.size)
        )
        columns[f"pB{j + 1} [bar]"] = 0.0024 * np.round(1e-5 * read / 0.0024)
    speeds = np.empty((AXLES, time.size))
    for i in range(AXLES):
        true = np.interp(time - faults.late[i], result.time, result.omega[:, i])
        true *= 1.0 + faults.poles[i]
        deviation = n * (0.002 + 3e-4 * true) * rng.standard_normal(time.size)
        speeds[i] = np.where(true < 0.5, 0.0, true + deviation)
        columns[f"omega{i + 1} [rad/s]"] = speeds[i]
    gain = (1.0 + tolerances.gain) * (1.0 + faults.accelerometer_gain)
    felt = gain * np.interp(time, result.time, _low_pass(result.a))
    felt += tolerances.bias + faults.accelerometer_bias
    columns["a [m/s2]"] = felt + n * 0.02 * rng.standard_normal(time.size)
    columns["vGNSS [km/h]"] = _satellites(result, time, seed, stop.number, n)
    rolled = _PERIOD * np.cumsum(_RADIUS * np.median(speeds, axis=0))
    columns["s [m]"] = _START + rng.normal(0.0, 5.0) + rolled
    write_whole(folder / "measured.csv", _table(columns, "%.6g"))
    names = ("position [m]", "gradient [permille]", "radius [m]")
    track = dict(zip(names, simulated.track.T, strict=True))
    write_whole(folder / "track.csv", _table(track, "%.2f"))
    write_whole(folder / "case.toml", _case(stop, simulated))


def _satellites(result: StopResult, time: Vector, seed: int, number: int, n: float) -> Vector:
    """Speed by satellites [km/h], (n,): new at 10 Hz, then held, NaN in a tunnel."""
    rng, new = np.random.default_rng([seed, number, 3]), time[::_SATELLITES]
    v, s = (np.interp(new, result.time, values) for values in (result.v, result.s))
    read = np.abs(np.round(3.6 * v + n * 0.06 * rng.standard_normal(new.size), 2))
    begins, length = rng.uniform(-_TUNNEL[1], result.s[-1]), rng.uniform(*_TUNNEL)
    if rng.random() < _TUNNELS:
        read[(s > begins) & (s < begins + length)] = np.nan
    held: Vector = np.repeat(read, _SATELLITES)[: time.size]
    return held


def _low_pass(values: Vector) -> Vector:
    """Behind a filter of first order at 5 Hz, (n,) every STEP."""
    share, filtered = 1.0 - np.exp(-2.0 * np.pi * 5.0 * STEP), values.copy()
    for k in range(1, filtered.size):
        filtered[k] = filtered[k - 1] + share * (values[k] - filtered[k - 1])
    return filtered


def _table(columns: dict[str, Vector], form: str) -> str:
    line = ",".join([form] * len(columns))
    rows = np.column_stack(list(columns.values())).tolist()
    lines = ((line % tuple(row)).replace("nan", "") for row in rows)
    return "\n".join([",".join(columns), *lines]) + "\n"


def _case(stop: AskedStop, simulated: SimulatedStop) -> str:
    brake = "emergency" if stop.pressure > 3e5 else "service"
    return f"""\
title = "{stop.speed * 3.6:.0f} km/h, {brake} brake, rail {stop.rail}"

[conditions]
initial_speed = "{stop.speed * 3.6:.0f} km/h"
brake_command = "{simulated.command:.2f} s"
brake = "{brake}"
pressure_full_load = "{stop.pressure / 1e5:g} bar"
rail = "{stop.rail}"
mass1 = "{simulated.weighed[0] / 1e3:.2f} t"
mass2 = "{simulated.weighed[1] / 1e3:.2f} t"

[measurement]
file = "measured.csv"

[track]
file = "track.csv"
"""
