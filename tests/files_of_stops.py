"""Several stops in one file, a sheet or a group for each, by the libraries of their formats."""

import datetime
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
from asammdf import MDF
from asammdf import Signal as Logged
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

from .recorder_files import BEGAN, Columns

Stops = Mapping[str, Columns]  # by the name of their sheet
PAUSE = 600.0  # s from the begin of a stop to that of the next


def add_sheet(book: openpyxl.Workbook, title: str, columns: Columns) -> None:
    """A table with units in brackets, of times as they are counted."""
    sheet = book.create_sheet(title)
    sheet.append([f"{name} [{unit}]" for name, (unit, _) in columns.items()])
    for row in zip(*(values.tolist() for _, values in columns.values()), strict=True):
        sheet.append(row)


def workbook(path: Path, stops: Stops) -> None:
    """A sheet for each stop, whose times count from its begin."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, columns in stops.items():
        add_sheet(book, title, columns)
    book.save(path)


def workbook_of_stamps(
    path: Path, stops: Stops, pause: float = PAUSE, *, of_day: bool = False
) -> None:
    """A sheet for each stop, with dates a pause after each other [s], or with times of day."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for number, (title, columns) in enumerate(stops.items()):
        begin = BEGAN.replace(tzinfo=None) + datetime.timedelta(seconds=pause * number)
        sheet = book.create_sheet(title)
        others = {name: column for name, column in columns.items() if name != "Zeit"}
        names = (f"{name} [{unit}]" for name, (unit, _) in others.items())
        sheet.append(["Uhrzeit" if of_day else "Zeitstempel", *names])
        for k, t in enumerate(columns["Zeit"][1]):
            moment = begin + datetime.timedelta(seconds=round(float(t), 3))
            stamp = moment.time() if of_day else moment
            sheet.append([stamp, *(float(values[k]) for _, values in others.values())])
    book.save(path)


def mdf_4(path: Path, stops: Stops) -> None:
    """A channel group for each stop, on one clock, one after the other."""
    with MDF(version="4.10") as file:
        file.start_time = BEGAN
        for number, (title, columns) in enumerate(stops.items()):
            times = columns["Zeit"][1] + PAUSE * number
            held = [
                Logged(values, times, name=name, unit=unit)
                for name, (unit, values) in columns.items()
                if name != "Zeit"
            ]
            file.append(held, acq_name=title)
        file.save(path, overwrite=True)


def tdms(path: Path, stops: Stops) -> None:
    """A group of waveforms for each stop, that begin one after the other."""
    with TdmsWriter(path) as file:
        for number, (title, columns) in enumerate(stops.items()):
            begun = np.datetime64(BEGAN.replace(tzinfo=None)) + np.timedelta64(600 * number, "s")
            step = float(np.median(np.diff(columns["Zeit"][1])))
            stated = {"wf_increment": step, "wf_start_time": begun}
            file.write_segment(
                [
                    ChannelObject(title, name, values, {"unit_string": unit, **stated})
                    for name, (unit, values) in columns.items()
                    if name != "Zeit"
                ]
            )


def _identifier(name: str) -> str:
    return name.replace("ä", "ae").replace(" ", "_")


def _structure(columns: Columns) -> dict[str, Any]:
    return {_identifier(n): {"data": v, "unit": unit} for n, (unit, v) in columns.items()}


def mat_5(path: Path, stops: Stops) -> None:
    """A structure for each stop, in it one for each channel."""
    savemat(path, {_identifier(title): _structure(columns) for title, columns in stops.items()})


def mat_5_array(path: Path, stops: Stops) -> None:
    """An array of structures, `stops(1)`, with vectors and their units."""
    held = []
    for columns in stops.values():
        vectors = {_identifier(name): values for name, (_, values) in columns.items()}
        units = {f"{_identifier(name)}_unit": unit for name, (unit, _) in columns.items()}
        held.append({**vectors, **units})
    array = np.empty((1, len(held)), dtype=[(name, "O") for name in held[0]])
    for number, recording in enumerate(held):
        for name, value in recording.items():
            array[0, number][name] = value
    savemat(path, {"stops": array})


def hdf5(path: Path, stops: Stops) -> None:
    """Groups in a group, with units as attributes; the fast channels of each are apart."""
    with h5py.File(path, "w") as file:
        for title, columns in stops.items():
            inner = file.create_group(f"monday/{title}")
            slow = inner.create_group("hydraulics"), ("Bremsdruck", "Temperatur")
            fast = inner.create_group("drive"), set(columns) - set(slow[1])
            for group, names in (slow, fast):
                for name in (
                    "Zeit",
                    *(column for column in columns if column in names and column != "Zeit"),
                ):
                    unit, values = columns[name]
                    group.create_dataset(name, data=values).attrs["unit"] = unit


def mat_73_array(path: Path, stops: Stops) -> None:
    """An array of structures as MATLAB lays it out: of each field a list of references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        hidden, held = file.create_group("#refs#"), file.create_group("stops")
        held.attrs["MATLAB_class"] = np.bytes_("struct")
        fields: dict[str, list[h5py.Reference]] = {}
        for number, columns in enumerate(stops.values()):
            for name, (unit, values) in columns.items():
                codes = np.array([[ord(character)] for character in unit], dtype=np.uint16)
                entries = {"": ("double", values.reshape(1, -1)), "_unit": ("char", codes)}
                for ending, (matlab_class, data) in entries.items():
                    field = f"{_identifier(name)}{ending}"
                    dataset = hidden.create_dataset(f"{field}{number}", data=data)
                    dataset.attrs["MATLAB_class"] = np.bytes_(matlab_class)
                    fields.setdefault(field, []).append(dataset.ref)
        for field, references in fields.items():
            held.create_dataset(field, data=np.array([references], dtype=h5py.ref_dtype))
    content = bytearray(path.read_bytes())
    mark = b"MATLAB 7.3 MAT-file, Platform: GLNXA64"
    content[: len(mark)] = mark
    path.write_bytes(content)


# With what recordings are called in them, of stops called "Stop 1" and "Stop 2".
FORMATS_OF_STOPS = {
    "sheets.xlsx": (workbook, ("Stop 1", "Stop 2")),
    "stamps.xlsx": (workbook_of_stamps, ("Stop 1", "Stop 2")),
    "logger.mf4": (mdf_4, ("Stop 1", "Stop 2")),
    "labview.tdms": (tdms, ("Stop 1", "Stop 2")),
    "structures.mat": (mat_5, ("Stop_1", "Stop_2")),
    "array.mat": (mat_5_array, ("stops/(1)", "stops/(2)")),
    "groups.h5": (hdf5, ("monday/Stop 1", "monday/Stop 2")),
    "new.mat": (mat_73_array, ("stops/(1)", "stops/(2)")),
}
