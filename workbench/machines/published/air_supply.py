"""Air production unit of a metro train, the first hours of MetroPT-3."""

import csv
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.csv import read_columns
from workbench.recordings.datasets import FolderLayout, PublishedRecording, PublishedSet

_CSV, _FOLDER = "original.csv", "20200201/measured.csv"
# A cycle begins ten samples before the compressor starts: what it warms has cooled by then.
_BEGINS = (0, 337, 539, 743, 946)
_ROWS, _FITTED = 1000, 3


def _cut(time: Vector, intake: Vector, pressure: Vector, file: str) -> list[PublishedRecording]:
    pieces = []
    for number, (a, b) in enumerate(pairwise((*_BEGINS, _ROWS)), start=1):
        columns = {
            "time [s]": time[a:b] - time[a],
            "COMP [1]": intake[a:b],
            "reservoir [bar]": pressure[a:b],
        }
        pieces.append(
            PublishedRecording(
                name=f"cycle_{number}",
                title=f"Cycle {number} of the compressor",
                columns=columns,
                file=file,
                rows=(a, b - 1),
                changed=("time from the first row", "cut at cycles", "two of the columns"),
                held_out=number > _FITTED,
            )
        )
    return pieces


def _read_csv(folder: Path) -> list[PublishedRecording]:
    with (folder / _CSV).open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    stamps = [datetime.fromisoformat(row["timestamp"]) for row in rows]
    time = np.array([(stamp - stamps[0]).total_seconds() for stamp in stamps])
    intake, pressure = (
        np.array([float(row[key]) for row in rows]) for key in ("COMP", "Reservoirs")
    )
    return _cut(time, intake, np.round(pressure, 3), _CSV)


def _read_folders(folder: Path) -> list[PublishedRecording]:
    columns = read_columns(folder / _FOLDER, ("time", "COMP", "reservoir"))
    time, intake, pressure = (columns[name].values for name in ("time", "COMP", "reservoir"))
    return _cut(time, intake, pressure, _FOLDER)


PUBLISHED = PublishedSet(
    title="Air production unit of a metro train: pressure of its reservoir, flag of its compressor",
    source="N. Davari, B. Veloso, R. P. Ribeiro, J. Gama, MetroPT-3 Dataset (2023), UCI Machine "
    "Learning Repository 791, https://doi.org/10.24432/C5VW3R",
    licence="CC BY 4.0",
    recordings="The first 1000 rows, 10 s apart: pressure of the reservoir, and COMP, 0 while "
    "the compressor delivers. They are cut into the five cycles of the compressor. The first three "
    "are to be fitted, the last two are held out.",
    layouts=(
        FolderLayout(
            "the first 1000 rows of the publisher's file, as original.csv",
            {_CSV: "717125183bfc0573a6485f9db046461d3ae52775bd56f709c45d8976fe8c650e"},
            _read_csv,
        ),
        FolderLayout(
            "one folder, with time in seconds",
            {_FOLDER: "8b4463cb5f1f7af5f1411ccfc570b7a2379fa319d449ce3a178ee18db8a468fb"},
            _read_folders,
        ),
    ),
)
