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
from workbench.machines.published.pneumatic_cylinder import LICENCE, SOURCE, Columns, layouts
from workbench.recordings.datasets import PublishedRecording, PublishedSet

_HELD_OUT = "_5bar"
_DROPPED = 15  # samples at the start, as the publisher does
_WINDOW = 11  # samples, 0.1 s: noise of 0.01 mm becomes one of 0.1 mm/s
_PUBLISHED = {  # SHA-256: by the publisher, in folders
    "NAPN_1bar": (
        "008a31e1007d67b1f0ebd9e6772cfe9e58a65667148e41ba29466deabb5551b9",
        "95c4c58a23dbcf7c19bcdd0702c87089ce0ae3c047cbe9e8ba1fa8f0c110a36b",
    ),
    "NAPN_3bar": (
        "87a0e11e56e8824203f1a2cb161f45a62ece2b95c1c5ad7712218a74035909f2",
        "1e4a070f1e54d4861d29bf6fdcd55cf115475a5b71ac6e485670080e059aa6d4",
    ),
    "NAPN_5bar": (
        "3bf6ec120f435a0e3feee07b4978db80f3d63208974e7c6749e0822270d9618b",
        "0a23c58e1412e5eb02ae60a53aae3f6224608332419f7fa50fea01ac477be137",
    ),
    "NAPN_7bar": (
        "fae7d01899d6111f32b726ab869c89128c572393fb40cc16df9553160c8f25a9",
        "129e3029346f388134713915ec0d87f9a5858436a4ce251de3c1488e3d0b9d29",
    ),
    "O-ring_1bar": (
        "b795d01ad801c0a4222ca0bd4fa561dbbb7a3c87546b0e2cbdc13efc2c9c874b",
        "b72f8823a968ea01941599b19d085ae751febf0d4ef3b2ebf88d5e2887e34d9d",
    ),
    "O-ring_3bar": (
        "d78d5575b6d9dcf57453107bea96b6dd8d59944a9f2df57f448621025115dade",
        "105e4c95909fc7271d85e470c22fc993379a2f13795383f36a0dc6946e2f704f",
    ),
    "O-ring_5bar": (
        "163b266a3ae723b4d3d8be90ad50f3caca390fa5e76ff13a7c5287a1c8502755",
        "f56d6144471cd694db1c1ccef4dfda69c3c1a9d7a83d433a044f2d2e4a8d0abb",
    ),
    "O-ring_7bar": (
        "e3814abff4dae2bfa70a53d925a5990699dc65e5a6472b42d1dad01293de7a35",
        "b079e8dba7d94fd17b4a448e47fd90f453166baddeb9d33605987b5a7f2d0033",
    ),
}


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
    """Slope of a line through each row."""
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
    "Pressure and force are as the publisher converted them; force is that which pushes the piston "
    "in.",
    layouts=layouts(
        ("results_pneumatic-actuator/data/friction", _publisher_columns),
        (
            "one folder for each recording",
            "friction",
            ("time", "stroke", "pressure", "force"),
        ),
        _PUBLISHED,
        _recordings,
    ),
)
