"""Tables of a result as compressed columns: an eighth of the room of a CSV, in a NumPy archive.

Neighbouring samples of a column are alike. Each number becomes a multiple k of the column's
quantum, and what compresses are the second differences of these multiples:

    value = quantum · k,    d = Δ(Δ k),    stored: 2 d for d >= 0, -2 d - 1 for d < 0

byte by byte, the lowest bytes of all samples first, as most others are zero.
"""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.runtime.files import replacing

if TYPE_CHECKING:
    import pandas as pd

# Of a quantum below the median magnitude of its column, in powers of two: 5e-7 of it, six digits.
# A sensor has three to four. The first column is the time, which no sample may lose.
_DIGITS, _TIME_DIGITS = 21, 50
_UNKNOWN = -(2**62)  # multiple that stands for NaN
_QUANTA = "quanta"


def pack_estimates(table: Mapping[str, Vector], path: Path) -> None:
    """Write columns (n,), of which the first is the time; see `read_estimates`."""
    quanta = []
    with replacing(path) as stream, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:

        def add(name: str, values: NDArray[np.generic]) -> None:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, values, allow_pickle=False)

        for place, (name, column) in enumerate(table.items()):
            values = np.asarray(column, float)
            multiples, quantum = _multiples(values, _DIGITS if place else _TIME_DIGITS)
            quanta.append(quantum)
            add(name, _packed(multiples))
        add(_QUANTA, np.array(quanta))


def read_estimates(path: Path) -> "pd.DataFrame":
    """Read the table that `pack_estimates` wrote: (n,) numbers in each column, of six digits."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            *names, last = archive.files
            if last != _QUANTA or len(names) != archive[last].size:
                raise ValueError("other entries")
            columns = {
                name: _values(archive[name], quantum)
                for name, quantum in zip(names, archive[last], strict=True)
            }
    except Exception as error:  # a damaged archive fails in many ways, another one in more
        damaged = "a damaged file, or one of another kind"
        raise InputError(
            where=str(path),
            found=damaged if Path(path).exists() else "no such file",
            expected="estimates that 'workbench simulate' wrote, NAME.npz",
            remedy="pass one, or run 'workbench simulate' again",
        ) from error
    import pandas as pd  # takes its time, and what only writes needs it not

    return pd.DataFrame(columns)


def _multiples(values: Vector, digits: int) -> tuple[NDArray[np.int64], float]:
    """Multiples (n,) and their quantum; a quantum of zero stands for the bits of the numbers.

    Those are kept where a column has infinite numbers, or such that no quantum serves all.
    """
    known = np.isfinite(values)
    magnitudes = np.abs(values[known & (values != 0.0)])
    exponent = -int(np.frexp(np.median(magnitudes))[1] if magnitudes.size else 0) + digits
    with np.errstate(over="ignore"):
        scaled = np.rint(np.ldexp(np.where(known, values, 0.0), exponent))
    quantum = float(np.ldexp(1.0, -exponent))
    if np.isinf(values).any() or not quantum or np.abs(scaled).max(initial=0.0) >= -_UNKNOWN:
        return values.copy().view(np.int64), 0.0
    return np.where(known, scaled, _UNKNOWN).astype(np.int64), quantum


def _packed(multiples: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Bytes (8, n) of second differences, which wrap as their sums do."""
    steps = np.diff(multiples, 2, prepend=np.zeros(2, np.int64))
    return ((steps << 1) ^ (steps >> 63)).astype("<i8").view(np.uint8).reshape(-1, 8).T.copy()


def _values(packed: NDArray[np.uint8], quantum: float) -> Vector:
    folded = packed.T.copy().view("<u8").ravel()
    steps = (folded >> 1).astype(np.int64) ^ -(folded & 1).astype(np.int64)
    multiples = np.cumsum(np.cumsum(steps))
    if not quantum:
        return multiples.view(np.float64)
    return np.where(multiples == _UNKNOWN, np.nan, quantum * multiples)
