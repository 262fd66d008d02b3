"""A servo that swings a pendulum: recordings of the Rhoban team for its friction models.

Protocol: the twelve records of gains 100, 400 and 800 are fitted, the four of gain 200 held out.
Each is simulated freely over its 6 s, controller in the loop, from goal, supply voltage and whether
the motor is driven, which are taken as exactly known; torque constant, resistance, inertia and zero
are common to all records. It starts at rest where the encoder reads, both within what its steps
leave open. Metric: mean absolute error of the position, over all samples and records.
"""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from workbench.arrays import Vector
from workbench.machines.published import checksums
from workbench.recordings.csv import read_columns
from workbench.recordings.datasets import FolderLayout, PublishedRecording, PublishedSet

_MOTIONS = {
    "lift_and_drop": "lifted, then let go",
    "sin_sin": "two sines, one in the other",
    "sin_time_square": "a sine that quickens",
    "up_and_down": "slowly up, and a little down",
}
_HELD_OUT = 200  # gain of the records that are not fitted
# Columns of a case, as they are called in the publisher's files and in folders.
_COLUMNS = {
    "goal [rad]": ("goal_position", "goal"),
    "volts [V]": ("input_volts", "volts"),
    "enabled [1]": ("torque_enable", "enabled"),
    "position [rad]": ("position", "position"),
}
_FOLDER = "bam/data.bak/processed"
_RECORDS = checksums("servo_pendulum")  # by gain and motion


def _recording(name: str, columns: Mapping[str, Vector], file: str) -> PublishedRecording:
    gain, motion = name.removeprefix("kp").split("_", 1)
    kp = int(gain)
    rows = (0, columns["time [s]"].size - 1)
    return PublishedRecording(
        name,
        f"{_MOTIONS[motion]}, gain {kp}",
        columns,
        file,
        rows,
        ("the publisher's samples of 5 ms, which are linear between those of the bus",),
        {"kp": kp},
        held_out=kp == _HELD_OUT,
    )


def _read_theirs(folder: Path) -> list[PublishedRecording]:
    recordings = []
    for name, (file, *_) in _RECORDS.items():
        path = f"{_FOLDER}/{file}"
        entries = json.loads((folder / path).read_text())["entries"]
        columns = {"time [s]": np.array([entry["timestamp"] for entry in entries], np.float64)}
        columns |= {
            column: np.array([entry[theirs] for entry in entries], np.float64)
            for column, (theirs, _) in _COLUMNS.items()
        }
        recordings.append(_recording(name, columns, path))
    return recordings


def _read_folders(folder: Path) -> list[PublishedRecording]:
    recordings = []
    for name in _RECORDS:
        file = f"{name}/measured.csv"
        read = read_columns(folder / file, ("time", *(ours for _, ours in _COLUMNS.values())))
        columns = {"time [s]": read["time"].values}
        columns |= {column: read[ours].values for column, (_, ours) in _COLUMNS.items()}
        recordings.append(_recording(name, columns, file))
    return recordings


PUBLISHED = PublishedSet(
    title="A Dynamixel XL330 that swings 0.49 kg at 0.1 m: goal, supply voltage, position",
    source="M. Duclusaud, G. Passault, Better Actuator Models (2026), Rhoban, "
    "https://github.com/Rhoban/bam, commit af226046; see also M. Duclusaud et al., Extended "
    "friction models for the physics simulation of servo actuators, IEEE ICRA 2025",
    licence="Apache-2.0",
    recordings="Sixteen records of 6 s: four motions at each of four gains of the position "
    "controller. The motor is driven throughout, but for the last 4 s of 'lift_and_drop'. Those of "
    "gain 200 are held out, all others are to be fitted.",
    layouts=(
        FolderLayout(
            "the publisher's own files",
            {f"{_FOLDER}/{file}": theirs for file, theirs, _ in _RECORDS.values()},
            _read_theirs,
        ),
        FolderLayout(
            "one folder for each record, five digits",
            {f"{name}/measured.csv": ours for name, (_, _, ours) in _RECORDS.items()},
            _read_folders,
        ),
    ),
)
