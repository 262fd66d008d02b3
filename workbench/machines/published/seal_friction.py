"""Friction of the seals of a pneumatic cylinder, by force, pressure and stroke.

Protocol: a machine is one seal. Its records at 1, 3 and 7 bar are fitted, that at 5 bar is held
out. Each gives the force from measured pressure, stroke and rate of the stroke, sample by sample;
the area is common to all records, known within 3 %. The model has no states to start from; those
of effects start at rest. Metric: root mean square error of the force, over all samples that are not
set aside: the first 15 are left out, the first second does not count.
"""

from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from workbench.arrays import Vector
from workbench.machines.published import checksums
from workbench.machines.published.pneumatic_cylinder import LICENCE, SOURCE, Columns, layouts
from workbench.recordings.datasets import PublishedRecording, PublishedSet

_HELD_OUT = "_5bar"
_DROPPED = 15  # samples at the start, as the publisher does
_WINDOW = 11  # samples, 0.1 s: noise of 0.01 mm becomes one of 0.1 mm/s


def rate(time: Vector, stroke: Vector) -> Vector:
    """Rate of a stroke, (n,): slope of the line through the samples around each.

    The samples need not be evenly spaced; at the ends the line goes through fewer of them. It
    passes any constant rate unchanged, and a change of rate within 0.1 s.
    """
    beside = _WINDOW // 2
    t, s = (sliding_window_view(values, _WINDOW) for values in (time, stroke))
    slopes = np.empty_like(time)
    slopes[beside:-beside] = _slope(t, s)
    for k in range(beside):
        first, last = slice(0, k + beside + 1), slice(time.size - k - beside - 1, None)
        slopes[k] = _slope(time[None, first], stroke[None, first])[0]
        slopes[-1 - k] = _slope(time[None, last], stroke[None, last])[0]
    return slopes


def _slope(t: Vector, s: Vector) -> Vector:
    centred = t - t.mean(axis=1, keepdims=True)
    slopes: Vector = (centred * s).sum(axis=1) / np.square(centred).sum(axis=1)
    return slopes


def _recordings(name: str, columns: Columns, file: str) -> list[PublishedRecording]:
    seal, pressure = name.removesuffix("bar").rsplit("_", 1)
    size = columns["time"].size
    time, stroke, p, force = (
        columns[channel][_DROPPED:] for channel in ("time", "stroke", "pressure", "force")
    )
    recording = PublishedRecording(
        name,
        f"Ten strokes at {pressure} bar, seal {seal}",
        {
            "time [s]": time,
            "p [bar]": p,
            "s [mm]": stroke,
            "v [mm/s]": rate(time, stroke),
            "F [N]": force,
        },
        file,
        (_DROPPED, size - 1),
        (
            f"the first {_DROPPED} samples are left out, as the publisher does",
            f"v is the slope of a line through {_WINDOW} samples of the stroke around each",
        ),
        held_out=name.endswith(_HELD_OUT),
        machine=seal,
    )
    return [recording]


def _publisher_columns(path: Path) -> Columns:
    # Time in ms; three voltages of sensors; stroke in mm, pressure in bar, force in N.
    time, _, _, _, stroke, pressure, force = np.loadtxt(path).T
    return {"time": time / 1e3, "stroke": stroke, "pressure": pressure, "force": force}


PUBLISHED = PublishedSet(
    title="Force of a pneumatic cylinder of 25 mm bore with two seals, an O-ring and a lip seal "
    "(NAPN), by pressure and stroke",
    source=SOURCE,
    licence=LICENCE,
    recordings="Ten strokes each, at 1, 3, 5 and 7 bar, about 95 samples a second, unevenly. A "
    "machine is one seal: diagnose its recordings at 1, 3 and 7 bar, and hold out that at 5 bar. "
    "Pressure and force are as the publisher converted them; the force pushes the piston in.",
    layouts=layouts(
        ("results_pneumatic-actuator/data/friction", _publisher_columns),
        (
            "one folder for each recording",
            "friction",
            ("time", "stroke", "pressure", "force"),
        ),
        checksums("seal_friction"),
        _recordings,
    ),
)
