"""A brake stop as recorders would have saved it: files made by the libraries of their formats."""

import datetime
import gzip
import json
import warnings
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import xlwt
from asammdf import MDF
from asammdf import Signal as Logged
from matio import save_to_mat
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

from workbench.recordings.case import Case
from workbench.system.system import System

BEGAN = datetime.datetime(2024, 3, 1, 8, 15, tzinfo=datetime.UTC)
DIGITS = 6  # after the decimal point, in files of text


def recorded(case: Case, system: System) -> dict[str, tuple[str, np.ndarray]]:
    """What a recorder has of a stop: names and units as laboratories use them."""
    km_h = 3.6 * system.values["rW"], 3.6 * system.values["rR"]
    return {
        "Zeit": ("s", case.time),
        "Bremsdruck": ("bar", case["pB"] / 1e5),
        "Antriebsmoment": ("kNm", case["tauR"] / 1e3),
        "v_Rad": ("km/h", case["omegaW"] * km_h[0]),
        "v_Rolle": ("km/h", case["omegaR"] * km_h[1]),
        "Längskraft": ("kN", case["Fx"] / 1e3),
        "Temperatur": ("°C", np.full(case.time.size, 25.5)),
    }


Columns = dict[str, tuple[str, np.ndarray]]


def german(value: float) -> str:
    return f"{value:.{DIGITS}f}".replace(".", ",")


def rows(columns: Columns, mark: str, cell: Callable[[float], str]) -> list[str]:
    table = zip(*(values for _, values in columns.values()), strict=True)
    return [mark.join(map(cell, row)) for row in table]


def point(value: float) -> str:
    return f"{value:.{DIGITS}f}"


def csv_of_a_german_rig(path: Path, columns: Columns) -> None:
    """Preamble, units in a second row, Latin-1, decimal commas, a last line."""
    units = ";".join(unit for unit, _ in columns.values())
    head = ["Prüfstand 3; Radsatz", "Prüfer: Müller", "", ";".join(columns), units]
    lines = [*head, *rows(columns, ";", german), "Ende der Messung"]
    path.write_bytes("\r\n".join(lines).encode("latin-1"))


def csv_with_comments(path: Path, columns: Columns) -> None:
    """As numpy saves it: the header is a comment, units in round brackets; packed."""
    names = ",".join(f"{name} ({unit})" for name, (unit, _) in columns.items())
    text = "\n".join(["# Prüfstand 3", f"# {names}", *rows(columns, ",", point)])
    path.write_bytes(gzip.compress(text.encode()))


def csv_with_stamps(path: Path, columns: Columns) -> None:
    """Time stamps of ISO 8601, tabs, UTF-8 with a mark, no units of time."""
    stamps = [
        (BEGAN + datetime.timedelta(seconds=float(t))).isoformat(timespec="milliseconds")
        for t in columns["Zeit"][1]
    ]
    others = {name: column for name, column in columns.items() if name != "Zeit"}
    names = "\t".join(["Zeitstempel", *(f"{n} [{unit}]" for n, (unit, _) in others.items())])
    held = [f"{stamp}\t{row}" for stamp, row in zip(stamps, rows(others, "\t", point), strict=True)]
    path.write_bytes("\n".join([names, *held]).encode("utf-8-sig"))


def csv_with_days_and_clocks(path: Path, columns: Columns) -> None:
    """A column of days and one of times, over midnight, in UTF-16."""
    begin = datetime.datetime(2024, 2, 29, 23, 59, 50)
    moments = [begin + datetime.timedelta(seconds=float(t)) for t in columns["Zeit"][1]]
    stamps = [f"{m:%d.%m.%Y};{m:%H:%M:%S},{m.microsecond // 1000:03d}" for m in moments]
    others = {name: column for name, column in columns.items() if name != "Zeit"}
    names = ";".join(["Datum", "Uhrzeit", *(f"{n} in {unit}" for n, (unit, _) in others.items())])
    held = [f"{stamp};{row}" for stamp, row in zip(stamps, rows(others, ";", german), strict=True)]
    path.write_bytes("\n".join([names, *held]).encode("utf-16"))


def csv_of_indices(path: Path, columns: Columns) -> None:
    """No times at all; a rate in the preamble."""
    others = {name: column for name, column in columns.items() if name != "Zeit"}
    step = float(np.median(np.diff(columns["Zeit"][1])))
    names = ";".join(["Index", *(f"{n} [{unit}]" for n, (unit, _) in others.items())])
    held = [f"{k};{row}" for k, row in enumerate(rows(others, ";", german))]
    path.write_text("\n".join([f"Abtastrate: {1 / step:g} Hz", names, *held]))


def workbook(path: Path, columns: Columns) -> None:
    """Dates as Excel has them, units in a second row, and a sheet with notes."""
    book = openpyxl.Workbook()
    book.active.append(["Prüfer", "Müller"])
    sheet = book.create_sheet("Daten")
    sheet.append(["Messung 8"])
    sheet.append([])
    others = {name: column for name, column in columns.items() if name != "Zeit"}
    sheet.append(["Zeitstempel", *others])
    sheet.append(["", *(unit for unit, _ in others.values())])
    begin = BEGAN.replace(tzinfo=None)
    for k, t in enumerate(columns["Zeit"][1]):
        moment = begin + datetime.timedelta(seconds=round(float(t), 3))
        sheet.append([moment, *(float(values[k]) for _, values in others.values())])
    book.save(path)


