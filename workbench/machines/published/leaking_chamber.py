"""Pressure of closed chambers, most of them printed, that leak.

Protocol: a machine is one chamber. From where the supply is closed, the first fall of more than 50
mbar between two samples, to where it reaches 2 bar it is fitted; what is below is held out. Both
are simulated freely from the closing on, without an input, in steps of the samples; the pressure
there is as read, within what the sensor leaves open, and the air has the temperature of the walls.
Metric: root mean square error of the pressure, over all samples above and below 2 bar. Chambers
that never fall to 2 bar have no record that is held out.
"""

from pathlib import Path

import numpy as np

from workbench.machines.published.pneumatic_cylinder import LICENCE, SOURCE, Columns, layouts
from workbench.recordings.datasets import PublishedRecording, PublishedSet

_BETWEEN = 2.0  # bar: what is above is fitted, what is below is held out
_CLOSED = 0.05  # bar from a sample to the next: as long as air comes in, pressure moves by less
_PUBLISHED = {  # SHA-256: by the publisher, in folders
    "Aluminium": (
        "5580b794ef9c83fa8123537de5f9dec87df0f0e4631f8a0f8294ddff2debb667",
        "31288eecacd270cde69c6c9184c207c0c50869d1de9a7e961788f6a511df1fe0",
    ),
    "Formlabs": (
        "a5314aac7deff4828ee2a3899d159f1f47172dc2ac96cf0354aa5f488a50a6b8",
        "cafd72e55725d5756d2adf471580837128567e5540064e4333002fa3ab5d4906",
    ),
    "Prusa": (
        "8296b3f1b7b8e80dffb23623be4063322c19e8f61fa955931ef305b56b722e7c",
        "2914ccd0b4ac5e7fcff2185393c6c2f7ec7676f0cb9d6098a10d403964eb46ae",
    ),
    "Ultimaker_015": (
        "b8991631f490eaa424c655c919f57050aa3c4e8d3cc5f36d6ca20780ba1f27d3",
        "016eadff37c9ac754094de7c12025d4bbe0432fa9f90b78a6cf624a524b494ad",
    ),
    "Ultimaker_020": (
        "cdcad454a471ed2a098c81e584f9419350ec19343f0b1dc17b4c59d6b5f4e6a5",
        "9a053a030b8e0674991e6e3aa599f5124e56d370fb13ca26c36dbc8b072d5fb8",
    ),
}


def _recordings(name: str, columns: Columns, file: str) -> list[PublishedRecording]:
    """What a chamber shows above and, if it falls so far, below the pressure between."""
    time, pressure = columns["time"], columns["pressure"]
    falls = np.flatnonzero(np.diff(pressure) < -_CLOSED)
    first = int(falls[0]) + 1 if falls.size else 0
    low = pressure[first:] < _BETWEEN
    middle = first + int(np.argmax(low)) if low.any() else pressure.size
    changed = ["time counts from the first sample that is kept"]
    if first:
        changed.append(f"left out: {first} samples, until the supply is closed")
    time = time - time[first]

    def until(end: int, part: str, begin: float | None = None) -> PublishedRecording:
        kept = slice(first, end)
        return PublishedRecording(
            f"{name}_{part}",
            f"Chamber {name}, {part} {_BETWEEN:g} bar",
            {"time [s]": time[kept], "p [bar]": pressure[kept]},
            file,
            (first, end - 1),
            tuple(changed),
            held_out=begin is not None,
            machine=name,
            counts_from=begin,
        )

    above = until(middle, "above")
    if middle == pressure.size:
        return [above]
    return [above, until(pressure.size, "below", float(time[middle]))]


def _publisher_columns(path: Path) -> Columns:
    rows = [line.split(";") for line in path.read_text().splitlines()]
    # Time in ms, "3.066.000": all points but the last stand between thousands.
    time = np.array([float(row[0].replace(".", "")) / 1e6 for row in rows])
    return {"time": time, "pressure": np.array([float(row[2]) for row in rows])}


PUBLISHED = PublishedSet(
    title="Pressure of closed chambers: one of aluminium, and printed ones",
    source=SOURCE,
    licence=LICENCE,
    recordings="Five chambers, filled to about 7.5 bar and closed, ten samples a second as "
    "published. A machine is one chamber: diagnose what it shows above 2 bar, and hold out what it "
    "shows below, to which what is above leads without being counted; three of them never fall so "
    "far.",
    layouts=layouts(
        ("appendix_compressed-air_chamber/data", _publisher_columns),
        (
            "one folder for each chamber, with one sample a second",
            "chamber",
            ("time", "pressure"),
        ),
        _PUBLISHED,
        _recordings,
    ),
)
