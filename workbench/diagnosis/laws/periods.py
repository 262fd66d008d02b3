"""Periods in what a model leaves unexplained, along time or along what something has turned."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from workbench.arrays import Matrix, Vector

_LEAST = 5.0  # periods in the longest recording: fewer are a function of time
_FINE = 4  # frequencies within that which a recording just tells apart
_RESOLVED = 0.4  # periods in a block, of which its mean has three quarters (sinc)
_AT_ONCE = 256  # frequencies: some hundred megabytes


@dataclass(frozen=True)
class Period:
    """The strongest period."""

    length: float  # in the unit of the clock
    tried: float  # frequencies that recordings tell apart, among which it is the strongest


def strongest_period(
    errors: Sequence[Matrix], clocks: Sequence[Vector], lasting: int
) -> Period | None:
    """The period that errors have most of, whatever its phase in each recording.

    Sum over recordings and channels of the periodogram of N. R. Lomb (1976), Astrophys. Space Sci.
    39, 447-462, of evenly weighted samples: in white noise each part is chi-squared of two degrees
    of freedom.

    Parameters
    ----------
    errors : (b, c) whitened, of the blocks of each recording.
    clocks : (b,) what goes on along them, never backwards.
    lasting : blocks; what is slower is taken away beforehand.

    Returns
    -------
    period : None where no recording has enough periods that its blocks resolve.
    """
    fast = [error - uniform_filter1d(error, lasting, axis=0, mode="nearest") for error in errors]
    rates = [np.gradient(clock) for clock in clocks]
    longest = max(float(np.ptp(clock)) for clock in clocks)
    slow = float(np.quantile(np.concatenate(rates), 0.25))
    if longest <= 0.0 or slow <= 0.0:
        return None
    low, high = _LEAST / longest, _RESOLVED / slow
    if high <= low:
        return None
    tried = (high - low) * longest
    grid = np.linspace(low, high, int(_FINE * tried) + 2)
    best = grid[np.argmax(_power(grid, fast, clocks, rates))]
    step = grid[1] - grid[0]
    near = np.linspace(best - step, best + step, 41)
    best = near[np.argmax(_power(near, fast, clocks, rates))]
    return Period(float(1.0 / best), tried)


def _power(
    frequencies: Vector, errors: Sequence[Matrix], clocks: Sequence[Vector], rates: Sequence[Vector]
) -> Vector:
    """Sum of all periodograms, (f,)."""
    spectrum = np.zeros(frequencies.size)
    for own, clock, rate in zip(errors, clocks, rates, strict=True):
        for first in range(0, frequencies.size, _AT_ONCE):
            some = frequencies[first : first + _AT_ONCE, None]
            wave = np.exp(2j * np.pi * some * clock) * (some * rate <= _RESOLVED)
            count = np.maximum(1, np.count_nonzero(wave, axis=1))
            power = 2.0 * np.square(np.abs(wave @ own)).sum(axis=1) / count
            spectrum[first : first + _AT_ONCE] += power
    return spectrum
