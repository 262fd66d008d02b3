"""All samples of a figure as text for a page, whose script redraws from them.

Each channel is a row of 16-bit codes between its lowest and highest value, 65535 where there is
none; what is written of a code is its difference from the one before (modulo 2^16, signs folded
into the last bit), low bytes before high ones, compressed by DEFLATE, as base64. The script takes
the same steps back: a value is off by half of 1/65534 of its channel's range at most.
"""

import base64
import json
import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from workbench.fmu import Vector
from workbench.report.figures import CaseFigure

_CODES = 65534
_NONE = 65535
_TICKS = 2**32 - 1  # of the time from the first to the last sample


def packed(figure: CaseFigure) -> tuple[str, str]:
    """All samples of a figure: ranges of the channels as JSON, and their codes.

    The first two channels are the high and the low half of the time in ticks of the whole; then
    come values and, where there are any, halves of bands, curve by curve.
    """
    begin, end = float(figure.time[0]), float(figure.time[-1])
    ticks = np.rint((figure.time - begin) / (end - begin) * _TICKS).astype(np.uint64)
    rows = [(ticks >> 16).astype(np.uint16), (ticks & 0xFFFF).astype(np.uint16)]
    curves: list[list[list[float]]] = []
    for panel in figure.panels:
        for curve in panel.curves:
            ranges = []
            for values in (curve.values, curve.reach):
                if values is not None:
                    codes, low, high = _codes(values)
                    rows.append(codes)
                    ranges.append([low, high])
            curves.append(ranges)
    told = json.dumps({"samples": figure.time.size, "curves": curves}, separators=(",", ":"))
    return told, base64.b64encode(zlib.compress(_planes(rows), 9)).decode()


def _codes(values: Vector) -> tuple[NDArray[np.uint16], float, float]:
    """Codes of a channel, and its lowest and highest value; 0 and 0 where it has none."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(values.size, _NONE, np.uint16), 0.0, 0.0
    low, high = float(values[known].min()), float(values[known].max())
    share = (np.where(known, values, low) - low) / ((high - low) or 1.0)
    return np.where(known, np.rint(share * _CODES), _NONE).astype(np.uint16), low, high


def _planes(rows: Sequence[NDArray[np.uint16]]) -> bytes:
    """Differences of each row, small ones as small numbers, low bytes first."""
    table = np.stack(rows)
    steps = np.diff(table, axis=1, prepend=np.uint16(0)).astype(np.int16).astype(np.int32)
    folded = ((steps << 1) ^ (steps >> 31)).astype(np.uint16)
    return (folded & 0xFF).astype(np.uint8).tobytes() + (folded >> 8).astype(np.uint8).tobytes()
