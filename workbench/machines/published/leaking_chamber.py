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

from workbench.machines.published import checksums
from workbench.machines.published.pneumatic_cylinder import LICENCE, SOURCE, Columns, layouts
from workbench.recordings.datasets import PublishedRecording, PublishedSet

_BETWEEN = 2.0  # bar: what is above is fitted, what is below is held out
_CLOSED = 0.05  # bar from a sample to the next: as long as air comes in, pressure moves by less


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
        checksums("leaking_chamber"),
        _recordings,
    ),
)
