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
_THEIRS = {  # by gain and motion
    "kp100_lift_and_drop": (
        "2026-01-15_10h28m17.json",
        "3d0dbbc5508530d7f63249bfcc8f9933c12b8e59909eef9b021038be69219e38",
    ),
    "kp100_sin_sin": (
        "2026-01-15_10h28m10.json",
        "679215b9bbc50fb95959ce6efe257179e91f1b31ff80df52f8263d9f59ac8204",
    ),
    "kp100_sin_time_square": (
        "2026-01-15_10h28m32.json",
        "c34fd5cbbbf915d007afab009ead4dce1f5e29b171aa590967baf13bc69beb0e",
    ),
    "kp100_up_and_down": (
        "2026-01-15_10h28m24.json",
        "1881386668c9dfa66850c7214be2a5d322c92cface018db161f49523b778bed1",
    ),
    "kp200_lift_and_drop": (
        "2026-01-15_10h28m49.json",
        "48471398d192c67037780bafc1bd9102caa0d0062ac6cb858061fd9c06112a3e",
    ),
    "kp200_sin_sin": (
        "2026-01-15_10h28m42.json",
        "32d76ad79a52950a1457b87a422442045f4f3809ebcf26bad5274cc98d1e1230",
    ),
    "kp200_sin_time_square": (
        "2026-01-15_10h29m04.json",
        "86337e9acdb95ac34cbf48e375a407e3dcdf674c7cffa4f6d8f82f04d7c97dff",
    ),
    "kp200_up_and_down": (
        "2026-01-15_10h28m57.json",
        "92d054cf37a49379f0dd6271d920f8a85a393744b3d08c1f89e97a255175ba4a",
    ),
    "kp400_lift_and_drop": (
        "2026-01-15_10h29m21.json",
        "d58d17d74df27283372e198f4bd437628054c8f4e7185a48244545d3fa5063ab",
    ),
    "kp400_sin_sin": (
        "2026-01-15_10h29m14.json",
        "f283c4136a7215c5a537ad634d20f537e5a336e2af609492bd2d6aade6b50c5e",
    ),
    "kp400_sin_time_square": (
        "2026-01-15_10h29m37.json",
        "4e3e1d059424c0530de67919e5e20038631d7145662fd7f69be34ac3efc02b59",
    ),
    "kp400_up_and_down": (
        "2026-01-15_10h29m29.json",
        "e4375867cea77647788f8035a37a9ab356b6b1cebb0aad8c5aeb0336d7510226",
    ),
    "kp800_lift_and_drop": (
        "2026-01-15_10h29m54.json",
        "d98925d044ad923eccea60eaa03dc5453f985183bf0459f46945b297a707b3d1",
    ),
    "kp800_sin_sin": (
        "2026-01-15_10h29m47.json",
        "932064f30186ce745c77dd4c6e25d7b247aea2e496cc33aefe3e884bcda50220",
    ),
    "kp800_sin_time_square": (
        "2026-01-15_10h30m10.json",
        "b642f484cc2928b0b782f09cab7bc30b6d6cbff2097f7b96b420a230a355fe62",
    ),
    "kp800_up_and_down": (
        "2026-01-15_10h30m02.json",
        "4fed9230bf6a345216778f23b34bf92a62126c84188d5a7ec5d742d691e1bcce",
    ),
}
_OURS = {
    "kp100_lift_and_drop": "f2486f5588d4118eb816864adfe59d71465090ef7c73af732456bc32f7912675",
    "kp100_sin_sin": "cc6a8a9901be3511818aede1f9a5b747231f7cbaff3162af697b8028581b7238",
    "kp100_sin_time_square": "74d48dbcedb0074b8b75869875fded1a5868c07b8f97d83158e1a135e0ffe3e4",
    "kp100_up_and_down": "214c9a59e550ccc0260456637ecf442c7d6c2210a83c3706283078d50bf04c76",
    "kp200_lift_and_drop": "3af61a3eec3835b3d3b97d3b6cd7631bd3a930d890c640f1e2a2373c7602c2d5",
    "kp200_sin_sin": "d21cc7c9f0d68fcec740d5a50f2f627f9e8dbc7799b6899cb202f6c4493c52f4",
    "kp200_sin_time_square": "733dcbe586c4acaa5d6d86d764c0763085c1c8a21bb814d8d4fc20676456305d",
    "kp200_up_and_down": "004020ac5a8df364f780d0fbe87cbcd02dc1293e45e02b4e579c745060a29f19",
    "kp400_lift_and_drop": "eeaae1c2aca176315a9750f77d1ca7ec79678d0836a7a3716d85a5ec0f77372a",
    "kp400_sin_sin": "f0a9d48cc470cb0fb286b4a864b0494f05fd2a8a5f222f2716b83bdd2a00a0c0",
    "kp400_sin_time_square": "1feebef1e75fa9bb73f63cd59de854cc37d4ffc43161e71ade6b1d5246c8936e",
    "kp400_up_and_down": "de4e657abd3d0ea15d2648999c4b2471acea4d2e367caabb305cfb7ae234f9d9",
    "kp800_lift_and_drop": "ed843357c4fd00cb93d1e7e064ed1f6db7d005ebd7490e3163afcc9049aab80b",
    "kp800_sin_sin": "fbb024c65193831bdf375b94eb404b82e2f0ca156d53df545099bc0eb23a22ae",
    "kp800_sin_time_square": "c5f9657986d9310d52d4678129e8d603073a85038ea63a2505a7c3725f5dc610",
    "kp800_up_and_down": "b9507ee62bab12b27029be0a48e7379dab613c649f8e8d12bb6eb2278d1c2977",
}


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
    for name, (file, _) in _THEIRS.items():
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
    for name in _OURS:
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
            {f"{_FOLDER}/{file}": sha256 for file, sha256 in _THEIRS.values()},
            _read_theirs,
        ),
        FolderLayout(
            "one folder for each record, five digits",
            {f"{name}/measured.csv": sha256 for name, sha256 in _OURS.items()},
            _read_folders,
        ),
    ),
)
