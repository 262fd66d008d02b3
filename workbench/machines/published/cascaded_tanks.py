"""Cascaded tanks with overflow, a benchmark of system identification."""

from pathlib import Path

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.csv import read_columns
from workbench.recordings.datasets import FolderLayout, PublishedRecording, PublishedSet

_TITLES = {
    "estimation": "Levels driven by a multisine, record for estimation",
    "test": "Levels driven by another multisine, record for tests",
}
_MAT = "dataBenchmark.mat"


def _recording(
    name: str, pump: Vector, level: Vector, step: float, file: str
) -> PublishedRecording:
    columns = {
        "time [s]": step * np.arange(pump.size, dtype=np.float64),
        "pump [V]": pump,
        "level2 [V]": level,
    }
    rows = (0, pump.size - 1)
    changed = ("time is the number of the sample times 4 s",)
    held_out = name == "test"
    return PublishedRecording(name, _TITLES[name], columns, file, rows, changed, held_out=held_out)


def _read_mat(folder: Path) -> list[PublishedRecording]:
    from scipy.io import loadmat  # takes its time, and nothing else needs it

    content = {name: np.ravel(value) for name, value in loadmat(folder / _MAT).items()}
    step = float(content["Ts"][0])
    return [
        _recording("estimation", content["uEst"], content["yEst"], step, _MAT),
        _recording("test", content["uVal"], content["yVal"], step, _MAT),
    ]


def _read_folders(folder: Path) -> list[PublishedRecording]:
    recordings = []
    for name in _TITLES:
        file = f"{name}/measured.csv"
        columns = read_columns(folder / file, ("time", "pump", "level2"))
        pump, level = columns["pump"].values, columns["level2"].values
        recordings.append(_recording(name, pump, level, 4.0, file))
    return recordings


PUBLISHED = PublishedSet(
    title="Two cascaded tanks that overflow: voltage of the pump, and of the lower tank's level",
    source="M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noel, Cascaded tanks benchmark combining "
    "soft and hard nonlinearities (2016), 4TU.ResearchData, https://doi.org/10.4121/12960104",
    licence="CC BY-SA 4.0",
    recordings="Two records of 1024 samples, 4 s apart, in volts: the pump's voltage, held between "
    "samples, and that of the level of the lower tank, whose sensor ends at 10 V. "
    "The levels at the start are not known, and they are alike in both records. 'estimation' is "
    "to be fitted, 'test' is held out.",
    layouts=(
        FolderLayout(
            "the publisher's own file",
            {_MAT: "cb2f88d4388be4d3f2a24c6402fba804976aac5f2e1f26cda59ea0a38d016eab"},
            _read_mat,
        ),
        FolderLayout(
            "one folder for each record, five digits",
            {
                "estimation/measured.csv": (
                    "7072f517472f12190e1599d0d9f46bbaee04f639b7ea8a19a663dd54a9160d30"
                ),
                "test/measured.csv": (
                    "a4b91dff071f20daa29c3438a958c1a1c82d1d4d3067f530ade14b22f15323e3"
                ),
            },
            _read_folders,
        ),
    ),
)