def old_workbook(path: Path, columns: Columns) -> None:
    """A sheet of Excel 97 with dates, and units in a second row."""
    book = xlwt.Workbook()
    sheet = book.add_sheet("Daten")
    days = columns["Zeit"][1] / 86400.0 + 45352.0
    dates = xlwt.easyxf(num_format_str="YYYY-MM-DD HH:MM:SS.000")
    for j, (name, (unit, values)) in enumerate(columns.items()):
        sheet.write(0, j, name)
        sheet.write(1, j, "" if name == "Zeit" else unit)
        for i, value in enumerate(days if name == "Zeit" else values):
            sheet.write(i + 2, j, float(value), *([dates] if name == "Zeit" else []))
    book.save(str(path))


def json_of_records(path: Path, columns: Columns) -> None:
    """A record for each sample, with the units beside them."""
    table = zip(*(values.tolist() for _, values in columns.values()), strict=True)
    records = [dict(zip(columns, row, strict=True)) for row in table]
    units = {name: unit for name, (unit, _) in columns.items()}
    path.write_text(json.dumps({"units": units, "records": records}))


def timetable(path: Path, columns: Columns) -> None:
    """A timetable of MATLAB, with durations."""
    times = pd.Index(pd.to_timedelta(columns["Zeit"][1], unit="s").to_numpy(), name="Zeit")
    others = {name: column for name, column in columns.items() if name != "Zeit"}
    held = {
        f"{name} [{unit}]".replace("ä", "ae"): values for name, (unit, values) in others.items()
    }
    frame = pd.DataFrame(held, index=times)
    with warnings.catch_warnings(action="ignore"):  # of the units that durations have in MATLAB
        save_to_mat(path, {"T": frame}, version="v7", do_compression=False)


def parquet(path: Path, columns: Columns) -> None:
    """Units in the metadata of the columns, times in milliseconds."""
    fields = [
        pa.field(name, pa.float64(), metadata={"unit": "ms" if name == "Zeit" else unit})
        for name, (unit, _) in columns.items()
    ]
    arrays = [v * 1e3 if n == "Zeit" else v for n, (_, v) in columns.items()]
    pq.write_table(pa.table(arrays, schema=pa.schema(fields)), path)


def mat_5(path: Path, columns: Columns) -> None:
    """A structure for each channel; times from an origin of their own."""
    content = {
        name.replace("ä", "ae"): {"data": values + 1e5 * (name == "Zeit"), "unit": unit}
        for name, (unit, values) in columns.items()
    }
    savemat(path, content)


def mat_73(path: Path, columns: Columns) -> None:
    """HDF5 as MATLAB lays it out: rows for columns, texts as codes, a mark in a block before it."""

    def add(group: h5py.Group, name: str, matlab_class: str, data: np.ndarray) -> None:
        group.create_dataset(name, data=data).attrs["MATLAB_class"] = np.bytes_(matlab_class)

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, (unit, values) in columns.items():
            ascii_name = name.replace("ä", "ae")
            add(file, ascii_name, "double", values.reshape(1, -1))
            codes = np.array([[ord(character)] for character in unit], dtype=np.uint16)
            add(file, f"{ascii_name}_unit", "char", codes)
    content = bytearray(path.read_bytes())
    mark = b"MATLAB 7.3 MAT-file, Platform: GLNXA64"
    content[: len(mark)] = mark
    path.write_bytes(content)


def mdf_4(path: Path, columns: Columns) -> None:
    """Two groups with rates of their own: the pressure has every fifth sample."""
    times = columns["Zeit"][1]
    with MDF(version="4.10") as file:
        file.start_time = BEGAN
        fast = [
            Logged(values, times, name=name, unit=unit)
            for name, (unit, values) in columns.items()
            if name not in ("Zeit", "Bremsdruck")
        ]
        file.append(fast, acq_name="fast")
        unit, values = columns["Bremsdruck"]
        # The last sample, too: nothing is known of the pressure after it.
        kept = np.unique([*range(0, times.size, 5), times.size - 1])
        file.append([Logged(values[kept], times[kept], name="Bremsdruck", unit=unit)])
        file.save(path, overwrite=True)


def tdms(path: Path, columns: Columns) -> None:
    """Waveforms: no channel of times, but a begin and a step."""
    step = float(np.median(np.diff(columns["Zeit"][1])))
    stated = {"wf_increment": step, "wf_start_time": np.datetime64(BEGAN.replace(tzinfo=None))}
    with TdmsWriter(path) as file:
        file.write_segment(
            [
                ChannelObject("Messung", name, values, {"unit_string": unit, **stated})
                for name, (unit, values) in columns.items()
                if name != "Zeit"
            ]
        )


FORMATS = {
    "german.csv": csv_of_a_german_rig,
    "comments.csv.gz": csv_with_comments,
    "stamps.txt": csv_with_stamps,
    "midnight.csv": csv_with_days_and_clocks,
    "indices.csv": csv_of_indices,
    "workbook.xlsx": workbook,
    "old.xls": old_workbook,
    "records.json": json_of_records,
    "timetable.mat": timetable,
    "table.parquet": parquet,
    "structures.mat": mat_5,
    "new.mat": mat_73,
    "logger.mf4": mdf_4,
    "labview.tdms": tdms,
}
