"""A circuit that swings as a mass on a stiffening spring does (Silverbox), a benchmark.

Protocol: three of the ten realisations of a multisine are fitted; held out is the noise whose
amplitude grows (the "arrow"), to its end, where it goes beyond what was fitted. Both run freely.
Metric: root mean square error of the output.
"""

from pathlib import Path

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.datasets import FolderLayout, PublishedRecording, PublishedSet

_FILE = "SNLS80mV.csv"
_STEP = 2.0**14 / 1e7  # [s], of a clock of 10 MHz
_ARROW = 40400  # samples
_FIRST, _LENGTH = 40420, 8700  # samples, of the multisine
_FITTED = 3


def sharpened(values: Vector) -> Vector:
    """Values, (n,), between which straight lines have the spectrum of a signal without aliases.

    Lines between samples are a filter of amplitude sinc^2, sinc(x) = sin(pi x)/(pi x), at the
    frequency by the sampling rate. Its inverse reaches 2.5 at half the sampling rate.
    """
    spectrum = np.fft.rfft(values) / np.sinc(np.fft.rfftfreq(values.size)) ** 2
    return np.fft.irfft(spectrum, values.size)


def _read(folder: Path) -> list[PublishedRecording]:
    u, y = np.loadtxt(folder / _FILE, delimiter=",", skiprows=1, usecols=(0, 1)).T
    force = sharpened(u)

    def part(name: str, title: str, first: int, end: int) -> PublishedRecording:
        return PublishedRecording(
            name,
            title,
            {
                "time [s]": _STEP * np.arange(end - first, dtype=np.float64),
                "u [V]": force[first:end],
                "y [V]": y[first:end],
            },
            _FILE,
            (first, end - 1),
            ("the input is sharpened: straight lines between its samples have its spectrum",),
            held_out=name == "arrow",
        )

    starts = [_FIRST + _LENGTH * number for number in range(_FITTED)]
    return [
        *(
            part(f"multisine_{number}", f"Multisine, realisation {number}", first, first + _LENGTH)
            for number, first in enumerate(starts, 1)
        ),
        part("arrow", "Noise of a growing amplitude", 0, _ARROW),
    ]


PUBLISHED = PublishedSet(
    title="A circuit that swings as a mass on a stiffening spring does: its input and output",
    source="T. Wigren, J. Schoukens, Three free data sets for development and benchmarking in "
    "nonlinear system identification, European Control Conference (2013), "
    "https://www.nonlinearbenchmark.org; also in https://github.com/forgi86/pytorch-ident, "
    "examples/statespace/silverbox",
    licence="none stated; free for benchmarks",
    recordings="131072 samples at 610 Hz: noise whose amplitude grows, the arrow, then ten "
    "realisations of a multisine, of which three are to be fitted. The arrow is held out; at its "
    "end it is larger than what was fitted.",
    layouts=(
        FolderLayout(
            "the publisher's own file",
            {_FILE: "ae62d5a91230c10f76e6dd02c8a4fac3c9d4d8a95fbf50e87cb0c4885003e0f1"},
            _read,
        ),
    ),
)
