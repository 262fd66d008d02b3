"""An office of light wood whose heaters are switched at random (FlexHouse).

Protocol: the first 96 hours are fitted. Held out is what follows, 45 hours: the whole record is
simulated, from its start, and only what follows is compared. All runs are free. Metric: root mean
square error of the temperature inside.
"""

from pathlib import Path

import numpy as np

from workbench.recordings.datasets import FolderLayout, PublishedRecording, PublishedSet

_FILE = "inputPRBS1.csv"
_FITTED = 1152  # samples of 5 minutes, 96 hours
_ZERO = 273.15  # [K], of the scale of Celsius


def _read(folder: Path) -> list[PublishedRecording]:
    hours, outside, sun, heating, inside = np.loadtxt(
        folder / _FILE, delimiter=",", skiprows=1, usecols=range(5)
    ).T
    time = 300.0 * np.round(12.0 * hours)

    def until(name: str, title: str, end: int, counts_from: float | None) -> PublishedRecording:
        return PublishedRecording(
            name,
            title,
            {
                "time [s]": time[:end],
                "Ta [K]": outside[:end] + _ZERO,
                "sun [W/m2]": 1e3 * sun[:end],
                "heating [W]": 1e3 * heating[:end],
                "T [K]": inside[:end] + _ZERO,
            },
            _FILE,
            (0, end - 1),
            ("hours, kilowatts and degrees Celsius became s, W and K",),
            held_out=counts_from is not None,
            counts_from=counts_from,
        )

    return [
        until("four_days", "The first 96 hours", _FITTED, None),
        until("rest", "What follows, after these", time.size, float(time[_FITTED])),
    ]


PUBLISHED = PublishedSet(
    title="An office whose heaters are switched at random: power, weather, temperature inside",
    source="P. Bacher, H. Madsen, Identifying suitable models for the heat dynamics of buildings, "
    "Energy and Buildings 43 (2011), 1511-1522; record of the examples of CTSM-R, "
    "https://ctsm.info; also in https://github.com/Nilavro/BSSPy, data",
    licence="none stated; an example for teaching",
    recordings="One record of 1691 samples, 5 minutes apart, February 2009: temperatures inside "
    "and outside, irradiance, power of the heaters. The first 96 hours are to be fitted, the 45 "
    "hours that follow are held out.",
    layouts=(
        FolderLayout(
            "as in BSSPy",
            {_FILE: "291c04d42b5ef234606c17d39aea6153704af7e12ef0698e8e4bda9fab6bf2eb"},
            _read,
        ),
    ),
)
