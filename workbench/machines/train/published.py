"""A train of two vehicles: what its own computer records of a stop, with the file of its track.

A folder holds a folder for each stop: `case.toml` with what the crew knows, `measured.csv`, and
`track.csv` with gradients and radii of curves along the line.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.recordings.csv import read_columns
from workbench.recordings.datasets import FolderLayout, PublishedRecording, PublishedSet
from workbench.system.tables import Table, read_table
from workbench.system.units import si_factor

_CASE = "case.toml"
_STEP = 0.1  # of a case [s]
_PRESSURES = ("pB1", "pB2", "pB3", "pB4")
_SPEEDS = tuple(f"omega{axle}" for axle in range(1, 9))
_INTERMITTENT = "vGNSS"  # new at 10 Hz, then held
_ASKED = "pressure_full_load"  # of the brake; a recording need not say so
_NONE: Mapping[str, str] = {}
_MIDDLES = (10.75, 37.15)  # of the vehicles, behind the first axle [m]
_CURVE = 0.6  # resistance over weight, times the radius [m]


def _read(folder: Path) -> list[PublishedRecording]:
    recordings = [_recording(path.parent) for path in sorted(folder.glob(f"*/{_CASE}"))]
    if not recordings:
        raise InputError(
            where=str(folder),
            found="no folder with a case.toml",
            expected="a folder for each stop, with what the train's computer wrote",
            remedy="give the folder that holds them",
        )
    return recordings


def _recording(folder: Path) -> PublishedRecording:
    document = read_table(folder / _CASE, "describe the stop", 'title = "..."')
    conditions = document.table("conditions")
    measured = folder / document.table("measurement").take("file", str)
    signals = dict.fromkeys(_PRESSURES, "Pa") | dict.fromkeys(_SPEEDS, "rad/s") | {"a": "m/s2"}
    read = _columns(measured, {"time": "s", **signals, "s": "m"}, {_INTERMITTENT: "m/s"})
    steps = np.diff(read["time"])
    if not (steps.size and (steps > 0.0).all()):
        raise InputError(
            where=str(measured),
            found="times that do not increase" if steps.size else "one sample",
            expected="strictly increasing time",
            remedy="take the recording from the train again",
        )
    size = max(1, round(_STEP / float(np.median(steps))))
    intermittent = read.pop(_INTERMITTENT, None)
    means = {name: _means(values, size) for name, values in read.items()}
    columns = {"time [s]": means["time"]}
    columns |= {f"{name} [{unit}]": means[name] for name, unit in signals.items()}
    if intermittent is not None:
        values = _interpolate(read["time"], intermittent, means["time"])
        columns[f"{_INTERMITTENT} [m/s]"] = values
    masses = np.array([conditions.number(f"mass{k}", "kg") for k in (1, 2)])
    slopes, curves = _along(folder / document.table("track").take("file", str), means["s"])
    for k, (mass, slope) in enumerate(zip(masses, slopes, strict=True), 1):
        columns[f"mass{k} [kg]"] = np.full(slope.size, mass)
        columns[f"slope{k} [1]"] = slope
    columns["curve [1]"] = masses @ curves / masses.sum()
    return PublishedRecording(
        folder.name,
        document.take("title", str),
        columns,
        f"{folder.name}/{measured.name}",
        (0, read["time"].size - 1),
        (
            f"means of {size} samples",
            "gradients and curves from the track file, at the middles of the vehicles",
            "satellite speed in lines between its samples, empty where it has none",
        ),
        {"rail": conditions.take("rail", str)} | _asked(conditions),
        date=conditions.text("date", ""),
    )


def _asked(conditions: Table) -> dict[str, str]:
    if _ASKED not in conditions:
        return {}
    return {_ASKED: f"{conditions.number(_ASKED, 'Pa'):.9g} Pa"}


def _columns(
    file: Path, needed: Mapping[str, str], optional: Mapping[str, str] = _NONE
) -> dict[str, Vector]:
    """Columns of a file, by name, in these units; optional ones may lack fields, or all."""
    columns = read_columns(file, list(needed), list(optional), list(optional))
    units = {name: unit for name, unit in {**needed, **optional}.items() if name in columns}
    where = f"{file}, line 1, column"
    return {
        name: columns[name].values * si_factor(columns[name].unit, unit, f"{where} '{name}'")
        for name, unit in units.items()
    }


def _means(values: Vector, size: int) -> Vector:
    """Means of so many samples each; what is left over is dropped."""
    means: Vector = values[: values.size // size * size].reshape(-1, size).mean(axis=1)
    return means


def _interpolate(time: Vector, values: Vector, at: Vector) -> Vector:
    """A signal that is new every 0.1 s and then held, (k,), in lines between its samples.

    A line from or to a sample that is missing is missing.
    """
    new = np.flatnonzero(np.diff(np.floor(time / _STEP + 1e-6), prepend=-1.0) > 0.0)
    values_at: Vector = np.interp(at, time[new], values[new], right=np.nan)
    return values_at


def _along(file: Path, position: Vector) -> tuple[Matrix, Matrix]:
    """Gradient, and resistance of curves over weight, under each vehicle, (2, n)."""
    track = _columns(file, {"position": "m", "gradient": "1", "radius": "m"})
    rows = track["position"]
    at = position - np.array(_MIDDLES)[:, None]
    slopes: Matrix = np.interp(at, rows, track["gradient"])
    radius = track["radius"][np.clip(np.searchsorted(rows, at, "right") - 1, 0, None)]
    curves: Matrix = np.divide(_CURVE, radius, out=np.zeros_like(radius), where=radius > 0.0)
    return slopes, curves


PUBLISHED = PublishedSet(
    title="Stops of a train of two vehicles, four axles each: pressures, axle speeds, acceleration",
    source="the train's own computer; any folder of stops in its format",
    licence="that of the train's owner",
    recordings="Each stop begins with 20 to 30 s of coasting and ends after standstill. A folder "
    "holds stops of one train.",
    layouts=(
        FolderLayout("one folder for each stop", {}, _read, pattern="*/*", read_one=_recording),
    ),
)
