"""Recordings of the virtual rig as files."""

import dataclasses
import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.machines.wheelset.rig.effects import Effects
from workbench.machines.wheelset.rig.run import RATE, TRUTH, StopTruth
from workbench.machines.wheelset.rig.scenarios import DISC_TEMPERATURE, WHEEL_LOAD, Scenario
from workbench.machines.wheelset.rig.sensors import received, sample
from workbench.runtime.files import write_json, write_whole

# Column of the recording, unit, factor from SI, digits that hold the resolution.
_COLUMNS = {
    "pB": ("bar", 1e-5, 4),
    "tauR": ("N.m", 1.0, 0),
    "omegaW": ("rad/s", 1.0, 4),
    "omegaR": ("rad/s", 1.0, 3),
    "Fx": ("N", 1.0, 0),
    "arms": ("N", 1.0, 0),
    "load": ("N", 1.0, 0),
    "surface": ("m/s", 1.0, 3),
    "disc": ("N", 1.0, 0),
}


def check_files(folders: Iterable[Path], rate: int) -> None:
    """Refuse what could not be written, or would destroy a measured recording.

    Parameters
    ----------
    folders : of the cases to be written.
    rate : [Hz] of the recordings.

    Raises
    ------
    InputError
        If the rate is no divisor of RATE, or a folder holds a recording without truth.
    """
    if RATE % rate:
        raise InputError(
            where="--rate",
            found=f"{rate} Hz",
            expected=f"a divisor of {RATE} Hz, the rate of the simulation",
            remedy="choose for instance 100, 200 or 500",
        )
    for folder in folders:
        if (folder / "measured.csv").exists() and not (folder / "truth.json").exists():
            raise InputError(
                where=str(folder),
                found="a recording without truth.json, which this rig did not make",
                expected="a new folder, or one with recordings of this rig",
                remedy="choose another folder with --out",
            )


def write_recording(
    stop: StopTruth, effects: Effects, rate: int, folder: Path, truth_every: int = 1
) -> None:
    """Write a case for estimators, and the truth for scores.

    Parameters
    ----------
    effects : as given to `simulate`.
    rate : [Hz] of the recording, a divisor of RATE.
    folder : of the case: case.toml, measured.csv, truth.csv, truth.json.
    truth_every : how many samples of the recording one line of truth.csv stands for.
    """
    recorded = np.flatnonzero(stop.time >= 0.0)[:: RATE // rate]
    time = stop.time[recorded]
    channels = sample(stop, effects, time)
    kept = received(stop, effects, time)
    measured = {
        f"{name} [{unit}]": (channels[name][kept] * factor, f"%.{digits}f")
        for name, (unit, factor, digits) in _COLUMNS.items()
        if name in channels
    }
    truth = {
        f"{name} [{unit}]": (stop.truth[name][recorded][kept][::truth_every], "%.7g")
        for name, unit in TRUTH.items()
    }
    planted = {name: gain for name, gain in dataclasses.asdict(effects).items() if gain}
    phases = {
        f"{name}_phase": phase
        for name, phase in dataclasses.asdict(stop.phases).items()
        if name in planted
    }
    content = {
        "seed": stop.seed,
        "rate": rate,
        "fmu_sha256": stop.model,
        "demand": stop.drawn.coasting,
        "standstill": round(stop.standstill, 3),
        "drawn": dataclasses.asdict(stop.drawn) | phases,
        "effects": planted,
    }
    write_json(folder / "truth.json", content)
    write_whole(folder / "truth.csv", _table(time[kept][::truth_every], truth))
    write_whole(folder / "measured.csv", _table(time[kept], measured))
    write_whole(folder / "case.toml", _case(stop.scenario))


def _table(time: Vector, columns: Mapping[str, tuple[Vector, str]]) -> str:
    """CSV with one header line, time first."""
    header = ",".join(["time [s]", *columns])
    row = ",".join(["%.3f", *(text for _, text in columns.values())])
    # Adding zero turns -0.0 into 0.0.
    values = np.column_stack([time, *(column for column, _ in columns.values())]) + 0.0
    return "\n".join([header, *(row % tuple(line) for line in values.tolist())]) + "\n"


def _case(scenario: Scenario) -> str:
    c = scenario.conditions
    besides = f'wheel_load = "{c.wheel_load / 1e3:g} kN"\n' if c.wheel_load != WHEEL_LOAD else ""
    if c.disc_temperature != DISC_TEMPERATURE:
        besides += f'disc_temperature = "{c.disc_temperature:g} K"\n'
    return f"""\
title = "{scenario.title}"

[conditions]
initial_speed = "{c.initial_speed * 3.6:g} km/h"
brake_pressure = "{c.brake_pressure / 1e5:g} bar"
wheel_rail = "{c.wheel_rail}"
discs = {json.dumps(c.discs)}
direction = {c.direction}
{besides}
[measurement]
file = "measured.csv"
"""
